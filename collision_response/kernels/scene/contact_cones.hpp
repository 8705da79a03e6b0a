// The contacts of a cluster as cones of friction.
#pragma once
#include "assembly.hpp"
#include "cone.hpp"

// Coefficients of friction: greater ones have no further effect, and smaller ones none at all.
constexpr double GREATEST_FRICTION = 1e30, LEAST_FRICTION = 1e-30;

// The mean of n.K n of unit normals.
inline double mean_inverse_mass(const Assembly& assembly, const List<int>& among) {
  double sum = 0;
  for (int i : among) sum += 1 / (assembly.contacts[i].unit() * assembly.contacts[i].unit());
  return sum / static_cast<double>(among.size());
}

// A contact as a cone, with impulses in units that make n.K n of every contact 1, and velocities in units of `speed`.
// `mean` is the mean of n.K n of unit normals. part and load: see Cone.
template <class R>
Cone<R> cone_of(const AssembledContact& contact, const std::array<ContactAxis<R>, 3>& axes, double speed, double mean,
                double part = 1, double load = 1) {
  Cone<R> cone;
  const double unit = contact.unit();
  for (int side = 0; side < 2; ++side) {
    cone.body[side] = contact.body[side];
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < 6; ++k) cone.row[side][axis][k] = unit * axes[axis].row[side][k];
  }
  for (int axis = 0; axis < 3; ++axis) cone.w[axis] = unit * axes[axis].velocity / speed;
  cone.mu = contact.mu > LEAST_FRICTION ? std::fmin(contact.mu, GREATEST_FRICTION) : 0;
  if (!(cone.mu > 0)) cone.w[1] = cone.w[2] = R{};  // they have no effect, but may be large
  cone.part = part;
  cone.load = load;
  // So that the least sum of squares is that of impulses in newton seconds.
  cone.share = std::fmin(std::fmax(1 / (unit * unit * mean), 1e-3), 1e3);
  return cone;
}

// An impulse of such a cone in newton seconds.
inline Axes in_newton_seconds(Axes P, const AssembledContact& contact, double speed) {
  for (double& along : P) along = along * speed * contact.unit();
  return P;
}
