// The Python module _compiled: takes named tuples apart, picks and calls kernels, makes an Impact. See library.py.
#include "arrays.hpp"
#include "contact_pairs.hpp"
#include "kernel_table.hpp"
#include "read_numbers.hpp"
#include "units.hpp"

namespace {

constexpr int LAWS = LAW_COUNT, GEOMETRIES = 5, PRECISIONS = 5;

PyTypeObject* impact_type;  // these, and python_types, are set by setup()
PyObject *plan_function, *model_as_used_function, *refusal_function;

// What plan_model() of model.py decides for an ImpactModel.
struct CachedPlan {
  PyObject* model;
  int law_without_friction, law_with_friction, geometry, first_precision, last_precision;
  double settings[ROWS_OF_MODEL], errors[ROWS_OF_MODEL], target_bound;
  PyObject* models_as_used[LAWS * GEOMETRIES * PRECISIONS];  // made when they are first needed
};
constexpr int CACHE_SIZE = 8;
CachedPlan plans[CACHE_SIZE];
int next_plan;

// The plan of a model. Those of the last few models are cached; models are told apart by identity.
CachedPlan* find_plan(PyObject* model) {
  for (CachedPlan& plan : plans)
    if (plan.model == model) return &plan;
  PyObject* made = PyObject_CallOneArg(plan_function, model);
  if (!made) return nullptr;
  CachedPlan plan{};
  double limit;  // not used here
  PyObject *settings, *errors;
  bool read = PyArg_ParseTuple(made, "iiiiiddOO", &plan.law_without_friction, &plan.law_with_friction, &plan.geometry,
                               &plan.first_precision, &plan.last_precision, &plan.target_bound, &limit, &settings, &errors);
  for (int k = 0; read && k < ROWS_OF_MODEL; ++k) {
    plan.settings[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(settings, k));
    plan.errors[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(errors, k));
  }
  Py_DECREF(made);
  if (!read) return nullptr;
  CachedPlan& slot = plans[next_plan++ % CACHE_SIZE];
  Py_XDECREF(slot.model);
  for (PyObject* model_as_used : slot.models_as_used) Py_XDECREF(model_as_used);
  Py_INCREF(model);
  plan.model = model;
  slot = plan;
  return &slot;
}

// The model with the law, geometry and precision that were used. A borrowed reference.
PyObject* model_as_used(CachedPlan* plan, int law, int geometry, int precision) {
  PyObject*& model = plan->models_as_used[(law * GEOMETRIES + geometry) * PRECISIONS + precision];
  if (!model) model = PyObject_CallFunction(model_as_used_function, "Oiii", plan->model, law, geometry, precision);
  return model;
}

bool is_articulated(PyObject* body) {
  return PyTuple_Check(body) && PyTuple_GET_SIZE(body) == 8 && PyTuple_GET_ITEM(body, 7) != Py_None;
}

// Read a body, from number i on. For an articulated one, its inverse inertia takes the place of mass, inertia, orientation
// and centre of mass.
bool read_body(PyObject* body, const InputBuffer& buffer, int i) {
  if (!PyTuple_Check(body) || PyTuple_GET_SIZE(body) != 8) {
    std::string name(buffer.names[i]);
    name.resize(name.find('.'));
    bool is_message = !strcmp(Py_TYPE(body)->tp_name, "BodyState");
    const char* hint = is_message ? "; collision_response.ros.convert.body_of(name, message) makes one" : "; Body.dynamic(...) and Body.static() make one";
    return set_type_error(name + ": must be a Body,", body, hint);
  }
  PyObject *orientation = PyTuple_GET_ITEM(body, 3), *inverse_inertia = PyTuple_GET_ITEM(body, 7);
  bool rigid = inverse_inertia == Py_None;
  if (!rigid) {
    orientation = Py_None;
    std::fill_n(buffer.value + i, BODY, 0.0);
    buffer.value[i] = INFINITY;
  }
  bool read = (rigid ? read_number(PyTuple_GET_ITEM(body, 0), buffer, i) &&
                           read_numbers<6>(PyTuple_GET_ITEM(body, 1), buffer, i + IN_BODY_A_INERTIA_XX)
                     : read_numbers<INVERSE_INERTIA>(inverse_inertia, buffer, INPUTS + i / BODY * INVERSE_INERTIA)) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 2), buffer, i + IN_BODY_A_POSITION_X) &&
              (orientation == Py_None || read_numbers<4>(orientation, buffer, i + IN_BODY_A_ORIENTATION_X)) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 4), buffer, i + IN_BODY_A_VELOCITY_X) &&
              read_numbers<3>(PyTuple_GET_ITEM(body, 5), buffer, i + IN_BODY_A_ANGULAR_VELOCITY_X) &&
              (!rigid || read_numbers<3>(PyTuple_GET_ITEM(body, 6), buffer, i + IN_BODY_A_COM_X));
  if (orientation == Py_None) {
    double* q = buffer.value + i + IN_BODY_A_ORIENTATION_X;
    q[0] = q[1] = q[2] = 0;
    q[3] = 1;
  }
  return read;
}

