// The compiled part of the package: nested named tuples in, an Impact out. See library.py.
#define WITH_TABLES
#include "arrays.hpp"
#include "read_numbers.hpp"
#include "contact_pairs.hpp"
#include "kernel_table.hpp"
#include "units.hpp"

namespace {

constexpr int LAWS = LAW_COUNT, GEOMETRIES = 5, PRECISIONS = 5;

PyTypeObject* impact_type;                                    // what module.cpp alone is told by setup(),
PyObject *plan_function, *decided_function, *refusal_function;

struct Plan {  // of an ImpactModel
  PyObject* model;
  int law_without_friction, law_with_friction, geometry, first, last;
  double settings[ROWS_OF_MODEL], errors[ROWS_OF_MODEL], wanted;
  PyObject* decided[LAWS * GEOMETRIES * PRECISIONS];
};
constexpr int KEPT = 8;
Plan plans[KEPT];
int next_plan;

// The plan of a model, by what model.py decides. Models are told apart by identity: the last few are kept.
Plan* plan_of(PyObject* model) {
  for (Plan& plan : plans)
    if (plan.model == model) return &plan;
  PyObject* made = PyObject_CallOneArg(plan_function, model);
  if (!made) return nullptr;
  Plan plan{};
  double limit;
  PyObject *settings, *errors;
  bool read = PyArg_ParseTuple(made, "iiiiiddOO", &plan.law_without_friction, &plan.law_with_friction, &plan.geometry,
                               &plan.first, &plan.last, &plan.wanted, &limit, &settings, &errors);
  for (int k = 0; read && k < ROWS_OF_MODEL; ++k) {
    plan.settings[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(settings, k));
    plan.errors[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(errors, k));
  }
  Py_DECREF(made);
  if (!read) return nullptr;
  Plan& place = plans[next_plan++ % KEPT];
  Py_XDECREF(place.model);
  for (PyObject* decided : place.decided) Py_XDECREF(decided);
  Py_INCREF(model);
  plan.model = model;
  place = plan;
  return &place;
}

PyObject* decided(Plan* plan, int law, int geometry, int precision) {
  PyObject*& place = plan->decided[(law * GEOMETRIES + geometry) * PRECISIONS + precision];
  if (!place) place = PyObject_CallFunction(decided_function, "Oiii", plan->model, law, geometry, precision);
  return place;
}

bool is_articulated(PyObject* body) {
  return PyTuple_Check(body) && PyTuple_GET_SIZE(body) == 8 && PyTuple_GET_ITEM(body, 7) != Py_None;
}

// Of an articulated body no mass, inertia, orientation or centre of mass is read.
bool read_body(PyObject* body, const Door& door, int i) {
  if (!PyTuple_Check(body) || PyTuple_GET_SIZE(body) != 8) {
    std::string name(door.names[i]);
    name.resize(name.find('.'));
    bool is_message = !strcmp(Py_TYPE(body)->tp_name, "BodyState");
    const char* hint = is_message ? "; collision_response.ros.convert.body_of(name, message) makes one" : "; Body.dynamic(...) and Body.static() make one";
    return refuse_kind(name + ": must be a Body,", body, hint);
  }
  PyObject *turn = PyTuple_GET_ITEM(body, 3), *own = PyTuple_GET_ITEM(body, 7);
  bool rigid = own == Py_None;
  if (!rigid) {
    turn = Py_None;
    std::fill_n(door.x + i, BODY, 0.0);
    door.x[i] = INFINITY;
  }
  bool read = (rigid ? read_number(PyTuple_GET_ITEM(body, 0), door, i) &&
                           read_numbers<6>(PyTuple_GET_ITEM(body, 1), door, i + IN_BODY_A_INERTIA_XX)
                     : read_numbers<INVERSE_INERTIA>(own, door, INPUTS + i / BODY * INVERSE_INERTIA)) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 2), door, i + IN_BODY_A_POSITION_X) &&
              (turn == Py_None || read_numbers<4>(turn, door, i + IN_BODY_A_ORIENTATION_X)) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 4), door, i + IN_BODY_A_VELOCITY_X) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 5), door, i + IN_BODY_A_ANGULAR_VELOCITY_X) &&
              (!rigid || read_numbers<3>(PyTuple_GET_ITEM(body, 6), door, i + IN_BODY_A_COM_X));
  if (turn == Py_None) {
    double* q = door.x + i + IN_BODY_A_ORIENTATION_X;
    q[0] = q[1] = q[2] = 0;
    q[3] = 1;
  }
  return read;
}

