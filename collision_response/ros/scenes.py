"""The service for several contacts at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..body_conversions import ROWS, body_from_numbers
from ..model import ImpactModel
from ..msg import BodyState, SceneResult
from ..msg import Contact as ContactMessage
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law
from ..recording import SceneRecord
from ..scene import SceneImpact, resolve_scene
from ..scene.answer import NUMBERS
from ..srv import ResolveScene
from ..status import ImpactError, StatusCode
from . import convert
from .batch_fields import names_in, write_model
from .journal import Journal
from .parameters import LatestParameters, Parameters
from .patience import TOGETHER, Look, when_not_too_early
from .request import (
    IN_FULL,
    Used,
    check_age,
    check_distinct,
    check_frame,
    check_immovable,
    check_world_frame,
    find,
)
from .serialized import nanoseconds
from .server import Work
from .states import LatestStates

CONTACT_ROWS = ("x", "y", "z", "nx", "ny", "nz", "e", "mu")
"""Of ``ResolveScene.contacts``."""

MOST_BODIES = 8192
"""Bodies of a scene, which are computed in one piece: as many as contacts can strike where
``budget.scene_contacts`` is as great as it may be."""


class SceneBodies(NamedTuple):
    """The bodies of a scene, those of the table first.

    Attributes:
        names: of each.
        columns: of those of the table.
        states: of each.
        used: which state stood for it.
        owners: what errors call it.
    """

    names: list[str]
    columns: list[list[float]]
    states: list[BodyState]
    used: list[Used]
    owners: list[str]


IN_TABLE = BodyState()
"""The state of a body of the table: it says neither material nor coefficients."""


class ContactOfBodies(NamedTuple):
    """One contact and its two bodies, as a request for one impact has them."""

    contact: ContactMessage
    body_a: BodyState
    body_b: BodyState


class SceneProblem(NamedTuple):
    """A request in the terms of the numeric core, and where its coefficients came from."""

    bodies: list[Body]
    pairs: list[tuple[int, int]]
    contacts: list[Contact]
    model: ImpactModel
    coefficients: list[convert.FilledIn]


@dataclass
class Scenes:
    """Answers requests.

    Attributes:
        parameters: of the node.
        states: of the bodies that it has heard of.
        journal: of the answers.
        now: the time by the node's clock [ns].
    """

    interface = ResolveScene
    name = "~/resolve_scene"
    parameters: LatestParameters
    states: LatestStates
    journal: Journal
    now: Callable[[], int]

    def answer(self, request: ResolveScene.Request) -> Work:
        """The work for a request."""
        current = self.parameters.values
        contacts = contacts_of(request, current.budget_scene_contacts)
        named = yield from when_not_too_early(
            partial(bodies_of, request, self.states, current, self.now), current.max_state_wait
        )
        scene = yield from scene_of(request, contacts, named, current)
        try:
            impact = resolve_scene(*scene[:4])
        except ImpactError as error:
            raise as_in_request(error, named) from None
        response = ResolveScene.Response(success=True)
        write_answer(response.result, request, contacts, named, scene, impact)
        self.journal.enter(
            response.result, lambda stamp, number: SceneRecord(stamp, number, named.names, *scene[:4], impact)
        )
        return response

    def refusal(self, request: ResolveScene.Request, error: ImpactError) -> ResolveScene.Response:
        """The response that says why there is no answer; its model is that of the request."""
        response = ResolveScene.Response()
        response.result.header = request.header
        convert.write_refusal(response.result, request.model, error)
        self.journal.refuse(response.result, error.code)
        return response

    def code(self, response: ResolveScene.Response) -> StatusCode:
        """How the request ended."""
        return StatusCode(response.result.status.code)


def table_of(field: str, numbers: Any, rows: int) -> Any:
    """A field as a table of so many rows.

    Raises:
        ImpactError: INVALID_TABLE.
    """
    numbers = np.asarray(numbers)
    if numbers.size % rows:
        reason = f"must hold {rows} rows, all of one length; holds {numbers.size} numbers"
        raise ImpactError(StatusCode.INVALID_TABLE, field, reason)
    return numbers.reshape(rows, -1)


def contacts_of(request: ResolveScene.Request, most: int) -> list[ContactMessage]:
    """The contacts as messages.

    Raises:
        ImpactError: INVALID_TABLE, or BUDGET_EXCEEDED for more than ``most``.
    """
    table = table_of("contacts", request.contacts, len(CONTACT_ROWS))
    if table.shape[1] > most:
        reason = f"are {table.shape[1]}; budget.scene_contacts is {most}"
        raise ImpactError(StatusCode.BUDGET_EXCEEDED, "contacts", reason)
    if len(request.pairs) != 2 * table.shape[1]:
        reason = (
            f"must hold two indices for each of {table.shape[1]} contacts, holds {len(request.pairs)} in all"
        )
        raise ImpactError(StatusCode.INVALID_TABLE, "pairs", reason)
    messages = []
    for x, y, z, nx, ny, nz, restitution, friction in table.T.tolist():
        message = ContactMessage(header=request.header, restitution=restitution, friction=friction)
        message.position.x, message.position.y, message.position.z = x, y, z
        message.normal.x, message.normal.y, message.normal.z = nx, ny, nz
        messages.append(message)
    return messages


def bodies_of(
    request: ResolveScene.Request, states: LatestStates, parameters: Parameters, now: Callable[[], int]
) -> Look[SceneBodies]:
    """The bodies of the table, then those of which a state was received.

    Raises:
        TooEarly: a state is older than ``not_before``, or unknown.
        ImpactError: INVALID_TABLE, BUDGET_EXCEEDED for more than ``MOST_BODIES``, SAME_BODY,
            UNKNOWN_BODY, STALE_STATE or FRAME_MISMATCH.
    """
    header = request.header
    check_world_frame("header.frame_id", header.frame_id, parameters.world_frame)
    table = table_of("bodies", request.bodies, ROWS)
    count = table.shape[1]
    given = names_in(request)
    if max(count, len(given)) > MOST_BODIES:
        reason = f"has {max(count, len(given))}; a scene may have {MOST_BODIES}"
        raise ImpactError(StatusCode.BUDGET_EXCEEDED, "bodies", reason)
    names = given or [f"body {i}" for i in range(count)]
    if len(names) < count:
        reason = f"must be empty, or a line for each of {count} bodies and more; has {len(names)}"
        raise ImpactError(StatusCode.INVALID_TABLE, "names", reason)
    check_distinct(names)
    check_immovable(request.immovable, count)
    owners = [f"bodies[{i}]" for i in range(count)]
    named = SceneBodies(names, table.T.tolist(), [IN_TABLE] * count, [IN_FULL] * count, owners)
    time, not_before = nanoseconds(header.stamp) or now(), nanoseconds(request.not_before)
    for i, name in enumerate(names[count:], count):
        if not i % TOGETHER:
            yield
        owner = f"names[{i}]"
        state = find(states, owner, owner, name, not_before)
        used = Used.of(state, time)
        check_age(owner, name, used.age, parameters.max_state_age)
        check_frame(f"{owner}.header.frame_id", state, "header.frame_id", header.frame_id)
        named.states.append(state)
        named.used.append(used)
        named.owners.append(owner)
    return named


def scene_of(
    request: ResolveScene.Request, messages: list[ContactMessage], named: SceneBodies, parameters: Parameters
) -> Look[SceneProblem]:
    """What a request asks for, in the terms of the numeric core.

    Args:
        request: for what of it is immovable, its pairs and its model.
        messages: its contacts; the names of their bodies are filled in.
        named: its bodies.
        parameters: of the node.

    Raises:
        ImpactError: it cannot be put to it.
    """
    immovable, count = set(request.immovable), len(named.columns)
    bodies: list[Body] = []
    for i, owner in enumerate(named.owners):
        if not i % TOGETHER:
            yield
        if i < count:
            bodies.append(_body_in_table(owner, named.columns[i], is_immovable=i in immovable))
        else:
            bodies.append(convert.body_of(owner, named.states[i]))
    of_a, of_b = np.asarray(request.pairs).reshape(2, -1).tolist()
    model, given = convert.model_of(request.model, parameters.model), request.model
    pairs, contacts, coefficients = list(zip(of_a, of_b, strict=True)), [], []
    for i, (pair, message) in enumerate(zip(pairs, messages, strict=True)):
        if max(pair) >= len(bodies):
            reason = f"must be indices of {len(bodies)} bodies, from 0; those of contact {i} are {pair}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, "pairs", reason)
        message.body_a, message.body_b = (named.names[place] for place in pair)
        touch = ContactOfBodies(message, *(named.states[place] for place in pair))
        places = {
            "contact": f"contacts[{i}]",
            "body_a": named.owners[pair[0]],
            "body_b": named.owners[pair[1]],
        }
        try:
            found = convert.coefficients_of(touch, parameters)
            own = None if given.tangential_restitution else found.pair.tangential_restitution
            contacts.append(convert.contact_with(message, found, model.law, own))
        except ImpactError as error:
            raise error.with_owner(places[error.field.partition(".")[0]]) from None
        ratio = found.pair.stiffness_ratio
        if model.law is Law.COMPLIANT and not given.stiffness_ratio and ratio is not None:
            reason = f"must be given in a scene: contacts[{i}] has {ratio} by its materials"
            raise ImpactError(StatusCode.INVALID_MODEL, "model.stiffness_ratio", reason)
        coefficients.append(found)
    return SceneProblem(bodies, pairs, contacts, model, coefficients)


def _body_in_table(owner: str, column: list[float], *, is_immovable: bool) -> Body:
    body = body_from_numbers(column)
    if is_immovable:
        still = Body.kinematic(body.position, body.velocity, body.angular_velocity)
        return still._replace(orientation=body.orientation)
    convert.check_mass(owner, body.mass)
    return body


def as_in_request(error: ImpactError, named: SceneBodies) -> ImpactError:
    """An error of the numeric core, the body or the contact named as the request names it."""
    owner = error.field.partition(".")[0]
    if owner.startswith("bodies["):
        return error.with_owner(named.owners[int(owner[len("bodies[") : -1])])
    if owner.startswith("pairs["):  # of one contact
        return error.with_owner(owner.replace("pairs", "contacts"))
    return error


def write_answer(
    result: SceneResult,
    request: ResolveScene.Request,
    contacts: list[ContactMessage],
    named: SceneBodies,
    scene: SceneProblem,
    impact: SceneImpact,
) -> None:
    """Fill in a result from what the core answered."""
    result.header = request.header
    result.status.code = int(impact.status)
    result.status.message = "; ".join(convert.notes(impact))
    result.contacts = contacts
    for message, contact in zip(result.contacts, impact.contacts, strict=True):
        message.restitution, message.friction = float(contact.restitution), contact.friction
    result.restitution_from, result.restitution_rules = _sources(of.restitution for of in scene.coefficients)
    result.friction_from, result.friction_rules = _sources(of.friction for of in scene.coefficients)
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


def _sources(filled: Iterable[convert.Filled]) -> tuple[list[int], list[str]]:
    """Where each coefficient is from, and by which rule."""
    some = list(filled)
    return [int(one.source) for one in some], [one.rule for one in some]


def _cluster_of_each(clusters: Sequence[Sequence[int]], n: int) -> list[int]:
    of = [0] * n
    for number, cluster in enumerate(clusters):
        for contact in cluster:
            of[contact] = number
    return of
