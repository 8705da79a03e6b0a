// What Impact.error_bound says it is, from the changes that an impact makes and their errors.
#pragma once
#include "numbers.hpp"

// What rounding to a double loses, relative; 0 of numbers that are one.
template <class N> constexpr double of_result = std::is_same_v<Value<N>, Base<N>> ? 0 : 0x1p-53;

// The square of the error of a vector over its length. What comes after the third component has a weight.
template <class N> INLINE Base<N> squared_error(const N* change, int count, Base<N> arm) {
  using T = Base<N>;
  constexpr bool is_double = sizeof(Lane<T>) == 8;
  T most{}, lost{}, weight[6];
  for (int i = 0; i < count; ++i) {
    weight[i] = i < 3 ? spread<T>(1) : arm;
    T size = magnitude(high(change[i])) * weight[i];
    most = choose<T>(size < most, most, size);
    lost += error_of(change[i]) * weight[i];
  }
  T size{}, squares = spread<T>(is_double ? 0x1p-900 : 0x1p-100), scale = 1 / most;
  for (int i = 0; i < count; ++i) {
    T value = high(change[i]) * weight[i] * scale, error = error_of(change[i]) * weight[i] * scale;
    if constexpr (of_result<N> > 0) error += magnitude(value) * spread<T>(of_result<N>);
    size += value * value;
    squares += error * error;
  }
  T share = squares / size * spread<T>(1 + 4 * slack<T>);
  share = choose<T>(share < 1, share, spread<T>(__builtin_inf()));  // so is what is not a number
  T of_exact = choose<T>(most == 0, T{}, spread<T>(of_result<N> * of_result<N>));
  return choose<T>((lost == 0) & (most < spread<T>(__builtin_inf())), of_exact, share);
}

// The greatest of the impulse's and the twist changes'. The radius of gyration weighs rotation.
template <class N> INLINE Base<N> error_bound(const N* changes, const Base<N>* mass, const Base<N>* trace) {
  using T = Base<N>;
  T worst = squared_error(changes, 3, spread<T>(1));
  for (int side = 0; side < 2; ++side) {
    T arm = root_of_base(trace[side] / (3 * mass[side]));
    T of_twist = squared_error(changes + 3 + 6 * side, 6, arm);
    of_twist = choose<T>(mass[side] < spread<T>(__builtin_inf()), of_twist, T{});
    worst = choose<T>(worst < of_twist, of_twist, worst);
  }
  T share = root_of_base(worst), bound = share / (1 - share);  // the true length is less by the error at most
  bound = choose<T>(worst <= spread<T>(of_result<N> * of_result<N>), share, bound);
  return choose<T>(share < 1, bound, spread<T>(__builtin_inf()));
}