bool is_function(PyObject* o) { return !PyFloat_CheckExact(o) && PyCallable_Check(o); }

// Coefficients that are functions, and tangential restitution, are left out: the caller sees to them.
bool read_contact(PyObject* contact, const Door& door, bool* has_more) {
  if (!PyTuple_Check(contact) || PyTuple_GET_SIZE(contact) != 5) return refuse_kind("contact: must be a Contact, made by Contact.of(...);", contact);
  PyObject *e = PyTuple_GET_ITEM(contact, 2), *mu = PyTuple_GET_ITEM(contact, 3);
  bool e_by_speed = is_function(e), mu_by_speed = is_function(mu);
  if (e_by_speed) door.x[IN_CONTACT_RESTITUTION] = 1;
  if (mu_by_speed) door.x[IN_CONTACT_FRICTION] = 0;
  *has_more = e_by_speed || mu_by_speed || PyTuple_GET_ITEM(contact, 4) != Py_None;
  return read_numbers<3>(PyTuple_GET_ITEM(contact, 0), door, IN_CONTACT_POSITION_X) &&
         read_numbers<3>(PyTuple_GET_ITEM(contact, 1), door, IN_CONTACT_NORMAL_X) &&
         (e_by_speed || read_number(e, door, IN_CONTACT_RESTITUTION)) &&
         (mu_by_speed || read_number(mu, door, IN_CONTACT_FRICTION));
}

// Two bodies and a contact.
bool read_request(PyObject* const* args, const Door& door, bool* has_more) {
  return read_body(args[0], door, 0) && read_body(args[1], door, BODY) && read_contact(args[2], door, has_more);
}

PyObject* answer(PyObject* contact, PyObject* model, const double* x, const ImpactResult& y, double bound, bool frictionless, bool normalised, bool articulated, int status) {
  PyObject* impact = impact_type->tp_alloc(impact_type, 20);
  if (!impact) return nullptr;
  int i = 0;
  auto put = [&](PyObject* o) { PyTuple_SET_ITEM(impact, i++, o); };
  put(Py_NewRef(PyTuple_GET_ITEM(python_types.statuses, status)));
  put(contact_as_used(contact, y.reported[OUT_RESTITUTION], y.flags[FLAG_BELOW_THRESHOLD], frictionless && x[IN_CONTACT_FRICTION] != 0));
  put(Py_NewRef(model));
  put(make_twist(y.reported));
  put(make_twist(y.reported + 6));
  put(make_twist(y.change + 3));
  put(make_twist(y.change + 9));
  put(make_vec3(y.change));
  for (int k = OUT_NORMAL_IMPULSE; k <= OUT_ENERGY_LOST_FRICTION; ++k) put(PyFloat_FromDouble(y.reported[k]));
  put(Py_NewRef(PyTuple_GET_ITEM(python_types.regimes, static_cast<int>(y.reported[OUT_REGIME]))));
  put(PyFloat_FromDouble(bound));
  int adjusted = normalised * ADJUSTMENT_NORMALISED_ORIENTATION + y.flags[FLAG_BELOW_THRESHOLD] * ADJUSTMENT_RESTITUTION_THRESHOLD +
                 y.flags[FLAG_FELL_BACK] * ADJUSTMENT_LAW_FALLBACK + y.flags[FLAG_MASSLESS_SPIN] * ADJUSTMENT_MASSLESS_SPIN +
                 articulated * ADJUSTMENT_ENERGY_CHANGE_ONLY;
  put(Py_NewRef(PyTuple_GET_ITEM(python_types.adjustments, adjusted)));
  return impact;
}

PyObject* refuse(int status) {
  PyObject* error = PyObject_CallFunction(refusal_function, "i", status);
  if (error) PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error)), error);
  Py_XDECREF(error);
  return nullptr;
}

