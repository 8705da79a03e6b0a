// Resolve one cluster of several contacts in doubles and double-double.
#pragma once
#include <array>

#include "../contact_pairs.hpp"
#include "coulomb.hpp"
#include "moreau.hpp"
#include "reflections.hpp"
#include "stronge.hpp"
#include "validity_everything.hpp"

using Code = unsigned char;  // a StatusCode, or UNDECIDED
constexpr Code UNDECIDED = STATUS_UNSET;  // fractions may know more: see scene/in_fractions.py

// The bodies and contacts of a cluster as numbers. Contacts name bodies by their indices in `bodies`.
struct ClusterParts {
  struct Contact {
    int body[2];
    double x[CONTACT], copies;
  };
  std::vector<std::array<double, BODY>> bodies;
  std::vector<Contact> contacts;

  // Whether a contact is given twice, in whichever order it names its bodies.
  bool has_copies() const {
    for (const Contact& one : contacts)
      for (const Contact* other = contacts.data(); other != &one; ++other)
        if (one.x[0] == other->x[0] && is_copy(one, *other)) return true;
    return false;
  }

 private:
  static bool is_copy(const Contact& one, const Contact& other) {
    bool turned = one.body[0] == other.body[1] && one.body[1] == other.body[0];
    if (!turned && !(one.body[0] == other.body[0] && one.body[1] == other.body[1])) return false;
    for (int k = 0; k < CONTACT; ++k) {
      bool is_of_normal = k >= CONTACT_NORMAL_X && k <= CONTACT_NORMAL_Z;
      if (one.x[k] != (turned && is_of_normal ? -other.x[k] : other.x[k])) return false;
    }
    return true;
  }
};

// Return the parts of a cluster from the list of its contacts. Bodies are numbered in the order in which contacts name
// them, and are listed in `used`. `place` must be -1 for all bodies, and is -1 again afterwards. body(b, x) and
// contact(k, x) write the numbers of a body and of a contact to x.
template <class Body, class Contact>
ClusterParts take_parts(const ContactPairs& pairs, const std::int64_t* first, const std::int64_t* last,
                        std::vector<int>& place, std::vector<std::int64_t>& used, Body body, Contact contact) {
  ClusterParts parts;
  auto place_of = [&](std::int64_t b) {
    if (place[b] < 0) {
      place[b] = static_cast<int>(used.size());
      used.push_back(b);
      body(b, parts.bodies.emplace_back().data());
    }
    return place[b];
  };
  parts.contacts.reserve(last - first);
  for (auto k = first; k != last; ++k) {
    parts.contacts.push_back({{place_of(pairs.a[*k]), place_of(pairs.b[*k])}, {}, 1});
    contact(*k, parts.contacts.back().x);
  }
  for (std::int64_t b : used) place[b] = -1;
  return parts;
}

struct Cluster {
  Assembly assembly;
  std::vector<int> movable_place;  // for each body, its place among the movable ones, or -1
  double energy = 0;  // kinetic energy of the movable bodies
  bool has_massless_spin = false, has_off_unit_orientation = false, has_friction = false;
  int fault = 0;  // status of the first invalid contact, or 0

  // Whether some numbers are out of the range of doubles, so that doubles cannot give an answer.
  bool is_out_of_range() const {
    return !(std::isfinite(energy) && assembly.is_finite() && assembly.has_representable_impulses());
  }

