"""Mass properties of a robot's rigid bodies, from its description in URDF or SDF.

A body is a link together with all links that fixed joints connect to it; with ``locked`` joints, movable
joints connect links too, each at position 0. For links with masses ``m_i``, centres of mass ``c_i`` and
inertias ``I_i`` about them, all in the same axes, the body has

    m = sum m_i    c = sum m_i c_i / m    I = sum I_i + m_i (d_i.d_i 1 - d_i d_i^T)    d_i = c_i - c

Poses are homogeneous matrices of shape (4, 4). Missing elements have the defaults of their format: a link
without ``inertial`` has no mass in URDF, and 1 kg in SDF.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Any, NamedTuple, TypeVar
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from .arguments import number_in
from .physics.mass_properties import MassProperties, of_particles, within_float64
from .physics.orientation import Quaternion
from .physics.tensor import Symmetric3
from .status import ImpactError, format_value

T = TypeVar("T")

Pose = Any
"""A homogeneous matrix of shape (4, 4)."""

MODEL_FRAME = "__model__"
"""SDF's name for the frame of the model."""

FILE_ROUNDING = 0.01
"""Error of the moments of inertia in files, relative to the greatest: few digits are written."""

ROUNDING = 2.0**-50
"""Error of second moments that are computed from them, with the same scale."""

LEAST_SECOND_MOMENT = 2.0**-40
"""What takes the place of a second moment below 0, with the same scale: above 0 by more than rounding."""

WORLD = "world"
"""Name of what does not move: in SDF, and by custom of a link without mass in URDF."""

URDF_JOINTS = "fixed", "revolute", "continuous", "prismatic", "floating", "planar"
SDF_JOINTS = (
    "fixed",
    "revolute",
    "continuous",
    "prismatic",
    "revolute2",
    "universal",
    "ball",
    "screw",
    "gearbox",
)


def _compared_with_arrays(kind: type[T]) -> type[T]:
    """Decorate a named tuple with arrays: tuples compare them, but whether arrays are equal is an array."""

    def is_equal(one: Any, other: Any) -> bool:
        return type(one) is type(other) and all(map(np.array_equal, one, other))

    def differs(one: Any, other: Any) -> bool:
        return not is_equal(one, other)

    for name, method in (("__eq__", is_equal), ("__ne__", differs), ("__hash__", None)):
        setattr(kind, name, method)
    return kind


@_compared_with_arrays
class Inertial(NamedTuple):
    """A link's mass [kg], centre of mass [m] and inertia about it [kg m^2], in the axes of the link."""

    mass: float
    com: Any
    inertia: Any


@_compared_with_arrays
class Joint(NamedTuple):
    """A joint between two links, and the pose of the child in the axes of the parent at joint position 0."""

    parent: str
    child: str
    pose: Pose
    is_fixed: bool


