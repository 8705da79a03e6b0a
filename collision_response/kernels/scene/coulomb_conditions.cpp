// Coulomb's conditions at several contacts, for given rebounds r:
//
//     u_n+ - r >= 0    complementary to    P_n >= 0
//
// and friction opposes the slip after the impact: |P_t| <= mu P_n, and P_t = -mu P_n u_t+ / |u_t+| where there is slip.
// So a contact that friction unloads parts, and one that it presses is loaded.
//
// The same in equations, with Q = P and any rho > 0:
//
//     P_n = max(0, Q_n - rho (u_n+ - r))    P_t = Q_t - rho u_t+, cut off at mu P_n
//     y = B^T P: its effect on the bodies    u+ = u + B y
//
// For another Q, these are equations for y alone, which Newton's method solves. Q = 0 describes contacts that give: by
// P / rho. They become harder step by step, as far as that leads. Then follow steps, each with the P of the last for Q.
//
// There may be several solutions, and many where friction is great or where more contacts than necessary share a load.
// Contacts that give choose one that is as symmetric as the scene.
//
// Where the normals of a face are slightly off, the least of these differences may decide which solution is found. So the
// equations are solved for contacts with the axes of their face first. The own axes then only make this more exact.
//
// The error bound is an estimate. P obeys the conditions exactly for velocities that differ a little: see off(). The
// equations are solved again for velocities that differ by more, and for other Q, and the greatest change of y counts. If
// y changes with Q, a load can be shared in several ways that differ in their effect: then the bound is infinite. So it is
// if P creeps, or contacts lock. Of solutions that lie apart, the bound knows nothing. Contacts that act along one line, but
// for their friction, are told apart in tries of their own.
//
// Source: Alart & Curnier, "A Mixed Formulation for Frictional Contact Problems Prone to Newton like Solution Methods",
// Comput. Methods Appl. Mech. Eng. 92 (1991).
#include "coulomb_conditions.hpp"

#include <algorithm>
#include <optional>

#include "contact_cones.hpp"
#include "skyline.hpp"

namespace {

// The conditions, in units of `speed`.
class Conditions {
 public:
  List<Axes> P;
  Vector y;

  Conditions(const Assembly& assembly, const List<ConditionAxes>& given, const List<Axes>& rebounds, double speed,
             double budget)
      : P(assembly.count), y(6 * static_cast<size_t>(assembly.body_count)), budget(budget), from(P), slopes(P.size()) {
    const double mean = mean_inverse_mass(assembly, assembly.all_contacts());
    ContactGraph graph{assembly.body_count, false};
    for (int i = 0; i < assembly.count; ++i) {
      const AssembledContact& contact = assembly.contacts[i];
      Cone<double> cone = cone_of(contact, given[i].axes, speed, mean);
      for (int k = 0; k < (cone.mu > 0 ? 3 : 1); ++k)
        cone.w[k] -= dot(given[i].in_own[k], rebounds[i]) * contact.unit() / speed;
      graph.pairs.push_back({cone.body[0], cone.body[1]});
      cones.push_back(cone);
    }
    matrix.lay_out(graph.order(), graph.groups());
  }

  // For soft contacts, then for harder ones, then with Q = P. Whether there is a solution for soft ones.
  bool solve() {
    log_rho = SOFT;
    if (!newton(FIRST_STEPS)) return false;
    raise_to(HARD);
    sharpen(PATIENCE);
    return true;
  }

  // From impulses that nearly solve the equations. Whether they lead to a solution.
  bool solve_from(List<Axes> nearly) {
    P = std::move(nearly);
    set_motion();
    from = P;
    if (!proximal_step(FIRM)) return false;
    sharpen(PATIENCE);
    return true;
  }

  // How far the velocities of a contact are, at most, from those for which P obeys the conditions exactly.
  double off() const {
    double most = 0;
    for (size_t i = 0; i < cones.size(); ++i) most = std::fmax(most, off_at(i));
    return most;
  }

  // How equations differ: velocities by about `size`, and Q from P by about this `part`, also where P is 0. The amounts
  // depend on how the normal impulse of a contact acts, or all contacts are `told_apart`.
  struct Change {
    double size, part, phase;
    bool told_apart;
  };

