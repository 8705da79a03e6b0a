// The movable bodies and the contacts of one cluster, and what impulses do to them.
//
// Normal impulses p are exact numbers in double-double: they are what was chosen. What they do, v = v0 + M^-1 N p and
// u = u0 + A p, is computed from them with a bound on the error, each time from the start. What happens along the unit
// normal and two tangents is also known in plain doubles.
#pragma once
#include "active_set.hpp"
#include "assembled.hpp"

struct Assembly {
  int count = 0, body_count = 0;  // of contacts, of movable bodies
  std::vector<AssembledContact> contacts;
  std::vector<AssembledBody> bodies;  // the movable ones
  std::vector<AssembledBody> walls;  // the immovable ones that move, once for each contact
  Vector A;  // n.K n of all pairs of contacts, scaled to a diagonal of 1
  bool has_moving_wall = false;
  // A velocity that separates all contacts, if there is one: by how much, scaled, and its size in the metric of kinetic
  // energy.
  Vector separation;
  double separating_size = 0;
  bool is_locked = false;  // no velocity separates all contacts, as far as 32 digits can tell

  // Add a contact, given as position, normal, e and mu. The places of its bodies are those among the movable ones.
  void add(const AssembledBody& a, const AssembledBody& b, int place_a, int place_b, const double* given,
           double copies) {
    AssembledContact contact{{place_a, place_b}, {-1, -1}};
    const int exponent = exponent_of(given + 3, 3);
    for (int k = 0; k < 3; ++k) {
      contact.point[k] = given[k];
      contact.normal[k] = std::ldexp(given[3 + k], -exponent);
    }
    contact.e = given[6];
    contact.mu = given[7];
    contact.copies = copies;
    contact.length = std::sqrt(contact.normal[0] * contact.normal[0] + contact.normal[1] * contact.normal[1] +
                               contact.normal[2] * contact.normal[2]);
    N direction[3], velocity[2];
    for (int k = 0; k < 3; ++k) direction[k] = exact(contact.normal[k]);
    const AssembledBody* both[2] = {&a, &b};
    const double *v_a = a.x + IN_BODY_A_VELOCITY_X, *v_b = b.x + IN_BODY_A_VELOCITY_X;
    const bool is_common = std::equal(v_a, v_a + 3, v_b);  // a common velocity cancels: leave out its rounding
    for (int side = 0; side < 2; ++side) {
      if (both[side]->rests()) {
        velocity[side] = exact(0.0);
        continue;
      }
      if (!both[side]->is_movable()) {
        contact.wall[side] = static_cast<int>(walls.size());
        walls.push_back(*both[side]);
      }
      Centre<N> centre = both[side]->centre;
      if (is_common) std::fill_n(centre.v, 3, exact(0.0));
      velocity[side] = column_of<N>(centre, contact, direction, side, contact.jacobian[side], contact.response[side]);
    }
    contact.velocity = velocity[0] - velocity[1];
    add_axes(both, contact);
    contacts.push_back(contact);
    ++count;
  }

  // After the last contact.
  void finish() {
    for (AssembledContact& contact : contacts) contact.scale = 1 / std::sqrt(coupling<double>(contact, contact));
    A = couplings<double>();
    for (int i = 0; i < count; ++i) A[i * count + i] = 1;
    is_locked = !find_separating_velocity(A) && !find_separating_velocity(couplings<DD>());
  }

  // n.K n of two contacts, by the bodies that they share.
  template <class R>
  static R coupling(const AssembledContact& i, const AssembledContact& j) {
    R sum{};
    for (int a = 0; a < 2; ++a)
      for (int b = 0; b < 2; ++b)
        if (i.body[a] >= 0 && i.body[a] == j.body[b])
          for (int k = 0; k < 6; ++k) sum = sum + rounded_to<R>(i.jacobian[a][k]) * rounded_to<R>(j.response[b][k]);
    return sum;
  }
  // The matrix A in the digits of R.
  template <class R>
  std::vector<R> couplings() const {
    std::vector<R> matrix(static_cast<size_t>(count) * count);
    for (int i = 0; i < count; ++i)
      for (int j = 0; j <= i; ++j)
        matrix[i * count + j] = matrix[j * count + i] =
            coupling<R>(contacts[i], contacts[j]) * (constant<R>(contacts[i].scale) * constant<R>(contacts[j].scale));
    return matrix;
  }

