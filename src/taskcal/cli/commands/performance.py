"""``taskcal performance``: accuracy and repeatability of measured poses and paths, after ISO 9283."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.common import split_names
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import check_outputs, info, show_table, write_json

if TYPE_CHECKING:
    from taskcal.cli.output import Outputs
    from taskcal.report.page import Page

POSE_CYCLES, PATH_CYCLES = 30, 10
"""How many cycles the standard asks for (ISO 9283:1998, 6.9)."""


def command(
    measured: Annotated[
        Path, typer.Argument(metavar="MEASURED.csv", readable=False, help="Measured cycles, with their commands.")
    ],
    path: Annotated[
        bool, typer.Option("--path", help="The rows are passes along a path: 'section' in place of 'pose'.")
    ] = False,
    commanded: Annotated[
        Path | None,
        typer.Option(
            "--command",
            metavar="PATH.csv",
            readable=False,
            help="The commanded path, in a file of its own; samples of the passes may lie anywhere along it.",
        ),
    ] = None,
    distance: Annotated[
        list[str] | None,
        typer.Option(
            "--distance",
            metavar="POSE,POSE",
            help="Two poses to judge the distance of; may be repeated; else each two in turn.",
        ),
    ] = None,
    *,
    out: PageOptions,
) -> None:
    """Evaluate accuracy and repeatability of poses or paths (ISO 9283)."""
    outputs = check_outputs("performance", out.places, [measured, commanded, out.header], force=out.force)
    out.check()
    as_json = out.as_json
    if path or commanded is not None:
        if distance:
            raise typer.BadParameter("a path has no poses with distances; leave one out", param_hint="--distance")
        result, page = _of_path(measured, commanded)
        _write(outputs, out, page)
        if as_json:
            write_json(result)
        else:
            _show(f"Path of {measured}", [result])
        return
    pairs = None if distance is None else [_pair(text) for text in distance]
    results, page = _of_poses(measured, pairs)
    _write(outputs, out, page)
    if as_json:
        write_json(results)
        return
    for key, title in (("poses", "Poses"), ("directions", "Directions of approach"), ("distances", "Distances")):
        if results[key]:
            _show(f"{title} of {measured}", results[key])


def _pair(text: str) -> tuple[str, str]:
    names = split_names(text, "--distance") or []
    if len(names) != 2:
        raise typer.BadParameter(f"'{text}' is not two poses; write for example P2,P4", param_hint="--distance")
    return names[0], names[1]


def _of_path(measured: Path, commanded: Path | None) -> "tuple[dict[str, Any], Page]":
    from taskcal.campaigns.performance import read_path_cycles
    from taskcal.errors import CampaignError, FileError

    cycles = read_path_cycles(measured, commanded)
    from taskcal.campaigns.performance import assess_path
    from taskcal.identification.provenance import package_version  # after the file was read: figures take a while
    from taskcal.report.performance import path_performance_page

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
    page = path_performance_page(performance, str(measured), version=package_version())
    return {**performance.summary(), "left_out": left_out}, page


def _of_poses(
    measured: Path, pairs: Sequence[tuple[str, str]] | None
) -> "tuple[dict[str, list[dict[str, Any]]], Page]":
    from taskcal.campaigns.performance import read_pose_cycles
    from taskcal.errors import CampaignError, FileError

    cycles = read_pose_cycles(measured)
    from taskcal.campaigns.performance import assess_cycles
    from taskcal.identification.provenance import package_version  # after the file was read: figures take a while
    from taskcal.report.performance import pose_performance_page

    try:
        performance = assess_cycles(cycles, pairs)
    except CampaignError as error:
        raise FileError(measured, str(error)) from error
    _ask_for_cycles("a pose", min(pose.cycles for pose in performance.poses.values()), POSE_CYCLES)
    return performance.summary(), pose_performance_page(performance, str(measured), version=package_version())


def _write(outputs: "Outputs", out: PageOptions, page: "Page") -> None:
    """Write the page, where one was asked for."""
    if out.asked:
        files = out.compose(page)
        outputs.write(files)
        info(f"wrote {out.in_words(files)}")


def _ask_for_cycles(what: str, cycles: int, wanted: int) -> None:
    if cycles == 1:
        info(f"{what} measured once has an accuracy but no repeatability; ISO 9283 asks for {wanted} cycles")
    elif cycles < wanted:
        info(f"ISO 9283 asks for {wanted} cycles of {what}; there are {cycles}")


def _show(title: str, results: Sequence[Mapping[str, Any]]) -> None:
    columns = [key for key in dict.fromkeys(key for result in results for key in result) if key != "left_out"]
    rows = [[_text(result[key]) if key in result else "" for key in columns] for result in results]
    show_table(title, [key.replace("_mm", " mm").replace("_deg", " °") for key in columns], rows)


def _text(value: float | int | str) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
