// A convex programme: among impulses in cones of friction, K_i = { |P_t| <= mu_i P_n }, those that do the least work on
// relative velocities,
//
//     |y|^2 / 2 + w.P -> min         y = B^T P: their effect on the bodies, in the metric of kinetic energy
//
// if asked, with given normal velocities N y = c. Multipliers lambda keep these, by rounds of the proximal method: each
// adds  sigma |N y - c - lambda_0 / sigma|^2 / 2  to the work, for the lambda_0 of the round before. ROUNDS of them give
// N y = c to all digits, except where contacts depend on each other so nearly that 1e-3 of their normals or lever arms
// decides: there, nothing is kept. So it does not matter which of these contacts would be kept exactly. What lies between
// is kept by a fixed number of rounds, PARTIAL_ROUNDS, in any digits. Where a body is much heavier than one that it
// touches, keeping its velocities takes a greater sigma, and double-double.
//
// The dual has no constraints, and a single velocity eta for all bodies, however many contacts there are. P and (eta,
// lambda) solve the programme of a round and its dual where
//
//     P_i = proj_K_i(P_i - rho_i (w + B eta)_i)   eta + N^T lambda = B^T P   lambda = lambda_0 - sigma (N B^T P - c)
//
// This is solved by steps of the augmented Lagrangian method. With Q for the P on the right, each step minimises over
// eta and lambda
//
//     |eta + N^T lambda|^2 / 2 - c.lambda + sum |P_i|^2 / (2 rho_i) + |lambda - lambda_0|^2 / (2 sigma)
//
// by Newton's method, as its gradient is piecewise smooth. A step from Q = 0 gives nearly the P of least sum of squares
// among all with the same effect. Further steps, from the greatest rho down, reduce the error. Each ends with a Newton
// step that changes P instead of computing it anew, because rho times a rounding is not small.
//
// Rockafellar, "Augmented Lagrangians and Applications of the Proximal Point Algorithm in Convex Programming",
// Math. Oper. Res. 1 (1976); Li, Sun & Toh, "A Highly Efficient Semismooth Newton Augmented Lagrangian Method",
// SIAM J. Optim. 28 (2018).
//
// R is double or double-double. The bound is the square root of a gap that contains the rounding of the slip w. If the
// slip is 1e9 times faster than the approach, as for a box that slides and hardly comes down, the bound of doubles is
// 1e-3.
#pragma once
#include "cone.hpp"
#include "newton_equations.hpp"

template <class R>
class Cones {
 public:
  using Axes = std::array<R, 3>;
  using Vector = std::vector<R>;
  // rho times the rounding of R is what P may lose in a step, before polish().
  static constexpr double FIRST_RHO = 1e6, LEAST_RHO = 1e2, GREATEST_RHO = is_scalar<R> ? 1e10 : 1e24;
  // Up to which doubles solve Newton's equations.
  static constexpr double GREATEST_RHO_IN_DOUBLES = 1e14, GREATEST_SIGMA_IN_DOUBLES = 1e8;
  static constexpr double KEEPING_RHO = is_scalar<R> ? 1e8 : 1e16;  // the greatest where velocities matter most
  static constexpr double SIGMA = 1e6;  // of contacts that fully take part
  static constexpr double FIRM_SIGMA = is_scalar<R> ? SIGMA : 1e20;  // beside heavy bodies
  static constexpr int ROUNDS = 6;  // at most
  static constexpr int PARTIAL_ROUNDS = 3;  // for contacts that take less than their full part
  static constexpr double KEPT = 1e-12;  // relative error of N y: no further rounds are needed
  static constexpr double GREATEST_FACTOR = 100, LEAST_FACTOR = 1.2;  // by which rho is raised at once
  static constexpr int MAX_STEPS = 60;
  // Newton steps for a greater rho. If they are too few, they are lost; double-double has a budget for all.
  static constexpr int MOST_TURNS = is_scalar<R> ? 200 : 60;
  static constexpr int TRIES = 3;  // of Newton steps that do not reduce the gradient, near the minimum
  static constexpr double SHORTEST = 1e-3;  // part of a Newton step
  // Newton steps of that length: hardly any converge after more, and only double-double takes so long.
  static constexpr int MOST_STALLS = is_scalar<R> ? 100 : 5;
  // Multiplications after which no steps begin that may be many. Only double-double takes so long.
  static constexpr double BUDGET = is_scalar<R> ? INFINITY : 1e8;

