// Scenes: several contacts at once. Resolve whole scenes, and clusters of tables, without Python.
#include <array>
#include <memory>
#include <optional>

#include "arrays.hpp"
#include "module.hpp"
#include "resolve.hpp"
#include "scene/read_scene.hpp"
#include "scene/table_clusters.hpp"

// find_clusters(pairs, movable, order, starts, cluster): writes the clusters to the last three arrays, as in
// contact_pairs.hpp, and returns how many there are.
PyObject* find_clusters(PyObject*, PyObject* const* args, Py_ssize_t count) {
  Array pairs, movable, order, starts, cluster;
  if (count != 5 || !open_arrays(args, {&pairs, &movable}) || !open_arrays(args + 2, {&order, &starts, &cluster}, true))
    return PyErr_Format(PyExc_TypeError, "find_clusters() takes five arrays");
  long n = static_cast<long>(order.view.shape[0]), found;
  ContactPairs who{pairs.at<std::int64_t>(), pairs.at<std::int64_t>() + n, movable.view.shape[0]};
  {
    ReleasedGil released;
    found = divide_into_clusters(who, n, movable.at<bool>(), order.at<std::int64_t>(), starts.at<std::int64_t>(),
                                 cluster.at<std::int64_t>());
  }
  return PyLong_FromLong(found);
}

// resolve_clusters(layout, law, numbers, bodies, pairs, contacts, order, starts, results, wanted, from, to): resolve
// the clusters wanted[from:to], without the GIL. `numbers` are the approach threshold, the restitution threshold, the
// tangential restitution, the tolerance, the greatest error bound allowed, the budget of ROUTH_STRONGE, and whether the
// restitution threshold is not rounded. The arrays are those of batch/resolve_scenes.py, of the right shapes; `results`
// are the fields of a ScenesResult. Clusters that are left to Python get the status 0, or keep theirs if no cluster is
// resolved here.
PyObject* resolve_clusters(PyObject*, PyObject* args) {
  int layout;
  long from, to;
  ClusterOptions options{};
  double bound_limit;
  int has_exact_threshold;
  PyObject *tables[5], *results, *wanted_clusters;
  if (!PyArg_ParseTuple(args, "ii(dddddlp)OOOOOO!Oll", &layout, &options.law, &options.threshold,
                        &options.restitution_threshold, &options.tangential_restitution, &options.tolerance,
                        &bound_limit, &options.springs.work, &has_exact_threshold, &tables[0], &tables[1], &tables[2],
                        &tables[3], &tables[4], &PyTuple_Type, &results, &wanted_clusters, &from, &to))
    return nullptr;
  options.has_exact_threshold = has_exact_threshold;
  if (!options.is_for_clusters()) Py_RETURN_NONE;
  TableClusters clusters{table_layouts[layout], options, bound_limit};
  Array wanted;
  if (!clusters.open(tables, results) || !wanted.open(wanted_clusters))
    return PyErr_Format(PyExc_TypeError, "resolve_clusters(): arrays must be contiguous");
  {
    ReleasedGil released;
    for (long i = from; i < to; ++i) clusters.resolve(wanted.at<std::int64_t>()[i]);
  }
  Py_RETURN_NONE;
}

namespace {

// A scene from Python.
struct SceneRequest {
  PyObject *given_bodies, *given_pairs, *given_contacts;  // tuples
  List<std::array<double, BODY>> bodies{};
  List<std::array<double, CONTACT>> contacts{};
  List<std::int64_t> a{}, b{}, order{}, starts{}, cluster{};  // see ContactPairs, divide_into_clusters()
  std::unique_ptr<bool[]> movable{};
  List<char> has_contact{};  // for each body
  long clusters = 0;
  bool has_friction = false;

  ContactPairs pairs() const { return {a.data(), b.data(), static_cast<std::int64_t>(bodies.size())}; }
  void copy_body(std::int64_t i, double* x) const { std::copy(bodies[i].begin(), bodies[i].end(), x); }
  void copy_contact(std::int64_t k, double* x) const { std::copy(contacts[k].begin(), contacts[k].end(), x); }

