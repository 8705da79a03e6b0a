// The compiled part of scenes: the arithmetic of one cluster of contacts. What is asked of it is written in
// collision_response/scene/.
//
// Impulses along the normals travel as bytes: a double-double for each contact.
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include "python.hpp"
#include "scene/compliant.hpp"
#include "scene/reflections.hpp"
#include "validity_everything.hpp"

namespace {

struct Types {
  PyTypeObject *vec3, *twist, *fraction;
  PyObject* regimes;  // by number
} types;

struct Cluster {
  PyObject_HEAD
  Assembly* scene;
  double energy;  // of the movable bodies
  bool idle, off_unit;
};

// A float, or an integer that is one. Python sees to the rest.
bool exact_float(PyObject* o, double& x) {
  if (PyFloat_Check(o)) {
    x = PyFloat_AS_DOUBLE(o);
    return true;
  }
  if (!PyLong_CheckExact(o)) return false;
  int overflow;
  long long whole = PyLong_AsLongLongAndOverflow(o, &overflow);
  x = static_cast<double>(whole);
  return !overflow && whole >= -(1LL << 53) && whole <= (1LL << 53);
}
bool floats(PyObject* o, int count, double* x) {
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != count) return false;
  for (int k = 0; k < count; ++k)
    if (!exact_float(PyTuple_GET_ITEM(o, k), x[k])) return false;
  return true;
}
bool read_body(PyObject* o, double* x) {
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != 7) return false;
  auto item = [o](int k) { return PyTuple_GET_ITEM(o, k); };
  double* q = x + IN_BODY_A_ORIENTATION_X;
  q[0] = q[1] = q[2] = 0;
  q[3] = 1;
  return exact_float(item(0), x[0]) && floats(item(1), 6, x + IN_BODY_A_INERTIA_XX) &&
         floats(item(2), 3, x + IN_BODY_A_POSITION_X) && (item(3) == Py_None || floats(item(3), 4, q)) &&
         floats(item(4), 3, x + IN_BODY_A_VELOCITY_X) && floats(item(5), 3, x + IN_BODY_A_ANGULAR_VELOCITY_X) &&
         floats(item(6), 3, x + IN_BODY_A_COM_X);
}
bool read_contact(PyObject* o, double* x) {
  return PyTuple_Check(o) && PyTuple_GET_SIZE(o) == 4 && floats(PyTuple_GET_ITEM(o, 0), 3, x) &&
         floats(PyTuple_GET_ITEM(o, 1), 3, x + 3) && exact_float(PyTuple_GET_ITEM(o, 2), x[6]) &&
         exact_float(PyTuple_GET_ITEM(o, 3), x[7]);
}

void dealloc(PyObject* self) {
  auto* cluster = reinterpret_cast<Cluster*>(self);
  delete cluster->scene;
  PyTypeObject* type = Py_TYPE(self);
  type->tp_free(self);
  Py_DECREF(type);
}

PyObject* cluster_type;

// assemble(bodies, pairs, contacts, copies): a cluster, of contacts each given so many times; or the place of the first contact at fault; or None if a number
// is no float.
PyObject* assemble(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4 || !PyList_Check(args[0]) || !PyList_Check(args[1]) || !PyList_Check(args[2]) || !PyList_Check(args[3]))
    return PyErr_Format(PyExc_TypeError, "assemble() takes four lists");
  Py_ssize_t bodies = PyList_GET_SIZE(args[0]), contacts = PyList_GET_SIZE(args[2]);
  std::vector<Given> given(bodies);
  std::vector<int> place(bodies, -1);
  auto* scene = new Assembly;
  double energies = 0;
  bool idle = false, off_unit = false;
  auto give_up = [&](PyObject* answer) {
    delete scene;
    return answer;
  };
  for (Py_ssize_t i = 0; i < bodies; ++i) {
    if (!read_body(PyList_GET_ITEM(args[0], i), given[i].x)) return give_up(Py_NewRef(Py_None));
    if (!given[i].rests()) given[i].look();
    if (!given[i].movable()) {
      scene->driven = scene->driven || given[i].moves();
      continue;
    }
    place[i] = scene->bodies++;
    energies += given[i].energy;
    idle = idle || given[i].idle;
    scene->given.push_back(given[i]);
  }
  scene->touches.reserve(contacts);
  for (Py_ssize_t k = 0; k < contacts; ++k) {
    double in[INPUTS] = {}, fault;
    bool shapes[5];
    PyObject* pair = PyList_GET_ITEM(args[1], k);
    long a = PyLong_AsLong(PyTuple_GET_ITEM(pair, 0)), b = PyLong_AsLong(PyTuple_GET_ITEM(pair, 1));
    std::copy(given[a].x, given[a].x + BODY, in);
    std::copy(given[b].x, given[b].x + BODY, in + BODY);
    if (!read_contact(PyList_GET_ITEM(args[2], k), in + IN_CONTACT_POSITION_X)) return give_up(Py_NewRef(Py_None));
    validity<double>(in, nullptr, &fault, shapes);
    if (fault != 0) return give_up(PyLong_FromSsize_t(k));
    off_unit = off_unit || shapes[4];
    scene->add(given[a], given[b], place[a], place[b], in + IN_CONTACT_POSITION_X,
               PyLong_AsDouble(PyList_GET_ITEM(args[3], k)));
    scene->add_plain(given[a], given[b], scene->touches.back());
  }
  scene->finish();
  auto* cluster = PyObject_New(Cluster, reinterpret_cast<PyTypeObject*>(cluster_type));
  if (!cluster) return give_up(nullptr);
  cluster->scene = scene;
  cluster->energy = energies;
  cluster->idle = idle;
  cluster->off_unit = off_unit;
  return reinterpret_cast<PyObject*>(cluster);
}

