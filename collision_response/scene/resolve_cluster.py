"""Resolve a cluster of several contacts: assemble it, apply a law, and put the answer together."""

from __future__ import annotations

from ..arguments import check_number
from ..geometry import suffices
from ..kernels import library
from ..model import Adjustment, Geometry, ImpactModel, Precision, law_for
from ..physics.laws import CLUSTER_LAWS, Law
from ..status import ImpactError, StatusCode
from .assemble import ClusterParts, assemble
from .cluster_result import ClusterAnswer, ClusterResult
from .copies import DistinctContacts
from .in_fractions import decide, resolve_in_fractions
from .in_kernels import resolve_in_kernels
from .rational_cluster import RationalCluster, contradiction
from .request import SceneOptions, SceneRequest


def resolve_cluster(scene: SceneRequest, distinct: DistinctContacts, options: SceneOptions) -> ClusterAnswer:
    """Return the answer by a law for the distinct contacts of a cluster.

    Raises:
        ImpactError: if the cluster cannot be resolved; ``field`` names the body or the contact.
        TypeError: if something is not a number.
    """
    model, law = options.model, options.law
    if law not in CLUSTER_LAWS:
        reason = f"{law.name} is for clusters of one contact: try ROUTH_STRONGE"
        raise ImpactError(StatusCode.INVALID_MODEL, "model.law", reason)
    cluster, parts, below_restitution_threshold = assemble(scene, distinct, options)
    if model.geometry in (Geometry.POINT, Geometry.PLANAR):
        _check_geometry(parts, model.geometry)
    has_friction = (
        scene.has_friction
        and law is not Law.FRICTIONLESS
        and any([contact.friction > 0 for contact in parts.contacts])
    )
    _check_tangential_restitution(parts, model, law_for(model.law, has_friction=has_friction))
    if isinstance(cluster, RationalCluster):
        result = resolve_in_fractions(cluster, law, options.threshold)
    else:
        result = resolve_in_kernels(cluster, parts, options, law)
        if result.code == StatusCode.UNSET:
            result = decide(cluster, parts, options, has_friction=has_friction)
    _check_result(result, parts)
    if result.adjustments & Adjustment.LAW_FALLBACK:
        law = Law.COULOMB if has_friction else Law.FRICTIONLESS
    e, contacts = result.restitution, parts.contacts
    if e is not None:
        contacts = [c if c.restitution == e else c._replace(restitution=e) for c in contacts]
    in_doubles = has_friction or law is Law.ROUTH_STRONGE
    return ClusterAnswer(
        bodies=[body for body in parts.body_indices if scene.movable[body]],
        contacts=contacts,
        effect=result.effect,
        decision_margin=result.margin,
        adjustments=result.adjustments | below_restitution_threshold * Adjustment.RESTITUTION_THRESHOLD,
        model=ImpactModel(
            law,
            Geometry.SPATIAL if model.geometry is Geometry.AUTO else model.geometry,
            Precision.DOUBLE if in_doubles else Precision.EXTENDED,
            *model[3:],
        ),
    )


def _check_result(result: ClusterResult, parts: ClusterParts) -> None:
    """Raises: ImpactError: if a law has no answer."""
    code = result.code
    if code == StatusCode.CONTRADICTORY_CONTACTS:
        raise contradiction()
    if code == StatusCode.INVALID_COEFFICIENT:
        i, e = parts.indices[result.faulty], parts.contacts[result.faulty].restitution
        raise ImpactError(StatusCode(code), f"contacts[{i}].restitution", f"{result.fault}, is {e}")
    if code == StatusCode.PATH_TOO_LONG:
        raise ImpactError(StatusCode(code), "contacts", result.fault)
    if code != StatusCode.OK:
        raise library.refusal(code)


def _check_tangential_restitution(parts: ClusterParts, model: ImpactModel, law: Law) -> None:
    """Raises: ImpactError, TypeError: if one is invalid, or not 0 though the law reads it."""
    for i, contact in zip(parts.indices, parts.contacts, strict=True):
        own = contact.tangential_restitution
        place, e_t = ("model", model.tangential_restitution) if own is None else (f"contacts[{i}]", own)
        check_number(f"{place}.tangential_restitution", e_t, -1, 1, StatusCode.INVALID_COEFFICIENT)
        if e_t and law is Law.COULOMB:
            reason = f"must be 0 for clusters of several contacts, is {e_t}"
            raise ImpactError(StatusCode.INVALID_MODEL, f"{place}.tangential_restitution", reason)


def _check_geometry(parts: ClusterParts, geometry: Geometry) -> None:
    """Raises: ImpactError: INVALID_MODEL, if the geometry leaves out motion that the cluster has."""
    for request in parts.in_fractions():
        if not suffices(geometry, *request, frictionless=False):
            reason = f"{geometry.name} leaves out motion of this cluster: use AUTO or SPATIAL"
            raise ImpactError(StatusCode.INVALID_MODEL, "model.geometry", reason)
