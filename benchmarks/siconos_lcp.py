"""Solves linear complementarity problems with Siconos, for benchmarks/scenes.py.

That program runs this one with the Python that has Siconos: on Debian and Ubuntu the system's, after
``apt install python3-siconos``.

Each line of the input is ``[A, q]`` for a new problem, or a number: how often to solve the last problem. Each
line of the output is ``[p, seconds]``: the solution, and the time of one.
"""

import json
import sys
import time

import numpy as np
import siconos.numerics as numerics


def main():
    for line in sys.stdin:
        asked, number = json.loads(line), 1
        if isinstance(asked, list):
            A, q = (np.array(part, order="F") for part in asked)
        else:
            number = asked
        start = time.thread_time()
        for _ in range(number):
            p, w = np.zeros(len(q)), np.zeros(len(q))
            problem = numerics.LCP(A, q)
            options = numerics.SolverOptions(numerics.SICONOS_LCP_LEMKE)
            failed = numerics.linearComplementarity_driver(problem, p, w, options)
        took = (time.thread_time() - start) / number
        print(json.dumps([None if failed else p.tolist(), took]), flush=True)


main()
