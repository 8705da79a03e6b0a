"""Tests of the node from outside: under load, with faults, and with hostile input.

The node is a process, and so is each client. ``processes.py`` starts and ends them, ``request_kinds.py`` has
the requests, and ``client.py`` sends and counts them. Each question has one file: ``faults.py``, ``fuzz.py``,
``states.py``, ``soak.py``. ``page.py`` makes the tables of docs/reliability.md.
"""
