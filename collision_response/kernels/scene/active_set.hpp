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
  ActiveSet(const R* matrix, int stride) : A(matrix), stride(stride), is_member(stride) {
    const size_t few = std::min(stride, 8);  // at once: memory for one after the other takes as long as the arithmetic
    members.reserve(few);
    first_of.reserve(few);
    factor.reserve(few * (few + 1) / 2);
  }

  List<int> members;
  bool has(int i) const { return is_member[i]; }

  // Make column i active if it is independent of the active ones. Whether it is.
  bool append(int i);

  // Make an independent subset of `among` active, the column farthest from dependent first. Returns the others: they
  // depend on the subset, with pivots up to `dependent`.
  List<int> span(const List<int>& among, double dependent = DEPENDENT<R>);

  // How far the last active column is from dependent on the others.
  double last_pivot() const { return high(factor.back() * factor.back()); }

  void drop(size_t place);

  // y <- A_PP^-1 y, in place, for the active set P.
  void solve(R* y) const;

  // The diagonal of A_PP^-1.
  List<R> diagonal_of_inverse() const;

  // The line that keeps the zeros of A x + b as x_i grows: x_P decreases by w. Returns the curvature along it; 0 if
  // column i depends on the active ones.
  R line(int i, List<R>& w) const;

 private:
  size_t forward(R* y, size_t m) const;
  void backward(R* y) const;

  const R* A;
  int stride;
  List<char> is_member;
  List<R> factor;  // rows of the lower triangle
  List<size_t> first_of;  // for each of its rows, the place of the first element that is not 0
};

enum class MinimumStatus { FOUND, UNBOUNDED, TOO_LONG };

// Let component i enter, whose slope is negative. at(j) returns x_j, and move(j, by) changes it; by = -infinity sets it
// to 0.
template <class R, class Move, class At>
MinimumStatus enter(ActiveSet<R>& active, int i, R slope, Move move, At at) {
  constexpr int MOST_TURNS = 10000;
  auto positive = [](const R& x) { return high(x) > 0 ? x : R{}; };
  List<R> w;
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
    if (turn > MOST_TURNS) return MinimumStatus::TOO_LONG;
  }
}

template <class R>
struct Minimum {
  ActiveSet<R> active;  // A x + b is 0 on it, and x is 0 outside of it
  List<R> x;
  MinimumStatus status = MinimumStatus::TOO_LONG;
  int last = -1;  // the component that entered last
};

// Minimise over the components `among`; the others are 0. A is stored by rows. The method begins on those of the active
// set `guess` on which x is positive.
template <class R>
Minimum<R> minimise(const List<R>& A, const List<R>& b, const List<int>& among, const List<int>& guess = {});
