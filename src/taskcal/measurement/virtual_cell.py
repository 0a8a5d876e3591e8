"""The virtual cell: a true robot drawn from tolerances, measured by a virtual tracker, or with sockets, wires and cameras."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypedDict, Unpack

import numpy as np
from jaxtyping import Float

from taskcal.arguments import expect_kinds, with_choices
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.joined import join
from taskcal.measurement.observation import Scene, instrument_of
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_observation import OutOfReachError, TrueRobot, visit
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr

CELLS = 6
"""That are set up one after another where what stands in one is out of reach; people look for another place, too."""

TRACKER_POSE = se3.pose(se3.exp(np.array([0.02, -0.01, 2.1])), np.array([3.2, -1.9, -0.35]))
"""Where the base is seen by default: a tracker some four metres away that stands nearly upright."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Truth:
    """What a simulated campaign was made from."""

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


class SimulationChoices(TypedDict, total=False):
    """`SimulationOptions` by keywords: all of them at once, some of them, or some that replace those of a whole."""

    options: "SimulationOptions | None"
    x: Float[np.ndarray, " p"] | None
    targets: Mapping[str, Float[np.ndarray, " 3"]] | None
    pose: bool
    noise: TrackerNoise | None
    T_tracker_base: Float[np.ndarray, "4 4"] | None
    lost: float
    conditions: Conditions | None
    model_error: float
    joint_error: float | Float[np.ndarray, " joints"]
    observe: str
    places: int | None


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class SimulationOptions:
    """What a virtual robot is measured with; `dataclasses.replace` gives others."""

    x: Float[np.ndarray, " p"] | None = None
    """The true robot's defects; None to draw them from the tolerances."""
    targets: Mapping[str, Float[np.ndarray, " 3"]] | None = None
    """Target centres in the tool frame, metres; None for one at the tool point."""
    pose: bool = False
    """Measure poses of the first target instead of points."""
    noise: TrackerNoise | None = None
    """The tracker's; None for the default."""
    T_tracker_base: Float[np.ndarray, "4 4"] | None = None
    """Where the tracker sees the base."""
    lost: float = 0.0
    """Share of beams that are lost."""
    conditions: Conditions | None = None
    """How the poses were reached; None for one after another in the order of the rows, where an effect of the model depends on
    it, and at its reference where it grows."""
    model_error: float = 0.0
    """Standard deviation per axis of what the model does not explain, metres; white, at every measured point."""
    joint_error: float | Float[np.ndarray, " joints"] = 0.0
    """Standard deviation of the true joints about what the controller says, radians (metres where a joint slides)."""
    observe: str = "tracker"
    """How: ``tracker``, ``socket``, ``wire``, ``camera``, ``board``, ``plane``, ``cube``; ``socket+wire`` shares the rows."""
    places: int | None = None
    """How many blocks, anchors, landmarks, planes or cubes stand there, without a tracker; three blocks, anchors or planes, one of
    the others by default."""

    def __post_init__(self) -> None:
        expect_kinds(
            {"noise": TrackerNoise | None, "conditions": Conditions | None},
            noise=self.noise,
            conditions=self.conditions,
        )
        for way in self.ways:
            if way != "tracker":
                instrument_of(way)
            if self.ways.count(way) > 1:
                raise CampaignError(f"'{self.observe}' names {way} twice; name each way to measure once")
        if self.pose and self.ways != ("tracker",):
            raise CampaignError(
                f"poses are measured by a tracker alone, not by '{self.observe}'; leave out one of both"
            )
        if self.places is not None and (self.places < 1 or self.ways == ("tracker",)):
            raise CampaignError(
                f"{self.places} places do not go with '{self.observe}'; give one or more, for what stands without a tracker"
            )

    @classmethod
    def of(cls, **choices: Unpack[SimulationChoices]) -> "SimulationOptions":
        """Options by keywords, those not named as in ``options``, or as by default.

        Raises:
            TypeError: an option that does not exist; the message names all.
        """
        return with_choices(choices.pop("options", None) or cls(), choices, "a simulation")

    @property
    def ways(self) -> tuple[str, ...]:
        """To measure, one after another."""
        return tuple(self.observe.split("+"))

    def reflectors_beside(self, others: set[str]) -> dict[str, Float[np.ndarray, " 3"]]:
        """The targets that a tracker measures: one at the tool point where all that are named are measured otherwise."""
        named = {name: np.asarray(at, dtype=float) for name, at in (self.targets or {}).items() if name not in others}
        named = named or {"tool": np.zeros(3)}
        return dict(list(named.items())[:1]) if self.pose else named


