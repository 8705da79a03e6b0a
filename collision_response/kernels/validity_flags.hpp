// What the check of a request says of a valid one: the flags of validity_header() of programs.py, in their order.
#pragma once

enum ValidityFlag {
  POINT_IF_FRICTIONLESS,
  POINT_SUFFICES,
  PLANAR_IF_FRICTIONLESS,
  PLANAR_SUFFICES,
  IS_OFF_UNIT,
  VALIDITY_FLAGS
};
