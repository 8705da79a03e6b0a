// Impact.error_bound: one relative error bound for an answer, from the changes by an impact and their error bounds.
#pragma once
#include "numbers.hpp"

// Relative error of rounding a result to the base; 0 if it is of that type already.
template <class N> constexpr double result_roundoff = std::is_same_v<Value<N>, Base<N>> ? 0 : 0x1p-53;

// The square of the relative error of a vector: error bound over length, in the Euclidean norm. The components after
// the third are multiplied by `arm`, which makes angular velocities comparable with linear ones.
template <class N> INLINE Base<N> squared_error(const N* change, int count, Base<N> arm) {
  using T = Base<N>;
  constexpr bool is_double = sizeof(Lane<T>) == 8;
  T largest{}, sum_of_errors{}, weight[6];
  for (int i = 0; i < count; ++i) {
    weight[i] = i < 3 ? broadcast<T>(1) : arm;
    T size = magnitude(high(change[i])) * weight[i];
    largest = choose<T>(size < largest, largest, size);
    sum_of_errors += error_of(change[i]) * weight[i];
  }
  T size{}, squares = broadcast<T>(is_double ? 0x1p-900 : 0x1p-100), scale = 1 / largest;
  for (int i = 0; i < count; ++i) {
    T value = high(change[i]) * weight[i] * scale, error = error_of(change[i]) * weight[i] * scale;
    if constexpr (result_roundoff<N> > 0) error += magnitude(value) * broadcast<T>(result_roundoff<N>);
    size += value * value;
    squares += error * error;
  }
  T squared_ratio = squares / size * broadcast<T>(1 + 4 * slack<T>);
  // NaN too becomes infinite.
  squared_ratio = choose<T>(squared_ratio < 1, squared_ratio, broadcast<T>(__builtin_inf()));
  T exact_ratio = choose<T>(largest == 0, T{}, broadcast<T>(result_roundoff<N> * result_roundoff<N>));
  return choose<T>((sum_of_errors == 0) & (largest < broadcast<T>(__builtin_inf())), exact_ratio, squared_ratio);
}

// The largest relative error of the impulse and of the two changes of twist. `trace` is that of each inertia tensor:
// the root of trace / 3 mass, a radius of gyration, is the arm of the angular velocities. A body of infinite mass has
// no change.
template <class N> INLINE Base<N> error_bound(const N* changes, const Base<N>* mass, const Base<N>* trace) {
  using T = Base<N>;
  T worst = squared_error(changes, 3, broadcast<T>(1));
  for (int side = 0; side < 2; ++side) {
    T arm = root_of_base(trace[side] / (3 * mass[side]));
    T twist_error = squared_error(changes + 3 + 6 * side, 6, arm);
    twist_error = choose<T>(mass[side] < broadcast<T>(__builtin_inf()), twist_error, T{});
    worst = choose<T>(worst < twist_error, twist_error, worst);
  }
  // Relative to the true length, which is less by the error at most.
  T ratio = root_of_base(worst), bound = ratio / (1 - ratio);
  bound = choose<T>(worst <= broadcast<T>(result_roundoff<N> * result_roundoff<N>), ratio, bound);
  return choose<T>(ratio < 1, bound, broadcast<T>(__builtin_inf()));
}
