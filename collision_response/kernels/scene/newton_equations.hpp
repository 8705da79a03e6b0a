// Newton's equations of a programme of cones, for the velocities eta of the bodies and the multipliers lambda: see
// cones.hpp. S_i is the derivative of the projection on cone i. The matrix is
//
//     M = | 1 + sum rho_i B_i^T S_i B_i   N^T             |
//         | N                             N N^T + 1/sigma |
//
// with rho_i / (1 + rho_i give_i) in place of rho_i for contacts that give.
#pragma once
#include "cone.hpp"
#include "skyline.hpp"

// In numbers T, which may have fewer digits than the numbers R of the cones.
template <class T>
class NewtonEquations {
 public:
  // Lay out the matrix, and find the part of it that does not depend on impulses.
  template <class R>
  void lay_out(const List<Cone<R>>& cones, const ContactGraph& graph) {
    const List<List<int>> groups = graph.groups();
    first_multiplier = 6 * graph.body_count;
    matrix.lay_out(graph.order(), groups);
    for (int i = 0; i < first_multiplier; ++i) matrix.at(i, i) = constant<T>(1);
    for (int b = 0; b < graph.body_count; ++b) {
      auto normal = [&](int i) {
        const Cone<R>& cone = cones[i - first_multiplier];
        return rounded(cone.row[cone.body[0] == b ? 0 : 1][0]);
      };
      for (size_t s = 6; s < groups[b].size(); ++s) {
        const int i = groups[b][s];
        const std::array<T, 6> row = normal(i);
        for (int k = 0; k < 6; ++k) matrix.at(6 * b + k, i) += row[k];
        for (size_t t = 6; t <= s; ++t) matrix.at(i, groups[b][t]) += dot(row.data(), normal(groups[b][t]).data(), 6);
      }
    }
    fixed = matrix.entries;
  }

  // Set the matrix anew.
  void begin() { matrix.entries = fixed; }
  void add_at_multiplier(size_t i, double x) {
    const int at = first_multiplier + static_cast<int>(i);
    matrix.at(at, at) += constant<T>(x);
  }
  // Add size B^T slope B of one contact.
  template <class R>
  void add_contact(const Cone<R>& cone, const typename Cone<R>::Slope& slope, double size) {
    if (high(slope[0][0]) == 0) return;  // no impulse at this contact
    std::array<std::array<T, 6>, 3> row[2], part[2];
    for (int side = 0; side < 2; ++side) {
      if (cone.body[side] < 0) continue;
      for (int a = 0; a < 3; ++a) row[side][a] = rounded(cone.row[side][a]);
      for (int a = 0; a < 3; ++a)
        for (int k = 0; k < 6; ++k) {
          SumOfProducts<T> sum;
          for (int b = 0; b < 3; ++b) sum.add(rounded_to<T>(slope[a][b]), row[side][b][k]);
          part[side][a][k] = size * sum.total();
        }
    }
    for (int s = 0; s < 2; ++s)
      for (int t = 0; t < 2; ++t) {
        if (cone.body[s] < 0 || cone.body[t] < 0) continue;
        const int rows = 6 * cone.body[s], columns = 6 * cone.body[t];
        if (!matrix.is_below(rows, columns)) continue;
        for (int k = 0; k < 6; ++k) {
          T* to = &matrix.at(rows + k, columns);
          const int last = rows == columns ? k + 1 : 6;
          for (int l = 0; l < last; ++l) {
            SumOfProducts<T> sum;
            for (int a = 0; a < 3; ++a) sum.add(row[s][a][k], part[t][a][l]);
            to[l] += sum.total();
          }
        }
      }
  }
  // step = -M^-1 gradient. The matrix becomes its factor.
  template <class R>
  void solve(const List<R>& gradient, List<R>& step) {
    matrix.solve(gradient, step);
  }
  double multiplications() const { return matrix.multiplications(); }

 private:
  Skyline<T> matrix;
  List<T> fixed;  // the entries that do not depend on impulses
  int first_multiplier = 0;

  template <class R>
  static std::array<T, 6> rounded(const R (&given)[6]) {
    std::array<T, 6> row;
    for (int k = 0; k < 6; ++k) row[k] = rounded_to<T>(given[k]);
    return row;
  }
};
