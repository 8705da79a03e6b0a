// The Python module _derivatives: derivatives of many impacts, arrays in and out, for collision_response/derivatives/.
#include "arrays.hpp"
#include "python_objects.hpp"

#include <algorithm>
#include <array>

#include "derivatives.hpp"
#include "units.hpp"

#include "changes.hpp"

#define X(formula) extern "C" void derivatives_##formula(const Bounded<double>*, const Seeds&, Impulse*);
EACH_FORMULA(X)
#undef X

namespace {

using SparseDual = Dual<Bounded<double>, SparseDerivatives>;

// An impact is differentiated by these parameters: its inputs, but three rotations about the world axes in place of
// the four numbers of a quaternion, and only those numbers of the model that laws read.
enum { PARAMETERS_OF_BODY = BODY - 1, STIFFNESS = IN_MODEL + MODEL_RESTITUTION_THRESHOLD - 2, PARAMETERS };
enum { TWISTS = CHANGES - AXES, RESULTS = CHANGES };  // the twists after the impact, then the impulse

constexpr int k_index[AXES][AXES] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};  // the place of each component of K

DerivativeKernel find_kernel(int law) {
#define X(formula) derivatives_##formula,
  static const DerivativeKernel kernels[] = {EACH_FORMULA(X)};
#undef X
  return kernels[formula_of[law]];
}

// Whether a contact without friction does not slip, as far as the error of its slip tells, when a law applies friction:
// COULOMB where the approach ends, MOREAU after the impact, and the others all along. Then the least friction holds it.
bool holds_without_friction(int law, const Bounded<double>* law_input) {
  const Bounded<double>*n = law_input + LAW_INPUT_N, *u = law_input + LAW_INPUT_U, *K = law_input + LAW_INPUT_K;
  const Bounded<double> none = Make<Bounded<double>>::constant(0), one = Make<Bounded<double>>::constant(1);
  const Bounded<double> j = -law_input[LAW_INPUT_N_U] / law_input[LAW_INPUT_N_KN];
  auto rests_after = [&](const Bounded<double>& impulse) {
    Bounded<double> v[AXES], n_v = none, nn = none;
    for (int i = 0; i < AXES; ++i) {
      Bounded<double> Kn = none;
      for (int k = 0; k < AXES; ++k) Kn = Kn + K[k_index[i][k]] * n[k];
      v[i] = u[i] + Kn * impulse;
      n_v = n_v + n[i] * v[i];
      nn = nn + n[i] * n[i];
    }
    for (int i = 0; i < AXES; ++i)
      if (const Bounded<double> slip = v[i] - n[i] * (n_v / nn); std::fabs(slip.value) > slip.error) return false;
    return true;
  };
  if (law == LAW_COULOMB) return rests_after(j);
  return rests_after((one + law_input[LAW_INPUT_RESTITUTION]) * j) && (law == LAW_MOREAU || rests_after(none));
}

// The energy that an impulse P with these derivatives by friction gains in one direction.
double gain_by_friction(const Bounded<double>* law_input, const Impulse& P, const Impulse& by_friction, int direction) {
  double gain = 0;
  for (int i = 0; i < AXES; ++i) {
    double u_after = law_input[LAW_INPUT_U + i].value;
    for (int j = 0; j < AXES; ++j) u_after += law_input[LAW_INPUT_K + k_index[i][j]].value * P.value[j].value;
    gain += by_friction.d[i][direction] * u_after;
  }
  return gain;
}

// Differentiate the impulse of a law by friction, where there is none: slip and stick meet in one point, where a law
// takes either branch. Springs of any stiffness have the derivatives of hard ones.
void differentiate_by_friction(int law, const Bounded<double>* law_input, const Seeds& seeds, Impulse* y) {
  if (!holds_without_friction(law, law_input))
    return find_kernel(law == LAW_COMPLIANT ? LAW_ROUTH_STRONGE : law)(law_input, seeds, y);
  *y = {};
  for (int k = 0; k < DenseDerivatives::DIRECTIONS; ++k) y->kinks |= Edges(seeds[LAW_INPUT_FRICTION][k] != 0) << k;
}

