// Coulomb's conditions at several contacts.
#pragma once
#include "impulses.hpp"

// The impulses, in doubles, after which no contact is slower than its rebound, none that is loaded is faster, and friction
// opposes the slip. None are found if iterations do not settle within `budget` multiplications. The error is infinite if
// others obey these conditions as well.
ClusterImpulses obey_coulomb(const Assembly& assembly, const Vector& rebounds, double budget);
