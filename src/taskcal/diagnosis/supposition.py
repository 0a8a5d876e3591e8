"""What may have been written wrong: a supposition undoes it, and says in one line how a user does."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.diagnosis.open_limits import open_limits
from taskcal.measurement.campaign import Campaign
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot


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

    def poses(self, rows: Int[np.ndarray, " k"]) -> Float[np.ndarray, "k 4 4"]:
        """Nominal poses at some rows; NaN where a closed loop does not close."""
        return nominal_poses(self.model, self.campaign.q[rows])


@dataclass(frozen=True, eq=False, kw_only=True)
class JointMap:
    """Joint positions as they should be, M·q + shift."""

    matrix: Float[np.ndarray, "joints joints"]
    shift: Float[np.ndarray, " joints"]

    def __call__(self, q: Float[np.ndarray, "*n joints"]) -> Float[np.ndarray, "*n joints"]:
        """The positions as they should be."""
        return q @ self.matrix.T + self.shift

    def after(self, first: "JointMap") -> "JointMap":
        """Both, the other one first."""
        return JointMap(matrix=self.matrix @ first.matrix, shift=self.matrix @ first.shift + self.shift)


@dataclass(frozen=True, eq=False, kw_only=True)
class Supposition:
    """One mistake, undone: in the joints, in the measurements, or in the robot."""

    id: str
    subject: tuple[str, ...]
    fix: str
    """One line that mends it."""
    joints: JointMap | None = None
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
