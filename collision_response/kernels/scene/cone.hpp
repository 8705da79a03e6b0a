// A contact as a cone of friction, K = { |P_t| <= mu P_n }, whose impulses cost work.
#pragma once
#include "vectors.hpp"

template <class R>
struct Cone {
  static constexpr double GIVE = 1e-14;  // of a contact that takes nearly its full part
  static constexpr int WORK = 90;  // multiplications of velocity(), project() and add_effect()
  using Slope = std::array<std::array<R, 3>, 3>;

  int body[2];  // -1: immovable
  R row[2][3][6];  // of B: along the normal and two tangents, for each body
  std::array<R, 3> w;
  double mu, share;  // share: rho_i / rho
  // How much part in the loads it takes, from 0 to 1. The less, the less its velocity is kept, and the more work its
  // impulses cost: give |P_i|^2 / 2.
  double part;
  double load;  // the impulse without friction, relative to the greatest

  bool is_partial() const { return part < 1; }
  double give() const { return is_partial() ? GIVE / (part * part * part * part) : 0; }
  // The part of a body in n.K n, from 0 to 1.
  double own_part(int side) const {
    double square = 0;
    for (const R& x : row[side][0]) square += high(x) * high(x);
    return square;
  }
  // Whether it touches a body that has less than a thousandth part.
  bool has_heavy_body() const {
    constexpr double HEAVY = 1e-3;
    return (body[0] >= 0 && own_part(0) < HEAVY) || (body[1] >= 0 && own_part(1) < HEAVY);
  }

  // B y: the velocity by a motion of the bodies.
  std::array<R, 3> velocity(const R* y) const {
    SumOfProducts<R> v[3];
    for (int side = 0; side < 2; ++side)
      if (body[side] >= 0) {
        const R* of = y + 6 * body[side];
        for (int k = 0; k < 6; ++k)
          for (int a = 0; a < 3; ++a) v[a].add(row[side][a][k], of[k]);
      }
    return {v[0].total(), v[1].total(), v[2].total()};
  }
  // y += B^T P
  void add_effect(const std::array<R, 3>& P, List<R>& y) const {
    for (int side = 0; side < 2; ++side)
      if (body[side] >= 0) {
        R* of = &y[6 * body[side]];
        for (int k = 0; k < 6; ++k) {
          SumOfProducts<R> sum{of[k]};
          for (int a = 0; a < 3; ++a) sum.add(row[side][a][k], P[a]);
          of[k] = sum.total();
        }
      }
  }

  // Project q on the cone; `slope` is the derivative of the projection.
  void project(std::array<R, 3>& q, Slope& slope) const {
    const R t = root(q[1] * q[1] + q[2] * q[2]), one = constant<R>(1), none{};
    slope = {};
    if (less_equal(none, q[0]) && less_equal(t, mu * q[0])) {
      for (int k = 0; k < 3; ++k) slope[k][k] = one;
      return;
    }
    if (less_equal(mu * t, -q[0])) {
      q = {};
      return;
    }
    const bool turned = high(t) > 0;
    const R d[2] = {turned ? q[1] / t : none, turned ? q[2] / t : none}, whole = one / (one + mu * constant<R>(mu));
    const R n = (q[0] + mu * t) * whole, round = turned ? mu * n / t : none;
    slope[0][0] = whole;
    for (int k = 0; k < 2; ++k) {
      slope[0][1 + k] = slope[1 + k][0] = mu * whole * d[k];
      for (int l = 0; l < 2; ++l)
        slope[1 + k][1 + l] = (mu * mu * whole - round) * d[k] * d[l] + (k == l ? round : none);
    }
    q = {n, mu * n * d[0], mu * n * d[1]};
  }
};
