// MOREAU for several contacts: Newton's restitution at each, all at once. Time steppers converge to it.
//
//     u_n+ + e min(u_n, 0) >= 0    complementary to    P_n >= 0
//
// so that a contact that separates never comes to approach, and friction opposes the slip after the impact, as for a
// single contact. Without friction this is one linear complementarity problem. With friction,
//
//     u_n+ + e min(u_n, 0) + s    with the shift    s = mu |u_t+|
//
// takes the place of u_n+ + e min(u_n, 0). For a given s this is a convex programme, that of COULOMB, with a unique
// u+. s starts at 0 and is updated until it no longer changes. If there are several solutions, of which there may be
// many where friction is great or where more contacts than necessary share a load, this finds one of them. In a dense
// pile it may depend on the order of the contacts.
//
// The error bound is an estimate. It tries shifts near the one found, and measures how much nearer one update takes
// them. Of solutions that lie apart from it, the bound knows nothing. If it takes them no nearer, as when contacts lock,
// or when several ways to share a load lead to several u+, the bound is infinite.
//
// COULOMB answers instead if s does not settle, or if no velocities rebound from all contacts. Unequal coefficients,
// and friction, may create energy: if they create more than 2^-40 of the work at the contacts, COULOMB answers, or
// FRICTIONLESS if there is no friction.
//
// Sources: Moreau, "Unilateral Contact and Dry Friction in Finite Freedom Dynamics", 1988; De Saxce & Feng, "The
// Bipotential Method", Math. Comput. Model. 28 (1998), for the shift by mu |u_t|; Acary, Cadoux, Lemarechal & Malick,
// "A Formulation of the Linear Discrete Coulomb Friction Problem via Convex Optimization", Z. Angew. Math. Mech. 91
// (2011), for the convex programmes.
#pragma once
#include "cones.hpp"
#include "contact_cones.hpp"
#include "impulses.hpp"
#include "projection.hpp"

// The shifts mu |u_t| of a solution.
inline Vector shifts_of(const Cones<double>& programme) {
  Vector shifts;
  for (size_t i = 0; i < programme.cones.size(); ++i)
    shifts.push_back(programme.cones[i].mu * std::hypot(programme.z[i][1], programme.z[i][2]));
  return shifts;
}
// The greatest distance between two components.
inline double distance(const Vector& one, const Vector& other) {
  double most = 0;
  for (size_t i = 0; i < one.size(); ++i) most = std::fmax(most, std::fabs(one[i] - other[i]));
  return most;
}

// How far the normal velocities are from those of the law. `start`: e min(u_n, 0) + u_n.
inline double rebound_error(const Cones<double>& programme, const Vector& start) {
  const Vector y = programme.motion();
  double most = 0;
  for (size_t i = 0; i < start.size(); ++i) {
    const double off = start[i] + programme.cones[i].velocity(y.data())[0];
    most = std::fmax(most, programme.P[i][0] > 0 ? std::fabs(off) : -off);
  }
  return most;
}

constexpr double MOREAU_BUDGET = 2e9;  // multiplications, for shifts to settle: a second or two

// An estimate of the error of the velocities, if one more round changes the shifts by `change`. A round takes shifts at
// a small distance from these nearer to them, by some rate. If it takes them nearer by more than `change`, there is a
// fixed point within that distance. Where contacts lock, or share a load in several ways, all shifts nearby are fixed
// points, and the error is unknown: infinite. The rate is that in the direction in which rounds are slowest, by the
// power method.
inline double shift_error(Cones<double> programme, const Vector& start, const Vector& shift, double change) {
  constexpr double LEAST = 1e-9, WIDER = 30, WIDEST = 1e-3, ROUNDING = 1e-12, FIXED = 1 - 1e-5, UNEVENNESS = 0.6;
  constexpr double NOISE = 1e-14;  // changes of the shifts that are rounding have no direction
  constexpr int ROUNDS = 20;
  auto round_from = [&](const Vector& by) {
    for (size_t i = 0; i < by.size(); ++i) programme.cones[i].w[0] = start[i] + std::fmax(shift[i] + by[i], 0);
    if (!programme.lagrangian_step(programme.FIRST_RHO, programme.P, false, 60)) programme.solve_from_zero();
    programme.polish();
    return shifts_of(programme);
  };
  const Vector zero(shift.size()), here = round_from(zero), y = programme.motion();
  Vector unsettled = here;  // what rounds change most slowly: all else has settled
  increase(unsettled, -1, shift);
  const double still = distance(unsettled, zero);
  change = std::fmax(change, ROUNDING) + still;
  double velocity_change = 0;  // the greatest seen
  // Directions: one as symmetric as the scene, and one that differs from contact to contact, in whatever order they are.
  Vector even(shift.size(), 1), uneven;
  for (const auto& cone : programme.cones) {
    double sum = 0;
    for (const auto& side : cone.row)
      for (int k = 0; k < 6; ++k) sum += std::sqrt(k + 2.0) * side[0][k];
    uneven.push_back(1 + UNEVENNESS * std::sin(50 * sum));
  }
  auto rate_at = [&](double size, Vector by) {
    double rate = 0, last = -1;
    for (int round = 0; round < ROUNDS && std::fabs(rate - last) > 0.01 * (1 - rate); ++round) {
      double now = distance(by, zero);
      if (!(now > 0)) break;
      for (double& x : by) x *= size / now;
      by = round_from(by);
      increase(by, -1, here);
      Vector moved = programme.motion();
      increase(moved, -1, y);
      velocity_change = std::fmax(velocity_change, std::sqrt(dot(moved, moved)));
      last = rate;
      rate = distance(by, zero) / size;
    }
    return rate;
  };
  for (double size = LEAST; size < WIDEST && programme.multiplications() < MOREAU_BUDGET; size *= WIDER) {
    if (change > size / 2) continue;
    double nearer = 1 - change / size, rate = rate_at(size, even);
    if (rate <= nearer) rate = rate_at(size, uneven);
    if (rate <= nearer && still > NOISE) rate = rate_at(size, unsettled);
    if (rate <= nearer) return 2 * velocity_change;
    if (rate > FIXED) break;
  }
  return INFINITY;
}

