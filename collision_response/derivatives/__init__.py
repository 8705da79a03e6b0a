"""Derivatives of an impact, for estimators and planners.

    differentiate           Jacobian of the twists after an impact and of the impulse         differentiate.py
    saltation_matrix        maps changes of the state before an impact to changes after it    saltation.py
    propagate_covariance    covariance of the state after an impact                           covariance.py
    sphere_on_plane, ...    how the contact point and the normal move with the bodies         surfaces.py

``docs/derivatives.md`` says what is held fixed, and explains kinks and jumps.
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
