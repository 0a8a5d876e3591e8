"""Robots from URDF files: the chain between two links, as the content of a robot file, and the meshes on the links."""

import keyword
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast, get_args

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, TaskcalError, UnknownName, listed, printable, shown
from taskcal.geometry import se3
from taskcal.io.xml_file import Element, parse_xml, read_xml
from taskcal.robot.importers.base import RobotImporter
from taskcal.robot.importers.xacro import expand_xacro
from taskcal.robot.robot_file import robot_from

# URDF, the robot description of ROS: links and joints of a file, with the lines they stand in.

UrdfKind = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar"]

MAX_NUMBER = 1e3
"""Metres or radians of any number that places something; larger ones stand for none."""

MAX_ANGLE_RAD = 8.0 * np.pi
"""Of an angle in the file, four turns: cables stop real joints sooner, and no part is turned so often. Degrees are more."""

MAX_SLIDE_M = 100.0
"""Of the limits of a joint that slides: the travel of the longest gantries. Millimetres are more."""

XACRO_SUFFIX = ".xacro"

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
        """Joints by name."""
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
    """Links and joints of a URDF file, or of the URDF that a xacro file stands for.

    Raises:
        FileError: it is not XML, not a URDF, its joints make no tree, or xacro macro expansion failed.
    """
    return _tree(path, _root(path))


def _root(path: Path) -> Element:
    return parse_xml(path, expand_xacro(path)) if path.suffix.lower() == XACRO_SUFFIX else read_xml(path)


def _tree(path: Path, root: Element) -> UrdfTree:
    if root.tag != "robot":
        raise root.error(f"is not a URDF: its root is <{shown(root.tag, 40)}>, not <robot>")
    if any(tag.tag.startswith("xacro:") for tag in root.children):
        raise FileError(path, "is a xacro file, not a URDF; name it .xacro, so that its macros are carried out")
    for tag in CLOSING:
        closing = root.first(tag)
        if closing is not None:
            raise closing.error(
                f"closes a loop by <{tag}>, which URDF does not define; describe the loop as [four_bar] of a robot file"
            )
    links = _named(root, "link")
    joints = [_joint(element, name) for name, element in _named(root, "joint").items()]
    if not joints:
        raise FileError(path, "has no joints; is it the right file?")
    return _joined(path, root.attributes.get("name", ""), list(links), joints)


def _named(root: Element, tag: str) -> dict[str, Element]:
    """Children of the root with a tag, by their names, all of which differ."""
    named: dict[str, Element] = {}
    for element in root.all(tag):
        name = _attribute(element, "name")
        if name in named:
            raise element.error(f"two {tag}s are named '{shown(name)}'")
        named[name] = element
    return named


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
        named = listed((f"'{shown(link, 40)}'" for link in roots), 4) or "none, its joints go round in a circle"
        raise FileError(path, f"must have exactly one root link; found {named}")
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


def _joint(element: Element, name: str) -> UrdfJoint:
    kind = _attribute(element, "type")
    if kind not in get_args(UrdfKind):
        raise element.error(str(UnknownName("type", kind, get_args(UrdfKind), f"of joint '{shown(name)}'")))
    axis, mimic = element.first("axis"), element.first("mimic")
    pose = _placed_at(element.first("origin"), f"joint '{shown(name)}'")
    limits, speed = _limits(element, name, sliding=kind == "prismatic")
    remark = ""
    if kind in ("revolute", "prismatic") and element.first("limit") is not None and limits is None:
        remark = f"limits of {name} are not a range, and taken for none"
    far, unit, other = (MAX_SLIDE_M, "m", "millimetres") if kind == "prismatic" else (MAX_ANGLE_RAD, "rad", "degrees")
    if kind in ("revolute", "prismatic") and limits is not None and max(map(abs, limits)) > far:
        remark = f"limits of {name}, {limits[0]:g} to {limits[1]:g} {unit}, are taken for none; are they {other}?"
        limits = None
    return UrdfJoint(
        name=name,
        kind=cast(UrdfKind, kind),
        parent=_linked(element, "parent"),
        child=_linked(element, "child"),
        origin=pose,
        axis=_axis(axis, name) if kind != "fixed" else np.array([0.0, 0.0, 1.0]),
        limits=limits if kind in ("revolute", "prismatic") else None,
        speed=speed,
        remark=remark,
        mimic=None
        if mimic is None
        else Mimic(
            joint=_attribute(mimic, "joint"),
            multiplier=_number(mimic, "multiplier", 1.0),
            offset=_number(mimic, "offset", 0.0),
        ),
        line=element.line,
    )


