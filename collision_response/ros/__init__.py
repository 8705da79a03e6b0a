"""The ROS node: everything that knows messages, parameters and topics.

The files::

    node.py              builds the node; parameters.py: what can be set
    server.py            takes requests and sends answers; with these:
        round_robin.py, clients.py, take_all.py    whose turn it is, who is there, what has arrived
    impacts.py, batches.py, scenes.py    answer the three services; with these:
        body_lookup.py, states.py, serialized.py    bodies given by name, from the latest states received
        convert.py, tables.py    messages to bodies and back; tables in messages
    answer_log.py        publishes and records the answers
    diagnostics.py, throttled_warnings.py    what the node says about itself
    process.py, wheels.py    signals, timers, memory; releases of ROS
    impact_client.py, batch_client.py, scene_client.py    for clients: requests from bodies and arrays
    sources.py, markers.py    the nodes that publish body states, and markers

In these files, to refuse is to raise an :class:`ImpactError` with the code in parentheses.
"""

from .wheels import check_release

check_release()  # before any import of ROS: mixed releases fail with errors that nobody understands
