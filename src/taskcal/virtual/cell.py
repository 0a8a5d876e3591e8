"""The virtual cell: a true robot drawn from tolerances, measured by a virtual tracker, or with sockets, wires and cameras."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.arguments import Named, by_name, checked, chosen_options, joints_checked
from taskcal.campaigns.campaign import Campaign, in_blocks, join
from taskcal.errors import CampaignError, listed
from taskcal.geometry import se3
from taskcal.kinematics.inverse import Reached, solve_near
from taskcal.observations import Differential, Measured, Observation, Scene
from taskcal.observations.base import TrackerNoise
from taskcal.observations.point import TRACKER_POSE
from taskcal.registration.stations import join_stations
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.virtual.options import SimulationOptions, check_joint_error

# Measuring a virtual robot without a tracker: it goes to what stands in its cell, or looks at it.
#
# Where something touches, the true robot is there: its joints are solved for by what it is, not by what its
# controller believes.

MAX_POSTURES = 40
"""Postures that are tried for a row, the row's own first."""

JOINT_SPREAD_RAD = 0.1
"""Standard deviation of the joints about another row's posture, where the row's own does not serve, radians."""

MAX_NAMES = 6
"""Fixtures that a message names."""

MAX_ROUNDS, TOUCHED_WITHIN_M = 8, 1e-8
"""Of going where something touches, for robots of which it depends on the way how they get there; and how well they meet it,
metres."""


class OutOfReachError(CampaignError):
    """A fixed object of a cell cannot be measured from any configuration that was tried."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueRobot:
    """A robot as it is, and where it stands in the measuring frame."""

    model: ErrorModel
    x: Float[np.ndarray, " p"]
    T_tracker_base: Float[np.ndarray, "4 4"]
    joint_error: Float[np.ndarray, " joints"]
    """Standard deviation of the joints about what the controller says, radians (metres where a joint slides)."""
    model_error: float
    """Standard deviation per axis of what no parameter explains, metres; of angles alone at an arm of 1 m."""

    def poses(
        self, q: Float[np.ndarray, "n joints"], target: Float[np.ndarray, "4 4"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of a target in the measuring frame."""
        return self.T_tracker_base @ self.model.poses(q, self.x, conditions) @ target


@dataclass(frozen=True, eq=False, kw_only=True)
class Visit:
    """Readings at the rows of one scene."""

    q: Float[np.ndarray, "n joints"]
    """Joints as the controller says, radians."""
    read: Measured
    conditions: Conditions
    target: Float[np.ndarray, "n 4 4"]
    """True poses of what is on the tool, in the measuring frame."""


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
    if scene.observation.width == scene.observation.angles:
        # where angles alone are measured, errors count at an arm of 1 m
        at[:, :3, :3] = se3.exp(error) @ at[:, :3, :3]
    off = robot.joint_error * rng.normal(size=true.shape)
    return Visit(q=true - off, read=_read(scene, at, noise), conditions=way or Conditions(), target=at)


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
    for _ in range(MAX_POSTURES):
        goals[left] = goal(robot.poses(seed, scene.T_tool_target), left)
        reached = _solve(robot, scene, goals[left], seed)
        true[left] = reached.q
        left = left[~reached.reached]
        if not len(left):
            return goals, true
        seed = q[rng.integers(len(q), size=len(left))] + JOINT_SPREAD_RAD * rng.normal(size=(len(left), q.shape[1]))
    raise OutOfReachError(_unreached(robot, scene, goals, left))


