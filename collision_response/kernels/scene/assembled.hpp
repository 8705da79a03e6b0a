// One body and one contact of a cluster, with the numbers that the arithmetic of the cluster needs.
#pragma once

#include "../numbers.hpp"
#include "column.hpp"
#include "constants.hpp"
#include "vectors.hpp"

using N = Bounded<DD>;

INLINE N exact(DD x) { return {x, 0}; }
INLINE N exact(double x) { return {{x, 0}, 0}; }
template <class R> R rounded_to(const N& x) { return rounded_to<R>(value(x)); }
INLINE double width(const N& x) { return x.error * (1 + 0x1p-30); }  // a bound on the error of high(x)

// The exponent of the power of two that scales numbers, as of a normal or a quaternion, into the middle of the range of
// doubles; 0 if they are there already. _with_scaled_normal in scene/assemble.py does the same for normals.
inline int exponent_of(const double* x, int count) {
  double largest = 0;
  for (int k = 0; k < count; ++k) largest = std::fmax(largest, std::fabs(x[k]));
  int exponent = 0;
  std::frexp(largest, &exponent);
  return std::abs(exponent) > USUAL_EXPONENT ? exponent : 0;
}

// The power of two just below `size`. Dividing by it loses no digits.
inline double power_near(double size) { return size > 0 && size < INFINITY ? std::ldexp(1.0, std::ilogb(size)) : 1; }

// A body as seen from its reference point, which is at x and moves with v. M^-1 = L L^T: a twist is L y, and |y| is its
// size in the metric of kinetic energy.
template <class T>
struct Centre {
  T numbers[CENTRE_COUNT + 10], x[3], v[3];
  double energy;
  bool has_massless_spin;

  explicit Centre(const double* body);
  Centre() = default;

  const T* com() const { return numbers + CENTRE_COM; }
  // L: a force along each axis, and three moments.
  const T& root() const { return numbers[CENTRE_COUNT]; }
  const T* turn(int k) const { return numbers + CENTRE_COUNT + 1 + 3 * k; }

  // row = L^T jacobian, for a unit impulse along `direction`, times `sign`, at `arm` from the centre of mass.
  void to_energy_metric(const T* direction, const T* arm, double sign, T* row) const {
    const std::array<T, 3> moment = cross(arm, direction);
    for (int k = 0; k < 3; ++k) {
      row[k] = constant<T>(sign) * root() * direction[k];
      row[3 + k] = constant<T>(sign) * (turn(k)[0] * moment[0] + turn(k)[1] * moment[1] + turn(k)[2] * moment[2]);
    }
  }
  // twist = L y
  void twist_of(const T* y, T* twist) const {
    for (int j = 0; j < 3; ++j) twist[3 + j] = turn(0)[j] * y[3] + turn(1)[j] * y[4] + turn(2)[j] * y[5];
    const std::array<T, 3> at_centre = cross(twist + 3, com());
    for (int j = 0; j < 3; ++j) twist[j] = root() * y[j] - at_centre[j];
  }
};

template <class R>
Centre<R> rounded_to(const Centre<N>& centre) {
  Centre<R> rounded;
  auto round = [](const N& x) { return rounded_to<R>(x); };
  std::transform(std::begin(centre.numbers), std::end(centre.numbers), rounded.numbers, round);
  std::transform(centre.x, centre.x + 3, rounded.x, round);
  std::transform(centre.v, centre.v + 3, rounded.v, round);
  rounded.energy = centre.energy;
  rounded.has_massless_spin = centre.has_massless_spin;
  return rounded;
}

struct AssembledBody {
  double x[BODY];  // as given
  int place = -1;  // among the movable bodies; -1: immovable
  Centre<N> centre;
  Centre<double> centre_in_doubles;

  bool is_movable() const { return x[BODY_MASS] < INFINITY; }
  bool moves() const {
    for (int k = 0; k < 6; ++k)
      if (x[BODY_VELOCITY_X + k] != 0) return true;
    return false;
  }
  bool rests() const { return !is_movable() && !moves(); }
  // Whether it moves as another body does, without turning: then an observer can be at rest with both.
  bool moves_with(const AssembledBody& other) const {
    const double *v = x + BODY_VELOCITY_X, *w = x + BODY_ANGULAR_VELOCITY_X;
    return std::equal(v, v + 3, other.x + BODY_VELOCITY_X) &&
           std::all_of(w, w + 3, [](double one) { return one == 0; });
  }

