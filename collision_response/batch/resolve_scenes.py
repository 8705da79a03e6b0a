"""Resolve many scenes at once, arrays in, arrays out: :func:`~collision_response.resolve_scene` for tables.

Two cubes that land flat on one floor, each on four corners:

    >>> import numpy as np
    >>> from collision_response import Geometry
    >>> from collision_response.batch import body_rows, contact_rows, resolve_scenes
    >>> rows, contact = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    >>> bodies, contacts = np.zeros((rows.height, 3)), np.zeros((contact.height, 8))
    >>> bodies[rows.mass], bodies[rows.inertia][[0, 3, 5], :2] = [[1.0, 1.0, np.inf]], 1 / 6
    >>> bodies[rows.position][0], bodies[rows.velocity][2] = [0.0, 9.0, 0.0], [-1.0, -2.0, 0.0]
    >>> contacts[contact.position][0] = [-0.5, -0.5, 0.5, 0.5, 8.5, 8.5, 9.5, 9.5]
    >>> contacts[contact.position][1], contacts[contact.position][2] = [-0.5, 0.5] * 4, -0.5
    >>> contacts[contact.normal][2], contacts[contact.restitution] = 1.0, [[1.0] * 4 + [0.5] * 4]
    >>> pairs = np.array([[0, 0, 0, 0, 1, 1, 1, 1], [2] * 8])
    >>> answer = resolve_scenes(bodies, contacts, pairs=pairs)
    >>> answer.velocity[2], answer.cluster
    (array([1., 1., 0.]), array([0, 0, 0, 0, 1, 1, 1, 1]))

Contacts that share a movable body, directly or through others, form a cluster, and each cluster is resolved
by itself. So one table holds many scenes. An immovable body, such as a floor, may belong to all of them.
"""

from __future__ import annotations

import math
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from ..arguments import check_count, check_number
from ..kernels import library, protocol
from ..model import DEFAULT, LARGEST_BOUND, ImpactModel
from ..physics.laws import PATHS
from ..scene import resolve_scene
from ..scene.frictionless import THRESHOLD
from ..status import BELOW_ONE, ImpactError, StatusCode
from .arrays import Array, as_numpy, compared_by_identity
from .one_by_one import body_of, contact_of
from .pairs import IS_ANSWER, as_pairs
from .plan import BatchRequest
from .resolve_batch import resolve_batch
from .result import ENERGIES, REPORTED_ADJUSTMENTS, UINT8, names_bodies
from .threads import run_in_parts

CLUSTERS_PER_WORKER = 64
"""With fewer clusters, another worker takes longer to start than it saves."""


@compared_by_identity
class ScenesResult(NamedTuple):
    """The results of :func:`resolve_scenes`, as in :class:`~collision_response.SceneImpact`.

    Attributes:
        velocity: of the centres of mass after the impact [m/s], shape ``(3, B)``; in PLANAR ``(2, B)``. NaN
            for movable bodies of a cluster without an answer. A pair that names one body twice, or a body
            that is not there, leaves its bodies as they were.
        angular_velocity: after the impact [rad/s], shape ``(3, B)``; in PLANAR, about z, ``(1, B)``; in POINT
            ``(0, B)``.
        impulse: on body_a of each contact [N s], shape ``(3, N)``; in PLANAR ``(2, N)``.
        regime: what friction did at each contact, a :class:`~collision_response.Regime`, uint8, shape
            ``(N,)``.
        cluster: number of the cluster of each contact, shape ``(N,)``. Clusters are numbered in the order of
            their first contacts.
        status: a :class:`~collision_response.StatusCode` for each cluster, uint8, shape ``(C,)``. Without an
            answer, impulses and the following numbers are NaN, and regimes 0.
        error_bound, decision_margin: of each cluster, shape ``(C,)``.
        kinetic_energy_before, kinetic_energy_after: of the movable bodies of each cluster [J], shape
            ``(C,)``.
        energy_lost_restitution, energy_lost_friction: in each cluster [J], shape ``(C,)``.
        adjustments: how the impact of each cluster differs from the request, an
            :class:`~collision_response.Adjustment`, uint8, shape ``(C,)``; 0 where there is no answer. Tables
            take quaternions of any length, so NORMALISED_ORIENTATION is not among them.
    """

    velocity: Array
    angular_velocity: Array
    impulse: Array
    regime: Array
    cluster: Array
    status: Array
    error_bound: Array
    decision_margin: Array
    kinetic_energy_before: Array
    kinetic_energy_after: Array
    energy_lost_restitution: Array
    energy_lost_friction: Array
    adjustments: Array


