"""The front door for a scene: check, divide into clusters, answer each by its law, put together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from ..geometry import required
from ..kernels import library
from ..model import Adjustment, Geometry, ImpactModel, Precision, check_number, law_for, plan
from ..numbers.number import Scalar
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.laws import Law, Regime
from ..physics.vector import Vec3
from ..resolve import DEFAULT, resolve
from ..status import ImpactError, StatusCode
from . import request
from .answer import SceneImpact
from .clusters import Pair, clusters_of
from .coulomb import with_friction
from .moreau import one_step
from .orders import distance, order_sensitivity
from .rational import RationalCluster
from .reflections import Struck, compiled_reflections, reflections
from .stronge import LEAST_RESTITUTION, compressed

THRESHOLD = 2.0**-30
"""An approach slower than this part of the fastest one does not count as one: no rounding decides it."""

RATIONAL_CONTACTS = 8
"""Clusters up to this size are decided in rationals where double-double can't."""

ENERGY_ROUNDING = 2.0**-40
"""Part of the energy before that a law may seem to create by rounding."""


UNCHANGED = Twist(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))


class Options(NamedTuple):
    """What else is asked: see :func:`resolve_scene`."""

    model: ImpactModel
    law: Law
    threshold: Scalar
    stiffness: Sequence[float] | None
    exponent: float


class Answered(NamedTuple):
    """What became of one cluster. Of bodies and contacts there is one entry each, in its order."""

    changes: Sequence[Twist]
    twists: Sequence[Twist]
    impulses: Sequence[Vec3]
    before: Sequence[Scalar]
    after: Sequence[Scalar]
    energies: tuple[Scalar, Scalar, Scalar, Scalar]
    bound: float
    margin: Scalar
    contacts: Sequence[Contact]
    regimes: Sequence[Regime]
    adjustments: Adjustment
    model: ImpactModel


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
    bodies, pairs, contacts = request.check_shape(bodies, pairs, contacts)
    limit = _limit_of(model)
    exact = library.is_rational(bodies) or library.is_rational(contacts)
    has_friction = any([request.has_friction(i, contact) for i, contact in enumerate(contacts)])
    law = law_for(model.law, has_friction=has_friction)
    if not (threshold is THRESHOLD and stiffness is None and exponent == 1.5 and orders == 0):
        _check_options(threshold, stiffness, exponent, orders, len(contacts))
    options = Options(model, law, threshold, stiffness, exponent)
    if exact:
        if law not in (Law.FRICTIONLESS, Law.MOREAU) or (
            law is Law.MOREAU and any(c.friction > 0 for c in contacts)
        ):
            raise ImpactError(
                StatusCode.INVALID_MODEL, "model.law", f"{law.name} is not rational: give floats"
            )
        bodies = list(map(request.as_fractions, bodies))
        contacts = list(map(request.contact_as_fractions, contacts))
    movable = [request.is_movable(i, body) for i, body in enumerate(bodies)]
    clusters = clusters_of(pairs, movable)

    twists: list[Any] = [None] * len(bodies)
    changes = [UNCHANGED] * len(bodies)
    of_contacts: list[Any] = [None] * len(contacts)
    energies = [0.0, 0.0, 0.0, 0.0] if not exact else [Fraction(0)] * 4
    bound, margin, adjustments, models = 0.0, math.inf, Adjustment.NONE, []
    for cluster in clusters:
        parts, of_parts = _parts(pairs, contacts, cluster, join=law is not Law.ROUTH_STRONGE)
        if len(parts.contacts) == 1 and not exact:
            answered, places = _alone(bodies, pairs, contacts, cluster, model)
        else:
            parts.bodies.extend(bodies[i] for i in of_parts)
            answered = _together(parts, pairs, contacts, cluster, options, exact)
            places = [i for i in of_parts if movable[i]]
        for place, change, twist in zip(places, answered.changes, answered.twists, strict=True):
            changes[place], twists[place] = change, twist
        rows = zip(
            answered.contacts,
            answered.impulses,
            answered.before,
            answered.after,
            answered.regimes,
            strict=True,
        )
        for i, row in zip(cluster, rows, strict=True):
            of_contacts[i] = row
        energies = [x + y for x, y in zip(energies, answered.energies, strict=True)]
        bound, margin = max(bound, answered.bound), min(margin, answered.margin)
        adjustments |= answered.adjustments
        models.append(answered.model)
    for place, body in enumerate(bodies):
        if twists[place] is None:
            twists[place] = Twist(Vec3(*body.velocity), Vec3(*body.angular_velocity))
            if movable[place]:
                energy = _energy_of_untouched(place, body)
                energies[0] += energy
                energies[1] += energy
    used, impulses, before, after, regimes = zip(*of_contacts, strict=True) if contacts else ((),) * 5
    separating = all([regime is Regime.SEPARATING for regime in regimes])
    status = StatusCode.SEPARATING if separating else StatusCode.OK
    fallen = [m.law for m in models if adjustments & Adjustment.LAW_FALLBACK and m.law is not law]
    return SceneImpact(
        status if bound <= limit else StatusCode.TOLERANCE_NOT_MET,
        ImpactModel(
            fallen[0] if fallen else law,
            max([m.geometry for m in models], default=Geometry.SPATIAL),
            max([m.precision for m in models], default=Precision.DOUBLE),
            *model[3:],
        ),
        used,
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
        order_sensitivity(bodies, pairs, used, model, orders) if orders else None,
        bound,
        margin,
        adjustments,
    )


