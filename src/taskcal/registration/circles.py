"""Registration from axis circles: the tracker's frame from the circles that targets describe while one axis turns.

The classical way, as in figure 6 of Gutiérrez et al.: turn one motor after the other; the circles' planes turn the
robot's base, and their centres place it. A motor need not turn the tool about its own axis: behind a parallelogram the
forearm keeps its direction while motor 2 turns, and the TCP describes a circle about a point that is not on
axis 2. So the nominal robot is put through the same fit as the measurements, and like is compared with like.

It leans on the sweeps alone, where `register` uses every pose and the fit refines both frames. It is here to be held
fixed, as published.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.estimation.matrices import single_threaded
from taskcal.geometry import se3
from taskcal.registration.registration import LOCATED_WITHIN, Registration, nominal_poses, place_targets
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr

MIN_ANGLES, MIN_ARC = 4, np.radians(20.0)
"""A circle needs so many different angles, over so large an arc."""

SAME_ANGLE_RAD = np.radians(1e-3)
"""Angle below which a joint has not moved, radians. A convention: a controller shows thousandths of a degree."""

MAX_DEPARTURE = 1e-3
"""How far the nominal tool may leave a circle while one motor turns, metres: a four-bar that is nearly a parallelogram
stays on one; a wrist whose motors are coupled does not."""

MIN_RADIUS = 0.02
"""Radius at least, metres, of a circle that shows its plane. A convention: 0.1 mm of noise across 20 mm tilts a plane by 0.3°."""

PARALLEL_SINE = 0.1
"""Sine of the angle, 6°, between axes up to which they do not turn the base. A convention: the base's turn is uncertain by ten
times theirs there."""

ASSUMED_MODEL_ERROR = 1e-3
"""Distance, metres, of a robot's circle from the nominal one, assumed in judging what the circles place. A convention, of the
size of a nominal robot's error."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class AxisCircle:
    """The circle that a target describes while one axis turns, in the tracker frame."""

    axis: int
    """Which, from 0."""
    target: int
    """Which, from 0."""
    rows: Int[np.ndarray, " k"]
    """Rows of the campaign in which it alone turns."""
    arc: float
    """Over which it turns, radians."""
    normal: Float[np.ndarray, " 3"]
    """Of the circle's plane, in the sense of growing angles."""
    centre: Float[np.ndarray, " 3"]
    """Metres."""
    radius: float
    """Metres."""
    residual: float
    """Root mean square distance of the points from the circle, metres."""
    nominal_normal: Float[np.ndarray, " 3"]
    """Of the nominal robot's circles, in the base."""
    nominal_centre: Float[np.ndarray, "3 4"]
    """Of the nominal robot's circle in the base, for a target at o in the tool frame: this · (o, 1)."""
    weight: tuple[float, float]
    """Of normal and centre: the inverse of their variances, for points with unit variance."""


@single_threaded
def register_from_circles(model: ErrorModel, campaign: Campaign) -> Registration:
    """The tracker frame from the circles of all axes that were swept, and the targets from all rows.

    Args:
        model: the robot's model.
        campaign: measured points, among them rows in which one axis turns alone, for two or more axes.

    Raises:
        CampaignError: poses were measured, there are too few sweeps, or they leave the base free.
    """
    circles = find_circles(model, campaign)
    Z = _turn_base(circles, model)
    base = se3.pose(Z, _place_base(circles, Z, len(campaign.targets), model))
    return replace(place_targets(model, campaign, base), method="circles")


def find_circles(model: ErrorModel, campaign: Campaign) -> tuple[AxisCircle, ...]:
    """The circles of all axes that were swept, each from the largest set of rows in which it alone turns.

    An axis is alone in turning where no other motor moves, or where nothing else moves in the chain.

    Raises:
        CampaignError: poses were measured, or no axis was swept.
    """
    if campaign.rotations is not None:
        raise CampaignError("axis circles are made of points; this campaign measured poses")
    T = nominal_poses(model, campaign)
    s = model.walk(campaign.q).s
    seen = np.asarray(campaign.valid)
    circles = [
        circle
        for axis, joint in enumerate(model.robot.joints)
        for target in range(len(campaign.targets))
        if joint.kind != "prismatic"
        and len(rows := _sweep(campaign.q, s, axis, seen[:, target], T)) > 0
        and (circle := _measure(campaign.points[rows, target], s[rows, axis], T[rows], axis, target, rows)).radius
        > MIN_RADIUS
    ]
    if not circles:
        raise CampaignError(
            f"no {MIN_ANGLES} rows over at least {np.degrees(MIN_ARC):.0f}° in which only one axis turns and a target is seen "
            f"{MIN_RADIUS * 1e3:.0f} mm or more away from it; measure such sweeps, one axis after the other, or register from "
            "all poses, which needs none"
        )
    return tuple(circles)


def _sweep(
    q: Float[np.ndarray, "n joints"],
    s: Float[np.ndarray, "n coordinates"],
    axis: int,
    seen: Bool[np.ndarray, " n"],
    T: Float[np.ndarray, "n 4 4"],
) -> Int[np.ndarray, " k"]:
    """The largest set of rows in which one axis turns alone, over a sufficient arc; empty if there is none."""
    best = np.zeros(0, dtype=np.int64)
    for positions in (q, s):
        others = np.delete(positions, axis, axis=1)
        for i in np.flatnonzero(seen):
            alike = np.flatnonzero((np.abs(others - others[i]) < SAME_ANGLE_RAD).all(axis=1) & seen)
            if len(alike) > len(best) and _suffices(s[alike, axis]) and _is_round(T[alike], s[alike, axis]):
                best = alike
    return best


