"""How much memory the process may take."""

from __future__ import annotations

import re
import resource
from pathlib import Path

from .process import StartError


def limit_memory(mebibytes: int) -> None:
    """Have allocations fail beyond a limit, so that no request, however hostile, takes the machine's memory.

    What is counted is private memory that can be written to: not libraries, and not what DDS shares.

    Args:
        mebibytes: the limit; 0: none.

    Raises:
        StartError: so much is taken already that DDS would end the process at the next request.
    """
    if not mebibytes:
        return
    taken = private_memory()
    if mebibytes << 20 <= taken:
        raise StartError(f"memory_limit: is {mebibytes} MiB, but the start alone takes {(taken >> 20) + 1}")
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = mebibytes << 20
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (wanted, hard))


def private_memory() -> int:
    """What the process has of the memory that is limited [bytes]."""
    found = re.search(r"^VmData:\s*(\d+) kB$", Path("/proc/self/status").read_text(), re.MULTILINE)
    return int(found[1]) << 10 if found else 0
