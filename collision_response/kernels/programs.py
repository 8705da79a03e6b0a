"""What is compiled: the impact by each law, and the conditions under which it may be asked for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from .. import geometry, validity
from ..impact import Answer, Changes, Flags, Report, blow_of, impact
from ..model import Adjustment, Geometry, Precision
from ..numbers.operations import choose, numbers_in
from ..physics.column import Column
from ..physics.effective_mass import BodyAtContact, ContactKinematics, ContactNumbers
from ..physics.energy import kinetic_energy
from ..physics.inverse_inertia import InverseInertia
from ..physics.laws import LAWS, PATHS, STEPPED, Coefficients, Law, Regime
from ..physics.laws.chatterjee_ruina import fallback
from ..physics.tensor import ZERO_TENSOR
from ..physics.vector import ZERO, Vec3
from ..status import StatusCode
from .emit import BRANCHES, BRANCHES_OF_PLAIN_NUMBERS, emit
from .layout import (
    Layout,
    Request,
    names_of_body,
    names_of_contact,
    names_of_inverse_inertia,
    names_of_model,
    request,
    units,
)
from .pairs import in_pairs
from .protocol import Left, Number
from .symbol import CONDITIONS, Node, Symbol, Tape, rebuilt

FORMULAS = {formula.__name__: law for law, formula in LAWS.items()}
"""The formulas of the laws by name, each with a law that it serves."""


def _formulas_of(laws: Iterable[Law]) -> list[str]:
    return list(dict.fromkeys(LAWS[law].__name__ for law in laws))


LISTS = {
    "formulas": _formulas_of(law for law in LAWS if law not in STEPPED),
    "stepped_formulas": _formulas_of(STEPPED),
    "formulas_in_float32": _formulas_of(law for law in LAWS if law not in PATHS),
    "usual_formulas": _formulas_of([Law.FRICTIONLESS, Law.COULOMB]),
}
"""Formulas by what is compiled for them: all kernels; one for all precisions; float32 too; the fastest."""

HEAD = '#pragma once\n#include "pairs.hpp"\n\n'


def headers(what: str) -> Iterator[tuple[str, str]]:
    """Names and texts of the C++ headers of a law's formula, or of what else ``trace.py`` takes."""
    if what == "sizes":
        yield "sizes", sizes()
        return
    if what in ALONE:
        yield what, HEAD + ALONE[what]()
        return
    one_kernel = what in LISTS["stepped_formulas"]
    for layout in (Layout.EVERYTHING, Layout.ARTICULATED) if one_kernel else Layout:
        text = validity_of(layout) if what == "validity" else impact_by(FORMULAS[what], layout)
        yield f"{what}_{layout.name.lower()}", HEAD + text
    if what != "validity":
        yield f"{what}_derivatives", HEAD + impulse_by(FORMULAS[what])


def _answer(asked: Request, law: Law) -> Answer:
    return impact(asked.body_a, asked.body_b, asked.contact, law, asked.settings)


def changes() -> str:
    """The changes for numbers that carry derivatives, and where a law finds what it sees."""
    tape = Tape(of_derivatives=True)
    asked = request(Layout.EVERYTHING, tape)
    contact = ContactKinematics.of(asked.body_a, asked.body_b, asked.contact)
    coefficients = Coefficients(asked.contact.restitution, asked.contact.friction, asked.settings)
    seen = (*ContactNumbers.of(contact), *coefficients)
    law = tape.write(Node("law", tuple(tape.symbol(x).place for x in numbers_in(seen)))).place
    impulse = Vec3(*(tape.write(Node("part", (law,), i)) for i in range(3)))
    results = map(tape.symbol, numbers_in(Changes(impulse, *contact.twist_changes(impulse))))
    names = (*ContactNumbers._fields, *Coefficients._fields)
    text = emit("changes", asked.names, results, [], [], branches=BRANCHES)
    return _places("SEEN", names, seen) + text


