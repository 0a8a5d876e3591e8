"""What a fit predicted of rows that it had not seen."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.performance import group_postures
from taskcal.errors import CampaignError
from taskcal.estimation.matrices import inverse_factors
from taskcal.identification.options import Grouping
from taskcal.io.codec import GAPS, NOT_IN_FILE, TRUTHS
from taskcal.io.toml_file import NotNegative, Ratio
from taskcal.observations import Compared, Observation, error_lengths
from taskcal.short_repr import short_repr

# What measured points lie off what was predicted, in the form a metrologist reports it.


@dataclass(frozen=True, eq=False, kw_only=True)
class Validation:
    """Errors, measured less predicted."""

    errors: Float[np.ndarray, " points"]
    """Length of every point's error, metres; of a kind that measures angles alone their angle, at an arm of 1 m."""
    components: Float[np.ndarray, "points 3"]
    """The errors in the axes of the robot's base, metres; NaN for kinds of observation that measure along no axes of it."""
    rotations: Float[np.ndarray, " points"] | None
    """Angle of every pose's orientation error, radians; None for points."""
    rows: tuple[int, ...]
    """Row of the campaign that each point belongs to."""
    lengths: Bool[np.ndarray, " n"] | None = None
    """Points whose error is a length: all but those of kinds that measure angles alone, which count at an arm of 1 m. None for
    all."""
    in_space: bool = True
    """Whether every error is a distance in space; of a kind that measures one number, such as a length, it is that number's."""
    remarks: tuple[str, ...] = ()
    """What a user should look at before believing the result."""
    compared: tuple[Compared, ...] = ()
    """Lengths that are stated, such as distances of sockets, beside those that were found."""

    def __repr__(self) -> str:
        remarks = f", {len(self.remarks)} remarks" if self.remarks else ""
        return (
            f"Validation({len(self)} points: mean {self.mean * 1e3:.4f} mm, rms {self.rms * 1e3:.4f} mm, 95 % "
            f"{self.p95 * 1e3:.4f} mm, largest {self.maximum * 1e3:.4f} mm{remarks})"
        )

    @classmethod
    def of_residuals(
        cls,
        residual: Float[np.ndarray, "n targets b"],
        base: Float[np.ndarray, "3 3"],
        kinds: Sequence[type[Observation]],
    ) -> "Validation":
        """Errors from residuals in the tracker's frame.

        Args:
            residual: measured less predicted, metres (then radians, for poses); NaN for lost beams.
            base: rotation of the robot's base in the tracker frame.
            kinds: of observation of each target.
        """
        rows, targets = np.nonzero(~np.isnan(residual[..., 0]))
        turn = np.where(
            np.array([kind.angles > 0 for kind in kinds])[targets, None], residual[rows, targets, 3:], np.nan
        )
        components = residual[rows, targets, :3] @ base
        components[~np.array([kind.along_axes for kind in kinds])[targets]] = np.nan
        return cls(
            errors=error_lengths(residual, kinds)[rows, targets],
            components=components,
            rotations=None if np.isnan(turn).all() else np.linalg.norm(turn, axis=1),
            rows=tuple(int(row) for row in rows),
            in_space=all(kind.width - kind.angles in (0, 3) for kind in kinds),
            lengths=_of_lengths(kinds)[targets],
        )

    def __len__(self) -> int:
        return len(self.errors)

    def of_points(self, points: Bool[np.ndarray, " points"]) -> "Validation":
        """The errors of some of the points."""
        rotations = None if self.rotations is None else self.rotations[points]
        return replace(
            self,
            errors=self.errors[points],
            components=self.components[points],
            rotations=None if rotations is None or np.isnan(rotations).all() else rotations,
            rows=tuple(row for row, chosen in zip(self.rows, points, strict=True) if chosen),
            lengths=None if self.lengths is None else self.lengths[points],
            remarks=(),
            compared=(),
        )

    @property
    def _lengths(self) -> Float[np.ndarray, " k"]:
        """Errors that are lengths, metres; where there is none, all."""
        return self.errors[self.lengths] if self.lengths is not None and self.lengths.any() else self.errors

    @property
    def mean(self) -> float:
        """Mean error of the lengths, metres."""
        return float(self._lengths.mean())

    @property
    def rms(self) -> float:
        """Root mean square of the error of the lengths, metres."""
        return float(np.sqrt(np.mean(self._lengths**2)))

    @property
    def p95(self) -> float:
        """Error that 95 % of the lengths stay below, metres."""
        return float(np.percentile(self._lengths, 95))

    @property
    def maximum(self) -> float:
        """Largest error of a length, metres."""
        return float(self._lengths.max())

    @property
    def per_axis(self) -> Float[np.ndarray, " 3"]:
        """Largest |x|, |y| and |z| in the robot's base axes, metres; NaN where nothing was measured along them."""
        along = self.components[~np.isnan(self.components[:, 0])]
        return np.abs(along).max(axis=0) if len(along) else np.full(3, np.nan)

    @property
    def has_axes(self) -> bool:
        """Whether anything was measured along the axes of the robot's base."""
        return not np.isnan(self.components).all()

    def summary(self) -> dict[str, float | int]:
        """The report in millimetres (and milliradians), without the axes where nothing was measured along them."""
        out: dict[str, float | int] = {
            "mean_mm": self.mean * 1e3,
            "rms_mm": self.rms * 1e3,
            "p95_mm": self.p95 * 1e3,
            "max_mm": self.maximum * 1e3,
        }
        if self.has_axes:
            out |= {f"max_{axis}_mm": float(value) * 1e3 for axis, value in zip("xyz", self.per_axis, strict=True)}
        out["n"] = len(self._lengths)
        if self.rotations is not None:
            out["mean_mrad"] = float(np.nanmean(self.rotations) * 1e3)
            out["max_mrad"] = float(np.nanmax(self.rotations) * 1e3)
        if self.compared:
            off = np.abs([one.found - one.stated for one in self.compared]) * 1e3
            out["distance_mean_mm"], out["distance_max_mm"] = float(off.mean()), float(off.max())
        return out


