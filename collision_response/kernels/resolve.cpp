// One impact: take named tuples apart, pick and call a kernel, make an Impact.
#include "resolve.hpp"

#include "module.hpp"
#include "read_numbers.hpp"
#include "suitable_units.hpp"

namespace {

bool is_articulated(PyObject* body) {
  return PyTuple_Check(body) && PyTuple_GET_SIZE(body) == 8 && PyTuple_GET_ITEM(body, 7) != Py_None;
}

// Read a body, from number i on. For an articulated one, its inverse inertia takes the place of mass, inertia,
// orientation and centre of mass.
bool read_body(PyObject* body, const InputBuffer& buffer, int i) {
  if (!PyTuple_Check(body) || PyTuple_GET_SIZE(body) != 8) {
    std::string name(buffer.names[i]);
    name.resize(name.find('.'));
    bool is_message = !strcmp(Py_TYPE(body)->tp_name, "BodyState");
    const char* hint = is_message ? "; collision_response.ros.convert.body_of(name, message) makes one"
                                  : "; Body.dynamic(...) and Body.static() make one";
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

// Read a contact. Sets not_only_numbers if it has coefficients that are functions, or a tangential restitution: these
// are not read.
bool read_contact(PyObject* contact, const InputBuffer& buffer, bool* not_only_numbers) {
  if (!PyTuple_Check(contact) || PyTuple_GET_SIZE(contact) != 5)
    return set_type_error("contact: must be a Contact, made by Contact.of(...);", contact);
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
  return read_body(args[0], buffer, 0) && read_body(args[1], buffer, BODY) &&
         read_contact(args[2], buffer, not_only_numbers);
}

// Raise the ImpactError of a status.
int raise_refusal(int status) {
  PyObject* error = PyObject_CallFunction(python.refusal, "i", status);
  if (error) PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error)), error);
  Py_XDECREF(error);
  return RAISED;
}

// `model` is a new reference.
PyObject* make_impact(PyObject* contact, PyObject* model, const OneImpact& one, int status) {
  PyObject* impact = new_tuple(python.impact, 20);
  if (!impact) {
    Py_DECREF(model);
    return nullptr;
  }
  const ImpactResult& result = one.result;
  int i = 0;
  auto put = [&](PyObject* o) { PyTuple_SET_ITEM(impact, i++, o); };
  put(Py_NewRef(PyTuple_GET_ITEM(python.statuses, status)));
  put(one.contact_as_used(contact));
  put(model);
  put(make_twist(result.reported));
  put(make_twist(result.reported + 6));
  put(make_twist(result.change + 3));
  put(make_twist(result.change + 9));
  put(make_vec3(result.change));
  for (int k = OUT_NORMAL_IMPULSE; k <= OUT_ENERGY_LOST_FRICTION; ++k) put(PyFloat_FromDouble(result.reported[k]));
  put(Py_NewRef(PyTuple_GET_ITEM(python.regimes, static_cast<int>(result.reported[OUT_REGIME]))));
  put(PyFloat_FromDouble(result.error_bound));
  put(Py_NewRef(PyTuple_GET_ITEM(python.adjustments, one.adjustments())));
  return impact;
}

}  // namespace

