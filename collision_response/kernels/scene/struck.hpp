// What a law answers: impulses.
#pragma once
#include "assembly.hpp"

enum class Outcome { ANSWERED, CONTRADICTORY, ENDLESS };

struct Struck {
  Outcome outcome = Outcome::ANSWERED;
  std::vector<DD> p;         // impulses along the normals
  double error = 0;          // of the velocities, in the metric of kinetic energy
  double margin = INFINITY;  // the least distance of a decision from its threshold, relative to the fastest approach
  double restitution = -1;   // of all contacts; -1: each has its own
  Vector tangential{};       // impulses across the normals, two of each contact, or none
};

// The same, with impulses that are in the axes of each contact.
inline Struck with_impulses(Struck struck, const Assembly& scene, const std::vector<Axes>& P) {
  struck.p.clear();
  for (int i = 0; i < scene.count; ++i) {
    struck.p.push_back({P[i][0] / scene.touches[i].length, 0});
    struck.tangential.insert(struck.tangential.end(), {P[i][1], P[i][2]});
  }
  return struck;
}
