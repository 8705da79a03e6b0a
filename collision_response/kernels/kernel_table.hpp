// Which kernel computes what. CMake lists the kernels that it compiles in kernels.inc, those with the longest vectors
// first. Laws, layouts, precisions and number types have the numbers of Python's enumerations.
#pragma once
#include <algorithm>
#include <iterator>

#include "batch.hpp"
#include "one_impact.hpp"

using ImpactKernel = void (*)(const double* input, const double* error, ImpactResult* result);

#define IMPACT_KERNEL(name, ...) extern "C" void impact_##name(const double*, const double*, ImpactResult*);
#define BATCH_KERNEL(name, ...) extern "C" void batch_##name(const Batch&, long, long);
#include "kernels.inc"
#undef IMPACT_KERNEL
#undef BATCH_KERNEL

enum { LEVEL_BASE = 0, LEVEL_AVX2 = 256, LEVEL_AVX512 = 512 };  // instruction sets, by the bits of their vectors
inline long longest_vectors = LEVEL_AVX512;  // that may be used; tests lower it to compare levels

#ifdef __x86_64__
inline const bool has_256_bits = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
inline const bool has_512_bits = has_256_bits && __builtin_cpu_supports("avx512f") &&
                                 __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
                                 __builtin_cpu_supports("avx512bw");
inline bool is_runnable(int level) {
  return level == LEVEL_BASE || (level <= longest_vectors && (level == LEVEL_AVX2 ? has_256_bits : has_512_bits));
}
#else
inline bool is_runnable(int level) { return level == LEVEL_BASE; }
#endif

// A kernel, with its precision (one impact) or number type (batch).
template <class Kernel> struct KernelEntry {
  int formula, layout, number, level;
  Kernel kernel;
};
enum { PRECISION_BOUNDED = PRECISION_DOUBLE };
inline const KernelEntry<ImpactKernel> impact_kernels[] = {
#define IMPACT_KERNEL(name, FORMULA, LAYOUT, NUMBER, LEVEL) \
  {FORMULA_##FORMULA, LAYOUT_##LAYOUT, PRECISION_##NUMBER, LEVEL_##LEVEL, impact_##name},
#define BATCH_KERNEL(...)
#include "kernels.inc"
#undef IMPACT_KERNEL
#undef BATCH_KERNEL
};
inline const KernelEntry<BatchKernel> batch_kernels[] = {
#define IMPACT_KERNEL(...)
#define BATCH_KERNEL(name, FORMULA, LAYOUT, NUMBER, LEVEL) \
  {FORMULA_##FORMULA, LAYOUT_##LAYOUT, NUMBER_##NUMBER, LEVEL_##LEVEL, batch_##name},
#include "kernels.inc"
#undef IMPACT_KERNEL
#undef BATCH_KERNEL
};

// The formula of a law; -1 if there is none, as for a law that Python has since this was compiled.
inline int formula_of_law(int law) { return law < LAW_COUNT ? formula_of[law] : -1; }

// Find the fastest kernel that the machine can run; null if there is none.
template <class Table> auto find_kernel(const Table& kernels, int law, int layout, int number) {
  auto fits = [=, formula = formula_of_law(law)](const auto& entry) {
    return entry.formula == formula && entry.layout == layout && entry.number == number && is_runnable(entry.level);
  };
  auto found = std::find_if(std::begin(kernels), std::end(kernels), fits);
  return found == std::end(kernels) ? nullptr : found;
}

// Find the kernel for one impact. If there is none of this precision, that of DOUBLE serves. Null if the law is unknown.
inline auto find_impact_kernel(int law, bool articulated, int precision) {
  const int layout = articulated ? LAYOUT_ARTICULATED : LAYOUT_EVERYTHING;
  auto found = find_kernel(impact_kernels, law, layout, precision);
  return found ? found : find_kernel(impact_kernels, law, layout, PRECISION_DOUBLE);
}

// Find the kernel for batches. If there is none for this layout, that of EVERYTHING serves; if there is none for this
// number type, that of BOUNDED. Null if the law is unknown.
inline const KernelEntry<BatchKernel>* find_batch_kernel(int law, int layout, int number_type) {
  if (auto found = find_kernel(batch_kernels, law, layout, number_type)) return found;
  if (layout != LAYOUT_EVERYTHING) return find_batch_kernel(law, LAYOUT_EVERYTHING, number_type);
  const bool has_substitute = number_type == NUMBER_PLAIN || number_type == NUMBER_EXTENDED;
  return has_substitute ? find_batch_kernel(law, layout, NUMBER_BOUNDED) : nullptr;
}
