// One body and one contact of a cluster, with the numbers that the arithmetic of the cluster needs.
#pragma once
#include "../numbers.hpp"
#include "column.hpp"
#include "constants.hpp"
#include "vectors.hpp"

using N = Bounded<DD>;

INLINE N exact(DD x) { return {x, 0}; }
INLINE N exact(double x) { return {{x, 0}, 0}; }
template <class R> R rounded_to(const N& x) {  // to the digits of R
  if constexpr (is_scalar<R>) return high(x);
  else return value(x);
}
INLINE double width(const N& x) { return x.error * (1 + 0x1p-30); }  // a bound on the error of high(x)

// The exponent of the power of two that scales a normal or a quaternion into the middle of the range of doubles; 0 if
// it is there already. _with_scaled_normal in apply_law.py does the same for normals.
inline int exponent_of(const double* x, int count) {
  double largest = 0;
  for (int k = 0; k < count; ++k) largest = std::fmax(largest, std::fabs(x[k]));
  int exponent = 0;
  std::frexp(largest, &exponent);
  return std::abs(exponent) > 100 ? exponent : 0;
}

// The power of two just below `size`. Dividing by it loses no digits.
inline double power_near(double size) { return size > 0 && size < INFINITY ? std::ldexp(1.0, std::ilogb(size)) : 1; }

inline Vector rounded(const DD* p, int count) {
  Vector out(count);
  for (int i = 0; i < count; ++i) out[i] = p[i].h;
  return out;
}

template <class T>
struct Centre {  // a body as seen from its reference point, which is at x and moves with v
  T numbers[CENTRE_COUNT], x[3], v[3];
};

struct AssembledBody {
  double x[BODY];  // as given
  double energy;
  bool has_massless_spin;
  Centre<N> centre;
  Centre<double> centre_in_doubles;
  // M^-1 = L L^T. A twist is L y, and |y| is its size in the metric of kinetic energy.
  double root, turn[3][3], com[3];  // L: root is 1 / sqrt(m), turn is the part for moments

  bool is_movable() const { return x[0] < INFINITY; }
  bool moves() const {
    for (int k = 0; k < 6; ++k)
      if (x[IN_BODY_A_VELOCITY_X + k] != 0) return true;
    return false;
  }
  bool rests() const { return !is_movable() && !moves(); }

  // Compute everything from x.
  void prepare() {
    fill(centre);
    fill(centre_in_doubles);
    const double* numbers = centre_in_doubles.numbers;
    root = std::sqrt(numbers[CENTRE_INVERSE_MASS]);
    std::copy(numbers + CENTRE_COM, numbers + CENTRE_COM + 3, com);
  }
  // twist = L y
  void twist_of(const double* y, double* twist) const {
    for (int j = 0; j < 3; ++j) twist[3 + j] = turn[0][j] * y[3] + turn[1][j] * y[4] + turn[2][j] * y[5];
    const Axes at_centre = cross(twist + 3, com);
    for (int j = 0; j < 3; ++j) twist[j] = root * y[j] - at_centre[j];
  }
  template <class T>
  void fill(Centre<T>& seen) {
    T in[BODY];
    Report<T> motion[10];
    const double* orientation = x + IN_BODY_A_ORIENTATION_X;
    const int exponent = exponent_of(orientation, 4);
    for (int i = 0; i < BODY; ++i) in[i] = Make<T>::constant(x[i]);
    for (int k = 0; k < 4; ++k)
      in[IN_BODY_A_ORIENTATION_X + k] = Make<T>::constant(std::ldexp(orientation[k], -exponent));
    ::centre<T>(in, seen.numbers, motion, &has_massless_spin);
    energy = motion[0];
    for (int i = 0; i < 9; ++i) turn[i / 3][i % 3] = motion[1 + i];
    for (int k = 0; k < 3; ++k) {
      seen.x[k] = in[IN_BODY_A_POSITION_X + k];
      seen.v[k] = in[IN_BODY_A_VELOCITY_X + k];
    }
  }
};

