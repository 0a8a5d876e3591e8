"""What no parameter explains at a single pose: the tracker's noise, a white error of the target, and one of every joint.

A joint that stands a little off turns and shifts all that it carries, so that errors of position and rotation, and of several
targets, belong together:

    R_i = N_i + σ_p²·1 + σ_r²·1 + Σ_j σ_j² c_ij·c_ijᵀ,   c_ij the movement of all that was measured at pose i by joint j

The variances are those of the largest marginal likelihood, by Fisher scoring on their logarithms in turn with the estimate;
the information is that of single poses, without what poses have in common through the estimate.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.identification.linearisation import Linearisation

TYPICAL, WIDTH = 5e-5, 3.0
"""Expected standard deviation, metres and radians: what industrial robots repeat to; and that of its square's logarithm."""

FREEDOM = 8.0
"""Degrees of freedom of the t-distribution that single poses' errors are expected to have."""

LEAST = 1e-14
"""Variance under which there is nothing, m² and rad²."""

LONGEST_STEP = 1.5
"""Of a logarithm in one step."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RowErrors:
    """Variances of what single poses add."""

    position: float
    """Of each axis, m²."""
    rotation: float | None
    """Of each axis, rad²; None where points were measured."""
    joints: Float[np.ndarray, " joints"]
    """Of every joint, rad² (m² where it slides)."""
    searched: bool = True
    """Whether they are estimated."""

    @property
    def variances(self) -> Float[np.ndarray, " k"]:
        """All of them, one behind another."""
        own = [self.position] if self.rotation is None else [self.position, self.rotation]
        return np.array([*own, *self.joints])

    def with_variances(self, variances: Float[np.ndarray, " k"]) -> "RowErrors":
        """The same with other values."""
        first = 1 if self.rotation is None else 2
        rotation = None if self.rotation is None else float(variances[1])
        return replace(self, position=float(variances[0]), rotation=rotation, joints=variances[first:])

    def parts(self, at: Linearisation) -> list[Float[np.ndarray, "n m m"]]:
        """Covariance of every pose for a unit of each variance."""
        n, m = at.residual.shape
        b = 3 if self.rotation is None else 6
        own = [np.arange(m) % b < 3] if self.rotation is None else [np.arange(m) % b < 3, np.arange(m) % b >= 3]
        parts: list[np.ndarray] = [np.broadcast_to(np.diag(mask.astype(float)), (n, m, m)) for mask in own]
        columns = np.moveaxis(at.by_joint, 2, 0)
        return parts + [c[:, :, None] * c[:, None, :] for c in columns]

    def covariance(self, at: Linearisation, noise: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n m m"]:
        """Of every pose; the identity where nothing was seen."""
        n, targets, b = noise.shape[:3]
        R = np.zeros((n, targets * b, targets * b))
        for t in range(targets):
            R[:, t * b : (t + 1) * b, t * b : (t + 1) * b] = noise[:, t]
        for variance, part in zip(self.variances, self.parts(at), strict=True):
            R += variance * part
        both = at.seen[:, :, None] & at.seen[:, None, :]
        return np.where(both, R, np.eye(targets * b))


def rescore(
    errors: RowErrors,
    at: Linearisation,
    whitener: Float[np.ndarray, "n m m"],
    left: Float[np.ndarray, "n m"],
    explained: Float[np.ndarray, "n m m"],
) -> RowErrors:
    """One step of the scoring.

    Args:
        errors: the variances so far.
        at: the rows.
        whitener: W with W·R·Wᵀ = 1 at every pose.
        left: whitened residuals of the estimate, with the weights of the poses.
        explained: covariance of what the estimate predicts of each pose, likewise.
    """
    variances = errors.variances
    own = np.eye(left.shape[1]) - explained
    white = [whitener @ part @ np.swapaxes(whitener, 1, 2) for part in errors.parts(at)]
    judged = [own @ part for part in white]
    gradient = np.array([
        0.5 * (np.einsum("ni,nij,nj", left, part, left) - np.trace(seen, axis1=1, axis2=2).sum())
        for part, seen in zip(white, judged, strict=True)
    ])  # fmt: skip
    flat = np.array([seen.reshape(-1) for seen in judged])
    turned = np.array([np.swapaxes(seen, 1, 2).reshape(-1) for seen in judged])
    information = 0.5 * (flat @ turned.T) * np.outer(variances, variances) + np.eye(len(variances)) / WIDTH**2
    gradient = gradient * variances - np.log(variances / TYPICAL**2) / WIDTH**2
    step = np.clip(np.linalg.solve(information, gradient), -LONGEST_STEP, LONGEST_STEP)
    return errors.with_variances(np.maximum(variances * np.exp(step), LEAST))


def weigh(square: Float[np.ndarray, " n"], numbers: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """What a pose counts whose error has this squared length in units of its covariance, made up of so many numbers.

    Errors of real robots have longer tails than normal ones: each pose's covariance is divided by a weight of its own, drawn
    from a gamma distribution of mean 1, so that errors are t-distributed with `FREEDOM` degrees of freedom (Lange, Little and
    Taylor 1989, Journal of the American Statistical Association 84).
    """
    return (FREEDOM + numbers) / (FREEDOM + square)


def log_weights(weights: Float[np.ndarray, " n"]) -> float:
    """Log density of weights, but for what it is where all are 1."""
    return float(0.5 * FREEDOM * (np.log(weights) - weights + 1.0).sum())


def of_targets(blocks: Float[np.ndarray, "n m m"], targets: int) -> Float[np.ndarray, "n targets b b"]:
    """The block of each target alone."""
    width = blocks.shape[1] // targets
    parts = [slice(t * width, (t + 1) * width) for t in range(targets)]
    return np.stack([blocks[:, part, part] for part in parts], axis=1)


def whiteners(R: Float[np.ndarray, "n m m"]) -> Float[np.ndarray, "n m m"]:
    """Lower triangular W with W·R·Wᵀ = 1 at every pose."""
    return np.linalg.inv(np.linalg.cholesky(R))
