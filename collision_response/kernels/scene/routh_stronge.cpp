// ROUTH_STRONGE for several contacts: the law of Liu, Zhao & Brogliato, as a differential equation in time.
//
// Each contact is a spring that gives back the fraction e^2 of the work it took, as in Stronge's law:
//
//     v' = M^-1 N f     f_i = k_i max(x_i, 0)^eta
//     x_i' = -u_i            while u_i < 0                 loading
//          = -u_i / e_i^2    while u_i > 0 and x_i > 0     unloading
//          = 0               else
//
// until all x_i are 0 and u >= 0. Only the ratios of the k_i matter. The exponent eta is 1 for linear springs and 3/2
// for Hertz's. For one contact u+ = -e u, for any k and eta. Friction opposes the slip, with at most mu f_i. So a
// contact loses (1 - e^2) of the work that compresses it, and friction takes its work along the path.
//
// The whole path is followed several times, with smaller and smaller errors allowed in a step, and the distance between
// the last two answers is the estimate of the error.
//
// A contact given twice is twice as stiff. The smaller e is, the more compressions a contact takes to end. Friction may
// wedge bodies, as in a corner of two walls with mu > 1: then springs stay compressed, and the path has no end. So it is
// with elastic contacts that press on each other.
//
// Source: Liu, Zhao & Brogliato, "Frictionless Multiple Impacts in Multibody Systems. I. Theoretical Framework", Proc.
// R. Soc. A 464 (2008).
#include "effect.hpp"
#include "laws.hpp"
#include "path_with_friction.hpp"
#include "path_without_friction.hpp"
#include "projection.hpp"