bool is_function(PyObject* o) { return !PyFloat_CheckExact(o) && PyCallable_Check(o); }

// Read a contact. Sets not_only_numbers if it has coefficients that are functions, or a tangential restitution: these are not
// read.
bool read_contact(PyObject* contact, const InputBuffer& buffer, bool* not_only_numbers) {
  if (!PyTuple_Check(contact) || PyTuple_GET_SIZE(contact) != 5) return set_type_error("contact: must be a Contact, made by Contact.of(...);", contact);
  PyObject *e = PyTuple_GET_ITEM(contact, 2), *mu = PyTuple_GET_ITEM(contact, 3);
  bool e_is_function = is_function(e), mu_is_function = is_function(mu);
  if (e_is_function) buffer.value[IN_CONTACT_RESTITUTION] = 1;
  if (mu_is_function) buffer.value[IN_CONTACT_FRICTION] = 0;
  *not_only_numbers = e_is_function || mu_is_function || PyTuple_GET_ITEM(contact, 4) != Py_None;
  return read_numbers<3>(PyTuple_GET_ITEM(contact, 0), buffer, IN_CONTACT_POSITION_X) &&
         read_numbers<3>(PyTuple_GET_ITEM(contact, 1), buffer, IN_CONTACT_NORMAL_X) &&
         (e_is_function || read_number(e, buffer, IN_CONTACT_RESTITUTION)) &&
         (mu_is_function || read_number(mu, buffer, IN_CONTACT_FRICTION));
}

// Read two bodies and a contact.
bool read_request(PyObject* const* args, const InputBuffer& buffer, bool* not_only_numbers) {
  return read_body(args[0], buffer, 0) && read_body(args[1], buffer, BODY) && read_contact(args[2], buffer, not_only_numbers);
}

PyObject* make_impact(PyObject* contact, PyObject* model, const double* input, const ImpactResult& result, bool frictionless, bool normalised, bool articulated, int status) {
  PyObject* impact = impact_type->tp_alloc(impact_type, 20);
  if (!impact) return nullptr;
  int i = 0;
  auto put = [&](PyObject* o) { PyTuple_SET_ITEM(impact, i++, o); };
  put(Py_NewRef(PyTuple_GET_ITEM(python_types.statuses, status)));
  put(contact_as_used(contact, result.reported[OUT_RESTITUTION], result.flags[FLAG_BELOW_THRESHOLD], frictionless && input[IN_CONTACT_FRICTION] != 0));
  put(Py_NewRef(model));
  put(make_twist(result.reported));
  put(make_twist(result.reported + 6));
  put(make_twist(result.change + 3));
  put(make_twist(result.change + 9));
  put(make_vec3(result.change));
  for (int k = OUT_NORMAL_IMPULSE; k <= OUT_ENERGY_LOST_FRICTION; ++k) put(PyFloat_FromDouble(result.reported[k]));
  put(Py_NewRef(PyTuple_GET_ITEM(python_types.regimes, static_cast<int>(result.reported[OUT_REGIME]))));
  put(PyFloat_FromDouble(result.error_bound));
  int adjustments = normalised * ADJUSTMENT_NORMALISED_ORIENTATION + result.flags[FLAG_BELOW_THRESHOLD] * ADJUSTMENT_RESTITUTION_THRESHOLD +
                 result.flags[FLAG_FELL_BACK] * ADJUSTMENT_LAW_FALLBACK + result.flags[FLAG_MASSLESS_SPIN] * ADJUSTMENT_MASSLESS_SPIN +
                 articulated * ADJUSTMENT_ENERGY_CHANGE_ONLY;
  put(Py_NewRef(PyTuple_GET_ITEM(python_types.adjustments, adjustments)));
  return impact;
}

