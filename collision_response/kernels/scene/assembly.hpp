// The contacts of one cluster: what an impulse along each normal does, in double-double with its error, and in
// plain doubles along the normal and two tangents.
//
// Impulses p are numbers of double-double, without error: they are what was chosen. What they do, v = v0 + M^-1 N p
// and u = u0 + A p, is computed from them with a bound, each time from the start.
#pragma once
#include "../numbers.hpp"
#include "active_set.hpp"
#include "column.hpp"
#include "sizes.hpp"

using N = Bounded<DD>;

INLINE N exact(DD x) { return {x, 0}; }
INLINE N exact(double x) { return {{x, 0}, 0}; }
template <class R> R digits(const N& x) {  // as many as R has
  if constexpr (is_scalar<R>) return high(x);
  else return value(x);
}
INLINE double width(const N& x) { return x.error * (1 + 0x1p-30); }

// Of the power of two that brings a normal or a quaternion into the middle of the range; 0 if it is there. Of normals
// as in resolve_cluster.py.
inline int exponent_of(const double* x, int count) {
  double largest = 0;
  for (int k = 0; k < count; ++k) largest = std::fmax(largest, std::fabs(x[k]));
  int exponent = 0;
  std::frexp(largest, &exponent);
  return std::abs(exponent) > 100 ? exponent : 0;
}

// The power of two below a size: what is divided by it keeps its digits.
inline double power_near(double size) { return size > 0 && size < INFINITY ? std::ldexp(1.0, std::ilogb(size)) : 1; }

template <class T>
struct Centre {  // a body as seen from its reference point, at x, which moves with v
  T numbers[CENTRE], x[3], v[3];
};

struct Given {  // a body
  double x[BODY];
  double energy;
  bool idle;
  Centre<N> centre;
  Centre<double> plain;
  // M^-1 = L L^T: a twist is L y, and |y| its size in the metric of kinetic energy.
  double root, turn[3][3], com[3];  // L: of velocities 1 / root(m), of moments

  bool movable() const { return x[0] < INFINITY; }
  bool moves() const {
    for (int k = 0; k < 6; ++k)
      if (x[IN_BODY_A_VELOCITY_X + k] != 0) return true;
    return false;
  }
  bool rests() const { return !movable() && !moves(); }
  void look() {
    fill(centre);
    fill(plain);
    const double* of = plain.numbers;
    root = std::sqrt(of[CENTRE_INVERSE_MASS]);
    std::copy(of + CENTRE_COM, of + CENTRE_COM + 3, com);
  }
  // L y
  void twist_of(const double* y, double* twist) const {
    for (int j = 0; j < 3; ++j) twist[3 + j] = turn[0][j] * y[3] + turn[1][j] * y[4] + turn[2][j] * y[5];
    const Axes at_centre = cross(twist + 3, com);
    for (int j = 0; j < 3; ++j) twist[j] = root * y[j] - at_centre[j];
  }
  template <class T>
  void fill(Centre<T>& seen) {
    T in[BODY];
    Report<T> motion[10];
    const double* turned = x + IN_BODY_A_ORIENTATION_X;
    const int exponent = exponent_of(turned, 4);
    for (int i = 0; i < BODY; ++i) in[i] = Make<T>::constant(x[i]);
    for (int k = 0; k < 4; ++k) in[IN_BODY_A_ORIENTATION_X + k] = Make<T>::constant(std::ldexp(turned[k], -exponent));
    ::centre<T>(in, seen.numbers, motion, &idle);
    energy = motion[0];
    for (int i = 0; i < 9; ++i) turn[i / 3][i % 3] = motion[1 + i];
    for (int k = 0; k < 3; ++k) {
      seen.x[k] = in[IN_BODY_A_POSITION_X + k];
      seen.v[k] = in[IN_BODY_A_VELOCITY_X + k];
    }
  }
};

struct Plain {  // one direction of one contact, in doubles: velocity + row.y
  double row[2][6], velocity;
};

struct Touch {
  int body[2];  // place among the movable ones, -1: immovable
  double point[3], normal[3], length, scale;  // scale: 1 / sqrt(n.K n)
  double e, mu, copies;           // how often it was given
  N reach[2][6], response[2][6];  // with the sign of the side
  N velocity;                     // before, times the length of the normal
  Plain plain[3];                 // along the unit normal and two tangents

