// The functions of the Python module _compiled, and the files that they are in.
#pragma once
#include "python_objects.hpp"

using Function = PyObject*(PyObject* module, PyObject* const* args, Py_ssize_t count);

Function resolve, numbers_with_errors;  // resolve.cpp
Function batch, resolve_columns, find_independent_sets;  // resolve_batch.cpp
Function resolve_scene, find_clusters;  // resolve_scene.cpp
PyObject *resolve_clusters(PyObject* module, PyObject* args), *has_fraction(PyObject* module, PyObject* o);
Function assemble;  // cluster_object.cpp
PyObject* kinetic_energy(PyObject* module, PyObject* body);
bool add_cluster_type(PyObject* module);
