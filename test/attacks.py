"""Impacts that are hard for solvers, in families: generators of named cases, each with a collision and a
model.

This module does not use the package: collisions are plain numbers, and a model is a dictionary of fields of
``ImpactModel`` with the names of laws, geometries and precisions as values. Everything is deterministic.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from exact import (
    PlainBody,
    PlainCollision,
    PlainContact,
    apply,
    dot,
    inverse,
    length,
    nearest_float,
    pair_of,
    rotation_matrix,
    vec,
)

TINY = 5e-324
PRECISIONS = ("SINGLE", "DOUBLE", "EXTENDED", "AUTO")
FORMULAS = ("FRICTIONLESS", "COULOMB")
ROUTH = ("ROUTH_POISSON", "ROUTH_STRONGE")
PATHS = ("MOREAU", *ROUTH)


class Case(NamedTuple):
    """One request.

    Attributes:
        name: unique in its family.
        collision: two bodies and their contact.
        model: fields of ``ImpactModel``.
        max_error: relative error that the answer must not exceed, whatever its bound; given for
            well-conditioned requests, for which an infinite bound would be no excuse.
        check_fields: whether the fields other than impulse and twists are checked too; not where
            a simpler geometry was forced.
    """

    name: str
    collision: PlainCollision
    model: dict[str, Any]
    max_error: float | None = None
    check_fields: bool = True


Cases = Iterator[Case]
FLOOR = PlainBody()
BOX = (0.5, 0.02, -0.03, 0.6, 0.01, 0.4)
TURN = (0.31, -0.17, 0.52, 0.74)
BODY_A = PlainBody(2.0, BOX, (0.1, 0.2, 0.5), TURN, (0.4, -0.3, -2.0), (0.3, 0.1, 0.7))
BODY_B = PlainBody(
    3.0, (0.7, 0.0, 0.0, 0.5, 0.0, 0.6), (-0.1, 0.3, -0.6), None, (0.1, 0.2, 1.0), (-0.2, 0.5, 0.1)
)
CONTACT = PlainContact((0.25, 0.1, 0.05), (0.1, -0.2, 1.0), 0.5, 0.3)
TUMBLING = PlainCollision(BODY_A, BODY_B, CONTACT)
ON_FLOOR = PlainCollision(BODY_A, FLOOR, CONTACT)
LEVELS = (0.0, 0.5, 1.0)


def model(law: str = "AUTO", precision: str = "AUTO", **more: Any) -> dict[str, Any]:
    """A model with geometry AUTO unless given."""
    return {"law": law, "precision": precision, **more}


def with_contact(collision: PlainCollision, **changes: Any) -> PlainCollision:
    return collision._replace(contact=collision.contact._replace(**changes))


def strikes_floor(body: PlainBody, *contact: Any) -> PlainCollision:
    """A body and the floor; ``contact`` is the position, the normal, and maybe restitution and friction."""
    return PlainCollision(body, FLOOR, PlainContact(*contact))


def ball(mass: float = 1.0, moment: float = 0.4, **more: Any) -> PlainBody:
    return PlainBody(mass, (moment, 0.0, 0.0, moment, 0.0, moment), **more)


def rod_in_plane(
    cosine: float, sine: float, u_t: float, u_n: float, e: float, mu: float, moment: float = 1 / 12
) -> PlainCollision:
    """A unit rod that translates and strikes the floor y = 0 with its lower end."""
    body = PlainBody(
        1.0, (moment, 0.0, 0.0, moment, 0.0, moment), (cosine / 2, sine / 2, 0.0), None, (u_t, u_n, 0.0)
    )
    return strikes_floor(body, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), e, mu)


def box_inertia(x: float, y: float, z: float) -> tuple[float, ...]:
    """The inertia of a body with second moments x, y, z, which is always valid."""
    return (y + z, 0.0, 0.0, x + z, 0.0, x + y)


def random_boxes(draw: random.Random, planar: bool = False) -> PlainCollision:
    """Two boxes that approach, in random axes or in the plane."""

    def number(low: float, high: float) -> float:
        return draw.uniform(low, high)

    def vector(size: float) -> tuple[float, ...]:
        v = [number(-size, size) for _ in range(3)]
        return (v[0], v[1], 0.0) if planar else tuple(v)

    def body() -> PlainBody:
        q = (0.0, 0.0, number(-1, 1), number(0.2, 1)) if planar else tuple(number(-1, 1) for _ in range(4))
        spin = (0.0, 0.0, number(-2, 2)) if planar else vector(2.0)
        inertia = box_inertia(*(number(0.02, 0.5) for _ in range(3)))
        return PlainBody(number(0.5, 3), inertia, vector(1.0), q, vector(2.0), spin)

    collision = PlainCollision(
        body(), body(), PlainContact(vector(0.5), vector(1.0), number(0, 1), number(0, 1))
    )
    return approaching(collision)


def approaching(collision: PlainCollision) -> PlainCollision:
    """The same collision, with the normal reversed if the bodies separate."""
    if pair_of(collision).n_u > 0:
        return with_contact(collision, normal=tuple(-c for c in collision.contact.normal))
    return collision


def scaled(v: Any, factor: float) -> Any:
    return None if v is None else tuple(c * factor for c in v)


def in_units(
    collision: PlainCollision, mass: float = 1.0, length: float = 1.0, time: float = 1.0
) -> PlainCollision:
    """The same collision in units that are smaller by these factors."""

    def body(b: PlainBody) -> PlainBody:
        return PlainBody(
            None if b.mass is None else b.mass * mass,
            tuple(i * mass * length * length for i in b.inertia),
            scaled(b.position, length),
            b.orientation,
            tuple(c * length / time for c in b.velocity),
            tuple(c / time for c in b.spin),
            scaled(b.com, length),
        )

    contact = collision.contact._replace(position=scaled(collision.contact.position, length))
    return PlainCollision(body(collision.a), body(collision.b), contact)


# the families


def quaternions() -> Cases:
    """Quaternions whose squared lengths underflow and overflow; components that are 0."""
    kinds = {
        "generic": TURN,
        "about x": (0.6, 0.0, 0.0, 0.8),
        "half turn": (0.6, 0.0, -0.8, 0.0),
        "w alone": (0.0, 0.0, 0.0, -1.0),
        "mixed": (1.0, 1e-8, 0.0, 1e-3),
    }
    lengths = (1e-160, 1e-155, 1e-150, 1e-100, 1e-20, 0.5, 1.001, 1e20, 1e100, 1e150, 1e153, 1e154)
    for (kind, q), size in product(kinds.items(), lengths):
        collision = TUMBLING._replace(a=BODY_A._replace(orientation=scaled(q, size)))
        for precision, law in zip(PRECISIONS, FORMULAS * 2, strict=True):
            yield Case(f"{kind} {size:g} {precision} {law}", collision, model(law, precision))
        if kind == "about x":
            yield Case(f"{kind} {size:g} MOREAU", collision, model("MOREAU"), 1e-9)
    for size in (TINY, 1e-300, 1e300):  # extreme lengths
        collision = TUMBLING._replace(a=BODY_A._replace(orientation=(0.0, size, 0.0, size)))
        yield Case(f"extreme {size:g}", collision, model("COULOMB"))


def thresholds() -> Cases:
    """Restitution thresholds at the rounded approach speed, and one unit in the last place next to it."""
    mass_point = PlainBody(1.5, position=(0.0, 0.0, 0.0), velocity=(0.1, -0.2, -0.3))
    collisions = {"along z": strikes_floor(mass_point, (0, 0, 0), (0.0, 0.0, 1.0), 0.5, 0.2)}
    for normal in ((0.6, 0.8, 0.0), (0.1, 0.2, 1.0), (1.0, 1.0, 1.0), (300.0, 700.0, 200.0), (2.0, 3.0, 6.0)):
        collisions[f"along {normal}"] = with_contact(collisions["along z"], normal=normal)
    collisions["tumbling"] = TUMBLING
    for name, collision in collisions.items():
        collision = approaching(collision)
        speed = nearest_float(pair_of(collision).approach_speed)
        near = {"at": speed, "above": math.nextafter(speed, 9), "below": math.nextafter(speed, 0)}
        for (where, threshold), precision, law in product(near.items(), PRECISIONS, FORMULAS):
            yield Case(
                f"{name} {where} {precision} {law}",
                collision,
                model(law, precision, restitution_threshold=threshold),
            )


def little_friction() -> Cases:
    """COULOMB with no friction or almost none, in EXTENDED."""
    frictions = (0.0, TINY, 1e-320, 1e-308, 1e-300, 1e-200, 1e-100, 1e-30, 1e-17, 1e-8)
    collisions = {
        "space": TUMBLING,
        "floor": ON_FLOOR,
        "plane": rod_in_plane(0.6, 0.8, 1.0, -1.0, 0.5, 0.0),
        "point": strikes_floor(PlainBody(1.0, velocity=(0.3, 0.1, -1.0)), (0, 0, 0), (0.1, 0.2, 1.0)),
        "no slip": strikes_floor(ball(velocity=(0.0, 0.0, -1.0)), (0, 0, -1), (0.0, 0.0, 1.0)),
    }
    for (name, collision), mu, (e, e_t) in product(
        collisions.items(), frictions, ((0.0, 0.0), (0.5, -1.0), (1.0, 1.0))
    ):
        made = with_contact(collision, restitution=e, friction=mu)
        yield Case(
            f"{name} mu={mu:g} e={e} e_t={e_t}",
            made,
            model("COULOMB", "EXTENDED", tangential_restitution=e_t),
        )


def much_friction() -> Cases:
    """Routh's path where slip stops at once. The limit is well-conditioned: errors up to 1e-6."""
    frictions = (1e3, 1e6, 1e8, 1e12, 1e16, 1e30, 1e100, 1e200, 1e300)
    tilts = {"5-12": (5 / 13, 12 / 13), "3-4": (0.6, 0.8), "level": (1.0, 0.0), "upright": (0.0, 1.0)}
    for mu, (tilt, (c, s)), u_t, law in product(frictions, tilts.items(), (1.0, -1.0), ROUTH):
        yield Case(
            f"{tilt} {law} u_t={u_t} mu={mu:g}", rod_in_plane(c, s, u_t, -1.0, 0.5, mu), model(law), 1e-6
        )
    for mu, law in product((1e3, 1e8, 1e30, 1e300), ROUTH):
        yield Case(f"tumbling {law} mu={mu:g}", with_contact(TUMBLING, friction=mu), model(law), 1e-6)


