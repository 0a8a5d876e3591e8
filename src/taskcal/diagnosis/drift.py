"""Drifts and slips during a campaign: a target slipped, the tracker or base moved, or drifted.

Each is a few more columns of the linear fit, free from one row on or growing with the rows; the gain is that of the logarithm of
the likelihood, noise unknown, less the price of the columns (Schwarz 1978) and of the rows tried.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.campaigns.drift import compensate_drift
from taskcal.diagnosis.fits import LinearFit, fit_linearly, frame_columns, registered, target_poses
from taskcal.diagnosis.hypotheses import Case, Finding, looked_for
from taskcal.diagnosis.rows import Local, find_row_fault, find_swapped
from taskcal.diagnosis.search import MISTAKE_CHARGE, Explanation, held_out_error, rows_to_register, typical
from taskcal.geometry import se3
from taskcal.registration.registration import Registration

MIN_MEDIANS = 1.5
"""Displacement over the median distance, at least, of a point that moved. A convention: less does not matter beside what the
fit leaves."""

MIN_MOVE_M = 1e-3
"""Displacement at least, metres, of a point that moved. A convention: a smaller one misses fewer moves and raises more false
alarms. Less only counts where it raised the error by `MIN_SMALL_MOVE_FACTOR`."""

MIN_SMALL_MOVE_FACTOR = 2.0
"""Factor at least by which a small move raised the error: more than half of it is then the move's. Where nothing moved it was 1.3
at most, on five measured robots and on 30 drawn ones with gear errors in rows that follow a joint."""

MIN_FACTOR = 1.05
"""Factor at least by which a slip, move or drift raised the root mean square error. A convention: less than 5 % changes nothing
that matters."""

MIN_SLIP_SHARE = 0.5
"""Share of the farthest target's displacement, at least, that a target moved by which slipped as well. A convention: halfway
between still and moved alike."""

MIN_CUT_ROWS = 4
"""Rows at least on either side of a slip. A convention: one row tells the displacement, the others confirm it."""

MIN_MOVED_SHARE = 0.1
"""Share of the rows, at least, on either side of a move. A convention: fewer in one corner of the workspace may lack what all
others explain."""

MAX_CUTS = 60
"""Cuts between rows, at most, at which a slip is tried first; the best one's neighbours are tried as well. A convention: more
cost time in proportion."""


MAX_FOLLOWED_RATIO = 1.1
"""Error with the reference points followed over that without, at most, where they are followed. A convention: as good as equal."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DriftOrSlip(ABC):
    """A slip, a move of the tracker or the base, or a drift; each class is one of them, and owns its evidence and its fix."""

    id: ClassVar[str]
    min_gain: ClassVar[float]
    """Of twice the logarithm of the likelihood. What a robot leaves unexplained is not white and follows the rows by chance: on 60
    drawn robots with gear errors, half of them measured in the order of their first joint, slips gained 4 at most, drifts 39."""
    min_abrupt_gain: ClassVar[float] = 0.0
    """Of the same, beside a smooth motion: what a robot leaves in rows that follow a joint changes smoothly, a slip or a move does
    not. On those robots with gear errors and compliance moves gained 28 at most; moves by 2 mm gained 36 at least, slips by 2 mm
    40."""

    row: int
    """The first row after a slip or a move, as the campaign counts."""
    move: float
    """How far it moved the points, metres."""
    gain: float
    """Gain of twice the logarithm of the likelihood, less the price of the columns."""
    significant: bool
    """Whether it is beyond doubt."""
    before: float
    """Root mean square distance of the points, the geometry free within its tolerances, metres."""
    after: float
    """The same with what happened taken into account."""

    @classmethod
    @abstractmethod
    def find(cls, fit: LinearFit, weight: Float[np.ndarray, " m"], count: int) -> "DriftOrSlip | None":
        """The most likely one; None where there are too few rows.

        Args:
            fit: of some rows.
            weight: of its points.
            count: of targets.
        """

    @abstractmethod
    def without(self, campaign: Campaign, fit: LinearFit) -> tuple[tuple[str, ...], str, Campaign]:
        """Subject, a fix in one line, and the campaign without the mistake."""

    @classmethod
    def is_abrupt(cls, fit: LinearFit, weight: np.ndarray, columns: Float[np.ndarray, "m 3 b"], value: float) -> bool:
        """Whether a slip or a move with a gain is beyond doubt, a smooth motion beside it."""
        smooth = _smooth(fit)
        both = np.concatenate([smooth, columns], axis=2)
        more = gain(fit, fit.objective(weight, smooth), fit.objective(weight, both), columns.shape[2], _numbers(weight))
        least = cls.min_abrupt_gain + 2.0 * float(np.log(len(np.unique(fit.rows))))
        return value > cls.min_gain and more > least

    def local(self, campaign: Campaign, fit: LinearFit) -> Local:
        """The finding, and the campaign without it; its confidence is 0.63 for the least gain that is significant, up to 0.99."""
        subject, fix, mended = self.without(campaign, fit)
        finding = Finding(
            id=self.id,
            subject=subject,
            error_before=self.before,
            error_after=self.after,
            confidence=float(np.clip(1.0 - np.exp(-self.gain / self.min_gain), 0.0, 0.99)),
            fix=fix,
        )
        return finding, mended