def _placed_at(origin: Element | None, of: str) -> Float[np.ndarray, "4 4"]:
    """The pose that an ``<origin>`` states, metres; none where there is no such element.

    Raises:
        FileError: it is not six numbers, or its angles are degrees.
    """
    if origin is None:
        return np.eye(4)
    roll, pitch, yaw = _triple_of(origin, "rpy", (0.0, 0.0, 0.0))
    _refuse_degrees(origin, of, (roll, pitch, yaw))
    R = se3.rotation("z", yaw) @ se3.rotation("y", pitch) @ se3.rotation("x", roll)
    return se3.pose(R[:3, :3], np.array(_triple_of(origin, "xyz", (0.0, 0.0, 0.0))))


def _refuse_degrees(origin: Element, of: str, angles: tuple[float, float, float]) -> None:
    most = max(map(abs, angles))
    if most > MAX_ANGLE_RAD:
        message = (
            f"rpy of <origin> of {of} has {most:g}, {most / (2 * np.pi):.0f} turns; URDF counts in radians: "
            f"write {np.radians(most):.6g} for {most:g}°"
        )
        raise origin.error(message)


def _axis(element: Element | None, joint: str) -> Float[np.ndarray, " 3"]:
    """Along x where none is stated, as URDF has it; of unit length."""
    if element is None:
        return np.array([1.0, 0.0, 0.0])
    axis = np.array(_triple_of(element, "xyz", (1.0, 0.0, 0.0)))
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise element.error(f"the axis of joint '{shown(joint)}' has no direction")
    return axis / length


def _limits(element: Element, name: str, *, sliding: bool) -> tuple[tuple[float, float] | None, float | None]:
    """Limits and speed; none where they are not stated, or as far out as nothing goes."""
    limit = element.first("limit")
    if limit is None:
        return None, None
    speed = _number(limit, "velocity", 0.0, far=True)
    low, high = _number(limit, "lower", 0.0, far=True), _number(limit, "upper", 0.0, far=True)
    if low > high:
        unit = "m" if sliding else "rad"
        message = f"joint '{shown(name)}' has the lower limit {low:g} {unit} above the upper {high:g} {unit}"
        raise limit.error(message)
    return (low, high) if low < high else None, speed if 0.0 < speed <= MAX_NUMBER else None


def _linked(element: Element, tag: str) -> str:
    inner = element.first(tag)
    if inner is None:
        name = shown(element.attributes.get("name", ""))
        raise element.error(f"joint '{name}' has no <{tag} link=…>")
    return _attribute(inner, "link")


def _attribute(element: Element, name: str) -> str:
    value = element.attributes.get(name, "").strip()
    if not value:
        raise element.error(f"<{element.tag}> has no {name}")
    return value


def _number(element: Element, name: str, default: float, *, far: bool = False) -> float:
    text = element.attributes.get(name)
    return default if text is None else _parsed(element, name, text, far=far)


def _triple_of(element: Element, name: str, default: tuple[float, float, float]) -> tuple[float, float, float]:
    """Three numbers of an attribute, or the default where it is not stated.

    Raises:
        FileError: they are not three numbers.
    """
    text = element.attributes.get(name)
    if text is None:
        return default
    words = text.split()
    if len(words) != 3:
        raise element.error(f'{name}="{shown(text)}" of <{element.tag}> is not three numbers')
    x, y, z = (_parsed(element, name, word) for word in words)
    return x, y, z