  std::vector<Cone<R>> cones;
  Vector kept_velocities;  // c, for each cone; or empty
  double enough = 5e-7;  // error of y: no further rounds are needed, nor steps at a tenth of it
  std::vector<Axes> P;
  // |y| by impulses without friction, of which the greatest is 1. Sigma grows with the slip relative to this: loads of
  // nearly dependent contacts may be known to few digits, their effect is known to all.
  double effect_of_loads = 1;
  // A bound on lambda where all contacts stick; empty where no body is heavy. With it, sigma is FIRM_SIGMA, and the error
  // is that from the minimum with N y = c.
  std::vector<double> sticking;

  explicit Cones(int body_count) : body_count(body_count) {}

  // After the last cone.
  void prepare() {
    const ContactGraph graph = contact_graph();
    P.resize(cones.size());
    z.resize(cones.size());
    for (Vector* one : {&x, &gradient, &step}) one->resize(graph.size());
    slopes.resize(cones.size());
    multipliers.resize(kept_velocities.size());
    for (const Cone<R>& cone : cones) {
      const double slip = std::hypot(high(cone.w[1]), high(cone.w[2]));
      fastest_slip = std::fmax(fastest_slip, std::fmax(std::fabs(high(cone.w[0])), slip));
    }
    for (const Cone<R>& cone : cones) stiffest = std::fmax(stiffest, stiffness(cone));
    equations.lay_out(cones, graph);
    if (!is_scalar<R>) rounded_equations.lay_out(cones, graph);
  }

  // For cones without friction: set w so that the minimum without constraints is y = aim.
  void aim_at(const Vector& aim) {
    for (Cone<R>& cone : cones) {
      const Axes v = cone.velocity(aim.data());
      cone.w = {-v[0], R{}, R{}};
    }
  }

  // Find P from the solution in fewer digits; from nothing, if that diverged. Returns a bound on the error of y.
  template <class S>
  double solve_from(const Cones<S>& coarse) {
    const double without = motion_error();
    for (size_t i = 0; i < x.size(); ++i) x[i] = lifted<R>(coarse.x[i]);
    for (size_t i = 0; i < P.size(); ++i)
      for (int k = 0; k < 3; ++k) P[i][k] = lifted<R>(coarse.P[i][k]);
    if (!(motion_error() <= without)) {
      restore({std::vector<Axes>(P.size()), z, Vector(x.size())});
      solve_from_zero();
    }
    return go_on();
  }
  // One step from Q = 0, with rho = size. If Newton's method does not converge from the start, raise rho step by step, by
  // factors with which it does.
  void solve_from_zero(double size = FIRST_RHO) {
    const std::vector<Axes> none(P.size());
    if (lagrangian_step(size, none, true, 12)) return;
    double reached = 1, factor = GREATEST_FACTOR;
    lagrangian_step(reached, none, true, 60);
    for (int turn = 0; turn < MAX_STEPS && reached < size && factor > LEAST_FACTOR && multiplications() < BUDGET;
         ++turn) {
      const State before = state();
      const double next = std::fmin(factor * reached, size);
      if (lagrangian_step(next, none, false, MOST_TURNS)) {
        reached = next;
        factor = std::fmin(factor * factor, GREATEST_FACTOR);
      } else {
        restore(before);
        factor = std::sqrt(factor);
      }
    }
  }