class Description(NamedTuple):
    """The links and joints of a robot.

    Attributes:
        name: name of the robot.
        inertials: mass properties of the links, by link name.
        joints: the joints between the links.
    """

    name: str
    inertials: dict[str, Inertial]
    joints: tuple[Joint, ...]

    @classmethod
    @np.errstate(over="ignore", invalid="ignore")  # overflow is reported below, with the name of the link
    def read(cls, text: str | bytes) -> Description:
        """Parse a URDF, or an SDF with one model.

        Args:
            text: the XML; bytes are decoded as their XML declaration says.

        Raises:
            ValueError: if ``text`` is neither, or has an invalid number, a negative mass, a link, joint or
                frame without a name or with that of another one of its kind, two elements where one belongs,
                or a joint of unknown type; if a URDF is not a tree or has xacro elements; if an SDF model is
                static, or has a pose that is relative to a name that two have. The message says where.
            TypeError: if it is not text.
        """
        if not isinstance(text, (str, bytes)):
            raise TypeError(f"text: must be the XML as text or bytes, is {format_value(text)}")
        if text and "<" not in (text if isinstance(text, str) else text.decode("latin-1")):
            raise ValueError(f"text: must be the XML itself, not the name of a file; is {format_value(text)}")
        try:
            root = ElementTree.fromstring(text)
        except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: of the encoding
            raise ValueError(f"the description is not XML: {error}") from None
        if root.tag == "robot":
            return cls(root.get("name", ""), *_urdf(root))
        models = [*root.iterfind("model"), *root.iterfind("world/model")]
        if root.tag != "sdf" or len(models) != 1:
            raise ValueError(
                f"the description must be a URDF <robot>, or an <sdf> with one <model>; "
                f"is a <{root.tag}> with {len(models)}"
            )
        return cls(models[0].get("name", ""), *_sdf(models[0]))

    @np.errstate(over="ignore", invalid="ignore")  # overflow is reported below, with the name of the link
    def mass_properties(self, link: str, *, locked: bool = False) -> MassProperties:
        """Return the mass properties of the body that a link belongs to, in the axes of the link.

        Args:
            link: name of the link.
            locked: whether movable joints connect links as fixed joints do.

        Returns:
            The sums of the links. Files have few digits: of a thin plate, the greatest moment of inertia may
            be greater than the sum of the other two, which no body can have. If it is by up to 0.02 of the
            greatest number of its tensor, the link gets the nearest possible tensor.

        Raises:
            ValueError: if there is no such link; if the body is fixed to the world, has no mass, or has a
                mass or inertia that exceeds float64; or if it has several links, and no body can have the
                inertia of one of them.
        """
        if link not in self.inertials:
            raise ValueError(f"{self.name!r} has no link {link!r}; it has {', '.join(self.inertials)}")
        links = list(self._connected_links(link, locked))
        is_at_world = len(links) > 1 and WORLD in [name for name, _ in links]
        if is_at_world and not self.inertials[WORLD].mass:
            reason = "is fixed to the world: give it as a STATIC body"
            raise ValueError(f"link {link!r} of {self.name!r} {reason}")
        for name, _ in links if len(links) > 1 else ():  # of a single link, each request says so
            if not _is_possible(self.inertials[name].inertia):
                reason = "negative, or one principal moment is greater than the sum of the other two"
                raise ValueError(f"the inertia of link {name!r} of {self.name!r} is impossible: {reason}")
        parts = [_transformed(pose, _without_rounding(self.inertials[name])) for name, pose in links]
        if not sum(part.mass for part in parts) > 0:
            raise ValueError(f"link {link!r} of {self.name!r} has no mass")
        inertia = sum(part.inertia for part in parts)
        upper_triangle = Symmetric3(*(inertia / 2 + inertia.T / 2)[np.triu_indices(3)].tolist())
        try:
            of_links = of_particles((part.mass, part.com) for part in parts)
            return within_float64(of_links._replace(inertia=of_links.inertia + upper_triangle))
        except ImpactError:
            reason = "has a mass or an inertia that exceeds float64"
            raise ValueError(f"link {link!r} of {self.name!r} {reason}") from None

    def _connected_links(self, link: str, locked: bool) -> Iterator[tuple[str, Pose]]:
        """Yield the links of the body that ``link`` belongs to, with their poses in the axes of ``link``."""
        neighbours = defaultdict(list)
        for joint in self.joints:
            if joint.is_fixed or (locked and WORLD not in joint[:2]):
                neighbours[joint.parent].append((joint.child, joint.pose))
                neighbours[joint.child].append((joint.parent, np.linalg.inv(joint.pose)))
        poses = {link: np.eye(4)}
        pending = [link]
        while pending:
            name = pending.pop()
            yield name, poses[name]
            for other, pose in neighbours[name]:
                if other not in poses:
                    poses[other] = poses[name] @ pose
                    pending.append(other)


def _transformed(pose: Pose, part: Inertial) -> Inertial:
    rotation = pose[:3, :3]
    return Inertial(part.mass, rotation @ part.com + pose[:3, 3], rotation @ part.inertia @ rotation.T)


