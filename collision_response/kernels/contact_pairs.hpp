// Contacts of one table of bodies: the two bodies of each, and which contacts may be answered at once.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "constants.hpp"

enum { BLOCK = 120 };  // contacts that are gathered together: they stay in the nearest cache

// Which columns of a table of bodies touch.
struct ContactPairs {
  const std::int64_t *a, *b;
  std::int64_t bodies;

  bool is_known(std::int64_t body) const { return body >= 0 && body < bodies; }
  int fault(long contact) const {
    if (a[contact] == b[contact]) return STATUS_SAME_BODY;
    return is_known(a[contact]) && is_known(b[contact]) ? 0 : STATUS_UNKNOWN_BODY;
  }

  // The bodies of the contacts from `from` on: row by row those of body_a, then those of body_b. Where there is a
  // fault their mass, the first row, is not a number. Whether there is one.
  template <class T>
  bool gather(const T* table, int rows, long from, long count, T* to) const {
    std::int64_t place[2][BLOCK];
    bool any = false;
    for (long k = 0; k < count; ++k) {
      place[0][k] = is_known(a[from + k]) ? a[from + k] : 0;
      place[1][k] = is_known(b[from + k]) ? b[from + k] : 0;
      any |= fault(from + k) != 0;
    }
    for (int row = 0; row < (bodies ? rows : 0); ++row)
      for (int side = 0; side < 2; ++side)
        for (long k = 0; k < count; ++k) to[(2 * row + side) * BLOCK + k] = table[row * bodies + place[side][k]];
    for (int row = 0; row < (bodies ? 0 : rows); ++row) std::fill_n(to + 2 * row * BLOCK, 2 * BLOCK, T(NAN));
    for (long k = 0; any && k < count; ++k)
      if (fault(from + k)) to[k] = to[BLOCK + k] = T(NAN);
    return any;
  }
};

// Orders contacts by the sets that they are in, in each as they came. starts gets where each set begins, and n.
static inline void sort_by_set(const std::vector<std::int64_t>& set, long sets, std::int64_t* order, std::int64_t* starts) {
  std::fill_n(starts, sets + 1, 0);
  for (std::int64_t own : set) ++starts[own + 1];
  for (long s = 0; s < sets; ++s) starts[s + 1] += starts[s];
  std::vector<std::int64_t> next(starts, starts + sets);
  for (std::size_t k = 0; k < set.size(); ++k) order[next[set[k]]++] = static_cast<std::int64_t>(k);
}

// Orders n contacts by sets in which no movable body appears twice. A contact falls into the set after the last one
// that it shares a movable body with. The number of sets; or -1 - contact for the first one without two known bodies.
static inline long independent_sets(const ContactPairs& pairs, long n, const bool* movable, std::int64_t* order, std::int64_t* starts) {
  std::vector<std::int64_t> after(pairs.bodies, 0), set(n);
  long sets = 0;
  for (long k = 0; k < n; ++k) {
    const std::int64_t a = pairs.a[k], b = pairs.b[k];
    if (!pairs.is_known(a) || !pairs.is_known(b)) return -1 - k;
    std::int64_t own = std::max(movable[a] ? after[a] : 0, movable[b] ? after[b] : 0);
    set[k] = own;
    after[a] = after[b] = own + 1;  // of an immovable body it is not read
    sets = std::max<long>(sets, own + 1);
  }
  sort_by_set(set, sets, order, starts);
  return sets;
}

// Orders n contacts by clusters: they share movable bodies, directly or through further contacts. A contact at fault,
// or of two immovable bodies, is one by itself. Clusters are numbered by their first contacts. How many there are.
static inline long clusters(const ContactPairs& pairs, long n, const bool* movable, std::int64_t* order, std::int64_t* starts, std::int64_t* cluster) {
  std::vector<std::int64_t> leader(pairs.bodies), number(pairs.bodies, -1), set(n);
  for (std::int64_t body = 0; body < pairs.bodies; ++body) leader[body] = body;
  auto find = [&](std::int64_t body) {
    while (leader[body] != body) body = leader[body] = leader[leader[body]];
    return body;
  };
  for (long k = 0; k < n; ++k)
    if (!pairs.fault(k) && movable[pairs.a[k]] && movable[pairs.b[k]]) leader[find(pairs.a[k])] = find(pairs.b[k]);
  long count = 0;
  for (long k = 0; k < n; ++k) {
    if (pairs.fault(k) || !(movable[pairs.a[k]] || movable[pairs.b[k]])) {
      set[k] = count++;
      continue;
    }
    std::int64_t& own = number[find(movable[pairs.a[k]] ? pairs.a[k] : pairs.b[k])];
    if (own < 0) own = count++;
    set[k] = own;
  }
  sort_by_set(set, count, order, starts);
  std::copy(set.begin(), set.end(), cluster);
  return count;
}
