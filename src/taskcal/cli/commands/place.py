"""``taskcal place``: where to put the part, by the expected error there."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

import taskcal
from taskcal.cli.command import argument, option
from taskcal.cli.options.common import RobotOptions
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import files_of_task, info, show, show_facts, tell
from taskcal.cli.progress import bar_over
from taskcal.tables.frame import csv_of

_NUMBER = r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*"


def _range(text: str, option: str, unit: str) -> tuple[float, float]:
    """Two numbers with a colon between them, or one."""
    if not re.fullmatch(f"{_NUMBER}(?::{_NUMBER})?", text):
        raise typer.BadParameter(f"'{text}' is not a range; write for example -200:200, in {unit}", param_hint=option)
    low, _, high = text.partition(":")
    return float(low), float(high or low)


@dataclass(frozen=True, kw_only=True)
class RegionOptions:
    """Region of placements of the part."""

    region: str = option(
        ..., "X:X,Y:Y,Z:Z", "Range of shifts of the part in the base frame, mm: -300:300,-200:200,0:100."
    )
    turn_deg: str = option(
        "0", "DEG:DEG", "Range of rotations about the vertical through the middle of the targets.", named="--turn"
    )
    steps: int = option(5, "N", "Placements along each axis with a range.", min=1)
    turns: int = option(3, "N", "Rotations, where there is a range.", min=1)

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
    what: list[Path] = argument(..., "PROGRAM|TASK.toml [MORE …]", "The files of a program, or a task."),
    of: RobotOptions,
    where: RegionOptions,
    cell: Path | None = option(None, "CELL.toml", "Measured frames of the program's tools and parts."),
    touched_off: bool = option(
        False, help="The part is touched off in place: an error common to all targets is removed."
    ),
    force_n: str | None = option(None, "X,Y,Z", "Process force on the tool, newtons, in the base frame."),
    accept_uncertain: bool = option(
        False, help="Rank placements even where the uncertainty exceeds three times the robot's tolerances."
    ),
    output: Path | None = option(None, "MAP.csv", "Output CSV: all placements.", also="-o"),
    page: PageOptions,
) -> None:
    """Compare placements of a part by the expected error.

    For every placement: the expected error before and after the correction, the deflection under a process force, whether every
    motion can be executed, and the distance of the joints from their limits and from singularities. Placements of which the
    calibration knows less than the robot's tolerances do are not ranked without --accept-uncertain.
    """
    force = _force(force_n)
    is_task = len(what) == 1 and what[0].suffix.lower() == ".toml"
    files = files_of_task(what[0]) if is_task else what
    outputs = page.begin("place", [("--output", output)], [*files, of.calibration, cell])

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
    with bar_over(["placements"], len(region.grid())) as begin:
        found = taskcal.correction.place(
            calibration or model.robot,
            target,
            region,
            cell=described,
            force=force,
            touched_off=touched_off,
            accept_uncertain=accept_uncertain,
            progress=lambda done, of: begin("placements"),
        )
    from taskcal.report.placement import SHOWN, placement_page

    calibrated, name = calibration is not None, model.robot.title or model.robot.name
    table = {} if output is None else {output: _csv(found)}
    made = page.write(outputs, table, lambda: placement_page(found, name, calibrated=calibrated))
    written = [*table, *made]
    result: dict[str, Any] = {
        "name": found.name,
        "written": output,
        "now": found.now.summary(),
        "recommended": None if found.recommended is None else found.recommended.summary(),
        "best": [placed.summary() for placed in found.ranked[:SHOWN]],
        "placements": [placed.summary() for placed in found.all],
    }
    page.give(result, lambda: _show(found, calibrated=calibrated))
    if written and not page.as_json:
        info(f"written: {page.in_words(written)}")
    if not found.ranked:
        raise typer.Exit(1)


def _force(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    if not re.fullmatch(",".join([_NUMBER] * 3), text):
        raise typer.BadParameter(f"'{text}' is not a force; write for example 0,0,-150", param_hint="--force-n")
    x, y, z = map(float, text.split(","))
    return x, y, z


def _csv(found: "taskcal.correction.PartPlacements") -> str:
    return csv_of(placed.summary() for placed in found.all)


def _show(found: "taskcal.correction.PartPlacements", *, calibrated: bool) -> None:
    from taskcal.report.placement import state_placement, state_recommendation, state_trade, tabulate_placements

    show(tabulate_placements(found))
    facts = [("present placement", state_placement(found.now))]
    if found.ranked:
        facts.append(("best placement", state_placement(found.ranked[0])))
        facts.append(("to reach it", state_trade(found, found.ranked[0])))
        facts.append(("recommended", state_recommendation(found)))
        if found.ranked[0].outside:
            facts.append(("measured range", f"at the best placement, {found.ranked[0].outside}"))
    else:
        facts.append(
            ("feasible", next((p.obstacle for p in found.all if p.obstacle), "none: all are near singularities"))
        )
    show_facts(facts)
    if not calibrated:
        tell(
            "before: expected from the robot's tolerances, in its base frame; pass --calibration for the error after correction"
        )
