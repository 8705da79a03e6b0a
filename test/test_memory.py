"""Too little memory raises MemoryError, and later calls are answered as before."""

from __future__ import annotations

import pytest
from programs import run_python

SCRIPT = """
import resource

import numpy as np

from collision_response import Body, Contact, ImpactModel, Law, resolve_scene
from collision_response.batch import independent_sets, resolve_scenes

LAWS = Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE


def chain(n, mu):
    balls = [Body.dynamic(1.0, velocity=(float(i == 0), 0.0, 0.0)) for i in range(n + 1)]
    contacts = [Contact.of((i + 0.5, 0.0, 0.0), (-1.0, 0.0, 0.0), 1.0, mu) for i in range(n)]
    return balls, [(i, i + 1) for i in range(n)], contacts


def tables(n):
    bodies, contacts = np.zeros((4, n + 1)), np.zeros((5, n))
    bodies[0], bodies[1, 0], contacts[0], contacts[3] = 1.0, 1.0, -1.0, 1.0
    return bodies, contacts, np.array([np.arange(n), np.arange(1, n + 1)])


def ask_scenes(n, law, workers):
    bodies, contacts, pairs = tables(n)
    return resolve_scenes(bodies, contacts, ImpactModel(law), pairs=pairs, workers=workers)


def asked(n):
    for law in LAWS:
        yield lambda: resolve_scene(*chain(n, 0.3 * (law is not Law.FRICTIONLESS)), ImpactModel(law))
    for law in LAWS[:3]:
        for workers in 1, 2:
            yield lambda: ask_scenes(n, law, workers)
    yield lambda: independent_sets([[0], [1]], np.zeros(5000 * n, bool))


few = ask_scenes(4, Law.COULOMB, 1)
N = 8000
with open("/proc/self/statm") as pages:
    taken = int(pages.read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + 2**28,) * 2)
try:
    bytearray(8 * N * N)
except MemoryError:
    pass
else:
    raise SystemExit("there is no limit")
for ask in asked(N):
    try:
        ask()
    except MemoryError:
        print("MemoryError")
    else:
        print("answered")
for ask in asked(4):
    ask()
for before, after in zip(few, ask_scenes(4, Law.COULOMB, 1)):
    np.testing.assert_array_equal(before, after)
print("done")
"""


def test_too_little_memory_raises_memory_error():
    done = run_python("-c", SCRIPT)
    if done.stderr.startswith("there is no limit"):
        pytest.skip("this machine does not limit memory")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == ["MemoryError"] * 11 + ["done"]
