// Laws with friction for one cluster, in plain doubles: see coulomb.py and moreau.py. Impulses and velocities are
// in the axes of each contact: unit normal, two tangents.
#pragma once
#include <array>

#include "assembly.hpp"
#include "cone_program.hpp"

using Axes = std::array<double, 3>;

struct Motion {  // of the movable bodies: changes of their twists
  const Assembly& scene;
  std::vector<double> twists;
  explicit Motion(const Assembly& assembly) : scene(assembly), twists(6 * static_cast<size_t>(assembly.bodies), 0.0) {}

  void push(int i, const Axes& by) {
    const Touch& touch = scene.touches[i];
    for (int side = 0; side < 2; ++side)
      if (touch.body[side] >= 0) {
        double* twist = &twists[6 * touch.body[side]];
        for (int axis = 0; axis < 3; ++axis)
          for (int k = 0; k < 6; ++k) twist[k] += touch.plain[axis].response[side][k] * by[axis];
      }
  }
  double velocity(int i, int axis) const {
    const Touch& touch = scene.touches[i];
    double sum = touch.plain[axis].velocity;
    for (int side = 0; side < 2; ++side)
      if (touch.body[side] >= 0)
        for (int k = 0; k < 6; ++k) sum += touch.plain[axis].reach[side][k] * twists[6 * touch.body[side] + k];
    return sum;
  }
  Axes velocity(int i) const { return {velocity(i, 0), velocity(i, 1), velocity(i, 2)}; }
};

inline double coupling(const Assembly& scene, int i, int a, int j, int b) {
  return scene.coupling(
      scene.touches[i], scene.touches[j], [a](const Touch& t, int side, int k) { return t.plain[a].reach[side][k]; },
      [b](const Touch& t, int side, int k) { return t.plain[b].response[side][k]; });
}

// Friction beyond these sticks no better, or does not show.
constexpr double GREATEST_FRICTION = 1e30, LEAST_FRICTION = 1e-30, GREATEST_IN_ONE_STEP = 1e6;

struct Friction {
  std::vector<Axes> P;
  double error = 0;  // of the velocities, in the metric of kinetic energy
  bool found = true;
};

// From frictionless impulses p, the least work on relative velocities over the cones of friction, with the normal
// velocities of the loaded contacts kept.
inline Friction least_work(const Assembly& scene, const std::vector<double>& p) {
  int count = scene.count;
  Friction result;
  result.P.assign(count, Axes{0, 0, 0});
  double largest = 0;
  for (int i = 0; i < count; ++i) {
    result.P[i][0] = p[i] * scene.touches[i].length;
    largest = std::fmax(largest, result.P[i][0]);
  }
  std::vector<int> loaded, tangents;
  ActiveSet basis(scene.A.data(), count);
  for (int i = 0; i < count; ++i)
    if (result.P[i][0] > 1e-12 * largest) {
      loaded.push_back(i);
      if (scene.touches[i].mu > LEAST_FRICTION) tangents.push_back(i);
    }
  if (tangents.empty()) return result;
  std::vector<int> rest = basis.span(loaded);
  const std::vector<int>& held = basis.members;
  int nt = 2 * static_cast<int>(tangents.size()), nz = static_cast<int>(rest.size()), n = nt + nz;
  size_t r = held.size();

  Motion free(scene);
  for (int i : loaded) free.push(i, result.P[i]);
  // C[c] = C_held,c of each unknown c, and answer[c] = C_held,held^-1 C[c].
  std::vector<std::vector<double>> C(n, std::vector<double>(r)), answer(n, std::vector<double>(r));
  auto diagonal = [&](int i) { return 1 / (scene.touches[i].scale * scene.touches[i].length); };
  auto direction = [&](int c) { return c < nt ? std::pair<int, int>{tangents[c / 2], 1 + c % 2} : std::pair<int, int>{rest[c - nt], 0}; };
  for (int c = 0; c < n; ++c) {
    auto [j, axis] = direction(c);
    for (size_t k = 0; k < r; ++k) {
      C[c][k] = coupling(scene, held[k], 0, j, axis);
      answer[c][k] = C[c][k] / diagonal(held[k]);
    }
    basis.solve(answer[c].data());
    for (size_t k = 0; k < r; ++k) answer[c][k] /= diagonal(held[k]);
  }
  ConeProgram programme;
  programme.n = n;
  programme.H.assign(static_cast<size_t>(n) * n, 0.0);
  programme.h.assign(n, 0.0);
  double trace = 0, slip = 0;
  for (int c = 0; c < nt; ++c) {
    auto [i, a] = direction(c);
    for (int d = 0; d <= c; ++d) {
      auto [j, b] = direction(d);
      double sum = coupling(scene, i, a, j, b);
      for (size_t k = 0; k < r; ++k) sum -= C[c][k] * answer[d][k];
      programme.H[c * n + d] = programme.H[d * n + c] = sum;
    }
    trace = std::fmax(trace, programme.H[c * n + c]);
  }
  // The work of the normal impulses that friction entails counts too.
  std::vector<double> kept(r);
  for (size_t k = 0; k < r; ++k) kept[k] = free.velocity(held[k], 0);
  double speed = 0;
  for (double u : kept) speed = std::fmax(speed, std::fabs(u));
  for (int c = 0; c < n; ++c) {
    auto [i, a] = direction(c);
    programme.h[c] = free.velocity(i, a);
    for (size_t k = 0; k < r; ++k) programme.h[c] -= answer[c][k] * kept[k];
    if (c < nt) slip = std::fmax(slip, std::fabs(programme.h[c]));
    else if (std::fabs(programme.h[c]) < 1e-10 * speed) programme.h[c] = 0;  // of contacts of one body: none
  }
  if (!(slip > 1e-14 * speed) || !(trace > 0)) return result;
  // Impulses in units of the largest, velocities in units of what it does.
  double unit = largest * trace;
  for (double& x : programme.H) x /= trace;
  for (double& x : programme.h) x /= unit;
  std::vector<int> place(count, -1);
  for (size_t k = 0; k < tangents.size(); ++k) place[tangents[k]] = 2 * static_cast<int>(k);
  for (int i : loaded) {
    ConeProgram::Cone cone{std::vector<double>(n, 0.0), place[i], 0, result.P[i][0] / largest};
    for (size_t k = 0; k < r; ++k)
      if (held[k] == i)
        for (int c = 0; c < n; ++c) cone.row[c] = -answer[c][k];
    for (int c = 0; c < nz; ++c)
      if (rest[c] == i) cone.row[nt + c] = 1;
    if (place[i] >= 0) cone.entry = 1 / std::fmin(scene.touches[i].mu, GREATEST_FRICTION);
    programme.cones.push_back(cone);
  }
  std::vector<double> x;
  double gap = programme.solve(x);
  result.error = std::sqrt(2 * std::fmax(gap, 0) * unit * largest);
  for (double& one : x) one *= largest;
  for (int c = 0; c < n; ++c)
    for (size_t k = 0; k < r; ++k) result.P[held[k]][0] -= answer[c][k] * x[c];
  for (int c = 0; c < nz; ++c) result.P[rest[c]][0] += x[nt + c];
  for (int i : loaded) {
    Axes& P = result.P[i];
    P[0] = std::fmax(P[0], 0);
    if (place[i] < 0) continue;
    P[1] = x[place[i]];
    P[2] = x[place[i] + 1];
    double most = scene.touches[i].mu * P[0], size = std::hypot(P[1], P[2]);
    if (size > most)
      for (int k = 1; k < 3; ++k) P[k] *= most / size;
  }

  // Another contact may approach now.
  Motion moved(scene);
  for (int i = 0; i < count; ++i) moved.push(i, result.P[i]);
  std::vector<double> b(count), y(count, 0.0);
  speed = std::fmax(speed, slip);
  for (int i = 0; i < count; ++i) speed = std::fmax(speed, std::fabs(scene.touches[i].plain[0].velocity));
  bool approaches = false;
  for (int i = 0; i < count; ++i) {
    double u = moved.velocity(i, 0);
    approaches = approaches || u < -1e-11 * speed;
    b[i] = (std::fabs(u) < 1e-11 * speed ? 0 : u) * scene.touches[i].scale * scene.touches[i].length;
  }
  if (approaches) {
    ActiveSet active(scene.A.data(), count);
    result.found = least(scene.A.data(), count, scene.all(), b.data(), y.data(), active) == Found::LEAST;
    for (int i = 0; i < count; ++i) result.P[i][0] += y[i] * scene.touches[i].scale * scene.touches[i].length;
  }
  return result;
}

