// Minimise  x.A x / 2 + b.x  over x >= 0, for a positive semi-definite A with a unit diagonal. At the minimum
// x >= 0, A x + b >= 0, x.(A x + b) = 0: a linear complementarity problem.
//
// The method keeps A x + b = 0 on an active set of independent columns, held as a Cholesky factor. In each turn the
// most negative component of A x + b enters, along the line that keeps those zeros; components of x that reach 0 on the
// way leave. A column that depends on the active ones enters in exchange for one of them. If there is none to exchange
// it for, there is no minimum (Keller, "The General Quadratic Optimization Problem", Math. Programming 5, 1973).
//
// R is double or double-double. Contacts that are nearly dependent, such as the corners of a box that are slightly off
// a plane, need more digits. scene/rational_algebra.py has the same method in exact arithmetic.
#pragma once
#include "../numbers.hpp"
#include "vectors.hpp"

// Values up to which it may be rounding: a pivot; a component of a line; a slope, relative to b and x.
template <class R> constexpr double DEPENDENT = 1e-11;
template <class R> constexpr double UNMOVED = 1e-14;
template <> inline constexpr double DEPENDENT<DD> = 1e-29;
template <> inline constexpr double UNMOVED<DD> = 1e-30;
// A pivot below which only half of the digits of double-double are known.
constexpr double NEARLY_DEPENDENT = 1e-18;

template <class R>
class ActiveSet {
 public:
  ActiveSet(const R* matrix, int stride) : A(matrix), stride(stride), is_member(stride) {}

  std::vector<int> members;
  bool has(int i) const { return is_member[i]; }

  // Make column i active if it is independent of the active ones. Whether it is.
  bool append(int i) {
    size_t m = members.size();
    factor.resize((m + 1) * (m + 2) / 2);
    R* row = &factor[m * (m + 1) / 2];
    for (size_t k = 0; k < m; ++k) row[k] = A[i * stride + members[k]];
    forward(row, m);
    const R pivot = A[i * stride + i] - dot(row, row, m);
    if (!(high(pivot) > DEPENDENT<R>)) return false;
    row[m] = root(pivot);
    members.push_back(i);
    is_member[i] = true;
    return true;
  }

  // Make an independent subset of `among` active, the column farthest from dependent first. Returns the others: they
  // depend on the subset, with pivots up to `dependent`.
  std::vector<int> span(const std::vector<int>& among, double dependent = DEPENDENT<R>) {
    std::vector<int> left(among);
    const size_t width = among.size();
    std::vector<R> rows(stride * width), pivot(stride);  // rows of the factor
    for (int i : left) pivot[i] = A[i * stride + i];
    while (!left.empty()) {
      size_t best = 0;
      for (size_t k = 1; k < left.size(); ++k)
        if (less(pivot[left[best]], pivot[left[k]])) best = k;
      int chosen = left[best];
      if (!(high(pivot[chosen]) > dependent)) break;
      left.erase(left.begin() + static_cast<long>(best));
      const size_t m = members.size();
      R* row = &rows[chosen * width];
      row[m] = root(pivot[chosen]);
      for (int i : left) {
        R* other = &rows[i * width];
        other[m] = (A[i * stride + chosen] - dot(other, row, m)) / row[m];
        pivot[i] = pivot[i] - other[m] * other[m];
      }
      factor.insert(factor.end(), row, row + m + 1);
      members.push_back(chosen);
      is_member[chosen] = true;
    }
    return left;
  }

  // How far the last active column is from dependent on the others.
  double last_pivot() const { return high(factor.back() * factor.back()); }

  void drop(size_t place) {
    std::vector<int> later(members.begin() + place + 1, members.end());
    for (size_t k = place; k < members.size(); ++k) is_member[members[k]] = false;
    members.resize(place);
    for (int i : later) append(i);
  }

  // y <- A_PP^-1 y, in place, for the active set P.
  void solve(R* y) const {
    forward(y, members.size());
    backward(y);
  }

  // The diagonal of A_PP^-1.
  std::vector<R> diagonal_of_inverse() const {
    const size_t m = members.size();
    std::vector<R> diagonal(m), column(m);
    for (size_t k = 0; k < m; ++k) {
      std::fill(column.begin(), column.end(), R{});
      column[k] = constant<R>(1);
      forward(column.data(), m, k);
      for (size_t i = k; i < m; ++i) diagonal[k] = diagonal[k] + column[i] * column[i];
    }
    return diagonal;
  }

  // The line that keeps the zeros of A x + b as x_i grows: x_P decreases by w. Returns the curvature along it; 0 if
  // column i depends on the active ones.
  R line(int i, std::vector<R>& w) const {
    w.resize(members.size());
    for (size_t k = 0; k < w.size(); ++k) w[k] = A[i * stride + members[k]];
    forward(w.data(), w.size());
    const R curvature = A[i * stride + i] - dot(w, w);
    backward(w.data());
    return high(curvature) > DEPENDENT<R> ? curvature : R{};
  }

 private:
  // Solve with the factor, for a y that is 0 before `first`.
  void forward(R* y, size_t m, size_t first = 0) const {
    for (size_t i = first; i < m; ++i) {
      const R* row = &factor[i * (i + 1) / 2];
      y[i] = (y[i] - dot(row + first, y + first, i - first)) / row[i];
    }
  }
  // Solve with the transpose of the factor.
  void backward(R* y) const {
    for (size_t i = members.size(); i-- > 0;) {
      const R* row = &factor[i * (i + 1) / 2];
      y[i] = y[i] / row[i];
      for (size_t k = 0; k < i; ++k) y[k] = y[k] - row[k] * y[i];
    }
  }

