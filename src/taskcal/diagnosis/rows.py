"""Rows whose measurements cannot be right beside the others: in another order, swapped, duplicated, grossly wrong."""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.fits import LEVER_SHARE, LinearFit, registered, registered_trimmed, target_poses
from taskcal.diagnosis.hypotheses import Case, Finding, looked_for
from taskcal.diagnosis.search import SOUND_SHARE
from taskcal.errors import listed
from taskcal.geometry import se3
from taskcal.registration.registration import Registration

Local = tuple[Finding, Campaign]
"""What happened to some of the rows, and the campaign without it."""

# Which point belongs to which joints, by geometry alone, where rows were shuffled.
#
# Points and tool positions have the same centre and the same spread in whatever order they stand. From there
# assignment and registration take turns, as closest points do (Besl and McKay 1992), every point being given away
# once.

HEADINGS = 24
"""Headings about the vertical, 15° apart, that are tried for a standing robot. A convention: fewer may miss the registration,
more cost time in proportion."""

MAX_ROUNDS = 25
"""Rounds of assignment and registration, at most, from one start. A convention that bounds the time."""

MAX_PAIRED_ROWS = 300
"""Rows, at most, that are paired by an assignment, whose cost grows with their cube. A convention that bounds the time."""

MAX_PAIRING_RATIO = 0.3
"""Ratio, at most, of the median distance of a paired point to that of the nearest point of another row. A convention: where
nothing belongs together, the ratio is about 1."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pairing:
    """The campaign with its measurements in the order of its joints."""

    mended: Campaign
    error: float
    """Median distance of the paired points from the registered robot, metres."""
    next_best: float
    """Median distance of a point from the nearest place of another row, metres."""
    source: Int[np.ndarray, " n"]
    """Row in which each row's measurements stood."""

    @property
    def moved(self) -> Int[np.ndarray, " k"]:
        """Rows that had the measurements of others."""
        return np.flatnonzero(self.source != np.arange(len(self.source)))

    @property
    def clear(self) -> bool:
        """Whether points are much nearer to their own place than to any other."""
        return self.error < MAX_PAIRING_RATIO * self.next_best


def pair_rows(case: Case) -> Pairing | None:
    """The only order of the measurements that fits the joints; None where none does, or several might."""
    campaign = case.campaign
    T = case.poses(np.arange(len(campaign)))
    whole = campaign.valid.all(axis=1)
    if not whole.all() or not np.isfinite(T).all() or not 8 <= len(campaign) <= MAX_PAIRED_ROWS:
        return None
    best: Pairing | None = None
    for Z in _starts(T, campaign):
        found = _descend(Z, T, campaign, LEVER_SHARE * case.reach)
        if found is not None and (best is None or found.error < best.error):
            best = found
            if best.clear and best.error < SOUND_SHARE * case.reach:
                break
    return best if best is not None and best.clear else None


def rearranged(campaign: Campaign, source: Int[np.ndarray, " n"]) -> Campaign:
    """The campaign with the measurements of row ``source[i]`` at row i."""
    return replace(
        campaign,
        points=campaign.points[source],
        rotations=None if campaign.rotations is None else campaign.rotations[source],
        uncertainty=None if campaign.uncertainty is None else campaign.uncertainty[source],
        reference_points={name: places[source] for name, places in campaign.reference_points.items()},
    )


def _starts(T: Float[np.ndarray, "n 4 4"], campaign: Campaign) -> list[Float[np.ndarray, "3 3"]]:
    """Rotations that bring the main axes of positions and points together, and those of a robot that stands."""
    p, y = T[:, :3, 3], campaign.points.mean(axis=1)
    axes = [np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2].T for x in (p, y)]
    out: list[np.ndarray] = []
    for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        Z = axes[1] @ np.diag(signs) @ axes[0].T
        out.append(Z * np.sign(np.linalg.det(Z)))
    angles = np.arange(HEADINGS) * 2.0 * np.pi / HEADINGS
    return [*out, *se3.turns("z", angles[:, None])]


def _descend(Z: np.ndarray, T: np.ndarray, campaign: Campaign, lever: float) -> Pairing | None:
    """The order where the search ends that starts from one rotation; None where it does not come to an end."""
    from scipy.optimize import linear_sum_assignment

    p, y = T[:, :3, 3], campaign.points
    ends = ((p - p.mean(axis=0)) @ Z.T)[:, None] + y.mean(axis=0)
    turned: np.ndarray | None = None
    source = np.arange(0)
    for _ in range(MAX_ROUNDS):
        square = ((ends[:, None] - y[None]) ** 2).sum(axis=3).mean(axis=2)
        if turned is not None and campaign.rotations is not None:
            square = square + lever**2 * 0.5 * ((turned[:, None] - campaign.rotations[None]) ** 2).sum(axis=(2, 3))
        apart = np.sqrt(square)
        # distances, not their squares: a pair that is wrong pulls no harder for being farther off
        chosen = linear_sum_assignment(apart)[1]
        error = float(np.median(apart[np.arange(len(T)), chosen]))
        if len(source) and (chosen == source).all():
            others = np.sort(apart, axis=1)[:, 1]
            mended = rearranged(campaign, source)
            return Pairing(mended=mended, error=error, next_best=float(np.median(others)), source=source)
        source = chosen
        registration = registered(rearranged(campaign, source), T)
        if registration is None:
            return None
        placed = target_poses(registration, T)
        ends, turned = placed[..., :3, 3], placed[:, 0, :3, :3]
    return None


