"""What went wrong in a campaign's course, as a finding, and the campaign without it."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.drift import compensate_drift
from taskcal.diagnosis.fits import LEVER_SHARE, LinearFit, fit_linearly, frame_columns, register_trimmed
from taskcal.diagnosis.hypotheses import Case, Finding
from taskcal.diagnosis.search import PER_MISTAKE, SOUND_SHARE, Explanation, held_out_error, rows_to_register, typical
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.registration.registration import Registration, register_closely

# What happened in the course of a campaign: a target slipped, or the tracker or base moved, at one row or slowly.
#
# Each is a few more columns of the linear fit, free from one row on or growing with the rows; the gain is that of
# the logarithm of the likelihood, noise unknown, less the price of the columns (Schwarz 1978) and of the rows
# tried.

LEAST_GAIN = {"target-slipped": 25.0, "station-moved": 60.0, "drift": 60.0}
"""Of twice the logarithm of the likelihood. What a robot leaves unexplained is not white and follows the rows by chance: on 60
drawn robots with gear errors, half of them measured in the order of their first joint, slips gained 4 at most, drifts 39."""

LEAST_ABRUPT = {"target-slipped": 10.0, "station-moved": 30.0}
"""Of the same, beside a smooth motion: what a robot leaves in rows that follow a joint changes smoothly, a slip or a move does not.
On those robots with gear errors and compliance moves gained 28 at most; moves by 2 mm gained 36 at least, slips by 2 mm 40."""

LEAST_MEDIANS = 1.5
"""Displacement over the median distance, at least, of a point that moved. A convention: less does not matter beside what the
fit leaves."""

LEAST_MOVE = 1e-3
"""Displacement at least, metres, of a point that moved. A convention: a smaller one misses fewer moves and raises more false
alarms. Less only counts where it raised the error by `CLEAR_FACTOR`."""

CLEAR_FACTOR = 2.0
"""Factor at least by which a small move raised the error: more than half of it is then the move's. Where nothing moved it was 1.3
at most, on five measured robots and on 30 drawn ones with gear errors in rows that follow a joint."""

LEAST_FACTOR = 1.05
"""Factor at least by which a slip, move or drift raised the root mean square error. A convention: less than 5 % changes nothing
that matters."""

LEAST_SHARE = 0.5
"""Share of the farthest target's displacement, at least, that a target moved by which slipped as well. A convention: halfway
between still and moved alike."""

LEAST_ROWS = 4
"""Rows at least on either side of a slip. A convention: one row tells the displacement, the others confirm it."""

LEAST_MOVED_SHARE = 0.1
"""Share of the rows, at least, on either side of a move. A convention: fewer in one corner of the workspace may lack what all
others explain."""

MOST_CUTS = 60
"""Cuts between rows, at most, at which a slip is tried first; the best one's neighbours are tried as well. A convention: more
cost time in proportion."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CourseMistake:
    """A slip, a move of the tracker or the base, or a drift."""

    id: str
    targets: tuple[int, ...]
    """That slipped."""
    row: int
    """The first row after a slip or a move, as the campaign counts."""
    move: float
    """How far it moved the points, metres."""
    gain: float
    """Of twice the logarithm of the likelihood, less what the columns cost."""
    believed: bool
    """Whether it is beyond doubt."""
    before: float
    """Root mean square distance of the points, the geometry free within its tolerances, metres."""
    after: float
    """The same with what happened taken into account."""
    motion: Float[np.ndarray, " b"] = field(default_factory=lambda: np.zeros(0))
    """Of a move: translation of the points' centre and rotation about it, metres and radians."""

    @property
    def confidence(self) -> float:
        """0.63 for the least gain that is believed, up to 0.99."""
        return float(np.clip(1.0 - np.exp(-self.gain / LEAST_GAIN[self.id]), 0.0, 0.99))


def find_course_mistake(fit: LinearFit, weight: Float[np.ndarray, " m"], count: int) -> CourseMistake | None:
    """The most likely slip, move or drift, if there is one beyond doubt: of which of them it is the gain decides alone."""
    tried = (_slip(fit, weight, count), _moved(fit, weight), _drift(fit, weight))
    found = [
        m
        for m in tried
        if m is not None
        and m.gain > 0.0
        and m.move > LEAST_MEDIANS * fit.median
        and m.before > (LEAST_FACTOR if m.move > LEAST_MOVE else CLEAR_FACTOR) * m.after
    ]
    if not any(m.believed for m in found):
        return None
    return max(found, key=lambda m: m.gain)


