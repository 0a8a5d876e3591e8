"""Many robots: their calibrations in one table, what changed from each to the next, and robots unlike the others."""

from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from taskcal.adaptation.fleet_campaigns import without_calibration
from taskcal.adaptation.fleet_files import FleetFiles, SentFile, find_fleet, read_file, reason_of
from taskcal.adaptation.fleet_outliers import FEWEST_ROBOTS, OutlyingParameter, find_outliers
from taskcal.adaptation.robot_history import Change, FleetCalibration, RobotHistory, SentRobot, follow_robot
from taskcal.adaptation.workers import side_by_side
from taskcal.errors import TaskcalError
from taskcal.identification.comparison import LEVEL
from taskcal.short_repr import short_repr

if TYPE_CHECKING:
    import pandas as pd

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
        "stated_mm": None if one.stated is None else one.stated * 1e3,
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
