// Generalised reflections for one cluster, in double-double with a bound: see reflections.py, which says what is
// computed and does it in rationals.
#pragma once
#include "assembly.hpp"

enum class Outcome { ANSWERED, CONTRADICTORY, ENDLESS };

struct Struck {
  Outcome outcome = Outcome::ANSWERED;
  std::vector<DD> p;           // impulses along the normals
  double error = 0;            // of the velocities, in the metric of kinetic energy
  double margin = INFINITY;    // the least distance of a decision from its threshold, relative to the fastest approach
  double restitution = -1;     // of all contacts; -1: nothing approaches
};

struct Speed {  // of the fastest approach [m/s]
  double most = 0, error = 0;
};

inline Speed approach(const Assembly& scene) {
  Speed speed;
  for (const Touch& touch : scene.touches) {
    double own = -high(touch.velocity) / touch.length;
    speed.most = std::fmax(speed.most, own);
    speed.error = std::fmax(speed.error, width(touch.velocity) / touch.length + std::fabs(own) * 0x1p-50);
  }
  return speed;
}

class Reflections {
 public:
  Reflections(const Assembly& assembly, double threshold, int budget) : scene(assembly), part(threshold), most(budget) {}

  Struck struck() {
    Struck result;
    const std::vector<DD> zero(scene.count, DD{0, 0});
    result.p = zero;
    Speed speed = approach(scene);
    if (!(speed.most > 0)) return result;
    Assembly::Projection first = scene.project(zero.data(), scene.all(), nullptr);
    if (first.found != Found::LEAST) return failed(Outcome::CONTRADICTORY);
    double e_error, rounding, more;
    double e = joined_restitution(first.q, e_error);
    std::vector<DD> inelastic = combined(1, zero, 1, first.q, rounding);
    double error_P = first.error + rounding;
    result.restitution = e;
    if (!(e > 0)) {
      result.p = inelastic;
      result.error = error_P;
      return result;
    }
    std::vector<DD> p = zero;
    double error = 0;
    std::vector<int> violated;
    for (int turn = 0;; ++turn) {
      if (turn == most) return failed(Outcome::ENDLESS);
      double near;
      bool certain = decide(p, error, part * speed.most, part * speed.error, violated, near);
      result.margin = std::fmin(result.margin, near / speed.most);
      if (!certain) error = INFINITY;
      if (violated.empty()) break;
      Assembly::Projection own;
      bool is_first = turn == 0 && static_cast<int>(violated.size()) == scene.count;
      if (!is_first) own = scene.project(p.data(), violated, nullptr);
      const Assembly::Projection& next = is_first ? first : own;
      if (next.found != Found::LEAST) return failed(Outcome::CONTRADICTORY);
      double q_error = is_first ? error_P : next.error;
      p = combined(1, p, 2, next.q, rounding);
      error += 2 * q_error + rounding;
    }
    std::vector<DD> elastic = combined(1, p, -1, inelastic, rounding);
    p = combined(1, inelastic, e, elastic, more);
    error = e * error + (1 - e) * error_P + rounding + more;
    if (e_error != 0) error += e_error * size(elastic);
    if (approaching(p, error)) {  // slower than the threshold
      Assembly::Projection last = scene.project(p.data(), scene.all(), nullptr);
      if (last.found != Found::LEAST) return failed(Outcome::CONTRADICTORY);
      p = combined(1, p, 1, last.q, rounding);
      error += last.error + rounding;
    }
    result.p = p;
    result.error = error;
    return result;
  }

 private:
  const Assembly& scene;
  double part;  // of the fastest approach: a slower one does not count
  int most;

  static Struck failed(Outcome outcome) {
    Struck none;
    none.outcome = outcome;
    return none;
  }

  // The contacts of velocity below -limit, and the least distance of a velocity from it. Whether that is more than is
  // not known of it.
  bool decide(const std::vector<DD>& p, double error, double limit, double doubt, std::vector<int>& violated, double& margin) const {
    std::vector<N> u = scene.velocities(p.data());
    violated.clear();
    margin = INFINITY;
    bool decided = true;
    for (int i = 0; i < scene.count; ++i) {
      const Touch& touch = scene.touches[i];
      N off = u[i] + exact(limit) * exact(touch.length);  // the length is rounded, as limit is
      double known = width(off) + error / touch.scale + (doubt + limit * 0x1p-50) * touch.length;
      double distance = std::fabs(high(off));
      decided = decided && (distance > known || (known == 0 && error == 0));
      margin = std::fmin(margin, distance / touch.length);
      if (high(off) < 0) violated.push_back(i);
    }
    return decided;
  }

  // Whether some contact approaches, beyond doubt.
  bool approaching(const std::vector<DD>& p, double error) const {
    std::vector<N> u = scene.velocities(p.data());
    for (int i = 0; i < scene.count; ++i)
      if (high(u[i]) < -width(u[i]) - error / scene.touches[i].scale) return true;
    return false;
  }

  // a p + b q, and what rounding does to the velocities.
  std::vector<DD> combined(double a, const std::vector<DD>& p, double b, const std::vector<DD>& q, double& rounding) const {
    std::vector<DD> sum(scene.count);
    std::vector<double> lost(scene.count);
    for (int i = 0; i < scene.count; ++i) {
      DD x = DD{a, 0} * p[i], y = DD{b, 0} * q[i];
      sum[i] = x + y;
      lost[i] = (std::fabs(x.h) + std::fabs(y.h)) * 0x1p-98;
    }
    rounding = scene.size_of(lost);
    return sum;
  }

  // At least the size of the velocities by impulses p, in the metric of kinetic energy.
  double size(const std::vector<DD>& p) const {
    std::vector<double> sizes(scene.count);
    for (int i = 0; i < scene.count; ++i) sizes[i] = std::fabs(p[i].h);
    return scene.size_of(sizes);
  }

  // Sum e u q / sum u q over the contacts that approach.
  double joined_restitution(const std::vector<DD>& q, double& error) const {
    N above = exact(0.0), below = exact(0.0);
    double least = 1, greatest = 0;
    for (int i = 0; i < scene.count; ++i) {
      const Touch& touch = scene.touches[i];
      if (!(high(touch.velocity) < 0) || q[i].h == 0) continue;
      N work = touch.velocity * exact(q[i]);
      above = above + work * exact(touch.e);
      below = below + work;
      least = std::fmin(least, touch.e);
      greatest = std::fmax(greatest, touch.e);
    }
    error = 0;
    if (!(high(below) < 0)) return 0;
    if (least == greatest) return least;
    N e = above / below;
    error = width(e) + 0x1p-53;
    return std::fmin(std::fmax(high(e), 0), 1);
  }
};
