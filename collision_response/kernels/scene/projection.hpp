// The inelastic projection: the least impulses, in the metric of kinetic energy, that keep contacts from approaching.
#pragma once
#include "assembly.hpp"

struct Projection {
  MinimumStatus status;
  List<DD> q;  // impulses along the normals
  List<N> r;  // velocities after them; only those of the contacts that were projected
  double error;  // a bound on that of the velocities, in the metric of kinetic energy
  List<int> active{};  // contacts that hold, from which the others follow
  bool is_settled = false;  // whether all velocities are right within their rounding: more digits change nothing
};

// The impulses q >= 0 of the contacts `among` that change velocities `start` least, to some that do not approach. Active
// sets are in doubles, and in double-double where contacts are nearly dependent. `guess`: contacts that may be active.
Projection project(const Assembly& assembly, const List<N>& start, const List<int>& among, const List<int>& guess = {});

// The impulses that give all contacts velocities of at least -e min(u, 0).
Projection project_to_rebound(const Assembly& assembly);

// The few contacts that contradict each other as far as doubles can tell: no velocities keep all of them from
// approaching. Empty if there are none.
List<int> contradictory_contacts(const Assembly& assembly);
