"""Many robots: their calibrations in one table, what changed from each to the next, and robots unlike the others."""

import os
import re
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from itertools import pairwise
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.drift import compensate_drift
from taskcal.errors import FileError, TaskcalError
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.comparison import LEVEL, ChangedParameter, Resemblance, compare
from taskcal.identification.holdout import Holdout, hold_out
from taskcal.identification.identify import fit_nominal, identify_parameters
from taskcal.identification.options import FitOptions
from taskcal.identification.uncertainty_budget import budget_at
from taskcal.io.files import write_whole
from taskcal.io.text_file import read_bytes
from taskcal.planning.workers import side_by_side
from taskcal.reading.reader import read_campaign
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit
from taskcal.short_repr import short_repr
from taskcal.tables.forms import table_suffixes

if TYPE_CHECKING:
    import pandas as pd


# The calibrations and campaigns of many robots, as they lie in a folder: a folder for each robot, or a file for each.

CALIBRATION = ".json"


@dataclass(frozen=True, kw_only=True)
class RobotFiles:
    """The files of one robot, relative to the fleet's folder."""

    robot: str
    """The first folder below the fleet's, or the name of a file that lies in that itself."""
    calibrations: tuple[str, ...]
    campaigns: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class FleetFiles:
    """All files of a fleet."""

    folder: Path
    robots: tuple[RobotFiles, ...]
    """By name."""
    others: tuple[str, ...]
    """Files that are neither, by their endings."""


@dataclass(frozen=True, kw_only=True)
class SentFile:
    """A file's name and content, for a machine that may not see the folder."""

    name: str
    content: bytes


def find_fleet(folder: str | Path) -> FleetFiles:
    """Look through a folder and all below it, but for those that are hidden.

    Raises:
        FileError: there is no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileError(folder, "is not a folder; name one with a folder, or a calibration, for each robot")
    calibrations: dict[str, list[str]] = {}
    campaigns: dict[str, list[str]] = {}
    others: list[str] = []
    for name in sorted(_names(folder)):
        path = Path(name)
        robot = path.parts[0] if len(path.parts) > 1 else path.stem
        suffix = path.suffix.lower()
        if suffix == CALIBRATION:
            calibrations.setdefault(robot, []).append(name)
        elif suffix in table_suffixes():
            campaigns.setdefault(robot, []).append(name)
        else:
            others.append(name)
    robots = (
        RobotFiles(
            robot=robot,
            calibrations=tuple(calibrations.get(robot, ())),
            campaigns=tuple(campaigns.get(robot, ())),
        )
        for robot in sorted({*calibrations, *campaigns})
    )
    return FleetFiles(folder=folder, robots=tuple(robots), others=tuple(others))


def _names(folder: Path) -> Generator[str, None, None]:
    """Names of all files, relative to the folder, with slashes."""
    for place, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in files:
            if not name.startswith("."):
                yield (Path(place) / name).relative_to(folder).as_posix()


def read_file(folder: Path, name: str) -> SentFile:
    """A file to be sent.

    Raises:
        FileError: it cannot be read.
    """
    return SentFile(name=name, content=read_bytes(folder / name))


@contextmanager
def laid_out(files: Iterable[SentFile]) -> Generator[Path, None, None]:
    """A folder in which files that were sent lie as they did, for as long as they are read.

    Raises:
        FileError: there is no room for them.
    """
    with TemporaryDirectory(prefix="taskcal-fleet-") as name:
        folder = Path(name)
        for file in files:
            path = folder / file.name
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(file.content)
            except OSError as error:
                message = f"cannot be copied to {folder}: {error.strerror or error}; name a folder with room in TMPDIR"
                raise FileError(file.name, message) from error
        yield folder


def reason_of(refusal: Exception, folder: Path) -> str:
    """State a refusal of a file in a folder, with the file's name in the fleet's."""
    return str(refusal).replace(f"{folder}{os.sep}", "")


# Campaigns of a fleet that are not identified yet: each identified as by ``taskcal identify``, side by side.

FOLDS = 5
"""Parts that are held out in turn, so that each calibration says what it predicts."""


@dataclass(frozen=True, kw_only=True)
class IdentifiedCampaign:
    """What became of a campaign."""

    campaign: str
    calibration: str
    """The file that was written, or would have been."""
    refusal: str | None
    """Why there is none."""


def without_calibration(robot: RobotFiles) -> tuple[str, ...]:
    """Campaigns of a robot beside which there is no calibration of the same name."""
    return tuple(name for name in robot.campaigns if _beside(name) not in robot.calibrations)


def _beside(campaign: str) -> str:
    return str(PurePosixPath(campaign).with_suffix(".json"))


def identify_campaigns(
    files: FleetFiles, model: ErrorModel, *, folds: int = FOLDS, engine: str = "loky", workers: int = -1
) -> Generator[IdentifiedCampaign, None, None]:
    """Identify every campaign that has no calibration, and write it beside the campaign, as ``NAME.json``.

    Args:
        files: of the fleet.
        model: of all robots.
        folds: parts that are held out in turn; the calibration is that of all rows.
        engine: of `side_by_side`.
        workers: how many; −1 for one per core.

    Yields:
        each as it is done; one that cannot be read or identified with the reason.

    Raises:
        TaskcalError: a calibration cannot be written.
    """
    sent = _sent_campaign([name for robot in files.robots for name in without_calibration(robot)], files.folder)
    with closing(side_by_side(partial(_identified, model, folds), sent, engine, workers)) as results:
        for name, text, refusal in results:
            if text is not None:
                write_whole(files.folder / _beside(name), text)
            yield IdentifiedCampaign(campaign=name, calibration=_beside(name), refusal=refusal)


def _sent_campaign(names: Sequence[str], folder: Path) -> Generator[SentFile | tuple[str, str], None, None]:
    """Files as there is room for them, or a name and the reason why it cannot be read."""
    for name in names:
        try:
            yield read_file(folder, name)
        except TaskcalError as refusal:
            yield name, reason_of(refusal, folder)


def _identified(model: ErrorModel, folds: int, sent: SentFile | tuple[str, str]) -> tuple[str, str | None, str | None]:
    """Name, the calibration's text, and the reason why there is none."""
    if isinstance(sent, tuple):
        return sent[0], None, sent[1]
    with laid_out([sent]) as folder:
        try:
            campaign = read_campaign(folder / sent.name, model.robot)
            followed = compensate_drift(campaign)
            campaign = replace(followed.campaign, notes=(*campaign.notes, *followed.remarks))
            return sent.name, _fitted(model, campaign, folds).to_text(), None
        except TaskcalError as refusal:
            return sent.name, None, reason_of(refusal, folder)


