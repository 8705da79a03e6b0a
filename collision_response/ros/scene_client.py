"""For clients of ``~/resolve_scene``: requests from bodies and contacts.

    >>> from collision_response import Body, Contact
    >>> ball = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0))
    >>> request = pack([ball, Body.static()], [(0, 1)], [Contact.of((0, 0, 0), (0, 0, 1), 0.5)])

Send the request with a client of rclpy.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..arguments import as_list, check_mapping, is_real
from ..body_numbers import body_to_numbers
from ..model import ImpactModel
from ..physics.body import Body
from ..physics.contact import Contact
from ..scene.request import check_parts
from ..srv import ResolveScene
from ..status import format_value
from .convert import NOT_GIVEN, body_in_floats, contact_in_floats, model_message
from .tables import append, as_indices, as_lines, as_text


def pack(
    bodies: Sequence[Body],
    pairs: Iterable[tuple[int, int]],
    contacts: Sequence[Contact],
    model: ImpactModel | None = None,
    *,
    names: Iterable[str] = (),
    frame_id: str = "",
) -> ResolveScene.Request:
    """Make the request for a scene, with arguments as for :func:`~collision_response.resolve_scene`.

    Args:
        bodies: the bodies that are given in full.
        pairs: for each contact, the indices of its body_a and its body_b. Indices from ``len(bodies)`` on are
            those of the further ``names``.
        contacts: the contacts. The node chooses a restitution or friction of -1.
        model: what to model. Left out: what the node's parameters say, which also holds for fields of a model
            that are 0, such as the law AUTO.
        names: names of ``bodies``, then of further bodies. The node uses their latest received states.
        frame_id: the inertial frame of all bodies and contacts.

    Raises:
        ImpactError: if the model is invalid, or a body is articulated.
        TypeError: if something has the wrong type.
        ValueError: if ``pairs`` is not two indices for each contact, a name is not one line of text, or the
            request has no place for something: the tangential restitution of a contact, or a coefficient
            that is a function.
    """
    wanted = model_message(model)
    bodies, pairs, contacts = check_parts(bodies, pairs, contacts)
    for i, pair in enumerate(pairs):
        if not (hasattr(pair, "__len__") and len(pair) == 2 and all(map(is_real, pair))):
            raise ValueError(f"pairs[{i}]: must be two indices of bodies, is {format_value(pair)}")
    contacts = [contact_in_floats(f"contacts[{i}]", contact) for i, contact in enumerate(contacts)]
    bodies = [body_in_floats(f"bodies[{i}]", body) for i, body in enumerate(bodies)]
    request = ResolveScene.Request(names=as_lines(names), model=wanted)
    request.header.frame_id = as_text("frame_id", frame_id)
    is_immovable = [body.mass == math.inf for body in bodies]  # a NaN mass is not movable either
    columns = [
        body_to_numbers(body._replace(mass=0.0) if fixed else body)
        for body, fixed in zip(bodies, is_immovable, strict=True)
    ]
    append(request.bodies, np.array(columns, float).T)
    request.immovable = [i for i, fixed in enumerate(is_immovable) if fixed]
    append(request.pairs, as_indices(np.array(pairs)).T)
    rows = [
        [*contact.position, *contact.normal, contact.restitution, contact.friction] for contact in contacts
    ]
    append(request.contacts, np.array(rows, float).T)
    return request


class Touch(NamedTuple):
    """A contact of two bodies given by name, as simulators report it, with the position of its point [m].

    The normal points from body_b to body_a and has any length except 0.
    """

    body_a: str
    body_b: str
    position: Sequence[float]
    normal: Sequence[float]


def pack_named(
    touches: Iterable[Touch],
    bodies: Mapping[str, Body] = MappingProxyType({}),
    model: ImpactModel | None = None,
    *,
    restitution: float = NOT_GIVEN,
    friction: float = NOT_GIVEN,
    frame_id: str = "",
) -> ResolveScene.Request:
    """Make the request for a scene whose bodies have names.

    Args:
        touches: the contacts.
        bodies: bodies that are given in full, by their names, such as the ground. For all others the node
            uses the latest states that it has received.
        model: as for :func:`pack`.
        restitution: restitution of all contacts; -1: chosen by the node.
        friction: friction of all contacts; -1: chosen by the node.
        frame_id: the inertial frame of all bodies and contacts.

    Raises:
        TypeError: if something has the wrong type.
        ValueError: as :func:`pack`.
    """
    touches = [_touch(f"touches[{i}]", touch) for i, touch in enumerate(as_list("touches", touches))]
    check_mapping("bodies", bodies)
    names = dict.fromkeys(chain(bodies, *((touch.body_a, touch.body_b) for touch in touches)))
    index = {name: i for i, name in enumerate(names)}
    pairs = [(index[touch.body_a], index[touch.body_b]) for touch in touches]
    contacts = [Contact.of(touch.position, touch.normal, restitution, friction) for touch in touches]
    return pack([*bodies.values()], pairs, contacts, model, names=names, frame_id=frame_id)


def _touch(field: str, given: Any) -> Touch:
    try:
        return Touch(*given)
    except TypeError:
        raise TypeError(f"{field}: must be a Touch, is {format_value(given)}") from None
