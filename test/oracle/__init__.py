"""Impact laws in arbitrary precision, as a reference for tests. They share no code with the package."""

import pytest

pytest.importorskip("mpmath")

from .laws import LAWS, impulse

__all__ = ["LAWS", "impulse"]
