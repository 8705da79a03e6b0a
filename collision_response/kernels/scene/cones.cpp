// The programme of cones.hpp is solved by steps of the augmented Lagrangian method. With Q for the P on the right, each
// step minimises over eta and lambda
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
#include "cones.hpp"

// The size of the part of y of the bodies of a contact.
template <class R>
static double size_near(const Cone<R>& cone, const List<R>& y) {
  double square = 0;
  for (int body : cone.body)
    for (int k = 0; body >= 0 && k < 6; ++k) square += high(y[6 * body + k]) * high(y[6 * body + k]);
  return std::sqrt(square);
}

// The greatest component; infinite if one is not a number.
template <class R>
static double greatest_component(const List<R>& g) {
  double most = 0;
  for (const R& v : g) {
    const double size = std::fabs(high(v));
    if (!(size <= most)) most = size < INFINITY ? size : INFINITY;
  }
  return most;
}

template <class R>
void Cones<R>::prepare() {
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
  sigma.clear();
  for (const Cone<R>& cone : cones) {
    sigma.push_back(stiffness(cone));
    stiffest = std::fmax(stiffest, sigma.back());
  }
  equations.lay_out(cones, graph);
  if (!is_scalar<R>) rounded_equations.lay_out(cones, graph);
}

template <class R>
void Cones<R>::aim_at(const Vector& aim) {
  for (Cone<R>& cone : cones) {
    const Axes v = cone.velocity(aim.data());
    cone.w = {-v[0], R{}, R{}};
  }
}

template <class R>
template <class S>
double Cones<R>::solve_from(const Cones<S>& coarse) {
  const double without = motion_error();
  for (size_t i = 0; i < x.size(); ++i) x[i] = lifted<R>(coarse.x[i]);
  for (size_t i = 0; i < P.size(); ++i)
    for (int k = 0; k < 3; ++k) P[i][k] = lifted<R>(coarse.P[i][k]);
  if (!(motion_error() <= without)) {
    restore({List<Axes>(P.size()), z, Vector(x.size())});
    solve_from_zero();
  }
  return go_on();
}

template <class R>
void Cones<R>::solve_from(double size, const List<Axes>& from) {
  if (lagrangian_step(size, from, true, FEW_TURNS)) return;
  double reached = 1, factor = GREATEST_FACTOR;
  lagrangian_step(reached, from, true, TURNS);
  for (int turn = 0; turn < MAX_STEPS && reached < size && factor > LEAST_FACTOR && multiplications() < BUDGET;
       ++turn) {
    const State before = state();
    const double next = std::fmin(factor * reached, size);
    if (lagrangian_step(next, from, false, MOST_TURNS)) {
      reached = next;
      factor = std::fmin(factor * factor, GREATEST_FACTOR);
    } else {
      restore(before);
      factor = std::sqrt(factor);
    }
  }
}

template <class R>
double Cones<R>::go_on() {
  const bool are_partial = std::any_of(cones.begin(), cones.end(), [](const Cone<R>& one) { return one.is_partial(); });
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
    lagrangian_step(FIRST_RHO, P, false, TURNS);
    bounds = finish_round();
    error += std::sqrt(2) * bounds.of_round;  // lambda_0 has the error of the round before
  }
  // Further rounds would change y: only the minimum with N y = c, which they approach, bounds how much.
  const bool is_last = round == ROUNDS || (bounds.are_kept && (!are_partial || round >= PARTIAL_ROUNDS));
  return is_firm() || !is_last ? bounds.of_kept : std::fmin(error, bounds.of_kept);
}

template <class R>
typename Cones<R>::Vector Cones<R>::motion() const {
  Vector y(6 * static_cast<size_t>(body_count));
  for (size_t i = 0; i < cones.size(); ++i) cones[i].add_effect(P[i], y);
  return y;
}

template <class R>
void Cones<R>::restore(const State& before) {
  P = before.P;
  z = before.z;
  x = before.x;
}