  // The same equations, changed, by amounts that do not depend on the order of contacts.
  bool solve_nearby(const Change& by) {
    budget = multiplications() + budget / 4;
    const double greatest_load = greatest();
    List<double> angle(cones.size());
    if (by.told_apart) angle = angles();
    auto amount = [&](size_t i, int k) {
      return by.told_apart ? std::sin(angle[i] + k + by.phase) : uneven(cones[i], k, by.phase);
    };
    for (size_t i = 0; i < cones.size(); ++i) {
      Cone<double>& cone = cones[i];
      for (int k = 0; k < (cone.mu > 0 ? 3 : 1); ++k) cone.w[k] += by.size * amount(i, k);
      from[i] = P[i];
      for (double& one : from[i]) one *= 1 + by.part * amount(i, 0);
      if (!(P[i][0] > 0)) from[i][0] = by.part * greatest_load * std::fabs(amount(i, 0));
    }
    // Velocities that differ change P by rho times as much.
    const double unit = std::fmax(1, greatest_load);
    if (!proximal_step(std::fmin(HARD, std::log10(0.01 * unit / std::fabs(by.size))))) return false;
    // Such velocities hardly ever allow an exact P, where contacts share a load.
    sharpen(by.size == 0 ? PATIENCE : 1);
    return true;
  }

  // Whether contacts that carry a load act nearly along one line, but for their friction.
  bool share_a_line() const {
    const List<size_t> sorted = sorted_by_line();
    for (size_t k = 0; k < sorted.size(); ++k)
      for (size_t l = k + 1; l < sorted.size() && have_same_bodies(cones[sorted[k]], cones[sorted[l]]); ++l) {
        const size_t i = sorted[k], j = sorted[l];
        if ((P[i][0] > 0 || P[j][0] > 0) && differ_in_friction(cones[i], cones[j])) return true;
      }
    return false;
  }

  double greatest() const {
    double most = 0;
    for (const Axes& one : P) most = std::fmax(most, one[0]);
    return most;
  }

 private:
  using Slope = Cone<double>::Slope;
  static constexpr double SOFT = -1, FIRM = 4, HARD = 6;  // decimal logarithms of rho
  static constexpr int FIRST_STEPS = 60, NEXT_STEPS = 30;  // of Newton's method
  static constexpr int PATIENCE = 5;  // turns of sharpen() that gain little

  double budget;  // multiplications
  List<Cone<double>> cones;
  double log_rho = SOFT, rho = 0;
  List<Axes> from;  // Q
  Vector residual;  // of y
  List<Slope> slopes;  // of P by the velocities, times -1 / rho
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
    const double parts = std::fmax(1, cone.mu) * std::fmax(-u[0], 0) + std::hypot(P[i][0], t);
    if (!(cone.mu > 0)) return std::fmin(parts, std::fabs(u[0])) + rounding;
    double slides = std::fmax(cone.mu * P[i][0] - t, 0);
    slides += t > 0 ? std::hypot(u[1] + slip * P[i][1] / t, u[2] + slip * P[i][2] / t) : slip;
    return std::fmin(parts, std::hypot(u[0], std::fmin(slip, slides))) + rounding;
  }

  // By how the impulses of a contact along an axis act.
  static double place(const Cone<double>& cone, int axis) {
    double sum = 0;
    for (const auto& side : cone.row)
      for (int k = 0; k < 6; ++k) sum += std::sqrt(k + 2.0) * side[axis][k];
    return sum;
  }

  // From -1 to 1, the same for impulses that act alike.
  static double uneven(const Cone<double>& cone, int axis, double phase) {
    constexpr double FREQUENCY = 50;  // contacts that act a little differently get other numbers
    return std::sin(FREQUENCY * place(cone, axis) + phase);
  }

  static std::pair<int, int> bodies_of(const Cone<double>& cone) { return std::minmax({cone.body[0], cone.body[1]}); }
  static bool have_same_bodies(const Cone<double>& one, const Cone<double>& other) {
    return bodies_of(one) == bodies_of(other);
  }

