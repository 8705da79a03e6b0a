// The number types that the emitted formulas run on. T is a base: double, float, or a vector of one of them.
//
//   T                  rounds as IEEE 754 says
//   DoubleDouble<T>    an unevaluated sum of two T: some 32 digits if T is double
//   Bounded<N>         a value of type N, and a bound on its error: here the error bounds are made
//
// Bounded is a running error analysis: Wilkinson; Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed.,
// 2002, section 3.3. With values a, b, their error bounds da, db, and u the roundoff of N, an operation computes its
// value as N does, and as its bound (in floating point, see `slack`)
//
//   a + b, a - b   da + db + u |result|
//   a b            (|a| + da) db + |b| da + u |result| + underflow
//   a / b          (da + |a / b| db + underflow) / (|b| - db) + u |result| + underflow; infinite unless |b| > db
//   root(a)        min(da / root(a), root(da)) + u |result|
//
// A comparison is three-valued (Truth): it is certain if the values are farther apart than the sum of their bounds,
// or if both bounds are 0. A choice by an uncertain condition gives the branch that the values take, with a bound that
// covers the other branch too: the hull of both.
//
// The results are the same to the bit on every machine: no fast-math, and the compiler fuses nothing. The one fused
// operation, `fms`, is written out and rounds alike everywhere. Only the bits of a NaN may differ.
#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#ifndef GIVEN_ROUNDOFF  // roundoff of the floats that the inputs were given in
#define GIVEN_ROUNDOFF 0x1p-53
#endif
#define INLINE static inline __attribute__((always_inline))
// With OUT_OF_LINE, operations are function calls, except those on a base. That compiles in a third of the time. With
// LONG_OUT_OF_LINE, only the long operations are.
#ifdef OUT_OF_LINE
#define SHORT_OPERATION static __attribute__((noinline))
#else
#define SHORT_OPERATION INLINE
#endif
#if defined(OUT_OF_LINE) || defined(LONG_OUT_OF_LINE)
#define LONG_OPERATION static __attribute__((noinline))
#else
#define LONG_OPERATION INLINE
#endif

// --- Bases -------------------------------------------------------------------------------------------

template <class T> constexpr bool is_scalar = std::is_arithmetic_v<T>;
template <class T> constexpr bool is_vector = !is_scalar<T> && !std::is_class_v<T>;
template <class T> auto first_lane(T x) {
  if constexpr (is_vector<T>) return x[0];
  else return x;
}
template <class T> using Lane = decltype(first_lane(T{}));  // the float or double in a base
template <class T> constexpr std::size_t lanes = sizeof(T) / sizeof(Lane<T>);
template <class T> using Mask = decltype(T{} < T{});  // the result of comparing bases

template <class T> INLINE T broadcast(double x) { return T{} + static_cast<Lane<T>>(x); }
template <class T> INLINE Mask<T> broadcast_truth(bool x) { return x ? Mask<T>(T{} == T{}) : Mask<T>(T{} != T{}); }

INLINE bool negation(bool m) { return !m; }
template <class M, class = std::enable_if_t<is_vector<M>>> INLINE M negation(M m) { return ~m; }
// Some instructions are written as assembly here: parsing the header of intrinsics takes longer than most of these
// files.
INLINE bool any(bool m) { return m; }
template <class M, class = std::enable_if_t<is_vector<M>>> INLINE bool any(M m) {
#ifdef __AVX512F__
  if constexpr (sizeof m == 64) {
    unsigned char some;
    __asm__("vptestmq %1, %1, %0" : "=Yk"(some) : "v"(m));
    return some;
  }
#endif
#ifdef __AVX2__
  if constexpr (sizeof m == 32) {
    bool some;
    __asm__("vptest %1, %1" : "=@ccnz"(some) : "x"(m));
    return some;
  }
#endif
  for (std::size_t i = 0; i < lanes<M>; ++i)
    if (m[i]) return true;
  return false;
}

