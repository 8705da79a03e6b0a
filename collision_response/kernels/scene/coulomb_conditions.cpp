// Coulomb's conditions at several contacts, for given rebounds r:
//
//     u_n+ - r >= 0    complementary to    P_n >= 0
//
// and friction opposes the slip after the impact: |P_t| <= mu P_n, and P_t = -mu P_n u_t+ / |u_t+| where there is slip.
// So a contact that friction unloads parts, and one that it presses is loaded.
//
// With  v = (u_n+ - r + mu |u_t+|, u_t+),  these say that no impulse of the friction cone does work against v, and that P
// does none. So for any rho > 0
//
//     P_i = proj_K_i(Q_i - rho_i v_i)    y = B^T P: its effect on the bodies    u+ = u + B y
//
// where Q = P. For another Q these are equations for y alone, which Newton's method solves. Q = 0 describes contacts that
// give: by P / rho. They become harder step by step. Where this leads nowhere, the shift mu |u_t+| is left out first, which
// makes it a convex programme, and added step by step. Then follow steps with Q = P.
//
// There may be several solutions, and many where friction is great or where more contacts than necessary share a load.
// Contacts that give choose one that is as symmetric as the scene.
//
// The error bound is an estimate. P obeys the conditions exactly for velocities that differ a little: see off(). The
// equations are solved again for velocities that differ by more, and for other Q, and the greatest change of y counts. If
// y changes with Q, a load can be shared in several ways that differ in their effect: then the bound is infinite. So it is
// if P creeps, or contacts lock. Of solutions that lie apart, the bound knows nothing.
//
// Sources: De Saxce & Feng, "The Bipotential Method", Math. Comput. Model. 28 (1998), for the shift by mu |u_t|; Alart &
// Curnier, "A Mixed Formulation for Frictional Contact Problems Prone to Newton like Solution Methods", Comput. Methods
// Appl. Mech. Eng. 92 (1991), for Newton's method.
#include "coulomb_conditions.hpp"

#include <optional>

#include "contact_cones.hpp"
#include "skyline.hpp"

namespace {

double length_of(const Vector& y) { return std::sqrt(dot(y, y)); }

// The conditions, in units of `speed`.
class Conditions {
 public:
  std::vector<Axes> P;
  Vector y;

  Conditions(const Assembly& assembly, const Vector& rebounds, double speed, double budget)
      : P(assembly.count), y(6 * static_cast<size_t>(assembly.body_count)), budget(budget), from(P), slopes(P.size()) {
    const double mean = mean_inverse_mass(assembly, assembly.all_contacts());
    ContactGraph graph{assembly.body_count, false};
    for (int i = 0; i < assembly.count; ++i) {
      const AssembledContact& contact = assembly.contacts[i];
      Cone<double> cone = cone_of(contact, contact.axes, speed, mean);
      cone.mu = std::fmin(cone.mu, GREATEST_MU);
      cone.w[0] -= rebounds[i] * contact.unit() / speed;
      graph.pairs.push_back({cone.body[0], cone.body[1]});
      cones.push_back(cone);
      friction.push_back(contact.mu);
    }
    matrix.lay_out(graph.order(), graph.groups());
  }

  // Solve the equations for hard contacts, then those with Q = P.
  bool solve() {
    const bool is_solved = by_harder_contacts() || by_greater_shifts();
    if (is_solved) sharpen();
    return is_solved;
  }

  // How far the velocities of a contact are, at most, from those for which P obeys the conditions exactly.
  double off() const {
    double most = 0;
    for (size_t i = 0; i < cones.size(); ++i) most = std::fmax(most, off_at(i));
    return most;
  }

  // The same equations for velocities that differ by about `size`, and for a Q that differs from P by about this `part`,
  // by amounts that do not depend on the order of contacts.
  bool solve_nearby(double size, double part, double phase) {
    budget = multiplications() + budget / 20;
    for (size_t i = 0; i < cones.size(); ++i) {
      Cone<double>& cone = cones[i];
      for (int k = 0; k < (cone.mu > 0 ? 3 : 1); ++k) cone.w[k] += size * uneven(cone, k, phase);
      from[i] = P[i];
      for (double& one : from[i]) one *= 1 + part * uneven(cone, 0, phase);
    }
    if (!proximal_step(HARD) && !by_harder_contacts()) return false;
    sharpen();
    return true;
  }

