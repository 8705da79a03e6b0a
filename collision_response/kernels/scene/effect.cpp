// What impulses do to the bodies and the contacts of a cluster: the answer, with the bound on its error.
#include "effect.hpp"

#include "contact_cones.hpp"
#include "least_norm.hpp"
#include "motion.hpp"

namespace {

// A slip below this fraction of the speeds at its contact counts as none. Friction that is below its limit by a smaller
// fraction counts as being at the limit.
constexpr double AT_REST = 0x1p-20;

// Impulses have the same effect if it differs by less than this fraction.
constexpr double SAME_EFFECT = 0x1p-30;

// Impulses that are applied to a cluster: the motion after them, and what is known of its error.
struct AppliedImpulses {
  const Assembly& assembly;
  const DD* normal;  // along the normals
  bool has_friction;
  double error;  // bound on that of the velocities, in the metric of kinetic energy
  List<Axes> along_axes;  // of each contact: 0, then the friction along the two tangents
  Vector reported;  // the normal impulses of the answer
  List<N> twist_changes;  // by the normal impulses
  List<N> normal_velocities;  // times the lengths of the normals; empty with friction
  Motion motion, by_friction;

  AppliedImpulses(const Assembly& assembly, const ClusterImpulses& impulses)
      : assembly(assembly),
        normal(impulses.normal.data()),
        has_friction(!impulses.tangential.empty()),
        error(impulses.error),
        along_axes(assembly.count),
        twist_changes(assembly.twist_changes(normal)),
        motion(assembly),
        by_friction(assembly) {
    for (int i = 0; i < assembly.count; ++i) {
      const AssembledContact& contact = assembly.contacts[i];
      reported.push_back(normal[i].h);
      if (has_friction) {
        for (int k = 0; k < 2; ++k) along_axes[i][1 + k] = impulses.tangential[2 * i + k];
        by_friction.apply(i, along_axes[i]);
      }
      motion.apply(i, {reported[i] * contact.length, along_axes[i][1], along_axes[i][2]});
      // An impulse is rounded to a multiple of the least double.
      if (normal[i].h != 0) error += 0x1p-1073 / contact.scale;
    }
    if (has_friction) return;
    if (!impulses.have_least_norm)
      take_least_norm(impulses.may_press.empty() ? assembly.all_contacts() : impulses.may_press);
    normal_velocities = assembly.velocities(normal);
  }

  // Report the least impulses with the same effect. Where contacts nearly face each other, loads on both of them seem to
  // do nothing, but may be so great that they do all the work.
  void take_least_norm(const List<int>& among) {
    Vector least = reported;
    least_norm(assembly, least, among);
    if (least == reported) return;
    List<DD> dropped;
    for (int i = 0; i < assembly.count; ++i) dropped.push_back(normal[i] - DD{least[i], 0});
    if (greatest_twist(assembly.twist_changes(dropped.data())) <= SAME_EFFECT * greatest_twist(twist_changes))
      reported = least;
  }
  double greatest_twist(const List<N>& changes) const {
    double greatest = 0, twist[6];
    for (int b = 0; b < assembly.body_count; ++b) {
      std::transform(&changes[6 * b], &changes[6 * b] + 6, twist, [](const N& x) { return high(x); });
      greatest = std::fmax(greatest, twist_size(assembly.bodies[b].x, twist));
    }
    return greatest;
  }

  double normal_impulse(int i) const { return normal[i].h * assembly.contacts[i].length; }
  double friction_limit(int i) const { return assembly.contacts[i].mu * reported[i] * assembly.contacts[i].length; }
  double friction(int i) const { return std::hypot(along_axes[i][1], along_axes[i][2]); }
  Axes velocity_before(int i) const {
    const auto& axes = assembly.contacts[i].axes;
    return {axes[0].velocity, axes[1].velocity, axes[2].velocity};
  }
  Axes velocity_after(int i) const {
    Axes u = motion.velocity(i);
    if (!has_friction) u[0] = high(normal_velocities[i]) / assembly.contacts[i].length;
    return u;
  }

  // The velocity of a contact before, and what its change is the sum of, all without signs.
  double speeds_at(int i) const {
    double sum = 0;
    for (int axis = 0; axis < 3; ++axis)
      sum += std::fabs(assembly.contacts[i].axes[axis].velocity) + motion.size_at(i, axis);
    return sum;
  }