  // These (Duff et al. 2017).
  std::array<Axes, 3> axes() const {
    double x = normal[0] / length, y = normal[1] / length, z = normal[2] / length;
    double sign = x < 0 ? -1 : 1, c = -1 / (sign + x), d = y * z * c;
    return {{{x, y, z}, {-(sign * y), 1 + sign * (y * y * c), sign * d}, {-z, d, sign + z * z * c}}};
  }
};

inline Vector rounded(const DD* p, int count) {
  Vector out(count);
  for (int i = 0; i < count; ++i) out[i] = p[i].h;
  return out;
}

struct Assembly {
  int count = 0, bodies = 0;
  std::vector<Touch> touches;
  std::vector<Given> given;      // the movable bodies
  Vector A;         // n.K n of all pairs, scaled to a diagonal of 1
  Vector room;      // of a velocity that parts all contacts: by how much, scaled
  double parting = 0;            // its size, in the metric of kinetic energy
  bool driven = false;           // a wall moves
  bool locked = false;           // there is no such velocity, as far as 32 digits can tell

  // What two bodies do at a contact. The places are of the movable ones.
  void add(const Given& a, const Given& b, int place_a, int place_b, const double* contact, double copies) {
    Touch touch{{place_a, place_b}};
    const int exponent = exponent_of(contact + 3, 3);
    for (int k = 0; k < 3; ++k) {
      touch.point[k] = contact[k];
      touch.normal[k] = std::ldexp(contact[3 + k], -exponent);
    }
    touch.e = contact[6];
    touch.mu = contact[7];
    touch.copies = copies;
    touch.length = std::sqrt(touch.normal[0] * touch.normal[0] + touch.normal[1] * touch.normal[1] + touch.normal[2] * touch.normal[2]);
    N direction[3], velocity[2];
    for (int k = 0; k < 3; ++k) direction[k] = exact(touch.normal[k]);
    const Given* both[2] = {&a, &b};
    const double *v_a = a.x + IN_BODY_A_VELOCITY_X, *v_b = b.x + IN_BODY_A_VELOCITY_X;
    const bool together = std::equal(v_a, v_a + 3, v_b);  // their velocity cancels, and leaves no rounding
    for (int side = 0; side < 2; ++side) {
      if (both[side]->rests()) {
        velocity[side] = exact(0.0);
        continue;
      }
      Centre<N> centre = both[side]->centre;
      if (together) std::fill_n(centre.v, 3, exact(0.0));
      velocity[side] = fill<N>(centre, touch, direction, side, touch.reach[side], touch.response[side]);
    }
    touch.velocity = velocity[0] - velocity[1];
    add_plain(both, touch);
    touches.push_back(touch);
    ++count;
  }

  // The same along unit vectors, in doubles.
  static void add_plain(const Given* const* both, Touch& touch) {
    const auto axes = touch.axes();
    for (int axis = 0; axis < 3; ++axis) {
      const double* n = axes[axis].data();
      double velocity[2] = {0, 0};
      for (int side = 0; side < 2; ++side) {
        const Given& body = *both[side];
        double* row = touch.plain[axis].row[side];
        if (body.rests()) continue;
        double reach[6], response[6];
        velocity[side] = fill<double>(body.plain, touch, n, side, reach, response);
        if (!body.movable()) continue;
        const Axes of_centre = cross(body.com, reach);
        double moment[3];  // about the centre of mass
        for (int k = 0; k < 3; ++k) moment[k] = reach[3 + k] - of_centre[k];
        for (int k = 0; k < 3; ++k) {
          row[k] = body.root * reach[k];
          row[3 + k] = body.turn[k][0] * moment[0] + body.turn[k][1] * moment[1] + body.turn[k][2] * moment[2];
        }
      }
      touch.plain[axis].velocity = velocity[0] - velocity[1];
    }
    touch.plain[0].velocity = high(touch.velocity) / touch.length;
  }

  template <class T>
  static T fill(const Centre<T>& body, const Touch& touch, const T* direction, int side, T* reach, T* response) {
    T in[CENTRE + 9], out[10];
    std::copy(body.numbers, body.numbers + CENTRE, in);
    for (int k = 0; k < 3; ++k) {
      in[CENTRE + k] = body.v[k];
      in[CENTRE + 3 + k] = Make<T>::constant(touch.point[k]) - body.x[k];
      in[CENTRE + 6 + k] = direction[k];
    }
    column<T>(in, out, nullptr, nullptr);
    std::copy(direction, direction + 3, reach);
    std::copy(out + 1, out + 4, reach + 3);
    std::copy(out + 4, out + 10, response);
    for (int k = 0; side && k < 6; ++k) {  // body_b gets the opposite
      reach[k] = -reach[k];
      response[k] = -response[k];
    }
    return out[0];
  }

