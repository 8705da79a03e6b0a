// The compiled part of scenes: the arithmetic of one cluster of contacts. What is asked of it is written in
// collision_response/scene/.
//
// Impulses along the normals travel as bytes: a double-double for each contact.
#include "arrays.hpp"
#include "python.hpp"
#define WITH_TABLES
#include "scene/compliant.hpp"
#include "scene/many.hpp"
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
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != 8) return false;
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
  return PyTuple_Check(o) && PyTuple_GET_SIZE(o) == 5 && floats(PyTuple_GET_ITEM(o, 0), 3, x) &&
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
  Struck found = reflections(of(self), threshold, budget);
  PyObject* e = found.restitution < 0 ? Py_NewRef(Py_None) : PyFloat_FromDouble(found.restitution);
  return Py_BuildValue("iNddN", static_cast<int>(found.outcome), bytes(found.p), found.error, found.margin, e);
}

PyObject* vector(const double* x) { return tuple_of(types.vec3, x, 3); }
PyObject* twist(const double* x) { return twist_of(types.twist, types.vec3, x); }

template <class Make> PyObject* listed(size_t count, Make make) {
  PyObject* list = PyList_New(static_cast<Py_ssize_t>(count));
  for (size_t i = 0; list && i < count; ++i) PyList_SET_ITEM(list, static_cast<Py_ssize_t>(i), make(i));
  return list;
}

PyObject* number_list(const std::vector<double>& x) {
  return listed(x.size(), [&x](size_t i) { return PyFloat_FromDouble(x[i]); });
}

// answer(p, tangential, error, by_slip): of normal impulses, and of tangential ones (pairs of floats in the axes of
// each contact, or None): the changes and the twists of the movable bodies, the impulses, the velocities before and
// after, the regimes, the energies before and after and what restitution and friction lost, the relative error,
// whether a body turned about an axis without inertia, and whether a quaternion was not of unit length.
PyObject* answer(PyObject* self, PyObject* const* args, Py_ssize_t argc) {
  const DD* p = argc == 4 ? impulses(self, args[0]) : nullptr;
  if (!p) return nullptr;
  std::vector<double> tangential;
  if (args[1] != Py_None)
    for (int i = 0; i < 2 * of(self).count; ++i) tangential.push_back(PyFloat_AsDouble(PyList_GET_ITEM(args[1], i)));
  double error = PyFloat_AsDouble(args[2]);
  if (PyErr_Occurred()) return nullptr;
  const auto* cluster = reinterpret_cast<Cluster*>(self);
  Numbers y = numbers_of(of(self), p, tangential, error, args[3] == Py_True);
  return Py_BuildValue(
      "NNNNNN(dddd)dNN", listed(of(self).bodies, [&](size_t b) { return twist(&y.changes[6 * b]); }),
      listed(of(self).bodies, [&](size_t b) { return twist(&y.after[6 * b]); }),
      listed(of(self).count, [&](size_t i) { return vector(&y.pushes[3 * i]); }), number_list(y.before), number_list(y.then),
      listed(of(self).count, [&](size_t i) { return Py_NewRef(PyTuple_GET_ITEM(types.regimes, y.regimes[i])); }),
      cluster->energy, y.energy_after, y.lost_restitution, y.lost_friction, y.bound,
      PyBool_FromLong(cluster->idle), PyBool_FromLong(cluster->off_unit));
}

PyObject* friction_answer(const Friction& friction, const Assembly& scene) {
  if (!friction.found) Py_RETURN_NONE;
  return Py_BuildValue("NNd", bytes(along_normals(friction, scene)), number_list(across_normals(friction)), friction.error);
}

