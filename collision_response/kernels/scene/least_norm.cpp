// The least of all impulses that have the same effect.
#include "least_norm.hpp"

namespace {

// The effects of impulses: the products of those of all pairs of contacts, scaled to a diagonal of 1, in the digits of R.
// To the velocities, moving walls add their work, which impulses of the same effect must not change either.
template <class R>
struct Effects {
  Vector u, scale;
  double fastest = 0;
  List<R> matrix;

  explicit Effects(const Assembly& assembly)
      : u(assembly.count), scale(assembly.count), matrix(assembly.couplings<R>()) {
    const int count = assembly.count;
    const List<AssembledContact>& contacts = assembly.contacts;
    for (const AssembledContact& contact : contacts)
      fastest = std::fmax(fastest, std::fabs(high(contact.velocity)) * contact.scale);
    for (int i = 0; i < count; ++i) {
      u[i] = assembly.walls_move_apart && fastest > 0 ? high(contacts[i].velocity) * contacts[i].scale / fastest : 0;
      scale[i] = contacts[i].scale / std::sqrt(1 + u[i] * u[i]);
    }
    auto factor = [&](int i) { return constant<R>(scale[i] / contacts[i].scale); };
    for (int i = 0; assembly.walls_move_apart && i < count; ++i)
      for (int j = 0; j < count; ++j)
        matrix[i * count + j] = factor(i) * factor(j) * (matrix[i * count + j] + constant<R>(u[i]) * constant<R>(u[j]));
  }
};

// Effects up to which they may be rounding, relative to those of the single impulses, which cancel; and up to which
// refining null impulses still gains digits.
constexpr double NO_EFFECT = 0x1p-93, LEAST_EFFECT = 0x1p-98;

// Find null impulses of the contacts `among` by pivots up to `dependent`, in the digits of R, and refine them until their
// effects are `enough`. Left out are those whose effect, squared, is `most` or greater.
template <class R>
NullImpulses null_impulses_in(const Assembly& assembly, const List<int>& among, double enough, double dependent,
                              double most) {
  constexpr int REFINEMENTS = 3;
  constexpr double WEIGHT_OF_WORK = 1e-6;  // the velocities of walls are known to fewer digits
  const int count = assembly.count;
  const List<AssembledContact>& contacts = assembly.contacts;
  const Effects<R> effects(assembly);
  const Vector &u = effects.u, &scale = effects.scale;
  const double fastest = effects.fastest;
  ActiveSet<R> basis(effects.matrix.data(), count);
  NullImpulses found;
  List<R> w;
  for (int i : basis.span(among, dependent)) {
    List<DD> z(count);
    basis.line(i, w);
    z[i].h = scale[i];
    for (size_t m = 0; m < w.size(); ++m)
      z[basis.members[m]] = lifted<DD>(w[m] * constant<R>(-scale[basis.members[m]]));
    // These digits take its effect for 0: compute that in double-double, and refine z until it is 0.
    double square = 0;
    bool is_exact = false;
    for (int turn = 0;; ++turn) {
      List<N> twists = assembly.twist_changes(z.data());
      N total = exact(0.0);
      for (int n = 0; assembly.walls_move_apart && n < count; ++n) total = total + contacts[n].velocity * exact(z[n]);
      const double work = fastest > 0 ? high(total) / fastest : 0;
      square = work * work * WEIGHT_OF_WORK;
      for (int n = 0; n < count; ++n)
        if (z[n].h != 0) square += z[n].h * high(assembly.velocity_change(contacts[n], twists));
      double size = std::fabs(work);  // of the effect, in the norm of error_bound
      for (int b = 0; b < assembly.body_count; ++b) {
        double rounded[6];
        for (int k = 0; k < 6; ++k) rounded[k] = high(twists[6 * b + k]);
        size += twist_size(assembly.bodies[b].x, rounded);
      }
      const double terms = assembly.velocity_size(z.data());
      is_exact = size <= NO_EFFECT * terms;
      if (size <= enough * terms || turn == REFINEMENTS) break;
      for (size_t m = 0; m < w.size(); ++m) {
        int j = basis.members[m];
        const double change = high(assembly.velocity_change(contacts[j], twists));
        w[m] = constant<R>(-(change + u[j] / contacts[j].scale * work) * scale[j]);
      }
      basis.solve(w.data());
      for (size_t m = 0; m < w.size(); ++m)
        z[basis.members[m]] = z[basis.members[m]] + lifted<DD>(w[m] * constant<R>(scale[basis.members[m]]));
    }
    if (!(std::fabs(square) < most)) {
      found.are_complete = false;
      basis.append(i);  // others may depend on it
      continue;
    }
    found.basis.push_back(std::move(z));
    found.are_exact = found.are_exact && is_exact;
  }
  return found;
}

// In doubles, contacts of very light bodies seem to depend on each other, and hide those that do.
NullImpulses null_impulses_with(const Assembly& assembly, const List<int>& among, double enough) {
  NullImpulses found = null_impulses_in<double>(assembly, among, enough, DEPENDENT<double>, NEXT_TO_NOTHING);
  return found.are_complete ? found : null_impulses_in<DD>(assembly, among, enough, NEXT_TO_NOTHING, NEXT_TO_NOTHING);
}

// Rounding of impulses, relative to the greatest.
template <class R> constexpr double ROUNDING = is_scalar<R> ? 0x1p-46 : 0x1p-88;

// The multipliers of the impulses that are 0, relative to the greatest impulse, from which on the others are not known:
// they grow with what these would be if rounding let the former be less than 0.
constexpr double GREATEST_MULTIPLIERS = 1e9;

// Null impulses as orthonormal vectors Z, in the digits of R.
template <class R>
class NullSpace {
 public:
  // `weight`: of each contact.
  NullSpace(const List<List<DD>>& basis, const Vector& weight) : used(basis.size()) {
    const int count = static_cast<int>(weight.size());
    for (size_t k = 0; k < basis.size(); ++k) {
      Z.emplace_back(count);
      used[k].reserve(count);
      for (int i = 0; i < count; ++i) Z[k][i] = weight[i] * rounded_to<R>(basis[k][i]);
      for (int turn = 0; turn < 2; ++turn)  // twice is enough
        for (size_t before = 0; before < k; ++before) add(Z[k], -along(Z[k], before), before);
      const R length = root(dot(Z[k], Z[k]));
      for (int i = 0; i < count; ++i) {
        R& x = Z[k][i];
        x = x / length;
        if (std::fabs(high(x)) < ROUNDING<R>) x = R{};
        else used[k].push_back(i);
      }
    }
  }

