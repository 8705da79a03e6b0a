"""Impacts that break solvers, in families: generators of cases, each with a name, a scene and a model.

Nothing here knows the package: scenes are plain numbers, and a model is a dictionary of the fields of
``ImpactModel`` with the names of laws, geometries and precisions for values. All is deterministic.
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
from exact import Scene, Solid, Touch, apply, dot, inverse, length, nearest, pair_of, rotation_of, vec

TINY = 5e-324
PRECISIONS = ("SINGLE", "DOUBLE", "EXTENDED", "AUTO")
FORMULAS = ("FRICTIONLESS", "COULOMB")
ROUTH = ("ROUTH_POISSON", "ROUTH_STRONGE")
PATHS = ("MOREAU", *ROUTH)


class Case(NamedTuple):
    """One request.

    Attributes:
        name: unique in its family.
        scene: two bodies and their contact.
        model: fields of ``ImpactModel``.
        within: relative error that the answer must keep, whatever its bound says; for well-conditioned
            requests, about which an infinite bound would be no excuse.
        fields: whether what is reported beside impulse and twists is that of the whole motion; not so
            where a cheaper geometry was forced.
    """

    name: str
    scene: Scene
    model: dict[str, Any]
    within: float | None = None
    fields: bool = True


Cases = Iterator[Case]
FLOOR = Solid()
BOX = (0.5, 0.02, -0.03, 0.6, 0.01, 0.4)
TURN = (0.31, -0.17, 0.52, 0.74)
BODY_A = Solid(2.0, BOX, (0.1, 0.2, 0.5), TURN, (0.4, -0.3, -2.0), (0.3, 0.1, 0.7))
BODY_B = Solid(
    3.0, (0.7, 0.0, 0.0, 0.5, 0.0, 0.6), (-0.1, 0.3, -0.6), None, (0.1, 0.2, 1.0), (-0.2, 0.5, 0.1)
)
TOUCH = Touch((0.25, 0.1, 0.05), (0.1, -0.2, 1.0), 0.5, 0.3)
TUMBLING = Scene(BODY_A, BODY_B, TOUCH)
ON_FLOOR = Scene(BODY_A, FLOOR, TOUCH)
LEVELS = (0.0, 0.5, 1.0)


def model(law: str = "AUTO", precision: str = "AUTO", **more: Any) -> dict[str, Any]:
    """A model; geometry AUTO unless told."""
    return {"law": law, "precision": precision, **more}


def with_contact(scene: Scene, **changes: Any) -> Scene:
    return scene._replace(contact=scene.contact._replace(**changes))


def ball(mass: float = 1.0, moment: float = 0.4, **more: Any) -> Solid:
    return Solid(mass, (moment, 0.0, 0.0, moment, 0.0, moment), **more)


def rod_in_plane(
    cosine: float, sine: float, u_t: float, u_n: float, e: float, mu: float, moment: float = 1 / 12
) -> Scene:
    """A unit rod whose lower end strikes the floor y = 0; it moves without turning."""
    body = Solid(
        1.0, (moment, 0.0, 0.0, moment, 0.0, moment), (cosine / 2, sine / 2, 0.0), None, (u_t, u_n, 0.0)
    )
    return Scene(body, FLOOR, Touch((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), e, mu))


def box_inertia(x: float, y: float, z: float) -> tuple[float, ...]:
    """Of second moments x, y, z: always that of a body."""
    return (y + z, 0.0, 0.0, x + z, 0.0, x + y)


def drawn(draw: random.Random, planar: bool = False) -> Scene:
    """Two boxes that approach, in no special axes; or in the plane."""

    def number(low: float, high: float) -> float:
        return draw.uniform(low, high)

    def vector(size: float) -> tuple[float, ...]:
        v = [number(-size, size) for _ in range(3)]
        return (v[0], v[1], 0.0) if planar else tuple(v)

    def body() -> Solid:
        q = (0.0, 0.0, number(-1, 1), number(0.2, 1)) if planar else tuple(number(-1, 1) for _ in range(4))
        spin = (0.0, 0.0, number(-2, 2)) if planar else vector(2.0)
        inertia = box_inertia(*(number(0.02, 0.5) for _ in range(3)))
        return Solid(number(0.5, 3), inertia, vector(1.0), q, vector(2.0), spin)

    scene = Scene(body(), body(), Touch(vector(0.5), vector(1.0), number(0, 1), number(0, 1)))
    return approaching(scene)


def approaching(scene: Scene) -> Scene:
    """The same with the normal reversed where the bodies separate."""
    if pair_of(scene).n_u > 0:
        return with_contact(scene, normal=tuple(-c for c in scene.contact.normal))
    return scene


def scaled(v: Any, factor: float) -> Any:
    return None if v is None else tuple(c * factor for c in v)


def in_units(scene: Scene, mass: float = 1.0, length: float = 1.0, time: float = 1.0) -> Scene:
    """The same scene in units so many times smaller."""

    def body(b: Solid) -> Solid:
        return Solid(
            None if b.mass is None else b.mass * mass,
            tuple(i * mass * length * length for i in b.inertia),
            scaled(b.position, length),
            b.orientation,
            tuple(c * length / time for c in b.velocity),
            tuple(c / time for c in b.spin),
            scaled(b.com, length),
        )

    contact = scene.contact._replace(position=scaled(scene.contact.position, length))
    return Scene(body(scene.a), body(scene.b), contact)


# the families


def quaternions() -> Cases:
    """Lengths whose squares underflow and overflow; components that are 0."""
    kinds = {
        "generic": TURN,
        "about x": (0.6, 0.0, 0.0, 0.8),
        "half turn": (0.6, 0.0, -0.8, 0.0),
        "w alone": (0.0, 0.0, 0.0, -1.0),
        "mixed": (1.0, 1e-8, 0.0, 1e-3),
    }
    lengths = (1e-160, 1e-155, 1e-150, 1e-100, 1e-20, 0.5, 1.001, 1e20, 1e100, 1e150, 1e153, 1e154)
    for (kind, q), size in product(kinds.items(), lengths):
        scene = TUMBLING._replace(a=BODY_A._replace(orientation=scaled(q, size)))
        for precision, law in zip(PRECISIONS, FORMULAS * 2, strict=True):
            yield Case(f"{kind} {size:g} {precision} {law}", scene, model(law, precision))
        if kind == "about x":
            yield Case(f"{kind} {size:g} MOREAU", scene, model("MOREAU"), 1e-9)
    for size in (TINY, 1e-300, 1e300):  # beyond the range that a square root could mend
        scene = TUMBLING._replace(a=BODY_A._replace(orientation=(0.0, size, 0.0, size)))
        yield Case(f"extreme {size:g}", scene, model("COULOMB"))


def thresholds() -> Cases:
    """A threshold that is the rounded approach speed, and the numbers beside it."""
    mass_point = Solid(1.5, position=(0.0, 0.0, 0.0), velocity=(0.1, -0.2, -0.3))
    scenes = {"along z": Scene(mass_point, FLOOR, Touch((0, 0, 0), (0.0, 0.0, 1.0), 0.5, 0.2))}
    for normal in ((0.6, 0.8, 0.0), (0.1, 0.2, 1.0), (1.0, 1.0, 1.0), (300.0, 700.0, 200.0), (2.0, 3.0, 6.0)):
        scenes[f"along {normal}"] = with_contact(scenes["along z"], normal=normal)
    scenes["tumbling"] = TUMBLING
    for name, scene in scenes.items():
        scene = approaching(scene)
        speed = nearest(pair_of(scene).approach_speed)
        near = {"at": speed, "above": math.nextafter(speed, 9), "below": math.nextafter(speed, 0)}
        for (where, threshold), precision, law in product(near.items(), PRECISIONS, FORMULAS):
            yield Case(
                f"{name} {where} {precision} {law}",
                scene,
                model(law, precision, restitution_threshold=threshold),
            )


def little_friction() -> Cases:
    """COULOMB with no friction, or next to none, in EXTENDED."""
    frictions = (0.0, TINY, 1e-320, 1e-308, 1e-300, 1e-200, 1e-100, 1e-30, 1e-17, 1e-8)
    scenes = {
        "space": TUMBLING,
        "floor": ON_FLOOR,
        "plane": rod_in_plane(0.6, 0.8, 1.0, -1.0, 0.5, 0.0),
        "point": Scene(Solid(1.0, velocity=(0.3, 0.1, -1.0)), FLOOR, Touch((0, 0, 0), (0.1, 0.2, 1.0))),
        "no slip": Scene(ball(velocity=(0.0, 0.0, -1.0)), FLOOR, Touch((0, 0, -1), (0.0, 0.0, 1.0))),
    }
    for (name, scene), mu, (e, e_t) in product(
        scenes.items(), frictions, ((0.0, 0.0), (0.5, -1.0), (1.0, 1.0))
    ):
        made = with_contact(scene, restitution=e, friction=mu)
        yield Case(
            f"{name} mu={mu:g} e={e} e_t={e_t}",
            made,
            model("COULOMB", "EXTENDED", tangential_restitution=e_t),
        )


def much_friction() -> Cases:
    """Routh's path where slip stops at once. The limit is well-conditioned: to 1e-6 in any case."""
    frictions = (1e3, 1e6, 1e8, 1e12, 1e16, 1e30, 1e100, 1e200, 1e300)
    tilts = {"5-12": (5 / 13, 12 / 13), "3-4": (0.6, 0.8), "level": (1.0, 0.0), "upright": (0.0, 1.0)}
    for mu, (tilt, (c, s)), u_t, law in product(frictions, tilts.items(), (1.0, -1.0), ROUTH):
        yield Case(
            f"{tilt} {law} u_t={u_t} mu={mu:g}", rod_in_plane(c, s, u_t, -1.0, 0.5, mu), model(law), 1e-6
        )
    for mu, law in product((1e3, 1e8, 1e30, 1e300), ROUTH):
        yield Case(f"tumbling {law} mu={mu:g}", with_contact(TUMBLING, friction=mu), model(law), 1e-6)