// The impulses of MOREAU with friction, in doubles.
inline ClusterImpulses moreau_with_friction(const Assembly& assembly) {
  constexpr int ROUNDS = 300;
  constexpr double SETTLED = 1e-12;  // change of the shifts
  constexpr double SOLVED = 1e-4;  // bound on the error of the velocities: mostly far too large, if they are a solution
  constexpr double SMALLER = 1e-9;  // by which shifts are reduced for more friction
  int count = assembly.count;
  std::vector<Axes> P(count);
  double speed = 0;
  bool approach = false;
  for (const AssembledContact& contact : assembly.contacts) {
    approach = approach || contact.axes[0].velocity < 0;
    bool has_friction = contact.mu > LEAST_FRICTION;  // without friction, the slip may be anything
    speed = std::fmax(speed, std::hypot(contact.axes[0].velocity, has_friction * contact.axes[1].velocity,
                                        has_friction * contact.axes[2].velocity) *
                                 contact.unit());
  }
  if (!approach) return with_axis_impulses({}, assembly, P);  // impulses of 0 are a solution
  const double mean = mean_inverse_mass(assembly, assembly.all_contacts());
  Cones<double> programme(assembly.body_count);
  Vector start;
  for (const AssembledContact& contact : assembly.contacts) {
    Cone<double> cone = cone_of(contact, contact.axes, speed, mean);
    cone.mu = std::fmin(cone.mu, GREATEST_IN_ONE_STEP);
    cone.w[0] += contact.e * std::fmin(cone.w[0], 0);
    start.push_back(cone.w[0]);
    programme.cones.push_back(cone);
  }
  programme.prepare();
  programme.solve_from_zero();
  programme.polish();
  auto set_shifts = [&](Cones<double>& of, const Vector& shift) {
    for (int i = 0; i < count; ++i) of.cones[i].w[0] = start[i] + shift[i];
  };
  Vector shift(count), step, last_step, last_shift;
  double change = INFINITY, last_change = INFINITY;
  for (int round = 0; round < ROUNDS && change > SETTLED && programme.multiplications() < MOREAU_BUDGET; ++round) {
    const Vector found = shifts_of(programme);
    step = found;
    increase(step, -1, shift);
    change = distance(found, shift);
    // Where the shifts settle slowly, a secant step from the last two rounds (Anderson 1965). Elsewhere that would
    // magnify rounding.
    Vector by;
    if (round > 0) {
      by = step;
      increase(by, -1, last_step);
    }
    bool is_slow = change > 0.9 * last_change;
    last_change = change;
    double square = dot(by, by),
           leap = is_slow && square > 0 ? std::fmin(std::fmax(dot(by, step) / square, -20), 0.5) : 0;
    for (int i = 0; i < count; ++i)
      shift[i] = std::fmax(round > 0 ? found[i] - leap * (found[i] - last_shift[i]) : found[i], 0);
    set_shifts(programme, shift);
    last_shift = found;
    last_step = step;
    if (!programme.lagrangian_step(programme.FIRST_RHO, programme.P, false, 60)) programme.solve_from_zero();
    programme.polish();
  }
  // If a load can be shared in several ways, take the one with the most friction, if that can be found as exactly.
  Cones<double> with_most_friction = programme;
  Vector smaller = shift;
  for (double& s : smaller) s *= 1 - SMALLER;
  set_shifts(with_most_friction, smaller);
  double motion_error = with_most_friction.solve();
  if (const double off = distance(shifts_of(with_most_friction), smaller); off <= 10 * SMALLER) {
    programme = std::move(with_most_friction);
    shift = smaller;
    change = off;
  } else {
    motion_error = programme.motion_error();
    if (motion_error > SOLVED) return {false};
  }
  // Relative to the fastest contact, and to the greatest impulse, which is small where a light body strikes a heavy
  // one.
  double greatest = 0;
  for (const Axes& one : programme.P) greatest = std::fmax(greatest, one[0]);
  if (!(change <= std::fmin(10 * SMALLER, 1e-4 * greatest))) return {false};
  for (int i = 0; i < count; ++i) P[i] = in_newton_seconds(programme.P[i], assembly.contacts[i], speed);
  const double of_shifts = assembly.is_locked ? INFINITY : shift_error(programme, start, shift, change);
  const double error = speed * (motion_error + rebound_error(programme, start) + of_shifts);
  return with_axis_impulses({true, {}, error}, assembly, P);
}

// The impulses of MOREAU; without friction, in double-double.
inline ClusterImpulses moreau(const Assembly& assembly, bool has_friction) {
  if (has_friction) return moreau_with_friction(assembly);
  auto separates = [](const AssembledContact& contact) { return high(contact.velocity) >= 0; };
  if (std::all_of(assembly.contacts.begin(), assembly.contacts.end(), separates))
    return {true, std::vector<DD>(assembly.count)};
  if (assembly.is_locked) return {false};
  Projection found = project_to_rebound(assembly);
  return {found.status == MinimumStatus::FOUND, found.q, found.error};
}
