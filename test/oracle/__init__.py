"""Impact laws at a contact of two rigid bodies in arbitrary precision, to check solvers against."""

import pytest

pytest.importorskip("mpmath")

from .laws import LAWS, impulse

__all__ = ["LAWS", "impulse"]
