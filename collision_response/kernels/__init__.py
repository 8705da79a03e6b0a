"""The formulas, compiled to machine code by the build.

Written in Python, they are compiled in these steps; ``symbol.py`` says more::

    symbol.py, simd_pairs.py   record the operations of a formula
    programs.py, layout.py     which formulas, on which inputs
    emit.py, constants.py      write C++ headers
    trace.py, CMakeLists.txt   run all of this, and compile each *.cpp.in for each number type

The number types: ``numbers.hpp`` bounds its own error, ``dual.hpp`` carries derivatives.

What a call from Python runs, through ``library.py``, whose types are in ``_compiled.pyi``::

    module.cpp                 the module: its functions, and the Python objects that they use
    resolve.cpp                one impact: reads the request, calls a kernel, makes the answer
    resolve_batch.cpp          arrays of independent contacts
    resolve_scene.cpp          several contacts at once; the computation is in scene/
    cluster_object.cpp         clusters for the laws of collision_response/scene/
    derivatives.cpp            derivatives of many impacts, a module of its own

    kernel_table.hpp           which kernel computes what
    units.hpp                  tries other units where numbers leave the range of floats
    answer_bound.hpp           makes one error bound of the errors of all numbers
"""
