// MOREAU for several contacts: Newton's restitution at each, all at once. Time steppers converge to it.
//
//     u_n+ + e min(u_n, 0) >= 0    complementary to    P_n >= 0
//
// so that a contact that separates never comes to approach, and friction opposes the slip after the impact, as for a
// single contact. Without friction this is one linear complementarity problem. With friction, these are Coulomb's
// conditions for rebounds of -e min(u_n, 0).
//
// COULOMB answers instead if none are found, or if no velocities rebound from all contacts. Unequal coefficients, and
// friction, may create energy: if they create more than 2^-40 of the work at the contacts, COULOMB answers, or
// FRICTIONLESS if there is no friction.
//
// Source: Moreau, "Unilateral Contact and Dry Friction in Finite Freedom Dynamics", 1988.
#include "coulomb_conditions.hpp"
#include "laws.hpp"
#include "projection.hpp"

ClusterImpulses moreau(const Assembly& assembly, bool has_friction) {
  constexpr double BUDGET = 2e9;  // multiplications: a second or two
  if (has_friction) {
    std::vector<Axes> rebounds;
    for (const AssembledContact& contact : assembly.contacts)
      rebounds.push_back({-contact.e * std::fmin(contact.axes[0].velocity, 0), 0, 0});
    return obey_coulomb(assembly, own_axes(assembly), rebounds, BUDGET, false);
  }
  auto separates = [](const AssembledContact& contact) { return high(contact.velocity) >= 0; };
  if (std::all_of(assembly.contacts.begin(), assembly.contacts.end(), separates))
    return {true, std::vector<DD>(assembly.count)};
  if (assembly.is_locked) return {false};
  Projection found = project_to_rebound(assembly);
  return {found.status == MinimumStatus::FOUND, found.q, found.error};
}
