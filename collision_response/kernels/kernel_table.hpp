// Which kernel computes what: by law, as numbered in Python, and precision or layout. The build lists all that it
// compiles, the longest vectors first.
#pragma once
#include "batch.hpp"
#include "one_impact.hpp"

using ImpactKernel = void (*)(const double* x, const double* error, ImpactResult* y);

extern "C" void check_everything(const double* x, double* fault, bool* shapes);
extern "C" void check_articulated(const double* x, double* fault, bool* shapes);

#define IMPACT_KERNEL(name, ...) extern "C" void impact_##name(const double*, const double*, ImpactResult*);
#define BATCH_KERNEL(name, ...) extern "C" void batch_##name(const Batch&, long, long);
#include "kernels.inc"
#undef IMPACT_KERNEL
#undef BATCH_KERNEL

enum { LEVEL_BASE = 0, LEVEL_AVX2 = 256, LEVEL_AVX512 = 512 };  // levels, by the bits of their vectors
static long longest_vectors = LEVEL_AVX512;         // that may be used: tests compare the levels of the machine

#ifdef __x86_64__
static const bool has_256_bits = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
static const bool has_512_bits = has_256_bits && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                                 __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
static bool runs(int level) { return level == LEVEL_BASE || (level <= longest_vectors && (level == LEVEL_AVX2 ? has_256_bits : has_512_bits)); }
#else
static bool runs(int level) { return level == LEVEL_BASE; }
#endif

enum { PRECISION_BOUNDED = PRECISION_DOUBLE };
static const struct { int formula, layout, precision, level; ImpactKernel kernel; } kernels_of_one[] = {
#define IMPACT_KERNEL(name, FORMULA, LAYOUT, NUMBER, LEVEL) {FORMULA_##FORMULA, LAYOUT_##LAYOUT, PRECISION_##NUMBER, LEVEL_##LEVEL, impact_##name},
#define BATCH_KERNEL(...)
#include "kernels.inc"
#undef IMPACT_KERNEL
#undef BATCH_KERNEL
};
static const struct { int formula, layout, number, level; BatchKernel kernel; } kernels_of_many[] = {
#define IMPACT_KERNEL(...)
#define BATCH_KERNEL(name, FORMULA, LAYOUT, NUMBER, LEVEL) {FORMULA_##FORMULA, LAYOUT_##LAYOUT, NUMBER_##NUMBER, LEVEL_##LEVEL, batch_##name},
#include "kernels.inc"
#undef IMPACT_KERNEL
#undef BATCH_KERNEL
};

// By law, whether a body is articulated, and precision: the fastest that the machine has. Where a precision has no
// kernel of its own, it becomes DOUBLE.
static ImpactKernel kernel_of(int law, bool articulated, int& precision) {
  int layout = articulated ? LAYOUT_ARTICULATED : LAYOUT_EVERYTHING;
  for (const auto& row : kernels_of_one)
    if (row.formula == formula_of[law] && row.layout == layout && row.precision == precision && runs(row.level)) return row.kernel;
  if (precision == PRECISION_DOUBLE) return nullptr;
  precision = PRECISION_DOUBLE;
  return kernel_of(law, articulated, precision);
}

// By law, layout and number; null if that layout has no kernel of its own on this machine. Of a law with one kernel for
// all precisions that.
static BatchKernel batch_kernel(int law, int layout, int number) {
  for (const auto& row : kernels_of_many)
    if (row.formula == formula_of[law] && row.layout == layout && row.number == number && runs(row.level)) return row.kernel;
  bool is_other = layout == LAYOUT_EVERYTHING && (number == NUMBER_PLAIN || number == NUMBER_EXTENDED);
  return is_other ? batch_kernel(law, layout, NUMBER_BOUNDED) : nullptr;
}
