// Derivatives of one impact in some directions.
#pragma once
#include "dual.hpp"
#include "sizes.hpp"

// What an impact is differentiated by: its inputs, but for three rotations about the axes of the world instead of
// the four numbers of a quaternion, and of the model only the tangential restitution.
enum { PARAMETERS_OF_BODY = BODY - 1, PARAMETERS = IN_MODEL_RESTITUTION_THRESHOLD - 2 };

// The derivatives of inputs and of results, in up to DIRECTIONS directions.
using Seeds = double[INPUTS][DIRECTIONS];
struct Derivatives {
  double d[CHANGES][DIRECTIONS];
  Edges kinks, jumps;
};
using DerivativeKernel = void (*)(const double* x, const Seeds& seeds, int directions, Derivatives* y);

template <class N, class F>
INLINE void derivatives_of(F changes, const double* x, const Seeds& seeds, int directions, Derivatives* y) {
  room = {};
  N in[INPUTS], results[CHANGES];
  int blocks = (directions + 3) / 4;
  for (int i = 0; i < INPUTS; ++i) {
    in[i] = N(Make<typename N::Number>::constant(x[i]));
    auto is_zero = [&](int block) {
      const double* some = seeds[i] + 4 * block;
      return some[0] == 0 && some[1] == 0 && some[2] == 0 && some[3] == 0;
    };
    int from = 0, to = blocks;
    while (from < to && is_zero(from)) ++from;
    while (from < to && is_zero(to - 1)) --to;
    if (from == to) continue;
    in[i].span(from, to);
    std::memcpy(in[i].d + from, seeds[i] + 4 * from, (to - from) * sizeof(Block));
  }
  changes(in, results, nullptr, nullptr);
  y->kinks = y->jumps = 0;
  for (int i = 0; i < CHANGES; ++i) {
    y->kinks |= results[i].kinks;
    y->jumps |= results[i].jumps;
    for (int k = 0; k < directions; ++k) y->d[i][k] = results[i].at(k);
  }
}
