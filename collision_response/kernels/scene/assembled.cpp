// The formula of physics/column.py for bodies.
#include "assembled.hpp"

template <class T>
Centre<T>::Centre(const double* body) {
  T in[BODY];
  const int exponent = exponent_of(body + BODY_ORIENTATION_X, 4);
  for (int i = 0; i < BODY; ++i) in[i] = Make<T>::constant(body[i]);
  for (int i = BODY_ORIENTATION_X; i < BODY_ORIENTATION_X + 4; ++i)
    in[i] = Make<T>::constant(std::ldexp(body[i], -exponent));
  centre<T>(in, numbers, &energy, &has_massless_spin);
  std::copy_n(in + BODY_POSITION_X, 3, x);
  std::copy_n(in + BODY_VELOCITY_X, 3, v);
}

template Centre<double>::Centre(const double* body);
template Centre<N>::Centre(const double* body);

double kinetic_energy(const double* body, const double* twist) {
  const double *v = twist, *spin = twist + 3;
  const int turning = exponent_of(spin, 3);
  double moving[BODY];
  std::copy_n(body, BODY, moving);
  double *linear = moving + BODY_VELOCITY_X, *angular = moving + BODY_ANGULAR_VELOCITY_X;
  if (exponent_of(v, 3) == 0 && turning == 0) {
    std::copy_n(twist, 6, linear);
    return Centre<double>(moving).energy;
  }
  // That of its centre of mass, and that of its spin: each with speeds in the middle of the range of doubles.
  std::array<double, 3> at_centre = cross(spin, Centre<double>(body).com());
  for (int k = 0; k < 3; ++k) at_centre[k] += v[k];
  const int moves = exponent_of(at_centre.data(), 3);
  std::fill_n(moving + BODY_COM_X, 3, 0.0);
  std::fill_n(angular, 3, 0.0);
  for (int k = 0; k < 3; ++k) linear[k] = std::ldexp(at_centre[k], -moves);
  const double of_centre = std::ldexp(Centre<double>(moving).energy, 2 * moves);
  std::fill_n(linear, 3, 0.0);
  for (int k = 0; k < 3; ++k) angular[k] = std::ldexp(spin[k], -turning);
  return of_centre + std::ldexp(Centre<double>(moving).energy, 2 * turning);
}

// Whether a body turns about an axis without inertia, at any speed.
static bool turns_without_inertia(const double* body, const Centre<N>& centre) {
  const int exponent = exponent_of(body + BODY_ANGULAR_VELOCITY_X, 3);
  if (exponent == 0) return centre.has_massless_spin;
  double turning[BODY];
  std::copy_n(body, BODY, turning);
  for (int k = BODY_ANGULAR_VELOCITY_X; k < BODY_ANGULAR_VELOCITY_X + 3; ++k)
    turning[k] = std::ldexp(body[k], -exponent);
  return Centre<N>(turning).has_massless_spin;
}

void AssembledBody::prepare() {
  centre = Centre<N>(x);
  centre.has_massless_spin = turns_without_inertia(x, centre);
  // Not by doubles alone: they may find inertia about the axis of a thin rod, which is rounding.
  centre_in_doubles = rounded_to<double>(centre);
  centre_in_doubles.energy = kinetic_energy(x, x + BODY_VELOCITY_X);  // as that after the impact is computed
}