def cancelled_mobility() -> Cases:
    """K is large beside n.Kn: a contact nearly below the centre of a body that turns easily."""
    normal = (0.3, -0.5, 0.8)
    for inertia, aside, mu, law in product((1e-4, 1e-8, 1e-12), (0.0, 1e-9, 1e-3), (0.5, 1e8), FORMULAS):
        tensor = (inertia, 0.0, 0.0, 1.3 * inertia, 0.0, 0.9 * inertia)
        arm = (-0.3 + aside, 0.5, -0.8 + aside)
        body = Solid(1.0, tensor, (0.0, 0.0, 0.0), TURN, (0.2, 0.4, -1.0), (0.3, -0.2, 0.1))
        scene = Scene(body, FLOOR, Touch(arm, normal, 0.5, mu))
        for precision in PRECISIONS:
            yield Case(
                f"I={inertia:g} aside={aside:g} mu={mu:g} {law} {precision}",
                approaching(scene),
                model(law, precision),
            )
    for inertia, mu, law in product((1e-4, 1e-8), (0.5, 1e8), PATHS):
        scene = rod_in_plane(0.6, 0.8, 1.0, -1.0, 0.5, mu, inertia)
        yield Case(f"plane I={inertia:g} mu={mu:g} {law}", scene, model(law))
    for thin, mu, precision in product((1e-6, 1e-10, 1e-13, 2e-15, 0.0), (0.3, 1e8), PRECISIONS):
        rod = BODY_A._replace(inertia=(1.0, 0.0, 0.0, thin, 0.0, 1.0), spin=(0.0, 0.0, 0.0))
        scene = TUMBLING._replace(a=rod, contact=TOUCH._replace(friction=mu))
        yield Case(f"rod {thin:g} mu={mu:g} {precision}", scene, model("COULOMB", precision))


