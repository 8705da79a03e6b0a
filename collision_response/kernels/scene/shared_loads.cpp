// Which contacts carry the loads of an impact.
#include "shared_loads.hpp"

#include <optional>

#include "cones.hpp"
#include "contact_cones.hpp"
#include "least_norm.hpp"

namespace {

constexpr double SHARING = 1e-9;  // for contacts whose normals or lever arms differ by 3e-5

// The weight of a body that has a thirtieth part in n.K n, or more: no wall at all, because even 1e-12 of one upsets loads
// that normals decide which differ by as little.
constexpr double NO_WALL = 1e-9;

using Velocity = std::array<double, 3>;

// What counts as a wall where loads are shared: immovable bodies, and bodies the more the heavier they are than what they
// touch. An impulse hardly moves them, but may do work on them.
struct Walls {
  static constexpr double HEAVY = 1e6;  // as many times heavier, bodies begin to count
  const Assembly& assembly;
  Vector weight;  // of each body: how much it counts as a wall, from 0 to 1
  Velocity drift{};  // of walls, on average over the loads. Work is what an observer sees who moves with it

  Walls(const Assembly& assembly, const Vector& loads, const List<Cone<DD>>& cones)
      : assembly(assembly), weight(assembly.body_count, 1) {
    for (const Cone<DD>& cone : cones)
      for (int side = 0; side < 2; ++side)
        if (const int body = cone.body[side]; body >= 0) weight[body] = std::fmin(weight[body], cone.own_part(side));
    for (double& one : weight) one = std::pow(1 + HEAVY * one, -2);
    const double greatest = greatest_of(loads);
    double total = 0;
    for (int i = 0; i < assembly.count; ++i)
      for (int side = 0; side < 2; ++side) {
        const int body = assembly.contacts[i].body[side];
        const double own = loads[i] / greatest * (body < 0 ? 1 : weight[body]);
        const Velocity v = velocity_of(assembly.contacts[i], side);
        for (int k = 0; k < 3; ++k) drift[k] += own * v[k];
        total += own;
      }
    for (double& one : drift) one /= total > 0 ? total : 1;
  }
  // Of a wall at the contact, or of the centre of mass of a body.
  Velocity velocity_of(const AssembledContact& contact, int side) const {
    const int body = contact.body[side], wall = contact.wall[side];
    if (body < 0 && wall < 0) return {};  // at rest
    const AssembledBody& of = body < 0 ? assembly.walls[wall] : assembly.bodies[body];
    Velocity arm;  // from the reference point
    for (int k = 0; k < 3; ++k)
      arm[k] = body < 0 ? contact.point[k] - of.x[BODY_POSITION_X + k] : of.centre_in_doubles.com()[k];
    Velocity v = cross(of.x + BODY_ANGULAR_VELOCITY_X, arm.data());
    for (int k = 0; k < 3; ++k) v[k] += of.x[BODY_VELOCITY_X + k];
    return v;
  }
  // Stretch the motion of a body along its velocity, so that its work counts. `fastest`: speed in the metric of kinetic
  // energy.
  void stretch(Cone<DD>& cone, const AssembledContact& contact, int side, double fastest) const {
    Velocity v = velocity_of(contact, side);
    for (int k = 0; k < 3; ++k) v[k] -= drift[k];
    const double speed = std::hypot(v[0], v[1], v[2]);
    const int body = contact.body[side];
    if (!(speed > 0) || weight[body] < NO_WALL) return;
    const double by = weight[body] * speed / (assembly.bodies[body].centre_in_doubles.root() * fastest);
    DD along{};
    for (int k = 0; k < 3; ++k) along += v[k] / speed * cone.row[side][0][k];
    for (int k = 0; k < 3; ++k) cone.row[side][0][k] += by * (v[k] / speed) * along;
  }
};

// The part of a wall in the normal velocity of a contact, for an observer who moves with `drift`.
DD wall_velocity(const Assembly& assembly, const AssembledContact& contact, int side, const Velocity& drift) {
  DD velocity{};
  for (int k = 0; k < 3; ++k) velocity -= (side ? -drift[k] : drift[k]) * DD{contact.normal[k], 0};
  for (int k = 0; contact.wall[side] >= 0 && k < 6; ++k)
    velocity += assembly.walls[contact.wall[side]].x[BODY_VELOCITY_X + k] * value(contact.jacobian[side][k]);
  return velocity;
}

// The loads >= 0 of nearly the same effect that are nearly the nearest to a target: those that minimise the square of the
// difference in the effect, plus SHARING times that of the distance. Walls that move apart are one more body, which their
// work moves. Only the contacts `among` have any.
Vector share_nearly(const Assembly& assembly, const Vector& loads, const List<int>& among, const Vector& target) {
  const int walls = assembly.body_count;
  const double greatest = greatest_of(loads);
  double fastest = 0, mean_mass = 0;
  for (int i : among) {
    const AssembledContact& contact = assembly.contacts[i];
    fastest = std::fmax(fastest, std::fabs(high(contact.velocity)) * contact.scale);
    mean_mass += contact.unit() * contact.unit() / static_cast<double>(among.size());
  }
  Cones<DD> programme(walls + assembly.walls_move_apart);
  for (int i : among) {
    const AssembledContact& contact = assembly.contacts[i];
    programme.cones.push_back(cone_of(contact, assembly.axes_of<DD>(contact), 1, 1 / mean_mass));
    programme.cones.back().mu = 0;
    programme.P.push_back({DD{loads[i] / greatest, 0}, DD{}, DD{}});
  }
  const Walls moving(assembly, loads, programme.cones);
  for (size_t k = 0; k < among.size() && fastest > 0; ++k)
    for (int side = 0; side < 2; ++side) {
      const AssembledContact& contact = assembly.contacts[among[k]];
      Cone<DD>& cone = programme.cones[k];
      if (contact.body[side] >= 0) {
        moving.stretch(cone, contact, side, fastest);
      } else if (assembly.walls_move_apart) {
        cone.body[side] = walls;
        cone.row[side][0][0] = contact.scale / fastest * wall_velocity(assembly, contact, side, moving.drift);
      }
    }
  programme.aim_at(programme.motion());
  programme.prepare();
  List<std::array<DD, 3>> from;
  for (int i : among) from.push_back({DD{target[i] / greatest, 0}, DD{}, DD{}});
  programme.solve_from(1 / SHARING, from);
  Vector shared(assembly.count);
  for (size_t k = 0; k < among.size(); ++k) shared[among[k]] = programme.P[k][0].h * greatest;
  return shared;
}

constexpr double NO_SHARE = 1e-8;  // components of impulses that do nothing

// Which part contacts take whose loads rounding may decide, relative to the greatest load: none up to `none`, where the
// load may be all rounding, and the full part from `full` on. Both limits grow as contacts depend on each other more
// nearly; of those that depend so nearly that half of the digits are lost, any load may be rounding. Next to these, a
// projection is known to half of the digits: the gap, which is rounded, bounds the square of its error.
struct RoundedLoads {
  Vector none, full;

