"""URDF, the robot description of ROS: links and joints of a file, with the lines they stand in."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast, get_args

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, UnknownName, shown
from taskcal.geometry import se3
from taskcal.xml_file import Element, parse_xml, read_xml

UrdfKind = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar"]

FARTHEST = 1e3
"""Metres or radians of any number that places something; larger ones stand for none."""

MOST_RAD = 8.0 * np.pi
"""Of an angle in the file, four turns: cables stop real joints sooner, and no part is turned so often. Degrees are more."""

CLOSING = ("loop_joint", "closure", "constraint", "loop")
"""Elements by which dialects close a loop, which URDF itself cannot."""


@dataclass(frozen=True, kw_only=True)
class Mimic:
    """A joint's value as another's."""

    joint: str
    multiplier: float
    offset: float
    """Radians or metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class UrdfJoint:
    """A joint of the file."""

    name: str
    kind: UrdfKind
    parent: str
    child: str
    origin: Float[np.ndarray, "4 4"]
    """Pose of the child in the parent, where the joint is at zero."""
    axis: Float[np.ndarray, " 3"]
    """Of unit length, in the child."""
    limits: tuple[float, float] | None
    """Radians or metres; None where none are stated."""
    speed: float | None
    """Radians or metres per second."""
    mimic: Mimic | None
    remark: str
    """What was made of unusual limits; empty where they are as usual."""
    line: int

    @property
    def moves(self) -> bool:
        """Whether it is anything but fixed."""
        return self.kind != "fixed"


@dataclass(frozen=True, eq=False, kw_only=True)
class UrdfTree:
    """Links and joints of a file: a tree with one root."""

    path: Path
    name: str
    links: tuple[str, ...]
    above: dict[str, UrdfJoint]
    """The joint that each link hangs on, by the link's name; none for the root."""

    @property
    def joints(self) -> dict[str, UrdfJoint]:
        """By name."""
        return {joint.name: joint for joint in self.above.values()}

    @property
    def root(self) -> str:
        """The link that hangs on none."""
        return next(link for link in self.links if link not in self.above)

    @property
    def leaves(self) -> tuple[str, ...]:
        """Links on which nothing hangs."""
        parents = {joint.parent for joint in self.above.values()}
        return tuple(link for link in self.links if link not in parents)

    def path_to(self, link: str) -> list[UrdfJoint]:
        """Joints from the root to a link."""
        out: list[UrdfJoint] = []
        while link in self.above:
            out.append(self.above[link])
            link = self.above[link].parent
        return out[::-1]


def read_urdf_tree(path: Path) -> UrdfTree:
    """Links and joints of a URDF file.

    Raises:
        FileError: it is not XML, not a URDF, or its joints make no tree.
    """
    return _tree(path, read_xml(path))


def parse_urdf_tree(path: Path, content: bytes) -> UrdfTree:
    """Links and joints of a URDF that was made of a file; errors as of `read_urdf_tree`."""
    return _tree(path, parse_xml(path, content))


def _tree(path: Path, root: Element) -> UrdfTree:
    if root.tag != "robot":
        raise FileError(path, f"is not a URDF: its root is <{shown(root.tag, 40)}>, not <robot>", line=root.line)
    if any(tag.tag.startswith("xacro:") for tag in root.children):
        raise FileError(path, "is a xacro file, not a URDF; name it .xacro, so that its macros are carried out")
    for tag in CLOSING:
        closing = root.first(tag)
        if closing is not None:
            message = (
                f"closes a loop by <{tag}>, which URDF does not define; describe the loop as [four_bar] of a robot file"
            )
            raise FileError(path, message, line=closing.line)
    links = [_attribute(path, link, "name") for link in root.all("link")]
    joints = [_joint(path, element) for element in root.all("joint")]
    if not joints:
        raise FileError(path, "has no joints; is it the right file?")
    _see_all_differ(path, [*root.all("link")], links, "links")
    _see_all_differ(path, [*root.all("joint")], [joint.name for joint in joints], "joints")
    return _joined(path, root.attributes.get("name", ""), links, joints)


