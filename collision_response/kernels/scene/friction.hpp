// COULOMB and MOREAU with friction for one cluster, in plain doubles. Impulses and velocities are along the axes of each
// contact: the unit normal and two tangents.
#pragma once
#include "cones.hpp"
#include "impulses.hpp"
#include "least_norm.hpp"
#include "projection.hpp"

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
  double speed(int i) const { return std::hypot(velocity(i, 0), velocity(i, 1), velocity(i, 2)); }
  // A bound on the terms that the change of the normal velocity of a contact is the sum of.
  double size_at(int i) const {
    double sum = 0;
    for (int side = 0; side < 2; ++side)
      for (int k = 0; assembly->contacts[i].body[side] >= 0 && k < 6; ++k)
        sum += std::fabs(assembly->contacts[i].axes[0].row[side][k] * y[6 * assembly->contacts[i].body[side] + k]);
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

// Coefficients of friction: greater ones have no further effect, and smaller ones none at all.
constexpr double GREATEST_FRICTION = 1e30, LEAST_FRICTION = 1e-30, GREATEST_IN_ONE_STEP = 1e6;

// Loads up to which they may be rounding: relative to the greatest, in double-double; and to that of their bodies, if
// they were shared in doubles.
constexpr double UNLOADED = 0x1p-80, UNSHARED = 1e-10;

// A contact as a cone, with impulses in units that make n.K n of every contact 1, and velocities in units of `speed`.
// `mean` is the mean of 1 / (n.K n) of unit normals. part and load: see Cone.
template <class R>
typename Cones<R>::Cone cone_of(const AssembledContact& contact, const std::array<ContactAxis<R>, 3>& axes,
                                double speed, double mean, double part = 1, double load = 1) {
  typename Cones<R>::Cone cone;
  double unit = contact.scale * contact.length;
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

// The impulses >= 0 of nearly the same effect as p with nearly the least norm: those that minimise the square of the
// difference in the effect, plus SHARING times the norm. Moving walls are one more body, which their work moves.
inline Vector nearly_least_norm(const Assembly& assembly, const Vector& p) {
  constexpr double SHARING = 1e-9;  // for contacts whose normals or lever arms differ by 3e-5
  const int count = assembly.count, walls = assembly.body_count;
  double greatest = 0, fastest = 0, mean = 0;
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    greatest = std::fmax(greatest, p[i] / contact.scale);
    fastest = std::fmax(fastest, std::fabs(high(contact.velocity)) * contact.scale);
    mean += contact.scale * contact.scale * contact.length * contact.length / count;
  }
  Cones<DD> programme(walls + assembly.has_moving_wall);
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    Cones<DD>::Cone cone = cone_of(contact, assembly.axes_of<DD>(contact), 1, 1 / mean);
    cone.mu = 0;
    for (int side = 0; side < 2; ++side)
      if (contact.wall[side] >= 0) {
        cone.body[side] = walls;
        for (int k = 0; k < 6 && fastest > 0; ++k)
          cone.row[side][0][0] += contact.scale / fastest *
                                  assembly.walls[contact.wall[side]].x[IN_BODY_A_VELOCITY_X + k] *
                                  value(contact.jacobian[side][k]);
      }
    programme.cones.push_back(cone);
    programme.P.push_back({DD{p[i] / contact.scale / greatest, 0}, DD{}, DD{}});
  }
  programme.aim_at(programme.motion());
  programme.prepare();
  programme.solve_from_zero(1 / SHARING);
  Vector nearly;
  for (int i = 0; i < count; ++i) nearly.push_back(programme.P[i][0].h * greatest * assembly.contacts[i].scale);
  return nearly;
}

