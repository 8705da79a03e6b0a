// Dual<N, D>: a number that carries its derivatives, one more number type for the emitted formulas (forward mode).
//
//   N   the number type of the value
//   D   the derivatives in some directions:
//         DenseDerivatives    in 16, all stored
//         SparseDerivatives   in up to 56; only the range that may differ from 0 is stored
//
// A branch is taken by the value. Where the value leaves a comparison open, or both sides are equal, the directions in
// which the sides differ are kept: a choice by that comparison has an edge there. The edge is a kink if both branches
// have the same value, else a jump. A factor of 0 that does not jump itself turns a jump into a kink, and removes a
// kink.
//
// Comparisons in the body of a loop mark no edges.
#pragma once
#include "numbers.hpp"

#include <algorithm>
#include <memory>
#include <vector>

typedef double Block __attribute__((vector_size(32)));  // the derivatives in four directions
using Edges = std::uint64_t;  // a set of directions: a bit for each

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_EACH_LEVEL __attribute__((target_clones("avx2", "default")))
#else
#define FOR_EACH_LEVEL
#endif
#define NOT_INLINED FOR_EACH_LEVEL static __attribute__((noinline, unused))

INLINE void multiply(Block* y, const Block* a, double by, int count) {
  for (int k = 0; k < count; ++k) y[k] = a[k] * by;
}
INLINE void blend(Block* y, const Block* a, double by_a, const Block* b, double by_b, int count) {
  for (int k = 0; k < count; ++k) y[k] = a[k] * by_a + b[k] * by_b;
}

// The directions in which a derivative is not 0, of the blocks in a range.
INLINE Edges nonzero_directions(const Block* d, int begin, int end) {
  Edges nonzero = 0;
  for (int i = 4 * begin; i < 4 * end; ++i) nonzero |= Edges(d[i / 4][i % 4] != 0) << i;
  return nonzero;
}

struct DenseDerivatives {
  static constexpr int BLOCKS = 4, DIRECTIONS = 4 * BLOCKS;
  Block d[BLOCKS];

  Edges nonzero() const { return nonzero_directions(d, 0, BLOCKS); }
  __attribute__((always_inline)) DenseDerivatives scaled(double by) const {
    DenseDerivatives y;
    multiply(y.d, d, by, BLOCKS);
    return y;
  }
  __attribute__((always_inline)) DenseDerivatives blended(double by, const DenseDerivatives& b, double by_b) const {
    DenseDerivatives y;
    blend(y.d, d, by, b.d, by_b, BLOCKS);
    return y;
  }
};

// Memory for sparse derivatives. They are written once and shared by copies; for each impact the arena is reset.
struct Arena {
  Block *next, *end;
  std::size_t chunks;
};
static thread_local Arena arena __attribute__((tls_model("initial-exec")));
constexpr int CHUNK = 1 << 14;

static __attribute__((noinline, cold, unused)) void grow_arena(std::size_t chunk) {
  static thread_local std::vector<std::unique_ptr<Block[]>> chunks;
  if (chunk == chunks.size()) chunks.emplace_back(new Block[CHUNK]);
  arena = {chunks[chunk].get(), chunks[chunk].get() + CHUNK, chunk + 1};
}

struct SparseDerivatives {
  static constexpr int BLOCKS = 14, DIRECTIONS = 4 * BLOCKS;
  int begin, end;  // the blocks that may differ from 0
  Block* d;  // stored from d[begin] on