def edge_of_the_cone() -> Cases:
    """The impulse that brings the slip to rest lies exactly on the cone, or one rounding of mu beside it."""
    bases = {
        "z": ((0.0, 0.0, 1.0), (3.0, 4.0, 0.0)),
        "122": ((1.0, 2.0, 2.0), (2.0, 1.0, -2.0)),
        "236": ((2.0, 3.0, 6.0), (6.0, 2.0, -3.0)),
        "y": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
    }
    for (axis, (n, t)), hoop, e, e_t in product(bases.items(), (False, True), (0.0, 0.5, 1.0), (0.0, 0.5)):
        slip, speed = Fraction(2), Fraction(1)  # in lengths of t and of n, which are whole
        length_n, length_t = (math.isqrt(int(dot(vec(v), vec(v)))) for v in (n, t))
        velocity = tuple(float(slip * Fraction(a) - speed * Fraction(b)) for a, b in zip(t, n, strict=True))
        share = Fraction(1, 2) if hoop else Fraction(1)  # 1/m + r^2/I = 2/m for a hoop, all at its rim
        critical = share * slip * length_t * (1 + Fraction(e_t)) / ((1 + Fraction(e)) * speed * length_n)
        arm = tuple(-c for c in n) if hoop else (0.0, 0.0, 0.0)
        moment = float(dot(vec(n), vec(n))) if hoop else 0.0
        body = ball(1.0, moment, velocity=velocity)
        mu = nearest(critical)
        near = {"on": mu, "inside": math.nextafter(mu, 99), "outside": math.nextafter(mu, 0)}
        for (where, friction), precision in product(near.items(), PRECISIONS):
            scene = Scene(body, FLOOR, Touch(arm, n, e, friction))
            yield Case(
                f"{axis} {'hoop' if hoop else 'point'} e={e} e_t={e_t} {where} {precision}",
                scene,
                model("COULOMB", precision, tangential_restitution=e_t),
            )


def underflow() -> Cases:
    """Numbers whose products underflow, one kind after the other, and all at once."""
    up = (0.0, 0.0, 1.0)
    scenes: dict[str, Scene] = {}
    for speed in (TINY, 1e-323, 1e-320, 1e-310, 1e-300, 1e-200, 1e-160):
        scenes[f"speed {speed:g}"] = Scene(
            ball(velocity=(speed, 0.0, -speed)), FLOOR, Touch((0, 0, -1), up, 0.5, 0.3)
        )
        scenes[f"oblique speed {speed:g}"] = in_units(TUMBLING, time=1 / max(speed, 1e-308))
    for size in (1e-160, 1e-250, 1e-310, TINY):
        normal = (0.6 * size, 0.0, 0.8 * size) if size > 1e-320 else (0.0, 0.0, size)
        scenes[f"normal {size:g}"] = with_contact(TUMBLING, normal=normal)
        slow = Solid(1.0, velocity=(0.0, 0.0, -1e-170))
        scenes[f"normal {size:g} and speed 1e-170"] = Scene(slow, FLOOR, Touch((0, 0, 0), normal, 0.5, 0.2))
    for size in (1e-100, 1e-160, 1e-200, 1e-310):
        scenes[f"lengths {size:g}"] = in_units(TUMBLING, length=size)
        arms = TUMBLING._replace(
            a=BODY_A._replace(position=scaled(BODY_A.position, size)),
            b=BODY_B._replace(position=scaled(BODY_B.position, size)),
        )
        scenes[f"arms {size:g}"] = with_contact(arms, position=scaled(TOUCH.position, size))
    for mass in (1e-150, 1e-250, 1e-300, 1e-307):
        scenes[f"masses {mass:g}"] = in_units(TUMBLING, mass=mass)
    for mass, time in ((1e-160, 1e160), (1e-250, 1e60), (1e-300, 1e20)):
        scenes[f"impulse {mass / time:g}"] = in_units(TUMBLING, mass=mass, time=time)
    faint = Solid(1e-300, (1e-310, 0.0, 0.0, 1e-310, 0.0, 1e-310), (1e-5, 0.0, 0.0), None, (0, 0, -1e-310))
    scenes["all subnormal"] = Scene(faint, FLOOR, Touch((0, 0, 0), (0.0, 0.0, 1e-310), 0.5, 0.3))
    for (name, scene), law in product(scenes.items(), FORMULAS):
        for precision in PRECISIONS:
            yield Case(f"{name} {law} {precision}", scene, model(law, precision))
    for name, law in product(("speed 1e-200", "oblique speed 1e-200", "masses 1e-250"), ("MOREAU",)):
        yield Case(f"{name} {law}", scenes[name], model(law), 1e-9)


