// Impulses in cones of friction,  K_i = { |P_t| <= mu_i P_n },  that do the least work on relative velocities:
//
//     |y|^2 / 2 + w.P -> least       y = B^T P, what they do to the body_count, in the metric of kinetic energy
//
// and, if asked, with given normal velocities N y = c. Its dual has no constraints and one velocity eta for all
// body_count, however many contacts they have; P solves it and its dual together where
//
//     P_i = proj_K_i(P_i - rho_i (w + B eta)_i)       eta + N^T lambda = B^T P        N (eta + N^T lambda) = c
//
// Augmented Lagrangian steps: with Q for the P on the right, the least over eta and lambda of
//
//     |eta + N^T lambda|^2 / 2 - c.lambda + sum |P_i|^2 / (2 rho_i) + |lambda - lambda_0|^2 / (2 sigma)
//
// is found by Newton's method, as its gradient is piecewise smooth. From Q = 0, P is that of least sum of squares among
// all that do the same, nearly; further steps, from the greatest rho down, mend the rest. Each ends with a step that
// changes P instead of computing it anew, for rho times a rounding is no small number. sigma is greater: of little load
// and much friction lambda is long, and |lambda| / sigma is what c is missed by.
//
// Rockafellar, "Augmented Lagrangians and Applications of the Proximal Point Algorithm in Convex Programming",
// Math. Oper. Res. 1 (1976); Li, Sun & Toh, "A Highly Efficient Semismooth Newton Augmented Lagrangian Method",
// SIAM J. Optim. 28 (2018).
#pragma once
#include "active_set.hpp"

class Cones {
 public:
  static constexpr double GREATEST = 1e6, LEAST = 1e2;        // rho
  static constexpr double USUAL = 1e10, IF_NEED_BE = 1e14;    // sigma
  static constexpr double ENOUGH = 5e-8;                // of what y is off

  struct Cone {
    int body[2];  // -1: none
    double row[2][3][6];
    Axes w;
    double mu, share;  // share: of rho
  };
  std::vector<Cone> cones;
  Vector kept_velocities;   // c, of the first cones, whose normal impulses do different things; or empty
  Vector loads;  // normal impulses > 0 that do it, but for `slack`
  Vector slack;
  ActiveSet<double> normals{nullptr, 0};  // how to find impulses that do what is kept_velocities
  std::vector<Axes> P, z;     // z: w + B eta

  explicit Cones(int body_count) : body_count(body_count) {}

  // After the last one.
  void prepare() {
    size_t n = cones.size();
    P.resize(n);
    z.resize(n);
    variables = 6 * body_count + static_cast<int>(kept_velocities.size());
    x.resize(variables);
    order_variables();
    allocate_matrix();
  }

  // Of all solutions that of least squares, nearly; and how far its y is off, at most.
  double solve() {
    solve_from_zero();
    refine();
    if (!kept_velocities.empty() && motion_error(0) > 30 * ENOUGH) {
      sigma = IF_NEED_BE;
      refine();
    }
    return motion_error(ROUNDING);
  }

  // The first step towards that.
  void solve_from_zero() {
    const std::vector<Axes> none(P.size());
    if (!lagrangian_step(GREATEST, none, true, 12))
      for (double size = 1; size <= GREATEST; size *= 100) lagrangian_step(size, none, size == 1, 60);
  }

  // The same without regard to the squares: steps from where it is, until they gain nothing.
  void refine() {
    double least = motion_error(0);
    for (double size = 100 * GREATEST; size >= LEAST; size /= 100)
      for (bool gains = true; gains && least > ENOUGH;) {
        const std::vector<Axes> old_P = P, old_z = z;
        const Vector old_x = x;
        lagrangian_step(size, P, false, 60);
        polish();
        double now = motion_error(0);
        gains = now < least / 3;
        if (now < least) {
          least = now;
        } else {
          P = old_P;
          z = old_z;
          x = old_x;
        }
      }
  }

