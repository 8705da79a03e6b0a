// Vectors of any length, vectors along the three axes of space or of a contact, and double-double numbers.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "../numbers.hpp"

using DD = DoubleDouble<double>;
using Vector = std::vector<double>;
using Axes = std::array<double, 3>;

inline double dot(const Vector& a, const Vector& b) { return std::inner_product(a.begin(), a.end(), b.begin(), 0.0); }
inline Axes cross(const double* a, const double* b) { return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}; }

// y += by x
inline void increase(Vector& y, double by, const Vector& x) {
  for (size_t i = 0; i < y.size(); ++i) y[i] += by * x[i];
}