  // Read the scene. False for anything unusual: a number that is no float, an articulated body, a wrong index.
  bool read() {
    const long n = PyTuple_GET_SIZE(given_contacts), of_bodies = PyTuple_GET_SIZE(given_bodies);
    if (PyTuple_GET_SIZE(given_pairs) != n) return false;
    bodies.resize(of_bodies);
    contacts.resize(n);
    for (auto* numbers : {&a, &b, &order, &cluster}) numbers->resize(n);
    starts.resize(n + 1);
    movable.reset(new bool[of_bodies]);
    has_contact.resize(of_bodies);
    for (long i = 0; i < of_bodies; ++i) {
      PyObject* body = PyTuple_GET_ITEM(given_bodies, i);
      if (Py_TYPE(body) != python.body || !read_exact_body(body, bodies[i].data())) return false;
      movable[i] = bodies[i][BODY_MASS] < INFINITY;
    }
    for (long k = 0; k < n; ++k) {
      PyObject* contact = PyTuple_GET_ITEM(given_contacts, k);
      std::int64_t pair[2];
      if (Py_TYPE(contact) != python.contact || PyTuple_GET_SIZE(contact) != CONTACT_FIELDS ||
          PyTuple_GET_ITEM(contact, CONTACT_FIELD_TANGENTIAL_RESTITUTION) != Py_None ||
          !read_exact_contact(contact, contacts[k].data()) ||
          !read_pair(PyTuple_GET_ITEM(given_pairs, k), of_bodies, pair))
        return false;
      a[k] = pair[0];
      b[k] = pair[1];
      has_contact[a[k]] = has_contact[b[k]] = 1;
      has_friction = has_friction || contacts[k][CONTACT_FRICTION] > 0;
    }
    clusters = divide_into_clusters(pairs(), n, movable.get(), order.data(), starts.data(), cluster.data());
    return clusters > 0;
  }
};

// The answer for a scene, put together cluster by cluster: see SceneImpact.
class SceneAnswer {
 public:
  SceneAnswer(const SceneRequest& scene, PyObject* model, const Plan& plan, const ClusterOptions& options)
      : scene(scene), model(model), plan(plan), options(options), law(options.law), place(scene.bodies.size(), -1) {
    const std::size_t of_bodies = scene.bodies.size(), of_contacts = scene.contacts.size();
    for (int i = 0; i < COLUMNS; ++i)
      column[i] = new_tuple(i < CONTACTS ? of_bodies : i < CLUSTERS ? of_contacts : scene.clusters);
  }
  SceneAnswer(const SceneAnswer&) = delete;
  ~SceneAnswer() {
    for (PyObject* one : column) Py_XDECREF(one);
  }

  // Resolve everything. False if a part is left to Python, or has no answer.
  bool resolve() {
    for (PyObject* one : column)
      if (!one) return false;
    for (long c = 0; c < scene.clusters; ++c) {
      const std::int64_t *first = scene.order.data() + scene.starts[c],
                         *last = scene.order.data() + scene.starts[c + 1];
      if (!(last - first == 1 ? resolve_single_contact(*first) : resolve_contacts(first, last))) return false;
      PyObject* indices = PyTuple_New(last - first);
      if (!indices) return false;
      for (auto k = first; k != last; ++k) PyTuple_SET_ITEM(indices, k - first, PyLong_FromLongLong(*k));
      PyTuple_SET_ITEM(column[CLUSTERS], c, indices);
    }
    for (std::size_t i = 0; i < scene.bodies.size(); ++i)
      if (!(scene.movable[i] && scene.has_contact[i]) && !add_unchanged_body(i)) return false;
    return std::all_of(energies, energies + 4, [](double energy) { return std::isfinite(energy); });
  }

  // The fields of a SceneImpact.
  PyObject* fields() {
    if (PyErr_Occurred()) return nullptr;  // an entry of a column could not be made
    for (PyObject* one : column) finished(one);
    PyObject* used = model_as_used(model, law, geometry, precision);
    if (!used) return nullptr;
    int status = bound > plan.bound_limit ? STATUS_TOLERANCE_NOT_MET : is_separating ? STATUS_SEPARATING : STATUS_OK;
    return Py_BuildValue("ONOOOOOOOddddOOddO", PyTuple_GET_ITEM(python.statuses, status), used, column[CONTACTS],
                         column[TWISTS], column[CHANGES], column[IMPULSES], column[BEFORE], column[AFTER],
                         column[REGIMES], energies[0], energies[1], energies[2], energies[3], column[CLUSTERS], Py_None,
                         bound, margin, PyTuple_GET_ITEM(python.adjustments, adjustments));
  }

 private:
  // One entry for each body in the first two, for each cluster in the last, for each contact in the others.
  enum { TWISTS, CHANGES, CONTACTS, IMPULSES, BEFORE, AFTER, REGIMES, CLUSTERS, COLUMNS };

  const SceneRequest& scene;
  PyObject* model;
  const Plan& plan;
  const ClusterOptions& options;
  PyObject* column[COLUMNS];
  double energies[4] = {}, bound = 0, margin = INFINITY;
  int law, geometry = GEOMETRY_AUTO, precision = PRECISION_AUTO, adjustments = 0;
  bool is_separating = true;
  List<int> place;  // for take_parts()