def cancelled_mobility() -> Cases:
    """K is large compared with n.Kn: a contact nearly below the centre of a body that turns easily."""
    normal = (0.3, -0.5, 0.8)
    for inertia, aside, mu, law in product((1e-4, 1e-8, 1e-12), (0.0, 1e-9, 1e-3), (0.5, 1e8), FORMULAS):
        tensor = (inertia, 0.0, 0.0, 1.3 * inertia, 0.0, 0.9 * inertia)
        arm = (-0.3 + aside, 0.5, -0.8 + aside)
        body = PlainBody(1.0, tensor, (0.0, 0.0, 0.0), TURN, (0.2, 0.4, -1.0), (0.3, -0.2, 0.1))
        collision = strikes_floor(body, arm, normal, 0.5, mu)
        for precision in PRECISIONS:
            yield Case(
                f"I={inertia:g} aside={aside:g} mu={mu:g} {law} {precision}",
                approaching(collision),
                model(law, precision),
            )
    for inertia, mu, law in product((1e-4, 1e-8), (0.5, 1e8), PATHS):
        collision = rod_in_plane(0.6, 0.8, 1.0, -1.0, 0.5, mu, inertia)
        yield Case(f"plane I={inertia:g} mu={mu:g} {law}", collision, model(law))
    for thin, mu, precision in product((1e-6, 1e-10, 1e-13, 2e-15, 0.0), (0.3, 1e8), PRECISIONS):
        rod = BODY_A._replace(inertia=(1.0, 0.0, 0.0, thin, 0.0, 1.0), spin=(0.0, 0.0, 0.0))
        collision = TUMBLING._replace(a=rod, contact=CONTACT._replace(friction=mu))
        yield Case(f"rod {thin:g} mu={mu:g} {precision}", collision, model("COULOMB", precision))


