"""What a fleet of robots shows, for the terminal."""

from taskcal.planning.fleet import Change, Fleet
from taskcal.report.content import Table

MOST_ROWS = 100
"""Beyond which only robots that somebody should look at are listed."""

MOST_NAMED = 20
"""Changes and outliers that are listed."""

HEADER = ("robot", "date", "rows", "nominal", "fitted", "held out", "stated σ", "verdict", "changed by")
SPARE = (4, 2, 3)
"""Columns that the first table can do without where it is too wide."""


def tabulate_fleet(fleet: Fleet) -> Table:
    """A row for each calibration; of many only those of robots that are not good, have changed, or are unlike the others."""
    changes = {change.after: change for change in fleet.changes}
    wanted = robots_to_look_at(fleet)
    short = len(fleet.calibrations) > MOST_ROWS
    rows = [
        (
            one.robot,
            one.date[:10],
            str(one.rows),
            _length(one.nominal),
            _length(one.fitted),
            _length(one.held_out),
            _length(one.stated),
            one.verdict,
            _changed(fleet, changes.get(one.file)),
        )
        for one in fleet.calibrations
        if not short or one.robot in wanted
    ]
    title = f"Fleet {fleet.folder}: mean error in space, mm"
    if short:
        title += f" (the {len(wanted)} of {len(fleet.robots)} robots that need a look; all are in --json and -o)"
    return Table.of_rows(title, HEADER, rows, text_columns=(0, 1, 7, 8))


def robots_to_look_at(fleet: Fleet) -> list[str]:
    """Names of robots whose latest calibration is not good, that have changed since the one before, or are unlike the others."""
    unlike = {one.robot for one in fleet.outliers}
    return [
        robot.robot
        for robot in fleet.robots
        if robot.calibrations[-1].verdict != "good"
        or robot.robot in unlike
        or (robot.changes and fleet.verdict_of(robot.changes[-1]) == "changed")
    ]


def tabulate_fleet_changes(fleet: Fleet) -> Table:
    """Robots that have changed from one calibration to the next, the most first."""
    changed = [change for change in fleet.changes if fleet.verdict_of(change) != "unchanged"]
    changed.sort(key=lambda change: -change.excess)
    rows = [
        (
            change.robot,
            change.after,
            fleet.verdict_of(change),
            f"{change.rms * 1e3:.3f}",
            f"{change.expected * 1e3:.3f}",
            _resemblance(change),
        )
        for change in changed[:MOST_NAMED]
    ]
    return Table.of_rows(
        f"Changed since the calibration before ({_of(len(rows), len(changed))}), rms in space, mm",
        ("robot", "calibration", "how much", "by", "by chance", "looks like"),
        rows,
        text_columns=(0, 1, 2, 5),
    )


def tabulate_outliers_of_fleet(fleet: Fleet) -> Table:
    """Parameters of robots that are unlike those of the others."""
    rows = [
        (
            one.robot,
            one.name,
            f"{one.value * one.unit.factor:+.4f}",
            f"{one.centre * one.unit.factor:+.4f}",
            f"{one.spread * one.unit.factor:.4f}",
            one.unit.name,
            f"{one.z:+.1f}",
        )
        for one in fleet.outliers[:MOST_NAMED]
    ]
    return Table.of_rows(
        f"Unlike the others ({_of(len(rows), len(fleet.outliers))})",
        ("robot", "parameter", "value", "fleet", "spread", "unit", "over 1σ"),
        rows,
        text_columns=(0, 1, 5),
    )


def describe_level(fleet: Fleet) -> str:
    """How rare a false alarm is."""
    return (
        f"a robot is called changed where chance alone does as much with a probability below {fleet.level:.2g}: 1 % in all of "
        f"{len(fleet.changes)} comparisons; unlike the others where one anywhere in a fleet of like robots has one below 1 %"
    )


def _of(shown: int, all_in_all: int) -> str:
    return str(all_in_all) if shown == all_in_all else f"{shown} of {all_in_all}"


def _length(metres: float | None) -> str:
    return "–" if metres is None else f"{metres * 1e3:.3f}"


def _changed(fleet: Fleet, change: Change | None) -> str:
    if change is None:
        return "–"
    words = {"unchanged": "nothing", "small": f"{change.rms * 1e3:.3f} (little)", "changed": f"{change.rms * 1e3:.3f}"}
    return words[fleet.verdict_of(change)]


def _resemblance(change: Change) -> str:
    if not change.resembles:
        return "–"
    first = change.resembles[0]
    return f"{first.name} {first.amount * first.unit.factor:+.3f} {first.unit.name} ({100 * first.share:.0f} %)"
