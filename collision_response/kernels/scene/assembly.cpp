// How a cluster is assembled, and what impulses do to it.
#include "assembly.hpp"

#include "../exact_normal_velocity.hpp"

static bool is_sign_known(const N& x) { return x.error == 0 || std::fabs(high(x)) > width(x); }

void Assembly::add(const AssembledBody& a, const AssembledBody& b, const double* given, double copies) {
  AssembledContact contact{{a.place, b.place}, {-1, -1}};
  const int exponent = exponent_of(given + CONTACT_NORMAL_X, 3);
  for (int k = 0; k < 3; ++k) {
    contact.point[k] = given[CONTACT_POSITION_X + k];
    contact.normal[k] = std::ldexp(given[CONTACT_NORMAL_X + k], -exponent);
  }
  contact.e = given[CONTACT_RESTITUTION];
  contact.mu = given[CONTACT_FRICTION];
  contact.copies = copies;
  contact.length = std::sqrt(dot(contact.normal, contact.normal, 3));
  const AssembledBody* both[2] = {&a, &b};
  for (int side = 0; side < 2; ++side) {
    if (both[side]->is_movable()) continue;
    if (!first_wall) first_wall = *both[side];
    walls_move_apart = walls_move_apart || !both[side]->moves_with(*first_wall);
    if (!both[side]->moves()) continue;
    contact.wall[side] = static_cast<int>(walls.size());
    walls.push_back(*both[side]);
    has_moving_wall = true;
  }
  set_columns(contact);
  if (!is_sign_known(contact.velocity))
    if (const auto n_u = exact_normal_velocity(a.x, b.x, contact.point, contact.normal))
      contact.velocity = {n_u->rounded(), std::fabs(n_u->sign()) * 0x1p-100};
  contact.axes = axes_of<double>(contact);
  contact.axes[0].velocity = high(contact.velocity) / contact.length;
  contacts.push_back(contact);
  ++count;
}

void Assembly::finish() {
  for (AssembledContact& contact : contacts) contact.scale = 1 / std::sqrt(coupling<double>(contact, contact));
  if (surely_separates()) return;
  A = scaled_couplings<double>();
  for (int i = 0; i < count; ++i) A[i * count + i] = 1;
  is_locked = !find_separating_velocity<double>() && !find_separating_velocity<DD>();
}

bool Assembly::is_finite() const {
  auto is_number = [](double x) { return std::isfinite(x); };
  for (const AssembledContact& contact : contacts) {
    if (!is_number(contact.scale)) return false;
    for (const auto& axis : contact.axes)
      if (!is_number(axis.velocity)) return false;
  }
  return std::all_of(A.begin(), A.end(), is_number);
}

bool Assembly::has_representable_impulses() const {
  double fastest = 0;
  for (const AssembledContact& contact : contacts) fastest = std::fmax(fastest, -contact.axes[0].velocity);
  return std::all_of(contacts.begin(), contacts.end(), [&](const AssembledContact& contact) {
    double speed = -contact.axes[0].velocity;
    return !(speed > 0 && speed >= fastest) || -high(contact.velocity) * contact.scale * contact.scale > 0;
  });
}

bool Assembly::surely_separates() const {
  auto may_approach = [](const AssembledContact& contact) {
    return !(high(contact.velocity) >= width(contact.velocity));
  };
  return std::none_of(contacts.begin(), contacts.end(), may_approach);
}

bool Assembly::approach_is_uncertain() const {
  auto approaches = [](const AssembledContact& contact) { return high(contact.velocity) < 0; };
  return std::none_of(contacts.begin(), contacts.end(), approaches) && !surely_separates();
}

std::optional<bool> Assembly::approaches_below(const AssembledContact& contact, double threshold, bool is_exact) const {
  const double speed = -contact.axes[0].velocity;
  if (!(speed > 0)) return false;
  if (std::fabs(speed - threshold) > threshold * 0x1p-50 + width(contact.velocity) / contact.length)
    return speed < threshold;
  if (!is_exact) return {};
  const double resting[BODY] = {INFINITY};
  auto numbers_of = [&](int side) { return body_of(contact, side) ? body_of(contact, side)->x : resting; };
  const auto n_u = exact_normal_velocity(numbers_of(0), numbers_of(1), contact.point, contact.normal);
  if (!n_u) return {};
  return approach_below(*n_u, contact.normal, threshold);
}

