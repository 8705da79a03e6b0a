// The derivatives of an impulse by the inputs of a law.
#pragma once
#include "dual.hpp"
#include "constants.hpp"

enum { AXES = 3 };

// Derivatives in some directions: of the inputs of a law, and of its impulse.
using Seeds = double[LAW_INPUT_COUNT][DenseDerivatives::DIRECTIONS];
struct Impulse {
  Bounded<double> value[AXES];
  double d[AXES][DenseDerivatives::DIRECTIONS];
  Edges kinks, jumps;
};
using DerivativeKernel = void (*)(const Bounded<double>* law_input, const Seeds& seeds, Impulse* result);
