// Matrices in which few variables are coupled, and their solution by triangular factors.
#pragma once
#include "vectors.hpp"

// Each row holds the entries from the first that may be other than 0 to the diagonal. Rows are in an order that keeps
// them short.
struct SkylineRows {
  List<int> place, first;  // first: of each row
  List<int> end;  // of each column, below its last row
  List<size_t> start;  // of each row

  // place: of each variable in that order. Variables of a group are coupled with each other.
  void lay_out(List<int> place_of_variables, const List<List<int>>& groups) {
    place = std::move(place_of_variables);
    const int count = static_cast<int>(place.size());
    first.resize(count);
    std::iota(first.begin(), first.end(), 0);
    for (const List<int>& group : groups) {
      int least = count;
      for (int i : group) least = std::min(least, place[i]);
      for (int i : group) first[place[i]] = std::min(first[place[i]], least);
    }
    end.assign(count, 0);
    for (int i = 0; i < count; ++i) std::fill(end.begin() + first[i], end.begin() + i + 1, i + 1);
    start.assign(count + 1, 0);
    for (int i = 0; i < count; ++i) start[i + 1] = start[i] + static_cast<size_t>(i - first[i] + 1);
  }
  int size() const { return static_cast<int>(place.size()); }
  // Where a row would begin if it had all columns: its entry in column j is row(entries, i)[j].
  template <class R>
  R* row(List<R>& entries, int i) const {
    return entries.data() + start[i] - first[i];
  }
  // Whether the row of i is below that of j, or the same.
  bool is_below(int i, int j) const { return place[i] >= place[j]; }
  // Where the entry of i and j is.
  size_t index(int i, int j) const {
    const int row = std::max(place[i], place[j]), along = std::min(place[i], place[j]);
    return start[row] + static_cast<size_t>(along - first[row]);
  }
};

// y += by x
template <class R>
INLINE void add_multiple(R* __restrict y, R by, const R* __restrict x, int count) {
  for (int k = 0; k < count; ++k) {
    SumOfProducts<R> sum{y[k]};
    sum.add(by, x[k]);
    y[k] = sum.total();
  }
}

// A symmetric positive definite matrix, solved by Cholesky's factors.
template <class R>
class Skyline {
 public:
  void lay_out(List<int> place_of_variables, const List<List<int>>& groups) {
    rows.lay_out(std::move(place_of_variables), groups);
    const int count = rows.size();
    entries.assign(rows.start[count], R{});
    rhs.resize(count);
    column.resize(count);
  }

  List<R> entries;
  R& at(int i, int j) { return entries[rows.index(i, j)]; }
  bool is_below(int i, int j) const { return rows.is_below(i, j); }
  double multiplications() const { return work; }

  // x = -M^-1 b, column by column, for numbers T of at least as many digits. The entries become the factor, with the
  // inverses of its diagonal.
  template <class T>
  void solve(const List<T>& b, List<T>& x) {
    const int count = rows.size();
    const List<int>&place = rows.place, &first = rows.first, &end = rows.end;
    for (int i = 0; i < count; ++i) rhs[place[i]] = -rounded_to<R>(b[i]);
    for (int k = 0; k < count; ++k) {
      R& pivot = rows.row(entries, k)[k];
      pivot = high(pivot) > 0 ? constant<R>(1) / root(pivot) : constant<R>(0x1p-200);
      rhs[k] = rhs[k] * pivot;
      // All at once: a processor waits if it loads two numbers together that have just been stored one by one.
      for (int i = k + 1; i < end[k]; ++i) column[i] = first[i] > k ? R{} : rows.row(entries, i)[k] * pivot;
      for (int i = k + 1; i < end[k]; ++i) {
        if (first[i] > k) continue;
        R* row = rows.row(entries, i) + k;
        row[0] = column[i];
        add_multiple(row + 1, -column[i], column.data() + k + 1, i - k);
        rhs[i] -= column[i] * rhs[k];
        work += i - k;
      }
    }
    for (int i = count; i-- > 0;) {
      const R* row = rows.row(entries, i);
      rhs[i] = rhs[i] * row[i];
      for (int j = first[i]; j < i; ++j) rhs[j] -= row[j] * rhs[i];
    }
    for (int i = 0; i < count; ++i) x[i] = lifted<T>(rhs[place[i]]);
  }

 private:
  SkylineRows rows;
  List<R> rhs, column;
  double work = 0;
};

// A matrix that need not be symmetric, but in which i is coupled with j if j is with i. Its factors are L and U, with a
// diagonal of 1 in U, without exchanges of rows.
class UnsymmetricSkyline {
 public:
  void lay_out(List<int> place_of_variables, const List<List<int>>& groups) {
    rows.lay_out(std::move(place_of_variables), groups);
    below.resize(rows.size());
    beside.resize(rows.size());
  }
  void set_to_unit() {
    lower.assign(rows.start.back(), 0);
    upper.assign(rows.start.back(), 0);
    for (int i = 0; i < rows.size(); ++i) lower[rows.start[i + 1] - 1] = 1;
  }
  // Add R^T S to the entries from row i and column j on, for six variables of a body each, which are next to each other.
  void add_product(int i, int j, const double (*R)[6], const double (*S)[6]) {
    const bool is_below = rows.is_below(i, j), is_diagonal = i == j;
    for (int k = 0; k < 6; ++k) {
      if (is_below) add_combination(&lower[rows.index(i + k, j)], R, k, S, is_diagonal ? k + 1 : 6);
      if (!is_below || is_diagonal) add_combination(&upper[rows.index(i, j + k)], S, k, R, is_diagonal ? k : 6);
    }
  }
  double multiplications() const { return work; }

