// Numbers that carry their derivatives: one more number type for the traced formulas.
//
//   Dual<N>   N, and its derivatives in some directions
//
// A branch is taken by the value. Where the value leaves a comparison open, or both sides are equal, the
// directions in which they part are kept: a choice by it has a kink there if both branches have one value, else
// a jump. A factor of 0, if it does not jump itself, turns a jump into a kink, and a kink into nothing.
//
// A loop runs on Dual<Value<N>>: what a turn decides is no edge of the result.
#pragma once
#include "numbers.hpp"

#include <memory>
#include <vector>

typedef double Block __attribute__((vector_size(32)));  // the derivatives in four directions
constexpr int BLOCKS = 14, DIRECTIONS = 4 * BLOCKS;
using Edges = std::uint64_t;  // a bit for each direction

// Where derivatives lie. They are written once and shared by copies; an impact begins anew.
struct Room { Block *next, *end; std::size_t chunks; };
static thread_local Room room __attribute__((tls_model("initial-exec")));
constexpr int CHUNK = 1 << 14;

static __attribute__((noinline, cold)) void more_room(std::size_t chunk) {
  static thread_local std::vector<std::unique_ptr<Block[]>> all;
  if (chunk == all.size()) all.emplace_back(new Block[CHUNK]);
  room = {all[chunk].get(), all[chunk].get() + CHUNK, chunk + 1};
}

#define OUT static __attribute__((noinline, unused))
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_EACH_LEVEL __attribute__((target_clones("avx2", "default")))
#else
#define FOR_EACH_LEVEL
#endif

template <class N>
struct Dual {
  using Number = N;
  N value;
  Edges kinks, jumps;
  int from, to;  // the blocks that may not be 0
  Block* d;      // of which the first is d[from]

  Dual() = default;
  Dual(N value) : value(value), kinks(0), jumps(0), from(BLOCKS), to(0), d(nullptr) {}
  template <class M> Dual(N value, const Dual<M>& a) : value(value), kinks(a.kinks), jumps(a.jumps), from(a.from), to(a.to), d(a.d) {}

  double at(int direction) const {
    int block = direction / 4;
    return from <= block && block < to ? d[block][direction % 4] : 0;
  }
  // Blocks to be written.
  void span(int first, int last) {
    if (room.end - room.next < BLOCKS) more_room(room.chunks);
    from = first;
    to = last;
    d = room.next - first;
    room.next += last - first;
  }
};

template <class N> struct Traits<Dual<N>> {
  using Base = typename Traits<N>::Base; using Value = Dual<typename Traits<N>::Value>; using Report = typename Traits<N>::Report;
  static constexpr double roundoff = Traits<N>::roundoff;
};

FOR_EACH_LEVEL OUT void multiply(Block* y, const Block* a, double by, int count) {
  for (int k = 0; k < count; ++k) y[k] = a[k] * by;
}
FOR_EACH_LEVEL OUT void blend(Block* y, const Block* a, double by_a, const Block* b, double by_b, int count) {
  for (int k = 0; k < count; ++k) y[k] = a[k] * by_a + b[k] * by_b;
}

template <class N> INLINE Dual<N> scaled(N value, const Dual<N>& a, double by) {
  Dual<N> y(value);
  y.kinks = by == 0 ? a.jumps : a.kinks;
  y.jumps = by == 0 ? 0 : a.jumps;
  if (a.from >= a.to) return y;
  y.span(a.from, a.to);
  multiply(y.d + y.from, a.d + y.from, by, y.to - y.from);
  return y;
}
// value, with the derivatives by_a a' + by_b b'
template <class N> INLINE Dual<N> combined(N value, const Dual<N>& a, double by_a, const Dual<N>& b, double by_b) {
  Dual<N> y(value);
  if (a.kinks | a.jumps | b.kinks | b.jumps) {
    y.kinks = (by_a == 0 ? a.jumps : a.kinks) | (by_b == 0 ? b.jumps : b.kinks);
    y.jumps = (a.jumps & b.jumps) | (by_a == 0 ? 0 : a.jumps) | (by_b == 0 ? 0 : b.jumps);
  }
  int from = a.from < b.from ? a.from : b.from, to = a.to < b.to ? b.to : a.to;
  if (from >= to) return y;
  y.span(from, to);
  // Where one of them has no derivatives the other is taken alone.
  int low = a.from < b.from ? b.from : a.from, high = a.to < b.to ? a.to : b.to;
  if (low >= high) {
    for (int k = from; k < to; ++k) y.d[k] = Block{};
    if (a.from < a.to) multiply(y.d + a.from, a.d + a.from, by_a, a.to - a.from);
    if (b.from < b.to) multiply(y.d + b.from, b.d + b.from, by_b, b.to - b.from);
    return y;
  }
  const Dual<N>&first = a.from < b.from ? a : b, &last = a.to < b.to ? b : a;
  if (from < low) multiply(y.d + from, first.d + from, &first == &a ? by_a : by_b, low - from);
  blend(y.d + low, a.d + low, by_a, b.d + low, by_b, high - low);
  if (high < to) multiply(y.d + high, last.d + high, &last == &a ? by_a : by_b, to - high);
  return y;
}