def edge_of_the_cone() -> Cases:
    """The impulse that stops the slip is exactly on the friction cone, or one rounding of mu off it."""
    bases = {
        "z": ((0.0, 0.0, 1.0), (3.0, 4.0, 0.0)),
        "122": ((1.0, 2.0, 2.0), (2.0, 1.0, -2.0)),
        "236": ((2.0, 3.0, 6.0), (6.0, 2.0, -3.0)),
        "y": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
    }
    for (axis, (n, t)), hoop, e, e_t in product(bases.items(), (False, True), (0.0, 0.5, 1.0), (0.0, 0.5)):
        slip, speed = Fraction(2), Fraction(1)  # in units of the lengths of t and n, which are integers
        length_n, length_t = (math.isqrt(int(dot(vec(v), vec(v)))) for v in (n, t))
        velocity = tuple(float(slip * Fraction(a) - speed * Fraction(b)) for a, b in zip(t, n, strict=True))
        share = Fraction(1, 2) if hoop else Fraction(1)  # 1/m + r^2/I = 2/m for a hoop, all at its rim
        critical = share * slip * length_t * (1 + Fraction(e_t)) / ((1 + Fraction(e)) * speed * length_n)
        arm = tuple(-c for c in n) if hoop else (0.0, 0.0, 0.0)
        moment = float(dot(vec(n), vec(n))) if hoop else 0.0
        body = ball(1.0, moment, velocity=velocity)
        mu = nearest_float(critical)
        near = {"on": mu, "inside": math.nextafter(mu, 99), "outside": math.nextafter(mu, 0)}
        for (where, friction), precision in product(near.items(), PRECISIONS):
            collision = strikes_floor(body, arm, n, e, friction)
            yield Case(
                f"{axis} {'hoop' if hoop else 'point'} e={e} e_t={e_t} {where} {precision}",
                collision,
                model("COULOMB", precision, tangential_restitution=e_t),
            )


def underflow() -> Cases:
    """Numbers whose products underflow, one kind at a time and all at once."""
    up = (0.0, 0.0, 1.0)
    collisions: dict[str, PlainCollision] = {}
    for speed in (TINY, 1e-323, 1e-320, 1e-310, 1e-300, 1e-200, 1e-160):
        collisions[f"speed {speed:g}"] = strikes_floor(
            ball(velocity=(speed, 0.0, -speed)), (0, 0, -1), up, 0.5, 0.3
        )
        collisions[f"oblique speed {speed:g}"] = in_units(TUMBLING, time=1 / max(speed, 1e-308))
    for size in (1e-160, 1e-250, 1e-310, TINY):
        normal = (0.6 * size, 0.0, 0.8 * size) if size > 1e-320 else (0.0, 0.0, size)
        collisions[f"normal {size:g}"] = with_contact(TUMBLING, normal=normal)
        slow = PlainBody(1.0, velocity=(0.0, 0.0, -1e-170))
        collisions[f"normal {size:g} and speed 1e-170"] = strikes_floor(slow, (0, 0, 0), normal, 0.5, 0.2)
    for size in (1e-100, 1e-160, 1e-200, 1e-310):
        collisions[f"lengths {size:g}"] = in_units(TUMBLING, length=size)
        arms = TUMBLING._replace(
            a=BODY_A._replace(position=scaled(BODY_A.position, size)),
            b=BODY_B._replace(position=scaled(BODY_B.position, size)),
        )
        collisions[f"arms {size:g}"] = with_contact(arms, position=scaled(CONTACT.position, size))
    for mass in (1e-150, 1e-250, 1e-300, 1e-307):
        collisions[f"masses {mass:g}"] = in_units(TUMBLING, mass=mass)
    for mass, time in ((1e-160, 1e160), (1e-250, 1e60), (1e-300, 1e20)):
        collisions[f"impulse {mass / time:g}"] = in_units(TUMBLING, mass=mass, time=time)
    faint = PlainBody(
        1e-300, (1e-310, 0.0, 0.0, 1e-310, 0.0, 1e-310), (1e-5, 0.0, 0.0), None, (0, 0, -1e-310)
    )
    collisions["all subnormal"] = strikes_floor(faint, (0, 0, 0), (0.0, 0.0, 1e-310), 0.5, 0.3)
    for (name, collision), law in product(collisions.items(), FORMULAS):
        for precision in PRECISIONS:
            yield Case(f"{name} {law} {precision}", collision, model(law, precision))
    for name, law in product(("speed 1e-200", "oblique speed 1e-200", "masses 1e-250"), ("MOREAU",)):
        yield Case(f"{name} {law}", collisions[name], model(law), 1e-9)


def uncertain_signs() -> Cases:
    """Approach speeds that cancel to 0, or to almost 0 of either sign."""
    collisions: dict[str, PlainCollision] = {}
    for k in (0.1, 0.3, 0.7, 1 / 3):
        for nudge in (-1, 0, 1):
            spin = k * 3.0
            v_z = k * 3 * 1.0
            v_z = math.nextafter(v_z, v_z + nudge) if nudge else v_z
            body = ball(velocity=(0.2, 0.0, v_z), spin=(0.0, spin, 0.0))
            collisions[f"spin against speed {k:.2f} {nudge:+d}"] = strikes_floor(
                body, (1.0, 0.0, -0.5), (0.0, 0.0, 1.0), 0.5, 0.3
            )
            v = (0.8 * k, math.nextafter(-0.6 * k, nudge) if nudge else -0.6 * k, 0.0)
            collisions[f"along the face {k:.2f} {nudge:+d}"] = strikes_floor(
                PlainBody(1.0, velocity=v), (0, 0, 0), (0.6, 0.8, 0.0), 0.5, 0.3
            )
    draw = random.Random("uncertain signs")
    for i in range(12):
        collision = random_boxes(draw)
        pair = pair_of(collision)
        n_z = Fraction(collision.contact.normal[2])
        v_z = nearest_float(Fraction(collision.a.velocity[2]) - pair.n_u / n_z)
        for nudge in (-1, 0, 1):
            near = math.nextafter(v_z, math.copysign(math.inf, nudge)) if nudge else v_z
            velocity = (*collision.a.velocity[:2], near)
            collisions[f"tumbling {i} {nudge:+d}"] = collision._replace(
                a=collision.a._replace(velocity=velocity)
            )
    for (name, collision), (precision, law) in product(
        collisions.items(), zip(PRECISIONS, FORMULAS * 2, strict=True)
    ):
        yield Case(f"{name} {precision}", collision, model(law, precision))
    for name in [name for name in collisions if "+0" in name][::3]:
        yield Case(f"{name} ROUTH_POISSON", collisions[name], model("ROUTH_POISSON"))


