"""The ROS node: everything that knows messages, parameters and topics."""