// One augmented Lagrangian step with rho = size, from impulses Q. `from_start` begins as if all contacts held.
// Whether Newton's method converged.
template <class R>
bool Cones<R>::lagrangian_step(double size, List<Axes> Q, bool from_start, int budget) {
  // Of the gradient: of 1, and of rho times a velocity. Double-double computes it to so many more digits.
  constexpr double ROUNDING_OF_ONE = 1e-14, ROUNDING_OF_RHO = 2e-16, MORE_DIGITS = is_scalar<R> ? 1 : 0x1p-44;
  constexpr double NEAR = 1e4, CONVERGED = 1e6;  // gradients relative to this rounding
  constexpr double LESS = 1e-4;  // part of the slope by which a step must reduce the value
  rho = size;
  from = std::move(Q);
  if (from_start) {
    trial = x;
    evaluate(x, true);
    newton();
    increase(x, 1, step);
  }
  R value = evaluate(x, false);
  if (from_start && greatest_component(gradient) == INFINITY) {
    x = trial;
    value = evaluate(x, false);
  }
  double off = greatest_component(gradient);
  double small = (ROUNDING_OF_ONE + ROUNDING_OF_RHO * rho) * MORE_DIGITS;
  if (!is_scalar<R>) small *= std::fmax(1, fastest_slip);
  double least = INFINITY;
  int tries = 0, stalls = 0;
  auto has_budget = [this] { return !is_scalar<R> || multiplications() < BUDGET; };
  for (int turn = 0; turn < budget && off > small && has_budget(); ++turn) {
    newton();
    const R slope = dot(gradient, step);
    const double old = off;
    const bool is_near = off < NEAR * small;  // rounding may hide what the value gains
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
      off = greatest_component(gradient);
      if (off <= old / 2 || less_equal(now, value + LESS * length * slope) || is_near || length < SHORTEST) break;
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
    x.swap(trial);
    value = now;
  }
  return off <= CONVERGED * small;
}

