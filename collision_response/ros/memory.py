"""Limiting the memory of the process."""

from __future__ import annotations

import re
import resource
from pathlib import Path

from .process import StartError


def limit_memory(mebibytes: int) -> None:
    """Make allocations fail beyond a limit, so that no request can exhaust the memory of the machine.

    The limit is on private writable memory. It excludes libraries and the shared memory of DDS.

    Args:
        mebibytes: the limit; 0: none.

    Raises:
        StartError: if the process already uses so much that DDS would end it at the next request.
    """
    if not mebibytes:
        return
    used, limit = private_memory(), mebibytes << 20
    if limit <= used:
        raise StartError(
            f"memory_limit: is {mebibytes} MiB, but the node uses {(used >> 20) + 1} at its start"
        )
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard != resource.RLIM_INFINITY:
        limit = min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


def private_memory() -> int:
    """Memory that the process uses, of the kind that is limited [bytes]."""
    match = re.search(r"^VmData:\s*(\d+) kB$", Path("/proc/self/status").read_text(), re.MULTILINE)
    return int(match[1]) << 10 if match else 0