  // After the last contact.
  void finish() {
    for (Touch& touch : touches) touch.scale = 1 / std::sqrt(coupling<double>(touch, touch));
    A = couplings<double>();
    for (int i = 0; i < count; ++i) A[i * count + i] = 1;
    locked = !part(A) && !part(couplings<DD>());
  }

  // n.K n of two contacts, by the bodies that they share.
  template <class R>
  static R coupling(const Touch& i, const Touch& j) {
    R sum{};
    for (int a = 0; a < 2; ++a)
      for (int b = 0; b < 2; ++b)
        if (i.body[a] >= 0 && i.body[a] == j.body[b])
          for (int k = 0; k < 6; ++k) sum = sum + digits<R>(i.reach[a][k]) * digits<R>(j.response[b][k]);
    return sum;
  }
  // Of all pairs, scaled.
  template <class R>
  std::vector<R> couplings() const {
    std::vector<R> matrix(static_cast<size_t>(count) * count);
    for (int i = 0; i < count; ++i)
      for (int j = 0; j <= i; ++j)
        matrix[i * count + j] = matrix[j * count + i] = coupling<R>(touches[i], touches[j]) * (constant<R>(touches[i].scale) * constant<R>(touches[j].scale));
    return matrix;
  }

  bool is_finite() const {
    auto is_number = [](double x) { return std::isfinite(x); };
    auto is_sound = [&](const Touch& touch) {
      return is_number(touch.scale) && std::all_of(touch.plain, touch.plain + 3, [&](const Plain& axis) { return is_number(axis.velocity); });
    };
    return std::all_of(touches.begin(), touches.end(), is_sound) && std::all_of(A.begin(), A.end(), is_number);
  }

  // Whether no impulse that stops the fastest approach by itself is below the least double.
  bool has_impulses() const {
    double fastest = 0;
    for (const Touch& touch : touches) fastest = std::fmax(fastest, -touch.plain[0].velocity);
    return std::all_of(touches.begin(), touches.end(), [&](const Touch& touch) {
      double speed = -touch.plain[0].velocity;
      return !(speed > 0 && speed >= fastest) || -high(touch.velocity) * touch.scale * touch.scale > 0;
    });
  }

  // Whether no contact seems to approach, and one may, by less than can be told.
  bool is_doubtful() const {
    auto approaches = [](const Touch& touch) { return high(touch.velocity) < 0; };
    auto may = [](const Touch& touch) { return high(touch.velocity) < width(touch.velocity); };
    return std::none_of(touches.begin(), touches.end(), approaches) && std::any_of(touches.begin(), touches.end(), may);
  }

  // The changes of the twists of the movable bodies.
  std::vector<N> changes(const DD* p) const {
    std::vector<N> twists(6 * static_cast<size_t>(bodies), exact(0.0));
    for (int i = 0; i < count; ++i) {
      if (p[i].h == 0) continue;
      for (int side = 0; side < 2; ++side)
        if (touches[i].body[side] >= 0) {
          N* twist = &twists[6 * touches[i].body[side]];
          for (int k = 0; k < 6; ++k) twist[k] = twist[k] + touches[i].response[side][k] * exact(p[i]);
        }
    }
    return twists;
  }

  N velocity_change(const Touch& touch, const std::vector<N>& twists) const {
    N sum = exact(0.0);
    for (int side = 0; side < 2; ++side)
      if (touch.body[side] >= 0)
        for (int k = 0; k < 6; ++k) sum = sum + touch.reach[side][k] * twists[6 * touch.body[side] + k];
    return sum;
  }

  // Normal velocities, times the lengths of the normals.
  std::vector<N> velocities(const DD* p) const {
    std::vector<N> u(count);
    for (int i = 0; i < count; ++i) u[i] = touches[i].velocity;
    if (std::all_of(p, p + count, [](const DD& x) { return x.h == 0; })) return u;
    std::vector<N> twists = changes(p);
    for (int i = 0; i < count; ++i) u[i] = u[i] + velocity_change(touches[i], twists);
    return u;
  }

  // At least |M^-1 N p|.
  double size_of(const DD* p) const {
    double sum = 0;
    for (int i = 0; i < count; ++i) sum += std::fabs(p[i].h) / touches[i].scale;
    return sum * (1 + 1e-9);
  }

