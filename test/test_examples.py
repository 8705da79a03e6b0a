"""The examples, in small."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from collision_response.physics.vector import Vec3

EXAMPLES = Path(__file__).parent.parent / "examples"


def test_a_batch_by_the_chunk():
    pytest.importorskip("dask.array")
    example = runpy.run_path(str(EXAMPLES / "dask_batch.py"))
    bodies, contacts = example["random_scene"](n=1000, chunk=300)
    result = example["resolve_batch"](bodies, contacts)
    assert result.status.chunks == ((300, 300, 300, 100),)
    whole = example["resolve_batch"](bodies.compute(), contacts.compute())
    np.testing.assert_array_equal(result.velocity.compute(), whole.velocity)
    answered = (result.status == example["StatusCode"].OK).sum()
    assert 300 < answered.compute() < 700


def test_a_filter_with_the_saltation_matrix_may_be_believed():
    example = runpy.run_path(str(EXAMPLES / "kalman_bounces.py"))
    good, naive = example["compare"](runs=8)
    # Of 8 runs of 50 steps, which depend on each other: sd of the mean some .6.
    assert 4 < good < 8 < naive


def test_a_cube_loses_energy_and_comes_to_rest_on_a_face():
    example = runpy.run_path(str(EXAMPLES / "bouncing_box.py"))
    cube = example["thrown"]()
    energies = [example["energy"](cube)]
    for _ in range(1500):
        cube = example["step"](cube)
        energies.append(example["energy"](cube))
    # Exact without an impact. With one, a step may err by the work of the weight at the speed of its fall.
    assert max(np.diff(energies)) < cube.mass * (example["GRAVITY"] * example["STEP"]) ** 2
    assert cube.velocity.norm() < 1e-9
    up = cube.to_body(Vec3(0.0, 0.0, 1.0))
    assert max(abs(x) for x in up) == pytest.approx(1, abs=1e-3)
    assert cube.position.z == pytest.approx(example["SIDE"] / 2, abs=1e-3)


def test_the_example_of_a_step_keeps_momentum_and_gains_no_energy():
    example = runpy.run_path(str(EXAMPLES / "step_of_arrays.py"))
    steps = example["steps"](balls=60, count=40, seed=1)
    momenta = np.array([step.momentum for step in steps])
    energies = np.array([step.energy for step in steps])
    contacts = [step.contacts for step in steps]
    assert sum(contacts) > 60
    assert abs(momenta - momenta[0]).max() < 1e-12 * np.sqrt(2 * energies[0] * 60)
    assert (np.diff(energies) <= 1e-12 * energies[0]).all()
    lost = sum(step.lost for step in steps[1:])
    assert lost == pytest.approx(energies[0] - energies[-1], rel=1e-9)
    assert lost > 0.05 * energies[0]
