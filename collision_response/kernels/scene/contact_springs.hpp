// The contacts of a cluster as springs, for the paths of ROUTH_STRONGE, whose equation routh_stronge.cpp derives. All
// numbers are doubles, along the axes of each contact, in units near the speeds and masses: powers of two, so that no
// square overflows or underflows.
#pragma once
#include "laws.hpp"
#include "motion.hpp"

// The springs, and what is known of a path.
struct ContactSprings {
  // Of the stiffest spring: softer springs count as this. They act when all others have done so.
  static constexpr double SOFTEST = 0x1p-100;
  // Where a light body rattles between heavy ones, the errors of countless steps damp it, on each of the first paths
  // alike. So they may add up to this, relative to the speed.
  static constexpr double LARGEST_SUM = 1;
  static constexpr double ROUNDING = 2e-14;  // of velocities, relative to the speed
  struct Coupled {
    int other;
    double by;
  };

  Assembly assembly;  // in these units
  int count;
  double unit = 1, root = 1;  // of speed, and of the root of mass
  double speed = 0, mass = 0;  // of the fastest approach; the mean effective mass
  // Of each contact, at most the mean, and the time that its own mass takes to bounce: what counts as little for other
  // contacts may be all of a light body.
  Vector own_mass, own_time;
  // Steps, in units of time: errors shorten none below the first; at full speed none is longer than the second, which is
  // less for a finer path: else both might take the same steps, and agree on the same error.
  double shortest = 1e-13, longest;
  double exponent;
  Vector stiffness;
  // For each contact, the change of its normal velocity by unit normal impulses on others.
  List<List<Coupled>> coupled;
  double tolerance;  // greatest error of a step, relative to the motion
  double slow;  // slower approaches count as none, because rounding could keep a contact approaching for ever
  // The work of all paths, that of this path, and what remains of it: the coupling of two contacts costs 1, about a
  // nanosecond.
  long budget, share, work;
  double h = 0;  // the length of the next step
  double step_errors = 0;  // the sum of the estimates of all steps, relative to the speed
  double rounding = 0;  // estimate of the relative error of the answer by rounding
  double friction_loss = 0;  // energy that friction took
  bool is_wedged = false;  // the path has no end

