// The path of ROUTH_STRONGE with friction, by the method (2, 2, 2) of Ascher, Ruuth & Spiteri, "Implicit-Explicit
// Runge-Kutta Methods for Time-Dependent Partial Differential Equations", Appl. Numer. Math. 25 (1997), of order 2.
//
// Springs are compressed by the known velocities (explicit), and friction opposes the slip at the end of each of the
// two stages (implicit), so that contacts can stick. Comparing one step with two of half its length gives its error,
// and extrapolates to order 3.
#pragma once
#include "contact_springs.hpp"
#include "friction_within_limits.hpp"

struct PathWithFriction : ContactSprings {
  using ContactSprings::ContactSprings;
  static constexpr bool HAS_FRICTION = true;
  static constexpr double FIRST_TOLERANCE = 1e-2, LEAST_RATIO = 1e-1, ENOUGH = 1e-5;  // see follow_springs()
  static constexpr double ORDER = 3;
  static constexpr double g = 1 - M_SQRT1_2, d = 1 - 0.5 / g;  // gamma and delta of the method
  static constexpr long SWEEP = FrictionWithinLimits::SWEEP;

  // Whether the path ended within its budget and was not wedged.
  bool follow() {
    h = 1e-3;  // of the first step: its error corrects it
    for (int i = 0; i < count; ++i) now.u[i] = now.motion.velocity(i, 0);
    while (!all_are_over()) {
      if (!step(now, h, whole) || !step(now, h / 2, half) || !step(half, h / 2, both)) return false;
      const Reversal reversal = first_reversal();
      const double worst = std::fmax(error_of_step(), reversal.error / (3 * tolerance * speed));
      if (!(worst < INFINITY)) return false;
      double turns = reversal.fraction, fastest = 0;
      for (int i = 0; i < count; ++i) {
        turns = std::fmin(turns, turning_fraction(i, now.x[i], now.u[i], both.u[i]));
        fastest = std::fmax(fastest, residual_speed(i, both.x[i], both.u[i]));
      }
      if (!accepts_step(worst, ORDER, turns, fastest)) continue;
      extrapolate();
      is_wedged = is_held();
      if (is_wedged || !is_within_budget(ORDER)) return false;
    }
    friction_loss = in_newton_seconds(friction_loss) * unit;
    return return_to_cones();
  }

  List<Axes> impulses() const { return now.P; }

 private:
  struct State {
    Vector x, u;  // u: normal velocities
    Motion motion;
    List<Axes> P, friction;  // friction: forces in the last stage, where the next stage starts its search
  };

  const double enough = 0.1 * tolerance * speed;  // change of the slip in a sweep: no further sweeps are needed
  State now{Vector(count), Vector(count), Motion(assembly), List<Axes>(count), List<Axes>(count)};
  State whole{now}, half{now}, both{now};  // after one step, and after two of half its length
  Vector load = Vector(count);  // the normal forces
  FrictionWithinLimits solver{assembly};
  List<int> frictional;  // the contacts that sweeps go over

  double rate_in(const State& state, int i) const { return rate(i, state.x[i], state.u[i]); }
  bool all_are_over() const {
    for (int i = 0; i < count; ++i)
      if (!is_over(i, now.x[i], now.u[i])) return false;
    return true;
  }

  // Apply the loads for some time, with friction that opposes the slip at the end of it. Sweeps over the contacts start
  // from the friction forces in `to`, until they change the slip by no more than `small`. Returns whether they do so
  // within the budget.
  bool apply_friction(State& to, double time, double small) {
    frictional.clear();
    for (int i = 0; i < count; ++i) {
      Axes& P = to.friction[i];
      if (!(load[i] > 0)) {
        P = {0, 0, 0};
        continue;
      }
      double most = assembly.contacts[i].mu * load[i], size = SlipMatrix::length(P[1], P[2]);
      double fits = time * (size > most ? most / size : 1);
      P = {time * load[i], fits * P[1], fits * P[2]};
      to.motion.apply(i, P);
      if (most > 0) frictional.push_back(i);
    }
    const bool found = solver.find(frictional, to.motion, to.friction, small, work);
    for (int i = 0; i < count; ++i) {
      for (double& along : to.friction[i]) along /= time;
      to.u[i] = to.motion.velocity(i, 0);
    }
    work -= SWEEP * count;
    return found;
  }

