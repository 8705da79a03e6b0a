// A bound on the error of projections that is proportional to their residuals.
//
// A projection takes velocities v to w = v + M^-1 N q, with q >= 0 and r = N^T w, where r_i = 0 if q_i > 0, and r_i >= 0
// elsewhere. Rounding leaves some r_i a little off. If a small velocity d makes up for it,
//
//     r_i + N_i^T d = 0   where q_i > 0          r_i + N_i^T d >= 0   elsewhere
//
// then w + d is the exact projection of v + d. Projections do not increase distances: that of v is within 2 |d| of w.
//
// Let S be a basis of independent contacts. The least d with N_S^T d = t has the size
//
//     |d| = sqrt(t.A_SS^-1 t) <= sum |t_s| sqrt((A_SS^-1)_ss)
//
// A contact i outside of the basis has to separate, unless it is the fourth corner of a rectangle: i = a - b + c, exactly,
// with a, b and c in the basis. Then r_i = r_a - r_b + r_c, and what makes up for three of them does so for the fourth.
#pragma once
#include "assembly.hpp"

class ResidualBound {
 public:
  explicit ResidualBound(const Assembly& assembly) : assembly(assembly), size(assembly.count), corners(assembly.count) {
    ActiveSet<double> basis(assembly.A.data(), assembly.count);
    const std::vector<int> others = basis.span(assembly.all_contacts());
    const Vector diagonal = basis.diagonal_of_inverse();
    // The factor is rounded: this must not change the inverse by more than its half.
    const double sum = std::accumulate(diagonal.begin(), diagonal.end(), 0.0);
    is_known = !assembly.is_locked && sum * assembly.count * assembly.count < 0x1p48;
    for (size_t k = 0; k < diagonal.size(); ++k)
      size[basis.members[k]] = assembly.contacts[basis.members[k]].scale * std::sqrt(2 * diagonal[k]);
    std::vector<char> is_corner(assembly.count);
    for (int i : others) find_rectangle(i, basis.members, is_corner);
    for (const AssembledContact& contact : assembly.contacts)
      tiny = std::fmax(tiny, std::fabs(high(contact.velocity)) * contact.scale * 0x1p-60);
  }

  // The bound, in the metric of kinetic energy, for impulses q that leave the contacts `among` velocities r.
  double operator()(const std::vector<int>& among, const std::vector<DD>& q, const std::vector<N>& r) const {
    Vector off(assembly.count, -1), t(assembly.count);  // off: how far r is from 0; -1: the contact separates
    for (int i : among)
      if (q[i].h > 0 || !(high(r[i]) * assembly.contacts[i].scale > tiny)) off[i] = std::fabs(high(r[i])) + width(r[i]);
    for (int i : among) {
      if (!(off[i] >= 0)) continue;
      if (size[i] > 0) {
        t[i] += off[i];
        continue;
      }
      if (corners[i][0] == corners[i][1]) return INFINITY;  // not a corner
      double sum = off[i];
      bool all_off = true;
      for (int s : corners[i]) {
        sum += std::fmax(off[s], 0);
        all_off = all_off && off[s] >= 0;
      }
      for (int s : corners[i]) t[s] += all_off ? 0 : sum;
    }
    double d = 0;
    for (int i = 0; i < assembly.count; ++i) d += t[i] * size[i];
    d *= 1 + 1e-9;
    for (int i : among)
      if (!(off[i] >= 0) && !(high(r[i]) - width(r[i]) > d / assembly.contacts[i].scale)) return INFINITY;
    return is_known ? 2 * d : INFINITY;
  }

 private:
  void find_rectangle(int i, const std::vector<int>& basis, std::vector<char>& is_corner) {
    std::vector<int> beside;  // at most three, because all have the same normal
    for (int s : basis)
      if (!is_corner[s] && is_beside(assembly.contacts[i], assembly.contacts[s])) beside.push_back(s);
    if (beside.size() != 3) return;
    for (int turn = 0; turn < 3; ++turn) {
      std::rotate(beside.begin(), beside.begin() + 1, beside.end());
      const double* x[4] = {assembly.contacts[beside[0]].point, assembly.contacts[beside[2]].point,
                            assembly.contacts[beside[1]].point, assembly.contacts[i].point};
      bool is_rectangle = true;
      for (int k = 0; k < 3; ++k) {
        const DD ends = exact_sum(x[0][k], x[1][k]), others = exact_sum(x[2][k], x[3][k]);
        is_rectangle = is_rectangle && ends.h == others.h && ends.l == others.l;
      }
      if (!is_rectangle) continue;
      std::copy(beside.begin(), beside.end(), corners[i].begin());
      for (int s : beside) is_corner[s] = true;
      return;
    }
  }
  // Whether two contacts have the same bodies and normal, and no wall that moves.
  static bool is_beside(const AssembledContact& i, const AssembledContact& j) {
    auto same = [](const auto& a, const auto& b) { return std::equal(std::begin(a), std::end(a), std::begin(b)); };
    const int none[2] = {-1, -1};
    return same(i.body, j.body) && same(i.normal, j.normal) && same(i.wall, none) && same(j.wall, none);
  }

  const Assembly& assembly;
  Vector size;  // of the least d that gives a contact a velocity of 1, and the rest of the basis 0; 0: not in the basis
  std::vector<std::array<int, 3>> corners;  // of the same rectangle; all are 0 if there is none
  bool is_known = false;
  double tiny = 0;  // a velocity that may be rounding
};
