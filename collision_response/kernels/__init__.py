"""The formulas, compiled to machine code by the build. Head of ``symbol.py``: how."""
