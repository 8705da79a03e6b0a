"""One frictionless impact in every arithmetic that EXTENDED might have been made of."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from fractions import Fraction
from types import SimpleNamespace
from typing import Any, NamedTuple

import mpmath
import numpy as np
from extremes import ORDINARY, scene_named
from flint import arb, ctx
from reference import exact_answer, true_error
from scenes import Scene

from collision_response import Geometry, ImpactModel, Law
from collision_response.numerics import extended
from collision_response.numerics.double_double import DoubleDouble
from collision_response.physics.body import Body
from collision_response.physics.effective_mass import Spatial
from collision_response.physics.laws import Parameters, frictionless

try:
    import gmpy2
except ImportError:
    gmpy2 = None

REPEATS = 41
SCENES = {
    "ordinary": ORDINARY,
    "grazing 1e-12": scene_named("grazing, |u_n|/|u| = 1e-12"),
    "rod 1e-12": scene_named("rod, moments 1 : 1e-12, in turned axes"),
}


class Arithmetic(NamedTuple):
    """A kind of number, and where it computes."""

    name: str
    number: Callable[[float], Any]
    context: Callable[[], AbstractContextManager[Any]] = nullcontext


def arithmetics() -> list[Arithmetic]:
    """All that are installed, the cheapest first or so."""
    found = [
        Arithmetic("float64", float),
        Arithmetic("80-bit `numpy.longdouble`", np.longdouble),
        Arithmetic("double-double in Python", DoubleDouble),
        Arithmetic("`flint.arb` of 128 bits, its error not looked at", arb, lambda: ctx.workprec(128)),
        Arithmetic("`mpmath` of 113 bits", mpmath.mpf, lambda: mpmath.workprec(113)),
        Arithmetic("`fractions.Fraction`, exact", Fraction),
    ]
    if gmpy2 is not None:
        gmpy2_113 = Arithmetic("`gmpy2.mpfr` of 113 bits", gmpy2.mpfr, lambda: gmpy2.context(precision=113))
        found[3:3] = [gmpy2_113, Arithmetic("`gmpy2.mpq`, exact", gmpy2.mpq)]
    return found


def compare() -> list[dict[str, Any]]:
    """For each arithmetic the median time of one impact [µs], and its error on each scene."""
    return [_row(a.name, lambda scene, a=a: _impact(a, scene)) for a in arithmetics()] + [
        _row("`flint.arb`, as many bits as the answer needs: EXTENDED", _as_extended)
    ]


def _row(name: str, compute: Callable[[Scene], Any]) -> dict[str, Any]:
    model = ImpactModel(Law.FRICTIONLESS, Geometry.SPATIAL)
    errors = {
        label: true_error(compute(scene), exact_answer(*scene, model)) for label, scene in SCENES.items()
    }
    return {"arithmetic": name, "microseconds": median_time(lambda: compute(ORDINARY)), "errors": errors}


def median_time(call: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Median time of one call [µs]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e6 * statistics.median(times)


def _impact(arithmetic: Arithmetic, scene: Scene) -> Any:
    with arithmetic.context():
        body_a, body_b, contact = (_mapped(part, arithmetic.number) for part in scene)
        response = _respond(_with_inverse_mass(body_a), _with_inverse_mass(body_b), contact)
        return SimpleNamespace(**{f: _mapped(getattr(response, f), _rounded) for f in FIELDS})


FIELDS = ("impulse", "change_a", "change_b")


def _respond(body_a: Body, body_b: Body, contact: Any) -> Any:
    approach = Spatial.prepare(body_a, body_b, contact)
    return approach.respond(frictionless(approach, Parameters(contact.restitution)).impulse)


def _as_extended(scene: Scene) -> Any:
    bodies, contact = [extended.lift(body) for body in scene[:2]], extended.lift(scene.contact)

    def compute() -> Any:
        return _respond(*(extended.with_inverse_mass(body) for body in bodies), contact)

    def error_of(response: Any) -> float:
        vectors = (response.impulse, *response.change_a, *response.change_b)
        return max(extended.relative_radius(*((x, 1) for x in vector)) for vector in vectors)

    response, _ = extended.to_enough_digits(compute, error_of)
    return SimpleNamespace(**{f: extended.lower(getattr(response, f)) for f in FIELDS})


def _with_inverse_mass(body: Body) -> Body:
    return body._replace(inverse_mass=1 / body.mass) if body.inverse_mass else body


def _rounded(number: Any) -> float:
    return number.high if isinstance(number, DoubleDouble) else float(number)


def _mapped(value: Any, number: Callable[[Any], Any]) -> Any:
    """Every number in nested named tuples, as another kind."""
    if value is None:
        return None
    if isinstance(value, tuple) and not isinstance(value, DoubleDouble):
        return type(value)(*(_mapped(part, number) for part in value))
    return number(value)