def _parsed(element: Element, name: str, text: str, *, far: bool = False) -> float:
    try:
        value = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if math.isnan(value) or (not far and abs(value) > MAX_NUMBER):
        message = (
            f"{name} of <{element.tag}>: '{shown(text)}' is not a number of metres or radians; write such as 0.0825"
        )
        raise element.error(message)
    return value


# A rigid transform as the elementary steps of a robot file.

MIN_STEP = 1e-15
"""Metres and radians that rounding leaves."""

DIGITS = 12
"""Of millimetres and degrees behind the point: a femtometre, and 2e-14 rad."""


def steps_of(T: Float[np.ndarray, "4 4"], number: str = "") -> list[dict[str, Any]]:
    """Elementary steps that make a transform: its translation, then rotations about z, y and x.

    The angles are taken one after another from what the one before has left (Givens), so that their product is the rotation
    to rounding even where z and x line up.

    Args:
        T: the transform, metres.
        number: what follows ``x``, ``y`` and ``z`` in the symbols of its lengths; none by default.
    """
    steps: list[dict[str, Any]] = []
    for axis, value in zip("xyz", T[:3, 3], strict=True):
        if abs(value) > MIN_STEP:
            symbol = {"symbol": f"{axis}{number}"} if number else {}
            steps.append({f"t{axis}_mm": round(float(value) * 1e3, DIGITS), **symbol})
    R = T[:3, :3]
    yaw = np.arctan2(R[1, 0], R[0, 0]) if np.hypot(R[0, 0], R[1, 0]) > 1e-9 else 0.0
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    for axis, angle in (("z", yaw), ("y", pitch), ("x", roll)):
        if abs(angle) > MIN_STEP:
            steps.append({f"r{axis}_deg": round(float(np.degrees(angle)), DIGITS)})
    return steps


FLANGE = "tool0"
"""What ROS calls the frame in which a controller counts its tools (REP 199)."""

MAX_TOTAL_LENGTH_M = 100.0
"""Metres that the links of a robot add up to, at most; of a small one in millimetres they are more."""

RESERVED = ("tool", "base", "loop", *keyword.kwlist)
"""What Taskcal calls parameters that belong to no joint; and what no expression of joints could hold."""


def describe_urdf(
    path: str | Path, *, tip: str | None = None, base: str | None = None, name: str | None = None
) -> dict[str, Any]:
    """A robot file's content from a URDF file, or from the URDF that a xacro file stands for.

    Joints keep their names and limits. Fixed joints, axes in any direction and mimic joints are taken into the chain: a joint
    that mimics another of the chain is driven by it.

    Args:
        path: the file.
        tip: the link that is the tool; by default the one at the end of the longest chain, ``tool0`` among several.
        base: the link that is the robot's base; the root by default.
        name: the robot's name; that in the file by default.

    Raises:
        FileError: the file is not a URDF, or does not say which of several links is the tip.
        UnknownName: it has no link of that name.
    """
    path = Path(path)
    return describe_tree(read_urdf_tree(path), tip=tip, base=base, name=name)


