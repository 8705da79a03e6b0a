"""The examples, in small."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

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
