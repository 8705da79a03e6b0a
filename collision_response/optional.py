"""Packages that only some parts of this package need."""

from __future__ import annotations


def missing(name: str, package: str) -> ImportError:
    """Return the error that says how to install something that is not there.

    Args:
        name: what is not there.
        package: arguments for pip.
    """
    return ImportError(f"collision_response needs {name} for this: pip install {package}")