@looked_for("drift", "target-slipped")
@dataclass(frozen=True, eq=False, kw_only=True)
class Slip(DriftOrSlip):
    """One target, or each of them by its own way, moved on the robot before one row."""

    id = "target-slipped"
    min_gain = 25.0
    min_abrupt_gain = 10.0

    targets: tuple[int, ...]

    @classmethod
    def find(cls, fit: LinearFit, weight: np.ndarray, count: int) -> "Slip | None":
        """Find the most likely one (`DriftOrSlip.find`)."""
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
        return cls(
            targets=tuple(t for t, size in zip(targets, sizes, strict=True) if size > MIN_SLIP_SHARE * sizes.max()),
            row=row,
            move=float(sizes.max()),
            gain=value,
            significant=cls.is_abrupt(fit, weight, columns, value),
            before=fit.rms(weight),
            after=fit.rms(weight, columns),
        )

    def without(self, campaign: Campaign, fit: LinearFit) -> tuple[tuple[str, ...], str, Campaign]:
        """The measurements after the slip are those of another target; of poses, the longer part alone is kept."""
        names = tuple(campaign.targets[t] for t in self.targets)
        other = "give it another name from there on, or identify" if campaign.rotations is None else "identify"
        fix = (
            f"{', '.join(names)} slipped by {self.move * 1e3:.1f} mm on the robot before {campaign.row(self.row)}: {other} the "
            f"rows before and after by themselves: {_parts(campaign, self.row)}"
        )
        after = np.arange(len(campaign)) >= self.row
        if campaign.rotations is not None:
            keep = ~after if after.mean() <= 0.5 else after
            return names, fix, campaign.take(np.flatnonzero(keep))
        chosen = list(self.targets)
        points = campaign.points.copy()
        moved = np.where(after[:, None, None], points[:, chosen], np.nan)
        points[after[:, None] & np.isin(np.arange(len(campaign.targets)), chosen)] = np.nan
        u = campaign.uncertainty
        mended = replace(
            campaign,
            targets=(*campaign.targets, *(f"{name}_slipped" for name in names)),
            points=np.concatenate([points, moved], axis=1),
            uncertainty=None if u is None else np.concatenate([u, u[:, chosen]], axis=1),
        )
        return names, fix, mended


@looked_for("drift", "station-moved")
@dataclass(frozen=True, eq=False, kw_only=True)
class StationMove(DriftOrSlip):
    """Tracker or base moved before one row: all points as one rigid body."""

    id = "station-moved"
    min_gain = 60.0
    min_abrupt_gain = 30.0

    motion: Float[np.ndarray, " 6"]
    """Translation of the points' centre and rotation about it, metres and radians."""

    @classmethod
    def find(cls, fit: LinearFit, weight: np.ndarray, count: int) -> "StationMove | None":
        """Find the most likely one (`DriftOrSlip.find`)."""
        frame = frame_columns(fit.places)

        def columns(row: int) -> Float[np.ndarray, "m 3 6"]:
            return frame * (fit.rows >= row)[:, None, None]

        least = max(MIN_CUT_ROWS, int(np.ceil(MIN_MOVED_SHARE * len(np.unique(fit.rows)))))
        cut = _best_cut(fit, weight, columns, least=least)
        if cut is None:
            return None
        row, value = cut
        motion = fit.size(weight, columns(row))
        return cls(
            row=row,
            move=float(np.median(np.linalg.norm((frame @ motion)[fit.rows >= row], axis=1))),
            gain=value,
            significant=cls.is_abrupt(fit, weight, columns(row), value),
            before=fit.rms(weight),
            after=fit.rms(weight, columns(row)),
            motion=motion,
        )

    def without(self, campaign: Campaign, fit: LinearFit) -> tuple[tuple[str, ...], str, Campaign]:
        """The measurements after the move are those of another station."""
        turn = se3.exp(self.motion[3:]).T
        back = se3.pose(turn, fit.centre - turn @ (fit.centre + self.motion[:3]))
        mended = _brought_back(campaign, self.row, back)
        return (campaign.ids[self.row],), _moved_fix(campaign, self.row, self.move), mended