// Coulomb's law on the velocities after: block Gauss-Seidel on  P = proj_cone(P - rho (u+ + (e min(u, 0) + mu |u_t+|) n)).
inline Friction one_step(const Assembly& scene, const std::vector<double>& p) {
  int count = scene.count;
  Friction result;
  result.P.assign(count, Axes{0, 0, 0});
  Motion motion(scene);
  std::vector<double> bounce(count), rho(count);
  double largest = 0;
  for (int i = 0; i < count; ++i) {
    result.P[i][0] = p[i] * scene.touches[i].length;
    motion.push(i, result.P[i]);
    largest = std::fmax(largest, result.P[i][0]);
    bounce[i] = scene.touches[i].e * std::fmin(scene.touches[i].plain[0].velocity, 0);
    double trace = 0;
    for (int a = 0; a < 3; ++a) trace += coupling(scene, i, a, i, a);
    rho[i] = 1 / trace;
  }
  if (!(largest > 0)) return result;
  double change = 0;
  for (int sweep = 0; sweep < 20000; ++sweep) {
    change = 0;
    if (sweep % 64 == 63) {  // rounding does not gather
      motion.twists.assign(motion.twists.size(), 0.0);
      for (int i = 0; i < count; ++i) motion.push(i, result.P[i]);
    }
    for (int i = 0; i < count; ++i) {
      Axes u = motion.velocity(i), &P = result.P[i];
      double mu = std::fmin(scene.touches[i].mu, GREATEST_IN_ONE_STEP);
      double n = P[0] - rho[i] * (u[0] + bounce[i] + mu * std::hypot(u[1], u[2]));
      double t1 = P[1] - rho[i] * u[1], t2 = P[2] - rho[i] * u[2], size = std::hypot(t1, t2);
      if (size > mu * n) {
        double onto = std::fmax((n + mu * size) / (1 + mu * mu), 0);
        double factor = size > 0 ? mu * onto / size : 0;
        n = onto;
        t1 *= factor;
        t2 *= factor;
      }
      Axes by{n - P[0], t1 - P[1], t2 - P[2]};
      change = std::fmax(change, std::fabs(by[0]) + std::fabs(by[1]) + std::fabs(by[2]));
      P = {n, t1, t2};
      motion.push(i, by);
    }
    if (change <= 1e-15 * largest) break;
  }
  result.found = change <= 1e-12 * largest;
  double speed = 0, off = 0;
  for (int i = 0; i < count; ++i) {
    speed = std::fmax(speed, std::fabs(scene.touches[i].plain[0].velocity));
    off = std::fmax(off, -motion.velocity(i, 0) - bounce[i]);
  }
  result.found = result.found && off <= 1e-8 * speed;
  double sum = 0;
  for (int i = 0; i < count; ++i) sum += 1e3 * std::fmax(change, 1e-15 * largest) / std::sqrt(rho[i]);
  result.error = sum;
  return result;
}
