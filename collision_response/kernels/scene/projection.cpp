// The inelastic projection, in double-double.
#include "projection.hpp"

namespace {

double greatest_scaled(const Assembly& assembly, const List<N>& u, const List<int>& among) {
  double most = 0;
  for (int i : among) most = std::fmax(most, std::fabs(high(u[i]) * assembly.contacts[i].scale));
  return most;
}

// How far impulses q that leave velocities r are from those of project(), at most. With w the velocities reached, w*
// those asked for, and r = u(w):
//
//     |w - w*|^2 = (q - q*).(r - r*) <= q.r + q*.max(-r, 0)        q*.r* = 0, q.r* >= 0
//     q*.rho <= |d| |w* - v|          for any velocity d that separates the contacts, N^T d = rho > 0
double projection_error(const Assembly& assembly, const List<int>& among, const List<DD>& q, const List<N>& start,
                        const List<N>& r) {
  if (assembly.is_locked) return INFINITY;
  // In a unit near the size of the velocities: energies may be out of the range of doubles.
  const double unit = power_near(greatest_scaled(assembly, start, among));
  double gap = 0, far = 0, moved = 0;
  for (int i : among) {
    double low = high(r[i]) - width(r[i]), largest = std::fabs(high(r[i])) + width(r[i]);
    gap += q[i].h / unit * ROUND_UP * (largest / unit);
    if (low < 0) far = std::fmax(far, -low * assembly.contacts[i].scale / unit / assembly.separation[i]);
    moved += q[i].h / unit * ((std::fabs(high(start[i])) + width(start[i])) / unit);
  }
  far *= assembly.separating_size;
  double distance = std::sqrt(moved + gap);  // |w - v|^2 = q.r - q.u
  return (far + std::sqrt(far * far + 4 * (gap + far * distance))) / 2 * ROUND_UP * unit;
}

// The projection from velocities `start`, with active sets in the digits of R and impulses in double-double.
template <class R>
Projection project_with(const Assembly& assembly, const List<N>& start, const List<int>& among,
                        const List<int>& guess) {
  constexpr int MOST_RETURNS = 1, REFINEMENTS = 8;
  constexpr double SETTLED = 2, APPROACH = 8;  // velocities relative to bounds on their rounding
  const int count = assembly.count, most_rounds = 4 * count + 20;  // mostly, few contacts change
  const List<AssembledContact>& contacts = assembly.contacts;
  auto scale = [&](int j) { return constant<R>(contacts[j].scale); };
  Projection result{MinimumStatus::FOUND, List<DD>(count), List<N>(count), INFINITY};
  List<DD>& q = result.q;
  List<N>& r = result.r;
  List<R> b(count);
  for (int i : among) b[i] = rounded_to<R>(start[i]) * scale(i);
  Minimum<R> first = minimise(assembly.couplings<R>(), b, among, guess);
  result.status = first.status;
  if (result.status != MinimumStatus::FOUND) return result;
  ActiveSet<R>& active = first.active;
  for (int j : active.members) q[j] = lifted<DD>(first.x[j] * scale(j));

  bool is_current = false;  // whether r are the velocities after q
  bool is_settled = false;
  auto update_r = [&] {
    is_current = true;
    List<N> twists = assembly.twist_changes(q.data());
    for (int i : among) r[i] = start[i] + assembly.velocity_change(contacts[i], twists);
  };
  List<R> y;
  List<char> has_left(count);
  int returns = 0;  // of contacts that have left
  for (int round = 0; round < most_rounds; ++round) {
    double residual = 0, first_residual = INFINITY;
    for (int turn = 0; turn < REFINEMENTS; ++turn) {  // refine the active impulses, by Newton's method
      update_r();
      is_settled = true;
      y.clear();
      residual = greatest_scaled(assembly, r, active.members);
      if (turn == 0) first_residual = residual;
      for (int j : active.members) {
        y.push_back(-rounded_to<R>(r[j]) * scale(j));
        is_settled = is_settled && std::fabs(high(r[j])) <= SETTLED * r[j].error;
      }
      if (is_settled) break;
      active.solve(y.data());
      is_current = false;
      for (size_t k = 0; k < y.size(); ++k) {
        int j = active.members[k];
        q[j] = q[j] + lifted<DD>(y[k] * scale(j));
      }
    }
    if (!is_settled && !(residual <= first_residual)) break;  // it diverges: R has too few digits
    int worst = -1;  // the most negative impulse leaves
    for (size_t k = 0; k < active.members.size(); ++k) {
      int j = active.members[k], other = active.members[worst < 0 ? k : worst];
      if (q[j].h < 0 && (worst < 0 || q[j].h * contacts[other].scale < q[other].h * contacts[j].scale))
        worst = static_cast<int>(k);
    }
    if (worst >= 0) {
      q[active.members[worst]] = DD{0, 0};
      is_current = false;
      active.drop(worst);
      continue;
    }
    int entering = -1;  // the contact that approaches fastest enters
    double most = 0;
    for (int i : among) {
      double slope = high(r[i]) * contacts[i].scale;
      if (!active.has(i) && high(r[i]) < -APPROACH * r[i].error && slope < most) {
        most = slope;
        entering = i;
      }
    }
    if (entering < 0) {
      result.is_settled = is_settled;
      break;
    }
    if (has_left[entering] && ++returns > MOST_RETURNS) break;  // they take turns: R has too few digits
    is_current = false;
    auto move = [&](int j, const R& by) {
      const bool leaves = high(by) == -INFINITY;
      has_left[j] = has_left[j] || leaves;
      q[j] = leaves ? DD{0, 0} : q[j] + lifted<DD>(by * scale(j));
    };
    MinimumStatus status = enter(active, entering, rounded_to<R>(r[entering]) * scale(entering), move,
                                 [&](int j) { return rounded_to<R>(q[j]) / scale(j); });
    if (status != MinimumStatus::FOUND) break;  // beyond what these digits can tell: the error bound says so
  }
  for (DD& one : q)
    if (one.h < 0) {
      one = DD{0, 0};
      is_current = false;
    }
  if (!is_current) update_r();
  result.active = active.members;
  result.error = projection_error(assembly, among, q, start, r);
  return result;
}

}  // namespace

Projection project(const Assembly& assembly, const List<N>& start, const List<int>& among, const List<int>& guess) {
  const Projection found = project_with<double>(assembly, start, among, guess);
  if (found.status == MinimumStatus::FOUND && (found.is_settled || assembly.is_locked)) return found;
  const Projection finer = project_with<DD>(assembly, start, among, found.active);
  return found.error <= finer.error && found.status == MinimumStatus::FOUND ? found : finer;
}

Projection project_to_rebound(const Assembly& assembly) {
  List<N> start;
  for (const AssembledContact& contact : assembly.contacts) {
    const N& u = contact.velocity;
    start.push_back(high(u) < 0 ? u + u * exact(contact.e) : u);
    if (!(high(u) < 0) && high(u) < width(u)) start.back().error += width(u);
  }
  return project(assembly, start, assembly.all_contacts());
}

List<int> contradictory_contacts(const Assembly& assembly) {
  Vector b;
  for (const AssembledContact& contact : assembly.contacts) b.push_back(high(contact.velocity) * contact.scale);
  Minimum<double> end = minimise(assembly.couplings<double>(), b, assembly.all_contacts());
  if (end.status != MinimumStatus::UNBOUNDED) return {};
  end.active.members.push_back(end.last);
  return end.active.members;
}
