// The impulses that a law gives for a cluster.
#pragma once
#include "assembly.hpp"

struct ClusterImpulses {
  bool are_found = true;  // else contacts contradict each other, or the law has no answer
  List<DD> normal;  // along the normals
  double error = 0;  // bound on that of the velocities, in the metric of kinetic energy
  double margin = INFINITY;  // least distance of a decision from its threshold, relative to the fastest approach
  double restitution = -1;  // the one used for all contacts; -1: each contact has its own
  bool no_rebound = false;  // reflections did not end: restitution is 0
  List<int> may_press{};  // the contacts that may have an impulse, by the law; empty: any
  // Of each contact without friction, the least velocity along the normal where the others have stopped; empty: not known.
  Vector stopped{};
  bool have_least_norm = false;  // whether no others with the same effect are smaller
  Vector tangential{};  // across the normals, two for each contact; empty without friction
};

// Set the impulses from those along the axes of each contact.
inline ClusterImpulses with_axis_impulses(ClusterImpulses impulses, const Assembly& assembly, const List<Axes>& P) {
  impulses.normal.clear();
  for (int i = 0; i < assembly.count; ++i) {
    impulses.normal.push_back({P[i][0] / assembly.contacts[i].length, 0});
    impulses.tangential.insert(impulses.tangential.end(), {P[i][1], P[i][2]});
  }
  return impulses;
}