  double greatest() const {
    double most = 0;
    for (const Axes& one : P) most = std::fmax(most, one[0]);
    return most;
  }

 private:
  using Slope = Cone<double>::Slope;
  static constexpr double GREATEST_MU = 1e6;  // beyond, Newton's method would have no digits left
  static constexpr double SOFT = -1, MEDIUM = 3, FIRM = 4, HARD = 6;  // decimal logarithms of rho
  static constexpr int FIRST_STEPS = 60, NEXT_STEPS = 30;  // of Newton's method

  double budget;  // multiplications
  std::vector<Cone<double>> cones;
  Vector friction;  // mu of the contacts, not of the cones
  double shift = 1;  // part of mu |u_t+| that counts
  double log_rho = SOFT, rho = 0;
  std::vector<Axes> from;  // Q
  Vector residual;  // of y
  std::vector<Slope> slopes;  // of P by the velocities, times -1 / rho
  UnsymmetricSkyline matrix;
  double work = 0;  // multiplications, but those of the matrix

  double multiplications() const { return work + matrix.multiplications(); }
  bool has_budget() const { return multiplications() < budget; }

  // off() of one contact. It parts, or sticks, or slides, whichever is nearest; impulses that do not fit this count by their
  // effect.
  double off_at(size_t i) const {
    const Cone<double>& cone = cones[i];
    const Axes by = cone.velocity(y.data());
    double rounding = 0;
    Axes u;
    for (int k = 0; k < 3; ++k) {
      u[k] = cone.w[k] + by[k];
      if (k == 0 || cone.mu > 0) rounding += 0x1p-51 * (std::fabs(cone.w[k]) + std::fabs(by[k]));
    }
    const double t = std::hypot(P[i][1], P[i][2]), slip = std::hypot(u[1], u[2]);
    // A load that is missed lacks its friction, too.
    const double parts = std::fmax(1, friction[i]) * std::fmax(-u[0], 0) + std::hypot(P[i][0], t);
    if (!(cone.mu > 0)) return std::fmin(parts, std::fabs(u[0])) + rounding;
    double slides = std::fmax(cone.mu * P[i][0] - t, 0);
    slides += t > 0 ? std::hypot(u[1] + slip * P[i][1] / t, u[2] + slip * P[i][2] / t) : slip;
    return std::fmin(parts, std::hypot(u[0], std::fmin(slip, slides))) + rounding;
  }

  // From nothing, with the Q at hand.
  bool by_harder_contacts() {
    y.assign(y.size(), 0);
    log_rho = SOFT;
    return newton(FIRST_STEPS) && raise(log_rho, HARD, 2);
  }
  // From the convex programme, with its P for Q.
  bool by_greater_shifts() {
    shift = 0;
    if (!by_harder_contacts()) return false;
    from = P;
    log_rho = MEDIUM;
    return newton(NEXT_STEPS) && raise(shift, 1, 1);
  }

  // From -1 to 1, by where and how a contact acts.
  static double uneven(const Cone<double>& cone, int axis, double phase) {
    double sum = 0;
    for (const auto& side : cone.row)
      for (int k = 0; k < 6; ++k) sum += std::sqrt(k + 2.0) * side[axis][k];
    return std::sin(50 * sum + phase);
  }

  // P and the residual y - B^T P at some y. Returns the length of this.
  double evaluate(const Vector& at) {
    residual = at;
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone<double>& cone = cones[i];
      Axes v = cone.velocity(at.data());
      for (int k = 0; k < 3; ++k) v[k] += cone.w[k];
      const double slip = std::hypot(v[1], v[2]), by = shift * cone.mu;
      v[0] += by * slip;
      for (int k = 0; k < 3; ++k) P[i][k] = from[i][k] - rho * cone.share * v[k];
      Slope& slope = slopes[i];
      cone.project(P[i], slope);
      if (slip > 0)
        for (auto& row : slope)
          for (int k = 1; k < 3; ++k) row[k] += row[0] * by * v[k] / slip;
      cone.add_effect({-P[i][0], -P[i][1], -P[i][2]}, residual);
    }
    work += static_cast<double>(90 * cones.size());
    return length_of(residual);
  }

