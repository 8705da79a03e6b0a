// Many impacts: columns of tables, some at a time in the lanes of vectors.
#pragma once
#include "answer_bound.hpp"
#include "numbers.hpp"
#include "constants.hpp"

enum { ROWS = 2 * ROWS_OF_BODY + ROWS_OF_CONTACT + ROWS_OF_MODEL };
enum { ENERGIES = OUT_ENERGY_LOST_FRICTION - OUT_KINETIC_ENERGY_BEFORE + 1, RESULTS = 12 + 3 + 1 + ENERGIES };

// Where the numbers of a batch are. All are float or all double.
struct Batch {
  const void* row[ROWS];  // in the order of the layout
  bool one_for_all[ROWS];
  void* velocity[3][2];  // null: not wanted
  void* angular_velocity[3][2];
  void* impulse[3];
  void* error_bound;
  void* energy[ENERGIES];
  unsigned char *status, *regime;  // null: no report is wanted, energies neither
};
using BatchKernel = void (*)(const Batch& batch, long from, long to);

#define UNROLLED _Pragma("GCC unroll 64")

template <class T> INLINE T load(const Lane<T>* from) {
  T x;
  std::memcpy(&x, from, sizeof x);
  return x;
}
template <class T> INLINE void store(void* row, long at, T x) {
  if (row) std::memcpy(static_cast<Lane<T>*>(row) + at, &x, sizeof x);
}
template <class T> INLINE void store_codes(unsigned char* to, T codes) {
  for (std::size_t lane = 0; lane < lanes<T>; ++lane) {
    if constexpr (is_scalar<T>) *to = static_cast<unsigned char>(codes);
    else to[lane] = static_cast<unsigned char>(codes[lane]);
  }
}

// The code of what is wrong with each, 0 if nothing is. Most are plainly sound.
template <auto validity, auto plainly_sound, class T>
INLINE T fault_of(const T* x) {
  Mask<T> sound;
  plainly_sound(x, nullptr, nullptr, &sound);
  if (!any(negation(sound))) return T{};
  T fault;
  Mask<T> shapes[5];
  validity(x, nullptr, &fault, shapes);
  return fault;
}

