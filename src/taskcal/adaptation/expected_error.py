"""The error to be expected over a task from a campaign and a choice of parameters, in closed form.

The truth is an over-complete model with prior Σ₀; the parameters outside a kept set K act on the measurements, but the
estimator x̂_K = G·y does not know them. With A = JᵀR⁻¹J of the campaign, L = A_KK + Σ₀_KK⁻¹, F its inverse (zero outside K)
and M = F·A, the covariance of the estimate's error is

    C(K) = (I − M)·Σ₀·(I − M)ᵀ + F·A·F = Σ₀ − F·D − Dᵀ·F + F·B·F,   D = A·Σ₀,  B = A·Σ₀·A + A

and the mean squared error over the task is tr(W·C), W the mean of J_tᵀJ_t. Tracker frame and targets are always estimated
and nothing is known of them beforehand: they are eliminated first (Schur complement), which leaves the error of the
predicted target in the tracker's frame. Leaving them out would count the base's arbitrary placement as an error.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from taskcal.adaptation.nested_models import order_of_dropping
from taskcal.estimation.scaled import pseudo_invert_scaled
from taskcal.geometry.covariance_propagation import propagate
from taskcal.geometry.normal_equations import normal_equations
from taskcal.identification.belief import frame_precision
from taskcal.identification.linearisation import linearise_rows
from taskcal.identification.observation_layout import layout_of, problem_of
from taskcal.identification.problem import FrameLayout, whitener
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import register
from taskcal.measurement.tracker import TrackerNoise
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.task.task import TaskPoses


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Design:
    """What a campaign says of the parameters, and how they move the task, tracker frame and targets eliminated."""

    model: ErrorModel
    information: Float[np.ndarray, "p p"]
    """A of the campaign."""
    influence: Float[np.ndarray, "p p"]
    """W of the task, m² per parameter unit squared."""
    prior: Float[np.ndarray, " p"]
    """Prior standard deviations, metres and radians."""
    frames: float
    """Mean squared error that the noise in tracker frame and targets adds, m²."""
    layout: FrameLayout
    free: Int[np.ndarray, " f"]
    """Columns of tracker frame and targets that the campaign estimates."""
    follow: Float[np.ndarray, "f p"]
    """How they follow the parameters."""
    frame_covariance: Float[np.ndarray, "f f"]
    """What the noise makes of them."""

    @cached_property
    def before(self) -> float:
        """Expected rms error in space with frames alone fitted, metres."""
        return float(np.sqrt(np.sum(np.diag(self.influence) * self.prior**2) + self.frames))

    def gain(self, kept: Int[np.ndarray, " k"]) -> Float[np.ndarray, "p p"]:
        """F of a kept set."""
        p = len(self.prior)
        F = np.zeros((p, p))
        if len(kept):
            scale = self.prior[kept]
            L = self.information[np.ix_(kept, kept)] * scale * scale[:, None] + np.eye(len(kept))
            F[np.ix_(kept, kept)] = np.linalg.inv(L) * scale * scale[:, None]
        return F

    def error_covariance(self, kept: Int[np.ndarray, " k"]) -> Float[np.ndarray, "p p"]:
        """C of a kept set."""
        F = self.gain(kept)
        rest = np.eye(len(self.prior)) - F @ self.information
        return (rest * self.prior**2) @ rest.T + F @ self.information @ F

    def expected_error(self, kept: Int[np.ndarray, " k"]) -> float:
        """Expected rms error in space over the task, metres."""
        return float(np.sqrt(np.sum(self.influence * self.error_covariance(kept)) + self.frames))

    def expected_at(
        self, q: Float[np.ndarray, "n joints"], kept: Int[np.ndarray, " k"] | None = None
    ) -> Float[np.ndarray, " n"]:
        """Expected rms error in space at single poses, mean over the targets, with a kept set identified; none: before."""
        kept = np.zeros(0, dtype=np.int64) if kept is None else kept
        z, p, f = len(self.layout.names), len(self.prior), self.free
        covariance = np.zeros((z, z))
        C = self.error_covariance(kept)
        covariance[:p, :p] = C
        covariance[np.ix_(f, np.arange(p))] = -self.follow @ C
        covariance[np.ix_(np.arange(p), f)] = -C @ self.follow.T
        covariance[np.ix_(f, f)] = self.follow @ C @ self.follow.T + self.frame_covariance
        walked = self.layout.walked(np.asarray(q, dtype=float), self.layout.start())
        nowhere = self.layout.nowhere(walked, self.layout.start())
        spread = propagate(walked, nowhere, covariance)[1][..., :3, :3]
        return np.sqrt(np.trace(spread, axis1=2, axis2=3).mean(axis=1))

    def expected_of(self, names: Iterable[str]) -> float:
        """Expected rms error of a model with these parameters, metres."""
        return self.expected_error(self.model.indices(names))

    def ladder(
        self, groups: Sequence[Int[np.ndarray, " _"]] | None = None
    ) -> tuple[list[int], Float[np.ndarray, " sizes"]]:
        """Drop parameters one by one, always the one that is missed least.

        Args:
            groups: parameters that go together; by default each goes alone.

        Returns:
            the groups in the order in which they go, and the expected error before each goes and after the last.
        """
        alone = list(np.arange(len(self.prior))[:, None]) if groups is None else groups
        order, squares = order_of_dropping(self.information, self.influence, self.prior, alone)
        return order, np.sqrt(squares + self.frames)


def design(
    model: ErrorModel,
    campaign: Campaign,
    task: TaskPoses,
    *,
    noise: TrackerNoise | None = None,
    model_error: tuple[float, ...] = (0.0, 0.0),
    joint_error: tuple[float, ...] = (),
    prior: Float[np.ndarray, " p"] | None = None,
) -> Design:
    """The design of a campaign for a task.

    Args:
        model: the over-complete model.
        campaign: the measurements; only where they were made matters here.
        task: the task's poses.
        noise: the tracker's.
        model_error: standard deviation of what the model cannot explain, metres (and radians).
        joint_error: standard deviation of how far each joint stands off at a single pose, radians; empty for none.
        prior: standard deviation of every parameter, metres and radians; the tolerances by default.

    Raises:
        CampaignError: too few rows for the frames.
    """
    registration = register(model, campaign)
    layout = replace(layout_of(model, np.arange(len(model)), registration, campaign, fixed=False), turned=False)
    problem = problem_of(layout, replace(campaign, conditions=Conditions()), noise)
    b = layout.block_size
    covariance = problem.covariance(np.square(model_error[: b // 3]))
    if any(joint_error):
        moved = linearise_rows(problem, layout.start()).by_joint[:, :, : len(joint_error)] * np.array(joint_error)
        moved = moved.reshape(len(moved), -1, b, len(joint_error))
        covariance += moved @ np.swapaxes(moved, 2, 3)
    A = problem.information(layout.start(), whitener(covariance))
    W = _influence(layout, task)
    frames = np.arange(len(model), len(layout.names))
    # directions in which the poses do not locate the targets are held, as in the fit
    A[np.ix_(frames, frames)] += frame_precision(layout)
    return _without_frames(layout, A, W, frames, model.tolerances if prior is None else prior)


def _influence(layout: FrameLayout, task: TaskPoses) -> Float[np.ndarray, "z z"]:
    """Weighted mean of JᵀJ of the targets' positions over the task."""
    n, targets = len(task), len(layout.targets)
    walked = layout.walked(task.q, layout.start())
    weight = np.zeros((n, targets, layout.block_size, layout.block_size))
    weight[..., range(3), range(3)] = np.sqrt(task.weights / targets)[:, None, None]
    return normal_equations(walked, layout.nowhere(walked, layout.start()), weight)[2]


def _without_frames(
    layout: FrameLayout,
    A: Float[np.ndarray, "z z"],
    W: Float[np.ndarray, "z z"],
    f: Int[np.ndarray, " f"],
    prior: Float[np.ndarray, " p"],
) -> Design:
    """Eliminate tracker frame and targets, of which nothing is known beforehand."""
    m = np.arange(len(layout.model))
    # directions that the campaign does not see, as of a target's offset against the base in one orientation, stay at zero
    inverse = pseudo_invert_scaled(A[np.ix_(f, f)], rcond=1e-10)
    K = inverse @ A[np.ix_(f, m)]
    W_mf, W_ff = W[np.ix_(m, f)], W[np.ix_(f, f)]
    return Design(
        model=layout.model,
        layout=layout,
        free=f,
        follow=K,
        frame_covariance=inverse,
        information=A[np.ix_(m, m)] - A[np.ix_(m, f)] @ K,
        influence=W[np.ix_(m, m)] - W_mf @ K - (W_mf @ K).T + K.T @ W_ff @ K,
        prior=prior,
        frames=float(np.sum(W_ff * inverse)),
    )
