"""Impact laws of two rigid bodies in arbitrary precision, to check solvers against."""

import pytest

pytest.importorskip("mpmath")

from .bodies import Body, mobility, relative_velocity
from .laws import LAWS, Outcome, Report, impact, impulse

__all__ = ["LAWS", "Body", "Outcome", "Report", "impact", "impulse", "mobility", "relative_velocity"]
