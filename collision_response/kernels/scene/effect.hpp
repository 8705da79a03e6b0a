// What impulses do to the bodies and the contacts of a cluster, and the error bound of that: ImpulseEffect of
// scene/cluster_result.py.
#pragma once
#include "contact_cones.hpp"
#include "impulses.hpp"
#include "least_norm.hpp"
#include "motion.hpp"

using Regime = unsigned char;

// A slip below this fraction of the fastest speed before the impact counts as none. Friction that is below its limit by
// a smaller fraction counts as being at the limit.
constexpr double AT_REST = 0x1p-20;

struct ImpulseEffect {
  ImpulseEffect() = default;
  ImpulseEffect(int contacts, int bodies)
      : changes(6 * static_cast<size_t>(bodies)),
        twists(changes.size()),
        impulses(3 * static_cast<size_t>(contacts)),
        normal_velocities_before(contacts),
        normal_velocities_after(contacts),
        regimes(contacts) {}

  Vector changes, twists;  // six numbers for each movable body
  Vector impulses;  // three numbers for each contact
  Vector normal_velocities_before, normal_velocities_after;
  std::vector<Regime> regimes;
  double energies[4] = {};  // kinetic energy before and after, energy lost to restitution and to friction
  double error_bound = 0;
  // Whether the contacts gain more energy than rounding explains, by the work on relative velocities, which is the same
  // for every observer.
  bool creates_energy = false;
  // Whether contacts gain energy, pull, leave their friction cones, or still approach, by more than the error; or kinetic
  // energy grows by more, without a moving wall.
  bool is_unphysical = false;

  bool is_separating() const {
    return std::all_of(regimes.begin(), regimes.end(), [](Regime regime) { return regime == REGIME_SEPARATING; });
  }
  // It suffices to check the energies, which are sums over everything else.
  bool is_finite() const {
    return std::all_of(energies, energies + 4, [](double energy) { return std::isfinite(energy); });
  }
};

