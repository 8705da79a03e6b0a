// Motions that impulses along the axes of contacts cause, in plain doubles.
#pragma once
#include "assembly.hpp"

// A motion of the movable bodies: their twists have changed by L y.
struct Motion {
  const Assembly* assembly;
  Vector y;
  explicit Motion(const Assembly& assembly) : assembly(&assembly), y(6 * static_cast<size_t>(assembly.body_count)) {}

  void apply(int i, const Axes& by) {
    const AssembledContact& contact = assembly->contacts[i];
    for (int side = 0; side < 2; ++side)
      if (contact.body[side] >= 0) {
        double* of = &y[6 * contact.body[side]];
        for (int axis = 0; axis < 3; ++axis)
          for (int k = 0; k < 6; ++k) of[k] += contact.axes[axis].row[side][k] * by[axis];
      }
  }
  double velocity(int i, int axis) const {
    const AssembledContact& contact = assembly->contacts[i];
    double sum = contact.axes[axis].velocity;
    for (int side = 0; side < 2; ++side)
      if (contact.body[side] >= 0)
        for (int k = 0; k < 6; ++k) sum += contact.axes[axis].row[side][k] * y[6 * contact.body[side] + k];
    return sum;
  }
  // The angular velocity of body_a of contact i, relative to body_b.
  Axes spin(int i) const {
    const AssembledContact& contact = assembly->contacts[i];
    Axes relative{};
    for (int side = 0; side < 2; ++side) {
      const AssembledBody* body = assembly->body_of(contact, side);
      if (!body) continue;
      double change[6]{};
      if (contact.body[side] >= 0) body->centre_in_doubles.twist_of(&y[6 * contact.body[side]], change);
      for (int k = 0; k < 3; ++k)
        relative[k] += (side == 0 ? 1 : -1) * (body->x[BODY_ANGULAR_VELOCITY_X + k] + change[3 + k]);
    }
    return relative;
  }
  double speed(int i) const { return std::hypot(velocity(i, 0), velocity(i, 1), velocity(i, 2)); }
  // The terms that the change of the velocity of a contact along an axis is the sum of, without their signs.
  double size_at(int i, int axis) const {
    double sum = 0;
    for (int side = 0; side < 2; ++side)
      for (int k = 0; assembly->contacts[i].body[side] >= 0 && k < 6; ++k)
        sum += std::fabs(assembly->contacts[i].axes[axis].row[side][k] * y[6 * assembly->contacts[i].body[side] + k]);
    return sum;
  }
  Axes velocity(int i) const { return {velocity(i, 0), velocity(i, 1), velocity(i, 2)}; }
};

// The velocity of contact i along its axis a by a unit impulse on contact j along its axis b.
inline double coupling(const Assembly& assembly, int i, int a, int j, int b) {
  const AssembledContact &one = assembly.contacts[i], &other = assembly.contacts[j];
  double sum = 0;
  for (int s = 0; s < 2; ++s)
    for (int t = 0; t < 2; ++t)
      if (one.body[s] >= 0 && one.body[s] == other.body[t])
        for (int k = 0; k < 6; ++k) sum += one.axes[a].row[s][k] * other.axes[b].row[t][k];
  return sum;
}