// The size of a twist change in the norm of error_bound, computed so that no square overflows or underflows.
inline double twist_size(const double* body, const double* twist) {
  double arm = (body[1] + body[4] + body[6]) / 3;
  return std::hypot(std::sqrt(body[0]) * std::hypot(twist[0], twist[1], twist[2]),
                    std::sqrt(arm) * std::hypot(twist[3], twist[4], twist[5]));
}

// The relative velocity along one axis of a contact: velocity + row.y, for bodies whose twists changed by L y.
template <class R>
struct ContactAxisOf {
  R row[2][6], velocity;
};
using ContactAxis = ContactAxisOf<double>;

// A body in double-double. L is from a Cholesky factorisation of the inverse inertia.
struct PreciseBody {
  Centre<DD> centre;
  DD root, turn[3][3], com[3];

  explicit PreciseBody(const AssembledBody& body) {
    const auto value_of = [](const N& x) { return value(x); };
    std::transform(body.centre.numbers, body.centre.numbers + CENTRE_COUNT, centre.numbers, value_of);
    std::transform(body.centre.x, body.centre.x + 3, centre.x, value_of);
    std::transform(body.centre.v, body.centre.v + 3, centre.v, value_of);
    std::copy(centre.numbers + CENTRE_COM, centre.numbers + CENTRE_COM + 3, com);
    if (!body.is_movable()) return;
    root = ::root(centre.numbers[CENTRE_INVERSE_MASS]);
    DD inverse_inertia[3][3];
    // The response to a unit moment, by a force along one axis and its lever arm.
    for (int axis = 0; axis < 3; ++axis) {
      const int arm = (axis + 1) % 3, force = (axis + 2) % 3;
      DD in[CENTRE_COUNT + 9]{}, out[10];
      std::copy(centre.numbers, centre.numbers + CENTRE_COUNT, in);
      std::fill_n(in + CENTRE_COM, 3, DD{});
      in[CENTRE_COUNT + 3 + arm] = DD{1, 0};
      in[CENTRE_COUNT + 6 + force] = DD{1, 0};
      column<DD>(in, out, nullptr, nullptr);
      std::copy(out + 7, out + 10, inverse_inertia[axis]);
    }
    const double size = inverse_inertia[0][0].h + inverse_inertia[1][1].h + inverse_inertia[2][2].h;
    for (int k = 0; k < 3; ++k) {
      auto remainder = [&](int i) {
        DD sum = inverse_inertia[i][k];
        for (int j = 0; j < k; ++j) sum -= turn[j][i] * turn[j][k];
        return sum;
      };
      const DD pivot = remainder(k);
      for (int i = 0; i < 3; ++i) turn[k][i] = pivot.h > 0x1p-80 * size && i >= k ? remainder(i) / ::root(pivot) : DD{};
    }
  }
};

struct AssembledContact {
  int body[2];  // places among the movable bodies; -1: immovable
  int wall[2];  // places among the walls; -1: no wall that moves
  double point[3], normal[3], length, scale;  // length: of the normal; scale: 1 / sqrt(n.K n)
  double e, mu, copies;  // copies: how often the contact is given
  // Along the normal as given, for each body, with opposite signs: the velocity by the twist, and the twist by an
  // impulse.
  N jacobian[2][6], response[2][6];
  N velocity;  // normal velocity before the impact, times the length of the normal
  ContactAxis axes[3];  // along the unit normal and two tangents

  // The unit normal and two tangents (Duff et al. 2017).
  std::array<Axes, 3> unit_vectors() const { return unit_vectors(length); }
  template <class R>
  std::array<std::array<R, 3>, 3> unit_vectors(const R& length) const {
    const R x = constant<R>(normal[0]) / length, y = constant<R>(normal[1]) / length,
            z = constant<R>(normal[2]) / length;
    const double side = high(x) < 0 ? -1 : 1;
    const R sign = constant<R>(side), c = constant<R>(-1) / (sign + x), d = y * z * c;
    return {{{x, y, z}, {-(sign * y), constant<R>(1) + sign * (y * y * c), sign * d}, {-z, d, sign + z * z * c}}};
  }
  DD precise_length() const {
    DD square{};
    for (double n : normal) square += exact_product(n, n);
    return root(square);
  }
};
