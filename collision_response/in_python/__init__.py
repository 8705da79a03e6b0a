"""What the kernels leave to Python: impacts on fractions and on balls, and coefficients that are functions.

``resolve.py`` comes here where the kernels cannot answer. The formulas are the same.
"""
