"""The service for several contacts at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

from std_msgs.msg import Header

from ..model import ImpactModel
from ..msg import BodyState, SceneResult
from ..msg import Contact as ContactMessage
from ..physics.body import Body
from ..physics.contact import Contact
from ..recording import Recorder, Refusal, SceneRecord
from ..scene import SceneImpact, resolve_scene
from ..srv import ResolveScene
from ..status import ImpactError, StatusCode
from . import convert
from .batch_fields import write_model
from .parameters import LatestParameters, Parameters
from .patience import when_not_too_early
from .request import IN_FULL, Used, age_of, check_age, check_frame, check_world_frame, find, is_name_only
from .results import Results
from .serialized import nanoseconds
from .server import Answer
from .states import LatestStates, quoted

NUMBERS = (
    "kinetic_energy_before",
    "kinetic_energy_after",
    "energy_lost_restitution",
    "energy_lost_friction",
    "error_bound",
    "decision_margin",
)
"""Fields of ``SceneResult`` and of :class:`~collision_response.SceneImpact` alike."""


class Named(NamedTuple):
    """The bodies of a scene.

    Attributes:
        names: of each.
        states: of each.
        used: which state stood for it.
        owners: what errors call it.
    """

    names: list[str]
    states: list[BodyState]
    used: list[Used]
    owners: list[str]


class Touch(NamedTuple):
    """One contact and its two bodies, as a request for one impact has them."""

    contact: ContactMessage
    body_a: BodyState
    body_b: BodyState


class Scene(NamedTuple):
    """A request in the terms of the numeric core."""

    bodies: list[Body]
    pairs: list[tuple[int, int]]
    contacts: list[Contact]
    model: ImpactModel


class Scenes:
    """Answers requests; publishes and records the answers, refusals included.

    Attributes:
        recorder: may be set; ``None``: nothing is recorded.

    Args:
        parameters: of the node.
        states: of the bodies that it has heard of.
        results: where answers are published.
        now: the time by the node's clock [ns].
        sequence: counts the answers of the node.
    """

    interface = ResolveScene
    name = "~/resolve_scene"

    def __init__(
        self,
        parameters: LatestParameters,
        states: LatestStates,
        results: Results,
        now: Callable[[], int],
        sequence: Iterator[int],
    ) -> None:
        self.recorder: Recorder | None = None
        self._parameters = parameters
        self._states = states
        self._results = results
        self._now = now
        self._numbers = sequence
        self._sequence = 0

    def answer(self, request: ResolveScene.Request) -> Answer:
        """The work for a request."""
        current = self._parameters.values
        check_size(request, current.budget_scene_contacts)
        named = yield from when_not_too_early(
            partial(bodies_of, request, self._states, current, self._now), current.max_state_wait
        )
        scene = scene_of(request, named, current)
        try:
            impact = resolve_scene(*scene)
        except ImpactError as error:
            raise as_in_request(error, named) from None
        response = ResolveScene.Response(success=True)
        write_answer(response.result, request, named, impact)
        self._publish(response.result)
        if self.recorder is not None:
            stamp = nanoseconds(response.result.header.stamp) or self._now()
            self.recorder.add(
                SceneRecord(stamp, self._sequence, named.names, scene.bodies, scene.pairs, impact)
            )
        return response

    def refusal(self, request: ResolveScene.Request, error: ImpactError) -> ResolveScene.Response:
        """The response that says why there is no answer; contacts and model are those of the request."""
        response = ResolveScene.Response()
        result = response.result
        result.header, result.contacts, result.model = header_of(request), request.contacts, request.model
        result.error_bound = -1.0
        result.status.code, result.status.message = int(error.code), convert.as_in_message(error)
        self._publish(result)
        if self.recorder is not None:
            stamp = nanoseconds(result.header.stamp) or self._now()
            text = f"{error.code.name}: {result.status.message}"
            self.recorder.add(Refusal(stamp, self._sequence, text))
        return response

    def code(self, response: ResolveScene.Response) -> StatusCode:
        """How the request ended."""
        return StatusCode(response.result.status.code)

    def _publish(self, result: SceneResult) -> None:
        self._sequence = next(self._numbers)
        result.sequence = self._sequence
        self._results.publish(result)


def check_size(request: ResolveScene.Request, most: int) -> None:
    """Raises: ImpactError: BUDGET_EXCEEDED."""
    if len(request.contacts) > most:
        reason = f"are {len(request.contacts)}; budget.scene_contacts is {most}"
        raise ImpactError(StatusCode.BUDGET_EXCEEDED, "contacts", reason)


def header_of(request: ResolveScene.Request) -> Header:
    """The header of the first contact."""
    return request.contacts[0].header if request.contacts else Header()


def bodies_of(
    request: ResolveScene.Request, states: LatestStates, parameters: Parameters, now: Callable[[], int]
) -> Named:
    """The bodies of a request, then those that its contacts name besides.

    Raises:
        TooEarly: a state is older than ``not_before``, or unknown.
        ImpactError: SAME_BODY, UNKNOWN_BODY, STALE_STATE or FRAME_MISMATCH.
    """
    header = header_of(request)
    time, not_before = nanoseconds(header.stamp) or now(), nanoseconds(request.not_before)
    check_world_frame("contacts[0].header.frame_id", header.frame_id, parameters.world_frame)
    wanted = _bodies_and_names(request)
    named = Named([], [], [], [])
    for owner, field, state in wanted:
        used = IN_FULL
        if is_name_only(state):
            known = find(states, owner, field, state.name, not_before)
            used = Used(known.state.header.stamp, age_of(known, time))
            check_age(owner, state.name, used.age, parameters.max_state_age)
            state = known.state
        check_frame(f"{owner}.header.frame_id", state, "contacts[0].header.frame_id", header.frame_id)
        named.names.append(state.name)
        named.states.append(state)
        named.used.append(used)
        named.owners.append(owner)
    return named


def _bodies_and_names(request: ResolveScene.Request) -> list[tuple[str, str, BodyState]]:
    """Every body once: what errors call it, and its name; and the body, of which there may be only the name.

    Raises:
        ImpactError: SAME_BODY or UNKNOWN_BODY.
    """
    wanted: dict[str, tuple[str, str, BodyState]] = {}
    for i, state in enumerate(request.bodies):
        owner = f"bodies[{i}]"
        if not state.name:
            raise ImpactError(StatusCode.UNKNOWN_BODY, f"{owner}.name", "is empty: contacts go by names")
        if state.name in wanted:
            reason = f"is {quoted(state.name)}, as {wanted[state.name][1]}: a body is given once"
            raise ImpactError(StatusCode.SAME_BODY, f"{owner}.name", reason)
        wanted[state.name] = owner, f"{owner}.name", state
    for i, contact in enumerate(request.contacts):
        for end in ("body_a", "body_b"):
            name, field = getattr(contact, end), f"contacts[{i}].{end}"
            if not name:
                raise ImpactError(StatusCode.UNKNOWN_BODY, field, "is empty: a contact names its bodies")
            wanted.setdefault(name, (field, field, BodyState(name=name)))
    return list(wanted.values())


def scene_of(request: ResolveScene.Request, named: Named, parameters: Parameters) -> Scene:
    """What a request asks for, in the terms of the numeric core.

    Raises:
        ImpactError: it cannot be put to it.
    """
    bodies = [convert.body_of(owner, state) for owner, state in zip(named.owners, named.states, strict=True)]
    index = {name: i for i, name in enumerate(named.names)}
    pairs, contacts = [], []
    frame = header_of(request).frame_id
    for i, message in enumerate(request.contacts):
        check_frame(f"contacts[{i}].header.frame_id", message, "contacts[0].header.frame_id", frame)
        pair = index[message.body_a], index[message.body_b]
        touch = Touch(message, *(named.states[place] for place in pair))
        try:
            contacts.append(convert.contact_of(touch, parameters))
        except ImpactError as error:
            places = {"contact": f"contacts[{i}]"}
            places |= {
                end: named.owners[place] for end, place in zip(("body_a", "body_b"), pair, strict=True)
            }
            owner, _, field = error.field.partition(".")
            raise ImpactError(error.code, f"{places[owner]}.{field}", error.reason) from None
        pairs.append(pair)
    return Scene(bodies, pairs, contacts, convert.model_of(request.model, parameters.model))


def as_in_request(error: ImpactError, named: Named) -> ImpactError:
    """An error of the numeric core, its field named as the request names it."""
    owner, _, field = error.field.partition(".")
    if owner.startswith("bodies["):
        owner = named.owners[int(owner[len("bodies[") : -1])]
        head, dot, rest = field.partition(".")
        field = f"{convert.CORE_TO_MESSAGE.get(head, head)}{dot}{rest}"
    if owner.startswith("pairs["):
        owner = f"contacts[{owner[len('pairs[') : -1]}]"
    return ImpactError(error.code, f"{owner}.{field}" if field else owner, error.reason)


def write_answer(
    result: SceneResult, request: ResolveScene.Request, named: Named, impact: SceneImpact
) -> None:
    """Fill in a result from what the core answered."""
    result.header = header_of(request)
    result.status.code = int(impact.status)
    result.status.message = "; ".join(convert.notes(impact))
    result.contacts = request.contacts
    for message, contact in zip(result.contacts, impact.contacts, strict=True):
        message.restitution, message.friction = float(contact.restitution), contact.friction
    write_model(result.model, impact.model)
    result.body_names = named.names
    result.state_stamps = [used.stamp for used in named.used]
    result.state_ages = [used.age for used in named.used]
    result.twists = [convert.twist_message(twist) for twist in impact.twists]
    result.impulses = [convert.vector_message(impulse) for impulse in impact.impulses]
    result.normal_velocities_before = list(impact.normal_velocities_before)
    result.normal_velocities_after = list(impact.normal_velocities_after)
    result.regimes = [int(regime) for regime in impact.regimes]
    result.clusters = _cluster_of_each(impact.clusters, len(impact.contacts))
    for field in NUMBERS:
        setattr(result, field, float(getattr(impact, field)))
    result.adjustments = int(impact.adjustments)


def _cluster_of_each(clusters: Sequence[Sequence[int]], n: int) -> list[int]:
    of = [0] * n
    for number, cluster in enumerate(clusters):
        for contact in cluster:
            of[contact] = number
    return of
