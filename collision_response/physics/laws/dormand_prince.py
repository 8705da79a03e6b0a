"""Coefficients of DOP853: Dormand & Prince's Runge-Kutta method of order 8 with error estimates.

For ``y' = f(y)`` and a step ``h``, a row of pairs ``(j, a_j)`` stands for the sum ``sum a_j k_j``:

    STAGES     k_0 = f(y)    k_i = f(y + h sum a_j k_j)        rows for the stages i = 1 to 11
    WEIGHTS    y + h sum a_j k_j                               the result of the step, of order 8
    ORDER_3    y + h sum a_j k_j                               a result of order 3
    ERROR_5    h sum a_j k_j                                   its difference from a result of order 5

Source: Hairer, Norsett & Wanner, *Solving ODEs I*, 1993, section II.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from ...numbers.operations import Scalar, add_up, choose, maximum, minimum, square_root

Row: TypeAlias = tuple[tuple[int, float], ...]

STAGES: tuple[Row, ...] = (
    ((0, 0.05260015195876773),),
    ((0, 0.0197250569845379), (1, 0.0591751709536137)),
    ((0, 0.02958758547680685), (2, 0.08876275643042054)),
    ((0, 0.2413651341592667), (2, -0.8845494793282861), (3, 0.924834003261792)),
    ((0, 0.037037037037037035), (3, 0.17082860872947386), (4, 0.12546768756682242)),
    ((0, 0.037109375), (3, 0.17025221101954405), (4, 0.06021653898045596), (5, -0.017578125)),
    (
        (0, 0.03709200011850479), (3, 0.17038392571223998), (4, 0.10726203044637328),
        (5, -0.015319437748624402), (6, 0.008273789163814023),
    ),
    (
        (0, 0.6241109587160757), (3, -3.3608926294469414), (4, -0.868219346841726),
        (5, 27.59209969944671), (6, 20.154067550477894), (7, -43.48988418106996),
    ),
    (
        (0, 0.47766253643826434), (3, -2.4881146199716677), (4, -0.590290826836843),
        (5, 21.230051448181193), (6, 15.279233632882423), (7, -33.28821096898486),
        (8, -0.020331201708508627),
    ),
    (
        (0, -0.9371424300859873), (3, 5.186372428844064), (4, 1.0914373489967295),
        (5, -8.149787010746927), (6, -18.52006565999696), (7, 22.739487099350505),
        (8, 2.4936055526796523), (9, -3.0467644718982196),
    ),
    (
        (0, 2.273310147516538), (3, -10.53449546673725), (4, -2.0008720582248625),
        (5, -17.9589318631188), (6, 27.94888452941996), (7, -2.8589982771350235),
        (8, -8.87285693353063), (9, 12.360567175794303), (10, 0.6433927460157636),
    ),
)  # fmt: skip
WEIGHTS = (
    (0, 0.054293734116568765), (5, 4.450312892752409), (6, 1.8915178993145003), (7, -5.801203960010585),
    (8, 0.3111643669578199), (9, -0.1521609496625161), (10, 0.20136540080403034), (11, 0.04471061572777259),
)  # fmt: skip
ORDER_3 = ((0, 0.2440944881889764), (8, 0.7338466882816118), (11, 0.022058823529411766))
ERROR_5 = (
    (0, 0.01312004499419488), (5, -1.2251564463762044), (6, -0.4957589496572502), (7, 1.6643771824549864),
    (8, -0.35032884874997366), (9, 0.3341791187130175), (10, 0.08192320648511571),
    (11, -0.022355307863886294),
)  # fmt: skip


def row_sum(row: Row, slopes: Sequence[Sequence[Scalar]], i: int) -> Scalar:
    """The sum ``sum a_j k_j`` that a row stands for, of component ``i`` of the ``k``."""
    return add_up(weight * slopes[j][i] for j, weight in row)


def step_error(e5: Scalar, e3: Scalar) -> Scalar:
    """Estimate the error of a step: ``e5^2 / (e5^2 + 0.01 e3^2)^(1/2)``.

    Args:
        e5: norm of ``ERROR_5``.
        e3: norm of the difference between ``WEIGHTS`` and ``ORDER_3``.
    """
    square = e5 * e5
    return choose(square > 0, lambda: square / square_root(square + 0.01 * e3 * e3), lambda: 0 * e5)


SAFETY = 0.9
"""Steps are made shorter by this than their errors would allow."""

LEAST_FACTOR, GREATEST_FACTOR = 0.2, 4
"""How much shorter or longer than the last one a step may be."""

TOO_LONG = 1e30
"""Error of a step that is far too long, relative to the error allowed."""


def step_factor(ratio: Scalar, one: Scalar) -> Scalar:
    """Length of the next step relative to the last one.

    Args:
        ratio: error of the last step relative to the error allowed.
        one: 1, as a number of the type that the path is computed with.
    """
    # 1e-6 avoids a division by 0; the factor is then above the greatest.
    factor = SAFETY / square_root(square_root(square_root(ratio + 1e-6)))
    return maximum(minimum(factor, GREATEST_FACTOR * one), LEAST_FACTOR * one)
