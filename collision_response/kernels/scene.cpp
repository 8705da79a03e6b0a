// The compiled part of scenes, as the Python module _scene: the class Cluster, for the laws of collision_response/scene/,
// and functions that resolve whole scenes, and clusters of tables, without Python.
//
// Python holds impulses along the normals as bytes: a double-double for each contact.
#include <memory>

#include "arrays.hpp"
#include "python_objects.hpp"
#include "scene/contact_springs.hpp"
#include "scene/table_clusters.hpp"
#include "validity_everything.hpp"

namespace {

PyTypeObject *body_type, *cluster_type;

struct ClusterObject {
  PyObject_HEAD
  Cluster* cluster;
};

// Read numbers. False if one is not exactly a float: those are left to Python.
bool read_floats(PyObject* o, int count, double* x) {
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != count) return false;
  for (int k = 0; k < count; ++k)
    if (!read_exact_float(PyTuple_GET_ITEM(o, k), x[k])) return false;
  return true;
}
bool read_body(PyObject* o, double* x) {
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != 8) return false;
  auto item = [o](int k) { return PyTuple_GET_ITEM(o, k); };
  double* q = x + IN_BODY_A_ORIENTATION_X;
  q[0] = q[1] = q[2] = 0;
  q[3] = 1;
  return read_exact_float(item(0), x[0]) && read_floats(item(1), 6, x + IN_BODY_A_INERTIA_XX) &&
         read_floats(item(2), 3, x + IN_BODY_A_POSITION_X) && (item(3) == Py_None || read_floats(item(3), 4, q)) &&
         read_floats(item(4), 3, x + IN_BODY_A_VELOCITY_X) && read_floats(item(5), 3, x + IN_BODY_A_ANGULAR_VELOCITY_X) &&
         read_floats(item(6), 3, x + IN_BODY_A_COM_X);
}
bool read_contact(PyObject* o, double* x) {
  return PyTuple_Check(o) && PyTuple_GET_SIZE(o) == 5 && read_floats(PyTuple_GET_ITEM(o, 0), 3, x) &&
         read_floats(PyTuple_GET_ITEM(o, 1), 3, x + 3) && read_exact_float(PyTuple_GET_ITEM(o, 2), x[6]) &&
         read_exact_float(PyTuple_GET_ITEM(o, 3), x[7]);
}

// Read the indices of two different bodies.
bool read_pair(PyObject* o, long bodies, std::int64_t* pair) {
  if (!PyTuple_CheckExact(o) || PyTuple_GET_SIZE(o) != 2) return false;
  for (int side = 0; side < 2; ++side) {
    PyObject* index = PyTuple_GET_ITEM(o, side);
    if (!PyLong_CheckExact(index)) return false;
    pair[side] = PyLong_AsLong(index);
    if (pair[side] < 0 || pair[side] >= bodies) {
      PyErr_Clear();
      return false;
    }
  }
  return pair[0] != pair[1];
}

void dealloc(PyObject* self) {
  delete reinterpret_cast<ClusterObject*>(self)->cluster;
  PyTypeObject* type = Py_TYPE(self);
  type->tp_free(self);
  Py_DECREF(type);
}

// assemble(bodies, pairs, contacts, counts): a Cluster of contacts, each given `counts` times. The place of the first
// invalid contact, if there is one; None if a number is not a float.
PyObject* assemble(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4 || !PyList_Check(args[0]) || !PyList_Check(args[1]) || !PyList_Check(args[2]) || !PyList_Check(args[3]))
    return PyErr_Format(PyExc_TypeError, "assemble() takes four lists");
  ClusterParts parts;
  parts.bodies.resize(PyList_GET_SIZE(args[0]));
  for (size_t i = 0; i < parts.bodies.size(); ++i)
    if (!read_body(PyList_GET_ITEM(args[0], i), parts.bodies[i].data())) Py_RETURN_NONE;
  for (Py_ssize_t k = 0; k < PyList_GET_SIZE(args[2]); ++k) {
    std::int64_t pair[2];
    ClusterParts::Contact contact{{}, {}, PyLong_AsDouble(PyList_GET_ITEM(args[3], k))};
    if (!read_contact(PyList_GET_ITEM(args[2], k), contact.x) || !read_pair(PyList_GET_ITEM(args[1], k), parts.bodies.size(), pair)) Py_RETURN_NONE;
    for (int side = 0; side < 2; ++side) contact.body[side] = static_cast<int>(pair[side]);
    parts.contacts.push_back(contact);
  }
  auto cluster = std::make_unique<Cluster>(parts, false);
  if (cluster->fault) return PyLong_FromSize_t(cluster->invalid_contact);
  auto* object = PyObject_New(ClusterObject, cluster_type);
  if (object) object->cluster = cluster.release();
  return reinterpret_cast<PyObject*>(object);
}