def _fitted(model: ErrorModel, campaign: Campaign, folds: int) -> Calibration:
    def fit(rows: Campaign) -> Calibration:
        return identify_parameters(model, rows)

    def nominal(rows: Campaign) -> Calibration:
        return fit_nominal(model, rows, FitOptions())

    return hold_out(fit, campaign, Holdout(folds=folds), nominal)


# The calibrations of one robot in their order of time, and what changed from each to the next.

MOST_POSES = 50
"""At which the stated uncertainty of a calibration is taken."""

MUCH_WORSE = 1.6
"""Times the fitted error, beyond which rows that were held out say that there were too few."""

CLEAR = 2.0
"""Standard errors of the difference from which on a parameter is kept as changed."""

DATE = re.compile(r"(?<!\d)(\d{4})[-_.]?(\d{2})[-_.]?(\d{2})(?!\d)")


@dataclass(frozen=True, kw_only=True)
class Estimates:
    """What a calibration found, to be held beside that of other robots."""

    kind: str
    """Digest of the nominal robot."""
    names: tuple[str, ...]
    units: tuple[ShownUnit, ...]
    """In which people see the parameters."""
    values: Float[np.ndarray, " p"]
    """Metres and radians."""
    errors: Float[np.ndarray, " p"]
    """Standard errors."""