def tolerances() -> Cases:
    """Offsets that are negligible at some tolerance, with and without friction."""
    wanted = (1e-2, 1e-4, 1e-6, 1e-9, 1e-12)
    for tolerance, share, mu in product(wanted, (1e-3, 0.1, 0.5, 3.0), (0.0, 0.3, 5.0)):
        aside = tolerance * share
        flat = PlainBody(
            1.0,
            (0.2, 0.0, 0.0, 0.3, 0.0, 0.25),
            (0.3, 0.4, aside),
            None,
            (0.3, -1.0, aside),
            (aside, 0.0, 0.5),
        )
        round_ = ball(
            1.0, 0.1, position=(aside, -aside, 1.0), velocity=(0.2, 0.1, -1.0), spin=(0.5, 0.0, 0.1)
        )
        collisions = {
            "plane": strikes_floor(flat, (0, 0, 0), (aside / 3, 1.0, aside), 0.5, mu),
            "ball": strikes_floor(round_, (0, 0, 0), (0.0, 0.0, 1.0), 0.5, mu),
            "near": PlainCollision(
                ball(
                    1.0,
                    0.1,
                    position=(aside, 0.0, aside / 2),
                    velocity=(0.2, 0.1, -1.0),
                    spin=(0.0, 0.4, 0.0),
                ),
                BODY_B._replace(position=(aside, aside, -aside)),
                PlainContact((0, 0, 0), (0.0, 0.0, 1.0), 0.5, mu),
            ),
        }
        for name, collision in collisions.items():
            yield Case(
                f"{name} tolerance={tolerance:g} share={share:g} mu={mu}",
                collision,
                model(tolerance=tolerance),
            )


def batches_with_much_friction() -> Cases:
    """Columns of an EXTENDED batch whose friction overflows when squared."""
    draw = random.Random("batches with much friction")
    for mu, i in product((1e150, 1e155, 1e200, 1e300, 1.7e308), range(4)):
        yield Case(
            f"mu={mu:g} {i}", with_contact(random_boxes(draw), friction=mu), model("COULOMB", "EXTENDED")
        )


def critical_paths() -> Cases:
    """Planar paths of Routh at critical friction, with e next to 1, and grazing."""
    tilts = {"3-4": (0.6, 0.8), "4-3": (0.8, 0.6), "5-12": (5 / 13, 12 / 13)}
    for (tilt, (c, s)), law in product(tilts.items(), ROUTH):
        K = pair_of(rod_in_plane(c, s, 1.0, -1.0, 0.5, 0.0)).K
        sticking = nearest_float(abs(K[0][1]) / K[0][0])
        near = (sticking, math.nextafter(sticking, 9), math.nextafter(sticking, 0), sticking * (1 - 1e-9))
        for mu, u_t, e in product(near, (1.0, -0.5, 0.0), (0.5, math.nextafter(1.0, 0), 1.0)):
            name = f"{tilt} {law} mu-mu*={mu - sticking:.0e} u_t={u_t} e={e!r}"
            yield Case(name, rod_in_plane(c, s, u_t, -1.0, e, mu), model(law), 1e-6)
        for graze, u_t, mu in product((1e-6, 1e-9, 1e-12), (1.0, -1.0), (0.3, sticking)):
            name = f"{tilt} {law} grazing {graze:g} u_t={u_t} mu={mu!r}"
            yield Case(name, rod_in_plane(c, s, u_t, -graze, 0.7, mu), model(law), 1e-6)
        jam = nearest_float(K[1][1] / abs(K[0][1]))
        for step, u_t in product((0.0, 2.0**-52, 1e-6, -1e-6), (1.0, -1.0)):
            mu = jam * (1 + step)
            name = f"{tilt} {law} mu/jam-1={step:.0e} u_t={u_t}"
            yield Case(name, rod_in_plane(c, s, u_t, -1.0, 0.7, mu), model(law))
    pair = pair_of(TUMBLING)
    unit = length(pair.n)
    sticking = nearest_float(_sticking_friction(pair))
    for mu, law in product((sticking, math.nextafter(sticking, 0)), ROUTH):
        collision = with_contact(TUMBLING, friction=mu, restitution=math.nextafter(1.0, 0))
        yield Case(f"tumbling {law} mu-mu*={mu - sticking:.0e}", collision, model(law), 1e-6)
    for graze, law in product((1e-9,), ROUTH):
        speed = nearest_float((pair.n_u / unit + Fraction(graze)) / unit)
        velocity = tuple(v - speed * n for v, n in zip(BODY_A.velocity, CONTACT.normal, strict=True))
        collision = TUMBLING._replace(a=BODY_A._replace(velocity=velocity))
        yield Case(f"tumbling {law} grazing {graze:g}", collision, model(law), 1e-6)
    for slow, below, law in product(
        (1e-9, 1e-12, 1e-13), (1e-3, 1e-9), ROUTH
    ):  # slip turns at once, then hardly grows
        body = PlainBody(1.0, (0.5, 0.0, 0.0, 0.375, 0.0, 0.25), (-0.5, -0.25, 1.0), None, (slow, 0.0, -1.0))
        collision = strikes_floor(body, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5)
        mu = nearest_float(_sticking_friction(pair_of(collision))) * (1 - below)
        yield Case(
            f"slow {slow:g} {law} mu/mu*-1=-{below:.0e}",
            with_contact(collision, friction=mu),
            model(law),
            1e-9,
        )


