// The compiled part of the package: nested named tuples in, an Impact out. See library.py.
#include "door.hpp"
#include "python.hpp"

#define WITH_TABLES
#include "table.hpp"
#include "units.hpp"

namespace {

enum Geometry { AUTO_GEOMETRY = 1, POINT, PLANAR, SPATIAL };
enum Precision { AUTO_PRECISION = 1, SINGLE, DOUBLE, EXTENDED };
enum Status { OK = 1, SEPARATING_STATUS = 2, PATH_TOO_LONG = 18, OUT_OF_RANGE = 16, TOLERANCE_NOT_MET = 17, INTERNAL_ERROR = 100 };
constexpr int LAWS = 6, GEOMETRIES = 5, PRECISIONS = 5;

// What Python's side knows, given by setup().
struct Types {
  PyTypeObject *impact, *twist, *vec3, *contact;
  PyObject *statuses, *regimes, *adjustments;  // by number
  PyObject *plan, *decided, *refusal;          // functions
} types;

struct Plan {  // of an ImpactModel
  PyObject* model;
  int law_without_friction, law_with_friction, geometry, first, last;
  double numbers[3], errors[3], wanted;
  PyObject* decided[LAWS][GEOMETRIES][PRECISIONS];
};
constexpr int KEPT = 8;
Plan plans[KEPT];
int next_plan;

// The plan of a model, by what model.py decides. Models are told apart by identity: the last few are kept.
Plan* plan_of(PyObject* model) {
  for (Plan& plan : plans)
    if (plan.model == model) return &plan;
  PyObject* made = PyObject_CallOneArg(types.plan, model);
  if (!made) return nullptr;
  Plan plan{};
  double limit;
  bool read = PyArg_ParseTuple(made, "iiiiidd(ddd)(ddd)", &plan.law_without_friction, &plan.law_with_friction,
                               &plan.geometry, &plan.first, &plan.last, &plan.wanted, &limit, &plan.numbers[0],
                               &plan.numbers[1], &plan.numbers[2], &plan.errors[0], &plan.errors[1],
                               &plan.errors[2]);
  Py_DECREF(made);
  if (!read) return nullptr;
  Plan& place = plans[next_plan++ % KEPT];
  Py_XDECREF(place.model);
  for (auto& of_law : place.decided)
    for (auto& of_geometry : of_law)
      for (PyObject* decided : of_geometry) Py_XDECREF(decided);
  Py_INCREF(model);
  plan.model = model;
  place = plan;
  return &place;
}

PyObject* decided(Plan* plan, int law, int geometry, int precision) {
  PyObject*& place = plan->decided[law][geometry][precision];
  if (!place) place = PyObject_CallFunction(types.decided, "Oiii", plan->model, law, geometry, precision);
  return place;
}

bool read_body(PyObject* body, const Door& door, int i) {
  if (!PyTuple_Check(body) || PyTuple_GET_SIZE(body) != 7) {
    std::string name(door.names[i]);
    name.resize(name.find('.'));
    PyErr_Format(PyExc_TypeError, "%s: must be a Body, is %R", name.c_str(), body);
    return false;
  }
  PyObject* turn = PyTuple_GET_ITEM(body, 3);
  bool read = read_number(PyTuple_GET_ITEM(body, 0), door, i) &&
              read_numbers<6>(PyTuple_GET_ITEM(body, 1), door, i + IN_BODY_A_INERTIA_XX) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 2), door, i + IN_BODY_A_POSITION_X) &&
              (turn == Py_None || read_numbers<4>(turn, door, i + IN_BODY_A_ORIENTATION_X)) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 4), door, i + IN_BODY_A_VELOCITY_X) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 5), door, i + IN_BODY_A_ANGULAR_VELOCITY_X) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 6), door, i + IN_BODY_A_COM_X);
  if (turn == Py_None) {
    double* q = door.x + i + IN_BODY_A_ORIENTATION_X;
    q[0] = q[1] = q[2] = 0;
    q[3] = 1;
  }
  return read;
}

// Restitution that is a function is left out: the caller sees to it.
bool read_contact(PyObject* contact, const Door& door, bool* has_function) {
  if (!PyTuple_Check(contact) || PyTuple_GET_SIZE(contact) != 4) {
    PyErr_Format(PyExc_TypeError, "contact: must be a Contact, is %R", contact);
    return false;
  }
  PyObject* e = PyTuple_GET_ITEM(contact, 2);
  *has_function = !PyFloat_CheckExact(e) && PyCallable_Check(e);
  return read_numbers<3>(PyTuple_GET_ITEM(contact, 0), door, IN_CONTACT_POSITION_X) &&
         read_numbers<3>(PyTuple_GET_ITEM(contact, 1), door, IN_CONTACT_NORMAL_X) &&
         (*has_function || read_number(e, door, IN_CONTACT_RESTITUTION)) &&
         read_number(PyTuple_GET_ITEM(contact, 3), door, IN_CONTACT_FRICTION);
}