def gain(fit: LinearFit, before: float, after: float, columns: int, numbers: float) -> float:
    """Of twice the logarithm of the likelihood, less what the columns cost."""
    freedom = max(numbers - fit.columns.shape[2] / 2.0, 6.0)
    return float(freedom * np.log(max(before, 1e-12) / max(after, 1e-12)) - columns * np.log(numbers))


def _drift(fit: LinearFit, weight: np.ndarray) -> CourseMistake:
    """Growing with the rows; believed where it grows evenly, and as likely as what grows faster at one end."""
    time, numbers, before = _time(fit), _numbers(weight), fit.objective(weight)
    curved = _smooth(fit)
    even = curved[:, :, :6]
    gains = [gain(fit, before, fit.objective(weight, c), c.shape[2], numbers) for c in (even, curved)]
    moved = even @ fit.size(weight, even)
    return CourseMistake(
        id="drift",
        targets=(),
        row=int(fit.rows.min()),
        # from the first row to the last
        move=float(np.median(np.linalg.norm(moved, axis=1) / np.maximum(np.abs(time), 0.05))),
        gain=max(gains),
        believed=gains[0] > LEAST_GAIN["drift"],
        before=fit.rms(weight),
        after=fit.rms(weight, (even, curved)[int(np.argmax(gains))]),
    )


def _time(fit: LinearFit) -> Float[np.ndarray, " m"]:
    return (fit.rows - fit.rows.mean()) / max(float(np.ptp(fit.rows)), 1.0)


def _smooth(fit: LinearFit) -> Float[np.ndarray, "m 3 12"]:
    """All points as one rigid body, evenly with the rows, and with their square."""
    time, frame = _time(fit), frame_columns(fit.places)
    return np.concatenate([frame * (time**power)[:, None, None] for power in (1, 2)], axis=2)


def _is_abrupt(
    name: str, fit: LinearFit, weight: np.ndarray, columns: Float[np.ndarray, "m 3 b"], value: float
) -> bool:
    """Whether a slip or a move is beyond doubt, a smooth motion beside it."""
    smooth = _smooth(fit)
    both = np.concatenate([smooth, columns], axis=2)
    more = gain(fit, fit.objective(weight, smooth), fit.objective(weight, both), columns.shape[2], _numbers(weight))
    least = LEAST_ABRUPT[name] + 2.0 * float(np.log(len(np.unique(fit.rows))))
    return value > LEAST_GAIN[name] and more > least


def _moved(fit: LinearFit, weight: np.ndarray) -> CourseMistake | None:
    """All points as one rigid body, from one row on."""
    frame = frame_columns(fit.places)

    def columns(row: int) -> Float[np.ndarray, "m 3 6"]:
        return frame * (fit.rows >= row)[:, None, None]

    least = max(LEAST_ROWS, int(np.ceil(LEAST_MOVED_SHARE * len(np.unique(fit.rows)))))
    cut = _best_cut(fit, weight, columns, least=least)
    if cut is None:
        return None
    row, value = cut
    motion = fit.size(weight, columns(row))
    return CourseMistake(
        id="station-moved",
        targets=(),
        row=row,
        move=float(np.median(np.linalg.norm((frame @ motion)[fit.rows >= row], axis=1))),
        gain=value,
        believed=_is_abrupt("station-moved", fit, weight, columns(row), value),
        before=fit.rms(weight),
        after=fit.rms(weight, columns(row)),
        motion=motion,
    )


