// The axes along which Coulomb's conditions hold: those of the contacts, or of the faces that these are on.
#pragma once
#include "assembly.hpp"

// The axes along which the conditions hold for a contact: its own, or those of its face.
struct ConditionAxes {
  std::array<ContactAxis<double>, 3> axes;
  std::array<Axes, 3> in_own{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // each of them, along the own axes of the contact
  bool is_turned = false;  // whether these differ
  bool on_face = false;  // whether the contact is on one face with another
  Axes above{};  // where it is, in space, from the plane of its face, if it is slightly off this; else 0
};

// Of each contact, its own axes.
List<ConditionAxes> own_axes(const Assembly& assembly);
// Of each contact, the axes along the mean normal of its face. The corners of a box whose normals are slightly off then
// share loads as if they were parallel.
List<ConditionAxes> face_axes(const Assembly& assembly);
