"""Measuring a virtual robot without a tracker: it goes to what stands in its cell, or looks at it.

Where something touches, the true robot is there: its joints are solved for by what it is, not by what its controller believes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import Reached, solve_near
from taskcal.measurement.observation import Differential, Measured, Observation, Scene, Standalone
from taskcal.measurement.tracker import TrackerNoise
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel

WITH_ROTATION = 6
"""Numbers of a kind that measures rotations."""

ATTEMPTS = 40
"""Postures that are tried for a row, the row's own first."""

SHAKEN = 0.1
"""Standard deviation of the joints about another row's posture, where the row's own does not serve, radians."""

NAMED = 6
"""Things that a message names."""

ROUNDS, MET = 8, 1e-8
"""Of going where something touches, for robots of which it depends on the way how they get there; and how well they meet it,
metres."""


class OutOfReachError(CampaignError):
    """What stands in a cell cannot be measured from any posture that was tried."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueRobot:
    """A robot as it is, and where it stands in the measuring frame."""

    model: ErrorModel
    x: Float[np.ndarray, " p"]
    T_tracker_base: Float[np.ndarray, "4 4"]
    joint_error: Float[np.ndarray, " joints"]
    """Standard deviation of the joints about what the controller says, radians (metres where a joint slides)."""
    model_error: float
    """Standard deviation per axis of what no parameter explains, metres."""

    def poses(
        self, q: Float[np.ndarray, "n joints"], target: Float[np.ndarray, "4 4"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Of a target, in the measuring frame."""
        return self.T_tracker_base @ self.model.poses(q, self.x, conditions) @ target


@dataclass(frozen=True, eq=False, kw_only=True)
class Visit:
    """What was read at the rows of one scene."""

    q: Float[np.ndarray, "n joints"]
    """Joints as the controller says, radians."""
    read: Measured
    conditions: Conditions


def visit(
    robot: TrueRobot,
    scene: Scene,
    q: Float[np.ndarray, "n joints"],
    *,
    conditions: Conditions | None,
    rng: np.random.Generator,
) -> Visit:
    """Measure near postures that are given: at what stands there if it is touched, before it if it is looked at.

    Args:
        robot: as it is.
        scene: the cell, with as many rows.
        q: joints, one for each row.
        conditions: how the rows were reached; in their order by default, where the model asks.
        rng: source of the noise.

    Raises:
        OutOfReachError: a row cannot be measured from any posture that was tried.
    """
    touched = scene.observation.touched
    error = robot.model_error * rng.normal(size=(len(q), 3))
    noise = _noise(scene, len(q), rng)

    def goal(at: np.ndarray, rows: np.ndarray) -> np.ndarray:
        T = at if scene.approach is None else scene.approach(at, rows).copy()
        if touched:
            # where it touches nothing else can give way: a ball that sits badly, and what no parameter explains, move the robot
            along = np.linalg.pinv(_differential(scene, T, rows).by_target[:, :, :3])
            T[:, :3, 3] += (along @ noise[rows][:, :, None])[:, :, 0] - error[rows]
        return T

    goals, true = _reach(robot, scene, q, goal, rng)
    way = conditions
    if robot.model.conditioned:
        true, way = _settle(robot, scene, true, goals, conditions)
    at = robot.poses(true, scene.T_tool_target, way)
    at[:, :3, 3] += error
    off = robot.joint_error * rng.normal(size=true.shape)
    return Visit(q=true - off, read=_read(scene, at, noise), conditions=way or Conditions())


def _reach(
    robot: TrueRobot,
    scene: Scene,
    q: Float[np.ndarray, "n joints"],
    goal: Callable[[np.ndarray, np.ndarray], np.ndarray],
    rng: np.random.Generator,
) -> tuple[Float[np.ndarray, "n 4 4"], Float[np.ndarray, "n joints"]]:
    """Poses of the target at which every row is measured, and the true robot's joints there."""
    left, seed, true = np.arange(len(q)), q, q.copy()
    goals = np.zeros((len(q), 4, 4))
    for _ in range(ATTEMPTS):
        goals[left] = goal(robot.poses(seed, scene.T_tool_target), left)
        reached = _solve(robot, scene, goals[left], seed)
        true[left] = reached.q
        left = left[~reached.reached]
        if not len(left):
            return goals, true
        seed = q[rng.integers(len(q), size=len(left))] + SHAKEN * rng.normal(size=(len(left), q.shape[1]))
    raise OutOfReachError(_unreached(robot, scene, goals, left))


