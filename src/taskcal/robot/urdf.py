"""Robots from URDF files: the chain between two links, as the content of a robot file."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, TaskcalError, UnknownName, shown
from taskcal.geometry import se3
from taskcal.robot.file import robot_from
from taskcal.robot.rotation_steps import steps_of
from taskcal.robot.urdf_file import UrdfJoint, UrdfTree, read_urdf_tree

FLANGE = "tool0"
"""What ROS calls the frame in which a controller counts its tools (REP 199)."""

FARTHEST_TOGETHER = 100.0
"""Metres that the links of a robot add up to, at most; of a small one in millimetres they are more."""

RESERVED = ("tool", "base", "loop")
"""What Taskcal calls parameters that belong to no joint."""


def describe_urdf(
    path: str | Path, *, tip: str | None = None, base: str | None = None, name: str | None = None
) -> dict[str, Any]:
    """A robot file's content from a URDF file.

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
        "name": name or re.sub(r"[^\w.+-]+", "-", tree.name).strip("-") or tree.path.stem,
        "source": [f"imported from {tree.path.name}: base {begin}, tip {end}", *(j.remark for j in joints if j.remark)],
        **_Writer(tree, joints).written(start, end),
    }
    try:
        robot = robot_from(described)
    except TaskcalError as error:
        raise FileError(tree.path, str(error)) from error
    parts = [part for joint in robot.joints for part in (*joint.before, *joint.after)] + list(robot.tool)
    apart = sum(float(np.linalg.norm(part.transform[:3, 3])) for part in parts)
    if apart > FARTHEST_TOGETHER:
        message = f"places the links from '{shown(begin)}' to '{shown(end)}' {apart:.0f} m apart; URDF counts in metres"
        raise FileError(tree.path, f"{message}: are these millimetres?")
    return described


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
    return ", ".join(shown(link, 40) for link in links[:12]) + (", …" if len(links) > 12 else "")


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
    """What Taskcal calls the joints that move, by their names in the file."""
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
