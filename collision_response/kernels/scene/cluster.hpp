// Resolve one cluster of several contacts as scene/resolve_cluster.py does, if doubles and double-double suffice.
#pragma once
#include <array>

#include "../contact_pairs.hpp"
#include "effect.hpp"
#include "reflections.hpp"
#include "validity_everything.hpp"

using Code = unsigned char;  // a StatusCode, or LEFT_TO_PYTHON
constexpr Code LEFT_TO_PYTHON = 0;

// The bodies and contacts of a cluster as numbers. Contacts name bodies by their indices in `bodies`.
struct ClusterParts {
  struct Contact {
    int body[2];
    double x[8], copies;
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
    for (int k = 0; k < 8; ++k)
      if (one.x[k] != (turned && k >= 3 && k < 6 ? -other.x[k] : other.x[k])) return false;
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
      auto [a, b] = contact.body;
      // An invalid coefficient stays invalid.
      if (frictionless && contact.x[7] < INFINITY) contact.x[7] = std::fmin(contact.x[7], 0);
      double in[INPUTS] = {}, found;
      bool flags[VALIDITY_FLAGS];
      std::copy(given[a].x, given[a].x + BODY, in);
      std::copy(given[b].x, given[b].x + BODY, in + BODY);
      std::copy(contact.x, contact.x + 8, in + IN_CONTACT_POSITION_X);
      validity<double>(in, nullptr, &found, flags);
      fault = static_cast<int>(found);
      if (fault) return;
      has_off_unit_orientation = has_off_unit_orientation || flags[VALIDITY_IS_OFF_UNIT];
      has_friction = has_friction || contact.x[7] > 0;
      assembly.add(given[a], given[b], movable_place[a], movable_place[b], contact.x, contact.copies);
    }
    assembly.finish();
  }
};

// The law and its settings.
struct ClusterOptions {
  int law;
  double threshold, restitution_threshold, tangential_restitution;

  // Whether clusters of several contacts are resolved here. If not, they are left to Python.
  bool is_compiled() const {
    return (law == LAW_FRICTIONLESS || law == LAW_COULOMB || law == LAW_MOREAU) && tangential_restitution == 0;
  }
};

struct ClusterResult {
  Code code;
  ImpulseEffect effect;
  double margin = INFINITY, restitution = -1;  // as in ClusterImpulses
  bool below_restitution_threshold = false, fell_back = false, no_rebound = false;
};

inline int adjustments_of(const Cluster& cluster, const ClusterResult& result) {
  return cluster.has_off_unit_orientation * ADJUSTMENT_NORMALISED_ORIENTATION +
         result.below_restitution_threshold * ADJUSTMENT_RESTITUTION_THRESHOLD +
         result.fell_back * ADJUSTMENT_LAW_FALLBACK + result.no_rebound * ADJUSTMENT_NO_REBOUND +
         cluster.has_massless_spin * ADJUSTMENT_MASSLESS_SPIN;
}

// MOREAU: see scene/moreau.py. Without friction, in double-double.
inline ClusterImpulses moreau(const Assembly& assembly, bool has_friction) {
  if (has_friction) return moreau_with_friction(assembly);
  auto separates = [](const AssembledContact& contact) { return high(contact.velocity) >= 0; };
  if (std::all_of(assembly.contacts.begin(), assembly.contacts.end(), separates))
    return {true, std::vector<DD>(assembly.count)};
  Projection found = project_to_rebound(assembly);
  return {found.status == MinimumStatus::FOUND, found.q, found.error};
}

// Apply a law, with its fallbacks, as in scene/apply_law.py. The code is LEFT_TO_PYTHON if only fractions can decide.
inline ClusterResult resolve_cluster(Cluster& cluster, const ClusterOptions& options) {
  Assembly& assembly = cluster.assembly;
  ClusterResult result{LEFT_TO_PYTHON, {}};
  if (cluster.is_out_of_range()) {
    result.code = STATUS_OUT_OF_RANGE;
    return result;
  }
  if (assembly.is_locked || assembly.approach_is_uncertain()) return result;
  for (AssembledContact& contact : assembly.contacts) {
    double speed = -contact.axes[0].velocity;
    bool is_slow = speed > 0 && speed < options.restitution_threshold && contact.e > 0;
    if (is_slow) contact.e = 0;
    result.below_restitution_threshold = result.below_restitution_threshold || is_slow;
  }
  ClusterImpulses impulses;
  auto finish = [&] {
    result.effect = effect_of(assembly, impulses, false);
    result.code = !result.effect.is_finite()    ? STATUS_OUT_OF_RANGE
                  : result.effect.is_unphysical ? STATUS_INTERNAL_ERROR
                                                : STATUS_OK;
    result.margin = impulses.margin;
    result.restitution = impulses.restitution;
    result.no_rebound = impulses.no_rebound;
  };
  if (options.law == LAW_MOREAU) {
    impulses = moreau(assembly, cluster.has_friction);
    if (impulses.are_found) finish();
    if (result.code != LEFT_TO_PYTHON && !result.effect.creates_energy) return result;
    result.fell_back = true;
  }
  impulses = Reflections{assembly}.resolve(options.threshold);
  const bool is_undecided = impulses.error == INFINITY;
  if (cluster.has_friction && impulses.are_found) impulses = least_work_friction(assembly, impulses);
  if (!impulses.are_found) result.code = STATUS_CONTRADICTORY_CONTACTS;
  else if (is_undecided) result.code = LEFT_TO_PYTHON;
  else finish();
  return result;
}
