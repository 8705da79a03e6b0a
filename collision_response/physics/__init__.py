"""The formulas of an impact, for numbers of any type. They know no messages and no arrays.

The files::

    body.py, contact.py          two bodies and where they touch
    mass_properties.py           mass, centre of mass and inertia of solids
    centre_of_mass.py            a body at its centre of mass, and as a planar body
    effective_mass.py            both bodies as seen from the contact
    column.py                    one body as seen from a contact, along one direction
    inverse_inertia.py           a link of a mechanism
    laws/                        the impact laws
    energy.py                    kinetic energy
    restitution.py, friction.py  coefficients that depend on a speed
    combine.py, stiffness.py     coefficients of a pair from those of its materials
    vector.py, tensor.py, orientation.py
"""