def jams() -> Cases:
    """A rod slides ahead of its end on rough ground, grazing. Friction raises its impulse far above that of
    the approach, in space, while the slip turns. Well-conditioned: errors up to 1e-9.
    """
    thickness = 1e-3
    for law, (i, across), graze, (k, mu) in product(
        ROUTH, enumerate((1e-6, 0.1, 1.0)), (1e-1, 1e-4, 1e-8), enumerate((2.5, 20.0))
    ):
        along, up, side = 0.16 / 12 + thickness, 0.64 / 12 + thickness, thickness
        xx, _, _, yy, _, zz = box_inertia(along, side, up)
        inertia = (xx, 0.0, -0.32 / 12, yy, 0.0, zz)
        rod = PlainBody(1.0, inertia, (0.2, 0.0, 0.4), None, (-1.0, across, -graze))
        contact = PlainContact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), LEVELS[(i + k) % 3], mu)
        name = f"{law} across={across:g} grazing {graze:g} mu={mu:g}"
        yield Case(name, PlainCollision(rod, FLOOR, contact), model(law), 1e-9)


def _sticking_friction(pair: Any) -> Fraction:
    """The least friction at which a stopped slip stays stopped: ``|K_tt^-1 K_tn|``.

    The impulse that holds it is along ``K^-1 n``.
    """
    holds = apply(inverse(pair.K), pair.n)
    along = dot(holds, pair.n)
    across = tuple(h - n * along / dot(pair.n, pair.n) for h, n in zip(holds, pair.n, strict=True))
    return length(across) * length(pair.n) / along


def everyday() -> Cases:
    """Numbers with one decimal and oblique normals. Nothing is ill-conditioned: errors up to 1e-9."""
    draw = random.Random("everyday")

    def number(low: int, high: int) -> float:
        return draw.randint(low, high) / 10

    def vector(size: int, planar: bool) -> tuple[float, ...]:
        v = [number(-size, size) for _ in range(3)]
        return (v[0], v[1], 0.0) if planar else tuple(v)

    def solid(kind: str, planar: bool) -> PlainBody:
        if kind == "floor":
            return FLOOR
        position, velocity = vector(10, planar), vector(30, planar)
        if kind == "point":
            return PlainBody(number(1, 30), velocity=velocity, position=position)
        inertia = box_inertia(*(number(1, 9) for _ in range(3)))
        spin = (0.0, 0.0, number(-30, 30)) if planar else vector(30, planar)
        return PlainBody(number(1, 30), inertia, position, None, velocity, spin)

    counts = {"COULOMB": 40, "MOREAU": 24, "ROUTH_POISSON": 14, "ROUTH_STRONGE": 14}
    for planar, kinds, law in product(
        (True, False), (("point", "floor"), ("box", "floor"), ("box", "box")), counts
    ):
        count = counts[law] // (1 if planar or law == "COULOMB" else 7 if law in ROUTH else 2)
        made = 0
        while made < count:
            normal = vector(10, planar)
            if not any(normal):
                continue
            a, b = (solid(kind, planar) for kind in kinds)
            at = a.position if "point" in kinds else vector(10, planar)
            collision = approaching(
                PlainCollision(a, b, PlainContact(at, normal, number(0, 10), number(0, 12)))
            )
            pair = pair_of(collision)
            if pair.n_u * pair.n_u * 100 < dot(pair.n, pair.n) * dot(pair.u, pair.u) or not any(pair.u):
                continue  # it grazes
            made += 1
            where = "plane" if planar else "space"
            yield Case(f"{where} {'-'.join(kinds)} {law} {made}", collision, model(law), 1e-9)

    for i, law in product(range(30), ("MOREAU", "COULOMB")):
        collision = random_boxes(random.Random(f"slender {i}"))
        thin = box_inertia(*(10 ** draw.uniform(-5, -1) for _ in range(3)))
        yield Case(
            f"slender {i} {law}",
            with_contact(collision._replace(a=collision.a._replace(inertia=thin)), friction=0.7),
            model(law),
        )


def massless_spins() -> Cases:
    """Spin about an axis without inertia has no energy and must move no contact."""
    bodies = {
        "point": PlainBody(1.0, (0.0,) * 6, (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), (2.0, -3.0, 1.0)),
        "point, turned": PlainBody(
            1.0, (0.0,) * 6, (0.3, -0.2, 0.5), TURN, (0.1, 0.2, -1.0), (20.0, -30.0, 10.0)
        ),
        "rod": PlainBody(
            1.0, (0.0, 0.0, 0.0, 0.3, 0.0, 0.3), (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), (5.0, 1.0, 2.0)
        ),
        "rod, turned": PlainBody(
            1.0, (0.3, 0.0, 0.0, 0.3, 0.0, 0.0), (0.3, -0.2, 0.5), TURN, (0.1, 0.2, -1.0), (5.0, 1.0, 2.0)
        ),
        "rod, spins about its axis": PlainBody(
            1.0, (0.0, 0.0, 0.0, 0.25, 0.0, 0.25), (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), (500.0, 0.0, 0.0)
        ),
        "rod in skew axes": PlainBody(
            1.0, (0.5, -0.5, 0.0, 0.5, 0.0, 1.0), (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), (3.0, -1.0, 2.0)
        ),
    }
    others = {"floor": FLOOR, "box": BODY_B, "point": bodies["point"]._replace(position=(0.1, 0.0, -0.4))}
    for (name, body), (other, b) in product(bodies.items(), others.items()):
        for e, mu in ((1.0, 0.4), (0.5, 5.0)):
            collision = approaching(
                PlainCollision(body, b, PlainContact((0.0, 0.0, 0.0), (0.2, 0.1, 1.0), e, mu))
            )
            for law, precision in product(FORMULAS, PRECISIONS):
                yield Case(f"{name} on {other} e={e} {law} {precision}", collision, model(law, precision))
            yield Case(f"{name} on {other} e={e} MOREAU", collision, model("MOREAU"), 1e-9)
        if other == "floor":
            for law in ROUTH:
                yield Case(f"{name} on {other} {law}", collision, model(law), 1e-9)


