"""Mass properties of solids, against sums over particles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from decimal import Decimal
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from refusals import refused

from collision_response import Body, Contact, StatusCode, resolve
from collision_response.physics import mass_properties as mp
from collision_response.physics.mass_properties import Particle, of_particles
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

# Solids as a few particles of the same mass, centre and inertia: nodes of an exact quadrature.


def sphere_particles(mass: float, radius: float) -> list[mp.Particle]:
    """Six particles on the axes, equimomental to a solid sphere."""
    d = radius * math.sqrt(3 / 5)
    at = [(d, 0, 0), (-d, 0, 0), (0, d, 0), (0, -d, 0), (0, 0, d), (0, 0, -d)]
    return _equal_shares(mass, at)


def box_particles(mass: float, size: Sequence[float]) -> list[mp.Particle]:
    """Eight particles at the Gauss nodes of a solid box."""
    return _equal_shares(mass, product(*(_gauss_nodes(edge) for edge in size)))


def cylinder_particles(mass: float, radius: float, length: float) -> list[mp.Particle]:
    """Eight particles, two rings of four, equimomental to a solid cylinder about z."""
    d = radius * math.sqrt(1 / 2)
    ring = [(d, 0), (0, d), (-d, 0), (0, -d)]
    return _equal_shares(mass, ((x, y, z) for (x, y), z in product(ring, _gauss_nodes(length))))


def rod_particles(mass: float, length: float) -> list[mp.Particle]:
    """Two particles at the Gauss nodes of a thin rod along x."""
    return _equal_shares(mass, ((x, 0, 0) for x in _gauss_nodes(length)))


def _gauss_nodes(length: float) -> tuple[float, float]:
    return -length / math.sqrt(12), length / math.sqrt(12)


def _equal_shares(mass: float, positions: Iterable[Sequence[float]]) -> list[mp.Particle]:
    at = [Vec3(*p) for p in positions]
    return [mp.Particle(mass / len(at), p) for p in at]


SOLIDS = [
    pytest.param(mp.sphere(2.0, 0.3), sphere_particles(2.0, 0.3), id="sphere"),
    pytest.param(mp.box(3.0, (0.2, 0.5, 1.1)), box_particles(3.0, (0.2, 0.5, 1.1)), id="box"),
    pytest.param(mp.cylinder(1.5, 0.4, 0.9), cylinder_particles(1.5, 0.4, 0.9), id="cylinder"),
    pytest.param(mp.rod(0.7, 1.3), rod_particles(0.7, 1.3), id="rod"),
]


@pytest.mark.parametrize(("solid", "particles"), SOLIDS)
def test_solid_equals_its_particles(solid, particles):
    mass, com, inertia = mp.of_particles(particles)
    # the particles' coordinates are rounded square roots: a few units in the last place
    assert mass == pytest.approx(solid.mass, rel=1e-15)
    assert com == pytest.approx(solid.com, abs=1e-16)
    assert inertia == pytest.approx(solid.inertia, rel=1e-15, abs=1e-17)


@pytest.mark.parametrize(
    ("solid", "inside", "half"),
    [
        (mp.sphere(2.0, 0.3), lambda x, y, z: x**2 + y**2 + z**2 <= 0.3**2, (0.3, 0.3, 0.3)),
        (mp.box(3.0, (0.2, 0.5, 1.1)), lambda x, y, z: x == x, (0.1, 0.25, 0.55)),
        (mp.cylinder(1.5, 0.4, 0.9), lambda x, y, z: x**2 + y**2 <= 0.4**2, (0.4, 0.4, 0.45)),
    ],
    ids=["sphere", "box", "cylinder"],
)
def test_solid_equals_a_fine_grid_of_particles(solid, inside, half):
    """Independent of the quadrature: the volume cut into 60^3 cells, accurate to the size of a cell."""
    axes = [np.linspace(-h, h, 120, endpoint=False)[::2] + h / 60 for h in half]
    grid = np.array([p for p in np.stack(np.meshgrid(*axes), -1).reshape(-1, 3) if inside(*p)])
    x, y, z = grid.T
    share = solid.mass / len(grid)
    moments = share * np.array([(y * y + z * z).sum(), (x * x + z * z).sum(), (x * x + y * y).sum()])
    assert moments == pytest.approx([solid.inertia.xx, solid.inertia.yy, solid.inertia.zz], rel=2e-3)


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_particles_of_fractions_have_exact_properties(count):
    """Against moments about the origin, moved to the centre of mass."""
    shares = [Fraction(k + 1, k + 3) for k in range(count)]
    places = [[Fraction((5 * k + i) % 7 - 3, 1 + (k + 2 * i) % 4) for i in range(3)] for k in range(count)]
    mass, com, inertia = mp.of_particles(zip(shares, places, strict=True))
    assert mass == sum(shares)
    assert list(com) == [sum(m * r[i] for m, r in zip(shares, places, strict=True)) / mass for i in range(3)]

    def moment(i: int, j: int) -> Fraction:
        return sum(m * r[i] * r[j] for m, r in zip(shares, places, strict=True)) - mass * com[i] * com[j]

    xx, yy, zz = (moment(i, i) for i in range(3))
    assert inertia == (yy + zz, -moment(0, 1), -moment(0, 2), xx + zz, -moment(1, 2), xx + yy)


def test_particles_must_have_mass():
    with pytest.raises(ValueError, match="add up to more than 0"):
        mp.of_particles([mp.Particle(0.0, Vec3(1.0, 2.0, 3.0))])


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: mp.sphere(1.0, -0.1), "radius"),
        (lambda: mp.hollow_sphere(1.0, -0.1), "radius"),
        (lambda: mp.box(1.0, (1.0, -1.0, 1.0)), "size.y"),
        (lambda: mp.cylinder(1.0, 0.1, -1.0), "length"),
        (lambda: mp.capsule(1.0, -0.1, 1.0), "radius"),
        (lambda: mp.capsule(1.0, 0.0, 0.0), "capsule"),
        (lambda: mp.cone(1.0, 0.1, -1.0), "height"),
        (lambda: mp.rod(1.0, -1.0), "length"),
    ],
)
def test_a_negative_size_is_refused_by_name(make, field):
    with pytest.raises(ValueError, match=field):
        make()


def test_numbers_beyond_float64_stay_exact():
    huge = Fraction(10**400)
    assert mp.sphere(huge, Fraction(1, 2)).inertia.xx == huge / 10
    assert mp.rod(Fraction(12), huge).inertia.zz == huge**2


CONSTRUCTORS = [
    mp.sphere,
    mp.hollow_sphere,
    lambda m, x: mp.box(m, (x, x, x)),
    lambda m, x: mp.cylinder(m, x, x),
]
CONSTRUCTORS += [lambda m, x: mp.capsule(m, x, x), lambda m, x: mp.cone(m, x, x), mp.rod]


@pytest.mark.parametrize("solid", CONSTRUCTORS)
@pytest.mark.parametrize("mass", [1, 10**400], ids=["1", "beyond"])
@pytest.mark.parametrize("power", [200, 400, 5000])
def test_integers_beyond_float64_are_refused_by_name(solid, mass, power):
    size = "inertia: is beyond float64" if power == 200 else r"(radius|size\.x|length): must be finite; is "
    with refused(StatusCode.NOT_FINITE, match=f"^{size if mass == 1 else 'mass: must be finite; is '}"):
        solid(mass, 10**power)


@pytest.mark.parametrize("wrong", [math.inf, -math.inf, math.nan, 10**400, Decimal("nan"), Decimal("1e400")])
def test_what_is_not_finite_is_refused_by_name(wrong):
    for i, name in enumerate(["mass", "size.x", "size.y", "size.z"]):
        mass, *size = [wrong if k == i else 1.0 for k in range(4)]
        with refused(StatusCode.NOT_FINITE, name):
            mp.box(mass, size)
        with refused(StatusCode.NOT_FINITE, f"particles[1].{name.replace('size', 'position')}"):
            mp.of_particles([(1.0, (0, 0, 0)), (mass, size)])


def test_a_hole_may_not_be_all_that_is_there():
    around = [(1, (x, y, 0)) for x in (-1, 1) for y in (-1, 1)]
    assert mp.of_particles([*around, (Fraction(-1, 2), (0, 0, 0))]).inertia.zz == 8
    with refused(StatusCode.INVALID_INERTIA, "particles", match="have a negative moment of inertia, -2"):
        mp.of_particles([(-1, (0, 0, 0)), (2, (1, 0, 0))])


def test_results_beyond_float64_are_refused_by_name():
    for particles, name in (
        ([(1e308, (0, 0, 0))] * 2, "mass"),
        ([(1.0, (1e308, 0, 0)), (-0.9, (-1e308, 0, 0))], "com"),
        ([(1.0, (1e200, 0, 0)), (1.0, (0, 0, 0))], "inertia"),
    ):
        with refused(StatusCode.NOT_FINITE, name, match="is beyond float64"):
            mp.of_particles(particles)


@pytest.mark.parametrize("axis", range(3))
def test_particles_on_a_line_have_no_inertia_about_it(axis):
    """Neither by rounding of the centre of mass, nor where the coordinates themselves are rounded."""
    for one in (0.3, 0.1 + 0.2):
        places = [[0.3] * 3 for _ in range(3)]
        places[0][(axis + 1) % 3] = one
        for place, along in zip(places, (-1.0, 0.1, 1.0), strict=True):
            place[axis] = along
        rod = mp.of_particles(zip((0.3, 0.1, 0.3), places, strict=True))
        moments = [rod.inertia.xx, rod.inertia.yy, rod.inertia.zz]
        assert moments[axis] == rod.inertia.xy == rod.inertia.xz == rod.inertia.yz == 0
        assert min(moments[axis - 1], moments[axis - 2]) > 0.5


def test_particles_at_one_place_have_no_inertia():
    assert mp.of_particles([(m, (0.1, 0.7, 0.3)) for m in (0.1, 0.2, 0.3)]).inertia == Symmetric3(*[0.0] * 6)


def test_many_particles_are_added_up_exactly():
    """The oblique rod still has no inertia about itself, so it does not turn about its own axis."""
    count = 5000
    rod = mp.of_particles([(0.1, (i / count, 2 * i / count, 3 * i / count)) for i in range(count)])
    assert rod.mass == 500.0
    body = Body.of(rod, velocity=(1.0, -0.5, -1.0))
    spin = resolve(body, Body.static(), Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2)).twist_a.angular
    assert abs(spin.dot(Vec3(1.0, 2.0, 3.0))) < 1e-12  # rounding: it turns at 0.6 rad/s


SHAPES = [
    (mp.sphere, 1, lambda r: [2 * r * r / 5] * 3),
    (mp.hollow_sphere, 1, lambda r: [2 * r * r / 3] * 3),
    (
        lambda m, *size: mp.box(m, size),
        3,
        lambda x, y, z: [(a * a + b * b) / 12 for a, b in ((y, z), (x, z), (x, y))],
    ),
    (mp.cylinder, 2, lambda r, h: [(3 * r * r + h * h) / 12] * 2 + [r * r / 2]),
    (mp.cone, 2, lambda r, h: [3 * (4 * r * r + h * h) / 80] * 2 + [3 * r * r / 10]),
    (mp.rod, 1, lambda h: [0, h * h / 12, h * h / 12]),
    (mp.capsule, 2, lambda r, h: of_a_capsule(r, h)),
]


def of_a_capsule(r: Fraction, h: Fraction) -> list[Fraction]:
    """Per mass; a half ball has 2/5 r^2 about its base, and its centre 3/8 r above that."""
    ball, middle = Fraction(4, 3) * r / (h + Fraction(4, 3) * r), h / (h + Fraction(4, 3) * r)
    at_end = 2 * r * r / 5 + h * h / 4 + Fraction(3, 8) * r * h
    return [middle * (3 * r * r + h * h) / 12 + ball * at_end] * 2 + [
        middle * r * r / 2 + ball * 2 * r * r / 5
    ]


@pytest.mark.parametrize(("solid", "count", "exact"), SHAPES)
@pytest.mark.parametrize("mass", [1e-300, 1e-150, 1.0, 1e150, 1e300, 1.7e308])
@pytest.mark.parametrize("number", [float, Fraction])
def test_moments_are_right_wherever_they_are_floats(solid, count, exact, mass, number):
    """However far products of the numbers are beyond float64."""
    for sizes in product([0.0, 5e-324, 1e-170, 1e-150, 0.3, 1e5, 1e150, 1e155], repeat=count):
        if not any(sizes):
            continue
        moments = [Fraction(mass) * x for x in exact(*map(Fraction, sizes))]
        if max(moments) > Fraction(1.797e308):
            continue
        found = solid(number(mass), *map(number, sizes)).inertia
        for one, moment in zip((found.xx, found.yy, found.zz), moments, strict=True):
            assert abs(Fraction(one) - moment) <= (moment / 2**50 + Fraction(3, 2**1074)) * (number is float)


@pytest.mark.parametrize("solid", CONSTRUCTORS)
@pytest.mark.parametrize("size", ["NaN", "Infinity", "1e999999"])
@pytest.mark.parametrize("mass", [1, Decimal(1), Decimal("NaN")])
def test_decimals_that_are_not_finite_are_refused_by_name(solid, size, mass):
    """Decimals raise errors of their own, here or when the body is used."""
    with refused(StatusCode.NOT_FINITE):
        body = Body.of(solid(mass, Decimal(size)), velocity=(0, 0, -1))._replace(mass=1.0)
        resolve(body, Body.static(), Contact.of((0, 0, 0), (0, 0, 1)))


@pytest.mark.parametrize("solid", CONSTRUCTORS)
@pytest.mark.parametrize("number", [np.float16, np.float32, np.array])
def test_numbers_of_numpy_lose_no_digits(solid, number):
    assert solid(number(0.75), number(300.5)) == solid(0.75, 300.5)
    placed = [(number(0.75), (number(300.5), number(0.0), number(-0.25)))]
    assert mp.of_particles(placed * 2) == mp.of_particles([(0.75, (300.5, 0.0, -0.25))] * 2)


@pytest.mark.parametrize("solid", CONSTRUCTORS)
@pytest.mark.parametrize("integer", [np.int8, np.uint8, np.int16])
def test_integers_of_numpy_do_not_overflow(solid, integer):
    assert solid(integer(100), integer(20)) == solid(100, 20)
    particles, expected = (
        mp.of_particles([(x(100), (x(90), x(0), x(20))), (x(50), (x(0), x(80), x(100)))])
        for x in (integer, int)
    )
    assert particles == expected
    tensor = np.array([[100, 90, 0], [90, 100, 0], [0, 0, 120]])
    assert Body.dynamic(1.0, tensor.astype(integer)).inertia == Body.dynamic(1.0, tensor.tolist()).inertia


@pytest.mark.parametrize("solid", CONSTRUCTORS)
@pytest.mark.parametrize("size", [True, np.True_, "1", None, 1j, [1.0]])
def test_a_size_must_be_a_real_number(solid, size):
    with pytest.raises(TypeError, match=r"^(radius|size\.x|length): must be a real number, is "):
        solid(1.0, size)


@pytest.mark.parametrize("solid", [*CONSTRUCTORS, lambda m, _: mp.mesh(m, None)])
def test_the_mass_must_be_a_number_that_is_not_negative(solid):
    for mass in (True, np.True_, "1", None, 1j, [1.0]):
        with pytest.raises(TypeError, match=r"^mass: must be a real number, is "):
            solid(mass, 1.0)
    for mass in (-1.0, -5e-324, Fraction(-1, 3), Fraction(-(10**300)), Decimal("-0.5")):
        with refused(StatusCode.INVALID_MASS, "mass", r"^mass: must be at least 0, is "):
            solid(mass, 1.0)


@pytest.mark.parametrize("exponent", [-320, -200, 0, 200, 307])
def test_the_norm_does_not_overflow(exponent):
    """3, 4 and 12 give 13; their squares overflow or underflow."""
    for zeros in ((0.0,), (0,)):
        s = float(f"1e{exponent}")
        assert Vec3(3 * s, 4 * s, *zeros).norm() == pytest.approx(5 * s, rel=1e-15, abs=5e-324)
        assert Vec3(3 * s, 4 * s, 12 * s).norm() == pytest.approx(13 * s, rel=1e-15, abs=5e-324)


@pytest.mark.parametrize("other", [Vec3(1.0, 2.0, 3.0), (1.0, 2.0, 3.0)])
def test_the_product_of_two_vectors_is_ambiguous_and_refused(other):
    with pytest.raises(TypeError, match=r"dot\(\) or cross\(\)"):
        Vec3(1.0, 2.0, 3.0) * other


@pytest.mark.parametrize("other", [(1.0, 2.0), (1.0, 2.0, 3.0, 4.0), np.ones(4), 1.0, np.float32(1.0)])
@pytest.mark.parametrize(
    "combine",
    [lambda v, other: v + other, lambda v, other: v - other, Vec3.dot, Vec3.cross],
    ids=["+", "-", "dot", "cross"],
)
def test_the_other_vector_must_have_three_components(combine, other):
    with pytest.raises((TypeError, ValueError)):
        combine(Vec3(1.0, 2.0, 3.0), other)


def test_a_box_has_three_edges():
    with pytest.raises(TypeError, match="size: must be"):
        mp.box(1.0, (1.0, 2.0))


def hull(corners, scale=1.0, middle=(0.0, 0.0, 0.0)):
    """The convex hull of some points, enlarged and moved."""
    trimesh = pytest.importorskip("trimesh")
    hull = trimesh.convex.convex_hull(np.array(corners, float))
    return trimesh.Trimesh(hull.vertices * scale + middle, hull.faces, process=False)


def corners_of_a_box(size):
    return [[sign * edge / 2 for sign, edge in zip(signs, size, strict=True)] for signs in SIGNS]


SIGNS = list(product((-1, 1), repeat=3))


@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (0.25, 2.0, 0.5), (1.0, 1.0, 2.0**-20)])
@pytest.mark.parametrize(
    "middle", [(0.0, 0.0, 0.0), (4.0, -8.0, 1.0), (2.0**20, -(2.0**21), 2.0**19), (2.0**30,) * 3]
)
def test_a_mesh_has_the_same_inertia_wherever_it_is(size, middle):
    """Its corners are exact floats at all of these places."""
    found, exact = mp.mesh(3.0, hull(corners_of_a_box(size), 1.0, middle)), mp.box(3.0, size)
    assert found.com == pytest.approx(middle, rel=1e-15, abs=1e-15)
    assert found.inertia == pytest.approx(exact.inertia, rel=1e-14, abs=1e-14)


@pytest.mark.parametrize("power", [-400, -333, -100, 100, 333, 400])
def test_a_mesh_may_be_of_any_size(power):
    """Its volume, or the square of its size, is out of range."""
    found = mp.mesh(3.0 * 2.0**-power, hull(corners_of_a_box((1.0, 2.0, 3.0)), 2.0**power))
    moments = np.array(found.inertia) * 2.0**-power
    assert moments == pytest.approx(mp.box(3.0, (1.0, 2.0, 3.0)).inertia, rel=1e-14, abs=1e-14)


@pytest.mark.parametrize("middle", [(0.0, 0.0, 0.0), (0.5, -2.0, 1.0), (1e3, 2e3, -3e3)])
def test_a_mesh_equals_its_particles(middle):
    """Tetrahedra are integrated by four points each, exactly for squares (Hammer & Stroud 1956)."""
    rng = np.random.default_rng(0)
    mesh = hull(rng.normal(size=(30, 3)) * (1.0, 2.0, 0.5), 1.0, middle)
    apex = mesh.vertices[0]
    near, far = (5 - math.sqrt(5)) / 20, (5 + 3 * math.sqrt(5)) / 20
    particles = []
    for triangle in mesh.triangles:
        corners = [apex, *triangle]
        volume = np.linalg.det(triangle - apex) / 6
        for most in range(4):
            weights = [far if k == most else near for k in range(4)]
            place = sum(w * (corner - apex) for w, corner in zip(weights, corners, strict=True))
            particles.append(mp.Particle(volume / 4, Vec3(*map(float, place))))
    whole, com, inertia = mp.of_particles(particles)
    found = mp.mesh(2.0, mesh)
    assert np.subtract(found.com, apex) == pytest.approx(com, abs=1e-12)  # 1e3 has an ulp of 1e-13
    assert found.inertia == pytest.approx([2.0 / whole * x for x in inertia], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("distance", [0.0, 1e6, 1e12])
@pytest.mark.parametrize("how", ["open", "inside out", "flat", "flat and turned", "a corner is no number"])
def test_a_mesh_that_encloses_no_volume_is_refused(how, distance):
    mesh = hull(corners_of_a_box((1.0, 2.0, 3.0)), 1.0, (distance,) * 3)
    if how == "open":
        mesh.faces = mesh.faces[1:]
    elif how == "inside out":
        mesh.invert()
    elif how == "flat and turned":  # by rounding, its volume is 6e-18
        mesh.vertices = (mesh.vertices - distance) @ np.array([(0.1, 0.2, 0.3), (0.3, -0.1, 0.7), (0, 0, 0)])
    else:
        mesh.vertices = mesh.vertices * (1, 1, 0) if how == "flat" else mesh.vertices * (1, 1, np.nan)
    with pytest.raises(ValueError, match="does not enclose a volume"):
        mp.mesh(1.0, mesh)


def test_a_part_that_is_inside_out_far_outside_is_refused():
    trimesh = pytest.importorskip("trimesh")
    cube, other = (hull(corners_of_a_box((1.0,) * 3), 1.0 - 0.5 * k, (3.0 * k, 0.0, 0.0)) for k in (0, 1))
    both = mp.mesh(1.0, trimesh.util.concatenate([cube, other]))
    assert both.com.x == pytest.approx(3.0 / 9.0, rel=1e-15)
    other.invert()
    other.apply_scale(1.5)
    with refused(StatusCode.INVALID_INERTIA, "shape", match="does not enclose a volume"):
        mp.mesh(1.0, trimesh.util.concatenate([cube, other]))


@pytest.mark.parametrize("shape", [None, "part.stl", np.zeros((12, 3, 3))])
def test_only_a_mesh_is_accepted(shape):
    with pytest.raises(TypeError, match="shape: must be a mesh of trimesh, is "):
        Body.mesh(1.0, shape)


class Triangles:
    """A mesh of another library: a box of 2 x 4 x 6 m with a corner at (1, 1, 1)."""

    is_watertight = is_winding_consistent = True

    def __init__(self, kind):
        corners = np.add(corners_of_a_box((2.0, 4.0, 6.0)), (2.0, 3.0, 4.0))
        self.triangles = hull(corners).triangles.astype(kind)


@pytest.mark.parametrize("kind", ["uint8", "int8", "uint32", "int64", "float32", "float64"])
def test_the_corners_of_a_mesh_may_be_numbers_of_any_type(kind):
    found = mp.mesh(3.0, Triangles(kind))
    assert found.com == pytest.approx((2.0, 3.0, 4.0), rel=1e-15)
    assert found.inertia == pytest.approx(mp.box(3.0, (2.0, 4.0, 6.0)).inertia, rel=1e-14, abs=1e-14)


def test_a_mesh_without_triangles_encloses_no_volume():
    mesh = Triangles(float)
    mesh.triangles = mesh.triangles[:0]
    with pytest.raises(ValueError, match="does not enclose a volume"):
        mp.mesh(1.0, mesh)


def test_s4_mass_properties_of_particles():
    """A dumbbell of 1 kg and 3 kg, 4 m apart along x, worked by hand."""
    particles = [
        Particle(Fraction(1), Vec3(*map(Fraction, (0, 1, 2)))),
        Particle(Fraction(3), Vec3(*map(Fraction, (4, 1, 2)))),
    ]
    mass, com, inertia = of_particles(particles)
    assert mass == 4
    assert com == (3, 1, 2)
    assert inertia == (0, 0, 0, 12, 0, 12)
