// Laws with friction for one cluster, in plain doubles: see coulomb.py and moreau.py. Impulses and velocities are
// in the axes of each contact: unit normal, two tangents.
#pragma once
#include "cones.hpp"
#include "struck.hpp"

struct Motion {  // of the movable bodies: y, and their twists have changed by L y
  const Assembly* scene;
  Vector y;
  explicit Motion(const Assembly& assembly) : scene(&assembly), y(6 * static_cast<size_t>(assembly.bodies)) {}

  void push(int i, const Axes& by) {
    const Touch& touch = scene->touches[i];
    for (int side = 0; side < 2; ++side)
      if (touch.body[side] >= 0) {
        double* of = &y[6 * touch.body[side]];
        for (int axis = 0; axis < 3; ++axis)
          for (int k = 0; k < 6; ++k) of[k] += touch.plain[axis].row[side][k] * by[axis];
      }
  }
  double velocity(int i, int axis) const {
    const Touch& touch = scene->touches[i];
    double sum = touch.plain[axis].velocity;
    for (int side = 0; side < 2; ++side)
      if (touch.body[side] >= 0)
        for (int k = 0; k < 6; ++k) sum += touch.plain[axis].row[side][k] * y[6 * touch.body[side] + k];
    return sum;
  }
  double fastest(int i) const { return std::hypot(velocity(i, 0), velocity(i, 1), velocity(i, 2)); }
  // Of the part of y that the velocity of a contact is from, at most, as that velocity.
  double size_at(int i) const {
    double sum = 0;
    for (int side = 0; side < 2; ++side)
      for (int k = 0; scene->touches[i].body[side] >= 0 && k < 6; ++k) sum += std::fabs(scene->touches[i].plain[0].row[side][k] * y[6 * scene->touches[i].body[side] + k]);
    return sum;
  }
  Axes velocity(int i) const { return {velocity(i, 0), velocity(i, 1), velocity(i, 2)}; }
};

inline double coupling(const Assembly& scene, int i, int a, int j, int b) {
  const Touch &one = scene.touches[i], &other = scene.touches[j];
  double sum = 0;
  for (int s = 0; s < 2; ++s)
    for (int t = 0; t < 2; ++t)
      if (one.body[s] >= 0 && one.body[s] == other.body[t])
        for (int k = 0; k < 6; ++k) sum += one.plain[a].row[s][k] * other.plain[b].row[t][k];
  return sum;
}

// Friction beyond these sticks no better, or does not show.
constexpr double GREATEST_FRICTION = 1e30, LEAST_FRICTION = 1e-30, GREATEST_IN_ONE_STEP = 1e6;

// A load that is this part of the greatest is rounding, of double-double; one that was not there before loads were shared
// out is rounding of doubles if it is this part of others of its bodies, or of the greatest if they have none.
constexpr double UNLOADED = 0x1p-80, UNSHARED = 1e-10;

// A contact as a cone: its impulses in units that make n.K n of every contact 1, velocities in units of `speed`.
inline Cones::Cone cone_of(const Touch& touch, double speed, double mean) {
  Cones::Cone cone;
  double unit = touch.scale * touch.length;
  for (int side = 0; side < 2; ++side) {
    cone.body[side] = touch.body[side];
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < 6; ++k) cone.row[side][axis][k] = touch.plain[axis].row[side][k] * unit;
  }
  for (int axis = 0; axis < 3; ++axis) cone.w[axis] = touch.plain[axis].velocity * unit / speed;
  cone.mu = touch.mu > LEAST_FRICTION ? std::fmin(touch.mu, GREATEST_FRICTION) : 0;
  if (!(cone.mu > 0)) cone.w[1] = cone.w[2] = 0;  // which may be much
  // Least squares of the impulses in newton seconds.
  cone.share = std::fmin(std::fmax(1 / (unit * unit * mean), 1e-3), 1e3);
  return cone;
}

// And back: what an impulse in such units is.
inline Axes in_newton_seconds(Axes P, const Touch& touch, double speed) {
  for (double& along : P) along = along * speed * touch.scale * touch.length;
  return P;
}