// Raise the ImpactError of a status.
PyObject* raise_refusal(int status) {
  PyObject* error = PyObject_CallFunction(refusal_function, "i", status);
  if (error) PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error)), error);
  Py_XDECREF(error);
  return nullptr;
}

// resolve(body_a, body_b, contact, model): an Impact, with TOLERANCE_NOT_MET if its bound is above target_bound: Python then
// decides; or a number, the Handover of protocol.py, that says why Python has to answer.
PyObject* resolve(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4) return PyErr_Format(PyExc_TypeError, "resolve() takes two bodies, a contact and a model");
  PyObject* contact = args[2];
  CachedPlan* plan = find_plan(args[3]);
  if (!plan) return nullptr;
  double input[ALL_INPUTS], error[ALL_INPUTS];
  std::fill_n(error, INPUTS, 0.0);
  bool articulated = is_articulated(args[0]) || is_articulated(args[1]);
  if (articulated) {
    std::fill_n(input + INPUTS, ALL_INPUTS - INPUTS, 0.0);
    std::fill_n(error + INPUTS, ALL_INPUTS - INPUTS, 0.0);
  }
  bool has_fraction = false, not_only_numbers;
  if (!read_request(args, {input, error, input_names, &has_fraction}, &not_only_numbers)) return nullptr;
  if (not_only_numbers) return PyLong_FromLong(HANDOVER_NOT_ONLY_NUMBERS);
  for (int k = 0; k < ROWS_OF_MODEL; ++k) {
    input[IN_MODEL_TANGENTIAL_RESTITUTION + k] = plan->settings[k];
    error[IN_MODEL_TANGENTIAL_RESTITUTION + k] = plan->errors[k];
  }
  double fault;
  bool flags[5];  // see validity_header() of programs.py
  (articulated ? check_articulated : check_everything)(input, &fault, flags);
  if (fault != 0 || args[0] == args[1]) return PyLong_FromLong(HANDOVER_INVALID);

  int law = input[IN_CONTACT_FRICTION] > 0 ? plan->law_with_friction : plan->law_without_friction;
  bool frictionless = law == LAW_FRICTIONLESS;
  int required = flags[frictionless ? 0 : 1] ? GEOMETRY_POINT : flags[frictionless ? 2 : 3] ? GEOMETRY_PLANAR : GEOMETRY_SPATIAL;
  if (plan->geometry != GEOMETRY_AUTO) {
    if (plan->geometry < required) return PyLong_FromLong(HANDOVER_GEOMETRY_TOO_SMALL);
    required = plan->geometry;
  }
  if (has_fraction && frictionless && !articulated) return PyLong_FromLong(HANDOVER_RATIONAL);
  ImpactResult result;
  int used_precision;
  for (int precision = plan->first_precision;; ++precision) {
    used_precision = precision;
    ImpactKernel kernel = find_impact_kernel(law, articulated, used_precision);
    if (!kernel) return PyErr_Format(PyExc_LookupError, "no kernel of law %d", law);
    compute_in_suitable_units(kernel, articulated, used_precision == PRECISION_SINGLE, input, error, result);
    if (result.error_bound <= plan->target_bound || precision == plan->last_precision) break;
  }
  if (result.flags[FLAG_UNFINISHED]) return raise_refusal(STATUS_PATH_TOO_LONG);
  if (result.flags[FLAG_UNPHYSICAL]) return raise_refusal(STATUS_INTERNAL_ERROR);
  if (!all_finite(result)) {
    if (result.error_bound < INFINITY) return raise_refusal(STATUS_OUT_OF_RANGE);
    return PyLong_FromLong(HANDOVER_NOTHING_KNOWN);
  }
  PyObject* model = model_as_used(plan, result.flags[FLAG_FELL_BACK] ? LAW_COULOMB : law, required, used_precision);
  if (!model) return nullptr;
  int status = result.error_bound <= plan->target_bound ? (result.flags[FLAG_SEPARATING] ? STATUS_SEPARATING : STATUS_OK) : STATUS_TOLERANCE_NOT_MET;
  return make_impact(contact, model, input, result, frictionless, flags[4], articulated, status);
}

