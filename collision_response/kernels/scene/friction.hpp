// Laws with friction for one cluster, in plain doubles: see coulomb.py and moreau.py. Impulses and velocities are
// in the axes of each contact: unit normal, two tangents.
#pragma once
#include "cones.hpp"
#include "impulses.hpp"
#include "least_norm.hpp"
#include "projection.hpp"

struct Motion {  // of the movable bodies: y, and their twists have changed by L y
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
  // Of the part of y that the velocity of a contact is from, at most, as that velocity.
  double size_at(int i) const {
    double sum = 0;
    for (int side = 0; side < 2; ++side)
      for (int k = 0; assembly->contacts[i].body[side] >= 0 && k < 6; ++k) sum += std::fabs(assembly->contacts[i].axes[0].row[side][k] * y[6 * assembly->contacts[i].body[side] + k]);
    return sum;
  }
  Axes velocity(int i) const { return {velocity(i, 0), velocity(i, 1), velocity(i, 2)}; }
};

inline double coupling(const Assembly& assembly, int i, int a, int j, int b) {
  const AssembledContact &one = assembly.contacts[i], &other = assembly.contacts[j];
  double sum = 0;
  for (int s = 0; s < 2; ++s)
    for (int t = 0; t < 2; ++t)
      if (one.body[s] >= 0 && one.body[s] == other.body[t])
        for (int k = 0; k < 6; ++k) sum += one.axes[a].row[s][k] * other.axes[b].row[t][k];
  return sum;
}

// Friction beyond these sticks no better, or does not show.
constexpr double GREATEST_FRICTION = 1e30, LEAST_FRICTION = 1e-30, GREATEST_IN_ONE_STEP = 1e6;

// A load that is this part of the greatest is rounding, of double-double; one that was not there before loads were shared
// out is rounding of doubles if it is this part of others of its bodies, or of the greatest if they have none.
constexpr double UNLOADED = 0x1p-80, UNSHARED = 1e-10;

// A contact as a cone: its impulses in units that make n.K n of every contact 1, velocities in units of `speed`.
inline Cones::Cone cone_of(const AssembledContact& contact, double speed, double mean) {
  Cones::Cone cone;
  double unit = contact.scale * contact.length;
  for (int side = 0; side < 2; ++side) {
    cone.body[side] = contact.body[side];
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < 6; ++k) cone.row[side][axis][k] = contact.axes[axis].row[side][k] * unit;
  }
  for (int axis = 0; axis < 3; ++axis) cone.w[axis] = contact.axes[axis].velocity * unit / speed;
  cone.mu = contact.mu > LEAST_FRICTION ? std::fmin(contact.mu, GREATEST_FRICTION) : 0;
  if (!(cone.mu > 0)) cone.w[1] = cone.w[2] = 0;  // which may be much
  // Least squares of the impulses in newton seconds.
  cone.share = std::fmin(std::fmax(1 / (unit * unit * mean), 1e-3), 1e3);
  return cone;
}

// And back: what an impulse in such units is.
inline Axes in_newton_seconds(Axes P, const AssembledContact& contact, double speed) {
  for (double& along : P) along = along * speed * contact.scale * contact.length;
  return P;
}

