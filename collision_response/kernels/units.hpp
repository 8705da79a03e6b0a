// Exact changes of units, for requests at the ends of the range of floats.
#pragma once
#include <algorithm>

#include "kernel_table.hpp"

// Powers of two for mass, length, time, the two quaternions and the normal, that bring a request into the
// middle of the range of floats.
struct Units {
  int power[6];

  static int exponent(const double* x, int count) {
    double most = 0;
    for (int i = 0; i < count; ++i) most = std::max(most, std::fabs(x[i]));
    return most > 0 && most < INFINITY ? std::ilogb(most) : 0;
  }

  static Units of(const double* x, bool articulated) {
    const double *a = x, *b = x + BODY, *point = x + IN_CONTACT_POSITION_X;
    double mass = std::min(a[0], b[0]), heaviest = std::max(a[0], b[0]), reach[2] = {};
    for (int side = 0; articulated && side < 2; ++side) {
      const double* own = x + INPUTS + side * INVERSE_INERTIA;
      double linear = linear_part(own), angular = angular_part(own);
      if (linear > 0) mass = std::min(mass, 1 / linear);
      if (linear > 0 && angular > 0) reach[side] = std::sqrt(linear) / std::sqrt(angular);
    }
    if (!(mass < INFINITY)) mass = 1;
    // The lightest becomes 1; but no heavy one becomes infinite, for that is immovable.
    int heavy = heaviest < INFINITY ? std::max(std::ilogb(mass), std::ilogb(heaviest) - 900) : std::ilogb(mass);
    double lengths[8], speeds[6];
    for (int k = 0; k < 3; ++k) {
      lengths[k] = point[k] - a[IN_BODY_A_POSITION_X + k];
      lengths[3 + k] = point[k] - b[IN_BODY_A_POSITION_X + k];
      speeds[k] = a[IN_BODY_A_VELOCITY_X + k] - b[IN_BODY_A_VELOCITY_X + k];
    }
    for (int side = 0; side < 2; ++side) {
      double trace = x[side * BODY + IN_BODY_A_INERTIA_XX] / 4 + x[side * BODY + IN_BODY_A_INERTIA_YY] / 4 +
                     x[side * BODY + IN_BODY_A_INERTIA_ZZ] / 4;
      lengths[6 + side] = trace > 0 ? std::sqrt(trace) / std::sqrt(x[side * BODY]) : reach[side];
    }
    int length = exponent(lengths, 8);
    int spin = std::max(exponent(a + IN_BODY_A_ANGULAR_VELOCITY_X, 3), exponent(b + IN_BODY_A_ANGULAR_VELOCITY_X, 3));
    bool spins = false;
    for (int k = 0; k < 3; ++k)
      spins = spins || a[IN_BODY_A_ANGULAR_VELOCITY_X + k] != 0 || b[IN_BODY_A_ANGULAR_VELOCITY_X + k] != 0;
    int speed = exponent(speeds, 3);
    bool moves = speeds[0] != 0 || speeds[1] != 0 || speeds[2] != 0;
    if (spins) speed = moves ? std::max(speed, spin + length) : spin + length;
    return {{-heavy, -length, speed - length, -exponent(a + IN_BODY_A_ORIENTATION_X, 4),
             -exponent(b + IN_BODY_A_ORIENTATION_X, 4), -exponent(x + IN_CONTACT_NORMAL_X, 3)}};
  }

  int of(const signed char* units) const {
    int sum = 0;
    for (int k = 0; k < 6; ++k) sum += units[k] * power[k];
    return sum;
  }
  // Exact, or the error says what got lost at the lower end of the range.
  static void scale(double& x, double& error, int power) {
    double scaled = std::ldexp(x, power);
    error = std::ldexp(error, power);
    if (std::ldexp(scaled, -power) != x) error += 0x1p-1074;
    x = scaled;
  }
};

// An impact in other units, and back.
static void impact_in_other_units(ImpactKernel kernel, bool articulated, const double* x, const double* error, ImpactResult& y) {
  Units units = Units::of(x, articulated);
  double scaled[ALL_INPUTS], lost[ALL_INPUTS], none = 0;
  for (int i = 0; i < (articulated ? ALL_INPUTS : INPUTS); ++i) {
    scaled[i] = x[i];
    lost[i] = error[i];
    if (x[i] - x[i] == 0) Units::scale(scaled[i], lost[i], units.of(input_units[i]));
  }
  kernel(scaled, lost, &y);
  for (int i = 0; i < CHANGES; ++i) Units::scale(y.change[i], y.error[i], -units.of(change_units[i]));
  for (int i = 0; i < REPORTED; ++i) Units::scale(y.reported[i], none, -units.of(reported_units[i]));
}

// Whether some square or product on the way may have left the range of floats.
static inline bool is_extreme(const ImpactResult& y, bool single) {
  double most = single ? 0x1p40 : 0x1p400;
  auto out = [most](double x) { return x != 0 && !(std::fabs(x) > 1 / most && std::fabs(x) < most); };
  return out(y.reported[OUT_NORMAL_IMPULSE]) || out(y.reported[OUT_NORMAL_VELOCITY_BEFORE]) ||
         out(y.reported[OUT_KINETIC_ENERGY_BEFORE]) || out(y.reported[OUT_EFFECTIVE_MASS]);
}

static inline bool all_finite(const ImpactResult& y) {
  double sum = 0;
  for (double number : y.change) sum += number - number;
  for (double number : y.reported) sum += number - number;
  return sum == 0;
}
