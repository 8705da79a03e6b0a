"""The node under load, faults and hostile input, from outside: it is a process, and so is each client.

``processes.py`` starts and ends them, ``kinds.py`` has what they ask, ``client.py`` asks and counts. Then one
file for each question: ``faults.py``, ``fuzz.py``, ``states.py``, ``soak.py``. ``page.py`` has the tables.
"""