// From frictionless impulses the least work on relative velocities over the cones of friction, with the normal velocities
// of the loaded contacts kept. Loaded are those of the impulses of least norm, as others depend on the order; and of those
// that do nearly the same, for a box a hair from flat stands on all its corners. Of contacts that nearly depend on others
// no velocity is kept, or that hair would keep them from sliding. If none of them has_friction, the frictionless impulses.
inline ClusterImpulses least_work_friction(const Assembly& assembly, const ClusterImpulses& free) {
  int count = assembly.count;
  ClusterImpulses result = free;
  Vector own = rounded(free.normal.data(), count), shared = own;
  least_norm(assembly, shared, false);
  Vector nearly_shared = shared;
  const double off = nearly_least_norm(assembly, nearly_shared);
  for (int i = 0; i < count; ++i) shared[i] = (shared[i] + nearly_shared[i]) / 2;  // loaded in either
  double mean = 0, speed = 0;
  Vector most(assembly.body_count);  // of the loads of each body
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    speed = std::fmax(speed, shared[i] / contact.scale);
    for (int body : contact.body)
      if (body >= 0) most[body] = std::fmax(most[body], own[i] / contact.scale);
  }
  auto rounding = [&](int i) {  // of the load of a contact
    double near = 0;
    for (int body : assembly.contacts[i].body)
      if (body >= 0) near = std::fmax(near, most[body]);
    bool is_new = shared[i] > 2 * own[i] || shared[i] < own[i] / 2;
    return is_new ? UNSHARED * (near > 0 ? near : speed) : UNLOADED * speed;
  };
  std::vector<int> loaded;
  bool has_friction = false;
  Motion as_given(assembly), as_shared(assembly);
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    as_given.apply(i, {own[i] * contact.length, 0, 0});
    as_shared.apply(i, {shared[i] * contact.length, 0, 0});
    if (!(shared[i] / contact.scale > rounding(i))) {
      double slip = std::hypot(contact.axes[1].velocity, contact.axes[2].velocity) * contact.length;
      if (shared[i] > 0) result.error += std::sqrt(2 * contact.mu * (shared[i] / contact.scale / speed) * (slip * contact.scale / speed)) * speed;
      continue;
    }
    loaded.push_back(i);
    has_friction = has_friction || contact.mu > LEAST_FRICTION;
    mean += 1 / (contact.scale * contact.scale * contact.length * contact.length);
  }
  if (!has_friction) return result;
  mean /= loaded.size();
  Cones programme(assembly.body_count);
  programme.normals = ActiveSet<double>(assembly.A.data(), count);
  const std::vector<int> dependent = programme.normals.span(loaded, NEARLY_DEPENDENT);
  loaded = programme.normals.members;
  loaded.insert(loaded.end(), dependent.begin(), dependent.end());
  const size_t independent = programme.normals.members.size();
  for (int i : loaded) {
    const AssembledContact& contact = assembly.contacts[i];
    programme.cones.push_back(cone_of(contact, speed, mean));
    programme.loads.push_back(shared[i] / contact.scale / speed);
    if (programme.kept_velocities.size() == independent) continue;
    double unit = contact.scale * contact.length / speed;
    programme.kept_velocities.push_back((as_given.velocity(i, 0) - contact.axes[0].velocity) * unit);
    programme.slack.push_back(std::fabs(as_shared.velocity(i, 0) - as_given.velocity(i, 0)) * unit);
  }
  programme.prepare();
  result.error += programme.solve() * speed;
  std::vector<Axes> P(count);
  for (size_t k = 0; k < loaded.size(); ++k) P[loaded[k]] = in_newton_seconds(programme.P[k], assembly.contacts[loaded[k]], speed);

  // Another contact may approach now.
  Motion moved(assembly);
  for (int i = 0; i < count; ++i) moved.apply(i, P[i]);
  double square = 0;  // of what friction changes
  for (size_t k = 0; k < moved.y.size(); ++k) square += (moved.y[k] - as_given.y[k]) / speed * ((moved.y[k] - as_given.y[k]) / speed);
  // An estimate: other contacts might have been kept, and shared. What two orders of them give was at most 0.73 of the sum
  // of both bounds apart, in 1500 stacks.
  result.error += 4 * off * (1 + std::sqrt(square)) * speed;
  std::vector<N> offset;
  bool approaches = false;
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    double u = moved.velocity(i, 0), doubt = 0x1p-50 * (std::fabs(contact.axes[0].velocity) + moved.size_at(i));
    approaches = approaches || u < -doubt;
    offset.push_back(exact(u * contact.length) - contact.velocity);
    offset.back().error += doubt * contact.length;
  }
  if (approaches) {
    Projection last = project(assembly, std::vector<DD>(count).data(), assembly.all_contacts(), offset.data());
    // GRR has found velocities that part them: if none are found here, doubles can't tell.
    result.error += last.status == MinimumStatus::FOUND ? last.error : INFINITY;
    for (int i = 0; i < count; ++i) P[i][0] += last.q[i].h * assembly.contacts[i].length;
  }
  return with_axis_impulses(std::move(result), assembly, P);
}

// The shifts that a solution leaves.
inline Vector shifts_of(const Cones& programme) {
  Vector shifts;
  for (size_t i = 0; i < programme.cones.size(); ++i) shifts.push_back(programme.cones[i].mu * std::hypot(programme.z[i][1], programme.z[i][2]));
  return shifts;
}
inline double distance(const Vector& one, const Vector& other) {
  double most = 0;
  for (size_t i = 0; i < one.size(); ++i) most = std::fmax(most, std::fabs(one[i] - other[i]));
  return most;
}

