"""Numbers that print as their names."""

from __future__ import annotations

from enum import IntEnum


class NamedEnum(IntEnum):
    """The number of a constant of the messages, by name: ``print(Law.COULOMB)`` says ``COULOMB``."""

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        return format(self.name, spec)
