"""Requests must not contain sequences of bytes, strings or messages.

rmw_fastrtps allocates the length that a sequence claims before it checks whether the data is there. If the
elements are numbers of several bytes, the missing data is noticed and the request is dropped. If they are
bytes, strings or messages, the garbage is accepted: 80 bytes cost gigabytes and seconds.
"""

from __future__ import annotations

import re

import pytest

pytest.importorskip("rclpy")

from collision_response import srv

SAFE = re.compile(r"sequence<(double|float|u?int(16|32|64))(, \d+)?>")


def sequences(message, path=""):
    for name, kind in message.get_fields_and_field_types().items():
        if kind.startswith("sequence"):
            yield f"{path}{name}", kind
        elif "/" in kind and "[" not in kind:
            yield from sequences(type(getattr(message(), name)), f"{path}{name}.")


@pytest.mark.parametrize("name", [name for name in dir(srv) if name[0].isupper() and "_" not in name])
def test_requests_hold_no_sequences_of_bytes_strings_or_messages(name):
    request = getattr(srv, name).Request
    assert [(field, kind) for field, kind in sequences(request) if not SAFE.fullmatch(kind)] == []
