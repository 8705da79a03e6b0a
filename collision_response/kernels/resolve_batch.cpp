// Batches: arrays of independent contacts. Pick and call a kernel.
#include "arrays.hpp"
#include "contact_pairs.hpp"
#include "kernel_table.hpp"
#include "module.hpp"
#include "resolve.hpp"

namespace {

const double zero_double = 0, one_double = 1;
const float zero_float = 0, one_float = 1;

constexpr int CACHE_LINE = 64;  // bytes

// The fields of BatchResult.
enum {
  VELOCITY,
  ANGULAR_VELOCITY,
  IMPULSE,
  STATUS,
  ERROR_BOUND,
  PRECISION,
  REGIME,
  ENERGY,
  ADJUSTMENTS = ENERGY + ENERGIES,
  FIELDS
};

// The batch from a column on. Its bodies have been gathered, so their rows stay.
Batch from_column(const Batch& batch, int body_rows, long at, int size) {
  Batch moved = batch;
  for (int i = body_rows; i < INPUTS; ++i)
    if (!moved.is_shared[i]) moved.row[i] = static_cast<const char*>(moved.row[i]) + at * size;
  for (void*& result : moved.result)
    if (result) result = static_cast<char*>(result) + at * size;
  moved.status += at;
  if (moved.regime) moved.regime += at, moved.adjustments += at;
  return moved;
}

// Compute the columns from `from` to `to` of a batch of contacts between the bodies of one table. The batch reads its
// bodies from the buffer `gathered`.
template <class T>
void compute_gathered(BatchKernel kernel, const Batch& batch, int body_rows, const ContactPairs& pairs, const T* table,
                      int rows, T* gathered, long from, long to) {
  // The first block is shorter, so that the results of the others begin where a cache line does.
  const auto first = reinterpret_cast<std::uintptr_t>(static_cast<T*>(batch.result[Batch::VELOCITY]) + from);
  long count = GATHER_BLOCK - static_cast<long>(first % CACHE_LINE / sizeof(T));
  for (long at = from; at < to; at += count, count = GATHER_BLOCK) {
    count = std::min(count, to - at);
    bool any_fault = pairs.gather(table, rows, at, count, gathered);
    kernel(from_column(batch, body_rows, at, sizeof(T)), 0, count);
    for (long k = at; any_fault && k < at + count; ++k)
      if (int fault = pairs.fault(k)) batch.status[k] = static_cast<unsigned char>(fault);
  }
}

// Not inlined: the compiler vectorises this loop only in a function of its own.
__attribute__((noinline)) int greatest(const unsigned char* code, const unsigned char* end) {
  unsigned char largest = 0;
  for (; code < end; ++code) largest = *code > largest ? *code : largest;
  return largest;
}

// The arrays of a batch: tables and results.
struct BatchArrays {
  Array bodies, pairs, contacts, settings, result[FIELDS];
  long count = -1;  // of contacts

  // If `pairs` is None, the bodies of a contact are in its own column.
  bool open(PyObject* const* inputs, PyObject* results) {
    if (!bodies.open(inputs[0]) || (inputs[1] != Py_None && !pairs.open(inputs[1])) || !contacts.open(inputs[2]) ||
        !settings.open(inputs[3]))
      return false;
    for (int i = 0; i < FIELDS; ++i) {
      PyObject* o = PyTuple_GET_ITEM(results, i);
      if (o != Py_None && !result[i].open(o, true)) return false;
    }
    if (contacts.view.ndim == 2) count = contacts.view.shape[1];
    return true;
  }
  bool is_double() const { return *settings.view.format == 'd'; }

