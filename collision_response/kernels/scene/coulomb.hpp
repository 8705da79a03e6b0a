// COULOMB for several contacts: the frictionless answer, then the friction that does the least work.
//
// First comes the answer without friction, by generalised reflections with restitution: GRR, scene/reflections.py. The
// contacts that it loads may then have any impulses P in the friction cones of their own normal impulses, |P_t| <= mu
// P_n. Of those that keep the normal velocities of GRR, the law takes the P with the least work on the relative
// velocities u:
//
//     P.A P / 2 + u.P  ->  min
//
// This is a convex programme. The impulses of GRR are admissible in it, so energy cannot grow. It is strictly convex in
// the velocities, so these are unique, and as symmetric as the scene. If another contact then approaches, one more
// projection, with e = 0, stops that. It only takes energy, too; and because it adds normal impulse, friction stays in
// its cones.
//
// The work is that on relative velocities, not the change of kinetic energy: next to a moving floor, the latter depends
// on the observer.
//
// All contacts that can carry a load share it, if that hardly changes its effect. So a box whose corners are slightly
// off a plane slides like one whose corners are in it. Where normals or lever arms differ by more than about 1e-4, a
// contact that the load does not need takes less and less part in it. Nor are normal velocities kept where such small
// differences decide them. Both change gradually, so that no choice of contacts has to be made, which would depend on
// their order.
//
// For one contact this is Chatterjee & Ruina's law in each of three cases: in the plane; where the contact sticks; and
// where normal and slip are uncoupled. In space, sliding, they differ by up to 23 % of the impulse.
//
// Impulses and velocities are along the axes of each contact: the unit normal and two tangents. Doubles solve the
// programme; where their bound on the error is too large, double-double solves it again.
//
// Sources: Kaufman, Sueda, James & Pai, "Staggered Projections for Frictional Contact in Multibody Systems", ACM Trans.
// Graph. 27 (2008), for maximal dissipation over actual cones; Smith et al. 2012 (see scene/reflections.py), for
// friction after reflections.
#pragma once
#include "contact_cones.hpp"
#include "impulses.hpp"
#include "least_norm.hpp"
#include "motion.hpp"
#include "projection.hpp"

constexpr double SHARING = 1e-9;  // for contacts whose normals or lever arms differ by 3e-5

// The impulses >= 0 of nearly the same effect as p with nearly the least norm: those that minimise the square of the
// difference in the effect, plus SHARING times the norm. Moving walls are one more body, which their work moves.
inline Vector nearly_least_norm(const Assembly& assembly, const Vector& p) {
  const int count = assembly.count, walls = assembly.body_count;
  double greatest = 0, fastest = 0, mean = 0;
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    greatest = std::fmax(greatest, p[i] / contact.scale);
    fastest = std::fmax(fastest, std::fabs(high(contact.velocity)) * contact.scale);
    mean += contact.scale * contact.scale * contact.length * contact.length / count;
  }
  Cones<DD> programme(walls + assembly.has_moving_wall);
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    Cones<DD>::Cone cone = cone_of(contact, assembly.axes_of<DD>(contact), 1, 1 / mean);
    cone.mu = 0;
    for (int side = 0; side < 2; ++side)
      if (contact.wall[side] >= 0) {
        cone.body[side] = walls;
        for (int k = 0; k < 6 && fastest > 0; ++k)
          cone.row[side][0][0] += contact.scale / fastest * assembly.walls[contact.wall[side]].x[BODY_VELOCITY_X + k] *
                                  value(contact.jacobian[side][k]);
      }
    programme.cones.push_back(cone);
    programme.P.push_back({DD{p[i] / contact.scale / greatest, 0}, DD{}, DD{}});
  }
  programme.aim_at(programme.motion());
  programme.prepare();
  programme.solve_from_zero(1 / SHARING);
  Vector nearly;
  for (int i = 0; i < count; ++i) nearly.push_back(programme.P[i][0].h * greatest * assembly.contacts[i].scale);
  return nearly;
}