def uncertain_signs() -> Cases:
    """Approach speeds that cancel to nothing, or to next to nothing of either sign."""
    scenes: dict[str, Scene] = {}
    for k in (0.1, 0.3, 0.7, 1 / 3):
        for nudge in (-1, 0, 1):
            spin = k * 3.0
            v_z = k * 3 * 1.0
            v_z = math.nextafter(v_z, v_z + nudge) if nudge else v_z
            body = ball(velocity=(0.2, 0.0, v_z), spin=(0.0, spin, 0.0))
            scenes[f"spin against speed {k:.2f} {nudge:+d}"] = Scene(
                body, FLOOR, Touch((1.0, 0.0, -0.5), (0.0, 0.0, 1.0), 0.5, 0.3)
            )
            v = (0.8 * k, math.nextafter(-0.6 * k, nudge) if nudge else -0.6 * k, 0.0)
            scenes[f"along the face {k:.2f} {nudge:+d}"] = Scene(
                Solid(1.0, velocity=v), FLOOR, Touch((0, 0, 0), (0.6, 0.8, 0.0), 0.5, 0.3)
            )
    draw = random.Random("uncertain signs")
    for i in range(12):
        scene = drawn(draw)
        pair = pair_of(scene)
        n_z = Fraction(scene.contact.normal[2])
        v_z = nearest(Fraction(scene.a.velocity[2]) - pair.n_u / n_z)
        for nudge in (-1, 0, 1):
            near = math.nextafter(v_z, math.copysign(math.inf, nudge)) if nudge else v_z
            velocity = (*scene.a.velocity[:2], near)
            scenes[f"tumbling {i} {nudge:+d}"] = scene._replace(a=scene.a._replace(velocity=velocity))
    for (name, scene), (precision, law) in product(
        scenes.items(), zip(PRECISIONS, FORMULAS * 2, strict=True)
    ):
        yield Case(f"{name} {precision}", scene, model(law, precision))
    for name in [name for name in scenes if "+0" in name][::3]:
        yield Case(f"{name} ROUTH_POISSON", scenes[name], model("ROUTH_POISSON"))