// Compute the effect of impulses. With `sticks_by_slip`, a contact sticks if it does not slip afterwards; otherwise, if
// its friction is below the limit.
inline ImpulseEffect effect_of(const Assembly& assembly, const ClusterImpulses& impulses, bool sticks_by_slip) {
  ImpulseEffect effect(assembly.count, assembly.body_count);
  int count = assembly.count;
  const DD* p = impulses.normal.data();
  double error = impulses.error;
  bool has_friction = !impulses.tangential.empty();
  std::vector<Axes> P(count);  // tangential impulses
  Vector reported = rounded(p, count);
  if (has_friction)
    for (int i = 0; i < count; ++i)
      for (int k = 0; k < 2; ++k) P[i][1 + k] = impulses.tangential[2 * i + k];
  std::vector<N> sums = assembly.twist_changes(p);
  Motion motion(assembly), by_friction(assembly);
  for (int i = 0; i < count; ++i) {
    if (has_friction) by_friction.apply(i, P[i]);
    motion.apply(i, {reported[i] * assembly.contacts[i].length, P[i][1], P[i][2]});
  }
  if (!has_friction) least_norm(assembly, reported, true);

  for (int i = 0; i < count; ++i)
    // An impulse is rounded to a multiple of the least double.
    if (p[i].h != 0) error += 0x1p-1073 / assembly.contacts[i].scale;

  double largest = 0, worst = 0, rounding = 0;
  for (int b = 0; b < assembly.body_count; ++b) {
    const double* body = assembly.bodies[b].x;
    double* change = &effect.changes[6 * b];
    if (has_friction) assembly.bodies[b].centre_in_doubles.twist_of(&by_friction.y[6 * b], change);
    for (int k = 0; k < 6; ++k) change[k] += high(sums[6 * b + k]);
    double moved[BODY];
    std::copy(body, body + BODY, moved);
    for (int k = 0; k < 6; ++k) moved[BODY_VELOCITY_X + k] += change[k];
    effect.energies[0] += assembly.bodies[b].centre_in_doubles.energy;
    effect.energies[1] += Centre<double>(moved).energy;
    double lost[6];
    for (int k = 0; k < 6; ++k)
      lost[k] = width(sums[6 * b + k]) +
                (std::fabs(change[k]) + std::fabs(high(sums[6 * b + k]))) * 0x1p-53 * (has_friction ? 4 : 1);
    largest = std::fmax(largest, twist_size(body, change));
    rounding = std::fmax(rounding, twist_size(body, lost));
    worst = std::fmax(worst, error * norm_ratio(assembly.bodies[b]));
    std::copy_n(moved + BODY_VELOCITY_X, 6, &effect.twists[6 * b]);
  }
  std::vector<N> u;
  if (!has_friction) u = assembly.velocities(p);
  double fastest = 0, greatest = 0;
  for (int i = 0; i < count; ++i) {
    const auto& axes = assembly.contacts[i].axes;
    fastest = std::fmax(fastest, std::hypot(axes[0].velocity, axes[1].velocity, axes[2].velocity));
    greatest = std::fmax(greatest, p[i].h * assembly.contacts[i].length);
  }
  // In units near the greatest, because the works may be out of the range of doubles.
  const double unit = power_near(fastest), load = power_near(greatest);
  double restitution = 0, friction_loss = 0, work = 0, doubt = 0, reach = 0;
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    double* impulse = &effect.impulses[3 * i];
    for (int k = 0; k < 3; ++k) impulse[k] = reported[i] * contact.normal[k];
    Axes u_before{contact.axes[0].velocity, contact.axes[1].velocity, contact.axes[2].velocity};
    Axes u_after = motion.velocity(i);
    if (!has_friction) u_after[0] = high(u[i]) / contact.length;
    double speed = std::hypot(u_after[1], u_after[2]), back = u_before[1] * u_after[1] + u_before[2] * u_after[2];
    double friction = std::hypot(P[i][1], P[i][2]), most = contact.mu * p[i].h * contact.length;
    if (has_friction) {
      const auto directions = contact.unit_vectors<double>();
      for (int k = 0; k < 3; ++k) impulse[k] += P[i][1] * directions[1][k] + P[i][2] * directions[2][k];
    }
    // By rounding, and by the least double.
    const double tolerated = has_friction ? 0x1p-50 * (std::fabs(u_before[0]) + motion.size_at(i))
                                          : width(u[i]) / contact.length + 0x1p-50 * std::fabs(u_after[0]);
    const bool approaches = u_after[0] < -tolerated - error / (contact.scale * contact.length);
    const double doubt_of_cone = 0x1p-40 * most + (1 + contact.mu) * error * contact.scale * contact.length + 0x1p-1070;
    const bool leaves_cone = friction > most + doubt_of_cone;
    effect.is_unphysical = effect.is_unphysical || p[i].h < 0 || leaves_cone || approaches;
    double normal = p[i].h * contact.length / load;
    double along =
        (P[i][1] / load * ((u_before[1] + u_after[1]) / unit) + P[i][2] / load * ((u_before[2] + u_after[2]) / unit)) /
        2;
    restitution -= normal * ((u_before[0] + u_after[0]) / unit) / 2;
    friction_loss -= along;
    doubt += normal * (width(contact.velocity) / contact.length / unit);
    reach += normal / (contact.scale * contact.length) / unit;
    work += normal * ((std::fabs(u_before[0]) + std::fabs(u_after[0])) / unit) + std::fabs(along);
    effect.normal_velocities_before[i] = u_before[0];
    effect.normal_velocities_after[i] = u_after[0];
    Regime regime = back < 0 && speed > AT_REST * fastest ? REGIME_REVERSED : REGIME_SLIDING;
    if (impulse[0] == 0 && impulse[1] == 0 && impulse[2] == 0) regime = REGIME_SEPARATING;
    else if (!(contact.mu > LEAST_FRICTION)) regime = REGIME_SLIDING;
    else if (sticks_by_slip ? speed <= AT_REST * fastest : friction < (1 - AT_REST) * most) regime = REGIME_STICKING;
    effect.regimes[i] = regime;
  }
  const double loss = restitution + friction_loss, by_rounding = 0x1p-40 * work + doubt;
  const double by_error = error < INFINITY ? error * reach : 0;
  const bool gains = loss < -by_rounding - by_error;
  const bool grows = !assembly.has_moving_wall &&
                     effect.energies[1] > effect.energies[0] * (1 + 0x1p-40) + by_error * load * unit;
  effect.creates_energy = loss < -by_rounding;
  effect.is_unphysical = effect.is_unphysical || gains || grows;
  if (!gains) restitution = std::fmax(restitution, -friction_loss);
  effect.energies[2] = restitution * load * unit;
  effect.energies[3] = friction_loss * load * unit;
  effect.error_bound = largest > 0 ? (worst + rounding) / std::fmax(largest - worst - rounding, 0)
                                   : (worst > 0 ? INFINITY : 0);
  if (!(effect.error_bound == effect.error_bound)) effect.error_bound = INFINITY;
  return effect;
}
