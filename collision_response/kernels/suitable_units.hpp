// Computing an impact in the units that suit its numbers.
#pragma once
#include "kernel_table.hpp"
#include "scene/assembled.hpp"
#include "units.hpp"

// In units that suit fast bodies, the motion of far slower ones may be lost. Set the velocities that nothing changes, and
// `energies` if asked for.
static void restore_slow_bodies(const double* input, bool energies, ImpactResult& result) {
  double before = 0, after = 0;
  for (int side = 0; side < 2; ++side) {
    const double *body = input + side * BODY, *twist = body + BODY_VELOCITY_X;
    for (int k = 0; k < 6; ++k)
      if (result.twist_change(side)[k] == 0) result.reported[6 * side + k] = twist[k];
    if (!energies) continue;
    before += kinetic_energy(body, twist);
    after += kinetic_energy(body, result.twist_after(side));
  }
  if (!energies || !(before < INFINITY && after < INFINITY)) return;
  result.reported[OUT_KINETIC_ENERGY_BEFORE] = before;
  result.reported[OUT_KINETIC_ENERGY_AFTER] = after;
}

// Compute an impact in other units, and convert the result back.
static void impact_in_other_units(ImpactKernel kernel, bool articulated, bool single, const double* input,
                                  const double* error, ImpactResult& result) {
  Units units = Units::of(input, articulated);
  double scaled[ALL_INPUTS], scaled_error[ALL_INPUTS], no_error = 0;
  for (int i = 0; i < (articulated ? ALL_INPUTS : INPUTS); ++i) {
    scaled[i] = input[i];
    scaled_error[i] = error[i];
    if (input[i] - input[i] == 0) Units::scale(scaled[i], scaled_error[i], units.power_of(input_units[i]));
  }
  kernel(scaled, scaled_error, &result);
  // The least normal float or double, times more than its digits: below this, a term may have lost some.
  const double least = single ? 0x1p-100 : 0x1p-960;
  const double *reported = result.reported, before = reported[OUT_KINETIC_ENERGY_BEFORE];
  const bool lacks_digits = !articulated && std::fmin(before, reported[OUT_KINETIC_ENERGY_AFTER]) < least;
  for (int i = 0; i < CHANGES; ++i) Units::scale(result.change[i], result.error[i], -units.power_of(change_units[i]));
  for (int i = 0; i < REPORTED; ++i) Units::scale(result.reported[i], no_error, -units.power_of(reported_units[i]));
  restore_slow_bodies(input, lacks_digits, result);
}

// Whether an intermediate square or product may have left the range of floats. Of the square of the normal, the numbers
// of separating bodies do not show that.
static inline bool is_extreme(const double* input, const ImpactResult& result, bool single) {
  const double limit = single ? 0x1p40 : 0x1p400, *n = input + IN_CONTACT + CONTACT_NORMAL_X;
  auto is_out = [limit](double x) { return x != 0 && !(std::fabs(x) > 1 / limit && std::fabs(x) < limit); };
  return is_out(result.reported[OUT_NORMAL_IMPULSE]) || is_out(result.reported[OUT_NORMAL_VELOCITY_BEFORE]) ||
         is_out(result.reported[OUT_KINETIC_ENERGY_BEFORE]) || is_out(result.reported[OUT_EFFECTIVE_MASS]) ||
         is_out(std::max({std::fabs(n[0]), std::fabs(n[1]), std::fabs(n[2])}));
}

static inline bool all_finite(const ImpactResult& result) {
  double sum = 0;
  for (double number : result.change) sum += number - number;
  for (double number : result.reported) sum += number - number;
  return sum == 0;
}

// Compute an impact; in other units too, if numbers near the ends of the range of floats may have spoilt the result.
static inline void compute_in_suitable_units(ImpactKernel kernel, bool articulated, bool single, const double* input,
                                             const double* error, ImpactResult& result) {
  kernel(input, error, &result);
  if (result.error_bound < INFINITY && !is_extreme(input, result, single) && all_finite(result)) return;
  ImpactResult scaled;
  impact_in_other_units(kernel, articulated, single, input, error, scaled);
  bool knows_more = scaled.error_bound < INFINITY || !(result.error_bound < INFINITY);
  if ((all_finite(scaled) && knows_more) || !all_finite(result)) result = scaled;
}
