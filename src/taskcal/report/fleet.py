"""The section of a fleet of robots."""

from collections.abc import Mapping, Sequence
from typing import Any

from taskcal.errors import listed
from taskcal.planning.fleet import Fleet
from taskcal.report.content import Column, Facts, Section, TextTable

MAX_ROWS = 100
"""Calibrations beyond which only robots that somebody should look at are listed."""

MAX_NAMED = 20
"""Changes, outliers and robots beyond the accuracy that are listed."""


def fleet_section(fleet: Fleet, accuracy_mm: float | None, beyond: Sequence[str]) -> Section:
    """Make the section of a fleet.

    Args:
        fleet: the robots.
        accuracy_mm: that is required; None for none.
        beyond: robots of which the latest held-out error exceeds it.
    """
    changes = tabulate_fleet_changes(fleet)
    changed = "none" if fleet.changes else "no robot has two calibrations"
    named = f"latest held-out error, 3D rms: {listed(beyond, MAX_NAMED) or 'none'}"
    return Section(
        "Fleet",
        tabulate_fleet(fleet),
        changes,
        tabulate_outliers_of_fleet(fleet),
        Facts(
            ("fleet", f"{len(fleet.robots)} robots, {len(fleet.calibrations)} calibrations"),
            None if len(changes) else ("changed", changed),
            ("alarms", describe_level(fleet)),
            None if accuracy_mm is None else (f"above {accuracy_mm:g} mm", named),
        ),
    )


def tabulate_fleet(fleet: Fleet) -> TextTable:
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
    rows = [row for row in fleet.calibrations if not short or row["robot"] in wanted]
    return TextTable.of(title, columns, rows, spare=("fitted", "rows", "nominal"))


def robots_to_look_at(fleet: Fleet) -> list[str]:
    """Names of robots whose latest calibration is not good, that have changed since the one before, or are unlike the others."""
    return [
        robot
        for robot, row in fleet.latest.items()
        if row["verdict"] != "good" or row["outliers"] or row["change"] == "changed"
    ]


def tabulate_fleet_changes(fleet: Fleet) -> TextTable:
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
    return TextTable.of(
        f"Changed since the previous calibration ({_of(len(rows), len(changed))}), 3D rms, mm", columns, rows
    )


def tabulate_outliers_of_fleet(fleet: Fleet) -> TextTable:
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
    return TextTable.of(f"Outliers of the fleet ({_of(len(rows), len(fleet.outliers))})", columns, rows)


def describe_level(fleet: Fleet) -> str:
    """State the probability of a false alarm."""
    return (
        f"a robot is reported as changed if p < {fleet.level:.2g}, 1 % divided by the number of comparisons "
        f"({len(fleet.changes)}); as an outlier at a level of one false alarm in a hundred fleets of equal robots"
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
