// Resolve one cluster: apply a law, with its fallbacks.
#include "resolve_cluster.hpp"

namespace {

// Greater coefficients of friction change no path, but cost it digits.
constexpr double GREATEST_SPRING_FRICTION = 1e12;

// ROUTH_STRONGE. The error bound includes the estimate of the error of the path.
void resolve_by_springs(const Assembly& assembly, const ClusterOptions& options, bool has_friction,
                        ClusterResult& result) {
  PathAnswer answer = follow_springs(assembly, options.springs, has_friction, options.tolerance);
  if (answer.fault) return result.refuse(answer.fault, answer.faulty);
  answer.impulses.error = answer.error * assembly.velocity_size(answer.impulses.normal.data());
  result.apply(assembly, answer.impulses, true);
  result.effect.error_bound = answer.error + answer.rounding;
  double* energies = result.effect.energies;
  energies[LOST_TO_RESTITUTION] += energies[LOST_TO_FRICTION] - answer.friction_loss;
  energies[LOST_TO_FRICTION] = answer.friction_loss;
}

// Whether the error bound of a result is too large because the impulses without friction are not known well enough.
// Fractions know them better.
bool needs_fractions(const Assembly& assembly, const ClusterImpulses& frictionless, const ClusterResult& result) {
  return !(result.effect.error_bound <= USEFUL_BOUND) && assembly.count <= RATIONAL_CONTACTS &&
         !(effect_of(assembly, frictionless, false).error_bound <= USEFUL_BOUND);
}

}  // namespace

ClusterResult resolve_cluster(Cluster& cluster, const ClusterOptions& options, const ClusterImpulses* decided) {
  Assembly& assembly = cluster.assembly;
  ClusterResult result;
  if (cluster.is_out_of_range()) {
    result.code = STATUS_OUT_OF_RANGE;
    return result;
  }
  if (assembly.surely_separates()) {
    ClusterImpulses none;
    none.normal.resize(assembly.count);
    result.apply(assembly, none);
    return result;
  }
  if (!decided && (assembly.is_locked || assembly.approach_is_uncertain())) return result;
  for (AssembledContact& contact : assembly.contacts) {
    if (!(options.restitution_threshold > 0 && contact.e > 0)) continue;
    const std::optional<bool> is_below =
        assembly.approaches_below(contact, options.restitution_threshold, options.has_exact_threshold);
    if (!is_below) return result;
    if (!*is_below) continue;
    contact.e = options.law == LAW_ROUTH_STRONGE ? std::fmin(contact.e, LEAST_SPRING_RESTITUTION) : 0;
    result.below_restitution_threshold = true;
  }
  const bool has_friction = cluster.has_friction && options.law != LAW_FRICTIONLESS;
  if (options.law == LAW_ROUTH_STRONGE) {
    for (AssembledContact& contact : assembly.contacts) contact.mu = std::fmin(contact.mu, GREATEST_SPRING_FRICTION);
    resolve_by_springs(assembly, options, has_friction, result);
    return result;
  }
  const bool are_decided = decided && !decided->normal.empty();
  if (options.law == LAW_MOREAU && !are_decided) {
    const ClusterImpulses impulses = moreau(assembly, has_friction);
    if (impulses.are_found) result.apply(assembly, impulses);
    if (result.code != UNDECIDED && !result.effect.creates_energy) {
      if (!decided && !has_friction && needs_fractions(assembly, impulses, result)) result.code = UNDECIDED;
      return result;
    }
    result.fell_back = true;
  }
  ClusterImpulses impulses = are_decided ? *decided : reflections(assembly, options.threshold);
  if (are_decided && has_friction)
    impulses.stopped = reflections(assembly, options.threshold).stopped;  // few digits are enough for friction
  if (!impulses.are_found && assembly.is_locked) {
    result.refuse("press on each other, and may or may not contradict: too many to decide exactly");
  } else if (!impulses.are_found) {
    result.code = STATUS_CONTRADICTORY_CONTACTS;
  } else if (impulses.error == INFINITY && !decided) {
    result.code = UNDECIDED;
  } else {
    result.apply(assembly, has_friction ? least_work_friction(assembly, impulses, options.tolerance) : impulses);
    if (!decided && needs_fractions(assembly, impulses, result)) result.code = UNDECIDED;
  }
  return result;
}
