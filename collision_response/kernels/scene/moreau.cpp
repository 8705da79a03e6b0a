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

namespace {

// The contacts that do not leave faster than they rebound: only these may have an impulse.
List<int> contacts_that_rebound(const Assembly& assembly, const Projection& found) {
  constexpr double ROUNDING = 0x1p-40;
  const List<N> after = assembly.velocities(found.q.data());
  List<int> result;
  for (int i = 0; i < assembly.count; ++i) {
    const AssembledContact& contact = assembly.contacts[i];
    const double before = high(contact.velocity), rebound = -contact.e * std::fmin(before, 0);
    const double rounding = ROUNDING * (std::fabs(before) + std::fabs(high(after[i])));
    if (high(after[i]) - rebound <= rounding + found.error / contact.scale) result.push_back(i);
  }
  return result;
}

}  // namespace

ClusterImpulses moreau(const Assembly& assembly, bool has_friction) {
  constexpr double BUDGET = 2e9;  // multiplications: a second or two
  if (has_friction) {
    List<Axes> rebounds;
    for (const AssembledContact& contact : assembly.contacts)
      rebounds.push_back({-contact.e * std::fmin(contact.axes[0].velocity, 0), 0, 0});
    return obey_coulomb(assembly, own_axes(assembly), rebounds, BUDGET, false);
  }
  auto separates = [](const AssembledContact& contact) { return high(contact.velocity) >= 0; };
  if (std::all_of(assembly.contacts.begin(), assembly.contacts.end(), separates))
    return {true, List<DD>(assembly.count)};
  if (assembly.is_locked) return {false};
  const Projection found = project_to_rebound(assembly);
  if (found.status != MinimumStatus::FOUND) return {false};
  ClusterImpulses impulses{true, found.q, found.error};
  impulses.may_press = contacts_that_rebound(assembly, found);
  return impulses;
}