  // Whether settings, results and pairs have the right shapes and types. Those of bodies and contacts have been checked.
  bool are_valid(const TableLayout& table, bool bounded) const {
    const char real = *settings.view.format;
    const Py_ssize_t n = count, axes = table.axes, spins = 3 - table.first_spin;
    bool report = result[REGIME].is_open();
    bool valid = settings.has(real, {MODEL}) && result[VELOCITY].has(real, {axes, 2, n}) &&
                 result[ANGULAR_VELOCITY].has(real, {spins, 2, n}) && result[IMPULSE].has(real, {axes, n}) &&
                 result[STATUS].has('B', {n}) && result[ERROR_BOUND].is_open() == bounded &&
                 result[PRECISION].is_open() == bounded &&
                 (!bounded || (result[ERROR_BOUND].has(real, {n}) && result[PRECISION].has('B', {n}))) &&
                 (!report || result[REGIME].has('B', {n}));
    for (int i = ENERGY; i < FIELDS; ++i)
      valid = valid && result[i].is_open() == report && (!report || result[i].has(i == ADJUSTMENTS ? 'B' : real, {n}));
    if (pairs.is_open())
      valid = valid && pairs.has_int64() && pairs.view.ndim == 2 && pairs.view.shape[0] == 2 &&
              pairs.view.shape[1] == n && bodies.view.ndim == 2;
    return valid;
  }

  // Whether a result overlaps another one, or a table.
  bool overlap() const {
    for (const Array& one : result) {
      for (const Array* other = result; other != &one; ++other)
        if (one.overlaps(*other)) return true;
      for (const Array* table : {&bodies, &pairs, &contacts})
        if (one.overlaps(*table)) return true;
    }
    return false;
  }

  // The rows for a kernel of the layout of the table, or of the general layout. Bodies of pairs are read from
  // `gathered`.
  Batch make_batch(const TableLayout& table, bool general, double* gathered) const {
    const int size = is_double() ? sizeof(double) : sizeof(float);
    const void* zero = is_double() ? static_cast<const void*>(&zero_double) : &zero_float;
    const void* one = is_double() ? static_cast<const void*>(&one_double) : &one_float;
    const Py_ssize_t contact_rows = contacts.view.shape[0];
    Batch batch{};
    int row = 0;
    auto put = [&](const void* at, bool is_shared) {
      batch.row[row] = at;
      batch.is_shared[row++] = is_shared;
    };
    auto absent = [&](int index) { put(index == ALL_ONE ? one : zero, true); };
    for (int side = 0; side < 2; ++side)
      for (int i = 0; i < (general ? BODY : table.body_rows); ++i) {
        int index = general ? table.body[i] : i;
        if (index < 0) absent(index);
        else
          put(pairs.is_open() ? reinterpret_cast<char*>(gathered) + (2 * index + side) * GATHER_BLOCK * size
                              : bodies.row(2 * index + side),
              false);
      }
    for (int i = 0; i < (general ? CONTACT : table.contact_rows); ++i) {
      int index = general ? table.contact[i] : i;
      if (index >= 0 && index < contact_rows) put(contacts.row(index), false);
      else absent(index);
    }
    for (int i = 0; i < MODEL; ++i) {
      // Tangential restitution, if each contact has its own.
      bool has_own_row = i == MODEL_TANGENTIAL_RESTITUTION && contact_rows > table.contact_rows;
      put(has_own_row ? contacts.row(table.contact_rows) : settings.at(i * size), !has_own_row);
    }
    for (int k = 0; k < 3; ++k) {
      for (int side = 0; side < 2; ++side) {
        const int i = 2 * k + side;
        if (k < table.axes) batch.result[Batch::VELOCITY + i] = result[VELOCITY].row(i);
        if (k >= table.first_spin)
          batch.result[Batch::ANGULAR_VELOCITY + i] = result[ANGULAR_VELOCITY].row(i - 2 * table.first_spin);
      }
      if (k < table.axes) batch.result[Batch::IMPULSE + k] = result[IMPULSE].row(k);
    }
    batch.result[Batch::ERROR_BOUND] = result[ERROR_BOUND].view.buf;
    batch.status = result[STATUS].at<unsigned char>();
    batch.regime = result[REGIME].at<unsigned char>();
    batch.adjustments = result[ADJUSTMENTS].at<unsigned char>();
    for (int i = 0; i < ENERGIES; ++i) batch.result[Batch::ENERGY + i] = result[ENERGY + i].view.buf;
    return batch;
  }
};

// Compute a column of a batch of doubles as resolve() computes one impact: with more digits where it takes them, and in
// suitable units. The status is 0 if there is no answer; or if its error bound, which has no place, is too large.
void compute_alone(const Batch& batch, const Plan& plan, long at, unsigned char* precision) {
  OneImpact impact;
  const double no_error[INPUTS] = {};
  for (int i = 0; i < INPUTS; ++i)
    impact.input[i] = static_cast<const double*>(batch.row[i])[batch.is_shared[i] ? 0 : at];
  batch.status[at] = STATUS_UNSET;
  if (compute_numbers(plan, no_error, impact) != ANSWERED) return;
  const ImpactResult& result = impact.result;
  if (!batch.result[Batch::ERROR_BOUND] && !(result.error_bound <= plan.target_bound)) return;
  auto put = [&](int place, double x) {
    if (batch.result[place]) static_cast<double*>(batch.result[place])[at] = x;
  };
  for (int k = 0; k < 3; ++k) {
    for (int side = 0; side < 2; ++side) {
      put(Batch::VELOCITY + 2 * k + side, result.twist_after(side)[k]);
      put(Batch::ANGULAR_VELOCITY + 2 * k + side, result.twist_after(side)[3 + k]);
    }
    put(Batch::IMPULSE + k, result.change[k]);
  }
  put(Batch::ERROR_BOUND, result.error_bound);
  for (int k = 0; k < ENERGIES; ++k) put(Batch::ENERGY + k, result.reported[OUT_KINETIC_ENERGY_BEFORE + k]);
  batch.status[at] = result.flags[FLAG_SEPARATING] ? STATUS_SEPARATING : STATUS_OK;
  if (precision) precision[at] = static_cast<unsigned char>(impact.precision);
  if (batch.regime) {
    batch.regime[at] = static_cast<unsigned char>(result.reported[OUT_REGIME]);
    batch.adjustments[at] = static_cast<unsigned char>(impact.adjustments() & ~ADJUSTMENT_NORMALISED_ORIENTATION);
  }
}

}  // namespace