  // The contacts of two bodies one after the other, and of these the contacts on one line, sorted by their friction.
  List<size_t> sorted_by_line() const {
    using Key = std::pair<std::pair<int, int>, std::array<double, 6>>;
    List<std::pair<Key, size_t>> keys;
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone<double>& cone = cones[i];
      const Key key{bodies_of(cone), {place(cone, 0), cone.mu, cone.w[1], cone.w[2], place(cone, 1), place(cone, 2)}};
      keys.push_back({key, i});
    }
    std::sort(keys.begin(), keys.end());
    List<size_t> sorted;
    for (const auto& [key, i] : keys) sorted.push_back(i);
    return sorted;
  }

  // Of each contact, far from those of others on its line.
  List<double> angles() const {
    constexpr double GOLDEN = 2.399963229728653;  // the golden angle
    List<double> angle(cones.size());
    const List<size_t> sorted = sorted_by_line();
    for (size_t k = 0; k < sorted.size(); ++k) angle[sorted[k]] = GOLDEN * static_cast<double>(k);
    return angle;
  }

  // Whether the normal impulses of two contacts of the same bodies nearly have the same effect, and their friction has not.
  static bool differ_in_friction(const Cone<double>& one, const Cone<double>& other) {
    constexpr double NEARLY = 0.03;  // uneven() tells apart what differs by more
    constexpr double MORE = 10;
    if (!(one.mu > 0 || other.mu > 0)) return false;
    double apart = 0, friction = std::fabs(one.mu - other.mu);
    for (int side = 0; side < 2; ++side) {
      if (one.body[side] < 0) continue;
      const int same = one.body[side] == other.body[0] ? 0 : 1;
      for (int a = 0; a < 3; ++a)
        for (int k = 0; k < 6; ++k) {
          double& most = a == 0 ? apart : friction;
          most = std::fmax(most, std::fabs(one.row[side][a][k] - other.row[same][a][k]));
        }
    }
    for (int a = 1; a < 3; ++a) friction = std::fmax(friction, std::fabs(one.w[a] - other.w[a]));
    return apart < NEARLY && friction > MORE * apart;
  }

  // P and the residual y - B^T P at some y. Returns the length of this.
  double evaluate(const Vector& at) {
    residual = at;
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone<double>& cone = cones[i];
      const Axes by = cone.velocity(at.data());
      for (int k = 0; k < 3; ++k) P[i][k] = from[i][k] - rho * cone.share * (cone.w[k] + by[k]);
      limit(P[i], cone.mu, slopes[i]);
      cone.add_effect({-P[i][0], -P[i][1], -P[i][2]}, residual);
    }
    work += static_cast<double>(Cone<double>::WORK * cones.size());
    return length_of(residual);
  }

  // Cut P off: P_n at 0, and P_t at mu P_n. `slope` is the derivative of this.
  static void limit(Axes& P, double mu, Slope& slope) {
    slope = {};
    if (!(P[0] > 0)) {
      P = {};
      return;
    }
    slope[0][0] = 1;
    const double t = std::hypot(P[1], P[2]), most = mu * P[0], part = t > most ? most / t : 1;
    for (int k = 1; k < 3; ++k) slope[k][k] = part;
    if (!(t > most)) return;
    const Axes along{0, P[1] / t, P[2] / t};
    for (int k = 1; k < 3; ++k) {
      slope[k][0] = mu * along[k];
      for (int l = 1; l < 3; ++l) slope[k][l] -= part * along[k] * along[l];
      P[k] = most * along[k];
    }
  }

  // step = -M^-1 residual, M = 1 + sum rho_i B_i^T S_i B_i, with the slopes S_i. Whether M has factors.
  bool newton_step(Vector& step) {
    matrix.set_to_unit();
    for (size_t i = 0; i < cones.size(); ++i) {
      const Cone<double>& cone = cones[i];
      if (!(slopes[i][0][0] > 0)) continue;  // no impulse at this contact
      Slope slope = slopes[i];
      for (auto& row : slope)
        for (double& one : row) one *= rho * cone.share;
      for (int t = 0; t < 2; ++t) {
        if (cone.body[t] < 0) continue;
        double part[3][6]{};
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            for (int l = 0; l < 6; ++l) part[a][l] += slope[a][b] * cone.row[t][b][l];
        for (int s = 0; s < 2; ++s)
          if (cone.body[s] >= 0) matrix.add_product(6 * cone.body[s], 6 * cone.body[t], cone.row[s], part);
      }
    }
    step = residual;
    for (double& one : step) one = -one;
    return matrix.solve(step);
  }

  // Solve the equations from the y at hand, until rounding hides what a step gains. If that fails, y stays as it is.
  bool newton(int turns) {
    constexpr double SHORTEST = 1e-3, LESS = 1e-4;
    constexpr double ROUNDING_OF_ONE = 1e-11, ROUNDING_OF_RHO = 1e-13;  // of 1, and of rho times a velocity
    rho = std::pow(10, log_rho);
    const double near = ROUNDING_OF_ONE + ROUNDING_OF_RHO * rho;
    Vector at = y, step, next;
    double left = evaluate(at);
    while (turns-- > 0 && has_budget()) {
      if (!newton_step(step)) return false;
      const double before = left;
      double length = 1;
      for (;; length /= 2) {
        next = at;
        increase(next, length, step);
        left = evaluate(next);
        if (left <= (1 - LESS * length) * before || length < SHORTEST) break;
      }
      if (before < near && !(left < before / 2)) {
        evaluate(at);
        take_last(step);
        return true;
      }
      if (length < SHORTEST) return false;
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
      limit(P[i], cones[i].mu, unused);
    }
    set_motion();
  }
  void set_motion() {
    y.assign(y.size(), 0);
    for (size_t i = 0; i < cones.size(); ++i) cones[i].add_effect(P[i], y);
  }

  // Raise rho, from one for which the equations are solved, by steps for which Newton's method converges.
  void raise_to(double last) {
    constexpr double WIDEST = 2, NARROWEST = 1e-3;
    double step = WIDEST;
    while (log_rho < last && step > NARROWEST && has_budget()) {
      const double before = log_rho;
      log_rho = std::fmin(log_rho + step, last);
      if (newton(NEXT_STEPS)) {
        step = std::fmin(2 * step, WIDEST);
      } else {
        log_rho = before;
        step /= 2;
      }
    }
    if (log_rho < last) newton(NEXT_STEPS);  // the last try has changed P
  }

  // A step with the greatest rho for which Newton's method converges, if need be by way of smaller ones.
  bool proximal_step(double greatest) {
    for (log_rho = greatest; log_rho >= SOFT; log_rho -= 2)
      if (newton(NEXT_STEPS)) {
        raise_to(greatest);
        return true;
      }
    return false;
  }

  // Steps with Q = P, until P is exact or no longer becomes more so. They take a greater rho where they are slow, and a
  // smaller one where rho times a rounding is too much. Rounding must not make loads creep from contact to contact: P that
  // are hardly more exact count for nothing.
  void sharpen(int patience) {
    constexpr int MOST = 60;
    constexpr double HARDEST = 12, FAST = 0.1, BETTER = 0.5, WORSE = 2, ROUNDING = 0x1p-49;
    List<Axes> best = P;
    double least = off(), last = least, hardness = FIRM, hardest = HARDEST;
    auto is_exact = [&] { return least <= ROUNDING * std::fmax(1, greatest()); };
    for (int turn = 0, idle = 0; turn < MOST && idle < patience && !is_exact() && has_budget(); ++turn) {
      from = P;
      if (!proximal_step(hardness)) break;
      const double now = off();
      ++idle;
      if (now > WORSE * least) {
        P = best;
        hardness = hardest = log_rho - 2;
        idle = 0;
      } else if (now > FAST * last) {
        hardness = std::fmin(log_rho + 2, hardest);
      }
      if (now < BETTER * least) {
        idle = 0;
        least = now;
        best = P;
      }
      last = now;
    }
    P = std::move(best);
    set_motion();
  }
};