// numbers_with_errors(body_a, body_b, contact): the numbers that resolve() reads, and the error of each, as the bytes of doubles
// in the order of the layout ARTICULATED. Those of the model are 0.
PyObject* numbers_with_errors(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) return PyErr_Format(PyExc_TypeError, "numbers_with_errors() takes two bodies and a contact");
  double value[ALL_INPUTS] = {}, error[ALL_INPUTS] = {};
  bool not_only_numbers;
  if (!read_request(args, {value, error, input_names}, &not_only_numbers)) return nullptr;
  return Py_BuildValue("y#y#", value, static_cast<Py_ssize_t>(sizeof value), error, static_cast<Py_ssize_t>(sizeof error));
}

const double zero_double = 0, one_double = 1;
const float zero_float = 0, one_float = 1;

enum { VELOCITY, ANGULAR_VELOCITY, IMPULSE, STATUS, ERROR_BOUND, REGIME = 6, ENERGY, FIELDS = ENERGY + ENERGIES };  // of BatchResult

// The batch from a column on. Its bodies have been gathered, so their rows stay.
Batch from_column(const Batch& batch, int body_rows, long at, int size) {
  Batch moved = batch;
  for (int i = body_rows; i < ROWS; ++i)
    if (!moved.is_shared[i]) moved.row[i] = static_cast<const char*>(moved.row[i]) + at * size;
  void** results = &moved.velocity[0][0];
  for (int i = 0; i < RESULTS; ++i)
    if (results[i]) results[i] = static_cast<char*>(results[i]) + at * size;
  moved.status += at;
  if (moved.regime) moved.regime += at;
  return moved;
}

// Compute the columns from `from` to `to` of a batch of contacts between the bodies of one table. The batch reads its bodies
// from the buffer `gathered`.
template <class T>
void compute_gathered(BatchKernel kernel, const Batch& batch, int body_rows, const ContactPairs& pairs, const T* table, int rows, T* gathered, long from, long to) {
  for (long at = from; at < to; at += GATHER_BLOCK) {
    long count = std::min<long>(GATHER_BLOCK, to - at);
    bool any_fault = pairs.gather(table, rows, at, count, gathered);
    kernel(from_column(batch, body_rows, at, sizeof(T)), 0, count);
    for (long k = at; any_fault && k < at + count; ++k)
      if (int fault = pairs.fault(k)) batch.status[k] = static_cast<unsigned char>(fault);
  }
}

// Not inlined: the compiler vectorises this loop only in a function of its own.
__attribute__((noinline)) int greatest(const unsigned char* code, const unsigned char* end) {
  unsigned char largest = 0;
  for (; code < end; ++code) largest = *code > largest ? *code : largest;
  return largest;
}

// The arrays of a batch: tables and results.
struct BatchArrays {
  Array bodies, pairs, contacts, settings, result[FIELDS];
  long count = -1;  // of contacts

  // If `pairs` is None, the bodies of a contact are in its own column.
  bool open(PyObject* const* inputs, PyObject* results) {
    if (!bodies.open(inputs[0]) || (inputs[1] != Py_None && !pairs.open(inputs[1])) || !contacts.open(inputs[2]) || !settings.open(inputs[3])) return false;
    for (int i = 0; i < FIELDS; ++i) {
      PyObject* o = PyTuple_GET_ITEM(results, i);
      if (o != Py_None && !result[i].open(o, true)) return false;
    }
    if (contacts.view.ndim == 2) count = contacts.view.shape[1];
    return true;
  }
  bool is_double() const { return *settings.view.format == 'd'; }

  // Whether results and pairs have the right shapes and types. Those of bodies and contacts have been checked.
  bool are_valid(const TableLayout& table, bool bounded) const {
    const char real = *settings.view.format;
    const Py_ssize_t n = count, axes = table.axes, spins = 3 - table.first_spin;
    bool report = result[REGIME].is_open();
    bool valid = result[VELOCITY].has(real, {axes, 2, n}) && result[ANGULAR_VELOCITY].has(real, {spins, 2, n}) &&
                result[IMPULSE].has(real, {axes, n}) && result[STATUS].has('B', {n}) &&
                result[ERROR_BOUND].is_open() == bounded && (!bounded || (result[ERROR_BOUND].has(real, {n}) && result[ERROR_BOUND + 1].has('B', {n}))) &&
                (!report || result[REGIME].has('B', {n}));
    for (int i = ENERGY; i < FIELDS; ++i) valid = valid && result[i].is_open() == report && (!report || result[i].has(real, {n}));
    if (pairs.is_open()) valid = valid && pairs.has_int64() && pairs.view.ndim == 2 && pairs.view.shape[0] == 2 && pairs.view.shape[1] == n && bodies.view.ndim == 2;
    return valid;
  }