// What becomes of `lanes` columns from `at` on.
//   Layout                            its counts: inputs, places of masses and moments among them
//   impact, validity, plainly_sound   the traced programs; not arguments, or GCC clones all this to have them known
template <class N, class Layout, auto impact, auto validity, auto plainly_sound>
static __attribute__((noinline)) void some_impacts(const Batch& batch, long at) {
  using T = Base<N>;
  T x[Layout::inputs];
  UNROLLED for (int i = 0; i < Layout::inputs; ++i) {
    auto row = static_cast<const Lane<T>*>(batch.row[i]);
    bool fixed = i < Layout::given ? false : batch.one_for_all[i];
    if constexpr (Layout::any_may_be_one_for_all) fixed = batch.one_for_all[i];
    x[i] = fixed ? T{} + *row : load<T>(row + at);
  }
  N in[Layout::inputs], changes[CHANGES];
  UNROLLED for (int i = 0; i < Layout::inputs; ++i) in[i] = Make<N>::read(x[i], T{});
  T fault = fault_of<validity, plainly_sound>(x);
  Report<N> reported[REPORTED];
  Mask<T> flags[FLAGS];
  impact(in, changes, reported, flags);

  T sum = high(changes[0]) + high(changes[1]) + high(changes[2]);
  UNROLLED for (int i = 0; i < 12; i += 3) sum += reported[i] + reported[i + 1] + reported[i + 2];
  T status = choose<T>(flags[FLAG_SEPARATING], spread<T>(STATUS_SEPARATING), spread<T>(STATUS_OK));
  status = choose<T>(flags[FLAG_UNPHYSICAL], spread<T>(STATUS_INTERNAL_ERROR), status);
  status = choose<T>(flags[FLAG_UNFINISHED], spread<T>(STATUS_PATH_TOO_LONG), status);
  status = choose<T>((sum - sum == 0) & negation(flags[FLAG_OUT_OF_RANGE]), status, spread<T>(STATUS_OUT_OF_RANGE));
  if (__builtin_expect(batch.regime != nullptr, 0)) {  // the compiler moves what leads to it in here
    T energies{};
    UNROLLED for (int k = 0; k < ENERGIES; ++k) energies += reported[OUT_KINETIC_ENERGY_BEFORE + k];
    status = choose<T>(energies - energies == 0, status, spread<T>(STATUS_OUT_OF_RANGE));
  }
  status = choose<T>(fault == 0, status, fault);
  Mask<T> answered = status <= spread<T>(STATUS_SEPARATING);
  T none = spread<T>(__builtin_nan(""));
  UNROLLED for (int k = 0; k < 3; ++k) {
    UNROLLED for (int side = 0; side < 2; ++side) {
      store<T>(batch.velocity[k][side], at, choose<T>(answered, reported[6 * side + k], none));
      store<T>(batch.angular_velocity[k][side], at, choose<T>(answered, reported[6 * side + 3 + k], none));
    }
    store<T>(batch.impulse[k], at, choose<T>(answered, high(changes[k]), none));
  }
  if constexpr (!std::is_same_v<N, T>) {
    T mass[2] = {x[0], x[Layout::body]}, trace[2];
    for (int side = 0; side < 2; ++side) trace[side] = Layout::trace(x + side * Layout::body);
    store<T>(batch.error_bound, at, choose<T>(answered, error_bound<N>(changes, mass, trace), none));
  }
  store_codes<T>(batch.status + at, status);
  if (__builtin_expect(batch.regime != nullptr, 0)) {
    UNROLLED for (int k = 0; k < ENERGIES; ++k)
      store<T>(batch.energy[k], at, choose<T>(answered, reported[OUT_KINETIC_ENERGY_BEFORE + k], none));
    store_codes<T>(batch.regime + at, choose<T>(answered, reported[OUT_REGIME], T{}));
  }
}

// All columns from `from` to `to`: the last ones together with some before them; a few by themselves.
template <class N, class Layout, auto impact, auto validity, auto plainly_sound>
INLINE void all_impacts(const Batch& batch, long from, long to) {
  using T = Base<N>;
  constexpr long width = lanes<T>;
  if (to - from >= width) {
    for (long at = from; at < to; at += width)
      some_impacts<N, Layout, impact, validity, plainly_sound>(batch, at + width <= to ? at : to - width);
    return;
  }
  Lane<T> given[Layout::inputs][width], results[RESULTS][width];
  unsigned char status[width], regime[width];
  Batch few = batch;
  for (int i = 0; i < Layout::inputs; ++i) {
    for (long k = 0; k < width; ++k) {
      long at = from + (k < to - from ? k : 0);
      given[i][k] = static_cast<const Lane<T>*>(batch.row[i])[batch.one_for_all[i] ? 0 : at];
    }
    few.row[i] = given[i];
    few.one_for_all[i] = false;
  }
  void** wanted = &few.velocity[0][0];  // 12 rows of velocities, 3 of the impulse, the bound, the energies
  void* const* there = &batch.velocity[0][0];
  for (int i = 0; i < RESULTS; ++i) wanted[i] = there[i] ? results[i] : nullptr;
  few.status = status;
  if (few.regime) few.regime = regime;
  some_impacts<N, Layout, impact, validity, plainly_sound>(few, 0);
  for (int i = 0; i < RESULTS; ++i)
    for (long k = 0; there[i] && k < to - from; ++k) static_cast<Lane<T>*>(there[i])[from + k] = results[i][k];
  for (long k = 0; k < to - from; ++k) {
    batch.status[from + k] = status[k];
    if (batch.regime) batch.regime[from + k] = regime[k];
  }
}