def rods_in_any_axes() -> Cases:
    """Two particles have no inertia about their line, but rounding gives their tensor some."""
    places = [(math.cos(i), math.sin(2 * i), math.sin(3 * i)) for i in range(15)]
    places += [(1.0, 0.3 * 10.0**-i, -0.7 * 10.0**-j) for i, j in product(range(0, 9, 2), repeat=2)]
    for (x, y, z), order in product(places, ((0, 1, 2), (1, 2, 0), (2, 0, 1))):
        arm = tuple((x, y, z)[i] for i in order)
        x, y, z = arm
        inertia = (y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y)
        rod = PlainBody(1.0, inertia, (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), arm)
        collision = with_contact(PlainCollision(rod, FLOOR, CONTACT), position=(0.0, 0.0, 0.0))
        for law, precision in product(FORMULAS, ("AUTO", "DOUBLE", "EXTENDED")):
            yield Case(f"{arm} {law} {precision}", collision, model(law, precision))


def zeros() -> Cases:
    """No slip, friction, restitution or coupling. All impacts are simple: errors up to 1e-9."""
    up = (0.0, 0.0, 1.0)
    collisions = {
        "no slip, ball": strikes_floor(ball(velocity=(0.0, 0.0, -1.0)), (0, 0, -1), up, 0.5, 0.3),
        "no slip, off centre": strikes_floor(
            ball(position=(0.3, 0.0, 1.0), velocity=(0.0, 0.0, -1.0)), (0, 0, 0), up, 0.5, 0.3
        ),
        "no slip, off centre, rough": strikes_floor(
            ball(position=(0.3, 0.2, 1.0), velocity=(0.0, 0.0, -1.0)), (0, 0, 0), up, 0.5, 9.0
        ),
        "isotropic": strikes_floor(ball(velocity=(0.4, 0.3, -1.0)), (0, 0, 0), up, 0.5, 0.3),
        "point": strikes_floor(PlainBody(1.0, velocity=(0.4, 0.3, -1.0)), (0, 0, 0), up, 0.5, 0.3),
        "ball": strikes_floor(
            ball(velocity=(0.4, 0.3, -1.0), spin=(0.2, 0.1, 0.7)), (0, 0, -1), up, 0.5, 0.1
        ),
        "aligned": strikes_floor(
            PlainBody(1.0, (0.2, 0.0, 0.0, 0.3, 0.0, 0.4), velocity=(0.5, 0.0, -1.0)),
            (0, 0, -1),
            up,
            0.5,
            0.2,
        ),
        "anisotropic, uncoupled": strikes_floor(
            PlainBody(1.0, (0.1, 0.0, 0.0, 0.9, 0.0, 0.9), velocity=(0.5, 0.4, -1.0)),
            (0, 0, -1),
            up,
            0.5,
            0.2,
        ),
        "faint slip": strikes_floor(ball(velocity=(1e-300, 0.0, -1.0)), (0, 0, -1), up, 0.5, 0.3),
        "slip across the coupling": rod_in_plane(0.6, 0.8, 0.0, -1.0, 0.5, 0.3),
        "plane, no slip, upright": rod_in_plane(0.0, 1.0, 0.0, -1.0, 0.5, 0.3),
        "plane, slip": rod_in_plane(0.0, 1.0, 1.0, -1.0, 0.5, 0.3),
    }
    for (name, collision), law in product(collisions.items(), PATHS):
        for e, mu in (
            (None, None),
            (0.0, None),
            (1.0, None),
            (None, 0.0),
            (0.0, 0.0),
            (1.0, 0.0),
            (-0.0, -0.0),
        ):
            e_used = collision.contact.restitution if e is None else e
            mu_used = collision.contact.friction if mu is None else mu
            made = with_contact(collision, restitution=e_used, friction=mu_used)
            yield Case(f"{name} {law} e={e_used!r} mu={mu_used!r}", made, model(law), 1e-9)
    for law, mu in product(PATHS, (0.0, TINY, 1e-300, 1e-20)):
        yield Case(f"tumbling {law} mu={mu:g}", with_contact(TUMBLING, friction=mu), model(law), 1e-9)


def forced_geometries() -> Cases:
    """POINT and PLANAR where more is needed: the bound must cover what they leave out, or be infinite."""
    for aside, law, geometry in product((1e-12, 1e-7, 1e-3, 0.3), FORMULAS, ("POINT", "PLANAR")):
        collisions = {
            "arm": strikes_floor(
                ball(position=(aside, 0.4, 0.0), velocity=(0.3, -1.0, 0.0)), (0, 0, 0), (0, 1.0, 0), 0.5, 0.3
            ),
            "spin": strikes_floor(
                ball(position=(aside, 0.0, 0.0), velocity=(0.0, -1.0, 0.0), spin=(0.0, 0.0, 1.0)),
                (0, 0, 0),
                (0.0, 1.0, 0.0),
                0.5,
                0.3,
            ),
            "out of plane": strikes_floor(
                PlainBody(
                    1.0,
                    (0.2, 0.0, 0.0, 0.3, 0.0, 0.25),
                    (0.3, 0.4, aside),
                    None,
                    (0.3, -1.0, aside),
                    (0.0, aside, 0.5),
                ),
                (0, 0, 0),
                (0.0, 1.0, aside),
                0.5,
                0.3,
            ),
            "coupled": strikes_floor(
                PlainBody(
                    1.0, (0.4, 0.01, aside / 3, 0.4, aside / 4, 0.4), (0.3, 0.4, 0.0), None, (0.3, -1.0, 0.0)
                ),
                (0, 0, 0),
                (0.0, 1.0, 0.0),
                0.5,
                0.3,
            ),
            "turned": strikes_floor(
                PlainBody(
                    1.0,
                    (0.2, 0.0, 0.0, 0.3, 0.0, 0.25),
                    (0.3, 0.4, 0.0),
                    (aside, 0.0, 0.0, 1.0),
                    (0.3, -1.0, 0.0),
                ),
                (0, 0, 0),
                (0.0, 1.0, 0.0),
                0.5,
                0.3,
            ),
        }
        for (name, collision), precision, tolerance in product(
            collisions.items(), ("DOUBLE", "EXTENDED", "AUTO"), (0.0, 1e-3)
        ):
            if tolerance and precision != "AUTO":
                continue
            yield Case(
                f"{name} {aside:g} {geometry} {law} {precision} {tolerance:g}",
                collision,
                model(law, precision, geometry=geometry, tolerance=tolerance),
                check_fields=False,
            )
    for geometry, precision in product(("POINT", "PLANAR"), PRECISIONS):
        yield Case(
            f"tumbling {geometry} {precision}",
            TUMBLING,
            model("COULOMB", precision, geometry=geometry),
            check_fields=False,
        )
    for law, geometry in product(PATHS, ("POINT", "PLANAR")):
        collision = rod_in_plane(0.6, 0.8, 1.0, -1.0, 0.5, 0.3)
        tilted = collision._replace(a=collision.a._replace(velocity=(1.0, -1.0, 0.2)))
        yield Case(f"rod {geometry} {law}", tilted, model(law, geometry=geometry), check_fields=False)


