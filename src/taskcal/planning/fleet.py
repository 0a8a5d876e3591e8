"""Many robots: their calibrations in one table, what changed from each to the next, and robots unlike the others."""

import os
import re
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from itertools import pairwise
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.drift import compensate_drift
from taskcal.errors import FileError, TaskcalError
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.comparison import LEVEL, compare
from taskcal.identification.holdout import hold_out
from taskcal.identification.identify import attempt, fit_nominal
from taskcal.identification.options import FitOptions, Holdout
from taskcal.identification.uncertainty_budget import budget_at
from taskcal.io.files import write_whole
from taskcal.io.json_file import note_of_edits
from taskcal.io.text_file import read_bytes
from taskcal.planning.workers import side_by_side
from taskcal.reading.reader import read_campaign
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit
from taskcal.short_repr import short_repr
from taskcal.tables.forms import table_suffixes
from taskcal.tables.frame import frame_of

if TYPE_CHECKING:
    import pandas as pd

Result = TypeVar("Result")

# The calibrations and campaigns of many robots, as they lie in a folder: a folder for each robot, or a file for each.

CALIBRATION = ".json"


@dataclass(frozen=True, kw_only=True)
class FleetFiles:
    """All files of a fleet, by their names in its folder, with slashes."""

    folder: Path
    calibrations: Mapping[str, tuple[str, ...]]
    """Of each robot that has some, by its name: the first folder below the fleet's, or the name of a file that lies in that
    itself."""
    unidentified: tuple[str, ...]
    """Campaigns beside which there is no calibration of the same name."""
    others: tuple[str, ...]
    """Files that are neither, by their endings."""


def find_fleet(folder: str | Path) -> FleetFiles:
    """Look through a folder and all below it, but for those that are hidden.

    Raises:
        FileError: there is no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileError(folder, "is not a folder; name one with a folder, or a calibration, for each robot")
    paths: list[PurePosixPath] = []
    for place, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        below = PurePosixPath(Path(place).relative_to(folder).as_posix())
        paths += [below / name for name in files if not name.startswith(".")]
    calibrations: dict[str, list[str]] = {}
    campaigns: list[str] = []
    others: list[str] = []
    for path in sorted(paths, key=str):
        suffix = path.suffix.lower()
        if suffix == CALIBRATION:
            calibrations.setdefault(path.parts[0] if len(path.parts) > 1 else path.stem, []).append(str(path))
        else:
            (campaigns if suffix in table_suffixes() else others).append(str(path))
    known = {name for names in calibrations.values() for name in names}
    return FleetFiles(
        folder=folder,
        calibrations={robot: tuple(calibrations[robot]) for robot in sorted(calibrations)},
        unidentified=tuple(name for name in campaigns if _beside(name) not in known),
        others=tuple(others),
    )


def _beside(campaign: str) -> str:
    return str(PurePosixPath(campaign).with_suffix(CALIBRATION))


class SentFile(NamedTuple):
    """A file for a machine that may not see the folder."""

    name: str
    content: bytes | str
    """The file's bytes; or why it cannot be read where it lies."""


def _sent(folder: Path, name: str) -> SentFile:
    try:
        return SentFile(name, read_bytes(folder / name))
    except TaskcalError as refusal:
        return SentFile(name, _reason(refusal, folder))


def _read_sent(file: SentFile, read: Callable[[Path], Result]) -> Result:
    """What a function makes of a file that was sent, which it finds under its own name.

    Raises:
        TaskcalError: it cannot be read; the message has the file's name in the fleet.
    """
    if isinstance(file.content, str):
        raise TaskcalError(file.content)
    with TemporaryDirectory(prefix="taskcal-fleet-") as folder:
        path = Path(folder) / file.name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(file.content)
        except OSError as error:
            message = f"cannot be copied to {folder}: {error.strerror or error}; name a folder with room in TMPDIR"
            raise FileError(file.name, message) from error
        try:
            return read(path)
        except TaskcalError as refusal:
            raise TaskcalError(_reason(refusal, folder)) from refusal


def _reason(refusal: TaskcalError, folder: str | Path) -> str:
    """State a refusal of a file in a folder, with the file's name in the fleet's."""
    return str(refusal).replace(f"{folder}{os.sep}", "")


# Campaigns of a fleet that are not identified yet: each identified as by ``taskcal identify``, side by side.