@looked_for("drift", "drift")
@dataclass(frozen=True, eq=False, kw_only=True)
class SlowDrift(DriftOrSlip):
    """Tracker or base moved with the rows; significant where it grows evenly, and as likely as what grows faster at one end."""

    id = "drift"
    min_gain = 60.0

    @classmethod
    def find(cls, fit: LinearFit, weight: np.ndarray, count: int) -> "SlowDrift":
        """Find the most likely one (`DriftOrSlip.find`)."""
        time, numbers, before = _time(fit), _numbers(weight), fit.objective(weight)
        curved = _smooth(fit)
        even = curved[:, :, :6]
        gains = [gain(fit, before, fit.objective(weight, c), c.shape[2], numbers) for c in (even, curved)]
        moved = even @ fit.size(weight, even)
        return cls(
            row=int(fit.rows.min()),
            # from the first row to the last
            move=float(np.median(np.linalg.norm(moved, axis=1) / np.maximum(np.abs(time), 0.05))),
            gain=max(gains),
            significant=gains[0] > cls.min_gain,
            before=fit.rms(weight),
            after=fit.rms(weight, (even, curved)[int(np.argmax(gains))]),
        )

    def without(self, campaign: Campaign, fit: LinearFit) -> tuple[tuple[str, ...], str, Campaign]:
        """Nothing mends it but measuring again."""
        fix = (
            f"tracker or base moved by about {self.move * 1e3:.1f} mm from the first row to the last: measure again, with "
            "fixed reference points beside each pose, which are followed"
        )
        return (), fix, campaign


DRIFTS_AND_SLIPS: tuple[type[DriftOrSlip], ...] = (Slip, StationMove, SlowDrift)
"""The first of those of equal gain is taken."""


def find_most_likely(fit: LinearFit, weight: Float[np.ndarray, " m"], count: int) -> DriftOrSlip | None:
    """The most likely slip, move or drift, if there is one beyond doubt: of which of them it is the gain decides alone."""
    found = [
        m
        for m in (kind.find(fit, weight, count) for kind in DRIFTS_AND_SLIPS)
        if m is not None
        and m.gain > 0.0
        and m.move > MIN_MEDIANS * fit.median
        and m.before > (MIN_FACTOR if m.move > MIN_MOVE_M else MIN_SMALL_MOVE_FACTOR) * m.after
    ]
    return max(found, key=lambda m: m.gain) if any(m.significant for m in found) else None


def gain(fit: LinearFit, before: float, after: float, columns: int, numbers: float) -> float:
    """Gain of twice the logarithm of the likelihood, less the price of the columns."""
    freedom = max(numbers - fit.columns.shape[2] / 2.0, 6.0)
    return float(freedom * np.log(max(before, 1e-12) / max(after, 1e-12)) - columns * np.log(numbers))


def _time(fit: LinearFit) -> Float[np.ndarray, " m"]:
    return (fit.rows - fit.rows.mean()) / max(float(np.ptp(fit.rows)), 1.0)


def _smooth(fit: LinearFit) -> Float[np.ndarray, "m 3 12"]:
    """All points as one rigid body, evenly with the rows, and with their square."""
    time, frame = _time(fit), frame_columns(fit.places)
    return np.concatenate([frame * (time**power)[:, None, None] for power in (1, 2)], axis=2)