// Differentiate the impulse of a law. Without friction every law is FRICTIONLESS, and its derivatives are those of
// FRICTIONLESS too, except those by friction. MOREAU falls back to COULOMB if all energy comes back, and the least
// friction would add some.
void differentiate_law(int law, const Bounded<double>* law_input, Seeds& seeds, Impulse* y) {
  double (&friction)[DenseDerivatives::DIRECTIONS] = seeds[LAW_INPUT_FRICTION];
  if (law_input[LAW_INPUT_FRICTION].value > 0 || law == LAW_FRICTIONLESS) return find_kernel(law)(law_input, seeds, y);
  double by_friction[DenseDerivatives::DIRECTIONS];
  std::memcpy(by_friction, friction, sizeof friction);
  std::memset(friction, 0, sizeof friction);
  find_kernel(LAW_FRICTIONLESS)(law_input, seeds, y);
  if (std::all_of(by_friction, by_friction + DenseDerivatives::DIRECTIONS, [](double d) { return d == 0; })) return;
  std::memset(seeds, 0, sizeof seeds);
  std::memcpy(friction, by_friction, sizeof friction);
  Impulse friction_part;
  differentiate_by_friction(law, law_input, seeds, &friction_part);
  if (law == LAW_MOREAU && law_input[LAW_INPUT_RESTITUTION].value == 1) {
    auto is_less = [](double a, double b) { return std::fabs(a) < std::fabs(b); };
    const int most = std::max_element(by_friction, by_friction + DenseDerivatives::DIRECTIONS, is_less) - by_friction;
    if (gain_by_friction(law_input, *y, friction_part, most) * by_friction[most] > 0)  // as friction rises from 0
      differentiate_by_friction(LAW_COULOMB, law_input, seeds, &friction_part);
  }
  y->kinks |= friction_part.kinks;
  y->jumps |= friction_part.jumps;
  for (int i = 0; i < AXES; ++i)
    for (int k = 0; k < DenseDerivatives::DIRECTIONS; ++k) y->d[i][k] += friction_part.d[i][k];
}

// The inputs of a law that are independent of each other: each is a direction. n.u and n.Kn depend on n, u and K.
enum { BY_N, BY_U = BY_N + AXES, BY_K = BY_U + AXES };
const int independent_inputs[DenseDerivatives::DIRECTIONS] = {
    LAW_INPUT_N,           LAW_INPUT_N + 1,    LAW_INPUT_N + 2,    LAW_INPUT_U,
    LAW_INPUT_U + 1,       LAW_INPUT_U + 2,    LAW_INPUT_K,        LAW_INPUT_K + 1,
    LAW_INPUT_K + 2,       LAW_INPUT_K + 3,    LAW_INPUT_K + 4,    LAW_INPUT_K + 5,
    LAW_INPUT_RESTITUTION, LAW_INPUT_FRICTION, LAW_INPUT_SETTINGS, LAW_INPUT_SETTINGS + MODEL_STIFFNESS_RATIO};

void seed_independent(const Bounded<double>* law_input, Seeds& seeds) {
  std::memset(seeds, 0, sizeof seeds);
  for (int k = 0; k < DenseDerivatives::DIRECTIONS; ++k) seeds[independent_inputs[k]][k] = 1;
  for (int i = 0; i < AXES; ++i) {
    double n_i = law_input[LAW_INPUT_N + i].value;
    seeds[LAW_INPUT_N_U][BY_N + i] = law_input[LAW_INPUT_U + i].value;
    seeds[LAW_INPUT_N_U][BY_U + i] = n_i;
    for (int j = 0; j < AXES; ++j) {
      double n_j = law_input[LAW_INPUT_N + j].value;
      seeds[LAW_INPUT_N_KN][BY_N + i] += 2 * n_j * law_input[LAW_INPUT_K + k_index[i][j]].value;
      seeds[LAW_INPUT_N_KN][BY_K + k_index[i][j]] += n_i * n_j;
    }
  }
}

// COMPLIANT takes a lesser restitution as this, since its springs would be too stiff. Its derivative by e at e = 0 is
// as far off as that.
constexpr double LEAST_RESTITUTION = 1e-7;

FOR_EACH_LEVEL void add(Block* y, const Block* a, double by, int count) {
  for (int k = 0; k < count; ++k) y[k] += a[k] * by;
}

// The impulse of a law with its derivatives in many directions. They come by the chain rule from those by each
// independent input of the law; on an edge, or for few directions, from the law in the directions themselves.
struct LawImpulse {
  int law, directions;