  // Rounds from the P at hand. Returns a bound on the error of y.
  double go_on() {
    const bool are_partial =
        std::any_of(cones.begin(), cones.end(), [](const Cone<R>& one) { return one.is_partial(); });
    if (const double error = are_partial ? INFINITY : keep_velocities(); error <= enough) return error;
    Bounds bounds = finish_round();
    double error = bounds.of_round;
    auto goes_on = [&](int round) {
      if (bounds.of_kept <= enough) return false;
      return (are_partial && round < PARTIAL_ROUNDS) || (!bounds.are_kept && multiplications() < BUDGET);
    };
    int round = 1;
    for (; round < ROUNDS && goes_on(round); ++round) {
      for (size_t i = 0; i < multipliers.size(); ++i)
        if (!cones[i].is_partial() || round < PARTIAL_ROUNDS) multipliers[i] = x[6 * body_count + i];
      lagrangian_step(FIRST_RHO, P, false, 60);
      bounds = finish_round();
      error += std::sqrt(2) * bounds.of_round;  // lambda_0 has the error of the round before
    }
    // Further rounds would change y: only the minimum with N y = c, which they approach, bounds how much.
    const bool is_last = round == ROUNDS || (bounds.are_kept && (!are_partial || round >= PARTIAL_ROUNDS));
    return is_firm() || !is_last ? bounds.of_kept : std::fmin(error, bounds.of_kept);
  }

  // The impulse that pulls a contact so that it does not separate faster than its velocity is kept, or 0.
  double pull(size_t i) const { return std::fmax(-high(x[6 * body_count + i]), 0); }

  // y = B^T P
  Vector motion() const {
    Vector y(6 * static_cast<size_t>(body_count));
    for (size_t i = 0; i < cones.size(); ++i) cones[i].add_effect(P[i], y);
    return y;
  }

  // A bound on the distance of y from that of the minimum of this round, without rounding.
  double motion_error() const { return motion_bounds(0).of_round; }
  double multiplications() const { return work + equations.multiplications() + rounded_equations.multiplications(); }

 private:
  template <class>
  friend class Cones;
  using Slope = typename Cone<R>::Slope;
  static constexpr double ROUNDING = Traits<R>::roundoff * 8;

  int body_count;
  double fastest_slip = 0;  // the greatest w along a normal, or across it
  double stiffest = 0;  // the greatest sigma
  Vector x;  // eta, lambda
  std::vector<Axes> z;  // w + B eta
  Vector multipliers;  // lambda_0
  double rho = 1;  // of the current step
  std::vector<Axes> from;  // Q
  Vector gradient, step, effect;  // of x
  std::vector<Slope> slopes;  // of the projections on the cones
  NewtonEquations<R> equations;
  NewtonEquations<double> rounded_equations;  // of double-double
  double work = 0;  // multiplications, but those of the equations

  struct State {
    std::vector<Axes> P, z;
    Vector x;
  };
  State state() const { return {P, z, x}; }
  void restore(const State& before) {
    P = before.P;
    z = before.z;
    x = before.x;
  }

  // On the error of y: the distance from the minimum of a round, and from that with N y = c.
  struct Bounds {
    double of_round, of_kept;
    bool are_kept;  // whether the velocities are, to all digits
  };

