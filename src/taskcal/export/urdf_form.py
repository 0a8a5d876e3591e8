"""A calibrated robot as URDF with absolute values, its joints at the controller's own."""

from dataclasses import dataclass, replace
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Float

from taskcal.export.calibrated_chain import CalibratedChain, ChainJoint, moved, spread_poses
from taskcal.export.export import Export, Loss
from taskcal.identification.calibration import Calibration

ANYWHERE = 1000.0
"""Metres to which a sliding joint without limits may go; URDF wants a limit."""


def export_urdf(
    calibration: Calibration, q: Float[np.ndarray, "n joints"] | None = None, *, accept_loss: bool = False
) -> Export:
    """The calibrated robot as URDF: links without shapes, every defect in the joints' origins.

    A joint that the controller couples with others is a row of joints about one axis, of which those that mimic have no motor.

    Args:
        calibration: the robot.
        q: joint positions at which a loss is measured; all over the ranges by default.
        accept_loss: write it although it loses something.

    Raises:
        TaskcalError: the model has parts that no URDF holds, such as gear harmonics; the message says what would be lost.
    """
    q = spread_poses(calibration) if q is None else q
    chain = CalibratedChain.of(calibration, q)
    loss = Loss.of(calibration, q, chain.poses(q))
    if not accept_loss:
        loss.refuse("a URDF")
    return Export(text=urdf_text(chain), loss=loss, frames={})


def urdf_text(chain: CalibratedChain) -> str:
    """The URDF of a chain."""
    robot = chain.robot
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<robot name={quoteattr(robot.name)}>",
        '  <link name="base_link"/>',
    ]
    parent, pending = "base_link", np.eye(4)
    for joint in chain.joints:
        pending = pending @ joint.before @ moved(joint.kind, chain.offset[joint.coordinate : joint.coordinate + 1])[0]
        parent = _joint(lines, chain, joint, parent, pending)
        pending = np.eye(4)
    pending = pending @ chain.end
    tip = "tool0" if np.allclose(robot.T_flange_tool, np.eye(4), atol=1e-12) else "tool"
    lines += [
        f'  <link name="{tip}"/>',
        f'  <joint name="{tip}_fixed" type="fixed">',
        f'    <parent link="{parent}"/>',
        f'    <child link="{tip}"/>',
        f"    {_origin(pending)}",
        "  </joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, eq=False, kw_only=True)
class _UrdfJoint:
    """A joint of the file and the link that it moves."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Float[np.ndarray, "4 4"]
    sign: float = 1.0
    mimic: str | None = None
    """The element that says which joint it follows; None for a joint with a motor."""


def _joint(
    lines: list[str], chain: CalibratedChain, joint: ChainJoint, parent: str, origin: Float[np.ndarray, "4 4"]
) -> str:
    """Write a joint and those that its coupling takes; returns the last link."""
    row, names = chain.matrix[joint.coordinate], chain.robot.joint_names
    own = joint.coordinate if joint.coordinate < len(names) else -1
    plain = _UrdfJoint(name=joint.name, kind=joint.kind, parent=parent, child=f"{joint.name}_link", origin=origin)
    if own >= 0 and abs(row[own]) != 1.0:  # its motor stands beside the chain, which follows it with its ratio
        motor = replace(plain, parent="base_link", child=f"{joint.name}_motor", origin=np.eye(4))
        lines += _element(chain, motor)
        own = -1
    elif own >= 0:
        lines += _element(chain, replace(plain, sign=float(row[own])))
        parent, origin = plain.child, np.eye(4)
    for other in np.flatnonzero(row):
        if other == own:
            continue
        name = f"{joint.name}_with_{names[other]}"
        mimic = f'<mimic joint="{names[other]}" multiplier="{float(row[other])!r}" offset="0"/>'
        follower = replace(plain, name=name, parent=parent, child=f"{name}_link", origin=origin, mimic=mimic)
        lines += _element(chain, follower)
        parent, origin = follower.child, np.eye(4)
    return parent


def _element(chain: CalibratedChain, joint: _UrdfJoint) -> list[str]:
    """The lines of a joint and of its link."""
    low, high, speed = -np.inf, np.inf, np.inf
    if joint.mimic is None:
        own = chain.robot.joints[chain.robot.joint_names.index(joint.name)]
        (low, high), speed = own.limits, own.speed
    limited = bool(np.isfinite([low, high]).all())
    if joint.kind == "prismatic" and not limited:
        low, high, limited = -ANYWHERE, ANYWHERE, True
    kind = "continuous" if joint.kind == "revolute" and not limited else joint.kind
    rate = speed if np.isfinite(speed) else 0.0
    bounds = f'lower="{low!r}" upper="{high!r}" ' if limited else ""
    return [
        f'  <link name="{joint.child}"/>',
        f'  <joint name="{joint.name}" type="{kind}">',
        f'    <parent link="{joint.parent}"/>',
        f'    <child link="{joint.child}"/>',
        f"    {_origin(joint.origin)}",
        f'    <axis xyz="0 0 {int(np.sign(joint.sign))}"/>',
        f'    <limit {bounds}velocity="{float(rate)!r}" effort="0"/>',
        *([f"    {joint.mimic}"] if joint.mimic else []),
        "  </joint>",
    ]


def _origin(T: Float[np.ndarray, "4 4"]) -> str:
    return f'<origin xyz="{_numbers(T[:3, 3])}" rpy="{_numbers(roll_pitch_yaw(T[:3, :3]))}"/>'


def _numbers(values: Float[np.ndarray, " 3"]) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)


def roll_pitch_yaw(R: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 3"]:
    """Angles about fixed x, y, z, each from what the one before has left, so that they give the rotation to rounding."""
    yaw = float(np.arctan2(R[1, 0], R[0, 0])) if np.hypot(R[0, 0], R[1, 0]) > 1e-9 else 0.0
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, pitch, yaw])
