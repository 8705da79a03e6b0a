// Where contacts depend on each other, as the four corners of a box do, several impulses have the same effect. These
// functions find those of least norm, which are as symmetric as the scene.
#pragma once
#include "assembly.hpp"

// A basis of the impulses that do next to nothing: one for each contact that depends on others, by pivots up to
// `dependent`. Included are those whose effect, squared, is less than `most`. The sum of their effects is added to
// `effect`, which knows them to doubles. `are_exact`, if given, says whether they do nothing in double-double either.
inline std::vector<Vector> null_impulses(const Assembly& assembly, double dependent, double most, double& effect,
                                         bool* are_exact = nullptr) {
  constexpr double ROUNDING = 0x1p-90;  // relative to the effects of the single impulses, which cancel
  constexpr int REFINEMENTS = 3;
  const int count = assembly.count;
  const std::vector<AssembledContact>& contacts = assembly.contacts;
  const Vector& A = assembly.A;
  // Moving walls add a row for their work, which impulses of the same effect must not change either.
  Vector u(count), B, scale(count);
  double fastest = 0;
  for (const AssembledContact& contact : contacts)
    fastest = std::fmax(fastest, std::fabs(high(contact.velocity)) * contact.scale);
  for (int i = 0; i < count; ++i) {
    u[i] = assembly.has_moving_wall && fastest > 0 ? high(contacts[i].velocity) * contacts[i].scale / fastest : 0;
    scale[i] = contacts[i].scale / std::sqrt(1 + u[i] * u[i]);
  }
  if (assembly.has_moving_wall) {
    B = A;
    for (int i = 0; i < count; ++i)
      for (int j = 0; j < count; ++j)
        B[i * count + j] =
            i == j ? 1 : (A[i * count + j] + u[i] * u[j]) * scale[i] / contacts[i].scale * scale[j] / contacts[j].scale;
  }
  ActiveSet<double> basis(assembly.has_moving_wall ? B.data() : A.data(), count);
  std::vector<Vector> found;
  Vector w;
  for (int i : basis.span(assembly.all_contacts(), dependent)) {
    std::vector<DD> z(count);
    basis.line(i, w);
    z[i].h = scale[i];
    for (size_t m = 0; m < w.size(); ++m) z[basis.members[m]].h = -w[m] * scale[basis.members[m]];
    // Doubles take its effect for 0: compute that in double-double, and refine z until it is 0.
    double square = 0;
    bool is_exact = false;
    for (int turn = 0;; ++turn) {
      std::vector<N> twists = assembly.twist_changes(z.data());
      N total = exact(0.0);
      for (int n = 0; assembly.has_moving_wall && n < count; ++n) total = total + contacts[n].velocity * exact(z[n]);
      const double work = fastest > 0 ? high(total) / fastest : 0;
      square = work * work * 1e-6;  // the velocities of walls are known to fewer digits
      for (int n = 0; n < count; ++n)
        if (z[n].h != 0) square += z[n].h * high(assembly.velocity_change(contacts[n], twists));
      double size = std::fabs(work);  // of the effect, in the norm of error_bound
      for (int b = 0; b < assembly.body_count; ++b) {
        double rounded[6];
        for (int k = 0; k < 6; ++k) rounded[k] = high(twists[6 * b + k]);
        size += twist_size(assembly.bodies[b].x, rounded);
      }
      is_exact = size <= ROUNDING * assembly.velocity_size(z.data());
      if (is_exact || turn == REFINEMENTS) break;
      for (size_t m = 0; m < w.size(); ++m) {
        int j = basis.members[m];
        w[m] = -(high(assembly.velocity_change(contacts[j], twists)) + u[j] / contacts[j].scale * work) * scale[j];
      }
      basis.solve(w.data());
      for (size_t m = 0; m < w.size(); ++m)
        z[basis.members[m]] = z[basis.members[m]] + DD{w[m] * scale[basis.members[m]], 0};
    }
    if (!(std::fabs(square) < most)) continue;
    found.push_back(rounded(z.data(), count));
    effect += std::sqrt(std::fabs(square));
    if (are_exact) *are_exact = *are_exact && is_exact;
  }
  return found;
}

