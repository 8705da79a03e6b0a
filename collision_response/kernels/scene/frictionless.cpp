// FRICTIONLESS: generalised reflections in double-double. scene/frictionless.py derives them, and computes them in
// fractions by the same steps.
#include <map>
#include <optional>

#include "laws.hpp"
#include "least_norm.hpp"
#include "projection.hpp"
#include "projection_bound.hpp"

namespace {

constexpr size_t KEPT_SETS = 200;  // of contacts, as each takes memory for all contacts

constexpr double ROUNDING = 0x1p-50;  // of a few operations in doubles
constexpr double ROUNDING_OF_IMPULSES = 0x1p-98;  // of a sum in double-double

struct Reflections {
  const Assembly& assembly;
  bool is_fine = false;  // with bounds from the contacts that press in each projection, in double-double: slow
  std::optional<ProjectionBound<double>> projection_bound{};  // from the first projection on
  // Light bodies between heavy ones project the same contacts again and again.
  std::map<List<int>, List<int>> last_active{};  // of each set of contacts, in its last projection
  std::map<List<int>, ProjectionBound<DD>> fine_bounds{};  // by the contacts of the basis

  ClusterImpulses resolve(double threshold) {
    ClusterImpulses result;
    List<DD>& p = result.normal;
    p.resize(assembly.count);
    double speed = 0, doubt = 0;  // the speed of the fastest approach, and a bound on its error
    for (const AssembledContact& contact : assembly.contacts) {
      double approach = -high(contact.velocity) / contact.length;
      speed = std::fmax(speed, approach);
      doubt = std::fmax(doubt, width(contact.velocity) / contact.length + std::fabs(approach) * ROUNDING);
    }
    if (!(speed > 0)) return result;
    if (!is_fine) projection_bound.emplace(assembly, assembly.all_contacts());
    List<N> u = assembly.velocities(p.data());
    const Projection first = project_from(u, assembly.all_contacts());
    if (first.status != MinimumStatus::FOUND) return {false};
    double e_error;
    const DD e = joined_restitution(first, e_error);
    result.restitution = e.h;
    double error = 0;
    for (const N& velocity : first.r) result.stopped.push_back(high(velocity));
    auto inelastic = [&] {
      p = first.q;
      for (int i = 0; i < assembly.count; ++i) result.stopped[i] = high(first.r[i]);
      result.no_rebound = result.restitution > 0;
      result.restitution = 0;
      result.error = e_error < INFINITY && error < INFINITY ? first.error : INFINITY;
      return result;
    };
    if (!(result.restitution > 0) || assembly.is_locked) return inelastic();
    for (int turn = 0;; ++turn) {
      if (turn == REFLECTIONS) return inelastic();
      const Violations seen = find_violations(u, error, threshold * speed, threshold * doubt);
      if (!seen.is_certain) error = result.error = INFINITY;
      if (!seen.is_certain && !is_fine) return result;  // finer bounds may tell
      result.margin = std::fmin(result.margin, seen.margin / speed);
      if (seen.violated.empty()) break;
      bool is_first = turn == 0 && static_cast<int>(seen.violated.size()) == assembly.count;
      Projection next = is_first ? first : project_from(u, seen.violated);
      if (next.status != MinimumStatus::FOUND) return {false};
      double rounding = add(p, 2, next.q);
      error += 2 * next.error + rounding;
      for (int i = 0; i < assembly.count; ++i) {
        const bool is_violated = std::binary_search(seen.violated.begin(), seen.violated.end(), i);
        result.stopped[i] = std::fmin(result.stopped[i], high(is_violated ? next.r[i] : u[i]));
      }
      u = assembly.velocities(p.data());
    }
    // e p_GR + (1 - e) p_P
    double rounding = add(p, -1, first.q);
    const double by_restitution = assembly.velocity_size(p.data());
    if (e_error > 0 && by_restitution > 0) error += e_error * by_restitution;
    for (DD& x : p) x = e * x;
    result.error = result.restitution * error + (1 - result.restitution) * first.error + rounding +
                   assembly.velocity_size(p.data()) * ROUNDING_OF_IMPULSES;
    result.error += add(p, 1, first.q);
    u = assembly.velocities(p.data());
    if (std::any_of(u.begin(), u.end(), [](const N& one) { return high(one) < width(one); })) {
      // Some contact may approach, more slowly than the threshold.
      Projection last = project_from(u, assembly.all_contacts());
      if (last.status != MinimumStatus::FOUND) return {false};
      result.error += add(p, 1, last.q) + last.error;
    }
    return result;
  }