  // step = -M^-1 residual, M = 1 + sum rho_i B_i^T S_i B_i, with the slopes S_i. Whether M has factors.
  bool newton_step(Vector& step) {
    matrix.set_to_unit();
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone<double>& cone = cones[i];
      for (int s = 0; s < 2; ++s)
        for (int t = 0; t < 2; ++t) {
          if (cone.body[s] < 0 || cone.body[t] < 0) continue;
          for (int l = 0; l < 6; ++l) {
            Axes part{};
            for (int a = 0; a < 3; ++a)
              for (int b = 0; b < 3; ++b) part[a] += rho * cone.share * slopes[i][a][b] * cone.row[t][b][l];
            for (int k = 0; k < 6; ++k)
              for (int a = 0; a < 3; ++a)
                matrix.at(6 * cone.body[s] + k, 6 * cone.body[t] + l) += cone.row[s][a][k] * part[a];
          }
        }
    }
    step = residual;
    for (double& one : step) one = -one;
    return matrix.solve(step);
  }

  // Solve the equations from the y at hand. If that fails, y stays as it is.
  bool newton(int budget) {
    constexpr double SHORTEST = 1e-3, LESS = 1e-4;
    rho = std::pow(10, log_rho);
    const double small = 1e-13 + 1e-15 * rho;  // of the residual: it has rho times the rounding of velocities
    Vector at = y, step, next;
    double off = evaluate(at);
    for (int turn = 0; turn < budget && has_budget(); ++turn) {
      if (!newton_step(step)) return false;
      if (off < small) {
        take_last(step);
        return true;
      }
      const double before = off;
      double length = 1;
      for (;; length /= 2) {
        next = at;
        increase(next, length, step);
        off = evaluate(next);
        if (off <= (1 - LESS * length) * before || length < SHORTEST) break;
      }
      if (length < SHORTEST) {
        if (!(before < 1e3 * small)) return false;
        evaluate(at);  // rounding is all that is left
        take_last(step);
        return true;
      }
      at = std::move(next);
    }
    return false;
  }
  // The last step changes P instead of computing it anew, with the rounding of rho times the velocity.
  void take_last(const Vector& step) {
    for (size_t i = 0; i < cones.size(); ++i) {
      const Axes by = cones[i].velocity(step.data());
      for (int a = 0; a < 3; ++a)
        for (int k = 0; k < 3; ++k) P[i][a] -= rho * cones[i].share * slopes[i][a][k] * by[k];
      Slope unused;
      cones[i].project(P[i], unused);
    }
    set_motion();
  }
  void set_motion() {
    y.assign(y.size(), 0);
    for (size_t i = 0; i < cones.size(); ++i) cones[i].add_effect(P[i], y);
  }

  // Raise a value of the equations from one for which they are solved to `last`, by steps for which Newton's method
  // converges.
  bool raise(double& value, double last, double widest) {
    constexpr double NARROWEST = 1e-3;
    double step = widest;
    while (value < last && step > NARROWEST && has_budget()) {
      const double before = value;
      value = std::fmin(value + step, last);
      if (newton(NEXT_STEPS)) {
        step = std::fmin(2 * step, widest);
      } else {
        value = before;
        step /= 2;
      }
    }
    return value == last;
  }

  // A step with the greatest rho for which Newton's method converges.
  bool proximal_step(double greatest) {
    for (log_rho = greatest; log_rho >= SOFT; log_rho -= 2)
      if (newton(NEXT_STEPS)) return true;
    return false;
  }

  // Steps with Q = P, until P is exact or no longer becomes more so. They take a greater rho where they are slow, and a
  // smaller one where rho times a rounding is too much.
  void sharpen() {
    constexpr int MOST = 60, PATIENCE = 5;
    constexpr double HARDEST = 12, FAST = 0.1, SLOW = 0.9, WORSE = 2, ROUNDING = 0x1p-49;
    std::vector<Axes> best = P;
    double least = off(), last = least, hardness = FIRM, hardest = HARDEST;
    for (int turn = 0, idle = 0; turn < MOST && idle < PATIENCE && least > ROUNDING && has_budget(); ++turn) {
      from = P;
      if (!proximal_step(hardness)) break;
      const double now = off();
      idle = now < SLOW * least ? 0 : idle + 1;
      if (now > WORSE * least) {
        P = best;
        hardness = hardest = log_rho - 2;
      } else if (now > FAST * last) {
        hardness = std::fmin(log_rho + 2, hardest);
      }
      if (now < least) {
        least = now;
        best = P;
      }
      last = now;
    }
    P = std::move(best);
    set_motion();
  }
};

