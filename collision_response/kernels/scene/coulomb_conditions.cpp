// Coulomb's conditions at several contacts, for given rebounds r:
//
//     u_n+ - r >= 0    complementary to    P_n >= 0
//
// and friction opposes the slip after the impact: |P_t| <= mu P_n, and P_t = -mu P_n u_t+ / |u_t+| where there is slip.
// So a contact that friction unloads parts, and one that it presses is loaded.
//
// With the shift  s = mu |u_t+|,  u_n+ - r + s  is the normal part of a velocity in the dual cone of (P_n, P_t). For a
// given s this is a convex programme, with a unique u+. s starts at 0 and is updated until it no longer changes. If there
// are several solutions, of which there may be many where friction is great or where more contacts than necessary share a
// load, this finds one of them. In a dense pile it may depend on the order of the contacts.
//
// The error bound is an estimate. It tries shifts near the one found, and measures how much nearer one update takes
// them. Of solutions that lie apart from it, the bound knows nothing. If it takes them no nearer, as when contacts lock,
// or when several ways to share a load lead to several u+, the bound is infinite.
//
// Sources: De Saxce & Feng, "The Bipotential Method", Math. Comput. Model. 28 (1998), for the shift by mu |u_t|; Acary,
// Cadoux, Lemarechal & Malick, "A Formulation of the Linear Discrete Coulomb Friction Problem via Convex Optimization",
// Z. Angew. Math. Mech. 91 (2011), for the convex programmes.
#include "coulomb_conditions.hpp"

#include "cones.hpp"
#include "contact_cones.hpp"

namespace {

// The greatest distance between two components.
double distance(const Vector& one, const Vector& other) {
  double most = 0;
  for (size_t i = 0; i < one.size(); ++i) most = std::fmax(most, std::fabs(one[i] - other[i]));
  return most;
}

// The convex programme for given shifts, and its solution.
struct ShiftedCones : Cones<double> {
  Vector start;  // u_n - r of each contact
  double budget;  // multiplications

  // For shifts of 0. Velocities are in units of `speed`.
  ShiftedCones(const Assembly& assembly, const Vector& rebounds, double speed, double budget)
      : Cones<double>(assembly.body_count), budget(budget) {
    const double mean = mean_inverse_mass(assembly, assembly.all_contacts());
    for (int i = 0; i < assembly.count; ++i) {
      const AssembledContact& contact = assembly.contacts[i];
      Cone<double> cone = cone_of(contact, contact.axes, speed, mean);
      cone.mu = std::fmin(cone.mu, GREATEST_IN_ONE_STEP);
      cone.w[0] -= rebounds[i] * contact.unit() / speed;
      start.push_back(cone.w[0]);
      cones.push_back(cone);
    }
    prepare();
    solve_from_zero();
    polish();
  }

