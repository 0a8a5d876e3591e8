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

from taskcal.arguments import joints_checked
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError
from taskcal.estimation.matrices import pseudo_invert_scaled
from taskcal.identification.calibration import Calibration
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.identify import attempt
from taskcal.identification.layout import Layout, frame_precision, layout_of
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import Rows, problem_of, whitener
from taskcal.observations.base import TrackerNoise
from taskcal.observations.point import Station
from taskcal.observations.pose import Pose
from taskcal.registration.options import TARGET_WITHIN
from taskcal.registration.registration import Registration, register
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import model_error_of
from taskcal.short_repr import short_repr
from taskcal.task.task import TaskPoses

# The order in which parameters, or groups of them, are missed least, with the error expected after each.
#
# In units of the prior, F = (1 + A)⁻¹ restricted to the kept parameters is the gain of a design, with A = XᵀX its
# information and W = TᵀT its influence. With G = T·F·Xᵀ and K = 1 + X·Xᵀ the mean squared error over the task is
#
#     |T|² − 2 tr(G·X·Tᵀ) + tr(G·K·Gᵀ)
#
# Dropping a group g makes F − F_g·F_gg⁻¹·F_gᵀ. What each group would cost follows from the products F·Tᵀ and F·Xᵀ,
# whose inner dimensions are those of task and campaign, not of the model.

MIN_EIGENVALUE_RATIO = 1e-15
"""Eigenvalue of information and influence over the largest, under which there is nothing but rounding (a double has 2.2e-16)."""

MAX_COST_TIE = 1e-9
"""Costs of two groups, over their size, that differ by less are equal: groups that repeat each other, to rounding."""

MIN_FRAME_EIGENVALUE_RATIO = 1e-10
"""Eigenvalue of the frames' scaled information over the largest, under which poses do not determine a direction: products of
sensitivities have lost half of a double's digits."""


def order_of_dropping(
    information: Float[np.ndarray, "p p"],
    influence: Float[np.ndarray, "p p"],
    prior: Float[np.ndarray, " p"],
    groups: Sequence[Int[np.ndarray, " _"]],
) -> tuple[list[int], Float[np.ndarray, " sizes"]]:
    """Drop groups one by one, always the one that is missed least.

    Args:
        information: A of the campaign.
        influence: W of the task.
        prior: standard deviations.
        groups: parameters that go together; each parameter is in one.

    Returns:
        numbers of the groups in the order in which they go, and the mean squared error over the task before each goes and after
        the last.
    """
    T, X = (_root(M * prior * prior[:, None]) for M in (influence, information))
    F = np.linalg.inv(np.eye(len(prior)) + information * prior * prior[:, None])
    F = 0.5 * (F + F.T)
    K, XT = np.eye(len(X)) + X @ X.T, X @ T.T
    FT, FX = F @ T.T, F @ X.T
    left = list(range(len(groups)))
    order: list[int] = []
    errors: list[float] = []
    while True:
        G = T @ FX
        GK = G @ K
        errors.append(float(np.sum(T**2) - 2.0 * np.sum(G * XT.T) + np.sum(GK * G)))
        if not left:
            return order, np.array(errors)
        costs = _costs(F, FT, FX, FX @ (XT - GK.T), FX @ K, [groups[g] for g in left])
        # groups that repeat each other cost the same: let the last one go
        k = int(np.flatnonzero(costs <= costs.min() + MAX_COST_TIE * (abs(costs.min()) + abs(errors[-1])))[-1])
        gone = left.pop(k)
        order.append(gone)
        g = groups[gone]
        column = F[:, g].copy()
        back = np.linalg.solve(F[np.ix_(g, g)], np.concatenate([column.T, FT[g], FX[g]], axis=1))
        p, m = len(prior), len(T)
        F, FT, FX = F - column @ back[:, :p], FT - column @ back[:, p : p + m], FX - column @ back[:, p + m :]
        F[g], F[:, g], FT[g], FX[g] = 0.0, 0.0, 0.0, 0.0


def _root(M: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "k p"]:
    """R with RᵀR = M."""
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    some = values > MIN_EIGENVALUE_RATIO * max(values[-1], 1e-300)
    return (vectors[:, some] * np.sqrt(values[some])).T


def _costs(
    F: Float[np.ndarray, "p p"],
    FT: Float[np.ndarray, "p m"],
    FX: Float[np.ndarray, "p n"],
    slope: Float[np.ndarray, "p m"],
    FXK: Float[np.ndarray, "p n"],
    groups: Sequence[Int[np.ndarray, " _"]],
) -> Float[np.ndarray, " groups"]:
    """Increase of the mean squared error without each group."""
    out = np.empty(len(groups))
    alone = np.flatnonzero([len(g) == 1 for g in groups])
    if len(alone):
        s = np.concatenate([g for g in groups if len(g) == 1])
        a, t = np.diag(F)[s], FT[s]
        by_rows = np.einsum("pn,pn->p", FX[s], FXK[s])
        out[alone] = 2.0 * np.einsum("pm,pm->p", t, slope[s]) / a + np.einsum("pm,pm->p", t, t) * by_rows / a**2
    for k, g in enumerate(groups):
        if len(g) == 1:
            continue
        inverse = np.linalg.inv(F[np.ix_(g, g)])
        by_task, by_rows = inverse @ FT[g], inverse @ FX[g]
        out[k] = 2.0 * np.sum(by_task * slope[g]) + np.sum((by_task @ FT[g].T) * (FXK[g] @ by_rows.T))
    return out


