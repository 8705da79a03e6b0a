// Where contacts depend on each other, as the four corners of a box do, several impulses have the same effect. These
// functions find those of least norm, which are as symmetric as the scene.
#pragma once
#include "assembly.hpp"

// Impulses that do next to nothing: a basis, with one for each contact that depends on others.
struct NullImpulses {
  List<List<DD>> basis;
  bool are_exact = true;  // whether they do nothing in double-double either
  bool are_complete = true;  // whether no contact was left out because the effect of its impulses is too great
};

constexpr double NEXT_TO_NOTHING = 1e-26;  // the square of an effect that is 0 to 13 digits

// The impulses that do next to nothing.
NullImpulses null_impulses(const Assembly& assembly);

// Replace p by the p + Z z >= 0 that is nearest to `target`, or of least norm, for null impulses Z. Returns whether p is
// known. Contacts that Z changes by up to `left_out` of its norm are left out, whatever basis Z is.
bool minimise_norm(const Assembly& assembly, List<DD>& p, const List<List<DD>>& Z, double left_out = 0,
                   const Vector& target = {});

// Replace p by the impulses >= 0 of the same effect with the least sum of n.n p^2, over all copies of contacts. Only the
// contacts `among` change.
void least_norm(const Assembly& assembly, Vector& p, const List<int>& among);
