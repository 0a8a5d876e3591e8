"""Random URDF files, and where Pinocchio finds their links."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio

from taskcal.robot.urdf_file import UrdfJoint, UrdfTree, read_urdf_tree


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
    """Poses of a URDF's links by Pinocchio, from the values of joints that do not mimic others."""

    def __init__(self, path: Path):
        self.tree: UrdfTree = read_urdf_tree(path)
        self.model = pinocchio.buildModelFromUrdf(str(path))
        self.data = self.model.createData()

    @property
    def motors(self) -> list[str]:
        return [joint.name for joint in self.tree.joints.values() if joint.moves and joint.mimic is None]

    def pose(self, values: Mapping[str, float], link: str) -> np.ndarray:
        q = pinocchio.neutral(self.model)
        for joint in self.tree.joints.values():
            if not joint.moves:
                continue
            known, value = self.model.joints[self.model.getJointId(joint.name)], self._value(values, joint)
            if known.nq == 2:
                q[known.idx_q : known.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                q[known.idx_q] = value
        pinocchio.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.model.getFrameId(link, pinocchio.FrameType.BODY)].homogeneous.copy()

    def _value(self, values: Mapping[str, float], joint: UrdfJoint) -> float:
        if joint.mimic is None:
            return values[joint.name]
        return joint.mimic.multiplier * self._value(values, self.tree.joints[joint.mimic.joint]) + joint.mimic.offset