Assembly& of(PyObject* self) { return *reinterpret_cast<Cluster*>(self)->scene; }

PyObject* bytes(const std::vector<DD>& p) {
  return PyBytes_FromStringAndSize(reinterpret_cast<const char*>(p.data()), p.size() * sizeof(DD));
}
const DD* impulses(PyObject* self, PyObject* o) {
  if (PyBytes_Check(o) && PyBytes_GET_SIZE(o) == static_cast<Py_ssize_t>(of(self).count * sizeof(DD)))
    return reinterpret_cast<const DD*>(PyBytes_AS_STRING(o));
  PyErr_SetString(PyExc_TypeError, "these are no impulses of this cluster");
  return nullptr;
}
std::vector<double> rounded(const DD* p, int count) {
  std::vector<double> out(count);
  for (int i = 0; i < count; ++i) out[i] = p[i].h;
  return out;
}

// none(): no impulses.
PyObject* none(PyObject* self, PyObject*) { return bytes(std::vector<DD>(of(self).count, DD{0, 0})); }

// from_floats(p): impulses.
PyObject* from_floats(PyObject* self, PyObject* list) {
  std::vector<DD> p(of(self).count, DD{0, 0});
  for (int i = 0; i < of(self).count; ++i) {
    p[i].h = PyFloat_AsDouble(PySequence_Fast_GET_ITEM(list, i));
    if (PyErr_Occurred()) return nullptr;
  }
  return bytes(p);
}

// size(p): at least that of the velocities by impulses p, in the metric of kinetic energy.
PyObject* size(PyObject* self, PyObject* o) {
  const DD* p = impulses(self, o);
  return p ? PyFloat_FromDouble(of(self).size_of(p)) : nullptr;
}

// reflections(threshold, budget): how they ended, impulses, their error, the margin of decisions, and the restitution
// of all contacts, or None.
PyObject* reflect(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 2) return PyErr_Format(PyExc_TypeError, "reflections() takes 2 arguments");
  double threshold = PyFloat_AsDouble(args[0]);
  long budget = PyLong_AsLong(args[1]);
  if (PyErr_Occurred()) return nullptr;
  Reflected found = reflections(of(self), threshold, budget);
  PyObject* e = found.e < 0 ? Py_NewRef(Py_None) : PyFloat_FromDouble(found.e);
  return Py_BuildValue("iNddN", static_cast<int>(found.end), bytes(found.p), found.error, found.margin, e);
}

PyObject* vector(const double* x) { return tuple_of(types.vec3, x, 3); }
PyObject* twist(const double* x) { return twist_of(types.twist, types.vec3, x); }

