// The axes of contacts on a face.
#include "condition_axes.hpp"

#include "shared_loads.hpp"

namespace {

// The greatest tilt between neighbours on a face, and the greatest height of a contact over its plane, relative to its size.
constexpr double TILT = 4.5e-5;

// The contacts on one face with the first, by way of neighbours, so that no order matters.
List<int> face_of(const Assembly& assembly, int first) {
  List<int> face{first};
  List<bool> is_found(assembly.count);
  is_found[first] = true;
  for (size_t k = 0; k < face.size(); ++k)
    for (int i = first + 1; i < assembly.count; ++i)
      if (!is_found[i] && are_on_one_face(assembly, face[k], i, TILT)) {
        is_found[i] = true;
        face.push_back(i);
      }
  return face;
}

// The plane of a face.
struct Plane {
  Axes normal;  // the mean one of its contacts, towards body_a of the first
  Axes middle;  // of the contacts
  double size;  // the greatest distance of a contact from there
};

Axes difference(const double* a, const double* b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

Plane plane_of(const Assembly& assembly, const List<int>& face) {
  Plane plane{};
  const Axes first = assembly.contacts[face[0]].unit_vectors<double>()[0];
  for (int i : face) {
    const AssembledContact& contact = assembly.contacts[i];
    const Axes own = contact.unit_vectors<double>()[0];
    for (int k = 0; k < 3; ++k) {
      plane.normal[k] += std::copysign(1, dot(first, own)) * own[k];  // the bodies may be swapped
      plane.middle[k] += contact.point[k] / static_cast<double>(face.size());
    }
  }
  const double length = length_of(plane.normal);
  for (double& one : plane.normal) one /= length;
  for (int i : face)
    plane.size = std::fmax(plane.size, length_of(difference(assembly.contacts[i].point, plane.middle.data())));
  return plane;
}

// The axes of a contact on a face.
ConditionAxes axes_on(const Plane& plane, const AssembledContact& contact) {
  constexpr double ROUNDING = 0x1p-49;  // of a unit normal
  ConditionAxes axes{contact.axes};
  axes.on_face = true;
  const Axes from_middle = difference(contact.point, plane.middle.data());
  const double height = dot(plane.normal, from_middle);
  for (int k = 0; k < 3 && std::fabs(height) <= TILT * plane.size; ++k) axes.above[k] = height * plane.normal[k];
  const std::array<Axes, 3> to = axes_along(plane.normal), from = contact.unit_vectors<double>();
  const double sign = std::copysign(1, dot(to[0], from[0]));
  for (int k = 0; k < 3; ++k) axes.is_turned = axes.is_turned || std::fabs(sign * to[0][k] - from[0][k]) > ROUNDING;
  if (!axes.is_turned) return axes;
  axes.axes = {};
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      const double part = axes.in_own[a][b] = sign * dot(to[a], from[b]);
      axes.axes[a].velocity += part * contact.axes[b].velocity;
      for (int side = 0; side < 2; ++side)
        for (int k = 0; k < 6; ++k) axes.axes[a].row[side][k] += part * contact.axes[b].row[side][k];
    }
  return axes;
}

}  // namespace

List<ConditionAxes> own_axes(const Assembly& assembly) {
  List<ConditionAxes> all;
  for (const AssembledContact& contact : assembly.contacts) all.push_back({contact.axes});
  return all;
}

List<ConditionAxes> face_axes(const Assembly& assembly) {
  List<ConditionAxes> all = own_axes(assembly);
  List<bool> is_done(assembly.count);
  for (int first = 0; first < assembly.count; ++first) {
    if (is_done[first]) continue;
    const List<int> face = face_of(assembly, first);
    for (int i : face) is_done[i] = true;
    if (face.size() < 2) continue;
    const Plane plane = plane_of(assembly, face);
    for (int i : face) all[i] = axes_on(plane, assembly.contacts[i]);
  }
  return all;
}