def _joined(path: Path, name: str, links: list[str], joints: list[UrdfJoint]) -> UrdfTree:
    above: dict[str, UrdfJoint] = {}
    known = set(links)
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in known:
                message = f"joint '{shown(joint.name)}' hangs on link '{shown(link)}', which the file does not have"
                raise FileError(path, message, line=joint.line)
        if joint.child in above:
            first = above[joint.child]
            raise FileError(
                path,
                f"link '{shown(joint.child)}' hangs on two joints, '{shown(first.name)}' and '{shown(joint.name)}': a closed loop, "
                "which URDF cannot hold; describe it as [four_bar] of a robot file",
                line=joint.line,
            )
        above[joint.child] = joint
    roots = [link for link in links if link not in above]
    if len(roots) != 1:
        named = ", ".join(f"'{shown(link, 40)}'" for link in roots[:4]) or "none, its joints go round in a circle"
        raise FileError(path, f"must have one link that hangs on no joint; it has {named}")
    tree = UrdfTree(path=path, name=name, links=tuple(links), above=above)
    _see_a_tree(tree)
    _see_mimics(tree)
    return tree


def _see_a_tree(tree: UrdfTree) -> None:
    """See that all links hang on the root: joints beside it may go round in a circle."""
    below: dict[str, list[UrdfJoint]] = {}
    for joint in tree.above.values():
        below.setdefault(joint.parent, []).append(joint)
    reached, waiting = 1, [tree.root]
    while waiting:
        children = [joint.child for joint in below.get(waiting.pop(), ())]
        reached += len(children)
        waiting += children
    if reached < len(tree.links):
        raise FileError(tree.path, "has joints that go round in a circle, apart from its root; a URDF is a tree")


def _see_mimics(tree: UrdfTree) -> None:
    """See that every mimic names a joint that moves, and none follows itself."""
    joints = tree.joints
    for joint in joints.values():
        followed, turns = joint, 0
        while followed.mimic is not None:
            other = joints.get(followed.mimic.joint)
            if other is None or not other.moves:
                message = f"joint '{shown(followed.name)}' mimics '{shown(followed.mimic.joint)}', which is no joint that moves"
                raise FileError(tree.path, message, line=followed.line)
            followed, turns = other, turns + 1
            if turns > len(joints):
                raise FileError(
                    tree.path, f"joint '{shown(joint.name)}' mimics itself by way of others", line=joint.line
                )


def _see_all_differ(path: Path, elements: list[Element], names: list[str], what: str) -> None:
    seen: set[str] = set()
    for element, name in zip(elements, names, strict=True):
        if name in seen:
            raise FileError(path, f"two {what} are named '{shown(name)}'", line=element.line)
        seen.add(name)


def _joint(path: Path, element: Element) -> UrdfJoint:
    name = _attribute(path, element, "name")
    kind = _attribute(path, element, "type")
    if kind not in get_args(UrdfKind):
        error = UnknownName("type", kind, get_args(UrdfKind), f"of joint '{shown(name)}'")
        raise FileError(path, str(error), line=element.line)
    axis, mimic = element.first("axis"), element.first("mimic")
    pose = placed_at(path, element.first("origin"), f"joint '{shown(name)}'")
    limits, speed = _limits(path, element, name, sliding=kind == "prismatic")
    remark = ""
    if kind in ("revolute", "prismatic") and element.first("limit") is not None and limits is None:
        remark = f"limits of {name} are not a range, and taken for none"
    if kind == "revolute" and limits is not None and max(map(abs, limits)) > MOST_RAD:
        remark = f"limits of {name}, {limits[0]:g} to {limits[1]:g} rad, are taken for none; are they degrees?"
        limits = None
    return UrdfJoint(
        name=name,
        kind=cast(UrdfKind, kind),
        parent=_linked(path, element, "parent"),
        child=_linked(path, element, "child"),
        origin=pose,
        axis=_axis(path, axis, name) if kind != "fixed" else np.array([0.0, 0.0, 1.0]),
        limits=limits if kind in ("revolute", "prismatic") else None,
        speed=speed,
        remark=remark,
        mimic=None
        if mimic is None
        else Mimic(
            joint=_attribute(path, mimic, "joint"),
            multiplier=_number(path, mimic, "multiplier", 1.0),
            offset=_number(path, mimic, "offset", 0.0),
        ),
        line=element.line,
    )