FOLDS = 5
"""Parts that are held out in turn, so that each calibration says what it predicts. A convention (Hastie et al., The Elements of
Statistical Learning, section 7.10: five or ten)."""


class IdentifiedCampaign(NamedTuple):
    """What became of a campaign."""

    campaign: str
    calibration: str
    """The file that was written, or would have been."""
    refusal: str | None
    """Why there is none."""


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
    sent = (_sent(files.folder, name) for name in files.unidentified)
    with closing(side_by_side(partial(_identified, model, folds), sent, engine, workers)) as results:
        for name, text, refusal in results:
            if text is not None:
                write_whole(files.folder / _beside(name), text)
            yield IdentifiedCampaign(name, _beside(name), refusal)


def _identified(model: ErrorModel, folds: int, file: SentFile) -> tuple[str, str | None, str | None]:
    """Name, the calibration's text, and the reason why there is none."""

    def fit(path: Path) -> str:
        campaign = read_campaign(path, model.robot)
        followed = compensate_drift(campaign)
        campaign = replace(followed.campaign, notes=(*campaign.notes, *followed.remarks))
        return hold_out(
            lambda rows: attempt(model, rows, FitOptions()).learnt().with_growth(),
            campaign,
            Holdout(folds=folds),
            lambda rows: fit_nominal(model, rows, FitOptions()),
        ).to_text()

    try:
        return file.name, _read_sent(file, fit), None
    except TaskcalError as refusal:
        if isinstance(refusal.__cause__, OSError):  # no room to work in, which is no campaign's fault
            raise
        return file.name, None, str(refusal)


# The calibrations of one robot in their order of time, and what changed from each to the next. Tables are lists of rows
# in the units in which people see them, millimetres where a key says so; None for what is not known.

Row = dict[str, Any]

MAX_STATED_POSES = 50
"""Poses, at most, at which the stated uncertainty of a calibration is taken; a convention that bounds the time."""

MAX_HELD_OUT_RATIO = 1.6
"""Error of held-out rows over that of fitted ones, beyond which there were too few rows; a convention. With n rows of three
coordinates and p unknowns both grow apart as √((3n + p)/(3n − p)), which is 1.6 where 3n is 2.3 p."""

MIN_CHANGE_SIGMA = 2.0
"""Standard errors of the difference from which on a parameter is listed as changed: 5 % of those that have not changed are."""

DATE = re.compile(r"(?<!\d)(\d{4})[-_.]?(\d{2})[-_.]?(\d{2})(?!\d)")


@dataclass(frozen=True, kw_only=True)
class Estimates:
    """What a calibration found, to be compared with that of other robots."""

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
class RobotHistory:
    """What the files of one robot tell."""

    calibrations: tuple[Row, ...]
    """The earliest first."""
    changes: tuple[Row, ...]
    """From each calibration to its next, as `compare` finds it."""
    latest: Estimates | None
    skipped: tuple[tuple[str, str], ...]
    """Files that could not be read, and why."""
    remarks: tuple[str, ...]
    """What could not be compared, and why."""


def _follow(robot: tuple[str, Sequence[SentFile]], *, unsealed: bool) -> RobotHistory:
    """Read a robot's calibrations and compare each with the one before it."""
    name, files = robot
    read: list[tuple[Row, Calibration]] = []
    skipped: list[tuple[str, str]] = []
    for file in files:
        try:
            calibration = _read_sent(file, partial(load_calibration, unsealed=unsealed))
            read.append((_row(name, file.name, calibration), calibration))
        except TaskcalError as refusal:
            skipped.append((file.name, str(refusal)))
    read.sort(key=lambda pair: (pair[0]["date"], pair[0]["file"]))
    changes: list[Row] = []
    remarks: list[str] = []
    for (early, before), (late, after) in pairwise(read):
        try:
            changes.append(_change(early, late, before, after))
        except TaskcalError as refusal:
            remarks.append(f"{late['file']} was not compared with {early['file']}: {refusal}")
    return RobotHistory(
        calibrations=tuple(row for row, _ in read),
        changes=tuple(changes),
        latest=_estimates(read[-1][1]) if read else None,
        skipped=tuple(skipped),
        remarks=tuple(remarks),
    )


