// Python's named tuples of numbers, its lock and its errors.
#pragma once
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <new>

// Gives the GIL back when it ends, by an exception too.
class WithoutGil {
 public:
  WithoutGil() : state(PyEval_SaveThread()) {}
  WithoutGil(const WithoutGil&) = delete;
  ~WithoutGil() { PyEval_RestoreThread(state); }

 private:
  PyThreadState* state;
};

// A function for Python whose memory may not suffice.
template <auto function> struct Guarded;
template <class... Args, PyObject* (*function)(Args...)> struct Guarded<function> {
  static PyObject* call(Args... args) {
    try {
      return function(args...);
    } catch (const std::bad_alloc&) {
      return PyErr_NoMemory();
    }
  }
};

static inline PyObject* tuple_of(PyTypeObject* type, const double* x, int count) {
  PyObject* v = type->tp_alloc(type, count);
  if (v)
    for (int k = 0; k < count; ++k) PyTuple_SET_ITEM(v, k, PyFloat_FromDouble(x[k]));
  return v;
}
static inline PyObject* twist_of(PyTypeObject* twist, PyTypeObject* vec3, const double* x) {
  PyObject* t = twist->tp_alloc(twist, 2);
  if (t)
    for (int k = 0; k < 2; ++k) PyTuple_SET_ITEM(t, k, tuple_of(vec3, x + 3 * k, 3));
  return t;
}
// A contact as used: with another restitution, and without friction, where they differ.
static inline PyObject* used_contact(PyTypeObject* type, PyObject* contact, double e, bool e_changed, bool without_friction) {
  if (!e_changed && !without_friction) return Py_NewRef(contact);
  PyObject* used = type->tp_alloc(type, 5);
  for (int k = 0; used && k < 5; ++k) {
    bool changed = (k == 2 && e_changed) || (k == 3 && without_friction);
    PyTuple_SET_ITEM(used, k, changed ? PyFloat_FromDouble(k == 2 ? e : 0) : Py_NewRef(PyTuple_GET_ITEM(contact, k)));
  }
  return used;
}