  SparseDerivatives() = default;
  SparseDerivatives(int first, int last) : begin(first), end(last) {  // not initialised
    if (first >= last) return;
    if (arena.end - arena.next < BLOCKS) grow_arena(arena.chunks);
    d = arena.next - first;
    arena.next += last - first;
  }
  double at(int direction) const {
    int block = direction / 4;
    return begin <= block && block < end ? d[block][direction % 4] : 0;
  }
  Edges nonzero() const { return nonzero_directions(d, begin, end); }
  __attribute__((always_inline)) SparseDerivatives scaled(double by) const {
    SparseDerivatives y(begin, end);
    if (begin < end) multiply(y.d + begin, d + begin, by, end - begin);
    return y;
  }
  __attribute__((always_inline)) SparseDerivatives blended(double by, const SparseDerivatives& b, double by_b) const {
    if (b.begin >= b.end) return scaled(by);
    if (begin >= end) return b.scaled(by_b);
    SparseDerivatives y(std::min(begin, b.begin), std::max(end, b.end));
    // Blocks that only one of them has are scaled; those of both are blended.
    int overlap_begin = std::max(begin, b.begin), overlap_end = std::min(end, b.end);
    if (overlap_begin >= overlap_end) {
      for (int k = overlap_end; k < overlap_begin; ++k) y.d[k] = Block{};
      multiply(y.d + begin, d + begin, by, end - begin);
      multiply(y.d + b.begin, b.d + b.begin, by_b, b.end - b.begin);
      return y;
    }
    if (begin < overlap_begin) multiply(y.d + begin, d + begin, by, overlap_begin - begin);
    if (b.begin < overlap_begin) multiply(y.d + b.begin, b.d + b.begin, by_b, overlap_begin - b.begin);
    blend(y.d + overlap_begin, d + overlap_begin, by, b.d + overlap_begin, by_b, overlap_end - overlap_begin);
    if (overlap_end < end) multiply(y.d + overlap_end, d + overlap_end, by, end - overlap_end);
    if (overlap_end < b.end) multiply(y.d + overlap_end, b.d + overlap_end, by_b, b.end - overlap_end);
    return y;
  }
};

template <class N, class D>
struct Dual {
  using Number = N;
  using Derivatives = D;
  N value;
  Edges kinks, jumps;
  D d;

  Dual() = default;
  Dual(N value) : value(value), kinks(0), jumps(0), d() {}
  Dual(N value, Edges kinks, Edges jumps, const D& d) : value(value), kinks(kinks), jumps(jumps), d(d) {}
  template <class M> Dual(N value, const Dual<M, D>& a) : Dual(value, a.kinks, a.jumps, a.d) {}

  double at(int direction) const { return d.at(direction); }
};
template <class N> using Number = typename N::Number;

template <class N, class D> struct Traits<Dual<N, D>> {
  using Base = typename Traits<N>::Base;
  using Value = Dual<typename Traits<N>::Value, D>;
  using Report = typename Traits<N>::Report;
  static constexpr double roundoff = Traits<N>::roundoff;
};

#define DUAL template <class N, class D>
DUAL INLINE Dual<N, D> scaled(N value, const Dual<N, D>& a, double by) {
  return {value, by == 0 ? a.jumps : a.kinks, by == 0 ? 0 : a.jumps, a.d.scaled(by)};
}
// A number with the derivatives by_a a' + by_b b'.
DUAL INLINE Dual<N, D> combined(N value, const Dual<N, D>& a, double by_a, const Dual<N, D>& b, double by_b) {
  Edges kinks = 0, jumps = 0;
  if (a.kinks | a.jumps | b.kinks | b.jumps) {
    kinks = (by_a == 0 ? a.jumps : a.kinks) | (by_b == 0 ? b.jumps : b.kinks);
    jumps = (a.jumps & b.jumps) | (by_a == 0 ? 0 : a.jumps) | (by_b == 0 ? 0 : b.jumps);
  }
  return {value, kinks, jumps, a.d.blended(by_a, b.d, by_b)};
}