@joints_checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Design:
    """Which parameters the rows of a campaign are enough for: their information, and the effect on the task of what is left out.

    Tracker frame and targets are eliminated. Which rows to measure an `Experiment` answers.
    """

    model: ErrorModel
    information: Float[np.ndarray, "p p"]
    """A of the campaign."""
    influence: Float[np.ndarray, "p p"]
    """W of the task, m² per parameter unit squared."""
    prior: Float[np.ndarray, " p"]
    """Prior standard deviations, metres and radians."""
    frames: float
    """Mean squared error that the noise in tracker frame and targets adds, m²."""
    layout: Layout
    free: Int[np.ndarray, " f"]
    """Columns of tracker frame and targets that the campaign estimates."""
    follow: Float[np.ndarray, "f p"]
    """How they follow the parameters."""
    frame_covariance: Float[np.ndarray, "f f"]
    """What the noise makes of them."""

    @classmethod
    def of(
        cls,
        layout: Layout,
        information: Float[np.ndarray, "z z"],
        influence: Float[np.ndarray, "z z"],
        prior: Float[np.ndarray, " p"],
    ) -> "Design":
        """The design in which tracker frame and targets, of which nothing is known beforehand, are eliminated.

        Args:
            layout: of the unknowns, the parameters first.
            information: A of all unknowns.
            influence: W of all unknowns.
            prior: standard deviations of the parameters.
        """
        A, W = information, influence
        m, f = np.split(np.arange(len(A)), [len(layout.estimated)])
        # directions that the campaign does not see, as of a target's offset against the base in one orientation, stay at zero
        inverse = pseudo_invert_scaled(A[np.ix_(f, f)], rcond=MIN_FRAME_EIGENVALUE_RATIO)
        K = inverse @ A[np.ix_(f, m)]
        moved, W_ff = W[np.ix_(m, f)] @ K, W[np.ix_(f, f)]
        return cls(
            model=layout.model,
            layout=layout,
            free=f,
            follow=K,
            frame_covariance=inverse,
            information=A[np.ix_(m, m)] - A[np.ix_(m, f)] @ K,
            influence=W[np.ix_(m, m)] - moved - moved.T + K.T @ W_ff @ K,
            prior=prior,
            frames=float(np.sum(W_ff * inverse)),
        )

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
        targets = Rows.of_targets(self.layout, self.layout.start(), np.asarray(q, dtype=float))
        spread = targets.propagate(covariance)[1][..., :3, :3]
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
    aligned = tuple(Pose(aligned=True) if one.turned and one.in_tracker else one for one in campaign.observations)
    campaign = replace(campaign, observations=aligned, conditions=Conditions())
    layout = layout_of(model, np.arange(len(model)), register(model, campaign), campaign, fixed=False)
    problem = problem_of(layout, campaign, noise)
    b = layout.block_size
    covariance = problem.covariance(np.square(model_error[: b // 3]))
    if any(joint_error):
        covariance += problem.rows(layout.start()).propagate_joints(np.square(joint_error))
    A = problem.information(layout.start(), whitener(covariance))
    frames = np.arange(len(model), len(layout.names))
    # directions in which the poses do not locate the targets are held, as in the fit
    A[np.ix_(frames, frames)] += frame_precision(layout)
    return Design.of(layout, A, _influence(layout, task), model.tolerances if prior is None else prior)


def _influence(layout: Layout, task: TaskPoses) -> Float[np.ndarray, "z z"]:
    """Weighted mean of JᵀJ of the targets' positions over the task."""
    n, targets = len(task), len(layout.targets)
    weight = np.zeros((n, targets, layout.block_size, layout.block_size))
    weight[..., range(3), range(3)] = np.sqrt(task.weights / targets)[:, None, None]
    return Rows.of_targets(layout, layout.start(), task.q).equations(weight)[2]


# Model error and prior scale that a plan or a choice of parameters starts from: a calibration's, or assumed.


def known_hyperparameters(calibration: Calibration, origin: str = "as calibrated") -> Hyperparameters:
    """Hyperparameters of a calibration."""
    common = Hyperparameters.of_deviations(calibration.model_error, calibration.prior_scale, origin)
    return replace(common, own=calibration.group_deviations, joint_error=calibration.joint_error)


def assumed_hyperparameters(
    model: ErrorModel, model_error: float | None = None, prior_scale: float = 1.0
) -> Hyperparameters:
    """Hyperparameters of a robot that was not measured: its tolerances, and the model error given, of its file, or typical."""
    error = model_error_of(model.robot, model_error)
    return Hyperparameters.of_deviations((error.position, 0.0), prior_scale, error.source)


# What a model takes or leaves as a whole: single parameters, and effects of a joint that have many.

MAX_SINGLE_PARAMETERS = 6
"""Parameters of one effect of one joint, at most, that are judged one by one, as many as an error frame has; more, such as
harmonics of many orders, go together. A convention."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterGroup:
    """Parameters that are kept or dropped together."""

    name: str
    """Of the parameter, or of the effect and its joint."""
    members: Int[np.ndarray, " k"]
    """Their numbers in the model."""


def parameter_groups(model: ErrorModel) -> tuple[ParameterGroup, ...]:
    """The groups of a model, in the order of its parameters."""
    effect_of = {name: effect.name for effect in model.effects for name in effect.term(model.robot).names}
    owned: dict[tuple[str, str], list[int]] = {}
    for i, name in enumerate(model.names):
        if name in effect_of:
            owned.setdefault((effect_of[name], name.partition(".")[0]), []).append(i)
    together = {own[0]: (label, own) for label, own in owned.items() if len(own) > MAX_SINGLE_PARAMETERS}
    inside = {i for _, own in together.values() for i in own}
    out: list[ParameterGroup] = []
    for i, name in enumerate(model.names):
        if i in together:
            (effect, owner), own = together[i]
            label = effect if effect.endswith(f" of {owner}") else f"{effect} of {owner}"
            out.append(ParameterGroup(name=label, members=np.array(own)))
        elif i not in inside:
            out.append(ParameterGroup(name=name, members=np.array([i])))
    return tuple(out)


# What is known of robot and cell before poses are chosen.


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanPrior:
    """From a campaign, from a calibration, or assumed."""

    hyper: Hyperparameters
    """Model error and prior scale."""
    registration: Registration | None = None
    """Where tracker and targets are, if known; a calibration has its own."""
    campaign: Campaign | None = None
    """Measured already, its targets in the station's order."""
    calibration: Calibration | None = None
    target_within: float = TARGET_WITHIN
    """How far targets may be from where they are stated, metres, as the fit takes it (`target_deviation`); a calibration has its
    own."""


def prior_from_campaign(
    model: ErrorModel, campaign: Campaign, station: Station | None, noise: TrackerNoise | None, target_within: float
) -> PlanPrior:
    """Prior of robot and cell from a campaign.

    Raises:
        CampaignError: a campaign of poses, or targets that are not the station's.
    """
    campaign.refuse_kinds("a plan that goes on from a campaign")
    if campaign.rotations is not None:
        raise CampaignError("a plan extends a campaign of points; this one measured poses")
    _check_targets("campaign", campaign.targets, station)
    if station is not None:
        campaign = campaign.of_targets([r.name for r in station.reflectors])
    fitted = attempt(model, campaign, FitOptions(noise=noise, target_within=target_within)).learnt().calibration
    return PlanPrior(
        hyper=known_hyperparameters(fitted, "what the campaign shows"),
        registration=register(model, campaign),
        campaign=campaign,
        target_within=target_within,
    )


def prior_from_calibration(model: ErrorModel, calibration: Calibration, station: Station | None) -> PlanPrior:
    """Prior from a calibration, its parameters' covariance above all.

    Raises:
        CampaignError: a calibration of another model, of poses, without a prior or with frames held, or targets that are
            not the station's.
    """
    if calibration.model.robot.digest != model.robot.digest or calibration.names != model.names:
        raise CampaignError("the calibration is of another robot or model; plan with the calibration's own model")
    if calibration.layout.pose:
        raise CampaignError("a plan adds points to a calibration from points; this one is from poses")
    if calibration.layout.fixed_frames:
        raise CampaignError("the calibration held tracker frame and targets; identify with frames fitted to plan on")
    if calibration.prior_scale is None:
        raise CampaignError(
            "the calibration has no prior, and does not say how well parameters are known that its data leave open; "
            "identify with a prior to plan on"
        )
    _check_targets("calibration", calibration.targets, station)
    if station is not None and calibration.targets != tuple(r.name for r in station.reflectors):
        raise CampaignError(
            "the station's reflectors stand in another order than the calibration's targets; write "
            f"{', '.join(calibration.targets)}"
        )
    return PlanPrior(
        hyper=known_hyperparameters(calibration),
        calibration=calibration,
    )


def _check_targets(whose: str, targets: tuple[str, ...], station: Station | None) -> None:
    if station is not None and set(targets) != {r.name for r in station.reflectors}:
        raise CampaignError(
            f"the {whose}'s targets are {', '.join(targets)}, the station's reflectors "
            f"{', '.join(r.name for r in station.reflectors)}; name them alike"
        )
    if station is None and len(targets) > 1:
        raise CampaignError(f"the {whose} has several targets; say with a station which reflectors the tool carries")
