// One impact: from doubles, with the errors they carry, to doubles with theirs.
#pragma once
#include "answer_bound.hpp"
#include "numbers.hpp"
#include "constants.hpp"

#include <limits>

struct ImpactResult {
  double change[CHANGES], error[CHANGES];  // what error_bound is about
  double reported[REPORTED];
  bool flags[FLAGS];
  double error_bound;
};

// The inverse inertia of a body, on its diagonal; none of a rigid one.
INLINE double linear_part(const double* d) { return d[0] + d[6] + d[11]; }
INLINE double angular_part(const double* d) { return d[15] + d[18] + d[20]; }

template <class N, int inputs, class F>
INLINE void one_impact(F impact, const double* x, const double* error, ImpactResult* y) {
  using T = Base<N>;
  N in[inputs], changes[CHANGES];
  Report<N> reported[REPORTED];
  for (int i = 0; i < inputs; ++i) {
    T number = static_cast<T>(x[i]);
    double lost = error[i] + __builtin_fabs(x[i] - static_cast<double>(number));
    if (!(x[i] - x[i] == 0)) lost = 0;  // infinity is exact
    T bound = static_cast<T>(lost * (1 + slack<T>));
    if (lost > 0) bound += std::numeric_limits<T>::denorm_min();  // the cast may have rounded down
    in[i] = Make<N>::read(number, bound);
  }
  impact(in, changes, reported, y->flags);
  T mass[2], trace[2];
  for (int side = 0; side < 2; ++side) {
    const double* moment = x + side * BODY + IN_BODY_A_INERTIA_XX;
    mass[side] = static_cast<T>(x[side * BODY]);
    trace[side] = static_cast<T>(moment[0] + moment[3] + moment[5]);
    if constexpr (inputs > INPUTS) {
      const double* own = x + INPUTS + side * INVERSE_INERTIA;
      double linear = linear_part(own), angular = angular_part(own);
      if (linear > 0 || angular > 0) {  // as of a body that is moved as easily
        mass[side] = 1;
        trace[side] = static_cast<T>(angular > 0 ? linear > 0 ? 3 * linear / angular : 3 : 0);
      }
    }
  }
  y->error_bound = error_bound<N>(changes, mass, trace);
  for (int i = 0; i < CHANGES; ++i) {
    y->change[i] = high(changes[i]);
    y->error[i] = static_cast<double>(error_of(changes[i])) * (1 + slack<T>);
    if constexpr (!std::is_same_v<Value<N>, T>) y->error[i] += __builtin_fabs(y->change[i]) * 0x1p-53;
  }
  for (int i = 0; i < REPORTED; ++i) y->reported[i] = reported[i];
}