  std::array<SparseDual, AXES> operator()(const SparseDual* in) const {
    Bounded<double> law_input[LAW_INPUT_COUNT];
    for (int i = 0; i < LAW_INPUT_COUNT; ++i) law_input[i] = in[i].value;
    if (double& e = law_input[LAW_INPUT_RESTITUTION].value; law == LAW_COMPLIANT && e < LEAST_RESTITUTION)
      e = LEAST_RESTITUTION;
    Seeds seeds;
    Impulse y;
    std::array<SparseDual, AXES> P;
    P.fill(SparseDual(Bounded<double>{}));
    const int block_count = (directions + 3) / 4;
    const bool has_edges =
        std::any_of(in, in + LAW_INPUT_COUNT, [](const SparseDual& one) { return one.kinks | one.jumps; });
    if (has_edges || directions > DenseDerivatives::DIRECTIONS) {
      seed_independent(law_input, seeds);
      differentiate_law(law, law_input, seeds, &y);
      for (int i = 0; i < AXES; ++i) P[i] = by_chain_rule(in, y, i);
      if (!(y.kinks | y.jumps) && is_finite(y)) return P;
    }
    for (int from = 0; from < block_count; from += DenseDerivatives::BLOCKS) {
      int blocks = std::min(DenseDerivatives::BLOCKS, block_count - from);
      for (int i = 0; i < LAW_INPUT_COUNT; ++i)
        for (int k = 0; k < DenseDerivatives::DIRECTIONS; ++k)
          seeds[i][k] = k < 4 * blocks ? in[i].at(4 * from + k) : 0;
      differentiate_law(law, law_input, seeds, &y);
      for (int i = 0; i < AXES; ++i) {
        if (from == 0) P[i] = {y.value[i], P[i].kinks, P[i].jumps, SparseDerivatives(0, block_count)};
        std::memcpy(P[i].d.d + from, y.d[i], blocks * sizeof(Block));
        P[i].kinks |= y.kinks << 4 * from;
        P[i].jumps |= y.jumps << 4 * from;
      }
    }
    return P;
  }
  static bool is_finite(const Impulse& y) {
    for (const auto& row : y.d)
      for (double d : row)
        if (!(d - d == 0)) return false;
    return true;
  }
  SparseDual by_chain_rule(const SparseDual* in, const Impulse& y, int axis) const {
    SparseDual P(y.value[axis], 0, 0, SparseDerivatives(0, (directions + 3) / 4));
    std::fill_n(P.d.d, P.d.end, Block{});
    for (int k = 0; k < DenseDerivatives::DIRECTIONS; ++k) {
      const SparseDual& input = in[independent_inputs[k]];
      double by = y.d[axis][k];
      P.kinks |= by == 0 ? input.jumps : input.kinks;
      P.jumps |= by == 0 ? 0 : input.jumps;
      if (by != 0 && input.d.begin < input.d.end)
        add(P.d.d + input.d.begin, input.d.d + input.d.begin, by, input.d.end - input.d.begin);
    }
    return P;
  }
};

// x times a power of two, which is mostly 1.
inline double scaled(double x, int power) { return power ? std::ldexp(x, power) : x; }

// The derivatives of `n` impacts in `count` directions. The numbers of impact `at` are in column `at` of the arrays.
struct Differentiation {
  int law;
  const double *inputs, *directions;
  long n, count;
  long direction_stride;  // from the directions of an impact to those of the next; 0: shared
  double* jacobian;
  unsigned char* smoothness;

