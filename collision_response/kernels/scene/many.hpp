// Many clusters from tables: what resolve_scene.py does with one of several contacts by FRICTIONLESS or COULOMB.
#pragma once
#include "../gather.hpp"
#include "answer.hpp"
#include "friction.hpp"
#include "reflections.hpp"
#include "validity_everything.hpp"

enum Code : unsigned char { LEFT_TO_PYTHON = 0, OK = 1, SEPARATING = 2, TOLERANCE_NOT_MET = 17, PATH_TOO_LONG = 18, CONTRADICTORY = 22 };

// What is asked, as in resolve_scenes.py, and where the answers go. A quantity of bodies or contacts is a row.
struct Many {
  const Table& table;
  const double *bodies, *contacts;
  Pairs pairs;
  long count, rows;  // of contacts
  const std::int64_t *order, *starts;
  bool frictionless;
  double threshold, restitution_threshold, limit;
  int budget;
  double *velocity, *spin, *impulse;  // of bodies, and of contacts
  unsigned char *regime, *status;     // of contacts, and of clusters
  double *bound, *margin, *energy[4];

  void body(std::int64_t column, double* x) const {
    for (int i = 0; i < BODY; ++i) x[i] = table.body[i] < 0 ? table.body[i] == -2 : bodies[table.body[i] * pairs.bodies + column];
  }
  void contact(std::int64_t column, double* x) const {
    for (int i = 0; i < 8; ++i) x[i] = table.contact[i] < 0 || table.contact[i] >= rows ? 0 : contacts[table.contact[i] * count + column];
    if (frictionless && x[7] > 0 && x[7] < INFINITY) x[7] = 0;
  }
  // Whether two contacts are one that was given twice.
  bool same(std::int64_t i, std::int64_t j) const {
    double x[8], y[8];
    bool turned = pairs.a[i] == pairs.b[j] && pairs.b[i] == pairs.a[j];
    if (!turned && !(pairs.a[i] == pairs.a[j] && pairs.b[i] == pairs.b[j])) return false;
    contact(i, x);
    contact(j, y);
    for (int k = 0; k < 8; ++k)
      if (x[k] != (turned && k >= 3 && k < 6 ? -y[k] : y[k])) return false;
    return true;
  }
};

// Answers clusters, one after the other.
class ManyClusters {
 public:
  explicit ManyClusters(const Many& asked) : many(asked), place(asked.pairs.bodies, -1) {}

  // Of several contacts without copies.
  void answer(long cluster) {
    const std::int64_t *first = many.order + many.starts[cluster], *last = many.order + many.starts[cluster + 1];
    used.clear();
    for (auto k = first; k != last; ++k)
      for (std::int64_t body : {many.pairs.a[*k], many.pairs.b[*k]})
        if (place[body] < 0) {
          place[body] = static_cast<long>(used.size());
          used.push_back(body);
        }
    Code code = answer(cluster, first, last);
    many.status[cluster] = code;
    for (std::int64_t body : used) place[body] = -1;
  }

 private:
  const Many& many;
  std::vector<long> place;         // in the cluster, of each body; -1: not of it
  std::vector<std::int64_t> used;  // the bodies of the cluster

  Code answer(long cluster, const std::int64_t* first, const std::int64_t* last) {
    for (auto k = first; k != last; ++k)
      for (auto j = first; j != k; ++j)
        if (many.same(*j, *k)) return LEFT_TO_PYTHON;
    Assembly scene;
    std::vector<Given> given(used.size());
    std::vector<int> movable(used.size(), -1);
    double energy = 0;
    for (size_t i = 0; i < used.size(); ++i) {
      many.body(used[i], given[i].x);
      if (!given[i].rests()) given[i].look();
      if (!given[i].movable()) {
        scene.driven = scene.driven || given[i].moves();
        continue;
      }
      movable[i] = scene.bodies++;
      energy += given[i].energy;
      scene.given.push_back(given[i]);
    }
    bool rubs = false;
    for (auto k = first; k != last; ++k) {
      double in[INPUTS] = {}, fault;
      bool shapes[5];
      long a = place[many.pairs.a[*k]], b = place[many.pairs.b[*k]];
      std::copy(given[a].x, given[a].x + BODY, in);
      std::copy(given[b].x, given[b].x + BODY, in + BODY);
      many.contact(*k, in + IN_CONTACT_POSITION_X);
      validity<double>(in, nullptr, &fault, shapes);
      if (fault != 0) return refused(cluster, first, last, static_cast<Code>(fault));
      rubs = rubs || in[IN_CONTACT_FRICTION] > 0;
      scene.add(given[a], given[b], movable[a], movable[b], in + IN_CONTACT_POSITION_X, 1);
      scene.add_plain(given[a], given[b], scene.touches.back());
    }
    scene.finish();
    if (scene.locked) return LEFT_TO_PYTHON;
    for (Touch& touch : scene.touches) {
      double speed = -touch.plain[0].velocity;
      if (speed > 0 && speed < many.restitution_threshold) touch.e = 0;
    }
    Struck struck = reflections(scene, many.threshold, many.budget);
    if (struck.outcome == Outcome::CONTRADICTORY) return refused(cluster, first, last, CONTRADICTORY);
    if (struck.outcome == Outcome::ENDLESS) return refused(cluster, first, last, PATH_TOO_LONG);
    if (struck.error == INFINITY) return LEFT_TO_PYTHON;
    std::vector<double> tangential;
    if (rubs) {
      Friction friction = rubbed(scene, struck.p.data());
      if (!friction.found) return refused(cluster, first, last, CONTRADICTORY);
      struck.p = along_normals(friction, scene);
      tangential = across_normals(friction);
      struck.error += friction.error;
    }
    return write(cluster, first, last, numbers_of(scene, struck.p.data(), tangential, struck.error, false), energy, struck.margin, movable);
  }

  Code write(long cluster, const std::int64_t* first, const std::int64_t* last, const Numbers& y, double energy, double margin, const std::vector<int>& movable) {
    long bodies = many.pairs.bodies, axes = many.table.axes, spin = many.table.first_spin;
    for (size_t i = 0; i < used.size(); ++i) {
      const double* after = movable[i] < 0 ? nullptr : &y.after[6 * movable[i]];
      for (int k = 0; after && k < axes; ++k) many.velocity[k * bodies + used[i]] = after[k];
      for (int k = static_cast<int>(spin); after && k < 3; ++k) many.spin[(k - spin) * bodies + used[i]] = after[3 + k];
    }
    bool separating = true;
    for (auto k = first; k != last; ++k) {
      size_t i = k - first;
      const double* push = &y.pushes[3 * i];
      for (int axis = 0; axis < axes; ++axis) many.impulse[axis * many.count + *k] = push[axis];
      Regime regime = y.regimes[i];
      many.regime[*k] = regime;
      separating = separating && regime == REGIME_SEPARATING;
    }
    many.bound[cluster] = y.bound;
    many.margin[cluster] = margin;
    double energies[4] = {energy, y.energy_after, y.lost_restitution, y.lost_friction};
    for (int i = 0; i < 4; ++i) many.energy[i][cluster] = energies[i];
    return y.bound <= many.limit ? (separating ? SEPARATING : OK) : TOLERANCE_NOT_MET;
  }

  // The answer that there is none. The bodies that could move have no velocity that is known.
  Code refused(long cluster, const std::int64_t* first, const std::int64_t* last, Code code) {
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
    many.bound[cluster] = many.margin[cluster] = NAN;
    for (double* energy : many.energy) energy[cluster] = NAN;
    return code;
  }
};