  ContactSprings(const Assembly& given, const SpringOptions& options, double tolerance, long work)
      : assembly(given),
        count(given.count),
        longest(0.5 * std::pow(tolerance, 0.1)),
        exponent(options.exponent),
        stiffness(options.stiffness.empty() ? Vector(count, 1) : options.stiffness),
        coupled(count),
        tolerance(tolerance),
        budget(options.work),
        share(work),
        work(work) {
    change_units();
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < count; ++j)
        if (double by = coupling(assembly, i, 0, j, 0); by != 0) coupled[i].push_back({j, by});
      own_mass.push_back(1 / coupling(assembly, i, 0, i, 0));
      mass += own_mass[i] / count;
    }
    for (double& own : own_mass) {
      own = std::fmin(own, mass);
      own_time.push_back(std::pow(own / mass, 1 / (1 + exponent)));
    }
    shortest *= *std::min_element(own_time.begin(), own_time.end());
    const double most = *std::max_element(stiffness.begin(), stiffness.end()), stiffness_unit = power_near(most);
    // In a unit of time near the duration of a contact: k x^eta t = m u with x = u t.
    for (double& k : stiffness)
      k = std::fmax(k / stiffness_unit, SOFTEST) * (mass * speed / std::pow(speed, exponent) / (most / stiffness_unit));
    slow = std::fmax(tolerance / 10, ROUNDING) * speed;
  }

  // f_i and x_i'
  double force(int i, double x) const {
    return x > 0 ? stiffness[i] * (exponent == 1.5 ? x * std::sqrt(x) : std::pow(x, exponent)) : 0;
  }
  double rate(int i, double x, double u) const {
    double e = assembly.contacts[i].e;
    return u < -slow ? -u : x > 0 && u > 0 ? -u / (e * e) : 0;
  }
  // Whether the energy left in a spring is too small to matter, and its contact does not approach.
  bool is_over(int i, double x, double u) const { return force(i, x) * x <= own_mass[i] * slow * slow && u >= -slow; }
  // The normal speed of a contact after its spring has given its energy back.
  double residual_speed(int i, double x, double u) const {
    return x > 0 || u < 0 ? std::sqrt(u * u + force(i, x) * x / own_mass[i]) : 0;
  }
  // The fraction of a step after which a spring turns from loading to unloading, by the secant; 1 if it does not.
  double turning_fraction(int i, double x, double before, double after) const {
    bool bends = x > 0 ? assembly.contacts[i].e < 1 : after < 0;
    return bends && (before < 0) != (after < 0) ? before / (before - after) : 1;
  }

  // Whether to accept a step whose error is `worst`, relative to the tolerance; sets the length of the next.
  //
  // An error that is too large is mostly due to a spring that turns within the step, where its rate has a kink: then
  // the step is shortened to end there, after the fraction `turns`. A spring that turns at the very end is not the cause.
  // Slower contacts compress their springs for longer, so the longest step depends on the `fastest` residual speed.
  bool accepts_step(double worst, double order, double turns, double fastest) {
    constexpr double CAUTION = 0.9, LENGTHEN = 4, SHORTEN = 0.2;  // factors of the length
    constexpr double LEAST_ERROR = 1e-10, AT_THE_START = 1e-6, AT_THE_END = 0.9;
    const double by = CAUTION * std::pow(std::fmax(worst, LEAST_ERROR), -1 / order);
    if (worst <= 1 || h < shortest) {
      step_errors += worst * tolerance;
      const double relative = std::fmin(std::fmax(fastest, slow) / speed, 1);
      const double most = longest * std::pow(relative, (1 - exponent) / (1 + exponent));
      h = std::fmin(h * std::fmin(LENGTHEN, std::fmax(SHORTEN, by)), most);
      return true;
    }
    h *= turns > AT_THE_START && turns < AT_THE_END ? turns : std::fmax(SHORTEN, by);
    return false;
  }

  // Whether the budget of all paths may be enough for this path and, if the errors of its steps add up to too much, for a
  // finer one. With steps of some order, the sum is the tolerance times the work, and the work is the inverse of its root.
  bool is_within_budget(double order) const {
    const double too_large = step_errors / LARGEST_SUM;
    const double finer = too_large > 1 ? std::pow(too_large, 1 / (order - 1)) : 0;
    return work > 0 && (1 + finer) * static_cast<double>(share - work) < static_cast<double>(budget);
  }

  // The size of a motion that separates all contacts, for contacts of mass and speed 1. It is large where light bodies
  // are between heavy ones.
  double separating_size() const { return assembly.is_locked ? 1 : assembly.separating_size; }

  double in_newton_seconds(double p) const { return p * root * unit * root; }
  // The part of impulses that creates no energy: less than 1 only by the errors of the path.
  double part_without_gain(const List<Axes>& P) const {
    Motion motion(assembly);
    for (int i = 0; i < count; ++i) motion.apply(i, P[i]);
    double before = 0, after = 0;  // twice the work of P is P.u before and after
    for (int i = 0; i < count; ++i)
      for (int axis = 0; axis < 3; ++axis) {
        before += P[i][axis] * assembly.contacts[i].axes[axis].velocity;
        after += P[i][axis] * motion.velocity(i, axis);
      }
    return before + after > 0 ? 2 * before / (before - after) : 1;
  }

 private:
  void change_units() {
    for (const AssembledContact& contact : assembly.contacts) {
      speed = std::fmax(speed, -contact.axes[0].velocity);
      mass = std::fmax(mass, std::fabs(contact.unit()));
    }
    unit = power_near(speed);
    root = power_near(mass);
    speed /= unit;
    mass = 0;
    for (AssembledContact& contact : assembly.contacts)
      for (auto& axis : contact.axes) {
        axis.velocity /= unit;
        for (auto& side : axis.row)
          for (double& x : side) x *= root;
      }
  }
};
