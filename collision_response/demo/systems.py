"""The eight systems S1 to S8 that were the start of this package, each with its closed form.

The closed forms are those of the two sources, in exact fractions where they are rational, and share no code
with the package. A quantity is named by its path in a result (``twist_a.linear.y``), which is the same in the
Python API and in the answer of the service.

Sources: a French lecture chapter on rigid-body collisions (S1 to S5) and a Spanish note on the
effective mass (S6 to S8).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction as F
from typing import Any, NamedTuple

import numpy as np

from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.mass_properties import Particle, of_particles
from ..physics.tensor import Symmetric3
from ..physics.vector import Vec3

fractions: Any = np.frompyfunc(F, 1, 1)
"""Array of the exact values of some numbers."""


class System(NamedTuple):
    """An impact with a known answer: values of some quantities of the result by a closed form, by path."""

    name: str
    title: str
    body_a: Body
    body_b: Body
    contact: Contact
    expected: Mapping[str, float]


def all_systems() -> list[System]:
    """S1 to S8, in order."""
    return [s1(), s2(math.radians(15)), s3(), s4(), s5(), s6(), s7(), s8()]


def s1() -> System:
    """A planar body bounces elastically off a fixed plane (French, section 1)."""
    m, moment, r, theta = 2.0, 0.5, 0.6, math.radians(35)
    v_x, v_y, w = 1.5, -3.0, 2.0
    arm = r * math.sin(theta)
    after = bounce(m, moment, arm, v_y, w)
    return System(
        "S1",
        "planar body on a plane, elastic",
        Body.dynamic(
            m,
            (moment, 0.0, 0.0, moment, 0.0, moment),
            position=(-arm, r * math.cos(theta), 0.0),
            velocity=(v_x, v_y, 0.0),
            angular_velocity=(0.0, 0.0, w),
        ),
        Body.static(),
        Contact.of((0.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0), restitution=1.0),
        {"twist_a.linear.x": v_x, "twist_a.linear.y": after[0], "twist_a.angular.z": after[1]},
    )


def bounce(m: float, moment: float, arm: float, v_y: float, w: float) -> tuple[float, float]:
    """``(v_y, w)`` after the impact of S1, with ``arm = +-r sin(theta)``.

    The second formula of the source lacks a factor ``sin(theta)``; this is its equation 3 with its first
    formula.
    """
    approach = v_y + arm * w
    v_y_after = v_y - 2 * approach / (1 + m * arm * arm / moment)
    return v_y_after, w + m * arm * (v_y_after - v_y) / moment


def s2(corner_angle: float) -> System:
    """A square of 3 kg and 1.2 m strikes a 40 degree incline with a corner (French, situation A).

    The figure of the source is lost, so the angle of the corner is a parameter.

    Args:
        corner_angle: angle at the centre from the perpendicular on the incline to the corner, positive uphill
            [rad]. Between -45 and 45 degrees the corner is the point of the square nearest to the incline.
    """
    m, side, incline, dip = 3.0, 1.2, math.radians(40), math.radians(30)
    moment, to_corner = m * side**2 / 6, side / math.sqrt(2)
    along, normal = (math.cos(incline), math.sin(incline)), (-math.sin(incline), math.cos(incline))
    v, w = (4 * math.cos(dip), -4 * math.sin(dip)), 2.8
    arm, height = to_corner * math.sin(corner_angle), to_corner * math.cos(corner_angle)
    v_t = v[0] * along[0] + v[1] * along[1]
    v_n, w_after = bounce(m, moment, arm, v[0] * normal[0] + v[1] * normal[1], w)
    return System(
        "S2",
        "square on an incline",
        Body.dynamic(
            m,
            (moment / 2, 0.0, 0.0, moment / 2, 0.0, moment),
            position=(height * normal[0] - arm * along[0], height * normal[1] - arm * along[1], 0.0),
            velocity=(*v, 0.0),
            angular_velocity=(0.0, 0.0, w),
        ),
        Body.static(),
        Contact.of((0.0, 0.0, 0.0), normal=(*normal, 0.0), restitution=1.0),
        {
            "twist_a.linear.x": v_t * along[0] + v_n * normal[0],
            "twist_a.linear.y": v_t * along[1] + v_n * normal[1],
            "twist_a.angular.z": w_after,
        },
    )


def s3() -> System:
    """Two bodies in space with restitution (French, section 2)."""
    a = Body.dynamic(
        2.0, (3.0, 0.5, -0.25, 4.0, 0.75, 5.0), (1.0, 2.0, -1.0), None, (-1.0, 0.5, 2.0), (0.5, -1.0, 2.0)
    )
    b = Body.dynamic(
        5.0, (6.0, -0.5, 1.0, 7.0, 0.25, 8.0), (-1.0, 0.0, 1.0), None, (2.0, 1.0, -0.5), (1.0, 0.25, -0.5)
    )
    contact = Contact.of((0.25, 0.5, 0.75), normal=(2.0, 1.0, -2.0), restitution=0.75)
    return System("S3", "two bodies in space", a, b, contact, _reaction_model(a, b, contact))


def s4() -> System:
    """A body made of particles, which determine its mass, centre of mass and inertia (French)."""
    masses = [1, 2, 3, 2]
    positions = [(0, 0, 0), (2, 0, 1), (0, 1, 2), (1, 2, 0)]
    particles = [Particle(F(m), Vec3(*map(F, p))) for m, p in zip(masses, positions, strict=True)]
    exact = of_particles(particles)
    a = Body.dynamic(
        float(exact.mass),
        [float(i) for i in exact.inertia],
        [float(x) for x in exact.com],
        None,
        (0.0, 0.0, -3.0),
    )
    contact = Contact.of((2.0, 0.0, 1.0), normal=(0.0, 0.0, 1.0), restitution=0.5)
    total, up = sum(masses), np.array([0, 0, 1])
    com = masses @ fractions(positions) / total
    from_com = [fractions(p) - com for p in positions]
    inertia = sum(
        m * (d @ d * np.eye(3, dtype=int) - np.outer(d, d)) for m, d in zip(masses, from_com, strict=True)
    )
    arm = fractions((2, 0, 1)) - com
    spin = _solve(inertia, np.cross(arm, up))
    mu = 1 / (F(1, total) + np.cross(spin, arm) @ up)
    j = F(3, 2) * mu * 3
    expected = {"effective_mass": mu, "twist_a.linear.z": -3 + j / total, "twist_a.angular.y": spin[1] * j}
    return System("S4", "a body of four particles", a, Body.static(), contact, _floats(expected))


def s5() -> System:
    """The planar case, in which only ``I_zz`` of the inertia matters (French)."""
    m_a, i_a, m_b, i_b, e = F(2), F(1, 2), F(3), F(3, 4), F(1, 2)
    r_a, r_b, n = fractions((-0.5, 0.25)), fractions((0.25, 0.5)), fractions((0, -1))
    w_a, w_b, v_a, v_b = F(2), F(-1), fractions((1, 3)), fractions((0, -1))
    arm_a, arm_b = (r[0] * n[1] - r[1] * n[0] for r in (r_a, r_b))
    approach = (v_a - v_b) @ n + w_a * arm_a - w_b * arm_b
    j = -(1 + e) * approach / (1 / m_a + 1 / m_b + arm_a**2 / i_a + arm_b**2 / i_b)
    expected = {
        "twist_a.linear.y": v_a[1] + j / m_a * n[1],
        "twist_a.angular.z": w_a + j * arm_a / i_a,
        "twist_b.linear.y": v_b[1] - j / m_b * n[1],
        "twist_b.angular.z": w_b - j * arm_b / i_b,
    }
    return System(
        "S5",
        "two bodies in the plane",
        Body.dynamic(
            2.0, (0.25, 0.0, 0.0, 0.25, 0.0, 0.5), (0.5, -0.25, 0.0), None, (1.0, 3.0, 0.0), (0.0, 0.0, 2.0)
        ),
        Body.dynamic(
            3.0, (0.5, 0.0, 0.0, 0.5, 0.0, 0.75), (-0.25, -0.5, 0.0), None, (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)
        ),
        Contact.of((0.0, 0.0, 0.0), normal=(0.0, -1.0, 0.0), restitution=0.5),
        _floats(expected),
    )


def s6() -> System:
    """Two point masses (Spanish): ``J = (1 + e) mu v_imp``, ``mu = m1 m2 / (m1 + m2)``."""
    m_1, m_2, e, v_1, v_2 = F(3), F(2), F(4, 5), F(2), F(-1)
    mu = m_1 * m_2 / (m_1 + m_2)
    j = (1 + e) * mu * (v_1 - v_2)
    expected = {
        "effective_mass": mu,
        "normal_impulse": j,
        "twist_a.linear.x": v_1 - j / m_1,
        "twist_b.linear.x": v_2 + j / m_2,
    }
    return System(
        "S6",
        "two point masses",
        Body.dynamic(3.0, velocity=(2.0, 0.0, 0.0)),
        Body.dynamic(2.0, velocity=(-1.0, 0.0, 0.0)),
        Contact.of((0.0, 0.0, 0.0), normal=(-1.0, 0.0, 0.0), restitution=0.8),
        _floats(expected),
    )


def s7() -> System:
    """Two rigid bodies by their effective mass (Spanish); its normal points from body 1 to body 2."""
    moments_1, moments_2 = fractions((2, 3, 4)), fractions((5, 6, 7))
    m_1, m_2, e, n = F(4), F(6), F(1, 4), fractions((0, 0, 1))
    c_1, c_2 = fractions((1, -0.5, -1)), fractions((-0.5, 1, 0.5))
    v_imp = F(3)
    rotation_1 = n @ np.cross(c_1, np.cross(c_1, n) / moments_1)
    rotation_2 = n @ np.cross(c_2, np.cross(c_2, n) / moments_2)
    mu = 1 / (1 / m_1 + 1 / m_2 - (rotation_1 + rotation_2))
    expected = {"effective_mass": mu, "normal_impulse": (1 + e) * mu * v_imp}
    return System(
        "S7",
        "effective mass of two bodies",
        Body.dynamic(4.0, (2.0, 0.0, 0.0, 3.0, 0.0, 4.0), (1.0, -0.5, -1.0), None, (0.0, 1.0, 3.0)),
        Body.dynamic(6.0, (5.0, 0.0, 0.0, 6.0, 0.0, 7.0), (-0.5, 1.0, 0.5)),
        Contact.of((0.0, 0.0, 0.0), normal=(0.0, 0.0, -1.0), restitution=0.25),
        _floats(expected),
    )


def s8() -> System:
    """A rod struck at its end by a point mass (Spanish): ``mu = m1 m2 / (m1 + 4 m2)``."""
    m_1, m_2, length, speed = F(3), F(1, 2), F(2), F(6)
    mu = m_1 * m_2 / (m_1 + 4 * m_2)
    j = 2 * mu * speed
    spin = j * (length / 2) / (m_1 * length**2 / 12)
    expected = {
        "effective_mass": mu,
        "twist_a.linear.x": -j / m_1,
        "twist_a.angular.z": spin,
        "twist_b.linear.x": -speed + j / m_2,
    }
    upright = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    return System(
        "S8",
        "rod struck at its end",
        Body.rod(3.0, 2.0, position=(0.0, -1.0, 0.0), orientation=upright),
        Body.dynamic(0.5, velocity=(-6.0, 0.0, 0.0)),
        Contact.of((0.0, 0.0, 0.0), normal=(-1.0, 0.0, 0.0), restitution=1.0),
        _floats(expected),
    )


def _reaction_model(a: Body, b: Body, contact: Contact) -> dict[str, float]:
    """Equation ``J_n`` of the French source, in fractions; the bodies' axes are parallel to the world's."""
    n = fractions(contact.normal)
    n = n / math.isqrt(int(n @ n))
    r_a, r_b = (fractions(contact.position) - fractions(body.position) for body in (a, b))
    v_a, v_b = (fractions(body.velocity) for body in (a, b))
    w_a, w_b = (fractions(body.angular_velocity) for body in (a, b))
    spin_a, spin_b = (
        _solve(fractions(Symmetric3(*body.inertia).rows()), np.cross(r, n))
        for body, r in ((a, r_a), (b, r_b))
    )
    approach = (v_a + np.cross(w_a, r_a) - v_b - np.cross(w_b, r_b)) @ n
    turning = (np.cross(spin_a, r_a) + np.cross(spin_b, r_b)) @ n
    restitution: Any = contact.restitution
    j = -(1 + F(restitution)) * approach / (1 / F(a.mass) + 1 / F(b.mass) + turning)
    after = {
        "twist_a.linear": v_a + j / F(a.mass) * n,
        "twist_a.angular": w_a + j * spin_a,
        "twist_b.linear": v_b - j / F(b.mass) * n,
        "twist_b.angular": w_b - j * spin_b,
    }
    expected = {f"{name}.{axis}": x for name, v in after.items() for axis, x in zip("xyz", v, strict=True)}
    return _floats({"normal_impulse": j, **expected})


def _solve(m: Any, y: Any) -> Any:
    """Solve ``m x = y`` for fractions, by Cramer's rule."""

    def det(columns: Any) -> Any:
        return columns[0] @ np.cross(columns[1], columns[2])

    columns = [*m.T]
    return np.array([det([*columns[:k], y, *columns[k + 1 :]]) for k in range(3)]) / det(columns)


def _floats(values: Mapping[str, F]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items()}
