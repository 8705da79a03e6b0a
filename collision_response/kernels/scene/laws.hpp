// The laws for several contacts at once. Each has a file of its own, which derives it.
#pragma once
#include "impulses.hpp"

// FRICTIONLESS: frictionless.cpp. Contacts that approach more slowly than `threshold`, relative to the fastest approach,
// are not reflected.
ClusterImpulses reflections(const Assembly& assembly, double threshold);

// COULOMB: coulomb.cpp, from the impulses of FRICTIONLESS. If none of the contacts that these load has friction, they are
// the result. `tolerance`: greatest error bound wanted, or 0.
ClusterImpulses least_work_friction(const Assembly& assembly, const ClusterImpulses& frictionless, double tolerance);

// MOREAU: moreau.cpp. Without friction, in double-double.
ClusterImpulses moreau(const Assembly& assembly, bool has_friction);

// ROUTH_STRONGE: routh_stronge.cpp.
struct SpringOptions {
  Vector stiffness{};  // of each contact, in any unit; empty: all are equal
  double exponent = 1.5;  // eta
  long work = 0;  // budget of all paths together, roughly in nanoseconds
};
struct PathAnswer {
  ClusterImpulses impulses;
  double friction_loss = 0;  // energy that friction took
  double rounding = 0;  // error bound of the effect of these impulses
  double error = INFINITY;  // estimate of the relative error of the path
  const char* fault = nullptr;  // why there is no answer
  int faulty = -1;  // the contact that it is about; -1: all
};
// `wanted`: greatest relative error wanted, or 0.
PathAnswer follow_springs(const Assembly& assembly, const SpringOptions& options, bool has_friction, double wanted);
