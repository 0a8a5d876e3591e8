"""Tables of a fleet of robots, for the terminal."""

from collections.abc import Mapping
from typing import Any

from taskcal.planning.fleet import Fleet
from taskcal.report.content import Column, Table

MAX_ROWS = 100
"""Calibrations beyond which only robots that somebody should look at are listed."""

MAX_NAMED = 20
"""Changes and outliers that are listed."""

SPARE = ("fitted", "rows", "nominal")
"""Columns that the first table can do without where it is too wide, those that go first at the front."""


def tabulate_fleet(fleet: Fleet) -> Table:
    """Tabulate each calibration; of many only those of robots that are not good, have changed, or are unlike the others."""
    wanted = robots_to_look_at(fleet)
    short = len(fleet.calibrations) > MAX_ROWS
    columns = (
        Column("robot", "robot"),
        Column("date", lambda row: row["date"][:10]),
        Column("rows", "rows", "d"),
        Column("nominal", "nominal_mm", ".3f"),
        Column("fitted", "fitted_mm", ".3f"),
        Column("held out", "held_out_mm", ".3f"),
        Column("stated σ", "stated_mm", ".3f"),
        Column("verdict", "verdict"),
        Column("changed by", _changed),
    )
    title = f"Fleet {fleet.folder}: mean 3D error, mm"
    if short:
        title += f" (the {len(wanted)} of {len(fleet.robots)} robots that need a look; all are in --json and -o)"
    return Table.of(title, columns, [row for row in fleet.calibrations if not short or row["robot"] in wanted])


def robots_to_look_at(fleet: Fleet) -> list[str]:
    """Names of robots whose latest calibration is not good, that have changed since the one before, or are unlike the others."""
    return [
        robot
        for robot, row in fleet.latest.items()
        if row["verdict"] != "good" or row["outliers"] or row["change"] == "changed"
    ]


def tabulate_fleet_changes(fleet: Fleet) -> Table:
    """Tabulate robots that have changed from one calibration to the next, the most first."""
    changed = [change for change in fleet.changes if change["verdict"] != "unchanged"]
    changed.sort(key=lambda change: -change["excess_mm"])
    columns = (
        Column("robot", "robot"),
        Column("calibration", "after"),
        Column("verdict", "verdict"),
        Column("change", "rms_mm", ".3f"),
        Column("expected by chance", "expected_mm", ".3f"),
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
        Column("value", "value", "+.4f"),
        Column("fleet median", "fleet_median", "+.4f"),
        Column("spread (1σ)", "fleet_spread", ".4f"),
        Column("unit", "unit"),
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


def _changed(row: Mapping[str, Any]) -> str:
    if not row["change"]:
        return "–"
    words = {"unchanged": "nothing", "small": f"{row['change_mm']:.3f} (small)", "changed": f"{row['change_mm']:.3f}"}
    return words[row["change"]]


def _resemblance(change: Mapping[str, Any]) -> str:
    if not change["resembles"]:
        return "–"
    first = change["resembles"][0]
    return f"{first['name']} {first['amount']:+.3f} {first['unit']} ({100 * first['share']:.0f} %)"
