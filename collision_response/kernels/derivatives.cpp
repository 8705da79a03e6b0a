// The compiled part of derivatives: arrays in, arrays out. What is asked of it is written in
// collision_response/derivatives/.
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <algorithm>

#include "derivatives.hpp"

#define X(law, number) extern "C" void derivatives_##law(const double*, const Seeds&, int, Derivatives*);
EACH_OF_LAWS(X)
#undef X

namespace {

DerivativeKernel kernel_of(int law) {
#define X(law, number) {number, derivatives_##law},
  static const struct { int law; DerivativeKernel kernel; } table[] = {EACH_OF_LAWS(X)};
#undef X
  for (const auto& row : table)
    if (row.law == law) return row.kernel;
  return nullptr;
}

// A quaternion turned by v about the axes of the world: half of v q.
void turn(const double* q, const double* v, double* d) {
  for (int i = 0; i < 3; ++i) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    d[i] = (v[i] * q[3] + (v[j] * q[k] - v[k] * q[j])) / 2;
  }
  d[3] = -(v[0] * q[0] + v[1] * q[1] + v[2] * q[2]) / 2;
}

// Directions of parameters as directions of inputs.
void seed(const double* x, const double (*direction)[DIRECTIONS], int directions, Seeds& seeds) {
  std::memset(seeds, 0, sizeof seeds);
  for (int i = 0, p = 0; i < IN_MODEL_RESTITUTION_THRESHOLD; ++i) {
    int of_body = i < 2 * BODY ? i % BODY : -1;
    if (of_body != IN_BODY_A_ORIENTATION_X) {
      std::memcpy(seeds[i], direction[p++], directions * sizeof(double));
      continue;
    }
    for (int k = 0; k < directions; ++k) {
      double v[3] = {direction[p][k], direction[p + 1][k], direction[p + 2][k]}, d[4];
      turn(x + i, v, d);
      for (int part = 0; part < 4; ++part) seeds[i + part][k] = d[part];
    }
    p += 3;
    i += 3;
  }
}

// Without friction every law is FRICTIONLESS, and so are its derivatives, but those by friction: there slip and
// stick meet in one point, where a law takes either branch.
void differentiate(int law, const double* x, Seeds& seeds, int directions, Derivatives* y) {
  DerivativeKernel kernel = kernel_of(law);
  double(&friction)[DIRECTIONS] = seeds[IN_CONTACT_FRICTION];
  if (x[IN_CONTACT_FRICTION] > 0 || law == LAW_FRICTIONLESS) return kernel(x, seeds, directions, y);
  double by_friction[DIRECTIONS];
  std::memcpy(by_friction, friction, sizeof friction);
  std::memset(friction, 0, sizeof friction);
  kernel_of(LAW_FRICTIONLESS)(x, seeds, directions, y);
  if (std::all_of(by_friction, by_friction + directions, [](double d) { return d == 0; })) return;
  std::memset(seeds, 0, sizeof seeds);
  std::memcpy(friction, by_friction, sizeof friction);
  Derivatives more;
  kernel(x, seeds, directions, &more);
  y->kinks |= more.kinks;
  y->jumps |= more.jumps;
  for (int i = 0; i < CHANGES; ++i)
    for (int k = 0; k < directions; ++k) y->d[i][k] += more.d[i][k];
}

enum { IMPULSE = 3, TWISTS = CHANGES - IMPULSE };

// One impact of many: its inputs lie `n` apart from one another.
struct Job {
  int law;
  const double *inputs, *directions;
  long n, count, apart;  // apart: of the directions of two impacts; 0: one for all
  double* jacobian;
  unsigned char* smoothness;

  void run(long at) const {
    double x[INPUTS];
    for (int i = 0; i < INPUTS; ++i) x[i] = inputs[i * n + at];
    for (long from = 0; from < count; from += DIRECTIONS) some(x, at, from, static_cast<int>(std::min<long>(DIRECTIONS, count - from)));
  }
  void some(const double* x, long at, long from, int width) const {
    double direction[PARAMETERS][DIRECTIONS];
    Seeds seeds;
    Derivatives y;
    for (int p = 0; p < PARAMETERS; ++p) {
      const double* row = directions + (p * count + from) * (apart ? n : 1) + apart * at;
      for (int k = 0; k < width; ++k) direction[p][k] = row[apart ? k * n : k];
    }
    seed(x, direction, width, seeds);
    double before[TWISTS][DIRECTIONS];
    for (int i = 0; i < TWISTS; ++i) std::memcpy(before[i], seeds[(i < TWISTS / 2 ? i : BODY + i - TWISTS / 2) + IN_BODY_A_VELOCITY_X], sizeof before[i]);
    differentiate(law, x, seeds, width, &y);
    for (int k = 0; k < width; ++k) {
      auto row = [&](int i) -> double& { return jacobian[(i * count + from + k) * n + at]; };
      for (int i = 0; i < TWISTS; ++i) row(i) = before[i][k] + y.d[IMPULSE + i][k];
      for (int i = 0; i < IMPULSE; ++i) row(TWISTS + i) = y.d[i][k];
      smoothness[(from + k) * n + at] = (y.jumps >> k & 1) ? 2 : (y.kinks >> k & 1);
    }
  }
};

struct Array {
  Py_buffer view{};
  ~Array() { PyBuffer_Release(&view); }
  bool open(PyObject* o, Py_ssize_t size, bool writable) {
    if (PyObject_GetBuffer(o, &view, PyBUF_C_CONTIGUOUS | (writable ? PyBUF_WRITABLE : 0))) return false;
    if (view.len == size) return true;
    PyErr_Format(PyExc_ValueError, "%zd bytes where %zd are due", view.len, size);
    return false;
  }
};

// differentiate(law, n, count, one_for_all, inputs, directions, jacobian, smoothness), without the GIL:
//   inputs (INPUTS, n), directions (PARAMETERS, count, n or 1), jacobian (CHANGES, count, n), smoothness (count, n)
PyObject* differentiate_all(PyObject*, PyObject* args) {
  Job job{};
  int one_for_all;
  PyObject *inputs, *directions, *jacobian, *smoothness;
  if (!PyArg_ParseTuple(args, "illpOOOO", &job.law, &job.n, &job.count, &one_for_all, &inputs, &directions, &jacobian, &smoothness)) return nullptr;
  if (!kernel_of(job.law)) return PyErr_Format(PyExc_LookupError, "no kernel of law %d", job.law);
  Array of[4];
  Py_ssize_t size = sizeof(double) * job.n, apart = one_for_all ? 0 : 1;
  if (!of[0].open(inputs, INPUTS * size, false) || !of[1].open(directions, PARAMETERS * job.count * (apart ? size : sizeof(double)), false) ||
      !of[2].open(jacobian, CHANGES * job.count * size, true) || !of[3].open(smoothness, job.count * job.n, true))
    return nullptr;
  job.apart = apart;
  job.inputs = static_cast<const double*>(of[0].view.buf);
  job.directions = static_cast<const double*>(of[1].view.buf);
  job.jacobian = static_cast<double*>(of[2].view.buf);
  job.smoothness = static_cast<unsigned char*>(of[3].view.buf);
  Py_BEGIN_ALLOW_THREADS;
  for (long at = 0; at < job.n; ++at) job.run(at);
  Py_END_ALLOW_THREADS;
  Py_RETURN_NONE;
}

PyMethodDef methods[] = {{"differentiate", differentiate_all, METH_VARARGS, ""}, {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_derivatives", "", -1, methods};

}  // namespace

PyMODINIT_FUNC PyInit__derivatives() { return PyModule_Create(&definition); }
