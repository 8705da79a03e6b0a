// The path of ROUTH_STRONGE without friction, by the Runge-Kutta pair of orders 5 and 4 of Dormand & Prince, "A Family
// of Embedded Runge-Kutta Formulae", J. Comput. Appl. Math. 6 (1980).
#pragma once
#include "contact_springs.hpp"

struct PathWithoutFriction : ContactSprings {
  using ContactSprings::ContactSprings;
  static constexpr bool HAS_FRICTION = false;
  static constexpr double FIRST_TOLERANCE = 1e-5, LEAST_RATIO = 1e-2, ENOUGH = 1e-6;  // see follow_springs()
  static constexpr double ORDER = 5;
  static constexpr long STAGE = 20;  // the cost of one contact in a stage, in addition to its couplings

  // Whether the path ended within its budget.
  bool follow() {
    h = 1e-4;  // of the first step: its error corrects it
    active = assembly.all_contacts();
    begin_step();
    while (is_within_budget(ORDER) && !active.empty()) {
      for (int stage = 1; stage < 7; ++stage) {
        for (int contact : active)
          for (int c : {contact, count + contact}) z[c] = y[c] + h * combination(STAGES[stage], stage, c);
        find_derivative(z, k[stage]);
      }
      double worst = 0, turns = 1, fastest = 0;
      for (int i : active) {
        const double of_x = std::fabs(h * combination(ERROR, 7, i)) / (own_time[i] * speed);
        const double of_p = std::fabs(h * combination(ERROR, 7, count + i)) / (own_mass[i] * speed);
        worst = std::fmax(worst, std::fmax(of_x, of_p) / tolerance);
        const double u = velocity(i, z);
        turns = std::fmin(turns, turning_fraction(i, y[i], velocity(i, y), u));
        fastest = std::fmax(fastest, residual_speed(i, z[i], u));
      }
      if (!accepts_step(worst, ORDER, turns, fastest)) continue;
      for (int i : active) z[i] = std::fmax(z[i], 0);
      y = z;  // contacts that are not active have not changed
      begin_step();
    }
    if (active.empty()) rounding = rounding_of_velocities();
    return active.empty();
  }

  List<Axes> impulses() const {
    List<Axes> P(count);
    for (int i = 0; i < count; ++i) P[i][0] = y[count + i];
    return P;
  }

 private:
  static constexpr double STAGES[7][6] = {{},
                                          {1.0 / 5},
                                          {3.0 / 40, 9.0 / 40},
                                          {44.0 / 45, -56.0 / 15, 32.0 / 9},
                                          {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
                                          {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
                                          {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
  static constexpr double ERROR[7] = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                                      -17253.0 / 339200, 22.0 / 525, -1.0 / 40};

  Vector y = Vector(2 * static_cast<size_t>(count));  // all x_i, then all p_i
  Vector z = y, k[7]{y, y, y, y, y, y, y};  // a stage, and the derivatives at the stages
  List<int> active;

  double combination(const double* by, int terms, int component) const {
    double sum = 0;
    for (int j = 0; j < terms; ++j) sum += by[j] * k[j][component];
    return sum;
  }
  double velocity(int i, const Vector& at) const {
    double u = assembly.contacts[i].axes[0].velocity;
    for (const Coupled& j : coupled[i]) u += j.by * at[count + j.other];
    return u;
  }
  void find_derivative(const Vector& at, Vector& d) {
    for (int i : active) {
      work -= STAGE + static_cast<long>(coupled[i].size());
      d[i] = rate(i, at[i], velocity(i, at));
      d[count + i] = force(i, at[i]);
    }
  }

  // Of the active contacts, keep those that are not over, and add those that these may compress within a step: up to
  // two contacts away.
  void begin_step() {
    List<int> found;
    List<char> listed(count, 0);
    auto list = [&](int i) {
      if (!listed[i]) found.push_back(i);
      listed[i] = 1;
    };
    for (int i : active)
      if (!is_over(i, y[i], velocity(i, y))) list(i);
    for (int away = 0; away < 2; ++away)
      for (size_t of_these = found.size(), f = 0; f < of_these; ++f)
        for (const Coupled& j : coupled[found[f]]) list(j.other);
    active = std::move(found);
    find_derivative(y, k[0]);
  }

  // An estimate of the error of the path by the rounding of the velocities, whose terms may cancel where light bodies
  // are pressed by heavy ones: the motion that changes every velocity by as much, relative to that by all impulses.
  double rounding_of_velocities() const {
    double most = 0, square = 0;
    for (int i = 0; i < count; ++i) {
      double terms = 0, change = 0;
      for (const Coupled& j : coupled[i]) {
        terms += std::fabs(j.by * y[count + j.other]);
        change += j.by * y[count + j.other];
      }
      most = std::fmax(most, terms / std::sqrt(coupling(assembly, i, 0, i, 0)));
      square += y[count + i] * change;
    }
    return 0x1p-52 * most * separating_size() / std::sqrt(square);
  }
};
