"""The source of a module for numba: a vector of problems at a time, in LLVM's own instructions.

For long programs: numba finds out the type of every operation, which takes it a minute for some ten
thousand. Here they are written for LLVM as they are. A vector is longer than those of the machine, so that
one part of it can be computed while the next waits for a result. Nothing branches, but that a vector in
which not all is ordinary is computed again by the general program: where both hold they agree.
"""

from __future__ import annotations

import math

from .emit_loop import types_of
from .program import Program, Slot

WIDTH = 16
"""Problems in a vector."""


def emit_vectors(ordinary: Program, general: Program) -> str:
    """A module with ``batch(<arrays>)``, for float64, of two programs as :func:`emit_loop` takes them."""
    names = general.arrays()
    per_problem = [name for name in names if name not in general.uniform]
    results = list(dict.fromkeys(slot.array for slot in general.outputs))
    arguments = ", ".join(names)
    rest = ", ".join(f"rest_{name}" if name in per_problem else name for name in names)
    flag = list(ordinary.outputs.values())[-1]
    lines = [
        "# Written by collision_response.numerics.emit_vectors.",
        _HEAD,
        *_vector("are_ordinary", ordinary, names, f"all_of(b, v{flag})"),
        *_vector("compute", general, names, "TRUTH(1)"),
        f'@njit([types.void({", ".join(types_of(general, "float64"))})], error_model="numpy", cache=True)',
        f"def batch({arguments}):",
        f"    n = {results[0]}.shape[-1]",
        f"    for start in range(0, n - n % {WIDTH}, {WIDTH}):",
        f"        if not are_ordinary(start, {arguments}):",
        f"            compute(start, {arguments})",
        f"    start, count = n - n % {WIDTH}, n % {WIDTH}",
        "    if count:",
        *(f"        rest_{name} = np.ones({_shape(general, name)}" for name in per_problem),
        *(
            f"        rest_{name}[..., :count] = {name}[..., start:]"
            for name in per_problem
            if name not in results
        ),
        f"        compute(0, {rest})",
        *(f"        {name}[..., start:] = rest_{name}[..., :count]" for name in results),
    ]
    return "\n".join([*lines, ""])


def _shape(program: Program, array: str) -> str:
    return f"{program.shape(array, WIDTH)}, np.{'uint8' if array in program.codes else 'float64'})"


def _vector(name: str, program: Program, arrays: list[str], answer: str) -> list[str]:
    """A function of numba's that computes the outputs from ``start`` on; ``answer`` is what it returns."""
    outputs = {slot: place for slot, place in program.outputs.items() if slot.array in arrays}
    body = [f"v{place} = {_form(program, place)}" for place in program.needed()]
    body += [f"{slot.array}.store({_row(slot)}, v{place})" for slot, place in outputs.items()]
    parameters = ", ".join(["start", *arrays])
    return [
        "@intrinsic",
        f"def {name}(typing, {parameters}):",
        "    def code(context, b, signature, arguments):",
        f"        {', '.join(arrays)} = rows_of(context, b, signature, arguments)",
        *(f"        {line}" for line in body),
        f"        return {answer}",
        "",
        f"    return types.boolean({parameters}), code",
        "",
        "",
    ]


def _form(program: Program, place: int) -> str:
    node = program.tape.nodes[place]
    if node.op == "input":
        read = "only" if node.value.array in program.uniform else "load"
        return f"{node.value.array}.{read}({_row(node.value)})"
    if node.op == "truth":
        return f"ir.Constant(TRUTHS, [{node.value}] * {WIDTH})"
    if node.op == "constant":
        value = repr(node.value) if math.isfinite(node.value) else f'float("{node.value}")'
        return f"ir.Constant(NUMBERS, [{value}] * {WIDTH})"
    return _FORMS[node.op].format(*(f"v{arg}" for arg in node.args))


def _row(slot: Slot) -> int:
    """Which of the rows of an array it is, counted through the lanes."""
    return slot.row if slot.lane is None else 2 * slot.row + slot.lane


_FORMS = {
    "add": "b.fadd({}, {})",
    "sub": "b.fsub({}, {})",
    "mul": "b.fmul({}, {})",
    "div": "b.fdiv({}, {})",
    "neg": "b.fneg({})",
    "sqrt": 'call(b, "llvm.sqrt", {})',
    "fma": 'call(b, "llvm.fma", {}, {}, {})',
    "lt": 'b.fcmp_ordered("<", {}, {})',
    "le": 'b.fcmp_ordered("<=", {}, {})',
    "eq": 'b.fcmp_ordered("==", {}, {})',
    "and": "b.and_({}, {})",
    "or": "b.or_({}, {})",
    "not": "b.not_({})",
    "select": "b.select({}, {}, {})",
}

_HEAD = f'''\
import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

WIDTH = {WIDTH}
NUMBER, TRUTH, CODE, INDEX = ir.DoubleType(), ir.IntType(1), ir.IntType(8), ir.IntType(32)
NUMBERS, TRUTHS, CODES, INDICES = (ir.VectorType(kind, WIDTH) for kind in (NUMBER, TRUTH, CODE, INDEX))


class Rows:
    """The rows of an array, from an element on."""

    def __init__(self, b, dtype, data, n, start):
        self.b, self.dtype, self.data, self.n, self.start = b, dtype, data, n, start

    def at(self, row, kind):
        place = self.b.add(self.b.mul(self.n, self.n.type(row)), self.start)
        return self.b.bitcast(self.b.gep(self.data, [place]), kind.as_pointer())

    def load(self, row):
        return self.b.load(self.at(row, NUMBERS), align=8)

    def only(self, row):
        number = self.b.load(self.b.gep(self.data, [self.n.type(row)]))
        first = self.b.insert_element(ir.Constant(NUMBERS, ir.Undefined), number, INDEX(0))
        return self.b.shuffle_vector(first, first, ir.Constant(INDICES, [0] * WIDTH))

    def store(self, row, value):
        if self.dtype == types.uint8:
            self.b.store(self.b.fptoui(value, CODES), self.at(row, CODES), align=1)
        else:
            self.b.store(value, self.at(row, NUMBERS), align=8)


def rows_of(context, b, signature, arguments):
    start, *arrays = arguments
    for kind, value in zip(signature.args[1:], arrays):
        array = context.make_array(kind)(context, b, value)
        yield Rows(b, kind.dtype, array.data, b.extract_value(array.shape, kind.ndim - 1), start)


def call(b, name, *operands):
    kind = ir.FunctionType(NUMBERS, [NUMBERS] * len(operands))
    return b.call(cgutils.get_or_insert_function(b.module, kind, f"{{name}}.v{{WIDTH}}f64"), operands)


def all_of(b, truths):
    bits = ir.IntType(WIDTH)
    return b.icmp_unsigned("==", b.bitcast(truths, bits), bits(-1))

'''
