// Generalised reflections in double-double: what collision_response/scene/reflections.py writes down, and computes
// of fractions.
#pragma once
#include "struck.hpp"

struct Reflections {
  const Assembly& scene;

  Struck resolve(double threshold, long budget) const {
    Struck result;
    std::vector<DD>& p = result.p;
    p.resize(scene.count);
    double speed = 0, doubt = 0;  // of the fastest approach
    for (const Touch& touch : scene.touches) {
      double own = -high(touch.velocity) / touch.length;
      speed = std::fmax(speed, own);
      doubt = std::fmax(doubt, width(touch.velocity) / touch.length + std::fabs(own) * 0x1p-50);
    }
    if (!(speed > 0)) return result;
    const Assembly::Projection first = scene.project(p.data(), scene.all(), nullptr);
    if (first.found != Found::LEAST) return {Outcome::CONTRADICTORY, {}};
    double e_error;
    result.restitution = joined_restitution(first.q, e_error);
    if (!(result.restitution > 0)) {
      p = first.q;
      result.error = first.error;
      return result;
    }
    double error = 0;
    bool all_part = false;
    for (long turn = 0;; ++turn) {
      if (turn == budget) return {Outcome::ENDLESS, {}};
      const Seen seen = look(p.data(), error, threshold * speed, threshold * doubt);
      if (!seen.certain) error = INFINITY;
      result.margin = std::fmin(result.margin, seen.margin / speed);
      all_part = seen.all_part;
      if (seen.violated.empty()) break;
      bool is_first = turn == 0 && static_cast<int>(seen.violated.size()) == scene.count;
      Assembly::Projection next = is_first ? first : scene.project(p.data(), seen.violated, nullptr);
      if (next.found != Found::LEAST) return {Outcome::CONTRADICTORY, {}};
      double rounding = add(p, 2, next.q);
      error += 2 * next.error + rounding;
    }
    // e p_GR + (1 - e) p_P
    double rounding = add(p, -1, first.q);
    if (e_error > 0) error += e_error * scene.size_of(p.data());
    for (DD& x : p) x = DD{result.restitution, 0} * x;
    result.error = result.restitution * error + (1 - result.restitution) * first.error + rounding + scene.size_of(p.data()) * 0x1p-98;
    result.error += add(p, 1, first.q);
    if (!all_part && approaches(p.data(), result.error)) {  // slower than the threshold
      Assembly::Projection last = scene.project(p.data(), scene.all(), nullptr);
      if (last.found != Found::LEAST) return {Outcome::CONTRADICTORY, {}};
      result.error += add(p, 1, last.q) + last.error;
    }
    return result;
  }

 private:
  // sum e u q / sum u q over the contacts that approach, of the q of least norm: of others e would depend on the order.
  double joined_restitution(const std::vector<DD>& q, double& error) const {
    double least = 1, most = 0;
    error = 0;
    for (const Touch& touch : scene.touches) {
      if (!(high(touch.velocity) < 0)) continue;
      least = std::fmin(least, touch.e);
      most = std::fmax(most, touch.e);
    }
    if (least >= most) return most;
    Vector shared = rounded(q.data(), scene.count);
    bool is_unique = !scene.least_norm(shared, false);
    // In units near the greatest: works may be beyond doubles.
    double fastest = 0, greatest = 0;
    for (int i = 0; i < scene.count; ++i) {
      fastest = std::fmax(fastest, -high(scene.touches[i].velocity));
      greatest = std::fmax(greatest, q[i].h);
    }
    if (!(greatest > 0)) return 0;
    const double unit = power_near(fastest), load = power_near(greatest);
    N above = exact(0.0), below = exact(0.0);
    for (int i = 0; i < scene.count; ++i) {
      const Touch& touch = scene.touches[i];
      if (!(high(touch.velocity) < 0)) continue;
      const N& u = touch.velocity;
      const DD p = is_unique ? q[i] : DD{shared[i], 0};
      N work = N{{u.value.h / unit, u.value.l / unit}, u.error / unit} * exact(DD{p.h / load, p.l / load});
      above = above + work * exact(touch.e);
      below = below + work;
    }
    if (!(high(below) < 0)) return 0;
    N e = above / below;
    error = width(e) + (is_unique ? 0x1p-53 : 0x1p-36 * (most - least));  // least squares in doubles
    return std::fmin(std::fmax(high(e), 0), 1);
  }

  struct Seen {
    std::vector<int> violated;  // the contacts that approach at the limit or faster
    double margin = INFINITY;   // the least distance of one from that
    bool certain = true;        // all this
    bool all_part = true;       // to all digits
  };
  Seen look(const DD* p, double error, double limit, double doubt) const {
    Seen seen;
    std::vector<N> u = scene.velocities(p);
    for (int i = 0; i < scene.count; ++i) {
      const Touch& touch = scene.touches[i];
      N off = u[i] + exact(limit) * exact(touch.length);  // the length is rounded, as limit is
      double known = width(off) + error / touch.scale + (doubt + limit * 0x1p-50) * touch.length;
      double distance = std::fabs(high(off));
      seen.certain = seen.certain && (distance > known || (known == 0 && error == 0));
      seen.margin = std::fmin(seen.margin, distance / touch.length);
      if (high(off) <= 0 && high(u[i]) < 0) seen.violated.push_back(i);
      seen.all_part = seen.all_part && high(u[i]) >= 0;
    }
    return seen;
  }

  // Whether some contact approaches, beyond doubt.
  bool approaches(const DD* p, double error) const {
    std::vector<N> u = scene.velocities(p);
    for (int i = 0; i < scene.count; ++i)
      if (high(u[i]) < -width(u[i]) - error / scene.touches[i].scale) return true;
    return false;
  }

  // p += a q for a power of two; what rounding does to the velocities.
  double add(std::vector<DD>& p, double a, const std::vector<DD>& q) const {
    double lost = 0;
    for (int i = 0; i < scene.count; ++i) {
      DD by{a * q[i].h, a * q[i].l};
      lost += (std::fabs(p[i].h) + std::fabs(by.h)) / scene.touches[i].scale;
      p[i] = p[i] + by;
    }
    return lost * 0x1p-98;
  }
};
