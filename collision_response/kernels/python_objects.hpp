// Helpers for Python's C API: numbers, named tuples, the GIL, errors.
#pragma once
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <unistd.h>

#include <new>

#include "constants.hpp"

// Releases the GIL for the lifetime of the object.
class ReleasedGil {
 public:
  ReleasedGil() : state(PyEval_SaveThread()) {}
  ReleasedGil(const ReleasedGil&) = delete;
  // After the end of the interpreter, Python before 3.14 ends a daemon thread here, by unwinding it. That must not leave a
  // destructor: the thread waits for the end of the process instead, as in Python 3.14.
  ~ReleasedGil() {
    try {
      PyEval_RestoreThread(state);
    } catch (...) {
      for (;;) pause();
    }
  }

 private:
  PyThreadState* state;
};

// A function for Python that raises MemoryError where C++ throws std::bad_alloc.
template <auto function> struct RaisesMemoryError;
template <class... Args, PyObject* (*function)(Args...)> struct RaisesMemoryError<function> {
  static PyObject* call(Args... args) {
    try {
      return function(args...);
    } catch (const std::bad_alloc&) { return PyErr_NoMemory(); }
  }
};

#define METHOD(name, function, flags) \
  {name, reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(RaisesMemoryError<function>::call)), flags, ""}

// Whether `o` is a float, or an integer that a double holds exactly; then x is set.
static inline bool read_exact_float(PyObject* o, double& x) {
  // float, or the last subclass of it: comparing is faster than PyFloat_Check.
  static PyTypeObject* known = &PyFloat_Type;
  if (Py_TYPE(o) == known || PyFloat_Check(o)) {
    if (!(Py_TYPE(o)->tp_flags & Py_TPFLAGS_HEAPTYPE)) known = Py_TYPE(o);  // a static type is never freed
    x = PyFloat_AS_DOUBLE(o);
    return true;
  }
  if (!PyLong_CheckExact(o)) return false;
  int overflow;
  long long whole = PyLong_AsLongLongAndOverflow(o, &overflow);
  x = static_cast<double>(whole);
  return !overflow && -(1LL << 53) <= whole && whole <= 1LL << 53;
}

// Python's types, functions and enumerations, given by setup().
struct PythonObjects {
  PyTypeObject *impact, *twist, *vec3, *body, *contact, *fraction;
  PyObject *statuses, *regimes, *adjustments;  // tuples of the members, by number
  PyObject *plan_model, *model_as_used, *refusal;
};
inline PythonObjects python;

static inline PyObject* with_unknown_hash(PyObject* tuple) {
#if PY_VERSION_HEX >= 0x030E0000
  if (tuple) reinterpret_cast<PyTupleObject*>(tuple)->ob_hash = -1;
#endif
  return tuple;
}
// A new named tuple, whose fields are null. finished() shows it to the garbage collector, and so to Python.
static inline PyObject* new_tuple(PyTypeObject* type, int count) {
  PyObject* tuple = type->tp_alloc(type, count);
  if (tuple) PyObject_GC_UnTrack(tuple);
  return with_unknown_hash(tuple);
}
// The same of a tuple of at least one entry; Python shares the empty one.
static inline PyObject* new_tuple(Py_ssize_t count) {
  PyObject* tuple = PyTuple_New(count);
  if (tuple) PyObject_GC_UnTrack(tuple);
  return tuple;
}
// A tuple whose fields are set; null if one could not be made.
static inline PyObject* finished(PyObject* tuple) {
  if (tuple && PyErr_Occurred()) Py_CLEAR(tuple);
  if (tuple) PyObject_GC_Track(tuple);
  return tuple;
}
// A new named tuple for numbers only, whose fields must be set at once. The garbage collector need not know it, which
// saves a tenth of the time of resolve().
static inline PyObject* new_tuple_of_numbers(PyTypeObject* type, int count) {
  return with_unknown_hash(reinterpret_cast<PyObject*>(PyObject_GC_NewVar(PyTupleObject, type, count)));
}
// Free a tuple of a class written in Python that has neither a finalizer nor attributes. Python's own function looks
// for these, which takes a fourteenth of the time of resolve(). For subclasses that function calls this one.
static inline void free_tuple_of_numbers(PyObject* tuple) {
  PyTypeObject* type = Py_TYPE(tuple);
  PyObject_GC_UnTrack(tuple);
  Py_TRASHCAN_BEGIN(tuple, free_tuple_of_numbers);
  for (Py_ssize_t i = Py_SIZE(tuple); i-- > 0;) Py_XDECREF(PyTuple_GET_ITEM(tuple, i));
  type->tp_free(tuple);
  Py_DECREF(type);
  Py_TRASHCAN_END
}
static inline PyObject* make_tuple(PyTypeObject* type, const double* x, int count) {
  PyObject* v = new_tuple_of_numbers(type, count);
  if (v)
    for (int k = 0; k < count; ++k) PyTuple_SET_ITEM(v, k, PyFloat_FromDouble(x[k]));
  return v;
}
static inline PyObject* make_vec3(const double* x) { return make_tuple(python.vec3, x, 3); }
static inline PyObject* make_twist(const double* x) {
  PyObject* t = new_tuple_of_numbers(python.twist, 2);
  if (t)
    for (int k = 0; k < 2; ++k) PyTuple_SET_ITEM(t, k, make_vec3(x + 3 * k));
  return t;
}
// The contact with the coefficients that were used: another restitution, or no friction, where these differ.
static inline PyObject* contact_as_used(PyObject* contact, double e, bool e_changed, bool without_friction) {
  if (!e_changed && !without_friction) return Py_NewRef(contact);
  PyObject* used = new_tuple(python.contact, CONTACT_FIELDS);
  for (int k = 0; used && k < CONTACT_FIELDS; ++k) {
    PyObject* field = k == CONTACT_FIELD_RESTITUTION && e_changed       ? PyFloat_FromDouble(e)
                      : k == CONTACT_FIELD_FRICTION && without_friction ? PyFloat_FromDouble(0)
                                                                        : Py_NewRef(PyTuple_GET_ITEM(contact, k));
    PyTuple_SET_ITEM(used, k, field);
  }
  return finished(used);
}
