"""From formulas in Python to C++ headers, during the build.

``trace.py``, which ``CMakeLists.txt`` runs, takes two steps:

1. ``headers.py`` runs each formula on symbols (``symbol.py``). A symbol is a number that computes nothing: it
   records each operation on a tape. ``inputs.py`` makes the symbols of two bodies, a contact and a model.
   ``simd_pairs.py`` joins what is computed for both bodies.
2. ``emit.py`` writes the tape as a C++ function template, whose parameter is the number type. Which type each
   number has and what stands in an ``if`` come from ``cpp_types.py`` and ``branches.py``.

``constants.py`` and ``units.py`` write what C++ shares with Python beside formulas.
"""
