"""Kinds of observation that need no tracker: they find target and unknowns by themselves, from poses of the tool alone.

A kind states its residuals and their derivatives; the search for a start is the same for all.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.geometry import se3
from taskcal.observations.base import Measured, Observation, Placed, TrackerNoise

TIPS = 0.15 * np.array([[0, 0, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], dtype=float)
"""Places on the tool from which a search starts, metres from the TCP. A convention: a hand's breadth to all sides."""

ROUGH_M = 1e-2
"""Residual, metres, from which on a number counts less in the search for a start: a nominal robot errs by less."""

GOOD_M = 2e-3
"""Residual, metres, under which most rows are where a start is good enough; else all starts are tried, which takes time alone. As
of a nominal robot that is not worn: some 0.5 mm. Wrong minima of lengths to three anchors were seen at 6 to 7 mm, in 2 of 40
simulated campaigns."""

TRUSTED_SHARE = 0.75
"""Share of the rows that are nearer than `GOOD_M` where a start is good enough. A convention, as of a trimmed registration."""

FAR_MEDIANS = 10.0
"""Times the median distance, beyond which a row is left out of the start. A convention."""

LEAST_MEDIAN_M = 1e-5
"""Median distance, metres, that counts where the median is smaller: no robot repeats better."""

ROBUST_ROUNDS = 2
"""Fits in which numbers beyond the median distance count less. A convention: a second one follows the median of the first."""

MAX_EVALUATIONS = 80
"""Of the residuals in one fit. A convention that bounds the time."""

HELD = 1e3
"""Weight of a coordinate of the place that is held, beside one of a row: it moves by a millionth of what the rows ask for."""

LOCATED_WITHIN_M = 0.02
"""A direction of the place is determined if its standard deviation is below this, metres."""

LEAST_ERROR_M = 1e-3
"""A residual under this, metres, is taken for it: a robot that happens to be exact has not more orientations for it."""


