"""The calibrated chain: what geometry alone holds of a calibration, its defects taken into the fixed parts."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.geometry.chain import ErrorFrame, Fixed, JointKind
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import closes
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

SAMPLES = 400
"""Poses over the joints' ranges, where no task says which matter."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ChainJoint:
    """A joint with the fixed part before it."""

    name: str
    kind: JointKind
    coordinate: int
    """Which chain coordinate moves it."""
    before: Float[np.ndarray, "4 4"]
    """From the previous joint's frame, or the base."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibratedChain:
    """Fixed parts, joints about or along their z axes, and what moves these."""

    robot: Robot
    joints: tuple[ChainJoint, ...]
    end: Float[np.ndarray, "4 4"]
    """From the last joint's frame to the tool."""
    matrix: Float[np.ndarray, "coordinates joints"]
    offset: Float[np.ndarray, " coordinates"]
    """Chain coordinates are matrix·q + offset, radians or metres."""

    @classmethod
    def of(cls, calibration: Calibration, q: Float[np.ndarray, "n joints"]) -> "CalibratedChain":
        """The chain of a calibration; of what effects and loops add at joint positions q, the mean goes into the joints' zeros."""
        return cls.of_model(calibration.model, calibration.estimate, q)

    @classmethod
    def of_model(
        cls, model: ErrorModel, x: Float[np.ndarray, " p"], q: Float[np.ndarray, "n joints"]
    ) -> "CalibratedChain":
        """The same of a model with parameter values x."""
        robot = model.robot
        count = len(robot.joint_map.offset)
        frames = se3.error_transform(model.error_frames(x))
        names = [*robot.joint_names, *(joint.name for joint in robot.driven)]
        joints: list[ChainJoint] = []
        pending, met, counted = np.eye(4), 0, 0
        for step in model.steps:
            if isinstance(step, Fixed):
                pending = pending @ step.transform
            elif isinstance(step, ErrorFrame):
                pending = pending @ frames[met]
                met += 1
            else:
                k = counted if step.number is None else step.number
                counted += step.number is None
                if k < count:  # joints that effects add stand still
                    joints.append(ChainJoint(name=names[k], kind=step.kind, coordinate=k, before=pending))
                    pending = np.eye(4)
        added = model.walk(q, x).s[:, :count] - robot.joint_map(q)
        return cls(
            robot=robot,
            joints=tuple(joints),
            end=pending,
            matrix=robot.joint_map.matrix,
            offset=robot.joint_map.offset + added.mean(axis=0),
        )

    def poses(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the base."""
        s = q @ self.matrix.T + self.offset
        T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
        for joint in self.joints:
            T = T @ joint.before @ moved(joint.kind, s[:, joint.coordinate])
        return T @ self.end


def moved(kind: JointKind, value: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 4 4"]:
    """What joints do at some values, radians or metres."""
    T = np.tile(np.eye(4), (len(value), 1, 1))
    if kind == "prismatic":
        T[:, 2, 3] = value
    else:
        T[:, 0, 0] = T[:, 1, 1] = np.cos(value)
        T[:, 1, 0] = np.sin(value)
        T[:, 0, 1] = -T[:, 1, 0]
    return T


def spread_poses(calibration: Calibration, count: int = SAMPLES) -> Float[np.ndarray, "n joints"]:
    """Joint positions all over the ranges at which loops close, radians or metres; the same ones at every call."""
    model = calibration.model
    limits = np.clip(model.robot.limits, -np.pi, np.pi)
    q = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (4 * count, len(limits)))
    q = q[model.robot.inside_limits(q)]
    return q[closes(model, q, None) & closes(model, q, calibration.estimate)][:count]