# Rows that cannot be right beside the others: swapped targets, mixed-up pairs, duplicated poses, gross errors.

MIN_GROSS_QUARTILES = 10.0
"""Of the upper quartile of what the robust fit leaves of the rows. The tails of real robots are heavy: one that leans far back is
off by three times the 95th percentile there, in all rows of that posture, and none of them is wrong."""

MIN_GROSS_M = 1e-3
"""Distance, metres, at least, of a grossly wrong row. A convention: a smaller one misses fewer wrong rows and raises more false
alarms."""

MAX_GROSS_SHARE = 0.2
"""Share of the rows, at most, that may be grossly wrong. A convention: with more, another mistake explains them better."""

MAX_MIXED_UP_SHARE = 0.5
"""Share of the rows, at most, that may have the points of one another. A convention: beyond half, the rows are in another
order. That all find their place is proof in itself."""

MAX_POSE_DIFFERENCE = 2e-5
"""Difference of joints, at most, of one pose, radians or metres. A convention: what rounding to a thousandth of a degree leaves."""


MAX_EXCHANGED_RATIO = 0.3
"""Distance of a row's points with two targets exchanged over that as they are, at most, where the targets are swapped. A
convention: of a row that is right the ratio is far above 1."""

MAX_SWAPPED_ERROR_RATIO = 0.4
"""Mean distance with targets exchanged back over that as given, at most. A convention: less is no proof."""

DUPLICATE_MEDIANS = 6.0
"""Distance of two points of one pose over the median residual, at least, that no robot repeats with. A convention."""

MAX_MIXED_UP_RATIO = 0.2
"""Median distance of points from the joints of one another over that from their own, at most, where they are mixed up. A
convention: others are as far from one another as from themselves."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RowFault:
    """Rows, what is wrong with them, and the campaign without it."""

    id: str
    rows: Int[np.ndarray, " k"]
    fix: str
    """One line that mends it, with the rows for ``{rows}``."""
    mended: Campaign
    before: float
    """Median distance of these rows, metres."""
    after: float
    """The same, mended; of the other rows, where these are left out."""
    targets: tuple[str, ...] = ()
    """Targets that are concerned, where it is these and not the rows."""

    def local(self, campaign: Campaign) -> Local:
        """The finding, and the campaign without it."""
        ids = tuple(campaign.ids[i] for i in self.rows)
        shown = listed(ids, 12) + (f" ({len(ids)} rows)" if len(ids) > 12 else "")
        finding = Finding(
            id=self.id,
            subject=self.targets or ids,
            error_before=self.before,
            error_after=self.after,
            confidence=float(np.clip(1.0 - self.after / max(self.before, 1e-9), 0.0, 0.99)),
            fix=self.fix.format(rows=f"the rows with id {shown}"),
        )
        return finding, self.mended


@looked_for("rows", "target-swapped")
def find_swapped(case: Case) -> RowFault | None:
    """Two targets that changed places in some of the rows.

    From the registration of all rows, and of every stretch of them alone, the targets of the others are told apart; the one on
    which most rows agree decides.
    """
    campaign = case.campaign
    if len(campaign.targets) < 2:
        return None
    T = case.poses(np.arange(len(campaign)))
    best: tuple[float, np.ndarray, tuple[int, int]] | None = None
    given = np.inf
    usable = case.usable()[0]
    for rows in (usable, *np.array_split(usable, 3)):
        registration = registered_trimmed(campaign.take(rows), T[rows])
        if registration is None:
            continue
        as_given = _row_residuals(registration, campaign.points, T)
        given = min(given, float(np.nanmean(as_given)))
        for a, b in itertools.combinations(range(len(campaign.targets)), 2):
            exchanged = _row_residuals(registration, _exchanged(campaign.points, a, b), T)
            swapped = exchanged < MAX_EXCHANGED_RATIO * as_given
            error = float(np.nanmean(np.where(swapped, exchanged, as_given)))
            if swapped.any() and (best is None or error < best[0]):
                best = (error, swapped, (a, b))
    if best is None or best[0] > MAX_SWAPPED_ERROR_RATIO * given:
        return None
    error, swapped, (a, b) = best
    if swapped.mean() > 0.5:
        swapped = ~swapped
    points = campaign.points.copy()
    points[swapped] = _exchanged(points[swapped], a, b)
    names = (campaign.targets[a], campaign.targets[b])
    return RowFault(
        id="target-swapped",
        rows=np.flatnonzero(swapped),
        targets=names,
        fix=f"exchange {' and '.join(map(_literal, names))} in {{rows}}",
        mended=replace(campaign, points=points),
        before=given,
        after=error,
    )


def _exchanged(points: np.ndarray, a: int, b: int) -> np.ndarray:
    out = points.copy()
    out[:, [a, b]] = out[:, [b, a]]
    return out


def _row_residuals(registration: Registration, points: np.ndarray, T: np.ndarray) -> Float[np.ndarray, " n"]:
    """Root mean square distance of each row's points from their prediction, metres."""
    square = np.nansum((points - target_poses(registration, T)[..., :3, 3]) ** 2, axis=(1, 2))
    return np.sqrt(square / np.maximum((~np.isnan(points[..., 0])).sum(axis=1), 1))


