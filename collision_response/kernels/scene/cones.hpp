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
  using Vector = List<R>;
  // rho times the rounding of R is what P may lose in a step, before polish().
  static constexpr double FIRST_RHO = 1e6, LEAST_RHO = 1e2, GREATEST_RHO = is_scalar<R> ? 1e10 : 1e24;
  // Up to which doubles solve Newton's equations.
  static constexpr double GREATEST_RHO_IN_DOUBLES = 1e14, GREATEST_SIGMA_IN_DOUBLES = 1e8;
  static constexpr double KEEPING_RHO = is_scalar<R> ? 1e8 : 1e16;  // the greatest where velocities matter most
  static constexpr double SIGMA = 1e6;  // of contacts that fully take part
  static constexpr double FIRM_SIGMA = is_scalar<R> ? SIGMA : 1e20;  // beside heavy bodies
  static constexpr double SURELY_ENOUGH = 0.1;  // part of an error that is enough, at which no steps follow
  static constexpr int ROUNDS = 6;  // at most
  static constexpr int PARTIAL_ROUNDS = 3;  // for contacts that take less than their full part
  static constexpr double KEPT = 1e-12;  // relative error of N y: no further rounds are needed
  static constexpr double GREATEST_FACTOR = 100, LEAST_FACTOR = 1.2;  // by which rho is raised at once
  static constexpr int MAX_STEPS = 60;
  // Newton steps for one rho; where it is not known whether they converge; and from a solution for a similar rho.
  static constexpr int TURNS = 60, FEW_TURNS = 12, FEW_TURNS_FROM_NEAR = 10;
  // Newton steps for a greater rho. If they are too few, they are lost; double-double has a budget for all.
  static constexpr int MOST_TURNS = is_scalar<R> ? 200 : 60;
  static constexpr int TRIES = 3;  // of Newton steps that do not reduce the gradient, near the minimum
  static constexpr double SHORTEST = 1e-3;  // part of a Newton step
  // Newton steps of that length: hardly any converge after more, and only double-double takes so long.
  static constexpr int MOST_STALLS = is_scalar<R> ? 100 : 5;
  // Multiplications after which no steps begin that may be many. Doubles end a step there, too: where a body touches
  // hundreds, each Newton step takes up to a second.
  static constexpr double BUDGET = is_scalar<R> ? 5e9 : 1e8;

  List<Cone<R>> cones;
  Vector kept_velocities;  // c, for each cone; or empty
  double enough = 5e-7;  // error of y: no further rounds are needed
  List<Axes> P;
  // |y| by impulses without friction, of which the greatest is 1. Sigma grows with the slip relative to this: loads of
  // nearly dependent contacts may be known to few digits, their effect is known to all.
  double effect_of_loads = 1;
  // A bound on lambda where all contacts stick; empty where no body is heavy. With it, sigma is FIRM_SIGMA, and the error
  // is that from the minimum with N y = c.
  List<double> sticking;

  explicit Cones(int body_count) : body_count(body_count) {}

  // After the last cone.
  void prepare();

  // For cones without friction: set w so that the minimum without constraints is y = aim.
  void aim_at(const Vector& aim);

  // Find P from the solution in fewer digits; from nothing, if that diverged. Returns a bound on the error of y.
  template <class S>
  double solve_from(const Cones<S>& coarse);
  // One step from Q = 0, with rho = size. If Newton's method does not converge from the start, raise rho step by step, by
  // factors with which it does.
  void solve_from_zero(double size = FIRST_RHO) { solve_from(size, List<Axes>(P.size())); }
  // The same from another Q.
  void solve_from(double size, const List<Axes>& from);

  // Rounds from the P at hand. Returns a bound on the error of y.
  double go_on();

  // The impulse that keeps the velocity of a contact: it pulls if it is less than 0.
  double keeping(size_t i) const { return high(x[6 * body_count + i]); }

  // y = B^T P
  Vector motion() const;

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
  List<double> sigma;  // of each cone
  double stiffest = 0;  // the greatest sigma
  Vector x;  // eta, lambda
  List<Axes> z;  // w + B eta
  Vector multipliers;  // lambda_0
  double rho = 1;  // of the current step
  double greatest_rho = GREATEST_RHO;  // of refine(): less where Newton's method did not converge for it
  List<Axes> from;  // Q
  Vector gradient, step, effect;  // of x
  Vector trial, best;  // x that lagrangian_step() tries
  List<Slope> slopes;  // of the projections on the cones
  NewtonEquations<R> equations;
  NewtonEquations<double> rounded_equations;  // of double-double
  double work = 0;  // multiplications, but those of the equations

  struct State {
    List<Axes> P, z;
    Vector x;
  };
  State state() const { return {P, z, x}; }
  void restore(const State& before);

  // On the error of y: the distance from the minimum of a round, and from that with N y = c.
  struct Bounds {
    double of_round, of_kept;
    bool are_kept;  // whether the velocities are, to all digits
  };

  bool lagrangian_step(double size, List<Axes> Q, bool from_start, int budget);
  void polish();
  double keep_velocities();
  Bounds finish_round();
  void take_adaptive_steps();
  void refine();
  Bounds motion_bounds(double rounding) const;

  bool is_firm() const { return !sticking.empty(); }
  double stiffness(const Cone<R>& cone) const;
  double own_step(const Cone<R>& cone) const { return rho * cone.share / (1 + rho * cone.share * cone.give()); }

  R evaluate(const Vector& at, bool holding);
  ContactGraph contact_graph() const;
  void newton();
  template <class T>
  void solve(NewtonEquations<T>& system);
};