// resolve(body_a, body_b, contact, model): an Impact, with TOLERANCE_NOT_MET if Python should look for more digits;
// or the number that says why the request is left to Python: see protocol.py.
PyObject* resolve(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4) return PyErr_Format(PyExc_TypeError, "resolve() takes two bodies, a contact and a model");
  PyObject* contact = args[2];
  Plan* plan = plan_of(args[3]);
  if (!plan) return nullptr;
  double x[ALL_INPUTS], error[ALL_INPUTS];
  std::fill_n(error, INPUTS, 0.0);
  bool articulated = is_articulated(args[0]) || is_articulated(args[1]);
  if (articulated) {
    std::fill_n(x + INPUTS, ALL_INPUTS - INPUTS, 0.0);
    std::fill_n(error + INPUTS, ALL_INPUTS - INPUTS, 0.0);
  }
  bool rational = false;
  bool has_more;
  if (!read_request(args, {x, error, input_names, &rational}, &has_more)) return nullptr;
  if (has_more) return PyLong_FromLong(HANDOVER_NOT_ONLY_NUMBERS);
  for (int k = 0; k < ROWS_OF_MODEL; ++k) {
    x[IN_MODEL_TANGENTIAL_RESTITUTION + k] = plan->settings[k];
    error[IN_MODEL_TANGENTIAL_RESTITUTION + k] = plan->errors[k];
  }
  double fault;
  bool shapes[5];
  (articulated ? check_articulated : check_everything)(x, &fault, shapes);
  if (fault != 0 || args[0] == args[1]) return PyLong_FromLong(HANDOVER_INVALID);

  int law = x[IN_CONTACT_FRICTION] > 0 ? plan->law_with_friction : plan->law_without_friction;
  bool frictionless = law == LAW_FRICTIONLESS;
  int required = shapes[frictionless ? 0 : 1] ? GEOMETRY_POINT : shapes[frictionless ? 2 : 3] ? GEOMETRY_PLANAR : GEOMETRY_SPATIAL;
  if (plan->geometry != GEOMETRY_AUTO) {
    if (plan->geometry < required) return PyLong_FromLong(HANDOVER_GEOMETRY_TOO_SMALL);
    required = plan->geometry;
  }
  if (rational && frictionless && !articulated) return PyLong_FromLong(HANDOVER_RATIONAL);
  ImpactResult y;
  int used;
  for (int precision = plan->first;; ++precision) {
    used = precision;
    ImpactKernel kernel = kernel_of(law, articulated, used);
    if (!kernel) return PyErr_Format(PyExc_LookupError, "no kernel of law %d", law);
    kernel(x, error, &y);
    if (!(y.error_bound < INFINITY) || is_extreme(y, used == PRECISION_SINGLE) || !all_finite(y)) {
      ImpactResult scaled;
      impact_in_other_units(kernel, articulated, x, error, scaled);
      bool knows_more = scaled.error_bound < INFINITY || !(y.error_bound < INFINITY);
      if ((all_finite(scaled) && knows_more) || !all_finite(y)) y = scaled;
    }
    if (y.error_bound <= plan->wanted || precision == plan->last) break;
  }
  double bound = y.error_bound;
  if (y.flags[FLAG_UNFINISHED]) return refuse(STATUS_PATH_TOO_LONG);
  if (y.flags[FLAG_UNPHYSICAL]) return refuse(STATUS_INTERNAL_ERROR);
  if (!all_finite(y)) {
    if (bound < INFINITY) return refuse(STATUS_OUT_OF_RANGE);
    return PyLong_FromLong(HANDOVER_NOTHING_KNOWN);
  }
  PyObject* model = decided(plan, y.flags[FLAG_FELL_BACK] ? LAW_COULOMB : law, required, used);
  if (!model) return nullptr;
  int status = bound <= plan->wanted ? (y.flags[FLAG_SEPARATING] ? STATUS_SEPARATING : STATUS_OK) : STATUS_TOLERANCE_NOT_MET;
  return answer(contact, model, x, y, bound, frictionless, shapes[4], articulated, status);
}

// numbers_with_errors(body_a, body_b, contact): what resolve() reads of them, and the error of each.
PyObject* numbers_with_errors(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) return PyErr_Format(PyExc_TypeError, "numbers_with_errors() takes two bodies and a contact");
  double x[ALL_INPUTS] = {}, error[ALL_INPUTS] = {};
  bool has_more;
  if (!read_request(args, {x, error, input_names}, &has_more)) return nullptr;
  return Py_BuildValue("NN", make_tuple(&PyTuple_Type, x, ALL_INPUTS), make_tuple(&PyTuple_Type, error, ALL_INPUTS));
}