// batch(law, layout, number_type, bodies, pairs, contacts, settings, results, from, to): compute the columns from
// `from` to `to`. settings holds the numbers of Settings, in the type of the tables; results is a BatchResult. Returns
// the greatest status and the greatest error bound (infinite if one is NaN); or None if an array is not contiguous, or
// not of the right type and shape, or if results overlap each other or the tables, for which resolve_batch.py then
// raises. Releases the GIL.
PyObject* batch(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 10 || !PyTuple_Check(args[7]) || PyTuple_GET_SIZE(args[7]) != FIELDS)
    return PyErr_Format(PyExc_TypeError, "batch() takes 10 arguments");
  int law = static_cast<int>(PyLong_AsLong(args[0])), number_type = static_cast<int>(PyLong_AsLong(args[2]));
  int layout = static_cast<int>(PyLong_AsLong(args[1]));
  long from = PyLong_AsLong(args[8]), to = PyLong_AsLong(args[9]);
  if (PyErr_Occurred()) return nullptr;
  const TableLayout& table = table_layouts[layout];
  BatchArrays arrays;
  if (!arrays.open(args + 3, args[7]) ||
      !arrays.are_valid(table, number_type == NUMBER_BOUNDED || number_type == NUMBER_EXTENDED) || arrays.overlap())
    Py_RETURN_NONE;
  const auto found = find_batch_kernel(law, layout, number_type);
  if (!found) return PyErr_Format(PyExc_LookupError, "no kernel of law %d for numbers of kind %d", law, number_type);

  const BatchKernel kernel = found->kernel;
  const bool general = found->layout == LAYOUT_EVERYTHING;
  alignas(CACHE_LINE) double gathered[2 * BODY * GATHER_BLOCK];  // the bodies of some contacts
  const Batch batch = arrays.make_batch(table, general, gathered);
  int body_rows = 2 * (general ? BODY : table.body_rows), greatest_status = 0;
  double greatest_bound = 0;
  {
    ReleasedGil released;
    if (arrays.pairs.is_open()) {
      const auto* a = arrays.pairs.at<std::int64_t>();
      const ContactPairs body_pairs{a, a + arrays.count, arrays.bodies.view.shape[1]};
      auto compute = [&](const auto* bodies, auto* gathered) {
        compute_gathered(kernel, batch, body_rows, body_pairs, bodies, table.body_rows, gathered, from, to);
      };
      if (arrays.is_double()) compute(arrays.bodies.at<double>(), gathered);
      else compute(arrays.bodies.at<float>(), reinterpret_cast<float*>(gathered));
    } else if (to > from) {
      kernel(batch, from, to);
    }
    greatest_status = greatest(batch.status + from, batch.status + to);
    const auto* bounds = static_cast<const double*>(batch.result[Batch::ERROR_BOUND]);
    for (long at = from; bounds && at < to; ++at) {
      double bound = bounds[at];
      greatest_bound = bound <= greatest_bound ? greatest_bound : bound - bound == 0 ? bound : INFINITY;
    }
  }
  return Py_BuildValue("id", greatest_status, greatest_bound);
}

