"""Impacts as programs: the geometries and laws of :mod:`physics`, traced for the batch and the fast path.

The rows of an array hold one quantity each; the lanes are body_a and body_b. A program is one of

    ordinary   the formula as it is for most contacts: both bodies can move and turn, and all numbers
               are sound. It has no branch but the one between approach and separation; its output
               ``ordinary`` says whether it may be believed.
    general    everything: immovable bodies, rods, points, and what is wrong with unsound numbers.

Where ``ordinary`` holds, the two agree to the last bit.
"""