def describe_tree(
    tree: UrdfTree, *, tip: str | None = None, base: str | None = None, name: str | None = None
) -> dict[str, Any]:
    """A robot file's content from links and joints; arguments and errors as of `describe_urdf`."""
    for option, link in (("tip", tip), ("base", base)):
        if link is not None and link not in tree.links:
            raise UnknownName("link", link, tree.links, f"in {tree.path}, for its {option}")
    end = tip or choose_tip(tree)
    begin = base or tree.root
    start, joints = _between(tree, begin, end)
    described: dict[str, Any] = {
        "name": name or re.sub(r"[^\w.+-]+", "-", tree.name).strip("-") or printable(tree.path.stem),
        "source": [
            f"imported from {printable(tree.path.name)}: base {begin}, tip {end}",
            *(j.remark for j in joints if j.remark),
        ],
        "links": [begin, end],
        **_Writer(tree, joints).written(start, end),
    }
    try:
        robot = robot_from(described)
    except TaskcalError as error:
        raise FileError(tree.path, str(error)) from error
    parts = [part for joint in robot.joints for part in (*joint.before, *joint.after)] + list(robot.tool)
    apart = sum(float(np.linalg.norm(part.transform[:3, 3])) for part in parts)
    if apart > MAX_TOTAL_LENGTH_M:
        message = f"places the links from '{shown(begin)}' to '{shown(end)}' {apart:.0f} m apart; URDF counts in metres"
        raise FileError(tree.path, f"{message}: are these millimetres?")
    return described


URDF = RobotImporter(
    name="URDF",
    suffixes=(".urdf",),
    options=("tip", "base"),
    describe=lambda path, options: describe_urdf(path, **options),
)

XACRO = replace(URDF, name="xacro", suffixes=(XACRO_SUFFIX,))


def choose_tip(tree: UrdfTree) -> str:
    """The link at the end of the longest chain of joints with motors; ``tool0`` where there are several.

    Links behind a joint that another one off their way mimics, as a gripper's finger, are none.

    Raises:
        FileError: several are left.
    """
    lengths: dict[str, int] = {}
    for leaf in tree.leaves:
        way = [joint for joint in tree.path_to(leaf) if joint.moves]
        if way and _has_its_motor(tree, way) and not _is_followed(tree, way):
            lengths[leaf] = sum(joint.mimic is None for joint in way)
    if not lengths:
        raise FileError(
            tree.path, f"has no chain of joints with motors; name its tip with --tip: {_listed(tree.links)}"
        )
    longest = [leaf for leaf, length in lengths.items() if length == max(lengths.values())]
    preferred = [leaf for leaf in longest if leaf == FLANGE] or [leaf for leaf in longest if leaf.endswith(FLANGE)]
    if len(longest) == 1 or len(preferred) == 1:
        return (preferred or longest)[0]
    file, tip = shown(tree.path.name, 40), shown(longest[0], 40)
    raise FileError(
        tree.path,
        f"has several links that may be the tip: {_listed(longest)}; name one, as in {file}#{tip}, or to taskcal robots import by "
        f"--tip {tip}",
    )


def _listed(links: Sequence[str]) -> str:
    return listed((shown(link, 40) for link in links), 12)


def _has_its_motor(tree: UrdfTree, way: list[UrdfJoint]) -> bool:
    """Whether the last joint has a motor, or follows one that is on the way to it."""
    joints, last = tree.joints, way[-1]
    while last.mimic is not None:
        last = joints[last.mimic.joint]
    return last in way


def _is_followed(tree: UrdfTree, way: list[UrdfJoint]) -> bool:
    """Whether a joint off the way mimics its last."""
    return any(
        joint.mimic is not None and joint.mimic.joint == way[-1].name and joint not in way
        for joint in tree.above.values()
    )


def _between(tree: UrdfTree, base: str, tip: str) -> tuple[Float[np.ndarray, "4 4"], list[UrdfJoint]]:
    """Pose in the base of the link where the joints towards the tip begin, and these.

    Raises:
        FileError: the base moves, seen from there, or nothing moves in between.
    """
    down, up = tree.path_to(tip), tree.path_to(base)
    shared = sum(a is b for a, b in zip(down, up, strict=False))
    T = np.eye(4)
    for joint in up[shared:]:
        if joint.moves:
            raise FileError(
                tree.path,
                f"base '{shown(base)}' moves by joint '{shown(joint.name)}' against the chain to '{shown(tip)}'; name a base "
                "before it",
            )
        T = T @ joint.origin
    joints = down[shared:]
    if not any(joint.moves for joint in joints):
        raise FileError(tree.path, f"has no joint that moves between base '{shown(base)}' and tip '{shown(tip)}'")
    return se3.inverse(T), joints