def impulse_by(law: Law) -> str:
    """The impulse by what a law sees, for numbers that carry derivatives."""
    tape = Tape(of_derivatives=True)
    like = ContactNumbers(ZERO, ZERO, 0.0, 0.0, ZERO_TENSOR), Coefficients(0.0)
    inputs, (seen, coefficients) = _arguments(tape, *like)
    impulse = blow_of(seen, coefficients, law).impulse
    return emit("impulse", inputs, map(tape.symbol, impulse), [], [], branches=BRANCHES)


def _arguments(tape: Tape, *like: Any) -> tuple[Iterable[object], list[Any]]:
    """The inputs that arguments like these are made of, and the arguments."""
    inputs = range(sum(1 for _ in numbers_in(like)))
    symbols = map(tape.input, inputs)
    return inputs, [rebuilt(one, symbols) for one in like]


SEEN_BY_FALLBACK = ContactNumbers(ZERO, ZERO, 0.0, 0.0, ZERO_TENSOR, ZERO_TENSOR), Coefficients(0.0)
"""Its arguments, of any numbers."""


def shared_fallback() -> str:
    """What laws answer that have no sound answer of their own, as a function that their kernels call."""
    tape = Tape()
    inputs, arguments = _arguments(tape, *SEEN_BY_FALLBACK)
    solution = fallback(*arguments)
    return emit("fallback", inputs, map(tape.symbol, numbers_in(solution)), [], [], branches=BRANCHES)


def impact_by(law: Law, layout: Layout) -> str:
    """The impact: the changes with their error, the report without, the flags."""
    tape = Tape()
    asked = request(layout, tape)
    answer = _answer(asked, law)
    *flags, unphysical = (tape.symbol(flag) for flag in answer.flags)
    results = [[tape.symbol(x) for x in numbers_in(part)] for part in (answer.changes, answer.report)]
    results += flags, [unphysical]
    is_general = layout in (Layout.EVERYTHING, Layout.ARTICULATED)
    branches = BRANCHES if is_general else BRANCHES_OF_PLAIN_NUMBERS
    text = emit("impact", asked.names, *results, branches=branches)
    if is_general:
        text += emit("impact_in_pairs", asked.names, *in_pairs(results), branches=BRANCHES)
    return text


def validity_of(layout: Layout) -> str:
    """The code of what is wrong with a request, 0 if nothing is; what it takes of the geometries,
    and whether a quaternion was not of unit length."""
    tape = Tape()
    asked = request(layout, tape)
    parts = asked.body_a, asked.body_b, asked.contact
    code = validity.fault(*parts, asked.settings.tangential_restitution)
    shapes = [
        geometry.is_point(*parts, frictionless=True),
        geometry.is_point(*parts, frictionless=False),
        geometry.is_planar(*parts, frictionless=True),
        geometry.is_planar(*parts, frictionless=False),
        validity.is_off_unit(asked.body_a) | validity.is_off_unit(asked.body_b),
    ]
    plain = tape.symbol(validity.is_plainly_sound(*parts, asked.settings.tangential_restitution))
    return (
        emit("validity", asked.names, [], [tape.symbol(code)], map(tape.symbol, shapes))
        + emit("plainly_sound", asked.names, [], [], [plain])
        + _counts_of(layout)
    )


