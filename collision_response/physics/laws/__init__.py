"""Impact laws: functions of the signature given in ``law.py``.

The files::

    frictionless.py        FRICTIONLESS: Newton's restitution
    coulomb.py             COULOMB: friction in closed form
    moreau.py              MOREAU: friction in one step; sliding.py solves its equation
    routh.py               ROUTH_POISSON, ROUTH_STRONGE: friction along the path of the impulse
        routh_path.py      - integrates the path while slip turns, with the coefficients of dormand_prince.py
        routh_straight.py  - the part of the path after slip has turned
        routh_error.py     - a bound on the error of the path
    routh_by_speed.py      the same laws where friction is a function of the slip speed
    compliant.py           COMPLIANT: springs along and across the normal; compliant_path.py integrates it

Those that need a contact in its own axes take them from ``contact_frame.py``, and those that look for the
extremes of a step take them from ``hermite.py``.
``CONTRIBUTING.md`` says how to add a law.
"""

from .compliant import compliant
from .coulomb import coulomb
from .frictionless import frictionless
from .law import Coefficients, Law, Outcome, Regime, Settings
from .moreau import moreau
from .routh import routh
from .routh_by_speed import routh_by_speed

LAWS = {
    Law.FRICTIONLESS: frictionless,
    Law.COULOMB: coulomb,
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

CLUSTER_LAWS = (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE)
"""The laws that resolve clusters of several contacts, too: see ``kernels/scene/laws.hpp``."""

__all__ = [
    "BY_SPEED",
    "CLUSTER_LAWS",
    "LAWS",
    "PATHS",
    "STEPPED",
    "Coefficients",
    "Law",
    "Outcome",
    "Regime",
    "Settings",
]