  void differentiate_impact(long at) const {
    for (long first = 0; first < count; first += SparseDerivatives::DIRECTIONS)
      in_directions(at, first, static_cast<int>(std::min<long>(SparseDerivatives::DIRECTIONS, count - first)));
  }
  // The derivatives of one impact in `width` directions.
  void in_directions(long at, long first, int width) const {
    arena = {};
    double x[INPUTS];
    for (int i = 0; i < INPUTS; ++i) x[i] = inputs[i * n + at];
    const bool is_scaled = !std::all_of(x, x + INPUTS, is_usual);
    const Units units = is_scaled ? Units::of(x, false) : Units{};
    auto power_of = [&](const signed char* dimensions) { return is_scaled ? units.power_of(dimensions) : 0; };
    SparseDerivatives parameters[PARAMETERS];
    for (int p = 0; p < PARAMETERS; ++p)
      parameters[p] = parameter(p, at, first, width, is_scaled ? power_of_parameter(p, units) : 0);
    SparseDual in[INPUTS], y[CHANGES];
    bool loses_inertia = false;
    for (int i = 0; i < INPUTS; ++i) {
      const double number = limited(i, scaled(x[i], power_of(input_units[i])));
      in[i] = SparseDual(Make<Bounded<double>>::constant(number));
      loses_inertia = loses_inertia || (is_inertia(i) && number == 0 && x[i] != 0);
    }
    if (loses_inertia) return refuse(at, first, width);
    seed(in, parameters);
    changes(in, y, nullptr, nullptr, LawImpulse{law, width});
    Edges kinks = 0, jumps = 0;
    for (int i = 0; i < RESULTS; ++i) {
      const int place = i < TWISTS ? AXES + i : i - TWISTS, power = -power_of(change_units[place]);
      const SparseDual& change = y[place];
      SparseDerivatives d = change.d;
      if (i < TWISTS)
        d = d.blended(1, parameters[VELOCITY + (i < TWISTS / 2 ? i : PARAMETERS_OF_BODY + i - TWISTS / 2)], 1);
      double* row = jacobian + (i * count + first) * n + at;
      const double* line = reinterpret_cast<const double*>(d.d);
      const int begin = std::min(4 * d.begin, width), end = std::max(begin, std::min(4 * d.end, width));
      for (int k = 0; k < begin; ++k) row[k * n] = 0;
      for (int k = begin; k < end; ++k) row[k * n] = scaled(line[k], power);
      for (int k = end; k < width; ++k) row[k * n] = 0;
      kinks |= change.kinks;
      jumps |= change.jumps;
    }
    for (int k = 0; k < width; ++k) smoothness[(first + k) * n + at] = (jumps >> k & 1) ? 2 : (kinks >> k & 1);
  }

 private:
  static constexpr int ORIENTATION = BODY_ORIENTATION_X, VELOCITY = BODY_VELOCITY_X - 1;

  // Whether products of some such numbers stay in the range of floats: if so, no other units are needed.
  static bool is_usual(double x) {
    return x == 0 || std::isinf(x) || (0x1p-60 < std::fabs(x) && std::fabs(x) < 0x1p60);
  }
  // Friction, and the threshold of restitution, no greater than matters: their squares are in the range of doubles.
  static double limited(int i, double x) {
    const bool may_be_any = i == IN_CONTACT + CONTACT_FRICTION || i == IN_MODEL + MODEL_RESTITUTION_THRESHOLD;
    return may_be_any ? std::fmin(x, 0x1p500) : x;
  }
  // Whether an input is a moment or product of inertia. In units in which it is 0, the body would not turn.
  static bool is_inertia(int i) { return i < IN_CONTACT && i % BODY >= BODY_INERTIA_XX && i % BODY <= BODY_INERTIA_ZZ; }
  // Leave some derivatives of an impact unknown.
  void refuse(long at, long first, int width) const {
    for (int i = 0; i < RESULTS; ++i)
      for (int k = 0; k < width; ++k) jacobian[(i * count + first + k) * n + at] = NAN;
    for (int k = 0; k < width; ++k) smoothness[(first + k) * n + at] = 0;
  }
  // The power of two that a parameter is multiplied by; 0 for a rotation.
  static int power_of_parameter(int p, const Units& units) {
    if (p == STIFFNESS) return 0;
    const int side = std::min(p / PARAMETERS_OF_BODY, 2), i = p - side * PARAMETERS_OF_BODY;
    if (side < 2 && i >= ORIENTATION && i < ORIENTATION + AXES) return 0;
    return units.power_of(input_units[side * BODY + i + (side < 2 && i > ORIENTATION)]);
  }
  static bool are_zero(const double* four) {
    std::uint64_t bits[4];
    std::memcpy(bits, four, sizeof bits);
    return (bits[0] | bits[1] | bits[2] | bits[3]) << 1 == 0;  // whatever the signs
  }
  // The components of some directions along a parameter, times a power of two; mostly only one is not 0. Not inlined: the
  // caller has no registers left.
  __attribute__((noinline)) SparseDerivatives parameter(int p, long at, long first, int width, int power) const {
    const long step = direction_stride ? n : 1;
    const double* row = directions + (p * count + first) * step + direction_stride * at;
    int begin = 0, end = width;
    while (begin + 4 <= end && step == 1 && are_zero(row + begin)) begin += 4;
    while (begin < end && row[begin * step] == 0) ++begin;
    while (begin + 4 <= end && step == 1 && are_zero(row + end - 4)) end -= 4;
    while (begin < end && row[(end - 1) * step] == 0) --end;
    if (begin == end) return {};
    SparseDerivatives d(begin / 4, (end + 3) / 4);
    double* line = reinterpret_cast<double*>(d.d);
    std::fill(line + 4 * d.begin, line + 4 * d.end, 0.0);
    for (int k = begin; k < end; ++k) line[k] = scaled(row[k * step], power);
    return d;
  }
  // Set the derivatives of the inputs from those of the parameters.
  static void seed(SparseDual* in, const SparseDerivatives* parameters) {
    for (int side = 0; side < 2; ++side) {
      SparseDual* body = in + side * BODY;
      const SparseDerivatives* given = parameters + side * PARAMETERS_OF_BODY;
      for (int i = 0; i < ORIENTATION; ++i) body[i].d = given[i];
      rotate(body + ORIENTATION, given + ORIENTATION);
      for (int i = ORIENTATION + 4; i < BODY; ++i) body[i].d = given[i - 1];
    }
    for (int i = 2 * BODY; i < IN_MODEL + MODEL_RESTITUTION_THRESHOLD; ++i) in[i].d = parameters[i - 2];
    in[IN_MODEL + MODEL_STIFFNESS_RATIO].d = parameters[STIFFNESS];
  }
  // The derivative of a quaternion q that rotates by v about the world axes: v q / 2.
  static void rotate(SparseDual* q, const SparseDerivatives* v) {
    double h[4];
    for (int i = 0; i < 4; ++i) h[i] = q[i].value.value / 2;
    for (int i = 0; i < AXES; ++i) {
      int j = (i + 1) % 3, k = (i + 2) % 3;
      q[i].d = v[i].blended(h[3], v[j].blended(h[k], v[k], -h[j]), 1);
    }
    q[3].d = v[0].blended(-h[0], v[1].blended(-h[1], v[2], -h[2]), 1);
  }
};