@dataclass(frozen=True, kw_only=True)
class FleetCalibration:
    """One calibration of one robot: lengths in metres, None where the file does not tell."""

    robot: str
    file: str
    model: str
    """Name of the nominal robot."""
    date: str
    """The last in the file's name, or in that of its folders; else when it was identified."""
    rows: int
    nominal: float | None
    """Mean error of the nominal robot on rows that were held out."""
    fitted: float
    """On those that were fitted."""
    held_out: float | None
    """On those that were held out."""
    stated: float
    """Standard uncertainty in space at a single pose among those measured, root mean square."""
    remarks: tuple[str, ...]

    @property
    def verdict(self) -> Literal["good", "too few rows", "no better", "not checked"]:
        """Verdict of the held-out rows."""
        if self.held_out is None or self.nominal is None:
            return "not checked"
        if self.held_out >= self.nominal:
            return "no better"
        return "too few rows" if self.held_out > MUCH_WORSE * self.fitted else "good"


@dataclass(frozen=True, kw_only=True)
class Change:
    """From one calibration of a robot to its next, as `compare` finds it; lengths in metres."""

    robot: str
    before: str
    """File of the earlier one."""
    after: str
    rms: float
    expected: float
    """That their uncertainties alone would give."""
    excess: float
    chance: float
    """That a robot that has not changed shows as much."""
    unexplained: float
    resembles: tuple[Resemblance, ...]
    parameters: tuple[ChangedParameter, ...]
    """Those that differ by more than two standard errors, the most changed first."""

    def verdict(self, level: float) -> Literal["unchanged", "small", "changed"]:
        """Verdict as `Comparison.verdict`, at a level that allows for the number of comparisons."""
        if self.chance >= level:
            return "unchanged"
        return "changed" if self.excess > self.unexplained else "small"


@dataclass(frozen=True, kw_only=True)
class RobotHistory:
    """What the files of one robot tell."""

    robot: str
    calibrations: tuple[FleetCalibration, ...] = ()
    """The earliest first."""
    changes: tuple[Change, ...] = ()
    latest: Estimates | None = None
    skipped: tuple[tuple[str, str], ...] = ()
    """Files that could not be read, and why."""
    remarks: tuple[str, ...] = ()
    """What could not be compared, and why."""


@dataclass(frozen=True, kw_only=True)
class SentRobot:
    """A robot's calibrations, to be looked at."""

    robot: str
    files: tuple[SentFile, ...]
    skipped: tuple[tuple[str, str], ...] = ()
    """Files that could not be read where they lie, and why."""


def follow_robot(sent: SentRobot) -> RobotHistory:
    """Read a robot's calibrations and compare each with the one before it."""
    read: list[tuple[FleetCalibration, Calibration]] = []
    skipped = list(sent.skipped)
    with laid_out(sent.files) as folder:
        for file in sent.files:
            try:
                calibration = load_calibration(folder / file.name)
                read.append((_described(sent.robot, file.name, calibration), calibration))
            except TaskcalError as refusal:
                skipped.append((file.name, reason_of(refusal, folder)))
    read.sort(key=lambda pair: (pair[0].date, pair[0].file))
    changes: list[Change] = []
    remarks: list[str] = []
    for (early, before), (late, after) in pairwise(read):
        try:
            changes.append(_change(early, late, before, after))
        except TaskcalError as refusal:
            remarks.append(f"{late.file} was not compared with {early.file}: {refusal}")
    return RobotHistory(
        robot=sent.robot,
        calibrations=tuple(row for row, _ in read),
        changes=tuple(changes),
        latest=_estimates(read[-1][1]) if read else None,
        skipped=tuple(skipped),
        remarks=tuple(remarks),
    )


def _described(robot: str, name: str, calibration: Calibration) -> FleetCalibration:
    held_out = calibration.held_out
    return FleetCalibration(
        robot=robot,
        file=name,
        model=calibration.model.robot.name,
        date=date_of(name) or calibration.provenance.created,
        rows=len(calibration.ids),
        nominal=None if held_out is None else held_out.nominal_validation.mean,
        fitted=float(np.nanmean(np.linalg.norm(calibration.residuals[..., :3], axis=2))),
        held_out=None if held_out is None else held_out.validation.mean,
        stated=_stated(calibration),
        remarks=calibration.remarks,
    )


def date_of(name: str) -> str | None:
    """The last date in a file's name or in that of its folders, as 2026-03-31."""
    for match in reversed(list(DATE.finditer(name))):
        try:
            return date(*map(int, match.groups())).isoformat()
        except ValueError:
            continue
    return None


