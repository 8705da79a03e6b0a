"""Numbers: ``operations.py`` has what formulas do with any type of them, ``balls.py`` a type with a bound.

The types that the kernels compute with are in ``kernels/numbers.hpp``.
"""
