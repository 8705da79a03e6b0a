// Contacts between the bodies of one table: reading the two bodies of each contact, and dividing the contacts into sets
// that are independent or into clusters.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "constants.hpp"

enum { GATHER_BLOCK = 120 };  // contacts that are gathered at a time: their bodies fit into the first-level cache

// For each contact, which columns of the table its body_a and body_b are.
struct ContactPairs {
  const std::int64_t *a, *b;
  std::int64_t bodies;  // number of columns

  bool is_known(std::int64_t body) const { return body >= 0 && body < bodies; }
  // The status code of what is wrong with a contact, 0 if nothing is.
  int fault(long contact) const {
    if (a[contact] == b[contact]) return STATUS_SAME_BODY;
    return is_known(a[contact]) && is_known(b[contact]) ? 0 : STATUS_UNKNOWN_BODY;
  }

  // Copy the bodies of the contacts from `from` on: for each row of the table that of body_a, then that of body_b. If a
  // contact has a fault, the masses of its bodies, the first row, become NaN. Return whether any has.
  template <class T>
  bool gather(const T* table, int rows, long from, long count, T* gathered) const {
    std::int64_t column[2][GATHER_BLOCK];
    bool any_fault = false;
    for (long k = 0; k < count; ++k) {
      column[0][k] = is_known(a[from + k]) ? a[from + k] : 0;
      column[1][k] = is_known(b[from + k]) ? b[from + k] : 0;
      any_fault |= fault(from + k) != 0;
    }
    if (!bodies) std::fill_n(gathered, 2 * rows * GATHER_BLOCK, T(NAN));
    for (int row = 0; bodies && row < rows; ++row)
      for (int side = 0; side < 2; ++side)
        for (long k = 0; k < count; ++k)
          gathered[(2 * row + side) * GATHER_BLOCK + k] = table[row * bodies + column[side][k]];
    for (long k = 0; any_fault && k < count; ++k)
      if (fault(from + k)) gathered[k] = gathered[GATHER_BLOCK + k] = T(NAN);
    return any_fault;
  }
};

// Sort contacts by the set that each is in, keeping their order within a set. starts gets the place where each set
// begins in `order`, and at the end the number of contacts.
static inline void sort_by_set(const std::vector<std::int64_t>& set, long sets, std::int64_t* order,
                               std::int64_t* starts) {
  std::fill_n(starts, sets + 1, 0);
  for (std::int64_t one : set) ++starts[one + 1];
  for (long s = 0; s < sets; ++s) starts[s + 1] += starts[s];
  std::vector<std::int64_t> next(starts, starts + sets);
  for (std::size_t k = 0; k < set.size(); ++k) order[next[set[k]]++] = static_cast<std::int64_t>(k);
}

// Divide n contacts into sets in which no movable body appears twice, and sort them by these. A contact is in the first
// set after those of earlier contacts with which it shares a movable body. Return the number of sets; if a body of a
// contact is not in the table, -1 - contact for the first such contact.
static inline long divide_into_independent_sets(const ContactPairs& pairs, long n, const bool* movable,
                                                std::int64_t* order, std::int64_t* starts) {
  std::vector<std::int64_t> next_set(pairs.bodies, 0), set(n);
  long sets = 0;
  for (long k = 0; k < n; ++k) {
    const std::int64_t a = pairs.a[k], b = pairs.b[k];
    if (!pairs.is_known(a) || !pairs.is_known(b)) return -1 - k;
    set[k] = std::max(movable[a] ? next_set[a] : 0, movable[b] ? next_set[b] : 0);
    next_set[a] = next_set[b] = set[k] + 1;  // not read for an immovable body
    sets = std::max<long>(sets, set[k] + 1);
  }
  sort_by_set(set, sets, order, starts);
  return sets;
}

// Divide n contacts into clusters, and sort them by these. Contacts are in one cluster if they share a movable body,
// directly or through other contacts. A contact that has a fault or two immovable bodies is a cluster by itself.
// Clusters are numbered in the order of their first contacts. Return their number.
static inline long divide_into_clusters(const ContactPairs& pairs, long n, const bool* movable, std::int64_t* order,
                                        std::int64_t* starts, std::int64_t* cluster) {
  std::vector<std::int64_t> leader(pairs.bodies), number(pairs.bodies, -1), set(n);  // union-find; number: by leader
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
    std::int64_t& cluster_number = number[find(movable[pairs.a[k]] ? pairs.a[k] : pairs.b[k])];
    if (cluster_number < 0) cluster_number = count++;
    set[k] = cluster_number;
  }
  sort_by_set(set, count, order, starts);
  std::copy(set.begin(), set.end(), cluster);
  return count;
}
