// Numbers that carry their derivatives: one more number type for the traced formulas.
//
//   Dual<N, D>   N, and its derivatives in some directions:
//     Few        in 16, all written out
//     Many       in up to 56, of which those are kept that may not be 0
//
// A branch is taken by the value. Where the value leaves a comparison open, or both sides are equal, the
// directions in which they part are kept: a choice by it has a kink there if both branches have one value, else
// a jump. A factor of 0, if it does not jump itself, turns a jump into a kink, and a kink into nothing.
//
// What is compared within a loop marks neither kinks nor jumps.
#pragma once
#include "numbers.hpp"

#include <algorithm>
#include <memory>
#include <vector>

typedef double Block __attribute__((vector_size(32)));  // the derivatives in four directions
using Edges = std::uint64_t;                            // a bit for each direction

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_EACH_LEVEL __attribute__((target_clones("avx2", "default")))
#else
#define FOR_EACH_LEVEL
#endif
#define OUT FOR_EACH_LEVEL static __attribute__((noinline, unused))

INLINE void multiply(Block* y, const Block* a, double by, int count) {
  for (int k = 0; k < count; ++k) y[k] = a[k] * by;
}
INLINE void blend(Block* y, const Block* a, double by_a, const Block* b, double by_b, int count) {
  for (int k = 0; k < count; ++k) y[k] = a[k] * by_a + b[k] * by_b;
}

// The directions in which there are any.
INLINE Edges edges_of(const Block* d, int from, int to) {
  Edges some = 0;
  for (int i = 4 * from; i < 4 * to; ++i) some |= Edges(d[i / 4][i % 4] != 0) << i;
  return some;
}

struct Few {
  static constexpr int BLOCKS = 4, DIRECTIONS = 4 * BLOCKS;
  Block d[BLOCKS];

  Edges edges() const { return edges_of(d, 0, BLOCKS); }
  __attribute__((always_inline)) Few scaled(double by) const {
    Few y;
    for (int k = 0; k < BLOCKS; ++k) y.d[k] = d[k] * by;
    return y;
  }
  __attribute__((always_inline)) Few blended(double by, const Few& b, double by_b) const {
    Few y;
    for (int k = 0; k < BLOCKS; ++k) y.d[k] = d[k] * by + b.d[k] * by_b;
    return y;
  }
};

// Where derivatives in many directions lie. They are written once and shared by copies; an impact begins anew.
struct Room { Block *next, *end; std::size_t chunks; };
static thread_local Room room __attribute__((tls_model("initial-exec")));
constexpr int CHUNK = 1 << 14;

static __attribute__((noinline, cold, unused)) void more_room(std::size_t chunk) {
  static thread_local std::vector<std::unique_ptr<Block[]>> all;
  if (chunk == all.size()) all.emplace_back(new Block[CHUNK]);
  room = {all[chunk].get(), all[chunk].get() + CHUNK, chunk + 1};
}

struct Many {
  static constexpr int BLOCKS = 14, DIRECTIONS = 4 * BLOCKS;
  int from = BLOCKS, to = 0;  // the blocks that may not be 0
  Block* d = nullptr;         // of which the first is d[from]