// What the solutions of equations that differ a little tell about the error of y.
class Neighbours {
 public:
  // farther: by how much velocities differ.
  Neighbours(const Conditions& solved, double farther)
      : solved(solved), farther(farther), greatest(solved.greatest()), kinds(solved.share_a_line() ? 2 : 1) {}

  // The greatest change of y by other velocities; infinite if no solution is found.
  double change_by_velocities() const {
    double most = 0;
    for (int kind = 0; kind < kinds; ++kind) {
      bool is_known = false;
      for (int k = 0; k < TRIES; ++k)
        for (double size : {-farther, farther})
          if (const auto other = solution({size, 0, 1.0 * k, kind > 0})) {
            most = std::fmax(most, distance(*other));
            is_known = true;
          }
      if (!is_known) return INFINITY;
    }
    return most;
  }

  // Whether slightly different velocities decide where P that creep end.
  bool lead_elsewhere() const {
    constexpr double SLIGHT = 1e-6;
    for (int k = 0; k < TRIES; ++k)
      for (double size : {-SLIGHT, SLIGHT})
        if (const auto other = solution({size, 0, 1.0 * k, false}); other && distance(*other) > SEVERAL * greatest)
          return true;
    return false;
  }

  // The greatest change of y by other shares of the load, and at least `most`, which other velocities cause; infinite if it
  // is large, or no solution is found.
  double change_by_shares(double most) const {
    constexpr double OTHER = 0.01;  // relative change of the shares
    constexpr double EXCESS = 10;  // of a change of y over what other velocities explain
    constexpr double APART = 10;  // change of y: these are solutions that lie apart
    for (int kind = 0; kind < kinds; ++kind) {
      bool is_known = false;
      for (int k = 0; k < TRIES; ++k) {
        const auto other = solution({0, OTHER, 1.0 * k, kind > 0});
        if (!other || other->off() > farther) continue;
        is_known = true;
        const double change = distance(*other), by_shares = change / OTHER;
        if (change < EXCESS * other->off() / farther * most || by_shares > APART * greatest) continue;
        if (by_shares > std::fmax(SEVERAL * greatest, most)) return INFINITY;
        most = std::fmax(most, by_shares);
      }
      if (!is_known) return INFINITY;
    }
    return most;
  }