Assembly& assembly_of(PyObject* self) { return reinterpret_cast<ClusterObject*>(self)->cluster->assembly; }

PyObject* bytes(const std::vector<DD>& p) {
  return PyBytes_FromStringAndSize(reinterpret_cast<const char*>(p.data()), p.size() * sizeof(DD));
}
const DD* impulses(PyObject* self, PyObject* o) {
  if (PyBytes_Check(o) && PyBytes_GET_SIZE(o) == static_cast<Py_ssize_t>(assembly_of(self).count * sizeof(DD)))
    return reinterpret_cast<const DD*>(PyBytes_AS_STRING(o));
  PyErr_SetString(PyExc_TypeError, "these are no impulses of this cluster");
  return nullptr;
}
bool read_list(PyObject* list, Vector& x) {
  for (size_t i = 0; i < x.size(); ++i) x[i] = PyFloat_AsDouble(PyList_GET_ITEM(list, i));
  return !PyErr_Occurred();
}
template <class Make> PyObject* listed(size_t count, Make make) {
  PyObject* list = PyList_New(static_cast<Py_ssize_t>(count));
  for (size_t i = 0; list && i < count; ++i) PyList_SET_ITEM(list, static_cast<Py_ssize_t>(i), make(i));
  return list;
}

// no_impulses(): impulses of 0.
PyObject* no_impulses(PyObject* self, PyObject*) { return bytes(std::vector<DD>(assembly_of(self).count)); }

// impulses_from_floats(p): impulses from a list of floats.
PyObject* impulses_from_floats(PyObject* self, PyObject* list) {
  Vector numbers(assembly_of(self).count);
  if (!read_list(list, numbers)) return nullptr;
  std::vector<DD> p;
  for (double number : numbers) p.push_back({number, 0});
  return bytes(p);
}

// contradictory_contacts(): the few contacts that seem to contradict each other, or an empty list.
PyObject* find_contradictory_contacts(PyObject* self, PyObject*) {
  const std::vector<int> found = contradictory_contacts(assembly_of(self));
  return listed(found.size(), [&found](size_t i) { return PyLong_FromLong(found[i]); });
}

// velocity_size(p): an upper bound on the size of the velocities that impulses p produce, in the metric of kinetic energy.
PyObject* velocity_size(PyObject* self, PyObject* o) {
  const DD* p = impulses(self, o);
  return p ? PyFloat_FromDouble(assembly_of(self).velocity_size(p)) : nullptr;
}

// reflections(threshold, budget): the normal impulses, error, margin, restitution (or None) and no_rebound of ClusterImpulses;
// None if contacts contradict each other.
PyObject* reflect(PyObject* self, PyObject* args) {
  double threshold;
  long budget;
  if (!PyArg_ParseTuple(args, "dl", &threshold, &budget)) return nullptr;
  ClusterImpulses found = Reflections{assembly_of(self)}.resolve(threshold, budget);
  if (!found.are_found) Py_RETURN_NONE;
  PyObject* e = found.restitution < 0 ? Py_NewRef(Py_None) : PyFloat_FromDouble(found.restitution);
  return Py_BuildValue("NddNN", bytes(found.normal), found.error, found.margin, e, PyBool_FromLong(found.no_rebound));
}

PyObject* number_list(const Vector& x) {
  return listed(x.size(), [&x](size_t i) { return PyFloat_FromDouble(x[i]); });
}