// How much part in the loads each contact takes. 1: it is loaded if loads of the same effect are shared; other loads
// would depend on the order of the contacts. Less: it is loaded if loads of nearly the same effect are, as the fourth
// corner of a box whose corners are slightly off a plane. Sets the loads shared.
inline Vector parts_in_loads(const Assembly& assembly, const Vector& given, double greatest, Vector& shared) {
  constexpr double LEAST = 1e-6;
  const std::vector<AssembledContact>& contacts = assembly.contacts;
  const int count = assembly.count;
  Vector most(assembly.body_count), part(count), nearly;  // most: the greatest load of each body
  shared = given;
  least_norm(assembly, shared, false);
  for (int i = 0; i < count; ++i)
    for (int body : contacts[i].body)
      if (body >= 0) most[body] = std::fmax(most[body], shared[i] / contacts[i].scale);
  for (int i = 0; i < count; ++i) {
    double nearby = 0;
    for (int body : contacts[i].body)
      if (body >= 0) nearby = std::fmax(nearby, most[body]);
    if (!(nearby > 0)) nearby = greatest;
    const bool is_given = shared[i] >= given[i] / 2 && shared[i] <= given[i] * 2;
    part[i] = shared[i] / contacts[i].scale > (is_given ? UNLOADED * greatest : UNSHARED * nearby);
    if (part[i] > 0) continue;
    if (nearly.empty()) nearly = nearly_least_norm(assembly, shared);
    const double load = nearly[i] / contacts[i].scale / nearby;
    part[i] = load > LEAST ? std::fmin(load, 1) : 0;
  }
  return part;
}

// The inverse: an impulse of such a cone in newton seconds.
inline Axes in_newton_seconds(Axes P, const AssembledContact& contact, double speed) {
  for (double& along : P) along = along * speed * contact.scale * contact.length;
  return P;
}

// The error of y, in units of `speed`, that makes the error bound of an answer `bound`.
inline double error_for_bound(const Assembly& assembly, const Vector& y, double bound) {
  double largest = 0, worst = 0;
  for (int b = 0; b < assembly.body_count; ++b) {
    double twist[6];
    assembly.bodies[b].centre_in_doubles.twist_of(&y[6 * b], twist);
    largest = std::fmax(largest, twist_size(assembly.bodies[b].x, twist));
    worst = std::fmax(worst, norm_ratio(assembly.bodies[b]));
  }
  return bound * largest / worst;
}

constexpr double ACCEPTED_IN_DOUBLES = 1e-6;  // a bound on the error of an answer: no need for double-double

// Solve the programme of least work again, in double-double. If this reduces `error`, the bound on the error of y, set
// the impulses of `programme`. Returns the new bound.
inline double solve_in_double_double(const Assembly& assembly, const std::vector<int>& loaded, const std::vector<DD>& p,
                                     double speed, double mean, Cones<double>& programme, double error, double enough) {
  Cones<DD> precise(assembly.body_count);
  precise.enough = std::fmin(precise.enough, enough);
  const std::vector<N> changes = assembly.twist_changes(p.data());
  for (size_t k = 0; k < loaded.size(); ++k) {
    const AssembledContact& contact = assembly.contacts[loaded[k]];
    const auto& cone = programme.cones[k];
    precise.cones.push_back(cone_of(contact, assembly.axes_of<DD>(contact), speed, mean, cone.part, cone.load));
    precise.kept_velocities.push_back(contact.scale * contact.length *
                                      value(assembly.velocity_change(contact, changes)) / contact.length_in<DD>() /
                                      speed);
  }
  precise.prepare();
  double precise_error = precise.solve_from(programme);
  if (!(precise_error < error)) return error;
  for (size_t k = 0; k < loaded.size(); ++k)
    for (int axis = 0; axis < 3; ++axis) {
      programme.P[k][axis] = precise.P[k][axis].h;
      double square = 0;
      for (const auto& side : programme.cones[k].row)
        for (double x : side[axis]) square += x * x;
      precise_error += 0x1p-53 * std::fabs(programme.P[k][axis]) * std::sqrt(square);  // P is rounded to doubles
    }
  return precise_error;
}

