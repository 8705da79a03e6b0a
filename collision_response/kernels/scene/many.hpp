// Many clusters from tables.
#pragma once
#include "cluster.hpp"

// What is asked, as in resolve_scenes.py, and where the answers go. A quantity of bodies or contacts is a row.
struct Many {
  const Table& table;
  const double *bodies, *contacts;
  Pairs pairs;
  long count, rows;  // of contacts
  const std::int64_t *order, *starts;
  Asked asked;
  double limit;
  double *velocity, *spin, *impulse;  // of bodies, and of contacts
  unsigned char *regime, *status;     // of contacts, and of clusters
  double *bound, *margin, *energy[4];
};

// Answers clusters, one after the other.
class ManyClusters {
 public:
  explicit ManyClusters(const Many& asked) : many(asked), place(asked.pairs.bodies, -1) {}

  // Of several contacts without copies.
  void answer(long cluster) {
    first = many.order + many.starts[cluster];
    last = many.order + many.starts[cluster + 1];
    used.clear();
    auto body = [this](std::int64_t b, double* x) {
      for (int i = 0; i < BODY; ++i) x[i] = many.table.body[i] < 0 ? many.table.body[i] == -2 : many.bodies[many.table.body[i] * many.pairs.bodies + b];
    };
    auto contact = [this](std::int64_t k, double* x) {
      for (int i = 0; i < 8; ++i) x[i] = many.table.contact[i] < 0 || many.table.contact[i] >= many.rows ? 0 : many.contacts[many.table.contact[i] * many.count + k];
    };
    Parts parts = parts_of(many.pairs, first, last, place, used, body, contact);
    many.status[cluster] = parts.has_copies() ? LEFT_TO_PYTHON : answer(cluster, parts);
  }

 private:
  const Many& many;
  std::vector<int> place;          // in the cluster, of each body; -1: not of it
  std::vector<std::int64_t> used;  // the bodies of the cluster
  const std::int64_t *first, *last;

  Code answer(long number, Parts& parts) {
    Cluster cluster(parts, many.asked.law == LAW_FRICTIONLESS);
    if (cluster.fault) return refused(number, static_cast<Code>(cluster.fault));
    Answer found = answered(cluster, many.asked);
    if (found.code == LEFT_TO_PYTHON) return LEFT_TO_PYTHON;
    if (found.code != STATUS_OK) return refused(number, found.code);
    const Numbers& y = found.numbers;
    long bodies = many.pairs.bodies, axes = many.table.axes, spin = many.table.first_spin;
    for (size_t i = 0; i < used.size(); ++i) {
      const double* after = cluster.movable[i] < 0 ? nullptr : &y.after[6 * cluster.movable[i]];
      for (int k = 0; after && k < axes; ++k) many.velocity[k * bodies + used[i]] = after[k];
      for (int k = static_cast<int>(spin); after && k < 3; ++k) many.spin[(k - spin) * bodies + used[i]] = after[3 + k];
    }
    for (auto k = first; k != last; ++k) {
      size_t i = k - first;
      for (int axis = 0; axis < axes; ++axis) many.impulse[axis * many.count + *k] = y.pushes[3 * i + axis];
      many.regime[*k] = y.regimes[i];
    }
    many.bound[number] = y.bound;
    many.margin[number] = found.margin;
    for (int i = 0; i < 4; ++i) many.energy[i][number] = y.energies[i];
    return y.bound <= many.limit ? (y.separates() ? STATUS_SEPARATING : STATUS_OK) : STATUS_TOLERANCE_NOT_MET;
  }

  // The answer that there is none. The bodies that could move have no velocity that is known.
  Code refused(long number, Code code) {
    long bodies = many.pairs.bodies, axes = many.table.axes, spins = 3 - many.table.first_spin;
    for (std::int64_t body : used) {
      if (!(many.bodies[body] < INFINITY)) continue;
      for (int k = 0; k < axes; ++k) many.velocity[k * bodies + body] = NAN;
      for (int k = 0; k < spins; ++k) many.spin[k * bodies + body] = NAN;
    }
    for (auto k = first; k != last; ++k) {
      for (int axis = 0; axis < axes; ++axis) many.impulse[axis * many.count + *k] = NAN;
      many.regime[*k] = 0;
    }
    many.bound[number] = many.margin[number] = NAN;
    for (double* energy : many.energy) energy[number] = NAN;
    return code;
  }
};