 private:
  Projection project_from(const List<N>& u, const List<int>& among) {
    if (last_active.size() == KEPT_SETS) last_active.clear();
    List<int>& active = last_active[among];
    Projection found = project(assembly, u, among, active);
    active = found.active;
    if (found.status != MinimumStatus::FOUND || !(found.error < INFINITY)) return found;
    found.error =
        std::fmin(found.error, is_fine ? fine_bound(among, found) : (*projection_bound)(among, found.q, found.r));
    return found;
  }
  double fine_bound(const List<int>& among, const Projection& found) {
    List<int> pressed;
    for (int i : among)
      if (found.q[i].h > 0) pressed.push_back(i);
    const double bound = bound_by(pressed)(among, found.q, found.r);
    // Contacts without load may hardly separate: then, all must be able to make up for residuals.
    return bound < INFINITY ? bound : bound_by(among)(among, found.q, found.r);
  }
  const ProjectionBound<DD>& bound_by(const List<int>& those) {
    if (fine_bounds.size() == KEPT_SETS) fine_bounds.clear();
    return fine_bounds.try_emplace(those, assembly, those).first->second;
  }

  // The restitution of the contacts that approach, 0 if there are none; nothing if they have several.
  std::optional<double> equal_restitution(const List<int>& among) const {
    double least = 1, most = 0;
    for (int i : among) {
      const AssembledContact& contact = assembly.contacts[i];
      if (!(high(contact.velocity) < 0)) continue;
      least = std::fmin(least, contact.e);
      most = std::fmax(most, contact.e);
    }
    if (least >= most) return most;
    return {};
  }

  // The contacts that may have an impulse in the first projection: the others separate.
  List<int> pressed_by(const Projection& first) const {
    const List<N> after = assembly.velocities(first.q.data());
    List<int> pressed;
    for (int i = 0; i < assembly.count; ++i)
      if (!(high(after[i]) > width(after[i]) + first.error / assembly.contacts[i].scale)) pressed.push_back(i);
    return pressed;
  }