// resolve_columns(model, layout, bodies, contacts, settings, results): compute each column as resolve() does, as far as
// the kernels know it; see compute_alone(). The bodies of a contact are in its own column, and all numbers are doubles.
// Releases the GIL.
PyObject* resolve_columns(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 6 || !PyTuple_Check(args[5]) || PyTuple_GET_SIZE(args[5]) != FIELDS)
    return PyErr_Format(PyExc_TypeError, "resolve_columns() takes 6 arguments");
  Plan plan;
  if (!find_plan(args[0], plan)) return nullptr;
  const TableLayout& table = table_layouts[PyLong_AsLong(args[1])];
  PyObject* inputs[] = {args[2], Py_None, args[3], args[4]};
  BatchArrays arrays;
  if (!arrays.open(inputs, args[5]) || !arrays.are_valid(table, arrays.result[ERROR_BOUND].is_open()) ||
      !arrays.is_double())
    return PyErr_Format(PyExc_TypeError, "resolve_columns() takes contiguous arrays of doubles");
  const Batch batch = arrays.make_batch(table, true, nullptr);
  auto* const precision = arrays.result[PRECISION].at<unsigned char>();
  {
    ReleasedGil released;
    for (long at = 0; at < arrays.count; ++at) compute_alone(batch, plan, at, precision);
  }
  Py_RETURN_NONE;
}

// find_independent_sets(pairs, movable, order, starts): see contact_pairs.hpp. The caller has checked the shapes of the
// arrays.
PyObject* find_independent_sets(PyObject*, PyObject* const* args, Py_ssize_t count) {
  Array pairs, movable, order, starts;
  if (count != 4 || !open_arrays(args, {&pairs, &movable}) || !open_arrays(args + 2, {&order, &starts}, true))
    return PyErr_Format(PyExc_TypeError, "find_independent_sets() takes four arrays");
  long n = static_cast<long>(order.view.shape[0]), sets;
  ContactPairs body_pairs{pairs.at<std::int64_t>(), pairs.at<std::int64_t>() + n, movable.view.shape[0]};
  {
    ReleasedGil released;
    sets = divide_into_independent_sets(body_pairs, n, movable.at<bool>(), order.at<std::int64_t>(),
                                        starts.at<std::int64_t>());
  }
  return PyLong_FromLong(sets);
}