  // One step, from impulses Q; whether Newton's method ended.
  bool lagrangian_step(double size, std::vector<Axes> Q, bool afresh, int budget) {
    rho = size;
    from = std::move(Q);
    lambda_before.assign(x.begin() + 6 * body_count, x.end());
    Vector gradient(variables), trial, step(variables);
    if (afresh) {  // as if all contacts held
      evaluate(x, gradient, true);
      newton(gradient, step);
      increase(x, 1, step);
    }
    double value = evaluate(x, gradient, false), off = norm(gradient), enough = 1e-14 + 2e-16 * rho;
    for (int turn = 0; turn < budget && off > enough; ++turn) {
      newton(gradient, step);
      const double slope = dot(gradient, step), old = off;
      double now = 0;
      for (double length = 1;; length /= 2) {
        trial = x;
        increase(trial, length, step);
        now = evaluate(trial, gradient, false);
        off = norm(gradient);
        if (off <= old / 2 || now <= value + 1e-4 * length * slope || length < 1e-3) break;
      }
      if (off >= old && old < 1e4 * enough) {  // rounding
        evaluate(x, gradient, false);
        return true;
      }
      x = trial;
      value = now;
    }
    return off <= 1e6 * enough;
  }

  // A last step of Newton's, by which P changes but is not computed anew: of rho (w + B eta) it has the rounding.
  void polish() {
    Vector gradient(variables), step(variables);
    evaluate(x, gradient, false);
    newton(gradient, step);
    increase(x, 1, step);
    for (size_t i = 0; i < cones.size(); ++i) {
      Axes by = velocity(cones[i], step.data());
      for (int a = 0; a < 3; ++a) z[i][a] += by[a];
      for (int a = 0; a < 3; ++a)
        for (int k = 0; k < 3; ++k) P[i][a] -= rho * cones[i].share * slopes[i][a][k] * by[k];
      Slope unused;
      project_on_cone(cones[i].mu, P[i], unused);
    }
  }

  // y
  Vector motion() const {
    Vector y(6 * static_cast<size_t>(body_count));
    for (size_t i = 0; i < cones.size(); ++i) add_row(cones[i], P[i], y);
    return y;
  }