// A size in the metric of kinetic energy, in the norm of error_bound: at most how many times it is.
double in_norm(const double* body) {
  double mass = body[0], xx = body[1], xy = body[2], xz = body[3], yy = body[4], yz = body[5], zz = body[6];
  double trace = xx + yy + zz, c = 0;
  for (int k = 0; k < 3; ++k) c += body[IN_BODY_A_COM_X + k] * body[IN_BODY_A_COM_X + k];
  double shift = 2 * mass * c, base = c > 0 ? 2 : 1;
  if (!(trace > 0)) return std::sqrt(base);
  if (xy == 0 && xz == 0 && yz == 0) {
    double least = INFINITY;
    for (double moment : {xx, yy, zz})
      if (moment > trace * 0x1p-48) least = std::fmin(least, moment);
    return std::sqrt(std::fmax(base, (shift + trace / 3) / least));
  }
  double det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  double inverse = det > trace * trace * trace * 0x1p-46 ? (yy * zz - yz * yz + xx * zz - xz * xz + xx * yy - xy * xy) / det * (1 + 0x1p-4) : INFINITY;
  if (inverse == INFINITY) inverse = 4 / trace * 0x1p46;
  return std::sqrt(std::fmax(base, (shift + trace / 3) * inverse));
}

enum Regime { REGIME_SEPARATING = 1, REGIME_STICKING, REGIME_SLIDING, REGIME_REVERSED };

// Of slip, relative to the fastest speed before, and of what friction lacks to its limit: this is none.
constexpr double AT_REST = 0x1p-20;

// answer(p, tangential, error, by_slip): of normal impulses, and of tangential ones (pairs of floats in the axes of
// each contact, or None): the changes and the twists of the movable bodies, the impulses, the velocities before and
// after, the regimes (by_slip: sticking is no slip, else it is less than all friction), the energies before and
// after, what restitution and friction lost, the relative error, whether a body turned about an axis without
// inertia, and whether a quaternion was not of unit length.
PyObject* answer(PyObject* self, PyObject* const* args, Py_ssize_t argc) {
  const DD* p = argc == 4 ? impulses(self, args[0]) : nullptr;
  if (!p) return nullptr;
  const Assembly& scene = of(self);
  int count = scene.count;
  double error = PyFloat_AsDouble(args[2]);
  bool rubs = args[1] != Py_None;
  std::vector<Axes> P(count, Axes{0, 0, 0});
  std::vector<double> reported = rounded(p, count);
  if (rubs)
    for (int i = 0; i < count; ++i)
      for (int k = 0; k < 2; ++k) P[i][1 + k] = PyFloat_AsDouble(PyList_GET_ITEM(args[1], 2 * i + k));
  if (PyErr_Occurred()) return nullptr;
  std::vector<N> sums = scene.changes(p);
  Motion motion(scene), across(scene);
  for (int i = 0; i < count; ++i) {
    if (rubs) across.push(i, P[i]);
    motion.push(i, {reported[i] * scene.touches[i].length, P[i][1], P[i][2]});
  }
  if (!rubs) scene.least_norm(reported, true);

  PyObject *changes = PyList_New(scene.bodies), *after = PyList_New(scene.bodies), *pushes = PyList_New(count);
  double energies = reinterpret_cast<Cluster*>(self)->energy, energies_after = 0, largest = 0, worst = 0, rounding = 0;
  for (int b = 0; b < scene.bodies; ++b) {
    const double* body = scene.given[b].x;
    double change[6] = {};
    if (rubs) scene.given[b].twist_of(&across.y[6 * b], change);
    for (int k = 0; k < 6; ++k) change[k] += high(sums[6 * b + k]);
    Given moved = scene.given[b];
    for (int k = 0; k < 6; ++k) moved.x[IN_BODY_A_VELOCITY_X + k] += change[k];
    moved.fill(moved.plain);
    energies_after += moved.energy;
    double arm = (body[1] + body[4] + body[6]) / 3, size = 0, off = 0;
    for (int k = 0; k < 6; ++k) {
      double weight = k < 3 ? body[0] : arm;
      size += weight * change[k] * change[k];
      double lost = width(sums[6 * b + k]) + (std::fabs(change[k]) + std::fabs(high(sums[6 * b + k]))) * 0x1p-53 * (rubs ? 4 : 1);
      off += weight * lost * lost;
    }
    largest = std::fmax(largest, std::sqrt(size));
    rounding = std::fmax(rounding, std::sqrt(off));
    worst = std::fmax(worst, error * in_norm(body));
    PyList_SET_ITEM(changes, b, twist(change));
    PyList_SET_ITEM(after, b, twist(moved.x + IN_BODY_A_VELOCITY_X));
  }
  PyObject *before = PyList_New(count), *then = PyList_New(count), *regimes = PyList_New(count);
  std::vector<N> u = scene.velocities(p);
  double lost_n = 0, lost_t = 0, fastest = 0;
  for (const Touch& touch : scene.touches)
    fastest = std::fmax(fastest, std::hypot(touch.plain[0].velocity, touch.plain[1].velocity, touch.plain[2].velocity));
  for (int i = 0; i < count; ++i) {
    const Touch& touch = scene.touches[i];
    double push[3];
    for (int k = 0; k < 3; ++k) push[k] = reported[i] * touch.normal[k];
    Axes u_before{touch.plain[0].velocity, touch.plain[1].velocity, touch.plain[2].velocity};
    Axes u_after = motion.velocity(i);
    if (!rubs) u_after[0] = high(u[i]) / touch.length;
    double speed = std::hypot(u_after[1], u_after[2]), back = u_before[1] * u_after[1] + u_before[2] * u_after[2];
    double across = std::hypot(P[i][1], P[i][2]), most = touch.mu * p[i].h * touch.length;
    if (rubs) {
      double x = touch.normal[0] / touch.length, y = touch.normal[1] / touch.length, z = touch.normal[2] / touch.length;
      double sign = x < 0 ? -1 : 1, c = -1 / (sign + x), d = y * z * c;
      double t1[3] = {-(sign * y), 1 + sign * (y * y * c), sign * d}, t2[3] = {-z, d, sign + z * z * c};
      for (int k = 0; k < 3; ++k) push[k] += P[i][1] * t1[k] + P[i][2] * t2[k];
    }
    lost_n -= p[i].h * touch.length * (u_before[0] + u_after[0]) / 2;
    lost_t -= (P[i][1] * (u_before[1] + u_after[1]) + P[i][2] * (u_before[2] + u_after[2])) / 2;
    PyList_SET_ITEM(pushes, i, vector(push));
    PyList_SET_ITEM(before, i, PyFloat_FromDouble(u_before[0]));
    PyList_SET_ITEM(then, i, PyFloat_FromDouble(u_after[0]));
    Regime regime = back < 0 ? REGIME_REVERSED : REGIME_SLIDING;
    if (push[0] == 0 && push[1] == 0 && push[2] == 0) regime = REGIME_SEPARATING;
    else if (touch.mu == 0) regime = REGIME_SLIDING;
    else if (args[3] == Py_True ? speed <= AT_REST * fastest : across < (1 - AT_REST) * most) regime = REGIME_STICKING;
    PyList_SET_ITEM(regimes, i, Py_NewRef(PyTuple_GET_ITEM(types.regimes, regime)));
  }
  double bound = largest > 0 ? (worst + rounding) / std::fmax(largest - worst - rounding, 0) : (worst > 0 ? INFINITY : 0);
  if (!(bound == bound)) bound = INFINITY;
  auto* cluster = reinterpret_cast<Cluster*>(self);
  return Py_BuildValue("NNNNNN(dddd)dNN", changes, after, pushes, before, then, regimes, energies, energies_after, lost_n, lost_t, bound, PyBool_FromLong(cluster->idle), PyBool_FromLong(cluster->off_unit));
}

