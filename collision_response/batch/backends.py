"""How a batch is computed: compiled by numba, by NumPy in blocks, or one contact after the other.

All three come from the same programs and give the same bits.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from math import inf, nan, sqrt
from typing import Any, NamedTuple

import numpy as np

from ..numerics import compiled
from ..numerics.choices import NUMPY_NAMES
from ..numerics.emit_blocks import emit_blocks
from ..numerics.emit_loop import emit_loop
from ..numerics.emit_scalar import emit_scalar
from ..numerics.emit_vectors import emit_vectors
from ..numerics.program import Program, Slot
from ..status import StatusCode
from . import bounded, doubled, kernels
from .kernels import in_single
from .problem import Arithmetic, Problem

_MODULES: dict[Arithmetic, Any] = {
    Arithmetic.PLAIN: kernels,
    Arithmetic.BOUNDED: bounded,
    Arithmetic.DOUBLED: doubled,
}

Arrays = dict[str, np.ndarray[Any, Any]]
"""Arrays by name, in the order of the program, of shape ``(rows, N)`` or ``(rows, 2, N)``."""

BLOCK_BYTES = 65536
"""Of one row and lane in a block: small enough for the cache, large enough for NumPy's overhead."""

ODD_BLOCK = 2048
"""Contacts in a block of those that are not ordinary."""


class Backend(Enum):
    """What computes a batch."""

    AUTO = "COMPILED if numba is installed, else NUMPY"
    COMPILED = "numba"
    NUMPY = "NumPy"


class Ready(NamedTuple):
    """A backend that is ready to run.

    Attributes:
        backend: which.
        run: takes all arrays, writes to those of the results.
        seconds: what it took to trace, and to compile or to read the machine code from disk.
    """

    backend: Backend
    run: Callable[[Arrays], None]
    seconds: float


def is_compiled(backend: Backend) -> bool:
    """Whether that asks for machine code, and may."""
    return backend is Backend.COMPILED or (backend is Backend.AUTO and compiled.is_available())


def prepare(backend: Backend, problem: Problem, dtype: np.dtype[Any]) -> Ready:
    """The backend for a problem; compiled now, if it is not yet.

    Raises:
        ImportError: COMPILED is asked for, and numba is not installed.
    """
    return _prepare(Backend.COMPILED if is_compiled(backend) else Backend.NUMPY, problem, dtype)


@cache
def _prepare(backend: Backend, problem: Problem, dtype: np.dtype[Any]) -> Ready:
    start = time.perf_counter()
    run = (_compiled if backend is Backend.COMPILED else _numpy)(problem, dtype)
    return Ready(backend, run, time.perf_counter() - start)


def programs_for(problem: Problem, dtype: np.dtype[Any]) -> tuple[Program, Program]:
    """The ordinary and the general program."""
    module = _MODULES[problem.arithmetic]
    programs = module.ordinary(problem), module.general(problem)
    return programs if dtype == np.float64 else (in_single(programs[0]), in_single(programs[1]))


def _compiled(problem: Problem, dtype: np.dtype[Any]) -> Callable[[Arrays], None]:
    usual, every = programs_for(problem, dtype)
    if problem.arithmetic is Arithmetic.PLAIN:
        source = emit_loop(usual, every, dtype.name)
    elif problem.arithmetic is Arithmetic.BOUNDED:
        source = emit_vectors(usual, every)
    else:
        source = emit_vectors(doubled.ordinary(problem, fused=True), doubled.general(problem, fused=True))
    batch = compiled.load(source).batch

    def run(arrays: Arrays) -> None:
        if all(array.flags.c_contiguous for array in arrays.values()):
            batch(*arrays.values())
        else:
            _in_contiguous_blocks(every, dtype, run, arrays)

    return run


