// Batches: each impact is a column of the tables. The lanes of a vector hold adjacent columns.
#pragma once
#include "answer_bound.hpp"
#include "numbers.hpp"
#include "constants.hpp"

enum { ENERGIES = OUT_ENERGY_LOST_FRICTION - OUT_KINETIC_ENERGY_BEFORE + 1 };

// The rows of inputs and results, all of float or all of double. A result that is not wanted is null.
struct Batch {
  // The places of the results: those of velocities are by axis and body. Energies are wanted if regimes are.
  enum { VELOCITY, ANGULAR_VELOCITY = 6, IMPULSE = 12, ERROR_BOUND = 15, ENERGY, RESULTS = ENERGY + ENERGIES };

  const void* row[INPUTS];  // in the order of the layout
  bool is_shared[INPUTS];  // whether a row is one number for all impacts
  void* result[RESULTS];
  unsigned char *status, *regime, *adjustments;  // adjustments are wanted if regimes are
};
using BatchKernel = void (*)(const Batch& batch, long from, long to);

// How many columns ahead the rows are fetched: there are more rows than a processor fetches ahead by itself.
constexpr long AHEAD = 16;

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

template <class T> INLINE T adjustment(Mask<T> is_made, int code) {
  return choose<T>(is_made, broadcast<T>(code), T{});
}

// The code of what is wrong with each impact, 0 if nothing is. Most pass the quick check, clearly_valid.
template <auto validity, auto clearly_valid, class T>
INLINE T find_fault(const T* x) {
  Mask<T> sound;
  clearly_valid(x, nullptr, nullptr, &sound);
  if (!any(negation(sound))) return T{};
  T fault;
  Mask<T> flags[VALIDITY_FLAGS];
  validity(x, nullptr, &fault, flags);
  return fault;
}

// What a kernel of a layout reads.
template <int layout> struct LayoutInputs {
  static constexpr const TableLayout& table = table_layouts[layout];
  static constexpr int body = table.body_rows, count = 2 * body + table.contact_rows + MODEL;
  // The first input that may be one number for all impacts: friction, because the tables of FRICTIONLESS lack it.
  static constexpr int first_shared = layout == LAYOUT_EVERYTHING ? 0 : 2 * body + table.contact_rows - 1;

  template <class T> INLINE T mass(const T* x) { return x[table.body[BODY_MASS]]; }
  // Trace of the inertia tensor of a body.
  template <class T> INLINE T trace(const T* x) {
    if constexpr (table.body[BODY_INERTIA_XX] < 0) return T{};
    else return x[table.body[BODY_INERTIA_XX]] + x[table.body[BODY_INERTIA_YY]] + x[table.body[BODY_INERTIA_ZZ]];
  }
};

