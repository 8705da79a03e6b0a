"""A cluster of several contacts: from the numbers of its bodies through a law to what becomes of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from ..geometry import required
from ..in_python import exact_fractions
from ..in_python.coefficients_at_speed import friction_at_first, restitution_at
from ..kernels import library
from ..model import Adjustment, Geometry, ImpactModel, Precision
from ..numbers.operations import Scalar
from ..physics.body import Body
from ..physics.column import Column
from ..physics.contact import Contact
from ..physics.laws import Law
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode
from . import request
from .cluster_answer import ClusterAnswer
from .clusters import DistinctContacts, Pair
from .coulomb import with_friction
from .moreau import one_step
from .order_sensitivity import distance
from .rational_cluster import RationalCluster
from .reflections import ClusterImpulses, contradiction, reflections
from .request import ContactIndices, SceneRequest
from .stronge import LEAST_RESTITUTION, compressed

CLUSTER_LAWS = (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE)
"""The laws that know several contacts."""

RATIONAL_CONTACTS = 8
"""Clusters up to this size are decided in rationals where double-double can't."""


class SceneOptions(NamedTuple):
    """What is asked of a scene beside its parts: see :func:`~collision_response.resolve_scene`."""

    model: ImpactModel
    law: Law
    threshold: Scalar
    stiffness: Sequence[float] | None
    exponent: float
    exact: bool


class ClusterParts(NamedTuple):
    """A cluster by itself.

    Attributes:
        bodies: those that it touches.
        pairs: of its contacts, by places among those bodies.
        contacts: each once; the numbers of ``bodies`` and ``contacts`` are of one kind.
        counts: how often each is given.
        first: of each, its index in the scene.
    """

    bodies: list[Body]
    pairs: list[Pair]
    contacts: list[Contact]
    counts: list[int]
    first: list[int]

    def some(self, places: Sequence[int]) -> ClusterParts:
        """Some of the contacts."""
        return ClusterParts(
            self.bodies,
            [self.pairs[i] for i in places],
            [self.contacts[i] for i in places],
            [self.counts[i] for i in places],
            [self.first[i] for i in places],
        )


def resolve_cluster(scene: SceneRequest, copies: DistinctContacts, asked: SceneOptions) -> ClusterAnswer:
    """What the law says of the contacts of a cluster, each once.

    Raises:
        ImpactError: the request can't be answered; ``field`` names the body or the contact.
        TypeError: something is no number.
    """
    model, law = asked.model, asked.law
    _check_model(scene, copies.first, model, law)
    places: dict[int, int] = {}
    pairs = []
    for i in copies.first:
        a, b = scene.pairs[i]
        pairs.append((places.setdefault(a, len(places)), places.setdefault(b, len(places))))
    contacts = [_with_friction(scene, i, law) for i in copies.first]
    parts = ClusterParts(
        [scene.bodies[place] for place in places], pairs, contacts, copies.counts, copies.first
    )
    cluster, parts, slow = _with_restitution(scene, parts, asked)
    if model.geometry in (Geometry.POINT, Geometry.PLANAR):
        _check_geometry(parts, model.geometry)
    has_friction = scene.has_friction and law is not Law.FRICTIONLESS
    has_friction = has_friction and any([contact.friction > 0 for contact in parts.contacts])
    if not asked.exact and cluster.beyond:
        raise library.refusal(StatusCode.OUT_OF_RANGE)

    struck, bound, motions = _by_law(cluster, parts, asked, has_friction)
    if struck.fell_back:
        law = Law.COULOMB if has_friction else Law.FRICTIONLESS
    changes, twists, impulses, before, after, regimes, energies, own_bound, idle, off_unit, _ = motions
    if not (asked.exact or all(map(math.isfinite, energies))):  # which are sums over all the rest
        raise library.refusal(StatusCode.OUT_OF_RANGE)
    if struck.rubbed is not None:
        e_before, e_after, restitution, friction = energies
        energies = e_before, e_after, restitution + friction - struck.rubbed, struck.rubbed
    e, used = struck.restitution, parts.contacts
    if e is not None:
        used = [c if c.restitution == e else c._replace(restitution=e) for c in used]
    in_doubles = has_friction or law is Law.ROUTH_STRONGE
    return ClusterAnswer(
        [place for place in places if scene.movable[place]],
        changes,
        twists,
        used,
        impulses,
        before,
        after,
        regimes,
        energies,
        own_bound if bound is None else bound,
        struck.margin,
        off_unit * Adjustment.NORMALISED_ORIENTATION
        | slow * Adjustment.RESTITUTION_THRESHOLD
        | struck.fell_back * Adjustment.LAW_FALLBACK
        | idle * Adjustment.MASSLESS_SPIN,
        ImpactModel(
            law,
            Geometry.SPATIAL if model.geometry is Geometry.AUTO else model.geometry,
            Precision.DOUBLE if in_doubles else Precision.EXTENDED,
            *model[3:],
        ),
    )


