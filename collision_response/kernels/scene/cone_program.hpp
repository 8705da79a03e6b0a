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

  using V3 = double[3];

  // x on return; the gap between its value and the least, or a bound on it. Starts at 0.
  double solve(std::vector<double>& x) const {
    size_t m = cones.size();
    std::vector<double> s(3 * m), z(3 * m), w(3 * m), lambda(3 * m), ds(3 * m), dz(3 * m), q(3 * m), rs(3 * m), beta(m);
    std::vector<double> M(static_cast<size_t>(n) * n), rx(n), dx(n), rhs(n), best(n, 0.0), gi(n);
    x.assign(n, 0.0);
    double size = 1e-300;
    for (double v : h) size = std::fmax(size, std::fabs(v));
    for (size_t i = 0; i < m; ++i) {
      s[3 * i] = cones[i].g;
      z[3 * i] = size;
    }
    double least_gap = INFINITY;
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
      } else if (turn > 25) {
        break;
      }
      if (merit < 1e-28 * size || !(gap == gap)) break;

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
      for (size_t i = 0; i < m; ++i) {
        const Cone& cone = cones[i];
        double c = 1 / (beta[i] * beta[i]), a[3] = {w[3 * i], -w[3 * i + 1], -w[3 * i + 2]};
        for (int k = 0; k < n; ++k) gi[k] = a[0] * cone.row[k];
        if (cone.place >= 0) {
          gi[cone.place] += a[1] * cone.entry;
          gi[cone.place + 1] += a[2] * cone.entry;
          M[cone.place * n + cone.place] += c * cone.entry * cone.entry;
          M[(cone.place + 1) * n + cone.place + 1] += c * cone.entry * cone.entry;
        }
        for (int k = 0; k < n; ++k) {
          double left = 2 * c * gi[k], minus = c * cone.row[k];
          for (int l = 0; l <= k; ++l) M[k * n + l] += left * gi[l] - minus * cone.row[l];
        }
      }
      if (!factor(M)) break;

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
        for (int a = 0; a < n; ++a) rhs[a] = -rx[a];
        std::vector<double> t(3 * m);
        for (size_t i = 0; i < m; ++i) {
          double a[3], b[3], c[3];
          scale(i, w, beta, &q[3 * i], a, true);  // W^-1 q
          scale(i, w, beta, &rs[3 * i], b, true);
          scale(i, w, beta, b, c, true);  // W^-2 rs
          for (int k = 0; k < 3; ++k) t[3 * i + k] = a[k] - c[k];
        }
        add_transposed(t, 1, rhs);
        dx = rhs;
        substitute(M, dx);
        double most = 1;
        for (size_t i = 0; i < m; ++i) {
          double t3[3], a[3], b[3], c[3];
          apply(i, dx, t3);
          for (int k = 0; k < 3; ++k) ds[3 * i + k] = t3[k] + rs[3 * i + k];
          scale(i, w, beta, &q[3 * i], a, true);
          scale(i, w, beta, &ds[3 * i], b, true);
          scale(i, w, beta, b, c, true);
          for (int k = 0; k < 3; ++k) dz[3 * i + k] = a[k] - c[k];
          most = std::fmin(most, std::fmin(reach(&s[3 * i], &ds[3 * i]), reach(&z[3 * i], &dz[3 * i])));
        }
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
    return least_gap;
  }

 private:
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
  bool factor(std::vector<double>& M) const {
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) {
        double sum = M[i * n + j];
        for (int k = 0; k < j; ++k) sum -= M[i * n + k] * M[j * n + k];
        if (i == j) {
          if (!(sum > 0)) return false;
          M[i * n + i] = std::sqrt(sum);
        } else {
          M[i * n + j] = sum / M[j * n + j];
        }
      }
    return true;
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
