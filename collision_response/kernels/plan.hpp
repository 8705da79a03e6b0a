// The plan of an ImpactModel: what plan_model() of model.py decides for it.
#pragma once
#include "constants.hpp"
#include "python_objects.hpp"

struct Plan {
  int law_without_friction, law_with_friction, geometry, first_precision, last_precision;
  double settings[MODEL], errors[MODEL], target_bound, bound_limit;
};

// Plans of the last few models are cached. Models are told apart by identity. Python code, which may run whenever the
// functions here or read_numbers.hpp call it, may use other models, also in other threads: so no pointer into the cache
// is kept.
constexpr int GEOMETRIES = GEOMETRY_SPATIAL + 1, PRECISIONS = PRECISION_EXTENDED + 1;
struct CachedPlan {
  PyObject* model;
  Plan plan;
  PyObject* models_as_used[LAW_COUNT * GEOMETRIES * PRECISIONS];  // made when they are first needed
};
constexpr int CACHE_SIZE = 8;
inline CachedPlan cached_plans[CACHE_SIZE];
inline int next_plan;

inline CachedPlan* find_cached_plan(PyObject* model) {
  for (CachedPlan& cached : cached_plans)
    if (cached.model == model) return &cached;
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
  bool read = PyArg_ParseTuple(made, "iiiiiddOO", &plan.law_without_friction, &plan.law_with_friction, &plan.geometry,
                               &plan.first_precision, &plan.last_precision, &plan.target_bound, &plan.bound_limit,
                               &settings, &errors);
  for (int k = 0; read && k < MODEL; ++k) {
    plan.settings[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(settings, k));
    plan.errors[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(errors, k));
  }
  Py_DECREF(made);
  if (!read) return false;
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