// Up to which loads of independent contacts, relative to the greatest, rounding may decide: the more, the more nearly
// they depend on each other.
inline Vector rounding_of_loads(const Assembly& assembly) {
  constexpr double ROUNDING = 0x1p-72;
  const std::vector<DD> matrix = assembly.couplings<DD>();
  ActiveSet<DD> basis(matrix.data(), assembly.count);
  basis.span(assembly.all_contacts(), NEARLY_DEPENDENT);
  const std::vector<DD> diagonal = basis.diagonal_of_inverse();
  Vector rounding(assembly.count, INFINITY);
  for (size_t k = 0; k < diagonal.size(); ++k) rounding[basis.members[k]] = ROUNDING * diagonal[k].h;
  return rounding;
}

// The loads, relative to the greatest of the body that has less, and at least to `least`.
inline Vector relative_loads(const Assembly& assembly, const Vector& loads, double least) {
  const std::vector<AssembledContact>& contacts = assembly.contacts;
  Vector relative(assembly.count), most(assembly.body_count);  // most: the greatest load of each body
  for (int i = 0; i < assembly.count; ++i)
    for (int body : contacts[i].body)
      if (body >= 0) most[body] = std::fmax(most[body], loads[i] / contacts[i].scale);
  for (int i = 0; i < assembly.count; ++i) {
    double nearby = INFINITY;
    for (int body : contacts[i].body)
      if (body >= 0) nearby = std::fmin(nearby, most[body]);
    relative[i] = loads[i] / contacts[i].scale / std::fmax(nearby, least);
  }
  return relative;
}

// How much part in the loads each contact takes, from 0 to 1. It takes part if it is loaded, where loads of the same
// effect are shared; other loads would depend on the order of the contacts. It takes less if it is loaded where loads of
// nearly the same effect are, as the fourth corner of a box whose corners are slightly off a plane; or if its load may be
// rounding. Sets the loads shared.
inline Vector parts_in_loads(const Assembly& assembly, const std::vector<DD>& given, double greatest, Vector& shared) {
  constexpr double SMALL = 1e-10, LEAST = 1e-6;  // a load, relative to those of its bodies; a part
  constexpr double NO_LOAD = 1e-20;  // of a body, relative to the greatest
  constexpr double NO_SHARE = 1e-8;  // components of impulses that do nothing
  const std::vector<AssembledContact>& contacts = assembly.contacts;
  const int count = assembly.count;
  Vector part(count), nearly, rounding;
  std::vector<DD> precise = given;
  const NullImpulses null = null_impulses(assembly, LEAST_EFFECT);
  if (!null.basis.empty()) minimise_norm(assembly, precise, false, null.basis, NO_SHARE);
  shared = rounded(precise.data(), count);
  auto is_independent = [&](int i) {
    return std::all_of(null.basis.begin(), null.basis.end(),
                       [&](const std::vector<DD>& z) { return std::fabs(z[i].h) < NO_SHARE * contacts[i].scale; });
  };
  const Vector exactly = relative_loads(assembly, shared, NO_LOAD * greatest);
  for (int i = 0; i < count; ++i) {
    if (exactly[i] > SMALL) {
      part[i] = 1;
      continue;
    }
    if (shared[i] > 0 && is_independent(i)) {
      if (rounding.empty()) rounding = rounding_of_loads(assembly);
      part[i] = shared[i] / contacts[i].scale / (rounding[i] * greatest);
    }
    if (!(part[i] >= 1)) {
      // Sharing gives loads of about SHARING to bodies that have none.
      if (nearly.empty())
        nearly = relative_loads(assembly, nearly_least_norm(assembly, rounded(given.data(), count)),
                                SHARING / LEAST * greatest);
      part[i] = std::fmax(part[i], nearly[i]);
    }
    part[i] = part[i] > LEAST ? std::fmin(part[i], 1) : 0;
  }
  return part;
}

// The error of y, in units of `speed`, that makes the error bound of an answer `bound`.
inline double error_for_bound(const Assembly& assembly, const Vector& y, double bound) {
  double largest = 0, worst = 0;
  for (int b = 0; b < assembly.body_count; ++b) {
    double twist[6];
    assembly.bodies[b].centre_in_doubles.twist_of(&y[6 * b], twist);
    largest = std::fmax(largest, twist_size(assembly.bodies[b].x, twist));
    worst = std::fmax(worst, norm_ratio(assembly.bodies[b]));
  }
  return bound * largest / worst;
}