def _stated(calibration: Calibration) -> float:
    count = len(calibration.q)
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_POSES)).astype(int))
    return budget_at(calibration, calibration.q[chosen]).combined


def _estimates(calibration: Calibration) -> Estimates:
    kept = calibration.estimated
    parameters = calibration.model.parameters
    return Estimates(
        kind=calibration.model.robot.digest,
        names=calibration.kept,
        units=tuple(parameters[i].shown for i in kept),
        values=calibration.estimate[kept],
        errors=calibration.standard_errors[kept],
    )


def _change(early: FleetCalibration, late: FleetCalibration, before: Calibration, after: Calibration) -> Change:
    comparison = compare(before, after)
    return Change(
        robot=early.robot,
        before=early.file,
        after=late.file,
        rms=comparison.rms,
        expected=comparison.expected,
        excess=comparison.excess,
        chance=comparison.chance,
        unexplained=comparison.unexplained,
        resembles=comparison.resembles,
        parameters=tuple(p for p in comparison.parameters if abs(p.over_sigma) >= CLEAR),
    )


# Robots of a fleet one of whose parameters is unlike those of the others, beyond what chance and uncertainty
# explain.
#
# Of each parameter the fleet has a centre (median) and a spread s: that with which the median of |x − centre|/√(s²
# + σ²), σ the standard error of each robot's own estimate, is what it is for a normal distribution (0.6745), so
# that a robot that was measured badly neither counts as an outlier nor widens the spread of the others. As few
# robots tell their spread badly, the quotient z is held against Student's t with 0.45 (n − 1) degrees of freedom:
# with that, fleets of 8 to 30 normal robots with 54 parameters had a false outlier in at most 1 % of cases.
# Probabilities are multiplied by how many robots and parameters there are (Holm 1979), so that an alarm anywhere in
# a fleet of robots that are alike has a chance of 1 % at most.

OUTLIER_LEVEL = 0.01
"""Chance of calling any robot of a fleet an outlier where all are alike."""

FEWEST_ROBOTS = 8
"""Of one kind, that can be held against each other."""

NORMAL_QUARTILE = 0.6745
"""Median of the absolute value of a standard normal variable."""

FREEDOM_SHARE = 0.45
"""Degrees of freedom for each robot but one."""

HALVINGS = 50
"""Of the interval in which a spread is looked for."""


@dataclass(frozen=True, kw_only=True)
class OutlyingParameter:
    """A parameter of a robot unlike that of the others; metres and radians."""

    robot: str
    name: str
    unit: ShownUnit
    value: float
    standard_error: float
    centre: float
    """Median of the fleet."""
    spread: float
    """Standard deviation of the robots about it, without what their uncertainties add."""
    z: float
    """Distance from the centre over its standard deviation, the own uncertainty included."""
    chance: float
    """Of one like that anywhere in the fleet, were all robots alike."""


def find_outliers(robots: Sequence[str], estimates: Sequence[Estimates]) -> tuple[OutlyingParameter, ...]:
    """Parameters of robots that are outliers, the least probable first.

    Args:
        robots: names of the robots, `FEWEST_ROBOTS` or more.
        estimates: of each; all of one nominal robot. A parameter that fewer of them have is left out.
    """
    names = list(dict.fromkeys(name for one in estimates for name in one.names))
    units = {name: unit for one in estimates for name, unit in zip(one.names, one.units, strict=True)}
    values, errors = _table(names, estimates)
    common = np.isfinite(values).sum(axis=0) >= FEWEST_ROBOTS
    names = [name for name, seen in zip(names, common, strict=True) if seen]
    values, errors = values[:, common], errors[:, common]
    if not names:
        return ()
    centre, spread, z, chance = judge(values, errors)
    out = [
        OutlyingParameter(
            robot=robots[int(r)],
            name=names[int(p)],
            unit=units[names[p]],
            value=float(values[r, p]),
            standard_error=float(errors[r, p]),
            centre=float(centre[p]),
            spread=float(spread[p]),
            z=float(z[r, p]),
            chance=float(chance[r, p]),
        )
        for r, p in np.argwhere(chance < OUTLIER_LEVEL)
    ]
    return tuple(sorted(out, key=lambda one: (one.chance, -abs(one.z))))