// Replace p by the p + Z z >= 0 of least norm.
inline void minimise_norm(const Assembly& assembly, Vector& p, bool over_copies, std::vector<Vector> Z) {
  constexpr double ROUNDING = 0x1p-46;
  const int count = assembly.count;
  Vector weight(count), P(count), terms(count);  // terms: the sum of the sizes of what P is the sum of
  for (int i = 0; i < count; ++i) {
    weight[i] = assembly.contacts[i].length / (over_copies ? std::sqrt(assembly.contacts[i].copies) : 1);
    P[i] = p[i] * weight[i];
    terms[i] = std::fabs(P[i]);
    for (Vector& z : Z) z[i] *= weight[i];
  }
  for (auto z = Z.begin(); z != Z.end(); ++z) {  // make Z orthonormal: twice is enough
    for (int turn = 0; turn < 2; ++turn)
      for (auto before = Z.begin(); before != z; ++before) increase(*z, -dot(*z, *before), *before);
    const double length = std::sqrt(dot(*z, *z));
    for (double& x : *z) {
      x /= length;
      if (std::fabs(x) < ROUNDING) x = 0;
    }
  }
  auto add = [&](double by, const Vector& z) {
    increase(P, by, z);
    for (int i = 0; i < count; ++i) terms[i] += std::fabs(by * z[i]);
  };
  for (const Vector& z : Z) add(-dot(z, P), z);
  // P + Z Z^T x >= 0, x >= 0: the dual is again a quadratic programme, scaled to a unit diagonal.
  auto rows = [&](int i, int j) {
    double sum = 0;
    for (const Vector& z : Z) sum += z[i] * z[j];
    return sum;
  };
  Vector b(count), s(count), dual(static_cast<size_t>(count) * count, 1);
  std::vector<int> among;
  double greatest = 0;
  for (int i = 0; i < count; ++i) {
    greatest = std::fmax(greatest, std::fabs(P[i]));
    const double square = rows(i, i);
    if (!(square > 1e-20)) continue;
    s[i] = 1 / std::sqrt(square);
    among.push_back(i);
  }
  for (int i : among)
    for (int j : among)
      if (i != j) dual[i * count + j] = rows(i, j) * s[i] * s[j];
  auto with_room = [&](double room) {
    for (int i : among) b[i] = (P[i] + room * greatest) * s[i];
    return minimise(dual, b, among);
  };
  Minimum<double> solved = with_room(0);
  // Where impulses are just 0, rounding may leave no solution without some room.
  if (solved.status != MinimumStatus::FOUND) solved = with_room(1e-13);
  if (solved.status != MinimumStatus::FOUND) return;
  const Vector& x = solved.x;
  for (const Vector& z : Z) {
    double along = 0;
    for (int i : among) along += z[i] * x[i] * s[i];
    add(along, z);
  }
  for (int i = 0; i < count; ++i) p[i] = x[i] > 0 || P[i] <= ROUNDING * terms[i] ? 0 : P[i] / weight[i];
}

// Replace p by the impulses >= 0 of the same effect with the least sum of n.n p^2, over all copies of contacts if
// `over_copies`. Whether several impulses have this effect.
inline bool least_norm(const Assembly& assembly, Vector& p, bool over_copies) {
  double effect = 0;
  std::vector<Vector> Z = null_impulses(assembly, DEPENDENT<double>, 1e-26, effect);
  if (Z.empty()) return false;
  minimise_norm(assembly, p, over_copies, std::move(Z));
  return true;
}

// Replace p as least_norm() does, and set `nearly` to the impulses of nearly the same effect with the least norm.
// Returns the difference in their effects, at most, for a load of 1 on each contact, in the metric of kinetic energy.
inline double share_loads(const Assembly& assembly, Vector& p, Vector& nearly) {
  double effect = 0;
  std::vector<Vector> Z = null_impulses(assembly, NEARLY_DEPENDENT, 1, effect);
  if (effect > 0x1p-50 * assembly.count) {
    least_norm(assembly, p, false);
    nearly = p;
    minimise_norm(assembly, nearly, false, std::move(Z));
  } else {  // contacts depend on others or are independent, and none is between
    if (!Z.empty()) minimise_norm(assembly, p, false, std::move(Z));
    nearly = p;
  }
  return effect;
}
