// COULOMB for several contacts: the frictionless answer, then the friction that does the least work.
//
// First comes the answer without friction, by generalised reflections with restitution: GRR, scene/frictionless.py. The
// contacts that it loads may then have any impulses P in the friction cones of their own normal impulses, |P_t| <= mu
// P_n. Of those that keep the normal velocities of GRR, the law takes the P with the least work on the relative
// velocities u:
//
//     P.A P / 2 + u.P  ->  min
//
// This is a convex programme. The impulses of GRR are admissible in it, so energy cannot grow. It is strictly convex in
// the velocities, so these are unique, and as symmetric as the scene.
//
// But friction may unload a contact, as the upper edge of a box that topples: the velocity of this one need not be kept.
// Or it may press another, such as a wall beside a ball that turns. Then the impulses are those of Coulomb's conditions for
// rebounds with the normal velocities of GRR (coulomb_conditions.cpp), if these have one solution, and it does not create
// energy. If there are several, as where four corners share the load of a box that slides and turns, they are the ones of
// least work after all.
//
// If another contact then approaches in the end, one more projection, with e = 0, stops that. It only takes energy, too;
// and because it adds normal impulse, friction stays in its cones.
//
// The work is that on relative velocities, not the change of kinetic energy: next to a moving floor, the latter depends
// on the observer.
//
// All contacts that can carry a load share it, if that hardly changes its effect. So a box whose corners are slightly
// off a plane slides like one whose corners are in it. Where normals or lever arms differ by more than about 1e-4, a
// contact that the load does not need takes less and less part in it. Nor are normal velocities kept where such small
// differences decide them. Both change gradually, so that no choice of contacts has to be made, which would depend on
// their order. Only a contact that parts all the time, and not just slightly, takes no part.
//
// For one contact, least work is Chatterjee & Ruina's law in each of three cases: in the plane; where the contact sticks;
// and where normal and slip are uncoupled. In space, sliding, it takes more energy: docs/scenes.md has figures.
//
// Impulses and velocities are along the axes of each contact: the unit normal and two tangents. Doubles solve the
// programme; where their bound on the error is too large, double-double solves it again.
//
// Sources: Kaufman, Sueda, James & Pai, "Staggered Projections for Frictional Contact in Multibody Systems", ACM Trans.
// Graph. 27 (2008), for maximal dissipation over actual cones; Smith et al. 2012 (see scene/frictionless.py), for
// friction after reflections.
#include <optional>

#include "cones.hpp"
#include "contact_cones.hpp"
#include "coulomb_conditions.hpp"
#include "laws.hpp"
#include "motion.hpp"
#include "projection.hpp"
#include "shared_loads.hpp"

namespace {

// The error of y, in units of `speed`, that makes the error bound of an answer `bound`.
double error_for_bound(const Assembly& assembly, const Vector& y, double bound) {
  double largest = 0, worst = 0;
  for (int b = 0; b < assembly.body_count; ++b) {
    double twist[6];
    assembly.bodies[b].centre_in_doubles.twist_of(&y[6 * b], twist);
    largest = std::fmax(largest, twist_size(assembly.bodies[b].x, twist));
    worst = std::fmax(worst, norm_ratio(assembly.bodies[b]));
  }
  return bound * largest / worst;
}

constexpr double LEAST_EFFECT_OF_LOADS = 1e-3;  // where bodies jam, loads hardly move them

// A bound on the multipliers that keep normal velocities u+ of the contacts `loaded` where all of them stick: for a
// basis S of these, and the roots a of the diagonal of A_SS^-1,
//
//     lambda_S = A_SS^-1 u+     |lambda_s| <= a_s sqrt(u+.A_SS^-1 u+) <= a_s sum a_i |u_i+|
Vector sticking_multipliers(const Assembly& assembly, const List<int>& loaded, const Vector& u) {
  ActiveSet<DD> basis(assembly.couplings<DD>().data(), assembly.count);  // beside heavy bodies, doubles lose its digits
  basis.span(loaded, NEARLY_DEPENDENT);
  const List<DD> diagonal = basis.diagonal_of_inverse();
  Vector of_contact(assembly.count), multipliers;
  double size = 0;
  for (size_t k = 0; k < diagonal.size(); ++k) of_contact[basis.members[k]] = std::sqrt(diagonal[k].h);
  for (size_t k = 0; k < loaded.size(); ++k) size += of_contact[loaded[k]] * std::fabs(u[k]);
  for (int i : loaded) multipliers.push_back(of_contact[i] * size);
  return multipliers;
}

// The least velocity at which a contact is pressed, or parts, and the least pull that keeps it from parting. Errors of the
// normals of a box, up to 1e-4, let its fourth corner part as slowly as that, and pull as little.
constexpr double LEAST_CHANGE = 1e-3, LEAST_PULL = 1e-4;

// The greatest errors with which answers can tell that: far above most, so that rounding hardly decides.
constexpr double COARSEST = 1e-5;

// The programme of least work for the contacts that are loaded. Its velocities are in units of `speed`.
struct LeastWork {
  const Assembly& assembly;
  const ClusterImpulses& frictionless;
  const double tolerance;
  const List<char> parting;  // the contacts that have no part in the loads, because they part
  const SharedLoads shared = share_loads(assembly, frictionless.normal, parting);
  const double speed = shared.greatest;
  List<int> loaded{};
  double mean = 0;  // of n.K n, for unit normals
  List<Axes> normal_only = List<Axes>(assembly.count);
  Motion before{assembly};  // friction
  double left_out = 0;  // bound on the effect of friction where contacts are loaded too little to take part

