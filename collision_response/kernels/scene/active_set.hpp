// The least of  x.A x / 2 + b.x  over x >= 0, for a positive semi-definite A of unit diagonal: its optimum is
// x >= 0, A x + b >= 0, x.(A x + b) = 0.
//
// The method keeps A x + b = 0 on an active set of independent columns, held as a Cholesky factor, and lets in
// the most negative component of A x + b, along the line that keeps those zeros; what x reaches 0 on the way
// leaves. A column that depends on the active ones enters in exchange for one of them; if there is nothing to
// exchange it for, there is no least (Keller, "The General Quadratic Optimization Problem", Math. Programming 5,
// 1973).
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

constexpr double DEPENDENT = 1e-11;  // a pivot at or below this is rounding

class ActiveSet {
 public:
  ActiveSet(const double* matrix, int stride) : A(matrix), stride(stride) {}

  std::vector<int> members;

  // Whether column i is independent of the active ones; it is active then.
  bool append(int i) {
    size_t m = members.size();
    factor.resize((m + 1) * (m + 2) / 2);
    double* row = &factor[m * (m + 1) / 2];
    for (size_t k = 0; k < m; ++k) row[k] = A[i * stride + members[k]];
    forward(row, m);
    double pivot = A[i * stride + i];
    for (size_t k = 0; k < m; ++k) pivot -= row[k] * row[k];
    if (!(pivot > DEPENDENT)) return false;
    row[m] = std::sqrt(pivot);
    members.push_back(i);
    return true;
  }

  // Make an independent part of `among` active, the farthest from dependent first. What depends on it is returned.
  std::vector<int> span(const std::vector<int>& among) {
    std::vector<int> left(among);
    std::vector<std::vector<double>> rows(stride);
    std::vector<double> pivot(stride);
    for (int i : left) pivot[i] = A[i * stride + i];
    while (!left.empty()) {
      size_t best = 0;
      for (size_t k = 1; k < left.size(); ++k)
        if (pivot[left[k]] > pivot[left[best]]) best = k;
      int chosen = left[best];
      if (!(pivot[chosen] > DEPENDENT)) break;
      left.erase(left.begin() + static_cast<long>(best));
      double root = std::sqrt(pivot[chosen]);
      for (int i : left) {
        double y = A[i * stride + chosen];
        for (size_t k = 0; k < rows[chosen].size(); ++k) y -= rows[i][k] * rows[chosen][k];
        rows[i].push_back(y / root);
        pivot[i] -= rows[i].back() * rows[i].back();
      }
      rows[chosen].push_back(root);
      factor.insert(factor.end(), rows[chosen].begin(), rows[chosen].end());
      members.push_back(chosen);
    }
    return left;
  }

  void drop(size_t place) {
    std::vector<int> later(members.begin() + place + 1, members.end());
    members.resize(place);
    for (int i : later) append(i);
  }

  // In place: y <- A_PP^-1 y.
  void solve(double* y) const {
    size_t m = members.size();
    forward(y, m);
    for (size_t i = m; i-- > 0;) {
      const double* row = &factor[i * (i + 1) / 2];
      y[i] /= row[i];
      for (size_t k = 0; k < i; ++k) y[k] -= row[k] * y[i];
    }
  }

  // The line that keeps the zeros of A x + b as x_i grows: x_P falls by w. Its curvature; 0 if i depends on P.
  double line(int i, std::vector<double>& w) const {
    w.resize(members.size());
    for (size_t k = 0; k < w.size(); ++k) w[k] = A[i * stride + members[k]];
    std::vector<double> half(w);
    forward(half.data(), half.size());
    double curvature = A[i * stride + i];
    for (double y : half) curvature -= y * y;
    solve(w.data());
    return curvature > DEPENDENT ? curvature : 0;
  }

 private:
  void forward(double* y, size_t m) const {
    for (size_t i = 0; i < m; ++i) {
      const double* row = &factor[i * (i + 1) / 2];
      double sum = y[i];
      for (size_t k = 0; k < i; ++k) sum -= row[k] * y[k];
      y[i] = sum / row[i];
    }
  }

  const double* A;
  int stride;
  std::vector<double> factor;  // rows of the lower triangle
};

enum class Found { LEAST, NO_LEAST, TOO_LONG };

// Let component i in, whose slope is negative. `move(place, by)` is told of every change of x_i (place -1) and of
// x_members[place]. `at(place)` gives x_members[place].
template <class Move, class At>
Found enter(ActiveSet& active, int i, double slope, Move move, At at) {
  std::vector<double> w;
  for (int turn = 0;; ++turn) {
    double curvature = active.line(i, w);
    double step = curvature > 0 ? std::fmax(-slope, 0) / curvature : INFINITY;
    int leaves = -1;
    for (size_t k = 0; k < w.size(); ++k)
      if (w[k] > 1e-14 && std::fmax(at(k), 0) / w[k] < step) {
        step = std::fmax(at(k), 0) / w[k];
        leaves = static_cast<int>(k);
      }
    if (step == INFINITY) return Found::NO_LEAST;
    for (size_t k = 0; k < w.size(); ++k) move(static_cast<int>(k), leaves == static_cast<int>(k) ? -INFINITY : -step * w[k]);
    move(-1, step);
    slope += step * curvature;
    if (leaves < 0) return active.append(i) ? Found::LEAST : Found::TOO_LONG;
    active.drop(leaves);
    if (turn > 10000) return Found::TOO_LONG;
  }
}

// In plain doubles. x and active start as found: x is 0 outside the active set, and A x + b is 0 on it. `last` is told
// of the component that entered last. A x + b may be less than 0 by `slack`.
inline Found least(const double* A, int stride, const std::vector<int>& among, const double* b, double* x, ActiveSet& active, int* last = nullptr, double slack = 0) {
  size_t n = among.size();
  std::vector<char> is_active(stride);
  for (size_t turn = 0; turn < 50 * n + 200; ++turn) {
    std::fill(is_active.begin(), is_active.end(), 0);
    for (int j : active.members) is_active[j] = 1;
    int entering = -1;
    double most = 0;
    for (size_t k = 0; k < n; ++k) {
      int i = among[k];
      if (is_active[i]) continue;
      double slope = b[i], terms = std::fabs(b[i]);
      for (int j : active.members) {
        double term = A[i * stride + j] * x[j];
        slope += term;
        terms += std::fabs(term);
      }
      bool is_less = turn < 20 * n + 100 ? slope < most : entering < 0;
      if (slope < -slack - 1e-14 * terms && is_less) {  // what is less is rounding
        most = slope;
        entering = i;
      }
    }
    if (entering < 0) return Found::LEAST;
    if (last) *last = entering;
    Found found = enter(
        active, entering, most,
        [&](int place, double by) {
          double& y = x[place < 0 ? entering : active.members[place]];
          y = by == -INFINITY ? 0 : y + by;
        },
        [&](size_t place) { return x[active.members[place]]; });
    if (found != Found::LEAST) return found;
    // Rounding of the steps does not gather: the active part anew.
    std::vector<double> y;
    for (int j : active.members) y.push_back(-b[j]);
    active.solve(y.data());
    for (size_t k = 0; k < y.size(); ++k) x[active.members[k]] = std::fmax(y[k], 0);
  }
  return Found::TOO_LONG;
}