// effect_of(p, tangential, error, sticks_by_slip): the fields of an ImpulseEffect of scene/impulses.py. p are normal
// impulses, tangential a list with two floats for each contact, along its tangents, or None.
PyObject* get_effect(PyObject* self, PyObject* args) {
  PyObject *normal, *tangential;
  double error;
  int sticks_by_slip;
  if (!PyArg_ParseTuple(args, "OOdp", &normal, &tangential, &error, &sticks_by_slip)) return nullptr;
  const DD* p = impulses(self, normal);
  if (!p) return nullptr;
  ClusterImpulses impulses{true, {p, p + assembly_of(self).count}, error};
  impulses.tangential.resize(tangential == Py_None ? 0 : 2 * assembly_of(self).count);
  if (!read_list(tangential, impulses.tangential)) return nullptr;
  const Cluster& cluster = *reinterpret_cast<ClusterObject*>(self)->cluster;
  ImpulseEffect effect = effect_of(assembly_of(self), impulses, sticks_by_slip);
  return Py_BuildValue(
      "NNNNNN(dddd)dNNN", listed(assembly_of(self).body_count, [&](size_t b) { return make_twist(&effect.changes[6 * b]); }),
      listed(assembly_of(self).body_count, [&](size_t b) { return make_twist(&effect.twists[6 * b]); }),
      listed(assembly_of(self).count, [&](size_t i) { return make_vec3(&effect.impulses[3 * i]); }), number_list(effect.normal_velocities_before), number_list(effect.normal_velocities_after),
      listed(assembly_of(self).count, [&](size_t i) { return Py_NewRef(PyTuple_GET_ITEM(python_types.regimes, effect.regimes[i])); }),
      effect.energies[0], effect.energies[1], effect.energies[2], effect.energies[3], effect.error_bound,
      PyBool_FromLong(cluster.has_massless_spin), PyBool_FromLong(cluster.has_off_unit_orientation),
      PyBool_FromLong(effect.creates_energy));
}

// Normal impulses, tangential ones (or None) and their error; None if there is no answer.
PyObject* impulses_or_none(const ClusterImpulses& impulses) {
  if (!impulses.are_found) Py_RETURN_NONE;
  PyObject* tangential = impulses.tangential.empty() ? Py_NewRef(Py_None) : number_list(impulses.tangential);
  return Py_BuildValue("NNd", bytes(impulses.normal), tangential, impulses.error);
}

// least_work_friction(p, error): the impulses of COULOMB, from frictionless ones.
PyObject* add_least_work_friction(PyObject* self, PyObject* args) {
  PyObject* normal;
  double error;
  if (!PyArg_ParseTuple(args, "Od", &normal, &error)) return nullptr;
  const DD* p = impulses(self, normal);
  return !p ? nullptr : impulses_or_none(least_work_friction(assembly_of(self), {true, {p, p + assembly_of(self).count}, error}));
}
// moreau(has_friction): the impulses of MOREAU.
PyObject* apply_moreau(PyObject* self, PyObject* has_friction) { return impulses_or_none(moreau(assembly_of(self), has_friction == Py_True)); }

// follow_springs(stiffness, exponent, tolerance, budget, has_friction): the impulses of ROUTH_STRONGE at the end of one
// path, normal and tangential (or None), the energy that friction took, and the rest of the budget. None if the budget ran
// out, False if the path has no end.
PyObject* follow_springs(PyObject* self, PyObject* args) {
  PyObject* stiffness;
  double exponent, tolerance;
  long budget;
  int has_friction;
  if (!PyArg_ParseTuple(args, "Oddlp", &stiffness, &exponent, &tolerance, &budget, &has_friction)) return nullptr;
  const Assembly& assembly = assembly_of(self);
  Vector ratios(assembly.count);
  if (!read_list(stiffness, ratios)) return nullptr;
  ContactSprings springs(assembly, exponent, ratios, budget);
  std::vector<Axes> P(assembly.count);
  bool found;
  {
    ReleasedGil released;
    Vector p;
    found = has_friction ? springs.follow_with_friction(tolerance, P) : springs.follow_without_friction(tolerance, p);
    for (size_t i = 0; i < p.size(); ++i) P[i][0] = p[i];
  }
  if (springs.is_wedged) Py_RETURN_FALSE;
  if (!found) Py_RETURN_NONE;
  const ClusterImpulses impulses = with_axis_impulses({}, assembly, P);
  PyObject* tangential = has_friction ? number_list(impulses.tangential) : Py_NewRef(Py_None);
  return Py_BuildValue("NNdl", bytes(impulses.normal), tangential, springs.friction_loss, springs.work);
}

