"""Arrays of NumPy and of other libraries: lazy ones of Dask, and those of any library with the Array API."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeAlias, TypeVar

import numpy as np

Array: TypeAlias = np.ndarray[Any, Any]
"""An array of NumPy."""

T = TypeVar("T")

TO_HOST: dict[str, Any] = {"device": "cpu"} if np.lib.NumpyVersion(np.__version__) >= "2.1.0" else {}
"""Arguments with which ``from_dlpack`` copies from the memory of a GPU. Older NumPy cannot."""


def compared_by_identity(result: type[T]) -> type[T]:
    """Decorate a named tuple of arrays. It would compare arrays, but whether these are equal is an array."""
    for name in ("__eq__", "__ne__", "__hash__"):
        setattr(result, name, getattr(object, name))
    return result


def as_numpy(name: str, array: Any) -> Array:
    """Return the array as one of NumPy, without a copy if possible. It is copied from the memory of a GPU.

    Raises:
        ValueError: if it is not an array, if NumPy cannot read its memory, or if elements are masked.
    """
    check_unmasked(name, array)
    is_foreign = not isinstance(array, (np.ndarray, np.generic)) and hasattr(array, "__dlpack__")
    if hasattr(array, "resolve_neg"):  # PyTorch would leave out the sign of what it negates lazily
        array = array.resolve_neg()
    try:
        return np.from_dlpack(array, **TO_HOST) if is_foreign else np.asarray(array)
    except (BufferError, RuntimeError, TypeError, ValueError) as error:
        raise ValueError(f"{name}: must be an array that NumPy can read: {error}") from error


def check_unmasked(name: str, array: Any) -> None:
    """Raises: ValueError: if elements are masked. The kernels would not see the mask."""
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        raise ValueError(f"{name}: must be numbers, some are masked")


def is_lazy(array: Any) -> bool:
    """Whether the array is one of Dask."""
    return library_of(array) == "dask"


def converter_like(array: Any) -> Callable[[Array], Any] | None:
    """Return a function that converts arrays of NumPy to the library and the device of ``array``.

    ``None`` if ``array`` is NumPy's, or of a library without the Array API. PyTorch and CuPy have it, though
    their arrays do not tell.
    """
    library = library_of(array)
    if library == "torch":
        import torch

        return partial(torch.asarray, device=array.device)
    if library == "cupy":
        import cupy

        def on_its_device(result: Array) -> Any:
            with array.device:
                return cupy.asarray(result)

        return on_its_device
    namespace = getattr(array, "__array_namespace__", None)
    if library == "numpy" or namespace is None:
        return None
    return partial(namespace().asarray, device=getattr(array, "device", None))  # JAX compiles without devices


def library_of(array: Any) -> str:
    """Return the name of the library of an array."""
    return type(array).__module__.partition(".")[0]
