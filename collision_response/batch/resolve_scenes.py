"""Many scenes at once, from arrays to arrays: :func:`~collision_response.resolve_scene` for tables.

Two cubes that land flat on one floor, each on four corners:

    >>> import numpy as np
    >>> from collision_response import Geometry
    >>> from collision_response.batch import body_rows, contact_rows, resolve_scenes
    >>> rows, touch = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    >>> bodies, contacts = np.zeros((rows.height, 3)), np.zeros((touch.height, 8))
    >>> bodies[rows.mass], bodies[rows.inertia][[0, 3, 5], :2] = [[1.0, 1.0, np.inf]], 1 / 6
    >>> bodies[rows.position][0], bodies[rows.velocity][2] = [0.0, 9.0, 0.0], [-1.0, -2.0, 0.0]
    >>> contacts[touch.position][0] = [-0.5, -0.5, 0.5, 0.5, 8.5, 8.5, 9.5, 9.5]
    >>> contacts[touch.position][1], contacts[touch.position][2] = [-0.5, 0.5] * 4, -0.5
    >>> contacts[touch.normal][2], contacts[touch.restitution] = 1.0, [[1.0] * 4 + [0.5] * 4]
    >>> pairs = np.array([[0, 0, 0, 0, 1, 1, 1, 1], [2] * 8])
    >>> answer = resolve_scenes(bodies, contacts, pairs=pairs)
    >>> answer.velocity[2], answer.cluster
    (array([1., 1., 0.]), array([0, 0, 0, 0, 1, 1, 1, 1]))

Contacts that share a movable body, directly or through others, form a cluster; clusters are
answered one by one. So many scenes are one table: an immovable body, such as a floor, may belong to all.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from ..kernels import library
from ..model import DEFAULT, LARGEST_BOUND, ImpactModel, check_number, plan_model
from ..physics.laws import PATHS
from ..scene import SceneImpact, resolve_scene
from ..scene.kernel_model import COMPILED_LAWS, THRESHOLD
from ..scene.reflections import REFLECTIONS
from ..status import ImpactError, StatusCode
from .one_by_one import REPORT, body_of, contact_of
from .other_arrays import check_unmasked
from .pairs import IS_ANSWER, as_pairs
from .resolve_batch import UINT8, Asked, check_workers, plan_for, resolve_batch
from .rows import body_rows, contact_rows

Array = np.ndarray[Any, Any]

SHARE = 64
"""Clusters below which a second worker is not worth waking."""


class ScenesResult(NamedTuple):
    """What became of the bodies. A number of an answer means what it does in
    :class:`~collision_response.SceneImpact`.

    Attributes:
        velocity: of the centres of mass after the impact [m/s], shape ``(3, B)``; PLANAR ``(2, B)``. NaN for
            what could move in a cluster without an answer; a pair of one body twice, or with a body that is
            not there, leaves its bodies as they were.
        angular_velocity: after the impact [rad/s], shape ``(3, B)``; PLANAR, about z, ``(1, B)``; POINT
            ``(0, B)``.
        impulse: on body_a of each contact [N s], shape ``(3, N)``; PLANAR ``(2, N)``.
        regime: what friction did at each contact, a :class:`~collision_response.Regime`, uint8,
            shape ``(N,)``.
        cluster: which cluster each contact is of, shape ``(N,)``; numbered by their first contacts.
        status: a :class:`~collision_response.StatusCode` for each cluster, uint8, shape ``(C,)``.
        error_bound, decision_margin: of each cluster, shape ``(C,)``.
        kinetic_energy_before, kinetic_energy_after: of the movable bodies of each cluster [J],
            shape ``(C,)``.
        energy_lost_restitution, energy_lost_friction: in each cluster [J], shape ``(C,)``.
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


