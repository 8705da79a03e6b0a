"""The ROS node: everything that knows messages, parameters and topics."""

from .wheels import check_release

check_release()  # before any import of ROS: mixed releases fail with errors that nobody understands