 private:
  static constexpr int TRIES = 3;
  static constexpr double SEVERAL = 1e-3;  // change of y, relative to impulses: it matters which solution this is
  const Conditions& solved;
  double farther, greatest;
  int kinds;  // of changes

  std::optional<Conditions> solution(const Conditions::Change& by) const {
    Conditions other = solved;
    if (!other.solve_nearby(by)) return {};
    return other;
  }
  double distance(const Conditions& other) const { return length_of(difference(other.y, solved.y)); }
};

// An estimate of the error of y: how far it is from the y of other velocities, and of other shares of the load. `turned`:
// by how much velocities differ because contacts have the axes of their face.
double motion_error(const Conditions& solved, double turned, bool on_faces) {
  // Relative to velocities and impulses. Places or normals that are off by 1e-9 make P creep for slips of CREEPING.
  constexpr double EXACT = 0x1p-44, CREEPING = 0x1p-30, ROUNDING = 0x1p-50;
  constexpr double LEAST_OF_CREEPING = 1e-7;  // P is not followed to where it ends: far above the errors seen
  constexpr double FARTHER = 10;  // change of velocities, relative to off()
  constexpr double CAUTION = 4;  // the directions tried may not be those in which the error is greatest
  const double unit = std::fmax(1, solved.greatest()), off = solved.off();
  if (off > (on_faces ? CREEPING : EXACT) * unit) return INFINITY;  // P that creep have unknown limits
  const bool does_creep = off > EXACT * unit;
  const Neighbours neighbours(solved, std::fmax(FARTHER * std::fmax(off, ROUNDING * unit), turned));
  double most = neighbours.change_by_velocities();
  if (most == INFINITY || (does_creep && neighbours.lead_elsewhere())) return INFINITY;
  most = neighbours.change_by_shares(most);
  if (does_creep) most = std::fmax(most, LEAST_OF_CREEPING);
  return CAUTION * most;
}

