"""The type of the compiled function of ``derivatives.cpp``, which says what it does."""

from typing import Any

import numpy as np

_Array = np.ndarray[Any, Any]

def differentiate(
    law: int,
    n: int,
    count: int,
    is_shared: bool,
    inputs: _Array | bytes,
    directions: _Array,
    jacobian: _Array,
    smoothness: _Array,
    /,
) -> bool: ...
