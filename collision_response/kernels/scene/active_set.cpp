// The active set of active_set.hpp, and the minimum that it finds.
#include "active_set.hpp"

template <class R>
bool ActiveSet<R>::append(int i) {
  size_t m = members.size();
  factor.resize((m + 1) * (m + 2) / 2);
  R* row = &factor[m * (m + 1) / 2];
  for (size_t k = 0; k < m; ++k) row[k] = A[i * stride + members[k]];
  const size_t first = forward(row, m);
  const R pivot = A[i * stride + i] - dot(row + first, row + first, m - first);
  if (!(high(pivot) > DEPENDENT<R>)) return false;
  row[m] = root(pivot);
  members.push_back(i);
  first_of.push_back(first);
  is_member[i] = true;
  return true;
}

template <class R>
List<int> ActiveSet<R>::span(const List<int>& among, double dependent) {
  List<int> left(among);
  const size_t width = among.size();
  List<R> rows(stride * width), pivot(stride);  // rows of the factor
  List<size_t> first(stride, width);  // in each row, the place of the first element that is not 0
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
    first[chosen] = std::min(first[chosen], m);
    for (int i : left) {
      R* other = &rows[i * width];
      const size_t from = std::min(std::max(first[i], first[chosen]), m);
      const R left_over = A[i * stride + chosen] - dot(other + from, row + from, m - from);
      if (high(left_over) == 0) continue;
      other[m] = left_over / row[m];
      first[i] = std::min(first[i], m);
      pivot[i] = pivot[i] - other[m] * other[m];
    }
    factor.insert(factor.end(), row, row + m + 1);
    first_of.push_back(first[chosen]);
    members.push_back(chosen);
    is_member[chosen] = true;
  }
  return left;
}

template <class R>
void ActiveSet<R>::drop(size_t place) {
  List<int> later(members.begin() + place + 1, members.end());
  for (size_t k = place; k < members.size(); ++k) is_member[members[k]] = false;
  members.resize(place);
  first_of.resize(place);
  for (int i : later) append(i);
}

template <class R>
void ActiveSet<R>::solve(R* y) const {
  forward(y, members.size());
  backward(y);
}

template <class R>
List<R> ActiveSet<R>::diagonal_of_inverse() const {
  const size_t m = members.size();
  List<R> diagonal(m), column(m);
  for (size_t k = 0; k < m; ++k) {
    std::fill(column.begin(), column.end(), R{});
    column[k] = constant<R>(1);
    forward(column.data(), m);
    for (size_t i = k; i < m; ++i) diagonal[k] = diagonal[k] + column[i] * column[i];
  }
  return diagonal;
}

template <class R>
R ActiveSet<R>::line(int i, List<R>& w) const {
  w.resize(members.size());
  for (size_t k = 0; k < w.size(); ++k) w[k] = A[i * stride + members[k]];
  forward(w.data(), w.size());
  const R curvature = A[i * stride + i] - dot(w, w);
  backward(w.data());
  return high(curvature) > DEPENDENT<R> ? curvature : R{};
}

// Solve with the first m rows of the factor. Returns the place of the first element of y that is not 0.
template <class R>
size_t ActiveSet<R>::forward(R* y, size_t m) const {
  size_t first = 0;
  while (first < m && high(y[first]) == 0) ++first;
  for (size_t i = first; i < m; ++i) {
    const R* row = &factor[i * (i + 1) / 2];
    const size_t from = std::min(std::max(first, first_of[i]), i);
    y[i] = (y[i] - dot(row + from, y + from, i - from)) / row[i];
  }
  return first;
}

// Solve with the transpose of the factor.
template <class R>
void ActiveSet<R>::backward(R* y) const {
  for (size_t i = members.size(); i-- > 0;) {
    const R* row = &factor[i * (i + 1) / 2];
    y[i] = y[i] / row[i];
    for (size_t k = first_of[i]; k < i; ++k) y[k] = y[k] - row[k] * y[i];
  }
}

template <class R>
Minimum<R> minimise(const List<R>& A, const List<R>& b, const List<int>& among, const List<int>& guess) {
  const int stride = static_cast<int>(b.size());
  Minimum<R> result{{A.data(), stride}, List<R>(b.size())};
  ActiveSet<R>& active = result.active;
  List<R>& x = result.x;
  List<R> y;
  auto solve_active = [&] {
    y.clear();
    for (int j : active.members) y.push_back(-b[j]);
    active.solve(y.data());
    for (size_t k = 0; k < y.size(); ++k) x[active.members[k]] = high(y[k]) > 0 ? y[k] : R{};
  };
  List<int> begin(guess);
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
  List<int> coupled;  // for each of `among`, those that it is coupled with
  List<size_t> end;
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

template class ActiveSet<double>;
template class ActiveSet<DD>;
template Minimum<double> minimise(const Vector& A, const Vector& b, const List<int>& among, const List<int>& guess);
template Minimum<DD> minimise(const List<DD>& A, const List<DD>& b, const List<int>& among, const List<int>& guess);
