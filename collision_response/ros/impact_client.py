"""For clients of ``~/resolve_collision``: requests from bodies and a contact, and the twists of a response.

    >>> from collision_response import Body, Contact
    >>> ball = Body.sphere(2.0, 0.1, position=(0, 0, 0.1), velocity=(0, 0, -3))
    >>> request = pack(ball, "floor", Contact.of((0, 0, 0), normal=(0, 0, 1), restitution=0.5))

The node uses the latest state of a body that is given by its name, as the floor here. Send the request with a
client of rclpy.
"""

from __future__ import annotations

from std_msgs.msg import Header

from ..model import ImpactModel
from ..msg import BodyState
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..srv import ResolveCollision
from ..status import format_value
from .convert import contact_message, error_from, model_message, state_message, twist_of
from .tables import as_text


def pack(
    body_a: Body | str,
    body_b: Body | str,
    contact: Contact,
    model: ImpactModel | None = None,
    *,
    frame_id: str = "",
) -> ResolveCollision.Request:
    """Make the request for an impact.

    Args:
        body_a, body_b: the bodies, or their names: then the node uses their latest received states.
        contact: the node chooses a restitution or friction of -1.
        model: what to model. Left out: what the node's parameters say, which also holds for fields of a model
            that are 0, such as the law AUTO.
        frame_id: the inertial frame of the contact and of the bodies.

    Raises:
        ImpactError: if the model is invalid, or a number is beyond float64.
        TypeError: if something has the wrong type.
        ValueError: if a name or ``frame_id`` is not one line of text, or the request has no place for
            something: the tangential restitution of the contact, or a coefficient that is a function.
    """
    wanted = model_message(model)
    if not isinstance(contact, Contact):
        raise TypeError(f"contact: must be a Contact, is {format_value(contact)}")
    header = Header(frame_id=as_text("frame_id", frame_id))
    request = ResolveCollision.Request(contact=contact_message(contact, header), model=wanted)
    request.body_a = _state("body_a", body_a, header)
    request.body_b = _state("body_b", body_b, header)
    return request


def unpack(response: ResolveCollision.Response) -> tuple[Twist, Twist]:
    """Return the twists of body_a and body_b after the impact.

    Raises:
        ImpactError: if the request was refused.
        ValueError: if this version does not know the status code.
    """
    result = response.result
    if not response.success:
        raise error_from(result.status.code, result.status.message)
    return twist_of(result.twist_a), twist_of(result.twist_b)


def _state(field: str, body: Body | str, header: Header) -> BodyState:
    if isinstance(body, str):
        return BodyState(name=as_text(field, body))
    if not isinstance(body, Body):
        raise TypeError(f"{field}: must be a Body or a name, is {format_value(body)}")
    return state_message("", body, header, field)