  LeastWork(const Assembly& assembly, const ClusterImpulses& frictionless, double tolerance, const List<char>& parting)
      : assembly(assembly), frictionless(frictionless), tolerance(tolerance), parting(parting) {
    const List<AssembledContact>& contacts = assembly.contacts;
    for (int i = 0; i < assembly.count; ++i) {
      normal_only[i] = {frictionless.normal[i].h * contacts[i].length, 0, 0};
      before.apply(i, normal_only[i]);
      if (shared.part[i] > 0) loaded.push_back(i);
      else if (shared.loads[i] > 0 && !parting[i]) left_out += effect_of_friction(i);
    }
    mean = mean_inverse_mass(assembly, loaded);
  }

  // The impulses with friction, if that takes energy: else rounding is all that it does.
  ClusterImpulses resolve() const {
    const List<AssembledContact>& contacts = assembly.contacts;
    ClusterImpulses result = frictionless;
    result.error += left_out;
    if (std::none_of(loaded.begin(), loaded.end(), [&](int i) { return contacts[i].mu > LEAST_FRICTION; }))
      return result;
    Cones<double> programme = as_cones();
    double distance = solve_in_doubles(programme);
    const bool is_rough = distance > COARSEST;
    if (is_rough) distance = solve_precisely(programme, distance);
    Solution found = solution_of(programme, distance);
    if (std::optional<Solution> obedient = by_coulombs_conditions(programme, found.after)) {
      found = *std::move(obedient);
    } else if (!is_rough) {
      const double finer = solve_precisely(programme, distance);
      if (finer < distance) found = solution_of(programme, finer);
    }
    auto& [P, after, error] = found;
    result.error += error;
    if (creates_energy(after, P)) {
      result.error += norm_of(difference(after.y, before.y));
      return result;
    }
    const double error_of_stop = stop_approach(after, error, P);
    if (error_of_stop == INFINITY) {
      // Between walls that face each other, an impulse of 1e16 may be needed, which no digits give.
      result.error = INFINITY;
      return result;
    }
    result.error += error_of_stop;
    return with_axis_impulses(std::move(result), assembly, P);
  }

 private:
  double effect_of_friction(int i) const {
    const AssembledContact& contact = assembly.contacts[i];
    const double slip = std::hypot(contact.axes[1].velocity, contact.axes[2].velocity) * contact.length;
    return std::sqrt(2 * contact.mu * (shared.loads[i] / speed) * (slip * contact.scale / speed)) * speed;
  }

  // `plastic`: for velocities less those that are kept, so that nothing rebounds.
  Cones<double> as_cones(bool plastic = false) const {
    Cones<double> programme(assembly.body_count);
    programme.cones.reserve(loaded.size());
    bool has_heavy = false, are_kept = true;  // whether a body is heavy, and all normal velocities are kept
    Vector velocities;
    for (int i : loaded) {
      const AssembledContact& contact = assembly.contacts[i];
      const double part = shared.part[i], load = part < 1 ? 1 : shared.loads[i] / speed;
      const double unit = contact.unit() / speed;
      programme.cones.push_back(cone_of(contact, contact.axes, speed, mean, part, load));
      programme.kept_velocities.push_back((before.velocity(i, 0) - contact.axes[0].velocity) * unit);
      velocities.push_back(before.velocity(i, 0) * unit);
      if (plastic) programme.cones.back().w[0] -= velocities.back();
      has_heavy = has_heavy || programme.cones.back().has_heavy_body();
      are_kept = are_kept && !programme.cones.back().is_partial();
    }
    if (has_heavy && are_kept) programme.sticking = sticking_multipliers(assembly, loaded, velocities);
    programme.effect_of_loads = std::fmax(norm_of(before.y) / speed, LEAST_EFFECT_OF_LOADS);
    programme.prepare();
    return programme;
  }

