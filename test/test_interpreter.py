"""The compiled functions and Python's own mechanisms: exit, sub-interpreters, interrupts."""

from __future__ import annotations

import pytest
from programs import run_python

from collision_response import Body, Contact, resolve, resolve_scene

EXIT = """
import threading
import numpy as np
from collision_response.batch import resolve_batch

bodies, contacts = np.zeros((4, 2, 200_000)), np.zeros((5, 200_000))
bodies[0], bodies[1, 0], contacts[0], contacts[3] = 1.0, -1.0, 1.0, 0.5
out, has_begun = resolve_batch(bodies, contacts), threading.Event()

def work():
    while True:
        resolve_batch(bodies, contacts, out=out)
        has_begun.set()

for _ in range(4):
    threading.Thread(target=work, daemon=True).start()
has_begun.wait()
"""


def test_daemon_threads_in_a_batch_do_not_disturb_the_end_of_the_process():
    result = run_python("-c", EXIT)
    assert (result.returncode, result.stderr) == (0, "")


SUB_INTERPRETER = """
import sys
if sys.version_info < (3, 13):
    import _xxsubinterpreters as interpreters
else:
    import _interpreters as interpreters
from collision_response import Body, Contact, Impact, ImpactModel, resolve

other = interpreters.create()
try:
    print(interpreters.run_string(other, f"import sys; sys.path[:] = {sys.path}; import collision_response"))
except Exception as error:
    print(error)
for tolerance in (1e-3, 1e-6):
    request = Body.dynamic(1.0, velocity=(0, 0, -1)), Body.static(), Contact.of((0, 0, 0), (0, 0, 1))
    print(type(resolve(*request, ImpactModel(tolerance=tolerance))) is Impact)
    if tolerance == 1e-3:
        interpreters.destroy(other)
"""


def test_a_sub_interpreter_does_not_take_the_classes_of_the_main_one():
    result = run_python("-c", SUB_INTERPRETER)
    said, *of_main = result.stdout.splitlines()
    assert "ImportError" in said or "another interpreter" in said, result.stderr
    assert of_main == ["True", "True"]


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("method", ["__float__", "__eq__", "__iter__"])
@pytest.mark.parametrize("count", [1, 2])
def test_an_interrupt_in_a_number_of_the_caller_is_not_swallowed(method, count):
    methods = {"__float__": lambda _: 1.0, "__eq__": lambda *_: True, "__iter__": lambda _: iter([0.0] * 3)}
    number = type("Number", (), methods | {method: interrupt})()
    velocity = number if method == "__iter__" else (number, 0.0, -1.0)
    bodies = [Body.dynamic(1.0)._replace(velocity=velocity), Body.static()]
    contacts = [Contact.of((float(i), 0, 0), (0, 0, 1)) for i in range(count)]
    with pytest.raises(KeyboardInterrupt):
        if count == 1:
            resolve(*bodies, contacts[0])
        else:
            resolve_scene(bodies, [(0, 1)] * count, contacts)


def test_an_interrupt_when_a_number_is_read_again_is_not_swallowed():
    """A scene reads the body of a single contact once more than resolve()."""
    calls = iter((1.0, None))

    def number(_: object) -> float:
        return next(calls) or interrupt()

    methods = {"__float__": number, "__eq__": lambda *_: True, "__lt__": lambda *_: True}
    mass = type("Number", (), methods)()
    bodies = [Body.dynamic(1.0)._replace(mass=mass), Body.static()]
    with pytest.raises(KeyboardInterrupt):
        resolve_scene(bodies, [(0, 1)], [Contact.of((0.0, 0, 0), (0, 0, 1))])


@pytest.mark.parametrize("method", ["__float__", "__eq__", "__iter__"])
def test_a_number_of_the_caller_that_needs_too_much_memory_says_so(method):
    def fail(_: object, *__: object) -> None:
        raise MemoryError

    methods = {"__float__": lambda _: 1.0, "__eq__": lambda *_: True, "__iter__": lambda _: iter([0.0] * 3)}
    number = type("Number", (), methods | {method: fail})()
    velocity = number if method == "__iter__" else (number, 0.0, -1.0)
    body = Body.dynamic(1.0)._replace(velocity=velocity)
    with pytest.raises(MemoryError):
        resolve(body, Body.static(), Contact.of((0.0, 0, 0), (0, 0, 1)))


WITHOUT_MEMORY = """
import _testcapi
from collision_response import Body, Contact
from collision_response.kernels import library, protocol

cube = Body.box(1.0, (1.0, 1.0, 1.0), position=(0.0, 0.0, 0.5), velocity=(0.5, 0.0, -1.0))
corners = [Contact.of((x, y, 0.0), (0.0, 0.0, 1.0), 0.5, 0.3) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
parts = [cube, Body.static()], [(0, 1)] * 4, corners, [1, 1, 1, 2]
options = 0.0, 1e-6, (None, 1.5, protocol.SPRING_WORK), None
failed = 0
for law in (1, 2, 3, 5):
    for allocations in range(150):
        error = None
        _testcapi.set_nomemory(allocations, allocations + 1)
        try:
            library.assemble(*parts).resolve(law, *options)
        except BaseException as raised:
            error = raised
        _testcapi.remove_mem_hooks()
        failed += type(error) is MemoryError
        if type(error) not in (MemoryError, type(None)):
            print(law, allocations, repr(error))
print(failed > 0)
"""


def test_a_scene_without_memory_raises_memory_error():
    """Whichever allocation of Python in a kernel fails. The list of a result held an error: SystemError.

    Only the kernels are asked, because CPython 3.13.0 mixes up its stack if an allocation of its own fails.
    """
    pytest.importorskip("_testcapi")
    result = run_python("-c", WITHOUT_MEMORY)
    assert (result.stdout, result.returncode) == ("True\n", 0), result.stderr
