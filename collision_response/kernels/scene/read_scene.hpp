// Read the bodies, contacts and pairs of a scene from Python. False if a double does not hold a number exactly, or an
// index is wrong: these are left to Python.
#pragma once
#include <algorithm>
#include <cstdint>

#include "read_request.hpp"

// Clear a TypeError, which Python finds again. Other errors, such as Ctrl-C, stay set.
inline void clear_type_error() {
  if (PyErr_Occurred() && PyErr_ExceptionMatches(PyExc_TypeError)) PyErr_Clear();
}

inline PyObject* none_unless_error() { return PyErr_Occurred() ? nullptr : Py_NewRef(Py_None); }

// Call read(buffer), which reads `count` numbers. Whether doubles hold all of them exactly. `names`: see InputBuffer.
template <class Read>
bool read_exactly(double* x, int count, const char* const* names, Read read) {
  double error[ALL_INPUTS];
  std::fill_n(error, count, 0.0);
  bool has_fraction = false;
  if (!read(InputBuffer{x, error, names, &has_fraction})) {
    clear_type_error();
    return false;
  }
  return !has_fraction && std::all_of(error, error + count, [](double e) { return e == 0; }) &&
         std::none_of(x, x + count, [](double number) { return number != number; });
}
inline bool read_exact_body(PyObject* o, double* x) {
  return !is_articulated(o) &&
         read_exactly(x, BODY, input_names, [o](const InputBuffer& buffer) { return read_body(o, buffer, 0); });
}
inline bool read_exact_contact(PyObject* o, double* x) {
  bool has_function = false;
  auto read = [&](const InputBuffer& buffer) { return read_contact(o, buffer, 0, &has_function); };
  // It becomes part of the answer, which could not be compared if its vectors were arrays.
  auto is_tuple = [o](int field) { return PyTuple_Check(PyTuple_GET_ITEM(o, field)); };
  return read_exactly(x, CONTACT, input_names + IN_CONTACT, read) && !has_function &&
         is_tuple(CONTACT_FIELD_POSITION) && is_tuple(CONTACT_FIELD_NORMAL);
}

// Read the indices of two different bodies.
inline bool read_pair(PyObject* o, long bodies, std::int64_t* pair) {
  PyObject* items = PyTuple_CheckExact(o) ? Py_NewRef(o) : PySequence_Tuple(o);
  bool fits = items && PyTuple_GET_SIZE(items) == 2;
  for (int side = 0; fits && side < 2; ++side) {
    PyObject* index = PyTuple_GET_ITEM(items, side);
    pair[side] = PyIndex_Check(index) && !PyBool_Check(index) ? PyNumber_AsSsize_t(index, nullptr) : -1;
    fits = pair[side] >= 0 && pair[side] < bodies;
  }
  Py_XDECREF(items);
  clear_type_error();
  return fits && pair[0] != pair[1];
}
