"""Impact laws, cheapest first: one file each, one signature (see ``law.py``).

To add one: write its file, enter it in ``Law`` and in ``LAWS``, and in ``msg/ImpactModel.msg`` for those who
call the node. One that needs a coefficient of its own enters that in ``Settings`` and in
``ImpactModel``.
"""

from .chatterjee_ruina import chatterjee_ruina
from .compliant import compliant
from .frictionless import frictionless
from .law import Coefficients, Law, Outcome, Regime, Settings
from .moreau import moreau
from .routh import routh
from .routh_by_speed import routh_by_speed

LAWS = {
    Law.FRICTIONLESS: frictionless,
    Law.COULOMB: chatterjee_ruina,
    Law.MOREAU: moreau,
    Law.ROUTH_POISSON: routh,
    Law.ROUTH_STRONGE: routh,
    Law.COMPLIANT: compliant,
}

BY_SPEED = {Law.ROUTH_POISSON: routh_by_speed, Law.ROUTH_STRONGE: routh_by_speed}
"""The laws that follow friction along its path where it is a function of the slip speed."""

PATHS = (Law.ROUTH_POISSON, Law.ROUTH_STRONGE, Law.COMPLIANT)
"""The laws that follow a path, step by step where slip turns. They need the digits of float64."""

STEPPED = (Law.COMPLIANT,)
"""The laws that are steps throughout: no arithmetic makes them more exact, and one kernel serves all."""

__all__ = ["BY_SPEED", "LAWS", "PATHS", "STEPPED", "Coefficients", "Law", "Outcome", "Regime", "Settings"]
