"""Measurements impacts, and how far a law's predictions are from them.

:class:`Impacts` has the twists of both bodies, :class:`SphereReadings` what papers print of a sphere on a
flat target.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from ..batch import body_rows, contact_rows, resolve_batch
from ..body_conversions import IDENTITY_QUATERNION, com_in_world_axes, with_com_as_reference
from ..model import Geometry, ImpactModel, Law
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.vector import Vec3
from ..resolve import resolve
from ..status import ImpactError, StatusCode

Array = np.ndarray[Any, Any]
CoefficientValues = Mapping[str, float]
"""By name: restitution, friction, or a field of :class:`~collision_response.ImpactModel`."""

ROUNDING = 1e-12
"""A component of a vector so much smaller than it is what rounding left of 0."""

BODY, CONTACT = body_rows(Geometry.SPATIAL, oriented=True), contact_rows(Geometry.SPATIAL)


class Measurements(Protocol):
    """What coefficients can be fitted to."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of residuals there are, the first of them the best."""

    def __len__(self) -> int:
        """The number of impacts."""

    def take(self, chosen: Array) -> Measurements:
        """Some of the impacts, by number, each as often as it is named."""

    def approaching(self) -> Array:
        """Whether the bodies approach each other, shape ``(N,)``."""

    def residuals(self, law: Law, coefficients: CoefficientValues, kind: str) -> Array:
        """Predicted less measured, shape ``(rows, N)``; 0 where nothing was measured."""

    def is_measured(self, kind: str) -> Array:
        """Whether a residual has anything measured in it, shape ``(rows, N)``."""

    def sizes(self, kind: str) -> Array:
        """What was measured, in the same norm as the residuals, shape ``(rows, N)``."""


EXTREME_COEFFICIENTS = (0.0, 0.0), (1.0, 0.0), (0.0, 1e3)
"""Restitution and friction: where nothing that was measured differs, it tells of neither."""


def informative(measured: Measurements, kind: str) -> Measurements:
    """The impacts that say anything by residuals of a kind: they approach, and what was measured after them
    depends on restitution or friction."""
    first, *others = (
        measured.residuals(Law.COULOMB, {"restitution": e, "friction": mu}, kind)
        for e, mu in EXTREME_COEFFICIENTS
    )
    tells = np.any([one != first for one in others], axis=0) & measured.is_measured(kind)
    return measured.take(np.flatnonzero(measured.approaching() & tells.any(axis=0)))