PyObject* vector(const double* x) { return tuple_of(types.vec3, x, 3); }
PyObject* twist(const double* x) { return twist_of(types.twist, types.vec3, x); }
PyObject* kept(PyObject* o) {
  Py_INCREF(o);
  return o;
}

// The contact as used.
PyObject* used_contact(PyObject* contact, double e, bool e_changed, bool without_friction) {
  if (!e_changed && !without_friction) return kept(contact);
  PyObject* used = types.contact->tp_alloc(types.contact, 4);
  if (!used) return nullptr;
  for (int k = 0; k < 2; ++k) PyTuple_SET_ITEM(used, k, kept(PyTuple_GET_ITEM(contact, k)));
  PyTuple_SET_ITEM(used, 2, e_changed ? PyFloat_FromDouble(e) : kept(PyTuple_GET_ITEM(contact, 2)));
  PyTuple_SET_ITEM(used, 3, without_friction ? PyFloat_FromDouble(0) : kept(PyTuple_GET_ITEM(contact, 3)));
  return used;
}

PyObject* answer(PyObject* contact, PyObject* model, const double* x, const Numbers& y, double bound, bool frictionless, bool normalised, int status) {
  PyObject* impact = types.impact->tp_alloc(types.impact, 20);
  if (!impact) return nullptr;
  int i = 0;
  auto put = [&](PyObject* o) { PyTuple_SET_ITEM(impact, i++, o); };
  put(kept(PyTuple_GET_ITEM(types.statuses, status)));
  put(used_contact(contact, y.reported[OUT_RESTITUTION], y.flags[FLAG_SLOW], frictionless && x[IN_CONTACT_FRICTION] != 0));
  put(kept(model));
  put(twist(y.reported));
  put(twist(y.reported + 6));
  put(twist(y.change + 3));
  put(twist(y.change + 9));
  put(vector(y.change));
  for (int k = OUT_NORMAL_IMPULSE; k <= OUT_ENERGY_LOST_FRICTION; ++k) put(PyFloat_FromDouble(y.reported[k]));
  put(kept(PyTuple_GET_ITEM(types.regimes, static_cast<int>(y.reported[OUT_REGIME]))));
  put(PyFloat_FromDouble(bound));
  int adjusted = normalised + 2 * y.flags[FLAG_SLOW] + 4 * y.flags[FLAG_FELL_BACK] + 8 * y.flags[FLAG_IDLE_SPIN];
  put(kept(PyTuple_GET_ITEM(types.adjustments, adjusted)));
  return impact;
}

PyObject* refuse(int status) {
  PyObject* error = PyObject_CallFunction(types.refusal, "i", status);
  if (error) PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error)), error);
  Py_XDECREF(error);
  return nullptr;
}

// resolve(body_a, body_b, contact, model): an Impact; or a number that says what is left to Python:
// 0 a fault in the request, 1 restitution is a function, 2 a geometry that leaves something out.
PyObject* resolve(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4) {
    PyErr_SetString(PyExc_TypeError, "resolve() takes two bodies, a contact and a model");
    return nullptr;
  }
  PyObject* contact = args[2];
  Plan* plan = plan_of(args[3]);
  if (!plan) return nullptr;
  double x[INPUTS], error[INPUTS] = {};
  const Door door{x, error, input_names};
  bool has_function;
  if (!read_body(args[0], door, 0) || !read_body(args[1], door, BODY) || !read_contact(contact, door, &has_function)) return nullptr;
  if (has_function) return PyLong_FromLong(1);
  for (int k = 0; k < 3; ++k) {
    x[IN_MODEL_TANGENTIAL_RESTITUTION + k] = plan->numbers[k];
    error[IN_MODEL_TANGENTIAL_RESTITUTION + k] = plan->errors[k];
  }
  double fault;
  bool shapes[5];
  check_request(x, &fault, shapes);
  if (fault != 0 || args[0] == args[1]) return PyLong_FromLong(0);

  int law = x[IN_CONTACT_FRICTION] > 0 ? plan->law_with_friction : plan->law_without_friction;
  bool frictionless = law == LAW_FRICTIONLESS;
  int required = shapes[frictionless ? 0 : 1] ? POINT : shapes[frictionless ? 2 : 3] ? PLANAR : SPATIAL;
  if (plan->geometry != AUTO_GEOMETRY) {
    if (plan->geometry < required) return PyLong_FromLong(2);
    required = plan->geometry;
  }
  Numbers y;
  int precision = plan->first;
  for (;; ++precision) {
    Kernel kernel = kernel_of(law, precision);
    if (!kernel) return PyErr_Format(PyExc_LookupError, "no kernel of law %d", law);
    kernel(x, error, &y);
    if (!(y.error_bound < INFINITY) || is_extreme(y, precision == SINGLE) || !all_finite(y)) {
      Numbers scaled;
      impact_in_other_units(kernel, x, error, scaled);
      bool knows_more = scaled.error_bound < INFINITY || !(y.error_bound < INFINITY);
      if ((all_finite(scaled) && knows_more) || !all_finite(y)) y = scaled;
    }
    if (y.error_bound <= plan->wanted || precision == plan->last) break;
  }
  double bound = y.error_bound;
  if (y.flags[FLAG_UNFINISHED]) return refuse(PATH_TOO_LONG);
  if (y.flags[FLAG_UNPHYSICAL]) return refuse(INTERNAL_ERROR);
  if (!all_finite(y)) {
    if (bound < INFINITY) return refuse(OUT_OF_RANGE);
    return PyLong_FromLong(3);
  }
  PyObject* model = decided(plan, y.flags[FLAG_FELL_BACK] ? LAW_COULOMB : law, required, precision);
  if (!model) return nullptr;
  int status = bound <= plan->wanted ? (y.flags[FLAG_SEPARATING] ? SEPARATING_STATUS : OK) : TOLERANCE_NOT_MET;
  return answer(contact, model, x, y, bound, frictionless, shapes[4], status);
}