PyObject* get_is_locked(PyObject* self, void*) { return PyBool_FromLong(assembly_of(self).is_locked); }
PyObject* get_approach_is_uncertain(PyObject* self, void*) { return PyBool_FromLong(assembly_of(self).approach_is_uncertain()); }
PyObject* get_is_out_of_range(PyObject* self, void*) { return PyBool_FromLong(reinterpret_cast<ClusterObject*>(self)->cluster->is_out_of_range()); }

PyMethodDef methods[] = {
    {"no_impulses", RaisesMemoryError<no_impulses>::call, METH_NOARGS, ""},
    {"impulses_from_floats", RaisesMemoryError<impulses_from_floats>::call, METH_O, ""},
    {"contradictory_contacts", RaisesMemoryError<find_contradictory_contacts>::call, METH_NOARGS, ""},
    {"velocity_size", velocity_size, METH_O, ""},
    {"reflections", RaisesMemoryError<reflect>::call, METH_VARARGS, ""},
    {"effect_of", RaisesMemoryError<get_effect>::call, METH_VARARGS, ""},
    {"least_work_friction", RaisesMemoryError<add_least_work_friction>::call, METH_VARARGS, ""},
    {"moreau", RaisesMemoryError<apply_moreau>::call, METH_O, ""},
    {"follow_springs", RaisesMemoryError<follow_springs>::call, METH_VARARGS, ""},
    {}};
PyGetSetDef fields[] = {{"is_locked", get_is_locked, nullptr, "", nullptr}, {"approach_is_uncertain", get_approach_is_uncertain, nullptr, "", nullptr}, {"is_out_of_range", get_is_out_of_range, nullptr, "", nullptr}, {}};
PyType_Slot slots[] = {{Py_tp_dealloc, reinterpret_cast<void*>(dealloc)}, {Py_tp_methods, methods}, {Py_tp_getset, fields}, {}};
PyType_Spec spec = {"collision_response.kernels._scene.Cluster", sizeof(ClusterObject), 0, Py_TPFLAGS_DEFAULT, slots};

// clusters(pairs, movable, order, starts, cluster): writes the clusters to the last three arrays, as in contact_pairs.hpp, and
// returns how many there are.
PyObject* find_clusters(PyObject*, PyObject* const* args, Py_ssize_t count) {
  Array pairs, movable, order, starts, cluster;
  if (count != 5 || !pairs.open(args[0]) || !movable.open(args[1]) || !order.open(args[2], true) || !starts.open(args[3], true) || !cluster.open(args[4], true))
    return PyErr_Format(PyExc_TypeError, "clusters() takes five arrays");
  long n = static_cast<long>(order.view.shape[0]), found;
  ContactPairs who{pairs.at<std::int64_t>(), pairs.at<std::int64_t>() + n, movable.view.shape[0]};
  {
    ReleasedGil released;
    found = clusters(who, n, movable.at<bool>(), order.at<std::int64_t>(), starts.at<std::int64_t>(), cluster.at<std::int64_t>());
  }
  return PyLong_FromLong(found);
}