class _Writer:
    """Writes a chain of joints as a robot file has it: parts, then a joint about, or along, its own z axis."""

    def __init__(self, tree: UrdfTree, chain: list[UrdfJoint]):
        self.tree, self.chain = tree, chain
        self.every = tree.joints
        self.names = plain_joint_names(tree)

    def written(self, start: Float[np.ndarray, "4 4"], tip: str) -> dict[str, Any]:
        """Joints, tool and flange."""
        out: list[dict[str, Any]] = []
        leaders = {joint.name for joint in self.chain if joint.moves and joint.mimic is None}
        pending, flange = start, None
        for joint in self.chain:
            pending = pending @ joint.origin
            if joint.moves:
                turned = _towards(joint.axis)
                parts = steps_of(pending @ turned, f"{len(out) + 1}")
                out.append(self._joint(joint, parts, leaders))
                pending, flange = se3.inverse(turned), None
            if joint.child == FLANGE:
                flange = pending
        flange = pending if flange is None else flange
        return {"joint": out, "tool": steps_of(pending), "flange": steps_of(flange)}

    def _joint(self, joint: UrdfJoint, parts: list[dict[str, Any]], leaders: set[str]) -> dict[str, Any]:
        if joint.kind in ("floating", "planar"):
            message = f"joint '{shown(joint.name)}' is {joint.kind}; Taskcal knows joints that turn or slide: name a base behind it"
            raise FileError(self.tree.path, message, line=joint.line)
        leader, multiplier, offset = self._leader(joint)
        described: dict[str, Any] = {"name": self.names[joint.name], "type": _type(joint), "steps": parts}
        own = leader
        if leader is not joint:
            if leader.name in leaders:
                described["driven"] = True
                own = None
            else:  # the joint that it follows is on another branch: its motor moves this one alone
                described["name"] = self.names[leader.name]
                leaders.add(leader.name)
            described["angle"] = f"{multiplier!r}*{self.names[leader.name]}"
            if offset:
                described.update(_scaled(joint, "offset", offset))
        if own is not None and _type(own) != _type(joint):
            message = (
                f"joint '{shown(joint.name)}' {_does(joint)} as '{shown(own.name)}' {_does(own)} on another branch, which is not "
                "read"
            )
            raise FileError(self.tree.path, message, line=joint.line)
        if own is not None and own.limits is not None:
            described.update(_scaled(own, "limits", own.limits))
        if own is not None and own.speed is not None:
            described.update(_scaled(own, "speed", own.speed))
        return described

    def _leader(self, joint: UrdfJoint) -> tuple[UrdfJoint, float, float]:
        """The joint with a motor that a joint follows, itself by default, and its factor and offset."""
        multiplier, offset = 1.0, 0.0
        while joint.mimic is not None:
            offset += multiplier * joint.mimic.offset
            multiplier *= joint.mimic.multiplier
            joint = self.every[joint.mimic.joint]
        return joint, multiplier, offset


def _type(joint: UrdfJoint) -> str:
    return "prismatic" if joint.kind == "prismatic" else "revolute"


def _does(joint: UrdfJoint) -> str:
    return "slides" if joint.kind == "prismatic" else "turns"


def _scaled(joint: UrdfJoint, key: str, value: float | tuple[float, float]) -> dict[str, Any]:
    """A value of a joint in the units of a robot file."""
    unit, scale = ("mm", 1e3) if joint.kind == "prismatic" else ("deg", 180.0 / np.pi)
    rate = "_s" if key == "speed" else ""
    shown_value = [v * scale for v in value] if isinstance(value, tuple) else value * scale
    return {f"{key}_{unit}{rate}": shown_value}


