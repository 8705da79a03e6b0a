"""The front door for a scene: check it, divide it into clusters, resolve each, and combine their answers."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from ..arguments import as_list
from ..in_python.request_numbers import body_as_fractions, contact_as_fractions, read_request
from ..kernels import library
from ..model import DEFAULT, Adjustment, Geometry, ImpactModel, Precision, check_model, law_for, plan_model
from ..numbers.operations import Scalar
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.laws import Law, Regime
from ..physics.vector import Vec3
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from .answer import SceneImpact
from .assemble import with_frictions_as_numbers, with_numbers
from .cluster_result import ClusterAnswer, ImpulseEffect
from .copies import distinct_contacts, split_among_copies
from .find_clusters import find_clusters
from .frictionless import THRESHOLD
from .order_sensitivity import order_sensitivity
from .request import (
    ContactIndices,
    SceneOptions,
    SceneRequest,
    check_options,
    check_request,
    with_scene_names,
)
from .resolve_cluster import resolve_cluster

HERTZ = 1.5
"""The exponent of the force between two curved bodies, by Hertz."""


def resolve_scene(
    bodies: Sequence[Body],
    pairs: Iterable[Sequence[int]],
    contacts: Sequence[Contact],
    model: ImpactModel = DEFAULT,
    *,
    threshold: Scalar = THRESHOLD,
    stiffness: Iterable[float] | None = None,
    exponent: float = HERTZ,
    orders: int = 0,
) -> SceneImpact:
    """Compute the twists of bodies after several contacts strike at once.

    Contacts that share a movable body, directly or through other contacts, form a cluster. A cluster of one
    contact is resolved by :func:`~collision_response.resolve`. A cluster of several contacts is resolved by
    one of these laws, which ``docs/scenes.md`` compares:

    =============  =======================================================================================
    FRICTIONLESS   generalised reflections, with one restitution for each cluster
    COULOMB        FRICTIONLESS, then the friction that does the least work; AUTO, if there is friction
    MOREAU         Newton's restitution at each contact, as in time steppers
    ROUTH_STRONGE  springs that give back the fraction e^2 of their work; needs e >= 0.05; ignores gaps
    =============  =======================================================================================

    Numbers given as :class:`fractions.Fraction` are computed with exactly, by FRICTIONLESS and by MOREAU
    without friction.

    Args:
        bodies: all bodies of the scene. A body may have no contact.
        pairs: for each contact, the indices of its body_a and its body_b: N pairs.
        contacts: where the bodies touch. Each normal points towards the contact's body_a.
        model: what to model, and how exactly. ``precision`` and ``tangential_restitution`` are for clusters
            of one contact.
        threshold: for FRICTIONLESS and COULOMB, in [0, 1): approaches slower than this fraction of the
            fastest one in their cluster are ignored. The answer jumps where an approach reaches the
            threshold.
        stiffness: for ROUTH_STRONGE, the stiffness of each contact, > 0, in any unit. Equal if left out.
        exponent: for ROUTH_STRONGE, the exponent of the contact forces, in [1, 10]: 1 is linear, 1.5 is
            Hertz.
        orders: number of orders to try for ``order_sensitivity``, at most 1000. Each one takes longer than
            the answer.

    Returns:
        The twists of all bodies after the impact, the impulses, the energies, and a bound on the relative
        error.

    Raises:
        ImpactError: if the scene cannot be resolved; ``field`` names the body, the pair or the contact.
        TypeError: if a field has the wrong type.
        ValueError: if there is not one pair, or not one stiffness, for each contact.
    """
    has_usual_types = (
        stiffness is None
        and isinstance(threshold, float)
        and isinstance(exponent, float)
        and type(orders) is int
    )
    if has_usual_types and 0 <= threshold < 1 and exponent == HERTZ and orders == 0:
        answer = resolve_without_python(bodies, pairs, contacts, model, threshold)
        if answer is not None:
            return answer
    check_model(model)
    scene = check_request(bodies, pairs, contacts)
    if model.law is Law.AUTO:
        scene = with_frictions_as_numbers(scene)
    law = law_for(model.law, has_friction=scene.has_friction)
    exact = library.has_fraction(scene.bodies) or library.has_fraction(scene.contacts)
    if stiffness is not None:
        stiffness = as_list("stiffness", stiffness)
    check_options(threshold, stiffness, exponent, orders, len(scene.contacts))
    options = SceneOptions(model, law, threshold, stiffness, exponent, exact)
    if exact:
        scene = _as_fractions(scene, law)
    clusters = find_clusters(scene.pairs, scene.movable)
    answers = [_resolve_one(scene, cluster, options) for cluster in clusters]
    answer = _combine(scene, options, clusters, answers)
    if orders:
        answer = answer._replace(order_sensitivity=order_sensitivity(scene, clusters, model, orders))
    return answer


def resolve_without_python(
    bodies: Sequence[Body],
    pairs: Iterable[Sequence[int]],
    contacts: Sequence[Contact],
    model: ImpactModel,
    threshold: float = THRESHOLD,
) -> SceneImpact | None:
    """Return the answer of :func:`resolve_scene` if the kernels have it, and so within milliseconds."""
    fields = library.resolve_scene(bodies, pairs, contacts, model, threshold)
    return None if fields is None else SceneImpact._make(fields)


def _resolve_one(scene: SceneRequest, cluster: list[int], options: SceneOptions) -> ClusterAnswer:
    """Return the answer for one cluster, with an entry for each of its contacts."""
    law = options.law
    if len(cluster) > 1 or options.exact:  # else resolve() does that
        scene = with_numbers(scene, cluster, options)
    e_t = options.model.tangential_restitution
    distinct = distinct_contacts(cluster, scene.pairs, scene.contacts, law, e_t)
    if len(distinct.indices) == 1 and not (options.exact and law is Law.MOREAU):
        answer = _resolve_single_contact(scene, cluster[0], options.model)
    else:
        try:
            answer = resolve_cluster(scene, distinct, options)
        except ImpactError as error:
            raise _of_cluster(error, scene, cluster) from None
    if len(distinct.indices) < len(cluster):
        answer = split_among_copies(answer, scene, cluster, distinct)
    return answer


def _of_cluster(error: ImpactError, scene: SceneRequest, cluster: list[int]) -> ImpactError:
    """Return an error, with the contacts in the name of its field if it is about one of several clusters."""
    if error.field != "contacts" or len(cluster) == len(scene.contacts):
        return error
    some = ", ".join(map(str, cluster[:10])) + ", ..." * (len(cluster) > 10)
    return ImpactError(error.code, f"contacts[{some}]", error.reason)


def _resolve_single_contact(scene: SceneRequest, i: int, model: ImpactModel) -> ClusterAnswer:
    """Return the answer of :func:`~collision_response.resolve` for contact ``i``, to the last bit.

    Raises:
        ImpactError, TypeError: those of ``resolve``, with the fields named as in the scene.
    """
    bodies = scene.bodies
    a, b = scene.pairs[i]
    # resolve() refuses one object as both bodies, but two bodies of a scene may be one object.
    body_b = bodies[b] if bodies[b] is not bodies[a] else Body(*bodies[b])
    impact = with_scene_names(ContactIndices(i, a, b), resolve, bodies[a], body_b, scene.contacts[i], model)
    sides = ((a, impact.change_a, impact.twist_a), (b, impact.change_b, impact.twist_b))
    moved = [side for side in sides if scene.movable[side[0]]]
    effect = ImpulseEffect(
        changes=[change for _, change, _ in moved],
        twists=[twist for _, _, twist in moved],
        impulses=(impact.impulse,),
        normal_velocities_before=(impact.normal_velocity_before,),
        normal_velocities_after=(impact.normal_velocity_after,),
        regimes=(impact.regime,),
        energies=(
            impact.kinetic_energy_before,
            impact.kinetic_energy_after,
            impact.energy_lost_restitution,
            impact.energy_lost_friction,
        ),
        error_bound=impact.error_bound,
    )
    return ClusterAnswer(
        [body for body, _, _ in moved], (impact.contact,), effect, math.inf, impact.adjustments, impact.model
    )


PROBE, PROBE_CONTACT = Body.dynamic(1.0), Contact.of((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
"""A partner for a body, or for a contact, that is checked by itself."""


def _as_fractions(scene: SceneRequest, law: Law) -> SceneRequest:
    """Return the scene in fractions.

    Raises:
        ImpactError: if the law cannot be computed exactly.
        TypeError: if something is not a number.
    """
    if not (law is Law.FRICTIONLESS or (law is Law.MOREAU and not scene.has_friction)):
        raise ImpactError(StatusCode.INVALID_MODEL, "model.law", f"{law.name} is not rational: give floats")
    for i, body in enumerate(scene.bodies):
        with_scene_names(ContactIndices(-1, i, -1), library.numbers_with_errors, body, PROBE, PROBE_CONTACT)
    for i, contact in enumerate(scene.contacts):
        with_scene_names(ContactIndices(i, -1, -1), library.numbers_with_errors, PROBE, PROBE, contact)
    return scene._replace(
        bodies=list(map(body_as_fractions, scene.bodies)),
        contacts=list(map(contact_as_fractions, scene.contacts)),
    )


UNCHANGED = Twist(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
FELL_BACK = int(Adjustment.LAW_FALLBACK)


def _combine(
    scene: SceneRequest, options: SceneOptions, clusters: list[list[int]], answers: list[ClusterAnswer]
) -> SceneImpact:
    """Combine the answers for clusters into that for the scene."""
    twists: list[Any] = [None] * len(scene.bodies)
    changes = [UNCHANGED] * len(scene.bodies)
    rows: list[Any] = [None] * len(scene.contacts)
    energies: Sequence[Scalar] = [Fraction(0) if options.exact else 0.0] * 4
    bound, margin, adjustments = 0.0, math.inf, 0
    for cluster, answer in zip(clusters, answers, strict=True):
        effect = answer.effect
        for place, change, twist in zip(answer.bodies, effect.changes, effect.twists, strict=True):
            changes[place], twists[place] = change, twist
        columns = (
            answer.contacts,
            effect.impulses,
            effect.normal_velocities_before,
            effect.normal_velocities_after,
            effect.regimes,
        )
        for i, *row in zip(cluster, *columns, strict=True):
            rows[i] = row
        energies = list(map(operator.add, energies, effect.energies))
        bound, margin = max(bound, effect.error_bound), min(margin, answer.decision_margin)
        adjustments |= answer.adjustments
    for i, given in enumerate(scene.bodies):
        if twists[i] is None:  # it has no contact, or is immovable
            body = _read_body(i, given, options.exact)
            energy = kinetic_energy(body) if options.exact else library.kinetic_energy(body)
            energies = [energies[0] + energy, energies[1] + energy, *energies[2:]]
            twists[i] = body.twist
    if not (options.exact or all(map(math.isfinite, energies))):
        raise library.refusal(StatusCode.OUT_OF_RANGE)
    contacts, impulses, before, after, regimes = zip(*rows, strict=True) if rows else ((),) * 5
    status = StatusCode.OK
    if bound > plan_model(options.model).bound_limit:
        status = StatusCode.TOLERANCE_NOT_MET
    elif regimes.count(Regime.SEPARATING) == len(regimes):
        status = StatusCode.SEPARATING
    return SceneImpact(
        status=status,
        model=_model_used(options, answers),
        contacts=contacts,
        twists=tuple(twists),
        changes=tuple(changes),
        impulses=impulses,
        normal_velocities_before=before,
        normal_velocities_after=after,
        regimes=regimes,
        kinetic_energy_before=energies[0],
        kinetic_energy_after=energies[1],
        energy_lost_restitution=energies[2],
        energy_lost_friction=energies[3],
        clusters=tuple(map(tuple, clusters)),
        order_sensitivity=None,
        error_bound=bound,
        decision_margin=margin,
        adjustments=Adjustment(adjustments),
    )


def _model_used(options: SceneOptions, answers: list[ClusterAnswer]) -> ImpactModel:
    """Return the model with the law for several contacts, and the greatest geometry and precision used."""
    return ImpactModel(
        next((answer.model.law for answer in answers if answer.adjustments & FELL_BACK), options.law),
        max((answer.model.geometry for answer in answers), default=Geometry.SPATIAL),
        max((answer.model.precision for answer in answers), default=Precision.DOUBLE),
        *options.model[3:],
    )


def _read_body(i: int, body: Body, exact: bool) -> Body:
    """Return a body that no impulse changes, with its numbers as floats, or as they are if ``exact``.

    Raises:
        ImpactError, TypeError: if the body is invalid: those that ``resolve`` raises for it and a probe.
    """
    try:
        with_scene_names(ContactIndices(-1, i, -1), resolve, body, PROBE, PROBE_CONTACT)
    except ImpactError as error:
        if error.code is not StatusCode.OUT_OF_RANGE:
            raise
    return body if exact else read_request(body, PROBE, PROBE_CONTACT)[0]
