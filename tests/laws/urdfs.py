"""Random URDF files, and where Pinocchio and pytransform3d find their links."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio
from pytransform3d.urdf import UrdfTransformManager

from taskcal.robot.importers.urdf import UrdfJoint, UrdfTree, read_urdf_tree


def random_urdf(rng: np.random.Generator, joints: int) -> str:
    """A chain of joints about any axes, some fixed, sliding or mimicking an earlier one, with a branch here and there."""
    text, moving = "", []
    for i in range(joints):
        kind = str(rng.choice(["revolute", "continuous", "prismatic", "fixed"]))
        mimic = ""
        if kind != "fixed" and moving and rng.random() < 0.3:
            followed = moving[int(rng.integers(len(moving)))]
            mimic = f'<mimic joint="{followed}" multiplier="{rng.uniform(-2, 2)}" offset="{rng.uniform(-1, 1)}"/>'
        elif kind != "fixed":
            moving.append(f"j{i}")
        axis = rng.choice([*np.eye(3), *-np.eye(3), rng.normal(size=3)])
        xyz, rpy = (
            rng.uniform(-0.8, 0.8, 3),
            rng.choice([0.0, np.pi / 2, -np.pi / 2, np.pi, 1.571, rng.uniform(-3, 3)], 3),
        )
        words = [" ".join(map(repr, values.tolist())) for values in (axis / np.linalg.norm(axis), xyz, rpy)]
        limits = (
            '<limit lower="-2.5" upper="2.0" velocity="1.5" effort="0"/>' if kind in ("revolute", "prismatic") else ""
        )
        text += (
            f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/><axis xyz="{words[0]}"/>'
            f'<origin xyz="{words[1]}" rpy="{words[2]}"/>{limits}{mimic}</joint>\n<link name="l{i + 1}"/>\n'
        )
    return f'<?xml version="1.0"?>\n<robot name="random"><link name="l0"/>\n{text}</robot>\n'


class Referee:
    """Poses of a URDF's links and their derivatives, from the values of joints that do not mimic others."""

    def __init__(self, path: Path):
        self.tree: UrdfTree = read_urdf_tree(path)
        self.model = pinocchio.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.other = UrdfTransformManager()
        # it would cut what is beyond a limit
        self.other.load_urdf(re.sub(r"<limit[^>]*/>", "", path.read_text(encoding="utf-8")))

    @property
    def motors(self) -> list[str]:
        return [joint.name for joint in self.tree.joints.values() if joint.moves and joint.mimic is None]

    def pose(self, values: Mapping[str, float], link: str) -> np.ndarray:
        """By Pinocchio."""
        pinocchio.framesForwardKinematics(self.model, self.data, self._configuration(values))
        return self.data.oMf[self._frame(link)].homogeneous.copy()

    def jacobian(self, values: Mapping[str, float], link: str, motors: Sequence[str]) -> np.ndarray:
        """Twists about a link's origin by the values of some joints, in base axes, by Pinocchio (6, motors)."""
        q = self._configuration(values)
        frame = self._frame(link)
        J = pinocchio.computeFrameJacobian(self.model, self.data, q, frame, pinocchio.LOCAL_WORLD_ALIGNED).reshape(
            6, -1
        )
        moving = [joint for joint in self.tree.joints.values() if joint.moves]
        columns = {joint.name: J[:, self.model.joints[self.model.getJointId(joint.name)].idx_v] for joint in moving}
        return np.stack(
            [sum(self._share(joint, motor) * columns[joint.name] for joint in moving) for motor in motors], 1
        )

    def pose_by_pytransform3d(self, values: Mapping[str, float], link: str) -> np.ndarray:
        """The same pose by the other library."""
        for joint in self.tree.joints.values():
            if joint.moves:
                self.other.set_joint(joint.name, self._value(values, joint))
        return self.other.get_transform(link, self.tree.root)

    def _frame(self, link: str) -> int:
        return self.model.getFrameId(link, pinocchio.FrameType.BODY)

    def _configuration(self, values: Mapping[str, float]) -> np.ndarray:
        q = pinocchio.neutral(self.model)
        for joint in self.tree.joints.values():
            if not joint.moves:
                continue
            known, value = self.model.joints[self.model.getJointId(joint.name)], self._value(values, joint)
            if known.nq == 2:
                q[known.idx_q : known.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                q[known.idx_q] = value
        return q

    def _value(self, values: Mapping[str, float], joint: UrdfJoint) -> float:
        if joint.mimic is None:
            return values[joint.name]
        return joint.mimic.multiplier * self._value(values, self.tree.joints[joint.mimic.joint]) + joint.mimic.offset

    def _share(self, joint: UrdfJoint, motor: str) -> float:
        """How far a joint moves with a motor."""
        if joint.mimic is None:
            return float(joint.name == motor)
        return joint.mimic.multiplier * self._share(self.tree.joints[joint.mimic.joint], motor)


def telescopic_column() -> str:
    """A column that lifts in two stages, the second with the first, and carries an arm of three joints."""
    joints = [
        ("lift", "prismatic", "0 0 0.5", "0 0 1", 0.0, 0.8, ""),
        ("lift2", "prismatic", "0 0 0.1", "0 0 1", 0.0, 0.8, '<mimic joint="lift"/>'),
        ("turn", "revolute", "0 0 0.2", "0 0 1", -3.0, 3.0, ""),
        ("shoulder", "revolute", "0.1 0 0.2", "0 1 0", -3.0, 3.0, ""),
        ("elbow", "revolute", "0 0 0.5", "0 1 0", -3.0, 3.0, ""),
    ]
    parts = [
        f'<joint name="{name}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="1" velocity="1"/>{mimic}</joint>'
        for i, (name, kind, xyz, axis, low, high, mimic) in enumerate(joints)
    ]
    tip = '<joint name="tip" type="fixed"><parent link="l5"/><child link="l6"/><origin xyz="0.4 0 0"/></joint>'
    links = "".join(f'<link name="l{i}"/>' for i in range(7))
    return f'<robot name="column">{links}{"".join(parts)}{tip}</robot>'
