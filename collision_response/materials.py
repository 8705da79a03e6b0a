"""Coefficients for pairs of materials, read from a file.

    pairs:
      - materials: [steel, glass]
        restitution: {yield_speed: 0.02, after: thornton}
        friction: 0.1
        tangential_restitution: 0.3
        stiffness_ratio: 0.87
        source: measured on 2026-01-31
    materials:
      steel: {restitution: 0.9, friction: 0.2, stiffness: 2.3e+11}

The entry of a pair takes precedence over the entries of its two materials. The coefficients:

* ``restitution`` of a pair is a number, or a function of the approach speed ``v`` [m/s]:
  ``{power: 0.25, speed: 1.0, value: 0.8}`` is ``value (v / speed)^-power``, at most 1;
  ``{yield_speed: 0.02, after: thornton}`` (or ``johnson``) is a law of plastic yielding;
  ``{speeds: [0.1, 1.0], values: [0.9, 0.7]}`` is a table.
* ``friction`` of a pair is a number, or a function of the slip speed ``v`` [m/s]:
  ``{static: 0.5, kinetic: 0.3, speed: 0.1}`` is ``kinetic + (static - kinetic) exp(-v / speed)``; a table is
  written as for restitution.
* ``restitution`` and ``friction`` of a single material are numbers.
* ``stiffness`` belongs to a material, in any unit; the combine rule "energetic" uses it.

Every coefficient is optional; the caller decides what applies where an entry leaves one out. Duplicate keys
and pairs are errors. Names are text: quote those that YAML reads as another type, such as ``"304"`` and
``"no"``.

The file ``materials.yaml`` next to this module has published values, each with its source. They hold for the
bodies and surfaces that were measured, not for the materials in general.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from reprlib import repr as quoted
from textwrap import shorten
from types import NoneType
from typing import Any, NamedTuple

from .arguments import check_number
from .model import STIFFNESS_RATIOS
from .physics import friction
from .physics.combine import CombineRule, check_rule, combine
from .physics.friction import Friction
from .physics.restitution import Restitution, johnson, plastic, power_law, tabulated
from .status import ImpactError, StatusCode, format_value, renamed

PUBLISHED = Path(__file__).with_name("materials.yaml")

MOST_LISTED = 500
"""Characters of a list of names in an error."""


class Pair(NamedTuple):
    """The coefficients of a pair of materials; ``None`` where one is not known.

    Attributes:
        restitution: in [0, 1], or a function of the approach speed [m/s].
        friction: >= 0, or a function of the slip speed [m/s].
        tangential_restitution: in [-1, 1].
        stiffness_ratio: tangential over normal stiffness, > 0.
        source: where the values come from, in words.
    """

    restitution: float | Restitution | None = None
    friction: float | Friction | None = None
    tangential_restitution: float | None = None
    stiffness_ratio: float | None = None
    source: str = ""


class Material(NamedTuple):
    """The coefficients of a single material; ``None`` where one is not known.

    Attributes:
        restitution, friction: are combined with those of the other material.
        stiffness: > 0, in any unit.
    """

    restitution: float | None = None
    friction: float | None = None
    stiffness: float | None = None


RANGES = {
    "restitution": (0.0, 1.0),
    "friction": (0.0, math.inf),
    "tangential_restitution": (-1.0, 1.0),
    "stiffness_ratio": STIFFNESS_RATIOS,
    "stiffness": (1e-300, math.inf),
}


class PairCoefficient(NamedTuple):
    """A coefficient of two materials, and where it comes from.

    Attributes:
        value: a number, or a function of the approach speed (restitution) or of the slip speed (friction).
        is_of_pair: whether it comes from the entry of the pair; otherwise it is combined from both materials.
        how: the source given in the entry, or the name of the combine rule.
    """

    value: float | Restitution | Friction
    is_of_pair: bool
    how: str


NO_PAIR = Pair()


@dataclass(frozen=True)
class Materials:
    """The contents of a materials file. Use :meth:`read` to read one.

    Attributes:
        pairs: entries of pairs, by the names of both materials in alphabetical order.
        materials: entries of single materials, by name.
    """

    pairs: Mapping[tuple[str, str], Pair]
    materials: Mapping[str, Material]

    @classmethod
    def read(cls, path: Path | str) -> Materials:
        """Read a YAML file.

        Raises:
            ImpactError: INVALID_TABLE, if the file does not have the structure described above;
                INVALID_COEFFICIENT or NOT_FINITE, if a number is out of range. ``field`` says where.
            OSError: if the file cannot be read.
            ImportError: if PyYAML is not installed.
        """
        from .strict_yaml import YAMLError, load_yaml

        try:
            tree = load_yaml(Path(path).read_text(encoding="utf-8"))
        except (YAMLError, UnicodeDecodeError) as error:
            where = " ".join(str(error).split())
            raise ImpactError(StatusCode.INVALID_TABLE, str(path), f"is not valid YAML: {where}") from None
        return cls.of(tree)

    @classmethod
    def of(cls, tree: Any) -> Materials:
        """Build from nested lists and mappings, as in the file.

        Raises:
            ImpactError: as :meth:`read` does.
        """
        top = _mapping("materials file", tree, ("pairs", "materials"))
        materials = {
            _name("materials", name): Material(**_numbers(f"materials.{name}", entry, Material._fields))
            for name, entry in _mapping("materials", top.get("materials"), None).items()
        }
        pairs: dict[tuple[str, str], Pair] = {}
        entries = [] if top.get("pairs") is None else top["pairs"]
        if not isinstance(entries, list):
            raise _malformed("pairs", "must be a list", entries)
        for i, entry in enumerate(entries):
            field = f"pairs[{i}]"
            names, pair = _pair(field, entry)
            if names in pairs:
                raise _malformed(f"{field}.materials", "must not appear twice", list(names))
            pairs[names] = pair
        return cls(pairs, materials)

    @cached_property
    def known(self) -> frozenset[str]:
        """The names of all materials in the file, including those of pairs."""
        return frozenset(self.materials).union(*self.pairs)

    @cached_property
    def _listed(self) -> str:
        return shorten(", ".join(sorted(self.known)), MOST_LISTED, placeholder=" ...") or "none"

    def check(self, field: str, name: str) -> None:
        """Raise ``ImpactError`` (UNKNOWN_MATERIAL) if the file does not have this material."""
        if name not in self.known:
            reason = f"is {quoted(name)}; the file has {self._listed}"
            raise ImpactError(StatusCode.UNKNOWN_MATERIAL, field, reason)

    def between(self, a: str, b: str) -> Pair:
        """Return the entry of the pair ``a`` and ``b``, or an empty entry if the file has none.

        Raises:
            TypeError: if a name is not text.
        """
        for field, name in (("a", a), ("b", b)):
            if not isinstance(name, str):
                raise TypeError(f"{field}: must be the name of a material, is {format_value(name)}")
        return self.pairs.get((min(a, b), max(a, b)), NO_PAIR)

    def find(
        self, coefficient: str, a: str, b: str, rule: CombineRule = CombineRule.AVERAGE
    ) -> PairCoefficient | None:
        """Return a coefficient of two materials: that of the pair, else both combined, else ``None``.

        Args:
            coefficient: "restitution" or "friction".
            a, b: names of the materials.
            rule: how to combine the coefficients of two materials.

        Raises:
            ImpactError: OUT_OF_RANGE, if the combined coefficient exceeds the range of float64.
            TypeError: if ``rule`` is not a :class:`~collision_response.physics.combine.CombineRule`, or a
                name is not text.
            ValueError: if ``coefficient`` is not "restitution" or "friction".
        """
        check_rule(rule)
        if coefficient not in ("restitution", "friction"):
            raise ValueError(f"coefficient: must be restitution or friction, is {coefficient!r}")
        pair = self.between(a, b)
        value = getattr(pair, coefficient)
        if value is not None:
            return PairCoefficient(value, True, pair.source)
        materials = [self.materials.get(name, Material()) for name in (a, b)]
        values = [getattr(material, coefficient) for material in materials]
        if None in values:
            return None
        known = [material.stiffness for material in materials if material.stiffness is not None]
        stiffnesses = known if len(known) == 2 else ()
        combined = combined_coefficient(coefficient, rule, (a, b), values, stiffnesses)
        return PairCoefficient(combined, False, rule.value)


def combined_coefficient(
    coefficient: str,
    rule: CombineRule,
    owners: Sequence[str],
    values: Sequence[float],
    stiffnesses: Sequence[float] = (),
) -> float:
    """Return the coefficient of a contact from those of two bodies or materials.

    Args:
        coefficient: its name, for the error.
        rule: how to combine the values.
        owners: the names of the two bodies or materials, for the error.
        values: their coefficients.
        stiffnesses: their stiffnesses, if both are known.

    Raises:
        ImpactError: OUT_OF_RANGE if the coefficient is beyond float64.
    """
    combined = combine(rule, *values, *stiffnesses)
    if math.isinf(combined):
        both = ", ".join(f"{owner} has {value}" for owner, value in zip(owners, values, strict=True))
        reason = f"exceeds float64 by the rule {rule.value}: {both}"
        raise ImpactError(StatusCode.OUT_OF_RANGE, f"contact.{coefficient}", reason)
    return float(combined)


NO_MATERIALS = Materials({}, {})
"""Stands for the absence of a materials file."""


def _malformed(field: str, must: str, value: Any) -> ImpactError:
    return ImpactError(StatusCode.INVALID_TABLE, field, f"{must}, is {format_value(value, quoted)}")


def _name(field: str, name: Any) -> str:
    if not isinstance(name, str):
        raise _malformed(
            field, "must have names that are text; quote names that YAML reads as another type", name
        )
    if not name:
        raise _malformed(field, "must have names; the empty name means no material", name)
    return name


def _mapping(field: str, tree: Any, keys: tuple[str, ...] | None) -> Mapping[str, Any]:
    if tree is None:
        return {}
    if not isinstance(tree, dict):
        raise _malformed(field, "must be a mapping", tree)
    unknown = [key for key in tree if keys is not None and key not in keys]
    if unknown:
        raise _malformed(field, f"may only have {', '.join(keys or ())}", unknown[0])
    return tree


def _number(field: str, name: str, value: Any) -> float:
    try:
        return check_number(f"{field}.{name}", value, *RANGES[name], StatusCode.INVALID_COEFFICIENT)
    except TypeError:
        raise _malformed(f"{field}.{name}", "must be a number", value) from None


def _numbers(field: str, entry: Any, keys: tuple[str, ...]) -> dict[str, float]:
    return {name: _number(field, name, value) for name, value in _mapping(field, entry, keys).items()}


def _pair(field: str, entry: Any) -> tuple[tuple[str, str], Pair]:
    numbers = dict(_mapping(field, entry, ("materials", *Pair._fields)))
    names = numbers.pop("materials", None)
    if not (isinstance(names, list) and len(names) == 2):
        raise _malformed(f"{field}.materials", "must be two names", names)
    a, b = sorted(_name(f"{field}.materials", name) for name in names)
    source = _source(f"{field}.source", numbers.pop("source", None))
    laws = {name: _coefficient(f"{field}.{name}", numbers.pop(name)) for name in FUNCTIONS if name in numbers}
    return (a, b), Pair(source=source, **laws, **_numbers(field, numbers, Pair._fields))


def _source(field: str, source: Any) -> str:
    if isinstance(source, bool) or not isinstance(source, (str, int, float, NoneType)):
        raise _malformed(field, "must be text", source)
    return "" if source is None else format_value(source, str)


FUNCTIONS: dict[str, dict[tuple[str, ...], Callable[..., Restitution | Friction]]] = {
    "restitution": {
        ("value", "speed", "power"): power_law,
        ("yield_speed", "after: thornton"): plastic,
        ("yield_speed", "after: johnson"): johnson,
        ("speeds", "values"): tabulated,
    },
    "friction": {("static", "kinetic", "speed"): friction.stribeck, ("speeds", "values"): friction.tabulated},
}
"""The functions of speed that restitution and friction of a pair may be, by the keys that describe them."""

KEYS = {"restitution": "value", "exponent": "power"}
"""The keys of arguments that have another name in these functions."""


def _coefficient(field: str, law: Any) -> Any:
    """Read a coefficient that is a number, or a mapping that describes a function of speed."""
    owner, _, name = field.rpartition(".")
    if not isinstance(law, dict):
        return _number(owner, name, law)
    given = {f"after: {law[key]}" if key == "after" else key for key in law}
    for keys, function in FUNCTIONS[name].items():
        if given == set(keys) and not any(str(key).startswith("after:") for key in law):
            try:
                return function(*(_constant(key, law[key]) for key in keys if key in law))
            except (TypeError, ValueError) as error:
                raise ImpactError(StatusCode.INVALID_COEFFICIENT, field, renamed(str(error), KEYS)) from None
    raise _malformed(field, f"must have {'; or '.join(map(', '.join, FUNCTIONS[name]))}", law)


def _constant(name: str, value: Any) -> Any:
    """Return a constant for a function, which checks its numbers; columns of a table must be lists."""
    if name in ("speeds", "values") and not isinstance(value, list):
        raise TypeError(f"{name}: must be a list of numbers, is {format_value(value, quoted)}")
    return value