  // How far y is from y* of the least, at most, of P as it is. With v the velocities of the cones, which lack `outside`
  // to those that no impulse of theirs works on, and Q any impulses that keep c, y_Q = y + e:
  //
  //     |y_Q - y*|^2 = (Q - P*).(v - v*) + (y_Q - y*).e <= Q.v + P*.outside + |y_Q - y*| |e|
  //
  // Q is (1 - part) P + part `loads` + `by` along normals, with the least part that leaves it in the cones. P* is taken to
  // be no greater than the greatest impulse found.
  double motion_error(double rounding) const {
    const Vector y = motion();
    Vector dual = y, by(kept_velocities.size()), e(y.size());
    const double* lambda = x.data() + 6 * body_count;
    double part = 0, reach = 1, sum = 0;
    for (size_t i = 0; i < kept_velocities.size(); ++i) {
      add_row(cones[i], Axes{-lambda[i], 0, 0}, dual);
      double own = kept_velocities[i] - velocity(cones[i], y.data())[0];
      by[i] = own + std::copysign(rounding * (std::fabs(kept_velocities[i]) + size_near(cones[i], y)) + slack[i], own);
    }
    along_normals(by, part);
    by.resize(loads.size());
    for (size_t i = 0; i < by.size(); ++i) add_row(cones[i], Axes{by[i] + part * loads[i], 0, 0}, e);
    increase(e, -part, y);
    for (const Axes& one : P) reach = std::fmax(reach, std::hypot(one[0], one[1], one[2]));
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone& cone = cones[i];
      Axes v = velocity(cone, dual.data());
      for (int k = 0; k < 3; ++k) v[k] += cone.w[k];
      double slip = cone.mu > 0 ? std::hypot(v[1], v[2]) : 0, outside = std::fmax(cone.mu * slip - v[0], 0);
      sum += std::fabs(v[0] * P[i][0] + v[1] * P[i][1] + v[2] * P[i][2]);
      sum += reach * std::fmin(outside, slip + std::fmax(-v[0], 0));
      if (!kept_velocities.empty()) sum += std::fabs(v[0]) * (part * loads[i] + std::fabs(by[i]));
    }
    const double far = std::sqrt(dot(e, e));
    return far + (far + std::sqrt(far * far + 4 * sum)) / 2;
  }

 private:
  int body_count, variables = 0;
  double rho = 1, sigma = USUAL;
  Vector x;  // eta, lambda
  Vector lambda_before;
  std::vector<Axes> from;
  static constexpr double ROUNDING = 0x1p-50;
  using Slope = std::array<Axes, 3>;
  std::vector<Slope> slopes;

  // From changes of normal velocities to impulses along normals, and the part of the loads that leaves them in the cones.
  void along_normals(Vector& by, double& part) const {
    normals.solve(by.data());
    for (size_t i = 0; i < by.size(); ++i) part = std::fmax(part, std::fabs(by[i]) / loads[i]);
    if (part < 1) return;
    part = 1;
    std::fill(by.begin(), by.end(), 0.0);
  }
  static double size_near(const Cone& cone, const Vector& y) {
    double square = 0;
    for (int body : cone.body)
      for (int k = 0; body >= 0 && k < 6; ++k) square += y[6 * body + k] * y[6 * body + k];
    return std::sqrt(square);
  }
  static double norm(const Vector& g) {
    double most = 0;
    for (double v : g) most = std::max(most, std::fabs(v));
    return most;
  }
  static Axes velocity(const Cone& cone, const double* y) {
    Axes v{0, 0, 0};
    for (int side = 0; side < 2; ++side)
      if (cone.body[side] >= 0) {
        const double* of = y + 6 * cone.body[side];
        for (int a = 0; a < 3; ++a)
          for (int k = 0; k < 6; ++k) v[a] += cone.row[side][a][k] * of[k];
      }
    return v;
  }
  static void add_row(const Cone& cone, const Axes& by, Vector& y) {
    for (int side = 0; side < 2; ++side)
      if (cone.body[side] >= 0) {
        double* of = &y[6 * cone.body[side]];
        for (int k = 0; k < 6; ++k) of[k] += cone.row[side][0][k] * by[0] + cone.row[side][1][k] * by[1] + cone.row[side][2][k] * by[2];
      }
  }

  // The nearest of the cone, and the derivative of that.
  static void project_on_cone(double mu, Axes& q, Slope& slope) {
    double t = std::sqrt(q[1] * q[1] + q[2] * q[2]);
    slope = {};
    if (q[0] >= 0 && t <= mu * q[0]) {
      for (int k = 0; k < 3; ++k) slope[k][k] = 1;
      return;
    }
    if (mu * t <= -q[0]) {
      q = {0, 0, 0};
      return;
    }
    double d[2] = {t > 0 ? q[1] / t : 0, t > 0 ? q[2] / t : 0}, whole = 1 / (1 + mu * mu);
    double n = (q[0] + mu * t) * whole, round = t > 0 ? mu * n / t : 0;
    slope[0][0] = whole;
    for (int k = 0; k < 2; ++k) {
      slope[0][1 + k] = slope[1 + k][0] = mu * whole * d[k];
      for (int l = 0; l < 2; ++l) slope[1 + k][1 + l] = (mu * mu * whole - round) * d[k] * d[l] + (k == l ? round : 0);
    }
    q = {n, mu * n * d[0], mu * n * d[1]};
  }

  // The value of the dual, its gradient, P and slopes there. `holding`: with no cones.
  double evaluate(const Vector& at, Vector& gradient, bool holding) {
    slopes.resize(cones.size());
    const double* lambda = at.data() + 6 * body_count;
    Vector& y = whole;
    y.assign(at.begin(), at.begin() + 6 * body_count);
    for (size_t i = 0; i < kept_velocities.size(); ++i) add_row(cones[i], Axes{lambda[i], 0, 0}, y);
    double value = 0;
    for (double v : y) value += v * v / 2;
    for (size_t i = 0; i < kept_velocities.size(); ++i) {
      double by = lambda[i] - lambda_before[i];
      gradient[6 * body_count + i] = velocity(cones[i], y.data())[0] - kept_velocities[i] + by / sigma;
      value += by * by / (2 * sigma) - kept_velocities[i] * lambda[i];
    }
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone& cone = cones[i];
      double own = rho * cone.share;
      z[i] = velocity(cone, at.data());
      for (int k = 0; k < 3; ++k) {
        z[i][k] += cone.w[k];
        P[i][k] = from[i][k] - own * z[i][k];
      }
      if (holding) {
        slopes[i] = {};
        for (int k = 0; k < 3; ++k) slopes[i][k][k] = k == 0 || cone.mu > 0;
        if (!(cone.mu > 0)) P[i][1] = P[i][2] = 0;
      } else {
        project_on_cone(cone.mu, P[i], slopes[i]);
      }
      value += (P[i][0] * P[i][0] + P[i][1] * P[i][1] + P[i][2] * P[i][2]) / (2 * own);
      add_row(cone, Axes{-P[i][0], -P[i][1], -P[i][2]}, y);
    }
    std::copy(y.begin(), y.end(), gradient.begin());
    return value;
  }

  // The matrix of Newton's method by rows, each from its first entry to the diagonal.
  std::vector<int> place, first;
  std::vector<size_t> start;
  Vector constant, M, rhs, whole;
  double& at(Vector& matrix, int i, int j) const {
    int a = std::max(place[i], place[j]), b = std::min(place[i], place[j]);
    return matrix[start[a] + static_cast<size_t>(b - first[a])];
  }

  // Bodies by breadth from one with few neighbours, each followed by the multipliers of its contacts: rows are short.
  void order_variables() {
    std::vector<std::vector<int>> touching(body_count);
    for (size_t i = 0; i < cones.size(); ++i)
      for (int body : cones[i].body)
        if (body >= 0) touching[body].push_back(static_cast<int>(i));
    std::vector<int> roots(body_count), queue;
    std::iota(roots.begin(), roots.end(), 0);
    auto fewer = [&](int a, int b) { return touching[a].size() < touching[b].size(); };
    std::stable_sort(roots.begin(), roots.end(), fewer);
    std::vector<char> seen(body_count), placed(kept_velocities.size());
    place.assign(variables, 0);
    int next = 0;
    for (int root : roots) {
      if (seen[root]) continue;
      queue.assign(1, root);
      seen[root] = 1;
      for (size_t k = 0; k < queue.size(); ++k) {
        int body = queue[k];
        for (int c = 0; c < 6; ++c) place[6 * body + c] = next++;
        std::vector<int> near;
        for (int i : touching[body]) {
          int other = cones[i].body[0] == body ? cones[i].body[1] : cones[i].body[0];
          if (i < static_cast<int>(kept_velocities.size()) && !placed[i] && (other < 0 || seen[other])) {
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
    members.assign(body_count, {});
    for (int b = 0; b < body_count; ++b) {
      for (int c = 0; c < 6; ++c) members[b].push_back(6 * b + c);
      for (int i : touching[b])
        if (i < static_cast<int>(kept_velocities.size())) members[b].push_back(6 * body_count + i);
    }
  }
  std::vector<std::vector<int>> members;  // the variables that a body brings together

  void allocate_matrix() {
    first.assign(variables, 0);
    for (int i = 0; i < variables; ++i) first[place[i]] = place[i];
    auto join = [&](const std::vector<int>& all) {
      int least = variables;
      for (int i : all) least = std::min(least, place[i]);
      for (int i : all) first[place[i]] = std::min(first[place[i]], least);
    };
    for (const auto& some : members) join(some);
    for (const Cone& cone : cones)
      if (cone.body[0] >= 0 && cone.body[1] >= 0) {
        std::vector<int> both;
        for (int body : cone.body)
          for (int k = 0; k < 6; ++k) both.push_back(6 * body + k);
        join(both);
      }
    start.assign(variables + 1, 0);
    for (int i = 0; i < variables; ++i) start[i + 1] = start[i] + static_cast<size_t>(i - first[i] + 1);
    constant.assign(start[variables], 0.0);
    for (int i = 0; i < 6 * body_count; ++i) at(constant, i, i) = 1;
    for (int b = 0; b < body_count && !kept_velocities.empty(); ++b)
      for (size_t s = 6; s < members[b].size(); ++s) {
        int i = members[b][s];
        const double* row = normal(i - 6 * body_count, b);
        for (int k = 0; k < 6; ++k) at(constant, 6 * b + k, i) += row[k];
        for (size_t t = 6; t <= s; ++t) {
          int j = members[b][t];
          const double* other = normal(j - 6 * body_count, b);
          double sum = 0;
          for (int k = 0; k < 6; ++k) sum += row[k] * other[k];
          at(constant, i, j) += sum;
        }
      }
  }
  const double* normal(int i, int body) const { return cones[i].row[cones[i].body[0] == body ? 0 : 1][0]; }

  // step <- - M^-1 gradient
  void newton(const Vector& gradient, Vector& step) {
    M = constant;
    for (size_t i = 0; i < kept_velocities.size(); ++i) at(M, 6 * body_count + static_cast<int>(i), 6 * body_count + static_cast<int>(i)) += 1 / sigma;
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone& cone = cones[i];
      double own = rho * cone.share, part[2][3][6];
      if (slopes[i][0][0] == 0) continue;  // open
      for (int side = 0; side < 2; ++side)
        for (int a = 0; cone.body[side] >= 0 && a < 3; ++a)
          for (int k = 0; k < 6; ++k)
            part[side][a][k] = own * (slopes[i][a][0] * cone.row[side][0][k] + slopes[i][a][1] * cone.row[side][1][k] + slopes[i][a][2] * cone.row[side][2][k]);
      for (int s = 0; s < 2; ++s)
        for (int t = 0; t < 2; ++t) {
          if (cone.body[s] < 0 || cone.body[t] < 0) continue;
          int rows = place[6 * cone.body[s]], columns = place[6 * cone.body[t]];
          if (columns > rows) continue;
          for (int k = 0; k < 6; ++k) {
            double* row = &M[start[rows + k] + static_cast<size_t>(columns - first[rows + k])];
            int last = rows == columns ? k + 1 : 6;
            for (int l = 0; l < last; ++l) row[l] += cone.row[s][0][k] * part[t][0][l] + cone.row[s][1][k] * part[t][1][l] + cone.row[s][2][k] * part[t][2][l];
          }
        }
    }
    rhs.resize(variables);
    for (int i = 0; i < variables; ++i) rhs[place[i]] = -gradient[i];
    for (int i = 0; i < variables; ++i) {
      double* row = &M[start[i]];
      for (int j = first[i]; j < i; ++j) {
        int from = std::max(first[i], first[j]);
        const double *p = row + (from - first[i]), *q = &M[start[j]] + (from - first[j]);
        double sum = row[j - first[i]];
        for (int k = 0; k < j - from; ++k) sum -= p[k] * q[k];
        row[j - first[i]] = sum / M[start[j + 1] - 1];
      }
      double pivot = row[i - first[i]];
      for (int j = first[i]; j < i; ++j) pivot -= row[j - first[i]] * row[j - first[i]];
      row[i - first[i]] = pivot > 0 ? std::sqrt(pivot) : 0x1p200;
      for (int j = first[i]; j < i; ++j) rhs[i] -= row[j - first[i]] * rhs[j];
      rhs[i] /= row[i - first[i]];
    }
    for (int i = variables; i-- > 0;) {
      const double* row = &M[start[i]];
      rhs[i] /= row[i - first[i]];
      for (int j = first[i]; j < i; ++j) rhs[j] -= row[j - first[i]] * rhs[i];
    }
    for (int i = 0; i < variables; ++i) step[i] = rhs[place[i]];
  }
};