def placed_at(path: Path, origin: Element | None, of: str) -> Float[np.ndarray, "4 4"]:
    """The pose that an ``<origin>`` states, metres; none where there is no such element.

    Raises:
        FileError: it is not six numbers, or its angles are degrees.
    """
    if origin is None:
        return np.eye(4)
    roll, pitch, yaw = triple_of(path, origin, "rpy", (0.0, 0.0, 0.0))
    _refuse_degrees(path, origin, of, (roll, pitch, yaw))
    R = se3.rotation("z", yaw) @ se3.rotation("y", pitch) @ se3.rotation("x", roll)
    return se3.pose(R[:3, :3], np.array(triple_of(path, origin, "xyz", (0.0, 0.0, 0.0))))


def _refuse_degrees(path: Path, origin: Element, of: str, angles: tuple[float, float, float]) -> None:
    most = max(map(abs, angles))
    if most > MOST_RAD:
        message = (
            f"rpy of <origin> of {of} has {most:g}, {most / (2 * np.pi):.0f} turns; URDF counts in radians: "
            f"write {np.radians(most):.6g} for {most:g}°"
        )
        raise FileError(path, message, line=origin.line)


def _axis(path: Path, element: Element | None, joint: str) -> Float[np.ndarray, " 3"]:
    """Along x where none is stated, as URDF has it; of unit length."""
    if element is None:
        return np.array([1.0, 0.0, 0.0])
    axis = np.array(triple_of(path, element, "xyz", (1.0, 0.0, 0.0)))
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise FileError(path, f"the axis of joint '{shown(joint)}' has no direction", line=element.line)
    return axis / length


def _limits(
    path: Path, element: Element, name: str, *, sliding: bool
) -> tuple[tuple[float, float] | None, float | None]:
    """Limits and speed; none where they are not stated, or as far out as nothing goes."""
    limit = element.first("limit")
    if limit is None:
        return None, None
    speed = _number(path, limit, "velocity", 0.0, far=True)
    low, high = _number(path, limit, "lower", 0.0, far=True), _number(path, limit, "upper", 0.0, far=True)
    if low > high:
        unit = "m" if sliding else "rad"
        message = f"joint '{shown(name)}' has the lower limit {low:g} {unit} above the upper {high:g} {unit}"
        raise FileError(path, message, line=limit.line)
    stated = low < high and abs(low) <= FARTHEST and abs(high) <= FARTHEST
    return (low, high) if stated else None, speed if 0.0 < speed <= FARTHEST else None


def _linked(path: Path, element: Element, tag: str) -> str:
    inner = element.first(tag)
    if inner is None:
        name = shown(element.attributes.get("name", ""))
        raise FileError(path, f"joint '{name}' has no <{tag} link=…>", line=element.line)
    return _attribute(path, inner, "link")


def _attribute(path: Path, element: Element, name: str) -> str:
    value = element.attributes.get(name, "").strip()
    if not value:
        raise FileError(path, f"<{element.tag}> has no {name}", line=element.line)
    return value


def _number(path: Path, element: Element, name: str, default: float, *, far: bool = False) -> float:
    text = element.attributes.get(name)
    return default if text is None else _parsed(path, element, name, text, far=far)


def triple_of(
    path: Path, element: Element, name: str, default: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Three numbers of an attribute, or the default where it is not stated.

    Raises:
        FileError: they are not three numbers.
    """
    text = element.attributes.get(name)
    if text is None:
        return default
    words = text.split()
    if len(words) != 3:
        raise FileError(path, f'{name}="{shown(text)}" of <{element.tag}> is not three numbers', line=element.line)
    x, y, z = (_parsed(path, element, name, word) for word in words)
    return x, y, z


def _parsed(path: Path, element: Element, name: str, text: str, *, far: bool = False) -> float:
    try:
        value = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if math.isnan(value) or (not far and abs(value) > FARTHEST):
        message = (
            f"{name} of <{element.tag}>: '{shown(text)}' is not a number of metres or radians; write such as 0.0825"
        )
        raise FileError(path, message, line=element.line)
    return value
