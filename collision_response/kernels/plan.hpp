// The plan of an ImpactModel: what plan_model() of model.py decides for it.
#pragma once
#include <cmath>

#include "constants.hpp"
#include "python_objects.hpp"

struct Plan {
  int law_without_friction, law_with_friction, geometry, first_precision, last_precision;
  double settings[MODEL], errors[MODEL], target_bound, bound_limit;
};

// Plans of the last few models are cached. Python code, which may run whenever the functions here or read_numbers.hpp call
// it, may use other models, also in other threads: so no pointer into the cache is kept.
constexpr int GEOMETRIES = GEOMETRY_SPATIAL + 1, PRECISIONS = PRECISION_EXTENDED + 1;
struct CachedPlan {
  PyObject* model;
  Plan plan;
  PyObject* models_as_used[LAW_COUNT * GEOMETRIES * PRECISIONS];  // made when they are first needed
};
constexpr int CACHE_SIZE = 8;
inline CachedPlan cached_plans[CACHE_SIZE];
inline unsigned next_plan;

// Whether two models have the same fields: a new model in every call then costs no new plan. Nothing is converted or
// compared by Python, so numbers that are not floats must be the same objects.
inline bool is_same_model(PyObject* one, PyObject* other) {
  if (one == other) return true;
  if (!one || Py_TYPE(one) != Py_TYPE(other) || !PyTuple_Check(one) || PyTuple_GET_SIZE(one) != PyTuple_GET_SIZE(other))
    return false;
  for (Py_ssize_t i = 0; i < PyTuple_GET_SIZE(one); ++i) {
    PyObject *x = PyTuple_GET_ITEM(one, i), *y = PyTuple_GET_ITEM(other, i);
    if (x == y) continue;
    if (!PyFloat_CheckExact(x) || !PyFloat_CheckExact(y)) return false;
    const double a = PyFloat_AS_DOUBLE(x), b = PyFloat_AS_DOUBLE(y);
    if (a != b || std::signbit(a) != std::signbit(b)) return false;
  }
  return true;
}

inline CachedPlan* find_cached_plan(PyObject* model) {
  for (CachedPlan& cached : cached_plans)
    if (is_same_model(cached.model, model)) return &cached;
  return nullptr;
}

// Set the plan of a model. False if Python raised an error.
inline bool find_plan(PyObject* model, Plan& plan) {
  if (const CachedPlan* cached = find_cached_plan(model)) {
    plan = cached->plan;
    return true;
  }
  PyObject* made = PyObject_CallOneArg(python.plan_model, model);
  if (!made) return false;
  PyObject *settings, *errors;
  int may_be_kept;
  bool read = PyArg_ParseTuple(made, "iiiiiddOOp", &plan.law_without_friction, &plan.law_with_friction, &plan.geometry,
                               &plan.first_precision, &plan.last_precision, &plan.target_bound, &plan.bound_limit,
                               &settings, &errors, &may_be_kept);
  for (int k = 0; read && k < MODEL; ++k) {
    plan.settings[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(settings, k));
    plan.errors[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(errors, k));
  }
  Py_DECREF(made);
  if (!read || !may_be_kept) return read;
  CachedPlan& slot = cached_plans[next_plan++ % CACHE_SIZE];
  const CachedPlan replaced = slot;
  slot = {Py_NewRef(model), plan, {}};
  Py_XDECREF(replaced.model);
  for (PyObject* one : replaced.models_as_used) Py_XDECREF(one);
  return true;
}

// The model with the law, geometry and precision that were used: a new reference.
inline PyObject* model_as_used(PyObject* model, int law, int geometry, int precision) {
  const int index = (law * GEOMETRIES + geometry) * PRECISIONS + precision;
  CachedPlan* cached = find_cached_plan(model);
  if (cached && cached->models_as_used[index]) return Py_NewRef(cached->models_as_used[index]);
  PyObject* used = PyObject_CallFunction(python.model_as_used, "Oiii", model, law, geometry, precision);
  cached = find_cached_plan(model);
  if (used && cached && !cached->models_as_used[index]) cached->models_as_used[index] = Py_NewRef(used);
  return used;
}
