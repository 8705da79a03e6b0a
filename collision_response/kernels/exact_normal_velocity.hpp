// The normal velocity of two bodies at a contact without rounding. No number of digits shows that bodies do not approach
// at all, or just as fast as the restitution threshold.
//
// Source of the sums: Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates",
// Discrete & Computational Geometry 18 (1997), section 2.
#pragma once
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "constants.hpp"
#include "numbers.hpp"

// A sum of products of doubles. It is exact, unless a product leaves the range in which its rounding is a double.
class ExactSum {
 public:
  using DD = DoubleDouble<double>;

  // Not 0, in the order of their size, and no two have bits of the same weight: so the last one has the sign of the sum.
  const std::vector<double>& parts() const { return parts_; }
  bool is_exact() const { return is_exact_ && std::isfinite(sign()); }
  double sign() const { return parts_.empty() ? 0 : parts_.back(); }
  DD rounded() const {
    DD sum{0, 0};
    for (double part : parts_) sum = sum + DD{part, 0};
    return sum;
  }

  void add(double x) {
    if (x == 0) return;
    size_t kept = 0;
    for (double part : parts_) {
      const DD sum = exact_sum(x, part);
      if (sum.l != 0) parts_[kept++] = sum.l;
      x = sum.h;
    }
    parts_.resize(kept);
    if (x != 0) parts_.push_back(x);
  }
  void add_product(double a, double b) {
    const DD p = product(a, b);
    add(p.l);
    add(p.h);
  }
  void add_product(double a, double b, double c) {
    const DD p = product(a, b);
    add_product(p.l, c);
    add_product(p.h, c);
  }

 private:
  static constexpr double LEAST_PRODUCT = 0x1p-960;  // the rounding of a smaller one may underflow

  DD product(double a, double b) {
    const DD p = exact_product(a, b);
    if (a != 0 && b != 0 && !(std::fabs(p.h) >= LEAST_PRODUCT)) is_exact_ = false;
    return p;
  }

  std::vector<double> parts_;
  bool is_exact_ = true;
};

// The spin of a body that moves its contacts: without that about axes without inertia. Nothing if it would be rounded.
inline std::optional<std::array<double, 3>> effective_spin(const double* body) {
  const double *given = body + BODY_ANGULAR_VELOCITY_X, *q = body + BODY_ORIENTATION_X, *com = body + BODY_COM_X;
  auto are_zero = [](const double* x) { return x[0] == 0 && x[1] == 0 && x[2] == 0; };
  std::array<double, 3> spin = {given[0], given[1], given[2]};
  if (are_zero(given) || !(body[BODY_MASS] < INFINITY)) return spin;
  const double size = body[BODY_INERTIA_XX] + body[BODY_INERTIA_YY] + body[BODY_INERTIA_ZZ];
  if (size == 0) {
    if (!are_zero(com)) return {};
    return std::array<double, 3>{};
  }
  // Of moments that add up to 1, none is less than the determinant.
  auto part = [&](int i) { return body[i] / size; };
  const double xx = part(BODY_INERTIA_XX), yy = part(BODY_INERTIA_YY), zz = part(BODY_INERTIA_ZZ),
               xy = part(BODY_INERTIA_XY), xz = part(BODY_INERTIA_XZ), yz = part(BODY_INERTIA_YZ);
  if (xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz) > 0x1p-30) return spin;
  if (xy != 0 || xz != 0 || yz != 0 || !are_zero(q) || !are_zero(com)) return {};
  const double moment[3] = {xx, yy, zz};
  for (int k = 0; k < 3; ++k) {
    if (moment[k] == 0) spin[k] = 0;
    else if (!(moment[k] > 0x1p-30)) return {};
  }
  return spin;
}

// n.u = n.(v_a - v_b) + n.(w_a x d_a - w_b x d_b) of rigid bodies, with d = point - position. Nothing if sums of doubles
// cannot hold it.
inline std::optional<ExactSum> exact_normal_velocity(const double* body_a, const double* body_b, const double* point,
                                                     const double* normal) {
  ExactSum n_u;
  for (int side = 0; side < 2; ++side) {
    const double* body = side ? body_b : body_a;
    const auto spin = effective_spin(body);
    if (!spin) return {};
    const double *v = body + BODY_VELOCITY_X, *w = spin->data(), *position = body + BODY_POSITION_X;
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const double n = side ? -normal[k] : normal[k];
      n_u.add_product(n, v[k]);
      n_u.add_product(n, w[i], point[j]);
      n_u.add_product(-n, w[i], position[j]);
      n_u.add_product(-n, w[j], point[i]);
      n_u.add_product(n, w[j], position[i]);
    }
  }
  if (!n_u.is_exact()) return {};
  return n_u;
}

// n.u of the unit normal.
inline double velocity_along(const ExactSum& n_u, const double* normal) {
  int exponent;
  std::frexp(std::fmax(std::fabs(normal[0]), std::fmax(std::fabs(normal[1]), std::fabs(normal[2]))), &exponent);
  auto scaled = [exponent](double x) { return std::ldexp(x, -exponent); };
  return scaled(n_u.rounded().h) / std::hypot(scaled(normal[0]), scaled(normal[1]), scaled(normal[2]));
}

// Whether bodies with this n.u approach more slowly than a threshold: n.u < 0 and (n.u)^2 < threshold^2 n.n. The squares
// matter only if the speeds nearly agree. Nothing if doubles cannot hold them.
inline std::optional<bool> approach_below(const ExactSum& n_u, const double* normal, double threshold) {
  if (!(n_u.sign() < 0)) return false;
  const double speed = -velocity_along(n_u, normal);
  const bool are_near = std::fabs(speed - threshold) <= threshold * 0x1p-30;
  if (!are_near && threshold >= 0x1p-1000) return speed < threshold;
  ExactSum excess;
  for (double a : n_u.parts())
    for (double b : n_u.parts()) excess.add_product(a, b);
  for (int k = 0; k < 3; ++k) {
    ExactSum limit;
    limit.add_product(threshold, normal[k]);
    if (!limit.is_exact()) return {};
    for (double a : limit.parts())
      for (double b : limit.parts()) excess.add_product(-a, b);
  }
  if (!excess.is_exact()) return {};
  return excess.sign() < 0;
}