  void set(const Vector& shifts) {
    for (size_t i = 0; i < cones.size(); ++i) cones[i].w[0] = start[i] + shifts[i];
  }
  // mu |u_t| of the solution
  Vector next_shifts() const {
    Vector shifts;
    for (size_t i = 0; i < cones.size(); ++i) shifts.push_back(cones[i].mu * std::hypot(z[i][1], z[i][2]));
    return shifts;
  }
  // How much faster a contact separates than it rebounds.
  double gap(size_t i) const { return z[i][0] - cones[i].mu * std::hypot(z[i][1], z[i][2]); }
  bool has_budget() const { return multiplications() < budget; }
  // How far the normal velocities are from those of the conditions.
  double rebound_error() const {
    const Vector y = motion();
    double most = 0;
    for (size_t i = 0; i < start.size(); ++i) {
      const double off = start[i] + cones[i].velocity(y.data())[0];
      most = std::fmax(most, P[i][0] > 0 ? std::fabs(off) : -off);
    }
    return most;
  }
  // Solve for other shifts, from the solution at hand. Returns the next ones.
  Vector round(const Vector& shifts) {
    set(shifts);
    if (!lagrangian_step(FIRST_RHO, P, false, 60)) solve_from_zero();
    polish();
    return next_shifts();
  }
};

// Update shifts until they no longer change. Returns their last change.
double settle(ShiftedCones& programme, Vector& shifts) {
  constexpr int ROUNDS = 300;
  constexpr double SETTLED = 1e-13;
  Vector found = programme.next_shifts(), last_found, last_step;
  double change = INFINITY, last_change = INFINITY;
  for (int round = 0; round < ROUNDS && change > SETTLED && programme.has_budget(); ++round) {
    Vector step = found;
    increase(step, -1, shifts);
    change = distance(found, shifts);
    double leap = 0;
    if (change > 0.9 * last_change) {
      // Where the shifts settle slowly, a secant step from the last two rounds (Anderson 1965). Elsewhere that would
      // magnify rounding.
      Vector by = step;
      increase(by, -1, last_step);
      const double square = dot(by, by);
      if (square > 0) leap = std::fmin(std::fmax(dot(by, step) / square, -20), 0.5);
    }
    for (size_t i = 0; i < shifts.size(); ++i)
      shifts[i] = std::fmax(round > 0 ? found[i] - leap * (found[i] - last_found[i]) : found[i], 0);
    last_change = change;
    last_found = std::move(found);
    last_step = std::move(step);
    found = programme.round(shifts);
  }
  return change;
}

// The neighbourhood of shifts that have settled. A round takes shifts nearby nearer to these, by some rate.
class SettledShifts {
 public:
  SettledShifts(const ShiftedCones& solved, const Vector& shifts)
      : programme(solved), shifts(shifts), next(round_from(Vector(shifts.size()))), motion(programme.motion()) {
    for (size_t i = 0; i < shifts.size(); ++i)
      if (programme.P[i][0] > 0 || programme.gap(i) < WIDEST) taking_part.push_back(i);
  }

  // An estimate of the error of the velocities, if one more round changes the shifts by `change`: if a round takes
  // shifts at some distance nearer by more than that, there is a fixed point within that distance.
  double velocity_error(double change) {
    constexpr double LEAST = 1e-10, WIDER = 30, ROUNDING = 1e-12, FIXED = 1 - 1e-5;
    constexpr double CAUTION = 4;  // the directions tried may not be those in which the error is greatest
    constexpr double NOISE = 1e-14;  // changes of the shifts that are rounding have no direction
    // Directions: one as symmetric as the scene, two that differ from contact to contact, in whatever order they are, and
    // what rounds change most slowly: all else has settled.
    std::vector<Vector> directions{Vector(shifts.size(), 1), uneven(0), uneven(1)};
    for (int k = 0; k < 3; ++k) {
      directions.emplace_back(shifts.size());
      increase(directions.back(), -1, directions[k]);
    }
    const double still = distance(next, shifts);
    if (still > NOISE) {
      directions.push_back(next);
      increase(directions.back(), -1, shifts);
    }
    change = std::fmax(change, ROUNDING) + still;
    for (double size = LEAST; size < WIDEST && programme.has_budget(); size *= WIDER) {
      if (change > size / 2) continue;
      const double nearer = 1 - change / size;
      double rate = 0;
      for (const Vector& direction : directions)
        if (rate <= nearer) rate = rate_at(size, direction);
      if (rate <= nearer) return CAUTION * velocity_change;
      if (rate > FIXED) break;
    }
    return INFINITY;
  }

 private:
  static constexpr double WIDEST = 1e-3;
  ShiftedCones programme;
  const Vector& shifts;
  std::vector<size_t> taking_part;  // all contacts but those that plainly part
  const Vector next, motion;  // after a round from these
  double velocity_change = 0;  // the greatest seen

  Vector round_from(Vector off) {
    for (size_t i = 0; i < off.size(); ++i) off[i] = std::fmax(shifts[i] + off[i], 0);
    return programme.round(off);
  }

  Vector uneven(double phase) const {
    Vector direction;
    for (const Cone<double>& cone : programme.cones) {
      double sum = 0;
      for (const auto& side : cone.row)
        for (int k = 0; k < 6; ++k) sum += std::sqrt(k + 2.0) * side[0][k];
      direction.push_back(std::sin(50 * sum + phase));
    }
    return direction;
  }