def _row(robot: str, file: str, calibration: Calibration) -> Row:
    """A calibration; errors are means in space, and the stated one is the standard uncertainty at a single pose, rms."""
    held_out = calibration.held_out
    nominal, predicted = (
        (None, None) if held_out is None else (held_out.nominal_validation.mean, held_out.validation.mean)
    )
    fitted = float(np.nanmean(np.linalg.norm(calibration.residuals[..., :3], axis=2)))
    count = len(calibration.q)
    some = np.unique(np.linspace(0, count - 1, min(count, MAX_STATED_POSES)).astype(int))
    return {
        "robot": robot,
        "file": note_of_edits(file, calibration.edited),
        "model": calibration.model.robot.name,
        "date": date_of(file) or calibration.provenance.created,
        "rows": len(calibration.ids),
        "nominal_mm": None if nominal is None else nominal * 1e3,
        "fitted_mm": fitted * 1e3,
        "held_out_mm": None if predicted is None else predicted * 1e3,
        "held_out_rms_mm": None if held_out is None else held_out.validation.rms * 1e3,
        "stated_mm": budget_at(calibration, calibration.q[some]).combined * 1e3,
        "verdict": _verdict(nominal, fitted, predicted),
    }


def _verdict(
    nominal: float | None, fitted: float, predicted: float | None
) -> Literal["good", "too few rows", "no better", "not checked"]:
    """Verdict of the held-out rows."""
    if predicted is None or nominal is None:
        return "not checked"
    if predicted >= nominal:
        return "no better"
    return "too few rows" if predicted > MAX_HELD_OUT_RATIO * fitted else "good"


def date_of(name: str) -> str | None:
    """The last date in a file's name or in that of its folders, as 2026-03-31."""
    for match in reversed(list(DATE.finditer(name))):
        try:
            return date(*map(int, match.groups())).isoformat()
        except ValueError:
            continue
    return None


def _estimates(calibration: Calibration) -> Estimates:
    estimated = calibration.estimated
    parameters = calibration.model.parameters
    return Estimates(
        kind=calibration.model.robot.digest,
        names=calibration.kept,
        units=tuple(parameters[i].shown for i in estimated),
        values=calibration.estimate[estimated],
        errors=calibration.standard_errors[estimated],
    )


def _change(early: Row, late: Row, before: Calibration, after: Calibration) -> Row:
    """The change from one calibration to the next, with the parameters that differ clearly, the most changed first."""
    comparison = compare(before, after)
    found = comparison.summary()
    return {
        "robot": early["robot"],
        "before": early["file"],
        "after": late["file"],
        **{key: found[key] for key in ("verdict", "rms_mm", "expected_mm")},
        "excess_mm": comparison.excess * 1e3,
        **{key: found[key] for key in ("unexplained_mm", "chance", "resembles")},
        "parameters": [
            {key: value for key, value in one.items() if key != "standard_error"}
            for one in found["parameters"]
            if abs(one["over_sigma"]) >= MIN_CHANGE_SIGMA
        ],
    }


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
"""Chance of calling any robot of a fleet an outlier where all are alike; a convention, as that of `compare`."""

MIN_ROBOTS = 8
"""Robots of one kind that can be compared with each other: the fewest for which the chance above was tried."""

NORMAL_QUARTILE = 0.6745
"""Median of the absolute value of a standard normal variable."""

MEDIAN_DEFICIT = 0.8
"""Robots by which the median distance of n of them is too small, as n/(n − 0.8) (Croux and Rousseeuw 1992, for the MAD)."""

FREEDOM_PER_ROBOT = 0.45
"""Degrees of freedom of a spread for each robot but one, by the experiment above."""

SPREAD_HALVINGS = 50
"""Of the interval in which a spread is looked for: to rounding."""