// Compute as many columns as there are lanes, from column `at` on. The emitted functions impact, validity and
// clearly_valid are template arguments because GCC would clone all of this for function arguments.
template <class N, int layout, auto impact, auto validity, auto clearly_valid>
static __attribute__((noinline)) void compute_lanes(const Batch& batch, long at) {
  using T = Base<N>;
  using Inputs = LayoutInputs<layout>;
  T x[Inputs::count];
  UNROLLED for (int i = 0; i < Inputs::count; ++i) {
    auto row = static_cast<const Lane<T>*>(batch.row[i]);
    bool is_shared = i >= Inputs::first_shared && batch.is_shared[i];
    x[i] = is_shared ? T{} + *row : load<T>(row + at);
    if (lanes<T> > 1 && !is_shared) __builtin_prefetch(row + at + AHEAD);
  }
  N in[Inputs::count], changes[CHANGES];
  UNROLLED for (int i = 0; i < Inputs::count; ++i)
    in[i] = Make<N>::read(x[i], T{});
  T fault = find_fault<validity, clearly_valid>(x);
  Report<N> reported[REPORTED];
  Mask<T> flags[FLAGS];
  impact(in, changes, reported, flags);

  T sum = high(changes[0]) + high(changes[1]) + high(changes[2]);
  UNROLLED for (int i = 0; i < 12; i += 3)
    sum += reported[i] + reported[i + 1] + reported[i + 2];
  T status = choose<T>(flags[FLAG_SEPARATING], broadcast<T>(STATUS_SEPARATING), broadcast<T>(STATUS_OK));
  // Numbers without error bounds may have too few digits.
  constexpr int fault_of_numbers = std::is_same_v<N, T> ? FLAG_GAINS_ENERGY : FLAG_UNPHYSICAL;
  status = choose<T>(flags[fault_of_numbers], broadcast<T>(STATUS_INTERNAL_ERROR), status);
  status = choose<T>(flags[FLAG_UNFINISHED], broadcast<T>(STATUS_PATH_TOO_LONG), status);
  status = choose<T>((sum - sum == 0) & negation(flags[FLAG_OUT_OF_RANGE]), status, broadcast<T>(STATUS_OUT_OF_RANGE));
  // Unlikely, so that the compiler moves what only this needs in here.
  if (__builtin_expect(batch.regime != nullptr, 0)) {
    T energies{};
    UNROLLED for (int k = 0; k < ENERGIES; ++k)
      energies += reported[OUT_KINETIC_ENERGY_BEFORE + k];
    status = choose<T>(energies - energies == 0, status, broadcast<T>(STATUS_OUT_OF_RANGE));
  }
  status = choose<T>(fault == 0, status, fault);
  Mask<T> answered = status <= broadcast<T>(STATUS_SEPARATING);
  T nan = broadcast<T>(__builtin_nan(""));
  UNROLLED for (int k = 0; k < 3; ++k) {
    UNROLLED for (int side = 0; side < 2; ++side) {
      store<T>(batch.result[Batch::VELOCITY + 2 * k + side], at, choose<T>(answered, reported[6 * side + k], nan));
      store<T>(batch.result[Batch::ANGULAR_VELOCITY + 2 * k + side], at,
               choose<T>(answered, reported[6 * side + 3 + k], nan));
    }
    store<T>(batch.result[Batch::IMPULSE + k], at, choose<T>(answered, high(changes[k]), nan));
  }
  if constexpr (!std::is_same_v<N, T>) {
    T mass[2] = {Inputs::mass(x), Inputs::mass(x + Inputs::body)},
      trace[2] = {Inputs::trace(x), Inputs::trace(x + Inputs::body)};
    store<T>(batch.result[Batch::ERROR_BOUND], at, choose<T>(answered, error_bound<N>(changes, mass, trace), nan));
  }
  store_codes<T>(batch.status + at, status);
  if (__builtin_expect(batch.regime != nullptr, 0)) {
    UNROLLED for (int k = 0; k < ENERGIES; ++k)
      store<T>(batch.result[Batch::ENERGY + k], at, choose<T>(answered, reported[OUT_KINETIC_ENERGY_BEFORE + k], nan));
    store_codes<T>(batch.regime + at, choose<T>(answered, reported[OUT_REGIME], T{}));
    T adjustments = adjustment<T>(flags[FLAG_BELOW_THRESHOLD], ADJUSTMENT_RESTITUTION_THRESHOLD) +
                    adjustment<T>(flags[FLAG_FELL_BACK], ADJUSTMENT_LAW_FALLBACK) +
                    adjustment<T>(flags[FLAG_MASSLESS_SPIN], ADJUSTMENT_MASSLESS_SPIN);
    store_codes<T>(batch.adjustments + at, choose<T>(answered, adjustments, T{}));
  }
}

// Compute the columns from `from` to `to`. After the first lanes, results fill whole cache lines, if their rows begin at
// the same place in one: lines written in part take twice the time. Columns left over at either end are computed
// together with some next to them. If there are fewer columns than lanes, they are copied and padded with the first.
template <class N, int layout, auto impact, auto validity, auto clearly_valid>
INLINE void compute_columns(const Batch& batch, long from, long to) {
  using T = Base<N>;
  constexpr long width = lanes<T>;
  if (to - from >= width) {
    compute_lanes<N, layout, impact, validity, clearly_valid>(batch, from);
    const auto first =
        reinterpret_cast<std::uintptr_t>(static_cast<const Lane<T>*>(batch.result[Batch::VELOCITY]) + from);
    const long done = width - static_cast<long>(first / sizeof(Lane<T>)) % width;
    for (long at = from + done; at < to; at += width)
      compute_lanes<N, layout, impact, validity, clearly_valid>(batch, at + width <= to ? at : to - width);
    return;
  }
  constexpr int count = LayoutInputs<layout>::count;
  Lane<T> inputs[count][width], results[Batch::RESULTS][width];
  unsigned char status[width], regime[width], adjustments[width];
  Batch padded = batch;
  for (int i = 0; i < count; ++i) {
    for (long k = 0; k < width; ++k) {
      long at = from + (k < to - from ? k : 0);
      inputs[i][k] = static_cast<const Lane<T>*>(batch.row[i])[batch.is_shared[i] ? 0 : at];
    }
    padded.row[i] = inputs[i];
    padded.is_shared[i] = false;
  }
  for (int i = 0; i < Batch::RESULTS; ++i) padded.result[i] = batch.result[i] ? results[i] : nullptr;
  padded.status = status;
  if (padded.regime) padded.regime = regime, padded.adjustments = adjustments;
  compute_lanes<N, layout, impact, validity, clearly_valid>(padded, 0);
  for (int i = 0; i < Batch::RESULTS; ++i)
    for (long k = 0; batch.result[i] && k < to - from; ++k)
      static_cast<Lane<T>*>(batch.result[i])[from + k] = results[i][k];
  for (long k = 0; k < to - from; ++k) {
    batch.status[from + k] = status[k];
    if (batch.regime) batch.regime[from + k] = regime[k], batch.adjustments[from + k] = adjustments[k];
  }
}
