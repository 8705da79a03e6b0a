// One impact: take named tuples apart, pick and call a kernel, make an Impact.
#include "resolve.hpp"

#include "check.hpp"
#include "exact_normal_velocity.hpp"
#include "module.hpp"
#include "read_request.hpp"
#include "suitable_units.hpp"

namespace {

// Read two bodies and a contact.
bool read_request(PyObject* const* args, const InputBuffer& buffer, bool* has_function) {
  return read_body(args[0], buffer, 0) && read_body(args[1], buffer, BODY) &&
         read_contact(args[2], buffer, IN_CONTACT, has_function);
}

// Raise the ImpactError of a status.
void raise_refusal(int status) {
  PyObject* error = PyObject_CallFunction(python.refusal, "i", status);
  if (error) PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error)), error);
  Py_XDECREF(error);
}

// `model` is a new reference.
PyObject* make_impact(PyObject* contact, PyObject* model, const OneImpact& one, int status) {
  PyObject* impact = new_tuple(python.impact, IMPACT_FIELDS);
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
  for (int side = 0; side < 2; ++side) put(make_twist(result.twist_after(side)));
  for (int side = 0; side < 2; ++side) put(make_twist(result.twist_change(side)));
  put(make_vec3(result.change));
  for (int k = OUT_NORMAL_IMPULSE; k <= OUT_ENERGY_LOST_FRICTION; ++k) put(PyFloat_FromDouble(result.reported[k]));
  put(Py_NewRef(PyTuple_GET_ITEM(python.regimes, static_cast<int>(result.reported[OUT_REGIME]))));
  put(PyFloat_FromDouble(result.error_bound));
  put(Py_NewRef(PyTuple_GET_ITEM(python.adjustments, one.adjustments())));
  return finished(impact);
}

// Set the geometry: that of the plan, where AUTO is the smallest one that suffices. Return whether it suffices.
bool find_geometry(const Plan& plan, OneImpact& impact) {
  const bool frictionless = impact.law == LAW_FRICTIONLESS, *validity = impact.validity;
  const bool is_point = validity[frictionless ? VALIDITY_POINT_IF_FRICTIONLESS : VALIDITY_POINT_SUFFICES];
  const bool is_planar = validity[frictionless ? VALIDITY_PLANAR_IF_FRICTIONLESS : VALIDITY_PLANAR_SUFFICES];
  impact.geometry = plan.geometry;
  if (plan.geometry == GEOMETRY_AUTO)
    impact.geometry = is_point ? GEOMETRY_POINT : is_planar ? GEOMETRY_PLANAR : GEOMETRY_SPATIAL;
  // POINT moves in space, so PLANAR does not always suffice where POINT does.
  return impact.geometry == GEOMETRY_SPATIAL || (impact.geometry == GEOMETRY_POINT ? is_point : is_planar);
}

// Whether a body whose approach was decided turns about an axis without inertia.
bool has_massless_spin(const double* body) {
  const auto spin = effective_spin(body);
  return spin && !std::equal(spin->begin(), spin->end(), body + BODY_ANGULAR_VELOCITY_X);
}

// Make a result that leaves open whether the bodies approach that of bodies that do not, with this normal velocity.
void set_separating(double normal_velocity, OneImpact& impact) {
  ImpactResult& result = impact.result;
  double* reported = result.reported;
  for (int side = 0; side < 2; ++side)
    std::copy_n(impact.input + side * BODY + BODY_VELOCITY_X, 6, reported + 6 * side);
  std::fill_n(result.change, CHANGES, 0.0);
  std::fill_n(result.error, CHANGES, 0.0);
  reported[OUT_NORMAL_IMPULSE] = reported[OUT_TANGENTIAL_IMPULSE] = 0;
  reported[OUT_NORMAL_VELOCITY_BEFORE] = reported[OUT_NORMAL_VELOCITY_AFTER] = normal_velocity;
  reported[OUT_KINETIC_ENERGY_AFTER] = reported[OUT_KINETIC_ENERGY_BEFORE];
  reported[OUT_ENERGY_LOST_RESTITUTION] = reported[OUT_ENERGY_LOST_FRICTION] = 0;
  reported[OUT_RESTITUTION] = impact.input[IN_CONTACT + CONTACT_RESTITUTION];
  reported[OUT_REGIME] = REGIME_SEPARATING;
  std::fill_n(result.flags, FLAGS, false);
  result.flags[FLAG_SEPARATING] = true;
  result.flags[FLAG_MASSLESS_SPIN] = has_massless_spin(impact.input) || has_massless_spin(impact.input + BODY);
  result.error_bound = 0;
  impact.precision = PRECISION_EXTENDED;
}

// What can be said about an approach without rounding.
struct Decision {
  std::optional<double> separates{};  // with this normal velocity
  std::optional<bool> is_below{};  // the threshold, if there is one that matters
};
Decision decide_approach(const double* input, const double* error) {
  if (std::any_of(error, error + INPUTS, [](double e) { return e != 0; })) return {};
  const double *normal = input + IN_CONTACT + CONTACT_NORMAL_X,
               threshold = input[IN_MODEL + MODEL_RESTITUTION_THRESHOLD];
  const auto n_u = exact_normal_velocity(input, input + BODY, input + IN_CONTACT + CONTACT_POSITION_X, normal);
  if (!n_u) return {};
  if (!(n_u->sign() < 0)) return {velocity_along(*n_u, normal), {}};
  const bool has_threshold = threshold > 0 && input[IN_CONTACT + CONTACT_RESTITUTION] > 0;
  return {{}, has_threshold ? approach_below(*n_u, normal, threshold) : std::nullopt};
}

