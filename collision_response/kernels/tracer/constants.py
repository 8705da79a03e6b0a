"""The header ``constants.hpp``: sizes, indices, enumerations and tables that C++ shares with Python."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import Any

from ...answer import Impact
from ...impact import Flags, Report
from ...model import USEFUL_BOUND, Adjustment, Geometry, Precision
from ...numbers.operations import numbers_in
from ...physics.body import Body
from ...physics.contact import Contact
from ...physics.effective_mass import ContactNumbers
from ...physics.inverse_inertia import InverseInertia
from ...physics.laws import CLUSTER_LAWS, LAWS, Coefficients, Law, Regime, Settings
from ...physics.tensor import ZERO_TENSOR
from ...physics.vector import ZERO
from ...status import StatusCode
from ..layout import (
    ALL_ONE,
    ALL_ZERO,
    Layout,
    names_of_body,
    names_of_contact,
    names_of_inputs,
    rows_in_everything,
)
from ..protocol import (
    LEAST_SPRING_RESTITUTION,
    RATIONAL_CONTACTS,
    REFLECTIONS,
    USUAL_EXPONENT,
    Handover,
    NumberType,
    ValidityFlag,
)
from .units import units

ENUMERATIONS: dict[str, Iterable[Any]] = {
    "LAW": Law,
    "STATUS": StatusCode,
    "REGIME": Regime,
    "ADJUSTMENT": Adjustment,
    "GEOMETRY": Geometry,
    "PRECISION": Precision,
    "NUMBER": NumberType,
    "HANDOVER": Handover,
    "VALIDITY": ValidityFlag,
}
"""The enumerations whose members C++ knows by name, each with the prefix of these names."""

FORMULAS = {formula.__name__: law for law, formula in LAWS.items()}
"""The name of each law's formula, with a law that it computes. Laws may share a formula."""

LAW_ARGUMENTS = ContactNumbers(ZERO, ZERO, 0.0, 0.0, ZERO_TENSOR), Coefficients(0.0)
"""Arguments of a law. Only their structure matters."""

LAYOUTS_OF_TABLES = [layout for layout in Layout if layout is not Layout.ARTICULATED]
"""The layouts that kernels of batches read."""

TABLE_LAYOUT = f"""
// The tables of a batch of some layout.
enum {{ ALL_ZERO = {ALL_ZERO}, ALL_ONE = {ALL_ONE} }};
struct TableLayout {{
  int body_rows, contact_rows;  // contact_rows counts restitution and friction
  int axes, first_spin;         // number of axes of velocities; first axis of rotation, 3 if there is none
  // Where the layout EVERYTHING finds its rows: the index of each row, or, for a row that the table lacks,
  // ALL_ZERO or ALL_ONE: its numbers are all 0 or 1.
  int body[BODY], contact[CONTACT];
}};
"""


