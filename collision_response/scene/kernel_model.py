"""An :class:`~collision_response.ImpactModel` in the form that the compiled ``resolve_scene`` takes."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..model import Geometry, ImpactModel, Precision, plan_model
from ..physics.laws import Law
from .reflections import REFLECTIONS

THRESHOLD = 2.0**-30
"""Approaches slower than this fraction of the fastest one are ignored, so that rounding never decides one."""

COMPILED_LAWS = (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU)
"""The laws by which the kernels resolve whole scenes."""

PRECISIONS = (Precision.DOUBLE, Precision.EXTENDED)


class KernelModel(NamedTuple):
    """A model as the kernels take it.

    Attributes:
        laws: for scenes without friction, and with.
        numbers: the approach threshold, the restitution threshold, the error bound above which the tolerance
            is not met, and the greatest number of reflections.
        models: the models to report, by the number of the law and by precision. Empty if this model is always
            left to Python.
    """

    laws: tuple[Law, Law]
    numbers: tuple[float, float, float, int]
    models: tuple[tuple[ImpactModel, ...], ...]


_last: tuple[Any, Any] = (None, None)
"""The last model and its KernelModel: many scenes are resolved with the same one."""


def kernel_model(model: ImpactModel) -> KernelModel:
    """Return the form of ``model`` that the kernels take.

    Raises:
        ImpactError, TypeError: if the model is invalid.
    """
    global _last
    last, result = _last
    if model is not last:
        result = _kernel_model(model)
        _last = model, result
    return result


def _kernel_model(model: ImpactModel) -> KernelModel:
    plan = plan_model(model)
    laws = plan.law_without_friction, plan.law_with_friction
    is_compiled = (
        model.geometry in (Geometry.AUTO, Geometry.SPATIAL)
        and not model.tangential_restitution
        and laws[1] in COMPILED_LAWS
    )
    models: tuple[tuple[ImpactModel, ...], ...] = ()
    if is_compiled:
        models = tuple(
            tuple(ImpactModel(law, Geometry.SPATIAL, precision, *model[3:]) for precision in PRECISIONS)
            for law in (Law.AUTO, *COMPILED_LAWS)
        )
    numbers = THRESHOLD, plan.settings.restitution_threshold, plan.bound_limit, REFLECTIONS
    return KernelModel(laws, numbers, models)