  void put_body(std::int64_t i, const double* twist, const double* change) {
    PyTuple_SET_ITEM(column[TWISTS], i, make_twist(twist));
    PyTuple_SET_ITEM(column[CHANGES], i, make_twist(change));
  }
  // `used` is a new reference.
  void put_contact(std::int64_t k, PyObject* used, const double* impulse, double before, double after, int regime) {
    PyTuple_SET_ITEM(column[CONTACTS], k, used);
    PyTuple_SET_ITEM(column[IMPULSES], k, make_vec3(impulse));
    PyTuple_SET_ITEM(column[BEFORE], k, PyFloat_FromDouble(before));
    PyTuple_SET_ITEM(column[AFTER], k, PyFloat_FromDouble(after));
    PyTuple_SET_ITEM(column[REGIMES], k, Py_NewRef(PyTuple_GET_ITEM(python.regimes, regime)));
    is_separating = is_separating && regime == REGIME_SEPARATING;
  }
  void put_cluster(const double* its_energies, double its_bound, int its_adjustments, int law_used, int geometry_used,
                   int precision_used) {
    for (int i = 0; i < 4; ++i) energies[i] += its_energies[i];
    bound = std::fmax(bound, its_bound);
    adjustments |= its_adjustments;
    if (its_adjustments & ADJUSTMENT_LAW_FALLBACK && law == options.law) law = law_used;
    geometry = std::max(geometry, geometry_used);
    precision = std::max(precision, precision_used);
  }

  // A cluster of one contact is an ordinary impact.
  bool resolve_single_contact(std::int64_t k) {
    const std::int64_t pair[] = {scene.a[k], scene.b[k]};
    PyObject* contact = PyTuple_GET_ITEM(scene.given_contacts, k);
    PyObject* request[] = {PyTuple_GET_ITEM(scene.given_bodies, pair[0]), PyTuple_GET_ITEM(scene.given_bodies, pair[1]),
                           contact};
    OneImpact impact;
    if (compute_one_impact(request, plan, impact) != ANSWERED) {
      clear_exception();  // Python raises it again, and names the fields of the scene
      return false;
    }
    const ImpactResult& result = impact.result;
    if (!(result.error_bound <= plan.target_bound)) return false;
    for (int side = 0; side < 2; ++side)
      if (scene.movable[pair[side]]) put_body(pair[side], result.twist_after(side), result.twist_change(side));
    int regime = static_cast<int>(result.reported[OUT_REGIME]);
    put_contact(k, impact.contact_as_used(contact), result.change, result.reported[OUT_NORMAL_VELOCITY_BEFORE],
                result.reported[OUT_NORMAL_VELOCITY_AFTER], regime);
    put_cluster(result.reported + OUT_KINETIC_ENERGY_BEFORE, result.error_bound, impact.adjustments(), impact.law,
                impact.geometry, impact.precision);
    return true;
  }

  bool resolve_contacts(const std::int64_t* first, const std::int64_t* last) {
    const bool is_full_geometry = plan.geometry == GEOMETRY_AUTO || plan.geometry == GEOMETRY_SPATIAL;
    if (!is_full_geometry || !options.is_for_clusters()) return false;
    const ClusterParts parts = take_parts(scene, scene.pairs(), first, last, place);
    const bool frictionless = options.law == LAW_FRICTIONLESS;
    if (parts.has_copies(frictionless)) return false;
    Cluster cluster(parts, frictionless);
    if (cluster.fault) return false;
    // A path may take a second, and Python says why it has no answer.
    if (options.law == LAW_ROUTH_STRONGE && !cluster.assembly.surely_separates()) return false;
    const ClusterResult result = resolve_cluster(cluster);
    if (result.code != STATUS_OK) return false;
    const ImpulseEffect& effect = result.effect;
    for (std::size_t i = 0; i < parts.indices.size(); ++i)
      if (const int movable = cluster.movable_place[i]; movable >= 0)
        put_body(parts.indices[i], &effect.twists[6 * movable], &effect.changes[6 * movable]);
    for (auto k = first; k != last; ++k) {
      const long i = k - first;
      const auto& given = scene.contacts[*k];
      const AssembledContact& used = cluster.assembly.contacts[i];
      const double e = result.restitution < 0 ? used.e : result.restitution;
      PyObject* contact = contact_as_used(PyTuple_GET_ITEM(scene.given_contacts, *k), e,
                                          e != given[CONTACT_RESTITUTION],
                                          frictionless && given[CONTACT_FRICTION] != 0);
      put_contact(*k, contact, &effect.impulses[3 * i], used.axes[0].velocity, effect.normal_velocities[i],
                  effect.regimes[i]);
    }
    const bool in_doubles = cluster.has_friction || options.law == LAW_ROUTH_STRONGE;
    // The law is read only if this one fell back.
    put_cluster(effect.energies, effect.error_bound, adjustments_of(cluster, result),
                cluster.has_friction ? LAW_COULOMB : LAW_FRICTIONLESS, GEOMETRY_SPATIAL,
                in_doubles ? PRECISION_DOUBLE : PRECISION_EXTENDED);
    margin = std::fmin(margin, result.margin);
    return true;
  }
  // Without the GIL if it takes long. Otherwise getting the GIL back may take longer than the work.
  ClusterResult resolve_cluster(Cluster& cluster) const {
    std::optional<ReleasedGil> released;
    if (cluster.assembly.count > 8) released.emplace();
    return ::resolve_cluster(cluster, options);
  }