DUAL NOT_INLINED Dual<N, D> operator+(const Dual<N, D>& a, const Dual<N, D>& b) {
  return combined(a.value + b.value, a, 1, b, 1);
}
DUAL NOT_INLINED Dual<N, D> operator-(const Dual<N, D>& a, const Dual<N, D>& b) {
  return combined(a.value - b.value, a, 1, b, -1);
}
DUAL NOT_INLINED Dual<N, D> operator-(const Dual<N, D>& a) { return scaled(-a.value, a, -1); }
DUAL NOT_INLINED Dual<N, D> operator*(const Dual<N, D>& a, const Dual<N, D>& b) {
  return combined(a.value * b.value, a, high(b.value), b, high(a.value));
}
DUAL NOT_INLINED Dual<N, D> operator/(const Dual<N, D>& a, const Dual<N, D>& b) {
  N q = a.value / b.value;
  double by = 1 / high(b.value);
  return combined(q, a, by, b, -high(q) * by);
}
// Operations with a number that has no derivatives.
DUAL NOT_INLINED Dual<N, D> operator+(const Dual<N, D>& a, const N& b) { return {a.value + b, a}; }
DUAL NOT_INLINED Dual<N, D> operator+(const N& a, const Dual<N, D>& b) { return {a + b.value, b}; }
DUAL NOT_INLINED Dual<N, D> operator-(const Dual<N, D>& a, const N& b) { return {a.value - b, a}; }
DUAL NOT_INLINED Dual<N, D> operator-(const N& a, const Dual<N, D>& b) { return scaled(a - b.value, b, -1); }
DUAL NOT_INLINED Dual<N, D> operator*(const Dual<N, D>& a, const N& b) { return scaled(a.value * b, a, high(b)); }
DUAL NOT_INLINED Dual<N, D> operator*(const N& a, const Dual<N, D>& b) { return scaled(a * b.value, b, high(a)); }
DUAL NOT_INLINED Dual<N, D> operator/(const Dual<N, D>& a, const N& b) { return scaled(a.value / b, a, 1 / high(b)); }
DUAL NOT_INLINED Dual<N, D> operator/(const N& a, const Dual<N, D>& b) {
  N q = a / b.value;
  return scaled(q, b, -high(q) / high(b.value));
}
// Derivative of a root s by what is under it. It is taken as 0 at s = 0: that is a sum of squares, whose slope is 0
// too.
INLINE double slope_of_root(double s) { return s > 0 ? 0.5 / s : 0; }
DUAL NOT_INLINED Dual<N, D> root(const Dual<N, D>& a) {
  N s = root(a.value);
  return scaled(s, a, a.d.nonzero() ? 0.5 / high(s) : slope_of_root(high(s)));
}
// log(1 + x) / x and (exp(x) - 1) / x: the results have no derivatives.
INLINE double log1p_over(double x) { return x == 0 ? 1 : std::log1p(x) / x; }
INLINE double expm1_over(double x) { return x == 0 ? 1 : std::expm1(x) / x; }
DUAL NOT_INLINED Dual<N, D> log1p_over(const Dual<N, D>& a) { return {lifted<N>(log1p_over(high(a.value)))}; }
DUAL NOT_INLINED Dual<N, D> expm1_over(const Dual<N, D>& a) { return {lifted<N>(expm1_over(high(a.value)))}; }
DUAL INLINE Dual<N, D> varying_as(const Dual<N, D>& x, const Dual<N, D>& y) { return {x.value, y}; }
DUAL INLINE Dual<typename Traits<N>::Value, D> value(const Dual<N, D>& a) { return {value(a.value), a}; }
DUAL INLINE Report<N> report(const Dual<N, D>& a) { return report(a.value); }

// A number with derivatives in four directions, for the body of a loop. There the values are computed before, so the
// operations give only the derivatives of their results. A double is a number without derivatives.
struct Dual4 {
  double value;
  Block d;
};
INLINE Block derivatives_of(const Dual4& a) { return a.d; }
INLINE Block derivatives_of(double) { return Block{}; }
INLINE Block operator+(const Dual4& a, const Dual4& b) { return a.d + b.d; }
INLINE Block operator+(const Dual4& a, double) { return a.d; }
INLINE Block operator+(double, const Dual4& b) { return b.d; }
INLINE Block operator-(const Dual4& a, const Dual4& b) { return a.d - b.d; }
INLINE Block operator-(const Dual4& a, double) { return a.d; }
INLINE Block operator-(double, const Dual4& b) { return -b.d; }
INLINE Block operator-(const Dual4& a) { return -a.d; }
INLINE Block operator*(const Dual4& a, const Dual4& b) { return a.d * b.value + b.d * a.value; }
INLINE Block operator*(const Dual4& a, double b) { return a.d * b; }
INLINE Block operator*(double a, const Dual4& b) { return b.d * a; }
INLINE Block operator/(const Dual4& a, const Dual4& b) { return (a.d - a.value / b.value * b.d) * (1 / b.value); }
INLINE Block operator/(const Dual4& a, double b) { return a.d * (1 / b); }
INLINE Block operator/(double a, const Dual4& b) { return -(a / b.value * b.d) * (1 / b.value); }
INLINE Block root(const Dual4& a) { return a.d * slope_of_root(root(a.value)); }
template <class X> INLINE Block varying_as(const X&, const Dual4& y) { return y.d; }

