// The Python type Cluster: a cluster of several contacts in double-double, for scene/resolve_cluster.py.
#include <memory>

#include "module.hpp"
#include "scene/projection.hpp"
#include "scene/read_scene.hpp"
#include "scene/resolve_cluster.hpp"

namespace {

PyTypeObject* cluster_type;

struct ClusterObject {
  PyObject_HEAD
  Cluster* cluster;
};
void dealloc(PyObject* self) {
  delete reinterpret_cast<ClusterObject*>(self)->cluster;
  PyTypeObject* type = Py_TYPE(self);
  type->tp_free(self);
  Py_DECREF(type);
}

Cluster& cluster_of(PyObject* self) { return *reinterpret_cast<ClusterObject*>(self)->cluster; }
Assembly& assembly_of(PyObject* self) { return cluster_of(self).assembly; }

bool read_list(PyObject* list, Vector& x) {
  for (Py_ssize_t i = 0; PyList_Check(list) && i < PyList_GET_SIZE(list); ++i)
    x.push_back(PyFloat_AsDouble(PyList_GET_ITEM(list, i)));
  return !PyErr_Occurred();
}
template <class Make> PyObject* listed(size_t count, Make make) {
  PyObject* list = PyList_New(static_cast<Py_ssize_t>(count));
  for (size_t i = 0; list && i < count; ++i) PyList_SET_ITEM(list, static_cast<Py_ssize_t>(i), make(i));
  if (PyErr_Occurred()) Py_CLEAR(list);
  return list;
}

// The fields of an ImpulseEffect of scene/cluster_result.py.
PyObject* fields_of(const ImpulseEffect& effect, const Assembly& assembly) {
  const size_t bodies = effect.twists.size() / 6, contacts = effect.regimes.size();
  return Py_BuildValue(
      "NNNNNN(dddd)d", listed(bodies, [&](size_t b) { return make_twist(&effect.changes[6 * b]); }),
      listed(bodies, [&](size_t b) { return make_twist(&effect.twists[6 * b]); }),
      listed(contacts, [&](size_t i) { return make_vec3(&effect.impulses[3 * i]); }),
      listed(contacts, [&](size_t i) { return PyFloat_FromDouble(assembly.contacts[i].axes[0].velocity); }),
      listed(contacts, [&](size_t i) { return PyFloat_FromDouble(effect.normal_velocities[i]); }),
      listed(contacts, [&](size_t i) { return Py_NewRef(PyTuple_GET_ITEM(python.regimes, effect.regimes[i])); }),
      effect.energies[0], effect.energies[1], effect.energies[2], effect.energies[3], effect.error_bound);
}

// resolve(law, threshold, tolerance, (stiffness, exponent, work), decided): the fields of a ClusterResult of
// scene/cluster_result.py. The stiffness is a list, or None. `decided` is None, or the fields of a Decided of
// scene/in_kernels.py.
PyObject* resolve_by_law(PyObject* self, PyObject* args) {
  ClusterOptions options{};
  PyObject *stiffness, *given;
  if (!PyArg_ParseTuple(args, "idd(Odl)O", &options.law, &options.threshold, &options.tolerance, &stiffness,
                        &options.springs.exponent, &options.springs.work, &given) ||
      !read_list(stiffness, options.springs.stiffness))
    return nullptr;
  Cluster& cluster = cluster_of(self);
  ClusterImpulses decided;
  if (given != Py_None) {
    PyObject *normal, *rest;
    Vector high, low;
    int no_rebound;
    if (!PyArg_ParseTuple(given, "OOdddp", &normal, &rest, &decided.error, &decided.margin, &decided.restitution,
                          &no_rebound) ||
        !read_list(normal, high) || !read_list(rest, low))
      return nullptr;
    for (size_t i = 0; i < high.size(); ++i) decided.normal.push_back({high[i], low[i]});
    decided.no_rebound = no_rebound;
    decided.have_least_norm = true;
    // The impulses were rounded.
    if (!high.empty()) decided.error += cluster.assembly.velocity_size(decided.normal.data()) * 0x1p-105;
  }
  ClusterResult result;
  {
    ReleasedGil released;
    result = resolve_cluster(cluster, options, given == Py_None ? nullptr : &decided);
  }
  PyObject* e = result.restitution < 0 ? Py_NewRef(Py_None) : PyFloat_FromDouble(result.restitution);
  return Py_BuildValue("iNdNisi", result.code, fields_of(result.effect, cluster.assembly), result.margin, e,
                       adjustments_of(cluster, result), result.fault, result.faulty);
}

// approaches_below(threshold): whether each contact approaches, slower than a threshold [m/s]; None: unknown.
PyObject* approaches_below(PyObject* self, PyObject* given) {
  const double threshold = PyFloat_AsDouble(given);
  if (PyErr_Occurred()) return nullptr;
  const Assembly& assembly = assembly_of(self);
  return listed(assembly.contacts.size(), [&](size_t i) {
    const std::optional<bool> is_below = assembly.approaches_below(assembly.contacts[i], threshold, false);
    return is_below ? PyBool_FromLong(*is_below) : Py_NewRef(Py_None);
  });
}

// contradictory_contacts(): the few contacts that seem to contradict each other, or an empty list.
PyObject* find_contradictory_contacts(PyObject* self, PyObject*) {
  const List<int> found = contradictory_contacts(assembly_of(self));
  return listed(found.size(), [&found](size_t i) { return PyLong_FromLong(found[i]); });
}

PyObject* get_is_locked(PyObject* self, void*) { return PyBool_FromLong(assembly_of(self).is_locked); }
PyObject* get_approach_is_uncertain(PyObject* self, void*) {
  return PyBool_FromLong(assembly_of(self).approach_is_uncertain());
}

PyMethodDef methods[] = {METHOD("resolve", resolve_by_law, METH_VARARGS),
                         METHOD("approaches_below", approaches_below, METH_O),
                         METHOD("contradictory_contacts", find_contradictory_contacts, METH_NOARGS),
                         {}};
PyGetSetDef fields[] = {{"is_locked", get_is_locked, nullptr, "", nullptr},
                        {"approach_is_uncertain", get_approach_is_uncertain, nullptr, "", nullptr},
                        {}};
PyType_Slot slots[] = {
    {Py_tp_dealloc, reinterpret_cast<void*>(dealloc)}, {Py_tp_methods, methods}, {Py_tp_getset, fields}, {}};
PyType_Spec spec = {"collision_response.kernels._compiled.Cluster", sizeof(ClusterObject), 0,
                    Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION, slots};

}  // namespace

