// Resolve one cluster of several contacts in doubles and double-double.
#pragma once
#include "cluster.hpp"
#include "effect.hpp"
#include "laws.hpp"

using Code = unsigned char;  // a StatusCode, or UNDECIDED
constexpr Code UNDECIDED = STATUS_UNSET;  // fractions may know more: see scene/in_fractions.py

// The law and its settings.
struct ClusterOptions {
  int law;
  double threshold, restitution_threshold, tangential_restitution;
  double tolerance;  // greatest error bound wanted, with friction; 0 for the default
  bool has_exact_threshold;  // whether restitution_threshold is not rounded
  SpringOptions springs{};

  // Whether the law resolves several contacts at once. If not, Python raises the error.
  bool is_for_clusters() const {
    return law < LAW_COUNT && is_cluster_law[law] && (tangential_restitution == 0 || law != LAW_COULOMB);
  }
  // Whether copies of a contact count as one contact.
  bool merges_copies() const { return law != LAW_ROUTH_STRONGE; }
};

struct ClusterResult {
  Code code = UNDECIDED;
  ImpulseEffect effect{};
  double margin = INFINITY, restitution = -1;  // as in ClusterImpulses
  bool below_restitution_threshold = false, fell_back = false, no_rebound = false;
  const char* fault = "";  // for PATH_TOO_LONG and INVALID_COEFFICIENT: why
  int faulty = -1;  // the contact that it is about; -1: all

  // Compute what impulses do, and whether that is an answer.
  void apply(const Assembly& assembly, const ClusterImpulses& impulses, bool sticks_by_slip = false) {
    effect = effect_of(assembly, impulses, sticks_by_slip);
    code = !effect.is_representable() ? STATUS_OUT_OF_RANGE : effect.is_unphysical ? STATUS_INTERNAL_ERROR : STATUS_OK;
    margin = impulses.margin;
    restitution = impulses.restitution;
    no_rebound = impulses.no_rebound;
  }
  void refuse(const char* why, int contact = -1) {
    code = contact < 0 ? STATUS_PATH_TOO_LONG : STATUS_INVALID_COEFFICIENT;
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

// Apply a law, with its fallbacks. If no contact approaches, there is no impulse by any law. Otherwise:
//
// * Contacts that press on each other without end, such as a ball between two walls, are locked: no velocity separates
//   all of them. Fractions decide what happens. If the cluster is too large for them, it does not rebound, and its
//   error has no bound.
// * Double-double may be too coarse to tell whether a contact approaches, or reaches the threshold of reflections; or, even
//   without friction, the error bound may be too large to be useful. Fractions help there too, if the cluster is small.
// * Doubles may be too coarse to tell whether an approach is slower than the restitution threshold. Fractions decide that.
// * MOREAU may have no solution, or one that creates energy. Then COULOMB answers, or FRICTIONLESS if there is no
//   friction.
//
// `decided`: what fractions have found, if they were asked: the impulses without friction, or none if they cannot tell.
// They are not asked again, so the answer may have an infinite bound.
ClusterResult resolve_cluster(Cluster& cluster, const ClusterOptions& options,
                              const ClusterImpulses* decided = nullptr);
