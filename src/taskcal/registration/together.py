"""Registrations of many campaigns of one target at once, as `registration` finds each by itself.

All steps are those of one campaign, over a leading axis of campaigns; each is damped and ends by itself.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from taskcal.geometry import se3
from taskcal.geometry.point_registration import HELD, LEAST_DAMPING, NEARLY_NOTHING, OFFSET_PULL
from taskcal.geometry.point_registration import MAX_STEPS as REFINEMENTS
from taskcal.registration.consensus import FAR_SIGMAS, MAX_STEPS, TRACKER_NOISE, TRUSTED_SHARE
from taskcal.registration.registration import LOCATED_WITHIN, MINORITY_SHARE, PLAUSIBLE_SHARE, STRAIGHT_SHARE


@dataclass(frozen=True, eq=False, kw_only=True)
class Registrations:
    """Tracker frames and targets, and where they can be relied on."""

    T_tracker_base: Float[np.ndarray, "robots 4 4"]
    target: Float[np.ndarray, "robots 3"]
    """In the tool frame, metres."""
    unobservable: Float[np.ndarray, "robots 3 3"]
    """Projectors onto the directions in which the poses do not tell where the target is."""
    sound: Bool[np.ndarray, " robots"]
    """Whether all rows agree, and joints and points belong together: else the campaign has to be looked at by itself."""


def register_together(
    T: Float[np.ndarray, "robots n 4 4"], y: Float[np.ndarray, "robots n 3"], reach: float, target_within: float
) -> Registrations:
    """Tracker frame and target of every campaign.

    Args:
        T: poses of the nominal tool in the base.
        y: measured points of one target, metres, none of them missing.
        reach: of the robot, metres.
        target_within: how far from the tool point a target may be, metres.
    """
    cloud = _Cloud(np.ascontiguousarray(T[..., :3, :3]), np.ascontiguousarray(T[..., :3, 3]), y)
    moments = _Moments.of(cloud)
    placed = _place(cloud, moments, _closed_form(moments))
    distance = _distances(cloud, placed)
    extent = np.sqrt(np.linalg.eigvalsh(moments.yy)[:, 1].clip(min=0.0) / y.shape[1])
    sound = (
        _all_agree(cloud, placed.Z, distance)
        & (_rms(distance) <= PLAUSIBLE_SHARE * reach)
        & (extent >= STRAIGHT_SHARE * reach)
        & (np.linalg.norm(placed.target, axis=1) <= target_within)
    )
    return Registrations(
        T_tracker_base=se3.pose(placed.Z, placed.t), target=placed.target, unobservable=placed.unobservable, sound=sound
    )


class _Cloud(NamedTuple):
    """Measured points beside the tool poses at which they were measured."""

    R: Float[np.ndarray, "robots n 3 3"]
    p: Float[np.ndarray, "robots n 3"]
    y: Float[np.ndarray, "robots n 3"]


class _Placed(NamedTuple):
    Z: Float[np.ndarray, "robots 3 3"]
    """Rotation …"""
    t: Float[np.ndarray, "robots 3"]
    """… and translation from base to tracker."""
    target: Float[np.ndarray, "robots 3"]
    unobservable: Float[np.ndarray, "robots 3 3"]


def _place(cloud: _Cloud, moments: "_Moments", start: Float[np.ndarray, "robots 3 3"]) -> _Placed:
    """Frames and targets that fit best; targets at the tool point along directions that the poses do not tell."""
    Z = _refine(start, moments)
    t, target = _offsets(moments, Z, np.zeros(Z.shape))
    unobservable = _unobservable(cloud.R, _rms(_distances(cloud, _Placed(Z, t, target, Z))))
    t, target = _offsets(moments, Z, unobservable)
    return _Placed(Z, t, target, unobservable)


def _offsets(
    moments: "_Moments", Z: Float[np.ndarray, "robots 3 3"], held: Float[np.ndarray, "robots 3 3"]
) -> tuple[Float[np.ndarray, "robots 3"], Float[np.ndarray, "robots 3"]]:
    """Translations and targets that are best for rotations, the targets zero along the directions that are held."""
    M = np.swapaxes(Z, -1, -2).reshape(-1, 9, 1)
    o = np.linalg.solve(moments.pulled + HELD * held, moments.by_offset_T @ M - moments.pull[..., None])
    t = moments.y_mean[..., None] - Z @ (moments.p_mean[..., None] + moments.R_mean @ o)
    return t[..., 0], o[..., 0]


def _distances(cloud: _Cloud, at: _Placed) -> Float[np.ndarray, "robots n"]:
    """How far every point is from where the nominal robot has it, metres."""
    R, p, y = cloud
    off = y - (p + (R @ at.target[:, None, :, None])[..., 0]) @ np.swapaxes(at.Z, -1, -2) - at.t[:, None]
    return np.sqrt((off**2).sum(axis=2))


def _rms(distance: Float[np.ndarray, "robots n"]) -> Float[np.ndarray, " robots"]:
    return np.sqrt((distance**2).mean(axis=1))


def _all_agree(
    cloud: _Cloud, Z: Float[np.ndarray, "robots 3 3"], distance: Float[np.ndarray, "robots n"]
) -> Bool[np.ndarray, " robots"]:
    """Whether `find_consensus` ends with all rows: registered on those that agree best, until these stay the same."""
    robots, n = distance.shape
    trusted = int(np.ceil(TRUSTED_SHARE * n))
    agree, Z = np.zeros(robots, dtype=bool), Z.copy()
    left, rows = np.arange(robots), np.full((robots, trusted), -1)
    for step in range(MAX_STEPS):
        limit = np.maximum(FAR_SIGMAS * np.median(distance, axis=1), TRACKER_NOISE)
        near = distance <= limit[:, None]
        agree[left] = near.all(axis=1) | (near.mean(axis=1) < TRUSTED_SHARE)
        following = np.sort(np.argpartition(distance, trusted - 1, axis=1)[:, :trusted], axis=1)
        moved = (following != rows).any(axis=1)
        left, rows = left[moved], following[moved]
        if not len(left) or step + 1 == MAX_STEPS:
            break
        best = _Cloud(*(array[left[:, None], rows] for array in cloud))
        placed = _place(best, _Moments.of(best), Z[left])
        Z[left] = placed.Z
        distance = _distances(_Cloud(*(array[left] for array in cloud)), placed)
    return agree


@dataclass(frozen=True, eq=False, kw_only=True)
class _Moments:
    """As `Moments`, of every campaign."""

    y_mean: Float[np.ndarray, "robots 3"]
    p_mean: Float[np.ndarray, "robots 3"]
    R_mean: Float[np.ndarray, "robots 3 3"]
    yy: Float[np.ndarray, "robots 3 3"]
    by_offset_T: Float[np.ndarray, "robots 3 9"]
    pull: Float[np.ndarray, "robots 3"]
    pulled: Float[np.ndarray, "robots 3 3"]
    """Information of the offsets, with the slight pull on them."""
    Q: Float[np.ndarray, "robots 9 9"]
    """The quadratic that is left of the rotation."""
    q: Float[np.ndarray, "robots 9"]
    rest: Float[np.ndarray, " robots"]

    @classmethod
    def of(cls, cloud: _Cloud) -> "_Moments":
        R, p, y = cloud
        robots, n = y.shape[:2]
        y_mean, p_mean = y.mean(axis=1), p.mean(axis=1)
        both = np.concatenate([y - y_mean[:, None], p - p_mean[:, None]], axis=2)
        square = np.swapaxes(both, 1, 2) @ both
        turned = (np.swapaxes(R.reshape(robots, n, 9), 1, 2) @ both).reshape(robots, 3, 3, 6)
        by_offset_T = turned[..., :3].transpose(0, 2, 1, 3).reshape(robots, 3, 9)
        pull, total = np.trace(turned[..., 3:], axis1=1, axis2=3), R.sum(axis=1)
        pulled = n * np.eye(3) - np.swapaxes(total, 1, 2) @ total / n + OFFSET_PULL * np.eye(3)
        eliminated = np.linalg.solve(pulled, np.concatenate([by_offset_T, pull[..., None]], axis=2))
        by_offset = np.swapaxes(by_offset_T, 1, 2)
        Q = -by_offset @ eliminated[..., :9]
        for i in range(3):
            Q[:, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += square[:, :3, :3]
        return cls(
            y_mean=y_mean,
            p_mean=p_mean,
            R_mean=total / n,
            yy=square[:, :3, :3],
            by_offset_T=by_offset_T,
            pull=pull,
            pulled=pulled,
            Q=0.5 * (Q + np.swapaxes(Q, 1, 2)),
            q=square[:, 3:, :3].reshape(robots, 9) - (by_offset @ eliminated[..., 9:])[..., 0],
            rest=np.trace(square[:, 3:, 3:], axis1=1, axis2=2) - (pull * eliminated[..., 9]).sum(axis=1),
        )


def _closed_form(moments: _Moments) -> Float[np.ndarray, "robots 3 3"]:
    M = np.linalg.pinv(moments.Q, rcond=NEARLY_NOTHING, hermitian=True) @ moments.q[..., None]
    return np.swapaxes(se3.nearest_rotation(M.reshape(-1, 3, 3)), 1, 2)


def _refine(Z: Float[np.ndarray, "robots 3 3"], moments: _Moments) -> Float[np.ndarray, "robots 3 3"]:
    """Damped Gauss–Newton on every rotation, as `refine` does it on one."""
    M, damping = np.swapaxes(Z, 1, 2).copy(), np.full(len(Z), LEAST_DAMPING)
    left = np.arange(len(Z))
    for _ in range(REFINEMENTS):
        if not len(left):
            break
        Q, q, at = moments.Q[left], moments.q[left, :, None], M[left].reshape(-1, 9, 1)
        K = _by_turn(M[left])
        K_T = np.swapaxes(K, 1, 2)
        H, g = K_T @ Q @ K, K_T @ (q - Q @ at)
        step = np.linalg.solve(H * (1.0 + damping[left, None, None] * np.eye(3)), g)[..., 0]
        turned = _turn(step) @ M[left]
        new = turned.reshape(-1, 9, 1)
        fall = (np.swapaxes(new - at, 1, 2) @ (2.0 * q - Q @ (at + new)))[:, 0, 0]
        better = fall >= 0.0
        M[left[better]] = turned[better]
        damping[left] = np.where(
            better, np.maximum(damping[left] / 10.0, LEAST_DAMPING), np.maximum(damping[left] * 10.0, 1e-3)
        )
        now = M[left].reshape(-1, 9, 1)
        squares = np.maximum((np.swapaxes(now, 1, 2) @ (Q @ now - 2.0 * q))[:, 0, 0] + moments.rest[left], 0.0)
        still = better & (((step**2).sum(axis=1) < 1e-18) | (fall < 1e-12 * squares))
        left = left[~(still | (~better & (damping[left] > 1e3)))]
    return np.swapaxes(M, 1, 2)


def _turn(w: Float[np.ndarray, "robots 3"]) -> Float[np.ndarray, "robots 3 3"]:
    A = np.broadcast_to(np.eye(3), (len(w), 3, 3)).copy()
    x, y, z = 0.5 * w.T
    A[:, 0, 1], A[:, 0, 2], A[:, 1, 0] = -z, y, z
    A[:, 1, 2], A[:, 2, 0], A[:, 2, 1] = -x, -y, x
    return np.linalg.solve(np.swapaxes(A, 1, 2), A)


def _by_turn(M: Float[np.ndarray, "robots 3 3"]) -> Float[np.ndarray, "robots 9 3"]:
    K = np.zeros((len(M), 3, 3, 3))
    K[:, 1, :, 0], K[:, 2, :, 0] = -M[:, 2], M[:, 1]
    K[:, 2, :, 1], K[:, 0, :, 1] = -M[:, 0], M[:, 2]
    K[:, 0, :, 2], K[:, 1, :, 2] = -M[:, 1], M[:, 0]
    return K.reshape(-1, 9, 3)


def _unobservable(
    R: Float[np.ndarray, "robots n 3 3"], rms: Float[np.ndarray, " robots"]
) -> Float[np.ndarray, "robots 3 3"]:
    """Directions that the orientations do not tell, without the few that are turned farthest away from the others."""
    n = R.shape[1]
    low, high = (n - 1) // 2, n // 2
    ordered = np.partition(R, (low, high), axis=1)
    middle = se3.nearest_rotation(0.5 * (ordered[:, low] + ordered[:, high]))
    turned = 3.0 - (middle[:, None] * R).sum(axis=(2, 3))
    last = max(n - max(int(MINORITY_SHARE * n), 1) - 1, 0)
    confirmed = turned <= np.partition(turned, last, axis=1)[:, last, None] + 1e-12
    count, total = confirmed.sum(axis=1)[:, None, None], np.where(confirmed[..., None, None], R, 0.0).sum(axis=1)
    values, vectors = np.linalg.eigh(count * np.eye(3) - np.swapaxes(total, 1, 2) @ total / count)
    weak = np.where((values < (np.maximum(rms, 1e-3) / LOCATED_WITHIN)[:, None] ** 2)[:, None], vectors, 0.0)
    return weak @ np.swapaxes(weak, 1, 2)
