// Functions that kernels call instead of having them inline: they take long to compile and are rarely needed. Each is
// compiled once for each number type.
#pragma once
#include "numbers.hpp"

typedef double Doubles __attribute__((vector_size(32)));
typedef float Floats __attribute__((vector_size(32)));
#define NUMBERS_OF_base(X) X(double) X(float) X(Bounded<double>) X(Bounded<float>) X(Bounded<DoubleDouble<double>>)
#define NUMBERS_OF_avx2(X) X(Doubles) X(Floats) X(Bounded<Doubles>) X(Bounded<DoubleDouble<Doubles>>)

#define DECLARE(N) void call_fallback(const N* seen, N* solution);
NUMBERS_OF_base(DECLARE) NUMBERS_OF_avx2(DECLARE)
#undef DECLARE