  // Whether two immovable bodies have the same velocity at every point.
  bool moves_like(const AssembledBody& other) const {
    return std::equal(x, x + BODY, other.x) || (moves_with(other) && other.moves_with(*this));
  }

  // Compute everything from x.
  void prepare();
  template <class T>
  decltype(auto) centre_in() const {
    if constexpr (std::is_same_v<T, N>) return (centre);
    else if constexpr (is_scalar<T>) return (centre_in_doubles);
    else return rounded_to<T>(centre);
  }
};

inline double trace_of_inertia(const double* body) {
  return body[BODY_INERTIA_XX] + body[BODY_INERTIA_YY] + body[BODY_INERTIA_ZZ];
}

// The size of a twist change in the norm of error_bound, computed so that no square overflows or underflows.
inline double twist_size(const double* body, const double* twist) {
  double arm = trace_of_inertia(body) / 3;
  return std::hypot(std::sqrt(body[BODY_MASS]) * std::hypot(twist[0], twist[1], twist[2]),
                    std::sqrt(arm) * std::hypot(twist[3], twist[4], twist[5]));
}

// The kinetic energy of a body with this twist.
double kinetic_energy(const double* body, const double* twist);

// The greatest ratio of the norm of error_bound to the size in the metric of kinetic energy, for twist changes of a
// body.
inline double norm_ratio(const AssembledBody& body) {
  const double* x = body.x;
  double moments[3] = {x[BODY_INERTIA_XX], x[BODY_INERTIA_YY], x[BODY_INERTIA_ZZ]}, trace = trace_of_inertia(x), c = 0;
  for (int k = 0; k < 3; ++k) c += x[BODY_COM_X + k] * x[BODY_COM_X + k];
  double shift = 2 * x[BODY_MASS] * c, base = c > 0 ? 2 : 1;
  if (!(trace > 0)) return std::sqrt(base);
  const bool is_diagonal = x[BODY_INERTIA_XY] == 0 && x[BODY_INERTIA_XZ] == 0 && x[BODY_INERTIA_YZ] == 0;
  double least = INFINITY, inverse = 0;  // the least moment that is not 0; the sum of the inverses of the moments
  for (int k = 0; k < 3; ++k) {
    const double* turn = body.centre_in_doubles.turn(k);
    double square = turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2];
    inverse += square;
    if (square > 0) least = std::fmin(least, moments[k]);
  }
  // Half of the digits of the least moment may be rounding: see ROUNDINGS in physics/body.py.
  return std::sqrt(std::fmax(base, is_diagonal ? (shift + trace / 3) / least : (shift + trace / 3) * 2 * inverse));
}

// The relative velocity along one axis of a contact: velocity + row.y, for bodies whose twists changed by L y.
template <class R>
struct ContactAxis {
  R row[2][6], velocity;
};

// A unit normal and two tangents (Duff et al. 2017).
template <class R>
std::array<std::array<R, 3>, 3> axes_along(const std::array<R, 3>& normal) {
  const auto& [x, y, z] = normal;
  const double side = high(x) < 0 ? -1 : 1;
  const R sign = constant<R>(side), c = constant<R>(-1) / (sign + x), d = y * z * c;
  return {{{x, y, z}, {-(sign * y), constant<R>(1) + sign * (y * y * c), sign * d}, {-z, d, sign + z * z * c}}};
}

struct AssembledContact {
  int body[2];  // places among the movable bodies; -1: immovable
  int wall[2];  // places among the walls; -1: no wall that moves
  double point[3], normal[3], length, scale;  // length: of the normal; scale: 1 / sqrt(n.K n)
  double e, mu, copies;  // copies: how often the contact is given
  // Along the normal as given, for each body, with opposite signs: the velocity by the twist, and the twist by an
  // impulse.
  N jacobian[2][6], response[2][6];
  N velocity;  // normal velocity before the impact, times the length of the normal
  std::array<ContactAxis<double>, 3> axes;  // along the unit normal and two tangents

  double unit() const { return scale * length; }  // 1 / sqrt(n.K n) of the unit normal

  // The unit normal and two tangents.
  template <class R>
  std::array<std::array<R, 3>, 3> unit_vectors() const {
    const R by = length_in<R>();
    return axes_along<R>({constant<R>(normal[0]) / by, constant<R>(normal[1]) / by, constant<R>(normal[2]) / by});
  }
  template <class R>
  R length_in() const {
    if constexpr (is_scalar<R>) {
      return length;
    } else {
      R square{};
      for (double n : normal) square += exact_product(n, n);
      return root(square);
    }
  }
};
