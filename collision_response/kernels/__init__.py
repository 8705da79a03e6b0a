"""The formulas as machine code: written down on a tape, emitted as C++, compiled by the build."""