  // Whether a result overlaps the tables.
  bool overwrite_tables() const {
    for (const Array* input : {&bodies, &pairs, &contacts})
      for (const Array& written : result)
        if (input->overlaps(written)) return true;
    return false;
  }
  // Whether results overlap each other.
  bool overwrite_results() const {
    for (const Array& one : result)
      for (const Array* other = result; other != &one; ++other)
        if (one.overlaps(*other)) return true;
    return false;
  }

  // The rows for a kernel of the layout of the table, or of the general layout. Bodies of pairs are read from `gathered`.
  Batch make_batch(const TableLayout& table, bool general, double* gathered) const {
    const int size = is_double() ? sizeof(double) : sizeof(float);
    const void* zero = is_double() ? static_cast<const void*>(&zero_double) : &zero_float;
    const void* one = is_double() ? static_cast<const void*>(&one_double) : &one_float;
    const Py_ssize_t contact_rows = contacts.view.shape[0];
    Batch batch{};
    int row = 0;
    auto put = [&](const void* at, bool is_shared) {
      batch.row[row] = at;
      batch.is_shared[row++] = is_shared;
    };
    auto absent = [&](int index) { put(index == ALL_ONE ? one : zero, true); };
    for (int side = 0; side < 2; ++side)
      for (int i = 0; i < (general ? ROWS_OF_BODY : table.body_rows); ++i) {
        int index = general ? table.body[i] : i;
        if (index < 0) absent(index);
        else put(pairs.is_open() ? reinterpret_cast<char*>(gathered) + (2 * index + side) * GATHER_BLOCK * size : bodies.row(2 * index + side), false);
      }
    for (int i = 0; i < (general ? ROWS_OF_CONTACT : table.contact_rows); ++i) {
      int index = general ? table.contact[i] : i;
      if (index >= 0 && index < contact_rows) put(contacts.row(index), false);
      else absent(index);
    }
    for (int i = 0; i < ROWS_OF_MODEL; ++i) {
      bool has_own_row = i == 0 && contact_rows > table.contact_rows;  // tangential restitution, if each contact has its own
      put(has_own_row ? contacts.row(table.contact_rows) : settings.at(i * size), !has_own_row);
    }
    for (int k = 0; k < 3; ++k) {
      for (int side = 0; side < 2; ++side) {
        if (k < table.axes) batch.velocity[k][side] = result[VELOCITY].row(2 * k + side);
        if (k >= table.first_spin) batch.angular_velocity[k][side] = result[ANGULAR_VELOCITY].row(2 * (k - table.first_spin) + side);
      }
      if (k < table.axes) batch.impulse[k] = result[IMPULSE].row(k);
    }
    batch.error_bound = result[ERROR_BOUND].view.buf;
    batch.status = result[STATUS].at<unsigned char>();
    batch.regime = result[REGIME].at<unsigned char>();
    for (int i = 0; i < ENERGIES; ++i) batch.energy[i] = result[ENERGY + i].view.buf;
    return batch;
  }
};

