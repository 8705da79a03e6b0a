// Coulomb's conditions at several contacts.
#pragma once
#include <functional>

#include "impulses.hpp"

// The axes of a contact, turned into those of the first contact of its face. The corners of a box whose normals differ by
// rounding then share loads as if they lay in a plane.
struct FaceAxes {
  std::array<ContactAxis<double>, 3> axes;
  std::array<Axes, 3> in_own;  // each of them, along the own axes of the contact

  // Along the first one, of a velocity along the own axes.
  double normal_part(const Axes& velocity) const {
    return in_own[0][0] * velocity[0] + in_own[0][1] * velocity[1] + in_own[0][2] * velocity[2];
  }
};

// The impulses, in doubles, after which no contact is slower than its rebound, none that is loaded is faster, and friction
// opposes the slip. rebound(i, face): of contact i, along the normal of its face. None are found if Newton's method does not
// lead there within `budget` multiplications. The error is an estimate, and infinite if other shares of the load obey these
// conditions with other velocities, or if impulses creep.
ClusterImpulses obey_coulomb(const Assembly& assembly, const std::function<double(int, const FaceAxes&)>& rebound,
                             double budget);
