// Python's numbers, named tuples of them, its lock and its errors.
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

#define FAST(name, function) {name, reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(Guarded<function>::call)), METH_FASTCALL, ""}

// A float, or an integer that is one.
static inline bool exact_float(PyObject* o, double& x) {
  static PyTypeObject* known = &PyFloat_Type;  // np.float64, if that was the last: to ask for its bases takes longer
  if (Py_TYPE(o) == known || PyFloat_Check(o)) {
    if (!(Py_TYPE(o)->tp_flags & Py_TPFLAGS_HEAPTYPE)) known = Py_TYPE(o);  // it is there for ever
    x = PyFloat_AS_DOUBLE(o);
    return true;
  }
  if (!PyLong_CheckExact(o)) return false;
  int overflow;
  long long whole = PyLong_AsLongLongAndOverflow(o, &overflow);
  x = static_cast<double>(whole);
  return !overflow && -(1LL << 53) <= whole && whole <= 1LL << 53;
}

// What Python's side knows, given by setup().
static struct {
  PyTypeObject *vec3, *twist, *contact, *fraction;
  PyObject *statuses, *regimes, *adjustments;  // by number
} types;

static inline PyObject* tuple_of(PyTypeObject* type, const double* x, int count) {
  PyObject* v = type->tp_alloc(type, count);
  if (v)
    for (int k = 0; k < count; ++k) PyTuple_SET_ITEM(v, k, PyFloat_FromDouble(x[k]));
  return v;
}
static inline PyObject* vector(const double* x) { return tuple_of(types.vec3, x, 3); }
static inline PyObject* twist(const double* x) {
  PyObject* t = types.twist->tp_alloc(types.twist, 2);
  if (t)
    for (int k = 0; k < 2; ++k) PyTuple_SET_ITEM(t, k, vector(x + 3 * k));
  return t;
}
// A contact as used: with another restitution, and without friction, where they differ.
static inline PyObject* used_contact(PyObject* contact, double e, bool e_changed, bool without_friction) {
  if (!e_changed && !without_friction) return Py_NewRef(contact);
  PyObject* used = types.contact->tp_alloc(types.contact, 5);
  for (int k = 0; used && k < 5; ++k) {
    bool changed = (k == 2 && e_changed) || (k == 3 && without_friction);
    PyTuple_SET_ITEM(used, k, changed ? PyFloat_FromDouble(k == 2 ? e : 0) : Py_NewRef(PyTuple_GET_ITEM(contact, k)));
  }
  return used;
}
