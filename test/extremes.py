"""Extreme collisions that break solvers, each with a name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from collisions import Collision
from random_impacts import rotated_tensor

from collision_response import Body, Contact, Geometry, ImpactModel, Precision, resolve
from collision_response.physics.effective_mass import ContactKinematics
from collision_response.physics.mass_properties import Particle, of_particles
from collision_response.physics.vector import Vec3

TURN = (0.31, -0.17, 0.52, 0.74)
"""A quaternion that is not of unit length; any length except 0 is valid."""

TURN_LENGTH = sum(q * q for q in TURN) ** 0.5
UNIT_TURN = tuple(q / TURN_LENGTH for q in TURN)

ORDINARY = Collision(
    Body.dynamic(
        2.0,
        (0.5, 0.02, -0.03, 0.6, 0.01, 0.4),
        (0.1, 0.2, 0.5),
        UNIT_TURN,
        (0.4, -0.3, -2.0),
        (0.3, 0.1, 0.7),
    ),
    Body.dynamic(
        3.0, (0.7, 0.0, 0.0, 0.5, 0.0, 0.6), (-0.1, 0.3, -0.6), None, (0.1, 0.2, 1.0), (-0.2, 0.5, 0.1)
    ),
    Contact.of((0.25, 0.1, 0.05), (0.1, -0.2, 1.0), 0.5, 0.3),
)
"""Two rotating bodies, struck off-centre, in general axes."""


BEYOND_FLOAT64 = {"speeds 1e+307 m/s"}
"""Extremes whose kinetic energy is beyond float64: every precision must refuse them."""


class Extreme(NamedTuple):
    """A named collision."""

    name: str
    collision: Collision


def extremes() -> list[Extreme]:
    """All extremes."""
    return [Extreme(name, collision) for name, collision in _all()]


def collision_named(name: str) -> Collision:
    """The collision of an extreme."""
    return dict(_all())[name]


def _all() -> Iterator[tuple[str, Collision]]:
    yield "ordinary", ORDINARY
    for ratio in (1e30, 1e-30):
        yield f"mass ratio {ratio:.0e}", ORDINARY._replace(body_a=_heavier(ORDINARY.body_a, ratio))
    for mass in (1e150, 1e-150, 1e-300):
        yield f"masses {mass:.0e} kg", _both(ORDINARY, lambda body, mass=mass: _heavier(body, mass))
    for speed in (1e150, 1e-150, 1e307):
        yield f"speeds {speed:.0e} m/s", _faster(ORDINARY, speed)
    yield (
        "speeds 1e+307 m/s, masses 1e-307 kg",
        _both(_faster(ORDINARY, 1e307), lambda body: _heavier(body, 1e-307)),
    )
    for name, second_moments in (("rod", (1.0, 1e-15, 1e-15)), ("blade", (1.0, 1e-15, 0.0))):
        x, y, z = second_moments
        moments = (y + z, x + z, x + y)
        principal = (moments[0], 0.0, 0.0, moments[1], 0.0, moments[2])
        yield f"{name}, moments 1 : 1e-15", _with_inertia(principal)
        yield f"{name}, moments 1 : 1e-15, turned", _with_inertia(principal, UNIT_TURN)
        yield f"{name}, moments 1 : 1e-15, in turned axes", _with_inertia(rotated_tensor(moments, TURN))
    yield "rod, moments 1 : 1e-12, in turned axes", _with_inertia(rotated_tensor((1e-12, 1.0, 1.0), TURN))
    yield "rod without axial inertia", _with_inertia((0.0, 0.0, 0.0, 0.3, 0.0, 0.3))
    yield "collinear particles, in turned axes", _with_inertia(_collinear())
    yield "point mass with a lever arm", _with_inertia((0.0,) * 6)
    for distance in (1e8, 1e12):
        yield f"{distance:.0e} m from the origin", _moved(ORDINARY, distance)
    for share in (1e-3, 1e-6, 1e-9, 1e-12, 1e-15):
        yield f"grazing, |u_n|/|u| = {share:.0e}", grazing(share)
    for e in (0.0, 1.0):
        yield f"e = {e:.0f}", ORDINARY._replace(contact=ORDINARY.contact._replace(restitution=e))
    yield "subnormal speeds (1e-310 m/s)", _faster(ORDINARY, 1e-310)
    yield "subnormal masses (1e-308 kg)", _both(ORDINARY, lambda body: _heavier(body, 3e-309))
    yield "subnormal lever arms (1e-310 m)", _nearer(ORDINARY, 1e-310)
    yield (
        "subnormal impulse (1e-320 N s)",
        _both(_faster(ORDINARY, 1e-160), lambda body: _heavier(body, 1e-160)),
    )
    for length in (1e100, 1e-100, 1e-200, 1e300):
        normal = ORDINARY.contact.normal * length
        yield (
            f"normal of length {length:.0e}",
            ORDINARY._replace(contact=ORDINARY.contact._replace(normal=normal)),
        )
    yield "kinematic body at 1e+06 m/s", ORDINARY._replace(body_b=_kinematic(ORDINARY.body_b, 1e6))
    yield "quaternion of length 1.001", _with_orientation(tuple(1.001 * q for q in UNIT_TURN))
    yield "all together", _all_together()


def grazing(share: float, collision: Collision = ORDINARY) -> Collision:
    """The collision with a normal velocity of about ``-share`` times the slip."""
    n = collision.contact.normal
    for _ in range(3):  # each step reduces the error to the rounding of the rest
        exactly = ImpactModel(geometry=Geometry.SPATIAL, precision=Precision.EXTENDED)
        u_n = resolve(*collision, exactly).normal_velocity_before
        slip = ContactKinematics.of(*collision).u.norm()
        velocity = collision.body_a.velocity - n * ((u_n + share * slip) / n.norm())
        collision = collision._replace(body_a=collision.body_a._replace(velocity=velocity))
    return collision


def _both(collision: Collision, change: Callable[[Body], Body]) -> Collision:
    return collision._replace(body_a=change(collision.body_a), body_b=change(collision.body_b))


def _heavier(body: Body, factor: float) -> Body:
    return Body.dynamic(body.mass * factor, [i * factor for i in body.inertia], *body[2:7])


def _faster(collision: Collision, factor: float) -> Collision:
    return _both(
        collision,
        lambda body: body._replace(
            velocity=body.velocity * factor, angular_velocity=body.angular_velocity * factor
        ),
    )


def _nearer(collision: Collision, factor: float) -> Collision:
    near = _both(collision, lambda body: body._replace(position=body.position * factor))
    return near._replace(contact=near.contact._replace(position=near.contact.position * factor))


def _moved(collision: Collision, distance: float) -> Collision:
    by = Vec3(distance, -0.7 * distance, 0.4 * distance)
    moved = _both(collision, lambda body: body._replace(position=body.position + by))
    return moved._replace(contact=moved.contact._replace(position=moved.contact.position + by))


def _with_inertia(inertia: tuple[float, ...], orientation: tuple[float, ...] | None = None) -> Collision:
    body = ORDINARY.body_a
    return ORDINARY._replace(
        body_a=Body.dynamic(
            body.mass, inertia, body.position, orientation, body.velocity, body.angular_velocity
        )
    )


def _with_orientation(quaternion: tuple[float, ...]) -> Collision:
    body = ORDINARY.body_a
    return ORDINARY._replace(body_a=Body.dynamic(*body[:3], quaternion, *body[4:7]))


def _collinear() -> tuple[float, ...]:
    along = Vec3(0.37, -0.61, 0.7)
    particles = [Particle(1.0, along * -0.4), Particle(0.7, along * 0.1), Particle(0.3, along)]
    return of_particles(particles).inertia


def _kinematic(body: Body, speed: float) -> Body:
    return Body.kinematic(body.position, (0.0, 0.1 * speed, speed), body.angular_velocity)


def _all_together() -> Collision:
    """A grazing impact along a long normal on a heavy rod in rotated axes, far from the origin."""
    collision = _with_inertia(rotated_tensor((1e-12, 1.0, 1.0), TURN), tuple(1.001 * q for q in UNIT_TURN))
    collision = _moved(collision._replace(body_a=_heavier(collision.body_a, 1e20)), 1e8)
    collision = collision._replace(contact=collision.contact._replace(normal=collision.contact.normal * 1e50))
    return grazing(1e-12, collision)
