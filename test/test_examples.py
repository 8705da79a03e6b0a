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