  // One augmented Lagrangian step with rho = size, from impulses Q. `from_start` begins as if all contacts held.
  // Whether Newton's method converged.
  bool lagrangian_step(double size, std::vector<Axes> Q, bool from_start, int budget) {
    rho = size;
    from = std::move(Q);
    Vector trial, best;
    if (from_start) {
      trial = x;
      evaluate(x, true);
      newton();
      increase(x, 1, step);
    }
    R value = evaluate(x, false);
    if (from_start && norm(gradient) == INFINITY) {
      x = trial;
      value = evaluate(x, false);
    }
    double off = norm(gradient),
           small = (1e-14 + 2e-16 * rho) * (is_scalar<R> ? 1 : 0x1p-44 * std::fmax(1, fastest_slip));
    double least = INFINITY;
    int tries = 0, stalls = 0;
    for (int turn = 0; turn < budget && off > small; ++turn) {
      newton();
      const R slope = dot(gradient, step);
      const double old = off;
      const bool is_near = off < 1e4 * small;  // rounding may hide what the value gains
      if (off < least) {
        least = off;
        best = x;
      }
      R now{};
      double length = 1;
      for (;; length /= 2) {
        trial = x;
        increase(trial, length, step);
        now = evaluate(trial, false);
        off = norm(gradient);
        if (off <= old / 2 || less_equal(now, value + 1e-4 * length * slope) || is_near || length < SHORTEST) break;
      }
      if (length < SHORTEST) ++stalls;
      if (off == INFINITY || stalls > MOST_STALLS) {
        evaluate(x, false);
        return false;
      }
      if (is_near && off >= old && ++tries == TRIES) {
        x = best;
        evaluate(x, false);
        return true;
      }
      x = trial;
      value = now;
    }
    return off <= 1e6 * small;
  }

  // A last Newton step, which changes P instead of computing it anew, with the rounding of rho (w + B eta).
  void polish() {
    evaluate(x, false);
    newton();
    increase(x, 1, step);
    for (size_t i = 0; i < cones.size(); ++i) {
      Axes by = cones[i].velocity(step.data());
      for (int a = 0; a < 3; ++a) z[i][a] += by[a];
      for (int a = 0; a < 3; ++a)
        for (int k = 0; k < 3; ++k) P[i][a] -= own_step(cones[i]) * slopes[i][a][k] * by[k];
      Slope unused;
      cones[i].project(P[i], unused);
    }
  }

  // Steps that are rounds of their own: mostly, two keep the velocities to all digits. Further ones follow only if ROUNDS
  // would keep them, too. Returns a bound on the error of y; if it is more than enough, nothing has changed.
  double keep_velocities() {
    if (kept_velocities.empty()) return INFINITY;
    const State before = state();
    double error = INFINITY, last = INFINITY, size = 100 * FIRST_RHO;
    bool converges = true;
    auto gains = [&] { return error < last / (converges ? 10 : 2) && multiplications() < BUDGET; };
    for (int round = 0; round < 2 || (error > enough && gains()); ++round) {
      multipliers.assign(x.begin() + 6 * body_count, x.end());
      converges = lagrangian_step(size, P, false, 10);
      if (converges) size = std::fmin(100 * size, KEEPING_RHO);
      if (round == 0 && converges) continue;
      polish();
      last = error;
      error = motion_bounds(ROUNDING).of_kept;  // may suffice although the step has not converged
    }
    if (!(error <= enough)) {
      restore(before);
      multipliers.assign(kept_velocities.size(), R{});
    }
    return error;
  }

  Bounds finish_round() {
    if constexpr (is_scalar<R>) refine();
    else take_adaptive_steps();
    return motion_bounds(ROUNDING);
  }

  // Further steps, with the greatest rho for which Newton's method converges. Many are needed if several ways to share
  // a load do nearly the same work.
  void take_adaptive_steps() {
    State best = state();
    double least = motion_error(), size = FIRST_RHO;
    for (int turn = 0; turn < MAX_STEPS && least > enough / 10 && multiplications() < BUDGET; ++turn) {
      const State before = state();
      if (!lagrangian_step(size, P, false, 30)) {
        restore(before);
        if (least <= enough / 4) break;  // a step that fails takes as long as twenty others
        size /= 10;
        continue;
      }
      size = std::fmin(30 * size, GREATEST_RHO);
      polish();
      if (const double now = motion_error(); now < least) {
        least = now;
        best = state();
      }
    }
    restore(best);
  }