// resolve_clusters(table, law, numbers, bodies, pairs, contacts, order, starts, results, wanted, from, to): resolve the
// clusters wanted[from:to], without the GIL. `numbers` are as in KernelModel of scene/kernel_model.py. The arrays are those
// of batch/resolve_scenes.py, of the right shapes; `results` are the fields of a ScenesResult. Clusters that are left to
// Python get the status 0.
PyObject* resolve_clusters(PyObject*, PyObject* const* args, Py_ssize_t count) {
  constexpr int RESULTS = 12;
  if (count != 12 || !PyTuple_Check(args[8]) || PyTuple_GET_SIZE(args[8]) != RESULTS) return PyErr_Format(PyExc_TypeError, "resolve_clusters() takes 12 arguments");
  int place = static_cast<int>(PyLong_AsLong(args[0])), law = static_cast<int>(PyLong_AsLong(args[1]));
  double number[4];
  if (PyErr_Occurred() || !read_floats(args[2], 4, number)) return PyErr_Format(PyExc_TypeError, "resolve_clusters(): numbers");
  long from = PyLong_AsLong(args[10]), to = PyLong_AsLong(args[11]);
  Array bodies, pairs, contacts, order, starts, wanted, result[RESULTS];
  bool open = bodies.open(args[3]) && pairs.open(args[4]) && contacts.open(args[5]) && order.open(args[6]) && starts.open(args[7]) && wanted.open(args[9]);
  for (int i = 0; i < RESULTS; ++i) open = open && (i == 4 || result[i].open(PyTuple_GET_ITEM(args[8], i), true));
  if (!open || PyErr_Occurred()) return PyErr_Format(PyExc_TypeError, "resolve_clusters(): arrays must be contiguous");
  long n = static_cast<long>(contacts.view.shape[1]);
  auto numbers = [&result](int i) { return result[i].at<double>(); };
  TableClusters clusters{table_layouts[place], bodies.at<double>(), contacts.at<double>(),
             {pairs.at<std::int64_t>(), pairs.at<std::int64_t>() + n, bodies.view.shape[1]},
             n, static_cast<long>(contacts.view.shape[0]), order.at<std::int64_t>(), starts.at<std::int64_t>(),
             {law, number[0], number[1], static_cast<int>(number[3])}, number[2],
             numbers(0), numbers(1), numbers(2), result[3].at<unsigned char>(), result[5].at<unsigned char>(),
             numbers(6), numbers(7), {numbers(8), numbers(9), numbers(10), numbers(11)}};
  {
    ReleasedGil released;
    for (long i = from; i < to; ++i) clusters.resolve(wanted.at<std::int64_t>()[i]);
  }
  Py_RETURN_NONE;
}

struct SolvedCluster {
  std::vector<std::int64_t> bodies;  // their indices in the scene
  Cluster cluster;
  ClusterResult result;
};

// A scene from Python.
struct SceneRequest {
  std::vector<std::array<double, BODY>> bodies;
  std::vector<std::array<double, 8>> contacts;
  std::vector<std::int64_t> a, b, order, starts, cluster;
  std::unique_ptr<bool[]> movable;
  long count;  // number of clusters
  bool has_friction = false;
  std::vector<SolvedCluster> solved;
  double energies[4] = {};

  // Read a scene. Whether it is a usual one: all numbers are floats, and every movable body is in a cluster of several
  // contacts.
  bool read(PyObject* body_list, PyObject* pair_list, PyObject* contact_list) {
    for (PyObject* list : {body_list, pair_list, contact_list})
      if (!PyList_Check(list) && !PyTuple_Check(list)) return false;
    long n = PySequence_Fast_GET_SIZE(contact_list), of_bodies = PySequence_Fast_GET_SIZE(body_list);
    if (PySequence_Fast_GET_SIZE(pair_list) != n) return false;
    bodies.resize(of_bodies);
    contacts.resize(n);
    for (auto* numbers : {&a, &b, &order, &cluster}) numbers->resize(n);
    starts.resize(n + 1);
    movable.reset(new bool[of_bodies]);
    std::vector<char> touched(of_bodies);
    for (long i = 0; i < of_bodies; ++i) {
      PyObject* body = PySequence_Fast_GET_ITEM(body_list, i);
      if (Py_TYPE(body) != body_type || PyTuple_GET_ITEM(body, 7) != Py_None || !read_body(body, bodies[i].data())) return false;
      movable[i] = bodies[i][0] < INFINITY;
    }
    for (long k = 0; k < n; ++k) {
      PyObject* contact = PySequence_Fast_GET_ITEM(contact_list, k);
      std::int64_t pair[2];
      if (Py_TYPE(contact) != python_types.contact || PyTuple_GET_ITEM(contact, 4) != Py_None || !read_contact(contact, contacts[k].data())) return false;
      if (!read_pair(PySequence_Fast_GET_ITEM(pair_list, k), of_bodies, pair)) return false;
      a[k] = pair[0];
      b[k] = pair[1];
      touched[a[k]] = touched[b[k]] = 1;
      has_friction = has_friction || contacts[k][7] > 0;
    }
    for (long i = 0; i < of_bodies; ++i)
      if (movable[i] && !touched[i]) return false;
    count = clusters({a.data(), b.data(), of_bodies}, n, movable.get(), order.data(), starts.data(), cluster.data());
    for (long c = 0; c < count; ++c)
      if (starts[c + 1] - starts[c] == 1) return false;
    return count > 0;
  }