// batch(law, layout, number_type, bodies, pairs, contacts, settings, results, from, to): compute the columns from `from` to `to`.
// settings holds the numbers of Settings, in the type of the tables; results is a BatchResult. Returns the greatest status and
// the greatest error bound (infinite if one is NaN); or None if an array is not contiguous, or not of the right type and
// shape, or if results overlap, for which resolve_batch.py then raises. Raises ValueError if results overlap the tables.
// Releases the GIL.
PyObject* batch(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 10 || !PyTuple_Check(args[7]) || PyTuple_GET_SIZE(args[7]) != FIELDS)
    return PyErr_Format(PyExc_TypeError, "batch() takes 10 arguments");
  int law = static_cast<int>(PyLong_AsLong(args[0])), number_type = static_cast<int>(PyLong_AsLong(args[2]));
  int layout = static_cast<int>(PyLong_AsLong(args[1]));
  long from = PyLong_AsLong(args[8]), to = PyLong_AsLong(args[9]);
  if (PyErr_Occurred()) return nullptr;
  const TableLayout& table = table_layouts[layout];
  BatchArrays arrays;
  if (!arrays.open(args + 3, args[7]) || !arrays.are_valid(table, number_type == NUMBER_BOUNDED || number_type == NUMBER_EXTENDED) || arrays.overwrite_results()) Py_RETURN_NONE;
  if (arrays.overwrite_tables()) return PyErr_Format(PyExc_ValueError, "out: overlaps the input");
  BatchKernel special = find_batch_kernel(law, layout, number_type);
  bool general = !special;
  BatchKernel kernel = special ? special : find_batch_kernel(law, LAYOUT_EVERYTHING, number_type);
  if (!kernel) return PyErr_Format(PyExc_LookupError, "no kernel of law %d for numbers of kind %d", law, number_type);

  double gathered[2 * ROWS_OF_BODY * GATHER_BLOCK];  // the bodies of some contacts
  const Batch batch = arrays.make_batch(table, general, gathered);
  int body_rows = 2 * (general ? ROWS_OF_BODY : table.body_rows), greatest_status = 0;
  double greatest_bound = 0;
  Py_BEGIN_ALLOW_THREADS;
  if (arrays.pairs.is_open()) {
    const auto* a = arrays.pairs.at<std::int64_t>();
    const ContactPairs body_pairs{a, a + arrays.count, arrays.bodies.view.shape[1]};
    if (arrays.is_double()) compute_gathered(kernel, batch, body_rows, body_pairs, arrays.bodies.at<double>(), table.body_rows, gathered, from, to);
    else compute_gathered(kernel, batch, body_rows, body_pairs, arrays.bodies.at<float>(), table.body_rows, reinterpret_cast<float*>(gathered), from, to);
  } else if (to > from) {
    kernel(batch, from, to);
  }
  greatest_status = greatest(batch.status + from, batch.status + to);
  for (long at = from; batch.error_bound && at < to; ++at) {
    double bound = static_cast<const double*>(batch.error_bound)[at];
    greatest_bound = bound <= greatest_bound ? greatest_bound : bound - bound == 0 ? bound : INFINITY;
  }
  Py_END_ALLOW_THREADS;
  return Py_BuildValue("id", greatest_status, greatest_bound);
}

// independent_sets(pairs, movable, order, starts): see contact_pairs.hpp. The caller has checked the shapes of the arrays.
PyObject* find_independent_sets(PyObject*, PyObject* const* args, Py_ssize_t count) {
  Array pairs, movable, order, starts;
  if (count != 4 || !pairs.open(args[0]) || !movable.open(args[1]) || !order.open(args[2], true) || !starts.open(args[3], true))
    return PyErr_Format(PyExc_TypeError, "independent_sets() takes four arrays");
  long n = static_cast<long>(order.view.shape[0]), sets;
  ContactPairs body_pairs{pairs.at<std::int64_t>(), pairs.at<std::int64_t>() + n, movable.view.shape[0]};
  {
    ReleasedGil released;
    sets = independent_sets(body_pairs, n, movable.at<bool>(), order.at<std::int64_t>(), starts.at<std::int64_t>());
  }
  return PyLong_FromLong(sets);
}

// limit_vectors(bits): use no vectors longer than this. The results are the same.
PyObject* limit_vectors(PyObject*, PyObject* bits) {
  longest_vectors = PyLong_AsLong(bits);
  return PyErr_Occurred() ? nullptr : Py_NewRef(Py_None);
}

PyObject* setup(PyObject*, PyObject* args) {
  if (!PyArg_ParseTuple(args, "OOOOOOOOOOO", &impact_type, &python_types.twist, &python_types.vec3, &python_types.contact, &python_types.fraction, &python_types.statuses, &python_types.regimes, &python_types.adjustments, &plan_function, &model_as_used_function, &refusal_function)) return nullptr;
  Py_INCREF(args);  // keeps the objects alive
  Py_RETURN_NONE;
}

PyMethodDef methods[] = {
    FASTCALL("resolve", resolve),
    FASTCALL("numbers_with_errors", numbers_with_errors),
    FASTCALL("batch", batch),
    FASTCALL("independent_sets", find_independent_sets),
    {"limit_vectors", limit_vectors, METH_O, ""},
    {"setup", setup, METH_VARARGS, ""},
    {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_compiled", "", -1, methods};

}  // namespace

PyMODINIT_FUNC PyInit__compiled() { return PyModule_Create(&definition); }
