"""A rod of 1 kg and 1 m that strikes a fixed plane with its end, at a friction of 0.3: published answers."""

from __future__ import annotations

import math
from fractions import Fraction as F

TABLE = {
    "T1": (
        (1, (0, -1), F(1, 2)),
        dict.fromkeys(
            ("moreau", "chatterjee_ruina", "routh_poisson", "routh_stronge"), ("9/41", "30/41", "-.243159")
        ),
    ),
    "T2": (
        (1, (1, -1), F(1, 2)),
        {
            "moreau": ("-.0625", ".5625", "-.171875"),
            "chatterjee_ruina": ("-.15254237", ".50847458", "-.19240161"),
            "routh_poisson": ("-.11412429", ".50847458", "-.19609148"),
            "routh_stronge": ("-.11288499", ".51260558", "-.19430798"),
        },
    ),
    "T3": (
        (4, (F(1, 2), -1), F(9, 10)),
        {
            "moreau": (".37", "1.465", ".01925"),
            "chatterjee_ruina": (".1", "1.2625", "-.071875"),
            "routh_poisson": (".25", "1.28378378", "-.11918828"),
            "routh_stronge": (".25579294", "1.30309359", "-.10551032"),
        },
    ),
    "T3 e=1": (
        (4, (F(1, 2), -1), 1),
        {
            "moreau": (".4", "1.55", ".1"),
            "chatterjee_ruina": (".1", "1.325", "-.0125"),
            "routh_poisson": (".27027027", "1.35135135", "-.06939372"),
            "routh_stronge": (".27670687", "1.3728067", "-.05244936"),
        },
    ),
}
"""By name: the square of the tangent of the angle, the velocity (tangential, normal) and restitution; by law
the impulse (tangential, normal) and the change of energy, with every digit given. ``moreau`` has no fallback.
"""

NAMES = {
    "COULOMB": "chatterjee_ruina",
    "MOREAU": "moreau",
    "ROUTH_POISSON": "routh_poisson",
    "ROUTH_STRONGE": "routh_stronge",
}


def request(case: str) -> tuple[float, tuple[float, float], float]:
    """The angle, the velocity and the restitution."""
    (tan2, velocity, e), _ = TABLE[case]
    return math.atan(math.sqrt(tan2)), (float(velocity[0]), float(velocity[1])), float(e)


def answer(case: str, law: str) -> tuple[float, ...]:
    """The impulse and the change of energy, by the name of a law of this package."""
    return tuple(float(F(text)) for text in TABLE[case][1][NAMES[law]])