  // Resolve every cluster. False if one of them is left to Python, or has no answer.
  bool solve(const ClusterOptions& options) {
    std::vector<int> place(bodies.size(), -1);
    auto body = [this](std::int64_t i, double* x) { std::copy(bodies[i].begin(), bodies[i].end(), x); };
    auto contact = [this](std::int64_t k, double* x) { std::copy(contacts[k].begin(), contacts[k].end(), x); };
    for (long c = 0; c < count; ++c) {
      std::vector<std::int64_t> used;
      ClusterParts parts = take_parts({a.data(), b.data(), 0}, &order[starts[c]], &order[0] + starts[c + 1], place, used, body, contact);
      if (parts.has_copies()) return false;
      Cluster cluster(parts, options.law == LAW_FRICTIONLESS);
      if (cluster.fault) return false;
      ClusterResult result = resolve_cluster(cluster, options);
      if (result.code != STATUS_OK) return false;
      for (int i = 0; i < 4; ++i) energies[i] += result.effect.energies[i];
      solved.push_back({std::move(used), std::move(cluster), std::move(result)});
    }
    return std::all_of(energies, energies + 4, [](double energy) { return std::isfinite(energy); });
  }
};

// resolve_scene(bodies, pairs, contacts, laws, numbers, models): the fields of a SceneImpact; None if the scene is left to
// Python. The last three are the fields of a KernelModel of scene/kernel_model.py.
PyObject* resolve_scene(PyObject*, PyObject* const* args, Py_ssize_t argc) {
  double number[4];
  int laws[2];
  if (argc != 6 || !PyArg_ParseTuple(args[3], "ii", &laws[0], &laws[1]) || !read_floats(args[4], 4, number))
    return PyErr_Occurred() ? nullptr : PyErr_Format(PyExc_TypeError, "resolve_scene() takes 6 arguments");
  SceneRequest request;
  if (!request.read(args[0], args[1], args[2])) Py_RETURN_NONE;
  ClusterOptions options{laws[request.has_friction], number[0], number[1], static_cast<int>(number[3])};
  if (!request.solve(options)) Py_RETURN_NONE;

  enum { CONTACTS, TWISTS, CHANGES, IMPULSES, BEFORE, AFTER, REGIMES, CLUSTERS, COLUMNS };
  auto bodies = static_cast<Py_ssize_t>(request.bodies.size()), contacts = static_cast<Py_ssize_t>(request.contacts.size());
  PyObject* column[COLUMNS];
  for (int i = 0; i < COLUMNS; ++i) column[i] = PyTuple_New(i == CLUSTERS ? request.count : i == TWISTS || i == CHANGES ? bodies : contacts);
  for (Py_ssize_t i = 0; i < bodies; ++i) {
    if (request.movable[i]) continue;
    const double none[6] = {};
    PyTuple_SET_ITEM(column[TWISTS], i, make_twist(&request.bodies[i][IN_BODY_A_VELOCITY_X]));
    PyTuple_SET_ITEM(column[CHANGES], i, make_twist(none));
  }
  double bound = 0, margin = INFINITY;
  int adjusted = 0, law = options.law;
  bool is_separating = true, is_extended = false;
  for (long c = 0; c < request.count; ++c) {
    const auto& [used, cluster, result] = request.solved[c];
    const ImpulseEffect& effect = result.effect;
    for (size_t i = 0; i < used.size(); ++i) {
      if (cluster.movable_place[i] < 0) continue;
      PyTuple_SET_ITEM(column[TWISTS], used[i], make_twist(&effect.twists[6 * cluster.movable_place[i]]));
      PyTuple_SET_ITEM(column[CHANGES], used[i], make_twist(&effect.changes[6 * cluster.movable_place[i]]));
    }
    long from = static_cast<long>(request.starts[c]), to = static_cast<long>(request.starts[c + 1]);
    PyObject* own = PyTuple_New(to - from);
    for (long i = 0; i < to - from; ++i) {
      auto k = static_cast<Py_ssize_t>(request.order[from + i]);
      double e = result.restitution < 0 ? cluster.assembly.contacts[i].e : result.restitution;
      PyTuple_SET_ITEM(own, i, PyLong_FromSsize_t(k));
      const auto& given = request.contacts[k];
      PyTuple_SET_ITEM(column[CONTACTS], k, contact_as_used(PySequence_Fast_GET_ITEM(args[2], k), e, e != given[6], options.law == LAW_FRICTIONLESS && given[7] != 0));
      PyTuple_SET_ITEM(column[IMPULSES], k, make_vec3(&effect.impulses[3 * i]));
      PyTuple_SET_ITEM(column[BEFORE], k, PyFloat_FromDouble(effect.normal_velocities_before[i]));
      PyTuple_SET_ITEM(column[AFTER], k, PyFloat_FromDouble(effect.normal_velocities_after[i]));
      PyTuple_SET_ITEM(column[REGIMES], k, Py_NewRef(PyTuple_GET_ITEM(python_types.regimes, effect.regimes[i])));
    }
    PyTuple_SET_ITEM(column[CLUSTERS], c, own);
    bound = std::fmax(bound, effect.error_bound);
    margin = std::fmin(margin, result.margin);
    adjusted |= cluster.has_off_unit_orientation * ADJUSTMENT_NORMALISED_ORIENTATION + result.below_restitution_threshold * ADJUSTMENT_RESTITUTION_THRESHOLD +
                result.fell_back * ADJUSTMENT_LAW_FALLBACK + result.no_rebound * ADJUSTMENT_NO_REBOUND + cluster.has_massless_spin * ADJUSTMENT_MASSLESS_SPIN;
    if (result.fell_back && law == options.law) law = cluster.has_friction ? LAW_COULOMB : LAW_FRICTIONLESS;
    is_separating = is_separating && effect.is_separating();
    is_extended = is_extended || !cluster.has_friction;
  }
  PyObject* status = PyTuple_GET_ITEM(python_types.statuses, bound > number[2] ? STATUS_TOLERANCE_NOT_MET : is_separating ? STATUS_SEPARATING : STATUS_OK);
  PyObject* model = PyTuple_GET_ITEM(PyTuple_GET_ITEM(args[5], law), is_extended);
  return Py_BuildValue("OONNNNNNNddddNOddO", status, model, column[CONTACTS], column[TWISTS], column[CHANGES], column[IMPULSES],
                       column[BEFORE], column[AFTER], column[REGIMES], request.energies[0], request.energies[1], request.energies[2], request.energies[3],
                       column[CLUSTERS], Py_None, bound, margin, PyTuple_GET_ITEM(python_types.adjustments, adjusted));
}