def far_centres() -> Cases:
    """A centre of mass far from the reference point of a spinning body."""
    for far, w, precision, law in product((0.5, 1e3, 1e6, 1e9), (0.0, 1.0, 1e3, 1e8), PRECISIONS, FORMULAS):
        com = (far, -0.3 * far, 0.2 * far)
        at_com = _world(TURN, com)
        body = PlainBody(
            2.0,
            BOX,
            tuple(nearest_float(Fraction(p) - c) for p, c in zip((0.1, 0.2, 0.5), at_com, strict=True)),
            TURN,
            (0.4, -0.3, -2.0),
            (0.3 * w, 0.1 * w, 0.7 * w),
            com,
        )
        collision = approaching(PlainCollision(body, BODY_B, CONTACT))
        yield Case(f"far {far:g} spin {w:g} {law} {precision}", collision, model(law, precision))
    aligned = ball(velocity=(0.3, 0.0, -1.0), spin=(0.0, 2.0, 0.0))._replace(com=(0.0, 0.0, 0.25))
    flat = PlainBody(
        1.0,
        (0.1, 0.0, 0.0, 0.1, 0.0, 0.1),
        (0.3, 0.5, 0.0),
        None,
        (0.3, -1.0, 0.0),
        (0, 0, 2.0),
        (0.1, 0.2, 0.0),
    )
    for law in (*FORMULAS, *PATHS):
        yield Case(
            f"near {law}", strikes_floor(aligned, (0, 0, -0.5), (0, 0, 1.0), 0.5, 0.3), model(law), 1e-9
        )
        yield Case(f"flat {law}", strikes_floor(flat, (0, 0, 0), (0, 1.0, 0), 0.5, 0.3), model(law), 1e-9)


def _world(q: Any, v: Any) -> Any:
    return tuple(dot(row, vec(v)) for row in rotation_matrix(q))


def elastic() -> Cases:
    """Elastic impacts: restitution loses no energy, and rounding must not create any."""
    draw = random.Random("elastic")
    for i in range(20):
        collision = with_contact(random_boxes(draw, planar=i % 2 == 0), restitution=1.0)
        for law, precision in product(FORMULAS, PRECISIONS):
            yield Case(f"{i} {law} {precision}", collision, model(law, precision))
        for law, mu in product(PATHS, (0.0, 0.3)):
            yield Case(f"{i} {law} mu={mu}", with_contact(collision, friction=mu), model(law))
        rough = with_contact(collision, friction=50.0)
        for e_t, precision in product((-1.0, 1.0), PRECISIONS):
            yield Case(
                f"{i} e_t={e_t} {precision}", rough, model("COULOMB", precision, tangential_restitution=e_t)
            )


def units() -> Cases:
    """The same collisions in other units, which must be no harder."""
    flat = rod_in_plane(0.6, 0.8, 1.0, -1.0, 0.5, 0.3)
    collisions = {"space": TUMBLING, "plane": flat}
    for unit, factor in product(("mass", "length", "time"), (1e30, 1e-30, 1e150, 1e-150)):
        for name, collision in collisions.items():
            changed = in_units(collision, **{unit: factor})
            for precision, law in product(PRECISIONS, FORMULAS):
                yield Case(f"{name} {unit} {factor:g} {law} {precision}", changed, model(law, precision))
            if name == "plane" or unit == "time":
                for law in ("MOREAU", "ROUTH_STRONGE"):
                    yield Case(f"{name} {unit} {factor:g} {law}", changed, model(law), 1e-9)
    on_wall = TUMBLING._replace(b=PlainBody())
    for mass, size, time in (
        (1e100, 1e-100, 1e-100),
        (1e-100, 1e100, 1e100),
        (1e60, 1e60, 1e-60),
        (1.0, 1e100, 1e200),
    ):
        changed, still = in_units(TUMBLING, mass, size, time), in_units(on_wall, mass, size, time)
        for law in ("COULOMB", "MOREAU", "ROUTH_STRONGE"):
            yield Case(f"wall {mass:g} {size:g} {time:g} {law}", still, model(law), 1e-9)
        for precision, law in product(PRECISIONS, FORMULAS):
            yield Case(f"mixed {mass:g} {size:g} {time:g} {law} {precision}", changed, model(law, precision))