// assemble(bodies, pairs, contacts, counts): a Cluster of contacts, each given as often as `counts` says; False if a
// contact is invalid; None if a number is not a float.
PyObject* assemble(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4 || !PyList_Check(args[0]) || !PyList_Check(args[1]) || !PyList_Check(args[2]) ||
      !PyList_Check(args[3]))
    return PyErr_Format(PyExc_TypeError, "assemble() takes four lists");
  ClusterParts parts;
  parts.bodies.resize(PyList_GET_SIZE(args[0]));
  for (size_t i = 0; i < parts.bodies.size(); ++i)
    if (!read_exact_body(PyList_GET_ITEM(args[0], i), parts.bodies[i].data())) return none_unless_error();
  for (Py_ssize_t k = 0; k < PyList_GET_SIZE(args[2]); ++k) {
    std::int64_t pair[2];
    ClusterParts::Contact contact{{}, {}, PyLong_AsDouble(PyList_GET_ITEM(args[3], k))};
    if (!read_exact_contact(PyList_GET_ITEM(args[2], k), contact.x) ||
        !read_pair(PyList_GET_ITEM(args[1], k), parts.bodies.size(), pair))
      return none_unless_error();
    for (int side = 0; side < 2; ++side) contact.body[side] = static_cast<int>(pair[side]);
    parts.contacts.push_back(contact);
  }
  auto cluster = std::make_unique<Cluster>(parts, false);
  if (cluster->fault) Py_RETURN_FALSE;
  auto* object = PyObject_New(ClusterObject, cluster_type);
  if (object) object->cluster = cluster.release();
  return reinterpret_cast<PyObject*>(object);
}

// kinetic_energy(body): [J], 0 if it is immovable; None if a number is not a float.
PyObject* kinetic_energy(PyObject*, PyObject* body) {
  AssembledBody read;
  if (!read_exact_body(body, read.x)) return none_unless_error();
  read.prepare();
  return PyFloat_FromDouble(read.centre_in_doubles.energy);
}

bool add_cluster_type(PyObject* module) {
  cluster_type = reinterpret_cast<PyTypeObject*>(PyType_FromSpec(&spec));
  return cluster_type && PyModule_AddType(module, cluster_type) == 0;
}
