"""The second half of ``taskcal demo --full``: the closed loop on virtual robots."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import joblib

from taskcal.cli.output import started_as
from taskcal.correction.cell_file import write_cell
from taskcal.demo.closed_loop import RoundTrip, Shop, furnish, go_round
from taskcal.demo.closed_loop_report import round_trip_html, tabulate_round_trips
from taskcal.files import write_whole
from taskcal.identification.calibration import package_version
from taskcal.presentation.terminal import print_tables
from taskcal.robot.robot import Robot


def run_round_trips(
    robot: Robot, count: int, seed: int, progress: Callable[[str], None]
) -> tuple[Shop, list[RoundTrip]]:
    """Furnish the shop and send robots round, on all cores."""
    shop = furnish(robot, seed=seed, progress=progress)
    jobs = (joblib.delayed(go_round)(shop, seed + k) for k in range(count))
    done = cast(Iterator[RoundTrip], joblib.Parallel(n_jobs=-1, return_as="generator")(jobs))
    trips: list[RoundTrip] = []
    for trip in done:
        trips.append(trip)
        progress(f"{len(trips)} of {count} robots measured, identified, corrected")
    return shop, trips


def write_round_trips(shop: Shop, trips: list[RoundTrip], folder: Path) -> dict[str, Path]:
    """The program, what belongs to the first robot, and the page."""
    first = trips[0]
    files = {
        "program": folder / "Milling.mod",
        "corrected program": folder / "Milling-corrected.mod",
        "calibration for milling": folder / "calibration-milling.json",
        "cell": folder / "cell.toml",
        "page of the closed loop": folder / "closed-loop.html",
    }
    write_whole(files["program"], shop.milling.source.encode())
    write_whole(files["corrected program"], first.correction.sources[0].encode())
    first.calibration.save(files["calibration for milling"])
    write_cell(files["cell"], first.cell)
    page = round_trip_html(shop, trips, next_steps=_commands(files), version=package_version())
    write_whole(files["page of the closed loop"], page)
    return files


def _commands(files: dict[str, Path]) -> str:
    return (
        f"  {started_as()} correct --calibration {files['calibration for milling']} --cell {files['cell']} "
        f"{files['program']} --dry-run"
    )


def show_round_trips(out: Any, trips: list[RoundTrip], files: dict[str, Path]) -> None:
    """Print the table and where the page is."""
    table = tabulate_round_trips(trips)
    print_tables(out, (replace(table, note=""),))
    out.print(f"The page of the closed loop: {files['page of the closed loop']}", soft_wrap=True)
    out.print("\nGo on:\n" + _commands(files), soft_wrap=True)


def summarise_round_trips(trips: list[RoundTrip]) -> list[dict[str, float]]:
    """Largest and root-mean-square errors of every robot, millimetres."""
    return [
        {
            "before_max_mm": float(trip.before.length.max() * 1e3),
            "after_max_mm": float(trip.after.length.max() * 1e3),
            "before_rms_mm": float((trip.before.length**2).mean() ** 0.5 * 1e3),
            "after_rms_mm": float((trip.after.length**2).mean() ** 0.5 * 1e3),
            "refused": float(len(trip.correction.refused)),
        }
        for trip in trips
    ]