// How far the velocities may be from those of shifts that stay, if these shifts are `off` after one more round. One
// round takes shifts a little beside them nearer, by some rate: if by more than `off`, some that stay are no farther.
// Where contacts lock, or share a load in several ways, shifts all around stay, and nothing can be said. The rate is
// that of the direction in which rounds are slowest, by the power method: an estimate.
inline double shift_error(Cones programme, const Vector& start, const Vector& shift, double off) {
  constexpr double LEAST = 1e-9, WIDER = 30, WIDEST = 1e-3, SEEN = 1e-12, STAYS = 1 - 1e-5;
  constexpr int ROUNDS = 20;
  auto look = [&](const Vector& by) {
    for (size_t i = 0; i < by.size(); ++i) programme.cones[i].w[0] = start[i] + std::fmax(shift[i] + by[i], 0);
    if (!programme.lagrangian_step(Cones::GREATEST, programme.P, false, 60)) programme.solve_from_zero();
    programme.polish();
    return shifts_of(programme);
  };
  const Vector zero(shift.size()), here = look(zero), y = programme.motion();
  off = std::fmax(off, SEEN) + distance(here, shift);
  double turned = 0;  // the velocities, at most
  auto rate_beside = [&](double beside, double uneven) {
    Vector by;
    for (size_t i = 0; i < shift.size(); ++i) by.push_back(beside * (1 + std::fmod(uneven * static_cast<double>(i), 1)));
    double rate = 0, last = -1;
    for (int round = 0; round < ROUNDS && std::fabs(rate - last) > 0.01 * (1 - rate); ++round) {
      double size = distance(by, zero);
      if (!(size > 0)) break;
      for (double& x : by) x *= beside / size;
      by = look(by);
      increase(by, -1, here);
      Vector moved = programme.motion();
      increase(moved, -1, y);
      turned = std::fmax(turned, std::sqrt(dot(moved, moved)));
      last = rate;
      rate = distance(by, zero) / beside;
    }
    return rate;
  };
  for (double beside = LEAST; beside < WIDEST; beside *= WIDER) {
    if (off > beside / 2) continue;
    double nearer = 1 - off / beside, rate = rate_beside(beside, 0);  // as symmetric as the scene
    if (rate <= nearer) rate = rate_beside(beside, 0.618);             // or not
    if (rate <= nearer) return 2 * turned;
    if (rate > STAYS) break;
  }
  return INFINITY;
}

// Coulomb's law on the velocities after, by convex programmes: with the shift s = mu |u_t+| of normal velocities held,
// this is least work again; s is then what that leaves, until it stays.
inline ClusterImpulses moreau_with_friction(const Assembly& assembly) {
  int count = assembly.count;
  std::vector<Axes> P(count);
  double mean = 0, speed = 0;
  bool approach = false;
  for (const AssembledContact& contact : assembly.contacts) {
    mean += 1 / (contact.scale * contact.scale * contact.length * contact.length) / count;
    approach = approach || contact.axes[0].velocity < 0;
    bool has_friction = contact.mu > LEAST_FRICTION;  // of what does not, the slip may be anything
    speed = std::fmax(speed, std::hypot(contact.axes[0].velocity, has_friction * contact.axes[1].velocity, has_friction * contact.axes[2].velocity) * contact.scale * contact.length);
  }
  if (!approach) return with_axis_impulses({}, assembly, P);  // no impulse is a solution
  Cones programme(assembly.body_count);
  Vector start;
  for (const AssembledContact& contact : assembly.contacts) {
    Cones::Cone cone = cone_of(contact, speed, mean);
    cone.mu = std::fmin(cone.mu, GREATEST_IN_ONE_STEP);
    cone.w[0] += contact.e * std::fmin(cone.w[0], 0);
    start.push_back(cone.w[0]);
    programme.cones.push_back(cone);
  }
  programme.prepare();
  programme.solve_from_zero();
  programme.polish();
  Vector shift(count), off, last_off, last_shift;
  double change = INFINITY, last_change = INFINITY;
  int round = 0;
  for (; round < 300 && change > 1e-12; ++round) {
    const Vector found = shifts_of(programme);
    off = found;
    increase(off, -1, shift);
    change = distance(found, shift);
    // The secant of the last two, which leaps where the shifts settle slowly (Anderson 1965). Elsewhere it would make
    // much of rounding.
    Vector by;
    if (round > 0) {
      by = off;
      increase(by, -1, last_off);
    }
    bool slow = change > 0.9 * last_change;
    last_change = change;
    double square = dot(by, by), leap = slow && square > 0 ? std::fmin(std::fmax(dot(by, off) / square, -20), 0.5) : 0;
    for (int i = 0; i < count; ++i) {
      shift[i] = std::fmax(round > 0 ? found[i] - leap * (found[i] - last_shift[i]) : found[i], 0);
      programme.cones[i].w[0] = start[i] + shift[i];
    }
    last_shift = found;
    last_off = off;
    programme.lagrangian_step(Cones::GREATEST, programme.P, false, 60);
    programme.polish();
  }
  // Of several splits of a load, that of the most friction.
  for (double& s : shift) s *= 1 - 1e-9;
  for (int i = 0; i < count; ++i) programme.cones[i].w[0] = start[i] + shift[i];
  double off_least = programme.solve();
  change = distance(shifts_of(programme), shift);
  if (!(change <= 1e-8)) return {Outcome::CONTRADICTORY, {}};
  for (int i = 0; i < count; ++i) P[i] = in_newton_seconds(programme.P[i], assembly.contacts[i], speed);
  double error = speed * (off_least + (assembly.is_locked ? INFINITY : shift_error(programme, start, shift, change)));
  return with_axis_impulses({Outcome::ANSWERED, {}, error}, assembly, P);
}
