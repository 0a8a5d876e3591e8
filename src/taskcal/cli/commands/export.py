"""``taskcal export``: a calibrated robot for other programs, or the offsets that a controller can hold of it."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import option, output_option
from taskcal.cli.options.common import (
    REACHING,
    AcceptUncertainOption,
    CalibrationArgument,
    CountOption,
    UnsealedOption,
    read_and_reach,
    read_calibration,
    task_option,
)
from taskcal.cli.output import info, plain, with_edits
from taskcal.cli.progress import bar_over
from taskcal.cli.run import File, OutputOptions, Result, Run
from taskcal.report.content import Column, Facts, Section, TextTable
from taskcal_groundwork.options import Seed

if TYPE_CHECKING:
    import numpy as np


OFFSETS = "offsets"
"""The form of a controller's offsets: not a file for another program, but a result of its own."""


def command(
    *,
    run: Run,
    calibration: CalibrationArgument,
    unsealed: UnsealedOption = False,
    form: str = option(
        ...,
        "urdf|mjcf|sdf|usd|ur-yaml|xarm-yaml|flexiv-yaml|dh|mdh|c|cffi|camera-info|opencv-yaml|camera-toml|camera-urdf|offsets|…",
        "urdf: links and joints; mjcf, sdf, usd: the same for MuJoCo, Gazebo, and Isaac or others; ur-yaml, xarm-yaml, "
        "flexiv-yaml: kinematics of these makers' ROS packages; dh, mdh: a table; c: C99 source of the whole "
        "calibration; cffi: the same as a module for Python; camera-info, opencv-yaml, camera-toml, camera-urdf: the camera of "
        "a calibration from images, for ROS, OpenCV, Taskcal's --camera, and as a link of a URDF; offsets: joint zeros, "
        "tool and base alone, with the remaining error; or a form of an installed package.",
    ),
    output: Path | None = output_option(
        None,
        "FILE|FOLDER",
        "File to write, optional for offsets; for c and cffi a folder, whose name all names begin with; a folder with --samples.",
        writes="later",
    ),
    camera: str | None = option(None, "NAME", "The camera to write, of a calibration from images of several."),
    meshes: str | None = option(
        None, "URDF", "The URDF of this robot, whose visible meshes the links of urdf, mjcf, sdf and usd get."
    ),
    samples: int | None = option(
        None,
        "N",
        "Draw this many robots from the posterior, for urdf, mjcf, sdf and usd, with a table of parameters.",
        low=1,
    ),
    task: Path | None = task_option("Fit offsets and measure losses over this task; by default over the joint ranges."),
    count: CountOption = 200,
    seed: Seed = 0,
    accept_loss: bool = option(False, help="Write the file even if its form cannot hold the whole calibration."),
    accept_uncertain: AcceptUncertainOption = False,
    out: OutputOptions,
) -> Result:
    """Export a calibrated robot, or fit the offsets of a controller."""
    form, exporter = form.lower(), None if form.lower() == OFFSETS else _exporter(form.lower())
    if output is None and exporter is not None:
        raise typer.BadParameter(f"name the file to write as {form}", param_hint="--output")
    for option_name, value in (("--meshes", meshes), ("--samples", samples)):
        if value is not None and (exporter is None or exporter.description is None):
            raise typer.BadParameter(f"is not for {form}, but for urdf, mjcf, sdf and usd", param_hint=option_name)
    if camera is not None and (exporter is None or exporter.camera is None):
        raise typer.BadParameter(
            f"is not for {form}, but for camera-info, opencv-yaml, camera-toml and camera-urdf", param_hint="--camera"
        )
    several = samples is not None or (exporter is not None and exporter.folder is not None)
    if several and output is not None and output.exists() and not output.is_dir():
        raise typer.BadParameter(
            f"'{output}' is a file, and {form} is a folder of several; name a folder", param_hint="--output"
        )
    run.free("--output", None if several else output)

    calibrated = read_calibration(calibration, unsealed=unsealed)
    name, reached = calibrated.model.robot.name, None
    if task is not None:
        with bar_over([REACHING]) as begin:
            reached = read_and_reach(taskcal.ErrorModel(calibrated.model.robot), task, count, seed, begin)
    if exporter is None or output is None:
        q, weights = _poses(reached)
        offsets = taskcal.export.fit_offsets(calibrated, q, weights, accept_uncertain=accept_uncertain)
        result: dict[str, Any] = {"robot": name, "form": form, **offsets.summary()}
        text = json.dumps(plain(with_edits(result)), indent=1, allow_nan=False) + "\n"
        return Result(
            summary=result,
            sections=lambda: [_offsets_section(name, offsets, task)],
            files=[File("offsets", output, text)],
        )
    q = _poses(reached)[0]
    if exporter.camera is None and not accept_uncertain:
        _check_known(calibrated, form, q)
    export = _export(
        exporter,
        calibrated,
        q,
        output,
        camera=camera,
        meshes=meshes,
        samples=samples,
        seed=seed,
        accept_loss=accept_loss,
    )
    for remark in export.remarks:
        info(remark)
    if export.loss.reasons:
        info(f"lost by the form: {export.loss.rms * 1e3:.3f} mm (3D rms), {', '.join(export.loss.reasons)}")
    files = [File(form, output, export.text, f": {name}")]
    if several:
        files = [File("", output / file, text) for file, text in export.files.items()]
    return Result(
        summary={"robot": name, "form": form, "file": output, **export.summary()},
        sections=lambda: [_section(export, (form, f"wrote {output}: {name}") if several else None)],
        files=files,
    )