def _check_model(scene: SceneRequest, first: Sequence[int], model: ImpactModel, law: Law) -> None:
    """Raises: ImpactError: it is for one contact."""
    if law not in CLUSTER_LAWS:
        reason = f"{law.name} is for clusters of one contact: try ROUTH_STRONGE"
        raise ImpactError(StatusCode.INVALID_MODEL, "model.law", reason)
    for i in first if law is Law.COULOMB else ():
        own = scene.contacts[i].tangential_restitution
        place, e_t = ("model", model.tangential_restitution) if own is None else (f"contacts[{i}]", own)
        if e_t:
            reason = f"must be 0 for clusters of several contacts, is {e_t}"
            raise ImpactError(StatusCode.INVALID_MODEL, f"{place}.tangential_restitution", reason)


def _check_geometry(parts: ClusterParts, geometry: Geometry) -> None:
    """Raises: ImpactError: it leaves out what matters."""
    for (a, b), contact in zip(parts.pairs, parts.contacts, strict=True):
        if required(parts.bodies[a], parts.bodies[b], contact, frictionless=False) > geometry:
            reason = (
                f"{geometry.name} leaves out motion that matters, which a cluster of several contacts can't"
            )
            raise ImpactError(StatusCode.INVALID_MODEL, "model.geometry", reason)


def _with_friction(scene: SceneRequest, i: int, law: Law) -> Contact:
    """A contact, its friction a number."""
    contact = scene.contacts[i]
    mu = contact.friction
    if not callable(mu):
        is_left_out = law is Law.FRICTIONLESS and 0 < mu < math.inf
        return contact._replace(friction=mu * 0) if is_left_out else contact
    if law is Law.FRICTIONLESS:
        return contact._replace(friction=0.0)
    a, b = scene.pairs[i]
    given = scene.bodies[a], scene.bodies[b], contact, law
    mu = request.with_scene_names(ContactIndices(i, a, b), friction_at_first, *given)
    return contact._replace(friction=mu)


def _with_restitution(
    scene: SceneRequest, parts: ClusterParts, asked: SceneOptions
) -> tuple[Any, ClusterParts, bool]:
    """The assembled cluster, every restitution a number; and whether one is 0 for want of speed."""
    given, threshold = parts.contacts, asked.model.restitution_threshold
    has_function = any([callable(contact.restitution) for contact in given])
    if has_function:
        numbers = [c._replace(restitution=1.0) if callable(c.restitution) else c for c in given]
        parts = parts._replace(contacts=numbers)
    cluster, parts = _assembled(scene, parts, asked.exact)
    if not (has_function or threshold):
        return cluster, parts, False
    speeds = [-u for u in _motions(cluster, ClusterImpulses(cluster.none()))[3]]
    fastest, slow, contacts = max(0.0, *speeds), False, []
    for original, contact, speed, i in zip(given, parts.contacts, speeds, parts.first, strict=True):
        e = contact.restitution
        if callable(original.restitution):
            e = restitution_at(float(speed if speed > 0 else fastest), original, f"contacts[{i}]")
        if 0 < speed < threshold and e > 0:
            e, slow = e * 0, True
        contacts.append(contact._replace(restitution=Fraction(e) if asked.exact else float(e)))
    return *_assembled(scene, parts._replace(contacts=contacts), asked.exact), slow


