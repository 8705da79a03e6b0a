// NumPy arrays, through the buffer protocol.
#pragma once
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <algorithm>
#include <initializer_list>

// A C-contiguous array; empty until it is opened.
struct Array {
  Py_buffer view{};
  Array() = default;
  Array(const Array&) = delete;
  ~Array() { PyBuffer_Release(&view); }
  // Return whether there is such an array. No Python error is set.
  bool open(PyObject* o, bool writable = false) {
    if (PyObject_GetBuffer(o, &view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0)) == 0)
      return true;
    PyErr_Clear();
    return false;
  }
  // Whether there is an array whose elements are of a type, by its format character, and which has a shape.
  bool has(char format, std::initializer_list<Py_ssize_t> shape) const {
    return is_open() && *view.format == format && !view.format[1] && view.ndim == static_cast<int>(shape.size()) &&
           std::equal(shape.begin(), shape.end(), view.shape);
  }
  bool has_int64() const { return is_open() && view.itemsize == 8 && (*view.format == 'l' || *view.format == 'q'); }
  bool is_open() const { return view.obj; }
  template <class T = char> T* at(Py_ssize_t index = 0) const { return static_cast<T*>(view.buf) + index; }
  template <class T = char> T* row(Py_ssize_t index) const {
    return reinterpret_cast<T*>(at(index * view.shape[view.ndim - 1] * view.itemsize));
  }
  bool overlaps(const Array& other) const { return at() < other.at(other.view.len) && other.at() < at(view.len); }
};

// Open arrays in this order. Return whether all are arrays.
inline bool open_arrays(PyObject* const* objects, std::initializer_list<Array*> arrays, bool writable = false) {
  return std::all_of(arrays.begin(), arrays.end(), [&](Array* one) { return one->open(*objects++, writable); });
}