def _export(
    exporter: "taskcal.export.Exporter",
    calibration: "taskcal.Calibration",
    q: "np.ndarray | None",
    output: Path,
    *,
    camera: str | None,
    meshes: str | None,
    samples: int | None,
    seed: int,
    accept_loss: bool,
) -> "taskcal.export.Export":
    """The files of a form."""
    if exporter.folder is not None:
        return exporter.folder(calibration, output.name)
    if exporter.camera is not None:
        return exporter.camera(calibration, camera)
    if exporter.description is None:
        return exporter.write(calibration, q, accept_loss)
    keys: dict[str, Any] = {"meshes": meshes, "accept_loss": accept_loss, "accept_uncertain": True}
    if samples is None:
        return taskcal.export.export_description(calibration, exporter.description, q, folder=output.parent, **keys)
    return taskcal.export.export_samples(
        calibration, exporter.description, samples, q, seed=seed, folder=output, **keys
    )


def _check_known(calibration: "taskcal.Calibration", form: str, q: "np.ndarray | None") -> None:
    """See that the calibration knows something of the poses of a task, or all over the joints' ranges.

    Raises:
        TaskcalError: it does not.
    """
    from taskcal.export.forms import spread_poses
    from taskcal.identification.uncertainty_budget import check_known

    q, over = (spread_poses(calibration), "the joint ranges (see --task)") if q is None else (q, "the task")
    check_known(calibration, q, f"{form} over {over} is not written")


def _exporter(form: str) -> "taskcal.export.Exporter":
    from taskcal.errors import UnknownName
    from taskcal.export.exporters import exporter_of

    try:
        return exporter_of(form)
    except UnknownName as error:
        raise typer.BadParameter(f"{error}, {OFFSETS}", param_hint="--form") from error


def _poses(reached: "taskcal.task.TaskPoses | None") -> "tuple[np.ndarray | None, np.ndarray | None]":
    return (None, None) if reached is None else (reached.q, reached.weights)


def _section(export: "taskcal.export.Export", folder: tuple[str, str] | None) -> Section:
    """Frames of an export, and the folder of its files, where it is one."""
    from taskcal.export.forms import describe_place

    return Section("Export", Facts(*((name, describe_place(T)) for name, T in export.frames.items()), folder))


SETTINGS = {
    "tool and base": "tool_and_base",
    "joint zeros, tool and base": "zeros_tool_and_base",
    "whole model, programs corrected": "program_correction",
}

REMAINING = (
    Column("set in the controller", "label"),
    Column("remaining rms mm", "left_rms_mm", ".3f"),
    Column("remaining max mm", "left_max_mm", ".3f"),
    Column("rms with uncertainty mm", "expected_rms_mm", ".3f"),
)


def _offsets_section(robot: str, offsets: "taskcal.export.ControllerOffsets", task: Path | None) -> Section:
    from taskcal.export.forms import describe_place

    result, over = offsets.summary(), "the joint ranges" if task is None else str(task)
    joints = ((name.rpartition("_"), value) for name, value in result["joint_offsets"].items())
    return Section(
        "Offsets",
        f"{robot}: offsets for its controller; add each joint's offset to its reading",
        Facts(
            *((name, f"{value:+.5f} {unit}") for (name, _, unit), value in joints),
            ("tool in the flange", describe_place(offsets.tool_in_flange)),
            ("base", describe_place(offsets.base)),
        ),
        TextTable.of(
            f"3D error of the TCP over {over} ({offsets.poses} poses)",
            REMAINING,
            [{"label": label, **result[key]} for label, key in SETTINGS.items()],
        ),
    )
