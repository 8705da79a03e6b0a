// Read the bodies and contacts of a request from Python, with clear errors for what is none.
#pragma once
#include <algorithm>
#include <cstring>

#include "constants.hpp"
#include "read_numbers.hpp"

inline bool is_body(PyObject* o) { return PyObject_TypeCheck(o, python.body) && PyTuple_GET_SIZE(o) == BODY_FIELDS; }
inline bool is_articulated(PyObject* o) {
  return is_body(o) && PyTuple_GET_ITEM(o, BODY_FIELD_INVERSE_INERTIA) != Py_None;
}

// Read a body, from number i on. For an articulated one, its inverse inertia takes the place of mass, inertia,
// orientation and centre of mass.
inline bool read_body(PyObject* body, const InputBuffer& buffer, int i) {
  if (!is_body(body)) {
    std::string name(buffer.names[i]);
    name.resize(name.find('.'));
    bool is_message = !strcmp(Py_TYPE(body)->tp_name, "BodyState");
    const char* hint = is_message ? "; collision_response.ros.convert.body_of(name, message) makes one"
                                  : "; Body.dynamic(...) and Body.static() make one";
    return set_type_error(name + ": must be a Body,", body, hint);
  }
  auto item = [body](int field) { return PyTuple_GET_ITEM(body, field); };
  PyObject *orientation = item(BODY_FIELD_ORIENTATION), *inverse_inertia = item(BODY_FIELD_INVERSE_INERTIA);
  bool rigid = inverse_inertia == Py_None;
  if (!rigid) {
    orientation = Py_None;
    std::fill_n(buffer.value + i, BODY, 0.0);
    buffer.value[i + BODY_MASS] = INFINITY;
  }
  if (orientation == Py_None) {
    std::fill_n(buffer.value + i + BODY_ORIENTATION_X, 3, 0.0);
    buffer.value[i + BODY_ORIENTATION_W] = 1;
  }
  return (rigid ? read_number(item(BODY_FIELD_MASS), buffer, i + BODY_MASS) &&
                      read_numbers<6>(item(BODY_FIELD_INERTIA), buffer, i + BODY_INERTIA_XX)
                : read_numbers<INVERSE_INERTIA>(inverse_inertia, buffer, INPUTS + i / BODY * INVERSE_INERTIA)) &&
         read_numbers<3>(item(BODY_FIELD_POSITION), buffer, i + BODY_POSITION_X) &&
         (orientation == Py_None || read_numbers<4>(orientation, buffer, i + BODY_ORIENTATION_X)) &&
         read_numbers<3>(item(BODY_FIELD_VELOCITY), buffer, i + BODY_VELOCITY_X) &&
         read_numbers<3>(item(BODY_FIELD_ANGULAR_VELOCITY), buffer, i + BODY_ANGULAR_VELOCITY_X) &&
         (!rigid || read_numbers<3>(item(BODY_FIELD_COM), buffer, i + BODY_COM_X));
}

inline bool is_function(PyObject* o) { return !PyFloat_CheckExact(o) && PyCallable_Check(o); }

// Read a contact, from number i on, without its tangential restitution. A coefficient that is a function is not read; then
// has_function is set.
inline bool read_contact(PyObject* contact, const InputBuffer& buffer, int i, bool* has_function) {
  if (!PyObject_TypeCheck(contact, python.contact) || PyTuple_GET_SIZE(contact) != CONTACT_FIELDS)
    return set_type_error("contact: must be a Contact, made by Contact.of(...);", contact);
  auto item = [contact](int field) { return PyTuple_GET_ITEM(contact, field); };
  PyObject *e = item(CONTACT_FIELD_RESTITUTION), *mu = item(CONTACT_FIELD_FRICTION);
  bool e_is_function = is_function(e), mu_is_function = is_function(mu);
  if (e_is_function) buffer.value[i + CONTACT_RESTITUTION] = 1;
  if (mu_is_function) buffer.value[i + CONTACT_FRICTION] = 0;
  *has_function = e_is_function || mu_is_function;
  return read_numbers<3>(item(CONTACT_FIELD_POSITION), buffer, i + CONTACT_POSITION_X) &&
         read_numbers<3>(item(CONTACT_FIELD_NORMAL), buffer, i + CONTACT_NORMAL_X) &&
         (e_is_function || read_number(e, buffer, i + CONTACT_RESTITUTION)) &&
         (mu_is_function || read_number(mu, buffer, i + CONTACT_FRICTION));
}