namespace {

constexpr const char* TOO_INELASTIC = "must be at least 0.05 for ROUTH_STRONGE in a cluster";

constexpr double WORST = 0.1;  // greatest error estimate that still counts as an answer

// Whether elastic contacts rattle for ever, such as those of a ball between two walls. Impulses p at them, all positive,
// have no effect. So sum p_i u_i keeps its value: 0, unless walls move apart. As e = 1, x_i' >= -u_i, so sum p_i x_i never
// decreases: if one of their springs is compressed, they are never all at rest.
bool rattles_for_ever(const Assembly& assembly) {
  if (!assembly.is_locked || assembly.walls_move_apart) return false;
  List<int> elastic;
  double fastest = 0;
  for (int i = 0; i < assembly.count; ++i) {
    if (assembly.contacts[i].e == 1) elastic.push_back(i);
    fastest = std::fmax(fastest, -assembly.contacts[i].axes[0].velocity);
  }
  const List<DD>& A = assembly.couplings<DD>();
  const Minimum<DD> minimum = minimise(A, List<DD>(assembly.count, {-1, 0}), elastic);
  if (minimum.status != MinimumStatus::UNBOUNDED) return false;
  auto approaches = [&](int i) { return -assembly.contacts[i].axes[0].velocity > WORST * fastest; };
  List<DD> w;  // p = -w, and 1 for the last one
  minimum.active.line(minimum.last, w);
  bool found = approaches(minimum.last);
  for (size_t k = 0; k < w.size(); ++k)
    found = found || (high(w[k]) < -UNMOVED<DD> && approaches(minimum.active.members[k]));
  return found;
}

struct FollowedPath : PathAnswer {
  Vector changes;  // of the twists of the movable bodies
  // Of the motion, relative to it: approaches too slow to count, which may matter to heavy bodies, and what was taken off
  // because it created energy.
  double left = 0;
};

// The length of a vector, whose squares may be beyond the range of doubles.
double size_of(const Vector& y) {
  double size = 0;
  for (double one : y) size = std::hypot(size, one);
  return size;
}

// The most motion that friction of a normal impulse causes: that of an impulse, or of its work on the slip, at first or
// at the end.
double most_by_friction(const Assembly& assembly, int i, double normal_impulse, const Motion& after) {
  const AssembledContact& contact = assembly.contacts[i];
  double square = 0, slip_before = 0, slip_after = 0;
  for (int axis = 1; axis < 3; ++axis) {
    slip_before = std::hypot(slip_before, contact.axes[axis].velocity);
    slip_after = std::hypot(slip_after, after.velocity(i, axis));
    for (const auto& side : contact.axes[axis].row) square += dot(side, side, 6);
  }
  const double most = 2 * contact.mu * normal_impulse;
  return std::fmin(most * std::sqrt(square), std::sqrt(2 * most) * std::sqrt(std::fmax(slip_before, slip_after)));
}

// How much motion is missing after impulses P, relative to theirs, because approaches that are too slow to count are
// left: at most twice what stops them all, as they may rebound, and the friction of these loads.
double motion_left(const Assembly& assembly, const List<Axes>& P) {
  Motion after(assembly);
  for (int i = 0; i < assembly.count; ++i) after.apply(i, P[i]);
  List<N> start;
  double alone = 0;  // what stops each by itself
  for (int i = 0; i < assembly.count; ++i) {
    const double u = after.velocity(i, 0);
    alone += 2 * std::fmax(-u, 0) * assembly.contacts[i].unit();
    start.push_back({{u * assembly.contacts[i].length, 0}, 0});
  }
  if (!(alone > 0)) return 0;
  const Projection stop = project(assembly, start, assembly.all_contacts());
  const double size = size_of(after.y);
  if (stop.status != MinimumStatus::FOUND) return alone / size;  // between walls
  Motion by_stop(assembly);
  double friction = 0;
  for (int i = 0; i < assembly.count; ++i) {
    const double normal_impulse = std::fabs(stop.q[i].h) * assembly.contacts[i].length;
    by_stop.apply(i, {normal_impulse, 0, 0});
    friction += most_by_friction(assembly, i, normal_impulse, after);
  }
  return (2 * size_of(by_stop.y) + friction) / size;
}

template <class Path>
FollowedPath answer_of(const Assembly& assembly, const Path& path) {
  FollowedPath answer;
  List<Axes> P = path.impulses();
  const double part = path.part_without_gain(P);
  for (Axes& one : P)
    for (double& along : one) along = path.in_newton_seconds(part * along);
  answer.impulses = with_axis_impulses({}, assembly, P);
  if (!Path::HAS_FRICTION) answer.impulses.tangential.clear();
  const ImpulseEffect effect = effect_of(assembly, answer.impulses, true);
  answer.changes = effect.changes;
  answer.rounding = effect.error_bound;
  answer.left = motion_left(assembly, P) + (1 - part);
  // No loss is negative, by the errors of the path and the rounding of this sum.
  const double lost = (effect.energies[LOST_TO_RESTITUTION] + effect.energies[LOST_TO_FRICTION]) * (1 - 0x1p-51);
  answer.friction_loss = std::fmin(std::fmax(path.friction_loss, 0), lost);
  return answer;
}

// How far twist changes are from a reference, relative to that, in the norm of error_bound.
double relative_distance(const Assembly& assembly, const Vector& changes, const Vector& reference) {
  double distance = 0, size = 0;
  for (int b = 0; b < assembly.body_count; ++b) {
    double off[6];
    for (int k = 0; k < 6; ++k) off[k] = changes[6 * b + k] - reference[6 * b + k];
    distance = std::hypot(distance, twist_size(assembly.bodies[b].x, off));
    size = std::hypot(size, twist_size(assembly.bodies[b].x, &reference[6 * b]));
  }
  return distance == 0 ? 0 : size > 0 ? distance / size : INFINITY;
}

// Follow the path more and more exactly. `wanted`: greatest relative error wanted; 0 for Path::ENOUGH.
template <class Path>
PathAnswer follow(const Assembly& assembly, const SpringOptions& options, double wanted) {
  constexpr double FINEST = 1e-13;  // least error allowed in a step, relative to the motion
  constexpr int LEAST_PATHS = 3;  // two may be close to each other, or wedged, by chance
  constexpr double COARSEST_RATIO = 0.5;  // a path whose error is not smaller by this factor tells nothing new
  // The work of a path grows at least with the square root of the refinement, times this.
  constexpr double GROWTH = 1.25;
  // Part of the work for the first path. If it needs more, none is left for another one.
  const double first_part = 1 / (1 + GROWTH / std::sqrt(COARSEST_RATIO));

  if (!(wanted > 0)) wanted = Path::ENOUGH;
  long work = options.work;
  double tolerance = Path::FIRST_TOLERANCE, ratio = Path::LEAST_RATIO;  // of a step; that of one path to the next
  double change = 0;
  int paths = 0, wedged = 0;  // wedged: in a row
  FollowedPath last;
  while (tolerance >= FINEST && wedged < LEAST_PATHS && (paths < LEAST_PATHS || last.error > wanted)) {
    const long given = paths > 0 ? work : static_cast<long>(first_part * static_cast<double>(work));
    Path path(assembly, options, tolerance, given);
    const bool has_ended = path.follow();
    const long used = given - path.work;
    work -= used;
    if (!has_ended && !path.is_wedged) break;
    if (path.is_wedged) {
      ++wedged;
      last.fault = "friction wedges the bodies: springs stay compressed, and their impulses have no end";
    } else {
      wedged = 0;
      FollowedPath found = answer_of(assembly, path);
      if (paths > 0) {
        // A change may be small by chance, so it counts for no less than the one before predicts.
        change = std::fmax(relative_distance(assembly, last.changes, found.changes), change * ratio);
        found.error = 2 * change + tolerance + path.rounding + found.left;
        if (!(path.step_errors <= Path::LARGEST_SUM)) found.error = INFINITY;
      }
      last = std::move(found);
      ++paths;
    }
    const double growth = GROWTH * static_cast<double>(used) / static_cast<double>(std::max(work, 1L));
    ratio = std::fmax(Path::LEAST_RATIO, growth * growth);
    if (ratio > COARSEST_RATIO) break;
    tolerance *= ratio;
  }
  if (!last.fault && !(last.error <= WORST)) last.fault = "the path of the impulses did not settle within its budget";
  return last;
}

}  // namespace

PathAnswer follow_springs(const Assembly& assembly, const SpringOptions& options, bool has_friction, double wanted) {
  const List<AssembledContact>& contacts = assembly.contacts;
  auto separates = [](const AssembledContact& contact) { return contact.axes[0].velocity >= 0; };
  auto is_less_elastic = [](const AssembledContact& a, const AssembledContact& b) { return a.e < b.e; };
  PathAnswer answer;
  if (std::all_of(contacts.begin(), contacts.end(), separates)) {
    answer.impulses.normal.resize(assembly.count);
    answer.error = 0;
    return answer;
  }
  const auto least = std::min_element(contacts.begin(), contacts.end(), is_less_elastic);
  if (least->e < LEAST_SPRING_RESTITUTION) {
    answer.fault = TOO_INELASTIC;
    answer.faulty = static_cast<int>(least - contacts.begin());
    return answer;
  }
  if (rattles_for_ever(assembly)) {
    answer.fault = "elastic contacts press on each other: they rattle for ever";
    return answer;
  }
  return has_friction ? follow<PathWithFriction>(assembly, options, wanted)
                      : follow<PathWithoutFriction>(assembly, options, wanted);
}