template <class R>
std::array<ContactAxis<R>, 3> Assembly::axes_of(const AssembledContact& contact) const {
  std::array<ContactAxis<R>, 3> axes{};
  const auto directions = contact.unit_vectors<R>();
  DD velocity[3]{};
  for (int side = 0; side < 2; ++side) {
    const AssembledBody* body = body_of(contact, side);
    if (!body) continue;
    DD d[3], com[3], spin[3], massless[3];  // d: from the reference point
    R arm[3];
    for (int k = 0; k < 3; ++k) {
      com[k] = value(body->centre.com()[k]);
      spin[k] = value(body->centre.numbers[CENTRE_EFFECTIVE_SPIN + k]);
      massless[k] = value(body->centre.numbers[CENTRE_MASSLESS_SPIN + k]);
      d[k] = DD{contact.point[k], 0} - value(body->centre.x[k]);
      arm[k] = rounded_to<R>(d[k] - com[k]);
    }
    const std::array<DD, 3> by_spin = cross(spin, d), by_massless_spin = cross(massless, com);
    for (int k = 0; k < 3; ++k) {
      const DD of_body = value(body->centre.v[k]) + by_spin[k] + by_massless_spin[k];
      velocity[k] = side ? velocity[k] - of_body : of_body;
    }
    if (!body->is_movable()) continue;
    const auto& centre = body->template centre_in<R>();
    for (int axis = 0; axis < 3; ++axis)
      centre.to_energy_metric(directions[axis].data(), arm, side ? -1 : 1, axes[axis].row[side]);
  }
  for (int axis = 0; axis < 3; ++axis)
    for (int k = 0; k < 3; ++k)
      axes[axis].velocity = axes[axis].velocity + directions[axis][k] * rounded_to<R>(velocity[k]);
  return axes;
}

List<N> Assembly::twist_changes(const DD* p) const {
  List<N> twists(6 * static_cast<size_t>(body_count), exact(0.0));
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

N Assembly::velocity_change(const AssembledContact& contact, const List<N>& twists) const {
  N sum = exact(0.0);
  for (int side = 0; side < 2; ++side)
    if (contact.body[side] >= 0)
      for (int k = 0; k < 6; ++k) sum = sum + contact.jacobian[side][k] * twists[6 * contact.body[side] + k];
  return sum;
}

List<N> Assembly::velocities(const DD* p) const {
  List<N> u(count);
  for (int i = 0; i < count; ++i) u[i] = contacts[i].velocity;
  if (std::all_of(p, p + count, [](const DD& x) { return x.h == 0; })) return u;
  List<N> twists = twist_changes(p);
  for (int i = 0; i < count; ++i) u[i] = u[i] + velocity_change(contacts[i], twists);
  return u;
}

template <class R>
List<R> Assembly::scaled_couplings() const {
  List<R> matrix(static_cast<size_t>(count) * count);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j <= i; ++j)
      matrix[i * count + j] = matrix[j * count + i] =
          coupling<R>(contacts[i], contacts[j]) * (constant<R>(contacts[i].scale) * constant<R>(contacts[j].scale));
  return matrix;
}

// The formula of physics/column.py for both bodies of a contact, along its normal.
void Assembly::set_columns(AssembledContact& contact) const {
  const AssembledBody* both[2] = {body_of(contact, 0), body_of(contact, 1)};
  constexpr int V = BODY_VELOCITY_X;
  // A common velocity cancels: leave out its rounding.
  const bool is_common = both[0] && both[1] && std::equal(both[0]->x + V, both[0]->x + V + 3, both[1]->x + V);
  N velocity[2] = {};
  for (int side = 0; side < 2; ++side) {
    if (!both[side]) continue;
    const Centre<N>& centre = both[side]->centre;
    N *jacobian = contact.jacobian[side], *response = contact.response[side];
    N in[CENTRE_COUNT + 9]{}, out[10];
    std::copy(centre.numbers, centre.numbers + CENTRE_COUNT, in);
    if (!is_common) std::copy(centre.v, centre.v + 3, in + CENTRE_COUNT);
    for (int k = 0; k < 3; ++k) {
      in[CENTRE_COUNT + 3 + k] = exact(contact.point[k]) - centre.x[k];
      in[CENTRE_COUNT + 6 + k] = jacobian[k] = exact(contact.normal[k]);
    }
    column<N>(in, out, nullptr, nullptr);
    velocity[side] = out[0];
    std::copy(out + 1, out + 4, jacobian + 3);
    std::copy(out + 4, out + 10, response);
    for (int k = 0; side && k < 6; ++k) {  // body_b gets the opposite
      jacobian[k] = -jacobian[k];
      response[k] = -response[k];
    }
  }
  contact.velocity = velocity[0] - velocity[1];
}

// Find a velocity that separates all contacts, in the digits of R: the least d with N^T d >= 1, scaled. Whether it does.
template <class R>
bool Assembly::find_separating_velocity() {
  const Minimum<R> minimum = minimise(couplings<R>(), List<R>(count, constant<R>(-1)), all_contacts());
  List<DD> d(count);
  for (int i = 0; i < count; ++i) d[i] = lifted<DD>(minimum.x[i] * constant<R>(contacts[i].scale));
  List<N> twists = twist_changes(d.data());
  separation.resize(count);
  double square = 0;
  bool separates = true;
  for (int i = 0; i < count; ++i) {
    N rho = velocity_change(contacts[i], twists);
    separation[i] = (high(rho) - width(rho)) * contacts[i].scale;
    square += d[i].h * (high(rho) + width(rho));
    separates = separates && separation[i] > 0.5;
  }
  separating_size = std::sqrt(square) * ROUND_UP;
  return separates;
}

template std::array<ContactAxis<DD>, 3> Assembly::axes_of(const AssembledContact& contact) const;
template List<DD> Assembly::scaled_couplings() const;
