// What impulses do to the bodies and the contacts of a cluster, and the error bound of that: ImpulseEffect of
// scene/cluster_result.py.
#pragma once
#include "impulses.hpp"

using Regime = unsigned char;

// Kinetic energy before and after, and the energy lost to restitution and to friction.
enum { ENERGY_BEFORE, ENERGY_AFTER, LOST_TO_RESTITUTION, LOST_TO_FRICTION };

struct ImpulseEffect {
  ImpulseEffect() = default;
  ImpulseEffect(int contacts, int bodies)
      : changes(6 * static_cast<size_t>(bodies)),
        twists(changes.size()),
        impulses(3 * static_cast<size_t>(contacts)),
        normal_velocities(contacts),
        regimes(contacts) {}

  Vector changes, twists;  // six numbers for each movable body
  Vector impulses;  // three numbers for each contact
  Vector normal_velocities;  // after the impact
  List<Regime> regimes;
  double energies[4] = {};
  double error_bound = 0;
  // Whether the contacts gain more energy than rounding explains, by the work on relative velocities, which is the same
  // for every observer.
  bool creates_energy = false;
  // Whether contacts gain energy, pull, leave their friction cones, or still approach, by more than the error; or kinetic
  // energy grows by more, without a moving wall.
  bool is_unphysical = false;
  // Whether kinetic energy grows where the error has no bound: the twists need more digits than a double has.
  bool lacks_digits = false;

  bool is_separating() const {
    return std::all_of(regimes.begin(), regimes.end(), [](Regime regime) { return regime == REGIME_SEPARATING; });
  }
  // It suffices to check the energies, which are sums over the twists and the velocities, and the impulses.
  bool is_representable() const {
    auto is_finite = [](double x) { return std::isfinite(x); };
    return !lacks_digits && std::all_of(energies, energies + 4, is_finite) &&
           std::all_of(impulses.begin(), impulses.end(), is_finite);
  }
};

// The effect of impulses. With `sticks_by_slip`, a contact sticks if it does not slip afterwards; otherwise, if its
// friction is below the limit.
ImpulseEffect effect_of(const Assembly& assembly, const ClusterImpulses& impulses, bool sticks_by_slip);