// An estimate of the error of y: how far it is from the y of other velocities, and of other shares of the load.
double motion_error(const Conditions& solved) {
  constexpr double GREATEST_OFF = 0x1p-44, ROUNDING = 0x1p-50;  // relative to velocities and impulses
  constexpr double FARTHER = 10;  // change of velocities, relative to off()
  constexpr double CAUTION = 4;  // the directions tried may not be those in which the error is greatest
  constexpr int TRIES = 3;
  const double greatest = solved.greatest(), unit = std::fmax(1, greatest), off = solved.off();
  if (off > GREATEST_OFF * unit) return INFINITY;  // P that creep have unknown limits
  const double farther = FARTHER * std::fmax(off, ROUNDING * unit);
  auto nearby = [&](double size, double part, double phase) -> std::optional<Conditions> {
    Conditions other = solved;
    if (!other.solve_nearby(size, part, phase)) return {};
    return other;
  };
  auto distance = [&](const Conditions& other) {
    Vector by = other.y;
    increase(by, -1, solved.y);
    return length_of(by);
  };
  double most = 0;
  bool is_known = false;
  for (int k = 0; k < TRIES; ++k)
    for (double size : {-farther, farther})
      if (const auto other = nearby(size, 0, k)) {
        most = std::fmax(most, distance(*other));
        is_known = true;
      }
  if (!is_known) return INFINITY;

  constexpr double OTHER = 0.01;  // relative change of the shares
  constexpr double SETTLED = 1e-10;  // their off(), relative to velocities and impulses
  constexpr double EXCESS = 10;  // of a change of y over what this explains
  constexpr double SEVERAL = 1e-3, APART = 10;  // changes of y: of shares that matter, and of solutions that lie apart
  for (int k = 0; k < TRIES; ++k) {
    const auto other = nearby(0, OTHER, k);
    if (!other || other->off() > SETTLED * unit) continue;
    const double change = distance(*other), by_shares = change / OTHER;
    if (change < EXCESS * other->off() / farther * most || by_shares > APART * greatest) continue;
    if (by_shares > std::fmax(SEVERAL * greatest, most)) return INFINITY;
    most = std::fmax(most, by_shares);
  }
  return CAUTION * most;
}

}  // namespace

ClusterImpulses obey_coulomb(const Assembly& assembly, const Vector& rebounds, double budget) {
  constexpr double SOLVED = 1e-6;  // greatest off(), and a hundred times this, of the greatest impulse
  std::vector<Axes> P(assembly.count);
  double speed = 0;
  bool approach = false;
  for (const AssembledContact& contact : assembly.contacts) {
    const auto& u = contact.axes;
    const bool has_friction = contact.mu > LEAST_FRICTION;  // without friction, the slip may be anything
    const double size = std::hypot(u[0].velocity, has_friction * u[1].velocity, has_friction * u[2].velocity);
    speed = std::fmax(speed, size * contact.unit());
    approach = approach || u[0].velocity < 0;
  }
  if (!approach) return with_axis_impulses({}, assembly, P);  // impulses of 0 are a solution
  Conditions conditions(assembly, rebounds, speed, budget);
  if (!conditions.solve()) return {false};
  if (!(conditions.off() <= SOLVED * std::fmin(1, 100 * conditions.greatest()))) return {false};
  const double error = speed * (assembly.is_locked ? INFINITY : motion_error(conditions));
  for (int i = 0; i < assembly.count; ++i) P[i] = in_newton_seconds(conditions.P[i], assembly.contacts[i], speed);
  return with_axis_impulses({true, {}, error}, assembly, P);
}
