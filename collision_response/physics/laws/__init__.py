"""Impact laws, cheapest first: one file each, one signature (see ``law.py``).

To add one: write its file, enter it here twice, and in ``msg/ImpactModel.msg`` for those who call the node.
"""

from ...named import Named
from .chatterjee_ruina import chatterjee_ruina
from .frictionless import frictionless
from .law import Coefficients, Outcome, Regime
from .moreau import moreau
from .routh import routh_poisson, routh_stronge


class Law(Named):
    """The impact laws; see ``docs/impact-laws.md`` for which to choose."""

    AUTO = 0
    """COULOMB where there is friction, else FRICTIONLESS."""
    FRICTIONLESS = 1
    """Newton's restitution along the normal; no tangential impulse."""
    COULOMB = 2
    """Chatterjee & Ruina's algebraic law with friction; never creates energy."""
    MOREAU = 3
    """Coulomb's friction in one step, as iterative engines converge to; COULOMB where that is unsound."""
    ROUTH_POISSON = 4
    """Friction along the path of the impulse; restitution of impulse."""
    ROUTH_STRONGE = 5
    """Friction along the path of the impulse; restitution of energy."""


LAWS = {
    Law.FRICTIONLESS: frictionless,
    Law.COULOMB: chatterjee_ruina,
    Law.MOREAU: moreau,
    Law.ROUTH_POISSON: routh_poisson,
    Law.ROUTH_STRONGE: routh_stronge,
}

PATHS = (Law.ROUTH_POISSON, Law.ROUTH_STRONGE)
"""The laws that follow a path, step by step where slip turns. They need the digits of float64."""

__all__ = ["LAWS", "PATHS", "Coefficients", "Law", "Outcome", "Regime"]