// differentiate(law, n, count, is_shared, inputs, directions, jacobian, smoothness): whether all derivatives are
// finite. is_shared says whether all impacts have the same directions. smoothness gets 0 (smooth), 1 (kink) or 2 (jump)
// for each impact and direction. Releases the GIL.
//   inputs (INPUTS, n), directions (PARAMETERS, count, n or 1), jacobian (CHANGES, count, n), smoothness (count, n)
PyObject* differentiate_all(PyObject*, PyObject* args) {
  Differentiation job{};
  int is_shared;
  PyObject *inputs, *directions, *jacobian, *smoothness;
  if (!PyArg_ParseTuple(args, "illpOOOO", &job.law, &job.n, &job.count, &is_shared, &inputs, &directions, &jacobian,
                        &smoothness))
    return nullptr;
  Array arrays[4];
  const Py_ssize_t size = sizeof(double) * job.n;
  job.direction_stride = is_shared ? 0 : 1;
  auto opens = [](Array& array, PyObject* o, Py_ssize_t bytes, bool writable) {
    return array.open(o, writable) && array.view.len == bytes;
  };
  if (!opens(arrays[0], inputs, INPUTS * size, false) ||
      !opens(arrays[1], directions, PARAMETERS * job.count * (is_shared ? sizeof(double) : size), false) ||
      !opens(arrays[2], jacobian, CHANGES * job.count * size, true) ||
      !opens(arrays[3], smoothness, job.count * job.n, true))
    return PyErr_Format(PyExc_TypeError, "differentiate(): arrays must be contiguous, and of the right sizes");
  job.inputs = arrays[0].at<double>();
  job.directions = arrays[1].at<double>();
  job.jacobian = arrays[2].at<double>();
  job.smoothness = arrays[3].at<unsigned char>();
  {
    ReleasedGil released;
    for (long at = 0; at < job.n; ++at) job.differentiate_impact(at);
  }
  return PyBool_FromLong(
      std::all_of(job.jacobian, job.jacobian + RESULTS * job.count * job.n, [](double d) { return d - d == 0; }));
}

PyMethodDef methods[] = {METHOD("differentiate", differentiate_all, METH_VARARGS), {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_derivatives", "", -1, methods};

}  // namespace

PyMODINIT_FUNC PyInit__derivatives() { return PyModule_Create(&definition); }
