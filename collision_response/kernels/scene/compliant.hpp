// Liu, Zhao & Brogliato's law as an equation in time: see stronge.py. In plain doubles, in the axes of each
// contact.
//
//     p_i' = f_i = k_i max(x_i, 0)^eta
//     x_i' = -u_i            while u_i < 0                     loading
//          = -u_i / e_i^2    while u_i > 0 and x_i > 0         unloading
//          = 0               else
#pragma once
#include <numeric>

#include "friction.hpp"

struct Compliant {
  const Assembly& scene;
  double exponent;
  std::vector<double> stiffness;
  struct Coupled {
    int other;
    double by;
  };
  std::vector<std::vector<Coupled>> C;  // normal velocities by unit normal impulses
  int count;
  double speed = 0, mass = 0;
  double slow = 0;  // an approach below it is none: rounding would keep some contact for ever

  Compliant(const Assembly& assembly, double exponent, std::vector<double> ratios)
      : scene(assembly), exponent(exponent), stiffness(std::move(ratios)), count(assembly.count) {
    C.resize(count);
    for (int i = 0; i < count; ++i) {
      speed = std::fmax(speed, std::fabs(scene.touches[i].plain[0].velocity));
      for (int j = 0; j < count; ++j)
        if (double by = coupling(scene, i, 0, j, 0); by != 0) C[i].push_back({j, by});
      mass += 1 / coupling(scene, i, 0, i, 0) / count;
    }
    double most = 0;
    for (double k : stiffness) most = std::fmax(most, k);
    // A unit of time is what a contact takes: k x^eta t = m u with x = u t.
    for (double& k : stiffness) k *= mass * speed / std::pow(speed, exponent) / most;
  }

  double force(int i, double x) const {
    return x > 0 ? stiffness[i] * (exponent == 1.5 ? x * std::sqrt(x) : std::pow(x, exponent)) : 0;
  }
  double rate(int i, double x, double u) const {
    double e = scene.touches[i].e;
    return u < -slow ? -u : x > 0 && u > 0 ? -u / (e * e) : 0;
  }
  double velocity(int i, const double* p) const {
    double u = scene.touches[i].plain[0].velocity;
    for (const Coupled& j : C[i]) u += j.by * p[j.other];
    return u;
  }

  // y: x_i, p_i. Dormand & Prince's pair of orders 5 and 4.
  void derivative(const double* y, double* d, const std::vector<int>& awake) const {
    const double *x = y, *p = y + count;
    for (int i : awake) {
      double u = velocity(i, p);
      d[i] = rate(i, x[i], u);
      d[count + i] = force(i, x[i]);
    }
  }

  // Whether what is left in a spring is too little to show.
  bool is_over(int i, double x, double u) const { return force(i, x) * x <= mass * slow * slow && u >= -slow; }
  // Of some contacts those that are not over, and what these may strike within a step: two contacts away.
  std::vector<int> still_awake(const double* y, const std::vector<int>& some) const {
    std::vector<int> found;
    std::vector<char> listed(count, 0);
    auto list = [&](int i) {
      if (!listed[i]) found.push_back(i);
      listed[i] = 1;
    };
    for (int i : some)
      if (!is_over(i, y[i], velocity(i, y + count))) list(i);
    for (int away = 0; away < 2; ++away)
      for (size_t of_these = found.size(), k = 0; k < of_these; ++k)
        for (const Coupled& j : C[found[k]]) list(j.other);
    return found;
  }