def _literal(name: str) -> str:
    """A name in a text that is formatted later."""
    return name.replace("{", "{{").replace("}", "}}")


def far_rows(fit: LinearFit, rows: int) -> Bool[np.ndarray, " n"]:
    """Rows that are much farther off than the others, from the fit and from the nominal robot.

    A fit that does not follow a row may bend away from it where it stands alone.
    """
    worst = np.zeros(rows)
    np.maximum.at(worst, fit.rows, np.minimum(fit.distance, np.linalg.norm(fit.residual, axis=1)))
    quartile = float(np.quantile(worst[np.unique(fit.rows)], 0.75))
    return worst > max(MIN_GROSS_M, MIN_GROSS_QUARTILES * quartile)


@looked_for("rows", "duplicate-poses", "gross-rows", "rows-shuffled")
def find_row_fault(case: Case, fit: LinearFit) -> RowFault | None:
    """Fault of the rows with large residuals, if these are few."""
    campaign = case.campaign
    far = far_rows(fit, len(campaign))
    same = _duplicates(campaign, fit)
    if same is not None:
        fix = "{rows} have the same joints as others, but other points: correct or leave them out"
        return _left_out("duplicate-poses", same, case, fit, fix)
    rows = np.flatnonzero(far)
    share = far[campaign.seen].mean()
    if not len(rows) or share > MAX_MIXED_UP_SHARE:
        return None
    mixed_up = _mixed_up(case, rows, fit)
    if mixed_up is not None or share > MAX_GROSS_SHARE:
        return mixed_up
    return _left_out("gross-rows", rows, case, fit, "correct {rows}, or leave them out")


def _left_out(name: str, rows: np.ndarray, case: Case, fit: LinearFit, fix: str) -> RowFault:
    concerned = np.isin(fit.rows, rows)
    return RowFault(
        id=name,
        rows=rows,
        fix=fix,
        mended=case.campaign.take(np.setdiff1d(np.arange(len(case.campaign)), rows)),
        before=float(np.median(fit.distance[concerned])) if concerned.any() else 0.0,
        after=float(np.median(fit.distance[~concerned])),
    )


def _duplicates(campaign: Campaign, fit: LinearFit) -> Int[np.ndarray, " k"] | None:
    """Rows with the same joints whose points differ by more than any robot repeats."""
    bound = max(MIN_GROSS_M, DUPLICATE_MEDIANS * fit.median)
    order = np.lexsort(np.round(campaign.q / MAX_POSE_DIFFERENCE).T)
    near = np.abs(np.diff(campaign.q[order], axis=0)).max(axis=1) < MAX_POSE_DIFFERENCE
    out: set[int] = set()
    for i in np.flatnonzero(near):
        a, b = order[i], order[i + 1]
        apart = np.linalg.norm(campaign.points[a] - campaign.points[b], axis=1)
        if np.nanmax(apart, initial=0.0) > bound:
            out |= {int(a), int(b)}
    return np.array(sorted(out)) if out else None


def _mixed_up(case: Case, rows: np.ndarray, fit: LinearFit) -> RowFault | None:
    """Rows whose points fit the joints of one another."""
    if len(rows) < 2:
        return None
    campaign, T = case.campaign, case.poses(np.arange(len(case.campaign)))
    others = np.setdiff1d(case.usable()[0], rows)
    registration = registered(campaign.take(others), T[others])
    if registration is None:
        return None
    ends = target_poses(registration, T[rows])[..., :3, 3]
    apart = np.nan_to_num(
        np.nanmax(np.linalg.norm(ends[:, None] - campaign.points[rows][None], axis=3), axis=2), nan=1e3
    )
    from scipy.optimize import linear_sum_assignment

    of, taken = linear_sum_assignment(apart)
    if np.median(apart[of, taken]) > MAX_MIXED_UP_RATIO * np.median(np.diag(apart)):
        return None
    source = np.arange(len(campaign))
    source[rows[of]] = rows[taken]
    concerned = np.isin(fit.rows, rows)
    return RowFault(
        id="rows-shuffled",
        rows=rows,
        fix="the points of {rows} belong to each other's joints: pair them again",
        mended=rearranged(campaign, source),
        before=float(np.median(fit.distance[concerned])),
        after=float(np.median(apart[of, taken])),
    )