  struct Solution {
    List<Axes> P;
    Motion after;
    double error;
  };
  // The impulses of a programme, of which the error is `distance`.
  Solution solution_of(const Cones<double>& programme, double distance) const {
    Solution found{List<Axes>(assembly.count), Motion(assembly), distance * speed};
    for (size_t k = 0; k < loaded.size(); ++k) {
      const int i = loaded[k];
      found.P[i] = in_newton_seconds(programme.P[k], assembly.contacts[i], speed);
      found.after.apply(i, found.P[i]);
    }
    return found;
  }

  // Whether a contact of a programme has a load. A small part of that without friction may be rounding.
  bool has_load(const Cones<double>& programme, size_t k) const {
    constexpr double LEAST = 0x1p-20;
    return programme.P[k][0] > LEAST * (shared.loads[loaded[k]] / speed);
  }

  // The pull of a programme without that of the rebounds, which press.
  double pull(const Cones<double>& programme) const {
    if (!(frictionless.restitution > 0)) return pull_of(programme);
    bool have_load = true;
    for (size_t k = 0; k < loaded.size(); ++k) have_load = have_load && has_load(programme, k);
    if (have_load) return 0;
    Cones<double> plastic = as_cones(true);
    plastic.enough = LEAST_PULL / 10;
    plastic.solve_from(Cones<double>::FIRST_RHO, programme.P);
    plastic.go_on();
    return pull_of(plastic);
  }

  // How much of the effect that keeps the velocities takes impulses which pull at contacts without a load. Contacts of one
  // face keep each other's velocities, in several ways: what one would do by pulling, others may do by pressing.
  double pull_of(const Cones<double>& programme) const {
    constexpr double HARD = 1e9;
    bool do_pull = false;
    for (size_t k = 0; k < loaded.size(); ++k)
      do_pull = do_pull || (!has_load(programme, k) && programme.keeping(k) < -LEAST_PULL);
    if (!do_pull) return 0;
    Cones<double> pressing(assembly.body_count);
    Vector effect(6 * static_cast<size_t>(assembly.body_count));
    for (size_t k = 0; k < loaded.size(); ++k) {
      Cone<double> cone = programme.cones[k];
      cone.add_effect({programme.keeping(k), 0, 0}, effect);
      cone.mu = 0;
      cone.part = 1;
      pressing.cones.push_back(cone);
      if (!has_load(programme, k)) continue;  // a contact with a load may also press less
      for (auto& side : cone.row)
        for (double& one : side[0]) one = -one;
      pressing.cones.push_back(cone);
    }
    pressing.aim_at(effect);
    pressing.prepare();
    pressing.solve_from_zero(HARD);
    return length_of(difference(pressing.motion(), effect));
  }

  // Whether friction presses contacts that are not loaded without it.
  bool presses_others(const Motion& after) const {
    for (int i = 0; i < assembly.count; ++i)
      if (!(shared.part[i] > 0) && -after.velocity(i, 0) * assembly.contacts[i].unit() > LEAST_CHANGE * speed)
        return true;
    return false;
  }

  // The velocity of a contact that GRR leaves, along its own axes: only the normal part of it. Contacts of a face whose
  // normals and heights are slightly off cannot all have rebounds along their own normals and stick. So they have those of
  // their face: along its normal, and as it turns. Fast slip makes own rebounds differ from these by more than a little.
  Axes rebound(int i, const ConditionAxes& axes) const {
    constexpr double LITTLE = 1e-3;  // relative to `speed`
    const AssembledContact& contact = assembly.contacts[i];
    const double little = LITTLE * speed / contact.unit();
    const Axes u = before.velocity(i);
    const double along_face = dot(axes.in_own[0], u);
    Axes sum{u[0], 0, 0};
    if (std::fabs(along_face - u[0]) <= little)
      for (int k = 0; k < 3; ++k) sum[k] = along_face * axes.in_own[0][k];
    const Axes by_turning = cross(before.spin(i).data(), axes.above.data());
    const auto own = contact.unit_vectors<double>();
    if (std::hypot(by_turning[0], by_turning[1], by_turning[2]) <= little)
      for (int k = 0; k < 3; ++k) sum[k] += dot(by_turning, own[k]);
    return sum;
  }

