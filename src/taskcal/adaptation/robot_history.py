"""The calibrations of one robot in their order of time, and what changed from each to the next."""

import re
from dataclasses import dataclass
from datetime import date
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.fleet_files import SentFile, laid_out, reason_of
from taskcal.errors import TaskcalError
from taskcal.identification.calibration import Calibration
from taskcal.identification.calibration_file import load_calibration
from taskcal.identification.comparison import ChangedParameter, Resemblance, compare
from taskcal.identification.uncertainty_budget import budget_at
from taskcal.robot.parameter import ShownUnit

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
    stated: float | None
    """Standard uncertainty in space at a single pose among those measured, root mean square."""
    remarks: tuple[str, ...]

    @property
    def verdict(self) -> Literal["good", "too few rows", "no better", "not checked"]:
        """What rows that were held out say of it."""
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
        """As `Comparison.verdict`, at a level that allows for how many comparisons there are."""
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


def _stated(calibration: Calibration) -> float | None:
    if calibration.q is None:
        return None
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
