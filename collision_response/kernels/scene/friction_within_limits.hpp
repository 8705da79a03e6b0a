// Friction at contacts whose normal impulses are known: of all friction impulses within their limits, those that do the
// least work,
//
//     |y|^2 / 2 + v.P -> min    |P_i| <= mu_i P_n,i    y: the effect of all impulses in the metric of kinetic energy
//
// where v are the slips without impulses. The derivative by P is the slip, which they oppose then, or stop.
//
// Sweeps over the contacts find them in a few turns, mostly. Where contacts hold a body in several ways, or its slip has
// little inertia, sweeps may take a million turns, and Newton's method takes a few: friction of a contact that sticks
// may change in all directions, that at its limit along the limit. A turn ends where the first contact reaches its
// limit.
#pragma once
#include "motion.hpp"
#include "skyline.hpp"

// The change of the slip of a contact by tangential impulses on it: a symmetric matrix.
struct SlipMatrix {
  double c11, c12, c22;

  double trace() const { return c11 + c22; }
  // The change from the friction impulse `now` to one of size at most `most` that opposes the slip, or nearly does.
  // v1, v2: the slip now.
  Axes change(const Axes& now, double most, double v1, double v2) const {
    constexpr double REGULAR = 1e-6;  // least determinant, over the square of the trace, to solve for no slip
    constexpr int TURNS = 4;  // the sweeps do the rest
    const double det = c11 * c22 - c12 * c12;
    double t1 = now[1], t2 = now[2];
    if (det > REGULAR * trace() * trace()) {
      double s1 = t1 - (c22 * v1 - c12 * v2) / det, s2 = t2 - (c11 * v2 - c12 * v1) / det;
      if (s1 * s1 + s2 * s2 <= most * most) return {0, s1 - t1, s2 - t2};
    }
    for (int turn = 0; turn < TURNS; ++turn) {
      double d1 = t1 - now[1], d2 = t2 - now[2];
      double s1 = t1 - (v1 + c11 * d1 + c12 * d2) / trace(), s2 = t2 - (v2 + c12 * d1 + c22 * d2) / trace();
      double size = length(s1, s2), fits = size > most ? most / size : 1;
      t1 = s1 * fits;
      t2 = s2 * fits;
    }
    return {0, t1 - now[1], t2 - now[2]};
  }
  // Squares are in range, so this is right. It takes a third of the time of std::hypot.
  static double length(double a, double b) { return std::sqrt(a * a + b * b); }
};

class FrictionWithinLimits {
 public:
  static constexpr long SWEEP = 60;  // the cost of one contact in a sweep

  explicit FrictionWithinLimits(const Assembly& assembly) : assembly(assembly), freedoms(assembly.count) {
    for (int i = 0; i < assembly.count; ++i)
      slips.push_back({coupling(assembly, i, 1, i, 1), coupling(assembly, i, 1, i, 2), coupling(assembly, i, 2, i, 2)});
  }

  const SlipMatrix& slip_matrix(int i) const { return slips[i]; }

  // Change the friction in P, and the motion by all of P, until a sweep over `contacts` changes their slips by no more
  // than `small`. Returns whether that was within the budget `work`, which this reduces.
  bool find(const List<int>& contacts, Motion& motion, List<Axes>& P, double small, long& work) {
    double change = INFINITY;
    for (size_t sweeps = 1; change > small && work > 0; ++sweeps) {
      change = sweep(contacts, motion, P);
      work -= SWEEP * static_cast<long>(contacts.size() + 1);
      // A turn of Newton's method takes as long as some sweeps for each contact.
      if (change > small && sweeps % (2 * contacts.size()) == 0) approach_minimum(contacts, motion, P, small, work);
    }
    return change <= small;
  }

 private:
  static constexpr double ROUNDING = 0x1p-50;  // of friction, relative to the impulse of its contact
  // Friction within this fraction of its limit is at it.
  static constexpr double AT_LIMIT = 0x1p-40;
  // Contacts may share friction in several ways. This, relative to its second derivative, lets them keep it.
  static constexpr double KEPT = 0x1p-40;
  // Turns in a row that do more work than one before: the limits are curved, so that a turn may have to make up for the
  // one before.
  static constexpr int MOST_WORSE = 3;