def column() -> str:
    """What scenes need: of a body, its kinetic energy, the roots of its inverse inertia in world axes; and of
    the body at a contact in one direction.
    """
    names, tape = [f"body_a.{name}" for name in names_of_body(Layout.EVERYTHING)], Tape()
    body = request(Layout.EVERYTHING, tape).body_a
    centre = BodyAtContact.of(body, body.position)
    idle = centre.massless_spin.dot(centre.massless_spin) > 0
    of_centre = list(map(tape.symbol, numbers_in(centre)))
    written = list(map(_as_number, of_centre))
    roots = map(centre.rotation.to_world, centre.inverse_tensor.square_root_columns())
    reported = map(tape.symbol, numbers_in((kinetic_energy(body), *roots)))
    text = emit("centre", names, written, reported, [tape.symbol(idle)])
    tape, count = Tape(), len(of_centre)
    inputs = [f"x{i}" for i in range(count + 9)]
    symbols = [tape.input(name) for name in inputs]
    read = (
        symbol > 0.5 if _is_condition(one) else symbol
        for symbol, one in zip(symbols, of_centre, strict=False)
    )
    seen = rebuilt(centre, read)
    velocity, d, direction = (Vec3(*symbols[i : i + 3]) for i in range(count, count + 9, 3))
    outputs = map(tape.symbol, numbers_in(Column.at(seen, velocity, d, direction)))
    return _places("CENTRE", BodyAtContact._fields, centre) + text + emit("column", inputs, outputs, [], [])


ALONE = {"column": column, "changes": changes, "fallback": shared_fallback}
"""What is a header of its own."""


def _places(prefix: str, names: Iterable[str], parts: Iterable[Any]) -> str:
    """Where the numbers of each part begin, and how many there are, as an ``enum``."""
    places, at = [], 0
    for name, part in zip(names, parts, strict=True):
        places.append(f"{prefix}_{name.upper()} = {at}, ")
        at += len(list(numbers_in(part)))
    return f"enum {{ {''.join(places)}{prefix} = {at} }};\n"


def _is_condition(symbol: Symbol) -> bool:
    return symbol.node.op in CONDITIONS


def _as_number(symbol: Symbol) -> Symbol:
    """A condition as 1 or 0: one that is open has the error of both."""
    if not _is_condition(symbol):
        return symbol
    return symbol.tape.symbol(choose(symbol, lambda: 1.0, lambda: 0.0))


def _counts_of(layout: Layout) -> str:
    """What a batch needs to know of a layout, as a C++ type."""
    body, contact = names_of_body(layout), names_of_contact(layout)
    moments = [
        f"x[{body.index(f'inertia.{axes}')}]" for axes in ("xx", "yy", "zz") if f"inertia.{axes}" in body
    ]
    if moments and len(moments) < 3:
        moments *= 3
    mentioned = " + ".join(moments) or "*x - *x"
    is_general = layout in (Layout.EVERYTHING, Layout.ARTICULATED)
    inputs = 2 * len(body) + len(contact) + len(names_of_model())
    return (
        f"\nstruct Layout_{layout.name.lower()} {{\n"
        f"  static constexpr int body = {len(body)}, inputs = {inputs};\n"
        f"  static constexpr int given = {2 * len(body) + contact.index('friction.')};\n"
        f"  static constexpr bool any_may_be_one_for_all = {'true' if is_general else 'false'};\n"
        f"  template <class T> INLINE T trace(const T* x) {{ return {mentioned}; }}\n"
        "};\n"
    )


ENUMERATIONS: dict[str, Iterable[Any]] = {
    "LAW": Law,
    "STATUS": StatusCode,
    "REGIME": Regime,
    "ADJUSTMENT": Adjustment,
    "GEOMETRY": Geometry,
    "PRECISION": Precision,
    "NUMBER": Number,
    "LEFT": Left,
}
"""Whose members the kernels know by name."""


