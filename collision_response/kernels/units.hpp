// Exact changes of units, for requests near the ends of the range of floats.
#pragma once
#include <algorithm>
#include <cmath>

#include "one_impact.hpp"

// Units that bring the numbers of a request into the middle of the range of floats: powers of two for mass, length,
// time, and the lengths of the two quaternions and of the normal.
struct Units {
  int power[6];

  // The binary exponent of the largest of some numbers; 0 if that is 0 or infinite.
  static int exponent(const double* x, int count) {
    double largest = 0;
    for (int i = 0; i < count; ++i) largest = std::max(largest, std::fabs(x[i]));
    return largest > 0 && largest < INFINITY ? std::ilogb(largest) : 0;
  }

  static Units of(const double* input, bool articulated) {
    const double *a = input, *b = input + BODY, *point = input + IN_CONTACT + CONTACT_POSITION_X;
    double mass = std::min(a[BODY_MASS], b[BODY_MASS]), heaviest = std::max(a[BODY_MASS], b[BODY_MASS]),
           articulated_length[2] = {};
    for (int side = 0; articulated && side < 2; ++side) {
      const double* inverse_inertia = input + INPUTS + side * INVERSE_INERTIA;
      double linear = linear_trace(inverse_inertia), angular = angular_trace(inverse_inertia);
      if (linear > 0) mass = std::min(mass, 1 / linear);
      if (linear > 0 && angular > 0) articulated_length[side] = std::sqrt(linear) / std::sqrt(angular);
    }
    if (!(mass < INFINITY)) mass = 1;
    // The lesser mass becomes about 1, unless the other would become infinite, which means immovable.
    int mass_power = heaviest < INFINITY ? std::max(std::ilogb(mass), std::ilogb(heaviest) - 900) : std::ilogb(mass);
    double arms[6], lengths[8]{}, speeds[3], spins[6];
    for (int side = 0; side < 2; ++side) {
      const double* body = input + side * BODY;
      double trace = body[BODY_INERTIA_XX] / 4 + body[BODY_INERTIA_YY] / 4 + body[BODY_INERTIA_ZZ] / 4;
      lengths[6 + side] = trace > 0 ? std::sqrt(trace) / std::sqrt(body[BODY_MASS]) : articulated_length[side];
      const bool has_lever = articulated || trace > 0 || !(body[BODY_MASS] < INFINITY);  // a point mass has none
      for (int k = 0; k < 3; ++k) {
        arms[3 * side + k] = point[k] - body[BODY_POSITION_X + k];
        if (has_lever) lengths[3 * side + k] = arms[3 * side + k];
      }
    }
    for (int k = 0; k < 3; ++k) {
      speeds[k] = a[BODY_VELOCITY_X + k] - b[BODY_VELOCITY_X + k];
      spins[k] = a[BODY_ANGULAR_VELOCITY_X + k];
      spins[3 + k] = b[BODY_ANGULAR_VELOCITY_X + k];
    }
    auto is_zero = [](double x) { return x == 0; };
    // Arms without an effect only must not leave the range when they are squared.
    int length = exponent(arms, 6);
    if (!std::all_of(lengths, lengths + 8, is_zero)) length = std::max(exponent(lengths, 8), length - 400);
    int speed = exponent(speeds, 3), tip_speed = exponent(spins, 6) + length;
    if (!std::all_of(spins, spins + 6, is_zero))
      speed = std::all_of(speeds, speeds + 3, is_zero) ? tip_speed : std::max(speed, tip_speed);
    return {{-mass_power, -length, speed - length, -exponent(a + BODY_ORIENTATION_X, 4),
             -exponent(b + BODY_ORIENTATION_X, 4), -exponent(input + IN_CONTACT + CONTACT_NORMAL_X, 3)}};
  }

  // The power of two that a quantity of these units is multiplied by.
  int power_of(const signed char* units) const {
    int sum = 0;
    for (int k = 0; k < 6; ++k) sum += units[k] * power[k];
    return sum;
  }
  // Exact, except for what underflows, which `error` then covers.
  static void scale(double& x, double& error, int power) {
    double scaled = std::ldexp(x, power);
    error = std::ldexp(error, power);
    if (std::ldexp(scaled, -power) != x) error += 0x1p-1074;
    x = scaled;
  }
};
