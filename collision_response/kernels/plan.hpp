// The plan of an ImpactModel: what plan_model() of model.py decides for it.
#pragma once
#include "constants.hpp"
#include "python_objects.hpp"

constexpr int GEOMETRIES = 5, PRECISIONS = 5;

struct Plan {
  PyObject* model;
  int law_without_friction, law_with_friction, geometry, first_precision, last_precision;
  double settings[ROWS_OF_MODEL], errors[ROWS_OF_MODEL], target_bound, bound_limit;
  PyObject* models_as_used[LAW_COUNT * GEOMETRIES * PRECISIONS];  // made when they are first needed

  double setting(int input) const { return settings[input - IN_MODEL_TANGENTIAL_RESTITUTION]; }
};
constexpr int CACHE_SIZE = 8;
inline Plan plans[CACHE_SIZE];
inline int next_plan;

// The plan of a model. Those of the last few models are cached; models are told apart by identity.
inline Plan* find_plan(PyObject* model) {
  for (Plan& plan : plans)
    if (plan.model == model) return &plan;
  PyObject* made = PyObject_CallOneArg(python.plan_model, model);
  if (!made) return nullptr;
  Plan plan{};
  PyObject *settings, *errors;
  bool read = PyArg_ParseTuple(made, "iiiiiddOO", &plan.law_without_friction, &plan.law_with_friction, &plan.geometry,
                               &plan.first_precision, &plan.last_precision, &plan.target_bound, &plan.bound_limit, &settings, &errors);
  for (int k = 0; read && k < ROWS_OF_MODEL; ++k) {
    plan.settings[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(settings, k));
    plan.errors[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(errors, k));
  }
  Py_DECREF(made);
  if (!read) return nullptr;
  Plan& slot = plans[next_plan++ % CACHE_SIZE];
  Py_XDECREF(slot.model);
  for (PyObject* model_as_used : slot.models_as_used) Py_XDECREF(model_as_used);
  Py_INCREF(model);
  plan.model = model;
  slot = plan;
  return &slot;
}

// The model with the law, geometry and precision that were used. A borrowed reference.
inline PyObject* model_as_used(Plan* plan, int law, int geometry, int precision) {
  PyObject*& model = plan->models_as_used[(law * GEOMETRIES + geometry) * PRECISIONS + precision];
  if (!model) model = PyObject_CallFunction(python.model_as_used, "Oiii", plan->model, law, geometry, precision);
  return model;
}