// input_bytes(body_a, body_b, contact, settings): what kernels of rigid bodies read, as bytes.
PyObject* input_bytes(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4 || !PyTuple_Check(args[3]) || PyTuple_GET_SIZE(args[3]) != ROWS_OF_MODEL)
    return PyErr_Format(PyExc_TypeError, "input_bytes() takes two bodies, a contact and settings");
  double x[ALL_INPUTS] = {}, error[ALL_INPUTS] = {};
  bool has_more;
  if (!read_request(args, {x, error, input_names}, &has_more)) return nullptr;
  for (int k = 0; k < ROWS_OF_MODEL; ++k) x[IN_MODEL_TANGENTIAL_RESTITUTION + k] = PyFloat_AsDouble(PyTuple_GET_ITEM(args[3], k));
  if (PyErr_Occurred()) return nullptr;
  return PyBytes_FromStringAndSize(reinterpret_cast<const char*>(x), INPUTS * sizeof(double));
}

const double zero_double = 0, one_double = 1;
const float zero_float = 0, one_float = 1;

enum { VELOCITY, ANGULAR_VELOCITY, IMPULSE, STATUS, ERROR_BOUND, REGIME = 6, ENERGY, WANTED = ENERGY + ENERGIES };  // of BatchResult

// The rows from a column on, of bodies that have been gathered.
Batch from_column(const Batch& batch, int body_rows, long at, int size) {
  Batch moved = batch;
  for (int i = body_rows; i < ROWS; ++i)
    if (!moved.one_for_all[i]) moved.row[i] = static_cast<const char*>(moved.row[i]) + at * size;
  void** results = &moved.velocity[0][0];
  for (int i = 0; i < RESULTS; ++i)
    if (results[i]) results[i] = static_cast<char*>(results[i]) + at * size;
  moved.status += at;
  if (moved.regime) moved.regime += at;
  return moved;
}

// The columns from `from` to `to` of contacts between the bodies of one table, whose rows the batch finds in `there`.
template <class T>
void gathered(BatchKernel kernel, const Batch& batch, int body_rows, const ContactPairs& pairs, const T* table, int rows, T* there, long from, long to) {
  for (long at = from; at < to; at += BLOCK) {
    long count = std::min<long>(BLOCK, to - at);
    bool any_fault = pairs.gather(table, rows, at, count, there);
    kernel(from_column(batch, body_rows, at, sizeof(T)), 0, count);
    for (long k = at; any_fault && k < at + count; ++k)
      if (int fault = pairs.fault(k)) batch.status[k] = static_cast<unsigned char>(fault);
  }
}

// Not inlined: in the midst of much else the compiler takes one code at a time.
__attribute__((noinline)) int greatest(const unsigned char* code, const unsigned char* end) {
  unsigned char most = 0;
  for (; code < end; ++code) most = *code > most ? *code : most;
  return most;
}

// The arrays of a batch: tables and results.
struct Arrays {
  Array bodies, pairs, contacts, model, result[WANTED];
  long count = -1;  // of contacts

  // Without pairs (None) the bodies lie side by side.
  bool open(PyObject* const* inputs, PyObject* results) {
    if (!bodies.open(inputs[0]) || (inputs[1] != Py_None && !pairs.open(inputs[1])) || !contacts.open(inputs[2]) || !model.open(inputs[3])) return false;
    for (int i = 0; i < WANTED; ++i) {
      PyObject* o = PyTuple_GET_ITEM(results, i);
      if (o != Py_None && !result[i].open(o, true)) return false;
    }
    if (contacts.view.ndim == 2) count = contacts.view.shape[1];
    return true;
  }
  bool is_double() const { return *model.view.format == 'd'; }

