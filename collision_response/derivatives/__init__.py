"""Derivatives of an impact, and what they are for: estimators and planners.

    differentiate           the Jacobian of the twists after, and of the impulse      differentiate.py
    saltation_matrix        of a state, from before an impact to after it             saltation.py
    propagate_covariance    of such a state, with uncertain coefficients and normal   covariance.py

What is held fixed, and what kinks and jumps are: ``docs/derivatives.md``.
"""

from .covariance import CovarianceAfter, propagate_covariance
from .differentiate import (
    PARAMETERS,
    RESULTS,
    BatchDerivatives,
    Derivatives,
    Smoothness,
    differentiate,
    differentiate_batch,
    unit_directions,
)
from .saltation import saltation_matrix
from .surfaces import SurfaceMotion, corner_on_plane, point_on_plane, sphere_on_plane, sphere_on_sphere

__all__ = [
    "PARAMETERS",
    "RESULTS",
    "BatchDerivatives",
    "CovarianceAfter",
    "Derivatives",
    "Smoothness",
    "SurfaceMotion",
    "corner_on_plane",
    "differentiate",
    "differentiate_batch",
    "point_on_plane",
    "propagate_covariance",
    "saltation_matrix",
    "sphere_on_plane",
    "sphere_on_sphere",
    "unit_directions",
]
