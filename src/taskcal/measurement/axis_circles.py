"""Registration from axis circles: the tracker's frame from the circles that targets describe while one axis turns.

The classical way, as in figure 6 of Gutiérrez et al.: turn axis 1 alone, then axis 2 alone; the circles' axes are two
lines of the robot, which place its base, and the tool centre follows. It leans on two axes of the nominal robot alone,
where `register` uses every pose and the fit refines both frames: on the 36 poses of a measured FANUC R-2000iC/165F it
leaves 5.8 mm rms, `register` 0.75. It is here to be held fixed, as published.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError
from taskcal.estimation.blas import single_threaded
from taskcal.geometry import se3, walk
from taskcal.geometry.chain import Chain, Joint
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration, place_targets
from taskcal.robot.error_model import ErrorModel

MIN_ROWS, ARC = 4, np.radians(20.0)
"""A circle needs so many points, over so large an arc."""

SAME_ANGLE_RAD = np.radians(1e-3)
"""A joint that moves less than this has not moved."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AxisLine:
    """An axis of the robot, as its circles show it."""

    axis: int
    """Which, from 0."""
    rows: Int[np.ndarray, " k"]
    """Rows of the campaign in which it alone turns."""
    direction: Float[np.ndarray, " 3"]
    """In the tracker frame, in the sense of growing angles."""
    point: Float[np.ndarray, " 3"]
    """A point of the axis, metres."""
    residual: float
    """Root mean square distance of the points from their circles, metres."""


@single_threaded
def register_from_circles(model: ErrorModel, campaign: Campaign) -> Registration:
    """The tracker frame from the circles of the first two axes, and the targets from all rows.

    Args:
        model: the robot's model.
        campaign: measured points, among them rows in which only axis 1 turns, and rows in which only axis 2 does.

    Raises:
        CampaignError: poses were measured, there are no such rows, or the two axes are parallel.
    """
    if campaign.rotations is not None:
        raise CampaignError("axis circles are made of points; this campaign measured poses")
    s = model.walk(campaign.q).s
    lines = [find_axis(model, campaign, s, axis) for axis in (0, 1)]
    nominal = [_nominal_axis(model, s[line.rows[0]], line.axis) for line in lines]
    if np.linalg.norm(np.cross(nominal[0][0], nominal[1][0])) < 0.1:
        raise CampaignError(
            f"axes 1 and 2 of {model.robot.name} are parallel, which does not place the base; use register"
        )
    Z = _rotation([a for a, _ in nominal], [line.direction for line in lines])
    A, b = np.zeros((3, 3)), np.zeros(3)
    for line, (_, point) in zip(lines, nominal, strict=True):
        across = np.eye(3) - np.outer(line.direction, line.direction)
        A += across
        b += across @ (line.point - Z @ point)
    return place_targets(model, campaign, se3.pose(Z, np.linalg.solve(A, b)))


def find_axis(model: ErrorModel, campaign: Campaign, s: Float[np.ndarray, "n coordinates"], axis: int) -> AxisLine:
    """The line of an axis, from the largest set of rows in which it alone turns.

    Raises:
        CampaignError: there is no such set.
    """
    if model.robot.joints[axis].kind == "prismatic":
        raise CampaignError(f"axis {axis + 1} of {model.robot.name} slides, so it describes no circle; use register")
    rows = _sweep(np.delete(s, axis, axis=1), s[:, axis], np.asarray(campaign.valid.all(axis=1)))
    if len(rows) < MIN_ROWS:
        raise CampaignError(
            f"no {MIN_ROWS} rows over at least {np.degrees(ARC):.0f}° in which only axis {axis + 1} turns and every target is "
            f"seen (at most {len(rows)}); "
            "measure such a sweep, or use register, which needs none"
        )
    directions, points, residuals = zip(
        *(_circle(campaign.points[rows, t], s[rows, axis]) for t in range(len(campaign.targets))),
        strict=True,
    )
    direction = np.mean(directions, axis=0)
    return AxisLine(
        axis=axis,
        rows=rows,
        direction=direction / np.linalg.norm(direction),
        point=np.mean(points, axis=0),
        residual=float(np.sqrt(np.mean(np.square(residuals)))),
    )


def _sweep(
    others: Float[np.ndarray, "n rest"], angle: Float[np.ndarray, " n"], seen: Bool[np.ndarray, " n"]
) -> Int[np.ndarray, " k"]:
    """The largest set of rows with the other coordinates alike and the angle over a sufficient arc."""
    best = np.zeros(0, dtype=np.int64)
    for i in range(len(angle)):
        alike = np.flatnonzero((np.abs(others - others[i]) < SAME_ANGLE_RAD).all(axis=1) & seen)
        if len(alike) > len(best) and np.ptp(angle[alike]) >= ARC:
            best = alike
    return best


def _circle(
    y: Float[np.ndarray, "k 3"], angle: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"], float]:
    """Axis direction, centre and residual of points at known angles: y = c + cos·u + sin·v is linear in c, u and v."""
    A = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    c, u, v = np.linalg.lstsq(A, y, rcond=None)[0]
    normal = np.cross(u, v)
    residual = y - A @ np.stack([c, u, v])
    return normal / np.linalg.norm(normal), c, float(np.sqrt((residual**2).sum(axis=1).mean()))


def _nominal_axis(
    model: ErrorModel, s: Float[np.ndarray, " coordinates"], axis: int
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Direction and a point of a joint's axis in the base, at chain coordinates s."""
    steps = model.robot.steps()
    joints = [k for k, step in enumerate(steps) if isinstance(step, Joint)]
    chain = Chain.of(steps[: joints[axis]])
    T = walk.poses(chain, np.ascontiguousarray(s[None, :axis]), np.zeros((0, 6)))[0]
    return T[:3, 2], T[:3, 3]


def _rotation(nominal: list[np.ndarray], measured: list[np.ndarray]) -> Float[np.ndarray, "3 3"]:
    """The rotation that carries nominal directions nearest to measured ones (Kabsch 1976)."""
    a = np.stack([*nominal, np.cross(nominal[0], nominal[1])])
    b = np.stack([*measured, np.cross(measured[0], measured[1])])
    return se3.nearest_rotation(b.T @ a)
