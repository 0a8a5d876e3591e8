"""Campaigns of one model identified together: what `identify` finds of each, many times as fast.

A study, or a test of coverage, identifies one campaign after another of the same model, and needs of each the estimate, its
covariance and the hyperparameters alone. They are fitted in one compiled pass over many robots (`search_kernel`), from the rows
that `identify` would fit, from the same start and by the same steps. A campaign that has anything unusual, rows that disagree
among them, is left to `identify`, which says what it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign, check_rows
from taskcal.errors import CampaignError, ClosureError
from taskcal.estimation import evidence
from taskcal.estimation.least_squares import Stopping
from taskcal.estimation.matrices import single_threaded
from taskcal.estimation.prior import GaussianPrior, Squared
from taskcal.geometry import se3
from taskcal.identification.calibration import tells_nothing
from taskcal.identification.hyperparameters import LINEAR_WITHIN, MAX_ROUNDS, SAMPLED_FROM
from taskcal.identification.layout import Layout, frame_precision, layout_of, prior_of
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import MAX_CACHED_NUMBERS, Rows
from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.closure import allocate_coordinates
from taskcal.kernels.fit import (
    CONVERGED,
    UNTOUCHED,
    Campaigns,
    FitBuffers,
    Fits,
    Model,
    Search,
    allocate_cache,
    search_robots,
)
from taskcal.kernels.lanes import LANES
from taskcal.kernels.points import allocate_points
from taskcal.kernels.products import allocate_products
from taskcal.observations.base import UNMEASURED
from taskcal.registration.consensus import agrees_throughout, check_targets, find_consensus
from taskcal.registration.registration import Cloud, Registration, register_cloud, serves
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.joint_side import FourBarDrive

ROBOTS = 64
"""A thread takes at a time."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """What a campaign says of a robot, without what only a report of it needs."""

    layout: Layout
    z: Float[np.ndarray, " z"]
    """All parameters, tracker frame and target, in the order of the layout's names."""
    z_covariance: Float[np.ndarray, "z z"]
    model_error: tuple[float, ...]
    """Standard deviation of what the model does not explain, metres per axis."""
    prior_scale: float
    """Factor of the prior's standard deviations."""

    @property
    def model(self) -> ErrorModel:
        """The model that was identified."""
        return self.layout.model

    @cached_property
    def estimate(self) -> Float[np.ndarray, " p"]:
        """Every parameter of the model, metres and radians."""
        return self.layout.parameters(self.z)

    @cached_property
    def standard_errors(self) -> Float[np.ndarray, " p"]:
        """Posterior standard deviation of every parameter, metres and radians."""
        return np.sqrt(np.diag(self.z_covariance)[: len(self.model)])

    def predict(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n targets 3"]:
        """Predict the target in the tracker frame, metres; arguments as in `Calibration.predict`."""
        base, targets = self.layout.frames(self.z)
        T = base @ self.tool_in_base(q, conditions)
        return np.stack([se3.apply(T, target[:3, 3]) for target in targets], axis=1)

    def predict_covariance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n targets 3 3"]:
        """Covariance of the target's true position about the predicted one, metres², as of `Calibration.predict_covariance`."""
        _, covariance = Rows.of_targets(self.layout, self.z, q).propagate(self.z_covariance)
        return covariance + self.model_error[0] ** 2 * np.eye(3)

    def tool_in_base(
        self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the robot's base."""
        return self.model.poses(q, self.estimate, conditions)


def can_fit_together(model: ErrorModel, options: FitOptions) -> bool:
    """Whether campaigns of a model can be fitted together at all."""
    prior = options.prior
    independent = isinstance(prior, str) or (
        isinstance(prior, GaussianPrior) and not prior.mean.any() and _is_diagonal(prior.covariance)
    )
    return (
        independent
        and not model.effects
        and len(model) > 0
        and (options.keep is None or len(set(model.indices(options.keep))) == len(model))
        and isinstance(options.loss, Squared)
        and options.registration is None
        and options.frames == "fit"
        and not isinstance(options.model_error, tuple)
    )


def _is_diagonal(A: Float[np.ndarray, "k k"]) -> bool:
    return not (A - np.diag(np.diag(A))).any()


@single_threaded
def fit_together(model: ErrorModel, campaigns: Sequence[Campaign], options: FitOptions) -> list[Estimate | None]:
    """The estimates of `identify`, to a millionth of a standard deviation, of campaigns of one model.

    Args:
        model: the model.
        campaigns: each of one robot, of any numbers of rows.
        options: of the fits.

    Returns:
        of each campaign its estimate, or None where `identify` has to look at it by itself.
    """
    out: list[Estimate | None] = [None] * len(campaigns)
    if not can_fit_together(model, options):
        return out
    alike: dict[int, list[int]] = {}
    for i, campaign in enumerate(campaigns):
        if _is_plain(campaign) and _is_small(model, campaign):
            alike.setdefault(len(campaign), []).append(i)
    for indices in alike.values():

        def fit_some(rows: slice, indices: list[int] = indices) -> None:
            some = indices[rows]
            for i, estimate in zip(some, _fit_alike(model, [campaigns[i] for i in some], options), strict=True):
                out[i] = estimate

        in_chunks(fit_some, len(indices), ROBOTS)
    return out


def _is_plain(campaign: Campaign) -> bool:
    """Whether a tracker saw one target at every row."""
    plain = not campaign.observations and campaign.rotations is None and len(campaign.targets) == 1
    return plain and bool(campaign.valid.all())


def _is_small(model: ErrorModel, campaign: Campaign) -> bool:
    """Whether a fit would keep its rows, and begin with all of them; and whether they are enough."""
    try:
        check_rows(campaign)
    except CampaignError:
        return False
    return len(campaign) <= SAMPLED_FROM and 9 * len(campaign) * (len(model) + 9) <= MAX_CACHED_NUMBERS


def _fit_alike(model: ErrorModel, campaigns: Sequence[Campaign], options: FitOptions) -> list[Estimate | None]:
    """Fit campaigns that have as many rows each."""
    q = np.stack([one.q for one in campaigns])
    try:
        T = model.poses(q.reshape(-1, q.shape[2])).reshape(*q.shape[:2], 4, 4)
    except ClosureError:
        return [None] * len(campaigns)
    found = [_register(model, one, poses, options) for one, poses in zip(campaigns, T, strict=True)]
    sound = [i for i, one in enumerate(found) if one is not None]
    out: list[Estimate | None] = [None] * len(campaigns)
    if not sound:
        return out
    registrations = [one for one in found if one is not None]
    fitting = _Fitting.of(model, [campaigns[i] for i in sound], registrations, options)
    fitting.search()
    for r, i in enumerate(sound):
        if fitting.state.state[r] == CONVERGED and fitting.is_worth(r):
            out[i] = fitting.estimate(r)
    return out


def _register(
    model: ErrorModel, campaign: Campaign, poses: Float[np.ndarray, "n 4 4"], options: FitOptions
) -> Registration | None:
    """The registration that `identify` would start from; None where it may not take all rows, or refuse them."""
    cloud = Cloud.of(poses, campaign)
    registration = register_cloud(cloud)
    try:
        serve = serves(registration, cloud, campaign, model.robot.reach)
        check_targets(registration, campaign, options.target_within)
    except CampaignError:
        return None
    if serve and agrees_throughout(registration, cloud):
        return registration
    consensus = find_consensus(model, campaign, poses)
    return consensus.registration if consensus.of_all else None


@dataclass(frozen=True, eq=False, kw_only=True)
class _Fitting:
    """Everything of a compiled search over many robots."""

    layouts: list[Layout]
    """Of every robot; they differ in their registrations."""
    options: FitOptions
    model: Model
    campaigns: Campaigns
    state: Fits
    likeliest: Float[np.ndarray, " robots"]
    """Most probable factors of the prior's variances."""

    @classmethod
    def of(
        cls,
        model: ErrorModel,
        campaigns: Sequence[Campaign],
        registrations: Sequence[Registration],
        options: FitOptions,
    ) -> "_Fitting":
        every = np.arange(len(model))
        layouts = [
            layout_of(model, every, registration, campaign, fixed=False)
            for registration, campaign in zip(registrations, campaigns, strict=True)
        ]
        q, points = np.stack([one.q for one in campaigns]), np.stack([one.points for one in campaigns])
        noise, start = (
            np.stack([one.covariances(options.noise) for one in campaigns]),
            np.stack([layout.start() for layout in layouts]),
        )
        robots, p = start.shape
        error = options.model_error**2 if isinstance(options.model_error, float | int) else -1.0
        factor = 1.0 if isinstance(options.prior_scale, str) else options.prior_scale**2
        along = noise[:, :, 0, 0, 0]
        return cls(
            layouts=layouts,
            options=options,
            model=_model(layouts[0], options),
            campaigns=Campaigns(
                q=q,
                position=points,
                valid=np.ones((robots, q.shape[1], 1), dtype=bool),
                noise=noise,
                tracker=np.stack([one.T_tracker_base[:3] for one in registrations]),
                start=start,
                frames=np.stack([frame_precision(layout) for layout in layouts]),
                typical=np.median(np.where(along < UNMEASURED, along, np.nan), axis=1),
            ),
            state=Fits(
                z=start.copy(),
                left=np.zeros((robots, p)),
                variance=np.full(robots, error),
                factor=np.full(robots, factor),
                information=np.zeros((robots, p, p)),
                posterior=np.zeros((robots, p, p)),
                state=np.full(robots, UNTOUCHED),
            ),
            likeliest=np.full(robots, factor),
        )

    def search(self) -> None:
        """Find hyperparameters and estimates, as `fit_with_hyperparameters` does."""
        error, scale = self.options.model_error == "estimate", self.options.prior_scale == "estimate"
        final = Stopping()
        search = Search(
            error=error,
            scale=scale,
            loose=LINEAR_WITHIN,
            last=LINEAR_WITHIN if scale else final.decrement,
            linear=scale,
            iterations=final.iterations,
            rounds=MAX_ROUNDS,
            smallest=evidence.SCALE_RANGE[0],
            largest=evidence.SCALE_RANGE[1],
        )
        self._run(search)
        self.likeliest[:] = self.state.factor
        if scale:
            self._expect_scale()
            self._run(search._replace(error=False, scale=False, last=final.decrement, linear=False))

    def _run(self, search: Search) -> None:
        walked = self.layouts[0].walked(self.campaigns.q[0, :1], self.campaigns.start[0])
        p, n = self.campaigns.start.shape[1], self.campaigns.q.shape[1]
        buffers = FitBuffers(
            coordinates=allocate_coordinates(self.campaigns.q.shape[2], len(self.model.drive.offset)),
            point=allocate_points(walked),
            cache=allocate_cache(n, 1, p),
            products=allocate_products(p, 3 * -(-n // LANES)),
        )
        search_robots(self.model, self.campaigns, search, self.state, buffers)

    def _expect_scale(self) -> None:
        """Put the expected factor of the prior's variances in the place of the likeliest one, where the fit converged."""
        state, k = self.state, len(self.model.prior)
        good = np.flatnonzero(state.state == CONVERGED)
        H = state.information[good]
        free = H[:, k:, k:] + self.campaigns.frames[good]
        own = H[:, :k, :k] - H[:, :k, k:] @ np.linalg.solve(free, H[:, k:, :k])
        deviation = (state.z + state.left)[good, :k]
        state.factor[good] = evidence.expect_factor(own, np.diag(self.model.prior), deviation, state.factor[good])

    def is_worth(self, i: int) -> bool:
        """Whether anything was learnt, where that is asked."""
        if self.options.prior_scale != "estimate":
            return True
        found, tolerances = self.estimate(i), self.layouts[0].model.tolerances
        likeliest = float(np.sqrt(self.likeliest[i]))
        return not tells_nothing(found.standard_errors, tolerances, found.prior_scale, likeliest, found.model_error[0])

    def estimate(self, i: int) -> Estimate:
        """Estimate of one robot."""
        state = self.state
        return Estimate(
            layout=self.layouts[i],
            z=state.z[i],
            z_covariance=state.posterior[i],
            model_error=(float(np.sqrt(state.variance[i])),),
            prior_scale=float(np.sqrt(state.factor[i])),
        )


def _model(layout: Layout, options: FitOptions) -> Model:
    """Model that the robots have in common, as the compiled pass takes it."""
    model, prior = layout.model, prior_of(layout, options.prior)
    # the tracker's frame is never the identity here, which a chain would leave out
    moved = replace(layout.registration, T_tracker_base=se3.translation(1.0, 1.0, 1.0))
    chain, robot = replace(layout, registration=moved).chain, model.robot
    joint_side = robot.joint_side
    assert prior.parameters is not None
    return Model(
        steps=chain.steps,
        drive=joint_side.drive,
        loop=joint_side.loop_numbers(np.zeros(3)),
        lengths=np.array([i for i, name in enumerate(model.names) if name in FourBarDrive.names], dtype=np.int64),
        wanted=joint_side.wanted(np.ones(len(layout.columns.joint), dtype=bool)),
        layout=layout.columns.arrays,
        point_columns=layout.point_columns,
        prior=np.diag(prior.parameters.covariance).copy(),
        sizes=prior.scale,
    )
