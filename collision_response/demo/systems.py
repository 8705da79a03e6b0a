"""The eight systems S1 to S8 that were the start of this package, each with its closed form.

The closed forms are those of the two sources, in exact fractions where they are rational, and share no code
with the package. A quantity is named by its path in a result (``twist_a.linear.y``), which is the same in the
Python API and in the answer of the service.

Sources: a French lecture chapter on rigid-body collisions (S1 to S5) and a Spanish note on the
effective mass (S6 to S8).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction as F
from typing import Any, NamedTuple

from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.mass_properties import Particle, of_particles, rod
from ..physics.tensor import Symmetric3
from ..physics.vector import Vec3


class System(NamedTuple):
    """An impact with a known answer.

    Attributes:
        name: S1 to S8.
        title: a short description.
        body_a, body_b, contact: the request.
        expected: values of some quantities of the result by a closed form, by path.
    """

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
    total = sum(masses)
    com = [F(sum(m * p[i] for m, p in zip(masses, positions, strict=True)), total) for i in range(3)]
    a = Body.dynamic(
        float(exact.mass),
        [float(i) for i in exact.inertia],
        [float(x) for x in exact.com],
        None,
        (0.0, 0.0, -3.0),
    )
    contact = Contact.of((2.0, 0.0, 1.0), normal=(0.0, 0.0, 1.0), restitution=0.5)
    inertia = [[F(0)] * 3 for _ in range(3)]
    for m, p in zip(masses, positions, strict=True):
        d = [x - c for x, c in zip(p, com, strict=True)]
        for i in range(3):
            for j in range(3):
                inertia[i][j] += m * ((sum(x * x for x in d) if i == j else 0) - d[i] * d[j])
    arm = [F(x) - c for x, c in zip((2, 0, 1), com, strict=True)]
    torque = _cross(arm, [0, 0, 1])
    spin = _solve(inertia, torque)
    mu = 1 / (F(1, total) + _dot(_cross(spin, arm), [0, 0, 1]))
    j = F(3, 2) * mu * 3
    expected = {"effective_mass": mu, "twist_a.linear.z": -3 + j / total, "twist_a.angular.y": spin[1] * j}
    return System("S4", "a body of four particles", a, Body.static(), contact, _floats(expected))


def s5() -> System:
    """The planar case, in which only ``I_zz`` of the inertia matters (French)."""
    m_a, i_a, m_b, i_b, e = F(2), F(1, 2), F(3), F(3, 4), F(1, 2)
    r_a, r_b, n = (F(-1, 2), F(1, 4)), (F(1, 4), F(1, 2)), (F(0), F(-1))
    w_a, w_b, v_a, v_b = F(2), F(-1), (F(1), F(3)), (F(0), F(-1))

    def arm(r: Sequence[F]) -> F:
        return r[0] * n[1] - r[1] * n[0]

    approach = (v_a[0] - v_b[0]) * n[0] + (v_a[1] - v_b[1]) * n[1] + w_a * arm(r_a) - w_b * arm(r_b)
    j = -(1 + e) * approach / (1 / m_a + 1 / m_b + arm(r_a) ** 2 / i_a + arm(r_b) ** 2 / i_b)
    expected = {
        "twist_a.linear.y": v_a[1] + j / m_a * n[1],
        "twist_a.angular.z": w_a + j * arm(r_a) / i_a,
        "twist_b.linear.y": v_b[1] - j / m_b * n[1],
        "twist_b.angular.z": w_b - j * arm(r_b) / i_b,
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
    moments_1, moments_2 = (F(2), F(3), F(4)), (F(5), F(6), F(7))
    m_1, m_2, e, n = F(4), F(6), F(1, 4), (F(0), F(0), F(1))
    c_1, c_2 = (F(1), F(-1, 2), F(-1)), (F(-1, 2), F(1), F(1, 2))
    v_imp = F(3)

    def rotation_term(c: Sequence[F], moments: Sequence[F]) -> F:
        turned = [x / i for x, i in zip(_cross(c, n), moments, strict=True)]
        return _dot(n, _cross(c, turned))

    mu = 1 / (1 / m_1 + 1 / m_2 - (rotation_term(c_1, moments_1) + rotation_term(c_2, moments_2)))
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
        Body.dynamic(3.0, rod(3.0, 2.0).inertia, (0.0, -1.0, 0.0), upright),
        Body.dynamic(0.5, velocity=(-6.0, 0.0, 0.0)),
        Contact.of((0.0, 0.0, 0.0), normal=(-1.0, 0.0, 0.0), restitution=1.0),
        _floats(expected),
    )


def _reaction_model(a: Body, b: Body, contact: Contact) -> dict[str, float]:
    """Equation ``J_n`` of the French source, in fractions; the bodies' axes are parallel to the world's."""
    n = [F(x) for x in contact.normal]
    length = math.isqrt(int(_dot(n, n)))
    unit = [x / length for x in n]
    r = [[F(c) - F(x) for c, x in zip(contact.position, body.position, strict=True)] for body in (a, b)]
    v = [[F(x) for x in body.velocity] for body in (a, b)]
    w = [[F(x) for x in body.angular_velocity] for body in (a, b)]
    spin = [
        _solve(Symmetric3(*map(F, body.inertia)).rows(), _cross(arm, unit))
        for body, arm in zip((a, b), r, strict=True)
    ]
    at_contact = [[p + q for p, q in zip(v[i], _cross(w[i], r[i]), strict=True)] for i in range(2)]
    approach = _dot([p - q for p, q in zip(*at_contact, strict=True)], unit)
    turning = [p + q for p, q in zip(_cross(spin[0], r[0]), _cross(spin[1], r[1]), strict=True)]
    restitution: Any = contact.restitution
    j = -(1 + F(restitution)) * approach / (1 / F(a.mass) + 1 / F(b.mass) + _dot(turning, unit))
    expected = {"normal_impulse": j}
    for name, sign, body, change, v_0, w_0 in (
        ("a", 1, a, spin[0], v[0], w[0]),
        ("b", -1, b, spin[1], v[1], w[1]),
    ):
        for i, axis in enumerate("xyz"):
            expected[f"twist_{name}.linear.{axis}"] = v_0[i] + sign * j / F(body.mass) * unit[i]
            expected[f"twist_{name}.angular.{axis}"] = w_0[i] + sign * j * change[i]
    return _floats(expected)


def _solve(m: Sequence[Sequence[F]], y: Sequence[Any]) -> list[F]:
    """Solve ``m x = y`` by Cramer's rule."""
    columns = list(zip(*m, strict=True))

    def det(p: Sequence[Any], q: Sequence[Any], r: Sequence[Any]) -> F:
        return F(_dot(p, _cross(q, r)))

    whole = det(*columns)
    return [det(*(y if i == k else column for i, column in enumerate(columns))) / whole for k in range(3)]


def _dot(p: Sequence[Any], q: Sequence[Any]) -> Any:
    return sum(x * y for x, y in zip(p, q, strict=True))


def _cross(p: Sequence[Any], q: Sequence[Any]) -> list[Any]:
    return [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]


def _floats(values: Mapping[str, F]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items()}