def _slip(fit: LinearFit, weight: np.ndarray, count: int) -> CourseMistake | None:
    """Of one target, or of all of them by their own ways, from one row on."""
    choices = [(t,) for t in range(count)] + ([tuple(range(count))] if count > 1 else [])
    best: tuple[float, tuple[int, ...], int] | None = None
    for targets in choices:
        cut = _best_cut(fit, weight, lambda row, chosen=targets: _after(fit, chosen, row), len(choices))
        if cut is not None and (best is None or cut[1] > best[0]):
            best = (cut[1], targets, cut[0])
    if best is None:
        return None
    value, targets, row = best
    columns = _after(fit, targets, row)
    sizes = np.linalg.norm(fit.size(weight, columns).reshape(-1, 3), axis=1)
    return CourseMistake(
        id="target-slipped",
        targets=tuple(t for t, size in zip(targets, sizes, strict=True) if size > LEAST_SHARE * sizes.max()),
        row=row,
        move=float(sizes.max()),
        gain=value,
        believed=_is_abrupt("target-slipped", fit, weight, columns, value),
        before=fit.rms(weight),
        after=fit.rms(weight, columns),
    )


def _best_cut(
    fit: LinearFit,
    weight: np.ndarray,
    columns: Callable[[int], Float[np.ndarray, "m 3 b"]],
    choices: int = 1,
    least: int = LEAST_ROWS,
) -> tuple[int, float] | None:
    """The row from which on the columns explain most, and their gain; None where there are too few rows.

    Args:
        fit: of some rows.
        weight: of its points.
        columns: that are free from a row on.
        choices: number of such columns that are tried at every row.
        least: rows on either side.
    """
    rows = np.unique(fit.rows)
    if len(rows) < 2 * least + 2:
        return None
    places = np.arange(least, len(rows) - least + 1)
    stride = max(1, len(places) // MOST_CUTS)
    tried: dict[int, float] = {}
    for near in (places[::stride], None):
        if near is None:
            top = min(tried, key=lambda k: tried[k])
            near = places[np.abs(places - top) < stride]
        tried |= {int(k): fit.objective(weight, columns(int(rows[k]))) for k in near if int(k) not in tried}
    top = min(tried, key=lambda k: tried[k])
    price = columns(int(rows[top])).shape[2]
    value = gain(fit, fit.objective(weight), tried[top], price, _numbers(weight))
    return int(rows[top]), value - 2.0 * float(np.log(len(places) * choices))


def _numbers(weight: np.ndarray) -> float:
    return 3.0 * float((weight > 0.0).sum())


def _after(fit: LinearFit, targets: tuple[int, ...], row: int) -> Float[np.ndarray, "m 3 b"]:
    out = np.zeros((len(fit.rows), 3, 3 * len(targets)))
    for k, t in enumerate(targets):
        chosen = (fit.targets == t) & (fit.rows >= row)
        out[chosen, :, 3 * k : 3 * k + 3] = fit.turned[chosen]
    return out


# Which point belongs to which joints, by geometry alone, where rows were shuffled.
#
# Points and tool positions have the same centre and the same spread in whatever order they stand. From there
# assignment and registration take turns, as closest points do (Besl and McKay 1992), every point being given away
# once.

HEADINGS = 24
"""Headings about the vertical, 15° apart, that are tried for a standing robot. A convention: fewer may miss the registration,
more cost time in proportion."""

ROUNDS = 25
"""Rounds of assignment and registration, at most, from one start. A convention that bounds the time."""

MOST_ROWS = 300
"""Rows, at most, that are paired by an assignment, whose cost grows with their cube. A convention that bounds the time."""

CLEARLY = 0.3
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
        return self.error < CLEARLY * self.next_best


def pair_rows(case: Case) -> Pairing | None:
    """The only order of the measurements that fits the joints; None where none does, or several might."""
    campaign = case.campaign
    T = case.poses(np.arange(len(campaign)))
    whole = campaign.valid.all(axis=1)
    if not whole.all() or not np.isfinite(T).all() or not 8 <= len(campaign) <= MOST_ROWS:
        return None
    best: Pairing | None = None
    for Z in _starts(T, campaign):
        found = _descend(Z, T, campaign, LEVER_SHARE * case.model.robot.reach)
        if found is not None and (best is None or found.error < best.error):
            best = found
            if best.clear and best.error < SOUND_SHARE * case.model.robot.reach:
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
    for _ in range(ROUNDS):
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
        try:
            registration = register_closely(rearranged(campaign, source), T)
        except (CampaignError, np.linalg.LinAlgError):
            return None
        placed = (registration.T_tracker_base @ T)[:, None] @ registration.T_tool_target
        ends, turned = placed[..., :3, 3], placed[:, 0, :3, :3]
    return None


# Rows that cannot be right beside the others: swapped targets, mixed-up pairs, duplicated poses, gross errors.

FAR_QUARTILES = 10.0
"""Of the upper quartile of what the robust fit leaves of the rows. The tails of real robots are heavy: one that leans far back is
off by three times the 95th percentile there, in all rows of that posture, and none of them is wrong."""

FAR = 1e-3
"""Distance, metres, at least, of a grossly wrong row. A convention: a smaller one misses fewer wrong rows and raises more false
alarms."""

MOST_SHARE = 0.2
"""Share of the rows, at most, that may be grossly wrong. A convention: with more, another mistake explains them better."""

MOST_MIXED_UP = 0.5
"""Share of the rows, at most, that may have the points of one another. A convention: beyond half, the rows are in another
order. That all find their place is proof in itself."""

SAME_POSE = 2e-5
"""Difference of joints, at most, of one pose, radians or metres. A convention: what rounding to a thousandth of a degree leaves."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RowFault:
    """Rows, what is wrong with them, and the campaign without it."""

    id: str
    rows: Int[np.ndarray, " k"]
    targets: tuple[int, ...]
    mended: Campaign
    before: float
    """Median distance of these rows, metres."""
    after: float
    """The same, mended; of the other rows, where these are left out."""


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
    usable = np.flatnonzero(np.isfinite(T[:, 0, 3]) & campaign.seen)
    for rows in (usable, *np.array_split(usable, 3)):
        try:
            registration = register_trimmed(campaign.take(rows), T[rows])
        except (CampaignError, np.linalg.LinAlgError):
            continue
        kept = _row_errors(registration, campaign.points, T)
        given = min(given, _mean(kept))
        for a, b in itertools.combinations(range(len(campaign.targets)), 2):
            exchanged = _row_errors(registration, _exchanged(campaign.points, a, b), T)
            swapped = exchanged < 0.3 * kept
            error = _mean(np.where(swapped, exchanged, kept))
            if swapped.any() and (best is None or error < best[0]):
                best = (error, swapped, (a, b))
    if best is None or best[0] > 0.4 * given:
        return None
    error, swapped, (a, b) = best
    if swapped.mean() > 0.5:
        swapped = ~swapped
    points = campaign.points.copy()
    points[swapped] = _exchanged(points[swapped], a, b)
    return RowFault(
        id="target-swapped",
        rows=np.flatnonzero(swapped),
        targets=(a, b),
        mended=replace(campaign, points=points),
        before=given,
        after=error,
    )


def _exchanged(points: np.ndarray, a: int, b: int) -> np.ndarray:
    out = points.copy()
    out[:, [a, b]] = out[:, [b, a]]
    return out


def _row_errors(registration: Registration, points: np.ndarray, T: np.ndarray) -> Float[np.ndarray, " n"]:
    ends = (registration.T_tracker_base @ T)[:, None] @ registration.T_tool_target
    return np.sqrt(np.nansum((points - ends[..., :3, 3]) ** 2, axis=(1, 2)) / np.maximum(_count(points), 1))


def _count(points: np.ndarray) -> Int[np.ndarray, " n"]:
    return (~np.isnan(points[..., 0])).sum(axis=1)


def _mean(errors: np.ndarray) -> float:
    return float(np.nanmean(errors))


def far_rows(fit: LinearFit, rows: int) -> Bool[np.ndarray, " n"]:
    """Rows that are much farther off than the others, from the fit and from the nominal robot.

    A fit that does not follow a row may bend away from it where it stands alone.
    """
    worst = np.zeros(rows)
    np.maximum.at(worst, fit.rows, np.minimum(fit.distance, np.linalg.norm(fit.residual, axis=1)))
    quartile = float(np.quantile(worst[np.unique(fit.rows)], 0.75))
    return worst > max(FAR, FAR_QUARTILES * quartile)


def find_row_fault(case: Case, fit: LinearFit) -> RowFault | None:
    """What is wrong with the rows that are far off, if they are few."""
    campaign = case.campaign
    far = far_rows(fit, len(campaign))
    same = _duplicates(campaign, fit)
    if same is not None:
        return _left_out("duplicate-poses", same, case, fit)
    rows = np.flatnonzero(far)
    share = far[campaign.seen].mean()
    if not len(rows) or share > MOST_MIXED_UP:
        return None
    mixed_up = _mixed_up(case, rows, fit)
    if mixed_up is not None or share > MOST_SHARE:
        return mixed_up
    return _left_out("gross-rows", rows, case, fit)


def _left_out(name: str, rows: np.ndarray, case: Case, fit: LinearFit) -> RowFault:
    concerned = np.isin(fit.rows, rows)
    return RowFault(
        id=name,
        rows=rows,
        targets=(),
        mended=case.campaign.take(np.setdiff1d(np.arange(len(case.campaign)), rows)),
        before=float(np.median(fit.distance[concerned])) if concerned.any() else 0.0,
        after=float(np.median(fit.distance[~concerned])),
    )


def _duplicates(campaign: Campaign, fit: LinearFit) -> Int[np.ndarray, " k"] | None:
    """Rows with the same joints whose points differ by more than any robot repeats."""
    bound = max(FAR, 6.0 * fit.median)
    order = np.lexsort(np.round(campaign.q / SAME_POSE).T)
    near = np.abs(np.diff(campaign.q[order], axis=0)).max(axis=1) < SAME_POSE
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
    others = np.setdiff1d(np.flatnonzero(np.isfinite(T[:, 0, 3]) & campaign.seen), rows)
    try:
        registration = register_closely(campaign.take(others), T[others])
    except (CampaignError, np.linalg.LinAlgError):
        return None
    ends = ((registration.T_tracker_base @ T[rows])[:, None] @ registration.T_tool_target)[..., :3, 3]
    apart = np.nan_to_num(
        np.nanmax(np.linalg.norm(ends[:, None] - campaign.points[rows][None], axis=3), axis=2), nan=1e3
    )
    from scipy.optimize import linear_sum_assignment

    of, taken = linear_sum_assignment(apart)
    if np.median(apart[of, taken]) > 0.2 * np.median(np.diag(apart)):
        return None
    source = np.arange(len(campaign))
    source[rows[of]] = rows[taken]
    mended = rearranged(campaign, source)
    concerned = np.isin(fit.rows, rows)
    return RowFault(
        id="rows-shuffled",
        rows=rows,
        targets=(),
        mended=mended,
        before=float(np.median(fit.distance[concerned])),
        after=float(np.median(apart[of, taken])),
    )


IN_COURSE_SHARE = 0.1
"""Median distance over the reach beyond which no slip, move or drift is looked for. A convention: then the fit itself is wrong."""

LOCAL_ROWS = 240
"""Rows, at most, on which slips, drifts and gross errors are looked for; of a longer campaign every second, or third. A
convention that bounds the time."""

LARGE_CUTS = 24
"""Cuts between rows at which a large move is tried first; those near the best one are tried as well. A convention that bounds
the time."""

LEAST_PART = 6
"""Rows at least on either side of a large move, as many as one half of the rows needs to judge the other. A convention."""

Local = tuple[Finding, Campaign]


def find_in_course(explanation: Explanation) -> Local | None:
    """The one thing that most likely went wrong in its course, if anything did, and the campaign without it."""
    case = _followed(explanation.case)
    swapped = find_swapped(case)
    if swapped is not None:
        return _of_rows(swapped, case)
    step = max(1, int(np.ceil(len(case.campaign) / LOCAL_ROWS)))
    rows = np.arange(0, len(case.campaign), step)
    fit = fit_linearly(case, rows)
    if fit is None or fit.median > IN_COURSE_SHARE * case.model.robot.reach:
        return None
    fault = find_row_fault(case, fit)
    weight = np.ones(len(fit.rows))
    without = weight if fault is None else (~np.isin(fit.rows, fault.rows)).astype(float)
    plain = find_course_mistake(fit, weight, len(case.campaign.targets))
    if plain is not None and plain.id != "drift" and step > 1:  # the rows between those that were looked at
        between = np.arange(max(plain.row - step, 0), plain.row)
        closer = fit_linearly(case, np.union1d(rows, between))
        again = (
            None
            if closer is None
            else find_course_mistake(closer, np.ones(len(closer.rows)), len(case.campaign.targets))
        )
        plain = again or plain
    if fault is None:
        return None if plain is None else _of_course(plain, explanation, fit)
    if fault.id in ("duplicate-poses", "rows-shuffled"):
        return _of_rows(fault, case)
    numbers = 3.0 * len(fit.rows)
    columns = 3 * int((without == 0.0).sum())
    by_rows = gain(fit, fit.objective(weight), fit.objective(without), columns, numbers)
    if plain is not None and plain.gain > by_rows:
        return _of_course(plain, explanation, fit)
    return _of_rows(fault, case)


def _followed(case: Case) -> Case:
    """With the motion of its reference points taken out, where that does not make it worse."""
    if not case.campaign.reference_points:
        return case
    followed = replace(case, campaign=compensate_drift(case.campaign).campaign)
    return followed if held_out_error(followed) <= 1.1 * held_out_error(case) else case


def _of_rows(fault: RowFault, case: Case) -> Local:
    campaign = case.campaign
    ids = tuple(campaign.ids[i] for i in fault.rows)
    shown = ", ".join(ids[:12]) + (f", … ({len(ids)} rows)" if len(ids) > 12 else "")
    names = tuple(campaign.targets[t] for t in fault.targets)
    fixes = {
        "target-swapped": f"exchange {' and '.join(names)} in the rows with id {shown}",
        "gross-rows": f"correct the rows with id {shown}, or leave them out",
        "duplicate-poses": f"the rows with id {shown} have the same joints as others, but other points: correct or leave them out",
        "rows-shuffled": f"the points of the rows with id {shown} belong to each other's joints: pair them again",
    }
    confidence = float(np.clip(1.0 - fault.after / max(fault.before, 1e-9), 0.0, 0.99))
    finding = Finding(
        id=fault.id,
        subject=names or ids,
        error_before=fault.before,
        error_after=fault.after,
        confidence=confidence,
        fix=fixes[fault.id],
    )
    return finding, fault.mended


def _of_course(mistake: CourseMistake, explanation: Explanation, fit: LinearFit) -> Local:
    campaign = explanation.case.campaign
    subject: tuple[str, ...] = ()
    mended = campaign
    if mistake.id == "drift":
        fix = (
            f"tracker or base moved by about {mistake.move * 1e3:.1f} mm from the first row to the last: measure again, with "
            "fixed reference points beside each pose, which are followed"
        )
    elif mistake.id == "station-moved":
        subject, fix = (campaign.ids[mistake.row],), _moved_fix(campaign, mistake.row, mistake.move)
        turn = se3.exp(mistake.motion[3:]).T
        back = se3.pose(turn, fit.centre - turn @ (fit.centre + mistake.motion[:3]))
        mended = _brought_back(campaign, mistake.row, back)
    else:
        subject = tuple(campaign.targets[t] for t in mistake.targets)
        row = campaign.row(mistake.row)
        slipped = f"{', '.join(subject)} slipped by {mistake.move * 1e3:.1f} mm on the robot"
        other = "give it another name from there on, or identify" if campaign.rotations is None else "identify"
        fix = (
            f"{slipped} before {row}: {other} the rows before and after by themselves: {_parts(campaign, mistake.row)}"
        )
        mended = _apart(campaign, mistake)
    finding = Finding(
        id=mistake.id,
        subject=subject,
        error_before=mistake.before,
        error_after=mistake.after,
        confidence=mistake.confidence,
        fix=fix,
    )
    return finding, mended


def find_large_move(case: Case) -> Local | None:
    """A move of the tracker or the base between two rows that is too large to be linear, and the campaign without it.

    The rows before and after every cut are registered by themselves; the frame of one is brought to that of the other.
    """
    T = case.poses(np.arange(len(case.campaign)))
    usable = np.flatnonzero(np.isfinite(T[:, 0, 3]) & case.campaign.seen)
    least = max(LEAST_PART, rows_to_register(case.campaign))
    places = np.arange(least, len(usable) - least + 1)
    if not len(places):
        return None
    tried: dict[int, tuple[float, Registration, Registration] | None] = {}
    stride = max(1, len(places) // LARGE_CUTS)
    near = places[::stride].tolist()
    while True:
        tried |= {place: _registered_apart(case.campaign, T, usable, place) for place in near}
        registered = {place: parts for place, parts in tried.items() if parts is not None}
        if not registered:
            return None
        top = min(registered, key=lambda place: registered[place][0])
        stride = max(1, stride // 2)
        near = [k for k in (top - stride, top + stride) if places[0] <= k <= places[-1] and k not in tried]
        if not near and stride == 1:
            break
    _, first, second = registered[top]
    row = int(usable[top])
    back = first.T_tracker_base @ se3.inverse(second.T_tracker_base)
    together = _brought_back(case.campaign, row, back)
    before, after = held_out_error(case), held_out_error(replace(case, campaign=together))
    points = case.campaign.points[usable[usable >= row]]
    move = float(np.nanmedian(np.linalg.norm(points @ back[:3, :3].T + back[:3, 3] - points, axis=-1)))
    # of all that can be tried, this alone brings nearly all rows together
    if not after < before * np.exp(-2.0 * PER_MISTAKE):
        return None
    finding = Finding(
        id="station-moved",
        subject=(case.campaign.ids[row],),
        error_before=before,
        error_after=after,
        confidence=float(np.clip(1.0 - after / before, 0.0, 0.99)),
        fix=_moved_fix(case.campaign, row, move),
    )
    return finding, together


def _registered_apart(
    campaign: Campaign, T: np.ndarray, usable: np.ndarray, place: int
) -> tuple[float, Registration, Registration] | None:
    """Typical distance of all rows, those before a place and those from there on registered by themselves; and how."""
    distances: list[np.ndarray] = []
    registrations: list[Registration] = []
    for rows in (usable[:place], usable[place:]):
        part = campaign.take(rows)
        try:
            registrations.append(register_closely(part, T[rows]))
        except (CampaignError, np.linalg.LinAlgError):
            return None
        ends = ((registrations[-1].T_tracker_base @ T[rows])[:, None] @ registrations[-1].T_tool_target)[..., :3, 3]
        distances.append(np.nanmedian(np.linalg.norm(part.points - ends, axis=2), axis=1))
    return typical(np.concatenate(distances)), registrations[0], registrations[1]


def _brought_back(campaign: Campaign, row: int, back: np.ndarray) -> Campaign:
    """The campaign with what was measured from a row on brought to the frame of the rows before."""
    points, rotations = campaign.points.copy(), campaign.rotations
    points[row:] = points[row:] @ back[:3, :3].T + back[:3, 3]
    if rotations is not None:
        rotations = np.concatenate([rotations[:row], back[:3, :3] @ rotations[row:]])
    return replace(campaign, points=points, rotations=rotations)


def _moved_fix(campaign: Campaign, row: int, move: float) -> str:
    return (
        f"tracker or base moved by about {move * 1e3:.1f} mm before {campaign.row(row)}: the rows before and after are two "
        f"campaigns, to be identified by themselves: {_parts(campaign, row)}"
    )


def _parts(campaign: Campaign, row: int) -> str:
    """Options that choose the rows before a row, and those from there on."""
    first, cut, last = (campaign.row_of(number) for number in (0, row, len(campaign) - 1))
    return f"--rows {first}:{cut} and --rows {cut}:{last + 1}"


def _apart(campaign: Campaign, mistake: CourseMistake) -> Campaign:
    """With a target's measurements after a slip as those of another target; of poses, those before it alone."""
    after = np.arange(len(campaign)) >= mistake.row
    if campaign.rotations is not None:
        keep = ~after if after.mean() <= 0.5 else after
        return campaign.take(np.flatnonzero(keep))
    points, names = [campaign.points.copy()], list(campaign.targets)
    uncertainty = None if campaign.uncertainty is None else [campaign.uncertainty]
    for t in mistake.targets:
        moved = np.where(after[:, None], campaign.points[:, t], np.nan)
        points[0][after, t] = np.nan
        points.append(moved[:, None])
        names.append(f"{campaign.targets[t]}_slipped")
        if uncertainty is not None and campaign.uncertainty is not None:
            uncertainty.append(campaign.uncertainty[:, t : t + 1])
    return replace(
        campaign,
        targets=tuple(names),
        points=np.concatenate(points, axis=1),
        uncertainty=None if uncertainty is None else np.concatenate(uncertainty, axis=1),
    )