class Clusters(NamedTuple):
    """The contacts by cluster: those of cluster ``c`` are ``order[starts[c] : starts[c + 1]]``."""

    order: Array
    starts: Array

    def contacts(self, cluster: int) -> Array:
        """Return the contacts of a cluster, in order."""
        return self.order[self.starts[cluster] : self.starts[cluster + 1]]


def resolve_scenes(
    bodies: Array,
    contacts: Array,
    model: ImpactModel = DEFAULT,
    *,
    pairs: Any,
    threshold: float = THRESHOLD,
    workers: int = 1,
) -> ScenesResult:
    """Compute the motion of bodies after several contacts strike at once, in any number of clusters.

    The numbers are those of :func:`~collision_response.resolve_scene` for each cluster by itself, in the
    geometry of the table, to the bit. Clusters are computed without Python, except for the few that need more
    digits or in which a contact is given twice, and for single contacts by a law that follows a path.

    Args:
        bodies: a table of bodies, float64, shape ``(rows, B)``. The number of rows determines the geometry.
        contacts: the contacts, float64, shape ``(rows, N)``, without a row of tangential restitution.
        model: as for ``resolve_scene``. AUTO law is COULOMB if ``contacts`` has a row of friction.
        pairs: for each contact the columns of its body_a and its body_b, integers, shape ``(2, N)``.
        threshold: as for ``resolve_scene``.
        workers: number of threads, at least 1.

    Raises:
        ImpactError: INVALID_MODEL or INVALID_COEFFICIENT, if the model is invalid, or not for tables.
        TypeError: if ``model`` is not an :class:`~collision_response.ImpactModel`, ``threshold`` not a
            number, or ``workers`` not a whole number.
        ValueError: if an array has the wrong shape or type.
    """
    bodies = np.ascontiguousarray(as_numpy("bodies", bodies))
    contacts, pairs = np.ascontiguousarray(as_numpy("contacts", contacts)), as_pairs(pairs)
    pairs = pairs.copy()  # another thread may change what is given, after the check of its indices
    check_count("workers", workers, 1, math.inf)
    check_number("threshold", threshold, 0, BELOW_ONE, StatusCode.INVALID_MODEL)
    request = BatchRequest.of(bodies, contacts, model, pairs)
    model = request.plan.model
    if bodies.dtype != np.float64 or contacts.shape[0] > request.plan.layout.contacts.height:
        given = f"{bodies.dtype}, and {contacts.shape[0]} rows of contacts"
        most = f"float64, and at most {request.plan.layout.contacts.height} rows of contacts"
        raise ValueError(f"bodies, contacts: must be {most}; are {given}")
    clusters, cluster_of = _find_clusters(bodies, pairs)
    result = _initial_result(request, cluster_of, clusters.starts.size - 1)
    is_single = np.diff(clusters.starts) == 1
    if model.law not in PATHS:  # single contacts of path laws stay UNSET, for resolve_scene() below
        singles = np.flatnonzero(is_single)
        _resolve_single_contacts(request, singles, clusters.order[clusters.starts[singles]], result, workers)
    _resolve_without_python(request, clusters, np.flatnonzero(~is_single), threshold, result, workers)
    for cluster in np.flatnonzero(result.status == StatusCode.UNSET).tolist():
        _resolve_in_python(request, cluster, clusters.contacts(cluster), threshold, result)
    return result


def _find_clusters(bodies: Array, pairs: Array) -> tuple[Clusters, Array]:
    """Return the contacts by cluster, and the cluster of each contact."""
    n = pairs.shape[1]
    order, starts, cluster_of = np.empty(n, np.int64), np.empty(n + 1, np.int64), np.empty(n, np.int64)
    count = library.find_clusters(pairs, bodies[0] < np.inf, order, starts, cluster_of)
    return Clusters(order, starts[: count + 1]), cluster_of


def _initial_result(request: BatchRequest, cluster_of: Array, clusters: int) -> ScenesResult:
    """Return a result in which no cluster is resolved yet."""
    rows, n = request.plan.layout.bodies, cluster_of.size
    velocity, angular_velocity = (request.bodies[i].copy() for i in (rows.velocity, rows.angular_velocity))
    impulse, regime = np.full((len(velocity), n), np.nan), np.zeros(n, UINT8)
    status, adjustments = np.zeros((2, clusters), UINT8)
    of_clusters = status, *np.full((6, clusters), np.nan), adjustments
    return ScenesResult._make((velocity, angular_velocity, impulse, regime, cluster_of, *of_clusters))