def _suffices(angle: Float[np.ndarray, " k"]) -> bool:
    different = 1 + int((np.diff(np.sort(angle)) > SAME_ANGLE_RAD).sum())
    return bool(different >= MIN_ANGLES and np.ptp(angle) >= MIN_ARC)


def _is_round(T: Float[np.ndarray, "k 4 4"], angle: Float[np.ndarray, " k"]) -> bool:
    """Whether the TCP, and points a metre from it, stay on circles."""
    y = T[:, :3].reshape(len(T), -1)
    A = _circular(angle)
    return bool(np.abs(y - A @ np.linalg.lstsq(A, y, rcond=None)[0]).max() < MAX_DEPARTURE)


def _circular(angle: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 3"]:
    """Points at known angles of a circle: y = c + cos·u + sin·v is linear in c, u and v."""
    return np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)


def _measure(
    y: Float[np.ndarray, "k 3"],
    angle: Float[np.ndarray, " k"],
    T: Float[np.ndarray, "k 4 4"],
    axis: int,
    target: int,
    rows: Int[np.ndarray, " k"],
) -> AxisCircle:
    """The measured circle, and the nominal robot's by the same fit."""
    A = _circular(angle)
    solve = np.linalg.pinv(A)
    c, u, v = solve @ y
    nominal = np.einsum("ak,kij->aij", solve, T[:, :3])
    # TCP and tool axes turn about one direction; where the tool keeps its orientation, the point alone shows it
    turning = np.cross(nominal[1], nominal[2], axis=0).sum(axis=1)
    normal, unit_covariance = np.cross(u, v), solve @ solve.T
    radius = float(np.sqrt(np.linalg.norm(normal)))
    residual = y - A @ np.stack([c, u, v])
    return AxisCircle(
        axis=axis,
        target=target,
        rows=rows,
        arc=float(np.ptp(angle)),
        normal=normal / max(float(np.linalg.norm(normal)), 1e-300),
        centre=c,
        radius=radius,
        residual=float(np.sqrt((residual**2).sum(axis=1).mean())),
        nominal_normal=turning / np.linalg.norm(turning),
        nominal_centre=nominal[0],
        weight=(radius**2 / float(np.linalg.eigvalsh(unit_covariance[1:, 1:])[-1]), 1.0 / float(unit_covariance[0, 0])),
    )


def _turn_base(circles: tuple[AxisCircle, ...], model: ErrorModel) -> Float[np.ndarray, "3 3"]:
    """The rotation that carries the nominal circles' normals nearest to the measured ones (Kabsch 1976)."""
    normals = np.stack([circle.nominal_normal for circle in circles])
    apart = np.linalg.norm(np.cross(normals[:, None], normals[None]), axis=2)
    if apart.max() < PARALLEL_SINE:
        raise CampaignError(
            f"only {_swept(circles, model)} swept, and one direction does not turn the base; sweep an axis that is not parallel "
            "as well, or register from all poses"
        )
    return se3.nearest_rotation(np.sum([c.weight[0] * np.outer(c.normal, c.nominal_normal) for c in circles], axis=0))


def _place_base(
    circles: tuple[AxisCircle, ...], Z: Float[np.ndarray, "3 3"], targets: int, model: ErrorModel
) -> Float[np.ndarray, " 3"]:
    """Translation of the base: every centre is Z·(c + C·o) + t, linear in t and in the targets' offsets o."""
    A, b = np.zeros((len(circles), 3, 3 + 3 * targets)), np.zeros((len(circles), 3))
    root = np.sqrt([circle.weight[1] for circle in circles])
    for k, circle in enumerate(circles):
        first = 3 + 3 * circle.target
        A[k, :, :3] = root[k] * np.eye(3)
        A[k, :, first : first + 3] = root[k] * (Z @ circle.nominal_centre[:, :3])
        b[k] = root[k] * (circle.centre - Z @ circle.nominal_centre[:, 3])
    flat = A.reshape(-1, 3 + 3 * targets)
    H, g = flat.T @ flat, flat.T @ b.reshape(-1)
    # what the offsets leave of the information on the translation
    eliminated = H[:3, 3:] @ np.linalg.pinv(H[3:, 3:], rcond=1e-10)
    information = H[:3, :3] - eliminated @ H[3:, :3]
    values, vectors = np.linalg.eigh(information)
    if values[0] < (ASSUMED_MODEL_ERROR / LOCATED_WITHIN) ** 2:
        x, y, z = np.abs(Z.T @ vectors[:, 0])
        raise CampaignError(
            f"{_swept(circles, model)} swept, which does not place the base along ({x:.2f}, {y:.2f}, {z:.2f}) of its own frame: "
            "the target's offset along it would do the same; sweep an axis that turns the tool about another direction, or "
            "register from all poses"
        )
    return np.linalg.solve(information, g[:3] - eliminated @ g[3:])


def _swept(circles: tuple[AxisCircle, ...], model: ErrorModel) -> str:
    """The axes of the circles, in words."""
    names = list(dict.fromkeys(model.robot.joint_names[circle.axis] for circle in circles))
    return f"{', '.join(names)} {'was' if len(names) == 1 else 'were'}"