  void compress(State& to, int i, double x) {
    to.x[i] = std::fmax(x, 0);
    load[i] = force(i, to.x[i]);
  }
  void add_impulses(State& to, double time) const {
    for (int i = 0; i < count; ++i)
      for (int k = 0; k < 3; ++k) to.P[i][k] += time * to.friction[i][k];
  }

  bool step(const State& from, double length, State& to) {
    to = from;
    for (int i = 0; i < count; ++i) compress(to, i, from.x[i] + length * g * rate_in(from, i));
    if (!apply_friction(to, length * g, enough)) return false;
    for (size_t k = 0; k < to.motion.y.size(); ++k)
      to.motion.y[k] = from.motion.y[k] + (to.motion.y[k] - from.motion.y[k]) * (1 - g) / g;
    add_impulses(to, length * (1 - g));
    for (int i = 0; i < count; ++i)
      compress(to, i, from.x[i] + length * (d * rate_in(from, i) + (1 - d) * rate_in(to, i)));
    if (!apply_friction(to, length * g, enough)) return false;
    add_impulses(to, length * g);
    return true;
  }

  // The error of a step relative to the tolerance.
  double error_of_step() const {
    double off = 0, square = 0;
    for (size_t k = 0; k < both.motion.y.size(); ++k) {
      double by = both.motion.y[k] - whole.motion.y[k];
      square += by * by;
    }
    for (int i = 0; i < count; ++i) {
      // Also compare with the trapezoidal rule, which notices a spring that turns after the last stage.
      double rates = rate_in(now, i) + 2 * rate_in(half, i) + rate_in(both, i);
      double by_ends = std::fmax(now.x[i] + h / 4 * rates, 0);
      off = std::fmax(off, std::fmax(std::fabs(both.x[i] - whole.x[i]), std::fabs(both.x[i] - by_ends)));
      off = std::fmax(off, std::fabs(both.u[i] - whole.u[i]));  // the norm gives little weight to light bodies
    }
    return std::fmax(off, std::sqrt(square / mass)) / (3 * tolerance * speed);
  }

  // Where a slip reverses within a step, or where friction stops a slip that it cannot hold, friction has the wrong
  // direction for a part of a stage, in the whole step and in its halves alike: comparing them may not notice it. So it
  // is where a slip stops and another one starts, because the load of the first one moves to the other. Slips of twice
  // `enough` may be what sweeps leave of none.
  struct Reversal {
    double error, fraction;  // of slips, at most; of the step, after which the first of them has nearly stopped
  };
  Reversal first_reversal() {
    Reversal first{0, 1};
    List<int> stopped;
    bool starts = false;
    for (int i : frictional)
      if (!(slip(now, i) > 2 * enough)) starts = starts || slip(both, i) > 4 * enough;
      else if (slip(both, i) <= 2 * enough) stopped.push_back(i);
      else if (product_of_slips(now, both, i) < 0) add_reversal(i, first);
    if (stopped.empty()) return first;
    State later = both;
    if (!starts && !apply_friction(later, h / 16, enough)) return first;
    for (int i : stopped)
      if (starts || slip(later, i) > 4 * enough) add_reversal(i, first);
    return first;
  }
  void add_reversal(int i, Reversal& first) const {
    const double before = slip(now, i), middle = std::copysign(slip(half, i), product_of_slips(now, half, i));
    const double fraction = middle < before ? std::fmin(before / (before - middle) / 2, 1) : 1;
    const double most = solver.slip_matrix(i).trace() * assembly.contacts[i].mu * (both.P[i][0] - now.P[i][0]);
    first.error = std::fmax(first.error, std::fmin(before, 2 * most * std::fmax(1 - fraction, g / 2)));
    first.fraction = std::fmin(first.fraction, 0.9 * fraction);
  }
  static double slip(const State& state, int i) { return std::sqrt(product_of_slips(state, state, i)); }
  static double product_of_slips(const State& a, const State& b, int i) {
    return a.motion.velocity(i, 1) * b.motion.velocity(i, 1) + a.motion.velocity(i, 2) * b.motion.velocity(i, 2);
  }

