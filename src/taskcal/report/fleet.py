"""Tables of a fleet of robots, for the terminal."""

from taskcal.planning.fleet import Change, Fleet
from taskcal.report.content import Column, Table, millimetres

MAX_ROWS = 100
"""Calibrations beyond which only robots that somebody should look at are listed."""

MAX_NAMED = 20
"""Changes and outliers that are listed."""

SPARE = (4, 2, 3)
"""Columns that the first table can do without where it is too wide."""


def tabulate_fleet(fleet: Fleet) -> Table:
    """Tabulate each calibration; of many only those of robots that are not good, have changed, or are unlike the others."""
    changes = {change.after: change for change in fleet.changes}
    wanted = robots_to_look_at(fleet)
    short = len(fleet.calibrations) > MAX_ROWS
    columns = (
        Column("robot", "robot"),
        Column("date", lambda one: one.date[:10]),
        Column("rows", "rows", "d"),
        millimetres("nominal", "nominal"),
        millimetres("fitted", "fitted"),
        millimetres("held out", "held_out"),
        millimetres("stated σ", "stated"),
        Column("verdict", "verdict"),
        Column("changed by", lambda one: _changed(fleet, changes.get(one.file))),
    )
    title = f"Fleet {fleet.folder}: mean 3D error, mm"
    if short:
        title += f" (the {len(wanted)} of {len(fleet.robots)} robots that need a look; all are in --json and -o)"
    return Table.of(title, columns, [one for one in fleet.calibrations if not short or one.robot in wanted])


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
    """Tabulate robots that have changed from one calibration to the next, the most first."""
    changed = [change for change in fleet.changes if fleet.verdict_of(change) != "unchanged"]
    changed.sort(key=lambda change: -change.excess)
    columns = (
        Column("robot", "robot"),
        Column("calibration", "after"),
        Column("verdict", fleet.verdict_of),
        millimetres("change", "rms"),
        millimetres("expected by chance", "expected"),
        Column("consistent with", _resemblance),
    )
    rows = changed[:MAX_NAMED]
    return Table.of(
        f"Changed since the previous calibration ({_of(len(rows), len(changed))}), 3D rms, mm", columns, rows
    )


def tabulate_outliers_of_fleet(fleet: Fleet) -> Table:
    """Tabulate parameters of robots that are unlike those of the others."""
    columns = (
        Column("robot", "robot"),
        Column("parameter", "name"),
        Column("value", lambda one: one.value * one.unit.factor, "+.4f"),
        Column("fleet median", lambda one: one.centre * one.unit.factor, "+.4f"),
        Column("spread (1σ)", lambda one: one.spread * one.unit.factor, ".4f"),
        Column("unit", lambda one: one.unit.name),
        Column("deviation / 1σ", "z", "+.1f"),
    )
    rows = fleet.outliers[:MAX_NAMED]
    return Table.of(f"Outliers of the fleet ({_of(len(rows), len(fleet.outliers))})", columns, rows)


def describe_level(fleet: Fleet) -> str:
    """State the probability of a false alarm."""
    return (
        f"a robot is called changed if p < {fleet.level:.2g}: 1 % in all of {len(fleet.changes)} comparisons; an outlier if p < 1 "
        "% anywhere in a fleet of equal robots"
    )


def _of(shown: int, all_in_all: int) -> str:
    return str(all_in_all) if shown == all_in_all else f"{shown} of {all_in_all}"


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