  bool is_finite() const {
    auto is_number = [](double x) { return std::isfinite(x); };
    auto is_sound = [&](const AssembledContact& contact) {
      return is_number(contact.scale) && std::all_of(contact.axes, contact.axes + 3,
                                                     [&](const ContactAxis& axis) { return is_number(axis.velocity); });
    };
    return std::all_of(contacts.begin(), contacts.end(), is_sound) && std::all_of(A.begin(), A.end(), is_number);
  }

  // Whether every impulse that stops a fastest approach by itself is at least the least double.
  bool has_representable_impulses() const {
    double fastest = 0;
    for (const AssembledContact& contact : contacts) fastest = std::fmax(fastest, -contact.axes[0].velocity);
    return std::all_of(contacts.begin(), contacts.end(), [&](const AssembledContact& contact) {
      double speed = -contact.axes[0].velocity;
      return !(speed > 0 && speed >= fastest) || -high(contact.velocity) * contact.scale * contact.scale > 0;
    });
  }

  // Whether no contact seems to approach, but one may, within the error of its velocity.
  bool approach_is_uncertain() const {
    auto approaches = [](const AssembledContact& contact) { return high(contact.velocity) < 0; };
    auto may_approach = [](const AssembledContact& contact) {
      return high(contact.velocity) < width(contact.velocity);
    };
    return std::none_of(contacts.begin(), contacts.end(), approaches) &&
           std::any_of(contacts.begin(), contacts.end(), may_approach);
  }

  // AssembledContact::axes in double-double. `precise` are the movable bodies.
  std::array<ContactAxisOf<DD>, 3> precise_axes(const AssembledContact& contact,
                                                const std::vector<PreciseBody>& precise) const {
    std::array<ContactAxisOf<DD>, 3> axes{};
    const auto unit_vectors = contact.unit_vectors(contact.precise_length());
    const AssembledBody* both[2];  // nullptr: at rest and immovable
    for (int side = 0; side < 2; ++side)
      both[side] = contact.body[side] >= 0   ? &bodies[contact.body[side]]
                   : contact.wall[side] >= 0 ? &walls[contact.wall[side]]
                                             : nullptr;
    const bool is_common = both[0] && both[1] &&
                           std::equal(both[0]->x + IN_BODY_A_VELOCITY_X, both[0]->x + IN_BODY_A_VELOCITY_X + 3,
                                      both[1]->x + IN_BODY_A_VELOCITY_X);
    for (int side = 0; side < 2; ++side) {
      if (!both[side]) continue;
      PreciseBody body = contact.body[side] >= 0 ? precise[contact.body[side]] : PreciseBody(*both[side]);
      if (is_common) std::fill_n(body.centre.v, 3, DD{});
      for (int axis = 0; axis < 3; ++axis) {
        DD jacobian[6], response[6];
        const DD velocity = column_of<DD>(body.centre, contact, unit_vectors[axis].data(), side, jacobian, response);
        axes[axis].velocity += side ? -velocity : velocity;
        if (both[side]->is_movable()) to_energy_metric(body, jacobian, axes[axis].row[side]);
      }
    }
    return axes;
  }

  // The changes of the twists of the movable bodies by impulses p.
  std::vector<N> twist_changes(const DD* p) const {
    std::vector<N> twists(6 * static_cast<size_t>(body_count), exact(0.0));
    for (int i = 0; i < count; ++i) {
      if (p[i].h == 0) continue;
      for (int side = 0; side < 2; ++side)
        if (contacts[i].body[side] >= 0) {
          N* twist = &twists[6 * contacts[i].body[side]];
          for (int k = 0; k < 6; ++k) twist[k] = twist[k] + contacts[i].response[side][k] * exact(p[i]);
        }
    }
    return twists;
  }

  // The change of a normal velocity, times the length of the normal, by changes of twists.
  N velocity_change(const AssembledContact& contact, const std::vector<N>& twists) const {
    N sum = exact(0.0);
    for (int side = 0; side < 2; ++side)
      if (contact.body[side] >= 0)
        for (int k = 0; k < 6; ++k) sum = sum + contact.jacobian[side][k] * twists[6 * contact.body[side] + k];
    return sum;
  }