  explicit RoundedLoads(const Assembly& assembly) : none(assembly.count, INFINITY), full(assembly.count, INFINITY) {
    constexpr double ROUNDING = 0x1p-72, ROUNDING_OF_PROJECTION = 0x1p-50;
    ActiveSet<DD> basis(assembly.couplings<DD>().data(), assembly.count);
    const List<int> dependent = basis.span(assembly.all_contacts(), NEARLY_DEPENDENT);
    const List<DD> diagonal = basis.diagonal_of_inverse();
    for (size_t k = 0; k < diagonal.size(); ++k) {
      none[basis.members[k]] = dependent.empty() ? 0 : ROUNDING_OF_PROJECTION * std::sqrt(diagonal[k].h);
      full[basis.members[k]] = ROUNDING * diagonal[k].h;
    }
    List<DD> w;
    for (int i : dependent) {
      basis.line(i, w);
      for (size_t k = 0; k < w.size(); ++k)
        if (std::fabs(w[k].h) > NO_SHARE) full[basis.members[k]] = INFINITY;
    }
  }
  double part_of(int contact, double load) const { return load > none[contact] ? load / full[contact] : 0; }
};

// For each contact the greatest load of a body: of that of its two bodies which has less.
Vector loads_nearby(const Assembly& assembly, const Vector& loads) {
  Vector nearby(assembly.count, INFINITY), most(assembly.body_count);  // most: the greatest load of each body
  for (int i = 0; i < assembly.count; ++i)
    for (int body : assembly.contacts[i].body)
      if (body >= 0) most[body] = std::fmax(most[body], loads[i]);
  for (int i = 0; i < assembly.count; ++i)
    for (int body : assembly.contacts[i].body)
      if (body >= 0) nearby[i] = std::fmin(nearby[i], most[body]);
  return nearby;
}

// Loads that are shared, and half of those that contacts without any could have as well: contacts of one face, whose loads
// decide nothing but how friction is spread. nearest(target) gives the loads of the same effect that are nearest to a target.
template <class Nearest>
Vector possible_loads(const Assembly& assembly, Vector loads, double least, const Nearest& nearest) {
  constexpr double TILT = 4.5e-7;  // of normals of one face
  constexpr double FAR = 100;  // a target beyond any load, relative to the greatest
  const List<AssembledContact>& contacts = assembly.contacts;
  const double greatest = greatest_of(loads), limit = least * greatest;
  auto may_share = [&](int i) {
    for (int j = 0; j < assembly.count; ++j)
      if (loads[j] > limit && contacts[i].mu == contacts[j].mu && are_on_one_face(assembly, i, j, TILT)) return true;
    return false;
  };
  for (;;) {
    Vector target(assembly.count);
    for (int i = 0; i < assembly.count; ++i)
      if (!(loads[i] > limit) && may_share(i)) target[i] = FAR * greatest;
    if (!(greatest_of(target) > 0)) return loads;
    const Vector other = nearest(target);
    bool is_more = false;
    for (int i = 0; i < assembly.count; ++i)
      if (target[i] > 0 && other[i] > 2 * limit) {
        loads[i] = other[i] / 2;
        is_more = true;
      }
    if (!is_more) return loads;
  }
}

constexpr double LEAST_PART = 1e-6;  // smaller parts are none

// The loads where impulses that do nearly nothing share them, too, and those that contacts could have as well.
struct NearlyShared {
  Vector possible, nearby;
  double least;  // sharing gives loads of about SHARING to bodies that have hardly any