def _table(names: Sequence[str], estimates: Sequence[Estimates]) -> tuple[np.ndarray, np.ndarray]:
    """Values and standard errors of every robot and parameter; NaN where a robot's calibration has not got it."""
    column = {name: k for k, name in enumerate(names)}
    values = np.full((len(estimates), len(names)), np.nan)
    errors = values.copy()
    for row, one in enumerate(estimates):
        columns = [column[name] for name in one.names]
        values[row, columns], errors[row, columns] = one.values, one.errors
    return values, errors


def judge(
    values: Float[np.ndarray, "n p"], errors: Float[np.ndarray, "n p"]
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"], Float[np.ndarray, "n p"], Float[np.ndarray, "n p"]]:
    """Centre and spread of each parameter, and of each robot the distance z and its chance; NaN where there is no value.

    Args:
        values: of each robot and parameter.
        errors: their standard errors.
    """
    from scipy.stats import t

    count = np.isfinite(values).sum(axis=0)
    centre = np.nanmedian(values, axis=0)
    distance = np.abs(values - centre)
    spread = _spread(distance, errors) * count / (count - 0.8)  # the median of few distances is too small
    width = np.sqrt((spread**2 + errors**2) * (1.0 + np.pi / (2.0 * count)))  # the centre is uncertain, too
    z = np.divide(values - centre, width, out=np.zeros_like(values), where=width > 0.0)
    z[np.isnan(values)] = np.nan
    single = 2.0 * t.sf(np.abs(z), FREEDOM_SHARE * (count - 1))
    return centre, spread, z, _holm(single)


def _spread(distance: Float[np.ndarray, "n p"], errors: Float[np.ndarray, "n p"]) -> Float[np.ndarray, " p"]:
    """The spread beside the errors with which the median distance is that of a normal distribution; zero where they suffice."""
    low = np.zeros(distance.shape[1])
    high = np.nanmax(distance, axis=0) / NORMAL_QUARTILE
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        width = np.sqrt(middle**2 + errors**2)
        over = np.divide(distance, width, out=np.zeros_like(distance), where=width > 0.0)
        over[np.isnan(distance)] = np.nan
        wider = np.nanmedian(over, axis=0) > NORMAL_QUARTILE
        low, high = np.where(wider, middle, low), np.where(wider, high, middle)
    return low


def _holm(single: Float[np.ndarray, "n p"]) -> Float[np.ndarray, "n p"]:
    """Probabilities that allow for how many there are (Holm 1979)."""
    flat = single.ravel()
    order = np.argsort(flat)[: int(np.isfinite(flat).sum())]
    factor = len(order) - np.arange(len(order))
    out = np.full_like(flat, np.nan)
    out[order] = np.minimum(np.maximum.accumulate(flat[order] * factor), 1.0)
    return out.reshape(single.shape)


FEW = 16
"""Calibrations that are read sooner here than processes for them would be started."""

Progress = Callable[[int, int], None]


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Fleet:
    """What the files of many robots tell."""

    folder: Path
    robots: tuple[RobotHistory, ...]
    """By name; those without a calibration that could be read are among the skipped files alone."""
    outliers: tuple[OutlyingParameter, ...]
    """Of the latest calibration of each robot, the least probable first."""
    skipped: tuple[tuple[str, str], ...]
    """Files that could not be read, and why."""
    unidentified: tuple[str, ...]
    """Campaigns without a calibration beside them."""
    others: tuple[str, ...]
    """Files that were not looked at."""
    remarks: tuple[str, ...]
    """What could not be compared, and why."""

    @property
    def calibrations(self) -> tuple[FleetCalibration, ...]:
        """All, by robot, the earliest first."""
        return tuple(one for robot in self.robots for one in robot.calibrations)

    @property
    def changes(self) -> tuple[Change, ...]:
        """All, by robot, the earliest first."""
        return tuple(one for robot in self.robots for one in robot.changes)

    @property
    def level(self) -> float:
        """Chance below which a change counts: with as many comparisons, one false alarm in the whole fleet stays as rare."""
        return LEVEL / max(len(self.changes), 1)

    def verdict_of(self, change: Change) -> Literal["unchanged", "small", "changed"]:
        """Whether a robot has changed, with all comparisons of the fleet in mind."""
        return change.verdict(self.level)

    def beyond(self, accuracy: float) -> tuple[str, ...]:
        """Robots of whose latest calibration the rows held out are farther off, in the mean, than an accuracy, metres."""
        latest = [robot.calibrations[-1] for robot in self.robots]
        return tuple(one.robot for one in latest if one.held_out is not None and one.held_out > accuracy)

    def table(self) -> list[dict[str, Any]]:
        """A row for each calibration, in millimetres, with what changed since the one before; None where that is not known."""
        changes = {change.after: change for change in self.changes}
        unlike: dict[str, list[OutlyingParameter]] = {}
        for one in self.outliers:
            unlike.setdefault(one.robot, []).append(one)
        latest = {robot.calibrations[-1].file for robot in self.robots}
        return [
            {
                **_row(one),
                **self._changed(changes.get(one.file)),
                "outliers": " ".join(p.name for p in unlike.get(one.robot, ())) if one.file in latest else "",
            }
            for one in self.calibrations
        ]

    def _changed(self, change: Change | None) -> dict[str, Any]:
        return {
            "change": "" if change is None else self.verdict_of(change),
            "change_mm": None if change is None else change.rms * 1e3,
            "change_expected_mm": None if change is None else change.expected * 1e3,
            "change_chance": None if change is None else change.chance,
        }

    def to_frame(self) -> "pd.DataFrame":
        """The table."""
        import pandas as pd

        return pd.DataFrame(self.table())

    def summary(self) -> dict[str, Any]:
        """Everything, in millimetres and milliradians."""
        return {
            "folder": str(self.folder),
            "robots": len(self.robots),
            "calibrations": self.table(),
            "changes": [self._described(change) for change in self.changes],
            "change_level": self.level,
            "outliers": [_unlike(one) for one in self.outliers],
            "skipped": [{"file": name, "reason": reason} for name, reason in self.skipped],
            "unidentified": list(self.unidentified),
            "not_looked_at": list(self.others),
            "remarks": list(self.remarks),
        }

    def _described(self, change: Change) -> dict[str, Any]:
        return {
            "robot": change.robot,
            "before": change.before,
            "after": change.after,
            "verdict": self.verdict_of(change),
            "rms_mm": change.rms * 1e3,
            "expected_mm": change.expected * 1e3,
            "excess_mm": change.excess * 1e3,
            "unexplained_mm": change.unexplained * 1e3,
            "chance": change.chance,
            "resembles": [
                {"name": r.name, "unit": r.unit.name, "amount": r.amount * r.unit.factor, "share": r.share}
                for r in change.resembles
            ],
            "parameters": [
                {
                    "name": p.name,
                    "unit": p.unit.name,
                    "first": p.first * p.unit.factor,
                    "second": p.second * p.unit.factor,
                    "over_sigma": p.over_sigma,
                }
                for p in change.parameters
            ],
        }


def review_fleet(
    folder: str | Path,
    *,
    engine: str = "loky",
    workers: int = -1,
    progress: Progress = lambda done, total: None,
) -> Fleet:
    """Look at the calibrations of many robots.

    A folder below the given one is a robot, with the calibrations that lie in it and below in the order of the dates in
    their names, or else of their identification; a calibration that lies in the given folder itself is a robot of its own.

    Args:
        folder: of all robots.
        engine: ``loky``, ``threading``, ``sequential``, or ``dask:ADDRESS`` of a scheduler; a few files are read at once.
        workers: how many; −1 for one per core.
        progress: called with the robots done and their total.

    Raises:
        FileError: there is no such folder.
        TaskcalError: it holds no calibration that can be read.
    """
    files = find_fleet(folder)
    with_some = [robot for robot in files.robots if robot.calibrations]
    if sum(len(robot.calibrations) for robot in with_some) <= FEW and engine == "loky":
        engine = "sequential"
    robots: list[RobotHistory] = []
    known: dict[Any, Any] = {}
    progress(0, len(with_some))
    with closing(side_by_side(follow_robot, _sent(files), engine, workers)) as results:
        for history in results:
            robots.append(_sharing(history, known))
            progress(len(robots), len(with_some))
    return _assembled(files, sorted(robots, key=lambda one: one.robot))


def _sent(files: FleetFiles) -> Generator[SentRobot, None, None]:
    """Robots with the content of their calibrations, read as there is room for them."""
    for robot in files.robots:
        if not robot.calibrations:
            continue
        sent: list[SentFile] = []
        skipped: list[tuple[str, str]] = []
        for name in robot.calibrations:
            try:
                sent.append(read_file(files.folder, name))
            except TaskcalError as refusal:
                skipped.append((name, reason_of(refusal, files.folder)))
        yield SentRobot(robot=robot.robot, files=tuple(sent), skipped=tuple(skipped))


def _sharing(history: RobotHistory, known: dict[Any, Any]) -> RobotHistory:
    """The history, with names that thousands of robots have in common kept once."""
    one = history.latest
    if one is None:
        return history
    shared = {key: known.setdefault(getattr(one, key), getattr(one, key)) for key in ("names", "units", "kind")}
    return replace(history, latest=replace(one, **shared))


def _assembled(files: FleetFiles, robots: Iterable[RobotHistory]) -> Fleet:
    robots = list(robots)
    readable = tuple(robot for robot in robots if robot.calibrations)
    skipped = tuple(one for robot in robots for one in robot.skipped)
    unidentified = tuple(name for robot in files.robots for name in without_calibration(robot))
    if not readable:
        raise TaskcalError(_nothing(files, skipped, unidentified))
    outliers, remarks = _unlike_others(readable)
    return Fleet(
        folder=files.folder,
        robots=readable,
        outliers=outliers,
        skipped=skipped,
        unidentified=unidentified,
        others=files.others,
        remarks=(*(remark for robot in robots for remark in robot.remarks), *remarks),
    )


def _nothing(files: FleetFiles, skipped: tuple[tuple[str, str], ...], unidentified: tuple[str, ...]) -> str:
    """Why there is nothing to show."""
    if skipped:
        return f"{files.folder}: none of {len(skipped)} files can be read as a calibration; the first: {skipped[0][1]}"
    if unidentified:
        return (
            f"{files.folder}: holds {len(unidentified)} campaigns, such as {unidentified[0]}, and no calibration; "
            "identify them first (--identify --robot ROBOT)"
        )
    return (
        f"{files.folder}: holds no calibration; put in a folder for each robot, with what taskcal identify wrote of it"
    )


def _unlike_others(robots: Iterable[RobotHistory]) -> tuple[tuple[OutlyingParameter, ...], tuple[str, ...]]:
    """Outliers among the robots of each kind, and kinds of which there are too few."""
    kinds: dict[str, list[RobotHistory]] = {}
    for robot in robots:
        if robot.latest is not None:
            kinds.setdefault(robot.latest.kind, []).append(robot)
    outliers: list[OutlyingParameter] = []
    remarks: list[str] = []
    for alike in kinds.values():
        if len(alike) < FEWEST_ROBOTS:
            name = alike[0].calibrations[-1].model
            remarks.append(
                f"{len(alike)} of {name}: too few to say which is unlike the others; it takes {FEWEST_ROBOTS} of one nominal robot"
            )
            continue
        latest = [robot.latest for robot in alike if robot.latest is not None]
        outliers += find_outliers([robot.robot for robot in alike], latest)
    return tuple(sorted(outliers, key=lambda one: (one.chance, -abs(one.z)))), tuple(remarks)


def _row(one: FleetCalibration) -> dict[str, Any]:
    return {
        "robot": one.robot,
        "file": one.file,
        "model": one.model,
        "date": one.date,
        "rows": one.rows,
        "nominal_mm": None if one.nominal is None else one.nominal * 1e3,
        "fitted_mm": one.fitted * 1e3,
        "held_out_mm": None if one.held_out is None else one.held_out * 1e3,
        "stated_mm": one.stated * 1e3,
        "verdict": one.verdict,
    }


def _unlike(one: OutlyingParameter) -> dict[str, Any]:
    factor = one.unit.factor
    return {
        "robot": one.robot,
        "name": one.name,
        "unit": one.unit.name,
        "value": one.value * factor,
        "standard_error": one.standard_error * factor,
        "fleet_median": one.centre * factor,
        "fleet_spread": one.spread * factor,
        "z": one.z,
        "chance": one.chance,
    }