  // The normal velocities after impulses p, times the lengths of the normals.
  std::vector<N> velocities(const DD* p) const {
    std::vector<N> u(count);
    for (int i = 0; i < count; ++i) u[i] = contacts[i].velocity;
    if (std::all_of(p, p + count, [](const DD& x) { return x.h == 0; })) return u;
    std::vector<N> twists = twist_changes(p);
    for (int i = 0; i < count; ++i) u[i] = u[i] + velocity_change(contacts[i], twists);
    return u;
  }

  // An upper bound on |M^-1 N p| in the metric of kinetic energy.
  double velocity_size(const DD* p) const {
    double sum = 0;
    for (int i = 0; i < count; ++i) sum += std::fabs(p[i].h) / contacts[i].scale;
    return sum * (1 + 1e-9);
  }

  std::vector<int> all_contacts() const {
    std::vector<int> all(count);
    std::iota(all.begin(), all.end(), 0);
    return all;
  }

 private:
  // row = L^T jacobian
  template <class SomeBody, class R>
  static void to_energy_metric(const SomeBody& body, const R* jacobian, R* row) {
    const auto of_centre = cross(body.com, jacobian);
    R moment[3];  // about the centre of mass
    for (int k = 0; k < 3; ++k) moment[k] = jacobian[3 + k] - of_centre[k];
    for (int k = 0; k < 3; ++k) {
      row[k] = body.root * jacobian[k];
      row[3 + k] = body.turn[k][0] * moment[0] + body.turn[k][1] * moment[1] + body.turn[k][2] * moment[2];
    }
  }

  static void add_axes(const AssembledBody* const* both, AssembledContact& contact) {
    const auto unit_vectors = contact.unit_vectors();
    for (int axis = 0; axis < 3; ++axis) {
      const double* direction = unit_vectors[axis].data();
      double velocity[2] = {0, 0};
      for (int side = 0; side < 2; ++side) {
        const AssembledBody& body = *both[side];
        if (body.rests()) continue;
        double jacobian[6], response[6];
        velocity[side] = column_of<double>(body.centre_in_doubles, contact, direction, side, jacobian, response);
        if (body.is_movable()) to_energy_metric(body, jacobian, contact.axes[axis].row[side]);
      }
      contact.axes[axis].velocity = velocity[0] - velocity[1];
    }
    contact.axes[0].velocity = high(contact.velocity) / contact.length;
  }

  // The formula of physics/column.py for one body of a contact along a direction. Returns the velocity of the body.
  template <class T>
  static T column_of(const Centre<T>& body, const AssembledContact& contact, const T* direction, int side, T* jacobian,
                     T* response) {
    T in[CENTRE_COUNT + 9], out[10];
    std::copy(body.numbers, body.numbers + CENTRE_COUNT, in);
    for (int k = 0; k < 3; ++k) {
      in[CENTRE_COUNT + k] = body.v[k];
      in[CENTRE_COUNT + 3 + k] = Make<T>::constant(contact.point[k]) - body.x[k];
      in[CENTRE_COUNT + 6 + k] = direction[k];
    }
    column<T>(in, out, nullptr, nullptr);
    std::copy(direction, direction + 3, jacobian);
    std::copy(out + 1, out + 4, jacobian + 3);
    std::copy(out + 4, out + 10, response);
    for (int k = 0; side && k < 6; ++k) {  // body_b gets the opposite
      jacobian[k] = -jacobian[k];
      response[k] = -response[k];
    }
    return out[0];
  }

  // Find a velocity that separates all contacts, in the digits of R: the least d with N^T d >= 1, scaled. Whether it
  // does.
  template <class R>
  bool find_separating_velocity(const std::vector<R>& matrix) {
    const Minimum<R> minimum = minimise(matrix, std::vector<R>(count, constant<R>(-1)), all_contacts());
    if (minimum.status != MinimumStatus::FOUND) return false;
    std::vector<DD> d(count);
    for (int i = 0; i < count; ++i) d[i] = lifted<DD>(minimum.x[i] * constant<R>(contacts[i].scale));
    std::vector<N> twists = twist_changes(d.data());
    separation.resize(count);
    double square = 0;
    bool separates = true;
    for (int i = 0; i < count; ++i) {
      N rho = velocity_change(contacts[i], twists);
      separation[i] = (high(rho) - width(rho)) * contacts[i].scale;
      square += d[i].h * (high(rho) + width(rho));
      separates = separates && separation[i] > 0.5;
    }
    separating_size = std::sqrt(square) * (1 + 1e-9);
    return separates;
  }
};
