// ROUTH_STRONGE for several contacts: the law of Liu, Zhao & Brogliato, as a differential equation in time.
//
// Each contact is a spring that gives back the fraction e^2 of the work it took, as in Stronge's law:
//
//     v' = M^-1 N f     f_i = k_i max(x_i, 0)^eta
//     x_i' = -u_i            while u_i < 0                 loading
//          = -u_i / e_i^2    while u_i > 0 and x_i > 0     unloading
//          = 0               else
//
// until all x_i are 0 and u >= 0. Only the ratios of the k_i matter. The exponent eta is 1 for linear springs and 3/2
// for Hertz's. For one contact u+ = -e u, for any k and eta. Friction opposes the slip, with at most mu f_i. So a
// contact loses (1 - e^2) of the work that compresses it, and friction takes its work along the path.
//
// Without friction a Runge-Kutta pair of orders 5 and 4 integrates the equation. With friction each step solves for the
// slip at its end, so that contacts can stick; its order is 2, extrapolated to 3. Steps adapt to an error allowed for
// each; a step in which a spring turns from loading to unloading, where its rate bends, ends there. The whole path is
// followed several times, with smaller and smaller errors, and the distance between the last two answers is the estimate
// of the error.
//
// A contact given twice is twice as stiff. The smaller e is, the more compressions a contact takes to end. Friction may
// wedge bodies, as in a corner of two walls with mu > 1: then springs stay compressed, and the path has no end.
//
// Sources: Liu, Zhao & Brogliato, "Frictionless Multiple Impacts in Multibody Systems. I. Theoretical Framework", Proc.
// R. Soc. A 464 (2008); Ascher, Ruuth & Spiteri, "Implicit-Explicit Runge-Kutta Methods for Time-Dependent Partial
// Differential Equations", Appl. Numer. Math. 25 (1997), for the steps with friction.
#pragma once
#include "contact_springs.hpp"
#include "effect.hpp"

// Below this restitution a path takes too many compressions to end.
constexpr double LEAST_SPRING_RESTITUTION = 0.05;
constexpr const char* TOO_INELASTIC = "must be at least 0.05 for ROUTH_STRONGE in a cluster";

struct SpringOptions {
  Vector stiffness{};  // of each contact, in any unit; empty: all are equal
  double exponent = 1.5;  // eta
  long work = 0;  // budget of all paths together, roughly in nanoseconds
};

// The answer of one path, or of the last one.
struct SpringPath {
  ClusterImpulses impulses;
  Vector changes;  // of the twists of the movable bodies
  double friction_loss = 0;  // energy that friction took
  double error = INFINITY;  // estimate of the relative error of the answer
  const char* fault = nullptr;  // why there is no answer
};

// How far twist changes are from a reference, relative to that, in the norm of error_bound.
inline double relative_distance(const Assembly& assembly, const Vector& changes, const Vector& reference) {
  double distance = 0, size = 0;
  for (int b = 0; b < assembly.body_count; ++b) {
    double off[6];
    for (int k = 0; k < 6; ++k) off[k] = changes[6 * b + k] - reference[6 * b + k];
    distance = std::hypot(distance, twist_size(assembly.bodies[b].x, off));
    size = std::hypot(size, twist_size(assembly.bodies[b].x, &reference[6 * b]));
  }
  return distance == 0 ? 0 : size > 0 ? distance / size : INFINITY;
}

// Follow the springs, more and more exactly. `tolerance`: greatest relative error wanted; 0 for the default.
inline SpringPath follow_springs(const Assembly& assembly, const SpringOptions& options, double tolerance,
                                 bool has_friction) {
  // The error allowed in a step of the first path, relative to the motion; its ratio from each path to the next; and the
  // estimate of the answer's error at which to stop, if no tolerance is given.
  double step_error = has_friction ? 1e-2 : 1e-5;
  const double least_ratio = has_friction ? 1e-1 : 1e-2, enough = has_friction ? 1e-5 : 1e-6;
  constexpr double FINEST = 1e-13;  // least error allowed in a step
  constexpr int LEAST_PATHS = 3;  // two may be close to each other by chance
  constexpr double COARSEST_RATIO = 0.5;  // a path whose error is not smaller by this factor tells nothing new
  // Where a light body rattles between heavy ones, the errors of countless steps damp it, on each of the first paths alike.
  constexpr double LARGEST_SUM = 1;  // of the errors of the steps of a path, relative to the speed
  constexpr double WORST = 0.1;  // greatest error estimate that still counts as an answer

  const Vector stiffness = options.stiffness.empty() ? Vector(assembly.count, 1) : options.stiffness;
  const double wanted = tolerance > 0 ? tolerance : enough;
  long work = options.work;
  double ratio = least_ratio, change = 0;
  SpringPath last;
  for (int paths = 0; step_error >= FINEST && (paths < LEAST_PATHS || last.error > wanted); ++paths) {
    ContactSprings springs(assembly, options.exponent, stiffness, work);
    std::vector<Axes> P(assembly.count);
    Vector p;
    const bool found = has_friction ? springs.follow_with_friction(step_error, P)
                                    : springs.follow_without_friction(step_error, p);
    if (springs.is_wedged) {
      last.fault = "friction wedges the bodies: springs stay compressed, and their impulses have no end";
      return last;
    }
    if (!found) break;  // the budget is spent
    for (size_t i = 0; i < p.size(); ++i) P[i][0] = p[i];
    SpringPath path{with_axis_impulses({}, assembly, springs.in_newton_seconds(P)), {}, springs.friction_loss};
    if (!has_friction) path.impulses.tangential.clear();
    const ImpulseEffect effect = effect_of(assembly, path.impulses, true);
    path.changes = effect.changes;
    // No loss is negative, by the errors of the path and the rounding of this sum.
    const double lost = (effect.energies[2] + effect.energies[3]) * (1 - 0x1p-51);
    path.friction_loss = std::fmin(std::fmax(path.friction_loss, 0), lost);
    if (paths > 0) {
      // A change may be small by chance, so it counts for no less than the one before predicts.
      change = std::fmax(relative_distance(assembly, last.changes, path.changes), change * ratio);
      path.error = 2 * change + step_error + springs.rounding;
      if (!(springs.step_errors <= LARGEST_SUM)) path.error = INFINITY;
    }
    last = path;
    // The work of a path grows at least with the square root of the refinement: stay within the budget.
    const double growth = 1.25 * static_cast<double>(work - springs.work) / std::fmax(springs.work, 1);
    ratio = std::fmax(least_ratio, growth * growth);
    if (ratio > COARSEST_RATIO) break;
    step_error *= ratio;
    work = springs.work;
  }
  if (!(last.error <= WORST)) last.fault = "the path of the impulses did not settle within its budget";
  return last;
}