def plain_joint_names(tree: UrdfTree) -> dict[str, str]:
    """Names of the moving joints in robot files and columns, by their names in the URDF."""
    return _plain_names([joint.name for joint in tree.joints.values() if joint.moves])


def _plain_names(names: Sequence[str]) -> dict[str, str]:
    """Names as robot files and columns have them, all different."""
    out: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)[:70]
        plain = plain if re.match(r"[A-Za-z_]", plain) else f"J_{plain}"
        plain = f"{plain}_joint" if plain in RESERVED else plain
        number = 1
        while plain in out.values():
            number += 1
            plain = f"{re.sub(r'_[0-9]+$', '', plain)}_{number}"
        out[name] = plain
    return out


def _towards(axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "4 4"]:
    """A rotation that turns the z axis to a direction; exact for the axes themselves."""
    x, y, z = axis
    return se3.rotation("z", float(np.arctan2(y, x)) if x or y else 0.0) @ se3.rotation(
        "y", float(np.arctan2(np.hypot(x, y), z))
    )


# The looks of a robot: which mesh each link has, where on the link, and where the links are at some joint positions.

MAX_VISUALS = 200
"""Of a robot; the most detailed ones of the field have sixty."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Visual:
    """A mesh on a link."""

    link: str
    origin: Float[np.ndarray, "4 4"]
    """Pose of the mesh in the link, metres."""
    scale: tuple[float, float, float]
    file: str
    """As the URDF names it, such as ``package://robot/meshes/link_1.stl``."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Looks:
    """A URDF's tree with the meshes on it."""

    tree: UrdfTree
    visuals: tuple[Visual, ...]

    def link_poses(self, joints: Mapping[str, float]) -> dict[str, Float[np.ndarray, "4 4"]]:
        """Poses of all links in the root.

        Args:
            joints: positions by joint, as Taskcal names them, radians or metres; joints that are not named are at zero, and those
                that mimic another one follow it.
        """
        every = self.tree.joints
        names = plain_joint_names(self.tree)

        def value(name: str) -> float:
            mimic = every[name].mimic
            if mimic is None:
                return joints.get(names[name], 0.0)
            return mimic.multiplier * value(mimic.joint) + mimic.offset

        poses: dict[str, np.ndarray] = {self.tree.root: np.eye(4)}
        for link in self.tree.links:
            for joint in self.tree.path_to(link):
                if joint.child not in poses:
                    poses[joint.child] = poses[joint.parent] @ joint.origin
                    if joint.moves:
                        poses[joint.child] = poses[joint.child] @ _moved(joint, value(joint.name))
        return poses


def _moved(joint: UrdfJoint, value: float) -> Float[np.ndarray, "4 4"]:
    if joint.kind == "prismatic":
        return se3.pose(np.eye(3), joint.axis * value)
    return se3.pose(se3.exp(joint.axis * value), np.zeros(3))


def read_looks(path: Path) -> Looks:
    """The meshes of a URDF or xacro file.

    Raises:
        FileError: it is not such a file, or has too many of them.
    """
    root = _root(path)
    visuals = tuple(visual for link in root.all("link") for visual in _visuals(link))
    if len(visuals) > MAX_VISUALS:
        raise FileError(path, f"has {len(visuals)} meshes; up to {MAX_VISUALS} are drawn")
    return Looks(tree=_tree(path, root), visuals=visuals)


def _visuals(link: Element) -> list[Visual]:
    found: list[Visual] = []
    for visual in link.all("visual"):
        geometry = visual.first("geometry")
        mesh = None if geometry is None else geometry.first("mesh")
        if mesh is None or not mesh.attributes.get("filename"):
            continue
        found.append(
            Visual(
                link=link.attributes["name"],
                origin=_placed_at(visual.first("origin"), f"a mesh of link '{shown(link.attributes['name'])}'"),
                scale=_triple_of(mesh, "scale", (1.0, 1.0, 1.0)),
                file=mesh.attributes["filename"],
            )
        )
    return found