def sizes() -> str:
    """How many numbers one impact has of each kind, their names and units; which laws there are, and the
    numbers that Python's enumerations have.
    """
    asked = request(Layout.EVERYTHING, Tape())
    twists = (["x.linear"] * 3 + ["x.angular"] * 3) * 2
    changes = ["x.impulse"] * 3 + twists
    reported = twists + [f"x.{field}" for field in Report._fields[2:]]

    def table(name: str, names: list[str]) -> str:
        rows = ", ".join("{" + ", ".join(map(str, units(one))) + "}" for one in names)
        return f"static const signed char {name}[{len(names)}][6] = {{{rows}}};\n"

    names = [*asked.names, *names_of_inverse_inertia()]
    spelled = ", ".join('"' + name.rstrip(".") + '"' for name in names)
    numbers = {
        "INPUTS": len(asked.names),
        "INVERSE_INERTIA": len(InverseInertia._fields),
        "ALL_INPUTS": len(names),
        "BODY": len(names_of_body(Layout.EVERYTHING)),
        "CHANGES": len(changes),
        "REPORTED": len(reported),
        "FLAGS": len(Flags._fields),
        "LAW_COUNT": max(LAWS) + 1,
    }
    numbers |= {f"IN_{name.replace('.', '_').upper().rstrip('_')}": i for i, name in enumerate(asked.names)}
    numbers |= {f"OUT_{field.upper()}": 12 + i for i, field in enumerate(Report._fields[2:])}
    numbers |= {f"FLAG_{field.upper()}": i for i, field in enumerate(Flags._fields)}
    for kind, members in ENUMERATIONS.items():
        numbers |= {f"{kind}_{member.name}": int(member) for member in members}
    numbers |= {f"LAYOUT_{layout.name}": i for i, layout in enumerate(Layout)}
    places = {formula: i for i, formula in enumerate(FORMULAS)}
    numbers |= {f"FORMULA_{formula.upper()}": i for formula, i in places.items()}
    formula_of = [places[LAWS[law].__name__] if law in LAWS else -1 for law in Law]
    tables = "".join(f"  {_table_of(layout)},\n" for layout in TABLES)
    listed = "".join(f"  {name} = {value},\n" for name, value in numbers.items())
    return (
        f"#pragma once\nenum {{\n{listed}}};\n"
        f"enum {{ ROWS_OF_BODY = BODY, ROWS_OF_CONTACT = {len(names_of_contact(Layout.EVERYTHING))}, "
        f"ROWS_OF_MODEL = {len(names_of_model())} }};\n"
        f"#define EACH_FORMULA(X) {' '.join(f'X({formula})' for formula in FORMULAS)}\n"
        f"static const signed char formula_of[] = {{{', '.join(map(str, formula_of))}}};  // a law\n"
        f"{TABLE}#ifdef WITH_TABLES\n"
        f"static const char* const input_names[] = {{{spelled}}};\n"
        f"{table('input_units', names)}"
        f"{table('change_units', changes)}"
        f"{table('reported_units', reported)}"
        f"static const Table tables[] = {{\n{tables}}};\n"
        "#endif\n"
    )


TABLE = """
// How the general layout finds its rows in the tables of another: their indices, or -1: 0, -2: 1 for all.
struct Table {
  int body_rows, contact_rows;  // with friction
  int axes, first_spin;         // of velocities; the first axis that bodies turn about, 3 if none
  int body[ROWS_OF_BODY], contact[ROWS_OF_CONTACT];
};
"""

TABLES = (Layout.POINT, Layout.PLANAR, Layout.SPATIAL, Layout.SPATIAL_ORIENTED)
"""The layouts that tables of batches have."""


def _table_of(layout: Layout) -> str:
    """How the general layout finds its rows in tables of this one: see ``Table`` above."""

    def place(name: str, names: list[str]) -> int:
        if name in names:
            return names.index(name)
        if name in ("inertia.xx", "inertia.yy") and "inertia.zz" in names:
            return names.index("inertia.zz")
        return ONE if name == "orientation.w" else NONE

    body, contact = names_of_body(layout), names_of_contact(layout)
    of_body = [place(name, body) for name in names_of_body(Layout.EVERYTHING)]
    of_contact = [place(name, contact) for name in names_of_contact(Layout.EVERYTHING)]
    axes, spins = layout.fields(0)["velocity"], layout.fields(0).get("angular_velocity", [])
    numbers = [len(body), len(contact), len(axes), 3 - len(spins)]
    rows = ", ".join("{" + ", ".join(map(str, row)) + "}" for row in (of_body, of_contact))
    return "{" + ", ".join(map(str, numbers)) + ", " + rows + "}"


NONE, ONE = -1, -2
"""Rows that a table has not: 0 for all, or 1 for all."""