// Compute the result of `input` in the first precision of the plan, then in the next ones, until its error bound is low
// enough. Where the bound is so large that the approach may be undecided, or stays too large, the approach is decided
// without rounding, unless it has been. Return whether there is a kernel.
bool compute_result(const Plan& plan, const double* input, const double* error, bool is_decided, OneImpact& impact) {
  ImpactResult& result = impact.result;
  const KernelEntry<ImpactKernel>* last = nullptr;
  for (int precision = plan.first_precision; precision <= plan.last_precision; ++precision) {
    const auto next = find_impact_kernel(impact.law, impact.is_articulated, precision);
    if (!next) return false;
    if (next == last) break;  // the law has one kernel for all precisions
    ImpactResult more_exact;
    compute_in_suitable_units(next->kernel, impact.is_articulated, next->number == PRECISION_SINGLE, input, error,
                              last ? more_exact : result);
    if (!last || all_finite(more_exact)) impact.precision = next->number;
    if (last && all_finite(more_exact)) result = more_exact;  // pairs of float64 overflow before float64 does
    if (result.error_bound <= plan.target_bound) break;
    last = next;
    const bool is_open = !(result.error_bound <= USEFUL_BOUND) || precision == plan.last_precision;
    if (is_decided || !is_open || !all_finite(result)) continue;
    is_decided = true;
    const Decision found = decide_approach(input, error);
    if (found.separates) {
      set_separating(*found.separates, impact);
      break;
    }
    if (!found.is_below) continue;
    double decided[INPUTS];
    std::copy_n(input, INPUTS, decided);
    decided[IN_MODEL + MODEL_RESTITUTION_THRESHOLD] = 0;
    if (*found.is_below) decided[IN_CONTACT + CONTACT_RESTITUTION] = 0;
    if (!compute_result(plan, decided, error, true, impact)) return false;
    result.flags[FLAG_BELOW_THRESHOLD] = *found.is_below;
    break;
  }
  return true;
}

}  // namespace

int compute_numbers(const Plan& plan, const double* error, OneImpact& impact) {
  double fault;
  (impact.is_articulated ? check_articulated : check_everything)(impact.input, &fault, impact.validity);
  if (fault != 0) return HANDOVER_INVALID;
  const double friction = impact.input[IN_CONTACT + CONTACT_FRICTION];
  impact.law = friction > 0 ? plan.law_with_friction : plan.law_without_friction;
  impact.leaves_out_friction = impact.law == LAW_FRICTIONLESS && friction != 0;
  if (!find_geometry(plan, impact)) return HANDOVER_GEOMETRY_TOO_SMALL;
  if (impact.has_fraction && impact.law == LAW_FRICTIONLESS && !impact.is_articulated) return HANDOVER_RATIONAL;

  const bool may_decide = plan.last_precision == PRECISION_EXTENDED && !impact.is_articulated;
  if (!compute_result(plan, impact.input, error, !may_decide, impact)) return NO_KERNEL;
  const ImpactResult& result = impact.result;
  if (result.flags[FLAG_UNFINISHED]) return refused(STATUS_PATH_TOO_LONG);
  if (result.flags[FLAG_UNPHYSICAL]) return refused(STATUS_INTERNAL_ERROR);
  if (!all_finite(result)) return result.error_bound < INFINITY ? refused(STATUS_OUT_OF_RANGE) : HANDOVER_NOTHING_KNOWN;
  if (result.flags[FLAG_FELL_BACK]) impact.law = LAW_COULOMB;
  return ANSWERED;
}

int compute_one_impact(PyObject* const* request, const Plan& plan, OneImpact& impact) {
  double error[ALL_INPUTS], *input = impact.input;
  std::fill_n(error, INPUTS, 0.0);
  impact.is_articulated = is_articulated(request[0]) || is_articulated(request[1]);
  if (impact.is_articulated) {
    std::fill_n(input + INPUTS, ALL_INPUTS - INPUTS, 0.0);
    std::fill_n(error + INPUTS, ALL_INPUTS - INPUTS, 0.0);
  }
  bool has_function;
  if (!read_request(request, {input, error, input_names, &impact.has_fraction}, &has_function)) return RAISED;
  if (has_function || PyTuple_GET_ITEM(request[2], CONTACT_FIELD_TANGENTIAL_RESTITUTION) != Py_None)
    return HANDOVER_NOT_ONLY_NUMBERS;
  std::copy_n(plan.settings, MODEL, input + IN_MODEL);
  std::copy_n(plan.errors, MODEL, error + IN_MODEL);
  if (request[0] == request[1]) return HANDOVER_INVALID;
  const int outcome = compute_numbers(plan, error, impact);
  if (outcome >= ANSWERED) return outcome;
  if (outcome == NO_KERNEL)
    PyErr_Format(PyExc_LookupError, "no kernel of law %d: is it newer than the build?", impact.law);
  else raise_refusal(status_of(outcome));
  return RAISED;
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
  bool has_function;
  if (!read_request(args, {value, error, input_names}, &has_function)) return nullptr;
  return Py_BuildValue("y#y#", value, static_cast<Py_ssize_t>(sizeof value), error,
                       static_cast<Py_ssize_t>(sizeof error));
}
