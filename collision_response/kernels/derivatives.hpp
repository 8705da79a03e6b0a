// The derivatives of an impulse by what a law sees.
#pragma once
#include "dual.hpp"
#include "constants.hpp"

enum { SEEN_BY_LAW = 21, AXES = 3 };

// The derivatives of what a law sees, in some directions, and those of the impulse.
using Seeds = double[SEEN_BY_LAW][Few::DIRECTIONS];
struct Impulse {
  Bounded<double> value[AXES];
  double d[AXES][Few::DIRECTIONS];
  Edges kinks, jumps;
};
using DerivativeKernel = void (*)(const Bounded<double>* seen, const Seeds& seeds, Impulse* y);