def _in_contiguous_blocks(
    program: Program, dtype: np.dtype[Any], run: Callable[[Arrays], None], arrays: Arrays
) -> None:
    for block in _blocks(program, arrays, BLOCK_BYTES // dtype.itemsize):
        whole = {name: np.ascontiguousarray(array) for name, array in block.items()}
        run(whole)
        for name in _results(program):
            block[name][...] = whole[name]


def _numpy(problem: Problem, dtype: np.dtype[Any]) -> Callable[[Arrays], None]:
    usual, every = programs_for(problem, dtype)
    run_usual = _BlockRunner(usual, dtype, BLOCK_BYTES // dtype.itemsize)
    run_every = _BlockRunner(every, dtype, ODD_BLOCK)

    def run(arrays: Arrays) -> None:
        with np.errstate(all="ignore"):
            for block in _blocks(every, arrays, run_usual.size):
                flags = np.empty((1, block["status"].shape[-1]), bool)
                run_usual({**block, "ordinary": flags})
                _again(run_every, block, np.flatnonzero(~flags[0]))

    return run


def _again(run: _BlockRunner, arrays: Arrays, odd: np.ndarray[Any, Any]) -> None:
    """Compute what is not ordinary by the general program."""
    for few in column_blocks(arrays, odd, run.program, run.size):
        run(few)


def column_blocks(
    arrays: Arrays, columns: np.ndarray[Any, Any], program: Program, size: int
) -> Iterator[Arrays]:
    """Some contacts, a block of at most ``size`` at a time. What is done to its results is done to theirs."""
    for start in range(0, columns.size, size):
        chosen = columns[start : start + size]
        few = {
            name: array if name in program.uniform else array[..., chosen] for name, array in arrays.items()
        }
        yield few
        for name in _results(program):
            arrays[name][..., chosen] = few[name]


class _BlockRunner:
    """A program over blocks. Its buffers are kept from call to call, for each thread its own."""

    def __init__(self, program: Program, dtype: np.dtype[Any], size: int) -> None:
        self.program = program
        self.size = size
        self._dtype = dtype
        self._blocks = emit_blocks(program)
        self._constants = self._blocks.make_constants(dtype)
        self._buffers = threading.local()
        names: dict[str, Any] = {name: getattr(np, name) for name in NUMPY_NAMES}
        names["BITS"] = np.dtype(f"i{dtype.itemsize}")
        exec(compile(self._blocks.source, "<emit_blocks>", "exec"), names)
        self._run = names["block"]

    def __call__(self, arrays: Arrays) -> None:
        n = arrays["status"].shape[-1]
        self._run(*(arrays[name] for name in self._blocks.arrays), self._buffers_for(n), self._constants)

    def _buffers_for(self, n: int) -> list[np.ndarray[Any, Any]]:
        kept: list[np.ndarray[Any, Any]] = getattr(self._buffers, "kept", [])
        if not kept or kept[0].shape[-1] < n:
            kept = self._buffers.kept = self._blocks.allocate(n, self._dtype)
        return kept if kept[0].shape[-1] == n else [buffer[..., :n] for buffer in kept]


def _blocks(program: Program, arrays: Arrays, size: int) -> Iterator[Arrays]:
    n = arrays["status"].shape[-1]
    for start in range(0, n, size):
        columns = slice(start, min(start + size, n))
        yield {
            name: array if name in program.uniform else array[..., columns] for name, array in arrays.items()
        }


def _results(program: Program) -> list[str]:
    return list(dict.fromkeys(slot.array for slot in program.outputs))


@cache
def one_by_one(problem: Problem) -> Callable[[Arrays], None]:
    """The program as a function of plain floats, called for each contact: the fastest for a few."""
    _, program = programs_for(problem, np.dtype(np.float64))
    names: dict[str, Any] = {"inf": inf, "nan": nan, "sqrt": sqrt}
    exec(compile(emit_scalar(program), "<emit_scalar>", "exec"), names)
    kernel: Callable[..., tuple[float, ...]] = names["kernel"]
    out_of_range = tuple(
        float(StatusCode.OUT_OF_RANGE) if slot.array == "status" else nan for slot in program.outputs
    )

    def answer(numbers: tuple[float, ...]) -> tuple[float, ...]:
        try:
            return kernel(*numbers)
        except ZeroDivisionError:  # what Python does where arrays have an infinity
            return out_of_range

    def run(arrays: Arrays) -> None:
        n = arrays["status"].shape[-1]
        columns = (np.broadcast_to(_row(arrays, slot), n).tolist() for slot in program.inputs)
        answers = [answer(numbers) for numbers in zip(*columns, strict=True)]
        for slot, results in zip(program.outputs, np.array(answers).T, strict=True):
            _row(arrays, slot)[...] = results

    return run


def _row(arrays: Arrays, slot: Slot) -> np.ndarray[Any, Any]:
    row = arrays[slot.array][slot.row]
    return row if slot.lane is None else row[slot.lane]