  // The normal impulses without friction; whether it ended within its budget of steps.
  bool follow(double tolerance, long budget, std::vector<double>& p) {
    slow = std::fmax(tolerance / 10, 2e-14) * speed;
    size_t n = 2 * static_cast<size_t>(count);
    std::vector<double> y(n, 0.0), k[7], z(n, 0.0);
    for (auto& one : k) one.resize(n);
    static const double a[7][6] = {
        {},
        {1.0 / 5},
        {3.0 / 40, 9.0 / 40},
        {44.0 / 45, -56.0 / 15, 32.0 / 9},
        {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
        {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
        {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
    static const double error[7] = {71.0 / 57600, 0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
    double h = 1e-4;
    std::vector<int> awake(count);
    std::iota(awake.begin(), awake.end(), 0);
    awake = still_awake(y.data(), awake);
    derivative(y.data(), k[0].data(), awake);
    for (long step = 0; step < budget; ++step) {
      if (awake.empty()) {
        p.assign(y.begin() + count, y.end());
        return true;
      }
      for (int s = 1; s < 7; ++s) {
        for (int contact : awake)
          for (int i : {contact, count + contact}) {
            double sum = 0;
            for (int j = 0; j < s; ++j) sum += a[s][j] * k[j][i];
            z[i] = y[i] + h * sum;
          }
        derivative(z.data(), k[s].data(), awake);
      }
      double worst = 0;
      for (int contact : awake)
        for (int i : {contact, count + contact}) {
          double off = 0;
          for (int j = 0; j < 7; ++j) off += error[j] * k[j][i];
          worst = std::fmax(worst, std::fabs(h * off) / (tolerance * (i < count ? speed : mass * speed)));
        }
      if (worst <= 1 || h < 1e-13) {
        for (int i : awake) z[i] = std::fmax(z[i], 0);
        y = z;  // of those asleep they are the same
        awake = still_awake(y.data(), awake);
        derivative(y.data(), k[0].data(), awake);
      }
      h *= std::fmin(4.0, std::fmax(0.2, 0.9 * std::pow(std::fmax(worst, 1e-10), -0.2)));
      if (h > 0.2) h = 0.2;
    }
    return false;
  }

  // With friction: steps of equal length, in each of which friction opposes the slip at its end.
  bool follow_with_friction(double h, long budget, std::vector<Axes>& P) {
    slow = 1e-8 * speed;  // steps of first order do not tell less
    Motion motion(scene);
    P.assign(count, Axes{0, 0, 0});
    std::vector<double> x(count, 0.0), limit(count), rho(count);
    std::vector<Axes> friction(count, Axes{0, 0, 0});
    for (int i = 0; i < count; ++i) rho[i] = 1 / (coupling(scene, i, 1, i, 1) + coupling(scene, i, 2, i, 2));
    for (long step = 0; step < budget; ++step) {
      bool done = true;
      // Half a step of x, a step of the forces, half a step of x.
      for (int i = 0; i < count; ++i) x[i] = std::fmax(x[i] + h / 2 * rate(i, x[i], motion.velocity(i, 0)), 0);
      double most = 0;
      for (int i = 0; i < count; ++i) {
        double by = h * force(i, x[i]);
        most = std::fmax(most, by);
        limit[i] = scene.touches[i].mu * by;
        double size = std::hypot(friction[i][1], friction[i][2]), fits = size > limit[i] ? limit[i] / size : 1;
        friction[i] = {0, friction[i][1] * fits, friction[i][2] * fits};
        motion.push(i, {by, friction[i][1], friction[i][2]});
        P[i][0] += by;
      }
      for (int sweep = 0; sweep < 200; ++sweep) {
        double change = 0;
        for (int i = 0; i < count; ++i) {
          if (!(limit[i] > 0)) continue;
          double t1 = friction[i][1] - rho[i] * motion.velocity(i, 1), t2 = friction[i][2] - rho[i] * motion.velocity(i, 2);
          double size = std::hypot(t1, t2), fits = size > limit[i] ? limit[i] / size : 1;
          Axes by{0, t1 * fits - friction[i][1], t2 * fits - friction[i][2]};
          friction[i] = {0, t1 * fits, t2 * fits};
          motion.push(i, by);
          change = std::fmax(change, std::fabs(by[1]) + std::fabs(by[2]));
        }
        if (change <= 1e-11 * most) break;
      }
      for (int i = 0; i < count; ++i) {
        P[i][1] += friction[i][1];
        P[i][2] += friction[i][2];
        double u = motion.velocity(i, 0);
        x[i] = std::fmax(x[i] + h / 2 * rate(i, x[i], u), 0);
        done = done && is_over(i, x[i], u);
      }
      if (done) return true;
    }
    return false;
  }
};
