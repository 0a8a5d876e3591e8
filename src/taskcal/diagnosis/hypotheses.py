"""Hypotheses on a campaign: each undoes a mistake, and states the fix in one line."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.joint_side import JointMap
from taskcal.robot.robot import Robot

# A robot without limits, so that a file with wrong joints can be read and looked at.


def open_limits(robot: Robot) -> Robot:
    """The robot, able to take any joint position."""
    joints = tuple(replace(joint, limits=(-np.inf, np.inf)) for joint in robot.joints)
    return replace(robot, joints=joints, coupled_limits=())


USUAL_REACH_M = 1.0
"""A convention, where a robot has no lengths of its own."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """A robot and a campaign that are to fit each other."""

    robot: Robot
    """As stated, with its limits."""
    model: ErrorModel
    """Of the same robot with open limits, so that wrong joints can be tried."""
    campaign: Campaign

    @classmethod
    def of(cls, robot: Robot, campaign: Campaign) -> "Case":
        """A case of any robot."""
        return cls(robot=robot, model=ErrorModel(open_limits(robot)), campaign=campaign)

    @property
    def reach(self) -> float:
        """Of the robot; of one that is slides alone, whose limits are open, that of usual robots, metres."""
        return self.model.robot.reach or USUAL_REACH_M

    def poses(self, rows: Int[np.ndarray, " k"]) -> Float[np.ndarray, "k 4 4"]:
        """Nominal poses at some rows; NaN where a closed loop does not close."""
        return nominal_poses(self.model, self.campaign.q[rows])

    def usable(
        self, rows: Int[np.ndarray, " k"] | None = None
    ) -> tuple[Int[np.ndarray, " u"], Float[np.ndarray, "u 4 4"]]:
        """Measured rows at which a closed loop closes, of some or all, and their nominal poses."""
        rows = np.arange(len(self.campaign)) if rows is None else rows
        T = self.poses(rows)
        usable = np.isfinite(T[:, 0, 3]) & self.campaign.seen[rows]
        return rows[usable], T[usable]


@dataclass(frozen=True, eq=False, kw_only=True)
class Hypothesis:
    """One mistake, undone: in the joints, in the measurements, or in the robot."""

    id: str
    subject: tuple[str, ...]
    fix: str
    """One line that mends it."""
    joints: JointMap | None = None
    """Joint positions as they should be, from those as they are."""
    measured: Callable[[Campaign], Campaign] | None = None
    robot: Robot | None = None
    size: float = 1.0
    """Factor of the points' size; an error counts beside it."""
    cost: float = 0.0
    """How much rarer it is than others, as a logarithm; decides where several leave the same error."""

    def undo(self, case: Case) -> Case:
        """The case without the mistake."""
        if self.robot is not None:
            return Case.of(self.robot, case.campaign)
        if self.measured is not None:
            return replace(case, campaign=self.measured(case.campaign))
        assert self.joints is not None
        # how the wrong joints were approached says nothing of the right ones
        conditions = replace(case.campaign.conditions, approach=None, move=None)
        q = np.ascontiguousarray(self.joints(case.campaign.q))
        return replace(case, campaign=replace(case.campaign, q=q, conditions=conditions))


def nominal_poses(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
    """Nominal poses; NaN where a closed loop does not close."""
    drive = model.robot.four_bar
    if drive is None:
        return model.poses(q)
    closes = drive.closes(q, np.zeros(3))
    T = np.full((len(q), 4, 4), np.nan)
    if closes.any():
        T[closes] = model.poses(q[closes])
    return T


# All mistakes that are looked for.

Part = Literal["joints", "frames", "robot", "order", "rows", "drift", "poses", "images"]
"""What a mistake is of."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Mistake:
    """One mistake that the doctor knows."""

    id: str
    part: Part
    find: Callable[..., Any]
    """Finds it: a function from the case to hypotheses, where it is one of how things were written."""
    without_tracker: bool = False
    """Whether it is tried by itself on observations that take long to register."""
    measured_anew: bool = False
    """Whether only other measurements mend it, and no change of the file or of the robot."""


MISTAKES: dict[str, Mistake] = {}
"""Every mistake by its id, in the order in which they are defined; `diagnose` imports the modules that define them."""

Finder = TypeVar("Finder", bound=Callable[..., Any])


def looked_for(
    part: Part, *ids: str, without_tracker: bool = False, measured_anew: bool = False
) -> Callable[[Finder], Finder]:
    """Decorator: enter the mistakes that a function or class finds, with their texts to be in ``taskcal_studio/texts.toml``."""

    def enter(find: Finder) -> Finder:
        for name in ids:
            MISTAKES[name] = Mistake(
                id=name, part=part, find=find, without_tracker=without_tracker, measured_anew=measured_anew
            )
        return find

    return enter


def hypotheses_of(case: Case, *parts: Part) -> Iterator[Hypothesis]:
    """Every mistake of some parts that may have been written into a case, one at a time.

    Raises:
        ValueError: a function yields one that its decorator does not name.
    """
    for part in parts:
        for find in dict.fromkeys(mistake.find for mistake in MISTAKES.values() if mistake.part == part):
            for hypothesis in find(case):
                if hypothesis.id not in MISTAKES:
                    raise ValueError(f"{find.__name__} yields '{hypothesis.id}', which its @looked_for does not name")
                yield hypothesis


# One mistake that was found.


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A mistake, what it concerns, and what mends it."""

    id: str
    """One of `MISTAKES`."""
    subject: tuple[str, ...]
    """The joints, targets, rows (by their id) or robots."""
    error_before: float | None
    """Median distance between measured points and the registered robot as given, metres; of what happened in the course of the
    campaign the root mean square, the geometry free within its tolerances. None where there are too few rows."""
    error_after: float | None
    """The same without the mistake, and those found with it; None where nothing that was tried lowers it."""
    confidence: float
    """0 to 1; see `diagnose`."""
    fix: str
    """One line that mends it."""
    alternative: bool = False
    """Whether it explains the campaign in place of those before it, nearly as well; the mended campaign still has it."""

    def as_json(self) -> dict[str, Any]:
        """The entry that ``taskcal doctor --json`` prints."""
        return {
            "id": self.id,
            "subject": list(self.subject),
            "error_before_mm": None if self.error_before is None else self.error_before * 1e3,
            "error_after_mm": None if self.error_after is None else self.error_after * 1e3,
            "confidence": self.confidence,
            "fix": self.fix,
            "alternative": self.alternative,
        }
