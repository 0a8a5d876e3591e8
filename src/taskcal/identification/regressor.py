"""What the remainder of a calibration may go with: quantities that vary from pose to pose, and what each would move."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.measurement.campaign import Campaign

MIN_VARIATION = 1e-6
"""A quantity that varies less than this, in SI units, is constant."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Regressor:
    """A quantity, and the directions in which the tool would move with it."""

    name: str
    moves: str
    """What it would move: ``turn of J2``, ``tool in base axes`` …"""
    values: Float[np.ndarray, "n parts"]
    """Of the quantity at each pose, SI units; several parts act one beside the other."""
    carrier: Float[np.ndarray, "n 3 directions"]
    """Movement of the measured point for a unit along each direction, in base axes."""
    unit: str
    """In which the quantity is shown."""
    scale: float
    """From SI to that unit."""
    smooth: bool = True
    """Whether any smooth function of it is meant; else a multiple of it."""


def list_regressors(calibration: Calibration, campaign: Campaign) -> tuple[Regressor, ...]:
    """All quantities that a campaign tells and that vary in it.

    The turn of a joint may go with its own angle (gears, encoders), with gravity's lever about its axis (what the drive
    yields, beyond a straight line too), with the side it was approached from (lost motion) and with its last move (a rest
    of it). The tool may move with the order of measurement and the temperature (drift), with its own tilt (bending), and
    along the beam with the distance from the tracker (the tracker's scale).

    Args:
        calibration: whose remainder it is.
        campaign: the measurements.
    """
    T = calibration.tool_in_base(campaign.q, campaign.conditions)
    # of the mean of the targets
    arm = np.einsum("nij,j->ni", T[:, :3, :3], calibration.T_tool_target[:, :3, 3].mean(axis=0))
    gravity = calibration.model.robot.statics.gravity
    regressors = [
        *_of_joints(calibration, campaign, arm),
        *_of_time(campaign),
        Regressor(
            name="tilt of the tool",
            moves="tool in its own axes",
            values=np.einsum("nji,j->ni", T[:, :3, :3], gravity),
            carrier=T[:, :3, :3],
            unit="of gravity",
            scale=1.0,
        ),
        _of_distance(calibration, T[:, :3, 3] + arm),
    ]
    return tuple(r for r in regressors if np.ptp(r.values, axis=0).max() > MIN_VARIATION)


def _of_joints(calibration: Calibration, campaign: Campaign, arm: Float[np.ndarray, "n 3"]) -> Iterator[Regressor]:
    """Position, gravity's lever, approach and last move of every joint, each of which would turn it."""
    robot, q = calibration.model.robot, campaign.q
    columns = se3.carry(calibration.model.joint_jacobian(q, calibration.estimate), arm)[:, :3]
    lever = np.einsum("i,nij->nj", robot.statics.gravity, columns)
    for j, joint in enumerate(robot.joint_names):
        slides = bool(robot.prismatic[j])
        moves, carrier = f"{'shift' if slides else 'turn'} of {joint}", columns[:, :, j : j + 1]
        yield Regressor(
            name=f"position of {joint}",
            moves=moves,
            values=q[:, j : j + 1],
            carrier=carrier,
            unit="mm" if slides else "°",
            scale=1e3 if slides else 180.0 / np.pi,
        )
        yield Regressor(
            name=f"gravity on {joint}",
            moves=moves,
            values=lever[:, j : j + 1],
            carrier=carrier,
            unit="m of lever",
            scale=1.0,
        )
        if campaign.approach is not None:
            yield Regressor(
                name=f"approach of {joint}",
                moves=moves,
                values=campaign.approach[:, j : j + 1],
                carrier=carrier,
                unit="side",
                scale=1.0,
                smooth=False,
            )
        if campaign.move is not None:
            yield Regressor(
                name=f"last move of {joint}",
                moves=moves,
                values=campaign.move[:, j : j + 1],
                carrier=carrier,
                unit="mm" if slides else "°",
                scale=1e3 if slides else 180.0 / np.pi,
            )


def _of_time(campaign: Campaign) -> Iterator[Regressor]:
    """Order and temperature, which would move the whole tool."""
    axes = np.broadcast_to(np.eye(3), (len(campaign), 3, 3))
    order = np.arange(len(campaign), dtype=float)[:, None]
    yield Regressor(
        name="order of measurement", moves="tool in base axes", values=order, carrier=axes, unit="row", scale=1.0
    )
    warmth = campaign.temperature
    if warmth is not None and np.isfinite(warmth).all():
        yield Regressor(
            name="temperature", moves="tool in base axes", values=warmth[:, None], carrier=axes, unit="°C", scale=1.0
        )


def _of_distance(calibration: Calibration, point: Float[np.ndarray, "n 3"]) -> Regressor:
    """From the tracker, which stands in the origin of its frame."""
    beam = point - se3.inverse(calibration.T_tracker_base)[:3, 3]
    distance = np.linalg.norm(beam, axis=1, keepdims=True)
    return Regressor(
        name="distance from the tracker",
        moves="tool along the beam",
        values=distance,
        carrier=(beam / distance)[:, :, None],
        unit="mm",
        scale=1e3,
    )