constexpr double ACCEPTED_IN_DOUBLES = 8e-7;  // a bound on the error of an answer: no need for double-double

// A bound on the multipliers that keep normal velocities u+ of the contacts `loaded` where all of them stick: for a
// basis S of these, and the roots a of the diagonal of A_SS^-1,
//
//     lambda_S = A_SS^-1 u+     |lambda_s| <= a_s sqrt(u+.A_SS^-1 u+) <= a_s sum a_i |u_i+|
inline Vector sticking_multipliers(const Assembly& assembly, const std::vector<int>& loaded, const Vector& u) {
  const std::vector<DD> matrix = assembly.couplings<DD>();  // beside heavy bodies, doubles lose its digits
  ActiveSet<DD> basis(matrix.data(), assembly.count);
  basis.span(loaded, NEARLY_DEPENDENT);
  const std::vector<DD> diagonal = basis.diagonal_of_inverse();
  Vector of_contact(assembly.count), multipliers;
  double size = 0;
  for (size_t k = 0; k < diagonal.size(); ++k) of_contact[basis.members[k]] = std::sqrt(diagonal[k].h);
  for (size_t k = 0; k < loaded.size(); ++k) size += of_contact[loaded[k]] * std::fabs(u[k]);
  for (int i : loaded) multipliers.push_back(of_contact[i] * size);
  return multipliers;
}