  // A body that is not movable, or has no contact. False if it is invalid, which a contact with a point mass tells.
  bool add_unchanged_body(std::size_t i) {
    const double none[6] = {};
    put_body(static_cast<std::int64_t>(i), &scene.bodies[i][BODY_VELOCITY_X], none);
    if (scene.has_contact[i]) return true;
    std::array<double, BODY> point_mass{};
    point_mass[BODY_MASS] = point_mass[BODY_ORIENTATION_W] = 1;
    const Cluster cluster({{scene.bodies[i], point_mass}, {{{0, 1}, {0, 0, 0, 1, 0, 0, 0, 0}, 1}}}, true);
    energies[0] += cluster.energy;
    energies[1] += cluster.energy;
    return !cluster.fault;
  }
};

// A tuple of what a list holds: no other thread can change it while the GIL is released.
struct FreeTuple {
  void operator()(PyObject* tuple) const { Py_DECREF(tuple); }
};
using Tuple = std::unique_ptr<PyObject, FreeTuple>;

constexpr int BODY_IN_LIST = 3;  // levels: the bodies, one of them, a vector of it

// Whether an object is a fraction, or a tuple or list that contains one within some levels. A list may contain itself.
bool holds_fraction(PyObject* o, int levels = BODY_IN_LIST) {
  if (PyFloat_CheckExact(o) || o == Py_None) return false;
  if (PyTuple_Check(o) || PyList_Check(o)) {
    for (Py_ssize_t i = 0; levels > 0 && i < PySequence_Fast_GET_SIZE(o); ++i)
      if (holds_fraction(PySequence_Fast_GET_ITEM(o, i), levels - 1)) return true;
    return false;
  }
  return PyObject_TypeCheck(o, python.fraction);
}

}  // namespace

PyObject* has_fraction(PyObject*, PyObject* o) { return PyBool_FromLong(holds_fraction(o)); }

// resolve_scene(bodies, pairs, contacts, model, threshold): the fields of a SceneImpact; None if the scene is left to
// Python.
PyObject* resolve_scene(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 5) return PyErr_Format(PyExc_TypeError, "resolve_scene() takes 5 arguments");
  Plan plan;
  if (!find_plan(args[3], plan)) return nullptr;
  ClusterOptions options{0,
                         PyFloat_AsDouble(args[4]),
                         plan.settings[MODEL_RESTITUTION_THRESHOLD],
                         plan.settings[MODEL_TANGENTIAL_RESTITUTION],
                         plan.settings[MODEL_TOLERANCE],
                         plan.errors[MODEL_RESTITUTION_THRESHOLD] == 0};
  if (PyErr_Occurred()) return nullptr;
  Tuple lists[3];
  for (int i = 0; i < 3; ++i) {
    const bool is_array_of_pairs = i == 1 && PySequence_Check(args[i]) && PyObject_CheckBuffer(args[i]);
    if (!PyList_Check(args[i]) && !PyTuple_Check(args[i]) && !is_array_of_pairs) Py_RETURN_NONE;
    lists[i].reset(PySequence_Tuple(args[i]));
    if (!lists[i]) {
      clear_type_error();
      return none_unless_error();
    }
  }
  SceneRequest scene{lists[0].get(), lists[1].get(), lists[2].get()};
  if (!scene.read()) return none_unless_error();
  options.law = scene.has_friction ? plan.law_with_friction : plan.law_without_friction;
  SceneAnswer answer(scene, args[3], plan, options);
  if (answer.resolve()) return answer.fields();
  return none_unless_error();
}