  // Leave out the contacts that change by less than `part` of the norm.
  void leave_out(double part) {
    const size_t count = Z.empty() ? 0 : Z[0].size();
    Vector square(count);
    for (const auto& z : Z)
      for (size_t i = 0; i < count; ++i) square[i] += high(z[i]) * high(z[i]);
    for (size_t k = 0; k < Z.size(); ++k) {
      List<int> kept;
      for (int i : used[k])
        if (square[i] < part * part) Z[k][i] = R{};
        else kept.push_back(i);
      used[k] = std::move(kept);
    }
  }

  size_t size() const { return Z.size(); }
  const R& at(size_t k, int i) const { return Z[k][i]; }
  const List<int>& contacts(size_t k) const { return used[k]; }

  // Z_k.x
  R along(const List<R>& x, size_t k) const {
    R sum{};
    for (int i : used[k]) sum += Z[k][i] * x[i];
    return sum;
  }
  // x += by Z_k
  void add(List<R>& x, const R& by, size_t k) const {
    for (int i : used[k]) x[i] += by * Z[k][i];
  }

 private:
  List<List<R>> Z;
  List<List<int>> used;  // the contacts for which each of them is not 0
};

// The multipliers x >= 0 of P + Z Z^T x >= 0.
template <class R>
struct Multipliers {
  bool are_found = false;
  List<R> x, scale;  // scale: 0 for contacts that Z does not change
  double sum = 0;  // of their sizes, scaled
  double room = 0;  // how far below 0 impulses were let, relative to the greatest
};

// By the dual, which is again a quadratic programme, scaled to a unit diagonal. `greatest`: of P.
template <class R>
Multipliers<R> find_multipliers(const NullSpace<R>& Z, const List<R>& P, double greatest) {
  constexpr double SMALL = is_scalar<R> ? 1e-10 : 1e-14;  // components of Z that may be rounding
  // Where impulses are just 0, rounding may leave no solution without some room below 0. The less the better: where
  // normals are nearly parallel, others change by many times as much.
  constexpr double ROOMS[] = {1e-30, 1e-27, 1e-24, 1e-18, 1e-13, 1e-9};
  const int count = static_cast<int>(P.size());
  Multipliers<R> found;
  found.x.resize(count);
  found.scale.resize(count);
  List<R>& s = found.scale;
  List<R> b(count), dual(static_cast<size_t>(count) * count);
  for (size_t k = 0; k < Z.size(); ++k)
    for (int i : Z.contacts(k))
      for (int j : Z.contacts(k)) dual[i * count + j] += Z.at(k, i) * Z.at(k, j);
  List<int> among;
  for (int i = 0; i < count; ++i) {
    const R square = dual[i * count + i];
    if (!(high(square) > SMALL * SMALL)) continue;
    s[i] = constant<R>(1) / root(square);
    among.push_back(i);
  }
  for (int i : among)
    for (int j : among) dual[i * count + j] = i == j ? constant<R>(1) : dual[i * count + j] * s[i] * s[j];
  auto with_room = [&](double least) {
    for (int i : among) b[i] = (P[i] + least * greatest) * s[i];
    return minimise(dual, b, among);
  };
  Minimum<R> solved = with_room(0);
  for (double more : ROOMS)
    if (more > Traits<R>::roundoff && solved.status != MinimumStatus::FOUND) solved = with_room(found.room = more);
  found.are_found = solved.status == MinimumStatus::FOUND;
  for (int i : among) {
    found.x[i] = solved.x[i] * s[i];
    found.sum += std::fabs(high(solved.x[i]));
  }
  return found;
}

// p is known if multipliers are not too great, and no component of Z that may be rounding changes an impulse by more than
// it is.
template <class R>
bool minimise_norm_in(const Assembly& assembly, List<R>& p, bool over_copies, const List<List<DD>>& basis,
                      double left_out = 0, const Vector& target = {}) {
  const int count = assembly.count;
  List<R> P(count), goal(count);
  Vector weight(count), terms(count);  // terms: the sum of the sizes of what P is the sum of
  for (int i = 0; i < count; ++i) {
    weight[i] = assembly.contacts[i].length / (over_copies ? std::sqrt(assembly.contacts[i].copies) : 1);
    P[i] = weight[i] * p[i];
    if (!target.empty()) goal[i] = constant<R>(weight[i] * target[i]);
    terms[i] = std::fabs(high(P[i]));
  }
  NullSpace<R> Z(basis, weight);
  Z.leave_out(left_out);
  const List<R> given = P;
  auto add_to_P = [&](const R& by, size_t k) {
    Z.add(P, by, k);
    for (int i : Z.contacts(k)) terms[i] += std::fabs(high(by * Z.at(k, i)));
  };
  for (size_t k = 0; k < Z.size(); ++k) add_to_P(Z.along(goal, k) - Z.along(P, k), k);
  double greatest = 0;
  for (const R& one : P) greatest = std::fmax(greatest, std::fabs(high(one)));
  const Multipliers<R> multipliers = find_multipliers(Z, P, greatest);
  if (!multipliers.are_found) return false;
  const List<R>& x = multipliers.x;
  for (size_t k = 0; k < Z.size(); ++k) add_to_P(Z.along(x, k), k);
  bool is_known = multipliers.sum <= GREATEST_MULTIPLIERS * greatest;
  for (int i = 0; i < count; ++i) {
    const double change = std::fabs(high(P[i] - given[i]));
    const bool may_change = high(multipliers.scale[i]) != 0;
    is_known = is_known && (may_change || change < high(given[i]) || change <= ROUNDING<R> * greatest);
    // The room of all contacts may add up at one.
    const double none = std::fmax(ROUNDING<R> * terms[i], count * multipliers.room * greatest);
    p[i] = high(x[i]) > 0 || high(P[i]) <= none ? R{} : P[i] / weight[i];
  }
  return is_known;
}

}  // namespace

NullImpulses null_impulses(const Assembly& assembly) {
  return null_impulses_with(assembly, assembly.all_contacts(), LEAST_EFFECT);
}

bool minimise_norm(const Assembly& assembly, List<DD>& p, const List<List<DD>>& Z, double left_out,
                   const Vector& target) {
  return minimise_norm_in(assembly, p, false, Z, left_out, target);
}

void least_norm(const Assembly& assembly, Vector& p, const List<int>& among) {
  if (std::all_of(p.begin(), p.end(), [](double x) { return x == 0; })) return;
  const NullImpulses found = null_impulses_with(assembly, among, NO_EFFECT);
  if (!found.basis.empty()) minimise_norm_in(assembly, p, true, found.basis);
}