int compute_one_impact(PyObject* const* request, const Plan& plan, OneImpact& impact) {
  double error[ALL_INPUTS], *input = impact.input;
  std::fill_n(error, INPUTS, 0.0);
  impact.is_articulated = is_articulated(request[0]) || is_articulated(request[1]);
  if (impact.is_articulated) {
    std::fill_n(input + INPUTS, ALL_INPUTS - INPUTS, 0.0);
    std::fill_n(error + INPUTS, ALL_INPUTS - INPUTS, 0.0);
  }
  bool has_fraction = false, not_only_numbers;
  if (!read_request(request, {input, error, input_names, &has_fraction}, &not_only_numbers)) return RAISED;
  if (not_only_numbers) return HANDOVER_NOT_ONLY_NUMBERS;
  for (int k = 0; k < ROWS_OF_MODEL; ++k) {
    input[IN_MODEL_TANGENTIAL_RESTITUTION + k] = plan.settings[k];
    error[IN_MODEL_TANGENTIAL_RESTITUTION + k] = plan.errors[k];
  }
  double fault;
  (impact.is_articulated ? check_articulated : check_everything)(input, &fault, impact.validity);
  if (fault != 0 || request[0] == request[1]) return HANDOVER_INVALID;

  impact.law = input[IN_CONTACT_FRICTION] > 0 ? plan.law_with_friction : plan.law_without_friction;
  const bool frictionless = impact.law == LAW_FRICTIONLESS, *validity = impact.validity;
  impact.leaves_out_friction = frictionless && input[IN_CONTACT_FRICTION] != 0;
  const bool is_point = validity[frictionless ? VALIDITY_POINT_IF_FRICTIONLESS : VALIDITY_POINT_SUFFICES];
  const bool is_planar = validity[frictionless ? VALIDITY_PLANAR_IF_FRICTIONLESS : VALIDITY_PLANAR_SUFFICES];
  impact.geometry = is_point ? GEOMETRY_POINT : is_planar ? GEOMETRY_PLANAR : GEOMETRY_SPATIAL;
  if (plan.geometry != GEOMETRY_AUTO) {
    // POINT moves in space, so PLANAR does not always suffice where POINT does.
    bool suffices = plan.geometry == GEOMETRY_POINT ? is_point : plan.geometry == GEOMETRY_SPATIAL || is_planar;
    if (!suffices) return HANDOVER_GEOMETRY_TOO_SMALL;
    impact.geometry = plan.geometry;
  }
  if (has_fraction && frictionless && !impact.is_articulated) return HANDOVER_RATIONAL;
  ImpactResult &result = impact.result, more_exact;
  ImpactKernel last_kernel = nullptr;
  for (int precision = plan.first_precision;; ++precision) {
    const bool is_first = !last_kernel;
    int used_precision = precision;
    ImpactKernel kernel = find_impact_kernel(impact.law, impact.is_articulated, used_precision);
    if (!kernel) {
      PyErr_Format(PyExc_LookupError, "no kernel of law %d: is it newer than the build?", impact.law);
      return RAISED;
    }
    if (kernel == last_kernel) break;  // the law has one kernel for all precisions
    last_kernel = kernel;
    compute_in_suitable_units(kernel, impact.is_articulated, used_precision == PRECISION_SINGLE, input, error,
                              is_first ? result : more_exact);
    if (is_first || all_finite(more_exact)) impact.precision = used_precision;
    if (!is_first && all_finite(more_exact)) result = more_exact;  // pairs of float64 overflow before float64 does
    if (result.error_bound <= plan.target_bound || precision == plan.last_precision) break;
  }
  if (result.flags[FLAG_UNFINISHED]) return raise_refusal(STATUS_PATH_TOO_LONG);
  if (result.flags[FLAG_UNPHYSICAL]) return raise_refusal(STATUS_INTERNAL_ERROR);
  if (!all_finite(result))
    return result.error_bound < INFINITY ? raise_refusal(STATUS_OUT_OF_RANGE) : HANDOVER_NOTHING_KNOWN;
  if (result.flags[FLAG_FELL_BACK]) impact.law = LAW_COULOMB;
  return ANSWERED;
}

// resolve(body_a, body_b, contact, model, in_python): an Impact. What the kernels cannot answer, or not exactly enough,
// is left to in_python(body_a, body_b, contact, model, answer): see _resolve_in_python() of resolve.py.
PyObject* resolve(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 5) return PyErr_Format(PyExc_TypeError, "resolve() takes two bodies, a contact, a model and a function");
  auto in_python = [args](PyObject* answer) {
    if (!answer) return answer;
    PyObject* request[] = {args[0], args[1], args[2], args[3], answer};
    PyObject* impact = PyObject_Vectorcall(args[4], request, 5, nullptr);
    Py_DECREF(answer);
    return impact;
  };
  Plan plan;
  if (!find_plan(args[3], plan)) return nullptr;
  OneImpact impact;
  int outcome = compute_one_impact(args, plan, impact);
  if (outcome != ANSWERED) return outcome == RAISED ? nullptr : in_python(PyLong_FromLong(outcome));
  PyObject* model = model_as_used(args[3], impact.law, impact.geometry, impact.precision);
  if (!model) return nullptr;
  if (!(impact.result.error_bound <= plan.target_bound))
    return in_python(make_impact(args[2], model, impact, STATUS_TOLERANCE_NOT_MET));
  return make_impact(args[2], model, impact, impact.result.flags[FLAG_SEPARATING] ? STATUS_SEPARATING : STATUS_OK);
}

// numbers_with_errors(body_a, body_b, contact): the numbers that resolve() reads, and the error of each, as the bytes
// of doubles in the order of the layout ARTICULATED. Those of the model are 0.
PyObject* numbers_with_errors(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) return PyErr_Format(PyExc_TypeError, "numbers_with_errors() takes two bodies and a contact");
  double value[ALL_INPUTS] = {}, error[ALL_INPUTS] = {};
  bool not_only_numbers;
  if (!read_request(args, {value, error, input_names}, &not_only_numbers)) return nullptr;
  return Py_BuildValue("y#y#", value, static_cast<Py_ssize_t>(sizeof value), error,
                       static_cast<Py_ssize_t>(sizeof error));
}