def _second_moments(inertia: Any) -> tuple[float, Any, Any]:
    """Return the greatest number of a tensor, and the second moments of mass in units of it, with their axes.

    They are the eigenvalues of ``tr(I)/2 1 - I``, the least first. A body has none below 0.
    """
    size = float(abs(inertia).max())
    scaled = inertia / size if 0 < size < math.inf else np.zeros((3, 3))
    moments, axes = np.linalg.eigh(np.trace(scaled) / 2 * np.eye(3) - scaled)
    return size, moments, axes


def _is_possible(inertia: Any) -> bool:
    """Whether a body can have a tensor, up to the rounding of numbers in files."""
    _, moments, _ = _second_moments(inertia)
    return bool(moments[0] >= -FILE_ROUNDING)


def _without_rounding(link: Inertial) -> Inertial:
    """Return a link with the nearest possible tensor, if it differs by no more than rounding in files."""
    size, moments, axes = _second_moments(link.inertia)
    if not -FILE_ROUNDING <= moments[0] < -ROUNDING:
        return link
    nearest = axes * np.maximum(moments, LEAST_SECOND_MOMENT) @ axes.T
    return link._replace(inertia=(np.trace(nearest) * np.eye(3) - nearest) * size)


def _by_name(owner: Element, tag: str) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in owner.iterfind(tag):
        name = element.get("name", "")
        if not name:
            raise ValueError(f"a <{tag}> has no name")
        if name in found:
            raise ValueError(f"{tag} {name!r} appears twice")
        found[name] = element
    return found


def _inertials(owner: Element, inertial: Callable[[Element], Inertial]) -> dict[str, Inertial]:
    return {name: inertial(link) for name, link in _by_name(owner, "link").items()}


def _urdf(robot: Element) -> tuple[dict[str, Inertial], tuple[Joint, ...]]:
    if any("xacro" in element.tag.rpartition("}")[0] for element in robot.iter()):  # by its namespace
        raise ValueError(f"robot {robot.get('name')!r} has xacro elements: expand them with xacro first")
    inertials = _inertials(robot, _urdf_inertial)
    joints = []
    parents: dict[str, list[str]] = {}
    for name, joint in _by_name(robot, "joint").items():
        where = f"joint {name!r}"
        parent, child = (_child(joint, end, where).get("link", "") for end in ("parent", "child"))
        _check_links(where, (parent, child), inertials)
        if child in parents:
            raise ValueError(f"{where}: its child {child!r} is the child of another joint too")
        parents[child] = [parent]
        joints.append(Joint(parent, child, _urdf_pose(joint, where), _is_fixed(joint, URDF_JOINTS)))
    try:
        TopologicalSorter(parents).prepare()
    except CycleError as error:
        raise ValueError(f"joints connect links in a circle: {', '.join(error.args[1])}") from None
    roots = [name for name in inertials if name not in parents]
    if len(roots) > 1:
        reason = "has more than one root: joints must connect all links"
        raise ValueError(f"robot {robot.get('name')!r} {reason}; {', '.join(roots)} have no parent")
    return inertials, tuple(joints)


def _is_fixed(joint: Element, types: Sequence[str]) -> bool:
    """Whether a joint is fixed. A type with a typing error is no movable joint: it would lose a mass."""
    kind = joint.get("type")
    if kind not in types:
        reason = f"type must be one of {', '.join(types)}; is {kind!r}"
        raise ValueError(f"joint {joint.get('name')!r}: {reason}")
    return kind == "fixed"


def _urdf_inertial(link: Element) -> Inertial:
    where = f"link {link.get('name')!r}"
    inertial = _child_or_none(link, "inertial", where)
    if inertial is None:
        return Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    mass = _mass(_child(inertial, "mass", where).get("value"), where)
    numbers = _child(inertial, "inertia", where).attrib
    at_com = Inertial(mass, np.zeros(3), _tensor(numbers, None, where))
    return _transformed(_urdf_pose(inertial, where), at_com)