template <class T> INLINE T magnitude(T x) {
  if constexpr (is_scalar<T>) return std::fabs(x);
  else return (T)((Mask<T>)x & ~(Mask<T>)(-T{}));  // all bits but the sign
}
template <class T> INLINE T root_of_base(T x) {
  if constexpr (is_scalar<T>) return std::sqrt(x);
#ifdef __AVX2__
  else if constexpr (sizeof x >= 16) {
    if constexpr (sizeof(Lane<T>) == 8) __asm__("vsqrtpd %1, %0" : "=v"(x) : "v"(x));
    else __asm__("vsqrtps %1, %0" : "=v"(x) : "v"(x));
    return x;
  }
#endif
  else {
    for (std::size_t i = 0; i < lanes<T>; ++i) x[i] = std::sqrt(x[i]);
    return x;
  }
}
template <class T> INLINE T fms_by_library(T a, T b, T p) {
  if constexpr (is_scalar<T>) return std::fma(a, b, -p);
  else {
    for (std::size_t i = 0; i < lanes<T>; ++i) p[i] = std::fma(a[i], b[i], -p[i]);
    return p;
  }
}
#ifdef __x86_64__
#ifndef __FMA__
// Use the instruction if the machine has it: a call of std::fma takes as long as ten operations.
static const bool has_fma = __builtin_cpu_supports("fma");
template <class T> static __attribute__((noinline, cold)) T fms_out_of_line(T a, T b, T p) {
  return fms_by_library(a, b, p);
}
#endif
template <class T> INLINE T fms(T a, T b, T p) {  // fused multiply-subtract: a b - p of doubles, rounded once
#ifndef __FMA__
  if (!has_fma) return fms_out_of_line(a, b, p);
#endif
  if constexpr (is_scalar<T>) __asm__("vfmsub231sd %2, %1, %0" : "+x"(p) : "x"(a), "x"(b));
  else __asm__("vfmsub231pd %2, %1, %0" : "+v"(p) : "v"(a), "v"(b));
  return p;
}
#else
template <class T> INLINE T fms(T a, T b, T p) { return fms_by_library(a, b, p); }
#endif
template <class T> INLINE T lesser(T a, T b) { return a < b ? a : b; }

// The operations that emitted code uses on every number type, for a base; below for the others.
#define ON_BASE template <class T, class = std::enable_if_t<!std::is_class_v<T>>> INLINE
ON_BASE T root(T x) { return root_of_base(x); }
// Arithmetic that is always inline. The operations of Bounded are made of it.
ON_BASE T sum_of(T a, T b) { return a + b; }
ON_BASE T product_of(T a, T b) { return a * b; }
ON_BASE T quotient_of(T a, T b) { return a / b; }
ON_BASE T root_of(T x) { return root_of_base(x); }
ON_BASE Mask<T> less(T a, T b) { return a < b; }
ON_BASE Mask<T> less_equal(T a, T b) { return a <= b; }
ON_BASE Mask<T> equal(T a, T b) { return a == b; }
template <class T> INLINE T choose(Mask<T> m, T a, T b) { return m ? a : b; }
ON_BASE T high(T x) { return x; }  // the number, rounded to the base
ON_BASE T error_of(T) { return T{}; }
ON_BASE T widened(T x, T) { return x; }
ON_BASE T value(T x) { return x; }
ON_BASE T report(T x) { return x; }
ON_BASE T plain_truth(T m) { return m; }
ON_BASE T certainly_true(T) { return T{}; }  // without error bounds nothing is certain
ON_BASE bool may_be_true(T m) { return any(m); }

// --- DoubleDouble ------------------------------------------------------------------------------------
// Dekker 1971; Hida, Li & Bailey 2001. The relative error of every operation is at most 2^-102, except where it
// underflows or overflows.

template <class T>
struct DoubleDouble {
  T h, l;
};  // high and low part

template <class T> INLINE DoubleDouble<T> quick_sum(T a, T b) {
  T s = a + b;
  return {s, b - (s - a)};
}
template <class T> INLINE DoubleDouble<T> exact_sum(T a, T b) {
  T s = a + b, c = s - a;
  return {s, (a - (s - c)) + (b - c)};
}
template <class T> INLINE DoubleDouble<T> exact_product(T a, T b) {
  T p = a * b;
  return {p, fms(a, b, p)};
}

