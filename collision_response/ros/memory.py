"""How much memory the process may take."""

from __future__ import annotations

import resource


def limit_memory(mebibytes: int) -> None:
    """Have allocations fail beyond a limit, so that no request, however hostile, takes the machine's memory.

    What is counted is private memory that can be written to: not libraries, and not what DDS shares.

    Args:
        mebibytes: the limit; 0: none.
    """
    if not mebibytes:
        return
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = mebibytes << 20
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (wanted, hard))