  void extrapolate() {
    auto extrapolated = [](double fine, double coarse) { return fine + (fine - coarse) / 3; };
    friction_loss +=
        extrapolated(work_of_friction(now, half) + work_of_friction(half, both), work_of_friction(now, whole));
    std::fill(now.motion.y.begin(), now.motion.y.end(), 0);  // anew, so that the rounding of the steps does not add up
    for (int i = 0; i < count; ++i) {
      now.x[i] = std::fmax(extrapolated(both.x[i], whole.x[i]), 0);
      for (int k = 0; k < 3; ++k) now.P[i][k] = extrapolated(both.P[i][k], whole.P[i][k]);
      now.motion.apply(i, now.P[i]);
    }
    for (int i = 0; i < count; ++i) now.u[i] = now.motion.velocity(i, 0);
    now.friction = both.friction;
  }
  // The energy that friction takes between two states, by the mean of their slips.
  double work_of_friction(const State& from, const State& to) const {
    double sum = 0;
    for (int i = 0; i < count; ++i)
      for (int axis = 1; axis < 3; ++axis)
        if (double by = to.P[i][axis] - from.P[i][axis]; by != 0)
          sum -= by * (from.motion.velocity(i, axis) + to.motion.velocity(i, axis)) / 2;
    return sum;
  }

  // Whether contacts at rest stay compressed for ever, because friction balances the forces of their springs. To find
  // out, the forces act a million times as long as it takes them to separate the contacts: they must set nothing in
  // motion.
  bool is_held() {
    double greatest = 0;
    for (int i = 0; i < count; ++i) {
      load[i] = force(i, now.x[i]);
      greatest = std::fmax(greatest, load[i]);
      if (load[i] > 0 && now.motion.speed(i) > slow) return false;
    }
    if (!(greatest > 0)) return false;
    State later = now;
    const long left = work;
    work = std::min(left, 1000 * SWEEP * count);  // if friction does not hold, sweeps take longer or never converge
    const long budget = work;
    const double size = separating_size(), slowest = mass * size * size;
    const bool found = apply_friction(later, 1e6 * slowest * speed / greatest, 1e-3 * speed);
    work += left - budget;
    for (int i = 0; found && i < count; ++i)
      if (load[i] > 0 && later.motion.speed(i) > speed) return false;
    return found;
  }

  // Extrapolated impulses may pull, or leave the friction cones if contacts can share their friction in several ways.
  // Then replace them by impulses in the cones that have the same effect. Returns whether these were found within the
  // budget.
  bool return_to_cones() {
    bool are_in_cones = true;
    Assembly at_rest = assembly;
    for (int i = 0; i < count; ++i) {
      load[i] = std::fmax(now.P[i][0], 0);
      for (auto& axis : at_rest.contacts[i].axes) axis.velocity = 0;
      const double most = assembly.contacts[i].mu * load[i] * (1 + 0x1p-30);
      are_in_cones = are_in_cones && now.P[i][0] >= 0 && std::hypot(now.P[i][1], now.P[i][2]) <= most;
    }
    if (are_in_cones) return true;
    now.motion = Motion(at_rest);  // the difference between the effects of the new impulses and of the old ones
    for (int i = 0; i < count; ++i) now.motion.apply(i, {-now.P[i][0], -now.P[i][1], -now.P[i][2]});
    now.friction = now.P;
    const bool found = apply_friction(now, 1, enough);
    now.P = now.friction;
    return found;
  }
};