  Cluster(const ClusterParts& parts, bool frictionless) {
    std::vector<AssembledBody> given(parts.bodies.size());
    for (size_t i = 0; i < given.size(); ++i) {
      std::copy(parts.bodies[i].begin(), parts.bodies[i].end(), given[i].x);
      if (!given[i].rests()) given[i].prepare();
      movable_place.push_back(given[i].is_movable() ? assembly.body_count++ : -1);
      if (movable_place[i] < 0) {
        assembly.has_moving_wall = assembly.has_moving_wall || given[i].moves();
        continue;
      }
      energy += given[i].centre_in_doubles.energy;
      has_massless_spin = has_massless_spin || given[i].centre_in_doubles.has_massless_spin;
      assembly.bodies.push_back(given[i]);
    }
    assembly.contacts.reserve(parts.contacts.size());
    for (ClusterParts::Contact contact : parts.contacts) {
      const auto [a, b] = contact.body;
      double& mu = contact.x[CONTACT_FRICTION];
      // An invalid coefficient stays invalid.
      if (frictionless && mu < INFINITY) mu = std::fmin(mu, 0);
      double in[INPUTS] = {}, found;
      bool flags[VALIDITY_FLAGS];
      std::copy(given[a].x, given[a].x + BODY, in);
      std::copy(given[b].x, given[b].x + BODY, in + BODY);
      std::copy(contact.x, contact.x + CONTACT, in + IN_CONTACT);
      validity<double>(in, nullptr, &found, flags);
      fault = static_cast<int>(found);
      if (fault) return;
      has_off_unit_orientation = has_off_unit_orientation || flags[VALIDITY_IS_OFF_UNIT];
      has_friction = has_friction || mu > 0;
      assembly.add(given[a], given[b], movable_place[a], movable_place[b], contact.x, contact.copies);
    }
    assembly.finish();
  }
};

// The law and its settings.
struct ClusterOptions {
  int law;
  double threshold, restitution_threshold, tangential_restitution;
  double tolerance;  // greatest error bound wanted, with friction; 0 for the default
  SpringOptions springs{};

  // Whether the law resolves several contacts at once. If not, Python raises the error.
  bool is_for_clusters() const { return law < LAW_COUNT && is_cluster_law[law] && tangential_restitution == 0; }
  // Whether copies of a contact count as one contact.
  bool merges_copies() const { return law != LAW_ROUTH_STRONGE; }
};

// What fractions have decided about a cluster.
struct Decided {
  bool is_final = false;  // they were asked, and are not asked again: the answer may have an infinite bound
  const ClusterImpulses* normal = nullptr;  // the impulses without friction, if they found them
};

struct ClusterResult {
  Code code;
  ImpulseEffect effect;
  double margin = INFINITY, restitution = -1;  // as in ClusterImpulses
  bool below_restitution_threshold = false, fell_back = false, no_rebound = false;
  const char* fault = "";  // for PATH_TOO_LONG: why
  int faulty = -1;  // the contact that it is about; -1: all
};

inline int adjustments_of(const Cluster& cluster, const ClusterResult& result) {
  return cluster.has_off_unit_orientation * ADJUSTMENT_NORMALISED_ORIENTATION +
         result.below_restitution_threshold * ADJUSTMENT_RESTITUTION_THRESHOLD +
         result.fell_back * ADJUSTMENT_LAW_FALLBACK + result.no_rebound * ADJUSTMENT_NO_REBOUND +
         cluster.has_massless_spin * ADJUSTMENT_MASSLESS_SPIN;
}

// Compute what impulses do, and whether that is an answer.
inline void apply(const Assembly& assembly, const ClusterImpulses& impulses, bool sticks_by_slip,
                  ClusterResult& result) {
  result.effect = effect_of(assembly, impulses, sticks_by_slip);
  result.code = !result.effect.is_representable() ? STATUS_OUT_OF_RANGE
                : result.effect.is_unphysical     ? STATUS_INTERNAL_ERROR
                                                  : STATUS_OK;
  result.margin = impulses.margin;
  result.restitution = impulses.restitution;
  result.no_rebound = impulses.no_rebound;
}

inline void refuse_path(const char* fault, ClusterResult& result) {
  result.code = STATUS_PATH_TOO_LONG;
  result.fault = fault;
}

