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

// The search for the projection from velocities `start`, with active sets in the digits of R and impulses in double-double.
template <class R>
class Search {
 public:
  Search(const Assembly& assembly, const List<N>& start, const List<int>& among)
      : assembly(assembly), contacts(assembly.contacts), start(start), among(among), has_left(assembly.count) {}

  Projection project(const List<int>& guess) && {
    List<R> b(assembly.count);
    for (int i : among) b[i] = rounded_to<R>(start[i]) * scale(i);
    Minimum<R> first = minimise(assembly.couplings<R>(), b, among, guess);
    found.status = first.status;
    if (found.status != MinimumStatus::FOUND) return std::move(found);
    for (int j : first.active.members) q[j] = lifted<DD>(first.x[j] * scale(j));
    change_active_set(first.active);
    for (DD& one : q)
      if (one.h < 0) set(one, DD{0, 0});
    if (!is_current) update_r();
    found.active = first.active.members;
    found.error = projection_error(assembly, among, q, start, r);
    return std::move(found);
  }

 private:
  const Assembly& assembly;
  const List<AssembledContact>& contacts;
  const List<N>& start;
  const List<int>& among;
  Projection found{MinimumStatus::FOUND, List<DD>(assembly.count), List<N>(assembly.count), INFINITY};
  List<DD>& q = found.q;
  List<N>& r = found.r;
  bool is_current = false;  // whether r are the velocities after q
  bool is_settled = false;  // whether those of the active set are 0 but for rounding
  List<char> has_left;
  int returns = 0;  // of contacts that have left

  R scale(int j) const { return constant<R>(contacts[j].scale); }
  void set(DD& impulse, const DD& x) {
    impulse = x;
    is_current = false;
  }
  void update_r() {
    is_current = true;
    const List<N> twists = assembly.twist_changes(q.data());
    for (int i : among) r[i] = start[i] + assembly.velocity_change(contacts[i], twists);
  }

  // Until no impulse pulls and no contact approaches, or R has too few digits.
  void change_active_set(ActiveSet<R>& active) {
    constexpr int MOST_RETURNS = 1;
    const int most_rounds = 4 * assembly.count + 20;  // mostly, few contacts change
    for (int round = 0; round < most_rounds; ++round) {
      if (!refine(active)) return;
      if (const int place = most_negative(active); place >= 0) {
        set(q[active.members[place]], DD{0, 0});
        active.drop(place);
        continue;
      }
      const int entering = fastest_approach(active);
      if (entering < 0) {
        found.is_settled = is_settled;
        return;
      }
      if (has_left[entering] && ++returns > MOST_RETURNS) return;  // they take turns
      if (!add(entering, active)) return;  // the error bound says so
    }
  }

  // Refine the active impulses, by Newton's method. Whether it does not diverge.
  bool refine(const ActiveSet<R>& active) {
    constexpr int REFINEMENTS = 8;
    constexpr double SETTLED = 2;  // velocities relative to bounds on their rounding
    double residual = 0, first_residual = INFINITY;
    List<R> y;
    for (int turn = 0; turn < REFINEMENTS; ++turn) {
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
      for (size_t k = 0; k < y.size(); ++k) {
        const int j = active.members[k];
        set(q[j], q[j] + lifted<DD>(y[k] * scale(j)));
      }
    }
    return is_settled || residual <= first_residual;
  }

  // The place in the active set of the impulse that pulls most, or -1.
  int most_negative(const ActiveSet<R>& active) const {
    int worst = -1;
    for (size_t k = 0; k < active.members.size(); ++k) {
      const int j = active.members[k], other = active.members[worst < 0 ? k : worst];
      if (q[j].h < 0 && (worst < 0 || q[j].h * contacts[other].scale < q[other].h * contacts[j].scale))
        worst = static_cast<int>(k);
    }
    return worst;
  }

  // The contact that approaches fastest, by more than rounding, or -1.
  int fastest_approach(const ActiveSet<R>& active) const {
    constexpr double APPROACH = 8;  // velocities relative to bounds on their rounding
    int fastest = -1;
    double most = 0;
    for (int i : among) {
      const double slope = high(r[i]) * contacts[i].scale;
      if (!active.has(i) && high(r[i]) < -APPROACH * r[i].error && slope < most) {
        most = slope;
        fastest = i;
      }
    }
    return fastest;
  }

  // Let a contact enter the active set. Whether the digits of R suffice.
  bool add(int entering, ActiveSet<R>& active) {
    auto move = [&](int j, const R& by) {
      const bool leaves = high(by) == -INFINITY;
      has_left[j] = has_left[j] || leaves;
      set(q[j], leaves ? DD{0, 0} : q[j] + lifted<DD>(by * scale(j)));
    };
    auto at = [&](int j) { return rounded_to<R>(q[j]) / scale(j); };
    const R slope = rounded_to<R>(r[entering]) * scale(entering);
    return enter(active, entering, slope, move, at) == MinimumStatus::FOUND;
  }
};

}  // namespace

Projection project(const Assembly& assembly, const List<N>& start, const List<int>& among, const List<int>& guess) {
  const Projection found = Search<double>(assembly, start, among).project(guess);
  if (found.status == MinimumStatus::FOUND && (found.is_settled || assembly.is_locked)) return found;
  const Projection finer = Search<DD>(assembly, start, among).project(found.active);
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