  // Directions in which the friction of a contact may change: two, or one along its limit.
  struct Freedom {
    int count;
    double along[2][2], curvature;  // unit vectors; of the work, because the limit is curved
    double row[2][2][6];  // the slips along them by motions of both bodies
  };
  struct Turn {
    double work, change;  // the change of the work, and the greatest change of a slip
    bool is_whole;  // no contact reached its limit
  };

  const Assembly& assembly;
  List<SlipMatrix> slips;
  List<Freedom> freedoms;
  Skyline<double> second_derivative;
  Vector slope, step;

  double limit(int i, const Axes& P) const { return assembly.contacts[i].mu * P[0]; }

  // Returns the greatest change of a slip by the friction of its own contact.
  double sweep(const List<int>& contacts, Motion& motion, List<Axes>& P) const {
    double change = 0;
    for (int i : contacts) {
      const Axes by = slips[i].change(P[i], limit(i, P[i]), motion.velocity(i, 1), motion.velocity(i, 2));
      motion.apply(i, by);
      for (int k = 1; k < 3; ++k) P[i][k] += by[k];
      const double size = SlipMatrix::length(by[1], by[2]);
      if (size > ROUNDING * (P[i][0] + SlipMatrix::length(P[i][1], P[i][2])))
        change = std::fmax(change, size * slips[i].trace());
    }
    return change;
  }

  // Go on with Newton's method until it converges, or does no less work.
  void approach_minimum(const List<int>& contacts, Motion& motion, List<Axes>& P, double small, long& work) {
    if (second_derivative.entries.empty()) lay_out();
    Vector best_y = motion.y;
    List<Axes> best_P = P;
    double done = 0, least = 0;
    for (int worse = 0; worse < MOST_WORSE && work > 0;) {
      const double before = second_derivative.multiplications();
      const Turn turn = newton_turn(contacts, motion, P);
      work -= 5 * SWEEP * static_cast<long>(contacts.size()) +
              10 * static_cast<long>(second_derivative.entries.size()) +
              static_cast<long>(second_derivative.multiplications() - before);
      done += turn.work;
      worse = done < least ? 0 : worse + 1;
      if (worse == 0) {
        least = done;
        best_y = motion.y;
        best_P = P;
      }
      if (turn.is_whole && turn.change <= small) break;
    }
    motion.y = best_y;
    P = best_P;
  }

  void lay_out() {
    List<List<int>> of_bodies(assembly.body_count);
    for (int i = 0; i < assembly.count; ++i)
      for (int body : assembly.contacts[i].body)
        if (body >= 0) of_bodies[body].insert(of_bodies[body].end(), {2 * i, 2 * i + 1});
    slope.resize(2 * static_cast<size_t>(assembly.count));
    step.resize(slope.size());
    List<int> place(slope.size());
    std::iota(place.begin(), place.end(), 0);
    second_derivative.lay_out(place, of_bodies);
  }

  void set_freedom(int i, const Axes& P, const double* slip) {
    Freedom& freedom = freedoms[i];
    const double size = SlipMatrix::length(P[1], P[2]), most = limit(i, P);
    const bool is_at_limit = size >= (1 - AT_LIMIT) * most;
    freedom.count = is_at_limit ? 1 : 2;
    if (is_at_limit) {
      freedom.along[0][0] = -P[2] / size;
      freedom.along[0][1] = P[1] / size;
      freedom.curvature = std::fmax(-(slip[0] * P[1] + slip[1] * P[2]), 0) / (size * size);
    } else {
      for (int k = 0; k < 2; ++k)
        for (int l = 0; l < 2; ++l) freedom.along[k][l] = k == l;
      freedom.curvature = 0;
    }
    for (int k = 0; k < freedom.count; ++k)
      for (int side = 0; side < 2; ++side)
        for (int c = 0; c < 6; ++c)
          freedom.row[k][side][c] = freedom.along[k][0] * assembly.contacts[i].axes[1].row[side][c] +
                                    freedom.along[k][1] * assembly.contacts[i].axes[2].row[side][c];
  }

