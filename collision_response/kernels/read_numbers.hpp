// Read Python's numbers of any type as doubles, each with the error of its conversion.
#pragma once
#include <cmath>
#include <string>

#include "python_objects.hpp"

// Where numbers are read to.
struct InputBuffer {
  double* value;
  double* error;
  const char* const* names;  // of the numbers, for error messages
  bool* has_fraction = nullptr;  // set to true if a number is a Fraction
};

// Set a TypeError that ends with the repr() of an object, as format_value() of status.py has it. Python has none for an
// integer of too many digits. Return false.
constexpr int LONGEST = 1000;  // characters of the repr(), also in the format below
static __attribute__((noinline, cold)) bool set_type_error(const std::string& text, PyObject* o,
                                                           const char* hint = "") {
  PyObject* repr = PyObject_Repr(o);
  if (!repr && !PyErr_ExceptionMatches(PyExc_ValueError)) return false;
  PyErr_Clear();
  const char* rest = repr && PyUnicode_GetLength(repr) > LONGEST ? "..." : "";
  PyErr_Format(PyExc_TypeError, "%s is %.1000V%s%s", text.c_str(), repr, "of more digits than are shown", rest, hint);
  Py_XDECREF(repr);
  return false;
}

// Clear an error that a function of an object has raised. False if it stays set: one that is no Exception, such as Ctrl-C,
// or that no memory is left.
static bool clear_exception() {
  if (PyErr_Occurred() && (!PyErr_ExceptionMatches(PyExc_Exception) || PyErr_ExceptionMatches(PyExc_MemoryError)))
    return false;
  PyErr_Clear();
  return true;
}

// Whether an object is a truth value, a complex number or text, or something of NumPy that is not one real number: an
// array, a date, bytes. An array without axes that holds an object is what that object is.
static bool is_no_number(PyObject* o, bool is_held = false) {
  if (PyBool_Check(o) || PyComplex_Check(o) || PyUnicode_Check(o)) return true;
  if (!PyObject_CheckBuffer(o)) return false;
  Py_buffer view;
  if (PyObject_GetBuffer(o, &view, PyBUF_FULL_RO) != 0) {
    clear_exception();
    return true;
  }
  const std::string format = view.format ? view.format : "";
  const bool is_number = view.ndim == 0 && format.find_first_of("?Zswx") == std::string::npos;
  PyBuffer_Release(&view);
  if (!is_number || format != "O") return !is_number;
  PyObject* held = is_held ? nullptr : PyObject_CallMethod(o, "item", nullptr);
  const bool holds_no_number = !held || is_no_number(held, true);
  clear_exception();
  Py_XDECREF(held);
  return holds_no_number;
}

// Read number i from an object that is not exactly a float.
static __attribute__((noinline, cold)) bool read_other(PyObject* o, const InputBuffer& buffer, int i) {
  double& x = buffer.value[i];
  double& error = buffer.error[i];
  auto refuse = [&] {
    return !PyErr_Occurred() && set_type_error(std::string(buffer.names[i]) + ": must be a real number,", o);
  };
  if (read_exact_float(o, x)) return true;
  if (buffer.has_fraction && PyObject_TypeCheck(o, python.fraction)) *buffer.has_fraction = true;
  PyNumberMethods* as_number = Py_TYPE(o)->tp_as_number;
  if (is_no_number(o) || !as_number || !(as_number->nb_float || as_number->nb_index)) return refuse();
  PyObject* number = as_number->nb_float ? PyNumber_Float(o) : PyNumber_Index(o);
  if (number && !PyFloat_Check(number)) Py_SETREF(number, PyNumber_Float(number));
  if (!number) {
    const bool is_beyond = PyErr_ExceptionMatches(PyExc_OverflowError);
    if (!clear_exception()) return false;
    if (!is_beyond) return refuse();
    x = NAN;  // an integer beyond the range of floats counts as not finite
    return true;
  }
  x = PyFloat_AS_DOUBLE(number);
  if (x == x) {
    int is_exact = PyObject_RichCompareBool(o, number, Py_EQ);
    if (is_exact < 0 && !clear_exception()) {
      Py_DECREF(number);
      return false;
    }
    if (is_exact != 1) error = std::fabs(x) * 0x1p-53 + 0x1p-1074;
    if (is_exact != 1 && std::isinf(x)) x = NAN;  // a finite number beyond the range of floats, like that integer
  }
  Py_DECREF(number);
  return true;
}

static inline __attribute__((always_inline)) bool read_number(PyObject* o, const InputBuffer& buffer, int i) {
  if (__builtin_expect(PyFloat_CheckExact(o), 1)) {
    buffer.value[i] = PyFloat_AS_DOUBLE(o);
    return true;
  }
  return read_other(o, buffer, i);
}

// Whether an object can be iterated over, but is no numbers in an order.
static bool is_no_sequence(PyObject* o) {
  return PyUnicode_Check(o) || PyBytes_Check(o) || PyByteArray_Check(o) || PyAnySet_Check(o) || PyDict_Check(o);
}

// Read numbers from a sequence that is not a tuple of the right length: a list, an array.
static __attribute__((noinline, cold)) bool read_sequence(PyObject* o, int count, const InputBuffer& buffer, int i) {
  PyObject* items = is_no_sequence(o) ? nullptr : PySequence_Tuple(o);
  if (!items && !clear_exception()) return false;
  bool fits = items && PyTuple_GET_SIZE(items) == count;
  if (!fits) {
    std::string name(buffer.names[i]);
    name.resize(name.rfind('.'));
    set_type_error(name + ": must be " + std::to_string(count) + " numbers,", o);
  }
  for (int k = 0; fits && k < count; ++k) fits = read_number(PyTuple_GET_ITEM(items, k), buffer, i + k);
  Py_XDECREF(items);
  return fits;
}

// Read `count` numbers, from number i on.
template <int count>
static inline __attribute__((always_inline)) bool read_numbers(PyObject* o, const InputBuffer& buffer, int i) {
  if (__builtin_expect(!(PyTuple_Check(o) && PyTuple_GET_SIZE(o) == count), 0))
    return read_sequence(o, count, buffer, i);
  for (int k = 0; k < count; ++k)
    if (!read_number(PyTuple_GET_ITEM(o, k), buffer, i + k)) return false;
  return true;
}