  // Without the shifts of contacts that part: they have no effect.
  Vector only_taking_part(const Vector& all) const {
    Vector off(all.size());
    for (size_t i : taking_part) off[i] = all[i];
    return off;
  }

  // The rate at a distance `size`, in the direction in which rounds are slowest, by the power method. It begins in the
  // direction `off`, of which the slowest may be a small part.
  double rate_at(double size, Vector off) {
    constexpr int LEAST_ROUNDS = 4, ROUNDS = 30;
    const Vector zero(off.size());
    off = only_taking_part(off);
    double rate = 0, last = -1;
    auto goes_on = [&](int round) {
      return round < LEAST_ROUNDS || (round < ROUNDS && std::fabs(rate - last) > 0.01 * (1 - rate));
    };
    for (int round = 0; goes_on(round); ++round) {
      const double now = distance(off, zero);
      if (!(now > 0)) break;
      for (double& x : off) x *= size / now;
      off = round_from(off);
      increase(off, -1, next);
      off = only_taking_part(off);
      Vector moved = programme.motion();
      increase(moved, -1, motion);
      velocity_change = std::fmax(velocity_change, std::sqrt(dot(moved, moved)));
      last = rate;
      rate = distance(off, zero) / size;
    }
    return rate;
  }
};

}  // namespace

ClusterImpulses obey_coulomb(const Assembly& assembly, const Vector& rebounds, double budget) {
  constexpr double SOLVED = 1e-4;  // bound on the error of the velocities: mostly far too large, if they are a solution
  constexpr double PRECISE = 1e-8;  // error of the velocities: bodies may slide far faster than they change theirs
  constexpr double SMALLER = 1e-9;  // by which shifts are reduced for more friction
  std::vector<Axes> P(assembly.count);
  double speed = 0;
  bool approach = false;
  for (const AssembledContact& contact : assembly.contacts) {
    const auto& u = contact.axes;
    const bool has_friction = contact.mu > LEAST_FRICTION;  // without friction, the slip may be anything
    const double size = std::hypot(u[0].velocity, has_friction * u[1].velocity, has_friction * u[2].velocity);
    speed = std::fmax(speed, size * contact.unit());
    approach = approach || u[0].velocity < 0;
  }
  if (!approach) return with_axis_impulses({}, assembly, P);  // impulses of 0 are a solution
  ShiftedCones programme(assembly, rebounds, speed, budget);
  Vector shifts(assembly.count);
  double change = settle(programme, shifts);
  // If a load can be shared in several ways, take the one with the most friction, if that can be found as exactly.
  ShiftedCones with_most_friction = programme;
  Vector smaller = shifts;
  for (double& s : smaller) s *= 1 - SMALLER;
  with_most_friction.set(smaller);
  with_most_friction.solve();
  if (distance(with_most_friction.next_shifts(), smaller) <= 10 * SMALLER) {
    programme = std::move(with_most_friction);
    shifts = smaller;
    change = settle(programme, shifts);
  }
  programme.enough = PRECISE;
  const double motion_error = programme.go_on();
  if (motion_error > SOLVED) return {false};
  // Relative to the fastest contact, and to the greatest impulse, which is small where a light body strikes a heavy
  // one.
  double greatest = 0;
  for (const Axes& one : programme.P) greatest = std::fmax(greatest, one[0]);
  if (!(change <= std::fmin(10 * SMALLER, 1e-4 * greatest))) return {false};
  for (int i = 0; i < assembly.count; ++i) P[i] = in_newton_seconds(programme.P[i], assembly.contacts[i], speed);
  const double of_rebound = programme.rebound_error();
  if (of_rebound > SOLVED) return {false};
  const double of_shifts = assembly.is_locked ? INFINITY : SettledShifts(programme, shifts).velocity_error(change);
  const double error = speed * (motion_error + of_rebound + of_shifts);
  return with_axis_impulses({true, {}, error}, assembly, P);
}