def _unreached(robot: TrueRobot, scene: Scene, goals: Float[np.ndarray, "n 4 4"], left: Int[np.ndarray, " k"]) -> str:
    """Which rows are not reached, of what, how far away that is, and what would help."""
    kind, name = scene.observation, robot.model.robot.name
    assert isinstance(kind, Standalone)
    named = ", ".join(f"'{kind.named[k]}'" for k in np.unique(kind.numbers[left])[:NAMED])
    base = se3.inverse(robot.T_tracker_base) @ goals[left]
    away = np.linalg.norm(base[:, :3, 3], axis=1) * 1e3
    distance = " to ".join(dict.fromkeys(f"{one:.0f}" for one in (away.min(), away.max())))
    return (
        f"{name} cannot measure with '{kind.instrument}' in {len(left)} of {len(goals)} rows: {ATTEMPTS} postures were tried, and "
        f"from none does it get inside its limits to {kind.label} {named}, {distance} mm from its base "
        f"(its links are {robot.model.robot.reach * 1e3:.0f} mm long in all); move the task to the middle of its reach, make it "
        "smaller, or let the tool turn less"
    )


def _solve(
    robot: TrueRobot, scene: Scene, goals: Float[np.ndarray, "n 4 4"], seed: Float[np.ndarray, "n joints"]
) -> Reached:
    tool = se3.inverse(robot.T_tracker_base) @ goals @ se3.inverse(scene.T_tool_target)
    return solve_near(robot.model, tool, seed, robot.x)


def _settle(
    robot: TrueRobot,
    scene: Scene,
    q: Float[np.ndarray, "n joints"],
    goals: Float[np.ndarray, "n 4 4"],
    conditions: Conditions | None,
) -> tuple[Float[np.ndarray, "n joints"], Conditions]:
    """Joints at which the robot touches where it should, although it depends on the way how it gets there; and the way."""
    aim = goals.copy()
    for _ in range(ROUNDS):
        way = conditions_in_order(robot.model.robot, q) if conditions is None else conditions
        if not scene.observation.touched:
            return q, way
        off = goals[:, :3, 3] - robot.poses(q, scene.T_tool_target, way)[:, :3, 3]
        if np.abs(off).max() < MET:
            return q, way
        aim[:, :3, 3] += off
        q = _solve(robot, scene, aim, q).q
    raise CampaignError(
        f"{robot.model.robot.name} does not come to rest at what it touches: its effects change by more than they bring it nearer"
    )


def _of_rows(scene: Scene, rows: Int[np.ndarray, " k"]) -> Observation:
    """The kind for some of the rows, its unknowns as they are."""
    of = scene.observation.of
    return scene.observation if of is None else replace(scene.observation, of=of[rows])


def _blank(scene: Scene, count: int) -> Measured:
    """As if everything read zero."""
    turned = scene.observation.width == WITH_ROTATION
    return Measured(np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)) if turned else None)


def _differential(scene: Scene, target: Float[np.ndarray, "k 4 4"], rows: Int[np.ndarray, " k"]) -> Differential:
    return _of_rows(scene, rows).differentiate(target, scene.unknown, _blank(scene, len(rows)))


def _noise(scene: Scene, count: int, rng: np.random.Generator) -> Float[np.ndarray, "n w"]:
    """As large as the kind says."""
    covariance = scene.observation.covariance(_blank(scene, count), None, TrackerNoise())
    factor = np.linalg.cholesky(covariance)
    return (factor @ rng.normal(size=(*factor.shape[:2], 1)))[:, :, 0]


def _read(scene: Scene, target: Float[np.ndarray, "n 4 4"], noise: Float[np.ndarray, "n w"]) -> Measured:
    """What the instrument shows at true poses of the target."""
    blank = _blank(scene, len(target))
    if scene.observation.touched:
        return blank
    # what is predicted is less by the residual than what was read, which is nothing
    residual = _differential(scene, target, np.arange(len(target))).residual
    points = np.zeros((len(target), 3))
    width = min(residual.shape[1], 3)
    points[:, :width] = (noise - residual)[:, :width]
    if blank.rotations is None:
        return Measured(points)
    return Measured(points, se3.exp(noise[:, 3:]) @ np.swapaxes(se3.exp(residual[:, 3:]), 1, 2))