  Many() = default;
  Many(int first, int last) : from(first), to(last) {  // to be written
    if (first >= last) return;
    if (room.end - room.next < BLOCKS) more_room(room.chunks);
    d = room.next - first;
    room.next += last - first;
  }
  double at(int direction) const {
    int block = direction / 4;
    return from <= block && block < to ? d[block][direction % 4] : 0;
  }
  Edges edges() const { return edges_of(d, from, to); }
  __attribute__((always_inline)) Many scaled(double by) const {
    Many y(from, to);
    if (from < to) multiply(y.d + from, d + from, by, to - from);
    return y;
  }
  __attribute__((always_inline)) Many blended(double by, const Many& b, double by_b) const {
    if (b.from >= b.to) return scaled(by);
    if (from >= to) return b.scaled(by_b);
    Many y(std::min(from, b.from), std::max(to, b.to));
    // Where one of them has no derivatives the other is taken alone.
    int low = std::max(from, b.from), high = std::min(to, b.to);
    if (low >= high) {
      for (int k = y.from; k < y.to; ++k) y.d[k] = Block{};
      multiply(y.d + from, d + from, by, to - from);
      multiply(y.d + b.from, b.d + b.from, by_b, b.to - b.from);
      return y;
    }
    if (from < low) multiply(y.d + from, d + from, by, low - from);
    if (b.from < low) multiply(y.d + b.from, b.d + b.from, by_b, low - b.from);
    blend(y.d + low, d + low, by, b.d + low, by_b, high - low);
    if (high < to) multiply(y.d + high, d + high, by, to - high);
    if (high < b.to) multiply(y.d + high, b.d + high, by_b, b.to - high);
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
  using Base = typename Traits<N>::Base; using Value = Dual<typename Traits<N>::Value, D>; using Report = typename Traits<N>::Report;
  static constexpr double roundoff = Traits<N>::roundoff;
};

#define DUAL template <class N, class D>
DUAL INLINE Dual<N, D> scaled(N value, const Dual<N, D>& a, double by) {
  return {value, by == 0 ? a.jumps : a.kinks, by == 0 ? 0 : a.jumps, a.d.scaled(by)};
}
// value, with the derivatives by_a a' + by_b b'
DUAL INLINE Dual<N, D> combined(N value, const Dual<N, D>& a, double by_a, const Dual<N, D>& b, double by_b) {
  Edges kinks = 0, jumps = 0;
  if (a.kinks | a.jumps | b.kinks | b.jumps) {
    kinks = (by_a == 0 ? a.jumps : a.kinks) | (by_b == 0 ? b.jumps : b.kinks);
    jumps = (a.jumps & b.jumps) | (by_a == 0 ? 0 : a.jumps) | (by_b == 0 ? 0 : b.jumps);
  }
  return {value, kinks, jumps, a.d.blended(by_a, b.d, by_b)};
}

DUAL OUT Dual<N, D> operator+(const Dual<N, D>& a, const Dual<N, D>& b) { return combined(a.value + b.value, a, 1, b, 1); }
DUAL OUT Dual<N, D> operator-(const Dual<N, D>& a, const Dual<N, D>& b) { return combined(a.value - b.value, a, 1, b, -1); }
DUAL OUT Dual<N, D> operator-(const Dual<N, D>& a) { return scaled(-a.value, a, -1); }
DUAL OUT Dual<N, D> operator*(const Dual<N, D>& a, const Dual<N, D>& b) { return combined(a.value * b.value, a, high(b.value), b, high(a.value)); }
DUAL OUT Dual<N, D> operator/(const Dual<N, D>& a, const Dual<N, D>& b) {
  N q = a.value / b.value;
  double by = 1 / high(b.value);
  return combined(q, a, by, b, -high(q) * by);
}
// With a number that has no derivatives.
DUAL OUT Dual<N, D> operator+(const Dual<N, D>& a, const N& b) { return {a.value + b, a}; }
DUAL OUT Dual<N, D> operator+(const N& a, const Dual<N, D>& b) { return {a + b.value, b}; }
DUAL OUT Dual<N, D> operator-(const Dual<N, D>& a, const N& b) { return {a.value - b, a}; }
DUAL OUT Dual<N, D> operator-(const N& a, const Dual<N, D>& b) { return scaled(a - b.value, b, -1); }
DUAL OUT Dual<N, D> operator*(const Dual<N, D>& a, const N& b) { return scaled(a.value * b, a, high(b)); }
DUAL OUT Dual<N, D> operator*(const N& a, const Dual<N, D>& b) { return scaled(a * b.value, b, high(a)); }
DUAL OUT Dual<N, D> operator/(const Dual<N, D>& a, const N& b) { return scaled(a.value / b, a, 1 / high(b)); }
DUAL OUT Dual<N, D> operator/(const N& a, const Dual<N, D>& b) {
  N q = a / b.value;
  return scaled(q, b, -high(q) / high(b.value));
}
// Of a sum of squares, which has no slope at 0 either: nothing else is 0 under a root in a loop.
INLINE double slope_of_root(double s) { return s > 0 ? 0.5 / s : 0; }
DUAL OUT Dual<N, D> root(const Dual<N, D>& a) {
  N s = root(a.value);
  return scaled(s, a, a.d.edges() ? 0.5 / high(s) : slope_of_root(high(s)));
}
// log(1 + x) / x and (exp(x) - 1) / x, as values.
INLINE double log1p_over(double x) { return x == 0 ? 1 : std::log1p(x) / x; }
INLINE double expm1_over(double x) { return x == 0 ? 1 : std::expm1(x) / x; }
DUAL OUT Dual<N, D> log1p_over(const Dual<N, D>& a) { return {lifted<N>(log1p_over(high(a.value)))}; }
DUAL OUT Dual<N, D> expm1_over(const Dual<N, D>& a) { return {lifted<N>(expm1_over(high(a.value)))}; }
DUAL INLINE Dual<N, D> varying_as(const Dual<N, D>& x, const Dual<N, D>& y) { return {x.value, y}; }
DUAL INLINE Dual<typename Traits<N>::Value, D> value(const Dual<N, D>& a) { return {value(a.value), a}; }
DUAL INLINE Report<N> report(const Dual<N, D>& a) { return report(a.value); }

// What a loop carries has the edges of all that goes into it.
template <class... Outer> INLINE auto share_edges(const Outer&... outer) {
  return [&](auto&... state) {
    Edges kinks = (Edges{} | ... | outer.kinks) | (state.kinks | ...), jumps = (Edges{} | ... | outer.jumps) | (state.jumps | ...);
    ((state.kinks = kinks), ...);
    ((state.jumps = jumps), ...);
  };
}

// The directions in which two numbers part.
DUAL OUT Edges parting(const Dual<N, D>& a, const Dual<N, D>& b) {
  return a.d.blended(1, b.d, -1).edges();
}

// The truth of a comparison: by value; and the directions in which the least step may change it.
struct Decision { bool value; Edges open; };

INLINE Edges everywhere_if(bool holds) { return holds ? ~Edges{} : 0; }
INLINE Decision negation(const Decision& a) { return {!a.value, a.open}; }
INLINE Decision operator&(const Decision& a, const Decision& b) {
  return {a.value && b.value, (a.open & (everywhere_if(b.value) | b.open)) | (b.open & (everywhere_if(a.value) | a.open))};
}
INLINE Decision operator|(const Decision& a, const Decision& b) { return negation(negation(a) & negation(b)); }
INLINE bool plain_truth(const Decision& a) { return a.value; }
INLINE bool may_be_true(const Decision& a) { return a.value || a.open; }
INLINE Decision choose(const Decision& c, const Decision& a, const Decision& b) { return (c & a) | (negation(c) & b); }

DUAL INLINE bool decision(bool truth, const Dual<N, D>&, const Dual<N, D>&) { return truth; }
DUAL INLINE Decision decision(const Truth<double>& truth, const Dual<N, D>& a, const Dual<N, D>& b) {
  return {truth.value, !truth.certain || high(a.value) == high(b.value) ? parting(a, b) : 0};
}
DUAL OUT auto less(const Dual<N, D>& a, const Dual<N, D>& b) { return decision(less(a.value, b.value), a, b); }
DUAL OUT auto less_equal(const Dual<N, D>& a, const Dual<N, D>& b) { return decision(less_equal(a.value, b.value), a, b); }
// Numbers that part are not equal: what holds at a point alone must choose no formula.
DUAL OUT auto equal(const Dual<N, D>& a, const Dual<N, D>& b) {
  return truth<Dual<N, D>>(high(a.value) == high(b.value) && !parting(a, b));
}

DUAL INLINE Dual<N, D> choose(bool c, const Dual<N, D>& a, const Dual<N, D>& b) { return c ? a : b; }
DUAL OUT Dual<N, D> choose(const Decision& c, const Dual<N, D>& a, const Dual<N, D>& b) {
  Dual<N, D> y = c.value ? a : b;
  if (!c.open) return y;
  const Dual<N, D>& other = c.value ? b : a;
  bool jumps = less(a.value, b.value).certain && high(a.value) != high(b.value);
  y.kinks |= c.open & (jumps ? 0 : other.kinks | parting(a, b));
  y.jumps |= c.open & (jumps ? ~Edges{} : other.jumps);
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
