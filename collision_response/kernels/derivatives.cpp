// The compiled part of derivatives: arrays in, arrays out. What is asked of it is written in
// collision_response/derivatives/.
#include "arrays.hpp"
#include "python_objects.hpp"

#include <algorithm>
#include <array>

#include "derivatives.hpp"

#include "changes.hpp"

#define X(formula) extern "C" void derivatives_##formula(const Bounded<double>*, const Seeds&, Impulse*);
EACH_FORMULA(X)
#undef X

namespace {

using Wide = Dual<Bounded<double>, Many>;
static_assert(int(SEEN) == int(SEEN_BY_LAW));

// What an impact is differentiated by: its inputs, but for three rotations about the axes of the world instead of
// the four numbers of a quaternion, and of the model what laws ask for.
enum { PARAMETERS_OF_BODY = BODY - 1, OF_CONTACT = 2 * PARAMETERS_OF_BODY, STIFFNESS = IN_MODEL_RESTITUTION_THRESHOLD - 2, PARAMETERS };
enum { TWISTS = CHANGES - AXES, RESULTS = CHANGES };

DerivativeKernel kernel_of(int law) {
#define X(formula) derivatives_##formula,
  static const DerivativeKernel kernels[] = {EACH_FORMULA(X)};
#undef X
  return kernels[formula_of[law]];
}

// Without friction every law is FRICTIONLESS, and so are its derivatives, but those by friction: there slip and
// stick meet in one point, where a law takes either branch. Soft springs then do as hard ones.
void differentiate(int law, const Bounded<double>* seen, Seeds& seeds, Impulse* y) {
  double(&friction)[Few::DIRECTIONS] = seeds[SEEN_FRICTION];
  if (seen[SEEN_FRICTION].value > 0 || law == LAW_FRICTIONLESS) return kernel_of(law)(seen, seeds, y);
  double by_friction[Few::DIRECTIONS];
  std::memcpy(by_friction, friction, sizeof friction);
  std::memset(friction, 0, sizeof friction);
  kernel_of(LAW_FRICTIONLESS)(seen, seeds, y);
  if (std::all_of(by_friction, by_friction + Few::DIRECTIONS, [](double d) { return d == 0; })) return;
  std::memset(seeds, 0, sizeof seeds);
  std::memcpy(friction, by_friction, sizeof friction);
  Impulse more;
  kernel_of(law == LAW_COMPLIANT ? LAW_ROUTH_STRONGE : law)(seen, seeds, &more);
  y->kinks |= more.kinks;
  y->jumps |= more.jumps;
  for (int i = 0; i < AXES; ++i)
    for (int k = 0; k < Few::DIRECTIONS; ++k) y->d[i][k] += more.d[i][k];
}

// The directions in which each number that a law sees changes alone: but n.u and n.Kn change with n, u and K.
enum { BY_N, BY_U = BY_N + AXES, BY_K = BY_U + AXES, BY_REST = BY_K + 6 };
const int free_numbers[Few::DIRECTIONS] = {
    SEEN_N, SEEN_N + 1, SEEN_N + 2, SEEN_U, SEEN_U + 1, SEEN_U + 2, SEEN_K, SEEN_K + 1, SEEN_K + 2, SEEN_K + 3, SEEN_K + 4, SEEN_K + 5,
    SEEN_RESTITUTION, SEEN_FRICTION, SEEN_SETTINGS, SEEN_SETTINGS + IN_MODEL_STIFFNESS_RATIO - IN_MODEL_TANGENTIAL_RESTITUTION};

void seed_each(const Bounded<double>* seen, Seeds& seeds) {
  static const int place[AXES][AXES] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  std::memset(seeds, 0, sizeof seeds);
  for (int k = 0; k < Few::DIRECTIONS; ++k) seeds[free_numbers[k]][k] = 1;
  for (int i = 0; i < AXES; ++i) {
    double n_i = seen[SEEN_N + i].value;
    seeds[SEEN_N_U][BY_N + i] = seen[SEEN_U + i].value;
    seeds[SEEN_N_U][BY_U + i] = n_i;
    for (int j = 0; j < AXES; ++j) {
      double n_j = seen[SEEN_N + j].value;
      seeds[SEEN_N_KN][BY_N + i] += 2 * n_j * seen[SEEN_K + place[i][j]].value;
      seeds[SEEN_N_KN][BY_K + place[i][j]] += n_i * n_j;
    }
  }
}

// Restitution less than this is taken as this by COMPLIANT, whose springs would be too stiff: it has a derivative
// by e at 0 too, and that is as far off.
constexpr double LEAST_RESTITUTION = 1e-7;

FOR_EACH_LEVEL void add(Block* y, const Block* a, double by, int count) {
  for (int k = 0; k < count; ++k) y[k] += a[k] * by;
}

// The impulse of a law, in many directions: by each number that it sees, and what those change. On an edge, and in
// few directions, as they are.
struct Blow {
  int law, directions;