def opposites() -> Cases:
    """Opposite magnitudes in one request."""

    def changed(b: PlainBody, mass: float = 1.0, speed: float = 1.0) -> PlainBody:
        return b._replace(
            mass=b.mass * mass,
            inertia=scaled(b.inertia, mass),
            velocity=scaled(b.velocity, speed),
            spin=scaled(b.spin, speed),
        )

    collisions: dict[str, PlainCollision] = {}
    for mass, speed in ((1e20, 1e-20), (1e100, 1e-100), (1e200, 1e-200), (1e-150, 1e100)):
        collisions[f"A mass {mass:g} speed {speed:g}"] = approaching(
            PlainCollision(
                changed(BODY_A, mass, speed), changed(BODY_B, 1 / mass, min(1 / speed, 1e150)), CONTACT
            )
        )
    for arm, inertia in ((1e10, 1e-10), (1e50, 1e-50), (1e100, 1e-100), (1e6, 1e-20)):
        body = BODY_A._replace(inertia=scaled(BODY_A.inertia, inertia), position=(arm, -0.7 * arm, 0.3 * arm))
        collisions[f"arm {arm:g} inertia {inertia:g}"] = approaching(PlainCollision(body, BODY_B, CONTACT))
        spinning = body._replace(spin=scaled(BODY_A.spin, 1 / arm))
        collisions[f"arm {arm:g} inertia {inertia:g} slow"] = approaching(
            PlainCollision(spinning, FLOOR, CONTACT)
        )
    for size in (1e-200, 1e200, 1e-300, 1e307):
        collisions[f"normal {size:g}"] = with_contact(TUMBLING, normal=scaled(CONTACT.normal, size))
    collisions["normal of two sizes"] = approaching(with_contact(TUMBLING, normal=(1e-200, 1e-100, 1e200)))
    collisions["heavy slow against light fast, long normal"] = with_contact(
        collisions["A mass 1e+100 speed 1e-100"], normal=scaled(CONTACT.normal, 1e200)
    )
    for (name, collision), law, precision in product(collisions.items(), FORMULAS, PRECISIONS):
        yield Case(f"{name} {law} {precision}", collision, model(law, precision))


def swaps() -> Cases:
    """Collisions to be resolved with their bodies in both orders."""
    draw = random.Random("swaps")
    for i in range(12):
        collision = random_boxes(draw, planar=i % 2 == 0)
        laws = (*FORMULAS, "MOREAU") if i % 2 else (*FORMULAS, *PATHS)
        for law in laws:
            yield Case(f"{i} {law}", collision, model(law))
        for precision in PRECISIONS[:3]:
            yield Case(f"{i} COULOMB {precision}", collision, model("COULOMB", precision))


# other number types, and restitution functions


class FieldValue(NamedTuple):
    """A value for a field of a request: accepted as ``float(value)``, or refused by name."""

    name: str
    field: str
    value: Any
    is_number: bool


FIELDS = (
    "mass",
    "inertia",
    "position",
    "velocity",
    "spin",
    "normal",
    "restitution",
    "friction",
    "tolerance",
    "e_t",
    "threshold",
)


def kinds_of_number() -> Iterator[FieldValue]:
    """Values of every number type, and values that are not numbers."""
    numbers = (
        np.float32(0.5),
        np.float64(0.5),
        1,
        np.int32(1),
        np.int64(1),
        Fraction(1, 2),
        Decimal("0.5"),
        np.float16(0.5),
        np.uint8(1),
        np.longdouble(0.5),
        np.array(0.5),
        np.array(np.float16(0.5)),
        np.array(Fraction(1, 2), object),
    )
    others = (
        True, np.True_, np.array(True), 0.5 + 0j, np.complex64(0.5), np.array(0.5j), None, object(),
        "0.5", np.str_("0.5"), b"1", np.bytes_(b"1"), np.void(b"1"), Decimal("sNaN"), 10**400,
        np.timedelta64(1, "s"), np.datetime64("2000"), [0.5], np.array([0.5, 0.25]), np.array([0.5]),
        np.array(True, object), np.array("1", object), np.array(None, object), np.array(1j, object),
    )  # fmt: skip
    for field in FIELDS:
        for i, value in enumerate((*numbers, *others)):
            yield FieldValue(f"{field}={type(value).__name__} {i}", field, value, i < len(numbers))


class Restitution(NamedTuple):
    """A restitution function. ``code`` is the code of its refusal, or None."""

    name: str
    function: Callable[[float], Any]
    code: str | None = None


def restitutions() -> Iterator[Restitution]:
    """Functions that return other number types, or invalid coefficients."""
    yield Restitution("float", lambda v: 0.5)
    yield Restitution("falling", lambda v: 1 / (1 + v))
    yield Restitution("np.float32", lambda v: np.float32(0.3))
    yield Restitution("np.float64", lambda v: np.float64(0.3))
    yield Restitution("int 0", lambda v: 0)
    yield Restitution("int 1", lambda v: 1)
    yield Restitution("-0.0", lambda v: -0.0)
    yield Restitution("a step", lambda v: 0.9 if v < 2.0 else 0.1)
    yield Restitution("a staircase", lambda v: math.floor(v * 7) % 8 / 8)
    yield Restitution("above 1", lambda v: 1.0000000000000002, "INVALID_COEFFICIENT")
    yield Restitution("negative", lambda v: -TINY, "INVALID_COEFFICIENT")
    yield Restitution("NaN", lambda v: math.nan, "NOT_FINITE")
    yield Restitution("infinite", lambda v: math.inf, "NOT_FINITE")


USER_ERRORS = (
    ZeroDivisionError("by the user"),
    ValueError("by the user"),
    OverflowError("by the user"),
    KeyError("by the user"),
)


FAMILIES: dict[str, Callable[[], Cases]] = {
    "quaternions": quaternions,
    "thresholds": thresholds,
    "little friction": little_friction,
    "much friction": much_friction,
    "cancelled mobility": cancelled_mobility,
    "edge of the cone": edge_of_the_cone,
    "underflow": underflow,
    "uncertain signs": uncertain_signs,
    "tolerances": tolerances,
    "critical paths": critical_paths,
    "jams": jams,
    "everyday": everyday,
    "massless spins": massless_spins,
    "rods in any axes": rods_in_any_axes,
    "zeros": zeros,
    "forced geometries": forced_geometries,
    "far centres": far_centres,
    "elastic": elastic,
    "units": units,
    "opposites": opposites,
    "swaps": swaps,
}