template <class T> INLINE DoubleDouble<T> sum_of(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  DoubleDouble<T> s = exact_sum(a.h, b.h), t = exact_sum(a.l, b.l);
  s = quick_sum(s.h, s.l + t.h);
  return quick_sum(s.h, s.l + t.l);
}
template <class T> INLINE DoubleDouble<T> operator-(const DoubleDouble<T>& a) { return {-a.h, -a.l}; }
template <class T> INLINE DoubleDouble<T> product_of(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  DoubleDouble<T> p = exact_product(a.h, b.h);
  return quick_sum(p.h, p.l + (a.h * b.l + a.l * b.h));
}
template <class T> INLINE DoubleDouble<T> quotient_of(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  T q = a.h / b.h;
  DoubleDouble<T> p = exact_product(q, b.h);
  p = quick_sum(p.h, q * b.l + p.l);
  return quick_sum(q, ((a.h - p.h) + (a.l - p.l)) / b.h);
}
template <class T> INLINE DoubleDouble<T> root_of(const DoubleDouble<T>& a) {
  T s = root_of_base(a.h);
  DoubleDouble<T> p = exact_product(s, s);
  T correction = (((a.h - p.h) - p.l) + a.l) / (s + s);
  return quick_sum(s, choose<T>(s == 0, T{}, correction));
}
template <class T> SHORT_OPERATION DoubleDouble<T> operator+(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return sum_of(a, b);
}
template <class T> SHORT_OPERATION DoubleDouble<T> operator-(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return sum_of(a, -b);
}
template <class T> SHORT_OPERATION DoubleDouble<T> operator*(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return product_of(a, b);
}
template <class T> SHORT_OPERATION DoubleDouble<T> operator/(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return quotient_of(a, b);
}
template <class T> SHORT_OPERATION DoubleDouble<T> root(const DoubleDouble<T>& a) { return root_of(a); }
template <class T> SHORT_OPERATION Mask<T> less(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return (a.h < b.h) | ((a.h == b.h) & (a.l < b.l));
}
template <class T> SHORT_OPERATION Mask<T> less_equal(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return (a.h < b.h) | ((a.h == b.h) & (a.l <= b.l));
}
template <class T> INLINE Mask<T> equal(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return (a.h == b.h) & (a.l == b.l);
}
template <class T> INLINE DoubleDouble<T> choose(Mask<T> m, const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return {choose<T>(m, a.h, b.h), choose<T>(m, a.l, b.l)};
}
template <class T> INLINE T high(const DoubleDouble<T>& a) { return a.h; }
template <class T> INLINE T report(const DoubleDouble<T>& a) { return a.h; }
template <class T> INLINE DoubleDouble<T> value(const DoubleDouble<T>& a) { return a; }
template <class T> INLINE T error_of(const DoubleDouble<T>&) { return T{}; }

// --- Traits ------------------------------------------------------------------------------------------
// Value: the type without its error bound. Report: the type of results that are reported without bounds.

template <class N> struct Bounded;
template <class N> struct Traits {  // a base
  using Base = N;
  using Value = N;
  using Report = N;
  static constexpr double roundoff = sizeof(Lane<N>) == 8 ? 0x1p-53 : 0x1p-24;
};
template <class T> struct Traits<DoubleDouble<T>> {
  using Base = T;
  using Value = DoubleDouble<T>;
  using Report = T;
  static constexpr double roundoff = 0x1p-102;
};
template <class N> struct Traits<Bounded<N>> {
  using Base = typename Traits<N>::Base;
  using Value = N;
  using Report = typename Traits<N>::Report;
  static constexpr double roundoff = Traits<N>::roundoff;
};
template <class N> using Base = typename Traits<N>::Base;
template <class N> using Value = typename Traits<N>::Value;
template <class N> using Report = typename Traits<N>::Report;

// --- Bounded -----------------------------------------------------------------------------------------

template <class N>
struct Bounded {
  N value;
  Base<N> error;
};
// What the values say, and whether their errors leave no doubt, in Kleene's logic.
template <class T>
struct Truth {
  Mask<T> value, certain;
};

// Bounds are computed in floating point too, and may come out too small by this fraction.
template <class T> constexpr double slack = sizeof(Lane<T>) == 8 ? 0x1p-30 : 0x1p-10;
// More than an operation can lose through underflow.
template <class T> constexpr double underflow = sizeof(Lane<T>) == 8 ? 0x1p-1060 : 0x1p-138;