def _of_lengths(kinds: Sequence[type[Observation]]) -> Bool[np.ndarray, " targets"]:
    """Targets of which lengths are measured; all where of none."""
    out = np.array([kind.width > kind.angles for kind in kinds])
    return out if out.any() else ~out


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class HeldOut:
    """Errors of held-out rows, in parts."""

    by: Grouping | Literal["chosen"]
    """How the parts were made; ``chosen`` where the user named the rows to fit."""
    folds: int
    """Fits that each left a part out, beside the calibration, which knows all rows; 0 where the calibration itself has not
    seen the rows."""
    rows: Int[np.ndarray, " rows"]
    """Rows of the whole campaign, counted from 0."""
    part: Int[np.ndarray, " rows"]
    """Which part each row belongs to, counted from 0: its fold, or its group of neighbours or block."""
    residuals: Annotated[Float[np.ndarray, "rows targets b"], GAPS]
    """Measured less predicted in the axes of the robot's base, metres (then radians, for poses); NaN for lost beams."""
    nominal: Annotated[Float[np.ndarray, "rows targets b"], GAPS]
    """The same of the nominal robot, with tracker frame and targets found from the rows that were fitted."""
    inside: Annotated[Float[np.ndarray, "rows targets"] | None, TRUTHS] = None
    """Whether each is in the 95 % region that was stated for it, as of `in_regions`; None where none was stated."""
    rotation_inside: Annotated[Float[np.ndarray, "rows targets"] | None, TRUTHS] = None
    """The same of rotations."""
    kinds: Annotated[tuple[type[Observation], ...], NOT_IN_FILE] = ()
    """Of observation of each target; none of a file alone, whose layout has them."""

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def validation(self) -> Validation:
        """The errors of all rows."""
        return Validation.of_residuals(self.residuals, np.eye(3), self.kinds)

    @property
    def nominal_validation(self) -> Validation:
        """The errors of all rows that the nominal robot leaves."""
        return Validation.of_residuals(self.nominal, np.eye(3), self.kinds)

    @property
    def part_means(self) -> Float[np.ndarray, " parts"]:
        """Mean error in space of every part in which anything was seen, metres."""
        sums, counts = self._by_part()
        return (sums / np.maximum(counts, 1))[counts > 0]

    @property
    def standard_error(self) -> float:
        """Standard error of the mean error over all rows, from the scatter of the parts, metres; NaN with a single part."""
        sums, counts = self._by_part()
        parts, total = int((counts > 0).sum()), counts.sum()
        if parts < 2:
            return float("nan")
        own = sums - counts * sums.sum() / total
        return float(np.sqrt((own**2).sum() * parts / (parts - 1)) / total)

    def _by_part(self) -> tuple[Float[np.ndarray, " parts"], Int[np.ndarray, " parts"]]:
        """Sum of the errors and number of points of every part."""
        length = error_lengths(self.residuals, self.kinds)
        seen = np.isfinite(length) & _of_lengths(self.kinds)
        sums = np.bincount(self.part, weights=np.where(seen, length, 0.0).sum(axis=1))
        return sums, np.bincount(self.part, weights=seen.sum(axis=1)).astype(int)

    def summary(self) -> dict[str, Any]:
        """Summary of the hold-out and of the scatter of its parts, in millimetres."""
        means = self.part_means * 1e3
        return {
            "by": self.by,
            "folds": self.folds,
            "parts": len(means),
            "least_mm": float(means.min()),
            "largest_mm": float(means.max()),
            "standard_error_mm": self.standard_error * 1e3,
            "part_means_mm": means.tolist(),
            "inside_share": share_inside(self.inside),
            "rotation_inside_share": share_inside(self.rotation_inside),
        }


