// Vectors of any length, vectors along the three axes of space or of a contact, and double-double numbers.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include "list.hpp"

#include "../numbers.hpp"

using DD = DoubleDouble<double>;
using Vector = List<double>;
using Axes = std::array<double, 3>;

constexpr double ROUND_UP = 1 + 1e-9;  // makes an upper bound of a sum of doubles that are not negative

INLINE DD operator+(const DD& a, double b) { return a + DD{b, 0}; }
INLINE DD operator*(double a, const DD& b) { return DD{a, 0} * b; }
INLINE DD operator/(const DD& a, double b) { return a / DD{b, 0}; }
INLINE DD& operator+=(DD& a, const DD& b) { return a = a + b; }
INLINE DD& operator-=(DD& a, const DD& b) { return a = a - b; }

template <class R> R rounded_to(const DD& x) {  // to the digits of R
  if constexpr (is_scalar<R>) return x.h;
  else return x;
}
template <class R> R rounded_to(double x) { return constant<R>(x); }

// A sum of products. That of double-double adds up what it loses in a number of its own, so that no addition waits for
// the rounding of the one before (Ogita, Rump & Oishi, "Accurate Sum and Dot Product", SIAM J. Sci. Comput. 26, 2005).
template <class R>
struct SumOfProducts {
  R sum{};
  void add(const R& a, const R& b) { sum += a * b; }
  R total() const { return sum; }
};
template <>
struct SumOfProducts<DD> {
  DD sum{};
  void add(const DD& a, const DD& b) {
    const DD product = exact_product(a.h, b.h), next = exact_sum(sum.h, product.h);
    sum = {next.h, sum.l + (next.l + (product.l + (a.h * b.l + a.l * b.h)))};
  }
  DD total() const { return quick_sum(sum.h, sum.l); }
};

inline double length_of(double a, double b) { return std::hypot(a, b); }
inline DD length_of(const DD& a, const DD& b) { return root(a * a + b * b); }

// The inner product, in four sums, which processors compute side by side.
template <class R>
INLINE R dot(const R* a, const R* b, size_t count) {
  SumOfProducts<R> sum, sums[4];
  size_t k = 0;
  for (; k + 4 <= count; k += 4)
    for (size_t l = 0; l < 4; ++l) sums[l].add(a[k + l], b[k + l]);
  if (k > 0) sum.sum = (sums[0].total() + sums[1].total()) + (sums[2].total() + sums[3].total());
  for (; k < count; ++k) sum.add(a[k], b[k]);
  return sum.total();
}
template <class V>
auto dot(const V& a, const V& b) {
  return dot(a.data(), b.data(), a.size());
}
template <class V>
double length_of(const V& v) {
  return std::sqrt(dot(v, v));
}
template <class R>
std::array<R, 3> cross(const R* a, const R* b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// y += by x
template <class R>
void increase(List<R>& y, double by, const List<R>& x) {
  for (size_t i = 0; i < y.size(); ++i) y[i] += by * x[i];
}
inline Vector difference(Vector x, const Vector& y) {
  increase(x, -1, y);
  return x;
}
