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

// The bodies and contacts of a cluster as numbers. Contacts name bodies by their places in `bodies`.
struct ClusterParts {
  struct Contact {
    int body[2];
    double x[CONTACT], copies;
  };
  std::vector<std::array<double, BODY>> bodies;
  std::vector<Contact> contacts;
  std::vector<std::int64_t> indices{};  // of the bodies in the scene

  // Whether a contact is given twice, in whichever order it names its bodies.
  bool has_copies() const {
    for (const Contact& one : contacts)
      for (const Contact* other = contacts.data(); other != &one; ++other)
        if (one.x[0] == other->x[0] && is_copy(one, *other)) return true;
    return false;
  }

 private:
  static bool is_copy(const Contact& one, Contact other) {
    if (one.body[0] == other.body[1]) {
      std::swap(other.body[0], other.body[1]);
      for (int k = 0; k < 3; ++k) other.x[CONTACT_NORMAL_X + k] *= -1;
    }
    return std::equal(one.body, one.body + 2, other.body) && std::equal(one.x, one.x + CONTACT, other.x);
  }
};

// Return the parts of the cluster of the contacts [first, last) of a scene. Bodies are numbered in the order in which
// contacts name them. scene.copy_body(b, x) and scene.copy_contact(k, x) copy the numbers of a body and of a contact
// to x. `place` must be -1 for all bodies, and is -1 again afterwards.
template <class Scene>
ClusterParts take_parts(const Scene& scene, const ContactPairs& pairs, const std::int64_t* first,
                        const std::int64_t* last, std::vector<int>& place) {
  ClusterParts parts;
  auto place_of = [&](std::int64_t b) {
    if (place[b] < 0) {
      place[b] = static_cast<int>(parts.indices.size());
      parts.indices.push_back(b);
      scene.copy_body(b, parts.bodies.emplace_back().data());
    }
    return place[b];
  };
  parts.contacts.reserve(last - first);
  for (auto k = first; k != last; ++k) {
    parts.contacts.push_back({{place_of(pairs.a[*k]), place_of(pairs.b[*k])}, {}, 1});
    scene.copy_contact(*k, parts.contacts.back().x);
  }
  for (std::int64_t b : parts.indices) place[b] = -1;
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
    std::vector<AssembledBody> bodies(parts.bodies.size());
    for (size_t i = 0; i < bodies.size(); ++i) {
      AssembledBody& body = bodies[i];
      std::copy(parts.bodies[i].begin(), parts.bodies[i].end(), body.x);
      if (!body.rests()) body.prepare();
      if (body.is_movable()) {
        body.place = assembly.body_count++;
        energy += body.centre_in_doubles.energy;
        has_massless_spin = has_massless_spin || body.centre_in_doubles.has_massless_spin;
        assembly.bodies.push_back(body);
      }
      movable_place.push_back(body.place);
    }
    assembly.contacts.reserve(parts.contacts.size());
    for (ClusterParts::Contact contact : parts.contacts) {
      const AssembledBody &a = bodies[contact.body[0]], &b = bodies[contact.body[1]];
      double& mu = contact.x[CONTACT_FRICTION];
      // An invalid coefficient stays invalid.
      if (frictionless && mu < INFINITY) mu = std::fmin(mu, 0);
      double in[INPUTS] = {}, found;
      bool flags[VALIDITY_FLAGS];
      std::copy(a.x, a.x + BODY, in);
      std::copy(b.x, b.x + BODY, in + BODY);
      std::copy(contact.x, contact.x + CONTACT, in + IN_CONTACT);
      validity<double>(in, nullptr, &found, flags);
      fault = static_cast<int>(found);
      if (fault) return;
      has_off_unit_orientation = has_off_unit_orientation || flags[VALIDITY_IS_OFF_UNIT];
      has_friction = has_friction || mu > 0;
      assembly.add(a, b, contact.x, contact.copies);
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

struct ClusterResult {
  Code code = UNDECIDED;
  ImpulseEffect effect{};
  double margin = INFINITY, restitution = -1;  // as in ClusterImpulses
  bool below_restitution_threshold = false, fell_back = false, no_rebound = false;
  const char* fault = "";  // for PATH_TOO_LONG: why
  int faulty = -1;  // the contact that it is about; -1: all

  // Compute what impulses do, and whether that is an answer.
  void apply(const Assembly& assembly, const ClusterImpulses& impulses, bool sticks_by_slip = false) {
    effect = effect_of(assembly, impulses, sticks_by_slip);
    code = !effect.is_representable() ? STATUS_OUT_OF_RANGE : effect.is_unphysical ? STATUS_INTERNAL_ERROR : STATUS_OK;
    margin = impulses.margin;
    restitution = impulses.restitution;
    no_rebound = impulses.no_rebound;
  }
  void refuse_path(const char* why, int contact = -1) {
    code = STATUS_PATH_TOO_LONG;
    fault = why;
    faulty = contact;
  }
};

inline int adjustments_of(const Cluster& cluster, const ClusterResult& result) {
  return cluster.has_off_unit_orientation * ADJUSTMENT_NORMALISED_ORIENTATION +
         result.below_restitution_threshold * ADJUSTMENT_RESTITUTION_THRESHOLD +
         result.fell_back * ADJUSTMENT_LAW_FALLBACK + result.no_rebound * ADJUSTMENT_NO_REBOUND +
         cluster.has_massless_spin * ADJUSTMENT_MASSLESS_SPIN;
}

// ROUTH_STRONGE. The error bound includes the estimate of the error of the path.
inline void resolve_by_springs(const Assembly& assembly, const ClusterOptions& options, bool has_friction,
                               ClusterResult& result) {
  const std::vector<AssembledContact>& contacts = assembly.contacts;
  auto separates = [](const AssembledContact& contact) { return contact.axes[0].velocity >= 0; };
  auto is_less_elastic = [](const AssembledContact& a, const AssembledContact& b) { return a.e < b.e; };
  if (std::all_of(contacts.begin(), contacts.end(), separates))
    return result.apply(assembly, {true, std::vector<DD>(assembly.count)}, true);
  const auto least = std::min_element(contacts.begin(), contacts.end(), is_less_elastic);
  if (least->e < LEAST_SPRING_RESTITUTION)
    return result.refuse_path(TOO_INELASTIC, static_cast<int>(least - contacts.begin()));
  auto follow = has_friction ? follow_springs<PathWithFriction> : follow_springs<PathWithoutFriction>;
  PathAnswer answer = follow(assembly, options.springs, options.tolerance);
  if (answer.fault) return result.refuse_path(answer.fault);
  answer.impulses.error = answer.error * assembly.velocity_size(answer.impulses.normal.data());
  result.apply(assembly, answer.impulses, true);
  result.effect.error_bound = answer.error + answer.rounding;
  double* energies = result.effect.energies;
  energies[LOST_TO_RESTITUTION] += energies[LOST_TO_FRICTION] - answer.friction_loss;
  energies[LOST_TO_FRICTION] = answer.friction_loss;
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
//
// `decided`: what fractions have found, if they were asked: the impulses without friction, or none if they cannot tell.
// They are not asked again, so the answer may have an infinite bound.
inline ClusterResult resolve_cluster(Cluster& cluster, const ClusterOptions& options,
                                     const ClusterImpulses* decided = nullptr) {
  Assembly& assembly = cluster.assembly;
  ClusterResult result;
  if (cluster.is_out_of_range()) {
    result.code = STATUS_OUT_OF_RANGE;
    return result;
  }
  if (!decided && (assembly.is_locked || assembly.approach_is_uncertain())) return result;
  for (AssembledContact& contact : assembly.contacts) {
    const double speed = -contact.axes[0].velocity;
    if (!(speed > 0 && speed < options.restitution_threshold && contact.e > 0)) continue;
    contact.e = 0;
    result.below_restitution_threshold = true;
  }
  const bool has_friction = cluster.has_friction && options.law != LAW_FRICTIONLESS;
  if (options.law == LAW_ROUTH_STRONGE) {
    resolve_by_springs(assembly, options, has_friction, result);
    return result;
  }
  const bool are_decided = decided && !decided->normal.empty();
  if (options.law == LAW_MOREAU && !are_decided) {
    const ClusterImpulses impulses = moreau(assembly, has_friction);
    if (impulses.are_found) result.apply(assembly, impulses);
    if (result.code != UNDECIDED && !result.effect.creates_energy) return result;
    result.fell_back = true;
  }
  ClusterImpulses impulses = are_decided ? *decided : reflections(assembly, options.threshold);
  if (!impulses.are_found && assembly.is_locked) {
    result.refuse_path("press on each other, and may or may not contradict: too many to decide exactly");
  } else if (!impulses.are_found) {
    result.code = STATUS_CONTRADICTORY_CONTACTS;
  } else if (impulses.error == INFINITY && !decided) {
    result.code = UNDECIDED;
  } else {
    if (has_friction) impulses = least_work_friction(assembly, impulses, options.tolerance);
    result.apply(assembly, impulses);
  }
  return result;
}
