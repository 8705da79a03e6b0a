"""The formulas, compiled to machine code by the build, and the functions that call them.

The build::

    tracer/                    writes formulas, which are in Python, as C++ headers
    numbers.hpp, dual.hpp      number types: one bounds its own error, one carries derivatives
    *.cpp.in, CMakeLists.txt   kernels: the headers, compiled for each number type and instruction set
    layout.py                  which numbers a kernel reads

What a call from Python runs, through ``library.py``, whose types are in ``_compiled.pyi``::

    module.cpp                 the module: its functions, and the Python objects that they use
    resolve.cpp                one impact: reads the request, calls a kernel, makes the answer
    resolve_batch.cpp          arrays of independent contacts
    resolve_scene.cpp          several contacts at once, see below
    cluster_object.cpp         clusters for the laws of collision_response/scene/
    derivatives.cpp            derivatives of many impacts, a module of its own

    kernel_table.hpp           which kernel computes what
    units.hpp                  units in which numbers are in the middle of the range of floats
    suitable_units.hpp         tries these where numbers leave the range
    answer_bound.hpp           makes one error bound of the errors of all numbers
    protocol.py                budgets, reasons and flags that Python and C++ share

Several contacts at once, in ``scene/``::

    resolve_cluster.cpp        one cluster: applies a law, with its fallbacks; laws.hpp lists the laws
    assembly.cpp               its bodies and contacts, and what impulses do to them
    frictionless.cpp           FRICTIONLESS, by the projections of projection.cpp
    coulomb.cpp                COULOMB, by the programme of cones.cpp
    moreau.cpp                 MOREAU
    routh_stronge.cpp          ROUTH_STRONGE, along a path
    coulomb_conditions.cpp     friction that opposes each slip: for MOREAU, and COULOMB where contacts part;
                               condition_axes.cpp: along which axes
    least_norm.cpp             how contacts share a load; shared_loads.cpp: which of them carry it
    effect.cpp                 the answer: twists, energies, and the bound on their error
"""