  struct Projection {
    Found found;
    std::vector<DD> q;
    double error;  // of the velocities, in the metric of kinetic energy: bound
  };

  // The impulses q >= 0 of the contacts `among` that bring v nearest to v0 + M^-1 N p and give them velocities
  // u + offset >= 0; and how far from that they are.
  Projection project(const DD* p, const std::vector<int>& among, const N* offset) const {
    std::vector<N> start = velocities(p);
    if (offset)
      for (int i : among) start[i] = start[i] + offset[i];
    const Projection found = nearest(A, start, among);
    if (locked || found.error <= FINE * greatest(start, among)) return found;
    const Projection finer = nearest(couplings<DD>(), start, among);
    return finer.error < found.error ? finer : found;
  }
  static constexpr double FINE = 0x1p-32;  // doubles do better, where contacts are not nearly dependent

  double greatest(const std::vector<N>& u, const std::vector<int>& among) const {
    double most = 0;
    for (int i : among) most = std::fmax(most, std::fabs(high(u[i]) * touches[i].scale));
    return most;
  }

  // The same with active sets in the digits of R.
  template <class R>
  Projection nearest(const std::vector<R>& matrix, const std::vector<N>& start, const std::vector<int>& among) const {
    auto scale = [&](int j) { return constant<R>(touches[j].scale); };
    Projection result{Found::LEAST, std::vector<DD>(count), INFINITY};
    std::vector<DD>& q = result.q;
    std::vector<R> b(count);
    for (int i : among) b[i] = digits<R>(start[i]) * scale(i);
    Least<R> first = least(matrix, b, among);
    result.found = first.found;
    if (result.found != Found::LEAST) return result;
    ActiveSet<R>& active = first.active;
    for (int j : active.members) q[j] = lifted<DD>(first.x[j] * scale(j));

    std::vector<N> r(count);
    bool seen = false;  // r is that of q
    auto look = [&] {
      seen = true;
      std::vector<N> twists = changes(q.data());
      for (int i : among) r[i] = start[i] + velocity_change(touches[i], twists);
    };
    std::vector<R> y;
    for (int round = 0; round < 4 * count + 20; ++round) {
      for (int turn = 0; turn < 8; ++turn) {  // the active part, by Newton's method
        look();
        bool settled = true;
        y.clear();
        for (int j : active.members) {
          y.push_back(-digits<R>(r[j]) * scale(j));
          settled = settled && std::fabs(high(r[j])) <= 2 * r[j].error;
        }
        if (settled) break;
        active.solve(y.data());
        seen = false;
        for (size_t k = 0; k < y.size(); ++k) {
          int j = active.members[k];
          q[j] = q[j] + lifted<DD>(y[k] * scale(j));
        }
      }
      int worst = -1;
      for (size_t k = 0; k < active.members.size(); ++k) {
        int j = active.members[k], other = active.members[worst < 0 ? k : worst];
        if (q[j].h < 0 && (worst < 0 || q[j].h * touches[other].scale < q[other].h * touches[j].scale)) worst = static_cast<int>(k);
      }
      if (worst >= 0) {
        q[active.members[worst]] = DD{0, 0};
        active.drop(worst);
        continue;
      }
      int entering = -1;
      double most = 0;
      for (int i : among) {
        double slope = high(r[i]) * touches[i].scale;
        if (!active.has(i) && high(r[i]) < -8 * r[i].error && slope < most) {
          most = slope;
          entering = i;
        }
      }
      if (entering < 0) break;
      seen = false;
      Found found = enter(
          active, entering, digits<R>(r[entering]) * scale(entering),
          [&](int j, const R& by) { q[j] = high(by) == -INFINITY ? DD{0, 0} : q[j] + lifted<DD>(by * scale(j)); },
          [&](int j) { return digits<R>(exact(q[j])) / scale(j); });
      if (found != Found::LEAST) break;  // beyond what these digits can tell: the bound says so
    }
    for (DD& one : q)
      if (one.h < 0) {
        one = DD{0, 0};
        seen = false;
      }
    if (!seen) look();
    result.error = distance_from_least(among, q, start, r);
    return result;
  }