_checked: tuple[Any, float] = (None, 0.0)
"""The last model, and its limit: many scenes are resolved by one."""


def _limit_of(model: ImpactModel) -> float:
    """The error bound above which the tolerance is not met, of a model that is sound."""
    global _checked
    last, limit = _checked
    if model is not last:
        limit = plan(model).limit
        _checked = model, limit
    return limit


def _check_options(threshold: Any, stiffness: Any, exponent: Any, orders: Any, count: int) -> None:
    check_number("threshold", threshold, 0, math.nextafter(1, 0), StatusCode.INVALID_MODEL)
    check_number("exponent", exponent, 1, 10, StatusCode.INVALID_MODEL)
    check_number("orders", orders, 0, math.inf, StatusCode.INVALID_MODEL)
    if stiffness is not None:
        if len(stiffness) != count:
            raise ValueError(
                f"stiffness: must be one for each contact; are {len(stiffness)} for {count} contacts"
            )
        for i, k in enumerate(stiffness):
            check_number(f"stiffness[{i}]", k, math.nextafter(0, 1), math.inf, StatusCode.INVALID_MODEL)


def _alone(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    cluster: Sequence[int],
    model: ImpactModel,
) -> tuple[Answered, list[int]]:
    """A cluster of one contact, perhaps given several times."""
    i, count = cluster[0], len(cluster)
    a, b = pairs[i]
    body_b = bodies[b] if bodies[b] is not bodies[a] else Body(*bodies[b])  # two bodies may be equal
    try:
        impact = resolve(bodies[a], body_b, contacts[i], model)
    except ImpactError as error:
        raise request.renamed(error, request.Name(i, a, b)) from None
    except TypeError as error:
        raise TypeError(request.named(str(error), request.Name(i, a, b))) from None
    sides = ((a, impact.change_a, impact.twist_a), (b, impact.change_b, impact.twist_b))
    moved = [side for side in sides if bodies[side[0]].is_movable()]
    shares = [impact.impulse if count == 1 else impact.impulse * (1 / count)]
    shares += [shares[0] if pairs[k] == (a, b) else -shares[0] for k in cluster[1:]]
    used = [impact.contact]
    for k in cluster[1:]:
        used.append(
            contacts[k]._replace(restitution=impact.contact.restitution, friction=impact.contact.friction)
        )
    answered = Answered(
        [change for _, change, _ in moved],
        [twist for _, _, twist in moved],
        shares,
        [impact.normal_velocity_before] * count,
        [impact.normal_velocity_after] * count,
        (
            impact.kinetic_energy_before, impact.kinetic_energy_after,
            impact.energy_lost_restitution, impact.energy_lost_friction,
        ),
        impact.error_bound,
        math.inf,
        used,
        [impact.regime] * count,
        impact.adjustments,
        impact.model,
    )  # fmt: skip
    return answered, [place for place, _, _ in moved]


class Parts(NamedTuple):
    """A cluster by itself: its bodies, and its contacts each once, with how often each was given.

    Attributes:
        bodies, pairs, contacts, copies: the pairs by places among the bodies.
        place_of: for each contact of the cluster, its place among those, and -1 if its bodies were swapped.
        field_of: for each contact here, its index in the scene.
    """

    bodies: list[Body]
    pairs: list[Pair]
    contacts: list[Contact]
    copies: list[int]
    place_of: list[tuple[int, int]]
    field_of: list[int]