  // Write the impulse on body_a in world axes.
  void write_impulse(int i, double* impulse) const {
    const AssembledContact& contact = assembly.contacts[i];
    for (int k = 0; k < 3; ++k) impulse[k] = reported[i] * contact.normal[k];
    if (!has_friction) return;
    const auto directions = contact.unit_vectors<double>();
    const Axes& P = along_axes[i];
    for (int k = 0; k < 3; ++k) impulse[k] += P[1] * directions[1][k] + P[2] * directions[2][k];
  }

  // Whether a contact pulls, leaves its friction cone, or still approaches, by more than the error.
  bool is_unphysical(int i, const Axes& before, const Axes& after) const {
    const AssembledContact& contact = assembly.contacts[i];
    // By rounding, and by the least double.
    const double tolerated = has_friction
                                 ? 0x1p-50 * (std::fabs(before[0]) + motion.size_at(i, 0))
                                 : width(normal_velocities[i]) / contact.length + 0x1p-50 * std::fabs(after[0]);
    const bool approaches = after[0] < -tolerated - error / contact.unit();
    const double doubt_of_cone = 0x1p-40 * friction_limit(i) + (1 + contact.mu) * error * contact.unit() + 0x1p-1070;
    return normal[i].h < 0 || friction(i) > friction_limit(i) + doubt_of_cone || approaches;
  }
};

// Set the motion of the bodies, their kinetic energies and the error bound.
void set_motion(const AppliedImpulses& applied, ImpulseEffect& effect) {
  const Assembly& assembly = applied.assembly;
  double largest = 0, worst = 0, rounding = 0;
  for (int b = 0; b < assembly.body_count; ++b) {
    const AssembledBody& body = assembly.bodies[b];
    const N* by_normal = &applied.twist_changes[6 * b];
    double *change = &effect.changes[6 * b], *twist = &effect.twists[6 * b], lost[6];
    if (applied.has_friction) body.centre_in_doubles.twist_of(&applied.by_friction.y[6 * b], change);
    for (int k = 0; k < 6; ++k) {
      change[k] += high(by_normal[k]);
      twist[k] = body.x[BODY_VELOCITY_X + k] + change[k];
      lost[k] = width(by_normal[k]) +
                (std::fabs(change[k]) + std::fabs(high(by_normal[k]))) * 0x1p-53 * (applied.has_friction ? 4 : 1);
    }
    effect.energies[ENERGY_BEFORE] += body.centre_in_doubles.energy;
    effect.energies[ENERGY_AFTER] += kinetic_energy(body.x, twist);
    largest = std::fmax(largest, twist_size(body.x, change));
    rounding = greater_error(rounding, twist_size(body.x, lost));
    worst = greater_error(worst, applied.error * norm_ratio(body));
  }
  effect.error_bound = largest > 0 ? (worst + rounding) / std::fmax(largest - worst - rounding, 0)
                                   : (worst <= 0 ? 0 : INFINITY);
  if (!(effect.error_bound == effect.error_bound)) effect.error_bound = INFINITY;
}

// The work of the contacts. It is summed in units near the greatest speed and impulse, because it may be out of the
// range of doubles.
struct Works {
  const AppliedImpulses& applied;
  double fastest = 0;  // speed before the impact
  double speed_unit = 1, impulse_unit = 1;
  DD normal_work{};  // of the normal impulses
  double lost_friction = 0;
  double total = 0;  // of all terms, without their signs
  double doubt = 0;  // by the errors of the velocities before the impact
  double reach = 0;  // by a unit error of the velocities after it, in the metric of kinetic energy

  explicit Works(const AppliedImpulses& applied) : applied(applied) {
    double greatest = 0;
    for (int i = 0; i < applied.assembly.count; ++i) {
      const Axes u = applied.velocity_before(i);
      fastest = std::fmax(fastest, std::hypot(u[0], u[1], u[2]));
      greatest = std::fmax(greatest, applied.normal_impulse(i));
    }
    speed_unit = power_near(fastest);
    impulse_unit = power_near(greatest);
  }

