"""Mass, centre of mass and inertia of sets of particles and of common solids.

For particles of mass ``m`` at ``(x, y, z)`` from their centre of mass,

    I_xx = sum m (y^2 + z^2)        I_xy = -sum m x y        and likewise for the other axes.

Solids are homogeneous, with their centre of mass at the origin; masses are in kg, lengths in m. Fractions
stay exact, other numbers are floats. All functions raise ``TypeError`` if something is not a number, and
``ImpactError``, with the name of the argument, if a mass or a size of a solid is negative, a number is not
finite, or a result is beyond float64.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from fractions import Fraction
from typing import Any, NamedTuple

from ..arguments import as_list, of_one_type
from ..numbers.operations import Scalar, add_up, maximum, numbers_in
from ..status import ImpactError, StatusCode, format_value
from .tensor import Symmetric3
from .vector import ZERO, Vec3, as_vector


class MassProperties(NamedTuple):
    """Mass, centre of mass and inertia of a body, as :meth:`Body.of` takes them.

    Attributes:
        mass: [kg].
        com: centre of mass, from the origin of the body's axes [m].
        inertia: about the centre of mass, in the body's axes [kg m^2].
    """

    mass: Scalar
    com: Vec3
    inertia: Symmetric3


class Particle(NamedTuple):
    """A point mass: mass [kg] and position [m]."""

    mass: Scalar
    position: Vec3


def of_particles(particles: Iterable[tuple[Scalar, Iterable[Scalar]]]) -> MassProperties:
    """Mass properties of a set of particles: exact, or rounded once if their masses or positions are floats.

    Floats that differ by no more than their rounding count as equal: particles on a line along an axis have
    no inertia about it.

    Args:
        particles: a :class:`Particle`, or a tuple of a mass [kg] and a position [m], for each. A negative
            mass is one that is missing in another, such as a hole.

    Raises:
        ImpactError: INVALID_MASS, if the sum of the masses is not positive, or there is no particle;
            INVALID_INERTIA, if negative masses leave a negative moment of inertia; NOT_FINITE.
        TypeError: if ``particles`` does not hold a mass and a position each, made of real numbers.
    """
    given: dict[str, Any] = {}
    for i, one in enumerate(as_list("particles", particles)):
        given |= _particle(f"particles[{i}]", one)
    numbers = of_one_type(given)
    number = _as_float if numbers and isinstance(numbers[0], float) else Fraction
    masses, unit_of_mass = _whole(numbers[::4])
    places, unit = _whole([x for i, x in enumerate(numbers) if i % 4])
    axes = [places[k::3] for k in range(3)]
    total = add_up(masses) if masses else 0
    if not total > 0:
        reason = f"masses must add up to more than 0, are {format_value(number(total * unit_of_mass), str)}"
        raise ImpactError(StatusCode.INVALID_MASS, "particles", reason)
    sums = [add_up(map(operator.mul, masses, axis)) for axis in axes]
    extends = [number is Fraction or _extends(axis) for axis in axes]

    def second_moment(i: int, j: int) -> Fraction:
        """``sum m x_i x_j`` about the centre of mass."""
        if not (extends[i] and extends[j]):
            return Fraction(0)
        whole = add_up(m * x * y for m, x, y in zip(masses, axes[i], axes[j], strict=True))
        return (whole - Fraction(sums[i] * sums[j], total)) * unit_of_mass * unit * unit

    xx, yy, zz = (second_moment(k, k) for k in range(3))
    products = (second_moment(i, j) for i, j in ((0, 1), (0, 2), (1, 2)))
    xy, xz, yz = (number(-product) for product in products)
    inertia = Symmetric3(number(yy + zz), xy, xz, number(xx + zz), yz, number(xx + yy))
    com = Vec3(*(number(unit * Fraction(one, total)) for one in sums))
    found = within_float64(MassProperties(number(total * unit_of_mass), com, inertia))
    least = min(inertia.xx, inertia.yy, inertia.zz)
    if least < 0:
        reason = f"have a negative moment of inertia, {format_value(least, str)}"
        raise ImpactError(StatusCode.INVALID_INERTIA, "particles", reason)
    return found


def _whole(numbers: list[Scalar]) -> tuple[list[int], Fraction]:
    """Return numbers as multiples of a unit, and the unit."""
    ratios = [x.as_integer_ratio() for x in numbers]
    common = math.lcm(*(denominator for _, denominator in ratios))
    return [numerator * (common // denominator) for numerator, denominator in ratios], Fraction(1, common)


NO_EXTENT = Fraction(1, 2**51)
"""Distances up to this part of the coordinates are rounding."""


def _extends(coordinates: list[int]) -> bool:
    """Whether coordinates differ by more than their rounding.

    Otherwise particles on a line would turn about it as if it were a body as thick as that.
    """
    least, most = min(coordinates), max(coordinates)
    return most - least > NO_EXTENT * max(abs(least), abs(most))


def _as_float(x: Fraction) -> float:
    try:
        return float(x)
    except OverflowError:
        return math.inf if x > 0 else -math.inf


def _particle(name: str, given: Any) -> dict[str, Any]:
    """Return the four numbers of a particle by name."""
    try:
        mass, position = given
    except (TypeError, ValueError):
        raise TypeError(f"{name}: must be a mass and a position, is {format_value(given)}") from None
    parts = as_vector(f"{name}.position", position)._asdict().items()
    return {f"{name}.mass": mass} | {f"{name}.position.{axis}": x for axis, x in parts}


def sphere(mass: Scalar, radius: Scalar) -> MassProperties:
    """A solid sphere."""
    mass, radius = _checked(mass=mass, radius=radius)
    moment = _moment(mass / 5 * 2, radius)
    return _principal(mass, moment, moment, moment)


def hollow_sphere(mass: Scalar, radius: Scalar) -> MassProperties:
    """A thin spherical shell."""
    mass, radius = _checked(mass=mass, radius=radius)
    moment = _moment(mass / 3 * 2, radius)
    return _principal(mass, moment, moment, moment)


def box(mass: Scalar, size: Iterable[Scalar]) -> MassProperties:
    """A solid box with edges ``size = (x, y, z)`` [m] along the axes."""
    sizes = {f"size.{axis}": edge for axis, edge in as_vector("size", size)._asdict().items()}
    mass, x, y, z = _checked(mass=mass, **sizes)
    return _principal(mass, _moment(mass, y, z) / 12, _moment(mass, x, z) / 12, _moment(mass, x, y) / 12)


def cylinder(mass: Scalar, radius: Scalar, length: Scalar) -> MassProperties:
    """A solid cylinder about the z axis."""
    mass, radius, length = _checked(mass=mass, radius=radius, length=length)
    transverse = _moment(mass / 4, radius) + _moment(mass / 12, length)
    return _principal(mass, transverse, transverse, _moment(mass / 2, radius))


def capsule(mass: Scalar, radius: Scalar, length: Scalar) -> MassProperties:
    """A solid cylinder about the z axis with a half ball at each end; ``length`` is without them [m]."""
    mass, radius, length = _checked(mass=mass, radius=radius, length=length)
    size = maximum(radius, length)
    if size == 0:
        reason = "or the length of the capsule must be above 0"
        raise ImpactError(StatusCode.INVALID_INERTIA, "radius", reason)
    volumes = 3 * (length / size), 4 * (radius / size)  # of the cylinder and of the ends
    middle, ends = (mass * (volume / add_up(volumes)) for volume in volumes)
    # A half ball has 83/320 m r^2 about its centre of mass, which is at 3/8 r.
    transverse = _moment(middle / 4 + ends / 320 * 83, radius) + _moment(middle / 12, length)
    transverse += _moment(ends, length / 2 + radius / 8 * 3)
    return _principal(mass, transverse, transverse, _moment(middle / 2 + ends / 5 * 2, radius))


def cone(mass: Scalar, radius: Scalar, height: Scalar) -> MassProperties:
    """A solid cone about the z axis; its base lies height/4 below the centre of mass, its tip above."""
    mass, radius, height = _checked(mass=mass, radius=radius, height=height)
    transverse = _moment(mass / 20 * 3, radius) + _moment(mass / 80 * 3, height)
    return _principal(mass, transverse, transverse, _moment(mass / 10 * 3, radius))


def mesh(mass: Scalar, shape: Any) -> MassProperties:
    """A homogeneous solid bounded by a mesh; axes and origin are those of the mesh.

    Each triangle forms a tetrahedron with the middle of the mesh. From there its corners are ``a``, ``b`` and
    ``c``; let ``s = a + b + c``. Then

        V = a.(b x c) / 6    int x dV = V s / 4    int x x^T dV = V (a a^T + b b^T + c c^T + s s^T) / 20

    Positions are taken from the middle, so a mesh far from the origin loses no digits except those that its
    corners have already lost.

    A part that is inside out counts as a cavity, and where parts overlap they count twice.

    Args:
        mass: [kg].
        shape: a mesh of `trimesh <https://trimesh.org>`_, in metres, or any object with its attributes
            ``is_watertight``, ``is_winding_consistent`` and ``triangles``, an array of shape ``(n, 3, 3)``.

    Raises:
        ImpactError: INVALID_INERTIA, if the mesh is not closed, is inside out, or has cavities far outside.
        TypeError: if ``shape`` is not a mesh.
    """
    (mass,) = _checked(mass=mass)
    if not all(hasattr(shape, name) for name in ("is_watertight", "is_winding_consistent", "triangles")):
        raise TypeError(f"shape: must be a mesh of trimesh, is {format_value(shape)}")
    corners = shape.triangles
    if getattr(corners, "shape", ())[1:] != (3, 3) or corners.dtype.kind not in "iuf":
        raise TypeError(f"shape.triangles: must be numbers of shape (n, 3, 3), is {format_value(corners)}")
    if not (shape.is_watertight and shape.is_winding_consistent and len(shape.triangles)):
        raise _no_volume()
    points = corners.reshape(-1, 3).astype(float)
    least = points.min(axis=0)
    middle = least + (points.max(axis=0) - least) / 2
    size = float(abs(points - middle).max())  # unit of length: products of lengths could overflow
    if not size > 0:
        raise _no_volume()
    a, b, c = (Vec3(*((points[k::3] - middle) / size).T) for k in range(3))
    s = a + b + c
    volumes = a.dot(b.cross(c)) / 6
    volume = volumes.sum()
    across = (b - a).cross(c - a)
    areas = across.dot(across) ** 0.5 / 2
    if not volume > LEAST_THICKNESS * areas.sum():
        raise _no_volume()
    com = [float((volumes * component).sum() / (4 * volume)) for component in s]

    def second_moment(i: int, j: int) -> float:
        """``int x_i x_j dV / V`` about the centre of mass."""
        whole = (volumes * (a[i] * a[j] + b[i] * b[j] + c[i] * c[j] + s[i] * s[j])).sum() / (20 * volume)
        return float(whole - com[i] * com[j])

    xx, yy, zz = (second_moment(i, i) for i in range(3))
    if min(xx, yy, zz) < 0:
        raise _no_volume()
    inertia = Symmetric3(
        yy + zz, -second_moment(0, 1), -second_moment(0, 2), xx + zz, -second_moment(1, 2), xx + yy
    )
    centre = Vec3(*(float(x) + size * offset for x, offset in zip(middle, com, strict=True)))
    return within_float64(MassProperties(mass, centre, inertia * mass * size * size))


LEAST_THICKNESS = 2.0**-44
"""The volume of a mesh is rounding up to this fraction of its surface, in units of its size."""


def _no_volume() -> ImpactError:
    reason = "does not enclose a volume: try trimesh's repair.fill_holes and fix_normals"
    return ImpactError(StatusCode.INVALID_INERTIA, "shape", reason)


def rod(mass: Scalar, length: Scalar) -> MassProperties:
    """A thin rod along the x axis, without inertia about that axis."""
    mass, length = _checked(mass=mass, length=length)
    transverse = _moment(mass / 12, length)
    return _principal(mass, transverse * 0, transverse, transverse)


def _moment(mass: Scalar, *lengths: Scalar) -> Scalar:
    """``mass`` times the sum of squares; multiplied in this order, only the result can be out of range."""
    return add_up(mass * x * x for x in lengths)


def _checked(**given: Scalar) -> list[Scalar]:
    """Return the numbers for use in formulas. Raises: as the head of this file says."""
    numbers = of_one_type(given)
    for name, x in zip(given, numbers, strict=True):
        if x < 0:
            code = StatusCode.INVALID_MASS if name == "mass" else StatusCode.INVALID_INERTIA
            raise ImpactError(code, name, f"must be at least 0, is {format_value(given[name], str)}")
    return numbers


def _principal(mass: Scalar, xx: Scalar, yy: Scalar, zz: Scalar) -> MassProperties:
    return within_float64(MassProperties(mass, ZERO, Symmetric3(xx, 0 * xx, 0 * xx, yy, 0 * xx, zz)))


def within_float64(found: MassProperties) -> MassProperties:
    """Return mass properties as they are. Raises: as the head of this file says."""
    for name, part in found._asdict().items():
        if not all(x - x == 0 for x in numbers_in(part)):
            raise ImpactError(StatusCode.NOT_FINITE, name, "is beyond float64")
    return found