def _best_cut(
    fit: LinearFit,
    weight: np.ndarray,
    columns: Callable[[int], Float[np.ndarray, "m 3 b"]],
    choices: int = 1,
    least: int = MIN_CUT_ROWS,
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
    stride = max(1, len(places) // MAX_CUTS)
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


MAX_MEDIAN_SHARE = 0.1
"""Median distance over the reach beyond which no slip, move or drift is looked for. A convention: then the fit itself is wrong."""

MAX_FITTED_ROWS = 240
"""Rows, at most, on which slips, drifts and gross errors are looked for; of a longer campaign every second, or third. A
convention that bounds the time."""

MAX_LARGE_CUTS = 24
"""Cuts between rows at which a large move is tried first; those near the best one are tried as well. A convention that bounds
the time."""

MIN_PART_ROWS = 6
"""Rows at least on either side of a large move, as many as one half of the rows needs to judge the other. A convention."""


def find_drift_or_slip(explanation: Explanation) -> Local | None:
    """The one thing that most likely went wrong in its course, if anything did, and the campaign without it."""
    case = _followed(explanation.case)
    swapped = find_swapped(case)
    if swapped is not None:
        return swapped.local(case.campaign)
    step = max(1, int(np.ceil(len(case.campaign) / MAX_FITTED_ROWS)))
    rows = np.arange(0, len(case.campaign), step)
    fit = fit_linearly(case, rows)
    if fit is None or fit.median > MAX_MEDIAN_SHARE * case.reach:
        return None
    fault = find_row_fault(case, fit)
    weight = np.ones(len(fit.rows))
    without = weight if fault is None else (~np.isin(fit.rows, fault.rows)).astype(float)
    plain = find_most_likely(fit, weight, len(case.campaign.targets))
    if plain is not None and plain.id != "drift" and step > 1:  # the rows between those that were looked at
        between = np.arange(max(plain.row - step, 0), plain.row)
        closer = fit_linearly(case, np.union1d(rows, between))
        again = (
            None if closer is None else find_most_likely(closer, np.ones(len(closer.rows)), len(case.campaign.targets))
        )
        plain = again or plain
    if fault is None:
        return None if plain is None else plain.local(explanation.case.campaign, fit)
    if fault.id in ("duplicate-poses", "rows-shuffled"):
        return fault.local(case.campaign)
    numbers = 3.0 * len(fit.rows)
    columns = 3 * int((without == 0.0).sum())
    by_rows = gain(fit, fit.objective(weight), fit.objective(without), columns, numbers)
    if plain is not None and plain.gain > by_rows:
        return plain.local(explanation.case.campaign, fit)
    return fault.local(case.campaign)


def _followed(case: Case) -> Case:
    """Compensate the motion of the reference points, unless that increases the error."""
    if not case.campaign.reference_points:
        return case
    followed = replace(case, campaign=compensate_drift(case.campaign).campaign)
    return followed if held_out_error(followed) <= MAX_FOLLOWED_RATIO * held_out_error(case) else case


def find_large_move(case: Case) -> Local | None:
    """A move of the tracker or the base between two rows that is too large to be linear, and the campaign without it.

    The rows before and after every cut are registered by themselves; the frame of one is brought to that of the other.
    """
    T, usable = case.poses(np.arange(len(case.campaign))), case.usable()[0]
    least = max(MIN_PART_ROWS, rows_to_register(case.campaign))
    places = np.arange(least, len(usable) - least + 1)
    if not len(places):
        return None
    tried: dict[int, tuple[float, Registration, Registration] | None] = {}
    stride = max(1, len(places) // MAX_LARGE_CUTS)
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
    if not after < before * np.exp(-2.0 * MISTAKE_CHARGE):
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
        registration = registered(part, T[rows])
        if registration is None:
            return None
        registrations.append(registration)
        ends = target_poses(registration, T[rows])[..., :3, 3]
        distances.append(np.nanmedian(np.linalg.norm(part.points - ends, axis=2), axis=1))
    return typical(np.concatenate(distances)), registrations[0], registrations[1]


def _brought_back(campaign: Campaign, row: int, back: np.ndarray) -> Campaign:
    """The campaign with what was measured from a row on as that of a second station, by its pose in the frame of the first."""
    first = "1" if campaign.stations is None else campaign.stations.names[0]
    stations = Stations(
        names=(first, "2" if campaign.stations is None else f"{first} moved"),
        of=(np.arange(len(campaign)) >= row).astype(int),
        T_first_station=np.tile(np.eye(4), (2, 1, 1)),
    )
    return replace(campaign, stations=stations).carried(np.stack([np.eye(4), back]))


def _moved_fix(campaign: Campaign, row: int, move: float) -> str:
    return (
        f"tracker or base moved by about {move * 1e3:.1f} mm before {campaign.row(row)}: name the rows before and those from there "
        "on as two stations in a column station (--fix writes it), and each has a frame of its own in a fit"
    )


def _parts(campaign: Campaign, row: int) -> str:
    """Options that choose the rows before a row, and those from there on."""
    first, cut, last = (campaign.row_of(number) for number in (0, row, len(campaign) - 1))
    return f"--rows {first}:{cut} and --rows {cut}:{last + 1}"