  // The impulses that obey Coulomb's conditions, if these are the only ones, and friction presses contacts or lets some
  // part. By least work it gives the motion `after`.
  std::optional<Solution> by_coulombs_conditions(const Cones<double>& programme, const Motion& after) const {
    constexpr double BUDGET = 1e8;  // multiplications: a tenth of a second
    const bool presses = presses_others(after);
    if (!presses && !(pull(programme) > LEAST_PULL)) return {};
    const List<ConditionAxes> axes = face_axes(assembly);
    List<Axes> rebounds(assembly.count);  // of plastic impacts exactly 0, which rounding would hide
    for (int i : loaded)
      if (frictionless.restitution > 0) rebounds[i] = rebound(i, axes[i]);
    const bool on_faces = std::all_of(loaded.begin(), loaded.end(), [&](int i) { return axes[i].on_face; });
    const ClusterImpulses impulses = obey_coulomb(assembly, axes, rebounds, BUDGET, on_faces);
    if (!impulses.are_found) return {};
    Solution found{{}, Motion(assembly), impulses.error};
    for (int i = 0; i < assembly.count; ++i) {
      const double normal = impulses.normal[i].h * assembly.contacts[i].length;
      found.P.push_back({normal, impulses.tangential[2 * i], impulses.tangential[2 * i + 1]});
      found.after.apply(i, found.P[i]);
    }
    const bool do_part = std::any_of(loaded.begin(), loaded.end(), [&](int i) {
      const double faster = found.after.velocity(i, 0) - before.velocity(i, 0);
      return faster * assembly.contacts[i].unit() > LEAST_CHANGE * speed;
    });
    const bool is_exact = found.error <= error_for_bound(assembly, found.after.y, COARSEST);
    if (!(do_part || presses) || !is_exact || creates_energy(found.after, found.P)) return {};
    return presses ? found : as_least_work(found);
  }

  // The impulses of least work of the contacts that are loaded in a solution, if they are the same but for its error: theirs
  // is a bound, and may be made as small as wanted.
  Solution as_least_work(const Solution& solution) const {
    LeastWork of_rest = *this;
    of_rest.loaded.clear();
    for (int i : loaded)
      if (solution.P[i][0] > 0) of_rest.loaded.push_back(i);
    Cones<double> programme = of_rest.as_cones();
    const double distance = of_rest.solve_precisely(programme, of_rest.solve_in_doubles(programme));
    const Solution found = of_rest.solution_of(programme, distance);
    return norm_of(difference(found.after.y, solution.after.y)) <= solution.error ? found : solution;
  }

  // The error of y that is small enough.
  double enough(const Cones<double>& programme) const {
    // Motion that is far faster than `speed` may be stopped again, and then counts for nothing.
    return std::fmin(error_for_bound(assembly, programme.motion(), 0.8 * tolerance), 5 * tolerance);
  }

  // Returns a bound on the error of y.
  double solve_in_doubles(Cones<double>& programme) const {
    programme.solve_from_zero();
    programme.enough = enough(programme);
    return programme.go_on();
  }

  // Solve the programme again in double-double, unless doubles are enough. Returns a bound on the error of y.
  double solve_precisely(Cones<double>& programme, double error_in_doubles) const {
    Cones<DD> precise(assembly.body_count);
    precise.enough = enough(programme);
    if (error_in_doubles <= precise.enough) return error_in_doubles;
    const List<N> changes = assembly.twist_changes(frictionless.normal.data());
    for (size_t k = 0; k < loaded.size(); ++k) {
      const AssembledContact& contact = assembly.contacts[loaded[k]];
      const Cone<double>& cone = programme.cones[k];
      precise.cones.push_back(cone_of(contact, assembly.axes_of<DD>(contact), speed, mean, cone.part, cone.load));
      precise.kept_velocities.push_back(contact.unit() * value(assembly.velocity_change(contact, changes)) /
                                        contact.length_in<DD>() / speed);
    }
    precise.sticking = programme.sticking;
    precise.effect_of_loads = programme.effect_of_loads;
    precise.prepare();
    double precise_error = precise.solve_from(programme);
    if (!(precise_error < error_in_doubles)) return error_in_doubles;
    for (size_t k = 0; k < loaded.size(); ++k)
      for (int axis = 0; axis < 3; ++axis) {
        programme.P[k][axis] = precise.P[k][axis].h;
        double square = 0;
        for (const auto& side : programme.cones[k].row)
          for (double x : side[axis]) square += x * x;
        precise_error += 0x1p-53 * std::fabs(programme.P[k][axis]) * std::sqrt(square);  // P is rounded to doubles
      }
    return precise_error;
  }

