// The least of  x.H x / 2 + h.x  where every  s_i = G_i x + g_i  lies in the cone  s_i[0] >= |(s_i[1], s_i[2])|.
//
// Primal-dual interior-point method with Nesterov & Todd's scaling and Mehrotra's predictor and corrector; as in
// Vandenberghe, "The CVXOPT linear and quadratic cone program solvers", 2010. Row 0 of G_i is dense, the others
// have one entry or none, at `place` and the next.
#pragma once
#include <cmath>
#include <vector>

struct ConeProgram {
  int n = 0;
  std::vector<double> H, h;
  struct Cone {
    std::vector<double> row;  // 0 of G
    int place;                // of the entries of rows 1 and 2, -1: none
    double entry;
    double g;  // g = (g, 0, 0): 0 is feasible
  };
  std::vector<Cone> cones;

  // x on return; the gap between its value and the least, or a bound on it. Starts at 0.
  double solve(std::vector<double>& x) const {
    size_t m = cones.size();
    std::vector<double> s(3 * m), z(3 * m), w(3 * m), lambda(3 * m), ds(3 * m), dz(3 * m), q(3 * m), rs(3 * m), t(3 * m), left(3 * m), beta(m);
    std::vector<double> M(static_cast<size_t>(n) * n), rx(n), dx(n), rhs(n), best(n, 0.0), gi(n);
    x.assign(n, 0.0);
    double size = 1e-300;
    for (double v : h) size = std::fmax(size, std::fabs(v));
    for (size_t i = 0; i < m; ++i) {
      s[3 * i] = cones[i].g;
      z[3 * i] = size;
    }
    std::vector<double> best_s(s), best_z(z);
    double least_gap = INFINITY, try_at = 1e-4 * size;
    for (int turn = 0; turn < 60; ++turn) {
      // Residuals.
      for (int a = 0; a < n; ++a) {
        double sum = h[a];
        for (int b = 0; b < n; ++b) sum += H[a * n + b] * x[b];
        rx[a] = sum;
      }
      add_transposed(z, -1, rx);
      double gap = 0, off = 0, worst = 0;
      for (size_t i = 0; i < m; ++i) {
        double t[3];
        apply(i, x, t);
        t[0] += cones[i].g;
        for (int k = 0; k < 3; ++k) {
          rs[3 * i + k] = t[k] - s[3 * i + k];
          gap += s[3 * i + k] * z[3 * i + k];
          off = std::fmax(off, std::fabs(rs[3 * i + k]));
        }
      }
      for (int a = 0; a < n; ++a) worst = std::fmax(worst, std::fabs(rx[a]));
      double merit = gap + worst + off * size;
      if (merit < least_gap) {
        least_gap = merit;
        best = x;
        best_s = s;
        best_z = z;
      } else if (turn > 25) {
        break;
      }
      if (merit < 1e-28 * size || !(gap == gap)) break;
      if (turn >= 3 && merit < try_at) {
        try_at = merit / 50;
        double polished = polish(s, z, x);
        if (polished < INFINITY) return polished;
      }

      // Scaling.
      for (size_t i = 0; i < m; ++i) {
        const double *a = &s[3 * i], *b = &z[3 * i];
        double la = std::sqrt(norm(a)), lb = std::sqrt(norm(b));
        double cosine = (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / (la * lb);
        double gamma = std::sqrt((1 + cosine) / 2);
        w[3 * i] = (a[0] / la + b[0] / lb) / (2 * gamma);
        w[3 * i + 1] = (a[1] / la - b[1] / lb) / (2 * gamma);
        w[3 * i + 2] = (a[2] / la - b[2] / lb) / (2 * gamma);
        beta[i] = std::sqrt(la / lb);
        scale(i, w, beta, &z[3 * i], &lambda[3 * i], false);
      }
      // H + G^T W^-2 G
      M = H;
      for (size_t i = 0; i < m; ++i) {  // by the eigenvectors of W^-2: nothing cancels
        const Cone& cone = cones[i];
        double across = std::hypot(w[3 * i + 1], w[3 * i + 2]), far = w[3 * i] + across;
        double d1 = across > 0 ? -w[3 * i + 1] / across : 1, d2 = across > 0 ? -w[3 * i + 2] / across : 0;
        for (double sign : {1.0, -1.0}) {
          double c = (sign > 0 ? far : 1 / far) / beta[i] * std::sqrt(0.5);
          for (int k = 0; k < n; ++k) gi[k] = c * cone.row[k];
          if (cone.place >= 0) {
            gi[cone.place] += sign * c * d1 * cone.entry;
            gi[cone.place + 1] += sign * c * d2 * cone.entry;
          }
          for (int k = 0; k < n; ++k)
            for (int l = 0; l <= k; ++l) M[k * n + l] += gi[k] * gi[l];
        }
        if (cone.place >= 0) {
          double c = cone.entry / beta[i], p1 = -c * d2, p2 = c * d1;
          int k = cone.place;
          M[k * n + k] += p1 * p1;
          M[(k + 1) * n + k] += p1 * p2;
          M[(k + 1) * n + k + 1] += p2 * p2;
        }
      }
      factor(M);

      // Predictor, then corrector.
      double target = 0;
      for (int phase = 0; phase < 2; ++phase) {
        for (size_t i = 0; i < m; ++i) {
          double r[3], *l = &lambda[3 * i];
          product(l, l, r);
          for (double& v : r) v = -v;
          if (phase) {
            double a[3], b[3], c[3];
            scale(i, w, beta, &ds[3 * i], a, true);
            scale(i, w, beta, &dz[3 * i], b, false);
            product(a, b, c);
            for (int k = 0; k < 3; ++k) r[k] -= c[k];
            r[0] += target;
          }
          divide(l, r, &q[3 * i]);
        }
        // H dx - G^T dz = -rx and W dz + W^-1 (G dx + rs) = q, with what rounding left of them twice more.
        std::fill(dx.begin(), dx.end(), 0.0);
        std::fill(dz.begin(), dz.end(), 0.0);
        ds = rs;
        for (int pass = 0; pass < (gap < 1e-5 * size ? 3 : 1); ++pass) {
          for (int a = 0; a < n; ++a) {
            double sum = rx[a];
            for (int b = 0; b < n; ++b) sum += H[a * n + b] * dx[b];
            rhs[a] = -sum;
          }
          add_transposed(dz, 1, rhs);
          for (size_t i = 0; i < m; ++i) {
            double a[3], b[3];
            scale(i, w, beta, &dz[3 * i], a, false);
            scale(i, w, beta, &ds[3 * i], b, true);
            for (int k = 0; k < 3; ++k) left[3 * i + k] = q[3 * i + k] - a[k] - b[k];
            scale(i, w, beta, &left[3 * i], &t[3 * i], true);
          }
          add_transposed(t, 1, rhs);
          substitute(M, rhs);
          for (int a = 0; a < n; ++a) dx[a] += rhs[a];
          for (size_t i = 0; i < m; ++i) {
            double by[3], a[3], b[3];
            apply(i, rhs, by);
            scale(i, w, beta, by, a, true);
            for (int k = 0; k < 3; ++k) {
              ds[3 * i + k] += by[k];
              a[k] = left[3 * i + k] - a[k];
            }
            scale(i, w, beta, a, b, true);
            for (int k = 0; k < 3; ++k) dz[3 * i + k] += b[k];
          }
        }
        double most = 1;
        for (size_t i = 0; i < m; ++i)
          most = std::fmin(most, std::fmin(reach(&s[3 * i], &ds[3 * i]), reach(&z[3 * i], &dz[3 * i])));
        if (phase == 0) {
          double after = 0;
          for (size_t i = 0; i < 3 * m; ++i) after += (s[i] + most * ds[i]) * (z[i] + most * dz[i]);
          double ratio = gap > 0 ? std::fmax(after, 0) / gap : 0;
          target = gap / m * ratio * ratio * ratio;
        } else {
          double step = most < 1 ? 0.995 * most : 1;
          for (int a = 0; a < n; ++a) x[a] += step * dx[a];
          for (size_t i = 0; i < 3 * m; ++i) {
            s[i] += step * ds[i];
            z[i] += step * dz[i];
          }
        }
      }
    }
    x = best;
    return std::fmin(least_gap, polish(best_s, best_z, x));
  }

 private:
  // Newton's method on the conditions of the least, with the active cones taken from an approximate solution: of
  // the direction of friction that knows only the root of the gap. The gap after it; x is left if that is no less.
  double polish(const std::vector<double>& s, const std::vector<double>& z, std::vector<double>& x) const {
    constexpr double PENALTY = 1e6;
    // Each is one number that is 0: of a cone with s on its boundary, or each of s where s is 0.
    struct Active {
      size_t cone;
      int part;  // of s, or BOUNDARY
      double multiplier;
    };
    constexpr int BOUNDARY = -1;
    std::vector<Active> active;
    for (size_t i = 0; i < cones.size(); ++i) {
      double across = std::hypot(s[3 * i + 1], s[3 * i + 2]), slack = s[3 * i] - across;
      double pull = std::hypot(z[3 * i + 1], z[3 * i + 2]);
      if (s[3 * i] + across < z[3 * i] - pull) {
        for (int part = 0; part < (cones[i].place < 0 ? 1 : 3); ++part) active.push_back({i, part, z[3 * i + part]});
      } else if (slack < z[3 * i]) {
        active.push_back({i, BOUNDARY, z[3 * i]});
      }
    }
    std::vector<double> y(x), M, rhs(n), slope(active.size() * n), value(active.size());
    double before = INFINITY;
    for (int turn = 0; turn < 12; ++turn) {
      M = H;
      for (int a = 0; a < n; ++a) {
        double sum = h[a];
        for (int b = 0; b < n; ++b) sum += H[a * n + b] * y[b];
        rhs[a] = -sum;
      }
      double off = 0;
      for (size_t k = 0; k < active.size(); ++k) {
        const Cone& cone = cones[active[k].cone];
        double* d = &slope[k * n];
        if (active[k].part > 0) {
          int p = cone.place + active[k].part - 1;
          std::fill(d, d + n, 0.0);
          d[p] = -cone.entry;
          value[k] = -cone.entry * y[p];
          rhs[p] -= d[p] * active[k].multiplier;
          off = std::fmax(off, std::fabs(value[k]));
          continue;
        }
        double along = cone.g;
        for (int a = 0; a < n; ++a) {
          along += cone.row[a] * y[a];
          d[a] = -cone.row[a];
        }
        value[k] = -along;
        if (cone.place >= 0 && active[k].part == BOUNDARY) {
          double t1 = y[cone.place], t2 = y[cone.place + 1], size = std::hypot(t1, t2);
          if (!(size > 0)) return INFINITY;
          value[k] += cone.entry * size;
          d[cone.place] += cone.entry * t1 / size;
          d[cone.place + 1] += cone.entry * t2 / size;
          double curvature = std::fmax(active[k].multiplier, 0) * cone.entry / size;
          int p = cone.place;
          M[p * n + p] += curvature * t2 * t2 / (size * size);
          M[(p + 1) * n + p] -= curvature * t1 * t2 / (size * size);
          M[(p + 1) * n + p + 1] += curvature * t1 * t1 / (size * size);
        }
        for (int a = 0; a < n; ++a) rhs[a] -= d[a] * active[k].multiplier;
        off = std::fmax(off, std::fabs(value[k]));
      }
      for (double r : rhs) off = std::fmax(off, std::fabs(r));
      if (off >= before / 2 && (turn > 2 || off < 1e-15)) break;
      before = off;
      for (size_t k = 0; k < active.size(); ++k)
        for (int a = 0; a < n; ++a) {
          double d = PENALTY * slope[k * n + a];
          rhs[a] -= d * value[k];
          for (int b = 0; b <= a; ++b) M[a * n + b] += d * slope[k * n + b];
        }
      factor(M);
      substitute(M, rhs);
      for (int a = 0; a < n; ++a) y[a] += rhs[a];
      for (size_t k = 0; k < active.size(); ++k) {
        double change = value[k];
        for (int a = 0; a < n; ++a) change += slope[k * n + a] * rhs[a];
        active[k].multiplier += PENALTY * change;
      }
    }
    // Whether it is the least: multipliers of the right sign, the other cones kept.
    double worst = before, sum = 0;
    for (size_t k = 0; k < active.size(); ++k) {
      double pull = active[k].multiplier;
      sum += std::fabs(pull);
      if (active[k].part > 0) continue;
      if (active[k].part == 0 && cones[active[k].cone].place >= 0)
        pull -= std::hypot(active[k + 1].multiplier, active[k + 2].multiplier);
      worst = std::fmax(worst, -pull);
    }
    for (size_t i = 0; i < cones.size(); ++i) {
      double t[3];
      apply(i, y, t);
      worst = std::fmax(worst, std::hypot(t[1], t[2]) - t[0] - cones[i].g);
    }
    if (!(worst < 1e-11)) return INFINITY;
    x = y;
    for (double v : y) sum += std::fabs(v);
    return worst * (sum + 1);
  }

  static double norm(const double* v) {
    double t = std::hypot(v[1], v[2]);
    return std::fmax((v[0] - t) * (v[0] + t), 1e-300);
  }
  static void product(const double* a, const double* b, double* c) {
    double first = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    double second = a[0] * b[1] + b[0] * a[1], third = a[0] * b[2] + b[0] * a[2];
    c[0] = first;
    c[1] = second;
    c[2] = third;
  }
  static void divide(const double* l, const double* r, double* y) {  // l o y = r
    double size = norm(l), along = l[1] * r[1] + l[2] * r[2];
    y[0] = (l[0] * r[0] - along) / size;
    for (int k = 1; k < 3; ++k) y[k] = (r[k] - y[0] * l[k]) / l[0];
  }
  // W y, or W^-1 y.
  static void scale(size_t i, const std::vector<double>& w, const std::vector<double>& beta, const double* y, double* out, bool inverse) {
    double a[3] = {w[3 * i], w[3 * i + 1], w[3 * i + 2]}, b = beta[i];
    double sign = inverse ? -1 : 1, f = inverse ? 1 / b : b;
    double along = sign * (a[1] * y[1] + a[2] * y[2]), first = a[0] * y[0] + along;
    double c = sign * (y[0] + along / (1 + a[0]));
    out[0] = f * first;
    for (int k = 1; k < 3; ++k) out[k] = f * (y[k] + c * a[k]);
  }
  static double reach(const double* v, const double* d) {  // how far v + a d stays in the cone
    double a = d[0] * d[0] - d[1] * d[1] - d[2] * d[2], b = v[0] * d[0] - v[1] * d[1] - v[2] * d[2], c = norm(v);
    double most = d[0] < 0 ? -v[0] / d[0] : INFINITY;
    double disc = b * b - a * c;
    if (disc >= 0) {
      double q = -(b + (b < 0 ? -1 : 1) * std::sqrt(disc));
      for (double root : {a != 0 ? q / a : INFINITY, q != 0 ? c / q : INFINITY})
        if (root > 0) most = std::fmin(most, root);
    }
    return most;
  }
  void apply(size_t i, const std::vector<double>& x, double* t) const {
    const Cone& cone = cones[i];
    t[0] = t[1] = t[2] = 0;
    for (int k = 0; k < n; ++k) t[0] += cone.row[k] * x[k];
    if (cone.place >= 0)
      for (int k = 0; k < 2; ++k) t[1 + k] = cone.entry * x[cone.place + k];
  }
  void add_transposed(const std::vector<double>& y, double sign, std::vector<double>& out) const {
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone& cone = cones[i];
      for (int k = 0; k < n; ++k) out[k] += sign * cone.row[k] * y[3 * i];
      if (cone.place >= 0)
        for (int k = 0; k < 2; ++k) out[cone.place + k] += sign * cone.entry * y[3 * i + 1 + k];
    }
  }
  // A direction that nothing resists is left out.
  void factor(std::vector<double>& M) const {
    std::vector<double> whole(n), column(n);
    for (int i = 0; i < n; ++i) whole[i] = M[i * n + i];
    for (int j = 0; j < n; ++j) {
      double pivot = M[j * n + j];
      double root = M[j * n + j] = pivot > 0x1p-50 * whole[j] ? std::sqrt(pivot) : 0x1p500;
      for (int i = j + 1; i < n; ++i) column[i] = M[i * n + j] /= root;
      for (int i = j + 1; i < n; ++i) {  // by rows: a compiler can make vectors of this
        double left = column[i], *row = &M[i * n];
        for (int k = j + 1; k <= i; ++k) row[k] -= left * column[k];
      }
    }
  }
  void substitute(const std::vector<double>& M, std::vector<double>& y) const {
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < i; ++k) y[i] -= M[i * n + k] * y[k];
      y[i] /= M[i * n + i];
    }
    for (int i = n; i-- > 0;) {
      y[i] /= M[i * n + i];
      for (int k = 0; k < i; ++k) y[k] -= M[i * n + k] * y[i];
    }
  }
};
