// The door: Python's numbers of any make become doubles, each with the error of the conversion.
#pragma once
#include <cmath>
#include <cstring>
#include <string>

#include "python_objects.hpp"

struct Door {
  double* x;
  double* error;
  const char* const* names;  // of the numbers, for messages
  bool* rational = nullptr;  // set where a number is a fraction
};

// A TypeError that ends with what something is: its repr(), or what is said of integers that Python does not spell out.
static __attribute__((noinline, cold)) bool refuse_kind(const std::string& text, PyObject* o, const char* hint = "") {
  PyObject* spelled = PyObject_Repr(o);
  if (!spelled && !PyErr_ExceptionMatches(PyExc_ValueError)) return false;
  PyErr_Clear();
  PyErr_Format(PyExc_TypeError, "%s is %V%s", text.c_str(), spelled, "of more digits than are shown", hint);
  Py_XDECREF(spelled);
  return false;
}

// Anything that is not exactly a float. Python floats never come here.
static __attribute__((noinline, cold)) bool read_other(PyObject* o, const Door& door, int i) {
  double& x = door.x[i];
  double& error = door.error[i];
  auto refuse = [&] { return refuse_kind(std::string(door.names[i]) + ": must be a real number,", o); };
  if (read_exact_float(o, x)) return true;
  if (door.rational && PyObject_TypeCheck(o, python_types.fraction)) *door.rational = true;
  PyNumberMethods* as_number = Py_TYPE(o)->tp_as_number;
  if (PyBool_Check(o) || std::strncmp(Py_TYPE(o)->tp_name, "numpy.bool", 10) == 0 || PyComplex_Check(o) || PyUnicode_Check(o) || !as_number ||
      !(as_number->nb_float || as_number->nb_index))
    return refuse();
  PyObject* number = as_number->nb_float ? PyNumber_Float(o) : PyNumber_Index(o);
  if (number && !PyFloat_Check(number)) Py_SETREF(number, PyNumber_Float(number));
  if (!number) {
    if (!PyErr_ExceptionMatches(PyExc_OverflowError)) {
      PyErr_Clear();
      return refuse();
    }
    PyErr_Clear();  // an integer beyond the range of floats: not finite
    x = NAN;
    return true;
  }
  x = PyFloat_AS_DOUBLE(number);
  if (x == x) {
    int same = PyObject_RichCompareBool(o, number, Py_EQ);
    if (same < 0) PyErr_Clear();
    if (same != 1) error = std::fabs(x) * 0x1p-53 + 0x1p-1074;
    if (same != 1 && std::isinf(x)) x = NAN;  // a finite number beyond the range of floats, as that integer
  }
  Py_DECREF(number);
  return true;
}

static inline __attribute__((always_inline)) bool read_number(PyObject* o, const Door& door, int i) {
  if (__builtin_expect(PyFloat_CheckExact(o), 1)) {
    door.x[i] = PyFloat_AS_DOUBLE(o);
    return true;
  }
  return read_other(o, door, i);
}

// Numbers in something that is no tuple of them: a list, an array.
static __attribute__((noinline, cold)) bool read_sequence(PyObject* o, int count, const Door& door, int i) {
  PyObject* items = PyUnicode_Check(o) ? nullptr : PySequence_Tuple(o);
  if (!items) PyErr_Clear();
  bool fits = items && PyTuple_GET_SIZE(items) == count;
  if (!fits) {
    std::string name(door.names[i]);
    name.resize(name.rfind('.'));
    refuse_kind(name + ": must be " + std::to_string(count) + " numbers,", o);
  }
  for (int k = 0; fits && k < count; ++k) fits = read_number(PyTuple_GET_ITEM(items, k), door, i + k);
  Py_XDECREF(items);
  return fits;
}

template <int count>
static inline __attribute__((always_inline)) bool read_numbers(PyObject* o, const Door& door, int i) {
  if (__builtin_expect(!(PyTuple_Check(o) && PyTuple_GET_SIZE(o) == count), 0))
    return read_sequence(o, count, door, i);
  for (int k = 0; k < count; ++k)
    if (!read_number(PyTuple_GET_ITEM(o, k), door, i + k)) return false;
  return true;
}
