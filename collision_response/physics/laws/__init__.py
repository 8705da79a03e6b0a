"""Impact laws, cheapest first: one file each, one signature (see ``law.py``)."""

from .chatterjee_ruina import chatterjee_ruina
from .frictionless import frictionless
from .law import Outcome, Parameters, Regime
from .moreau import moreau
from .routh import routh_poisson, routh_stronge

__all__ = [
    "Outcome",
    "Parameters",
    "Regime",
    "chatterjee_ruina",
    "frictionless",
    "moreau",
    "routh_poisson",
    "routh_stronge",
]
