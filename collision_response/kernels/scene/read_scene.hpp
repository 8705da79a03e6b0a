// Read the bodies, contacts and pairs of a scene from Python. False if a number is not exactly a float, or an index is
// wrong: these are left to Python.
#pragma once
#include "python_objects.hpp"
#include "constants.hpp"

#include <cmath>
#include <cstdint>

inline bool read_floats(PyObject* o, int count, double* x) {
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != count) return false;
  for (int k = 0; k < count; ++k)
    if (!read_exact_float(PyTuple_GET_ITEM(o, k), x[k])) return false;
  return true;
}
inline bool read_body(PyObject* o, double* x) {
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != 8) return false;
  auto item = [o](int k) { return PyTuple_GET_ITEM(o, k); };
  double* q = x + IN_BODY_A_ORIENTATION_X;
  q[0] = q[1] = q[2] = 0;
  q[3] = 1;
  return read_exact_float(item(0), x[0]) && read_floats(item(1), 6, x + IN_BODY_A_INERTIA_XX) &&
         read_floats(item(2), 3, x + IN_BODY_A_POSITION_X) && (item(3) == Py_None || read_floats(item(3), 4, q)) &&
         read_floats(item(4), 3, x + IN_BODY_A_VELOCITY_X) &&
         read_floats(item(5), 3, x + IN_BODY_A_ANGULAR_VELOCITY_X) && read_floats(item(6), 3, x + IN_BODY_A_COM_X);
}
inline bool read_contact(PyObject* o, double* x) {
  return PyTuple_Check(o) && PyTuple_GET_SIZE(o) == 5 && read_floats(PyTuple_GET_ITEM(o, 0), 3, x) &&
         read_floats(PyTuple_GET_ITEM(o, 1), 3, x + 3) && read_exact_float(PyTuple_GET_ITEM(o, 2), x[6]) &&
         read_exact_float(PyTuple_GET_ITEM(o, 3), x[7]);
}

// Read the indices of two different bodies.
inline bool read_pair(PyObject* o, long bodies, std::int64_t* pair) {
  if (!PyTuple_CheckExact(o) || PyTuple_GET_SIZE(o) != 2) return false;
  for (int side = 0; side < 2; ++side) {
    PyObject* index = PyTuple_GET_ITEM(o, side);
    if (!PyLong_CheckExact(index)) return false;
    pair[side] = PyLong_AsLong(index);
    if (pair[side] < 0 || pair[side] >= bodies) {
      PyErr_Clear();
      return false;
    }
  }
  return pair[0] != pair[1];
}