  NearlyShared(const Assembly& assembly, const Vector& loads, const List<int>& touched)
      : least(SHARING / LEAST_PART * greatest_of(loads)) {
    auto nearest = [&](const Vector& target) { return share_nearly(assembly, loads, touched, target); };
    const Vector shared = nearest(Vector(assembly.count));
    possible = possible_loads(assembly, shared, LEAST_PART, nearest);
    nearby = loads_nearby(assembly, shared);
  }
  double part_of(int contact) const { return possible[contact] / std::fmax(nearby[contact], least); }
};

}  // namespace

bool are_on_one_face(const Assembly& assembly, int i, int j, double tilt) {
  const AssembledContact &one = assembly.contacts[i], &other = assembly.contacts[j];
  double product = 0;
  for (int k = 0; k < 3; ++k) product += one.normal[k] / one.length * (other.normal[k] / other.length);
  auto same = [&](int a, int b) {
    if (one.body[a] != other.body[b]) return false;
    const int wall = one.wall[a], by = other.wall[b];
    return wall == by || (wall >= 0 && by >= 0 && assembly.walls[wall].moves_like(assembly.walls[by]));
  };
  if (same(0, 1) && same(1, 0)) product = -product;
  else if (!(same(0, 0) && same(1, 1))) return false;
  return product > 1 - tilt * tilt / 2;
}

SharedLoads share_loads(const Assembly& assembly, const List<DD>& p, const List<char>& parting) {
  constexpr double SMALL = 1e-10;  // a load, relative to those of its bodies
  constexpr double NEVER_ROUNDING = 1e-6;  // a load, also relative: from here on, rounding does not decide it
  constexpr double NO_LOAD = 1e-20;  // relative to the greatest: where impulses cancel, it is rounding
  const int count = assembly.count;
  List<DD> shared = p;
  const NullImpulses null = null_impulses(assembly);
  if (!null.basis.empty()) minimise_norm(assembly, shared, null.basis, NO_SHARE);
  auto is_independent = [&](int i) {
    const double none = NO_SHARE * assembly.contacts[i].scale;
    return std::all_of(null.basis.begin(), null.basis.end(),
                       [&](const List<DD>& z) { return std::fabs(z[i].h) < none; });
  };
  Vector loads = loads_of(assembly, shared);
  auto nearest = [&](const Vector& target) {
    Vector impulses = target;
    for (int i = 0; i < count; ++i) impulses[i] *= assembly.contacts[i].scale;
    List<DD> other = shared;
    minimise_norm(assembly, other, null.basis, NO_SHARE, impulses);
    return loads_of(assembly, other);
  };
  Vector possible = null.basis.empty() ? loads : possible_loads(assembly, loads, SMALL, nearest);
  const double greatest = greatest_of(loads), no_load = NO_LOAD * greatest;
  // A body without a load has none to share. Where p leaves it without, its share may be rounding.
  Vector sure = loads_of(assembly, p);
  for (int i = 0; i < count; ++i)
    if (loads[i] > SMALL * greatest) sure[i] = std::fmax(sure[i], loads[i]);
  const Vector given = loads_nearby(assembly, sure);
  List<int> touched;  // contacts of bodies that all have a load
  for (int i = 0; i < count; ++i) {
    if (given[i] > no_load) touched.push_back(i);
    else loads[i] = possible[i] = 0;
  }
  SharedLoads result{possible, greatest, Vector(count)};
  const Vector nearby = loads_nearby(assembly, loads);
  std::optional<RoundedLoads> rounded;  // found if needed
  std::optional<NearlyShared> nearly;  // the same
  for (int i = 0; i < count; ++i) {
    const double exactly = possible[i] / std::fmax(nearby[i], no_load);
    double part = exactly > SMALL && possible[i] > no_load;
    if (exactly < NEVER_ROUNDING && loads[i] > 0 && is_independent(i)) {
      if (!rounded) rounded.emplace(assembly);
      part = rounded->part_of(i, loads[i] / greatest);
    }
    if (!(part >= 1) && given[i] > no_load) {
      if (!nearly) nearly.emplace(assembly, loads, touched);
      part = std::fmax(part, nearly->part_of(i));
    }
    if (parting[i]) part = 0;
    result.part[i] = part > LEAST_PART ? std::fmin(part, 1) : 0;
  }
  // Loads that small differences decide are known to few digits, those that are nearly shared to all.
  for (int i = 0; i < count && nearly; ++i)
    if (result.part[i] >= 1) result.loads[i] = nearly->possible[i];
  return result;
}
