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
