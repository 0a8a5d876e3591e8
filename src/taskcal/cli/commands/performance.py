"""``taskcal performance``: accuracy and repeatability of measured poses and paths, after ISO 9283."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from taskcal.cli.command import argument, option
from taskcal.cli.options.common import split_names
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import info
from taskcal.cli.run import Result

if TYPE_CHECKING:
    from taskcal.report.content import Section
    from taskcal.report.page import Report

POSE_CYCLES, PATH_CYCLES = 30, 10
"""Cycles that the standard requires (ISO 9283:1998, 6.9)."""


def command(
    *,
    measured: Path = argument(..., "MEASURED.csv", "Measured cycles, with their commands."),
    path: bool = option(False, help="The rows are passes along a path: 'section' in place of 'pose'."),
    commanded: Path | None = option(
        None, "PATH.csv", "Separate file with the commanded path; passes may be sampled anywhere.", named="command"
    ),
    distance: list[str] | None = option(
        None, "POSE,POSE", "Two poses whose distance is evaluated; repeatable; by default consecutive ones."
    ),
    page: PageOptions,
) -> Result:
    """Evaluate accuracy and repeatability of poses or paths (ISO 9283)."""
    if path or commanded is not None:
        if distance:
            raise typer.BadParameter("a path has no poses with distances; leave one out", param_hint="--distance")
        title, result, sections = "Performance along a path", *_of_path(measured, commanded)
    else:
        pairs = None if distance is None else [_pair(text) for text in distance]
        title, result, sections = "Performance of poses", *_of_poses(measured, pairs)

    def make() -> "Report":
        from taskcal.report.performance import performance_page

        return performance_page(title, sections(), str(measured))

    return Result(summary=result, sections=sections, page=make)


def _pair(text: str) -> tuple[str, str]:
    names = split_names(text, "--distance") or []
    if len(names) != 2:
        raise typer.BadParameter(f"'{text}' is not two poses; write for example P2,P4", param_hint="--distance")
    return names[0], names[1]


def _of_path(measured: Path, commanded: Path | None) -> "tuple[dict[str, Any], Callable[[], list[Section]]]":
    from taskcal.campaigns.performance import assess_path, read_path_cycles
    from taskcal.errors import CampaignError, FileError

    cycles = read_path_cycles(measured, commanded)
    try:
        performance = assess_path(
            cycles.commanded,
            cycles.attained,
            commanded_rotations=cycles.commanded_rotations,
            rotations=cycles.rotations,
        )
    except CampaignError as error:
        raise FileError(measured, str(error)) from error
    _ask_for_cycles("a path", performance.cycles, PATH_CYCLES)
    left_out = [cycles.sections[i] for i in performance.left_out]
    if left_out:
        info(f"{len(left_out)} of {len(cycles.sections)} sections are not crossed by every pass and left out")
    result = {**performance.summary(), "left_out": left_out}

    def sections() -> "list[Section]":
        from taskcal.report.performance import path_sections

        return path_sections(performance)

    return result, sections


def _of_poses(
    measured: Path, pairs: Sequence[tuple[str, str]] | None
) -> "tuple[dict[str, Any], Callable[[], list[Section]]]":
    from taskcal.campaigns.performance import assess_cycles, read_pose_cycles
    from taskcal.errors import CampaignError, FileError

    cycles = read_pose_cycles(measured)
    try:
        performance = assess_cycles(cycles, pairs)
    except CampaignError as error:
        raise FileError(measured, str(error)) from error
    _ask_for_cycles("a pose", min(pose.cycles for pose in performance.poses.values()), POSE_CYCLES)

    def sections() -> "list[Section]":
        from taskcal.report.performance import pose_sections

        return pose_sections(performance)

    return performance.summary(), sections


def _ask_for_cycles(what: str, cycles: int, wanted: int) -> None:
    if cycles == 1:
        info(f"{what} measured once has an accuracy but no repeatability; ISO 9283 requires {wanted} cycles")
    elif cycles < wanted:
        info(f"ISO 9283 requires {wanted} cycles of {what}; there are {cycles}")