def _parts(
    pairs: Sequence[Pair], contacts: Sequence[Contact], cluster: Sequence[int], *, join: bool
) -> tuple[Parts, list[int]]:
    """The parts of a cluster, and the indices of its bodies in the scene."""
    places: dict[int, int] = {}
    known: dict[Any, int] = {}
    parts = Parts([], [], [], [], [], [])
    for i in cluster:
        (a, b), contact = pairs[i], contacts[i]
        local = places.setdefault(a, len(places)), places.setdefault(b, len(places))
        key: Any = i
        if join:
            key = (a, b, contact)
            if a > b:
                key = b, a, contact._replace(normal=Vec3(*(-x for x in contact.normal)))
        try:
            place = known.setdefault(key, len(known))
        except TypeError:  # of lists or arrays, which have no hash
            place = known.setdefault(i, len(known))
        if place == len(parts.contacts):
            parts.pairs.append(local)
            parts.contacts.append(contact)
            parts.copies.append(1)
            parts.field_of.append(i)
            parts.place_of.append((place, 1))
        else:
            parts.copies[place] += 1
            first = pairs[parts.field_of[place]]
            parts.place_of.append((place, 1 if first == (a, b) else -1))
    return parts, list(places)


def _together(
    parts: Parts,
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    cluster: Sequence[int],
    options: Options,
    exact: bool,
) -> Answered:
    """A cluster of several contacts."""
    model, law = options.model, options.law
    if law in (Law.ROUTH_POISSON, Law.COMPLIANT):
        raise ImpactError(
            StatusCode.INVALID_MODEL,
            "model.law",
            f"{law.name} is for clusters of one contact: try ROUTH_STRONGE",
        )
    for i in cluster if law is Law.COULOMB else ():
        own = contacts[i].tangential_restitution
        field, e_t = ("model", model.tangential_restitution) if own is None else (f"contacts[{i}]", own)
        if e_t:
            raise ImpactError(
                StatusCode.INVALID_MODEL,
                f"{field}.tangential_restitution",
                f"must be 0 for clusters of several contacts, is {e_t}",
            )
    if law is Law.FRICTIONLESS:
        for place, contact in enumerate(parts.contacts):
            if 0 < contact.friction < math.inf:
                parts.contacts[place] = contact._replace(friction=contact.friction * 0)
    slow = Adjustment.NONE
    has_function = any([callable(contact.restitution) for contact in parts.contacts])
    placeholder = parts
    if has_function:
        simple = [c._replace(restitution=1.0) if callable(c.restitution) else c for c in parts.contacts]
        placeholder = parts._replace(contacts=simple)
    kinetics, placeholder = _assembled(placeholder, pairs, exact)
    if model.geometry in (Geometry.POINT, Geometry.PLANAR):
        _check_geometry(placeholder, model.geometry)
    if has_function or model.restitution_threshold:
        speeds = [-u for u in kinetics.answer(kinetics.none(), None, 0.0)[3]]
        fastest = max(0.0, *speeds)
        final = []
        for original, contact, speed, i in zip(
            parts.contacts, placeholder.contacts, speeds, parts.field_of, strict=True
        ):
            e = contact.restitution
            if callable(original.restitution):
                e = request.restitution_of(original, i, float(speed if speed > 0 else fastest))
            if 0 < speed < model.restitution_threshold and e > 0:
                e, slow = e * 0, Adjustment.RESTITUTION_THRESHOLD
            final.append(contact._replace(restitution=Fraction(e) if exact else float(e)))
        kinetics, placeholder = _assembled(placeholder._replace(contacts=final), pairs, exact)
    parts = placeholder
    has_friction = law is not Law.FRICTIONLESS and any([contact.friction > 0 for contact in parts.contacts])

    struck, bound, motions = _by_law(kinetics, parts, options, exact, has_friction)
    used_law = law
    if struck.fell_back:
        used_law = Law.COULOMB if has_friction else Law.FRICTIONLESS
        slow |= Adjustment.LAW_FALLBACK
    changes, twists, impulses, before, after, *energies, own_bound, (slips, idle, off_unit) = motions
    if off_unit:
        slow |= Adjustment.NORMALISED_ORIENTATION
    if idle:
        slow |= Adjustment.MASSLESS_SPIN
    regimes = [
        _regime(impulse, contact.friction, slip, used_law)
        for impulse, contact, slip in zip(impulses, parts.contacts, slips, strict=True)
    ]
    used = parts.contacts
    if struck.restitution is not None:
        used = [
            c if c.restitution == struck.restitution else c._replace(restitution=struck.restitution)
            for c in used
        ]
    exactness = Precision.DOUBLE if has_friction or used_law is Law.ROUTH_STRONGE else Precision.EXTENDED
    geometry = Geometry.SPATIAL if model.geometry is Geometry.AUTO else model.geometry
    answered = Answered(
        changes,
        twists,
        impulses,
        before,
        after,
        tuple(energies),
        own_bound if bound is None else bound,
        struck.margin,
        used,
        regimes,
        slow,
        ImpactModel(used_law, geometry, exactness, *model[3:]),
    )
    return answered if len(used) == len(cluster) else _dealt(answered, parts, contacts, cluster, exact)


