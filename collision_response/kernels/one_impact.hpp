// One impact: inputs and results are doubles, with their error bounds.
#pragma once
#include "answer_bound.hpp"
#include "numbers.hpp"
#include "constants.hpp"

#include <algorithm>
#include <limits>

struct ImpactResult {
  double change[CHANGES], error[CHANGES];  // impulse and changes of twist, and their error bounds
  double reported[REPORTED];
  bool flags[FLAGS];
  double error_bound;  // relative, of the changes together

  const double* twist_after(int side) const { return reported + 6 * side; }
  const double* twist_change(int side) const { return change + 3 + 6 * side; }
};

// Traces of the linear and the angular block of an inverse inertia; 0 for a rigid body.
INLINE double linear_trace(const double* inverse_inertia) {
  return inverse_inertia[INVERSE_INERTIA_XX] + inverse_inertia[INVERSE_INERTIA_YY] +
         inverse_inertia[INVERSE_INERTIA_ZZ];
}
INLINE double angular_trace(const double* inverse_inertia) {
  return inverse_inertia[INVERSE_INERTIA_AA] + inverse_inertia[INVERSE_INERTIA_BB] +
         inverse_inertia[INVERSE_INERTIA_CC];
}

template <class N, int layout, class F>
INLINE void compute_impact(F impact, const double* input, const double* error, ImpactResult* result) {
  using T = Base<N>;
  constexpr int inputs = layout == LAYOUT_ARTICULATED ? ALL_INPUTS : INPUTS;
  N in[inputs], changes[CHANGES];
  Report<N> reported[REPORTED];
  bool flags[FLAGS];
  for (int i = 0; i < inputs; ++i) {
    T number = static_cast<T>(input[i]);
    double input_error = error[i] + __builtin_fabs(input[i] - static_cast<double>(number));
    if (!(input[i] - input[i] == 0)) input_error = 0;  // an infinity is exact
    T bound = static_cast<T>(input_error * (1 + slack<T>));
    if (input_error > 0) bound += std::numeric_limits<T>::denorm_min();  // the cast may have rounded down
    in[i] = Make<N>::read(number, bound);
  }
  impact(in, changes, reported, flags);
  flags[FLAG_GAINS_ENERGY] = false;  // the error bounds tell more
  std::copy_n(flags, FLAGS, result->flags);
  T mass[2], trace[2];
  for (int side = 0; side < 2; ++side) {
    const double* body = input + side * BODY;
    mass[side] = static_cast<T>(body[BODY_MASS]);
    trace[side] = static_cast<T>(body[BODY_INERTIA_XX] + body[BODY_INERTIA_YY] + body[BODY_INERTIA_ZZ]);
    if constexpr (layout == LAYOUT_ARTICULATED) {
      const double* inverse_inertia = input + INPUTS + side * INVERSE_INERTIA;
      double linear = linear_trace(inverse_inertia), angular = angular_trace(inverse_inertia);
      if (linear > 0 || angular > 0) {  // those of a rigid body that is as easily moved
        mass[side] = 1;
        trace[side] = static_cast<T>(angular > 0 ? linear > 0 ? 3 * linear / angular : 3 : 0);
      }
    }
  }
  result->error_bound = error_bound<N>(changes, mass, trace);
  for (int i = 0; i < CHANGES; ++i) {
    result->change[i] = high(changes[i]);
    result->error[i] = static_cast<double>(error_of(changes[i])) * (1 + slack<T>);
    if constexpr (!std::is_same_v<Value<N>, T>) result->error[i] += __builtin_fabs(result->change[i]) * 0x1p-53;
  }
  for (int i = 0; i < REPORTED; ++i) result->reported[i] = reported[i];
  if constexpr (std::is_same_v<T, float>) {  // a twist that nothing changes is not rounded
    for (int side = 0; side < 2; ++side) {
      const double* change = result->twist_change(side);
      const bool is_changed = std::any_of(change, change + 6, [](double x) { return x != 0; });
      if (!is_changed) std::copy_n(input + side * BODY + BODY_VELOCITY_X, 6, result->reported + 6 * side);
    }
  }
}