def _assembled(scene: SceneRequest, parts: ClusterParts, exact: bool) -> tuple[Any, ClusterParts]:
    """What impulses do in a cluster, and its parts in the numbers that are used."""
    if not exact:
        made = library.assemble(*parts[:4])
        if made.__class__ is library.Cluster:
            return made, parts
    names = [ContactIndices(i, *scene.pairs[i]) for i in parts.first]
    if not exact:
        if made is None:  # a number is no float
            bodies, contacts = request.as_floats(parts.bodies, parts.pairs, parts.contacts, names)
            parts = parts._replace(bodies=bodies, contacts=contacts)
            made = library.assemble(*parts[:4])
        if made.__class__ is library.Cluster:
            return made, parts
    for (a, b), contact, name in zip(parts.pairs, parts.contacts, names, strict=True):
        request.check_contact(parts.bodies[a], parts.bodies[b], contact, name)
    if not exact:
        raise ImpactError(StatusCode.INTERNAL_ERROR, "contacts", "were refused for no known reason")
    return RationalCluster(*parts[:4]), parts


def _motions(cluster: Any, struck: ClusterImpulses, *, by_slip: bool = False) -> Any:
    return cluster.answer(struck.p, struck.tangential, struck.error, by_slip)


def _by_law(
    cluster: Any, parts: ClusterParts, asked: SceneOptions, has_friction: bool
) -> tuple[ClusterImpulses, float | None, Any]:
    """What the law gives; the relative error, where the law estimates it; what becomes of the bodies."""
    locked = _locked(cluster, parts)
    if cluster.doubtful and not cluster.locked:
        hidden, springs = _approaches(parts), asked.law is Law.ROUTH_STRONGE
        if not hidden or has_friction or springs or len(parts.contacts) > RATIONAL_CONTACTS:
            nothing = ClusterImpulses(cluster.none(), error=math.inf if hidden else 0.0)
            return nothing, None, _motions(cluster, nothing)
        locked = _in_fractions(parts)
    if asked.law is Law.ROUTH_STRONGE:
        return _by_springs(cluster, parts, asked, has_friction)
    fell_back = asked.law is Law.MOREAU
    if asked.law is Law.MOREAU:
        struck = _in_one_step(cluster, locked, has_friction=has_friction)
        if struck is not None:
            motions = _motions(cluster, struck)
            if not motions[10]:
                return struck, None, motions
    struck = _by_reflections(cluster, parts, locked, asked.threshold)
    if has_friction:
        struck = with_friction(cluster, struck)
    return struck._replace(fell_back=True) if fell_back else struck, None, _motions(cluster, struck)


def _in_one_step(
    cluster: Any, locked: RationalCluster | None, *, has_friction: bool
) -> ClusterImpulses | None:
    """MOREAU; without friction, what may press on itself decided in rationals."""
    if locked is None or (has_friction and locked.can_rebound()):
        return one_step(cluster, has_friction=has_friction)
    exact = None if has_friction else one_step(locked, has_friction=False)
    return None if exact is None else _in_floats(cluster, locked, exact)


def _in_floats(cluster: Any, exactly: RationalCluster, exact: ClusterImpulses) -> ClusterImpulses:
    p = cluster.from_floats([float(x) for x in exactly.least_norm(exact.p)])
    e = None if exact.restitution is None else float(exact.restitution)
    return ClusterImpulses(p, None, cluster.size(p) * 2.0**-53, float(exact.margin), e)


