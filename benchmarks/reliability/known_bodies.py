"""Counts the bodies that a node knows, by a request for each body by name."""

from __future__ import annotations

from typing import Any

import numpy as np

from .child_process import DEADLINE, Parent, ros_node, service_client
from .publisher import name_of

AT_ONCE = 1000
"""Bodies of one request."""
UNKNOWN_BODY = 8


def run(order: dict[str, Any], parent: Parent) -> None:
    """Main function of the process: send "known" with the number of known bodies."""
    from collision_response import Geometry
    from collision_response.batch.rows import body_rows, contact_rows
    from collision_response.ros.batch_client import pack

    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    ground = np.zeros((body_row.height, 1))
    ground[body_row.mass] = np.inf
    with ros_node("known") as (node, executor):
        client = service_client(node, "resolve_collision_batch")
        parent.wait_until(client.service_is_ready)
        known = 0
        for begin in range(0, order["bodies"], AT_ONCE):
            names = [name_of(number) for number in range(begin, min(order["bodies"], begin + AT_ONCE))]
            contacts = np.zeros((contact_row.height, len(names)))
            contacts[contact_row.normal][2] = 1.0
            pairs = np.array([range(1, len(names) + 1), [0] * len(names)])
            request = pack(ground, pairs, contacts, names=names, frame_id="world")
            future = client.call_async(request)
            executor.spin_until_future_complete(future, DEADLINE)
            if not future.done():
                raise TimeoutError("no answer")
            if not future.result().success:
                raise RuntimeError(future.result().message)
            known += int((np.asarray(future.result().status) != UNKNOWN_BODY).sum())
        parent.send("known", known)