template <class N> INLINE Bounded<N> with_roundoff(N x, Base<N> error) {
  return {x, error + magnitude(high(x)) * broadcast<Base<N>>(Traits<N>::roundoff)};
}
template <class T> INLINE Bounded<T> bounded_sum(T a, T b, T error) { return with_roundoff(a + b, error); }
// The low parts are added in the base, and the rounding of that is counted. It takes half the operations of sum_of,
// and gives no error where nothing is rounded.
template <class T> INLINE Bounded<DoubleDouble<T>> bounded_sum(const DoubleDouble<T>& a, const DoubleDouble<T>& b,
                                                               T error) {
  DoubleDouble<T> s = exact_sum(a.h, b.h);
  T low = a.l + b.l;
  return with_roundoff(quick_sum(s.h, s.l + low), error + magnitude(low) * broadcast<T>(0x1p-53));
}
template <class N> SHORT_OPERATION Bounded<N> operator+(const Bounded<N>& a, const Bounded<N>& b) {
  return bounded_sum(a.value, b.value, a.error + b.error);
}
template <class N> SHORT_OPERATION Bounded<N> operator-(const Bounded<N>& a, const Bounded<N>& b) {
  return bounded_sum(a.value, -b.value, a.error + b.error);
}
template <class N> INLINE Bounded<N> operator-(const Bounded<N>& a) { return {-a.value, a.error}; }
template <class N> SHORT_OPERATION Bounded<N> operator*(const Bounded<N>& a, const Bounded<N>& b) {
  using T = Base<N>;
  T size_a = magnitude(high(a.value)) + a.error, size_b = magnitude(high(b.value));
  T lost = lesser(size_a, size_b + b.error) > 0 ? broadcast<T>(underflow<T>) : T{};  // a product with 0 is exact
  return with_roundoff(product_of(a.value, b.value), (size_a * b.error + size_b * a.error) + lost);
}
template <class N> LONG_OPERATION Bounded<N> operator/(const Bounded<N>& a, const Bounded<N>& b) {
  using T = Base<N>;
  N q = quotient_of(a.value, b.value);
  T least_divisor = magnitude(high(b.value)) - b.error * broadcast<T>(1 + slack<T>);
  T lost = magnitude(high(a.value)) + a.error > 0 ? broadcast<T>(underflow<T>) : T{};
  // |q| db, and the remainder of a long division, may underflow before they are divided. If nothing can, the dividend
  // is 0 instead of a subnormal number, whose division is slow.
  T lost_before = std::is_same_v<N, T> ? choose<T>(b.error > 0, lost, T{}) : lost;
  T error = (a.error + magnitude(high(q)) * b.error + lost_before) / least_divisor;
  return with_roundoff(q, choose<T>(least_divisor > 0, error + lost, broadcast<T>(__builtin_inf())));
}
template <class N> LONG_OPERATION Bounded<N> root(const Bounded<N>& a) {
  using T = Base<N>;
  N s = root_of(a.value);
  T error = a.error;
  if constexpr (!std::is_same_v<N, T>) error += high(a.value) > 0 ? broadcast<T>(underflow<T>) : T{};
  T far_from_0 = error / high(s), near_0 = root_of_base(error);
  return with_roundoff(s, choose<T>(far_from_0 < near_0, far_from_0, near_0));
}
template <class N> INLINE Truth<Base<N>> compare(Mask<Base<N>> truth, const Bounded<N>& a, const Bounded<N>& b) {
  using T = Base<N>;
  T errors = (a.error + b.error) * broadcast<T>(1 + slack<T>);
  return {truth, (Mask<T>)((magnitude(high(sum_of(a.value, -b.value))) > errors) | (errors == 0))};
}
template <class N> SHORT_OPERATION Truth<Base<N>> less(const Bounded<N>& a, const Bounded<N>& b) {
  return compare(less(a.value, b.value), a, b);
}
template <class N> SHORT_OPERATION Truth<Base<N>> less_equal(const Bounded<N>& a, const Bounded<N>& b) {
  return compare(less_equal(a.value, b.value), a, b);
}
template <class N> SHORT_OPERATION Truth<Base<N>> equal(const Bounded<N>& a, const Bounded<N>& b) {
  return compare(equal(a.value, b.value), a, b);
}
template <class T> INLINE Truth<T> operator&(const Truth<T>& a, const Truth<T>& b) {
  return {(Mask<T>)(a.value & b.value),
          (Mask<T>)((a.certain & b.certain) | (a.certain & negation(a.value)) | (b.certain & negation(b.value)))};
}
template <class T> INLINE Truth<T> operator|(const Truth<T>& a, const Truth<T>& b) {
  return {(Mask<T>)(a.value | b.value),
          (Mask<T>)((a.certain & b.certain) | (a.certain & a.value) | (b.certain & b.value))};
}
template <class T> INLINE Truth<T> negation(const Truth<T>& a) { return {negation(a.value), a.certain}; }
// A bound that is NaN stays NaN, and counts as infinite.
template <class T> INLINE T greater_error(T a, T b) { return choose<T>(a < b, b, choose<T>(a >= b, a, a + b)); }
template <class N> SHORT_OPERATION Bounded<N> choose(const Truth<Base<N>>& c, const Bounded<N>& a,
                                                     const Bounded<N>& b) {
  using T = Base<N>;
  T error = choose<T>(c.value, a.error, b.error);
  if (__builtin_expect(any(negation(c.certain)), 0)) {
    T hull =
        magnitude(high(sum_of(a.value, -b.value))) * broadcast<T>(1 + slack<T>) + choose<T>(c.value, b.error, a.error);
    error = choose<T>(c.certain, error, greater_error(error, hull));
  }
  return {choose(c.value, a.value, b.value), error};
}
template <class T> INLINE Truth<T> choose(const Truth<T>& c, const Truth<T>& a, const Truth<T>& b) {
  return (c & a) | (negation(c) & b) | (a & b);
}
template <class N> INLINE N value(const Bounded<N>& a) { return a.value; }
template <class N> INLINE Report<N> report(const Bounded<N>& a) { return report(a.value); }
template <class N> INLINE Base<N> high(const Bounded<N>& a) { return high(a.value); }
template <class N> INLINE Base<N> error_of(const Bounded<N>& a) { return a.error; }
template <class N> INLINE Bounded<N> widened(const Bounded<N>& x, N by) {
  return {x.value, x.error + magnitude(high(by)) * broadcast<Base<N>>(1 + slack<Base<N>>)};
}
template <class T> INLINE Mask<T> plain_truth(const Truth<T>& a) { return a.value; }
template <class T> INLINE bool may_be_true(const Truth<T>& a) { return any((Mask<T>)(a.value | negation(a.certain))); }
template <class T> INLINE Mask<T> certainly_true(const Truth<T>& a) { return a.value & a.certain; }

