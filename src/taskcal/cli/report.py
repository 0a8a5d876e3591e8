"""``taskcal report``: a calibration as a page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options import JsonOption, SeedOption
from taskcal.cli.output import announce_compilation, check_destination, working, write_json

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.presentation.calibration_report import Uncertainty
    from taskcal.task.task import Task


def command(
    calibration: Annotated[
        Path, typer.Argument(metavar="CAL.json", readable=False, help="Calibration written by taskcal identify.")
    ],
    task: Annotated[
        Path | None,
        typer.Option(
            "--task", "-t", metavar="TASK.toml", readable=False, help="Show the uncertainty of the tool over this task."
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="REPORT.html", readable=False, help="Page to write.")
    ] = Path("report.html"),
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Make a page of a calibration: parameters, residuals, outliers, uncertainty over a task."""
    check_destination(output, [path for path in (calibration, task) if path is not None])
    from taskcal.files import write_whole
    from taskcal.identification.calibration import load_calibration, package_version
    from taskcal.presentation.calibration_report import calibration_html
    from taskcal.task.task import load_task

    known = load_calibration(calibration)
    asked = None if task is None else load_task(task)
    announce_compilation()
    with working("uncertainty and page"):
        over = None if asked is None else uncertainty_over(known, asked, seed)
        write_whole(output, calibration_html(known, over, version=package_version()))
    result: dict[str, Any] = {"report": output, "robot": known.model.robot.name, "rows": len(known.residuals)}
    result["outliers"] = len(known.outliers)
    if over is not None:
        result |= {
            "task": over.task,
            "before_mm": over.before * 1e3,
            "after_mm": over.after * 1e3,
            "target_mm": over.target * 1e3,
        }
    if as_json:
        write_json(result)
        return
    if over is not None:
        print(
            f"over '{over.task}', standard deviation in space, rms: target {over.target * 1e3:.4f} mm; tool "
            f"{over.after * 1e3:.4f} mm, {over.before * 1e3:.4f} mm by the tolerances alone"
        )
    print(f"wrote {output}")


def uncertainty_over(calibration: "Calibration", task: "Task", seed: int) -> "Uncertainty":
    """How well the tool is known over a task: by the tolerances alone, and calibrated.

    Raises:
        ReachError: the robot does not reach the task.
    """
    import numpy as np

    from taskcal.adaptation.task_map import map_tolerance, map_uncertainty, slice_workspace
    from taskcal.presentation.calibration_report import Uncertainty
    from taskcal.task.task import reach_task

    model = calibration.model
    poses = reach_task(model, task, seed=seed)
    effect = model.jacobian(poses.q, angular=False) * model.tolerances
    turn = calibration.T_tracker_base[:3, :3]

    def target(q: np.ndarray) -> np.ndarray:
        return calibration.predict_covariance(q, model_error=False)[:, 0, :3, :3]

    def per_axis(covariance: np.ndarray) -> np.ndarray:
        in_base = turn.T @ covariance[:, :3, :3] @ turn
        return np.sqrt(np.maximum(np.diagonal(in_base, axis1=1, axis2=2), 0.0))

    def in_space(deviation: np.ndarray) -> float:
        return float(np.sqrt(np.sum(poses.weights[:, None] * deviation**2)))

    before = np.sqrt((effect**2).sum(axis=2))
    after, point = per_axis(calibration.tool_covariance(poses.q)), per_axis(target(poses.q))
    slices = () if task.workspace is None else slice_workspace(model, task)
    return Uncertainty(
        task=task.name,
        unreachable=float(poses.unreachable.mean()),
        before=in_space(before),
        after=in_space(after),
        target=in_space(point),
        deviations={
            "tool, by the tolerances": before,
            "tool, calibrated": after,
            f"target {calibration.targets[0]}": point,
        },
        slices=slices,
        maps={
            "target": tuple(at.spread(np.sqrt(np.trace(target(at.q[at.reached]), axis1=1, axis2=2))) for at in slices),
            "tool": tuple(map_uncertainty(calibration, at) for at in slices),
            "by the tolerances": tuple(map_tolerance(model, at) for at in slices),
        },
    )