def _dealt(
    answered: Answered, parts: Parts, contacts: Sequence[Contact], cluster: Sequence[int], exact: bool
) -> Answered:
    """What each of several equal contacts has of what they have together."""

    def share(place: int, sign: int) -> Vec3:
        copies = parts.copies[place]
        return answered.impulses[place] * (Fraction(sign, copies) if exact else sign / copies)

    def used(i: int, place: int, sign: int) -> Contact:
        own = answered.contacts[place]
        return own if sign > 0 else contacts[i]._replace(restitution=own.restitution, friction=own.friction)

    places = [place for place, _ in parts.place_of]
    return answered._replace(
        impulses=[share(place, sign) for place, sign in parts.place_of],
        before=[answered.before[place] for place in places],
        after=[answered.after[place] for place in places],
        contacts=[used(i, *which) for i, which in zip(cluster, parts.place_of, strict=True)],
        regimes=[answered.regimes[place] for place in places],
    )


def _assembled(parts: Parts, pairs: Sequence[Pair], exact: bool) -> tuple[Any, Parts]:
    """What impulses do in a cluster, and its parts in the numbers that are used."""
    if not exact:
        made = library.assemble(parts.bodies, parts.pairs, parts.contacts, parts.copies)
        if made.__class__ is library.Cluster:
            return made, parts
    names = [request.Name(i, *pairs[i]) for i in parts.field_of]
    if not exact:
        if made is None:
            bodies, contacts = request.as_floats(parts.bodies, parts.pairs, parts.contacts, names)
            parts = parts._replace(bodies=bodies, contacts=contacts)
            made = library.assemble(parts.bodies, parts.pairs, parts.contacts, parts.copies)
        if made.__class__ is library.Cluster:
            return made, parts
    for (a, b), contact, name in zip(parts.pairs, parts.contacts, names, strict=True):
        request.check_contact(parts.bodies[a], parts.bodies[b], contact, name)
    if not exact:
        raise ImpactError(StatusCode.INTERNAL_ERROR, "contacts", "were refused for no known reason")
    return RationalCluster(parts.bodies, parts.pairs, parts.contacts), parts


def _by_law(
    cluster: Any, parts: Parts, options: Options, exact: bool, has_friction: bool
) -> tuple[Struck, float | None, Any]:
    """What the law gives; the relative error, where the law estimates it; what becomes of the bodies."""
    law = options.law
    if law is Law.MOREAU:
        struck = one_step(cluster, has_friction=has_friction)
        if struck is not None:
            motions = cluster.answer(struck.p, struck.tangential, struck.error)
            lost, energy = motions[7] + motions[8], motions[5]
            if lost >= (0 if exact else -ENERGY_ROUNDING * energy):
                return struck, None, motions
        struck = _by_reflections(cluster, parts, options, has_friction)._replace(fell_back=True)
    elif law is Law.ROUTH_STRONGE:
        return _by_springs(cluster, parts, options, has_friction)
    else:
        struck = _by_reflections(cluster, parts, options, has_friction)
    return struck, None, cluster.answer(struck.p, struck.tangential, struck.error)


