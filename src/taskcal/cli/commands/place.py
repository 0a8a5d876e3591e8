"""``taskcal place``: where to put the part, by the expected error there."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import argument, option, output_option
from taskcal.cli.options.common import CellOption, RobotOptions
from taskcal.cli.options.page import PageOptions
from taskcal.cli.run import File, Result, Run
from taskcal.correction.options import PlacementOptions
from taskcal.tables.frame import csv_of
from taskcal.tables.table import number_of

if TYPE_CHECKING:
    import taskcal.report.placement


BEST = 8
"""Placements among the best of the JSON result, which has all of them too."""


def _range(text: str, option: str, unit: str) -> tuple[float, float]:
    """Two numbers with a colon between them, or one."""
    numbers = [number_of(part.strip()) for part in text.split(":")]
    if len(numbers) > 2 or not all(map(math.isfinite, numbers)):
        raise typer.BadParameter(f"'{text}' is not a range; write for example -200:200, in {unit}", param_hint=option)
    return numbers[0], numbers[-1]


@dataclass(frozen=True, kw_only=True)
class RegionOptions:
    """Region of placements of the part."""

    region: str = option(
        ..., "X:X,Y:Y,Z:Z", "Range of shifts of the part in the base frame, mm: -300:300,-200:200,0:100."
    )
    turn_deg: str = option(
        "0", "DEG:DEG", "Range of rotations about the vertical through the middle of the targets.", named="turn"
    )
    steps: int = option(5, "N", "Placements along each axis with a range.", low=1)
    turns: int = option(3, "N", "Rotations, where there is a range.", low=1)

    def grid(self) -> "taskcal.correction.Region":
        """In metres and radians.

        Raises:
            TaskcalError: there is no such region.
        """
        import numpy as np

        axes = self.region.split(",")
        if len(axes) != 3:
            raise typer.BadParameter(
                f"'{self.region}' has {len(axes)} ranges; write three, as -300:300,-200:200,0", param_hint="--region"
            )
        bounds = np.array([_range(text, "--region", "mm") for text in axes]) * 1e-3
        low, high = np.radians(_range(self.turn_deg, "--turn", "degrees"))
        return taskcal.correction.Region(
            low=bounds[:, 0], high=bounds[:, 1], turn=(float(low), float(high)), steps=(self.steps, self.turns)
        )


def command(
    *,
    run: Run,
    what: list[Path] = argument(..., "PROGRAM|TASK.toml [MORE …]", "The files of a program, or a task."),
    of: RobotOptions,
    where: RegionOptions,
    cell: CellOption = None,
    choice: PlacementOptions,
    output: Path | None = output_option(None, "MAP.csv", "Output CSV: all placements."),
    page: PageOptions,
) -> Result:
    """Compare placements of a part by the expected error.

    For every placement: the expected error before and after the correction, the deflection under a process force, whether every
    motion can be executed, and the distance of the joints from their limits and from singularities. Placements of which the
    calibration knows less than the robot's tolerances do are not ranked without --accept-uncertain.
    """
    is_task = len(what) == 1 and what[0].suffix.lower() == ".toml"
    region = where.grid()
    model, calibration = of.load()
    from robot_programs.reading import read_program
    from taskcal.correction.cell import given_frames

    described = taskcal.Cell() if cell is None else taskcal.load_cell(cell)
    tools, parts = given_frames(described)
    target = (
        taskcal.load_task(what[0])
        if is_task
        else read_program(*what, robot=model.robot, tools=tools, parts=parts, data=described.data)
    )
    begin = run.bar(["placements"], len(region.grid()))
    found = taskcal.correction.place(
        calibration or model.robot,
        target,
        region,
        cell=described,
        progress=lambda done, of: begin("placements"),
        options=choice,
    )
    calibrated = calibration is not None
    result: dict[str, Any] = {
        "name": found.name,
        "written": output,
        "tolerance_mm": None if found.tolerance is None else found.tolerance * 1e3,
        "now": found.now.summary(),
        "recommended": None if found.recommended is None else found.recommended.summary(),
        "best": [placed.summary() for placed in found.ranked[:BEST]],
        "placements": [placed.summary() for placed in found.all],
    }
    failed: bool | str = not found.ranked
    if found.unmet:
        best = found.ranked[0].summary() if found.ranked else None
        at = (
            ""
            if best is None
            else "; the best is at {x_mm:.0f}, {y_mm:.0f}, {z_mm:.0f} mm, {turn_deg:.1f}°".format(**best)
        )
        failed = f"no placement of {found.name} is recommended{at}: {found.unmet}"
    robot = model.robot.title or model.robot.name
    return Result(
        summary=result,
        sections=lambda: taskcal.report.placement.placement_sections(found, calibrated=calibrated),
        files=[File("map", output, csv_of(placed.summary() for placed in found.all))],
        page=lambda: taskcal.report.placement.placement_page(found, robot, calibrated=calibrated),
        failed=failed,
    )