// ROUTH_STRONGE. The error bound includes the estimate of the error of the path.
inline void resolve_by_springs(const Assembly& assembly, const ClusterOptions& options, bool has_friction,
                               ClusterResult& result) {
  const std::vector<AssembledContact>& contacts = assembly.contacts;
  auto separates = [](const AssembledContact& contact) { return contact.axes[0].velocity >= 0; };
  auto is_less_elastic = [](const AssembledContact& a, const AssembledContact& b) { return a.e < b.e; };
  if (std::all_of(contacts.begin(), contacts.end(), separates))
    return apply(assembly, {true, std::vector<DD>(assembly.count)}, true, result);
  const auto least = std::min_element(contacts.begin(), contacts.end(), is_less_elastic);
  if (least->e < LEAST_SPRING_RESTITUTION) {
    result.faulty = static_cast<int>(least - contacts.begin());
    return refuse_path(TOO_INELASTIC, result);
  }
  auto follow = has_friction ? follow_springs<PathWithFriction> : follow_springs<PathWithoutFriction>;
  PathAnswer answer = follow(assembly, options.springs, options.tolerance);
  if (answer.fault) return refuse_path(answer.fault, result);
  answer.impulses.error = answer.error * assembly.velocity_size(answer.impulses.normal.data());
  apply(assembly, answer.impulses, true, result);
  result.effect.error_bound = answer.error + answer.rounding;
  double* energies = result.effect.energies;
  energies[2] += energies[3] - answer.friction_loss;
  energies[3] = answer.friction_loss;
}

// Apply a law, with its fallbacks:
//
// * Contacts that press on each other without end, such as a ball between two walls, are locked: no velocity separates
//   all of them. Fractions decide what happens. If the cluster is too large for them, it does not rebound, and its
//   error has no bound.
// * Double-double may be too coarse to tell whether a contact approaches, or reaches the threshold of reflections.
//   Fractions decide that too.
// * MOREAU may have no solution, or one that creates energy. Then COULOMB answers, or FRICTIONLESS if there is no
//   friction.
inline ClusterResult resolve_cluster(Cluster& cluster, const ClusterOptions& options, const Decided& decided = {}) {
  Assembly& assembly = cluster.assembly;
  ClusterResult result{UNDECIDED, {}};
  if (cluster.is_out_of_range()) {
    result.code = STATUS_OUT_OF_RANGE;
    return result;
  }
  if (!decided.is_final && (assembly.is_locked || assembly.approach_is_uncertain())) return result;
  for (AssembledContact& contact : assembly.contacts) {
    double speed = -contact.axes[0].velocity;
    bool is_slow = speed > 0 && speed < options.restitution_threshold && contact.e > 0;
    if (is_slow) contact.e = 0;
    result.below_restitution_threshold = result.below_restitution_threshold || is_slow;
  }
  const bool has_friction = cluster.has_friction && options.law != LAW_FRICTIONLESS;
  if (options.law == LAW_ROUTH_STRONGE) {
    resolve_by_springs(assembly, options, has_friction, result);
    return result;
  }
  if (options.law == LAW_MOREAU && !decided.normal) {
    const ClusterImpulses impulses = moreau(assembly, has_friction);
    if (impulses.are_found) apply(assembly, impulses, false, result);
    if (result.code != UNDECIDED && !result.effect.creates_energy) return result;
    result.fell_back = true;
  }
  ClusterImpulses impulses = decided.normal ? *decided.normal : reflections(assembly, options.threshold);
  if (!impulses.are_found && assembly.is_locked) {
    refuse_path("press on each other, and may or may not contradict: too many to decide exactly", result);
  } else if (!impulses.are_found) {
    result.code = STATUS_CONTRADICTORY_CONTACTS;
  } else if (impulses.error == INFINITY && !decided.is_final) {
    result.code = UNDECIDED;
  } else {
    if (has_friction) impulses = least_work_friction(assembly, impulses, options.tolerance);
    apply(assembly, impulses, false, result);
  }
  return result;
}