// numbers(body_a, body_b, contact): what resolve() reads of them, and the error of each.
PyObject* numbers(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) {
    PyErr_SetString(PyExc_TypeError, "numbers() takes two bodies and a contact");
    return nullptr;
  }
  double x[INPUTS] = {}, error[INPUTS] = {};
  const Door door{x, error, input_names};
  bool has_function;
  if (!read_body(args[0], door, 0) || !read_body(args[1], door, BODY) || !read_contact(args[2], door, &has_function)) return nullptr;
  PyObject *values = PyTuple_New(IN_MODEL_TANGENTIAL_RESTITUTION), *errors = PyTuple_New(IN_MODEL_TANGENTIAL_RESTITUTION);
  for (int i = 0; i < IN_MODEL_TANGENTIAL_RESTITUTION; ++i) {
    PyTuple_SET_ITEM(values, i, PyFloat_FromDouble(x[i]));
    PyTuple_SET_ITEM(errors, i, PyFloat_FromDouble(error[i]));
  }
  return Py_BuildValue("NN", values, errors);
}

// An array that a batch reads or writes.
struct Array {
  Py_buffer view{};
  ~Array() { PyBuffer_Release(&view); }
  bool open(PyObject* o, bool writable) {
    return PyObject_GetBuffer(o, &view, PyBUF_C_CONTIGUOUS | (writable ? PyBUF_WRITABLE : 0)) == 0;
  }
  char* row(Py_ssize_t index, Py_ssize_t columns) const {
    return static_cast<char*>(view.buf) + index * columns * view.itemsize;
  }
  bool overlaps(const Array& other) const {
    auto begin = static_cast<char*>(view.buf), theirs = static_cast<char*>(other.view.buf);
    return begin < theirs + other.view.len && theirs < begin + view.len;
  }
  Py_ssize_t rows(Py_ssize_t columns) const { return columns ? view.len / view.itemsize / columns : 0; }
};

const double zero_double = 0, one_double = 1;
const float zero_float = 0, one_float = 1;

