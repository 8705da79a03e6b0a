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
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != BODY_FIELDS) return false;
  auto item = [o](int field) { return PyTuple_GET_ITEM(o, field); };
  PyObject* orientation = item(BODY_FIELD_ORIENTATION);
  x[BODY_ORIENTATION_X] = x[BODY_ORIENTATION_Y] = x[BODY_ORIENTATION_Z] = 0;
  x[BODY_ORIENTATION_W] = 1;
  return read_exact_float(item(BODY_FIELD_MASS), x[BODY_MASS]) &&
         read_floats(item(BODY_FIELD_INERTIA), 6, x + BODY_INERTIA_XX) &&
         read_floats(item(BODY_FIELD_POSITION), 3, x + BODY_POSITION_X) &&
         (orientation == Py_None || read_floats(orientation, 4, x + BODY_ORIENTATION_X)) &&
         read_floats(item(BODY_FIELD_VELOCITY), 3, x + BODY_VELOCITY_X) &&
         read_floats(item(BODY_FIELD_ANGULAR_VELOCITY), 3, x + BODY_ANGULAR_VELOCITY_X) &&
         read_floats(item(BODY_FIELD_COM), 3, x + BODY_COM_X);
}
inline bool read_contact(PyObject* o, double* x) {
  if (!PyTuple_Check(o) || PyTuple_GET_SIZE(o) != CONTACT_FIELDS) return false;
  auto item = [o](int field) { return PyTuple_GET_ITEM(o, field); };
  return read_floats(item(CONTACT_FIELD_POSITION), 3, x + CONTACT_POSITION_X) &&
         read_floats(item(CONTACT_FIELD_NORMAL), 3, x + CONTACT_NORMAL_X) &&
         read_exact_float(item(CONTACT_FIELD_RESTITUTION), x[CONTACT_RESTITUTION]) &&
         read_exact_float(item(CONTACT_FIELD_FRICTION), x[CONTACT_FRICTION]);
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