def _urdf_pose(owner: Element, where: str) -> Pose:
    origin = _child_or_none(owner, "origin", where)
    if origin is None:
        return np.eye(4)
    xyz = _numbers(origin.get("xyz", "0 0 0"), 3, f"xyz of {where}")
    quat, rpy = origin.get("quat_xyzw"), origin.get("rpy")
    if quat is None:
        return _pose(xyz, _numbers("0 0 0" if rpy is None else rpy, 3, f"rpy of {where}"))
    if rpy is not None:
        raise ValueError(f"origin of {where}: must have rpy or quat_xyzw, not both")
    return _pose_from_quaternion(xyz, _numbers(quat, 4, f"quat_xyzw of {where}"), f"quat_xyzw of {where}")


def _sdf(model: Element) -> tuple[dict[str, Inertial], tuple[Joint, ...]]:
    for tag in ("model", "include"):
        if model.find(tag) is not None:
            raise ValueError(f"model {model.get('name')!r}: a <{tag}> inside a model is not supported")
    if _is_true(model.findtext("static")):
        raise ValueError(f"model {model.get('name')!r} is static: give it as a STATIC body")
    kinds = [_by_name(model, tag) for tag in ("joint", "frame", "link")]
    elements = kinds[0] | kinds[1] | kinds[2]
    for name, element in elements.items():
        if name == WORLD or name.startswith("__"):
            raise ValueError(f"{element.tag} {name!r} has a name that SDF reserves")

    known = {MODEL_FRAME: np.eye(4)}

    def pose_in_model(name: str) -> Pose:
        """Return the pose of a link, joint or frame in the axes of the model."""
        relative: dict[str, Pose] = {}
        while name not in known:
            if name not in elements or name in relative:
                raise ValueError(f"the pose of {[*relative][-1]!r} is relative to {name!r}, which has none")
            element = elements[name]
            pose = element.find("pose")
            relative[name] = _sdf_pose(pose, f"{element.tag} {name!r}")
            is_joint = element.tag == "joint"
            default = element.findtext("child", "").strip() if is_joint else element.get("attached_to")
            base_name = None if pose is None else pose.get("relative_to")
            if sum(base_name in kind for kind in kinds) > 1:
                raise ValueError(f"the pose of {name!r} is relative to {base_name!r}, a name that two have")
            name = base_name or default or MODEL_FRAME
        base = known[name]
        for name in reversed(relative):
            base = known[name] = base @ relative[name]
        return base

    inertials = _inertials(model, _sdf_inertial)
    joints = []
    for joint in model.iterfind("joint"):
        parent, child = ends = tuple(joint.findtext(end, "").strip() for end in ("parent", "child"))
        where = f"joint {joint.get('name')!r}"
        for end in ends:
            if end in elements and elements[end].tag != "link":
                raise ValueError(f"{where}: {end!r} is a <{elements[end].tag}>: name its link instead")
        _check_links(where, ends, inertials.keys() | {WORLD})
        # Where in the world does not matter.
        pose = np.eye(4) if WORLD in ends else np.linalg.inv(pose_in_model(parent)) @ pose_in_model(child)
        joints.append(Joint(parent, child, pose, _is_fixed(joint, SDF_JOINTS)))
    if any(WORLD in joint[:2] for joint in joints):
        inertials[WORLD] = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    return inertials, tuple(joints)


def _sdf_inertial(link: Element) -> Inertial:
    where = f"link {link.get('name')!r}"
    inertial = _child_or_none(link, "inertial", where)
    if inertial is None:
        return Inertial(1.0, np.zeros(3), np.eye(3))
    if _is_true(inertial.get("auto")):
        raise ValueError(f"{where}: an inertial with auto='true' is not supported: write its numbers")
    mass = _mass(inertial.findtext("mass", "1"), where)
    numbers = {e.tag: e.text or "" for e in inertial.iterfind("inertia/*")}
    at_com = Inertial(mass, np.zeros(3), _tensor(numbers, 1.0, where))
    pose = inertial.find("pose")
    if pose is not None and pose.get("relative_to"):
        raise ValueError(
            f"inertial of {where}: relative_to is not supported: give its pose in the link's axes"
        )
    return _transformed(_sdf_pose(pose, where), at_com)