  // How far impulses q that leave velocities r are from those of project(), at most. With w the velocities reached, w*
  // those asked for, r = u(w):
  //
  //     |w - w*|^2 = (q - q*).(r - r*) <= q.r + q*.max(-r, 0)        q*.r* = 0, q.r* >= 0
  //     q*.rho <= |d| |w* - v|          for any velocity d that parts the contacts, N^T d = rho > 0
  double distance_from_least(const std::vector<int>& among, const std::vector<DD>& q, const std::vector<N>& start, const std::vector<N>& r) const {
    if (locked) return INFINITY;
    // In a unit near the size of the velocities: energies may be beyond doubles.
    const double unit = power_near(greatest(start, among));
    double gap = 0, far = 0, moved = 0;
    for (int i : among) {
      double low = high(r[i]) - width(r[i]), reach = std::fabs(high(r[i])) + width(r[i]);
      gap += q[i].h / unit * (1 + 1e-9) * (reach / unit);
      if (low < 0) far = std::fmax(far, -low * touches[i].scale / unit / room[i]);
      moved += q[i].h / unit * ((std::fabs(high(start[i])) + width(start[i])) / unit);
    }
    far *= parting;
    double distance = std::sqrt(moved);  // |w* - v|^2 <= -q.u
    return (far + std::sqrt(far * far + 4 * (gap + far * distance))) / 2 * (1 + 1e-9) * unit;
  }

  // The impulses that give all contacts velocities of at least -e min(u, 0).
  Projection rebound() const {
    std::vector<N> offset;
    for (const Touch& touch : touches) {
      double u = high(touch.velocity), doubt = width(touch.velocity);
      offset.push_back(u < 0 ? touch.velocity * exact(touch.e) : N{{0, 0}, u < doubt ? doubt : 0});
    }
    return project(std::vector<DD>(count).data(), all(), offset.data());
  }

  std::vector<int> all() const {
    std::vector<int> everyone(count);
    std::iota(everyone.begin(), everyone.end(), 0);
    return everyone;
  }

  // The few contacts that, as far as doubles can tell, no velocities keep all from approaching; or none.
  std::vector<int> contradiction() const {
    Vector b;
    for (const Touch& touch : touches) b.push_back(high(touch.velocity) * touch.scale);
    Least<double> end = least(A, b, all());
    if (end.found != Found::NO_LEAST) return {};
    end.active.members.push_back(end.last);
    return end.active.members;
  }

  // A velocity that parts all contacts: the least d with N^T d >= 1, scaled. To the digits of R; whether it does.
  template <class R>
  bool part(const std::vector<R>& matrix) {
    const Least<R> parted = least(matrix, std::vector<R>(count, constant<R>(-1)), all());
    if (parted.found != Found::LEAST) return false;
    std::vector<DD> d(count);
    for (int i = 0; i < count; ++i) d[i] = lifted<DD>(parted.x[i] * constant<R>(touches[i].scale));
    std::vector<N> twists = changes(d.data());
    room.resize(count);
    double square = 0;
    bool parts = true;
    for (int i = 0; i < count; ++i) {
      N rho = velocity_change(touches[i], twists);
      room[i] = (high(rho) - width(rho)) * touches[i].scale;
      square += d[i].h * (high(rho) + width(rho));
      parts = parts && room[i] > 0.5;
    }
    parting = std::sqrt(square) * (1 + 1e-9);
    return parts;
  }

  // Of all impulses that do the same, p + Z z >= 0, those of least sum of n.n p^2; `shared`: over all copies. Whether
  // there are others.
  bool least_norm(Vector& p, bool shared) const {
    double effect = 0;
    std::vector<Vector> Z = idle_impulses(DEPENDENT<double>, 1e-26, effect);
    if (Z.empty()) return false;
    share(p, shared, std::move(Z));
    return true;
  }

  // Of all impulses that do nearly the same as these of least norm, those; and what the difference is at most, for a load
  // of 1 of each contact, in the metric of kinetic energy.
  double nearly_least_norm(Vector& p) const {
    double effect = 0;
    std::vector<Vector> Z = idle_impulses(NEARLY_DEPENDENT, 1, effect);
    if (effect > 0x1p-50 * count) share(p, false, std::move(Z));
    return effect;
  }

