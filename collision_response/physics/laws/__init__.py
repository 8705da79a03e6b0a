"""Impact laws, one per file, all with the signature given in ``law.py``.

``CONTRIBUTING.md`` says how to add a law.
"""

from .chatterjee_ruina import chatterjee_ruina
from .compliant import compliant
from .frictionless import frictionless
from .law import Coefficients, Law, Outcome, Regime, Settings
from .moreau import moreau
from .routh import routh
from .routh_by_speed import routh_by_speed

LAWS = {  # cheapest first
    Law.FRICTIONLESS: frictionless,
    Law.COULOMB: chatterjee_ruina,
    Law.MOREAU: moreau,
    Law.ROUTH_POISSON: routh,
    Law.ROUTH_STRONGE: routh,
    Law.COMPLIANT: compliant,
}

BY_SPEED = {Law.ROUTH_POISSON: routh_by_speed, Law.ROUTH_STRONGE: routh_by_speed}
"""The laws that can evaluate friction along the path of the impact, as a function of the slip speed."""

PATHS = (Law.ROUTH_POISSON, Law.ROUTH_STRONGE, Law.COMPLIANT)
"""The laws that follow the impact step by step if slip turns. They need the digits of float64."""

STEPPED = (Law.COMPLIANT,)
"""The laws that always integrate in steps. More digits do not improve them, so one kernel serves all."""

__all__ = ["BY_SPEED", "LAWS", "PATHS", "STEPPED", "Coefficients", "Law", "Outcome", "Regime", "Settings"]
