"""``taskcal place``: where to put the part, by the error to be expected there."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import check_outputs, files_of_task, info, show, show_facts, tell, write_json
from taskcal.cli.progress import bar_over

if TYPE_CHECKING:
    from robot_programs.core.program import Program
    from taskcal.correction.part_placement import PartPlacements, Region
    from taskcal.identification.calibration import Calibration
    from taskcal.report.page import Page
    from taskcal.robot.robot import Robot
    from taskcal.task.task import Task

_NUMBER = r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*"


def _range(text: str, option: str, unit: str) -> tuple[float, float]:
    """Two numbers with a colon between them, or one."""
    if not re.fullmatch(f"{_NUMBER}(?::{_NUMBER})?", text):
        raise typer.BadParameter(f"'{text}' is not a range; write for example -200:200, in {unit}", param_hint=option)
    low, _, high = text.partition(":")
    return float(low), float(high or low)


@dataclass(frozen=True, kw_only=True)
class RegionOptions:
    """Where the part may be put."""

    region: Annotated[
        str,
        typer.Option(
            "--region",
            metavar="X:X,Y:Y,Z:Z",
            help="How far the part may be moved from where it stands, along the base's axes, mm: -300:300,-200:200,0:100.",
        ),
    ]
    turn_deg: Annotated[
        str,
        typer.Option(
            "--turn",
            metavar="DEG:DEG",
            help="How far it may be turned about the vertical through the middle of the targets.",
        ),
    ] = "0"
    steps: Annotated[
        int, typer.Option("--steps", min=1, metavar="N", help="Placements along each axis along which it may be moved.")
    ] = 5
    turns: Annotated[int, typer.Option("--turns", min=1, metavar="N", help="Turns, where it may be turned.")] = 3

    def grid(self) -> "Region":
        """In metres and radians.

        Raises:
            TaskcalError: there is no such region.
        """
        import numpy as np

        from taskcal.correction.part_placement import Region

        axes = self.region.split(",")
        if len(axes) != 3:
            raise typer.BadParameter(
                f"'{self.region}' has {len(axes)} ranges; write three, as -300:300,-200:200,0", param_hint="--region"
            )
        bounds = np.array([_range(text, "--region", "mm") for text in axes]) * 1e-3
        low, high = _range(self.turn_deg, "--turn", "degrees")
        turn = float(np.radians(low)), float(np.radians(high))
        return Region(low=bounds[:, 0], high=bounds[:, 1], turn=turn, steps=(self.steps, self.turns))


@dataclass(frozen=True, kw_only=True)
class OnOptions:
    """The robot, as calibrated or as built.

    Raises:
        typer.BadParameter: none is given, or both.
    """

    calibration: Annotated[
        Path | None,
        typer.Option(
            "--calibration",
            "-c",
            metavar="CAL.json",
            readable=False,
            help="The robot as calibrated.",
        ),
    ] = None
    robot: Annotated[
        str | None,
        typer.Option("--robot", "-r", metavar="ROBOT", help="A robot by its tolerances: catalogue name, or a file."),
    ] = None

    def __post_init__(self) -> None:
        if (self.calibration is None) == (self.robot is None):
            raise typer.BadParameter("give exactly one of them", param_hint="--calibration / --robot")

    def load(self) -> "tuple[Calibration | Robot, Robot]":
        """What the error is expected of, and its robot."""
        from taskcal.identification.calibration import load_calibration
        from taskcal.robot.catalogue import load_robot

        if self.calibration is not None:
            calibration = load_calibration(self.calibration)
            return calibration, calibration.model.robot
        assert self.robot is not None
        robot = load_robot(self.robot)
        return robot, robot


def command(
    what: Annotated[
        list[Path],
        typer.Argument(metavar="PROGRAM|TASK.toml [MORE …]", readable=False, help="The files of a program, or a task."),
    ],
    on: OnOptions,
    where: RegionOptions,
    cell: Annotated[
        Path | None,
        typer.Option(
            "--cell", metavar="CELL.toml", readable=False, help="What was measured of the program's tools and parts."
        ),
    ] = None,
    touched_off: Annotated[
        bool,
        typer.Option(
            "--touched-off",
            help="The part is touched off or measured where it is put: what is common to all targets does not count.",
        ),
    ] = False,
    force_n: Annotated[
        str | None,
        typer.Option(
            "--force-n", metavar="X,Y,Z", help="Force of the process on the tool, newtons, in axes of the base."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="MAP.csv", readable=False, help="Write all placements here."),
    ] = None,
    *,
    page: PageOptions,
) -> None:
    """Compare placements of a part by the expected error.

    For every placement: the expected error before and after the correction, how far a process force deflects the tool, whether
    every motion can be executed, and how far the joints stay from their limits and from singular postures.
    """
    force = _force(force_n)
    is_task = len(what) == 1 and what[0].suffix.lower() == ".toml"
    files = files_of_task(what[0]) if is_task else what
    inputs = [path for path in (*files, on.calibration, cell, page.header) if path is not None]
    outputs = check_outputs("place", [("--output", output), *page.places], inputs, force=page.force)
    page.check()
    from taskcal.correction.cell import load_cell
    from taskcal.correction.part_placement import place

    region = where.grid()
    loaded, robot = on.load()
    target = _read(what, robot, is_task=is_task)
    number = len(region.grid())
    with bar_over(["placements"], number) as say:
        found = place(
            loaded,
            target,
            region,
            cell=None if cell is None else load_cell(cell),
            force=force,
            touched_off=touched_off,
            progress=lambda done, of: say("placements"),
        )
    files_written: dict[Path, str | bytes] = {} if output is None else {output: _csv(found)}
    if page.asked:
        files_written |= page.compose(_page(found, robot, calibrated=on.calibration is not None))
    outputs.write(files_written)
    if page.as_json:
        write_json({**_as_json(found, output), **page.summary()})
    else:
        _show(found, calibrated=on.calibration is not None)
        if files_written:
            info(f"written: {page.in_words(files_written)}")
    if not found.ranked:
        raise typer.Exit(1)


def _force(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    if not re.fullmatch(",".join([_NUMBER] * 3), text):
        raise typer.BadParameter(f"'{text}' is not a force; write for example 0,0,-150", param_hint="--force-n")
    x, y, z = map(float, text.split(","))
    return x, y, z


def _read(paths: list[Path], robot: "Robot", *, is_task: bool) -> "Program | Task":
    from robot_programs.reading import read_program
    from taskcal.task.task import load_task

    return load_task(paths[0]) if is_task else read_program(*paths, robot=robot)


def _csv(found: "PartPlacements") -> str:
    import pandas as pd

    return pd.DataFrame([placed.summary() for placed in found.all]).to_csv(index=False)


def _page(found: "PartPlacements", robot: "Robot", *, calibrated: bool) -> "Page":
    from taskcal.identification.provenance import package_version
    from taskcal.report.placement import placement_page

    return placement_page(found, robot.title or robot.name, calibrated=calibrated, version=package_version())


def _as_json(found: "PartPlacements", output: Path | None) -> dict[str, Any]:
    from taskcal.report.placement import SHOWN

    return {
        "name": found.name,
        "written": output,
        "now": found.now.summary(),
        "best": [placed.summary() for placed in found.ranked[:SHOWN]],
        "placements": [placed.summary() for placed in found.all],
    }


def _show(found: "PartPlacements", *, calibrated: bool) -> None:
    from taskcal.report.placement import state_cost, state_placement, tabulate_placements

    ranked = found.ranked
    show(tabulate_placements(found))
    facts = [("as it stands", state_placement(found.now))]
    if ranked:
        facts.append(("best", state_placement(ranked[0])))
        facts.append(("best costs", state_cost(found.now, ranked[0])))
    else:
        facts.append(("none", next((p.obstacle for p in found.all if p.obstacle), "all come near singular postures")))
    show_facts(facts)
    if not calibrated:
        tell("before: of the robot's tolerances, in its own base; a calibration tells what is left after a correction")