  // Whether results and pairs are of the shapes and types that they should be; bodies and contacts have been looked at.
  bool fit(const TableLayout& table, bool bounded) const {
    const char real = *model.view.format;
    const Py_ssize_t n = count, axes = table.axes, spins = 3 - table.first_spin;
    bool report = result[REGIME].is_there();
    bool fits = result[VELOCITY].is(real, {axes, 2, n}) && result[ANGULAR_VELOCITY].is(real, {spins, 2, n}) &&
                result[IMPULSE].is(real, {axes, n}) && result[STATUS].is('B', {n}) &&
                result[ERROR_BOUND].is_there() == bounded && (!bounded || (result[ERROR_BOUND].is(real, {n}) && result[ERROR_BOUND + 1].is('B', {n}))) &&
                (!report || result[REGIME].is('B', {n}));
    for (int i = ENERGY; i < WANTED; ++i) fits = fits && result[i].is_there() == report && (!report || result[i].is(real, {n}));
    if (pairs.is_there()) fits = fits && pairs.is_whole() && pairs.view.ndim == 2 && pairs.view.shape[0] == 2 && pairs.view.shape[1] == n && bodies.view.ndim == 2;
    return fits;
  }

  bool overlap() const {
    for (const Array* input : {&bodies, &pairs, &contacts})
      for (const Array& written : result)
        if (input->overlaps(written)) return true;
    return false;
  }

  // Where a kernel finds its rows: in the order of the table, or of the general layout. Bodies of pairs will be `there`.
  Batch batch(const TableLayout& table, bool general, double* there) const {
    const int size = is_double() ? sizeof(double) : sizeof(float);
    const void* zero = is_double() ? static_cast<const void*>(&zero_double) : &zero_float;
    const void* one = is_double() ? static_cast<const void*>(&one_double) : &one_float;
    const Py_ssize_t contact_rows = contacts.view.shape[0];
    Batch given{};
    int row = 0;
    auto put = [&](const void* at, bool for_all) {
      given.row[row] = at;
      given.one_for_all[row++] = for_all;
    };
    auto absent = [&](int index) { put(index == -2 ? one : zero, true); };
    for (int side = 0; side < 2; ++side)
      for (int i = 0; i < (general ? ROWS_OF_BODY : table.body_rows); ++i) {
        int index = general ? table.body[i] : i;
        if (index < 0) absent(index);
        else put(pairs.is_there() ? reinterpret_cast<char*>(there) + (2 * index + side) * BLOCK * size : bodies.row(2 * index + side), false);
      }
    for (int i = 0; i < (general ? ROWS_OF_CONTACT : table.contact_rows); ++i) {
      int index = general ? table.contact[i] : i;
      if (index >= 0 && index < contact_rows) put(contacts.row(index), false);
      else absent(index);
    }
    for (int i = 0; i < ROWS_OF_MODEL; ++i) {
      bool own_row = i == 0 && contact_rows > table.contact_rows;  // e_t of each contact
      put(own_row ? contacts.row(table.contact_rows) : model.at(i * size), !own_row);
    }
    for (int k = 0; k < 3; ++k) {
      for (int side = 0; side < 2; ++side) {
        if (k < table.axes) given.velocity[k][side] = result[VELOCITY].row(2 * k + side);
        if (k >= table.first_spin) given.angular_velocity[k][side] = result[ANGULAR_VELOCITY].row(2 * (k - table.first_spin) + side);
      }
      if (k < table.axes) given.impulse[k] = result[IMPULSE].row(k);
    }
    given.error_bound = result[ERROR_BOUND].view.buf;
    given.status = result[STATUS].at<unsigned char>();
    given.regime = result[REGIME].at<unsigned char>();
    for (int i = 0; i < ENERGIES; ++i) given.energy[i] = result[ENERGY + i].view.buf;
    return given;
  }
};