// batch(law, table, number, bodies, contacts, model, velocity, angular_velocity, impulse, error_bound, status,
// from, to): the columns from `from` to `to`, without the GIL. The arrays are contiguous and of the right shapes,
// as resolve_batch.py sees to; results that overlap the tables are refused. The answer is the greatest status and
// the greatest error bound, infinite where one is not a number.
// model holds e_t, the threshold and the tolerance, in the type of the tables.
PyObject* batch(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 13) return PyErr_Format(PyExc_TypeError, "batch() takes 13 arguments");
  int law = static_cast<int>(PyLong_AsLong(args[0])), number = static_cast<int>(PyLong_AsLong(args[2]));
  int place = static_cast<int>(PyLong_AsLong(args[1]));
  long from = PyLong_AsLong(args[11]), to = PyLong_AsLong(args[12]);
  Array bodies, contacts, model, velocity, spin, impulse, bound, status;
  if (PyErr_Occurred() || !bodies.open(args[3], false) || !contacts.open(args[4], false) || !model.open(args[5], false) ||
      !velocity.open(args[6], true) || !spin.open(args[7], true) || !impulse.open(args[8], true) ||
      (args[9] != Py_None && !bound.open(args[9], true)) || !status.open(args[10], true))
    return nullptr;
  for (const Array* input : {&bodies, &contacts})
    for (const Array* result : {&velocity, &spin, &impulse, &bound, &status})
      if (input->overlaps(*result)) return PyErr_Format(PyExc_ValueError, "out: overlaps the input");
  const Table& table = tables[place];
  BatchKernel own = batch_kernel(law, place, number);
  bool general = !own;
  BatchKernel kernel = own ? own : batch_kernel(law, LAYOUT_EVERYTHING, number);
  if (!kernel) return PyErr_Format(PyExc_LookupError, "no kernel of law %d for numbers of kind %d", law, number);

  Py_ssize_t n = status.view.len, contact_rows = contacts.rows(n);
  bool is_double = bodies.view.itemsize == 8;
  const void* zero = is_double ? static_cast<const void*>(&zero_double) : &zero_float;
  const void* one = is_double ? static_cast<const void*>(&one_double) : &one_float;
  Batch given{};
  int row = 0;
  auto put = [&](const void* at, bool for_all) {
    given.row[row] = at;
    given.one_for_all[row++] = for_all;
  };
  auto take = [&](int index, const Array& array, Py_ssize_t step, Py_ssize_t shift, Py_ssize_t rows) {
    if (index >= 0 && index < rows) put(array.row(index * step + shift, n), false);
    else put(index == -2 ? one : zero, true);
  };
  for (int side = 0; side < 2; ++side)
    for (int i = 0; i < (general ? ROWS_OF_BODY : table.body_rows); ++i)
      take(general ? table.body[i] : i, bodies, 2, side, table.body_rows);
  for (int i = 0; i < (general ? ROWS_OF_CONTACT : table.contact_rows); ++i)
    take(general ? table.contact[i] : i, contacts, 1, 0, std::min<Py_ssize_t>(contact_rows, table.contact_rows));
  for (int i = 0; i < ROWS_OF_MODEL; ++i) {
    bool own_row = i == 0 && contact_rows > table.contact_rows;  // e_t of each contact
    put(own_row ? contacts.row(table.contact_rows, n) : model.row(i, 1), !own_row);
  }
  for (int k = 0; k < 3; ++k) {
    for (int side = 0; side < 2; ++side) {
      if (k < table.axes) given.velocity[k][side] = velocity.row(2 * k + side, n);
      if (k >= table.first_spin) given.angular_velocity[k][side] = spin.row(2 * (k - table.first_spin) + side, n);
    }
    if (k < table.axes) given.impulse[k] = impulse.row(k, n);
  }
  given.error_bound = bound.view.buf;
  given.status = static_cast<unsigned char*>(status.view.buf);
  unsigned char most = 0;
  double loosest = 0;
  Py_BEGIN_ALLOW_THREADS;
  if (to > from) kernel(given, from, to);
  for (long at = from; at < to; ++at) most = std::max(most, given.status[at]);
  for (long at = from; given.error_bound && at < to; ++at) {
    double one = static_cast<const double*>(given.error_bound)[at];
    loosest = one <= loosest ? loosest : one - one == 0 ? one : INFINITY;
  }
  Py_END_ALLOW_THREADS;
  return Py_BuildValue("id", most, loosest);
}

// allow_long_vectors(yes): whether batches use them, where there are any. The results are the same.
PyObject* allow_long_vectors(PyObject*, PyObject* yes) {
  may_use_long_vectors = yes == Py_True;
  Py_RETURN_NONE;
}

PyObject* setup(PyObject*, PyObject* args) {
  PyObject *impact, *twist, *vec3, *contact;
  if (!PyArg_ParseTuple(args, "OOOOOOOOOO", &impact, &twist, &vec3, &contact, &types.statuses, &types.regimes, &types.adjustments, &types.plan, &types.decided, &types.refusal)) return nullptr;
  types.impact = reinterpret_cast<PyTypeObject*>(impact);
  types.twist = reinterpret_cast<PyTypeObject*>(twist);
  types.vec3 = reinterpret_cast<PyTypeObject*>(vec3);
  types.contact = reinterpret_cast<PyTypeObject*>(contact);
  Py_INCREF(args);  // keeps all of them for ever
  Py_RETURN_NONE;
}

PyMethodDef methods[] = {
    {"resolve", reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(resolve)), METH_FASTCALL, ""},
    {"numbers", reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(numbers)), METH_FASTCALL, ""},
    {"batch", reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(batch)), METH_FASTCALL, ""},
    {"allow_long_vectors", allow_long_vectors, METH_O, ""},
    {"setup", setup, METH_VARARGS, ""},
    {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_compiled", "", -1, methods};

}  // namespace

PyMODINIT_FUNC PyInit__compiled() { return PyModule_Create(&definition); }
