// TableClusters clusters from tables.
#pragma once
#include "cluster.hpp"

// What is options, as in resolve_scenes.py, and where the answers go. A quantity of bodies or contacts is a row. One cluster
// is answered after the other.
struct TableClusters {
  const TableLayout& table;
  const double *bodies, *contacts;
  ContactPairs pairs;
  long count, rows;  // of contacts
  const std::int64_t *order, *starts;
  ClusterOptions options;
  double limit;
  double *velocity, *spin, *impulse;  // of bodies, and of contacts
  unsigned char *regime, *status;     // of contacts, and of clusters
  double *bound, *margin, *energy[4];

  // Of the cluster that is answered.
  std::vector<int> place{};          // of each body, -1: not of it
  std::vector<std::int64_t> used{};  // its bodies
  const std::int64_t *first = nullptr, *last = nullptr;

  // Of several contacts without copies.
  void answer(long cluster) {
    first = order + starts[cluster];
    last = order + starts[cluster + 1];
    used.clear();
    place.resize(pairs.bodies, -1);
    auto body = [this](std::int64_t b, double* x) {
      for (int i = 0; i < BODY; ++i) x[i] = table.body[i] < 0 ? table.body[i] == -2 : bodies[table.body[i] * pairs.bodies + b];
    };
    auto contact = [this](std::int64_t k, double* x) {
      for (int i = 0; i < 8; ++i) x[i] = table.contact[i] < 0 || table.contact[i] >= rows ? 0 : contacts[table.contact[i] * count + k];
    };
    ClusterParts parts = take_parts(pairs, first, last, place, used, body, contact);
    status[cluster] = parts.has_copies() ? LEFT_TO_PYTHON : answer(cluster, parts);
  }

 private:
  Code answer(long number, ClusterParts& parts) {
    Cluster cluster(parts, options.law == LAW_FRICTIONLESS);
    if (cluster.fault) return refused(number, static_cast<Code>(cluster.fault));
    ClusterResult result = resolve_cluster(cluster, options);
    if (result.code == LEFT_TO_PYTHON) return LEFT_TO_PYTHON;
    if (result.code != STATUS_OK) return refused(number, result.code);
    const ImpulseEffect& effect = result.effect;
    const long n = pairs.bodies;
    for (size_t i = 0; i < used.size(); ++i) {
      const double* after = cluster.movable_place[i] < 0 ? nullptr : &effect.twists[6 * cluster.movable_place[i]];
      for (int k = 0; after && k < table.axes; ++k) velocity[k * n + used[i]] = after[k];
      for (int k = table.first_spin; after && k < 3; ++k) spin[(k - table.first_spin) * n + used[i]] = after[3 + k];
    }
    for (auto k = first; k != last; ++k) {
      size_t i = k - first;
      for (int axis = 0; axis < table.axes; ++axis) impulse[axis * count + *k] = effect.impulses[3 * i + axis];
      regime[*k] = effect.regimes[i];
    }
    bound[number] = effect.error_bound;
    margin[number] = result.margin;
    for (int i = 0; i < 4; ++i) energy[i][number] = effect.energies[i];
    return effect.error_bound <= limit ? (effect.is_separating() ? STATUS_SEPARATING : STATUS_OK) : STATUS_TOLERANCE_NOT_MET;
  }

  // The answer that there is none. The bodies that could move have no velocity that is known.
  Code refused(long number, Code code) {
    const long n = pairs.bodies;
    for (std::int64_t body : used) {
      if (!(bodies[body] < INFINITY)) continue;
      for (int k = 0; k < table.axes; ++k) velocity[k * n + body] = NAN;
      for (int k = table.first_spin; k < 3; ++k) spin[(k - table.first_spin) * n + body] = NAN;
    }
    for (auto k = first; k != last; ++k) {
      for (int axis = 0; axis < table.axes; ++axis) impulse[axis * count + *k] = NAN;
      regime[*k] = 0;
    }
    bound[number] = margin[number] = NAN;
    for (double* one : energy) one[number] = NAN;
    return code;
  }
};