// batch(law, table, number, bodies, pairs, contacts, model, results, from, to): the columns from `from` to `to`,
// without the GIL. model holds the numbers of Settings, in the type of the tables; results is a BatchResult. The answer
// is the greatest status and the greatest error bound, infinite where one is not a number; or None if an array is not
// contiguous or not of its type and shape, which resolve_batch.py then says. Results that overlap the tables are refused.
PyObject* batch(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 10 || !PyTuple_Check(args[7]) || PyTuple_GET_SIZE(args[7]) != WANTED)
    return PyErr_Format(PyExc_TypeError, "batch() takes 10 arguments");
  int law = static_cast<int>(PyLong_AsLong(args[0])), number = static_cast<int>(PyLong_AsLong(args[2]));
  int place = static_cast<int>(PyLong_AsLong(args[1]));
  long from = PyLong_AsLong(args[8]), to = PyLong_AsLong(args[9]);
  if (PyErr_Occurred()) return nullptr;
  const TableLayout& table = table_layouts[place];
  Arrays arrays;
  if (!arrays.open(args + 3, args[7]) || !arrays.fit(table, number == NUMBER_BOUNDED || number == NUMBER_EXTENDED)) Py_RETURN_NONE;
  if (arrays.overlap()) return PyErr_Format(PyExc_ValueError, "out: overlaps the input");
  BatchKernel own = batch_kernel(law, place, number);
  bool general = !own;
  BatchKernel kernel = own ? own : batch_kernel(law, LAYOUT_EVERYTHING, number);
  if (!kernel) return PyErr_Format(PyExc_LookupError, "no kernel of law %d for numbers of kind %d", law, number);

  double there[2 * ROWS_OF_BODY * BLOCK];  // the bodies of some contacts
  const Batch given = arrays.batch(table, general, there);
  int body_rows = 2 * (general ? ROWS_OF_BODY : table.body_rows), most = 0;
  double loosest = 0;
  Py_BEGIN_ALLOW_THREADS;
  if (arrays.pairs.is_there()) {
    const auto* a = arrays.pairs.at<std::int64_t>();
    const ContactPairs who{a, a + arrays.count, arrays.bodies.view.shape[1]};
    if (arrays.is_double()) gathered(kernel, given, body_rows, who, arrays.bodies.at<double>(), table.body_rows, there, from, to);
    else gathered(kernel, given, body_rows, who, arrays.bodies.at<float>(), table.body_rows, reinterpret_cast<float*>(there), from, to);
  } else if (to > from) {
    kernel(given, from, to);
  }
  most = greatest(given.status + from, given.status + to);
  for (long at = from; given.error_bound && at < to; ++at) {
    double one = static_cast<const double*>(given.error_bound)[at];
    loosest = one <= loosest ? loosest : one - one == 0 ? one : INFINITY;
  }
  Py_END_ALLOW_THREADS;
  return Py_BuildValue("id", most, loosest);
}

// independent_sets(pairs, movable, order, starts): see contact_pairs.hpp; the arrays are of the right shapes.
PyObject* independent(PyObject*, PyObject* const* args, Py_ssize_t count) {
  Array pairs, movable, order, starts;
  if (count != 4 || !pairs.open(args[0]) || !movable.open(args[1]) || !order.open(args[2], true) || !starts.open(args[3], true))
    return PyErr_Format(PyExc_TypeError, "independent_sets() takes four arrays");
  long n = static_cast<long>(order.view.shape[0]), sets;
  ContactPairs who{pairs.at<std::int64_t>(), pairs.at<std::int64_t>() + n, movable.view.shape[0]};
  {
    ReleasedGil released;
    sets = independent_sets(who, n, movable.at<bool>(), order.at<std::int64_t>(), starts.at<std::int64_t>());
  }
  return PyLong_FromLong(sets);
}

// limit_vectors(bits): the longest that batches use, where there are any. The results are the same.
PyObject* limit_vectors(PyObject*, PyObject* bits) {
  longest_vectors = PyLong_AsLong(bits);
  return PyErr_Occurred() ? nullptr : Py_NewRef(Py_None);
}

PyObject* setup(PyObject*, PyObject* args) {
  if (!PyArg_ParseTuple(args, "OOOOOOOOOOO", &impact_type, &python_types.twist, &python_types.vec3, &python_types.contact, &python_types.fraction, &python_types.statuses, &python_types.regimes, &python_types.adjustments, &plan_function, &decided_function, &refusal_function)) return nullptr;
  Py_INCREF(args);  // keeps all of them for ever
  Py_RETURN_NONE;
}

PyMethodDef methods[] = {
    FASTCALL("resolve", resolve),
    FASTCALL("numbers_with_errors", numbers_with_errors),
    FASTCALL("input_bytes", input_bytes),
    FASTCALL("batch", batch),
    FASTCALL("independent_sets", independent),
    {"limit_vectors", limit_vectors, METH_O, ""},
    {"setup", setup, METH_VARARGS, ""},
    {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_compiled", "", -1, methods};

}  // namespace

PyMODINIT_FUNC PyInit__compiled() { return PyModule_Create(&definition); }