// Give the state of a loop the edges of all numbers that the loop reads.
template <class... Outer> INLINE auto share_edges(const Outer&... outer) {
  return [&](auto&... state) {
    Edges kinks = (Edges{} | ... | outer.kinks) | (state.kinks | ...),
          jumps = (Edges{} | ... | outer.jumps) | (state.jumps | ...);
    ((state.kinks = kinks), ...);
    ((state.jumps = jumps), ...);
  };
}

// The directions in which the derivatives of two numbers differ.
DUAL NOT_INLINED Edges differing(const Dual<N, D>& a, const Dual<N, D>& b) { return a.d.blended(1, b.d, -1).nonzero(); }

// The truth of a comparison by values, and the directions in which the smallest step may change it.
struct Decision {
  bool value;
  Edges undecided;
};

INLINE Edges all_directions_if(bool holds) { return holds ? ~Edges{} : 0; }
INLINE Decision negation(const Decision& a) { return {!a.value, a.undecided}; }
INLINE Decision operator&(const Decision& a, const Decision& b) {
  return {a.value && b.value, (a.undecided & (all_directions_if(b.value) | b.undecided)) |
                                  (b.undecided & (all_directions_if(a.value) | a.undecided))};
}
INLINE Decision operator|(const Decision& a, const Decision& b) { return negation(negation(a) & negation(b)); }
INLINE bool plain_truth(const Decision& a) { return a.value; }
INLINE bool may_be_true(const Decision& a) { return a.value || a.undecided; }
INLINE Decision choose(const Decision& c, const Decision& a, const Decision& b) { return (c & a) | (negation(c) & b); }

DUAL INLINE bool decision(bool truth, const Dual<N, D>&, const Dual<N, D>&) { return truth; }
DUAL INLINE Decision decision(const Truth<double>& truth, const Dual<N, D>& a, const Dual<N, D>& b) {
  return {truth.value, !truth.certain || high(a.value) == high(b.value) ? differing(a, b) : 0};
}
DUAL NOT_INLINED auto less(const Dual<N, D>& a, const Dual<N, D>& b) { return decision(less(a.value, b.value), a, b); }
DUAL NOT_INLINED auto less_equal(const Dual<N, D>& a, const Dual<N, D>& b) {
  return decision(less_equal(a.value, b.value), a, b);
}
// Numbers whose derivatives differ do not count as equal: a condition that holds at one point only must not choose a
// formula.
DUAL NOT_INLINED auto equal(const Dual<N, D>& a, const Dual<N, D>& b) {
  return truth<Dual<N, D>>(high(a.value) == high(b.value) && !differing(a, b));
}

DUAL INLINE Dual<N, D> choose(bool c, const Dual<N, D>& a, const Dual<N, D>& b) { return c ? a : b; }
DUAL NOT_INLINED Dual<N, D> choose(const Decision& c, const Dual<N, D>& a, const Dual<N, D>& b) {
  Dual<N, D> y = c.value ? a : b;
  if (!c.undecided) return y;
  const Dual<N, D>& other = c.value ? b : a;
  bool jumps = less(a.value, b.value).certain && high(a.value) != high(b.value);
  y.kinks |= c.undecided & (jumps ? 0 : other.kinks | differing(a, b));
  y.jumps |= c.undecided & (jumps ? ~Edges{} : other.jumps);
  return y;
}

DUAL struct Make<Dual<N, D>> {
  INLINE Dual<N, D> constant(double x) { return {Make<N>::constant(x)}; }
  INLINE bool truth(double, bool x) { return x; }
  template <class M> INLINE Decision truth(const M&, bool x) { return {x, 0}; }
  INLINE auto truth(bool x) { return truth(N{}, x); }
  INLINE Dual<N, D> lifted(const Dual<typename Traits<N>::Value, D>& a) { return {Make<N>::lifted(a.value), a}; }
  INLINE Dual<N, D> lifted(Report<N> a) { return {Make<N>::lifted(a)}; }
};
