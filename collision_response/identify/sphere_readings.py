"""Readings of a sphere that strikes a flat target, as papers usually print them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..arguments import as_list, check_mapping, check_number, finite_number
from ..batch.arrays import Array
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.laws import Law
from ..physics.vector import Vec3
from ..status import POSITIVE, ImpactError, StatusCode, format_value
from .measurements import BODY, CoefficientValues, Impacts, Measurements

SHELL_GYRATION = 2 / 3
"""``I / (m R^2)`` of a thin hollow sphere, the largest of all spheres."""


class SphereReadings(Measurements):
    """Readings of a sphere that strikes a flat target at one speed and without spin.

    The kinds of residuals are the names of the tables, and ``all`` for all together if there are several.
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
        """Take the readings from tables of pairs: angle of incidence from the normal [degrees], and reading.

        Args:
            speed: speed of the centre before the impacts [m/s], > 0.
            radius: radius of the sphere [m], > 0.
            tables: the tables, by name. ``ratio``: tangential velocity of the centre after the impact divided
                by the one before, at incidences that are not 0. ``angle``: angle of the rebound from the
                normal [degrees]. ``spin``: angular velocity after the impact [rad/s].
            errors: error of one reading of each table, by name, > 0, in the units of the table. Residuals are
                divided by it, so it sets the weight of the table.
            gyration: ``I / (m R^2)``, in (0, 2/3]: 0.4 for a solid sphere, 2/3 for a thin shell.

        Raises:
            ImpactError: INVALID_TABLE or NOT_FINITE, if a table has an unknown name, there are no readings,
                or a number is out of range.
            TypeError: if something has the wrong type.
        """
        speed, radius = _positive("speed", speed), _positive("radius", radius)
        self._sphere = speed, radius, _positive("gyration", gyration, SHELL_GYRATION)
        check_mapping("tables", tables)
        check_mapping("errors", errors)
        for field, names in (("tables", tables), ("errors", errors)):
            for name in names:
                if name not in self.QUANTITIES:
                    reason = f"must be some of {', '.join(self.QUANTITIES)}; one is {format_value(name)}"
                    raise ImpactError(StatusCode.INVALID_TABLE, field, reason)
        rows = []
        for name, readings in tables.items():
            if name not in errors:
                raise ImpactError(StatusCode.INVALID_TABLE, f"errors[{name!r}]", "is missing")
            error = _positive(f"errors[{name!r}]", errors[name])
            column = self.QUANTITIES.index(name)
            rows += [(column, *row, error) for row in _read_readings(name, readings)]
        if not rows:
            raise ImpactError(StatusCode.INVALID_TABLE, "tables", "there is no reading in them")
        self.kinds = ("all", *tables) if len(tables) > 1 else tuple(tables)
        self._rows = np.array(rows).T
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
        some = object.__new__(SphereReadings)
        some.kinds, some._sphere, some._rows = self.kinds, self._sphere, self._rows[:, chosen]
        some._impacts = self._impacts.take(chosen)
        return some

    def approaching(self) -> Array:
        return self._impacts.approaching()

    def residuals(self, law: Law, coefficients: CoefficientValues, kind: str) -> Array:
        """Return prediction minus measurement, in errors of a reading; 0 where nothing was measured."""
        return self._in_reading_errors(kind, self.predict(law, coefficients) - self._rows[2])

    def is_measured(self, kind: str) -> Array:
        of = range(len(self.QUANTITIES)) if kind == "all" else [self.QUANTITIES.index(kind)]
        return np.isin(self._rows[0], of)[None]

    def sizes(self, kind: str) -> Array:
        return self._in_reading_errors(kind, self._rows[2])

    def rounding(self, kind: str) -> Array:
        return np.zeros(len(self))  # the normal is along an axis: what depends on nothing stays the same

    def predict(self, law: Law, coefficients: CoefficientValues) -> Array:
        """Return the readings that a law predicts, shape ``(N,)``.

        Raises:
            ImpactError: if the law cannot answer an impact.
        """
        before = self._impacts.bodies[BODY.velocity, 0]
        after = self._impacts.predict(law, coefficients)[:, 0]
        ratio = np.divide(after[0], before[0], out=np.zeros_like(before[0]), where=before[0] != 0)
        read = ratio, np.degrees(np.arctan2(after[0], after[2])), after[4]
        return np.choose(self._rows[0].astype(int), read)

    def _in_reading_errors(self, kind: str, numbers: Array) -> Array:
        return np.asarray(np.where(self.is_measured(kind), numbers, 0.0) / self._rows[3])


def _positive(field: str, value: Any, most: float = math.inf) -> float:
    return check_number(field, value, POSITIVE, most, StatusCode.INVALID_TABLE)


def _read_readings(name: str, rows: Iterable[Any]) -> Iterator[tuple[float, float]]:
    """Yield the angles of incidence and the readings of a table."""
    for i, row in enumerate(as_list(f"tables[{name!r}]", rows)):
        field = f"tables[{name!r}][{i}]"
        try:
            incidence, reading = row
        except (TypeError, ValueError):
            raise TypeError(f"{field}: must be an angle and a reading, is {format_value(row)}") from None
        numbers = finite_number(field, incidence), finite_number(field, reading)
        if abs(numbers[0]) > 90:
            reason = f"the incidence must be in [-90, 90] degrees, is {numbers[0]:g}"
            raise ImpactError(StatusCode.INVALID_TABLE, field, reason)
        if name == "ratio" and numbers[0] == 0:
            reason = "at incidence 0 there is no tangential velocity before"
            raise ImpactError(StatusCode.INVALID_TABLE, field, reason)
        yield numbers