def _resolve_single_contacts(
    request: BatchRequest, clusters: Array, contacts: Array, result: ScenesResult, workers: int
) -> None:
    """Resolve clusters of one contact each by ``resolve_batch``, with error bounds."""
    if not clusters.size:
        return
    model, bodies, pairs = request.plan.model, request.bodies, request.pairs
    assert pairs is not None
    # Any tolerance gives error bounds.
    bounded = model if model.tolerance else model._replace(tolerance=LARGEST_BOUND)
    own_pairs, own_contacts = pairs.take(contacts, 1), request.contacts.take(contacts, 1)
    found = resolve_batch(bodies, own_contacts, bounded, pairs=own_pairs, report=True, workers=workers)
    result.impulse[:, contacts], result.regime[contacts] = found.impulse, found.regime
    result.status[clusters], result.error_bound[clusters] = found.status, found.error_bound
    result.decision_margin[clusters[IS_ANSWER[found.status]]] = np.inf
    for field in (*ENERGIES, "adjustments"):
        getattr(result, field)[clusters] = getattr(found, field)
    has_bodies = names_bodies(found.status)
    for side, column in enumerate(own_pairs[:, has_bodies]):
        movable = bodies[0, column] < np.inf
        velocity = found.velocity[:, side, has_bodies]
        angular_velocity = found.angular_velocity[:, side, has_bodies]
        result.velocity[:, column[movable]] = velocity[:, movable]
        result.angular_velocity[:, column[movable]] = angular_velocity[:, movable]


def _resolve_without_python(
    request: BatchRequest,
    clusters: Clusters,
    wanted: Array,
    threshold: float,
    result: ScenesResult,
    workers: int,
) -> None:
    """Resolve the clusters ``wanted``. Those that are left to Python keep the status UNSET."""
    plan, model, pairs = request.plan, request.plan.model, request.pairs
    assert pairs is not None
    settings = model.restitution_threshold, model.tangential_restitution, model.tolerance
    floats = map(float, (threshold, *settings, plan.model_plan.bound_limit))
    has_exact_threshold = plan.model_plan.settings_errors.restitution_threshold == 0
    numbers = (*floats, protocol.SPRING_WORK, has_exact_threshold)

    def resolve_some(start: int, stop: int) -> None:
        library.resolve_clusters(
            plan.layout.number,
            int(model.law),
            numbers,
            request.bodies,
            pairs,
            request.contacts,
            clusters.order,
            clusters.starts,
            result,
            wanted,
            start,
            stop,
        )

    run_in_parts(resolve_some, 0, wanted.size, min(workers, wanted.size // CLUSTERS_PER_WORKER))


def _resolve_in_python(
    request: BatchRequest, cluster: int, contacts: Array, threshold: float, result: ScenesResult
) -> None:
    """Resolve one cluster by ``resolve_scene``."""
    model, bodies, pairs = request.plan.model, request.bodies, request.pairs
    assert pairs is not None
    own_pairs = pairs[:, contacts].T.tolist()
    if any(a == b for a, b in own_pairs):
        result.status[cluster] = StatusCode.SAME_BODY
        return
    columns = list(dict.fromkeys(chain(*own_pairs)))  # bodies in the order in which contacts name them
    if min(columns) < 0 or max(columns) >= bodies.shape[1]:
        result.status[cluster] = StatusCode.UNKNOWN_BODY
        return
    place = {column: i for i, column in enumerate(columns)}
    rows, contact_rows = request.plan.layout.bodies, request.plan.layout.contacts
    movable = [i for i in columns if bodies[0, i] < np.inf]
    try:
        answer = resolve_scene(
            [body_of(rows, bodies[:, i]) for i in columns],
            [(place[a], place[b]) for a, b in own_pairs],
            [contact_of(contact_rows, request.contacts[:, i]) for i in contacts.tolist()],
            model,
            threshold=threshold,
        )
    except ImpactError as error:
        result.status[cluster] = error.code
        result.velocity[:, movable] = result.angular_velocity[:, movable] = np.nan
        return
    linear, angular = len(result.velocity), len(result.angular_velocity)
    for i in movable:
        twist = answer.twists[place[i]]
        result.velocity[:, i] = twist.linear[:linear]
        result.angular_velocity[:, i] = twist.angular[3 - angular :]
    result.impulse[:, contacts] = np.array([impulse[:linear] for impulse in answer.impulses]).T
    result.regime[contacts] = answer.regimes
    for field in ("status", "error_bound", "decision_margin", *ENERGIES):
        getattr(result, field)[cluster] = getattr(answer, field)
    result.adjustments[cluster] = answer.adjustments & REPORTED_ADJUSTMENTS