# Groups of poses that lie next to each other, by cutting what was measured in two again and again.
#
# Each cut is square to the direction in which the joint positions spread most, so that a trajectory falls into
# pieces and a cloud of poses into cells, all with about as many rows.

SAME_POSTURE_RAD = float(np.radians(0.5))
"""Rows whose joints all differ by less are one posture, radians (metres where a joint slides)."""

WIDEST = 3.0
"""Times that angle, over which a chain of rows may reach and still be one posture; a longer one is a trajectory."""


def group_neighbours(q: Float[np.ndarray, "n joints"], count: int) -> Int[np.ndarray, " n"]:
    """The group of every row, counted from 0; rows of one posture are in one group.

    Args:
        q: joint positions, radians (metres where a joint slides).
        count: of the groups; there are fewer where there are fewer postures.
    """
    posture = single_postures(q)
    rows = np.bincount(posture)
    centres = np.stack([np.bincount(posture, weights=column) for column in q.T], axis=1) / rows[:, None]
    group = np.empty(len(rows), dtype=int)
    for number, members in enumerate(_cut(centres, rows, np.arange(len(rows)), min(count, len(rows)))):
        group[members] = number
    return group[posture]


def single_postures(q: Float[np.ndarray, "n joints"]) -> Int[np.ndarray, " n"]:
    """The posture of every row, counted from 0: rows half a degree apart, but every row of a trajectory for itself."""
    chain = group_postures(q, SAME_POSTURE_RAD)
    reach = np.zeros(chain.max(initial=-1) + 1)
    for label in np.flatnonzero(np.bincount(chain) > 1):
        reach[label] = np.ptp(q[chain == label], axis=0).max()
    alone = reach[chain] > WIDEST * SAME_POSTURE_RAD
    label = np.where(alone, len(reach) + np.arange(len(q)), chain)
    return np.unique(label, return_inverse=True)[1].reshape(-1)


SWEPT_ALIKE = 1e-6
"""Joints whose sweeps differ by less of their width, and rows by less in radians, are in the order of the robot and of the file. A
convention: far above rounding, far below what a robot moves."""


def _cut(
    centres: Float[np.ndarray, "k joints"], rows: Int[np.ndarray, " k"], members: Int[np.ndarray, " m"], count: int
) -> list[Int[np.ndarray, " _"]]:
    """Members in `count` groups of about as many rows."""
    if count == 1:
        return [members]
    first = count // 2
    away = centres[members] - np.average(centres[members], axis=0, weights=rows[members])
    # Joints swept alike give equal singular values, and rounding the direction: earlier joints first.
    weight = 1 - SWEPT_ALIKE * np.arange(away.shape[1])
    along = np.linalg.svd(away * weight, full_matrices=False)[2][0]
    along = along * np.sign(along[np.argmax(np.abs(along))])
    order = np.argsort(np.round(away @ along / SWEPT_ALIKE), kind="stable")
    reached = np.cumsum(rows[members][order])
    cut = int(np.argmin(np.abs(reached - reached[-1] * first / count))) + 1
    cut = min(max(cut, first), len(members) - (count - first))
    return [
        *_cut(centres, rows, members[order[:cut]], first),
        *_cut(centres, rows, members[order[cut:]], count - first),
    ]


# Stated regions, and whether what was measured lies in them.

REGION = 0.95
"""Share of points that a stated region is to hold."""

NO_UNCERTAINTY = "the calibration and the campaign state no uncertainty at some point; state one (column u_mm)"

FOLLOWED = 1e-6
"""Variance of a residual over that of the measurement, below which the fit follows the measurement entirely: there is no residual
to judge. A convention: far above rounding."""

FOLLOWED_BY_PLACE = 1e-3
"""The same of rows that locate what they refer to, such as an anchor by four lengths to it. A convention: the place is found by a
search, and the region from derivatives there; both are as exact as a hundredth of the noise, and not much more."""