def _sdf_pose(pose: Element | None, where: str) -> Pose:
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    if pose.get("frame"):
        raise ValueError(f"pose of {where}: the attribute frame is not supported: SDF 1.7 has relative_to")
    rotation_format = pose.get("rotation_format", "euler_rpy")
    if rotation_format not in ("euler_rpy", "quat_xyzw"):
        raise ValueError(
            f"pose of {where}: rotation_format must be euler_rpy or quat_xyzw, is {rotation_format!r}"
        )
    if rotation_format == "quat_xyzw":
        numbers = _numbers(pose.text, 7, f"pose of {where}")
        return _pose_from_quaternion(numbers[:3], numbers[3:], f"pose of {where}")
    numbers = _numbers(pose.text, 6, f"pose of {where}")
    unit = math.pi / 180 if _is_true(pose.get("degrees")) else 1.0
    return _pose(numbers[:3], [unit * angle for angle in numbers[3:]])


def _is_true(text: str | None) -> bool:
    """Whether SDF reads a text as true."""
    return (text or "").strip().lower() in ("true", "1")


def quaternion(numbers: Sequence[float], what: str) -> Quaternion:
    """Build a quaternion, scaled to a length between 1/2 and 2 so that its square is a float.

    Args:
        numbers: ``x y z w``, of any length except 0.
        what: name of the quaternion, for the error.

    Raises:
        ValueError: if all numbers are 0, or one is not finite.
    """
    if not any(numbers) or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{what}: the quaternion must be finite and not 0, is {tuple(numbers)}")
    return Quaternion(*map(float, numbers)).scaled()


def _pose_from_quaternion(xyz: Any, xyzw: Sequence[float], what: str) -> Pose:
    pose = _pose(xyz, (0.0, 0.0, 0.0))
    pose[:3, :3] = quaternion(xyzw, what).rotation()[:3]
    return pose


def _pose(xyz: Any, rpy: Any) -> Pose:
    """Return the pose with roll about x, then pitch about y, then yaw about z, all about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    pose = np.eye(4)
    pose[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    pose[:3, 3] = xyz
    return pose


def _tensor(numbers: Any, moment: float | None, where: str) -> Any:
    """Read an inertia from ``ixx`` etc. Missing moments are ``moment`` or an error, products 0."""

    def number(name: str) -> float:
        default = moment if name[1] == name[2] else 0.0
        if default is None and name not in numbers:
            raise ValueError(f"{name} of {where}: must be given")
        return _numbers(numbers.get(name, str(default)), 1, f"{name} of {where}")[0]

    return np.array(Symmetric3(*map(number, ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))).rows())


def _numbers(text: str | None, count: int, what: str) -> list[float]:
    try:
        numbers = list(map(number_in, (text or "").split()))
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        raise ValueError(f"{what}: must be {wanted}, is {text!r}")
    return numbers


def _mass(text: str | None, where: str) -> float:
    (mass,) = _numbers(text, 1, f"mass of {where}")
    if mass < 0:
        raise ValueError(f"mass of {where}: must be at least 0, is {text!r}")
    return mass


def _child_or_none(owner: Element, tag: str, where: str) -> Element | None:
    found = owner.findall(tag)
    if len(found) > 1:
        raise ValueError(f"{where} has {len(found)} <{tag}>")
    return found[0] if found else None


def _child(owner: Element, tag: str, where: str) -> Element:
    child = _child_or_none(owner, tag, where)
    if child is None:
        raise ValueError(f"{where} has no <{tag}>")
    return child


def _check_links(where: str, ends: Iterable[str], links: Container[str]) -> None:
    for end in ends:
        if end not in links:
            raise ValueError(f"{where}: the robot has no link {end!r}")
