// Resolve clusters whose bodies and contacts are columns of tables: see batch/resolve_scenes.py.
#pragma once
#include "cluster.hpp"

// The tables, the options, and the arrays for the results. Each quantity is a row of a table, each body or contact a
// column.
struct TableClusters {
  const TableLayout& table;
  const double *bodies = nullptr, *contacts = nullptr;
  ContactPairs pairs{};
  long count = 0, rows = 0;  // of contacts
  const std::int64_t *order = nullptr, *starts = nullptr;  // contacts by cluster: order[starts[c]:starts[c + 1]]
  ClusterOptions options{};
  double limit = 0;  // the error bound above which the tolerance is not met
  double *velocity = nullptr, *angular_velocity = nullptr, *impulse = nullptr;  // of bodies; impulse: of contacts
  unsigned char *regime = nullptr, *status = nullptr;  // of contacts; status: of clusters
  double *error_bound = nullptr, *margin = nullptr, *energy[4] = {};  // of clusters

  // The current cluster.
  std::vector<int> place{};  // for each body, its place in the cluster, or -1
  std::vector<std::int64_t> used{};  // the bodies of the cluster
  const std::int64_t *first = nullptr, *last = nullptr;  // its contacts

  // Resolve a cluster of several contacts. Its status is UNDECIDED if only Python can resolve it.
  void resolve(long cluster) {
    first = order + starts[cluster];
    last = order + starts[cluster + 1];
    used.clear();
    place.resize(pairs.bodies, -1);
    auto body = [this](std::int64_t b, double* x) {
      for (int i = 0; i < BODY; ++i)
        x[i] = table.body[i] < 0 ? table.body[i] == ALL_ONE : bodies[table.body[i] * pairs.bodies + b];
    };
    auto contact = [this](std::int64_t k, double* x) {
      for (int i = 0; i < CONTACT; ++i)
        x[i] = table.contact[i] < 0 || table.contact[i] >= rows ? 0 : contacts[table.contact[i] * count + k];
    };
    ClusterParts parts = take_parts(pairs, first, last, place, used, body, contact);
    status[cluster] = options.merges_copies() && parts.has_copies() ? UNDECIDED : resolve(cluster, parts);
  }

 private:
  Code resolve(long number, ClusterParts& parts) {
    Cluster cluster(parts, options.law == LAW_FRICTIONLESS);
    if (cluster.fault) return refuse(number, static_cast<Code>(cluster.fault));
    ClusterResult result = resolve_cluster(cluster, options);
    if (result.code == UNDECIDED) return UNDECIDED;
    if (result.code != STATUS_OK) return refuse(number, result.code);
    const ImpulseEffect& effect = result.effect;
    const long n = pairs.bodies;
    for (size_t i = 0; i < used.size(); ++i) {
      const double* after = cluster.movable_place[i] < 0 ? nullptr : &effect.twists[6 * cluster.movable_place[i]];
      for (int k = 0; after && k < table.axes; ++k) velocity[k * n + used[i]] = after[k];
      for (int k = table.first_spin; after && k < 3; ++k)
        angular_velocity[(k - table.first_spin) * n + used[i]] = after[3 + k];
    }
    for (auto k = first; k != last; ++k) {
      size_t i = k - first;
      for (int axis = 0; axis < table.axes; ++axis) impulse[axis * count + *k] = effect.impulses[3 * i + axis];
      regime[*k] = effect.regimes[i];
    }
    error_bound[number] = effect.error_bound;
    margin[number] = result.margin;
    for (int i = 0; i < 4; ++i) energy[i][number] = effect.energies[i];
    return effect.error_bound <= limit ? (effect.is_separating() ? STATUS_SEPARATING : STATUS_OK)
                                       : STATUS_TOLERANCE_NOT_MET;
  }

  // Write that there is no answer: the velocities of movable bodies are unknown.
  Code refuse(long number, Code code) {
    const long n = pairs.bodies;
    for (std::int64_t body : used) {
      if (!(bodies[body] < INFINITY)) continue;
      for (int k = 0; k < table.axes; ++k) velocity[k * n + body] = NAN;
      for (int k = table.first_spin; k < 3; ++k) angular_velocity[(k - table.first_spin) * n + body] = NAN;
    }
    for (auto k = first; k != last; ++k) {
      for (int axis = 0; axis < table.axes; ++axis) impulse[axis * count + *k] = NAN;
      regime[*k] = 0;
    }
    error_bound[number] = margin[number] = NAN;
    for (double* one : energy) one[number] = NAN;
    return code;
  }
};
