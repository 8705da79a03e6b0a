"""Mass, centre of mass and inertia of sets of particles and of common solids.

For particles of mass ``m`` at ``(x, y, z)`` from their centre of mass,

    I_xx = sum m (y^2 + z^2)        I_xy = -sum m x y        and likewise for the other axes.

Solids are homogeneous, with their centre of mass at the origin; masses are in kg, lengths in m. The
functions for them raise ``ValueError`` if the mass or a size is negative, ``TypeError`` if one is not a
number, and ``ImpactError`` if they are integers and the inertia is beyond the range of float64.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, NamedTuple, ParamSpec

from ..arguments import as_list, real_number
from ..numbers.operations import Scalar
from ..status import ImpactError, StatusCode, format_value
from .tensor import UNIT, Symmetric3
from .vector import ZERO, Vec3, as_vector

P = ParamSpec("P")


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


def _within_float64(solid: Callable[P, MassProperties]) -> Callable[P, MassProperties]:
    """Raise an ImpactError where Python raises an error as it divides numbers beyond float64."""

    @wraps(solid)
    def checked(*args: P.args, **kwargs: P.kwargs) -> MassProperties:
        try:
            return solid(*args, **kwargs)
        except ArithmeticError:
            raise ImpactError(StatusCode.NOT_FINITE, "inertia", "is beyond float64") from None

    return checked


@_within_float64
def of_particles(particles: Iterable[tuple[Scalar, Iterable[Scalar]]]) -> MassProperties:
    """Mass properties of a set of particles: exact if their masses and positions are fractions.

    Args:
        particles: a :class:`Particle`, or a tuple of a mass [kg] and a position [m], for each.

    Raises:
        ValueError: if the sum of the masses is not positive, or there is no particle.
        TypeError: if ``particles`` does not hold a mass and a position each, made of real numbers.
    """
    checked = [_particle(f"particles[{i}]", one) for i, one in enumerate(as_list("particles", particles))]
    mass = sum(p.mass for p in checked)
    if not mass > 0:
        raise ValueError(f"the particles' masses must add up to more than 0, not {mass}")
    com = sum((p.position * p.mass for p in checked[1:]), checked[0].position * checked[0].mass) / mass
    inertia = UNIT * 0  # of whole numbers: floats would make fractions inexact
    for m, position in checked:
        x, y, z = position - com
        inertia += Symmetric3(
            m * (y * y + z * z), -m * x * y, -m * x * z, m * (x * x + z * z), -m * y * z, m * (x * x + y * y)
        )
    return MassProperties(mass, com, inertia)


def _particle(name: str, given: Any) -> Particle:
    try:
        mass, position = given
    except (TypeError, ValueError):
        raise TypeError(f"{name}: must be a mass and a position, is {format_value(given)}") from None
    position = as_vector(f"{name}.position", position)
    return Particle(
        real_number(f"{name}.mass", mass), Vec3(*(real_number(f"{name}.position", x) for x in position))
    )


@_within_float64
def sphere(mass: Scalar, radius: Scalar) -> MassProperties:
    """A solid sphere."""
    mass, radius = _checked(mass=mass, radius=radius)
    moment = 2 * mass * radius * radius / 5
    return _principal(mass, moment, moment, moment)


@_within_float64
def hollow_sphere(mass: Scalar, radius: Scalar) -> MassProperties:
    """A thin spherical shell."""
    mass, radius = _checked(mass=mass, radius=radius)
    moment = 2 * mass * radius * radius / 3
    return _principal(mass, moment, moment, moment)


@_within_float64
def box(mass: Scalar, size: Iterable[Scalar]) -> MassProperties:
    """A solid box with edges ``size = (x, y, z)`` [m] along the axes."""
    sizes = {f"size.{axis}": edge for axis, edge in as_vector("size", size)._asdict().items()}
    mass, *edges = _checked(mass=mass, **sizes)
    xx, yy, zz = (edge * edge for edge in edges)
    return _principal(mass, mass * (yy + zz) / 12, mass * (xx + zz) / 12, mass * (xx + yy) / 12)


@_within_float64
def cylinder(mass: Scalar, radius: Scalar, length: Scalar) -> MassProperties:
    """A solid cylinder about the z axis."""
    mass, radius, length = _checked(mass=mass, radius=radius, length=length)
    transverse = mass * (3 * radius * radius + length * length) / 12
    return _principal(mass, transverse, transverse, mass * radius * radius / 2)


@_within_float64
def capsule(mass: Scalar, radius: Scalar, length: Scalar) -> MassProperties:
    """A solid cylinder about the z axis with a half ball at each end; ``length`` is without them [m]."""
    mass, radius, length = _checked(mass=mass, radius=radius, length=length)
    total = 3 * length + 4 * radius  # volume of the cylinder and of the ends, over pi r^2 / 3
    if total == 0:
        raise ValueError("a capsule must have a radius or a length above 0")
    middle, ends = mass * 3 * length / total, mass * 4 * radius / total
    r, h = radius * radius, length * length
    transverse = middle * (3 * r + h) / 12 + ends * (2 * r / 5 + h / 4 + 3 * length * radius / 8)
    return _principal(mass, transverse, transverse, middle * r / 2 + ends * 2 * r / 5)


@_within_float64
def cone(mass: Scalar, radius: Scalar, height: Scalar) -> MassProperties:
    """A solid cone about the z axis; its base lies height/4 below the centre of mass, its tip above."""
    mass, radius, height = _checked(mass=mass, radius=radius, height=height)
    transverse = 3 * mass * (4 * radius * radius + height * height) / 80
    return _principal(mass, transverse, transverse, 3 * mass * radius * radius / 10)


def mesh(mass: Scalar, shape: Any) -> MassProperties:
    """A homogeneous solid bounded by a mesh; axes and origin are those of the mesh.

    Each triangle forms a tetrahedron with the middle of the mesh. From there its corners are ``a``, ``b`` and
    ``c``; let ``s = a + b + c``. Then

        V = a.(b x c) / 6    int x dV = V s / 4    int x x^T dV = V (a a^T + b b^T + c c^T + s s^T) / 20

    Positions are taken from the middle, so a mesh far from the origin loses no digits except those that its
    corners have already lost.

    Args:
        mass: [kg].
        shape: a mesh of `trimesh <https://trimesh.org>`_, in metres, or any object with its attributes
            ``is_watertight``, ``is_winding_consistent`` and ``triangles``, an array of shape ``(n, 3, 3)``.

    Raises:
        ValueError: if the mesh is not closed, or is inside out, or the mass is negative.
        TypeError: if ``shape`` is not a mesh, or the mass not a number.
    """
    (mass,) = _checked(mass=mass)
    if not all(hasattr(shape, name) for name in ("is_watertight", "is_winding_consistent", "triangles")):
        raise TypeError(f"shape: must be a mesh of trimesh, is {shape!r}")
    if not (shape.is_watertight and shape.is_winding_consistent and len(shape.triangles)):
        raise _no_volume()
    points = shape.triangles.reshape(-1, 3).astype(float)
    least = points.min(axis=0)
    middle = least + (points.max(axis=0) - least) / 2
    size = abs(points - middle).max()  # unit of length: products of lengths could overflow
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
    scale = mass * float(size) * float(size)
    inertia = Symmetric3(
        yy + zz, -second_moment(0, 1), -second_moment(0, 2), xx + zz, -second_moment(1, 2), xx + yy
    )
    centre = Vec3(*(float(x) + float(size) * offset for x, offset in zip(middle, com, strict=True)))
    return MassProperties(mass, centre, inertia * scale)


LEAST_THICKNESS = 2.0**-44
"""The volume of a mesh is rounding up to this fraction of its surface, in units of its size."""


def _no_volume() -> ValueError:
    return ValueError("the mesh does not enclose a volume: try trimesh's repair.fill_holes and fix_normals")


@_within_float64
def rod(mass: Scalar, length: Scalar) -> MassProperties:
    """A thin rod along the x axis, without inertia about that axis."""
    mass, length = _checked(mass=mass, length=length)
    transverse = mass * length * length / 12
    return _principal(mass, transverse * 0, transverse, transverse)


def _checked(**numbers: Scalar) -> list[Scalar]:
    """Return the numbers for use in formulas. Raises: as the head of this file says."""
    # Numbers of Python: small ones of NumPy overflow or lose digits.
    checked = [real_number(name, x) for name, x in numbers.items()]
    for name, x in zip(numbers, checked, strict=True):
        if x < 0:
            raise ValueError(f"{name}: must be at least 0, is {format_value(x, str)}")
    return checked


def _principal(mass: Scalar, xx: Scalar, yy: Scalar, zz: Scalar) -> MassProperties:
    return MassProperties(mass, ZERO, Symmetric3(xx, 0 * xx, 0 * xx, yy, 0 * xx, zz))
