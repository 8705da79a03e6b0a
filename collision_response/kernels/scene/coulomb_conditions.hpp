// Coulomb's conditions at several contacts.
#pragma once
#include "impulses.hpp"

// The axes along which the conditions hold for a contact: its own, or those of its face.
struct ConditionAxes {
  std::array<ContactAxis<double>, 3> axes;
  std::array<Axes, 3> in_own{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // each of them, along the own axes of the contact
  bool is_turned = false;  // whether these differ
  bool on_face = false;  // whether the contact is on one face with another
  Axes above{};  // where it is, in space, from the plane of its face, if it is slightly off this; else 0
};

// Of each contact, its own axes.
std::vector<ConditionAxes> own_axes(const Assembly& assembly);
// Of each contact, the axes along the mean normal of its face. The corners of a box whose normals are slightly off then
// share loads as if they were parallel.
std::vector<ConditionAxes> face_axes(const Assembly& assembly);

// The impulses, in doubles, after which no contact is slower than its rebound, none that is loaded is faster, and friction
// opposes the slip. `rebounds`: velocities along the own axes of each contact; they may have tangential parts, relative to
// which it sticks or slips. None are found if Newton's method does not lead there within `budget` multiplications. The
// error is an estimate, and infinite if other shares of the load obey these conditions with other velocities, or if
// impulses creep. `on_faces`: whether each contact that carries a load is on one face with another. Then impulses may creep,
// because they only shift between these.
ClusterImpulses obey_coulomb(const Assembly& assembly, const std::vector<ConditionAxes>& axes,
                             const std::vector<Axes>& rebounds, double budget, bool on_faces);