def find_outliers(robots: Sequence[str], estimates: Sequence[Estimates]) -> list[Row]:
    """Parameters of robots that are outliers, the least probable first.

    Args:
        robots: names of the robots, `MIN_ROBOTS` or more.
        estimates: of each; all of one nominal robot. A parameter that fewer of them have is left out.
    """
    units = {name: unit for one in estimates for name, unit in zip(one.names, one.units, strict=True)}
    values = np.full((len(estimates), len(units)), np.nan)
    errors = values.copy()
    column = {name: at for at, name in enumerate(units)}
    for row, one in enumerate(estimates):
        at = [column[name] for name in one.names]
        values[row, at], errors[row, at] = one.values, one.errors
    many = (~np.isnan(values)).sum(axis=0) >= MIN_ROBOTS
    if not many.any():
        return []
    names, values, errors = (
        [name for name, kept in zip(units, many, strict=True) if kept],
        values[:, many],
        errors[:, many],
    )
    centre, spread, z, chance = judge(values, errors)
    found = sorted(np.argwhere(chance < OUTLIER_LEVEL).tolist(), key=lambda at: (chance[*at], -abs(z[*at])))
    return [
        {
            "robot": robots[r],
            "name": (name := names[p]),
            "unit": units[name].name,
            "value": float(values[r, p]) * units[name].factor,
            "standard_error": float(errors[r, p]) * units[name].factor,
            "fleet_median": float(centre[p]) * units[name].factor,
            "fleet_spread": float(spread[p]) * units[name].factor,
            "z": float(z[r, p]),
            "chance": float(chance[r, p]),
        }
        for r, p in found
    ]


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
    spread = _spread(np.abs(values - centre), errors) * count / (count - MEDIAN_DEFICIT)
    # the centre is uncertain, too: the variance of a median is π/2 times that of a mean
    width = np.sqrt((spread**2 + errors**2) * (1.0 + np.pi / (2.0 * count)))
    z = np.divide(values - centre, width, out=np.zeros_like(values), where=width > 0.0)
    z[np.isnan(values)] = np.nan
    return centre, spread, z, _holm(2.0 * t.sf(np.abs(z), FREEDOM_PER_ROBOT * (count - 1)))


def _spread(distance: Float[np.ndarray, "n p"], errors: Float[np.ndarray, "n p"]) -> Float[np.ndarray, " p"]:
    """The spread beside the errors with which the median distance is that of a normal distribution; zero where they suffice."""
    low = np.zeros(distance.shape[1])
    high = np.nanmax(distance, axis=0) / NORMAL_QUARTILE
    for _ in range(SPREAD_HALVINGS):
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


# The fleet: all robots together.

MAX_SEQUENTIAL = 16
"""Calibrations, at most, that are read sooner here than processes for them are started: each takes some 20 ms, and a process a
second (`benchmarks/fleet_cost.py`)."""