// From frictionless impulses the least work on relative velocities over the cones of friction, with the normal velocities
// of the loaded contacts kept. Loaded are those of the impulses of least norm, as others depend on the order; and of those
// that do nearly the same, for a box a hair from flat stands on all its corners. Of contacts that nearly depend on others
// no velocity is kept, or that hair would keep them from sliding. If none of them rubs, the frictionless impulses.
inline Struck least_work(const Assembly& scene, const Struck& free) {
  int count = scene.count;
  Struck result = free;
  Vector own = rounded(free.p.data(), count), shared = own;
  scene.least_norm(shared, false);
  Vector nearly_shared = shared;
  const double off = scene.nearly_least_norm(nearly_shared);
  for (int i = 0; i < count; ++i) shared[i] = (shared[i] + nearly_shared[i]) / 2;  // loaded in either
  double mean = 0, speed = 0;
  Vector most(scene.bodies);  // of the loads of each body
  for (int i = 0; i < count; ++i) {
    const Touch& touch = scene.touches[i];
    speed = std::fmax(speed, shared[i] / touch.scale);
    for (int body : touch.body)
      if (body >= 0) most[body] = std::fmax(most[body], own[i] / touch.scale);
  }
  auto rounding = [&](int i) {  // of the load of a contact
    double near = 0;
    for (int body : scene.touches[i].body)
      if (body >= 0) near = std::fmax(near, most[body]);
    bool is_new = shared[i] > 2 * own[i] || shared[i] < own[i] / 2;
    return is_new ? UNSHARED * (near > 0 ? near : speed) : UNLOADED * speed;
  };
  std::vector<int> loaded;
  bool rubs = false;
  Motion as_given(scene), as_shared(scene);
  for (int i = 0; i < count; ++i) {
    const Touch& touch = scene.touches[i];
    as_given.push(i, {own[i] * touch.length, 0, 0});
    as_shared.push(i, {shared[i] * touch.length, 0, 0});
    if (!(shared[i] / touch.scale > rounding(i))) {
      double slip = std::hypot(touch.plain[1].velocity, touch.plain[2].velocity) * touch.length;
      if (shared[i] > 0) result.error += std::sqrt(2 * touch.mu * (shared[i] / touch.scale / speed) * (slip * touch.scale / speed)) * speed;
      continue;
    }
    loaded.push_back(i);
    rubs = rubs || touch.mu > LEAST_FRICTION;
    mean += 1 / (touch.scale * touch.scale * touch.length * touch.length);
  }
  if (!rubs) return result;
  mean /= loaded.size();
  Cones programme(scene.bodies);
  programme.normals = ActiveSet<double>(scene.A.data(), count);
  const std::vector<int> dependent = programme.normals.span(loaded, NEARLY_DEPENDENT);
  loaded = programme.normals.members;
  loaded.insert(loaded.end(), dependent.begin(), dependent.end());
  const size_t independent = programme.normals.members.size();
  for (int i : loaded) {
    const Touch& touch = scene.touches[i];
    programme.cones.push_back(cone_of(touch, speed, mean));
    programme.loads.push_back(shared[i] / touch.scale / speed);
    if (programme.kept.size() == independent) continue;
    double unit = touch.scale * touch.length / speed;
    programme.kept.push_back((as_given.velocity(i, 0) - touch.plain[0].velocity) * unit);
    programme.spare.push_back(std::fabs(as_shared.velocity(i, 0) - as_given.velocity(i, 0)) * unit);
  }
  programme.begin();
  result.error += programme.solve() * speed;
  std::vector<Axes> P(count);
  for (size_t k = 0; k < loaded.size(); ++k) P[loaded[k]] = in_newton_seconds(programme.P[k], scene.touches[loaded[k]], speed);

  // Another contact may approach now.
  Motion moved(scene);
  for (int i = 0; i < count; ++i) moved.push(i, P[i]);
  double square = 0;  // of what friction changes
  for (size_t k = 0; k < moved.y.size(); ++k) square += (moved.y[k] - as_given.y[k]) / speed * ((moved.y[k] - as_given.y[k]) / speed);
  // An estimate: other contacts might have been kept, and shared. What two orders of them give was at most 0.73 of the sum
  // of both bounds apart, in 1500 stacks.
  result.error += 4 * off * (1 + std::sqrt(square)) * speed;
  std::vector<N> offset;
  bool approaches = false;
  for (int i = 0; i < count; ++i) {
    const Touch& touch = scene.touches[i];
    double u = moved.velocity(i, 0), doubt = 0x1p-50 * (std::fabs(touch.plain[0].velocity) + moved.size_at(i));
    approaches = approaches || u < -doubt;
    offset.push_back(exact(u * touch.length) - touch.velocity);
    offset.back().error += doubt * touch.length;
  }
  if (approaches) {
    Assembly::Projection last = scene.project(std::vector<DD>(count).data(), scene.all(), offset.data());
    // GRR has found velocities that part them: if none are found here, doubles can't tell.
    result.error += last.found == Found::LEAST ? last.error : INFINITY;
    for (int i = 0; i < count; ++i) P[i][0] += last.q[i].h * scene.touches[i].length;
  }
  return with_impulses(std::move(result), scene, P);
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
inline double spread(Cones programme, const Vector& start, const Vector& shift, double off) {
  constexpr double LEAST = 1e-9, WIDER = 30, WIDEST = 1e-3, SEEN = 1e-12, STAYS = 1 - 1e-5;
  constexpr int ROUNDS = 20;
  auto look = [&](const Vector& by) {
    for (size_t i = 0; i < by.size(); ++i) programme.cones[i].w[0] = start[i] + std::fmax(shift[i] + by[i], 0);
    if (!programme.settle(Cones::GREATEST, programme.P, false, 60)) programme.start_afresh();
    programme.sharpen();
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
inline Struck one_step(const Assembly& scene) {
  int count = scene.count;
  std::vector<Axes> P(count);
  double mean = 0, speed = 0;
  bool approach = false;
  for (const Touch& touch : scene.touches) {
    mean += 1 / (touch.scale * touch.scale * touch.length * touch.length) / count;
    approach = approach || touch.plain[0].velocity < 0;
    bool rubs = touch.mu > LEAST_FRICTION;  // of what does not, the slip may be anything
    speed = std::fmax(speed, std::hypot(touch.plain[0].velocity, rubs * touch.plain[1].velocity, rubs * touch.plain[2].velocity) * touch.scale * touch.length);
  }
  if (!approach) return with_impulses({}, scene, P);  // no impulse is a solution
  Cones programme(scene.bodies);
  Vector start;
  for (const Touch& touch : scene.touches) {
    Cones::Cone cone = cone_of(touch, speed, mean);
    cone.mu = std::fmin(cone.mu, GREATEST_IN_ONE_STEP);
    cone.w[0] += touch.e * std::fmin(cone.w[0], 0);
    start.push_back(cone.w[0]);
    programme.cones.push_back(cone);
  }
  programme.begin();
  programme.start_afresh();
  programme.sharpen();
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
    programme.settle(Cones::GREATEST, programme.P, false, 60);
    programme.sharpen();
  }
  // Of several splits of a load, that of the most friction.
  for (double& s : shift) s *= 1 - 1e-9;
  for (int i = 0; i < count; ++i) programme.cones[i].w[0] = start[i] + shift[i];
  double off_least = programme.solve();
  change = distance(shifts_of(programme), shift);
  if (!(change <= 1e-8)) return {Outcome::CONTRADICTORY, {}};
  for (int i = 0; i < count; ++i) P[i] = in_newton_seconds(programme.P[i], scene.touches[i], speed);
  double error = speed * (off_least + (scene.locked ? INFINITY : spread(programme, start, shift, change)));
  return with_impulses({Outcome::ANSWERED, {}, error}, scene, P);
}