  // Whether impulses P do more work than those without friction. Where friction only shares impulses, it neither adds
  // energy nor takes any, up to rounding.
  bool creates_energy(const Motion& after, const List<Axes>& P) const {
    double size = 0;  // of what the works are the sums of
    auto work = [&](const Motion& motion, const List<Axes>& impulses) {
      double sum = 0;
      auto add = [&](double one) {
        sum += one;
        size += std::fabs(one);
      };
      for (double y : motion.y) add(y / speed * (y / speed) / 2);
      for (int i = 0; i < assembly.count; ++i) {
        const AssembledContact& contact = assembly.contacts[i];
        for (int axis = 0; axis < 3; ++axis)
          add(contact.axes[axis].velocity * contact.scale / speed * (impulses[i][axis] / contact.scale / speed));
      }
      return sum;
    };
    const double gain = work(after, P) - work(before, normal_only);
    return !(gain - 0x1p-48 * size <= 0);
  }
  double norm_of(const Vector& y) const {
    double square = 0;
    for (double one : y) square += one / speed * (one / speed);
    return std::sqrt(square) * speed;
  }

  // Friction may have made another contact approach, and the error of the programme any of them. Add the normal impulses
  // that stop that, unless they do little, and no more than this error. As a projection, the stop does not increase the
  // error. Returns that of the stop.
  double stop_approach(const Motion& after, double error, List<Axes>& P) const {
    const int count = assembly.count;
    List<N> start;
    double approach = 0;
    for (int i = 0; i < count; ++i) {
      const AssembledContact& contact = assembly.contacts[i];
      const double u = after.velocity(i, 0);
      const double doubt = 0x1p-50 * (std::fabs(contact.axes[0].velocity) + after.size_at(i, 0));
      if (u < -doubt) approach -= u * contact.unit();
      start.push_back({{u * contact.length, 0}, doubt * contact.length});
    }
    if (!(approach > 0)) return 0;
    const Projection last = project(assembly, start, assembly.all_contacts());
    // GRR has found velocities that separate the contacts. If none are found here, doubles cannot tell: the stop then
    // counts as large as if each contact were stopped by itself.
    const bool is_found = last.status == MinimumStatus::FOUND;
    const double size = is_found ? assembly.velocity_size(last.q.data()) : approach;
    if (size <= std::fmin(error, USEFUL_BOUND * speed)) return size;
    for (int i = 0; i < count; ++i) P[i][0] += last.q[i].h * assembly.contacts[i].length;
    return is_found ? last.error : INFINITY;
  }
};

// The contacts that part, by their velocity where the others have stopped. The corner of a face whose normals are slightly off
// stops like the others, but for less than a thousandth of the greatest load.
List<char> parting_contacts(const Assembly& assembly, const ClusterImpulses& frictionless, double greatest) {
  constexpr double SLIGHT = 1e-3;
  List<char> parting(assembly.count);
  for (int i = 0; i < assembly.count && !frictionless.stopped.empty(); ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    parting[i] = frictionless.stopped[i] / contact.length * contact.unit() > SLIGHT * greatest;
  }
  return parting;
}

}  // namespace

ClusterImpulses least_work_friction(const Assembly& assembly, const ClusterImpulses& frictionless, double tolerance) {
  const double greatest = greatest_of(loads_of(assembly, frictionless.normal));
  if (!(greatest > 0)) return frictionless;
  // Coarser answers could not tell whether contacts part.
  const double fine = tolerance > 0 ? std::fmin(tolerance, USEFUL_BOUND) : USEFUL_BOUND;
  const List<char> parting = parting_contacts(assembly, frictionless, greatest);
  ClusterImpulses found = LeastWork(assembly, frictionless, fine, parting).resolve();
  const bool do_part = std::find(parting.begin(), parting.end(), true) != parting.end();
  if (!do_part || found.error <= COARSEST * greatest) return found;
  // Where bodies jam, friction may press contacts that part, in ways that leave no bound.
  return LeastWork(assembly, frictionless, fine, List<char>(assembly.count)).resolve();
}