class Clusters(NamedTuple):
    """The contacts of each cluster: ``order[starts[c] : starts[c + 1]]``."""

    order: Array
    starts: Array

    def contacts(self, cluster: int) -> Array:
        """The contacts of a cluster, in order."""
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
    """The motion of bodies after several contacts strike at once, in as many clusters as there are.

    The numbers are those of :func:`~collision_response.resolve_scene` for each cluster by itself, in the
    geometry of the table, bit by bit.
    Clusters by FRICTIONLESS, COULOMB and MOREAU are computed without Python, but for the few that need more
    digits or have a contact twice; those by other laws are computed one after the other.

    Args:
        bodies: a table of bodies, float64, shape ``(rows, B)``; the number of rows tells the geometry.
        contacts: the contacts, float64, shape ``(rows, N)``, without a row of tangential restitution.
        model: as for ``resolve_scene``; AUTO is COULOMB if ``contacts`` has a row of friction.
        pairs: for each contact the column of its body_a and that of its body_b, integers, shape ``(2, N)``.
        threshold: as for ``resolve_scene``.
        workers: threads to use, at least 1.

    Raises:
        ImpactError: INVALID_MODEL or INVALID_COEFFICIENT: the model is none for tables.
        ValueError: an array has not the right shape or type.
    """
    check_unmasked("bodies", bodies)
    check_unmasked("contacts", contacts)
    bodies, contacts, pairs = np.ascontiguousarray(bodies), np.ascontiguousarray(contacts), as_pairs(pairs)
    check_workers(workers)
    check_number("threshold", threshold, 0, math.nextafter(1, 0), StatusCode.INVALID_MODEL)
    here = plan_for(bodies, contacts, model, pairs)
    model, asked = here.model, Asked(here, bodies, pairs, contacts)
    if bodies.dtype != np.float64 or contacts.shape[0] > contact_rows(model.geometry).height:
        raise ValueError("bodies, contacts: must be float64, and without rows of tangential restitution")
    clusters, of_contacts = _clusters(bodies, pairs)
    result = _nothing(asked, of_contacts, clusters.starts.size - 1)
    sizes = np.diff(clusters.starts)
    alone, together = np.flatnonzero(sizes == 1), np.flatnonzero(sizes > 1)
    if model.law in PATHS:
        together = np.flatnonzero(sizes > 0)
    else:
        _alone(asked, alone, clusters.order[clusters.starts[alone]], result, workers)
    if model.law in COMPILED_LAWS and not model.tangential_restitution:
        numbers = threshold, model.restitution_threshold, plan_model(model).bound_limit, REFLECTIONS
        tables = bodies, pairs, contacts, *clusters, result, together
        kernel = here.layout, int(model.law), tuple(map(float, numbers))
        _share(lambda *part: library.resolve_clusters(*kernel, *tables, *part), together.size, workers)
        together = together[result.status[together] == StatusCode.UNSET]
    for cluster in together.tolist():
        _by_itself(asked, cluster, clusters.contacts(cluster), threshold, result)
    return result


def _clusters(bodies: Array, pairs: Array) -> tuple[Clusters, Array]:
    n = pairs.shape[1]
    order, starts, of_contacts = np.empty(n, np.int64), np.empty(n + 1, np.int64), np.empty(n, np.int64)
    count = library.clusters(pairs, bodies[0] < np.inf, order, starts, of_contacts)
    return Clusters(order, starts[: count + 1]), of_contacts


def _nothing(asked: Asked, of_contacts: Array, count: int) -> ScenesResult:
    """A result in which nothing has happened yet."""
    plan, bodies, n = asked.plan, asked.bodies, of_contacts.size
    rows = body_rows(plan.model.geometry, oriented=plan.oriented)
    motion = bodies[rows.velocity].copy(), bodies[rows.angular_velocity].copy()
    impulse, regime, status = np.full((plan.axes, n), np.nan), np.zeros(n, UINT8), np.zeros(count, UINT8)
    return ScenesResult(*motion, impulse, regime, of_contacts, status, *np.full((6, count), np.nan))