def tolerances() -> Cases:
    """Offsets small enough to be left out at some tolerance, with and without friction."""
    wanted = (1e-2, 1e-4, 1e-6, 1e-9, 1e-12)
    for tolerance, share, mu in product(wanted, (1e-3, 0.1, 0.5, 3.0), (0.0, 0.3, 5.0)):
        aside = tolerance * share
        flat = Solid(
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
        scenes = {
            "plane": Scene(flat, FLOOR, Touch((0, 0, 0), (aside / 3, 1.0, aside), 0.5, mu)),
            "ball": Scene(round_, FLOOR, Touch((0, 0, 0), (0.0, 0.0, 1.0), 0.5, mu)),
            "near": Scene(
                ball(
                    1.0,
                    0.1,
                    position=(aside, 0.0, aside / 2),
                    velocity=(0.2, 0.1, -1.0),
                    spin=(0.0, 0.4, 0.0),
                ),
                BODY_B._replace(position=(aside, aside, -aside)),
                Touch((0, 0, 0), (0.0, 0.0, 1.0), 0.5, mu),
            ),
        }
        for name, scene in scenes.items():
            yield Case(
                f"{name} tolerance={tolerance:g} share={share:g} mu={mu}", scene, model(tolerance=tolerance)
            )


def batches_with_much_friction() -> Cases:
    """Rows of a batch in EXTENDED whose friction overflows once squared."""
    draw = random.Random("batches with much friction")
    for mu, i in product((1e150, 1e155, 1e200, 1e300, 1.7e308), range(4)):
        yield Case(f"mu={mu:g} {i}", with_contact(drawn(draw), friction=mu), model("COULOMB", "EXTENDED"))


def critical_paths() -> Cases:
    """Planar paths of Routh at critical friction, with e next to 1, and grazing."""
    tilts = {"3-4": (0.6, 0.8), "4-3": (0.8, 0.6), "5-12": (5 / 13, 12 / 13)}
    for (tilt, (c, s)), law in product(tilts.items(), ROUTH):
        K = pair_of(rod_in_plane(c, s, 1.0, -1.0, 0.5, 0.0)).K
        sticking = nearest(abs(K[0][1]) / K[0][0])
        near = (sticking, math.nextafter(sticking, 9), math.nextafter(sticking, 0), sticking * (1 - 1e-9))
        for mu, u_t, e in product(near, (1.0, -0.5, 0.0), (0.5, math.nextafter(1.0, 0), 1.0)):
            name = f"{tilt} {law} mu-mu*={mu - sticking:.0e} u_t={u_t} e={e!r}"
            yield Case(name, rod_in_plane(c, s, u_t, -1.0, e, mu), model(law), 1e-6)
        for graze, u_t, mu in product((1e-6, 1e-9, 1e-12), (1.0, -1.0), (0.3, sticking)):
            name = f"{tilt} {law} grazing {graze:g} u_t={u_t} mu={mu!r}"
            yield Case(name, rod_in_plane(c, s, u_t, -graze, 0.7, mu), model(law), 1e-6)
        jam = nearest(K[1][1] / abs(K[0][1]))
        for step, u_t in product((0.0, 2.0**-52, 1e-6, -1e-6), (1.0, -1.0)):
            mu = jam * (1 + step)
            name = f"{tilt} {law} mu/jam-1={step:.0e} u_t={u_t}"
            yield Case(name, rod_in_plane(c, s, u_t, -1.0, 0.7, mu), model(law))
    pair = pair_of(TUMBLING)
    unit = length(pair.n)
    sticking = nearest(_sticking_friction(pair))
    for mu, law in product((sticking, math.nextafter(sticking, 0)), ROUTH):
        scene = with_contact(TUMBLING, friction=mu, restitution=math.nextafter(1.0, 0))
        yield Case(f"tumbling {law} mu-mu*={mu - sticking:.0e}", scene, model(law), 1e-6)
    for graze, law in product((1e-9,), ROUTH):
        speed = nearest((pair.n_u / unit + Fraction(graze)) / unit)
        velocity = tuple(v - speed * n for v, n in zip(BODY_A.velocity, TOUCH.normal, strict=True))
        scene = TUMBLING._replace(a=BODY_A._replace(velocity=velocity))
        yield Case(f"tumbling {law} grazing {graze:g}", scene, model(law), 1e-6)


def jams() -> Cases:
    """A rod that slides ahead of its end on rough ground, grazing: friction makes it fall to far above the
    approach, in space, and with a slip that is turning as it does. To 1e-9: that is well-conditioned.
    """
    thickness = 1e-3
    for law, (i, across), graze, (k, mu) in product(
        ROUTH, enumerate((1e-6, 0.1, 1.0)), (1e-1, 1e-4, 1e-8), enumerate((2.5, 20.0))
    ):
        along, up, side = 0.16 / 12 + thickness, 0.64 / 12 + thickness, thickness
        xx, _, _, yy, _, zz = box_inertia(along, side, up)
        inertia = (xx, 0.0, -0.32 / 12, yy, 0.0, zz)
        rod = Solid(1.0, inertia, (0.2, 0.0, 0.4), None, (-1.0, across, -graze))
        contact = Touch((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), LEVELS[(i + k) % 3], mu)
        name = f"{law} across={across:g} grazing {graze:g} mu={mu:g}"
        yield Case(name, Scene(rod, FLOOR, contact), model(law), 1e-9)


def _sticking_friction(pair: Any) -> Fraction:
    """The least friction with which slip that has stopped stays stopped: ``|K_tt^-1 K_tn|``.

    The impulse that holds it is along ``K^-1 n``.
    """
    holds = apply(inverse(pair.K), pair.n)
    along = dot(holds, pair.n)
    across = tuple(h - n * along / dot(pair.n, pair.n) for h, n in zip(holds, pair.n, strict=True))
    return length(across) * length(pair.n) / along


def everyday() -> Cases:
    """Numbers with one decimal, on oblique normals. To 1e-9: nothing here is ill-conditioned."""
    draw = random.Random("everyday")

    def number(low: int, high: int) -> float:
        return draw.randint(low, high) / 10

    def vector(size: int, planar: bool) -> tuple[float, ...]:
        v = [number(-size, size) for _ in range(3)]
        return (v[0], v[1], 0.0) if planar else tuple(v)

    def solid(kind: str, planar: bool) -> Solid:
        if kind == "floor":
            return FLOOR
        position, velocity = vector(10, planar), vector(30, planar)
        if kind == "point":
            return Solid(number(1, 30), velocity=velocity, position=position)
        inertia = box_inertia(*(number(1, 9) for _ in range(3)))
        spin = (0.0, 0.0, number(-30, 30)) if planar else vector(30, planar)
        return Solid(number(1, 30), inertia, position, None, velocity, spin)

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
            scene = approaching(Scene(a, b, Touch(at, normal, number(0, 10), number(0, 12))))
            pair = pair_of(scene)
            if pair.n_u * pair.n_u * 100 < dot(pair.n, pair.n) * dot(pair.u, pair.u) or not any(pair.u):
                continue  # it grazes
            made += 1
            where = "plane" if planar else "space"
            yield Case(f"{where} {'-'.join(kinds)} {law} {made}", scene, model(law), 1e-9)

    for i, law in product(range(30), ("MOREAU", "COULOMB")):
        scene = drawn(random.Random(f"slender {i}"))
        thin = box_inertia(*(10 ** draw.uniform(-5, -1) for _ in range(3)))
        yield Case(
            f"slender {i} {law}",
            with_contact(scene._replace(a=scene.a._replace(inertia=thin)), friction=0.7),
            model(law),
        )


def idle_spins() -> Cases:
    """Spin about an axis without inertia has no energy to give: it must move no contact."""
    bodies = {
        "point": Solid(1.0, (0.0,) * 6, (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), (2.0, -3.0, 1.0)),
        "point, turned": Solid(
            1.0, (0.0,) * 6, (0.3, -0.2, 0.5), TURN, (0.1, 0.2, -1.0), (20.0, -30.0, 10.0)
        ),
        "rod": Solid(
            1.0, (0.0, 0.0, 0.0, 0.3, 0.0, 0.3), (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), (5.0, 1.0, 2.0)
        ),
        "rod, turned": Solid(
            1.0, (0.3, 0.0, 0.0, 0.3, 0.0, 0.0), (0.3, -0.2, 0.5), TURN, (0.1, 0.2, -1.0), (5.0, 1.0, 2.0)
        ),
        "rod, spins about its axis": Solid(
            1.0, (0.0, 0.0, 0.0, 0.25, 0.0, 0.25), (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), (500.0, 0.0, 0.0)
        ),
        "rod in skew axes": Solid(
            1.0, (0.5, -0.5, 0.0, 0.5, 0.0, 1.0), (0.3, -0.2, 0.5), None, (0.1, 0.2, -1.0), (3.0, -1.0, 2.0)
        ),
    }
    others = {"floor": FLOOR, "box": BODY_B, "point": bodies["point"]._replace(position=(0.1, 0.0, -0.4))}
    for (name, body), (other, b) in product(bodies.items(), others.items()):
        for e, mu in ((1.0, 0.4), (0.5, 5.0)):
            scene = approaching(Scene(body, b, Touch((0.0, 0.0, 0.0), (0.2, 0.1, 1.0), e, mu)))
            for law, precision in product(FORMULAS, PRECISIONS):
                yield Case(f"{name} on {other} e={e} {law} {precision}", scene, model(law, precision))
            yield Case(f"{name} on {other} e={e} MOREAU", scene, model("MOREAU"), 1e-9)
        if other == "floor":
            for law in ROUTH:
                yield Case(f"{name} on {other} {law}", scene, model(law), 1e-9)


def zeros() -> Cases:
    """Every kind of nothing: slip, friction, restitution, coupling. To 1e-9: all are simple impacts."""
    up = (0.0, 0.0, 1.0)
    scenes = {
        "no slip, ball": Scene(ball(velocity=(0.0, 0.0, -1.0)), FLOOR, Touch((0, 0, -1), up, 0.5, 0.3)),
        "no slip, off centre": Scene(
            ball(position=(0.3, 0.0, 1.0), velocity=(0.0, 0.0, -1.0)), FLOOR, Touch((0, 0, 0), up, 0.5, 0.3)
        ),
        "no slip, off centre, rough": Scene(
            ball(position=(0.3, 0.2, 1.0), velocity=(0.0, 0.0, -1.0)), FLOOR, Touch((0, 0, 0), up, 0.5, 9.0)
        ),
        "isotropic": Scene(ball(velocity=(0.4, 0.3, -1.0)), FLOOR, Touch((0, 0, 0), up, 0.5, 0.3)),
        "point": Scene(Solid(1.0, velocity=(0.4, 0.3, -1.0)), FLOOR, Touch((0, 0, 0), up, 0.5, 0.3)),
        "ball": Scene(
            ball(velocity=(0.4, 0.3, -1.0), spin=(0.2, 0.1, 0.7)), FLOOR, Touch((0, 0, -1), up, 0.5, 0.1)
        ),
        "aligned": Scene(
            Solid(1.0, (0.2, 0.0, 0.0, 0.3, 0.0, 0.4), velocity=(0.5, 0.0, -1.0)),
            FLOOR,
            Touch((0, 0, -1), up, 0.5, 0.2),
        ),
        "anisotropic, uncoupled": Scene(
            Solid(1.0, (0.1, 0.0, 0.0, 0.9, 0.0, 0.9), velocity=(0.5, 0.4, -1.0)),
            FLOOR,
            Touch((0, 0, -1), up, 0.5, 0.2),
        ),
        "faint slip": Scene(ball(velocity=(1e-300, 0.0, -1.0)), FLOOR, Touch((0, 0, -1), up, 0.5, 0.3)),
        "slip across the coupling": rod_in_plane(0.6, 0.8, 0.0, -1.0, 0.5, 0.3),
        "plane, no slip, upright": rod_in_plane(0.0, 1.0, 0.0, -1.0, 0.5, 0.3),
        "plane, slip": rod_in_plane(0.0, 1.0, 1.0, -1.0, 0.5, 0.3),
    }
    for (name, scene), law in product(scenes.items(), PATHS):
        for e, mu in (
            (None, None),
            (0.0, None),
            (1.0, None),
            (None, 0.0),
            (0.0, 0.0),
            (1.0, 0.0),
            (-0.0, -0.0),
        ):
            e_used = scene.contact.restitution if e is None else e
            mu_used = scene.contact.friction if mu is None else mu
            made = with_contact(scene, restitution=e_used, friction=mu_used)
            yield Case(f"{name} {law} e={e_used!r} mu={mu_used!r}", made, model(law), 1e-9)
    for law, mu in product(PATHS, (0.0, TINY, 1e-300, 1e-20)):
        yield Case(f"tumbling {law} mu={mu:g}", with_contact(TUMBLING, friction=mu), model(law), 1e-9)


def forced_geometries() -> Cases:
    """POINT and PLANAR on what needs more: the bound covers what was dropped, or is infinite."""
    for aside, law, geometry in product((1e-12, 1e-7, 1e-3, 0.3), FORMULAS, ("POINT", "PLANAR")):
        scenes = {
            "arm": Scene(
                ball(position=(aside, 0.4, 0.0), velocity=(0.3, -1.0, 0.0)),
                FLOOR,
                Touch((0, 0, 0), (0, 1.0, 0), 0.5, 0.3),
            ),
            "spin": Scene(
                ball(position=(aside, 0.0, 0.0), velocity=(0.0, -1.0, 0.0), spin=(0.0, 0.0, 1.0)),
                FLOOR,
                Touch((0, 0, 0), (0.0, 1.0, 0.0), 0.5, 0.3),
            ),
            "out of plane": Scene(
                Solid(
                    1.0,
                    (0.2, 0.0, 0.0, 0.3, 0.0, 0.25),
                    (0.3, 0.4, aside),
                    None,
                    (0.3, -1.0, aside),
                    (0.0, aside, 0.5),
                ),
                FLOOR,
                Touch((0, 0, 0), (0.0, 1.0, aside), 0.5, 0.3),
            ),
            "coupled": Scene(
                Solid(
                    1.0, (0.4, 0.01, aside / 3, 0.4, aside / 4, 0.4), (0.3, 0.4, 0.0), None, (0.3, -1.0, 0.0)
                ),
                FLOOR,
                Touch((0, 0, 0), (0.0, 1.0, 0.0), 0.5, 0.3),
            ),
            "turned": Scene(
                Solid(
                    1.0,
                    (0.2, 0.0, 0.0, 0.3, 0.0, 0.25),
                    (0.3, 0.4, 0.0),
                    (aside, 0.0, 0.0, 1.0),
                    (0.3, -1.0, 0.0),
                ),
                FLOOR,
                Touch((0, 0, 0), (0.0, 1.0, 0.0), 0.5, 0.3),
            ),
        }
        for (name, scene), precision, tolerance in product(
            scenes.items(), ("DOUBLE", "EXTENDED", "AUTO"), (0.0, 1e-3)
        ):
            if tolerance and precision != "AUTO":
                continue
            yield Case(
                f"{name} {aside:g} {geometry} {law} {precision} {tolerance:g}",
                scene,
                model(law, precision, geometry=geometry, tolerance=tolerance),
                fields=False,
            )
    for geometry, precision in product(("POINT", "PLANAR"), PRECISIONS):
        yield Case(
            f"tumbling {geometry} {precision}",
            TUMBLING,
            model("COULOMB", precision, geometry=geometry),
            fields=False,
        )
    for law, geometry in product(PATHS, ("POINT", "PLANAR")):
        scene = rod_in_plane(0.6, 0.8, 1.0, -1.0, 0.5, 0.3)
        tilted = scene._replace(a=scene.a._replace(velocity=(1.0, -1.0, 0.2)))
        yield Case(f"rod {geometry} {law}", tilted, model(law, geometry=geometry), fields=False)


def far_centres() -> Cases:
    """The centre of mass far from the reference point of a body that spins."""
    for far, w, precision, law in product((0.5, 1e3, 1e6, 1e9), (0.0, 1.0, 1e3, 1e8), PRECISIONS, FORMULAS):
        com = (far, -0.3 * far, 0.2 * far)
        at_com = _world(TURN, com)
        body = Solid(
            2.0,
            BOX,
            tuple(nearest(Fraction(p) - c) for p, c in zip((0.1, 0.2, 0.5), at_com, strict=True)),
            TURN,
            (0.4, -0.3, -2.0),
            (0.3 * w, 0.1 * w, 0.7 * w),
            com,
        )
        scene = approaching(Scene(body, BODY_B, TOUCH))
        yield Case(f"far {far:g} spin {w:g} {law} {precision}", scene, model(law, precision))
    aligned = ball(velocity=(0.3, 0.0, -1.0), spin=(0.0, 2.0, 0.0))._replace(com=(0.0, 0.0, 0.25))
    flat = Solid(
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
            f"near {law}", Scene(aligned, FLOOR, Touch((0, 0, -0.5), (0, 0, 1.0), 0.5, 0.3)), model(law), 1e-9
        )
        yield Case(
            f"flat {law}", Scene(flat, FLOOR, Touch((0, 0, 0), (0, 1.0, 0), 0.5, 0.3)), model(law), 1e-9
        )


def _world(q: Any, v: Any) -> Any:
    return tuple(dot(row, vec(v)) for row in rotation_of(q))


def elastic() -> Cases:
    """Nothing is lost to restitution, and nothing is gained by rounding."""
    draw = random.Random("elastic")
    for i in range(20):
        scene = with_contact(drawn(draw, planar=i % 2 == 0), restitution=1.0)
        for law, precision in product(FORMULAS, PRECISIONS):
            yield Case(f"{i} {law} {precision}", scene, model(law, precision))
        rough = with_contact(scene, friction=50.0)
        for e_t, precision in product((-1.0, 1.0), PRECISIONS):
            yield Case(
                f"{i} e_t={e_t} {precision}", rough, model("COULOMB", precision, tangential_restitution=e_t)
            )


def units() -> Cases:
    """The same scenes in other units: nothing about them is harder."""
    flat = rod_in_plane(0.6, 0.8, 1.0, -1.0, 0.5, 0.3)
    scenes = {"space": TUMBLING, "plane": flat}
    for unit, factor in product(("mass", "length", "time"), (1e30, 1e-30, 1e150, 1e-150)):
        for name, scene in scenes.items():
            changed = in_units(scene, **{unit: factor})
            for precision, law in product(PRECISIONS, FORMULAS):
                yield Case(f"{name} {unit} {factor:g} {law} {precision}", changed, model(law, precision))
            if name == "plane" or unit == "time":
                for law in ("MOREAU", "ROUTH_STRONGE"):
                    yield Case(f"{name} {unit} {factor:g} {law}", changed, model(law), 1e-9)
    for mass, size, time in ((1e100, 1e-100, 1e-100), (1e-100, 1e100, 1e100), (1e60, 1e60, 1e-60)):
        changed = in_units(TUMBLING, mass, size, time)
        for precision, law in product(PRECISIONS, FORMULAS):
            yield Case(f"mixed {mass:g} {size:g} {time:g} {law} {precision}", changed, model(law, precision))


def opposites() -> Cases:
    """Opposite ranges in one request."""

    def changed(b: Solid, mass: float = 1.0, speed: float = 1.0) -> Solid:
        return b._replace(
            mass=b.mass * mass,
            inertia=scaled(b.inertia, mass),
            velocity=scaled(b.velocity, speed),
            spin=scaled(b.spin, speed),
        )

    scenes: dict[str, Scene] = {}
    for mass, speed in ((1e20, 1e-20), (1e100, 1e-100), (1e200, 1e-200), (1e-150, 1e100)):
        scenes[f"A mass {mass:g} speed {speed:g}"] = approaching(
            Scene(changed(BODY_A, mass, speed), changed(BODY_B, 1 / mass, min(1 / speed, 1e150)), TOUCH)
        )
    for arm, inertia in ((1e10, 1e-10), (1e50, 1e-50), (1e100, 1e-100), (1e6, 1e-20)):
        body = BODY_A._replace(inertia=scaled(BODY_A.inertia, inertia), position=(arm, -0.7 * arm, 0.3 * arm))
        scenes[f"arm {arm:g} inertia {inertia:g}"] = approaching(Scene(body, BODY_B, TOUCH))
        spinning = body._replace(spin=scaled(BODY_A.spin, 1 / arm))
        scenes[f"arm {arm:g} inertia {inertia:g} slow"] = approaching(Scene(spinning, FLOOR, TOUCH))
    for size in (1e-200, 1e200, 1e-300, 1e307):
        scenes[f"normal {size:g}"] = with_contact(TUMBLING, normal=scaled(TOUCH.normal, size))
    scenes["normal of two sizes"] = approaching(with_contact(TUMBLING, normal=(1e-200, 1e-100, 1e200)))
    scenes["heavy slow against light fast, long normal"] = with_contact(
        scenes["A mass 1e+100 speed 1e-100"], normal=scaled(TOUCH.normal, 1e200)
    )
    for (name, scene), law, precision in product(scenes.items(), FORMULAS, PRECISIONS):
        yield Case(f"{name} {law} {precision}", scene, model(law, precision))


def swaps() -> Cases:
    """Scenes to be seen from both sides."""
    draw = random.Random("swaps")
    for i in range(12):
        scene = drawn(draw, planar=i % 2 == 0)
        laws = (*FORMULAS, "MOREAU") if i % 2 else (*FORMULAS, *PATHS)
        for law in laws:
            yield Case(f"{i} {law}", scene, model(law))
        for precision in PRECISIONS[:3]:
            yield Case(f"{i} COULOMB {precision}", scene, model("COULOMB", precision))


# numbers of other makes, and restitution that is a function


class Given(NamedTuple):
    """A value for a field of a request that must be served as ``float(value)``, or refused by name."""

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


def kinds_of_number() -> Iterator[Given]:
    """Numbers of every make, and what is no number."""
    numbers = (
        np.float32(0.5),
        np.float64(0.5),
        1,
        np.int32(1),
        np.int64(1),
        Fraction(1, 2),
        Decimal("0.5"),
        np.float16(0.5),
    )
    others = (True, np.True_, 0.5 + 0j, "0.5", None, [0.5], 10**400, np.array([0.5, 0.25]), object())
    for field in FIELDS:
        for i, value in enumerate((*numbers, *others)):
            yield Given(f"{field}={type(value).__name__} {i}", field, value, i < len(numbers))


class Restitution(NamedTuple):
    """A function for the restitution. ``code`` is that of the refusal, or None."""

    name: str
    function: Callable[[float], Any]
    code: str | None = None


def restitutions() -> Iterator[Restitution]:
    """Functions that return other makes of number, and no coefficient."""
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


RAISING = (
    ZeroDivisionError("by the user"),
    ValueError("by the user"),
    OverflowError("by the user"),
    KeyError("by the user"),
)


FAMILIES: dict[str, Callable[[], Cases]] = {
    "a quaternions": quaternions,
    "b thresholds": thresholds,
    "c little friction": little_friction,
    "d much friction": much_friction,
    "f cancelled mobility": cancelled_mobility,
    "g edge of the cone": edge_of_the_cone,
    "h underflow": underflow,
    "i uncertain signs": uncertain_signs,
    "j tolerances": tolerances,
    "n critical paths": critical_paths,
    "n jams": jams,
    "o everyday": everyday,
    "p idle spins": idle_spins,
    "q zeros": zeros,
    "r forced geometries": forced_geometries,
    "t far centres": far_centres,
    "u elastic": elastic,
    "x units": units,
    "y opposites": opposites,
    "z swaps": swaps,
}
