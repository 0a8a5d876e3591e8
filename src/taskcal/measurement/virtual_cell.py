"""The virtual cell: a true robot drawn from tolerances, measured by a virtual tracker."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np
from jaxtyping import Float

from taskcal.arguments import expect_kinds, with_choices
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.tracker import TrackerNoise
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr

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

    def __post_init__(self) -> None:
        expect_kinds(
            {"noise": TrackerNoise | None, "conditions": Conditions | None},
            noise=self.noise,
            conditions=self.conditions,
        )

    @classmethod
    def of(cls, **choices: Unpack[SimulationChoices]) -> "SimulationOptions":
        """Options by keywords, those not named as in ``options``, or as by default.

        Raises:
            TypeError: an option that does not exist; the message names all.
        """
        return with_choices(choices.pop("options", None) or cls(), choices, "a simulation")

    @property
    def named_targets(self) -> dict[str, Float[np.ndarray, " 3"]]:
        """The targets that are measured."""
        named = {"tool": np.zeros(3)} if self.targets is None else dict(self.targets)
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
        q: joint positions of the measured poses, radians.
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

    Returns:
        the campaign, and the truth it was made from.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    expect_kinds({"model": ErrorModel}, model=model)
    chosen = SimulationOptions.of(**options)
    noise, named = chosen.noise or TrackerNoise(), chosen.named_targets
    offsets = np.array(list(named.values()), dtype=float)
    truth = Truth(
        model=model,
        x=draw_defects(model, rng) if chosen.x is None else np.asarray(chosen.x, dtype=float),
        T_tracker_base=TRACKER_POSE if chosen.T_tracker_base is None else chosen.T_tracker_base,
        T_tool_target=se3.pose(np.broadcast_to(np.eye(3), (len(offsets), 3, 3)), offsets),
    )
    q = np.asarray(q, dtype=float)
    conditions = chosen.conditions
    if conditions is None and model.conditioned:
        conditions = conditions_in_order(model.robot, q)
    T = truth.poses(q, conditions)
    points = T[..., :3, 3]
    factor = np.linalg.cholesky(noise.covariance(points) + chosen.model_error**2 * np.eye(3))
    points = points + (factor @ rng.normal(size=(*points.shape, 1)))[..., 0]
    rotations = None
    if chosen.pose:
        rotations = se3.exp(noise.rotation * rng.normal(size=(len(q), 3))) @ T[:, 0, :3, :3]
    if chosen.lost:
        points[rng.random(points.shape[:2]) < chosen.lost] = np.nan
    campaign = Campaign(
        ids=tuple(str(i) for i in range(len(q))),
        q=q,
        targets=tuple(named),
        points=points,
        rotations=rotations,
        conditions=conditions or Conditions(),
        source="virtual cell",
    )
    return campaign, truth