def in_regions(
    residual: Float[np.ndarray, "n targets b"],
    own: Float[np.ndarray, "n targets b b"],
    noise: Float[np.ndarray, "n targets b b"],
    kinds: Sequence[Observation],
    *,
    rotations: bool = False,
) -> Float[np.ndarray, "n targets"]:
    """Whether each residual is in the region that holds 95 % of a normal distribution of its covariance: 1 or 0.

    Degrees of freedom are the numbers that the kind measures, less those that the fit follows entirely.

    Args:
        residual: measured less predicted, metres (then radians).
        own: covariance of the residuals.
        noise: of the measurements.
        kinds: of observation of each target.
        rotations: of the angles, of kinds that measure some; else of the lengths, or of the angles of kinds that measure these
            alone.

    Returns:
        NaN where nothing was measured, or nothing is left to judge.

    Raises:
        CampaignError: no uncertainty is stated.
    """
    from scipy.special import chdtri

    out = np.full(residual.shape[:2], np.nan)
    for t, kind in enumerate(kinds):
        lengths, angles = ([k for k in kind.block() if (k >= 3) == turn] for turn in (False, True))
        block = angles if rotations else lengths or angles
        seen, part = np.flatnonzero(np.isfinite(residual[:, t, 0])), np.ix_(block, block)
        if not (len(block) and len(seen)):
            continue
        covariance, error = own[seen, t][:, *part], np.trace(noise[seen, t][:, *part], axis1=1, axis2=2)
        if (np.trace(covariance, axis1=1, axis2=2) + error <= 0.0).any():
            raise CampaignError(NO_UNCERTAINTY)
        square, count = _squared_lengths(
            residual[seen, t][:, block], covariance, FOLLOWED_BY_PLACE * error / len(block)
        )
        out[seen, t] = np.where(count > 0, square <= chdtri(np.maximum(count, 1), 1.0 - REGION), np.nan)
    return out


def share_inside(inside: Float[np.ndarray, "..."] | None) -> float | None:
    """Share of those that were judged; None where none was."""
    return None if inside is None or np.isnan(inside).all() else float(np.nanmean(inside))


# Measured points that the fit cannot believe.

NEIGHBOURS = 4
"""Rows before and after one, and as many of the nearest poses, that are asked whether they have its error too."""

ALIKE = 0.4
"""Part of an outlier's residual that a neighbour's has along it, to be the same error. Outliers have 4.5 standard deviations
or more, so that an error of its own has 1.8 in that direction once in thirty times."""

MIN_ALIKE = 2
"""Neighbours with the same error, of `NEIGHBOURS`, that show it to be of the model: by chance once in a hundred times."""


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """A measured point whose residual is too large for chance."""

    row: int
    """Row of the whole campaign, counted from 0, whichever rows were fitted."""
    line: int | None = None
    """Line of the campaign's file, counted from 1; None where it is not known."""
    id: str
    target: str
    studentised: Ratio
    """Length of its residual over that residual's standard deviation."""
    residual: NotNegative
    """Length of its position residual, metres."""

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "row": self.row,
            "line": self.line,
            "id": self.id,
            "target": self.target,
            "residual_mm": self.residual * 1e3,
            "studentised": self.studentised,
        }


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A row that was not fitted, since it cannot be right."""

    row: int
    """Row of the whole campaign, counted from 0, whichever rows were to be fitted."""
    line: int | None = None
    """Line of the campaign's file, counted from 1; None where it is not known."""
    id: str
    distance: NotNegative
    """How far its farthest point is from where the fit of the others has it, metres."""
    studentised: Ratio
    """The same over its standard deviation."""


