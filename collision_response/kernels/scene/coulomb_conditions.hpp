// Coulomb's conditions at several contacts.
#pragma once
#include "condition_axes.hpp"
#include "impulses.hpp"

// The impulses, in doubles, after which no contact is slower than its rebound, none that is loaded is faster, and friction
// opposes the slip. `rebounds`: velocities along the own axes of each contact; they may have tangential parts, relative to
// which it sticks or slips. None are found if Newton's method does not lead there within `budget` multiplications. The
// error is an estimate, and infinite if other shares of the load obey these conditions with other velocities, or if
// impulses creep. `on_faces`: whether each contact that carries a load is on one face with another. Then impulses may creep,
// because they only shift between these.
ClusterImpulses obey_coulomb(const Assembly& assembly, const List<ConditionAxes>& axes, const List<Axes>& rebounds,
                             double budget, bool on_faces);
