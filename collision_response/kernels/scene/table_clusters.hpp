// Resolve clusters whose bodies and contacts are columns of tables: see batch/resolve_scenes.py.
#pragma once
#include "../arrays.hpp"
#include "resolve_cluster.hpp"

// The tables, and the arrays for the results. Each quantity is a row of a table, each body or contact a column.
struct TableClusters {
  // The fields of a ScenesResult.
  enum {
    VELOCITY,
    SPIN,
    IMPULSE,
    REGIME,
    CLUSTER,
    STATUS,
    ERROR_BOUND,
    MARGIN,
    ENERGY,
    ADJUSTMENTS = ENERGY + 4,
    RESULTS
  };

  const TableLayout& table;
  ClusterOptions options;
  double limit;  // the error bound above which the tolerance is not met
  Array bodies{}, pairs{}, contacts{};
  Array order{}, starts{};  // contacts by cluster: order[starts[c]:starts[c + 1]]
  Array results[RESULTS]{};
  List<int> place{};  // for take_parts()

  // Return whether all are arrays. `tables`: bodies, pairs, contacts, order, starts.
  bool open(PyObject* const* tables, PyObject* fields) {
    if (PyTuple_GET_SIZE(fields) != RESULTS) return false;
    for (int i = 0; i < RESULTS; ++i)
      if (i != CLUSTER && !results[i].open(PyTuple_GET_ITEM(fields, i), true)) return false;
    return open_arrays(tables, {&bodies, &pairs, &contacts, &order, &starts});
  }

  // Resolve a cluster of several contacts, whose numbers in the results are NaN so far. Its status is UNDECIDED if only
  // Python can resolve it. Without an answer, the velocities of its movable bodies are unknown.
  void resolve(std::int64_t number) {
    const std::int64_t* bounds = starts.at<std::int64_t>(number);
    const std::int64_t *first = order.at<std::int64_t>(bounds[0]), *last = order.at<std::int64_t>(bounds[1]);
    const std::int64_t *a = pairs.at<std::int64_t>(), *b = a + contacts.view.shape[1],
                       all_bodies = bodies.view.shape[1];
    Code& status = *results[STATUS].at<Code>(number);
    status = UNDECIDED;
    place.resize(all_bodies, -1);
    const ClusterParts parts = take_parts(*this, {a, b, all_bodies}, first, last, place);
    const bool frictionless = options.law == LAW_FRICTIONLESS;
    if (options.merges_copies() && parts.has_copies(frictionless)) return;
    Cluster cluster(parts, frictionless);
    const ClusterResult result = cluster.fault ? ClusterResult{static_cast<Code>(cluster.fault)}
                                               : resolve_cluster(cluster, options);
    status = result.code;
    if (status == UNDECIDED) return;
    const ImpulseEffect& effect = result.effect;
    constexpr double UNKNOWN[6] = {NAN, NAN, NAN, NAN, NAN, NAN};
    for (size_t i = 0; i < parts.indices.size(); ++i) {
      const int movable = cluster.movable_place[i];
      if (movable < 0) continue;
      const double* twist = status == STATUS_OK ? &effect.twists[6 * movable] : UNKNOWN;
      for (int k = 0; k < table.axes; ++k) at(VELOCITY, parts.indices[i], k) = twist[k];
      for (int k = table.first_spin; k < 3; ++k) at(SPIN, parts.indices[i], k - table.first_spin) = twist[3 + k];
    }
    if (status != STATUS_OK) return;
    for (auto k = first; k != last; ++k) {
      for (int axis = 0; axis < table.axes; ++axis) at(IMPULSE, *k, axis) = effect.impulses[3 * (k - first) + axis];
      *results[REGIME].at<Regime>(*k) = effect.regimes[k - first];
    }
    at(ERROR_BOUND, number) = effect.error_bound;
    at(MARGIN, number) = result.margin;
    for (int i = 0; i < 4; ++i) at(ENERGY + i, number) = effect.energies[i];
    *results[ADJUSTMENTS].at<Code>(number) = adjustments_of(cluster, result) & ~ADJUSTMENT_NORMALISED_ORIENTATION;
    if (!(effect.error_bound <= limit)) status = STATUS_TOLERANCE_NOT_MET;
    else if (effect.is_separating()) status = STATUS_SEPARATING;
  }

  void copy_body(std::int64_t b, double* x) const {
    for (int i = 0; i < BODY; ++i)
      x[i] = table.body[i] < 0 ? table.body[i] == ALL_ONE : bodies.row<double>(table.body[i])[b];
  }
  void copy_contact(std::int64_t k, double* x) const {
    for (int i = 0; i < CONTACT; ++i)
      x[i] = table.contact[i] < 0 || table.contact[i] >= contacts.view.shape[0]
                 ? 0
                 : contacts.row<double>(table.contact[i])[k];
  }

 private:
  double& at(int result, std::int64_t column, int row = 0) const { return results[result].row<double>(row)[column]; }
};
