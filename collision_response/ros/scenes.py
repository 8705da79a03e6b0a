"""The service for several contacts at once."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from ..body_numbers import ROWS, body_from_numbers
from ..model import ImpactModel
from ..msg import BodyState, SceneResult
from ..msg import Contact as ContactMessage
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law
from ..recording import SceneRecord
from ..scene import SceneImpact, resolve_scene
from ..scene.answer import NUMBERS
from ..scene.resolve_scene import resolve_without_python
from ..srv import ResolveScene
from ..status import ImpactError, StatusCode
from . import convert
from .answer_log import AnswerLog
from .body_lookup import BODIES_PER_STEP, StateFinder, check_immovable, check_names, check_texts
from .parameters import LatestParameters, Parameters
from .round_robin import TIME_SLICE, Steps
from .states import LatestStates
from .tables import names_in, number_of_names, table_in

CONTACT_ROWS = ("x", "y", "z", "nx", "ny", "nz", "e", "mu")
"""Rows of ``ResolveScene.contacts``."""

MAX_AT_ONCE = 4
"""Most contacts of a scene that is computed at once if the kernels can: another thread would take longer to
begin and to end. What the kernels leave to Python may take a second."""

MAX_BODIES = 8192
"""Most bodies in a scene, which are converted without a budget of their own: as many as the contacts can have
if ``budget.scene_contacts`` has its greatest value."""


IN_TABLE = BodyState()
"""State of a body of the table, which has no stamp, material or coefficients."""


class SceneBody(NamedTuple):
    """A body as the numeric core takes it, and its state with its age [s]. Errors call the body ``owner``."""

    name: str
    owner: str
    body: Body
    state: BodyState
    age: float


SceneProblem = tuple[list[Body], list[tuple[int, int]], list[Contact], ImpactModel]
"""A request as the numeric core takes it: the arguments of :func:`~collision_response.resolve_scene`."""


THREAD = "scenes"
"""How the names of threads that compute scenes begin."""


def _start_thread() -> ThreadPoolExecutor:
    """Return an executor whose thread runs, so that none needs to start when memory is short."""
    executor = ThreadPoolExecutor(1, THREAD)
    executor.submit(int).result()
    return executor


@dataclass
class SceneService:
    """Answers ``~/resolve_scene``. Another thread computes what may take long: some scenes take seconds."""

    interface = ResolveScene
    name = "~/resolve_scene"
    has_budget = False
    parameters: LatestParameters
    states: LatestStates
    answer_log: AnswerLog
    _executor: ThreadPoolExecutor = field(init=False, default_factory=_start_thread)

    def answer(self, request: ResolveScene.Request) -> Steps[tuple[StatusCode, ResolveScene.Response]]:
        """Compute the response to a request, in steps."""
        parameters = self.parameters.values
        check_texts(request, ["header.frame_id"])
        finder = StateFinder("header", request.header, request.not_before, self.states, parameters)
        contacts = contacts_of(request, parameters.budget_scene_contacts)
        bodies = yield from finder.wait(partial(bodies_of, request, finder))
        problem, coefficients = problem_of(request, contacts, bodies, parameters)

        try:
            impact = yield from self._compute(problem)
        except ImpactError as error:  # pairs[i] is what the core calls contact i
            owners = {f"bodies[{i}]": body.owner for i, body in enumerate(bodies)}
            raise error.renamed({"pairs": "contacts", **owners}) from None

        response = ResolveScene.Response(success=True)
        write_answer(response.result, request, contacts, bodies, coefficients, impact)
        names = [body.name for body in bodies]
        self.answer_log.add(
            response.result, lambda stamp, sequence: SceneRecord(stamp, sequence, names, *problem, impact)
        )
        return impact.status, response

    def _compute(self, problem: SceneProblem) -> Steps[SceneImpact]:
        _, _, contacts, _ = problem
        at_once = resolve_without_python(*problem) if len(contacts) <= MAX_AT_ONCE else None
        if at_once is not None:
            return at_once
        future = self._executor.submit(resolve_scene, *problem)
        if not wait([future], TIME_SLICE).done:
            yield future
        return future.result()

    def refusal(self, request: ResolveScene.Request, error: ImpactError) -> ResolveScene.Response:
        """Return the response that says why there is no answer, with the model of the request."""
        response = ResolveScene.Response()
        response.result.header = request.header
        convert.write_refusal(response.result, request.model, error)
        self.answer_log.add_refusal(response.result)
        return response

    def close(self) -> None:
        """Compute no more scenes. The thread ends with the scene that it computes: nothing stops that."""
        self._executor.shutdown(wait=False, cancel_futures=True)


def contacts_of(request: ResolveScene.Request, max_contacts: int) -> list[ContactMessage]:
    """Make a message of each contact of a request.

    Raises:
        ImpactError: INVALID_TABLE if contacts or pairs are incomplete; BUDGET_EXCEEDED.
    """
    table = table_in("contacts", request.contacts, len(CONTACT_ROWS))
    count = table.shape[1]
    if count > max_contacts:
        reason = f"has {count} contacts; budget.scene_contacts is {max_contacts}"
        raise ImpactError(StatusCode.BUDGET_EXCEEDED, "contacts", reason)
    if len(request.pairs) != 2 * count:
        reason = f"must hold two indices for each of {count} contacts, holds {len(request.pairs)} in all"
        raise ImpactError(StatusCode.INVALID_TABLE, "pairs", reason)
    messages = []
    for x, y, z, nx, ny, nz, restitution, friction in table.T.tolist():
        message = ContactMessage(header=request.header, restitution=restitution, friction=friction)
        convert.write_vector(message.position, (x, y, z))
        convert.write_vector(message.normal, (nx, ny, nz))
        messages.append(message)
    return messages


def bodies_of(request: ResolveScene.Request, finder: StateFinder) -> Steps[list[SceneBody]]:
    """Collect the bodies of a request: those of the table, then the latest states of those given by name.

    Raises:
        ImpactError: INVALID_TABLE if the table is incomplete, or does not fit the names or ``immovable``;
            BUDGET_EXCEEDED; as ``check_names``, as ``find`` and ``check`` of the finder, and as ``body_of``.
    """
    table = table_in("bodies", request.bodies, ROWS)
    count = table.shape[1]
    for holder, number in (("bodies", count), ("names", number_of_names(request))):
        if number > MAX_BODIES:
            reason = f"has {number}; a scene may have {MAX_BODIES}"
            raise ImpactError(StatusCode.BUDGET_EXCEEDED, holder, reason)
    names = names_in(request) or [f"body {i}" for i in range(count)]
    if len(names) < count:
        reason = f"must be empty, or have a line for each of the {count} bodies at least; has {len(names)}"
        raise ImpactError(StatusCode.INVALID_TABLE, "names", reason)
    check_names(names)
    check_immovable(request.immovable, count)
    columns, immovable = table.T.tolist(), np.zeros(count, bool)
    immovable[np.asarray(request.immovable)] = True
    bodies: list[SceneBody] = []
    for i, name in enumerate(names):
        if not i % BODIES_PER_STEP:
            yield None
        if i < count:
            owner, state, age = f"bodies[{i}]", IN_TABLE, 0.0
            body = _body_in_table(owner, columns[i], is_immovable=immovable[i])
        else:
            owner = f"names[{i}]"
            state, age = finder.find(owner, owner, name)
            finder.check(owner, state, age)
            body = convert.body_of(owner, state)
        bodies.append(SceneBody(name, owner, body, state, age))
    return bodies


def problem_of(
    request: ResolveScene.Request,
    messages: list[ContactMessage],
    bodies: list[SceneBody],
    parameters: Parameters,
) -> tuple[SceneProblem, list[convert.ContactCoefficients]]:
    """Convert a request, and fill in the names of the bodies in its contacts, ``messages``.

    The coefficients of each contact come with their sources.

    Raises:
        ImpactError: UNKNOWN_BODY if ``pairs`` has an index beyond the bodies; INVALID_MODEL if only materials
            give the stiffness ratio that COMPLIANT needs; as ``coefficients_of`` and ``contact_of``.
    """
    model = convert.model_of(request.model, parameters.model)
    indices_a, indices_b = np.asarray(request.pairs).reshape(2, -1).tolist()
    pairs, contacts, coefficients = list(zip(indices_a, indices_b, strict=True)), [], []
    for i, (pair, message) in enumerate(zip(pairs, messages, strict=True)):
        if max(pair) >= len(bodies):
            reason = f"must be indices of {len(bodies)} bodies, from 0; those of contact {i} are {pair}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, "pairs", reason)
        body_a, body_b = (bodies[index] for index in pair)
        message.body_a, message.body_b = body_a.name, body_b.name
        try:
            found = convert.coefficients_of(message, body_a.state, body_b.state, parameters)
            of_pair = None if request.model.tangential_restitution else found.pair.tangential_restitution
            contacts.append(convert.contact_of(message, found, model.law, of_pair))
        except ImpactError as error:
            owners = {"contact": f"contacts[{i}]", "body_a": body_a.owner, "body_b": body_b.owner}
            raise error.renamed(owners) from None
        ratio = found.pair.stiffness_ratio
        if model.law is Law.COMPLIANT and not request.model.stiffness_ratio and ratio is not None:
            reason = f"must be given in a scene: the materials of contacts[{i}] have {ratio}"
            raise ImpactError(StatusCode.INVALID_MODEL, "model.stiffness_ratio", reason)
        coefficients.append(found)
    return ([body.body for body in bodies], pairs, contacts, model), coefficients


def _body_in_table(owner: str, column: list[float], *, is_immovable: bool) -> Body:
    body = body_from_numbers(column)
    if is_immovable:
        kinematic = Body.kinematic(body.position, body.velocity, body.angular_velocity)
        return kinematic._replace(orientation=body.orientation)
    convert.check_mass(owner, body.mass)
    return body


def write_answer(
    result: SceneResult,
    request: ResolveScene.Request,
    contacts: list[ContactMessage],
    bodies: list[SceneBody],
    coefficients: list[convert.ContactCoefficients],
    impact: SceneImpact,
) -> None:
    """Write the answer of the core into a result."""
    result.header = request.header
    result.status.code = int(impact.status)
    result.status.message = "; ".join(convert.notes_of(impact))
    result.contacts = contacts
    for message, contact in zip(result.contacts, impact.contacts, strict=True):
        message.restitution, message.friction = float(contact.restitution), contact.friction
    e_t = impact.model.tangential_restitution
    own = [contact.tangential_restitution for contact in impact.contacts]
    result.tangential_restitutions = [float(e_t if of_pair is None else of_pair) for of_pair in own]
    result.restitution_from = [of_contact.restitution.source for of_contact in coefficients]
    result.restitution_rules = [of_contact.restitution.rule for of_contact in coefficients]
    result.friction_from = [of_contact.friction.source for of_contact in coefficients]
    result.friction_rules = [of_contact.friction.rule for of_contact in coefficients]
    convert.write_model(result.model, impact.model)
    result.body_names = [body.name for body in bodies]
    result.state_stamps = [body.state.header.stamp for body in bodies]
    result.state_ages = [body.age for body in bodies]
    result.twists = [convert.twist_message(twist) for twist in impact.twists]
    result.impulses = [convert.vector_message(impulse) for impulse in impact.impulses]
    result.normal_velocities_before = list(impact.normal_velocities_before)
    result.normal_velocities_after = list(impact.normal_velocities_after)
    result.regimes = [int(regime) for regime in impact.regimes]
    result.clusters = impact.cluster_of_contacts()
    for name in NUMBERS:
        setattr(result, name, float(getattr(impact, name)))
    result.adjustments = int(impact.adjustments)
