// A bound on the error of projections that is proportional to their residuals.
//
// A projection takes velocities v to w = v + M^-1 N q, with q >= 0 and r = N^T w, where r_i = 0 if q_i > 0, and r_i >= 0
// elsewhere. Rounding leaves some r_i a little off. If a small velocity d makes up for it,
//
//     r_i + N_i^T d = 0   where q_i > 0          r_i + N_i^T d >= 0   elsewhere
//
// then w + d is the exact projection of v + d. Projections do not increase distances: that of v is within 2 |d| of w.
//
// Let S be a basis of independent contacts, scaled to a diagonal of A of 1. The least d with N_S^T d = t has the size
//
//     |d| = sqrt(t.A_SS^-1 t) <= sum |t_s| sqrt((A_SS^-1)_ss)
//
// Contacts of the same bodies along the same normal n depend on each other: N_i is affine in the point x_i, and the part
// of x_i along n does not matter. So with three of them in the basis, N_i = c_0 N_0 + c_1 N_1 + c_2 N_2, exactly. What
// makes up for these three does so for all. Other contacts outside of the basis must separate faster than |d|; in the
// basis, t is 0 for those that separate, and d leaves them alone.
#pragma once
#include <optional>

#include "assembly.hpp"

template <class R>
class ProjectionBound {
 public:
  // With a basis of the contacts `those`.
  ProjectionBound(const Assembly& assembly, const List<int>& those)
      : assembly(assembly), size(assembly.count), beside(assembly.count) {
    ActiveSet<R> basis(assembly.couplings<R>().data(), assembly.count);
    const List<int> others = basis.span(those);
    const List<R> diagonal = basis.diagonal_of_inverse();
    // A is rounded, the more the thinner a body is, and so is the factor.
    double roundings = static_cast<double>(assembly.count) * assembly.count;
    for (const AssembledBody& body : assembly.bodies) roundings = std::fmax(roundings, std::pow(norm_ratio(body), 2));
    for (const R& one : diagonal) rounding += high(one) * roundings * 16 * Traits<R>::roundoff;
    is_known = !assembly.is_locked && rounding < 0.25;
    if (!is_known) return;
    for (size_t k = 0; k < diagonal.size(); ++k) size[basis.members[k]] = std::sqrt(high(diagonal[k])) * (1 + rounding);
    for (int i : others) beside[i] = contacts_beside(i, basis);
  }

  // The bound, in the metric of kinetic energy, for impulses q that leave the contacts `among` velocities r.
  double operator()(const List<int>& among, const List<DD>& q, const List<N>& r) const {
    if (!is_known) return INFINITY;
    List<char> separates(assembly.count, true);
    for (int i : among) separates[i] = !(q[i].h > 0);
    for (;;) {
      const std::optional<Vector> t = changes_that_make_up_for(among, separates, r);
      const double d = t ? dot(*t, size) * ROUND_UP : INFINITY;
      bool is_enough = true;
      for (int i : among) {
        const double change = t && size[i] > 0 ? (*t)[i] * ROUND_UP : d;
        if (separates[i] && !((high(r[i]) - width(r[i])) * assembly.contacts[i].scale >= change))
          separates[i] = is_enough = false;  // d might stop it from separating: make up for it, too
      }
      if (is_enough) return 2 * d;
    }
  }

 private:
  // The sizes of t, or more, for a d that lets the contacts `separates` separate. Nothing if there may be no such d.
  std::optional<Vector> changes_that_make_up_for(const List<int>& among, const List<char>& separates,
                                                 const List<N>& r) const {
    Vector off(assembly.count), t(assembly.count);  // off: how far r is from 0
    for (int i : among) {
      if (separates[i]) continue;
      off[i] = (std::fabs(high(r[i])) + width(r[i])) * assembly.contacts[i].scale;
      if (size[i] > 0) t[i] = off[i];
    }
    for (int i : among) {
      if (separates[i] || size[i] > 0) continue;
      const Beside& of = beside[i];
      if (!of.is_known) return {};
      int spare = -1;  // a contact beside it that separates, and can make up for it
      double rest = off[i];
      for (int k = 0; k < 3; ++k)
        if (!separates[of.contact[k]]) rest += (of.c[k] + of.rounding) * off[of.contact[k]];
        else if (spare < 0 || of.c[k] > of.c[spare]) spare = k;
      if (spare < 0) continue;
      if (!(of.c[spare] > 2 * of.rounding)) return {};
      for (int s : of.contact)
        if (separates[s] && t[s] > 0) return {};  // it makes up for another contact already
      t[of.contact[spare]] = rest / (of.c[spare] - of.rounding);
    }
    return t;
  }

  // Three contacts of the basis, and how a contact beside them depends on them.
  struct Beside {
    bool is_known = false;
    int contact[3];
    double c[3];  // sizes, without signs
    double rounding;  // of each c
  };

  Beside contacts_beside(int i, const ActiveSet<R>& basis) const {
    Beside found{};
    int count = 0;  // at most three of one normal are independent
    List<R> line;
    for (size_t k = 0; k < basis.members.size() && count < 3; ++k) {
      const int s = basis.members[k];
      if (!are_beside(assembly.contacts[i], assembly.contacts[s])) continue;
      if (count == 0) basis.line(i, line);
      found.contact[count] = s;
      found.c[count++] = std::fabs(high(line[k]));
    }
    found.rounding = rounding * (found.c[0] + found.c[1] + found.c[2]);
    found.is_known = count == 3;
    return found;
  }
  // Whether two contacts have the same bodies, in whichever order, the same normal, and no wall that moves.
  static bool are_beside(const AssembledContact& i, const AssembledContact& j) {
    const bool turned = i.body[0] != j.body[0];
    for (int side = 0; side < 2; ++side)
      if (i.body[side] != j.body[turned ? 1 - side : side] || i.wall[side] >= 0 || j.wall[side] >= 0) return false;
    return std::equal(i.normal, i.normal + 3, j.normal, [&](double a, double b) { return a == (turned ? -b : b); });
  }

  const Assembly& assembly;
  // Of the least d that gives a contact a velocity of 1, and the rest of the basis 0. 0: not in the basis.
  Vector size;
  List<Beside> beside;  // of the contacts outside of the basis
  bool is_known = false;
  double rounding = 0;  // relative, of what is computed by the factor of A
};
