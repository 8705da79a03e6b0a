// Which contacts carry the loads of an impact, and how much part in them each takes.
//
// Impulses of the same effect, as at the four corners of a box, are shared: others would depend on the order of the
// contacts. A contact that is loaded then takes full part, and so does one that could have a load of its face. One that is
// loaded only where loads of nearly the same effect are shared takes less, as the fourth corner of a box whose corners are
// slightly off a plane; and so does one whose load may be rounding. A contact of a body without any load takes none: it
// parts.
#pragma once
#include "assembly.hpp"

// The impulses of contacts in units that make n.K n of each 1: each is the change of its velocity by itself, times the
// square root of the effective mass.
inline Vector loads_of(const Assembly& assembly, const List<DD>& p) {
  Vector loads(assembly.count);
  for (int i = 0; i < assembly.count; ++i) loads[i] = p[i].h / assembly.contacts[i].scale;
  return loads;
}
inline double greatest_of(const Vector& loads) { return *std::max_element(loads.begin(), loads.end()); }

// Whether two contacts lie on one face: they touch the same bodies, and their normals are the same up to `tilt`.
bool are_on_one_face(const Assembly& assembly, int i, int j, double tilt);

struct SharedLoads {
  Vector loads;  // of contacts that take full part, nearly shared loads where some contact needs them
  double greatest;
  Vector part;  // from 0 to 1
};

// Share the loads of impulses p. Contacts that part have no part in them.
SharedLoads share_loads(const Assembly& assembly, const List<DD>& p, const List<char>& parting);
