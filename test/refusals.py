"""A check for refused requests."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from collision_response import ImpactError, StatusCode


@contextmanager
def refused(
    code: StatusCode, field: str | None = None, match: str | None = None
) -> Iterator[pytest.ExceptionInfo[ImpactError]]:
    """Check that the block raises an ImpactError with this code; also its field and a pattern if given."""
    with pytest.raises(ImpactError, match=match) as caught:
        yield caught
    assert caught.value.code is code, caught.value
    assert field in (None, caught.value.field), caught.value