// COULOMB for several contacts: the frictionless answer, then the friction that does the least work.
//
// First comes the answer without friction, by generalised reflections with restitution: GRR, scene/reflections.py. The
// contacts that it loads may then have any impulses P in the friction cones of their own normal impulses, |P_t| <= mu
// P_n. Of those that keep the normal velocities of GRR, the law takes the P with the least work on the relative
// velocities u:
//
//     P.A P / 2 + u.P  ->  min
//
// This is a convex programme. The impulses of GRR are admissible in it, so energy cannot grow. It is strictly convex in
// the velocities, so these are unique, and as symmetric as the scene. If another contact then approaches, one more
// projection, with e = 0, stops that. It only takes energy, too; and because it adds normal impulse, friction stays in
// its cones.
//
// The work is that on relative velocities, not the change of kinetic energy: next to a moving floor, the latter depends
// on the observer.
//
// All contacts that can carry a load share it, if that hardly changes its effect. So a box whose corners are slightly
// off a plane slides like one whose corners are in it. Where normals or lever arms differ by more than about 1e-4, a
// contact that the load does not need takes less and less part in it. Nor are normal velocities kept where such small
// differences decide them. Both change gradually, so that no choice of contacts has to be made, which would depend on
// their order.
//
// For one contact this is Chatterjee & Ruina's law in each of three cases: in the plane; where the contact sticks; and
// where normal and slip are uncoupled. In space, sliding, they differ by up to 23 % of the impulse.
//
// Sources: Kaufman, Sueda, James & Pai, "Staggered Projections for Frictional Contact in Multibody Systems", ACM Trans.
// Graph. 27 (2008), for maximal dissipation over actual cones; Smith et al. 2012 (see scene/reflections.py), for
// friction after reflections.
//
// If none of the loaded contacts has friction, the result is the frictionless impulses.
inline ClusterImpulses least_work_friction(const Assembly& assembly, const ClusterImpulses& frictionless) {
  int count = assembly.count;
  ClusterImpulses result = frictionless;
  const Vector given = rounded(frictionless.normal.data(), count);
  double mean = 0, speed = 0;
  for (int i = 0; i < count; ++i) speed = std::fmax(speed, given[i] / assembly.contacts[i].scale);
  if (!(speed > 0)) return result;
  Vector shared;
  const Vector part = parts_in_loads(assembly, given, speed, shared);
  std::vector<int> loaded;
  bool has_friction = false;
  Motion as_given(assembly);
  std::vector<Axes> normal_only(count);
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    normal_only[i] = {given[i] * contact.length, 0, 0};
    as_given.apply(i, normal_only[i]);
    if (!(part[i] > 0)) {
      double slip = std::hypot(contact.axes[1].velocity, contact.axes[2].velocity) * contact.length;
      if (given[i] > 0)
        result.error +=
            std::sqrt(2 * contact.mu * (given[i] / contact.scale / speed) * (slip * contact.scale / speed)) * speed;
      continue;
    }
    loaded.push_back(i);
    has_friction = has_friction || contact.mu > LEAST_FRICTION;
    mean += 1 / (contact.scale * contact.scale * contact.length * contact.length);
  }
  if (!has_friction) return result;
  mean /= loaded.size();
  Cones<double> programme(assembly.body_count);
  programme.cones.reserve(loaded.size());
  for (int i : loaded) {
    const AssembledContact& contact = assembly.contacts[i];
    const double load = part[i] < 1 ? 1 : shared[i] / contact.scale / speed;
    programme.cones.push_back(cone_of(contact, contact.axes, speed, mean, part[i], load));
    programme.kept_velocities.push_back((as_given.velocity(i, 0) - contact.axes[0].velocity) *
                                        (contact.scale * contact.length / speed));
  }
  programme.prepare();
  double error = programme.solve();
  const double enough = error_for_bound(assembly, programme.motion(), ACCEPTED_IN_DOUBLES);
  if (!(error <= enough))
    error = solve_in_double_double(assembly, loaded, frictionless.normal, speed, mean, programme, error, enough);
  result.error += error * speed;
  std::vector<Axes> P(count);
  for (size_t k = 0; k < loaded.size(); ++k)
    P[loaded[k]] = in_newton_seconds(programme.P[k], assembly.contacts[loaded[k]], speed);

  // Friction may have made another contact approach.
  Motion moved(assembly);
  for (int i = 0; i < count; ++i) moved.apply(i, P[i]);
  double square = 0;  // of the change by friction
  for (size_t k = 0; k < moved.y.size(); ++k)
    square += (moved.y[k] - as_given.y[k]) / speed * ((moved.y[k] - as_given.y[k]) / speed);
  // Friction takes energy. If it seems to add some, rounding is all that it does: leave it out.
  auto work = [&](const Motion& motion, const std::vector<Axes>& impulses) {
    double sum = 0;
    for (double y : motion.y) sum += y / speed * (y / speed) / 2;
    for (int i = 0; i < count; ++i) {
      const AssembledContact& contact = assembly.contacts[i];
      for (int axis = 0; axis < 3; ++axis)
        sum += contact.axes[axis].velocity * contact.scale / speed * (impulses[i][axis] / contact.scale / speed);
    }
    return sum;
  };
  if (work(moved, P) > work(as_given, normal_only)) {
    result.error += std::sqrt(square) * speed;
    return result;
  }
  std::vector<N> offset;
  bool approaches = false;
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    double u = moved.velocity(i, 0);
    const double doubt = 0x1p-50 * (std::fabs(contact.axes[0].velocity) + moved.size_at(i));
    // Velocities that are kept do not approach, except by the error of the programme.
    const double kept = part[i] < 1 ? 0 : error * speed / (contact.scale * contact.length);
    approaches = approaches || u < -doubt - kept;
    offset.push_back(exact(u * contact.length) - contact.velocity);
    offset.back().error += doubt * contact.length;
  }
  if (approaches) {
    Projection last = project(assembly, std::vector<DD>(count).data(), assembly.all_contacts(), offset.data());
    // GRR has found velocities that separate the contacts. If none are found here, doubles cannot tell.
    result.error += last.status == MinimumStatus::FOUND ? last.error : INFINITY;
    for (int i = 0; i < count; ++i) P[i][0] += last.q[i].h * assembly.contacts[i].length;
  }
  return with_axis_impulses(std::move(result), assembly, P);
}

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

