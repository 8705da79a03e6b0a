"""Impact laws, cheapest first: one file each, one signature (see ``law.py``)."""

from .chatterjee_ruina import chatterjee_ruina
from .frictionless import frictionless
from .law import Material, Outcome, Regime

__all__ = ["Material", "Outcome", "Regime", "chatterjee_ruina", "frictionless"]