def _unreached(robot: TrueRobot, scene: Scene, goals: Float[np.ndarray, "n 4 4"], left: Int[np.ndarray, " k"]) -> str:
    """Describe rows that are not reached: object, distance, and remedy."""
    kind, name = scene.observation, robot.model.robot.name
    names = [] if kind.of is None else [f"'{kind.named[k]}'" for k in np.unique(kind.of[left])]
    what = f"{kind.label} {listed(names, MAX_NAMES)}" if names else "where it measures"
    base = se3.inverse(robot.T_tracker_base) @ goals[left]
    away = np.linalg.norm(base[:, :3, 3], axis=1) * 1e3
    distance = " to ".join(dict.fromkeys(f"{one:.0f}" for one in (away.min(), away.max())))
    return (
        f"{name} cannot measure with '{kind.instrument}' in {len(left)} of {len(goals)} rows: {MAX_POSTURES} postures were tried, "
        f"and from none does it get inside its limits to {what}, {distance} mm from its base "
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
    for _ in range(MAX_ROUNDS):
        way = conditions_in_order(robot.model.robot, q) if conditions is None else conditions
        if not scene.observation.touched:
            return q, way
        off = goals[:, :3, 3] - robot.poses(q, scene.T_tool_target, way)[:, :3, 3]
        if np.abs(off).max() < TOUCHED_WITHIN_M:
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


def _differential(scene: Scene, target: Float[np.ndarray, "k 4 4"], rows: Int[np.ndarray, " k"]) -> Differential:
    return _of_rows(scene, rows).differentiate(target, scene.unknown, scene.observation.blank(len(rows)))


def _noise(scene: Scene, count: int, rng: np.random.Generator) -> Float[np.ndarray, "n w"]:
    """Noise as large as the kind says."""
    covariance = scene.observation.covariance(scene.observation.blank(count), None, TrackerNoise())
    factor = np.linalg.cholesky(covariance)
    return (factor @ rng.normal(size=(*factor.shape[:2], 1)))[:, :, 0]


def _read(scene: Scene, target: Float[np.ndarray, "n 4 4"], noise: Float[np.ndarray, "n w"]) -> Measured:
    """Readings of the instrument at true poses of the target."""
    blank = scene.observation.blank(len(target))
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


MAX_CELLS = 6
"""Cells that are set up one after another where what stands in one is out of reach; people look for another place, too."""


@joints_checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Truth:
    """Truth of a simulated campaign: parameters, frame, targets and unknowns."""

    model: ErrorModel
    x: Float[np.ndarray, " p"]
    """The true robot's defects, metres and radians."""
    T_tracker_base: Float[np.ndarray, "4 4"]
    T_tool_target: Float[np.ndarray, "targets 4 4"]
    unknowns: Mapping[str, float] = field(default_factory=dict[str, float])
    """Where sockets, anchors, landmarks … stand, by the names that they have in a fit, metres and radians."""

    def poses(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n targets 4 4"]:
        """True poses of the targets in the tracker frame."""
        T = self.T_tracker_base @ self.model.poses(q, self.x, conditions)
        return T[:, None] @ self.T_tool_target

    def points(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n targets 3"]:
        """True positions of the targets in the tracker frame, metres."""
        return self.poses(q, conditions)[..., :3, 3]


def draw_defects(model: ErrorModel, rng: np.random.Generator) -> Float[np.ndarray, " p"]:
    """Defects of a robot drawn from the model's tolerances."""
    return rng.normal(size=len(model)) * model.tolerances


@by_name(SimulationOptions)
@checked
def simulate(
    _kind: Callable[Named, SimulationOptions],
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    rng: np.random.Generator,
    options: SimulationOptions | None = None,
    *_args: Named.args,
    **_named: Named.kwargs,
) -> tuple[Campaign, Truth]:
    """Measure a virtual robot.

    Args:
        model: the model that the true robot follows.
        q: joint positions of the measured poses, radians; where something is touched or looked at, of poses near them.
        rng: source of the defects and of the noise.
        options: all at once; those that are named replace what is in them.

    Returns:
        the campaign, and the truth it was made from.

    Raises:
        UnknownName: an instrument that does not exist.
        WrongValue: options that cannot be, or not together.
        CampaignError: in none of some cells does the robot reach all that stands there.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    chosen, q = chosen_options(_kind, options, *_args, **_named), np.asarray(q, dtype=float)
    check_joint_error(chosen.joint_error, q.shape[1])
    kinds = chosen.kinds
    if len(q) < len(kinds):
        raise CampaignError(f"{len(q)} rows cannot be shared among {len(kinds)} instruments; give more")
    base = TRACKER_POSE if chosen.T_tracker_base is None else chosen.T_tracker_base
    robot = TrueRobot(
        model=model,
        x=draw_defects(model, rng) if chosen.x is None else np.asarray(chosen.x, dtype=float),
        T_tracker_base=base if any(kind.in_tracker for kind in kinds.values()) else np.eye(4),
        joint_error=np.broadcast_to(np.asarray(chosen.joint_error, dtype=float), q.shape[1:]),
        model_error=chosen.model_error,
    )
    rows = {name: np.arange(k, len(q), len(kinds)) for k, name in enumerate(kinds)}
    scenes = {
        name: _scene(robot, chosen, kind, q[rows[name]], rng) for name, kind in kinds.items() if not kind.in_tracker
    }
    reflectors = chosen.reflectors_beside({scene.target for scene in scenes.values()})
    parts: list[Campaign] = []
    targets: list[np.ndarray] = []
    for name, own in rows.items() if chosen.stations == 1 else ():
        conditions = None if chosen.conditions is None else chosen.conditions.take(own)
        if name in scenes:
            scenes[name], part = _visit_one(robot, chosen, scenes[name], q[own], conditions, rng)
            parts.append(part)
            targets.append(scenes[name].T_tool_target)
        else:
            parts.append(_track(robot, chosen, reflectors, q[own], conditions, rng))
            targets += [se3.translation(*at) for at in reflectors.values()]
    if chosen.stations > 1:
        parts.append(_track_from_stations(robot, chosen, reflectors, q, rng))
        targets += [se3.translation(*at) for at in reflectors.values()]
    truth = Truth(
        model=model,
        x=robot.x,
        T_tracker_base=robot.T_tracker_base,
        T_tool_target=np.stack(targets),
        unknowns={
            name: float(value)
            for scene in scenes.values()
            for name, value in zip(scene.observation.unknowns, scene.unknown, strict=True)
        },
    )
    return join(parts), truth


def _scene(
    robot: TrueRobot, options: SimulationOptions, kind: type[Observation], q: np.ndarray, rng: np.random.Generator
) -> Scene:
    """The cell for rows about these joints; what is on the tool where it is asked to be."""
    scene = kind.stage(robot.T_tracker_base @ robot.model.nominal.poses(q), options.places, rng)
    if options.targets is None or scene.target not in options.targets:
        return scene
    at = np.asarray(options.targets[scene.target], dtype=float)
    return scene._replace(T_tool_target=se3.pose(scene.T_tool_target[:3, :3], at))


def _visit_one(
    robot: TrueRobot,
    options: SimulationOptions,
    scene: Scene,
    q: Float[np.ndarray, "n joints"],
    conditions: Conditions | None,
    rng: np.random.Generator,
) -> tuple[Scene, Campaign]:
    """The first of some cells in which the robot reaches what stands there, and what is read of it.

    Raises:
        OutOfReachError: it reaches it in none of them.
    """
    for _ in range(MAX_CELLS - 1):
        try:
            return scene, _visit(robot, options, scene, q, conditions, rng)
        except OutOfReachError:
            scene = _scene(robot, options, type(scene.observation), q, rng)
    return scene, _visit(robot, options, scene, q, conditions, rng)


def _visit(
    robot: TrueRobot,
    options: SimulationOptions,
    scene: Scene,
    q: Float[np.ndarray, "n joints"],
    conditions: Conditions | None,
    rng: np.random.Generator,
) -> Campaign:
    """Measurements of a fixture."""
    found = visit(robot, scene, q, conditions=conditions, rng=rng)
    points = found.read.points
    if options.lost:
        points[rng.random(len(points)) < options.lost] = np.nan
    return Campaign(
        ids=tuple(str(i) for i in range(len(points))),
        q=found.q,
        targets=(scene.target,),
        points=points[:, None],
        rotations=found.read.rotations,
        observations=(scene.observation,),
        conditions=found.conditions,
        source="virtual cell",
    )


def _track_from_stations(
    robot: TrueRobot,
    options: SimulationOptions,
    reflectors: Mapping[str, Float[np.ndarray, " 3"]],
    q: Float[np.ndarray, "n joints"],
    rng: np.random.Generator,
) -> Campaign:
    """Measurements of a tracker that goes around the robot, as many rows from each place."""
    conditions = options.conditions
    if conditions is None and robot.model.conditioned:
        conditions = conditions_in_order(robot.model.robot, q)
    parts: list[tuple[str, Campaign]] = []
    station = in_blocks(len(q), options.stations)
    for k in range(options.stations):
        rows = np.flatnonzero(station == k)
        around = se3.rotation("z", 2.0 * np.pi * k / options.stations)
        there = replace(robot, T_tracker_base=robot.T_tracker_base @ around)
        told = None if conditions is None else conditions.take(rows)
        part = _track(there, options, reflectors, q[rows], told, rng)
        parts.append((f"{k + 1}", replace(part, ids=tuple(map(str, rows.tolist())))))
    return join_stations(robot.model.nominal, parts)


def _track(
    robot: TrueRobot,
    options: SimulationOptions,
    reflectors: Mapping[str, Float[np.ndarray, " 3"]],
    q: Float[np.ndarray, "n joints"],
    conditions: Conditions | None,
    rng: np.random.Generator,
) -> Campaign:
    """Measurements of a tracker."""
    noise = options.noise or TrackerNoise()
    if conditions is None and robot.model.conditioned:
        conditions = conditions_in_order(robot.model.robot, q)
    true = q + robot.joint_error * rng.normal(size=q.shape) if robot.joint_error.any() else q
    T = np.stack([robot.poses(true, se3.translation(*at), conditions) for at in reflectors.values()], axis=1)
    points = T[..., :3, 3]
    factor = np.linalg.cholesky(noise.covariance(points) + options.model_error**2 * np.eye(3))
    points = points + (factor @ rng.normal(size=(*points.shape, 1)))[..., 0]
    rotations = None
    if options.pose:
        rotations = se3.exp(noise.rotation * rng.normal(size=(len(q), 3))) @ T[:, 0, :3, :3]
    if options.lost:
        points[rng.random(points.shape[:2]) < options.lost] = np.nan
    return Campaign(
        ids=tuple(str(i) for i in range(len(q))),
        q=q,
        targets=tuple(reflectors),
        points=points,
        rotations=rotations,
        conditions=conditions or Conditions(),
        source="virtual cell",
    )
