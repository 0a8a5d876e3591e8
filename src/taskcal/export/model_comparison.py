"""How far a model that someone uses is from the calibrated robot: over its poses, as it stands and with its frames fitted."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.errors import TaskcalError, WrongValue, shown
from taskcal.export.forms import placed
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.comparison import MAX_POSES, fit_frames, spread_without_frames
from taskcal.robot.catalogue import describe_robot, load_robot
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from
from taskcal.short_repr import short_repr

STEPS = 30
"""Of Gauss and Newton, from the best rigid motion of the tool points: enough for tools half a metre apart."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Distance:
    """Distance of a model's poses from the calibrated robot's, one each."""

    position: Float[np.ndarray, " n"]
    """Of the tool point, metres."""
    rotation: Float[np.ndarray, " n"]
    """Of the tool's axes, radians."""

    @classmethod
    def between(cls, T: Float[np.ndarray, "n 4 4"], other: Float[np.ndarray, "n 4 4"]) -> "Distance":
        """The distance of poses from others."""
        apart = np.linalg.norm(T[:, :3, :3] - other[:, :3, :3], axis=(1, 2)) / np.sqrt(8.0)
        return cls(
            position=np.linalg.norm(T[:, :3, 3] - other[:, :3, 3], axis=1),
            rotation=2.0 * np.arcsin(np.minimum(apart, 1.0)),
        )

    def summary(self) -> dict[str, float]:
        """Mean, 95 % and largest, in millimetres and degrees."""
        return {
            f"{name}_{unit}": float(of(values)) * scale
            for values, unit, scale in ((self.position, "mm", 1e3), (self.rotation, "deg", 180.0 / np.pi))
            for name, of in (("mean", np.mean), ("p95", lambda values: np.percentile(values, 95.0)), ("max", np.max))
        }


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class ModelComparison:
    """A model beside a calibrated robot."""

    joint_names: tuple[str, ...]
    prismatic: tuple[bool, ...]
    q: Float[np.ndarray, "n joints"]
    """Poses at which they were compared, radians or metres."""
    T: Float[np.ndarray, "n 4 4"]
    """The calibrated robot's, of its tool in its base."""
    as_it_stands: Distance
    """With the model's own base and tip."""
    frames_fitted: Distance
    """With the base and the tool that put its tool points nearest to the robot's."""
    nominal: Distance
    """Of the nominal robot of the calibration, its frames fitted as well."""
    uncertainty: float
    """Of the calibrated tool point at these poses beside base and tool, 3D rms, 1σ, metres."""
    base: Float[np.ndarray, "4 4"]
    """The model's base in the robot's, as fitted."""
    tool: Float[np.ndarray, "4 4"]
    """The robot's tool in the model's tip, as fitted."""

    def summary(self) -> dict[str, Any]:
        """The comparison in millimetres and degrees, with the pose at which the fitted model is farthest off."""
        worst = int(np.argmax(self.frames_fitted.position))
        joints = {
            f"{name}_{'mm' if slides else 'deg'}": float(value) * (1e3 if slides else 180.0 / np.pi)
            for name, slides, value in zip(self.joint_names, self.prismatic, self.q[worst], strict=True)
        }
        return {
            "poses": len(self.q),
            "as_it_stands": self.as_it_stands.summary(),
            "frames_fitted": self.frames_fitted.summary(),
            "nominal": self.nominal.summary(),
            "uncertainty_mm": self.uncertainty * 1e3,
            "worst": {"row": worst, "joints": joints, "position_mm": [float(v) * 1e3 for v in self.T[worst, :3, 3]]},
            "base": placed(self.base),
            "tool": placed(self.tool),
        }


def read_model(source: str, convention: str | None = None) -> Robot:
    """A robot from what `taskcal.load_robot` takes, or from a table.

    Args:
        source: catalogue name or file; behind a ``#`` the tip.
        convention: of a table.

    Raises:
        FileError: the file does not describe a robot, or is a table without a convention.
        UnknownName: there is no such robot or link.
    """
    if convention is None and Path(source).suffix.lower() != ".csv":
        return load_robot(source)
    return robot_from(describe_robot(source, convention=convention))


def match_joints(model: Robot, robot: Robot, names: Sequence[str] | None = None) -> tuple[int, ...]:
    """Place in the robot's joints of each joint of a model, by name.

    Args:
        model: the model.
        robot: the robot.
        names: the model's joints in the order of the robot's, where their names differ.

    Raises:
        TaskcalError: they have other joints, or a joint of another kind.
    """
    named = robot.joint_names if names is None else tuple(names)
    if sorted(named) != sorted(model.joint_names):
        message = f"{shown(model.name)} has the joints {', '.join(model.joint_names)}, {robot.name} {', '.join(robot.joint_names)}"
        if names is not None:
            message += f", and named were {', '.join(shown(name) for name in named)}"
        if len(model.joints) == len(robot.joints):
            message += f"; name the model's in the order of {robot.name}'s: --joints {','.join(model.joint_names)}"
        raise TaskcalError(message)
    order = tuple(named.index(name) for name in model.joint_names)
    for k, name in zip(order, model.joint_names, strict=True):
        if robot.prismatic[k] != model.prismatic[model.joint_names.index(name)]:
            raise TaskcalError(f"{robot.joint_names[k]} and {name} are no pair: one turns and the other slides")
    return order


@checked
def compare_model(
    calibration: Calibration,
    model: Robot,
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    joints: Sequence[str] | None = None,
) -> ModelComparison:
    """Compare a model of a robot with its calibration.

    Args:
        calibration: the robot.
        model: what someone takes for it.
        q: joint positions at which it matters, radians or metres; by default some of those measured.
        joints: the model's joints in the order of the robot's, where their names differ.

    Raises:
        WrongValue: q has no rows.
        TaskcalError: the joints are others.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    robot = calibration.model.robot
    order = match_joints(model, robot, joints)
    if q is None:
        q = calibration.q[np.unique(np.linspace(0, len(calibration.q) - 1, MAX_POSES).astype(int))]
    if not len(q):
        raise WrongValue("q has no rows; give the poses at which a difference matters, or leave it out")
    robot.check_radians(q)
    T, own = calibration.tool_in_base(q), model.tool_poses(q[:, order])
    fitted, base, tool = _fitted(own, T)
    return ModelComparison(
        joint_names=robot.joint_names,
        prismatic=robot.prismatic,
        q=q,
        T=T,
        as_it_stands=Distance.between(own, T),
        frames_fitted=Distance.between(fitted, T),
        nominal=Distance.between(_fitted(robot.tool_poses(q), T)[0], T),
        uncertainty=float(np.linalg.norm(spread_without_frames(calibration, q, np.zeros((1, 3)))) / np.sqrt(len(q))),
        base=base,
        tool=tool,
    )


def _fitted(
    own: Float[np.ndarray, "n 4 4"], T: Float[np.ndarray, "n 4 4"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses with a base and a tool that put them onto others: the tool points by least squares, then the tool's mean rotation."""
    points = T[:, None, :3, 3]
    near = se3.fit_points(own[:, :3, 3], points[:, 0])
    moved, (tip,), _ = fit_frames(near @ own, np.zeros((1, 3)), points, STEPS)
    turned = np.swapaxes(moved[:, :3, :3], 1, 2) @ T[:, :3, :3]
    tool = se3.pose(se3.nearest_rotation(turned.mean(axis=0)), tip)
    return moved @ tool, moved[0] @ se3.inverse(own[0]), tool
