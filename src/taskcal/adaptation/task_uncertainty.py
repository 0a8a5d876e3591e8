"""How well a calibrated tool point is known over a task."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.task_map import Maps, Slice, map_tolerance, map_uncertainty, slice_workspace
from taskcal.identification.calibration import Calibration
from taskcal.task.task import Task, reach_task


@dataclass(frozen=True, eq=False, kw_only=True)
class Uncertainty:
    """How well the tool point is known over a task, before and after, metres."""

    task: str
    unreachable: float
    """Share of the task's poses that the robot does not reach."""
    before: float
    """Standard deviation in space by the tolerances alone, rms over the task."""
    after: float
    """Of the calibrated tool."""
    target: float
    """Of the first measured target."""
    deviations: Mapping[str, Float[np.ndarray, "n 3"]]
    """Standard deviations pose by pose in the axes of the robot's base."""
    slices: tuple[Slice, ...]
    """Of the workspace; none for a list of poses or a path."""
    maps: Mapping[str, Maps]
    """Standard deviations in space over the slices."""


def uncertainty_over(calibration: Calibration, task: Task, seed: int = 0) -> Uncertainty:
    """How well the tool is known over a task: by the tolerances alone, and calibrated.

    Args:
        calibration: the calibration.
        task: what the robot has to do.
        seed: of the spread over its workspace.

    Raises:
        ReachError: the robot does not reach the task.
    """
    model = calibration.model
    poses = reach_task(model, task, seed=seed)
    effect = model.jacobian(poses.q, angular=False) * model.tolerances
    turn = calibration.T_tracker_base[:3, :3]

    def target(q: np.ndarray) -> np.ndarray:
        return calibration.predict_covariance(q, model_error=False)[:, 0, :3, :3]

    def per_axis(covariance: np.ndarray) -> np.ndarray:
        in_base = turn.T @ covariance[:, :3, :3] @ turn
        return np.sqrt(np.maximum(np.diagonal(in_base, axis1=1, axis2=2), 0.0))

    def in_space(deviation: np.ndarray) -> float:
        return float(np.sqrt(np.sum(poses.weights[:, None] * deviation**2)))

    before = np.sqrt((effect**2).sum(axis=2))
    after, point = per_axis(calibration.tool_covariance(poses.q)), per_axis(target(poses.q))
    slices = () if task.workspace is None else slice_workspace(model, task)
    return Uncertainty(
        task=task.name,
        unreachable=float(poses.unreachable.mean()),
        before=in_space(before),
        after=in_space(after),
        target=in_space(point),
        deviations={
            "tool, by the tolerances": before,
            "tool, calibrated": after,
            f"target {calibration.targets[0]}": point,
        },
        slices=slices,
        maps={
            "target": tuple(at.spread(np.sqrt(np.trace(target(at.q[at.reached]), axis1=1, axis2=2))) for at in slices),
            "tool": tuple(map_uncertainty(calibration, at) for at in slices),
            "by the tolerances": tuple(map_tolerance(model, at) for at in slices),
        },
    )
