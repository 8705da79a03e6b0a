"""Derivatives of an impact by differences: the oracle of ``differentiate``, with which it shares no code."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("mpmath")
import numpy as np
from mpmath import mp, mpf

from collision_response import Body, Contact, ImpactModel, Law, resolve
from collision_response.derivatives import PARAMETERS, differentiate
from collision_response.impact import impact
from collision_response.physics.laws import Settings
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3


def in_mpf(body: Body) -> Body:
    """The body in mpmath numbers, with its orientation written out."""
    q = body.orientation or Quaternion(0.0, 0.0, 0.0, 1.0)
    return Body(
        mpf(body.mass), type(body.inertia)(*map(mpf, body.inertia)), Vec3(*map(mpf, body.position)),
        Quaternion(*map(mpf, q)), Vec3(*map(mpf, body.velocity)), Vec3(*map(mpf, body.angular_velocity)),
        Vec3(*map(mpf, body.com)),
    )  # fmt: skip


def changed(request: dict, name: str, axis: int, by) -> dict:
    """The request with one component of one parameter changed by ``by``."""
    owner, field = name.split(".")
    part = request[owner]
    if field == "orientation":
        v, w = Vec3(*part.orientation[:3]), part.orientation.w
        angle = Vec3(*(by if i == axis else mpf(0) for i in range(3)))
        sine, cosine = mp.sin(by / 2) / by, mp.cos(by / 2)
        turned = angle * (sine * w) + v * cosine + (angle * sine).cross(v)
        new = Quaternion(*turned, w * cosine - (angle * sine).dot(v))
    elif isinstance(part, dict):
        return request | {owner: part | {field: part[field] + by}}
    elif isinstance(value := getattr(part, field), tuple):
        new = type(value)(*(x + by if i == axis else x for i, x in enumerate(value)))
    else:
        new = value + by
    return request | {owner: part._replace(**{field: new})}


def results(request: dict, law: Law) -> list:
    """The differentiated results, in the order of the rows of a Jacobian."""
    model = request["model"]
    settings = Settings(model["tangential_restitution"], mpf(0), mpf(10) ** -13, model["stiffness_ratio"])
    answer = impact(request["body_a"], request["body_b"], request["contact"], law, settings)
    twists = [*answer.report.twist_a, *answer.report.twist_b]
    return [x for v in (*twists, answer.changes.impulse) for x in v]


def by_differences(
    collision,
    law: Law,
    name: str,
    axis: int = 0,
    e_t=0.0,
    stiffness_ratio=1.0,
    step="1e-18",
    digits=60,
    side=0,
):
    """A central difference, or a one-sided one in the direction of the sign ``side``."""
    with mp.workdps(digits):
        contact = collision[2]
        request = {
            "body_a": in_mpf(collision[0]), "body_b": in_mpf(collision[1]),
            "model": {"tangential_restitution": mpf(e_t), "stiffness_ratio": mpf(stiffness_ratio)},
            "contact": Contact(Vec3(*map(mpf, contact.position)), Vec3(*map(mpf, contact.normal)),
                               mpf(contact.restitution), mpf(contact.friction)),
        }  # fmt: skip
        h = mpf(step)
        high, low = (h, -h) if not side else (h * side, mpf(0))
        ends = [results(changed(request, name, axis, x) if x else request, law) for x in (high, low)]
        return [float((a - b) / (high - low)) for a, b in zip(*ends, strict=True)]


def assert_agrees(collision, model: ImpactModel, names=tuple(PARAMETERS), tolerance=1e-10, **how) -> None:
    """Compare the columns of the Jacobian with differences in many digits."""
    found = differentiate(*collision, model, names)
    for name in names:
        if collision[0 if "body_a" in name else 1].mass == math.inf and name.startswith("body"):
            continue
        for axis, column in enumerate(found.jacobian[:, found.columns[name]].T):
            settings = model.tangential_restitution, model.stiffness_ratio
            expected = by_differences(collision, model.law, name, axis, *settings, **how)
            scale = max(1.0, max(map(abs, expected)))
            np.testing.assert_allclose(
                column, expected, rtol=0, atol=tolerance * scale, err_msg=f"{name} {axis}"
            )


def by_differences_of_resolve(collision, model: ImpactModel, name: str, axis: int, step: float) -> np.ndarray:
    """A central difference of order 4 of the answers of ``resolve``."""
    bodies = (
        body._replace(orientation=body.orientation or Quaternion(0.0, 0.0, 0.0, 1.0))
        for body in collision[:2]
    )
    request = dict(zip(("body_a", "body_b", "contact"), (*bodies, collision[2]), strict=True))
    request["model"] = {name: getattr(model, name) for name in ("tangential_restitution", "stiffness_ratio")}

    def after(by: float) -> np.ndarray:
        here = changed(request, name, axis, by)
        turned = (
            here[body]._replace(orientation=Quaternion(*map(float, here[body].orientation)))
            for body in ("body_a", "body_b")
        )
        impact = resolve(*turned, here["contact"], model._replace(**here["model"]))
        return np.concatenate([*impact.twist_a, *impact.twist_b, impact.impulse])

    near, far = (after(k * step) - after(-k * step) for k in (1, 2))
    return (8 * near - far) / (12 * step)