// --- Making numbers ----------------------------------------------------------------------------------
// constant, truth: from a literal. lifted: from a number of a type that carries less. read: from an input and its
// error.

template <class N> struct Make {  // a base
  INLINE N constant(double x) { return broadcast<N>(x); }
  INLINE Mask<N> truth(bool x) { return broadcast_truth<N>(x); }
  INLINE N lifted(N x) { return x; }
  INLINE N read(Base<N> x, Base<N>) { return x; }
};
template <class T> struct Make<DoubleDouble<T>> {
  INLINE DoubleDouble<T> constant(double x) { return {broadcast<T>(x), T{}}; }
  INLINE Mask<T> truth(bool x) { return broadcast_truth<T>(x); }
  INLINE DoubleDouble<T> lifted(T x) { return {x, T{}}; }
  INLINE DoubleDouble<T> lifted(const DoubleDouble<T>& x) { return x; }
  INLINE DoubleDouble<T> read(T x, T) { return {x, T{}}; }
};
template <class N> struct Make<Bounded<N>> {
  INLINE Bounded<N> constant(double x) {
    double lost = x - x == 0 ? x - static_cast<double>(static_cast<Lane<Base<N>>>(x)) : 0;
    return {Make<N>::constant(x), broadcast<Base<N>>((lost < 0 ? -lost : lost) * (1 + slack<Base<N>>))};
  }
  INLINE Truth<Base<N>> truth(bool x) { return {broadcast_truth<Base<N>>(x), broadcast_truth<Base<N>>(true)}; }
  INLINE Bounded<N> lifted(Base<N> x) { return {Make<N>::lifted(x), Base<N>{}}; }
  INLINE Bounded<N> lifted(const DoubleDouble<Base<N>>& x) { return {x, Base<N>{}}; }
  INLINE Bounded<N> read(Base<N> x, Base<N> error) { return {Make<N>::read(x, error), error}; }
};
template <class N> INLINE N constant(double x) { return Make<N>::constant(x); }
template <class N> INLINE auto truth(bool x) { return Make<N>::truth(x); }
template <class N> using Condition = decltype(Make<N>::truth(true));
template <class N, class X> INLINE N lifted(X x) { return Make<N>::lifted(x); }
