"""Measured rows in the robot's base: the points, and where the instrument stood that measured them."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.errors import CampaignError, TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.registration.registration import PLAUSIBLE_SHARE, nominal_poses, register_trimmed, trusted_distance
from taskcal.report.scene import AT_ORIGIN
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal_studio.project import Project
from taskcal_studio.results import read_measured
from taskcal_studio.robot_meshes import RobotMeshes, meshes_if_sound


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredRows:
    """Rows of a campaign or a calibration, as a scene shows them."""

    q: Float[np.ndarray, "n joints"]
    """Radians, or metres."""
    points: Float[np.ndarray, "n targets 3"]
    """In the robot's base, metres; NaN where nothing was seen."""
    instruments: Float[np.ndarray, "n 3"] | None = None
    """Where the instrument stood that measured each row, in the base, metres; None where that is not known."""
    in_base: bool = True
    """Whether it is known how the points lie to the robot; else they are in the instrument's frame."""

    @property
    def cloud(self) -> tuple[Float[np.ndarray, "k 3"], Int[np.ndarray, " k"], Int[np.ndarray, " k"]]:
        """All points, and the row and the target of each."""
        rows, targets = np.nonzero(np.isfinite(self.points).all(axis=2))
        return self.points[rows, targets], rows, targets

    @property
    def standing(self) -> Float[np.ndarray, "k 3"]:
        """Every place where an instrument stands."""
        return np.zeros((0, 3)) if self.instruments is None else np.unique(self.instruments, axis=0)

    def at(self, row: int) -> Float[np.ndarray, "k 3"]:
        """The points of a row."""
        return self.points[row][np.isfinite(self.points[row]).all(axis=1)]

    def beams(self, row: int | None) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "k 3"]]:
        """Where the instrument of a row stands, and the points to which its beams go; none on the way between rows."""
        if self.instruments is None or row is None:
            return np.zeros(3), np.zeros((0, 3))
        return self.instruments[row], self.at(row)


def registered_rows(model: ErrorModel, campaign: Campaign) -> MeasuredRows:
    """The rows of a campaign, placed by a registration of the nominal robot that bears wrong rows.

    What was measured without a tracker is where the robot had it.
    """
    seen = np.where(campaign.valid[..., None], campaign.points, np.nan)
    alone = MeasuredRows(q=campaign.q, points=seen, in_base=False)
    try:
        T = nominal_poses(model, campaign)
        registration, distance = register_trimmed(T, campaign, model)
    except CampaignError:
        return alone
    if trusted_distance(distance[campaign.seen]) > PLAUSIBLE_SHARE * model.robot.reach:
        return alone
    tracked = np.array([one.in_tracker for one in campaign.observations])
    ends = (T[:, None] @ registration.T_tool_target)[..., :3, 3]
    points = se3.apply(se3.inverse(registration.T_tracker_base), seen)
    return MeasuredRows(
        q=campaign.q,
        points=np.where(tracked.reshape(-1, 1), points, np.where(campaign.valid[..., None], ends, np.nan)),
        instruments=_instruments(registration.T_tracker_base, campaign.stations, len(campaign), model.robot)
        if tracked.any()
        else None,
    )


def fitted_rows(calibration: Calibration) -> MeasuredRows | None:
    """The rows of a calibration, where it predicts their targets; None where no tracker measured them, or nothing was seen."""
    seen = np.asarray(np.isfinite(calibration.residuals[:, :, :3]).all(axis=2))
    if not calibration.layout.in_tracker or not seen.any():
        return None
    T = calibration.T_tracker_base
    ends = se3.apply(se3.inverse(T), calibration.target_poses(calibration.q)[..., :3, 3])
    return MeasuredRows(
        q=calibration.q,
        points=np.where(seen[..., None], ends, np.nan),
        instruments=_instruments(T, calibration.layout.stations, len(calibration.q), calibration.model.robot),
    )


def _instruments(
    T_tracker_base: Float[np.ndarray, "4 4"], stations: Stations | None, count: int, robot: Robot
) -> Float[np.ndarray, "n 3"] | None:
    """Where the instrument of each row stands; None where its frame is the robot's base, which no tracker stands in."""
    places = np.zeros((count, 3)) if stations is None else stations.T_first_station[stations.of, :3, 3]
    places = se3.apply(se3.inverse(T_tracker_base), places)
    return None if np.linalg.norm(places, axis=1).min(initial=np.inf) < AT_ORIGIN * robot.reach else places


def cell_of(project: Project, robot: Robot) -> tuple[RobotMeshes | None, MeasuredRows | None]:
    """What else a scene of a project's robot can show: its meshes, and the chosen measurements where they fit it."""
    measured = None
    with suppress(TaskcalError):
        if project.choices.campaign:
            campaign = read_measured(project, robot)
            measured = registered_rows(ErrorModel(robot), campaign)
    return meshes_if_sound(project), measured if measured is not None and measured.in_base else None
