"""The ROS node: everything that knows messages, parameters and topics."""

from .wheels import check_release

check_release()  # first of all: wheels of two releases do not fail in an understandable way
