"""Every answer for a cluster is checked: impulses that break mechanics are a fault, not an answer."""

from __future__ import annotations

import ctypes
from fractions import Fraction as F

import pytest
from compile_cpp import compile_library

from collision_response import Body, Contact
from collision_response.kernels.tracer.headers import headers_of
from collision_response.scene.rational_cluster import RationalCluster, RationalImpulses

MU = 0.3

SOURCE = """
#include "scene/active_set.cpp"
#include "scene/assembled.cpp"
#include "scene/assembly.cpp"
#include "scene/cluster.cpp"
#include "scene/effect.cpp"
#include "scene/least_norm.cpp"
#include "scene/list.cpp"
#include "validity_everything.hpp"

void check_everything(const double* input, double* fault, bool* flags) {
  validity<double>(input, nullptr, fault, flags);
}

// Whether impulses on the four contacts of a point mass that falls and slides along x break mechanics.
extern "C" bool is_unphysical(double e, double mu, const double* normal, const double* tangential) {
  std::array<double, BODY> ball{}, floor{};
  ball[BODY_MASS] = 1;
  floor[BODY_MASS] = INFINITY;
  ball[BODY_ORIENTATION_W] = floor[BODY_ORIENTATION_W] = 1;
  ball[BODY_VELOCITY_X] = 1;
  ball[BODY_VELOCITY_Z] = -1;
  ClusterParts parts{{ball, floor}, {}};
  ClusterImpulses impulses;
  for (int i = 0; i < 4; ++i) {
    parts.contacts.push_back({{0, 1}, {0.1 * i, 0, 0, 0, 0, 1, e, mu}, 1});
    impulses.normal.push_back({normal[i], 0});
  }
  if (mu > 0) impulses.tangential.assign(tangential, tangential + 8);
  const Cluster cluster(parts, false);
  return effect_of(cluster.assembly, impulses, false).is_unphysical;
}
"""

FAULTS = {
    "approach": ([0.2] * 4, [0.0] * 8),
    "energy": ([0.6] * 4, [0.0] * 8),
    "pull": ([1.375, -0.625, -0.625, 1.375], [0.0] * 8),
    "friction outside the cone": ([0.375] * 4, [0.0, 0.1, 0.0, 0.1, 0.0, 0.1, 0.0, 0.15]),
    "energy by friction": ([0.5] * 4, [0.0, -0.1] * 4),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> ctypes.CDLL:
    directory = tmp_path_factory.mktemp("effect")
    for target in ("constants", "column", "validity"):
        for name, text in headers_of(target).items():
            (directory / f"{name}.hpp").write_text("#pragma once\n" + text())
    return compile_library(SOURCE, directory)


def is_unphysical(library: ctypes.CDLL, e: float, mu: float, normal: list, tangential: list) -> bool:
    """The second tangents of the contacts point against the slip."""
    library.is_unphysical.restype = ctypes.c_bool
    numbers = (ctypes.c_double * 4)(*normal), (ctypes.c_double * 8)(*tangential)
    return library.is_unphysical(ctypes.c_double(e), ctypes.c_double(mu), *numbers)


@pytest.mark.parametrize("fault", FAULTS)
def test_impulses_that_break_mechanics_are_found(library, fault):
    assert is_unphysical(library, 0.5, MU, *FAULTS[fault])


@pytest.mark.parametrize("fault", ["approach", "energy", "pull"])
def test_without_friction_too(library, fault):
    assert is_unphysical(library, 0.5, 0.0, *FAULTS[fault])


@pytest.mark.parametrize(("e", "friction"), [(0.5, 0.1125), (0.5, 0.0), (1.0, 0.1), (0.0, 0.075)])
def test_impulses_within_the_laws_are_accepted(library, e, friction):
    assert not is_unphysical(library, e, MU, [(1 + e) / 4] * 4, [0.0, friction] * 4)


@pytest.mark.parametrize("fault", ["approach", "energy"])
def test_in_fractions_too(fault):
    mass = Body.dynamic(F(1), velocity=(F(1), F(0), F(-1)))
    contacts = [Contact.of((F(i), F(0), F(0)), (F(0), F(0), F(1)), F(1, 2), F(0)) for i in range(4)]
    cluster = RationalCluster([mass, Body.static()], [(0, 1)] * 4, contacts, [1] * 4)
    for p, expected in (([*map(F, FAULTS[fault][0])], True), ([F(3, 8)] * 4, False)):
        assert cluster.is_unphysical(p, cluster.effect_of(RationalImpulses(p))) is expected
