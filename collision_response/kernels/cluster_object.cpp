// The Python type Cluster, for the laws of collision_response/scene/.
//
// Python holds impulses along the normals as bytes: a double-double for each contact.
#include <memory>

#include "module.hpp"
#include "scene/cluster.hpp"
#include "scene/contact_springs.hpp"
#include "scene/read_scene.hpp"

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

PyObject* bytes(const std::vector<DD>& p) {
  return PyBytes_FromStringAndSize(reinterpret_cast<const char*>(p.data()), p.size() * sizeof(DD));
}
// Read normal impulses. Those of another cluster are not found: a Python error is set.
ClusterImpulses read_impulses(PyObject* self, PyObject* o, double error = 0) {
  const std::size_t count = assembly_of(self).count;
  if (PyBytes_Check(o) && PyBytes_GET_SIZE(o) == static_cast<Py_ssize_t>(count * sizeof(DD))) {
    auto* p = reinterpret_cast<const DD*>(PyBytes_AS_STRING(o));
    return {true, {p, p + count}, error};
  }
  PyErr_SetString(PyExc_TypeError, "these are no impulses of this cluster");
  return {false};
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

// velocity_size(p): an upper bound on the size of the velocities that impulses p produce, in the metric of kinetic
// energy.
PyObject* velocity_size(PyObject* self, PyObject* o) {
  const ClusterImpulses impulses = read_impulses(self, o);
  return impulses.are_found ? PyFloat_FromDouble(assembly_of(self).velocity_size(impulses.normal.data())) : nullptr;
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
  const Cluster& cluster = cluster_of(self);
  const Assembly& assembly = cluster.assembly;
  ClusterImpulses impulses = read_impulses(self, normal, error);
  impulses.tangential.resize(tangential == Py_None ? 0 : 2 * assembly.count);
  if (!impulses.are_found || !read_list(tangential, impulses.tangential)) return nullptr;
  ImpulseEffect effect = effect_of(assembly, impulses, sticks_by_slip);
  return Py_BuildValue(
      "NNNNNN(dddd)dNNNN", listed(assembly.body_count, [&](size_t b) { return make_twist(&effect.changes[6 * b]); }),
      listed(assembly.body_count, [&](size_t b) { return make_twist(&effect.twists[6 * b]); }),
      listed(assembly.count, [&](size_t i) { return make_vec3(&effect.impulses[3 * i]); }),
      number_list(effect.normal_velocities_before), number_list(effect.normal_velocities_after),
      listed(assembly.count, [&](size_t i) { return Py_NewRef(PyTuple_GET_ITEM(python.regimes, effect.regimes[i])); }),
      effect.energies[0], effect.energies[1], effect.energies[2], effect.energies[3], effect.error_bound,
      PyBool_FromLong(cluster.has_massless_spin), PyBool_FromLong(cluster.has_off_unit_orientation),
      PyBool_FromLong(effect.creates_energy), PyBool_FromLong(effect.is_unphysical));
}

// The fields of ClusterImpulses of scene/impulses.py up to no_rebound; None if there is no answer.
PyObject* impulses_or_none(const ClusterImpulses& impulses) {
  if (!impulses.are_found) Py_RETURN_NONE;
  PyObject* tangential = impulses.tangential.empty() ? Py_NewRef(Py_None) : number_list(impulses.tangential);
  PyObject* e = impulses.restitution < 0 ? Py_NewRef(Py_None) : PyFloat_FromDouble(impulses.restitution);
  return Py_BuildValue("NNddNN", bytes(impulses.normal), tangential, impulses.error, impulses.margin, e,
                       PyBool_FromLong(impulses.no_rebound));
}

// reflections(threshold): the impulses of FRICTIONLESS.
PyObject* reflect(PyObject* self, PyObject* threshold) {
  const double relative = PyFloat_AsDouble(threshold);
  return PyErr_Occurred() ? nullptr : impulses_or_none(Reflections{assembly_of(self)}.resolve(relative));
}
// least_work_friction(p, error): the impulses of COULOMB, from frictionless ones.
PyObject* add_least_work_friction(PyObject* self, PyObject* args) {
  PyObject* normal;
  double error;
  if (!PyArg_ParseTuple(args, "Od", &normal, &error)) return nullptr;
  const ClusterImpulses impulses = read_impulses(self, normal, error);
  return impulses.are_found ? impulses_or_none(least_work_friction(assembly_of(self), impulses)) : nullptr;
}
// moreau(has_friction): the impulses of MOREAU.
PyObject* apply_moreau(PyObject* self, PyObject* has_friction) {
  return impulses_or_none(moreau(assembly_of(self), has_friction == Py_True));
}

// follow_springs(stiffness, exponent, tolerance, budget, has_friction): the impulses of ROUTH_STRONGE at the end of one
// path, normal and tangential (or None), the energy that friction took, and the rest of the budget. None if the budget
// ran out, False if the path has no end.
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
PyObject* get_approach_is_uncertain(PyObject* self, void*) {
  return PyBool_FromLong(assembly_of(self).approach_is_uncertain());
}
PyObject* get_is_out_of_range(PyObject* self, void*) { return PyBool_FromLong(cluster_of(self).is_out_of_range()); }

PyMethodDef methods[] = {METHOD("no_impulses", no_impulses, METH_NOARGS),
                         METHOD("impulses_from_floats", impulses_from_floats, METH_O),
                         METHOD("contradictory_contacts", find_contradictory_contacts, METH_NOARGS),
                         METHOD("velocity_size", velocity_size, METH_O),
                         METHOD("reflections", reflect, METH_O),
                         METHOD("effect_of", get_effect, METH_VARARGS),
                         METHOD("least_work_friction", add_least_work_friction, METH_VARARGS),
                         METHOD("moreau", apply_moreau, METH_O),
                         METHOD("follow_springs", follow_springs, METH_VARARGS),
                         {}};
PyGetSetDef fields[] = {{"is_locked", get_is_locked, nullptr, "", nullptr},
                        {"approach_is_uncertain", get_approach_is_uncertain, nullptr, "", nullptr},
                        {"is_out_of_range", get_is_out_of_range, nullptr, "", nullptr},
                        {}};
PyType_Slot slots[] = {
    {Py_tp_dealloc, reinterpret_cast<void*>(dealloc)}, {Py_tp_methods, methods}, {Py_tp_getset, fields}, {}};
PyType_Spec spec = {"collision_response.kernels._compiled.Cluster", sizeof(ClusterObject), 0, Py_TPFLAGS_DEFAULT,
                    slots};

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
    if (!read_body(PyList_GET_ITEM(args[0], i), parts.bodies[i].data())) Py_RETURN_NONE;
  for (Py_ssize_t k = 0; k < PyList_GET_SIZE(args[2]); ++k) {
    std::int64_t pair[2];
    ClusterParts::Contact contact{{}, {}, PyLong_AsDouble(PyList_GET_ITEM(args[3], k))};
    if (!read_contact(PyList_GET_ITEM(args[2], k), contact.x) ||
        !read_pair(PyList_GET_ITEM(args[1], k), parts.bodies.size(), pair))
      Py_RETURN_NONE;
    for (int side = 0; side < 2; ++side) contact.body[side] = static_cast<int>(pair[side]);
    parts.contacts.push_back(contact);
  }
  auto cluster = std::make_unique<Cluster>(parts, false);
  if (cluster->fault) Py_RETURN_FALSE;
  auto* object = PyObject_New(ClusterObject, cluster_type);
  if (object) object->cluster = cluster.release();
  return reinterpret_cast<PyObject*>(object);
}

bool add_cluster_type(PyObject* module) {
  cluster_type = reinterpret_cast<PyTypeObject*>(PyType_FromSpec(&spec));
  return cluster_type && PyModule_AddType(module, cluster_type) == 0;
}