// Solve the programme of least work again, in double-double. If this reduces `error`, the bound on the error of y, set
// the impulses of `programme`. Returns the new bound.
inline double solve_in_double_double(const Assembly& assembly, const std::vector<int>& loaded, const std::vector<DD>& p,
                                     double speed, double mean, Cones<double>& programme, double error, double enough) {
  Cones<DD> precise(assembly.body_count);
  precise.enough = std::fmin(precise.enough, enough);
  const std::vector<N> changes = assembly.twist_changes(p.data());
  for (size_t k = 0; k < loaded.size(); ++k) {
    const AssembledContact& contact = assembly.contacts[loaded[k]];
    const auto& cone = programme.cones[k];
    precise.cones.push_back(cone_of(contact, assembly.axes_of<DD>(contact), speed, mean, cone.part, cone.load));
    precise.kept_velocities.push_back(contact.scale * contact.length *
                                      value(assembly.velocity_change(contact, changes)) / contact.length_in<DD>() /
                                      speed);
  }
  precise.sticking = programme.sticking;
  precise.prepare();
  double precise_error = precise.solve_from(programme);
  if (!(precise_error < error)) return error;
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

// The impulses of COULOMB, from the frictionless ones. If none of the loaded contacts has friction, these are the result.
inline ClusterImpulses least_work_friction(const Assembly& assembly, const ClusterImpulses& frictionless) {
  int count = assembly.count;
  ClusterImpulses result = frictionless;
  const Vector given = rounded(frictionless.normal.data(), count);
  auto greatest = [&](const Vector& loads) {
    double most = 0;
    for (int i = 0; i < count; ++i) most = std::fmax(most, loads[i] / assembly.contacts[i].scale);
    return most;
  };
  if (!(greatest(given) > 0)) return result;
  Vector shared;
  const Vector part = parts_in_loads(assembly, frictionless.normal, greatest(given), shared);
  const double speed = greatest(shared);
  double mean = 0;
  std::vector<int> loaded;
  bool has_friction = false;
  Motion as_given(assembly);
  std::vector<Axes> normal_only(count);
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    normal_only[i] = {given[i] * contact.length, 0, 0};
    as_given.apply(i, normal_only[i]);
    if (!(part[i] > 0)) {
      double slip = std::hypot(contact.axes[1].velocity, contact.axes[2].velocity) * contact.length;
      if (given[i] > 0)
        result.error +=
            std::sqrt(2 * contact.mu * (given[i] / contact.scale / speed) * (slip * contact.scale / speed)) * speed;
      continue;
    }
    loaded.push_back(i);
    has_friction = has_friction || contact.mu > LEAST_FRICTION;
    mean += 1 / (contact.scale * contact.scale * contact.length * contact.length);
  }
  if (!has_friction) return result;
  mean /= loaded.size();
  Cones<double> programme(assembly.body_count);
  programme.cones.reserve(loaded.size());
  bool has_heavy = false, are_kept = true;  // whether a body is heavy, and all normal velocities are kept
  Vector after;  // these, in units of `speed`
  for (int i : loaded) {
    const AssembledContact& contact = assembly.contacts[i];
    const double load = part[i] < 1 ? 1 : shared[i] / contact.scale / speed;
    programme.cones.push_back(cone_of(contact, contact.axes, speed, mean, part[i], load));
    const double unit = contact.scale * contact.length / speed;
    programme.kept_velocities.push_back((as_given.velocity(i, 0) - contact.axes[0].velocity) * unit);
    after.push_back(as_given.velocity(i, 0) * unit);
    has_heavy = has_heavy || programme.cones.back().has_heavy_body();
    are_kept = are_kept && !(part[i] < 1);
  }
  if (has_heavy && are_kept) programme.sticking = sticking_multipliers(assembly, loaded, after);
  programme.prepare();
  double error = programme.solve();
  const double enough = error_for_bound(assembly, programme.motion(), ACCEPTED_IN_DOUBLES);
  if (!(error <= enough))
    error = solve_in_double_double(assembly, loaded, frictionless.normal, speed, mean, programme, error, enough);
  result.error += error * speed;
  std::vector<Axes> P(count);
  for (size_t k = 0; k < loaded.size(); ++k)
    P[loaded[k]] = in_newton_seconds(programme.P[k], assembly.contacts[loaded[k]], speed);

  // Friction may have made another contact approach.
  Motion moved(assembly);
  for (int i = 0; i < count; ++i) moved.apply(i, P[i]);
  double square = 0;  // of the change by friction
  for (size_t k = 0; k < moved.y.size(); ++k)
    square += (moved.y[k] - as_given.y[k]) / speed * ((moved.y[k] - as_given.y[k]) / speed);
  // Friction takes energy. If it seems to add some, rounding is all that it does: leave it out. Where it only shares
  // impulses, it neither adds nor takes any, up to rounding.
  double size = 0;  // of what the works are the sums of
  auto work = [&](const Motion& motion, const std::vector<Axes>& impulses) {
    double sum = 0;
    auto add = [&](double one) {
      sum += one;
      size += std::fabs(one);
    };
    for (double y : motion.y) add(y / speed * (y / speed) / 2);
    for (int i = 0; i < count; ++i) {
      const AssembledContact& contact = assembly.contacts[i];
      for (int axis = 0; axis < 3; ++axis)
        add(contact.axes[axis].velocity * contact.scale / speed * (impulses[i][axis] / contact.scale / speed));
    }
    return sum;
  };
  if (const double gain = work(moved, P) - work(as_given, normal_only); !(gain - 0x1p-48 * size <= 0)) {
    result.error += std::sqrt(square) * speed;
    return result;
  }
  std::vector<N> offset;
  bool approaches = false;
  for (int i = 0; i < count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    double u = moved.velocity(i, 0);
    const double doubt = 0x1p-50 * (std::fabs(contact.axes[0].velocity) + moved.size_at(i));
    // Velocities that are kept do not approach, except by the error of the programme.
    const double kept = part[i] < 1 ? 0 : error * speed / (contact.scale * contact.length);
    approaches = approaches || u < -doubt - kept;
    offset.push_back(exact(u * contact.length) - contact.velocity);
    offset.back().error += doubt * contact.length;
  }
  if (approaches) {
    Projection last = project(assembly, std::vector<DD>(count).data(), assembly.all_contacts(), offset.data());
    // GRR has found velocities that separate the contacts. If none are found here, doubles cannot tell.
    result.error += last.status == MinimumStatus::FOUND ? last.error : INFINITY;
    for (int i = 0; i < count; ++i) P[i][0] += last.q[i].h * assembly.contacts[i].length;
  }
  return with_axis_impulses(std::move(result), assembly, P);
}