def _share(work: Any, count: int, workers: int) -> None:
    shares = max(1, min(workers, count // SHARE))
    cuts = [count * i // shares for i in range(shares + 1)]
    if shares == 1:
        work(*cuts)
        return
    with ThreadPoolExecutor(shares) as pool:
        list(pool.map(work, cuts[:-1], cuts[1:]))


def _alone(asked: Asked, alone: Array, at: Array, result: ScenesResult, workers: int) -> None:
    """Clusters of one contact: each is one impact, with its bound."""
    if not alone.size:
        return
    model, bodies, pairs, contacts = asked.plan.model, *asked[1:]
    assert pairs is not None
    wanted = (
        model if model.tolerance else model._replace(tolerance=LARGEST_BOUND)
    )  # any, but there is a bound
    own = pairs.take(at, 1)
    found = resolve_batch(bodies, contacts.take(at, 1), wanted, pairs=own, report=True, workers=workers)
    result.impulse[:, at], result.regime[at] = found.impulse, found.regime
    result.status[alone], result.error_bound[alone] = found.status, found.error_bound
    result.decision_margin[alone[IS_ANSWER[found.status]]] = np.inf
    for field in REPORT[1:]:
        getattr(result, field)[alone] = getattr(found, field)
    of_bodies = ~np.isin(found.status, (StatusCode.SAME_BODY, StatusCode.UNKNOWN_BODY))
    for side, column in enumerate(own[:, of_bodies]):
        moved = bodies[0, column] < np.inf
        velocity, spin = found.velocity[:, side, of_bodies], found.angular_velocity[:, side, of_bodies]
        result.velocity[:, column[moved]] = velocity[:, moved]
        result.angular_velocity[:, column[moved]] = spin[:, moved]


def _by_itself(asked: Asked, cluster: int, own: Array, threshold: float, result: ScenesResult) -> None:
    """One cluster by ``resolve_scene``."""
    model, bodies, pairs, contacts = asked.plan.model, *asked[1:]
    assert pairs is not None
    places, first, inverse = np.unique(pairs[:, own].T.ravel(), return_index=True, return_inverse=True)
    if places[0] < 0 or places[-1] >= bodies.shape[1]:
        result.status[cluster] = StatusCode.UNKNOWN_BODY
        return
    order = np.argsort(first)  # bodies as they come
    places, inverse = places[order], np.argsort(order)[inverse].reshape(-1, 2)
    rows, touch = body_rows(model.geometry, oriented=asked.plan.oriented), contact_rows(model.geometry)
    movable = places[bodies[0, places] < np.inf]
    try:
        answer = resolve_scene(
            [body_of(rows, bodies[:, i]) for i in places.tolist()],
            [(a, b) for a, b in inverse.tolist()],
            [contact_of(touch, contacts[:, i]) for i in own.tolist()],
            model,
            threshold=threshold,
        )
    except ImpactError as error:
        result.status[cluster] = error.code
        if error.code is not StatusCode.SAME_BODY:
            result.velocity[:, movable] = result.angular_velocity[:, movable] = np.nan
    else:
        _write(answer, places, movable, own, cluster, result)


def _write(
    answer: SceneImpact, places: Array, movable: Array, own: Array, cluster: int, result: ScenesResult
) -> None:
    twists = dict(zip(places.tolist(), answer.twists, strict=True))
    axes, spins = len(result.velocity), len(result.angular_velocity)
    for i in movable.tolist():
        result.velocity[:, i] = twists[i].linear[:axes]
        result.angular_velocity[:, i] = twists[i].angular[3 - spins :]
    result.impulse[:, own] = np.array([impulse[:axes] for impulse in answer.impulses]).T
    result.regime[own] = answer.regimes
    for field in ("status", "error_bound", "decision_margin", *REPORT[1:]):
        getattr(result, field)[cluster] = getattr(answer, field)