  // Further steps from the current P, until they reduce the error no more. They do not keep the sum of squares least.
  void refine() {
    double least = motion_error();
    for (double size = GREATEST_RHO; size >= LEAST_RHO; size /= 100)
      for (bool gains = true; gains && least > enough / 10;) {
        const State before = state();
        lagrangian_step(size, P, false, 60);
        polish();
        double now = motion_error();
        gains = now < least / 3;
        if (now < least) least = now;
        else restore(before);
      }
  }

  // Bounds on the distance of y from y* of the minimum, for the current P. Let v be the velocities of the cones,
  // `outside` their distance from velocities against which no impulse in the cone gains work, and r the error of
  // N y - c + (lambda - lambda_0) / sigma = 0. For the minimum of a round, and for that with N y* = c,
  //
  //     |y - y*|^2 + sigma |N (y - y*)|^2 / 2 <= (P - P*).(v - v*) + sigma |r|^2 / 2
  //     |y - y*|^2 = (P - P*).(v - v*) + (lambda - lambda*).(N y - c)
  //     (P - P*).(v - v*) <= P.v + P*.outside
  //
  // P* and lambda* are assumed to be no greater than the greatest P and lambda found; or lambda*, than mu times the slip
  // before, unless the load is too great for the contact to slide on. Beside heavy bodies, lambda* may also be as great
  // as where all contacts stick.
  Bounds motion_bounds(double rounding) const {
    const Vector y = motion();
    Vector dual = y;
    const R* lambda = x.data() + 6 * body_count;
    double greatest = 1, gap = 0, of_round = 0, of_kept = 0, of_sticking = 0, longest = 0;
    bool are_kept = true;
    for (size_t i = 0; i < kept_velocities.size(); ++i) {
      const Cone<R>& cone = cones[i];
      cone.add_effect(Axes{-lambda[i], R{}, R{}}, dual);
      const R off = cone.velocity(y.data())[0] - kept_velocities[i];
      const double size = std::fabs(high(kept_velocities[i])), lost = rounding * (size + size_near(cone, y));
      const double r = std::fabs(high(off + (lambda[i] - multipliers[i]) / stiffness(cone))) + lost;
      of_round += stiffness(cone) * r * r / 2;
      of_kept += std::fabs(high(off)) + lost;
      if (is_firm()) of_sticking += sticking[i] * (std::fabs(high(off)) + lost);
      const double slip = std::hypot(high(cone.w[1]), high(cone.w[2]));
      longest = std::fmax(longest, std::fmax(std::fabs(high(lambda[i])), slip * std::fmin(cone.mu, slip / cone.load)));
      are_kept = are_kept && (cone.is_partial() || std::fabs(high(off)) <= KEPT * size + lost);
    }
    for (const Axes& one : P) greatest = std::fmax(greatest, std::hypot(high(one[0]), high(one[1]), high(one[2])));
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone<R>& cone = cones[i];
      Axes v = cone.velocity(dual.data());
      for (int k = 0; k < 3; ++k) v[k] += cone.w[k] + cone.give() * P[i][k];
      const R slip = cone.mu > 0 ? length_of(v[1], v[2]) : R{};
      const double outside = std::fmax(high(cone.mu * slip - v[0]), 0);
      gap += std::fabs(high(v[0] * P[i][0] + v[1] * P[i][1] + v[2] * P[i][2]));
      gap += greatest * std::fmin(outside, high(slip) + std::fmax(-high(v[0]), 0));
    }
    return {std::sqrt(gap + of_round), std::sqrt(gap + 2 * longest * of_kept + of_sticking), are_kept};
  }

  bool is_firm() const { return !sticking.empty(); }
  // sigma of a contact. One of great friction that slides because its load is light presses the harder to move apart.
  double stiffness(const Cone<R>& cone) const {
    const double light = std::fmax(std::fmin(cone.mu, 1 / cone.load) / 10, 1);
    const double sigma = is_firm() ? FIRM_SIGMA : SIGMA;
    return cone.part * cone.part * cone.part * sigma * std::fmax(1, fastest_slip / effect_of_loads) * (light * light);
  }
  double own_step(const Cone<R>& cone) const { return rho * cone.share / (1 + rho * cone.share * cone.give()); }
  static double size_near(const Cone<R>& cone, const Vector& y) {
    double square = 0;
    for (int body : cone.body)
      for (int k = 0; body >= 0 && k < 6; ++k) square += high(y[6 * body + k]) * high(y[6 * body + k]);
    return std::sqrt(square);
  }
  static double norm(const Vector& g) {
    double most = 0;  // infinite if a component is not a number
    for (const R& v : g) {
      const double size = std::fabs(high(v));
      if (!(size <= most)) most = size < INFINITY ? size : INFINITY;
    }
    return most;
  }

  // Returns the value to minimise at (eta, lambda); sets its gradient, P, z and slopes. `holding`: as if all contacts
  // held.
  R evaluate(const Vector& at, bool holding) {
    const R* lambda = at.data() + 6 * body_count;
    Vector& y = effect;
    y.assign(at.begin(), at.begin() + 6 * body_count);
    for (size_t i = 0; i < kept_velocities.size(); ++i) cones[i].add_effect(Axes{lambda[i], R{}, R{}}, y);
    work += static_cast<double>(90 * cones.size());
    R value{};
    for (const R& v : y) value += v * v / 2;
    for (size_t i = 0; i < kept_velocities.size(); ++i) {
      const R by = lambda[i] - multipliers[i];
      gradient[6 * body_count + i] = cones[i].velocity(y.data())[0] - kept_velocities[i] + by / stiffness(cones[i]);
      value += by * by / (2 * stiffness(cones[i])) - kept_velocities[i] * lambda[i];
    }
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone<R>& cone = cones[i];
      const double own = rho * cone.share, less = 1 / (1 + own * cone.give());
      z[i] = cone.velocity(at.data());
      for (int k = 0; k < 3; ++k) {
        z[i][k] += cone.w[k];
        P[i][k] = less * (from[i][k] - own * z[i][k]);
      }
      if (holding) {
        slopes[i] = {};
        for (int k = 0; k < 3; ++k) slopes[i][k][k] = constant<R>(k == 0 || cone.mu > 0);
        if (!(cone.mu > 0)) P[i][1] = P[i][2] = R{};
      } else {
        cone.project(P[i], slopes[i]);
      }
      value += (P[i][0] * P[i][0] + P[i][1] * P[i][1] + P[i][2] * P[i][2]) / (2 * own * less);
      cone.add_effect(Axes{-P[i][0], -P[i][1], -P[i][2]}, y);
    }
    std::copy(y.begin(), y.end(), gradient.begin());
    return value;
  }

  ContactGraph contact_graph() const {
    ContactGraph graph{body_count, !kept_velocities.empty()};
    for (const Cone<R>& cone : cones) graph.pairs.push_back({cone.body[0], cone.body[1]});
    return graph;
  }

  // step = -M^-1 gradient. Of double-double, a step in doubles is as good: the gradient is computed in all digits.
  void newton() {
    const bool are_doubles_enough = rho <= GREATEST_RHO_IN_DOUBLES && stiffest <= GREATEST_SIGMA_IN_DOUBLES;
    if (!is_scalar<R> && are_doubles_enough) solve(rounded_equations);
    else solve(equations);
  }
  template <class T>
  void solve(NewtonEquations<T>& system) {
    system.begin();
    for (size_t i = 0; i < kept_velocities.size(); ++i) system.add_at_multiplier(i, 1 / stiffness(cones[i]));
    for (size_t i = 0; i < cones.size(); ++i) system.add_contact(cones[i], slopes[i], own_step(cones[i]));
    system.solve(gradient, step);
  }
};
