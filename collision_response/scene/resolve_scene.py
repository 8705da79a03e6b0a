"""The front door for a scene: check, divide into clusters, answer each by its law, put together."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from fractions import Fraction
from numbers import Integral
from typing import Any, NamedTuple

from ..in_python import exact_fractions
from ..kernels import library
from ..model import DEFAULT, Adjustment, Geometry, ImpactModel, Precision, check_number, law_for, plan
from ..numbers.operations import Scalar
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.laws import Law, Regime
from ..physics.vector import Vec3
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from . import request
from .answer import SceneImpact
from .cluster_answer import ClusterAnswer, split_among_copies
from .clusters import Pair, distinct_contacts, find_clusters
from .order_sensitivity import order_sensitivity
from .reflections import REFLECTIONS
from .resolve_cluster import SceneOptions, resolve_cluster
from .single_contact import resolve_single_contact

THRESHOLD = 2.0**-30
"""An approach slower than this part of the fastest one does not count as one: no rounding decides it."""

COMPILED_LAWS = (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU)
"""The laws by which scenes are resolved without Python, where nothing is unusual."""

PRECISIONS = (Precision.DOUBLE, Precision.EXTENDED)

UNCHANGED = Twist(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))


def resolve_scene(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    model: ImpactModel = DEFAULT,
    *,
    threshold: Scalar = THRESHOLD,
    stiffness: Sequence[float] | None = None,
    exponent: float = 1.5,
    orders: int = 0,
) -> SceneImpact:
    """The twists of bodies after several contacts strike at once.

    Contacts that share a movable body, directly or through others, form a cluster; a cluster of one contact
    is :func:`~collision_response.resolve`. For several, the laws are those of ``docs/scenes.md``:

    =============  =======================================================================================
    FRICTIONLESS   generalised reflections, with one restitution for a cluster
    COULOMB        the same, then friction that does the least work; the default where there is friction
    MOREAU         Newton's restitution at each contact, as time steppers do
    ROUTH_STRONGE  springs that give back the part e^2 of their work; e >= 0.05
    =============  =======================================================================================

    Numbers that are :class:`fractions.Fraction` are computed with exactly, by FRICTIONLESS, and by MOREAU
    without friction.

    Args:
        bodies: that touch, or not.
        pairs: for each contact, the indices of its body_a and its body_b.
        contacts: where they touch; each normal points to its body_a.
        model: what to model, and how exactly. ``tangential_restitution`` is for clusters of one contact.
        threshold: an approach slower than this part of the fastest of its cluster does not count as one, in
            [0, 1): of FRICTIONLESS and COULOMB. Reflections jump where it does.
        stiffness: of each contact, in any unit, for ROUTH_STRONGE; left out, all are equal.
        exponent: of the contact forces, for ROUTH_STRONGE: 1 linear, 1.5 Hertz. At least 1, at most 10.
        orders: how many orders to try for ``order_sensitivity``, each of which takes longer than the answer.

    Raises:
        ImpactError: the request cannot be answered; ``field`` names the body, the pair or the contact.
        TypeError: a field is not of the kind that it should be.
        ValueError: there is not one pair, or not one stiffness, for each contact.
    """
    wanted = _kernel_model(model)
    if threshold is THRESHOLD and stiffness is None and exponent == 1.5 and orders == 0:
        found = library.resolve_scene(bodies, pairs, contacts, *wanted[:3]) if wanted.models else None
        if found is not None:
            return SceneImpact._make(found)
    scene = request.check(bodies, pairs, contacts)
    law = law_for(model.law, has_friction=scene.has_friction)
    exact = library.is_rational(scene.bodies) or library.is_rational(scene.contacts)
    _check_options(threshold, stiffness, exponent, orders, len(scene.contacts))
    asked = SceneOptions(model, law, threshold, stiffness, exponent, exact)
    if exact:
        scene = _as_fractions(scene, law)
    clusters = find_clusters(scene.pairs, scene.movable)
    answers = []
    for cluster in clusters:
        copies = distinct_contacts(cluster, scene.pairs, scene.contacts, join=law is not Law.ROUTH_STRONGE)
        if len(copies.first) == 1 and not (exact and law is Law.MOREAU):
            answered = resolve_single_contact(scene, cluster[0], model)
        else:
            answered = resolve_cluster(scene, copies, asked)
        if len(copies.first) < len(cluster):
            answered = split_among_copies(answered, scene, cluster, copies)
        answers.append(answered)
    answer = _put_together(scene, asked, wanted.numbers[2], clusters, answers)
    if orders:
        spread = order_sensitivity(scene.bodies, scene.pairs, answer.contacts, model, orders)
        answer = answer._replace(order_sensitivity=spread)
    return answer


def _put_together(
    scene: request.SceneRequest,
    asked: SceneOptions,
    limit: float,
    clusters: list[list[int]],
    answers: list[ClusterAnswer],
) -> SceneImpact:
    """The answer for the scene, from those for its clusters."""
    twists: list[Any] = [None] * len(scene.bodies)
    changes = [UNCHANGED] * len(scene.bodies)
    of_contacts: list[Any] = [None] * len(scene.contacts)
    energies: Sequence[Scalar] = [Fraction(0) if asked.exact else 0.0] * 4
    bound, margin, adjustments, law = 0.0, math.inf, 0, asked.law
    model = None
    for cluster, answered in zip(clusters, answers, strict=True):
        for place, change, twist in zip(answered.places, answered.changes, answered.twists, strict=True):
            changes[place], twists[place] = change, twist
        for i, row in zip(cluster, zip(*answered[3:8], strict=True), strict=True):
            of_contacts[i] = row
        energies = list(map(operator.add, energies, answered.energies))
        bound, margin = max(bound, answered.bound), min(margin, answered.margin)
        adjustments |= answered.adjustments
        if answered.adjustments & FELL_BACK and law is asked.law:
            law = answered.model.law
        model = answered.model if model is None else _of_both(model, answered.model)
    if model is None:
        model = ImpactModel(law, Geometry.SPATIAL, Precision.DOUBLE, *asked.model[3:])
    for place, twist in enumerate(twists):
        if twist is None:
            body = scene.bodies[place]
            twists[place] = Twist(Vec3(*body.velocity), Vec3(*body.angular_velocity))
            if scene.movable[place]:
                energy = _energy_of_untouched(place, body)
                energies = [energies[0] + energy, energies[1] + energy, *energies[2:]]
    if not (asked.exact or all(map(math.isfinite, energies))):
        raise library.refusal(StatusCode.OUT_OF_RANGE)
    contacts, impulses, before, after, regimes = zip(*of_contacts, strict=True) if of_contacts else ((),) * 5
    status = StatusCode.OK
    if bound > limit:
        status = StatusCode.TOLERANCE_NOT_MET
    elif regimes.count(Regime.SEPARATING) == len(regimes):
        status = StatusCode.SEPARATING
    return SceneImpact(
        status,
        model if model.law is law else model._replace(law=law),
        contacts,
        tuple(twists),
        tuple(changes),
        impulses,
        before,
        after,
        regimes,
        energies[0],
        energies[1],
        energies[2],
        energies[3],
        tuple(map(tuple, clusters)),
        None,
        bound,
        margin,
        ADJUSTMENTS[adjustments],
    )


ADJUSTMENTS = tuple(map(Adjustment, range(16)))
FELL_BACK = int(Adjustment.LAW_FALLBACK)


def _of_both(one: ImpactModel, other: ImpactModel) -> ImpactModel:
    """The greater geometry and precision of two clusters."""
    return one._replace(
        geometry=max(one.geometry, other.geometry), precision=max(one.precision, other.precision)
    )


def _as_fractions(scene: request.SceneRequest, law: Law) -> request.SceneRequest:
    """Raises: ImpactError: the law is not rational."""
    if not (law is Law.FRICTIONLESS or (law is Law.MOREAU and not scene.has_friction)):
        raise ImpactError(StatusCode.INVALID_MODEL, "model.law", f"{law.name} is not rational: give floats")
    return scene._replace(
        bodies=list(map(exact_fractions.body_as_fractions, scene.bodies)),
        contacts=list(map(exact_fractions.contact_as_fractions, scene.contacts)),
    )


class KernelModel(NamedTuple):
    """What a model comes to.

    Attributes:
        laws: without friction, and with.
        numbers: the threshold, the restitution threshold, the limit of error bounds, the budget of
            reflections.
        models: as used, by the number of the law and by precision; empty if the kernels leave all such
            scenes to Python.
    """

    laws: tuple[Law, Law]
    numbers: tuple[float, float, float, int]
    models: tuple[tuple[ImpactModel, ...], ...]


_last: tuple[Any, Any] = (None, None)
"""The last model, and what it comes to: many scenes are resolved by one."""


def _kernel_model(model: ImpactModel) -> KernelModel:
    """Raises: ImpactError, TypeError: the model is not sound."""
    global _last
    last, wanted = _last
    if model is not last:
        wanted = _wanted(model)
        _last = model, wanted
    return wanted


def _wanted(model: ImpactModel) -> KernelModel:
    found = plan(model)
    laws = found.law_without_friction, found.law_with_friction
    usual = model.geometry in (Geometry.AUTO, Geometry.SPATIAL) and not model.tangential_restitution
    models: tuple[tuple[ImpactModel, ...], ...] = ()
    if usual and laws[1] in COMPILED_LAWS:
        models = tuple(
            tuple(ImpactModel(law, Geometry.SPATIAL, precision, *model[3:]) for precision in PRECISIONS)
            for law in (Law.AUTO, *COMPILED_LAWS)
        )
    numbers = THRESHOLD, found.settings.restitution_threshold, found.limit, REFLECTIONS
    return KernelModel(laws, numbers, models)


def _check_options(threshold: Any, stiffness: Any, exponent: Any, orders: Any, count: int) -> None:
    check_number("threshold", threshold, 0, math.nextafter(1, 0), StatusCode.INVALID_MODEL)
    check_number("exponent", exponent, 1, 10, StatusCode.INVALID_MODEL)
    check_number("orders", orders, 0, math.inf, StatusCode.INVALID_MODEL)
    if not isinstance(orders, (int, Integral)):
        raise TypeError(f"orders: must be a whole number, is {orders!r}")
    if stiffness is not None:
        if len(stiffness) != count:
            raise ValueError(
                f"stiffness: must be one for each contact; are {len(stiffness)} for {count} contacts"
            )
        for i, k in enumerate(stiffness):
            check_number(f"stiffness[{i}]", k, math.nextafter(0, 1), math.inf, StatusCode.INVALID_MODEL)


PROBE = Body.dynamic(1.0)
NOWHERE = Contact.of((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def _energy_of_untouched(place: int, body: Body) -> Scalar:
    """Of a body without contacts, which must be sound too."""
    try:
        request.with_scene_names(request.ContactIndices(-1, place, -1), resolve, body, PROBE, NOWHERE)
    except ImpactError as error:
        if error.code is not StatusCode.OUT_OF_RANGE:
            raise
    return kinetic_energy(body)
