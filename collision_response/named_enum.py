"""Integer enumerations that print as names."""

from __future__ import annotations

from enum import IntEnum


class NamedEnum(IntEnum):
    """Constants of the messages, printed by name: ``print(Law.COULOMB)`` shows ``COULOMB``."""

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        return format(int(self) if spec[-1:] in ("b", "d", "o", "x", "X") else self.name, spec)