// Whether an object is a fraction, or a tuple or list that contains one.
bool holds_fraction(PyObject* o) {
  if (PyFloat_CheckExact(o) || o == Py_None) return false;
  if (PyTuple_Check(o) || PyList_Check(o)) {
    for (Py_ssize_t i = 0; i < PySequence_Fast_GET_SIZE(o); ++i)
      if (holds_fraction(PySequence_Fast_GET_ITEM(o, i))) return true;
    return false;
  }
  return PyObject_TypeCheck(o, python_types.fraction);
}
PyObject* is_rational(PyObject*, PyObject* o) { return PyBool_FromLong(holds_fraction(o)); }

PyObject* setup(PyObject*, PyObject* args) {
  if (!PyArg_ParseTuple(args, "OOOOOOOO", &python_types.vec3, &python_types.twist, &python_types.fraction, &body_type, &python_types.contact, &python_types.regimes, &python_types.statuses, &python_types.adjustments)) return nullptr;
  Py_INCREF(args);  // keeps all of them alive for ever
  Py_RETURN_NONE;
}

PyMethodDef functions[] = {FASTCALL("assemble", assemble), FASTCALL("clusters", find_clusters), FASTCALL("resolve_clusters", resolve_clusters), FASTCALL("resolve_scene", resolve_scene), {"is_rational", is_rational, METH_O, ""}, {"setup", setup, METH_VARARGS, ""}, {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_scene", "", -1, functions, nullptr, nullptr, nullptr, nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__scene() {
  cluster_type = reinterpret_cast<PyTypeObject*>(PyType_FromSpec(&spec));
  PyObject* module = cluster_type ? PyModule_Create(&definition) : nullptr;
  if (module && PyModule_AddType(module, cluster_type) < 0) Py_CLEAR(module);
  return module;
}
