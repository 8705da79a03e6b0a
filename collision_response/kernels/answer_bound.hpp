// What Impact.error_bound says it is, from the changes that an impact makes and their errors.
#pragma once
#include "numbers.hpp"

// The error of a vector over its length. From the third component on a weight applies.
template <class N> INLINE Base<N> relative_error(const N* change, int count, Base<N> arm) {
  using T = Base<N>;
  constexpr bool is_double = sizeof(Lane<T>) == 8;
  T most{}, lost{}, weight[6];
  for (int i = 0; i < count; ++i) {
    weight[i] = i < 3 ? spread<T>(1) : arm;
    T size = magnitude(high(change[i])) * weight[i];
    most = choose<T>(size < most, most, size);
    lost += error_of(change[i]) * weight[i];
  }
  T size{}, squares{};
  for (int i = 0; i < count; ++i) {
    T value = high(change[i]) * weight[i] / most, error = error_of(change[i]) * weight[i] / most;
    if constexpr (!std::is_same_v<Value<N>, T>) error += magnitude(value) * spread<T>(0x1p-53);  // of the result
    size += value * value;
    squares += error * error;
  }
  T share = root_of_base(squares + spread<T>(is_double ? 0x1p-900 : 0x1p-100)) / root_of_base(size);
  share = share * spread<T>(1 + 2 * slack<T>);
  T bound = choose<T>(share < 1, share / (1 - share), spread<T>(__builtin_inf()));
  return choose<T>((lost == 0) & (most < spread<T>(__builtin_inf())), std::is_same_v<Value<N>, T> ? T{} : choose<T>(most == 0, T{}, spread<T>(0x1p-53)), bound);
}

// The greatest of the impulse's and the twist changes'. The radius of gyration weighs rotation.
template <class N> INLINE Base<N> error_bound(const N* changes, const Base<N>* mass, const Base<N>* trace) {
  using T = Base<N>;
  T bound = relative_error(changes, 3, spread<T>(1));
  for (int side = 0; side < 2; ++side) {
    T arm = root_of_base(trace[side] / (3 * mass[side]));
    T of_twist = relative_error(changes + 3 + 6 * side, 6, arm);
    of_twist = choose<T>(mass[side] < spread<T>(__builtin_inf()), of_twist, T{});
    bound = choose<T>(of_twist <= bound, bound, of_twist);  // not a number counts as greater
  }
  return choose<T>(bound < spread<T>(__builtin_inf()), bound, spread<T>(__builtin_inf()));
}