// An estimate of the error of the velocities, if one more round changes the shifts by `change`. A round takes shifts at
// a small distance from these nearer to them, by some rate. If it takes them nearer by more than `change`, there is a
// fixed point within that distance. Where contacts lock, or share a load in several ways, all shifts nearby are fixed
// points, and the error is unknown: infinite. The rate is that in the direction in which rounds are slowest, by the
// power method.
inline double shift_error(Cones<double> programme, const Vector& start, const Vector& shift, double change) {
  constexpr double LEAST = 1e-9, WIDER = 30, WIDEST = 1e-3, ROUNDING = 1e-12, FIXED = 1 - 1e-5;
  constexpr int ROUNDS = 20;
  auto round_from = [&](const Vector& by) {
    for (size_t i = 0; i < by.size(); ++i) programme.cones[i].w[0] = start[i] + std::fmax(shift[i] + by[i], 0);
    if (!programme.lagrangian_step(programme.FIRST_RHO, programme.P, false, 60)) programme.solve_from_zero();
    programme.polish();
    return shifts_of(programme);
  };
  const Vector zero(shift.size()), here = round_from(zero), y = programme.motion();
  change = std::fmax(change, ROUNDING) + distance(here, shift);
  double velocity_change = 0;  // the greatest seen
  auto rate_at = [&](double size, double unevenness) {
    Vector by;
    for (size_t i = 0; i < shift.size(); ++i)
      by.push_back(size * (1 + std::fmod(unevenness * static_cast<double>(i), 1)));
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
  for (double size = LEAST; size < WIDEST; size *= WIDER) {
    if (change > size / 2) continue;
    double nearer = 1 - change / size, rate = rate_at(size, 0);  // in a direction as symmetric as the scene
    if (rate <= nearer) rate = rate_at(size, 0.618);  // and in one that is not
    if (rate <= nearer) return 2 * velocity_change;
    if (rate > FIXED) break;
  }
  return INFINITY;
}

// MOREAU for several contacts: Newton's restitution at each, all at once. Time steppers converge to it.
//
//     u_n+ + e min(u_n, 0) >= 0    complementary to    P_n >= 0
//
// so that a contact that separates never comes to approach, and friction opposes the slip after the impact, as for a
// single contact. Without friction this is one linear complementarity problem. With friction,
//
//     u_n+ + e min(u_n, 0) + s    with the shift    s = mu |u_t+|
//
// takes the place of u_n+ + e min(u_n, 0). For a given s this is a convex programme, that of COULOMB, with a
// unique u+. s starts at 0 and is updated until it no longer changes. If there are several solutions, of which
// there may be many where friction is great, this always finds the same one, in whatever order the contacts are given.
//
// The error bound is an estimate. It tries shifts near the one found, and measures how much nearer one update takes
// them. If it takes them no nearer, as when contacts lock, or when several ways to share a load lead to several u+,
// the bound is infinite.
//
// COULOMB answers instead if s does not settle, or if no velocities rebound from all contacts. Unequal
// coefficients, and friction, may create energy: if they create more than 2^-40 of the work at the contacts, COULOMB
// answers, or FRICTIONLESS if there is no friction.
//
// Sources: Moreau, "Unilateral Contact and Dry Friction in Finite Freedom Dynamics", 1988; De Saxce & Feng, "The
// Bipotential Method", Math. Comput. Model. 28 (1998), for the shift by mu |u_t|; Acary, Cadoux, Lemarechal & Malick,
// "A Formulation of the Linear Discrete Coulomb Friction Problem via Convex Optimization", Z. Angew. Math. Mech. 91
// (2011), for the convex programmes.
inline ClusterImpulses moreau_with_friction(const Assembly& assembly) {
  int count = assembly.count;
  std::vector<Axes> P(count);
  double mean = 0, speed = 0;
  bool approach = false;
  for (const AssembledContact& contact : assembly.contacts) {
    mean += 1 / (contact.scale * contact.scale * contact.length * contact.length) / count;
    approach = approach || contact.axes[0].velocity < 0;
    bool has_friction = contact.mu > LEAST_FRICTION;  // without friction, the slip may be anything
    speed = std::fmax(speed, std::hypot(contact.axes[0].velocity, has_friction * contact.axes[1].velocity,
                                        has_friction * contact.axes[2].velocity) *
                                 contact.scale * contact.length);
  }
  if (!approach) return with_axis_impulses({}, assembly, P);  // impulses of 0 are a solution
  Cones<double> programme(assembly.body_count);
  Vector start;
  for (const AssembledContact& contact : assembly.contacts) {
    Cones<double>::Cone cone = cone_of(contact, contact.axes, speed, mean);
    cone.mu = std::fmin(cone.mu, GREATEST_IN_ONE_STEP);
    cone.w[0] += contact.e * std::fmin(cone.w[0], 0);
    start.push_back(cone.w[0]);
    programme.cones.push_back(cone);
  }
  programme.prepare();
  programme.solve_from_zero();
  programme.polish();
  Vector shift(count), step, last_step, last_shift;
  double change = INFINITY, last_change = INFINITY;
  int round = 0;
  for (; round < 300 && change > 1e-12; ++round) {
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
    for (int i = 0; i < count; ++i) {
      shift[i] = std::fmax(round > 0 ? found[i] - leap * (found[i] - last_shift[i]) : found[i], 0);
      programme.cones[i].w[0] = start[i] + shift[i];
    }
    last_shift = found;
    last_step = step;
    programme.lagrangian_step(programme.FIRST_RHO, programme.P, false, 60);
    programme.polish();
  }
  // If a load can be shared in several ways, take the one with the most friction.
  for (double& s : shift) s *= 1 - 1e-9;
  for (int i = 0; i < count; ++i) programme.cones[i].w[0] = start[i] + shift[i];
  double motion_error = programme.solve();
  change = distance(shifts_of(programme), shift);
  // Relative to the fastest contact, and to the greatest impulse, which is small where a light body strikes a heavy
  // one.
  double greatest = 0;
  for (const Axes& one : programme.P) greatest = std::fmax(greatest, one[0]);
  if (!(change <= std::fmin(1e-8, 1e-4 * greatest))) return {false};
  for (int i = 0; i < count; ++i) P[i] = in_newton_seconds(programme.P[i], assembly.contacts[i], speed);
  double error =
      speed * (motion_error + (assembly.is_locked ? INFINITY : shift_error(programme, start, shift, change)));
  return with_axis_impulses({true, {}, error}, assembly, P);
}