class Impacts:
    """Twists of two bodies before and after each of N impacts: build them with :meth:`of`.

    The kinds of residuals: ``kinetic``, whose square is twice the kinetic energy of what twists are off;
    ``contact``, what the relative velocity at the contact point is off [m/s]; ``linear``, the linear part
    of ``kinetic``.
    """

    kinds = ("kinetic", "contact", "linear")

    def __init__(self, bodies: Array, contacts: Array, after: Array, root: Array) -> None:
        """From tables.

        Args:
            bodies: before, of SPATIAL, oriented rows, shape ``(rows, 2, N)``; see
                :func:`~collision_response.batch.resolve_batch`.
            contacts: points and normals, shape ``(rows, N)``; coefficients in them do not count.
            after: linear and angular velocities of the centres of mass, in world axes [m/s, rad/s], shape
                ``(6, 2, N)``. NaN: not measured.
            root: of the inertia in world axes, ``root^T root = I`` [kg^(1/2) m], shape ``(3, 3, 2, N)``.
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
        """From what :func:`~collision_response.resolve` takes, and what was measured after.

        Args:
            bodies_a, bodies_b: before. A common factor of all masses of an impact changes no prediction; by
                residuals ``kinetic`` and ``linear`` it is the weight of that impact.
            contacts: where they touch; their coefficients do not count.
            after_a, after_b: twists of the reference points after; NaN where nothing was measured. Those of
                immovable bodies do not count. If the centre of mass is off the reference point, its velocity
                is known as far as the angular velocity is.

        Raises:
            ImpactError: a request is not sound, or of a mechanism, or something infinite was measured; the
                field starts with the number of the impact.
        """
        n = len(contacts)
        tables = np.zeros((BODY.height, 2, n)), np.zeros((CONTACT.height, n)), np.zeros((6, 2, n))
        root = np.zeros((3, 3, 2, n))
        rows = zip(bodies_a, bodies_b, contacts, after_a, after_b, strict=True)
        for i, (a, b, contact, twist_a, twist_b) in enumerate(rows):
            for name, body in (("body_a", a), ("body_b", b)):
                if body.is_articulated():
                    field = f"impacts[{i}].{name}.inverse_inertia"
                    raise ImpactError(
                        StatusCode.INVALID_INERTIA, field, "is of a mechanism: give rigid bodies"
                    )
            try:
                resolve(a, b, contact._replace(restitution=1.0, friction=0.0))
            except ImpactError as error:
                raise error.within(f"impacts[{i}]") from None
            for name, body, twist in (("after_a", a, twist_a), ("after_b", b, twist_b)):
                _check_twist(f"impacts[{i}].{name}", body, twist)
            tables[1][:, i] = *contact.position, *contact.normal, 1.0, 0.0
            for side, (body, twist) in enumerate(((a, twist_a), (b, twist_b))):
                _write_body(tables[0][:, side, i], tables[2][:, side, i], root[:, :, side, i], body, twist)
        return cls(*tables, root)

    def __len__(self) -> int:
        return self.contacts.shape[1]

    def take(self, chosen: Array) -> Impacts:
        """See :class:`Measurements`."""
        return Impacts(*(table[..., chosen] for table in (self.bodies, self.contacts, self.after, self.root)))

    def approaching(self) -> Array:
        """See :class:`Measurements`."""
        return (self._at_contact(self._twists_before()) * self.contacts[CONTACT.normal]).sum(axis=0) < 0

    def residuals(self, law: Law, coefficients: CoefficientValues, kind: str) -> Array:
        """See :class:`Measurements`."""
        return self._in_norm(kind, self.predict(law, coefficients) - self.after)

    def is_measured(self, kind: str) -> Array:
        """See :class:`Measurements`."""
        known = ~np.isnan(self.after) & np.isfinite(self.bodies[BODY.mass])
        linear, angular = known[:3], known[3:]
        if kind == "contact":
            acts = np.roll(self._lever_arms() != 0, 1, axis=0) & np.roll(angular, 2, axis=0)
            acts |= np.roll(self._lever_arms() != 0, 2, axis=0) & np.roll(angular, 1, axis=0)
            return (linear | acts).any(axis=1)
        turning = ((self.root != 0) & angular).any(axis=1)
        rows = [linear] if kind == "linear" else [linear, turning]
        return np.concatenate(rows).reshape(-1, len(self))

    def sizes(self, kind: str) -> Array:
        """See :class:`Measurements`."""
        return self._in_norm(kind, self.after)

    def predict(self, law: Law, coefficients: CoefficientValues) -> Array:
        """The twists after, by a law, as those of ``after``.

        Raises:
            ImpactError: the law does not answer an impact.
        """
        of_model: dict[str, Any] = {
            name: x for name, x in coefficients.items() if name in ImpactModel._fields
        }
        contacts = self.contacts.copy()
        contacts[CONTACT.restitution], contacts[CONTACT.friction] = (
            coefficients["restitution"],
            coefficients.get("friction", 0.0),
        )
        result = resolve_batch(self.bodies, contacts, ImpactModel(law, **of_model))
        if (refused := np.flatnonzero(result.status > StatusCode.SEPARATING)).size:
            i = int(refused[0])
            raise ImpactError(
                StatusCode(int(result.status[i])), f"impacts[{i}]", f"{law.name} does not answer it"
            )
        return np.concatenate([result.velocity, result.angular_velocity])

    def _in_norm(self, kind: str, twists: Array) -> Array:
        twists = np.nan_to_num(twists)
        if kind == "contact":
            return self._at_contact(twists)
        mass = self.bodies[BODY.mass][0]
        linear = np.sqrt(np.where(np.isinf(mass), 0.0, mass)) * twists[:3]
        angular = np.einsum("ijsn,jsn->isn", self.root, twists[3:])
        rows = [linear] if kind == "linear" else [linear, angular]
        return np.concatenate(rows).reshape(-1, len(self))

    def _at_contact(self, twists: Array) -> Array:
        """Velocities of body_a relative to body_b, there."""
        there = twists[:3] + np.cross(twists[3:], self._lever_arms(), axis=0)
        return there[:, 0] - there[:, 1]

    def _lever_arms(self) -> Array:
        return np.asarray(self.contacts[CONTACT.position][:, None] - self.bodies[BODY.position])

    def _twists_before(self) -> Array:
        return np.concatenate([self.bodies[BODY.velocity], self.bodies[BODY.angular_velocity]])


def _check_twist(field: str, body: Body, twist: Twist) -> None:
    """Raises: ImpactError: NOT_FINITE: it is infinite. NaN was not measured."""
    for name, vector in zip(twist._fields, twist, strict=True):
        if body.is_movable() and any(map(math.isinf, vector)):
            reason = f"must be finite, or NaN where nothing was measured; is {tuple(vector)}"
            raise ImpactError(StatusCode.NOT_FINITE, f"{field}.{name}", reason)


def _write_body(column: Array, after: Array, root: Array, body: Body, twist: Twist) -> None:
    """One body of one impact, by its centre of mass."""
    centre = with_com_as_reference(body)
    column[BODY.mass], column[BODY.inertia], column[BODY.position] = body.mass, body.inertia, centre.position
    column[BODY.orientation] = body.orientation or IDENTITY_QUATERNION
    column[BODY.velocity], column[BODY.angular_velocity] = centre.velocity, body.angular_velocity
    if not body.is_movable():
        after[:3], after[3:] = centre.velocity, body.angular_velocity
        return
    after[:3], after[3:] = _com_velocity(body, twist), twist.angular
    xx, xy, xz, yy, yz, zz = body.inertia
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    across = [body.to_world(Vec3(*axis)) for axis in axes.T.tolist()]
    root[...] = np.sqrt(np.maximum(moments, 0.0))[:, None] * np.array(across)


def _com_velocity(body: Body, twist: Twist) -> Vec3:
    """After; NaN only where a component that was not measured has a part in it."""
    c, w = com_in_world_axes(body), Vec3(*twist.angular)
    least = ROUNDING * max(map(abs, c))

    def part(spin: float, arm: float) -> float:
        return spin * arm if abs(arm) > least else 0.0

    turned = Vec3(
        part(w.y, c.z) - part(w.z, c.y), part(w.z, c.x) - part(w.x, c.z), part(w.x, c.y) - part(w.y, c.x)
    )
    return Vec3(*twist.linear) + turned


SHELL_GYRATION = 2 / 3
"""``I / (m R^2)`` of a hollow sphere: no sphere has more."""


class SphereReadings:
    """What papers print of a sphere that strikes a flat target at one speed, without spin.

    The kinds of residuals are those of the tables together, ``all``, and each table alone.
    """

    QUANTITIES = ("ratio", "angle", "spin")

    def __init__(
        self,
        speed: float,
        radius: float,
        tables: Mapping[str, Sequence[tuple[float, float]]],
        errors: Mapping[str, float],
        gyration: float = 0.4,
    ) -> None:
        """From tables of pairs: incidence from the normal [degrees], reading.

        Args:
            speed: of the centre before [m/s], > 0.
            radius: of the sphere [m], > 0.
            tables: by name: ``ratio``, tangential velocity of the centre after over before, which needs an
                incidence that is not 0; ``angle``, of the rebound from the normal [degrees]; ``spin``, after
                [rad/s].
            errors: of a reading, by name, > 0, in the same units: they say what a table counts.
            gyration: ``I / (m R^2)``, in (0, 2/3]: 0.4 for a solid sphere, 2/3 for a shell.

        Raises:
            ValueError: there is no such table, no reading, or a number is out of range; it begins with the
                argument.
        """
        _check_positive("speed", speed)
        _check_positive("radius", radius)
        _check_positive("gyration", gyration, SHELL_GYRATION)
        for name, rows in tables.items():
            if name not in self.QUANTITIES:
                raise ValueError(f"tables: {name!r} is none of {', '.join(self.QUANTITIES)}")
            _check_positive(f"errors[{name!r}]", errors.get(name, 0.0))
            _check_readings(name, rows)
        if not any(map(len, tables.values())):
            raise ValueError("tables: there is no reading in them")
        self.kinds = ("all", *tables) if len(tables) > 1 else tuple(tables)
        self._rows = np.array(
            [
                (self.QUANTITIES.index(name), *row, errors[name])
                for name, rows in tables.items()
                for row in rows
            ]
        ).T
        self._sphere = speed, radius, gyration
        self._impacts = self._spheres(np.radians(self._rows[1]))

    def _spheres(self, incidence: Array) -> Impacts:
        speed, radius, gyration = self._sphere
        ball = Body.dynamic(1.0, [gyration * radius * radius * x for x in (1, 0, 0, 1, 0, 1)])
        moving = [
            ball._replace(velocity=Vec3(speed * math.sin(a), 0.0, -speed * math.cos(a)))
            for a in incidence.tolist()
        ]
        n = len(moving)
        nothing = [Twist(Vec3(*[math.nan] * 3), Vec3(*[math.nan] * 3))] * n
        touch = Contact.of((0.0, 0.0, -radius), (0.0, 0.0, 1.0))
        return Impacts.of(moving, [Body.static()] * n, [touch] * n, nothing, nothing)

    def __len__(self) -> int:
        return self._rows.shape[1]

    def take(self, chosen: Array) -> SphereReadings:
        """See :class:`Measurements`."""
        some = object.__new__(SphereReadings)
        some.kinds, some._sphere, some._rows = self.kinds, self._sphere, self._rows[:, chosen]
        some._impacts = self._impacts.take(chosen)
        return some

    def approaching(self) -> Array:
        """See :class:`Measurements`."""
        return self._impacts.approaching()

    def residuals(self, law: Law, coefficients: CoefficientValues, kind: str) -> Array:
        """See :class:`Measurements`; in errors of a reading."""
        return self._in_reading_errors(kind, self.predict(law, coefficients) - self._rows[2])

    def is_measured(self, kind: str) -> Array:
        """See :class:`Measurements`."""
        of = range(len(self.QUANTITIES)) if kind == "all" else [self.QUANTITIES.index(kind)]
        return np.isin(self._rows[0], of)[None]

    def sizes(self, kind: str) -> Array:
        """See :class:`Measurements`."""
        return self._in_reading_errors(kind, self._rows[2])

    def predict(self, law: Law, coefficients: CoefficientValues) -> Array:
        """What would be read, shape ``(N,)``."""
        before = self._impacts.bodies[BODY.velocity, 0]
        after = self._impacts.predict(law, coefficients)[:, 0]
        ratio = np.divide(after[0], before[0], out=np.zeros_like(before[0]), where=before[0] != 0)
        read = ratio, np.degrees(np.arctan2(after[0], after[2])), after[4]
        return np.choose(self._rows[0].astype(int), read)

    def _in_reading_errors(self, kind: str, numbers: Array) -> Array:
        return np.asarray(np.where(self.is_measured(kind), numbers, 0.0) / self._rows[3])


def _check_positive(field: str, value: float, most: float = math.inf) -> None:
    if not (0 < value <= most and math.isfinite(value)):
        limit = "" if most == math.inf else f" and at most {most:.4g}"
        raise ValueError(f"{field}: must be positive{limit or ' and finite'}, is {value}")


def _check_readings(name: str, rows: Sequence[tuple[float, float]]) -> None:
    for i, (incidence, reading) in enumerate(rows):
        if not (math.isfinite(incidence) and math.isfinite(reading)):
            raise ValueError(f"tables[{name!r}][{i}]: must be finite, is {(incidence, reading)}")
        if name == "ratio" and incidence == 0:
            raise ValueError(f"tables['ratio'][{i}]: at incidence 0 there is no tangential velocity before")
