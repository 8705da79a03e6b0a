"""Impact laws of two rigid bodies in arbitrary precision, to check solvers against."""
from .laws import LAWS, Body, Outcome, Report, impact, impulse, mobility, relative_velocity

__all__ = ["LAWS", "Body", "Outcome", "Report", "impact", "impulse", "mobility", "relative_velocity"]