  // The restitution of the cluster: sum e u q / sum u q over the contacts that approach, for the q of least norm. For
  // another q, e would depend on the order of the contacts.
  DD joined_restitution(const Projection& first, double& error) const {
    constexpr double GREATEST_DOUBT = 0x1p-30;
    error = 0;
    if (const auto e = equal_restitution(assembly.all_contacts())) return {*e, 0};
    const List<int> pressed = pressed_by(first);
    if (const auto e = equal_restitution(pressed)) return {*e, 0};
    List<DD> shared = first.q;
    const NullImpulses null = null_impulses(assembly);
    const bool is_unique = null.basis.empty();
    const bool is_known = is_unique || minimise_norm(assembly, shared, null.basis);
    // In units near the greatest, because the works may be out of the range of doubles.
    double fastest = 0, greatest = 0;
    for (int i = 0; i < assembly.count; ++i) {
      fastest = std::fmax(fastest, -high(assembly.contacts[i].velocity));
      greatest = std::fmax(greatest, first.q[i].h);
    }
    if (!(greatest > 0)) return {};
    const double unit = power_near(fastest), load = power_near(greatest);
    N above = exact(0.0), below = exact(0.0);
    for (int i : pressed) {
      const AssembledContact& contact = assembly.contacts[i];
      if (!(high(contact.velocity) < 0)) continue;
      const N& u = contact.velocity;
      const DD& p = shared[i];
      N work = N{{u.value.h / unit, u.value.l / unit}, u.error / unit} * exact(DD{p.h / load, p.l / load});
      above = above + work * exact(contact.e);
      below = below + work;
    }
    if (!(high(below) < 0)) return {};
    const N e = above / below;
    auto lost = [&](int i) {  // (e_i - e) u_i
      const AssembledContact& contact = assembly.contacts[i];
      return (contact.e - high(e)) * (std::fmin(high(contact.velocity), 0) / unit);
    };
    // How far the works may be from those for the exact q*:
    //     sum (e_i - e) u_i (q*_i - q_i) = z.A (q* - q) <= sqrt(z.A z) |M^-1 N (q* - q)|    for A z = (e_i - e) u_i
    ActiveSet<DD> basis(assembly.couplings<DD>().data(), assembly.count);
    const bool depends = !basis.span(pressed, NEXT_TO_NOTHING).empty();
    List<DD> z;
    for (int i : basis.members) z.push_back({lost(i) * assembly.contacts[i].scale, 0});
    const List<DD> c(z);
    basis.solve(z.data());
    double square = 0;
    for (size_t k = 0; k < c.size(); ++k) square += high(c[k] * z[k]);
    double doubt = first.error / load * std::sqrt(square) / -high(below);
    // If null impulses do little, but not nothing, these contacts may not be free to share their load evenly. If others
    // depend on each other too nearly, there may be another load to share.
    if (!(null.are_exact && basis.last_pivot() >= NEARLY_DEPENDENT))
      for (const List<DD>& one : null.basis) {
        double work = 0, size = 0;
        for (int i : pressed) {
          work += lost(i) * one[i].h;
          size = std::fmax(size, std::fabs(one[i].h));
        }
        if (size > 0) doubt += std::fabs(work) / size * (greatest / load) / -high(below);
      }
    error = width(e) + doubt;
    // These digits do not tell which contacts carry the load; fractions may.
    if ((depends && is_unique) || !is_known || doubt > GREATEST_DOUBT) error = INFINITY;
    return high(e) < 0 ? DD{} : high(e) > 1 ? DD{1, 0} : e.value;
  }

  struct Violations {
    List<int> violated;  // the contacts that approach at the limit or faster
    double margin = INFINITY;  // the least distance of a contact from the limit
    bool is_certain = true;  // whether the errors leave `violated` without doubt
  };
  Violations find_violations(const List<N>& u, double error, double limit, double doubt) const {
    Violations seen;
    for (int i = 0; i < assembly.count; ++i) {
      const AssembledContact& contact = assembly.contacts[i];
      N off = u[i] + exact(limit) * exact(contact.length);  // both the length and the limit are rounded
      double known = width(off) + error / contact.scale + (doubt + limit * ROUNDING) * contact.length;
      double distance = std::fabs(high(off));
      seen.is_certain = seen.is_certain && (distance > known || (known == 0 && error == 0));
      seen.margin = std::fmin(seen.margin, distance / contact.length);
      if (high(off) <= 0 && high(u[i]) < 0) seen.violated.push_back(i);
    }
    return seen;
  }

  // p += a q, for a power of two a. Returns a bound on the error that rounding causes in the velocities.
  double add(List<DD>& p, double a, const List<DD>& q) const {
    double lost = 0;
    for (int i = 0; i < assembly.count; ++i) {
      DD by{a * q[i].h, a * q[i].l};
      lost += (std::fabs(p[i].h) + std::fabs(by.h)) / assembly.contacts[i].scale;
      p[i] = p[i] + by;
    }
    return lost * ROUNDING_OF_IMPULSES;
  }
};

}  // namespace

ClusterImpulses reflections(const Assembly& assembly, double threshold) {
  const ClusterImpulses found = Reflections{assembly}.resolve(threshold);
  if (found.error < INFINITY || assembly.is_locked) return found;
  // Bounds leave open which contacts approach: finer ones may tell.
  return Reflections{assembly, true}.resolve(threshold);
}
