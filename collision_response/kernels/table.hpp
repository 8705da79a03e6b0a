// Which kernel computes what: by law, as numbered in Python, and precision or layout.
#pragma once
#include "batch.hpp"
#include "single.hpp"

using Kernel = void (*)(const double* x, const double* error, Numbers* y);

extern "C" void check_everything(const double* x, double* fault, bool* shapes);
extern "C" void check_articulated(const double* x, double* fault, bool* shapes);

#define ONE(name) extern "C" void impact_##name(const double*, const double*, Numbers*);
#define X(law, number)                \
  ONE(law##_everything_bounded_base)  \
  ONE(law##_everything_extended_base) \
  ONE(law##_articulated_bounded_base) \
  ONE(law##_articulated_extended_base)
EACH_OF_LAWS(X)
#undef X
#define X(law, number)                \
  ONE(law##_everything_bounded_base)  \
  ONE(law##_articulated_bounded_base)
EACH_OF_STEPPED_LAWS(X)
#undef X
#define X(law, number) ONE(law##_everything_single_base)
EACH_OF_LAWS_IN_FLOAT32(X)
#undef X
#ifdef WITH_LONG_VECTORS
#define X(law, number) ONE(law##_everything_bounded_avx2)
EACH_OF_LAWS(X)
#undef X
#define X(law, number) ONE(law##_everything_extended_avx2)
EACH_OF_LAWS_IN_FLOAT32(X)
#undef X
#endif
#undef ONE

static long longest_vectors = 512;  // bits that may be used: tests compare the levels of the machine

#ifdef WITH_LONG_VECTORS
static const bool has_256_bits = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#ifdef WITH_512_BITS
static const bool has_512_bits = has_256_bits && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                                 __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
#endif
#endif

struct Row { int law; bool articulated; int precision; Kernel kernel; };

// By law, whether a body is articulated, and precision: the fastest that the machine has. Where a precision has no
// kernel of its own, it becomes DOUBLE.
static Kernel kernel_of(int law, bool articulated, int& precision) {
  auto find = [&](const auto& table) -> Kernel {
    for (const Row& row : table)
      if (row.law == law && row.articulated == articulated && row.precision == precision) return row.kernel;
    return nullptr;
  };
#ifdef WITH_LONG_VECTORS
  static const Row of_256_bits[] = {
#define X(law, number) {number, false, PRECISION_DOUBLE, impact_##law##_everything_bounded_avx2},
      EACH_OF_LAWS(X)
#undef X
#define X(law, number) {number, false, PRECISION_EXTENDED, impact_##law##_everything_extended_avx2},
      EACH_OF_LAWS_IN_FLOAT32(X)
#undef X
  };
  if (has_256_bits && longest_vectors >= 256)
    if (Kernel kernel = find(of_256_bits)) return kernel;
#endif
  static const Row every_machine[] = {
#define X(law, number)                                                    \
  {number, false, PRECISION_DOUBLE, impact_##law##_everything_bounded_base},        \
  {number, false, PRECISION_EXTENDED, impact_##law##_everything_extended_base},     \
  {number, true, PRECISION_DOUBLE, impact_##law##_articulated_bounded_base},        \
  {number, true, PRECISION_EXTENDED, impact_##law##_articulated_extended_base},
      EACH_OF_LAWS(X)
#undef X
#define X(law, number)                                                    \
  {number, false, PRECISION_DOUBLE, impact_##law##_everything_bounded_base},        \
  {number, true, PRECISION_DOUBLE, impact_##law##_articulated_bounded_base},
      EACH_OF_STEPPED_LAWS(X)
#undef X
#define X(law, number) {number, false, PRECISION_SINGLE, impact_##law##_everything_single_base},
      EACH_OF_LAWS_IN_FLOAT32(X)
#undef X
  };
  Kernel kernel = find(every_machine);
  if (kernel || precision == PRECISION_DOUBLE) return kernel;
  precision = PRECISION_DOUBLE;
  return kernel_of(law, articulated, precision);
}

#define DECLARE(name) extern "C" void batch_##name(const Batch&, long, long);
#define X(law, number)                   \
  DECLARE(law##_everything_plain_base)   \
  DECLARE(law##_everything_bounded_base) \
  DECLARE(law##_everything_extended_base)
EACH_OF_LAWS(X)
#undef X
#define X(law, number) DECLARE(law##_everything_bounded_base)
EACH_OF_STEPPED_LAWS(X)
#undef X
#define X(law, number) DECLARE(law##_everything_float_base)
EACH_OF_LAWS_IN_FLOAT32(X)
#undef X
#ifdef WITH_512_BITS
#define X(law, number)                         \
  DECLARE(law##_everything_bounded_avx512)     \
  DECLARE(law##_everything_extended_avx512)    \
  DECLARE(law##_spatial_plain_avx512)          \
  DECLARE(law##_spatial_oriented_plain_avx512)
EACH_OF_USUAL_LAWS(X)
#undef X
#endif
#ifdef WITH_LONG_VECTORS
#define X(law, number)            \
  DECLARE(law##_point_plain_avx2) \
  DECLARE(law##_point_float_avx2)
EACH_OF_USUAL_LAWS(X)
#undef X
#define X(law, number)                       \
  DECLARE(law##_planar_plain_avx2)           \
  DECLARE(law##_spatial_plain_avx2)          \
  DECLARE(law##_spatial_oriented_plain_avx2) \
  DECLARE(law##_everything_bounded_avx2)     \
  DECLARE(law##_everything_extended_avx2)
EACH_OF_LAWS(X)
#undef X
#define X(law, number)              \
  DECLARE(law##_planar_float_avx2)  \
  DECLARE(law##_spatial_float_avx2) \
  DECLARE(law##_spatial_oriented_float_avx2)
EACH_OF_LAWS_IN_FLOAT32(X)
#undef X
#endif
#undef DECLARE

struct BatchRow { int law, layout, number; BatchKernel kernel; };

// By law, layout and number; null if that layout has no kernel of its own on this machine.
static BatchKernel batch_kernel(int law, int layout, int number) {
  auto find = [=](const auto& table) -> BatchKernel {
    for (const BatchRow& row : table)
      if (row.law == law && row.layout == layout && row.number == number) return row.kernel;
    return nullptr;
  };
#ifdef WITH_512_BITS
  static const BatchRow of_512_bits[] = {
#define X(law, number)                                                                   \
  {number, LAYOUT_SPATIAL, NUMBER_PLAIN, batch_##law##_spatial_plain_avx512},                   \
  {number, LAYOUT_SPATIAL_ORIENTED, NUMBER_PLAIN, batch_##law##_spatial_oriented_plain_avx512}, \
  {number, LAYOUT_EVERYTHING, NUMBER_BOUNDED, batch_##law##_everything_bounded_avx512},         \
  {number, LAYOUT_EVERYTHING, NUMBER_EXTENDED, batch_##law##_everything_extended_avx512},
      EACH_OF_USUAL_LAWS(X)
#undef X
  };
  if (has_512_bits && longest_vectors >= 512)
    if (BatchKernel kernel = find(of_512_bits)) return kernel;
#endif
#ifdef WITH_LONG_VECTORS
  static const BatchRow of_256_bits[] = {
#define X(law, number)                                                                    \
  {number, LAYOUT_PLANAR, NUMBER_PLAIN, batch_##law##_planar_plain_avx2},                        \
  {number, LAYOUT_SPATIAL, NUMBER_PLAIN, batch_##law##_spatial_plain_avx2},                      \
  {number, LAYOUT_SPATIAL_ORIENTED, NUMBER_PLAIN, batch_##law##_spatial_oriented_plain_avx2},    \
  {number, LAYOUT_EVERYTHING, NUMBER_BOUNDED, batch_##law##_everything_bounded_avx2},            \
  {number, LAYOUT_EVERYTHING, NUMBER_EXTENDED, batch_##law##_everything_extended_avx2},
      EACH_OF_LAWS(X)
#undef X
#define X(law, number)                                                                    \
  {number, LAYOUT_PLANAR, NUMBER_FLOAT, batch_##law##_planar_float_avx2},                        \
  {number, LAYOUT_SPATIAL, NUMBER_FLOAT, batch_##law##_spatial_float_avx2},                      \
  {number, LAYOUT_SPATIAL_ORIENTED, NUMBER_FLOAT, batch_##law##_spatial_oriented_float_avx2},
      EACH_OF_LAWS_IN_FLOAT32(X)
#undef X
#define X(law, number)                                          \
  {number, LAYOUT_POINT, NUMBER_PLAIN, batch_##law##_point_plain_avx2}, \
  {number, LAYOUT_POINT, NUMBER_FLOAT, batch_##law##_point_float_avx2},
      EACH_OF_USUAL_LAWS(X)
#undef X
  };
  if (has_256_bits && longest_vectors >= 256)
    if (BatchKernel kernel = find(of_256_bits)) return kernel;
#endif
  static const BatchRow every_machine[] = {
#define X(law, number)                                                         \
  {number, LAYOUT_EVERYTHING, NUMBER_PLAIN, batch_##law##_everything_plain_base},     \
  {number, LAYOUT_EVERYTHING, NUMBER_BOUNDED, batch_##law##_everything_bounded_base}, \
  {number, LAYOUT_EVERYTHING, NUMBER_EXTENDED, batch_##law##_everything_extended_base},
      EACH_OF_LAWS(X)
#undef X
#define X(law, number) {number, LAYOUT_EVERYTHING, NUMBER_FLOAT, batch_##law##_everything_float_base},
      EACH_OF_LAWS_IN_FLOAT32(X)
#undef X
#define X(law, number)                                                     \
  {number, LAYOUT_EVERYTHING, NUMBER_PLAIN, batch_##law##_everything_bounded_base},   \
  {number, LAYOUT_EVERYTHING, NUMBER_BOUNDED, batch_##law##_everything_bounded_base}, \
  {number, LAYOUT_EVERYTHING, NUMBER_EXTENDED, batch_##law##_everything_bounded_base},
      EACH_OF_STEPPED_LAWS(X)
#undef X
  };
  return find(every_machine);
}
