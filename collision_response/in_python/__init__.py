"""What the kernels leave to Python: fractions, arbitrary precision, and coefficients that are functions.

``resolve.py`` calls these modules for requests that the kernels cannot answer. The formulas are the same.
"""
