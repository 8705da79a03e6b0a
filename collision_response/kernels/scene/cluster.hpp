// A cluster of several contacts: its numbers as given, and assembled.
#pragma once
#include <array>

#include "../contact_pairs.hpp"
#include "assembly.hpp"

// The bodies and contacts of a cluster as numbers. Contacts name bodies by their places in `bodies`.
struct ClusterParts {
  struct Contact {
    int body[2];
    double x[CONTACT], copies;
  };
  List<std::array<double, BODY>> bodies;
  List<Contact> contacts;
  List<std::int64_t> indices{};  // of the bodies in the scene

  // Whether a contact is given twice, in whichever order it names its bodies. With `frictionless`, copies may differ in
  // friction.
  bool has_copies(bool frictionless) const {
    for (const Contact& one : contacts)
      for (const Contact* other = contacts.data(); other != &one; ++other)
        if (one.x[0] == other->x[0] && is_copy(one, *other, frictionless ? CONTACT_FRICTION : CONTACT)) return true;
    return false;
  }

 private:
  // `compared`: how many numbers of the contacts must be equal.
  static bool is_copy(const Contact& one, Contact other, int compared) {
    if (one.body[0] == other.body[1]) {
      std::swap(other.body[0], other.body[1]);
      for (int k = 0; k < 3; ++k) other.x[CONTACT_NORMAL_X + k] *= -1;
    }
    return std::equal(one.body, one.body + 2, other.body) && std::equal(one.x, one.x + compared, other.x);
  }
};

// Return the parts of the cluster of the contacts [first, last) of a scene. Bodies are numbered in the order in which
// contacts name them. scene.copy_body(b, x) and scene.copy_contact(k, x) copy the numbers of a body and of a contact
// to x. `place` must be -1 for all bodies, and is -1 again afterwards.
template <class Scene>
ClusterParts take_parts(const Scene& scene, const ContactPairs& pairs, const std::int64_t* first,
                        const std::int64_t* last, List<int>& place) {
  ClusterParts parts;
  auto place_of = [&](std::int64_t b) {
    if (place[b] < 0) {
      place[b] = static_cast<int>(parts.indices.size());
      parts.indices.push_back(b);
      scene.copy_body(b, parts.bodies.emplace_back().data());
    }
    return place[b];
  };
  parts.contacts.reserve(last - first);
  for (auto k = first; k != last; ++k) {
    parts.contacts.push_back({{place_of(pairs.a[*k]), place_of(pairs.b[*k])}, {}, 1});
    scene.copy_contact(*k, parts.contacts.back().x);
  }
  for (std::int64_t b : parts.indices) place[b] = -1;
  return parts;
}

struct Cluster {
  Assembly assembly;
  List<int> movable_place;  // for each body, its place among the movable ones, or -1
  double energy = 0;  // kinetic energy of the movable bodies
  bool has_massless_spin = false, has_off_unit_orientation = false, has_friction = false;
  int fault = 0;  // status of the first invalid contact, or 0

  // Whether some numbers are out of the range of doubles, so that doubles cannot give an answer.
  bool is_out_of_range() const {
    return !(std::isfinite(energy) && assembly.is_finite() && assembly.has_representable_impulses());
  }

  // With `frictionless`, friction is left out.
  Cluster(const ClusterParts& parts, bool frictionless);
};