def _by_reflections(
    cluster: Any, parts: ClusterParts, locked: RationalCluster | None, threshold: Scalar
) -> ClusterImpulses:
    """FRICTIONLESS; what double-double can't decide, decided in rationals."""
    struck = None if locked or cluster.locked else reflections(cluster, threshold)
    if struck is not None and struck.error < math.inf:
        return struck
    if len(parts.contacts) <= RATIONAL_CONTACTS:
        exactly = locked or _in_fractions(parts)
        return _in_floats(cluster, exactly, reflections(exactly, threshold))
    if struck is None:
        reason = f"more than {RATIONAL_CONTACTS} press on each other without end, as a ball between walls"
        raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
    return struck


def _locked(cluster: Any, parts: ClusterParts) -> RationalCluster | None:
    """A cluster in fractions, if it is small and may press on itself: then no double is to decide it.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS: no velocities keep all contacts from approaching.
    """
    if not cluster.locked:
        return None
    small = len(parts.contacts) <= RATIONAL_CONTACTS
    suspects = range(len(parts.contacts)) if small else cluster.contradiction()
    if not 0 < len(suspects) <= RATIONAL_CONTACTS:
        return None
    exactly = _in_fractions(parts.some(suspects))
    if exactly.project(exactly.none()) is None:
        raise contradiction()
    return exactly if small else None


def _approaches(parts: ClusterParts) -> bool:
    """Whether a contact does, to all digits."""
    bodies = list(map(exact_fractions.body_as_fractions, parts.bodies))
    for (a, b), given in zip(parts.pairs, parts.contacts, strict=True):
        contact = exact_fractions.contact_as_fractions(given)
        u, v = (Column.of(bodies[k], contact.position, contact.normal).velocity for k in (a, b))
        if u < v:
            return True
    return False


def _in_fractions(parts: ClusterParts) -> RationalCluster:
    bodies = list(map(exact_fractions.body_as_fractions, parts.bodies))
    contacts = [exact_fractions.contact_as_fractions(_of_usual_length(c)) for c in parts.contacts]
    return RationalCluster(bodies, parts.pairs, contacts, parts.counts)


def _of_usual_length(contact: Contact) -> Contact:
    """A contact whose normal is in the middle of the range: as assembled, for impulses count along it."""
    _, exponent = math.frexp(max(map(abs, contact.normal)))
    if abs(exponent) <= 100:
        return contact
    return contact._replace(normal=Vec3(*(math.ldexp(x, -exponent) for x in contact.normal)))


def _by_springs(
    cluster: Any, parts: ClusterParts, asked: SceneOptions, has_friction: bool
) -> tuple[ClusterImpulses, float, Any]:
    movable = [body for body in parts.bodies if body.is_movable()]

    def motions_of(struck: ClusterImpulses) -> Any:
        return _motions(cluster, struck, by_slip=True)

    def apart(one: ClusterImpulses, other: ClusterImpulses) -> float:
        return distance(movable, motions_of(one)[0], motions_of(other)[0])

    struck = ClusterImpulses(cluster.none())
    motions = motions_of(struck)
    if not min(motions[3]) < 0:
        return struck, 0.0, motions
    restitution = [contact.restitution for contact in parts.contacts]
    least = min(restitution)
    if least < LEAST_RESTITUTION:
        field = f"contacts[{parts.first[restitution.index(least)]}].restitution"
        reason = f"must be at least {LEAST_RESTITUTION} for ROUTH_STRONGE in a cluster, is {least}"
        raise ImpactError(StatusCode.PATH_TOO_LONG, field, reason)
    given = asked.stiffness
    stiffness = [1.0 if given is None else float(given[i]) for i in parts.first]
    struck, error = compressed(
        cluster, stiffness, float(asked.exponent), asked.model.tolerance,
        has_friction=has_friction, apart=apart,
    )  # fmt: skip
    motions = motions_of(struck)
    return struck, error + motions[7], motions