Progress = Callable[[int, int], None]


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Fleet:
    """Results of many robots: tables of rows with the keys of ``--json``, in millimetres and milliradians."""

    folder: Path
    calibrations: tuple[Row, ...]
    """By robot, the earliest first, with what changed since the one before, and in a robot's latest which of its parameters
    are unlike those of the others; None where that is not known."""
    changes: tuple[Row, ...]
    """From each calibration of a robot to its next, by robot, the earliest first."""
    outliers: tuple[Row, ...]
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
    def latest(self) -> dict[str, Row]:
        """The latest calibration of each robot, by its name; those without one that could be read are among the skipped files."""
        return {row["robot"]: row for row in self.calibrations}

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots."""
        return tuple(self.latest)

    @property
    def level(self) -> float:
        """Chance below which a change counts: with as many comparisons, one false alarm in the whole fleet stays as rare."""
        return _level(self.changes)

    def beyond(self, accuracy: float) -> tuple[str, ...]:
        """Robots of whose latest calibration the rows held out are farther off, 3D rms, than an accuracy, metres."""
        errors = {robot: row["held_out_rms_mm"] for robot, row in self.latest.items()}
        return tuple(robot for robot, error in errors.items() if error is not None and error > accuracy * 1e3)

    def to_frame(self) -> "pd.DataFrame":
        """The calibrations as a table.

        Raises:
            TaskcalError: pandas is not installed.
        """
        return frame_of(list(self.calibrations))

    def summary(self) -> dict[str, Any]:
        """Everything, in millimetres and milliradians."""
        return {
            "folder": str(self.folder),
            "robots": len(self.robots),
            "calibrations": list(self.calibrations),
            "changes": list(self.changes),
            "change_level": self.level,
            "outliers": list(self.outliers),
            "skipped": [{"file": name, "reason": reason} for name, reason in self.skipped],
            "unidentified": list(self.unidentified),
            "not_looked_at": list(self.others),
            "remarks": list(self.remarks),
        }


def _level(changes: Sequence[Row]) -> float:
    return LEVEL / max(len(changes), 1)


def review_fleet(
    folder: str | Path,
    *,
    engine: str = "loky",
    workers: int = -1,
    progress: Progress = lambda done, total: None,
    unsealed: bool = False,
) -> Fleet:
    """Look at the calibrations of many robots.

    A folder below the given one is a robot, with the calibrations that lie in it and below in the order of the dates in
    their names, or else of their identification; a calibration that lies in the given folder itself is a robot of its own.

    Args:
        folder: of all robots.
        engine: ``loky``, ``threading``, ``sequential``, or ``dask:ADDRESS`` of a scheduler; a few files are read at once.
        workers: how many; −1 for one per core.
        progress: called with the robots done and their total.
        unsealed: read calibrations that were edited after they were identified, too; their names tell.

    Raises:
        FileError: there is no such folder.
        TaskcalError: it holds no calibration that can be read.
    """
    files = find_fleet(folder)
    if sum(map(len, files.calibrations.values())) <= MAX_SEQUENTIAL and engine == "loky":
        engine = "sequential"
    # read as there is room for them
    sent = ((robot, [_sent(files.folder, name) for name in names]) for robot, names in files.calibrations.items())
    histories: list[RobotHistory] = []
    common: dict[Any, Any] = {}
    progress(0, len(files.calibrations))
    with closing(side_by_side(partial(_follow, unsealed=unsealed), sent, engine, workers)) as results:
        for history in results:
            if (one := history.latest) is not None:  # what thousands of robots have in common is held once
                shared = {
                    key: common.setdefault(getattr(one, key), getattr(one, key)) for key in ("names", "units", "kind")
                }
                history = replace(history, latest=replace(one, **shared))
            histories.append(history)
            progress(len(histories), len(files.calibrations))
    return _assembled(files, histories)


def _assembled(files: FleetFiles, histories: Iterable[RobotHistory]) -> Fleet:
    by_robot = {h.calibrations[0]["robot"]: h for h in histories if h.calibrations}
    readable = [by_robot[robot] for robot in files.calibrations if robot in by_robot]
    skipped = sorted(one for history in histories for one in history.skipped)
    if not readable:
        raise TaskcalError(_nothing(files, skipped))
    changes = [change for history in readable for change in history.changes]
    level = _level(changes)
    for change in changes:
        if change["chance"] >= level:
            change["verdict"] = "unchanged"
    outliers, remarks = _outliers_by_kind(readable)
    since = {change["after"]: change for change in changes}
    rows: list[Row] = []
    for row in (row for history in readable for row in history.calibrations):
        change = since.get(row["file"], {})
        rows.append(
            {
                **row,
                "change": change.get("verdict", ""),
                "change_mm": change.get("rms_mm"),
                "change_expected_mm": change.get("expected_mm"),
                "change_chance": change.get("chance"),
                "outliers": "",
            }
        )
    latest = {row["robot"]: row for row in rows}
    for one in outliers:
        latest[one["robot"]]["outliers"] = f"{latest[one['robot']]['outliers']} {one['name']}".lstrip()
    return Fleet(
        folder=files.folder,
        calibrations=tuple(rows),
        changes=tuple(changes),
        outliers=tuple(outliers),
        skipped=tuple(skipped),
        unidentified=files.unidentified,
        others=files.others,
        remarks=(*(remark for history in readable for remark in history.remarks), *remarks),
    )


def _nothing(files: FleetFiles, skipped: Sequence[tuple[str, str]]) -> str:
    """Why there is nothing to show."""
    if skipped:
        return f"{files.folder}: none of {len(skipped)} files can be read as a calibration; the first: {skipped[0][1]}"
    if files.unidentified:
        return (
            f"{files.folder}: holds {len(files.unidentified)} campaigns, such as {files.unidentified[0]}, and no calibration; "
            "identify them first (--identify --robot ROBOT)"
        )
    return (
        f"{files.folder}: holds no calibration; put in a folder for each robot, with what taskcal identify wrote of it"
    )


def _outliers_by_kind(readable: Iterable[RobotHistory]) -> tuple[list[Row], list[str]]:
    """Outliers among the robots of each kind, and kinds of which there are too few."""
    kinds: dict[str, list[tuple[Row, Estimates]]] = {}
    for history in readable:
        if history.latest is not None:
            kinds.setdefault(history.latest.kind, []).append((history.calibrations[-1], history.latest))
    outliers: list[Row] = []
    remarks: list[str] = []
    for alike in kinds.values():
        if len(alike) < MIN_ROBOTS:
            remarks.append(
                f"{len(alike)} of {alike[0][0]['model']}: too few to say which is unlike the others; it takes {MIN_ROBOTS} of one "
                "nominal robot"
            )
        else:
            outliers += find_outliers([row["robot"] for row, _ in alike], [estimates for _, estimates in alike])
    return sorted(outliers, key=lambda one: (one["chance"], -abs(one["z"]))), remarks