  std::array<Wide, AXES> operator()(const Wide* in) const {
    Bounded<double> seen[SEEN];
    for (int i = 0; i < SEEN; ++i) seen[i] = in[i].value;
    if (double& e = seen[SEEN_RESTITUTION].value; law == LAW_COMPLIANT && e < LEAST_RESTITUTION) e = LEAST_RESTITUTION;
    Seeds seeds;
    Impulse y;
    std::array<Wide, AXES> P;
    P.fill(Wide(Bounded<double>{}));
    const int all = (directions + 3) / 4;
    const bool has_edges = std::any_of(in, in + SEEN, [](const Wide& one) { return one.kinks | one.jumps; });
    if (has_edges || directions > Few::DIRECTIONS) {
      seed_each(seen, seeds);
      differentiate(law, seen, seeds, &y);
      for (int i = 0; i < AXES; ++i) P[i] = by_each(in, y, i);
      if (!(y.kinks | y.jumps) && is_finite(y)) return P;
    }
    for (int from = 0; from < all; from += Few::BLOCKS) {
      int blocks = std::min(Few::BLOCKS, all - from);
      for (int i = 0; i < SEEN; ++i)
        for (int k = 0; k < Few::DIRECTIONS; ++k) seeds[i][k] = k < 4 * blocks ? in[i].at(4 * from + k) : 0;
      differentiate(law, seen, seeds, &y);
      for (int i = 0; i < AXES; ++i) {
        if (from == 0) P[i] = {y.value[i], P[i].kinks, P[i].jumps, Many(0, all)};
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
  Wide by_each(const Wide* in, const Impulse& y, int axis) const {
    Wide P(y.value[axis], 0, 0, Many(0, (directions + 3) / 4));
    std::fill_n(P.d.d, P.d.to, Block{});
    for (int k = 0; k < Few::DIRECTIONS; ++k) {
      const Wide& one = in[free_numbers[k]];
      double by = y.d[axis][k];
      P.kinks |= by == 0 ? one.jumps : one.kinks;
      P.jumps |= by == 0 ? 0 : one.jumps;
      if (by != 0 && one.d.from < one.d.to) add(P.d.d + one.d.from, one.d.d + one.d.from, by, one.d.to - one.d.from);
    }
    return P;
  }
};

// One impact of many: its inputs lie `n` apart from one another.
struct Job {
  int law;
  const double *inputs, *directions;
  long n, count, apart;  // apart: of the directions of two impacts; 0: one for all
  double* jacobian;
  unsigned char* smoothness;

  void run(long at) const {
    for (long from = 0; from < count; from += Many::DIRECTIONS) some(at, from, static_cast<int>(std::min<long>(Many::DIRECTIONS, count - from)));
  }
  void some(long at, long from, int width) const {
    room = {};
    Many parameters[PARAMETERS];
    for (int p = 0; p < PARAMETERS; ++p) parameters[p] = parameter(p, at, from, width);
    Wide in[INPUTS], y[CHANGES];
    for (int i = 0; i < INPUTS; ++i) in[i] = Wide(Make<Bounded<double>>::constant(inputs[i * n + at]));
    seed(in, parameters);
    changes(in, y, nullptr, nullptr, Blow{law, width});
    Edges kinks = 0, jumps = 0;
    for (int i = 0; i < RESULTS; ++i) {
      const Wide& change = y[i < TWISTS ? AXES + i : i - TWISTS];
      Many d = change.d;
      if (i < TWISTS) d = d.blended(1, parameters[VELOCITY + (i < TWISTS / 2 ? i : PARAMETERS_OF_BODY + i - TWISTS / 2)], 1);
      double* row = jacobian + (i * count + from) * n + at;
      double line[Many::DIRECTIONS] = {};
      if (d.from < d.to) std::memcpy(line + 4 * d.from, d.d + d.from, (d.to - d.from) * sizeof(Block));
      for (int k = 0; k < width; ++k) row[k * n] = line[k];
      kinks |= change.kinks;
      jumps |= change.jumps;
    }
    for (int k = 0; k < width; ++k) smoothness[(from + k) * n + at] = (jumps >> k & 1) ? 2 : (kinks >> k & 1);
  }

 private:
  static constexpr int ORIENTATION = IN_BODY_A_ORIENTATION_X, VELOCITY = IN_BODY_A_VELOCITY_X - 1;

  // How a parameter changes in some directions.
  Many parameter(int p, long at, long from, int width) const {
    long step = apart ? n : 1;
    const double* row = directions + (p * count + from) * step + apart * at;
    double line[Many::DIRECTIONS];
    if (step == 1) std::memcpy(line, row, width * sizeof *row);
    else for (int k = 0; k < width; ++k) line[k] = row[k * step];
    int first = 0, last = (width + 3) / 4;
    for (int k = width; k < 4 * last; ++k) line[k] = 0;
    auto is_zero = [&](int block) {
      std::uint64_t bits[4];
      std::memcpy(bits, line + 4 * block, sizeof bits);
      return !(bits[0] | bits[1] | bits[2] | bits[3]);
    };
    while (first < last && is_zero(first)) ++first;
    while (first < last && is_zero(last - 1)) --last;
    Many d(first, last);
    if (first < last) std::memcpy(d.d + first, line + 4 * first, (last - first) * sizeof(Block));
    return d;
  }
  // The changes of parameters as changes of inputs.
  static void seed(Wide* in, const Many* parameters) {
    for (int body = 0; body < 2; ++body, in += BODY, parameters += PARAMETERS_OF_BODY) {
      for (int i = 0; i < ORIENTATION; ++i) in[i].d = parameters[i];
      turn(in + ORIENTATION, parameters + ORIENTATION);
      for (int i = ORIENTATION + 4; i < BODY; ++i) in[i].d = parameters[i - 1];
    }
    in -= 2 * BODY;
    for (int i = 2 * BODY; i < IN_MODEL_RESTITUTION_THRESHOLD; ++i) in[i].d = (parameters - OF_CONTACT)[i - 2];
    in[IN_MODEL_STIFFNESS_RATIO].d = (parameters - OF_CONTACT)[STIFFNESS];
  }
  // A quaternion turned by v about the axes of the world: half of v q.
  static void turn(Wide* q, const Many* v) {
    double h[4];
    for (int i = 0; i < 4; ++i) h[i] = q[i].value.value / 2;
    for (int i = 0; i < AXES; ++i) {
      int j = (i + 1) % 3, k = (i + 2) % 3;
      q[i].d = v[i].blended(h[3], v[j].blended(h[k], v[k], -h[j]), 1);
    }
    q[3].d = v[0].blended(-h[0], v[1].blended(-h[1], v[2], -h[2]), 1);
  }
};

// differentiate(law, n, count, one_for_all, inputs, directions, jacobian, smoothness), without the GIL: whether all
// derivatives are finite.
//   inputs (INPUTS, n), directions (PARAMETERS, count, n or 1), jacobian (CHANGES, count, n), smoothness (count, n)
PyObject* differentiate_all(PyObject*, PyObject* args) {
  Job job{};
  int one_for_all;
  PyObject *inputs, *directions, *jacobian, *smoothness;
  if (!PyArg_ParseTuple(args, "illpOOOO", &job.law, &job.n, &job.count, &one_for_all, &inputs, &directions, &jacobian, &smoothness)) return nullptr;
  Array of[4];
  Py_ssize_t size = sizeof(double) * job.n, apart = one_for_all ? 0 : 1;
  auto is = [](Array& array, PyObject* o, Py_ssize_t bytes, bool writable) { return array.open(o, writable) && array.view.len == bytes; };
  if (!is(of[0], inputs, INPUTS * size, false) || !is(of[1], directions, PARAMETERS * job.count * (apart ? size : sizeof(double)), false) ||
      !is(of[2], jacobian, CHANGES * job.count * size, true) || !is(of[3], smoothness, job.count * job.n, true))
    return PyErr_Format(PyExc_TypeError, "differentiate(): arrays must be contiguous, and of the right sizes");
  job.apart = apart;
  job.inputs = of[0].at<double>();
  job.directions = of[1].at<double>();
  job.jacobian = of[2].at<double>();
  job.smoothness = of[3].at<unsigned char>();
  {
    ReleasedGil released;
    for (long at = 0; at < job.n; ++at) job.run(at);
  }
  return PyBool_FromLong(std::all_of(job.jacobian, job.jacobian + RESULTS * job.count * job.n, [](double d) { return d - d == 0; }));
}

PyMethodDef methods[] = {{"differentiate", RaisesMemoryError<differentiate_all>::call, METH_VARARGS, ""}, {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_derivatives", "", -1, methods};

}  // namespace

PyMODINIT_FUNC PyInit__derivatives() { return PyModule_Create(&definition); }