  // Set the derivatives of the work by the directions that contacts have.
  void set_derivatives(const List<int>& contacts, const Motion& motion, const List<Axes>& P) {
    Skyline<double>& M = second_derivative;
    std::fill(M.entries.begin(), M.entries.end(), 0);
    std::fill(slope.begin(), slope.end(), 0);
    for (int i = 0; i < 2 * assembly.count; ++i) M.at(i, i) = 1;
    for (size_t a = 0; a < contacts.size(); ++a) {
      const int i = contacts[a];
      const double slip[2] = {motion.velocity(i, 1), motion.velocity(i, 2)};
      set_freedom(i, P[i], slip);
      for (int k = 0; k < freedoms[i].count; ++k) {
        const double* along = freedoms[i].along[k];
        slope[2 * i + k] = along[0] * slip[0] + along[1] * slip[1];
        M.at(2 * i + k, 2 * i + k) = freedoms[i].curvature;
      }
      for (size_t b = 0; b <= a; ++b) add_coupling(i, contacts[b]);
      for (int k = 0; k < freedoms[i].count; ++k) M.at(2 * i + k, 2 * i + k) *= 1 + KEPT;
    }
  }
  void add_coupling(int i, int j) {
    const AssembledContact &one = assembly.contacts[i], &other = assembly.contacts[j];
    for (int s = 0; s < 2; ++s)
      for (int t = 0; t < 2; ++t) {
        if (one.body[s] < 0 || one.body[s] != other.body[t]) continue;
        for (int k = 0; k < freedoms[i].count; ++k)
          for (int l = 0; l < (i == j ? k + 1 : freedoms[j].count); ++l)
            second_derivative.at(2 * i + k, 2 * j + l) += dot(freedoms[i].row[k][s], freedoms[j].row[l][t], 6);
      }
  }

  // The part of the step after which the first contact that sticks reaches its limit, or all of it.
  double part_within_limits(const List<int>& contacts, const List<Axes>& P) const {
    double part = 1;
    for (int i : contacts) {
      if (freedoms[i].count < 2) continue;
      const double d[2] = {step[2 * i], step[2 * i + 1]}, most = limit(i, P[i]);
      const double along = P[i][1] * d[0] + P[i][2] * d[1], square = d[0] * d[0] + d[1] * d[1];
      const double room = most * most - P[i][1] * P[i][1] - P[i][2] * P[i][2];
      const double least = along + std::sqrt(along * along + square * room);
      if (room < part * least) part = room / least;
    }
    return part;
  }

  Turn newton_turn(const List<int>& contacts, Motion& motion, List<Axes>& P) {
    set_derivatives(contacts, motion, P);
    second_derivative.solve(slope, step);
    const double part = part_within_limits(contacts, P);
    const Vector y = motion.y;
    Turn turn{0, 0, part == 1};
    for (int i : contacts) {
      Axes to = P[i];
      for (int k = 0; k < freedoms[i].count; ++k)
        for (int l = 0; l < 2; ++l) to[1 + l] += part * step[2 * i + k] * freedoms[i].along[k][l];
      const double size = SlipMatrix::length(to[1], to[2]), most = limit(i, P[i]), fits = size > most ? most / size : 1;
      const Axes by = {0, fits * to[1] - P[i][1], fits * to[2] - P[i][2]};
      motion.apply(i, by);
      for (int k = 1; k < 3; ++k) {
        P[i][k] += by[k];
        turn.work += by[k] * assembly.contacts[i].axes[k].velocity;
      }
      turn.change = std::fmax(turn.change, SlipMatrix::length(by[1], by[2]) * slips[i].trace());
    }
    for (size_t k = 0; k < y.size(); ++k) turn.work += (motion.y[k] - y[k]) * (motion.y[k] + y[k]) / 2;
    return turn;
  }
};