class Standalone(Observation):
    """A kind that needs no tracker."""

    resolution: ClassVar[float] = 1e-4
    """1σ of its lengths where the campaign does not say, metres."""
    turn_resolution: ClassVar[float] = 1e-3
    """1σ of its angles, radians."""
    rows_to_judge: ClassVar[int] = 1
    """Rows of one thing, at least, from which on one of them may seem wrong: fewer fit whatever they say."""
    good_m: ClassVar[float] = GOOD_M
    """Residual, metres, as of `GOOD_M`; larger for a kind whose own measurements err by as much before the fit."""
    evaluations: ClassVar[int] = MAX_EVALUATIONS
    """Of the residuals from each start, before the best goes on; fewer for a kind with many starts."""

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of the noise of each row, independent in every number; a stated uncertainty is that of the lengths."""
        deviation = np.full((len(measured.points), self.width), self.turn_resolution)
        deviation[:, : self.width - self.angles] = self.resolution if uncertainty is None else uncertainty[:, None]
        return deviation[:, :, None] ** 2 * np.eye(self.width)

    def check(self, rows: "Search") -> None:
        """Raise a `CampaignError` where the rows cannot tell, whatever they say; by default never."""

    def starts(self, rows: "Search") -> "Iterable[Float[np.ndarray, ' x']]":
        """Estimates from which to search, the likeliest first: several places on the tool, and the unknowns that fit there."""
        return (rows.about(se3.translation(*tip)) for tip in TIPS)

    def find(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> "Found":
        """Find target and unknowns by robust least squares.

        Raises:
            CampaignError: the rows do not tell.
        """
        rows = Search.of(self, tool, measured)
        self.check(rows)
        return rows.find(self.starts(rows))

    def place(self, tool: Float[np.ndarray, "n 4 4"], measured: Measured) -> Placed:
        """Estimate target offset and unknowns from tool poses, robust to a few wrong rows.

        Raises:
            CampaignError: the rows do not tell.
        """
        return self.find(tool, measured).placed


@dataclass(frozen=True, eq=False, kw_only=True)
class Search:
    """Rows by which a target and the unknowns of its kind are looked for.

    An estimate x has the target's place on the tool, its rotation vector if the kind depends on that, and the unknowns, which
    their `deviations` hold about where a search starts.
    """

    kind: Standalone
    """With what each of these rows refers to."""
    tool: Float[np.ndarray, "n 4 4"]
    measured: Measured
    deviations: Float[np.ndarray, " u"]
    seen: Bool[np.ndarray, " all"]
    """Which rows of all they are."""

    @classmethod
    def of(cls, kind: Standalone, tool: Float[np.ndarray, "all 4 4"], measured: Measured) -> "Search":
        """The rows in which something was read."""
        seen = measured.valid
        own = kind if kind.of is None else replace(kind, of=kind.of[seen])
        return cls(kind=own, tool=tool[seen], measured=measured.take(seen), deviations=kind.deviations, seen=seen)

    @property
    def numbers(self) -> Int[np.ndarray, " n"]:
        """Number of the thing that each row refers to; zero where there is one."""
        return np.zeros(len(self.tool), dtype=int) if self.kind.of is None else self.kind.numbers

    @property
    def counts(self) -> Int[np.ndarray, " things"]:
        """Number of rows of each thing."""
        return np.bincount(self.numbers, minlength=max(1, len(self.kind.named)))

    @property
    def first(self) -> int:
        """Place of the first unknown in an estimate."""
        return 6 if self.kind.turned else 3

    @property
    def weights(self) -> Float[np.ndarray, " w"]:
        """Weight of each number: an angle beside lengths counts as their resolutions have it, one alone at an arm of 1 m."""
        kind = self.kind
        arm = kind.resolution / kind.turn_resolution if kind.width > kind.angles else 1.0
        return np.repeat([1.0, arm], [kind.width - kind.angles, kind.angles])

    def about(
        self, T_tool_target: Float[np.ndarray, "4 4"], unknown: Float[np.ndarray, " u"] | None = None
    ) -> Float[np.ndarray, " x"]:
        """The estimate of a target, with unknowns or those that fit it best."""
        if unknown is None:
            unknown = self.kind.settle(self.tool @ T_tool_target, self.measured, np.full(len(self.deviations), np.nan))
        turn = [se3.log(T_tool_target[:3, :3])] if self.kind.turned else []
        # of what no row shows anything but zero, which is no normal of a plane
        return np.concatenate([T_tool_target[:3, 3], *turn, np.nan_to_num(unknown, nan=0.5)])

    def target(self, x: Float[np.ndarray, " x"]) -> Float[np.ndarray, "4 4"]:
        """Pose of the target in the tool frame."""
        return se3.pose(se3.exp(x[3:6]) if self.kind.turned else np.eye(3), x[:3])

    def linearise(self, x: Float[np.ndarray, " x"]) -> tuple[Float[np.ndarray, "n w"], Float[np.ndarray, "n w x"]]:
        """Residual of every row, its numbers weighted, and the derivative of what is predicted by the estimate."""
        R, at = (
            self.tool[:, :3, :3],
            self.kind.differentiate(self.tool @ self.target(x), x[self.first :], self.measured),
        )
        turn = [at.by_target[:, :, 3:] @ (R @ se3.left_jacobian(x[3:6]))] if self.kind.turned else []
        by_x = np.concatenate([at.by_target[:, :, :3] @ R, *turn, at.by_unknown], axis=2)
        return self.weights * at.residual, self.weights[:, None] * by_x

    def distance(self, x: Float[np.ndarray, " x"]) -> Float[np.ndarray, " n"]:
        """Length of the residual of every row, metres."""
        return np.linalg.norm(self.linearise(x)[0], axis=1)

    def improve(
        self,
        start: Float[np.ndarray, " x"],
        *,
        weight: Float[np.ndarray, " n"] | None = None,
        scale: float | None = ROUGH_M,
        held: Float[np.ndarray, "3 3"] | None = None,
        evaluations: int = MAX_EVALUATIONS,
    ) -> tuple[Float[np.ndarray, " x"], float]:
        """The least cost next to a start, and that cost.

        Args:
            start: the estimate.
            weight: of each row; one by default.
            scale: residual, metres, from which on a number counts less (smooth L1 loss); None for least squares.
            held: projector onto directions in which the target's place stays.
            evaluations: of the residuals at most.
        """
        from scipy.optimize import least_squares

        kind, first = self.kind, self.first
        root = np.sqrt(np.ones(len(self.tool)) if weight is None else weight)[:, None]
        pull = np.zeros((3 + len(self.deviations), len(start)))
        pull[:3, :3] = 0.0 if held is None else HELD * held
        pull[3:, first:] = np.diag(kind.resolution / self.deviations)
        last: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

        def system(x: Float[np.ndarray, " x"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            if not last or not np.array_equal(last[0][0], x):
                residual, by_x = self.linearise(x)
                stated = kind.stated(x[first:])
                sure = kind.resolution / stated.uncertainty
                rows = [(root * residual).reshape(-1), sure * stated.residual, pull @ (start - x)]
                by_stated = np.pad(sure[:, None] * stated.by_unknown, ((0, 0), (first, 0)))
                by_rows = (root[:, :, None] * by_x).reshape(-1, len(x))
                last[:] = [(x.copy(), np.concatenate(rows), -np.concatenate([by_rows, by_stated, pull]))]
            return last[0]

        found = least_squares(
            lambda x: system(x)[1],
            start,
            jac=lambda x: system(x)[2],  # pyright: ignore[reportArgumentType]
            loss="linear" if scale is None else "soft_l1",
            f_scale=scale or 1.0,
            x_scale="jac",
            max_nfev=evaluations,
        )
        return found.x, float(found.cost)

    def find(self, starts: Iterable[Float[np.ndarray, " x"]]) -> "Found":
        """The best estimate from some starts, in spite of a few wrong rows.

        Along directions of its place that the rows do not tell, the target is at the TCP.
        """
        x, least = np.zeros(0), np.inf
        for start in starts:
            trial, cost = self.improve(start, evaluations=self.kind.evaluations)
            x, least = (trial, cost) if cost < least else (x, least)
            if np.quantile(self.distance(x), TRUSTED_SHARE) < self.kind.good_m:
                break
        counts, few = self.counts, self.kind.rows_to_judge
        judged = (counts >= few)[self.numbers]
        weight = np.ones(len(judged))
        if judged.any():
            for _ in range(ROBUST_ROUNDS):
                median = float(np.median(self.distance(x)[judged]))
                x = self.improve(x, scale=max(median, 0.1 * LEAST_MEDIAN_M))[0]
            distance = self.distance(x)
            near = distance <= FAR_MEDIANS * max(float(np.median(distance[judged])), LEAST_MEDIAN_M)
            left = np.bincount(self.numbers[near], minlength=len(counts))
            if near.mean() > 0.5 and (left[counts >= few] >= few).all():
                weight = near.astype(float)
        x = self.improve(x, weight=weight, scale=None)[0]
        hidden = self.hidden(x, weight)
        if hidden.any():
            at_tool_point = np.concatenate([x[:3] - hidden @ x[:3], x[3:]])
            x = self.improve(at_tool_point, weight=weight, scale=None, held=hidden)[0]
        return Found(rows=self, x=x, weight=weight, hidden=hidden)

    def hidden(self, x: Float[np.ndarray, " x"], weight: Float[np.ndarray, " n"]) -> Float[np.ndarray, "3 3"]:
        """Projector onto directions of the target's place that the rows do not tell beside what else is unknown."""
        residual, by_x = self.linearise(x)
        rms = float(np.sqrt(weight @ (residual**2).sum(axis=1) / weight.sum()))
        rows = (np.sqrt(weight)[:, None, None] * by_x).reshape(-1, len(x))
        known = np.pad(np.diag(self.kind.resolution / self.deviations), ((0, 0), (self.first, 0)))
        J = np.concatenate([rows, known])
        scale = np.linalg.norm(J, axis=0)
        basis, size, _ = np.linalg.svd(J[:, 3:][:, scale[3:] > 0] / scale[3:][scale[3:] > 0], full_matrices=False)
        basis = basis[:, size > 1e-7 * size.max(initial=0.0)]
        left = J[:, :3] - basis @ (basis.T @ J[:, :3])
        values, vectors = np.linalg.eigh(left.T @ left)
        weak = vectors[:, values < (max(rms, LEAST_ERROR_M) / LOCATED_WITHIN_M) ** 2]
        return weak @ weak.T


class Found(NamedTuple):
    """Target and unknowns as some rows have them."""

    rows: Search
    x: Float[np.ndarray, " x"]
    """The estimate."""
    weight: Float[np.ndarray, " n"]
    """Of each row: zero for those that disagree with the others."""
    hidden: Float[np.ndarray, "3 3"]
    """Projector onto directions of the target's place that these rows do not tell."""

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """The kind's own unknowns."""
        return self.x[self.rows.first :]

    @property
    def placed(self) -> Placed:
        """The same for all rows."""
        kind, T = self.rows.kind, self.rows.target(self.x)
        residual = kind.differentiate(self.rows.tool @ T, self.unknown, self.rows.measured).residual
        distance = np.zeros(len(self.rows.seen))
        distance[self.rows.seen] = np.linalg.norm(residual[:, : kind.width - kind.angles or kind.width], axis=1)
        return Placed(T, self.unknown, distance, self.hidden)
