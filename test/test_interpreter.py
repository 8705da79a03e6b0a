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