def constants() -> str:
    """Text of ``constants.hpp``."""
    inputs, all_inputs = names_of_inputs(Layout.EVERYTHING), names_of_inputs(Layout.ARTICULATED)
    twists = (["x.linear"] * 3 + ["x.angular"] * 3) * 2
    changes = ["x.impulse"] * 3 + twists
    reported = twists + [f"x.{field}" for field in Report._fields[2:]]
    numbers = {
        **_places("BODY", names_of_body(Layout.EVERYTHING), "BODY"),
        **_places("CONTACT", names_of_contact(Layout.EVERYTHING), "CONTACT"),
        **_places("MODEL", Settings._fields, "MODEL"),
        **_places("INVERSE_INERTIA", InverseInertia._fields, "INVERSE_INERTIA"),
        **_places("FLAG", Flags._fields, "FLAGS"),
        **_places("BODY_FIELD", Body._fields, "BODY_FIELDS"),
        **_places("CONTACT_FIELD", Contact._fields, "CONTACT_FIELDS"),
        **{f"OUT_{field.upper()}": i for i, field in enumerate(Report._fields[2:], len(twists))},
        "IN_CONTACT": next(i for i, name in enumerate(inputs) if name.startswith("contact.")),
        "IN_MODEL": next(i for i, name in enumerate(inputs) if name.startswith("model.")),
        "INPUTS": len(inputs),
        "ALL_INPUTS": len(all_inputs),
        "CHANGES": len(changes),
        "REPORTED": len(reported),
        "IMPACT_FIELDS": len(Impact._fields),
        "VALIDITY_FLAGS": len(ValidityFlag),
        "LAW_COUNT": max(LAWS) + 1,
        "REFLECTIONS": REFLECTIONS,
        "RATIONAL_CONTACTS": RATIONAL_CONTACTS,
    }
    for prefix, enumeration in ENUMERATIONS.items():
        numbers |= {f"{prefix}_{member.name}": int(member) for member in enumeration}
    numbers |= {f"LAYOUT_{layout.name}": layout.number for layout in Layout}
    formulas = list(FORMULAS)
    numbers |= {f"FORMULA_{formula.upper()}": i for i, formula in enumerate(formulas)}
    formula_of = [formulas.index(LAWS[law].__name__) if law in LAWS else -1 for law in Law]
    is_cluster_law = [int(law in CLUSTER_LAWS) for law in Law]
    enumerators = "".join(f"  {name} = {value},\n" for name, value in numbers.items())
    quoted = ", ".join('"' + name.rstrip(".") + '"' for name in all_inputs)
    table_layouts = "".join(f"  {_table_layout(layout)},\n" for layout in LAYOUTS_OF_TABLES)
    return (
        f"enum {{\n{enumerators}}};\n"
        f"constexpr double USEFUL_BOUND = {USEFUL_BOUND.hex()};  // an error bound above this says little\n"
        f"constexpr double LEAST_SPRING_RESTITUTION = {LEAST_SPRING_RESTITUTION};\n"
        f"constexpr int USUAL_EXPONENT = {USUAL_EXPONENT};\n"
        f"{offsets('LAW_INPUT', *LAW_ARGUMENTS)}"
        f"#define EACH_FORMULA(X) {' '.join(f'X({formula})' for formula in formulas)}\n"
        f"static const signed char formula_of[] = {_braced(formula_of)};  // by law\n"
        f"static const bool is_cluster_law[] = {_braced(is_cluster_law)};\n"
        f"{TABLE_LAYOUT}"
        f"constexpr TableLayout table_layouts[] = {{\n{table_layouts}}};  // by layout\n"
        f"static const char* const input_names[] = {{{quoted}}};\n"
        f"{_unit_table('input_units', all_inputs)}"
        f"{_unit_table('change_units', changes)}"
        f"{_unit_table('reported_units', reported)}"
    )


def _places(prefix: str, names: Iterable[str], count: str) -> dict[str, int]:
    """The place of each name in an array or a named tuple, and how many there are."""
    places = {f"{prefix}_{name.replace('.', '_').rstrip('_').upper()}": i for i, name in enumerate(names)}
    return {**places, count: len(places)}


def _unit_table(name: str, quantities: list[str]) -> str:
    """A C++ array with the units of some quantities."""
    rows = ", ".join(_braced(units(quantity)) for quantity in quantities)
    return f"static const signed char {name}[{len(quantities)}][6] = {{{rows}}};\n"


def _table_layout(layout: Layout) -> str:
    """Initializer of the ``TableLayout`` of a layout."""
    body_rows, contact_rows = rows_in_everything(layout)
    fields = layout.body_fields
    axes, spins = len(fields["velocity"]), len(fields.get("angular_velocity", []))
    heights = len(names_of_body(layout)), len(names_of_contact(layout))
    return _braced([*heights, axes, 3 - spins, _braced(body_rows), _braced(contact_rows)])


def _braced(values: Iterable[object]) -> str:
    return "{" + ", ".join(map(str, values)) + "}"


def offsets(prefix: str, *parts: Any) -> str:
    """An ``enum`` of the places where the numbers of each field of named tuples begin, and of their count."""
    places, count = [], 0
    for name, field in chain(*(zip(part._fields, part, strict=True) for part in parts)):
        places.append(f"{prefix}_{name.upper()} = {count}, ")
        count += len(list(numbers_in(field)))
    return f"enum {{ {''.join(places)}{prefix}_COUNT = {count} }};\n"