  void add(int i, const Axes& before, const Axes& after) {
    const AssembledContact& contact = applied.assembly.contacts[i];
    const Axes& P = applied.along_axes[i];
    const double normal = applied.normal_impulse(i) / impulse_unit;
    const double along = (P[1] / impulse_unit * ((before[1] + after[1]) / speed_unit) +
                          P[2] / impulse_unit * ((before[2] + after[2]) / speed_unit)) /
                         2;
    const DD twice = applied.has_friction ? DD{normal * ((before[0] + after[0]) / speed_unit), 0}
                                          : twice_the_work_without_friction(i);
    normal_work = normal_work + 0.5 * twice;
    lost_friction -= along;
    total += normal * ((std::fabs(before[0]) + std::fabs(after[0])) / speed_unit) + std::fabs(along);
    doubt += normal * (width(contact.velocity) / contact.length / speed_unit);
    reach += normal / contact.unit() / speed_unit;
  }

  // Loads on both of two contacts that nearly face each other may cancel in all digits of a double.
  DD twice_the_work_without_friction(int i) const {
    const DD load = applied.normal[i] / impulse_unit;
    const N both = applied.assembly.contacts[i].velocity + applied.normal_velocities[i];
    return DD{both.value.h / speed_unit, both.value.l / speed_unit} * load;
  }

  // Set the energies that are lost, and whether energy is created. Kinetic energies must agree with the work: they depend
  // on the observer, and so decide nothing else.
  void set_losses(ImpulseEffect& effect) const {
    double* energies = effect.energies;
    const double lost_restitution = -high(normal_work);
    const double loss = lost_restitution + lost_friction, by_rounding = 0x1p-40 * total + doubt;
    const bool is_bounded = effect.error_bound < INFINITY;
    const double by_error = applied.error < INFINITY ? applied.error * reach : 0;
    const double explained = is_bounded ? (by_rounding + by_error) * impulse_unit * speed_unit : 0;
    const double least = 0x1p-1070 * applied.assembly.body_count;  // that energies are rounded to
    const double greatest = energies[ENERGY_BEFORE] * (1 + 0x1p-40) + explained + least;
    const bool exceeds = !applied.assembly.has_moving_wall && energies[ENERGY_AFTER] > greatest;
    const bool gains = loss < -by_rounding - by_error, grows = exceeds && is_bounded;
    effect.creates_energy = loss < -by_rounding;
    effect.is_unphysical = effect.is_unphysical || gains || grows;
    effect.lacks_digits = exceeds && !is_bounded;
    const double to_restitution = gains ? lost_restitution : std::fmax(lost_restitution, -lost_friction);
    energies[LOST_TO_RESTITUTION] = to_restitution * impulse_unit * speed_unit;
    energies[LOST_TO_FRICTION] = lost_friction * impulse_unit * speed_unit;
  }
};

}  // namespace

ImpulseEffect effect_of(const Assembly& assembly, const ClusterImpulses& impulses, bool sticks_by_slip) {
  ImpulseEffect effect(assembly.count, assembly.body_count);
  const AppliedImpulses applied(assembly, impulses);
  set_motion(applied, effect);
  Works works(applied);
  for (int i = 0; i < assembly.count; ++i) {
    const Axes before = applied.velocity_before(i), after = applied.velocity_after(i);
    double* impulse = &effect.impulses[3 * i];
    applied.write_impulse(i, impulse);
    effect.normal_velocities[i] = after[0];
    effect.is_unphysical = effect.is_unphysical || applied.is_unphysical(i, before, after);
    works.add(i, before, after);
    const double mu = assembly.contacts[i].mu, at_rest = AT_REST * applied.speeds_at(i);
    const double slip_before = std::hypot(before[1], before[2]), slip = std::hypot(after[1], after[2]);
    const bool turns_back = before[1] / slip_before * after[1] + before[2] / slip_before * after[2] < 0 &&
                            std::fmin(slip_before, slip) > at_rest;
    const bool sticks = sticks_by_slip ? slip <= at_rest
                                       : applied.friction(i) < (1 - AT_REST) * applied.friction_limit(i);
    Regime& regime = effect.regimes[i];
    if (impulse[0] == 0 && impulse[1] == 0 && impulse[2] == 0) regime = REGIME_SEPARATING;
    else if (!(mu > LEAST_FRICTION)) regime = REGIME_SLIDING;
    else if (sticks) regime = REGIME_STICKING;
    else regime = turns_back ? REGIME_REVERSED : REGIME_SLIDING;
  }
  works.set_losses(effect);
  return effect;
}