def _by_reflections(cluster: Any, parts: Parts, options: Options, has_friction: bool) -> Struck:
    if cluster.locked:
        struck = _decided_in_rationals(cluster, parts, options)
        if struck is None:
            reason = f"more than {RATIONAL_CONTACTS} press on each other without end, as a ball between walls"
            raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
    else:
        if isinstance(cluster, RationalCluster):
            struck = reflections(cluster, options.threshold)
        else:
            struck = compiled_reflections(cluster, float(options.threshold))
        if struck.error == math.inf:
            struck = _decided_in_rationals(cluster, parts, options) or struck
    return with_friction(cluster, struck) if has_friction else struck


def _decided_in_rationals(cluster: Any, parts: Parts, options: Options) -> Struck | None:
    """The impulses of GRR, exact but for the rounding of each; ``None`` for clusters too large for that."""
    if len(parts.contacts) > RATIONAL_CONTACTS:
        return None
    bodies = list(map(request.as_fractions, parts.bodies))
    contacts = list(map(request.contact_as_fractions, parts.contacts))
    exactly = RationalCluster(bodies, parts.pairs, contacts)
    struck = reflections(exactly, Fraction(options.threshold))
    p = cluster.from_floats([float(x) for x in exactly.least_norm(struck.p)])
    restitution = None if struck.restitution is None else float(struck.restitution)
    return Struck(p, None, cluster.size(p) * 2.0**-53, float(struck.margin), restitution)


def _by_springs(
    cluster: Any, parts: Parts, options: Options, has_friction: bool
) -> tuple[Struck, float, Any]:
    movable = [body for body in parts.bodies if body.is_movable()]

    def motions_of(struck: Struck) -> Any:
        return cluster.answer(struck.p, struck.tangential, 0.0)

    def apart(one: Struck, other: Struck) -> float:
        return distance(movable, motions_of(one)[0], motions_of(other)[0])

    if not cluster.approach()[0] > 0:
        struck = Struck(cluster.none())
        return struck, 0.0, motions_of(struck)
    given = options.stiffness
    stiffness = [1.0] * len(parts.contacts) if given is None else [float(given[i]) for i in parts.field_of]
    restitution = [contact.restitution for contact in parts.contacts]
    least = min(restitution)
    if least < LEAST_RESTITUTION:
        field = f"contacts[{parts.field_of[restitution.index(least)]}].restitution"
        reason = f"must be at least {LEAST_RESTITUTION} for ROUTH_STRONGE in a cluster, is {least}"
        raise ImpactError(StatusCode.PATH_TOO_LONG, field, reason)
    struck, error = compressed(
        cluster, stiffness, float(options.exponent), options.model.tolerance,
        has_friction=has_friction, apart=apart,
    )  # fmt: skip
    return struck, error, motions_of(struck)


def _check_geometry(parts: Parts, geometry: Geometry) -> None:
    for (a, b), contact in zip(parts.pairs, parts.contacts, strict=True):
        if required(parts.bodies[a], parts.bodies[b], contact, frictionless=False) > geometry:
            reason = (
                f"{geometry.name} leaves out motion that matters, which a cluster of several contacts can't"
            )
            raise ImpactError(StatusCode.INVALID_MODEL, "model.geometry", reason)


AT_REST = 2.0**-20
"""Of slip, relative to the fastest speed before, and of what friction lacks to its limit: this is none."""


def _regime(impulse: Vec3, friction: Scalar, slip: tuple[float, float, float], law: Law) -> Regime:
    if not any(impulse):
        return Regime.SEPARATING
    speed, back, share = slip
    if friction == 0:
        return Regime.SLIDING
    if speed < AT_REST if law is Law.ROUTH_STRONGE else share < 1 - AT_REST:
        return Regime.STICKING
    return Regime.REVERSED if back < 0 else Regime.SLIDING


PROBE = Body.dynamic(1.0)
NOWHERE = Contact.of((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def _energy_of_untouched(place: int, body: Body) -> Scalar:
    """Of a body without contacts, which must be sound too."""
    try:
        resolve(body, PROBE, NOWHERE)
    except ImpactError as error:
        if error.code is not StatusCode.OUT_OF_RANGE:
            raise ImpactError(
                error.code, error.field.replace("body_a", f"bodies[{place}]"), error.reason
            ) from None
    except TypeError as error:
        raise TypeError(str(error).replace("body_a", f"bodies[{place}]")) from None
    return kinetic_energy(body)