  const R* A;
  int stride;
  std::vector<char> is_member;
  std::vector<R> factor;  // rows of the lower triangle
};

enum class MinimumStatus { FOUND, UNBOUNDED, TOO_LONG };

// Let component i enter, whose slope is negative. at(j) returns x_j, and move(j, by) changes it; by = -infinity sets it
// to 0.
template <class R, class Move, class At>
MinimumStatus enter(ActiveSet<R>& active, int i, R slope, Move move, At at) {
  auto positive = [](const R& x) { return high(x) > 0 ? x : R{}; };
  std::vector<R> w;
  for (int turn = 0;; ++turn) {
    R curvature = active.line(i, w);
    R step = high(curvature) > 0 ? positive(-slope) / curvature : constant<R>(INFINITY);
    int leaves = -1;
    for (size_t k = 0; k < w.size(); ++k)
      if (R x = positive(at(active.members[k])); high(w[k]) > UNMOVED<R> && less(x / w[k], step)) {
        step = x / w[k];
        leaves = static_cast<int>(k);
      }
    if (high(step) == INFINITY) return MinimumStatus::UNBOUNDED;
    for (size_t k = 0; k < w.size(); ++k)
      move(active.members[k], leaves == static_cast<int>(k) ? constant<R>(-INFINITY) : -step * w[k]);
    move(i, step);
    slope = slope + step * curvature;
    if (leaves < 0) return active.append(i) ? MinimumStatus::FOUND : MinimumStatus::TOO_LONG;
    active.drop(leaves);
    if (turn > 10000) return MinimumStatus::TOO_LONG;
  }
}

template <class R>
struct Minimum {
  ActiveSet<R> active;  // A x + b is 0 on it, and x is 0 outside of it
  std::vector<R> x;
  MinimumStatus status = MinimumStatus::TOO_LONG;
  int last = -1;  // the component that entered last
};

// Minimise over the components `among`; the others are 0. A is stored by rows. The method begins on those of the active
// set `guess` on which x is positive.
template <class R>
Minimum<R> minimise(const std::vector<R>& A, const std::vector<R>& b, const std::vector<int>& among,
                    const std::vector<int>& guess = {}) {
  const int stride = static_cast<int>(b.size());
  Minimum<R> result{{A.data(), stride}, std::vector<R>(b.size())};
  ActiveSet<R>& active = result.active;
  std::vector<R>& x = result.x;
  std::vector<R> y;
  auto solve_active = [&] {
    y.clear();
    for (int j : active.members) y.push_back(-b[j]);
    active.solve(y.data());
    for (size_t k = 0; k < y.size(); ++k) x[active.members[k]] = high(y[k]) > 0 ? y[k] : R{};
  };
  std::vector<int> begin(guess);
  for (bool is_positive = begin.empty(); !is_positive;) {
    active = {A.data(), stride};
    for (int i : begin) active.append(i);
    x.assign(b.size(), R{});
    solve_active();
    begin.clear();
    for (int j : active.members)
      if (high(x[j]) > 0) begin.push_back(j);
    is_positive = begin.size() == active.members.size();
  }
  size_t n = among.size();
  std::vector<int> coupled;  // for each of `among`, those that it is coupled with
  std::vector<size_t> end;
  coupled.reserve(8 * n);
  end.reserve(n);
  for (int i : among) {
    for (int j : among)
      if (high(A[i * stride + j]) != 0) coupled.push_back(j);
    end.push_back(coupled.size());
  }
  // Mostly, n turns are enough. Where doubles take more than 2 n, they have too few digits. In double-double, the first
  // column whose slope is negative enters after 4 n, so that columns do not take turns for ever.
  const size_t by_slope = 20 + 4 * n, turns = is_scalar<R> ? 20 + 2 * n : 200 + 50 * n;
  for (size_t turn = 0; turn < turns; ++turn) {
    int entering = -1;
    R most{};
    double size = 0;  // of A x at most, because no element of A is greater than 1
    for (int j : active.members) size += std::fabs(high(x[j]));
    for (size_t k = 0; k < n; ++k) {
      const int i = among[k];
      if (active.has(i)) continue;
      R slope = b[i];
      for (size_t c = k ? end[k - 1] : 0; c < end[k]; ++c) slope = slope + A[i * stride + coupled[c]] * x[coupled[c]];
      bool is_less = turn < by_slope ? less(slope, most) : entering < 0;
      if (high(slope) < -UNMOVED<R> * (std::fabs(high(b[i])) + size) && is_less) {
        most = slope;
        entering = i;
      }
    }
    result.status = MinimumStatus::FOUND;
    if (entering < 0) return result;
    result.last = entering;
    result.status = enter(
        active, entering, most, [&](int j, const R& by) { x[j] = high(by) == -INFINITY ? R{} : x[j] + by; },
        [&](int j) { return x[j]; });
    if (result.status != MinimumStatus::FOUND) return result;
    solve_active();  // anew, so that the rounding of the steps does not accumulate
  }
  result.status = MinimumStatus::TOO_LONG;
  return result;
}
