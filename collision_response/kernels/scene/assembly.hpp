// The movable bodies and the contacts of one cluster, and what impulses do to them.
//
// Normal impulses p are exact numbers in double-double: they are what was chosen. What they do, v = v0 + M^-1 N p and
// u = u0 + A p, is computed from them with a bound on the error, each time from the start. What happens along the unit
// normal and two tangents is also known in plain doubles.
#pragma once
#include <optional>

#include "active_set.hpp"
#include "assembled.hpp"

struct Assembly {
  int count = 0, body_count = 0;  // of contacts, of movable bodies
  List<AssembledContact> contacts;
  List<AssembledBody> bodies;  // the movable ones
  List<AssembledBody> walls;  // the immovable ones that move, once for each contact
  bool has_moving_wall = false;
  bool walls_move_apart = false;  // whether no observer sees all immovable bodies at rest
  // A velocity that separates all contacts, if there is one: by how much, scaled, and its size in the metric of kinetic
  // energy.
  Vector separation;
  double separating_size = 0;
  bool is_locked = false;  // no velocity separates all contacts, as far as 32 digits can tell

  // Add a contact, given by its numbers.
  void add(const AssembledBody& a, const AssembledBody& b, const double* given, double copies);

  // After the last contact. If no contact approaches, there is no impulse, and nothing else to know.
  void finish();

  // n.K n of two contacts, by the bodies that they share.
  template <class R>
  static R coupling(const AssembledContact& i, const AssembledContact& j) {
    R sum{};
    for (int a = 0; a < 2; ++a)
      for (int b = 0; b < 2; ++b)
        if (i.body[a] >= 0 && i.body[a] == j.body[b])
          for (int k = 0; k < 6; ++k) sum = sum + rounded_to<R>(i.jacobian[a][k]) * rounded_to<R>(j.response[b][k]);
    return sum;
  }
  // The matrix A: n.K n of all pairs of contacts, scaled to a diagonal of 1, in the digits of R.
  template <class R>
  const List<R>& couplings() const {
    if constexpr (is_scalar<R>) {
      return A;
    } else {
      if (finer_A.empty()) finer_A = scaled_couplings<R>();
      return finer_A;
    }
  }

  bool is_finite() const;

  // Whether every impulse that stops a fastest approach by itself is at least the least double.
  bool has_representable_impulses() const;

  // Whether no contact approaches, whatever the error of its velocity.
  bool surely_separates() const;
  // Whether no contact seems to approach, but one may, within the error of its velocity.
  bool approach_is_uncertain() const;
  // Whether a contact approaches, slower than a threshold [m/s]; unknown if doubles cannot tell, as for speeds that nearly
  // agree if the threshold was rounded.
  std::optional<bool> approaches_below(const AssembledContact& contact, double threshold, bool is_exact) const;

  // What happens along the unit normal and two tangents of a contact, in the digits of R. The velocities of the bodies,
  // and the arms, may nearly cancel, so their differences are taken in double-double.
  template <class R>
  std::array<ContactAxis<R>, 3> axes_of(const AssembledContact& contact) const;

  // The changes of the twists of the movable bodies by impulses p.
  List<N> twist_changes(const DD* p) const;

  // The change of a normal velocity, times the length of the normal, by changes of twists.
  N velocity_change(const AssembledContact& contact, const List<N>& twists) const;

  // The normal velocities after impulses p, times the lengths of the normals.
  List<N> velocities(const DD* p) const;

  // An upper bound on |M^-1 N p| in the metric of kinetic energy.
  double velocity_size(const DD* p) const {
    double sum = 0;
    for (int i = 0; i < count; ++i) sum += std::fabs(p[i].h) / contacts[i].scale;
    return sum * ROUND_UP;
  }

  List<int> all_contacts() const {
    List<int> all(count);
    std::iota(all.begin(), all.end(), 0);
    return all;
  }

  // One body of a contact; nullptr: it is at rest and immovable.
  const AssembledBody* body_of(const AssembledContact& contact, int side) const {
    return contact.body[side] >= 0   ? &bodies[contact.body[side]]
           : contact.wall[side] >= 0 ? &walls[contact.wall[side]]
                                     : nullptr;
  }

 private:
  std::optional<AssembledBody> first_wall;
  Vector A;
  mutable List<DD> finer_A;  // found when it is first asked for

  template <class R>
  List<R> scaled_couplings() const;

  void set_columns(AssembledContact& contact) const;
  template <class R>
  bool find_separating_velocity();
};