// A last Newton step, which changes P instead of computing it anew, with the rounding of rho (w + B eta).
template <class R>
void Cones<R>::polish() {
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
template <class R>
double Cones<R>::keep_velocities() {
  constexpr double HARDER = 100;  // factor of rho, from step to step
  constexpr double GAIN = 10, GAIN_OF_FEW_TURNS = 2;  // factors by which a step reduces the error, or is the last
  if (kept_velocities.empty()) return INFINITY;
  const State before = state();
  double error = INFINITY, last = INFINITY, size = HARDER * FIRST_RHO;
  bool converges = true;
  auto gains = [&] { return error < last / (converges ? GAIN : GAIN_OF_FEW_TURNS) && multiplications() < BUDGET; };
  for (int round = 0; round < 2 || (error > enough && gains()); ++round) {
    multipliers.assign(x.begin() + 6 * body_count, x.end());
    converges = lagrangian_step(size, P, false, FEW_TURNS_FROM_NEAR);
    if (converges) size = std::fmin(HARDER * size, KEEPING_RHO);
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

template <class R>
typename Cones<R>::Bounds Cones<R>::finish_round() {
  if constexpr (is_scalar<R>) refine();
  else take_adaptive_steps();
  return motion_bounds(ROUNDING);
}

// Further steps, with the greatest rho for which Newton's method converges. Many are needed if several ways to share
// a load do nearly the same work.
template <class R>
void Cones<R>::take_adaptive_steps() {
  constexpr double HARDER = 30, SOFTER = 10;  // factors of rho after a step that converged, and one that did not
  constexpr double NEARLY_ENOUGH = 0.25;  // part of an error that is enough
  State best = state();
  double least = motion_error(), size = FIRST_RHO;
  for (int turn = 0; turn < MAX_STEPS && least > SURELY_ENOUGH * enough && multiplications() < BUDGET; ++turn) {
    const State before = state();
    if (!lagrangian_step(size, P, false, TURNS / 2)) {
      restore(before);
      if (least <= NEARLY_ENOUGH * enough) break;  // a step that fails takes as long as twenty others
      size /= SOFTER;
      continue;
    }
    size = std::fmin(HARDER * size, GREATEST_RHO);
    polish();
    if (const double now = motion_error(); now < least) {
      least = now;
      best = state();
    }
  }
  restore(best);
}

// Further steps from the current P, until they reduce the error no more. They do not keep the sum of squares least.
template <class R>
void Cones<R>::refine() {
  constexpr double SOFTER = 100, GAIN = 3;  // factors: of rho, and by which a step reduces the error, or is the last
  double least = motion_error();
  for (double size = greatest_rho; size >= LEAST_RHO; size /= SOFTER)
    for (bool gains = true; gains && least > SURELY_ENOUGH * enough;) {
      const State before = state();
      if (!lagrangian_step(size, P, false, TURNS)) greatest_rho = std::fmax(size / SOFTER, LEAST_RHO);
      polish();
      double now = motion_error();
      gains = now < least / GAIN;
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
template <class R>
typename Cones<R>::Bounds Cones<R>::motion_bounds(double rounding) const {
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
    const double r = std::fabs(high(off + (lambda[i] - multipliers[i]) / sigma[i])) + lost;
    of_round += sigma[i] * r * r / 2;
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

// sigma of a contact. One of great friction that slides because its load is light presses the harder to move apart.
template <class R>
double Cones<R>::stiffness(const Cone<R>& cone) const {
  constexpr double LIGHT = 10;  // as many times less than the greatest load, and as great a coefficient
  const double light = std::fmax(std::fmin(cone.mu, 1 / cone.load) / LIGHT, 1);
  const double usual = is_firm() ? FIRM_SIGMA : SIGMA;
  return cone.part * cone.part * cone.part * usual * std::fmax(1, fastest_slip / effect_of_loads) * (light * light);
}

// Returns the value to minimise at (eta, lambda); sets its gradient, P, z and slopes. `holding`: as if all contacts
// held.
template <class R>
R Cones<R>::evaluate(const Vector& at, bool holding) {
  const R* lambda = at.data() + 6 * body_count;
  Vector& y = effect;
  y.assign(at.begin(), at.begin() + 6 * body_count);
  for (size_t i = 0; i < kept_velocities.size(); ++i) cones[i].add_effect(Axes{lambda[i], R{}, R{}}, y);
  work += static_cast<double>(Cone<R>::WORK * cones.size());
  R value{};
  for (const R& v : y) value += v * v / 2;
  for (size_t i = 0; i < kept_velocities.size(); ++i) {
    const R by = lambda[i] - multipliers[i];
    gradient[6 * body_count + i] = cones[i].velocity(y.data())[0] - kept_velocities[i] + by / sigma[i];
    value += by * by / (2 * sigma[i]) - kept_velocities[i] * lambda[i];
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

template <class R>
ContactGraph Cones<R>::contact_graph() const {
  ContactGraph graph{body_count, !kept_velocities.empty()};
  for (const Cone<R>& cone : cones) graph.pairs.push_back({cone.body[0], cone.body[1]});
  return graph;
}

// step = -M^-1 gradient. Of double-double, a step in doubles is as good: the gradient is computed in all digits.
template <class R>
void Cones<R>::newton() {
  const bool are_doubles_enough = rho <= GREATEST_RHO_IN_DOUBLES && stiffest <= GREATEST_SIGMA_IN_DOUBLES;
  if (!is_scalar<R> && are_doubles_enough) solve(rounded_equations);
  else solve(equations);
}

template <class R>
template <class T>
void Cones<R>::solve(NewtonEquations<T>& system) {
  system.begin();
  for (size_t i = 0; i < kept_velocities.size(); ++i) system.add_at_multiplier(i, 1 / sigma[i]);
  for (size_t i = 0; i < cones.size(); ++i) system.add_contact(cones[i], slopes[i], own_step(cones[i]));
  system.solve(gradient, step);
}

template class Cones<double>;
template class Cones<DD>;
template double Cones<DD>::solve_from(const Cones<double>& coarse);