template <class N> OUT Dual<N> operator+(const Dual<N>& a, const Dual<N>& b) { return combined(a.value + b.value, a, 1, b, 1); }
template <class N> OUT Dual<N> operator-(const Dual<N>& a, const Dual<N>& b) { return combined(a.value - b.value, a, 1, b, -1); }
template <class N> OUT Dual<N> operator-(const Dual<N>& a) { return scaled(-a.value, a, -1); }
template <class N> OUT Dual<N> operator*(const Dual<N>& a, const Dual<N>& b) { return combined(a.value * b.value, a, high(b.value), b, high(a.value)); }
template <class N> OUT Dual<N> operator/(const Dual<N>& a, const Dual<N>& b) {
  N q = a.value / b.value;
  double by = 1 / high(b.value);
  return combined(q, a, by, b, -high(q) * by);
}
template <class N> OUT Dual<N> root(const Dual<N>& a) {
  N s = root(a.value);
  return scaled(s, a, 0.5 / high(s));
}
template <class N> INLINE Dual<N> varying_as(const Dual<N>& x, const Dual<N>& y) { return {x.value, y}; }
template <class N> INLINE Dual<typename Traits<N>::Value> value(const Dual<N>& a) { return {value(a.value), a}; }

// The directions in which two numbers part.
template <class N> OUT Edges parting(const Dual<N>& a, const Dual<N>& b) {
  Edges apart = 0;
  for (int i = 0; i < DIRECTIONS; ++i) apart |= Edges(a.at(i) != b.at(i)) << i;
  return apart;
}

// The truth of a comparison: by value; and the directions in which the least step may change it.
struct Decision { bool value; Edges open; };

INLINE Edges everywhere_if(bool holds) { return holds ? ~Edges{} : 0; }
INLINE Decision negation(const Decision& a) { return {!a.value, a.open}; }
INLINE Decision operator&(const Decision& a, const Decision& b) {
  return {a.value && b.value, (a.open & (everywhere_if(b.value) | b.open)) | (b.open & (everywhere_if(a.value) | a.open))};
}
INLINE Decision operator|(const Decision& a, const Decision& b) { return negation(negation(a) & negation(b)); }
INLINE bool decided(const Decision& a) { return a.value; }
INLINE bool may_hold(const Decision& a) { return a.value || a.open; }
INLINE Decision choose(const Decision& c, const Decision& a, const Decision& b) { return (c & a) | (negation(c) & b); }

template <class N> INLINE bool decision(bool truth, const Dual<N>&, const Dual<N>&) { return truth; }
template <class N> INLINE Decision decision(const Truth<double>& truth, const Dual<N>& a, const Dual<N>& b) {
  return {truth.value, !truth.sure || high(a.value) == high(b.value) ? parting(a, b) : 0};
}
template <class N> OUT auto less(const Dual<N>& a, const Dual<N>& b) { return decision(less(a.value, b.value), a, b); }
template <class N> OUT auto less_equal(const Dual<N>& a, const Dual<N>& b) { return decision(less_equal(a.value, b.value), a, b); }
// Numbers that part are not equal: what holds at a point alone must choose no formula.
template <class N> OUT auto equal(const Dual<N>& a, const Dual<N>& b) {
  return truth<Dual<N>>(high(a.value) == high(b.value) && !parting(a, b));
}

template <class N> INLINE Dual<N> choose(bool c, const Dual<N>& a, const Dual<N>& b) { return c ? a : b; }
template <class N> OUT Dual<N> choose(const Decision& c, const Dual<N>& a, const Dual<N>& b) {
  Dual<N> y = c.value ? a : b;
  if (!c.open) return y;
  const Dual<N>& other = c.value ? b : a;
  bool jumps = less(a.value, b.value).sure && high(a.value) != high(b.value);
  y.kinks |= c.open & (jumps ? 0 : other.kinks | parting(a, b));
  y.jumps |= c.open & (jumps ? ~Edges{} : other.jumps);
  return y;
}

template <class N> struct Make<Dual<N>> {
  INLINE Dual<N> constant(double x) { return {Make<N>::constant(x)}; }
  INLINE bool truth(double, bool x) { return x; }
  template <class M> INLINE Decision truth(const M&, bool x) { return {x, 0}; }
  INLINE auto truth(bool x) { return truth(N{}, x); }
  INLINE Dual<N> lifted(const Dual<typename Traits<N>::Value>& a) { return {Make<N>::lifted(a.value), a}; }
};

// The room that the turns of a loop take: after each, that of its state alone is kept.
struct Turns {
  Room before = room;

  template <class... N> void keep(N&... state) {
    Block kept[sizeof...(state)][BLOCKS];
    int i = 0;
    (std::memcpy(kept[i++], state.d + state.from, bytes(state)), ...);
    room = before;
    i = 0;
    (write(state, kept[i++]), ...);
  }
  template <class N> static std::size_t bytes(const N& x) { return x.from < x.to ? (x.to - x.from) * sizeof(Block) : 0; }
  template <class N> static void write(N& x, const Block* kept) {
    if (x.from >= x.to) return;
    x.span(x.from, x.to);
    std::memcpy(x.d + x.from, kept, bytes(x));
  }
};
