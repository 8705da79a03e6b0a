// Coulomb's conditions at several contacts.
#pragma once
#include "impulses.hpp"

// The impulses, in doubles, after which no contact is slower than its rebound, none that is loaded is faster, and friction
// opposes the slip. None are found if Newton's method does not lead there within `budget` multiplications. The error is an
// estimate, and infinite if other shares of the load obey these conditions with other velocities, or if impulses creep.
// `on_faces`: whether each contact is parallel to another one of the same bodies. Then impulses may creep, because they only
// shift between these, but solutions that slight changes of velocities decide do not count.
ClusterImpulses obey_coulomb(const Assembly& assembly, const Vector& rebounds, double budget, bool on_faces);
