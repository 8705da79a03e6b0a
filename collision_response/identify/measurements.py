"""Measured impacts, and how far a law's predictions are from them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from ..arguments import as_list, finite_number, real_number
from ..batch import body_rows, contact_rows, resolve_batch
from ..batch.arrays import Array
from ..body_numbers import orientation_of
from ..in_python.request_numbers import read_request
from ..model import Geometry, ImpactModel
from ..physics.body import Body, Twist
from ..physics.centre_of_mass import com_in_world_axes, with_com_as_reference
from ..physics.contact import Contact
from ..physics.laws import Law
from ..physics.vector import Vec3, as_vector
from ..resolve import resolve
from ..status import ImpactError, StatusCode, format_value

CoefficientValues = Mapping[str, float]
"""Values by name: restitution, friction, or a field of :class:`~collision_response.ImpactModel`."""

ROUNDING = 1e-12
"""A component of a vector counts as 0 if it is at most this fraction of the largest component."""

BODY, CONTACT = body_rows(Geometry.SPATIAL, oriented=True), contact_rows(Geometry.SPATIAL)


class Measurements(Protocol):
    """Measurements of N impacts to which coefficients can be fitted."""

    kinds: tuple[str, ...]
    """Names of the available kinds of residuals. The first is the default."""

    def __len__(self) -> int:
        """The number of impacts."""

    def take(self, chosen: Array) -> Measurements:
        """Return the impacts with the given indices. An index may appear several times."""

    def approaching(self) -> Array:
        """Whether the bodies of each impact approach each other, shape ``(N,)``."""

    def residuals(self, law: Law, coefficients: CoefficientValues, kind: str) -> Array:
        """Return prediction minus measurement, shape ``(rows, N)``; 0 where nothing was measured."""

    def is_measured(self, kind: str) -> Array:
        """Whether a residual depends on any measured number, shape ``(rows, N)``."""

    def sizes(self, kind: str) -> Array:
        """Return the measurements in the same norm as the residuals, shape ``(rows, N)``."""

    def changes(self, kind: str) -> Array:
        """Return what the misfit is relative to, in the same norm: the changes by the impact, if known."""
        return self.sizes(kind)

    def rounding(self, kind: str) -> Array:
        """Return up to which size a difference of two residuals may be rounding, shape ``(N,)``."""


EXTREME_COEFFICIENTS = (0.0, 0.0), (1.0, 0.0), (0.0, 1e3)
"""Pairs of restitution and friction. A measurement that is predicted the same with all of them depends on
neither coefficient."""


def informative(measured: Measurements, kind: str) -> Measurements:
    """Return the impacts that depend on the coefficients, by residuals of one kind.

    In these the bodies approach, and a measurement after the impact depends on restitution or friction.
    """
    first, *others = (
        measured.residuals(Law.COULOMB, {"restitution": e, "friction": mu}, kind)
        for e, mu in EXTREME_COEFFICIENTS
    )
    least = measured.rounding(kind)
    depends = np.any([abs(one - first) > least for one in others], axis=0) & measured.is_measured(kind)
    return measured.take(np.flatnonzero(measured.approaching() & depends.any(axis=0)))


class Impacts(Measurements):
    """Twists of two bodies before and after each of N impacts. Use :meth:`of` to build them.

    There are three kinds of residuals. The squares of ``kinetic`` add up to twice the kinetic energy of the
    errors of the twists; ``linear`` is the part of it from linear velocities. ``contact`` is the error of the
    relative velocity at the contact point [m/s].
    """

    kinds = ("kinetic", "contact", "linear")

    def __init__(self, bodies: Array, contacts: Array, after: Array, root: Array) -> None:
        """Build the impacts from arrays.

        Args:
            bodies: the bodies before the impacts, in the rows for SPATIAL with orientations, shape
                ``(rows, 2, N)``; see :func:`~collision_response.batch.resolve_batch`.
            contacts: contact points and normals, shape ``(rows, N)``. The coefficients in them have no
                effect.
            after: measured velocities of the centres of mass and angular velocities after the impacts, in
                world axes [m/s, rad/s], shape ``(6, 2, N)``. NaN where nothing was measured.
            root: square roots of the inertias in world axes, ``root^T root = I`` [kg^(1/2) m], shape
                ``(3, 3, 2, N)``.
        """
        self.bodies, self.contacts, self.after, self.root = bodies, contacts, after, root

    @classmethod
    def of(
        cls,
        bodies_a: Sequence[Body],
        bodies_b: Sequence[Body],
        contacts: Sequence[Contact],
        after_a: Sequence[Twist],
        after_b: Sequence[Twist],
    ) -> Impacts:
        """Build the impacts from requests as for :func:`~collision_response.resolve`, and measured twists.

        Args:
            bodies_a, bodies_b: the bodies before the impacts. A factor on all masses and inertias of one
                impact changes no prediction, but it is the weight of that impact in the sum of squares of the
                residuals ``kinetic`` and ``linear``.
            contacts: the contacts. Their restitution and friction have no effect.
            after_a, after_b: measured twists of the reference points after the impacts, NaN where nothing was
                measured. Those of immovable bodies have no effect. If the centre of mass is not the reference
                point, its velocity is only known if the angular velocity is.

        Raises:
            ImpactError: if an impact breaks a rule of :func:`~collision_response.resolve`, a body is
                articulated (INVALID_INERTIA), or a measured number is infinite (NOT_FINITE). The field starts
                with the index of the impact.
            TypeError: if one of them holds something else.
            ValueError: if the sequences have different lengths.
        """
        given = bodies_a, bodies_b, contacts, after_a, after_b
        names = "bodies_a", "bodies_b", "contacts", "after_a", "after_b"
        lists = [as_list(name, values) for name, values in zip(names, given, strict=True)]
        lengths = n, *_ = [len(values) for values in lists]
        if lengths.count(n) < len(lengths):
            raise ValueError(f"{', '.join(names)}: must be of one length; have {lengths}")
        bodies, touches = np.zeros((BODY.height, 2, n)), np.zeros((CONTACT.height, n))
        after, root = np.zeros((6, 2, n)), np.zeros((3, 3, 2, n))
        for i, (a, b, contact, twist_a, twist_b) in enumerate(zip(*lists, strict=True)):
            a, b, contact = _read_request(f"impacts[{i}]", a, b, contact)
            touches[:, i] = *contact.position, *contact.normal, contact.restitution, contact.friction
            for side, (name, body, measured) in enumerate((("after_a", a, twist_a), ("after_b", b, twist_b))):
                twist = _read_twist(f"impacts[{i}].{name}", body, measured)
                _write_body(bodies[:, side, i], after[:, side, i], root[:, :, side, i], body, twist)
        return cls(bodies, touches, after, root)

    def __len__(self) -> int:
        return self.contacts.shape[1]

    def take(self, chosen: Array) -> Impacts:
        tables = self.bodies, self.contacts, self.after, self.root
        return Impacts(*(np.ascontiguousarray(table[..., chosen]) for table in tables))

    def approaching(self) -> Array:
        normals = self.contacts[CONTACT.normal]
        normals = normals / abs(normals).max(axis=0)  # of any length: no product must become 0
        return (self._at_contact(self._twists_before()) * normals).sum(axis=0) < 0

    def residuals(self, law: Law, coefficients: CoefficientValues, kind: str) -> Array:
        return self._in_norm(kind, self.predict(law, coefficients) - self.after)

    def is_measured(self, kind: str) -> Array:
        known = ~np.isnan(self.after) & np.isfinite(self.bodies[BODY.mass])
        linear, angular = known[:3], known[3:]
        if kind == "contact":
            acts = np.roll(self._lever_arms() != 0, 1, axis=0) & np.roll(angular, 2, axis=0)
            acts |= np.roll(self._lever_arms() != 0, 2, axis=0) & np.roll(angular, 1, axis=0)
            return (linear | acts).any(axis=1)
        turning = ((self.root != 0) & angular).any(axis=1)
        return _in_rows([linear] if kind == "linear" else [linear, turning])

    def sizes(self, kind: str) -> Array:
        return self._in_norm(kind, self.after)

    def changes(self, kind: str) -> Array:
        return self._in_norm(kind, self.after - self._twists_before())

    def rounding(self, kind: str) -> Array:
        before, after = self._twists_before(), self.predict(Law.FRICTIONLESS, {"restitution": 1.0})
        largest = [abs(self._in_norm(kind, twists)).max(axis=0) for twists in (before, after - before)]
        return np.asarray(ROUNDING * np.maximum(*largest))

    def predict(self, law: Law, coefficients: CoefficientValues) -> Array:
        """Return the twists after the impacts according to a law, in the layout of ``after``.

        Raises:
            ImpactError: if the law cannot answer an impact.
        """
        of_model: dict[str, Any] = {
            name: x for name, x in coefficients.items() if name in ImpactModel._fields
        }
        contacts = self.contacts.copy()
        contacts[CONTACT.restitution] = coefficients["restitution"]
        contacts[CONTACT.friction] = coefficients.get("friction", 0.0)
        result = resolve_batch(self.bodies, contacts, _model_of(law, **of_model))
        if (refused := np.flatnonzero(result.status > StatusCode.SEPARATING)).size:
            i = int(refused[0])
            raise ImpactError(
                StatusCode(int(result.status[i])), f"impacts[{i}]", f"{law.name} does not answer it"
            )
        return np.concatenate([result.velocity, result.angular_velocity])

    @np.errstate(over="ignore", invalid="ignore")  # an energy beyond float64 is NaN
    def nearest_impulses(self, kind: str) -> tuple[Array, Array, Array]:
        """Find the impulse at each contact point that comes nearest to the measurement, by no law.

        Returns:
            What these impulses miss, like :meth:`residuals`: no law misses less. By which factor they change
            the energy of the relative motion at the contact, shape ``(N,)``: by no law more than 1. And the
            speed of approach that they leave, as a part of that before, shape ``(N,)``: by no law above 0.
        """
        known, before = ~np.isnan(self.after), self._twists_before()
        side, mass = np.array([[1.0], [-1.0]]), self.bodies[BODY.mass][0]
        unit = mass.min(axis=0)
        inverse_root = np.sqrt(unit)[:, None, None] * np.linalg.pinv(np.moveaxis(self.root, (0, 1), (2, 3)))
        twists = []  # by impulses of size `unit` along each axis of the world
        for axis in np.eye(3)[:, :, None, None]:
            torque = np.cross(self._lever_arms(), axis, axis=0)
            spin = np.einsum("snij,snkj,ksn->isn", inverse_root, inverse_root, torque)
            twists.append(side * np.concatenate([axis * (unit / mass), spin]))
        effects = np.array([self._in_norm(kind, np.where(known, twist, 0.0)) for twist in twists]).T
        change = self.changes(kind)
        impulses = np.einsum("nkr,rn->nk", np.linalg.pinv(effects), change)
        to_contact = np.array([self._at_contact(twist) for twist in twists]).T
        u = self._at_contact(before).T
        u_after = u + np.einsum("nrk,nk->nr", to_contact, impulses)
        energies = [np.einsum("nr,nrk,nk->n", v, np.linalg.pinv(to_contact), v) for v in (u, u_after)]
        approach = [np.einsum("nr,rn->n", v, self.contacts[CONTACT.normal]) for v in (u, u_after)]
        missed = np.einsum("nrk,nk->rn", effects, impulses) - change
        return missed, energies[1] / energies[0], approach[1] / approach[0]

    def _in_norm(self, kind: str, twists: Array) -> Array:
        twists = np.nan_to_num(twists)
        if kind == "contact":
            return self._at_contact(twists)
        mass = self.bodies[BODY.mass][0]
        linear = np.sqrt(np.where(np.isinf(mass), 0.0, mass)) * twists[:3]
        angular = np.einsum("ijsn,jsn->isn", self.root, twists[3:])
        return _in_rows([linear] if kind == "linear" else [linear, angular])

    def _at_contact(self, twists: Array) -> Array:
        """Return the velocities of body_a relative to body_b at the contact points."""
        there = twists[:3] + np.cross(twists[3:], self._lever_arms(), axis=0)
        return there[:, 0] - there[:, 1]

    def _lever_arms(self) -> Array:
        return np.asarray(self.contacts[CONTACT.position][:, None] - self.bodies[BODY.position])

    def _twists_before(self) -> Array:
        return np.concatenate([self.bodies[BODY.velocity], self.bodies[BODY.angular_velocity]])


@lru_cache(maxsize=64)
def _model_of(law: Law, **fields: Any) -> ImpactModel:
    """Return a model, the same object each time: batches keep the plans of recent models."""
    return ImpactModel(law, **fields)


def _in_rows(parts: Sequence[Array]) -> Array:
    """Return numbers of both bodies, parts of shape ``(3, 2, N)``, as rows, shape ``(rows, N)``."""
    both = np.concatenate(parts)
    return both.reshape(both.shape[0] * both.shape[1], both.shape[2])


def _read_request(field: str, body_a: Body, body_b: Body, contact: Contact) -> tuple[Body, Body, Contact]:
    """Return a request with floats. It must have an answer, whatever its coefficients, and rigid bodies."""
    given = ("body_a", body_a, Body), ("body_b", body_b, Body), ("contact", contact, Contact)
    for name, value, kind in given:
        if not isinstance(value, kind):
            raise TypeError(f"{field}.{name}: must be a {kind.__name__}, is {format_value(value)}")
    contact = contact._replace(restitution=1.0, friction=0.0)
    try:
        resolve(body_a, body_b, contact)
    except ImpactError as error:
        raise error.within(field) from None
    except TypeError as error:
        raise TypeError(f"{field}.{error}") from None
    for name, body in (("body_a", body_a), ("body_b", body_b)):
        if body.is_articulated():
            reason = "is of a mechanism: give rigid bodies"
            raise ImpactError(StatusCode.INVALID_INERTIA, f"{field}.{name}.inverse_inertia", reason)
    return read_request(body_a, body_b, contact)


def _read_twist(field: str, body: Body, twist: Twist) -> Twist:
    """Return a measured twist with floats. That of an immovable body has no effect."""
    if not isinstance(twist, Twist):
        raise TypeError(f"{field}: must be a Twist, is {format_value(twist)}")
    if not body.is_movable():
        return twist
    parts = zip(twist._fields, twist, strict=True)
    return Twist(*(_read_vector(f"{field}.{name}", vector) for name, vector in parts))


def _read_vector(field: str, vector: Sequence[Any]) -> Vec3:
    """Return a measured vector with floats. Each is finite, or NaN: not measured."""
    numbers = (real_number(field, x) for x in as_vector(field, vector))
    return Vec3(*(math.nan if x != x else finite_number(field, x) for x in numbers))


def _write_body(column: Array, after: Array, root: Array, body: Body, twist: Twist) -> None:
    """Write one body of one impact into the arrays of :class:`Impacts`, at its centre of mass."""
    centre = with_com_as_reference(body)
    column[BODY.mass], column[BODY.inertia], column[BODY.position] = body.mass, body.inertia, centre.position
    column[BODY.orientation] = orientation_of(body)
    column[BODY.velocity], column[BODY.angular_velocity] = centre.velocity, body.angular_velocity
    if not body.is_movable():
        after[:3], after[3:] = centre.velocity, body.angular_velocity
        return
    after[:3], after[3:] = _com_velocity(body, twist), twist.angular
    moments, axes = np.linalg.eigh(np.array(body.inertia.rows()))
    across = [body.to_world(Vec3(*axis)) for axis in axes.T.tolist()]
    root[...] = np.sqrt(np.maximum(moments, 0.0))[:, None] * np.array(across)


def _com_velocity(body: Body, twist: Twist) -> Vec3:
    """Return the velocity of the centre of mass, NaN only in components that depend on unmeasured ones."""
    c, w = com_in_world_axes(body), twist.angular
    least = ROUNDING * max(map(abs, c))

    def part(spin: float, arm: float) -> float:
        return spin * arm if abs(arm) > least else 0.0

    turned = Vec3(
        part(w.y, c.z) - part(w.z, c.y), part(w.z, c.x) - part(w.x, c.z), part(w.x, c.y) - part(w.y, c.x)
    )
    return twist.linear + turned