def simulate(
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    *,
    rng: np.random.Generator,
    **options: Unpack[SimulationChoices],
) -> tuple[Campaign, Truth]:
    """Measure a virtual robot.

    Args:
        model: the model that the true robot follows.
        q: joint positions of the measured poses, radians; where something is touched or looked at, of poses near them.
        rng: source of the defects and of the noise.
        **options: those of `SimulationOptions`, each by its name, and all at once as ``options``; names replace what is in those.

            ``x``: the true robot's defects; drawn from the tolerances by default.

            ``targets``: target centres in the tool frame, metres; one at the tool point by default.

            ``pose``: measure poses of the first target instead of points.

            ``noise``: the tracker's.

            ``T_tracker_base``: where the tracker sees the base.

            ``lost``: share of beams that are lost.

            ``conditions``: how the poses were reached; one after another in the order of the rows by default, where an effect
            of the model depends on it, and at its reference where it grows.

            ``model_error``: standard deviation per axis of what the model does not explain, metres; white, at every measured
            point.

            ``joint_error``: standard deviation of the true joints about what the controller says.

            ``observe``: how: ``tracker``, ``socket``, ``wire``, ``camera``, ``board``, ``plane``, ``cube``; ``socket+wire`` shares
            the rows. With a socket or a camera the true robot takes the posture nearby at which the ball is in the socket, or
            the landmark in the picture.

            ``places``: how many blocks, anchors, landmarks stand there.

    Returns:
        the campaign, and the truth it was made from.

    Raises:
        UnknownName: a way to measure that does not exist.
        CampaignError: options do not go together.
        CampaignError: in none of some cells does the robot reach all that stands there.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    expect_kinds({"model": ErrorModel}, model=model)
    chosen, q = SimulationOptions.of(**options), np.asarray(q, dtype=float)
    ways = chosen.ways
    if len(q) < len(ways):
        raise CampaignError(f"{len(q)} rows cannot be shared among {len(ways)} ways to measure; give more")
    base = TRACKER_POSE if chosen.T_tracker_base is None else chosen.T_tracker_base
    robot = TrueRobot(
        model=model,
        x=draw_defects(model, rng) if chosen.x is None else np.asarray(chosen.x, dtype=float),
        T_tracker_base=base if "tracker" in ways else np.eye(4),
        joint_error=np.broadcast_to(np.asarray(chosen.joint_error, dtype=float), q.shape[1:]),
        model_error=chosen.model_error,
    )
    rows = {way: np.arange(k, len(q), len(ways)) for k, way in enumerate(ways)}
    scenes = {way: _scene(robot, chosen, way, q[rows[way]], rng) for way in ways if way != "tracker"}
    reflectors = chosen.reflectors_beside({scene.target for scene in scenes.values()})
    parts: list[Campaign] = []
    targets: list[np.ndarray] = []
    for way, own in rows.items():
        conditions = None if chosen.conditions is None else chosen.conditions.take(own)
        if way in scenes:
            scenes[way], part = _visit_one(robot, chosen, way, scenes[way], q[own], conditions, rng)
            parts.append(part)
            targets.append(scenes[way].T_tool_target)
        else:
            parts.append(_track(robot, chosen, reflectors, q[own], conditions, rng))
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


def _scene(robot: TrueRobot, options: SimulationOptions, way: str, q: np.ndarray, rng: np.random.Generator) -> Scene:
    """What stands there, for rows about these joints; what is on the tool where it is asked to be."""
    scene = instrument_of(way).stage(robot.T_tracker_base @ robot.model.nominal.poses(q), options.places, rng)
    if options.targets is None or scene.target not in options.targets:
        return scene
    at = np.asarray(options.targets[scene.target], dtype=float)
    return scene._replace(T_tool_target=se3.pose(scene.T_tool_target[:3, :3], at))


def _visit_one(
    robot: TrueRobot,
    options: SimulationOptions,
    way: str,
    scene: Scene,
    q: Float[np.ndarray, "n joints"],
    conditions: Conditions | None,
    rng: np.random.Generator,
) -> tuple[Scene, Campaign]:
    """The first of some cells in which the robot reaches what stands there, and what is read of it.

    Raises:
        OutOfReachError: it reaches it in none of them.
    """
    for _ in range(CELLS - 1):
        try:
            return scene, _visit(robot, options, scene, q, conditions, rng)
        except OutOfReachError:
            scene = _scene(robot, options, way, q, rng)
    return scene, _visit(robot, options, scene, q, conditions, rng)


def _visit(
    robot: TrueRobot,
    options: SimulationOptions,
    scene: Scene,
    q: Float[np.ndarray, "n joints"],
    conditions: Conditions | None,
    rng: np.random.Generator,
) -> Campaign:
    """What is read of what stands there."""
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


def _track(
    robot: TrueRobot,
    options: SimulationOptions,
    reflectors: Mapping[str, Float[np.ndarray, " 3"]],
    q: Float[np.ndarray, "n joints"],
    conditions: Conditions | None,
    rng: np.random.Generator,
) -> Campaign:
    """What a tracker sees."""
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
