"""The ratio of tangential to normal stiffness of a contact, for the law COMPLIANT.

Two elastic bodies with shear moduli ``G`` and Poisson's ratios ``nu`` touch in a circle and do not slip. Let
``k_n`` be the stiffness against pressing them together and ``k_t`` that against shifting them tangentially.
By Mindlin,

                (1 - nu_1) / G_1 + (1 - nu_2) / G_2
    k_t/k_n = -----------------------------------------
              (1 - nu_1/2) / G_1 + (1 - nu_2/2) / G_2

Source: Mindlin, "Compliance of Elastic Bodies in Contact", J. Appl. Mech. 16 (1949); Johnson, *Contact
Mechanics*, 1985, section 7.2.
"""

from __future__ import annotations

import math
from fractions import Fraction
from operator import attrgetter
from typing import NamedTuple

from ..arguments import is_finite, real_number
from ..numbers.operations import Scalar
from ..status import ImpactError, StatusCode, format_value


class Elastic(NamedTuple):
    """An elastic material: Poisson's ratio, in (-1, 1/2], and shear modulus [Pa], > 0."""

    poisson_ratio: Scalar
    shear_modulus: Scalar = 1.0


def stiffness_ratio(a: Elastic, b: Elastic) -> Scalar:
    """Ratio ``k_t / k_n`` of tangential to normal stiffness for a contact between two materials.

    It is between 2/3 (both incompressible, ``nu = 1/2``) and 4/3 (both with ``nu`` near -1).

    Args:
        a, b: the materials; one of them may be rigid, with an infinite shear modulus.

    Raises:
        ImpactError: INVALID_COEFFICIENT, if a Poisson's ratio is not in (-1, 1/2] or a modulus is not
            positive or beyond float64, or if both materials are rigid.
        TypeError: if a material is not an :class:`Elastic`, or a number of it is not a real number.
    """
    softer, stiffer = sorted((_checked("a", a), _checked("b", b)), key=attrgetter("shear_modulus"))
    if softer.shear_modulus == math.inf:
        reason = "or that of a must be finite: two rigid materials have no ratio of stiffnesses"
        raise ImpactError(StatusCode.INVALID_COEFFICIENT, "b.shear_modulus", reason)
    share = softer.shear_modulus / stiffer.shear_modulus  # 1/G may be beyond float64
    normal = (1 - softer.poisson_ratio) + (1 - stiffer.poisson_ratio) * share
    tangential = (1 - softer.poisson_ratio / 2) + (1 - stiffer.poisson_ratio / 2) * share
    return normal / tangential  # compliances, so the ratio of stiffnesses is this way up


def _checked(name: str, material: Elastic) -> Elastic:
    if not isinstance(material, Elastic):
        raise TypeError(f"{name}: must be an Elastic, is {format_value(material)}")
    numbers = material._asdict().items()
    nu, modulus = (_exact_or_float(real_number(f"{name}.{field}", x)) for field, x in numbers)
    is_within_float64 = is_finite(modulus) or modulus == math.inf
    for field, x, holds, requirement in (
        ("poisson_ratio", nu, -1 < nu <= 0.5, "in (-1, 0.5]"),
        ("shear_modulus", modulus, modulus > 0 and is_within_float64, "positive, and within float64"),
    ):
        if not holds:
            reason = f"must be {requirement}; is {format_value(x, str)}"
            raise ImpactError(StatusCode.INVALID_COEFFICIENT, f"{name}.{field}", reason)
    return Elastic(nu, modulus)


def _exact_or_float(x: Scalar) -> Scalar:
    """A number that can be computed with any other: a decimal cannot."""
    return x if isinstance(x, (int, Fraction)) else float(x)


METAL_ON_METAL = 14 / 17
"""The ratio for two equal materials with Poisson's ratio 0.3."""