PyObject* friction_answer(const Friction& friction, const Assembly& scene) {
  if (!friction.found) Py_RETURN_NONE;
  std::vector<DD> p(scene.count, DD{0, 0});
  PyObject* tangential = PyList_New(2 * scene.count);
  for (int i = 0; i < scene.count; ++i) {
    p[i].h = friction.P[i][0] / scene.touches[i].length;
    for (int k = 0; k < 2; ++k) PyList_SET_ITEM(tangential, 2 * i + k, PyFloat_FromDouble(friction.P[i][1 + k]));
  }
  return Py_BuildValue("NNd", bytes(p), tangential, friction.error);
}

// least_work(p), one_step(friction): impulses along the normals, across them, and the error; None if there are none.
PyObject* with_least_work(PyObject* self, PyObject* o) {
  const DD* p = impulses(self, o);
  if (!p) return nullptr;
  std::vector<double> normal = rounded(p, of(self).count);
  of(self).least_norm(normal, false);
  return friction_answer(least_work(of(self), normal), of(self));
}
PyObject* in_one_step(PyObject* self, PyObject* rubs) {
  const Assembly& scene = of(self);
  if (rubs == Py_True) return friction_answer(one_step(scene), scene);
  Assembly::Projection found = scene.rebound();
  if (found.found != Found::LEAST) Py_RETURN_NONE;
  return Py_BuildValue("NOd", bytes(found.q), Py_None, found.error);
}

