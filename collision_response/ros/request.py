"""What must hold of a request before its numbers matter: names, look-up, age, frames."""

from __future__ import annotations

from collections.abc import Callable

from ..msg import BodyState
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from .parameters import Parameters
from .states import LatestStates, check_age


def complete(
    request: ResolveCollision.Request, states: LatestStates, parameters: Parameters, now: Callable[[], int]
) -> None:
    """Replace the bodies that are given by name only, and check that the parts belong together.

    Args:
        request: changed in place.
        states: the latest states received.
        parameters: of the node.
        now: the time by the node's clock [ns]; reading it is not free, and rarely needed.

    Raises:
        ImpactError: SAME_BODY, UNKNOWN_BODY, STALE_STATE or FRAME_MISMATCH.
    """
    check_names(request)
    for owner in ("body_a", "body_b"):
        given = getattr(request, owner)
        if is_name_only(given):
            state = states.find(owner, given.name)
            if parameters.max_state_age:
                check_age(owner, state, now(), parameters.max_state_age)
            setattr(request, owner, state)
    check_frames(request, parameters.world_frame)


def is_name_only(body: BodyState) -> bool:
    """Whether a body has a name, and every other field as constructed."""
    if not body.name or body.inertia.m or body.motion_type:
        return False  # most bodies given in full; the comparison below takes ten times as long
    return body == BodyState(name=body.name)


def check_names(request: ResolveCollision.Request) -> None:
    """Raises: ImpactError: UNKNOWN_BODY or SAME_BODY."""
    names = []
    for owner in ("body_a", "body_b"):
        own, in_contact = getattr(request, owner).name, getattr(request.contact, owner)
        if own and in_contact and own != in_contact:
            reason = f"is {in_contact!r}, but {owner}.name is {own!r}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, f"contact.{owner}", reason)
        names.append(own or in_contact)
    if names[0] and names[0] == names[1]:
        reason = f"is {names[1]!r}, as that of body_a: a body cannot strike itself"
        raise ImpactError(StatusCode.SAME_BODY, "body_b.name", reason)


def check_frames(request: ResolveCollision.Request, world_frame: str) -> None:
    """Raises: ImpactError: FRAME_MISMATCH."""
    frame = request.contact.header.frame_id
    if world_frame and frame != world_frame:
        reason = f"is {frame!r}, but the parameter world_frame is {world_frame!r}"
        raise ImpactError(StatusCode.FRAME_MISMATCH, "contact.header.frame_id", reason)
    for owner in ("body_a", "body_b"):
        own = getattr(request, owner).header.frame_id
        if own != frame:
            reason = f"is {own!r}, but contact.header.frame_id is {frame!r}"
            raise ImpactError(StatusCode.FRAME_MISMATCH, f"{owner}.header.frame_id", reason)
