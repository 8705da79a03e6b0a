// ROUTH_STRONGE: one path of its differential equation, in plain doubles, along the axes of each contact.
// stronge.hpp derives it, and chooses the tolerance of the path.
//
//     p_i' = f_i = k_i max(x_i, 0)^eta
//     x_i' = -u_i            while u_i < 0                     loading
//          = -u_i / e_i^2    while u_i > 0 and x_i > 0         unloading
//          = 0               else
#pragma once
#include <numeric>

#include "motion.hpp"

struct ContactSprings {
  Assembly assembly;  // in units near its speed and mass, powers of two: no square overflows or underflows
  double unit = 1, root = 1;  // the units of speed, and of the root of mass
  double exponent;
  std::vector<double> stiffness;
  // Of the stiffest spring: softer springs count as this. They act when all others have done so.
  static constexpr double SOFTEST = 0x1p-100;
  struct Coupled {
    int other;
    double by;
  };
  // For each contact, the change of its normal velocity by unit normal impulses on others.
  std::vector<std::vector<Coupled>> C;
  int count;
  double speed = 0, mass = 0;  // speed: of the fastest approach
  double slow = 0;  // slower approaches count as none, because rounding could keep a contact approaching for ever
  long work;  // remaining budget: the coupling of two contacts costs 1, about a nanosecond
  double friction_loss = 0;  // energy that friction took
  double step_errors = 0;  // the sum of the estimates of all steps, relative to the speed
  double rounding = 0;  // estimate of the relative error of the answer by rounding
  bool is_wedged = false;  // the path has no end

