// The Python module _compiled. See library.py.
#include "module.hpp"

#include "kernel_table.hpp"

namespace {

// limit_vectors(bits): use no vectors longer than this. The results are the same.
PyObject* limit_vectors(PyObject*, PyObject* bits) {
  longest_vectors = PyLong_AsLong(bits);
  return PyErr_Occurred() ? nullptr : Py_NewRef(Py_None);
}

// setup(...): take the Python objects that the functions use.
PyObject* setup(PyObject*, PyObject* args) {
  static PyInterpreterState* const first = PyInterpreterState_Get();
  if (PyInterpreterState_Get() != first)
    return PyErr_Format(PyExc_ImportError, "collision_response: another interpreter of this process has imported it");
  if (!PyArg_ParseTuple(args, "OOOOOOOOOOOO", &python.impact, &python.twist, &python.vec3, &python.body,
                        &python.contact, &python.fraction, &python.statuses, &python.regimes, &python.adjustments,
                        &python.plan_model, &python.model_as_used, &python.refusal))
    return nullptr;
  python.vec3->tp_dealloc = python.twist->tp_dealloc = free_tuple_of_numbers;
  Py_INCREF(args);  // keeps the objects alive
  Py_RETURN_NONE;
}

PyMethodDef methods[] = {METHOD("resolve", resolve, METH_FASTCALL),
                         METHOD("numbers_with_errors", numbers_with_errors, METH_FASTCALL),
                         METHOD("batch", batch, METH_FASTCALL),
                         METHOD("resolve_columns", resolve_columns, METH_FASTCALL),
                         METHOD("find_independent_sets", find_independent_sets, METH_FASTCALL),
                         METHOD("resolve_scene", resolve_scene, METH_FASTCALL),
                         METHOD("find_clusters", find_clusters, METH_FASTCALL),
                         METHOD("resolve_clusters", resolve_clusters, METH_VARARGS),
                         METHOD("assemble", assemble, METH_FASTCALL),
                         METHOD("kinetic_energy", kinetic_energy, METH_O),
                         METHOD("has_fraction", has_fraction, METH_O),
                         METHOD("limit_vectors", limit_vectors, METH_O),
                         METHOD("setup", setup, METH_VARARGS),
                         {}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_compiled", "", -1, methods, nullptr, nullptr, nullptr, nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__compiled() {
  PyObject* module = PyModule_Create(&definition);
  if (module && !add_cluster_type(module)) Py_CLEAR(module);
  return module;
}