// least_work(p), one_step(friction): impulses along the normals, across them, and the error; None if there are none.
PyObject* with_least_work(PyObject* self, PyObject* o) {
  const DD* p = impulses(self, o);
  return p ? friction_answer(rubbed(of(self), p), of(self)) : nullptr;
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

// clusters(pairs, movable, order, starts, cluster): how many; see gather.hpp.
PyObject* find_clusters(PyObject*, PyObject* const* args, Py_ssize_t count) {
  Array pairs, movable, order, starts, cluster;
  if (count != 5 || !pairs.open(args[0]) || !movable.open(args[1]) || !order.open(args[2], true) || !starts.open(args[3], true) || !cluster.open(args[4], true))
    return PyErr_Format(PyExc_TypeError, "clusters() takes five arrays");
  long n = static_cast<long>(order.view.shape[0]), found;
  Pairs who{pairs.at<std::int64_t>(), pairs.at<std::int64_t>() + n, movable.view.shape[0]};
  Py_BEGIN_ALLOW_THREADS;
  found = clusters(who, n, movable.at<bool>(), order.at<std::int64_t>(), starts.at<std::int64_t>(), cluster.at<std::int64_t>());
  Py_END_ALLOW_THREADS;
  return PyLong_FromLong(found);
}

// many(table, frictionless, numbers, bodies, pairs, contacts, order, starts, results, wanted, from, to): the clusters
// that `wanted` lists between two places, without the GIL. numbers are the threshold, the restitution threshold, the
// limit of error bounds and the budget of reflections. The arrays are those of resolve_scenes.py, of the
// right shapes. A status of 0: left to Python.
PyObject* many(PyObject*, PyObject* const* args, Py_ssize_t count) {
  constexpr int RESULTS = 12;
  if (count != 12 || !PyTuple_Check(args[8]) || PyTuple_GET_SIZE(args[8]) != RESULTS) return PyErr_Format(PyExc_TypeError, "many() takes 12 arguments");
  int place = static_cast<int>(PyLong_AsLong(args[0]));
  double number[4];
  if (PyErr_Occurred() || !floats(args[2], 4, number)) return PyErr_Format(PyExc_TypeError, "many(): numbers");
  long from = PyLong_AsLong(args[10]), to = PyLong_AsLong(args[11]);
  Array bodies, pairs, contacts, order, starts, wanted, result[RESULTS];
  bool open = bodies.open(args[3]) && pairs.open(args[4]) && contacts.open(args[5]) && order.open(args[6]) && starts.open(args[7]) && wanted.open(args[9]);
  for (int i = 0; i < RESULTS; ++i) open = open && (i == 4 || result[i].open(PyTuple_GET_ITEM(args[8], i), true));
  if (!open || PyErr_Occurred()) return PyErr_Format(PyExc_TypeError, "many(): arrays must be contiguous");
  long n = static_cast<long>(contacts.view.shape[1]);
  auto numbers = [&result](int i) { return result[i].at<double>(); };
  Many asked{tables[place], bodies.at<double>(), contacts.at<double>(),
             {pairs.at<std::int64_t>(), pairs.at<std::int64_t>() + n, bodies.view.shape[1]},
             n, static_cast<long>(contacts.view.shape[0]), order.at<std::int64_t>(), starts.at<std::int64_t>(),
             args[1] == Py_True, number[0], number[1], number[2], static_cast<int>(number[3]),
             numbers(0), numbers(1), numbers(2), result[3].at<unsigned char>(), result[5].at<unsigned char>(),
             numbers(6), numbers(7), {numbers(8), numbers(9), numbers(10), numbers(11)}};
  Py_BEGIN_ALLOW_THREADS;
  ManyClusters clusters(asked);
  for (long i = from; i < to; ++i) clusters.answer(wanted.at<std::int64_t>()[i]);
  Py_END_ALLOW_THREADS;
  Py_RETURN_NONE;
}

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

PyMethodDef functions[] = {FAST("assemble", assemble), FAST("clusters", find_clusters), FAST("many", many), {"is_rational", is_rational, METH_O, ""}, {"setup", setup, METH_VARARGS, ""}, {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_scene", "", -1, functions, nullptr, nullptr, nullptr, nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__scene() {
  cluster_type = PyType_FromSpec(&spec);
  PyObject* module = cluster_type ? PyModule_Create(&definition) : nullptr;
  if (module && PyModule_AddObjectRef(module, "Cluster", cluster_type) < 0) Py_CLEAR(module);
  return module;
}