  ContactSprings(const Assembly& given, double exponent, std::vector<double> ratios, long budget)
      : assembly(given), exponent(exponent), stiffness(std::move(ratios)), count(given.count), work(budget) {
    C.resize(count);
    for (const AssembledContact& contact : assembly.contacts) {
      speed = std::fmax(speed, -contact.axes[0].velocity);
      mass = std::fmax(mass, std::fabs(contact.unit()));
    }
    unit = power_near(speed);
    root = power_near(mass);
    speed /= unit;
    mass = 0;
    for (AssembledContact& contact : assembly.contacts)
      for (auto& axis : contact.axes) {
        axis.velocity /= unit;
        for (auto& side : axis.row)
          for (double& x : side) x *= root;
      }
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < count; ++j)
        if (double by = coupling(assembly, i, 0, j, 0); by != 0) C[i].push_back({j, by});
      mass += 1 / coupling(assembly, i, 0, i, 0) / count;
    }
    double most = 0;
    for (double k : stiffness) most = std::fmax(most, k);
    const double stiffness_unit = power_near(most);
    most /= stiffness_unit;
    // In a unit of time near the duration of a contact: k x^eta t = m u with x = u t.
    for (double& k : stiffness)
      k = std::fmax(k / stiffness_unit, SOFTEST) * (mass * speed / std::pow(speed, exponent) / most);
  }

  double impulse(double p) const { return p * root * unit * root; }
  // Squares are in range, so this is right. It takes a third of the time of std::hypot.
  static double length(double a, double b) { return std::sqrt(a * a + b * b); }
  double force(int i, double x) const {
    return x > 0 ? stiffness[i] * (exponent == 1.5 ? x * std::sqrt(x) : std::pow(x, exponent)) : 0;
  }
  double rate(int i, double x, double u) const {
    double e = assembly.contacts[i].e;
    return u < -slow ? -u : x > 0 && u > 0 ? -u / (e * e) : 0;
  }
  double velocity(int i, const double* p) const {
    double u = assembly.contacts[i].axes[0].velocity;
    for (const Coupled& j : C[i]) u += j.by * p[j.other];
    return u;
  }

  // The size of a motion that separates all contacts, for contacts of mass and speed 1. It is large where light bodies
  // are between heavy ones.
  double separating_size() const { return assembly.is_locked ? 1 : assembly.separating_size; }
  // An estimate of the error of the path by the rounding of the velocities, whose terms may cancel where light bodies are
  // pressed by heavy ones: the motion that changes every velocity by as much, relative to the motion by impulses p.
  double rounding_of(const std::vector<double>& p) const {
    double most = 0, square = 0;
    for (int i = 0; i < count; ++i) {
      double terms = 0, change = 0;
      for (const Coupled& j : C[i]) {
        terms += std::fabs(j.by * p[j.other]);
        change += j.by * p[j.other];
      }
      most = std::fmax(most, terms / std::sqrt(coupling(assembly, i, 0, i, 0)));
      square += p[i] * change;
    }
    return 0x1p-52 * most * separating_size() / std::sqrt(square);
  }

  // The impulses of a path in newton seconds. If the errors of the path create energy, all impulses are made smaller until
  // they do not.
  std::vector<Axes> in_newton_seconds(std::vector<Axes> P) const {
    Motion motion(assembly);
    for (int i = 0; i < count; ++i) motion.apply(i, P[i]);
    double before = 0, after = 0;  // twice the work of P is P.u before and after
    for (int i = 0; i < count; ++i)
      for (int axis = 0; axis < 3; ++axis) {
        before += P[i][axis] * assembly.contacts[i].axes[axis].velocity;
        after += P[i][axis] * motion.velocity(i, axis);
      }
    const double part = before + after > 0 ? 2 * before / (before - after) : 1;
    for (Axes& one : P)
      for (double& along : one) along = impulse(part * along);
    return P;
  }

  // Without friction the state y is all x_i, then all p_i. It is integrated by the pair of Dormand & Prince, of orders
  // 5 and 4.
  static constexpr long STAGE = 20;  // the cost of one contact in a stage, in addition to its couplings
  void derivative(const double* y, double* d, const std::vector<int>& active) {
    const double *x = y, *p = y + count;
    for (int i : active) {
      work -= STAGE + static_cast<long>(C[i].size());
      double u = velocity(i, p);
      d[i] = rate(i, x[i], u);
      d[count + i] = force(i, x[i]);
    }
  }

  // Whether the energy left in a spring is too small to matter, and its contact does not approach.
  bool is_over(int i, double x, double u) const { return force(i, x) * x <= mass * slow * slow && u >= -slow; }
  // Those of `some` contacts that are not over, and the contacts that these may compress within a step: those up to two
  // contacts away.
  std::vector<int> still_active(const double* y, const std::vector<int>& some) const {
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

  // The length of the steps. An error that is too large is mostly due to a spring that turns from loading to unloading
  // within the step, where its rate has a kink: then the step is shortened to end there, by the secant. A spring that
  // turns at the very end is not the cause.
  struct Pace {
    double h;

    // Whether to accept a step; sets the length of the next. worst: the error relative to the one allowed; turns: the
    // fraction of the step after which the first spring turns.
    bool accepts(double worst, double order, double turns, double longest) {
      double by = 0.9 * std::pow(std::fmax(worst, 1e-10), -1 / order);
      if (worst <= 1 || h < 1e-13) {
        h = std::fmin(h * std::fmin(4.0, std::fmax(0.2, by)), longest);
        return true;
      }
      h *= turns > 1e-6 && turns < 0.9 ? turns : std::fmax(0.2, by);
      return false;
    }
  };
  double turning_fraction(int i, double x, double before, double after) const {
    bool bends = x > 0 ? assembly.contacts[i].e < 1 : after < 0;
    return bends && (before < 0) != (after < 0) ? before / (before - after) : 1;
  }
  // The normal speed of a contact after its spring has given its energy back.
  double residual_speed(int i, double x, double u) const {
    return x > 0 || u < 0 ? std::sqrt(u * u + force(i, x) * x / mass) : 0;
  }
  // The longest step, if `fastest` is the greatest residual speed. Slower contacts compress their springs for longer.
  double longest_step(double fastest) const {
    return 0.2 * std::pow(std::fmin(std::fmax(fastest, slow) / speed, 1), (1 - exponent) / (1 + exponent));
  }

  // Find the normal impulses p without friction. Returns whether the path ended within its budget.
  bool follow_without_friction(double tolerance, std::vector<double>& p) {
    slow = std::fmax(tolerance / 10, 2e-14) * speed;
    size_t n = 2 * static_cast<size_t>(count);
    std::vector<double> y(n, 0.0), k[7], z(n, 0.0);
    for (auto& one : k) one.resize(n);
    static const double a[7][6] = {{},
                                   {1.0 / 5},
                                   {3.0 / 40, 9.0 / 40},
                                   {44.0 / 45, -56.0 / 15, 32.0 / 9},
                                   {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
                                   {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
                                   {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
    static const double error[7] = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                                    -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
    Pace pace{1e-4};
    std::vector<int> active(count);
    std::iota(active.begin(), active.end(), 0);
    active = still_active(y.data(), active);
    derivative(y.data(), k[0].data(), active);
    while (work > 0) {
      if (active.empty()) {
        p.assign(y.begin() + count, y.end());
        rounding = rounding_of(p);
        return true;
      }
      const double h = pace.h;
      for (int s = 1; s < 7; ++s) {
        for (int contact : active)
          for (int i : {contact, count + contact}) {
            double sum = 0;
            for (int j = 0; j < s; ++j) sum += a[s][j] * k[j][i];
            z[i] = y[i] + h * sum;
          }
        derivative(z.data(), k[s].data(), active);
      }
      double worst = 0;
      for (int contact : active)
        for (int i : {contact, count + contact}) {
          double off = 0;
          for (int j = 0; j < 7; ++j) off += error[j] * k[j][i];
          worst = std::fmax(worst, std::fabs(h * off) / (tolerance * (i < count ? speed : mass * speed)));
        }
      double turns = 1, fastest = 0;
      for (int i : active) {
        double u = velocity(i, z.data() + count);
        turns = std::fmin(turns, turning_fraction(i, y[i], velocity(i, y.data() + count), u));
        fastest = std::fmax(fastest, residual_speed(i, z[i], u));
      }
      if (pace.accepts(worst, 5, turns, longest_step(fastest))) {
        step_errors += worst * tolerance;
        for (int i : active) z[i] = std::fmax(z[i], 0);
        y = z;  // contacts that are not active have not changed
        active = still_active(y.data(), active);
        derivative(y.data(), k[0].data(), active);
      }
    }
    return false;
  }

  // With friction a step is the method (2, 2, 2) of Ascher, Ruuth & Spiteri, of order 2. Springs are compressed by the
  // known velocities (explicit), and friction opposes the slip at the end of each of the two stages (implicit), so that
  // contacts can stick. Comparing one step with two of half its length gives its error, and extrapolates to order 3.
  static constexpr long SWEEP = 60;  // the cost of one contact in a sweep
  struct State {
    std::vector<double> x, u;  // u: normal velocities
    Motion motion;
    std::vector<Axes> P, friction;  // friction: forces in the last stage, where the next stage starts its search
  };

  // Apply the normal forces `load` for some time, with friction that opposes the slip at the end of it, to within
  // `enough`. Sweeps over the contacts start from the friction forces in `to`. Returns whether they converged within
  // the budget.
  bool apply_friction(State& to, double time, const std::vector<double>& load, double enough) {
    frictional.clear();
    for (int i = 0; i < count; ++i) {
      if (!(load[i] > 0)) {
        to.friction[i] = {0, 0, 0};
        continue;
      }
      double most = assembly.contacts[i].mu * load[i], size = length(to.friction[i][1], to.friction[i][2]);
      double fits = time * (size > most ? most / size : 1);
      to.friction[i] = {time * load[i], fits * to.friction[i][1], fits * to.friction[i][2]};
      to.motion.apply(i, to.friction[i]);
      if (most > 0) frictional.push_back(i);
    }
    double change = INFINITY;
    while (change > enough && work > 0) {
      change = 0;
      for (int i : frictional) {
        Axes by = slips[i].change(to.friction[i], assembly.contacts[i].mu * to.friction[i][0], to.motion.velocity(i, 1),
                                  to.motion.velocity(i, 2));
        to.motion.apply(i, by);
        for (int k = 1; k < 3; ++k) to.friction[i][k] += by[k];
        change = std::fmax(change, length(by[1], by[2]) * slips[i].trace);
      }
      work -= SWEEP * static_cast<long>(frictional.size() + 1);
    }
    for (int i = 0; i < count; ++i) {
      for (double& along : to.friction[i]) along /= time;
      to.u[i] = to.motion.velocity(i, 0);
    }
    work -= SWEEP * count;
    return change <= enough;
  }

  // The change of the slip of a contact by tangential impulses on it: a symmetric matrix.
  struct Slip {
    double c[3], trace;  // c: elements 11, 12, 22

    // The change from the friction impulse `now` to one of size at most `most` that opposes the slip, or nearly does.
    // v1, v2: the slip now.
    Axes change(const Axes& now, double most, double v1, double v2) const {
      double det = c[0] * c[2] - c[1] * c[1], t1 = now[1], t2 = now[2];
      if (det > 1e-6 * trace * trace) {
        double s1 = t1 - (c[2] * v1 - c[1] * v2) / det, s2 = t2 - (c[0] * v2 - c[1] * v1) / det;
        if (s1 * s1 + s2 * s2 <= most * most) return {0, s1 - t1, s2 - t2};
      }
      for (int turn = 0; turn < 4; ++turn) {
        double d1 = t1 - now[1], d2 = t2 - now[2];
        double s1 = t1 - (v1 + c[0] * d1 + c[1] * d2) / trace, s2 = t2 - (v2 + c[1] * d1 + c[2] * d2) / trace;
        double size = length(s1, s2), fits = size > most ? most / size : 1;
        t1 = s1 * fits;
        t2 = s2 * fits;
      }
      return {0, t1 - now[1], t2 - now[2]};
    }
  };

  bool step(const State& from, double h, double enough, State& to) {
    static const double g = 1 - std::sqrt(0.5), d = 1 - 0.5 / g;
    to = from;
    for (int i = 0; i < count; ++i) {
      first[i] = rate(i, from.x[i], from.u[i]);
      to.x[i] = std::fmax(from.x[i] + h * g * first[i], 0);
      load[i] = force(i, to.x[i]);
    }
    if (!apply_friction(to, h * g, load, enough)) return false;
    for (size_t k = 0; k < to.motion.y.size(); ++k)
      to.motion.y[k] = from.motion.y[k] + (to.motion.y[k] - from.motion.y[k]) * (1 - g) / g;
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < 3; ++k) to.P[i][k] += h * (1 - g) * to.friction[i][k];
      double second = rate(i, to.x[i], to.u[i]);
      to.x[i] = std::fmax(from.x[i] + h * (d * first[i] + (1 - d) * second), 0);
      load[i] = force(i, to.x[i]);
    }
    if (!apply_friction(to, h * g, load, enough)) return false;
    for (int i = 0; i < count; ++i)
      for (int k = 0; k < 3; ++k) to.P[i][k] += h * g * to.friction[i][k];
    return true;
  }

  // The energy that friction takes between two states, by the mean of their slips.
  double work_of_friction(const State& from, const State& to) const {
    double sum = 0;
    for (int i = 0; i < count; ++i)
      for (int axis = 1; axis < 3; ++axis)
        if (double by = to.P[i][axis] - from.P[i][axis]; by != 0)
          sum -= by * (from.motion.velocity(i, axis) + to.motion.velocity(i, axis)) / 2;
    return sum;
  }

  // Whether contacts at rest stay compressed for ever, because friction balances the forces of their springs. To find
  // out, the forces act a million times as long as it takes them to separate the contacts: they must set nothing in
  // motion.
  bool is_held(const State& now) {
    double greatest = 0;
    for (int i = 0; i < count; ++i) {
      load[i] = force(i, now.x[i]);
      greatest = std::fmax(greatest, load[i]);
      if (load[i] > 0 && now.motion.speed(i) > slow) return false;
    }
    if (!(greatest > 0)) return false;
    State later = now;
    const long left = work;
    work = std::min(left, 1000 * SWEEP * count);  // if friction does not hold, sweeps take longer or never converge
    const long budget = work;
    const double size = separating_size(), slowest = mass * size * size;
    const bool found = apply_friction(later, 1e6 * slowest * speed / greatest, load, 1e-3 * speed);
    work += left - budget;
    for (int i = 0; found && i < count; ++i)
      if (load[i] > 0 && later.motion.speed(i) > speed) return false;
    return found;
  }

  // Extrapolated impulses may pull, or leave the friction cones if contacts can share their friction in several ways.
  // Then replace them by impulses in the cones that have the same effect, to within `enough`. Returns whether these
  // were found within the budget.
  bool return_to_cones(State& now, double enough) {
    bool are_in_cones = true;
    Assembly at_rest = assembly;
    for (int i = 0; i < count; ++i) {
      load[i] = std::fmax(now.P[i][0], 0);
      for (auto& axis : at_rest.contacts[i].axes) axis.velocity = 0;
      const double most = assembly.contacts[i].mu * load[i] * (1 + 0x1p-30);
      are_in_cones = are_in_cones && now.P[i][0] >= 0 && std::hypot(now.P[i][1], now.P[i][2]) <= most;
    }
    if (are_in_cones) return true;
    now.motion = Motion(at_rest);  // the difference between the effects of the new impulses and of the old ones
    for (int i = 0; i < count; ++i) now.motion.apply(i, {-now.P[i][0], -now.P[i][1], -now.P[i][2]});
    now.friction = now.P;
    const bool found = apply_friction(now, 1, load, enough);
    now.P = now.friction;
    return found;
  }

  // Find the impulses P with friction. Returns whether the path ended within its budget and was not wedged.
  bool follow_with_friction(double tolerance, std::vector<Axes>& P) {
    slow = std::fmax(tolerance / 10, 2e-14) * speed;
    const std::vector<Axes> none(count, Axes{0, 0, 0});
    const std::vector<double> zero(count, 0.0);
    first = load = zero;
    slips.resize(count);
    State now{zero, zero, Motion(assembly), none, none};
    for (int i = 0; i < count; ++i) {
      Slip& slip = slips[i];
      slip = {{coupling(assembly, i, 1, i, 1), coupling(assembly, i, 1, i, 2), coupling(assembly, i, 2, i, 2)}, 0};
      slip.trace = slip.c[0] + slip.c[2];
      now.u[i] = now.motion.velocity(i, 0);
    }
    State whole = now, half = now, both = now;
    Pace pace{1e-3};
    double enough = 0.1 * tolerance * speed;
    for (;;) {
      bool done = true;
      for (int i = 0; i < count; ++i) done = done && is_over(i, now.x[i], now.u[i]);
      if (done) {
        if (!return_to_cones(now, enough)) return false;
        P = now.P;
        friction_loss = impulse(friction_loss) * unit;
        return true;
      }
      const double h = pace.h;
      if (!step(now, h, enough, whole) || !step(now, h / 2, enough, half) || !step(half, h / 2, enough, both))
        return false;
      double off = 0, square = 0, turns = 1, fastest = 0;
      for (size_t k = 0; k < both.motion.y.size(); ++k) {
        double by = both.motion.y[k] - whole.motion.y[k];
        square += by * by;
      }
      for (int i = 0; i < count; ++i) {
        // Also compare with the trapezoidal rule, which notices a spring that turns after the last stage.
        double rates = rate(i, now.x[i], now.u[i]) + 2 * rate(i, half.x[i], half.u[i]) + rate(i, both.x[i], both.u[i]);
        double by_ends = std::fmax(now.x[i] + h / 4 * rates, 0);
        off = std::fmax(off, std::fmax(std::fabs(both.x[i] - whole.x[i]), std::fabs(both.x[i] - by_ends)));
        off = std::fmax(off, std::fabs(both.u[i] - whole.u[i]));  // the norm gives little weight to light bodies
        turns = std::fmin(turns, turning_fraction(i, now.x[i], now.u[i], both.u[i]));
        fastest = std::fmax(fastest, residual_speed(i, both.x[i], both.u[i]));
      }
      double worst = std::fmax(off, std::sqrt(square / mass)) / (3 * tolerance * speed);
      if (!(worst < INFINITY)) return false;
      if (!pace.accepts(worst, 3, turns, longest_step(fastest))) continue;
      step_errors += worst * tolerance;
      auto extrapolated = [](double fine, double coarse) { return fine + (fine - coarse) / 3; };
      friction_loss +=
          extrapolated(work_of_friction(now, half) + work_of_friction(half, both), work_of_friction(now, whole));
      for (size_t k = 0; k < both.motion.y.size(); ++k)
        now.motion.y[k] = extrapolated(both.motion.y[k], whole.motion.y[k]);
      for (int i = 0; i < count; ++i) {
        now.x[i] = std::fmax(extrapolated(both.x[i], whole.x[i]), 0);
        now.u[i] = now.motion.velocity(i, 0);
        for (int k = 0; k < 3; ++k) now.P[i][k] = extrapolated(both.P[i][k], whole.P[i][k]);
      }
      now.friction = both.friction;
      is_wedged = is_held(now);
      if (is_wedged) return false;
    }
  }

 private:
  std::vector<double> first, load;
  std::vector<Slip> slips;
  std::vector<int> frictional;
};
