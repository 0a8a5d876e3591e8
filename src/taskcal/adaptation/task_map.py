"""Where in a task the errors are: maps over slices of a workspace, and curves along a path."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.adaptation.expected_error import Design
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import find_posture, follow
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

Maps = Sequence[Float[np.ndarray, "v u"]]
"""One for each slice."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Slice:
    """A plane through the middle of a workspace, in one of its orientations."""

    plane: str
    """``xy``, ``xz`` or ``yz`` of the workspace's own axes."""
    u: Float[np.ndarray, " u"]
    """Along the first axis, from the centre, metres."""
    v: Float[np.ndarray, " v"]
    """Along the second."""
    q: Float[np.ndarray, "v u joints"]
    """Radians."""
    reached: Bool[np.ndarray, "v u"]
    """Where the robot gets to."""

    def spread(self, values: Float[np.ndarray, " reached"]) -> Float[np.ndarray, "v u"]:
        """Values at the reached points as a map, NaN elsewhere."""
        out = np.full(self.reached.shape, np.nan)
        out[self.reached] = values
        return out


def slice_workspace(model: ErrorModel, task: Task, points: int = 21) -> tuple[Slice, ...]:
    """Three planes through the middle of a task's workspace.

    Raises:
        ReachError: the task has no workspace, or the robot does not reach its middle.
    """
    space = task.workspace
    if space is None:
        raise ReachError(
            f"task '{task.name}' is a list of poses, which has no slices; its poses themselves can be shown"
        )
    middle = space.middle()[0]
    start = find_posture(model, middle)
    axes = space.T_base_frame[:3, :3] @ space.turned
    out: list[Slice] = []
    for first, second in ((0, 1), (0, 2), (1, 2)):
        u = np.linspace(-0.5, 0.5, points) * space.size[first]
        v = np.linspace(-0.5, 0.5, points) * space.size[second]
        p = middle[:3, 3] + u[None, :, None] * axes[:, first] + v[:, None, None] * axes[:, second]
        inside = np.ones((points, points), dtype=bool)
        if space.shape == "cylinder":
            across = np.hypot(u[None], v[:, None]) if (first, second) == (0, 1) else np.abs(u)[None] + 0.0 * v[:, None]
            inside = across <= 0.5 * space.size[0] * (1 + 1e-9)
        found = follow(model, se3.pose(np.broadcast_to(middle[:3, :3], (points**2, 3, 3)), p.reshape(-1, 3)), start)
        out.append(
            Slice(
                plane="xyz"[first] + "xyz"[second],
                u=u,
                v=v,
                q=found.q.reshape(points, points, -1),
                reached=found.reached.reshape(points, points) & inside,
            )
        )
    return tuple(out)


def map_sensitivity(model: ErrorModel, at: Slice) -> Float[np.ndarray, "p v u"]:
    """Effect in space of every parameter's tolerance over a slice, metres; NaN where the robot does not get to."""
    S = model.jacobian(at.q[at.reached], angular=False)
    effect = np.linalg.norm(S, axis=1) * model.tolerances
    return np.stack([at.spread(effect[:, k]) for k in range(len(model))])


def map_tolerance(model: ErrorModel, at: Slice) -> Float[np.ndarray, "v u"]:
    """Expected error of the nominal robot in its own base, all tolerances together, metres."""
    S = model.jacobian(at.q[at.reached], angular=False) * model.tolerances
    return at.spread(np.sqrt((S**2).sum(axis=(1, 2))))


def map_expected(design: Design, at: Slice, kept: Int[np.ndarray, " k"] | None = None) -> Float[np.ndarray, "v u"]:
    """Expected error over a slice in the tracker frame, metres: with a kept set identified, or before (no set)."""
    return at.spread(design.expected_at(at.q[at.reached], kept))


def map_uncertainty(calibration: Calibration, at: Slice) -> Float[np.ndarray, "v u"]:
    """Standard deviation in space of the calibrated tool point over a slice, tracker frame, metres."""
    covariance = calibration.tool_covariance(at.q[at.reached])
    return at.spread(np.sqrt(np.trace(covariance[:, :3, :3], axis1=1, axis2=2)))
