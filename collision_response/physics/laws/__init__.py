"""Impact laws, cheapest first: one file each, one signature (see ``law.py``).

To add one: write its file, enter it here twice, and in ``msg/ImpactModel.msg`` for those who call the node.
One that needs a coefficient of its own enters that in ``Settings`` and in ``ImpactModel``.
"""

from ...named import Named
from .chatterjee_ruina import chatterjee_ruina
from .compliant import compliant
from .frictionless import frictionless
from .law import Coefficients, Outcome, Regime, Settings
from .moreau import moreau
from .routh import routh_poisson, routh_stronge
from .routh_by_speed import routh_poisson_by_speed, routh_stronge_by_speed


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
    COMPLIANT = 6
    """Springs along and across the normal, friction between them; restitution of energy."""


LAWS = {
    Law.FRICTIONLESS: frictionless,
    Law.COULOMB: chatterjee_ruina,
    Law.MOREAU: moreau,
    Law.ROUTH_POISSON: routh_poisson,
    Law.ROUTH_STRONGE: routh_stronge,
    Law.COMPLIANT: compliant,
}

BY_SPEED = {Law.ROUTH_POISSON: routh_poisson_by_speed, Law.ROUTH_STRONGE: routh_stronge_by_speed}
"""The laws that follow friction along its path where it is a function of the slip speed."""

PATHS = (Law.ROUTH_POISSON, Law.ROUTH_STRONGE, Law.COMPLIANT)
"""The laws that follow a path, step by step where slip turns. They need the digits of float64."""

STEPPED = (Law.COMPLIANT,)
"""The laws that are steps throughout: no arithmetic makes them more exact, and one kernel serves all."""

__all__ = ["BY_SPEED", "LAWS", "PATHS", "STEPPED", "Coefficients", "Law", "Outcome", "Regime", "Settings"]
