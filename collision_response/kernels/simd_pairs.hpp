// Pairs of numbers in the two lanes of a SIMD vector, one for each body: see simd_pairs.py.
#pragma once
#include "numbers.hpp"

template <class N> struct PairOf;
template <> struct PairOf<double> { typedef double type __attribute__((vector_size(16))); };
template <> struct PairOf<float> { typedef float type __attribute__((vector_size(8))); };
template <class T> struct PairOf<DoubleDouble<T>> { using type = DoubleDouble<typename PairOf<T>::type>; };
template <class N> struct PairOf<Bounded<N>> { using type = Bounded<typename PairOf<N>::type>; };
template <class N> using Pair = typename PairOf<N>::type;

template <class T, class = std::enable_if_t<is_scalar<T>>> INLINE Pair<T> join(T a, T b) { return Pair<T>{a, b}; }
template <class T> INLINE DoubleDouble<Pair<T>> join(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return {join(a.h, b.h), join(a.l, b.l)};
}
template <class N> INLINE Bounded<Pair<N>> join(const Bounded<N>& a, const Bounded<N>& b) {
  return {join(a.value, b.value), join(a.error, b.error)};
}
template <class N> INLINE auto join_truths(bool a, bool b) {
  using M = Mask<Pair<Base<N>>>;
  return M{-static_cast<Lane<M>>(a), -static_cast<Lane<M>>(b)};
}
template <class N, class T> INLINE auto join_truths(const Truth<T>& a, const Truth<T>& b) {
  return Truth<Pair<T>>{join_truths<T>(a.value, b.value), join_truths<T>(a.certain, b.certain)};
}

// One number of a pair.
template <int lane, class T, class = std::enable_if_t<is_vector<T>>> INLINE auto at(T x) {
  if constexpr (std::is_integral_v<Lane<T>>) return x[lane] != 0;
  else return x[lane];
}
template <int lane, class T> INLINE auto at(const DoubleDouble<T>& x) {
  return DoubleDouble<Lane<T>>{at<lane>(x.h), at<lane>(x.l)};
}
template <int lane, class N> INLINE auto at(const Bounded<N>& x) {
  return Bounded<decltype(at<lane>(x.value))>{at<lane>(x.value), at<lane>(x.error)};
}
template <int lane, class T> INLINE auto at(const Truth<T>& x) {
  return Truth<Lane<T>>{at<lane>(x.value), at<lane>(x.certain)};
}

template <class T, class = std::enable_if_t<is_vector<T>>> INLINE T swapped(T x) {
  return __builtin_shufflevector(x, x, 1, 0);
}
template <class T> INLINE DoubleDouble<T> swapped(const DoubleDouble<T>& x) { return {swapped(x.h), swapped(x.l)}; }
template <class N> INLINE Bounded<N> swapped(const Bounded<N>& x) { return {swapped(x.value), swapped(x.error)}; }
template <class T> INLINE Truth<T> swapped(const Truth<T>& x) { return {swapped(x.value), swapped(x.certain)}; }
