"""What is compiled: each formula is run on symbols here, and the C++ header that comes out is emitted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from ... import geometry, validity
from ...impact import Changes, evaluate_law, impact
from ...numbers.operations import choose, numbers_in, rebuilt, square_root
from ...physics.column import Column
from ...physics.effective_mass import BodyAtContact, ContactKinematics, ContactNumbers
from ...physics.energy import kinetic_energy
from ...physics.laws import LAWS, PATHS, STEPPED, Coefficients, Law
from ...physics.laws.coulomb import fallback
from ...physics.tensor import ZERO_TENSOR
from ...physics.vector import Vec3
from ..layout import Layout, names_of_body
from ..protocol import ValidityFlag
from .branches import LEAST_SAVING, LEAST_SAVING_IN_VECTORS
from .constants import FORMULAS, LAW_ARGUMENTS, constants, offsets
from .emit import emit
from .inputs import kernel_inputs
from .simd_pairs import pair_bodies
from .symbol import CONDITIONS, Node, Symbol, Tape

GENERAL = (Layout.EVERYTHING, Layout.ARTICULATED)
"""The layouts that one impact is computed in. The others serve batches only."""


def _formulas_of(laws: Iterable[Law]) -> list[str]:
    return list(dict.fromkeys(LAWS[law].__name__ for law in laws))


FORMULA_LISTS = {
    "formulas": _formulas_of(law for law in LAWS if law not in STEPPED),
    "stepped_formulas": _formulas_of(STEPPED),
    "formulas_in_float32": _formulas_of(law for law in LAWS if law not in PATHS),
    "usual_formulas": _formulas_of([Law.FRICTIONLESS, Law.COULOMB]),
}
"""Lists for CMakeLists.txt, which decides by them what to compile of a formula: kernels of all number types
(``formulas``) or one kernel for all precisions (``stepped_formulas``); float32 as well; optimised most."""


def headers_of(target: str) -> Mapping[str, Callable[[], str]]:
    """The C++ headers of a target of ``trace.py``: for each name a function that returns the text."""
    if target in SHARED_HEADERS:
        return {target: SHARED_HEADERS[target]}
    if target == "validity":
        return {f"validity_{layout.name.lower()}": partial(validity_header, layout) for layout in Layout}
    law = FORMULAS[target]
    layouts = GENERAL if law in STEPPED else Layout
    by_layout = {f"{target}_{layout.name.lower()}": partial(impact_header, law, layout) for layout in layouts}
    return by_layout | {f"{target}_derivatives": partial(impulse_header, law)}


def cmake_lists() -> str:
    """CMake code that sets the lists of formulas, and for each target the names of its headers."""
    targets = [*SHARED_HEADERS, "validity", *FORMULAS]
    header_lists = {f"{target}_headers": list(headers_of(target)) for target in targets}
    lists = FORMULA_LISTS | header_lists | {"targets": targets}
    return "".join(f"set({name} {' '.join(items)})\n" for name, items in lists.items())


HEAD = '#pragma once\n#include "simd_pairs.hpp"\n\n'
"""The first lines of each header."""


def impact_header(law: Law, layout: Layout) -> str:
    """The impact by a law: its changes with error bounds, its report without, its flags."""
    tape = Tape()
    given = kernel_inputs(layout, tape)
    answer = impact(given.body_a, given.body_b, given.contact, law, given.settings)
    *flags, unphysical = tape.symbols(answer.flags)
    results = tape.symbols(answer.changes), tape.symbols(answer.report), flags, [unphysical]
    is_general = layout in GENERAL
    least_saving = LEAST_SAVING if is_general else LEAST_SAVING_IN_VECTORS
    twists = len(tape.symbols(answer.report[:2]))  # next to a change of like size, they lose digits
    text = emit("impact", given.names, *results, rounded_last=twists, least_saving=least_saving)
    if is_general:
        paired = pair_bodies(results)
        text += emit("impact_in_pairs", given.names, *paired, rounded_last=twists, least_saving=LEAST_SAVING)
    return text


def validity_header(layout: Layout) -> str:
    """The check of a request.

    ``validity`` reports the code of what is wrong, 0 if nothing is, and sets the flags of ``ValidityFlag``.
    ``clearly_valid`` is a quick check that most requests pass.
    """
    tape = Tape()
    given = kernel_inputs(layout, tape)
    parts, e_t = given[1:4], given.settings.tangential_restitution
    code = validity.first_fault(*parts, e_t)
    flags = {
        ValidityFlag.POINT_IF_FRICTIONLESS: geometry.point_suffices(*parts, frictionless=True),
        ValidityFlag.POINT_SUFFICES: geometry.point_suffices(*parts, frictionless=False),
        ValidityFlag.PLANAR_IF_FRICTIONLESS: geometry.planar_suffices(*parts, frictionless=True),
        ValidityFlag.PLANAR_SUFFICES: geometry.planar_suffices(*parts, frictionless=False),
        ValidityFlag.IS_OFF_UNIT: validity.is_not_normalised(given.body_a)
        | validity.is_not_normalised(given.body_b),
    }
    is_sound = tape.symbol(validity.is_clearly_valid(*parts, e_t))
    ordered = tape.symbols(tuple(flags[flag] for flag in ValidityFlag))
    text = emit("validity", given.names, [], [tape.symbol(code)], ordered)
    return text + emit("clearly_valid", given.names, [], [], [is_sound])


def impulse_header(law: Law) -> str:
    """The impulse of a law from what the law sees, for numbers that carry derivatives."""
    tape = Tape(of_derivatives=True)
    inputs, (seen, coefficients) = _traced_arguments(tape, *LAW_ARGUMENTS)
    impulse = evaluate_law(seen, coefficients, law).impulse
    return emit("impulse", inputs, tape.symbols(impulse), least_saving=LEAST_SAVING)


def changes_header() -> str:
    """The changes by an impact, for numbers that carry derivatives. The law is a parameter of the C++."""
    tape = Tape(of_derivatives=True)
    given = kernel_inputs(Layout.EVERYTHING, tape)
    contact = ContactKinematics.of(given.body_a, given.body_b, given.contact)
    coefficients = Coefficients(given.contact.restitution, given.contact.friction, given.settings)
    seen = (*ContactNumbers.of(contact), *coefficients)
    law = tape.add(Node("law", tuple(x.index for x in tape.symbols(seen)))).index
    impulse = Vec3(*(tape.add(Node("part", (law,), i)) for i in range(3)))
    changes = Changes(impulse, *contact.twist_changes(impulse))
    return emit("changes", given.names, tape.symbols(changes), least_saving=LEAST_SAVING)


FALLBACK_ARGUMENTS = LAW_ARGUMENTS[0]._replace(regularized_K=ZERO_TENSOR), LAW_ARGUMENTS[1]
"""Arguments of the fallback law. Only their structure matters."""


def fallback_header() -> str:
    """The law that others fall back to where they have no sound answer: a function that kernels call."""
    tape = Tape()
    inputs, arguments = _traced_arguments(tape, *FALLBACK_ARGUMENTS)
    return emit("fallback", inputs, tape.symbols(fallback(*arguments)), least_saving=LEAST_SAVING)


def column_header() -> str:
    """What scenes compute of one body: ``centre`` without a contact, then ``column`` at a contact.

    ``centre`` gives the body as seen from its reference point, then the roots of its inverse mass and of its
    inverse inertia in world axes; and its kinetic energy. ``column`` takes the first of these, and the
    velocity, lever arm and direction at a contact.
    """
    tape = Tape()
    body = kernel_inputs(Layout.EVERYTHING, tape).body_a
    names = [f"body_a.{name}" for name in names_of_body(Layout.EVERYTHING)]
    centre = BodyAtContact.of(body, body.position)
    has_massless_spin = tape.symbol(centre.has_massless_spin())
    numbers = tape.symbols(centre)
    turns = map(centre.rotation.to_world, centre.inverse_tensor.square_root_columns())
    roots = tape.symbols((square_root(centre.inverse_mass), *turns))
    bounded = [*map(_as_number, numbers), *roots]
    energy = tape.symbols((kinetic_energy(body),))
    text = emit("centre", names, bounded, energy, [has_massless_spin])

    tape, count = Tape(), len(numbers)
    inputs = [f"x{i}" for i in range(count + 9)]
    symbols = [tape.input(name) for name in inputs]
    read = (
        symbol > 0.5 if _is_condition(number) else symbol
        for symbol, number in zip(symbols, numbers, strict=False)
    )
    side = rebuilt(centre, read)
    velocity, arm, direction = (Vec3(*symbols[i : i + 3]) for i in range(count, count + 9, 3))
    column = Column.at(side, velocity, arm, direction)
    return offsets("CENTRE", centre) + text + emit("column", inputs, tape.symbols(column))


SHARED_HEADERS: dict[str, Callable[[], str]] = {
    "changes": changes_header,
    "column": column_header,
    "constants": constants,
    "fallback": fallback_header,
}
"""The headers that do not depend on a law or layout."""


def _traced_arguments(tape: Tape, *like: Any) -> tuple[Iterable[object], list[Any]]:
    """The names of the inputs for arguments of the structure of ``like``, and such arguments, as symbols."""
    inputs = range(sum(1 for _ in numbers_in(like)))
    symbols = map(tape.input, inputs)
    return inputs, [rebuilt(one, symbols) for one in like]


def _is_condition(symbol: Symbol) -> bool:
    return symbol.node.op in CONDITIONS


def _as_number(symbol: Symbol) -> Symbol:
    """A condition as 1 or 0. One that is undecided has an error that covers both."""
    if not _is_condition(symbol):
        return symbol
    return symbol.tape.symbol(choose(symbol, lambda: 1.0, lambda: 0.0))