  // x = M^-1 x, column by column. The entries become the factors. Whether there are any.
  bool solve(Vector& x) {
    const List<int>&place = rows.place, &first = rows.first, &end = rows.end;
    const int count = rows.size();
    Vector b(count);
    for (int i = 0; i < count; ++i) b[place[i]] = x[i];
    for (int k = 0; k < count; ++k) {
      const double pivot = rows.row(lower, k)[k];
      if (!(std::fabs(pivot) > 0)) return false;
      b[k] /= pivot;
      for (int i = k + 1; i < end[k]; ++i) {
        const bool is_zero = first[i] > k;
        below[i] = is_zero ? 0 : rows.row(lower, i)[k];
        beside[i] = is_zero ? 0 : rows.row(upper, i)[k] / pivot;
      }
      for (int i = k + 1; i < end[k]; ++i) {
        if (first[i] > k) continue;
        double *L = rows.row(lower, i) + k, *U = rows.row(upper, i) + k;
        U[0] = beside[i];
        add_multiple(L + 1, -below[i], beside.data() + k + 1, i - k);
        add_multiple(U + 1, -beside[i], below.data() + k + 1, i - k - 1);
        b[i] -= below[i] * b[k];
        work += 2 * (i - k);
      }
    }
    for (int i = count; i-- > 0;)
      for (int j = first[i]; j < i; ++j) b[j] -= rows.row(upper, i)[j] * b[i];
    for (int i = 0; i < count; ++i) x[i] = b[place[i]];
    return true;
  }

 private:
  // y += A^T a, for the column k of a matrix whose columns are the a
  static void add_combination(double* __restrict y, const double (*a)[6], int k, const double (*__restrict A)[6],
                              int count) {
    const double by[3] = {a[0][k], a[1][k], a[2][k]};
    for (int l = 0; l < count; ++l) y[l] += by[0] * A[0][l] + by[1] * A[1][l] + by[2] * A[2][l];
  }

  SkylineRows rows;
  Vector lower, upper;  // upper: by columns, without its diagonal
  Vector below, beside;  // the column of L and the row of U at hand
  double work = 0;
};

// The variables of bodies and contacts: six of each body, then, with `contacts_have_one`, one of each contact. Those of a
// body and of its contacts are coupled, and those of two bodies that touch.
struct ContactGraph {
  int body_count;
  bool contacts_have_one;
  List<std::array<int, 2>> pairs{};  // the bodies of each contact; -1: immovable

  int size() const { return 6 * body_count + (contacts_have_one ? static_cast<int>(pairs.size()) : 0); }

  // Groups of coupled variables: first for each body, its own and those of its contacts.
  List<List<int>> groups() const {
    constexpr size_t FEW = 16;  // variables: memory for one after the other takes as long as the arithmetic
    List<List<int>> groups(body_count);
    for (List<int>& group : groups) group.reserve(FEW);
    auto add_body = [](int body, List<int>& group) {
      for (int k = 0; k < 6; ++k) group.push_back(6 * body + k);
    };
    for (int b = 0; b < body_count; ++b) add_body(b, groups[b]);
    for (size_t i = 0; i < pairs.size(); ++i) {
      const auto [a, b] = pairs[i];
      for (int body : pairs[i])
        if (body >= 0 && contacts_have_one) groups[body].push_back(6 * body_count + static_cast<int>(i));
      if (a < 0 || b < 0) continue;
      List<int>& both = groups.emplace_back();
      add_body(a, both);
      add_body(b, both);
    }
    return groups;
  }

  // An order in which coupled variables are near each other: bodies breadth first from one with few contacts, each
  // followed by the variables of its contacts.
  List<int> order() const {
    List<List<int>> touching(body_count);
    for (size_t i = 0; i < pairs.size(); ++i)
      for (int b : pairs[i])
        if (b >= 0) touching[b].push_back(static_cast<int>(i));
    List<int> roots(body_count), queue, place(size());
    std::iota(roots.begin(), roots.end(), 0);
    auto fewer = [&](int a, int b) { return touching[a].size() < touching[b].size(); };
    std::stable_sort(roots.begin(), roots.end(), fewer);
    List<char> seen(body_count), placed(pairs.size(), !contacts_have_one);
    int next = 0;
    for (int root : roots) {
      if (seen[root]) continue;
      queue.assign(1, root);
      seen[root] = 1;
      for (size_t k = 0; k < queue.size(); ++k) {
        const int body = queue[k];
        for (int c = 0; c < 6; ++c) place[6 * body + c] = next++;
        List<int> near;
        for (int i : touching[body]) {
          const int other = pairs[i][pairs[i][0] == body];
          if (!placed[i] && (other < 0 || seen[other])) {
            placed[i] = 1;
            place[6 * body_count + i] = next++;
          }
          if (other >= 0 && !seen[other]) {
            seen[other] = 1;
            near.push_back(other);
          }
        }
        std::stable_sort(near.begin(), near.end(), fewer);
        queue.insert(queue.end(), near.begin(), near.end());
      }
    }
    return place;
  }
};