 private:
  // Of p + Z z >= 0 that of least norm.
  void share(Vector& p, bool shared, std::vector<Vector> Z) const {
    Vector weight(count), P(count);
    for (int i = 0; i < count; ++i) {
      weight[i] = touches[i].length / (shared ? std::sqrt(touches[i].copies) : 1);
      P[i] = p[i] * weight[i];
      for (Vector& z : Z) z[i] *= weight[i];
    }
    for (auto z = Z.begin(); z != Z.end(); ++z) {  // orthonormal, twice is enough
      for (int turn = 0; turn < 2; ++turn)
        for (auto before = Z.begin(); before != z; ++before) increase(*z, -dot(*z, *before), *before);
      const double length = std::sqrt(dot(*z, *z));
      for (double& x : *z) {
        x /= length;
        if (std::fabs(x) < 0x1p-46) x = 0;  // rounding
      }
    }
    for (const Vector& z : Z) increase(P, -dot(z, P), z);
    // P + Z Z^T x >= 0, x >= 0: the same programme, scaled to a unit diagonal.
    auto rows = [&](int i, int j) {
      double sum = 0;
      for (const Vector& z : Z) sum += z[i] * z[j];
      return sum;
    };
    Vector b(count), s(count), dual(static_cast<size_t>(count) * count, 1);
    std::vector<int> among;
    double greatest = 0;
    for (int i = 0; i < count; ++i) {
      greatest = std::fmax(greatest, std::fabs(P[i]));
      const double square = rows(i, i);
      if (!(square > 1e-20)) continue;
      s[i] = 1 / std::sqrt(square);
      among.push_back(i);
    }
    for (int i : among)
      for (int j : among)
        if (i != j) dual[i * count + j] = rows(i, j) * s[i] * s[j];
    auto with_room = [&](double room) {
      for (int i : among) b[i] = (P[i] + room * greatest) * s[i];
      return least(dual, b, among);
    };
    Least<double> solved = with_room(0);
    // Where impulses are just 0, rounding may leave no solution without some room.
    if (solved.found != Found::LEAST) solved = with_room(1e-13);
    if (solved.found != Found::LEAST) return;
    const Vector& x = solved.x;
    for (const Vector& z : Z) {
      double along = 0;
      for (int i : among) along += z[i] * x[i] * s[i];
      increase(P, along, z);
    }
    for (int i = 0; i < count; ++i) p[i] = x[i] > 0 ? 0 : std::fmax(P[i] / weight[i], 0);
  }

  // Impulses that do next to nothing: one for each contact that depends on others, by pivots up to `dependent`. What they
  // do, squared, is less than `idle`; in all it is `effect`.
  std::vector<Vector> idle_impulses(double dependent, double idle, double& effect) const {
    // With a row for the work of walls that move, which the same impulses do as well.
    Vector u(count), B, scale(count);
    double fastest = 0;
    for (const Touch& touch : touches) fastest = std::fmax(fastest, std::fabs(high(touch.velocity)) * touch.scale);
    for (int i = 0; i < count; ++i) {
      u[i] = driven && fastest > 0 ? high(touches[i].velocity) * touches[i].scale / fastest : 0;
      scale[i] = touches[i].scale / std::sqrt(1 + u[i] * u[i]);
    }
    if (driven) {
      B = A;
      for (int i = 0; i < count; ++i)
        for (int j = 0; j < count; ++j) B[i * count + j] = i == j ? 1 : (A[i * count + j] + u[i] * u[j]) * scale[i] / touches[i].scale * scale[j] / touches[j].scale;
    }
    ActiveSet<double> basis(driven ? B.data() : A.data(), count);
    std::vector<Vector> found;
    Vector w;
    for (int i : basis.span(all(), dependent)) {
      std::vector<DD> z(count);
      basis.line(i, w);
      z[i].h = scale[i];
      for (size_t m = 0; m < w.size(); ++m) z[basis.members[m]].h = -w[m] * scale[basis.members[m]];
      // What doubles take for nothing is looked at in all digits.
      double square = 0;
      for (int turn = 0; turn < 2; ++turn) {
        std::vector<N> twists = changes(z.data());
        double work = 0;
        for (int n = 0; n < count; ++n) work += (z[n].h + z[n].l) * u[n] / touches[n].scale;
        square = work * work * 1e-6;  // which is known to doubles only
        for (int n = 0; n < count; ++n)
          if (z[n].h != 0) square += z[n].h * high(velocity_change(touches[n], twists));
        if (turn) break;
        for (size_t m = 0; m < w.size(); ++m) {
          int j = basis.members[m];
          w[m] = -(high(velocity_change(touches[j], twists)) + u[j] / touches[j].scale * work) * scale[j];
        }
        basis.solve(w.data());
        for (size_t m = 0; m < w.size(); ++m) z[basis.members[m]] = z[basis.members[m]] + DD{w[m] * scale[basis.members[m]], 0};
      }
      if (!(std::fabs(square) < idle)) continue;
      found.push_back(rounded(z.data(), count));
      effect += std::sqrt(std::fabs(square));
    }
    return found;
  }
};
