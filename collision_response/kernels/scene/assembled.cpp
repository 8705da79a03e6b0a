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

void AssembledBody::prepare() {
  centre = Centre<N>(x);
  // Not by doubles alone: they may find inertia about the axis of a thin rod, which is rounding.
  centre_in_doubles = rounded_to<double>(centre);
  centre_in_doubles.energy = Centre<double>(x).energy;  // as that after the impact is computed
}
