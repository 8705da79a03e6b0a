"""How stiff a contact is across its normal, beside along it: for laws with compliance.

Of two elastic bodies with shear moduli ``G`` and Poisson's ratios ``nu`` that touch in a circle and do not
slip (Mindlin; ``k_n`` is that of the flattening, ``k_t`` that of the shift),

                (1 - nu_1) / G_1 + (1 - nu_2) / G_2
    k_t/k_n = -----------------------------------------
              (1 - nu_1/2) / G_1 + (1 - nu_2/2) / G_2

Source: Mindlin, "Compliance of Elastic Bodies in Contact", J. Appl. Mech. 16 (1949); Johnson, *Contact
Mechanics*, 1985, section 7.2.
"""

from __future__ import annotations

from typing import NamedTuple

from ..numbers.operations import Scalar


class Elastic(NamedTuple):
    """An elastic material: Poisson's ratio, in (-1, 1/2], and shear modulus [Pa], > 0."""

    poisson_ratio: Scalar
    shear_modulus: Scalar = 1.0


def stiffness_ratio(a: Elastic, b: Elastic) -> Scalar:
    """Tangential over normal stiffness of a contact of two materials; a rigid one has an infinite modulus.

    Between 2/3 (like materials that keep their volume) and 4/3.

    Raises:
        ValueError: a ratio or a modulus is none, or both are rigid.
    """
    for nu, G in (a, b):
        if not (-1 < nu <= 0.5 and G > 0):
            raise ValueError(f"Poisson's ratio must be in (-1, 1/2], the modulus above 0; are {nu} and {G}")
    along = (1 - a.poisson_ratio) / a.shear_modulus + (1 - b.poisson_ratio) / b.shear_modulus
    across = (1 - a.poisson_ratio / 2) / a.shear_modulus + (1 - b.poisson_ratio / 2) / b.shear_modulus
    if not across > 0:
        raise ValueError("both materials are rigid: their stiffness has no ratio")
    return along / across


METAL_ON_METAL = 14 / 17
"""Of like materials with Poisson's ratio 0.3."""
