"""Node that publishes the results of the service as markers for RViz and Foxglove, and as wrenches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import count, pairwise
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, WrenchStamped
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from ..msg import CollisionResult, SceneResult
from ..physics.vector import Vec3
from ..recording import colours
from ..status import StatusCode
from .convert import vector_message, vector_of
from .parameters import Declaration, DeclaringNode, declare, warn_of_unknown
from .process import run
from .throttled_warnings import WARNING_INTERVAL

DECLARATIONS = (
    Declaration("metres_per_newton_second", 0.1, "Length of the arrow of an impulse [m/(N s)].", 1e-9, 1e9),
    Declaration(
        "size", 0.1, "Length of the arrow of a normal [m]. Points and shafts are scaled with it.", 1e-9, 1e9
    ),
    Declaration("lifetime", 1.0, "How long an impact is shown [s]. 0: forever.", most=1e9),
    Declaration(
        "contact_duration",
        1.0,
        "Time [s] by which an impulse is divided to give a wrench. 1: the numbers are those of the impulse.",
        1e-9,
        1e9,
    ),
)

ANSWERS = {int(code) for code in StatusCode if code.is_answer}

RED, GREY, GREEN, VIOLET = (
    ColorRGBA(r=r / 255, g=g / 255, b=b / 255, a=a)
    for (r, g, b), a in ((colours.RED, 1.0), (colours.GREY, 1.0), (colours.GREEN, 1.0), (colours.VIOLET, 0.3))
)

FULL_CIRCLE = np.linspace(0.0, 2 * np.pi, 33)


class Drawing(NamedTuple):
    """How impacts are drawn: the values of the parameters of the same names."""

    metres_per_newton_second: float
    size: float
    lifetime: float


class DrawnContact(NamedTuple):
    """A contact as it is drawn; ``normal`` is of length 1."""

    position: Vec3
    normal: Vec3
    friction: float
    impulse: Vec3


def contacts_of(result: CollisionResult | SceneResult) -> list[DrawnContact]:
    """Contacts of an answer.

    A refusal has none. Contacts with a normal of length 0, or with numbers that are not finite, are left out:
    the service does not answer with such contacts, but other publishers may.
    """
    if result.status.code not in ANSWERS:
        return []
    if isinstance(result, CollisionResult):
        pairs = [(result.contact, result.impulse)]
    else:
        pairs = list(zip(result.contacts, result.impulses, strict=False))
    return [contact for pair in pairs if (contact := _drawn_contact(*pair)) is not None]


def markers_of(
    header: Any, contacts: Sequence[DrawnContact], drawing: Drawing, numbers: Iterator[int]
) -> MarkerArray:
    """Make a point, two arrows and a friction cone for each contact.

    The cone holds the directions that friction allows for the impulse. Its edge is as long as the impulse, so
    the impulse of a sliding contact ends on its rim. There is no cone without friction or impulse. Markers
    that would reach beyond float64 are left out. The markers of each contact have the next of ``numbers`` as
    their id.
    """
    array = MarkerArray()
    shown = max(1, round(drawing.lifetime * 1e9)) if drawing.lifetime else 0  # [ns]; 0: forever
    seconds, nanoseconds = divmod(shown, 10**9)
    for contact in contacts:
        number = next(numbers) % 2**31
        with np.errstate(over="ignore", invalid="ignore"):
            shapes = [*_shapes(contact, drawing)]
        for namespace, kind, colour, scale, points in shapes:
            if not np.isfinite(points).all():
                continue
            marker = Marker(header=header, ns=namespace, id=number, type=kind, color=colour)
            marker.points = [Point(x=x, y=y, z=z) for x, y, z in np.array(points).tolist()]
            marker.scale.x, marker.scale.y, marker.scale.z = scale
            marker.pose.orientation.w = 1.0
            marker.lifetime = Duration(sec=seconds, nanosec=nanoseconds)
            array.markers.append(marker)
    return array


def wrench_of(header: Any, contact: DrawnContact, contact_duration: float) -> WrenchStamped:
    """Mean force [N] on body_a during the impact, and its moment about the origin of the frame [N m].

    They are ``P/T`` and ``x cross P/T`` for an impulse ``P`` at ``x`` and a duration ``T`` [s].
    """
    wrench = WrenchStamped(header=header)
    wrench.wrench.force = vector_message(contact.impulse / contact_duration)
    wrench.wrench.torque = vector_message(contact.position.cross(contact.impulse) / contact_duration)
    return wrench


def _is_finite(wrench: WrenchStamped) -> bool:
    parts = wrench.wrench.force, wrench.wrench.torque
    return all(math.isfinite(x) for part in parts for x in vector_of(part))


def _drawn_contact(contact: Any, impulse: Any) -> DrawnContact | None:
    x, n, p = map(vector_of, (contact.position, contact.normal, impulse))
    if not all(map(math.isfinite, (*x, *n, *p))) or not any(n):
        return None
    n = n / max(map(abs, n))  # so that the squares in its norm neither overflow nor vanish
    return DrawnContact(x, n / n.norm(), contact.friction, p)


def _shapes(contact: DrawnContact, drawing: Drawing) -> Iterator[tuple[str, int, ColorRGBA, Any, Any]]:
    """Namespace, type, colour, scale and points of each marker."""
    size, tip = drawing.size, contact.impulse * drawing.metres_per_newton_second
    shaft = (size / 10, size / 5, 0.0)
    here = np.array(contact.position)
    yield "point", Marker.SPHERE_LIST, RED, (size / 5,) * 3, [here]
    yield "normal", Marker.ARROW, GREY, shaft, [here, here + size * np.array(contact.normal)]
    length = math.hypot(*tip)
    if not length:
        return
    yield "impulse", Marker.ARROW, GREEN, shaft, [here, here + np.array(tip)]
    if contact.friction > 0:
        rim = here + length * _rim(np.array(contact.normal), math.atan(contact.friction))
        corners = [corner for a, b in pairwise(rim) for corner in (here, a, b)]
        yield "friction cone", Marker.TRIANGLE_LIST, VIOLET, (1.0, 1.0, 1.0), corners


def _rim(normal: Any, angle: float) -> Any:
    """Unit vectors at an angle to the normal, evenly spaced around it."""
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    circle = np.outer(np.cos(FULL_CIRCLE), across) + np.outer(np.sin(FULL_CIRCLE), np.cross(normal, across))
    return math.cos(angle) * normal + math.sin(angle) * circle


class ContactMarkers(DeclaringNode):
    """Publishes markers and wrenches for the answers of the service.

    Interfaces (all may be remapped):
        subscriptions ``collision_response/result`` and ``collision_response/scene_result``.
        publisher ``collision_response/markers``: every contact of every answer.
        publisher ``collision_response/wrench``: the wrench on body_a of every single impact.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("collision_response_markers", **options)
        warn_of_unknown(self, declare(self, DECLARATIONS))
        self._numbers = count()
        self._markers = self.create_publisher(MarkerArray, "collision_response/markers", 100)
        self._wrenches = self.create_publisher(WrenchStamped, "collision_response/wrench", 100)
        results = [
            self.create_subscription(kind, topic, self._show, 100).topic_name
            for kind, topic in (
                (CollisionResult, "collision_response/result"),
                (SceneResult, "collision_response/scene_result"),
            )
        ]
        self.get_logger().info(
            f"showing {', '.join(results)} as markers on {self._markers.topic_name} "
            f"and wrenches on {self._wrenches.topic_name}"
        )

    def _show(self, result: CollisionResult | SceneResult) -> None:
        contacts = contacts_of(result)
        if not contacts:
            return
        drawing = Drawing(*(self.get_parameter(name).value for name in Drawing._fields))
        self._markers.publish(markers_of(result.header, contacts, drawing, self._numbers))
        if isinstance(result, CollisionResult):
            duration = self.get_parameter("contact_duration").value
            wrench = wrench_of(result.header, contacts[0], duration)
            if _is_finite(wrench):
                self._wrenches.publish(wrench)
            else:
                self.get_logger().warning(
                    "a wrench beyond float64 is not published: see contact_duration",
                    throttle_duration_sec=WARNING_INTERVAL,
                )


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM, and return the exit code."""
    return run(ContactMarkers, args)