def studentise(
    residual: Float[np.ndarray, "n targets b"],
    own: Float[np.ndarray, "n targets b b"],
    covariance: Float[np.ndarray, "n targets b b"],
    campaign: Campaign,
    level: float,
    followed: float = FOLLOWED,
) -> tuple[Float[np.ndarray, "n targets"], tuple[Outlier, ...]]:
    """Length of each residual over its own standard deviation, and the points too long for chance.

    The level is shared among all points (Bonferroni), so that a sound campaign names any at all with that probability.

    Args:
        residual: measured less predicted, metres (and radians, for poses).
        own: covariance of the residuals after the fit.
        covariance: of the measurements, model error included: the scale below which a direction has no residual to judge.
        campaign: the measurements.
        level: chance of naming any where there is none.
        followed: share of the covariance that is too small a residual to judge.
    """
    valid, out = campaign.valid, np.full(campaign.valid.shape, np.nan)
    blocks = [one.block() for one in campaign.observations]
    widths = np.array([len(block) for block in blocks])
    for t, block in enumerate(blocks):  # numbers that were measured
        judged, part = valid[:, t], np.ix_(block, block)
        floor = followed * np.trace(covariance[judged, t][:, *part], axis1=1, axis2=2) / len(block)
        square, _ = _squared_lengths(residual[judged, t][:, block], own[judged, t][:, *part], floor)
        out[judged, t] = np.sqrt(square)
    from scipy.special import chdtri

    limit = np.sqrt(chdtri(widths, level / max(int(valid.sum()), 1)))
    lengths = error_lengths(residual, campaign.observations)
    rows = [(float(out[i, t]), int(i), int(t)) for i, t in zip(*np.nonzero(out > limit), strict=True)]
    named = [
        Outlier(
            row=campaign.row_of(i),
            line=campaign.line_of(i),
            id=campaign.ids[i],
            target=campaign.targets[t],
            studentised=s,
            residual=float(lengths[i, t]),
        )
        for s, i, t in sorted(rows, reverse=True)
    ]
    return out, tuple(named)


def _squared_lengths(
    residual: Float[np.ndarray, "k b"], own: Float[np.ndarray, "k b b"], floor: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, " k"], Int[np.ndarray, " k"]]:
    """Squared lengths of residuals in units of their own covariances, and in how many directions.

    Those whose variance is below the floor do not count: the fit follows them entirely.
    """
    W = inverse_factors(own)
    square = np.sum((W @ residual[:, :, None])[:, :, 0] ** 2, axis=1)
    # the smallest variance is at least 1/tr(own⁻¹) = 1/|W|²
    doubtful = ~(np.einsum("kij,kij->k", W, W) * floor < 1.0)
    count = np.full(len(own), own.shape[1])
    if doubtful.any():
        values, vectors = np.linalg.eigh(own[doubtful])
        along, least = np.einsum("kij,ki->kj", vectors, residual[doubtful]), floor[doubtful, None]
        square[doubtful] = np.sum(np.where(values > least, along**2 / np.maximum(values, least), 0.0), axis=1)
        count[doubtful] = (values > least).sum(axis=1)
    return square, count


def shared_with_neighbours(
    outliers: Sequence[Outlier],
    residual: Float[np.ndarray, "n targets b"],
    studentised: Float[np.ndarray, "n targets"],
    q: Float[np.ndarray, "n joints"],
) -> tuple[bool, ...]:
    """Whether neighbours of each outlier, in the order of the rows or by their poses, have much the same error.

    An error that neighbours share is what the model leaves, or something that moved for a while; a wrong reading stands alone.
    Rows of one posture are one pose, whose joints may have been noted wrongly once for all of them: they do not count.

    Args:
        outliers: as `studentise` names them.
        residual: that they were judged by, metres first.
        studentised: the lengths that `studentise` gave.
        q: joint positions, radians (metres where a joint slides).
    """
    if not outliers:
        return ()
    from scipy.spatial import KDTree

    posture, shared = single_postures(q), list[bool]()
    trees: dict[int, tuple[np.ndarray, KDTree]] = {}
    for outlier in outliers:
        i, t = np.unravel_index(np.nanargmin(np.abs(studentised - outlier.studentised)), studentised.shape)
        i, t = int(i), int(t)
        if t not in trees:
            seen = np.flatnonzero(np.isfinite(studentised[:, t]))
            trees[t] = seen, KDTree(q[seen])
        seen, tree = trees[t]
        place = int(np.searchsorted(seen, i))
        nearest = tree.query(q[i], k=min(8 * NEIGHBOURS, len(seen)), p=np.inf)[1]
        before, after = seen[:place][::-1], seen[place + 1 :]
        own = np.nan_to_num(residual[i, t, :3])

        def alike(
            rows: np.ndarray, count: int, own: np.ndarray = own, mine: int = int(posture[i]), target: int = t
        ) -> int:
            others = rows[posture[rows] != mine][:count]
            along = np.nan_to_num(residual[others, target, :3]) @ own
            return int(np.sum(along >= ALIKE * float(own @ own)))

        half = NEIGHBOURS // 2
        in_order = alike(before[:50], half) + alike(after[:50], half)
        shared.append(max(in_order, alike(seen[np.atleast_1d(nearest)], NEIGHBOURS)) >= MIN_ALIKE)
    return tuple(shared)