// compress(stiffness, exponent, tolerance or step, budget, friction): as above, along a law with compliance.
PyObject* compress(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 5) return PyErr_Format(PyExc_TypeError, "compress() takes 5 arguments");
  const Assembly& scene = of(self);
  std::vector<double> ratios;
  for (int i = 0; i < scene.count; ++i) ratios.push_back(PyFloat_AsDouble(PyList_GET_ITEM(args[0], i)));
  Compliant law(scene, PyFloat_AsDouble(args[1]), ratios);
  double fineness = PyFloat_AsDouble(args[2]);
  long budget = PyLong_AsLong(args[3]);
  if (PyErr_Occurred()) return nullptr;
  Friction result;
  result.P.assign(scene.count, Axes{0, 0, 0});
  bool rubs = args[4] == Py_True;
  Py_BEGIN_ALLOW_THREADS;
  if (rubs) {
    result.found = law.follow_with_friction(fineness, budget, result.P);
  } else {
    std::vector<double> p;
    result.found = law.follow(fineness, budget, p);
    for (size_t i = 0; i < p.size(); ++i) result.P[i][0] = p[i];
  }
  Py_END_ALLOW_THREADS;
  return friction_answer(result, scene);
}

PyObject* get_locked(PyObject* self, void*) { return PyBool_FromLong(of(self).locked); }
PyObject* get_floats(PyObject* self, void*) { return PyLong_FromLong(of(self).count); }

#define FAST(name, function) {name, reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(function)), METH_FASTCALL, ""}
PyMethodDef methods[] = {
    {"none", none, METH_NOARGS, ""},
    {"from_floats", from_floats, METH_O, ""},
    {"size", size, METH_O, ""},
    FAST("reflections", reflect),
    FAST("answer", answer),
    {"least_work", with_least_work, METH_O, ""},
    {"one_step", in_one_step, METH_O, ""},
    FAST("compress", compress),
    {}};
PyGetSetDef fields[] = {{"locked", get_locked, nullptr, "", nullptr}, {"count", get_floats, nullptr, "", nullptr}, {}};
PyType_Slot slots[] = {{Py_tp_dealloc, reinterpret_cast<void*>(dealloc)}, {Py_tp_methods, methods}, {Py_tp_getset, fields}, {}};
PyType_Spec spec = {"collision_response.kernels._scene.Cluster", sizeof(Cluster), 0, Py_TPFLAGS_DEFAULT, slots};

// Whether there is a fraction in it.
bool holds_fraction(PyObject* o) {
  if (PyFloat_CheckExact(o) || o == Py_None) return false;
  if (PyTuple_Check(o) || PyList_Check(o)) {
    for (Py_ssize_t i = 0; i < PySequence_Fast_GET_SIZE(o); ++i)
      if (holds_fraction(PySequence_Fast_GET_ITEM(o, i))) return true;
    return false;
  }
  return PyObject_TypeCheck(o, types.fraction);
}
PyObject* is_rational(PyObject*, PyObject* o) { return PyBool_FromLong(holds_fraction(o)); }

PyObject* setup(PyObject*, PyObject* args) {
  PyObject *vec3, *twist, *fraction;
  if (!PyArg_ParseTuple(args, "OOOO", &vec3, &twist, &fraction, &types.regimes)) return nullptr;
  types.fraction = reinterpret_cast<PyTypeObject*>(fraction);
  types.vec3 = reinterpret_cast<PyTypeObject*>(vec3);
  types.twist = reinterpret_cast<PyTypeObject*>(twist);
  Py_INCREF(args);  // keeps all of them for ever
  Py_RETURN_NONE;
}

PyMethodDef functions[] = {FAST("assemble", assemble), {"is_rational", is_rational, METH_O, ""}, {"setup", setup, METH_VARARGS, ""}, {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_scene", "", -1, functions, nullptr, nullptr, nullptr, nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__scene() {
  cluster_type = PyType_FromSpec(&spec);
  PyObject* module = cluster_type ? PyModule_Create(&definition) : nullptr;
  if (module && PyModule_AddObjectRef(module, "Cluster", cluster_type) < 0) Py_CLEAR(module);
  return module;
}
