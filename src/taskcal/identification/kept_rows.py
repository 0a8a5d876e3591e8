"""The rows of a campaign about an estimate, kept: a fit of few rows weighs and propagates the same ones again and again."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from taskcal.geometry import se3, walk
from taskcal.geometry.observations import Observations, Walked
from taskcal.measurement.observation.pose import turn_by_rotation

MOST_NUMBERS = 1_000_000
"""Of the derivatives that are kept (8 MB). More are streamed: to read them again would take longer than to work them out."""


class KeptRows(NamedTuple):
    """What was seen, linearised by all that is unknown."""

    valid: Bool[np.ndarray, "n targets"]
    residual: Float[np.ndarray, "seen b"]
    """Measured less predicted, of every target that was seen at a pose."""
    by_entry: Float[np.ndarray, "seen b z"]
    """Derivative of what is predicted."""

    @classmethod
    def of(cls, walked: Walked, seen: Observations) -> "KeptRows":
        """Of points and poses of a tracker, or of observations that are linearised by the twist of the chain's end."""
        if seen.linear is None:
            residual, columns = (rows[seen.valid] for rows in tracker_rows(walked, seen))
            if seen.rotation is not None:
                columns[:, 3:] = turn_by_rotation(residual[:, 3:]) @ columns[:, 3:]
            return cls(seen.valid, residual, columns)
        n, targets, b = seen.linear.residual.shape
        return cls(
            seen.valid,
            seen.linear.residual[seen.valid],
            by_entry(walked, seen).reshape(n, targets, b, -1)[seen.valid],
        )

    def equations(
        self, whitener: Float[np.ndarray, "n targets b b"]
    ) -> tuple[float, Float[np.ndarray, " z"], Float[np.ndarray, "z z"]]:
        """Cost, gradient and information of the squared whitened residuals, as of `normal_equations`."""
        W = whitener[self.valid]
        r = (W @ self.residual[:, :, None]).reshape(-1)
        A = (W @ self.by_entry).reshape(len(r), self.by_entry.shape[2])
        return 0.5 * float(r @ r), A.T @ r, A.T @ A

    def propagate(
        self, covariance: Float[np.ndarray, "z z"]
    ) -> tuple[Float[np.ndarray, "n targets b"], Float[np.ndarray, "n targets b b"]]:
        """Residuals, and the covariance of what is predicted; NaN where nothing was measured. As `propagate` of the geometry."""
        shape, b = self.valid.shape, self.residual.shape[1]
        residual, propagated = np.full((*shape, b), np.nan), np.full((*shape, b, b), np.nan)
        residual[self.valid] = self.residual
        moved = self.by_entry.reshape(self.residual.size, len(covariance)) @ covariance
        propagated[self.valid] = moved.reshape(self.by_entry.shape) @ np.swapaxes(self.by_entry, 1, 2)
        return residual, 0.5 * (propagated + np.swapaxes(propagated, -1, -2))

    def moved(self, step: Float[np.ndarray, " z"]) -> Float[np.ndarray, "n targets b"]:
        """By how much what is predicted moves with a step of the estimate, to first order; zero where nothing was measured."""
        out = np.zeros((*self.valid.shape, self.residual.shape[1]))
        out[self.valid] = self.by_entry @ step
        return out


def by_entry(walked: Walked, seen: Observations) -> Float[np.ndarray, "n m z"]:
    """Derivative of what is predicted by the entries of an estimate, the blocks of a pose's targets one behind another."""
    assert seen.linear is not None
    n, targets, b = seen.linear.residual.shape
    twist = walk.columns(walked.chain, walked.s, walked.e, walked.layout, walked.factor, angular=True)
    out = seen.linear.by_end.reshape(n, targets * b, 6) @ twist
    for t, columns in enumerate(seen.linear.columns):
        own = columns >= 0
        out[:, t * b : (t + 1) * b, columns[own]] += seen.linear.by_unknown[:, t][:, :, own]
    return out


def tracker_rows(
    walked: Walked, seen: Observations
) -> tuple[Float[np.ndarray, "n targets b"], Float[np.ndarray, "n targets b z"]]:
    """Measured less predicted of a tracker's points or poses, and the derivative of what is predicted by the entries of z.

    What belongs to a target that was not seen means nothing. A rotation is derived as a turn of what is predicted.
    """
    T, pose = walk.poses(walked.chain, walked.s, walked.e), seen.rotation is not None
    n, targets, b, points = len(T), seen.valid.shape[1], seen.rows, walked.points
    residual, out = np.empty((n, targets, b)), np.empty((n, targets, b, walked.layout.count))
    for t, offset in enumerate(points.position):
        columns = walk.columns(
            walked.chain, walked.s, walked.e, walked.layout, walked.factor, angular=pose, point=offset
        )
        residual[:, t, :3] = seen.position[:, t] - T[:, :3, 3] - T[:, :3, :3] @ offset
        if seen.rotation is not None:
            turned = seen.rotation @ np.swapaxes(points.turn @ T[:, :3, :3], 1, 2)
            turned[~seen.valid[:, t]] = np.eye(3)
            residual[:, t, 3:] = se3.log(turned)
            columns[:, 3:] = points.turn @ columns[:, 3:]
        if points.columns[t, 0] >= 0:
            columns[:, b - 3 :, points.columns[t]] = points.turning if pose else T[:, :3, :3]
        out[:, t] = columns
    return residual, out