// An impulse along given axes, along the own axes of the contact; in its own cone.
Axes along_own_axes(const Axes& P, const ConditionAxes& given, double mu) {
  Axes own{};
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) own[b] += P[a] * given.in_own[a][b];
  if (!(own[0] > 0)) return {};
  const double t = std::hypot(own[1], own[2]), most = mu * own[0];
  for (int b = 1; b < 3 && t > most; ++b) own[b] *= most / t;
  return own;
}

struct Solution {
  List<Axes> P;  // along the own axes of the contacts
  double error = 0;  // of the motion
  double turned = 0;  // by how much velocities along the normals of the conditions and along the own ones differ
};

// What the conditions along given axes lead to.
Solution turned_back(const Assembly& assembly, const List<ConditionAxes>& axes, const Conditions& found, double speed,
                     bool on_faces) {
  Solution solution{found.P};
  Vector off(found.y.size());  // how much the effects of impulses along both axes differ
  const double mean = mean_inverse_mass(assembly, assembly.all_contacts());
  for (int i = 0; i < assembly.count; ++i) {
    const Axes& P = found.P[i];
    if (!axes[i].is_turned || !(P[0] > 0)) continue;
    const AssembledContact& contact = assembly.contacts[i];
    const Cone<double> given = cone_of(contact, axes[i].axes, speed, mean);
    const Cone<double> own = cone_of(contact, contact.axes, speed, mean);
    solution.P[i] = along_own_axes(P, axes[i], own.mu);
    own.add_effect(solution.P[i], off);
    given.add_effect({-P[0], -P[1], -P[2]}, off);
    // The normal parts of the velocity, as vectors. The tangents may point anywhere.
    const double u = own.w[0] + own.velocity(found.y.data())[0], v = given.w[0] + given.velocity(found.y.data())[0];
    for (int b = 0; b < 3; ++b)
      solution.turned = std::fmax(solution.turned, std::fabs(v * axes[i].in_own[0][b] - (b == 0 ? u : 0)));
  }
  solution.error = motion_error(found, solution.turned, on_faces) + length_of(off);
  return solution;
}

// Solve the conditions along the own axes, too, and take their solution if its motion is nearly the one that was found. If
// they lead elsewhere, the one that was found counts if its error is small.
void refine(Solution& solution, const Conditions& found, Conditions along_own, bool on_faces) {
  constexpr double NEAR = 1e-3, SMALL = 1e-7;  // relative to the greatest impulse
  if (solution.error == INFINITY || !along_own.solve_from(solution.P)) return;
  const double apart = length_of(difference(along_own.y, found.y));
  if (apart > std::fmax(solution.error, NEAR * found.greatest())) {
    if (solution.error > SMALL * found.greatest()) solution.error = INFINITY;
    return;
  }
  solution.error = std::fmax(solution.error, apart);
  const double error = motion_error(along_own, 0, on_faces);
  if (error <= solution.error) solution = {along_own.P, error};
}

}  // namespace

ClusterImpulses obey_coulomb(const Assembly& assembly, const List<ConditionAxes>& axes, const List<Axes>& rebounds,
                             double budget, bool on_faces) {
  constexpr double SOLVED = 1e-6;  // greatest off(), and a hundred times this, of the greatest impulse
  List<Axes> P(assembly.count);
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
  Conditions conditions(assembly, axes, rebounds, speed, budget);
  if (!conditions.solve()) return {false};
  if (!(conditions.off() <= SOLVED * std::fmin(1, 100 * conditions.greatest()))) return {false};
  Solution solution = turned_back(assembly, axes, conditions, speed, on_faces);
  if (solution.turned > 0)
    refine(solution, conditions, Conditions(assembly, own_axes(assembly), rebounds, speed, budget), on_faces);
  for (int i = 0; i < assembly.count; ++i) P[i] = in_newton_seconds(solution.P[i], assembly.contacts[i], speed);
  return with_axis_impulses({true, {}, assembly.is_locked ? INFINITY : speed * solution.error}, assembly, P);
}
