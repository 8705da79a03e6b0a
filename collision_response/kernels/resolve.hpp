// One impact, as numbers.
#pragma once
#include "one_impact.hpp"
#include "plan.hpp"

struct OneImpact {
  double input[ALL_INPUTS];
  ImpactResult result;
  int law, geometry, precision;  // as used
  bool is_articulated = false, has_fraction = false, leaves_out_friction;
  bool validity[VALIDITY_FLAGS];

  int adjustments() const {
    return validity[VALIDITY_IS_OFF_UNIT] * ADJUSTMENT_NORMALISED_ORIENTATION +
           result.flags[FLAG_BELOW_THRESHOLD] * ADJUSTMENT_RESTITUTION_THRESHOLD +
           result.flags[FLAG_FELL_BACK] * ADJUSTMENT_LAW_FALLBACK +
           result.flags[FLAG_MASSLESS_SPIN] * ADJUSTMENT_MASSLESS_SPIN + is_articulated * ADJUSTMENT_ENERGY_CHANGE_ONLY;
  }
  PyObject* contact_as_used(PyObject* contact) const {
    return ::contact_as_used(contact, result.reported[OUT_RESTITUTION], result.flags[FLAG_BELOW_THRESHOLD],
                             leaves_out_friction);
  }
};

// What became of a request: ANSWERED; the Handover of protocol.py that says why Python has to answer; or why there is no
// answer.
enum { ANSWERED = -1, RAISED = -2, NO_KERNEL = -3 };
constexpr int refused(int status) { return NO_KERNEL - status; }
constexpr int status_of(int outcome) { return NO_KERNEL - outcome; }

// Compute the impact of the numbers in impact.input, which have these errors. Needs no GIL.
int compute_numbers(const Plan& plan, const double* error, OneImpact& impact);

// Compute the impact of a body_a, a body_b and a contact. Returns ANSWERED, RAISED if a Python error is set, or a Handover.
int compute_one_impact(PyObject* const* request, const Plan& plan, OneImpact& impact);
