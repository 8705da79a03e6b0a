// Assemble a cluster from its numbers.
#include "cluster.hpp"

#include "../check.hpp"

Cluster::Cluster(const ClusterParts& parts, bool frictionless) {
  List<AssembledBody> bodies(parts.bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    AssembledBody& body = bodies[i];
    std::copy(parts.bodies[i].begin(), parts.bodies[i].end(), body.x);
    if (!body.rests()) body.prepare();
    if (body.is_movable()) {
      body.place = assembly.body_count++;
      energy += body.centre_in_doubles.energy;
      has_massless_spin = has_massless_spin || body.centre_in_doubles.has_massless_spin;
      assembly.bodies.push_back(body);
    }
    movable_place.push_back(body.place);
  }
  assembly.contacts.reserve(parts.contacts.size());
  for (ClusterParts::Contact contact : parts.contacts) {
    const AssembledBody &a = bodies[contact.body[0]], &b = bodies[contact.body[1]];
    double& mu = contact.x[CONTACT_FRICTION];
    // An invalid coefficient stays invalid.
    if (frictionless && mu < INFINITY) mu = std::fmin(mu, 0);
    double in[INPUTS] = {}, found;
    bool flags[VALIDITY_FLAGS];
    std::copy(a.x, a.x + BODY, in);
    std::copy(b.x, b.x + BODY, in + BODY);
    std::copy(contact.x, contact.x + CONTACT, in + IN_CONTACT);
    check_everything(in, &found, flags);
    fault = static_cast<int>(found);
    if (fault) return;
    has_off_unit_orientation = has_off_unit_orientation || flags[VALIDITY_IS_OFF_UNIT];
    has_friction = has_friction || mu > 0;
    assembly.add(a, b, contact.x, contact.copies);
  }
  assembly.finish();
}
