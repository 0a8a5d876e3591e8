"""``taskcal export``: a calibrated robot for other programs, or what a controller alone can hold of it."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.common import CalibrationArgument, CountOption, OutputOptions, SeedOption
from taskcal.cli.options.task import REACHING, read_and_reach
from taskcal.cli.output import check_outputs, files_of_task, info, plain, show_facts, show_table, tell, write_json
from taskcal.cli.progress import bar_over

if TYPE_CHECKING:
    import numpy as np

    from taskcal.export.controller import ControllerOffsets
    from taskcal.export.forms import Export, Exporter
    from taskcal.identification.calibration import Calibration


OFFSETS = "offsets"
"""What a controller alone can hold: not a file for another program, but a result of its own."""


@dataclass(frozen=True, kw_only=True)
class PosesOptions:
    """Where the robot is to be accurate."""

    task: Annotated[
        Path | None,
        typer.Option(
            "--task",
            "-t",
            metavar="TASK.toml",
            readable=False,
            help="Where offsets are to serve, and losses are measured; all over the joints' ranges by default.",
        ),
    ] = None
    count: CountOption = 200
    seed: SeedOption = 0


def command(
    calibration: CalibrationArgument,
    form: Annotated[
        str,
        typer.Option(
            "--form",
            metavar="urdf|ur-yaml|dh|mdh|offsets|…",
            help="urdf: links and joints, absolute; ur-yaml: kinematics of Universal Robots' driver; dh, mdh: a table; offsets: "
            "joint zeros, tool and base alone, with the error that they leave; or a form that an installed package writes.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", readable=False, help="File to write; optional for offsets."),
    ] = None,
    *,
    poses: PosesOptions,
    accept_loss: Annotated[
        bool,
        typer.Option("--accept-loss", help="Write the file even if its format cannot represent the whole calibration."),
    ] = False,
    out: OutputOptions,
) -> None:
    """Export a calibrated robot, or fit the offsets of a controller."""
    form, exporter = form.lower(), None if form.lower() == OFFSETS else _exporter(form.lower())
    if output is None and exporter is not None:
        raise typer.BadParameter(f"name the file to write as {form}", param_hint="--output")
    inputs = [calibration, *files_of_task(poses.task)]
    outputs = check_outputs("export", [("--output", output)], inputs, force=out.force)
    from taskcal.identification.calibration import load_calibration
    from taskcal.robot.error_model import ErrorModel

    calibrated = load_calibration(calibration)
    robot, reached = calibrated.model.robot, None
    if poses.task is not None:
        with bar_over([REACHING], 1) as begin:
            reached = read_and_reach(ErrorModel(robot), poses.task, poses.count, poses.seed, begin)
    q = None if reached is None else reached.q
    if exporter is None:
        from taskcal.export.controller import fit_offsets

        offsets = fit_offsets(calibrated, q, None if reached is None else reached.weights)
        result: dict[str, Any] = {"robot": robot.name, "form": form, **offsets.summary()}
        if output is not None:
            outputs.write({output: json.dumps(plain(result), indent=1, allow_nan=False) + "\n"})
        if out.as_json:
            write_json(result)
        else:
            _show_offsets(robot.name, offsets, poses.task)
        return
    export = exporter.write(calibrated, q, accept_loss)
    assert output is not None, "checked above"
    outputs.write({output: export.text})
    _say(export, calibrated, form, output, as_json=out.as_json)


def _exporter(form: str) -> "Exporter":
    from taskcal.errors import UnknownName
    from taskcal.export.forms import exporter_of

    try:
        return exporter_of(form)
    except UnknownName as error:
        raise typer.BadParameter(f"{error}, {OFFSETS}", param_hint="--form") from error


def _say(export: "Export", calibration: "Calibration", form: str, output: Path, *, as_json: bool) -> None:
    from taskcal.export.forms import placed

    for remark in export.remarks:
        info(remark)
    if export.loss.reasons:
        info(f"lost by the form: {export.loss.rms * 1e3:.3f} mm (rms), {', '.join(export.loss.reasons)}")
    if as_json:
        frames = {name: placed(T) for name, T in export.frames.items()}
        name = calibration.model.robot.name
        write_json({"robot": name, "form": form, "file": output, "loss": export.loss.summary(), "frames": frames})
        return
    tell(f"wrote {output}: {calibration.model.robot.name} as {form}")
    for name, T in export.frames.items():
        tell(f"{name}: {_place(T)}")


def _place(T: "np.ndarray") -> str:
    from taskcal.export.forms import placed

    place = placed(T)
    x, y, z = place["position_mm"]
    a, b, c = place["rpy_deg"]
    return f"x {x:.4f} y {y:.4f} z {z:.4f} mm, turned by {a:.5f}° {b:.5f}° {c:.5f}° about fixed x, y, z"


def _show_offsets(robot: str, offsets: "ControllerOffsets", task: Path | None) -> None:
    result = offsets.summary()
    facts = [
        (name.rpartition("_")[0], f"{value:+.5f} {name.rpartition('_')[2]}")
        for name, value in result["joint_offsets"].items()
    ]
    facts += [("tool in the flange", _place(offsets.tool_in_flange)), ("base", _place(offsets.base))]
    tell(f"{robot}: what its controller may hold; add each joint's offset to what it reads")
    show_facts(facts)
    rows = [
        (label, *(f"{result[key][column]:.3f}" for column in ("left_rms_mm", "left_max_mm", "expected_rms_mm")))
        for label, key in (
            ("tool and base", "tool_and_base"),
            ("joint zeros, tool and base", "zeros_tool_and_base"),
            ("whole model, programs corrected", "program_correction"),
        )
    ]
    over = "the joints' ranges" if task is None else str(task)
    header = ("the controller is told", "left, rms mm", "largest mm", "with uncertainty, rms mm")
    show_table(f"Error of the tool point over {over} ({offsets.poses} poses)", header, rows)
