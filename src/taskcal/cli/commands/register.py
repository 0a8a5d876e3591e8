"""``taskcal register``: tracker frame and targets from a raw campaign and the nominal robot."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import taskcal
from taskcal.cli.command import option, output_option
from taskcal.cli.options.campaign import CampaignOptions
from taskcal.cli.options.common import CampaignArgument, RobotOption
from taskcal.cli.run import File, OutputOptions, Result
from taskcal.geometry.se3 import placement
from taskcal.registration.options import Method, register_by
from taskcal.report.content import Column, Facts, Section, TextTable

MAX_WORST = 5
"""Rows with the largest residuals that are shown."""

CIRCLES = (
    Column("axis", "axis"),
    Column("target", "target"),
    Column("rows", "rows", "d"),
    Column("arc °", "arc_deg", ".1f"),
    Column("radius mm", "radius_mm", ".2f"),
    Column("rms residual mm", "residual_mm", ".3f"),
)

FRAMES = (
    Column("", "name"),
    *(Column(f"{axis} mm", lambda frame, k=k: frame["position_mm"][k], ".3f") for k, axis in enumerate("xyz")),
    *(Column(f"q{axis}", lambda frame, k=k: frame["quaternion"][k], ".6f") for k, axis in enumerate("xyzw")),
)


def command(
    *,
    campaign: CampaignArgument,
    robot: RobotOption,
    method: Method = option("poses", help="All poses, or the circles of axes that turn alone (two or more)."),
    output: Path | None = output_option(None, "REG.json", "Output: the registration, for identify --registration."),
    reading: CampaignOptions,
    out: OutputOptions,
) -> Result:
    """Register tracker frame and targets with the nominal robot.

    The result is the start of the fit of taskcal identify. No parameter of the robot is identified.
    """
    from taskcal.registration.registration_file import registration_text

    model = taskcal.ErrorModel(taskcal.load_robot(robot))
    read = reading.read(campaign, model.robot)
    registration = register_by(method, model, read.campaign)
    circles = taskcal.registration.find_circles(model, read.campaign) if method == "circles" else ()
    result = {
        "registration": output,
        "robot": model.robot.name,
        "method": method,
        **_frames(registration, model, read.campaign),
        "circles": [_circle(circle, model, read.campaign) for circle in circles],
        "drift": read.drift,
    }
    text = registration_text(registration, model, read.campaign)
    return Result(summary=result, sections=lambda: [_section(result)], files=[File("registration", output, text)])


def _frames(
    registration: "taskcal.registration.Registration", model: "taskcal.ErrorModel", campaign: "taskcal.Campaign"
) -> dict[str, Any]:
    """Frames and residuals, in millimetres."""
    from taskcal.registration.registration import registration_residuals
    from taskcal.report.calibration import describe_unobservable

    left = registration_residuals(registration, model, campaign)
    names = [f"{target}_mm" for target in campaign.targets]
    return {
        "rows": len(campaign),
        "tracker_frame": placement(registration.T_tracker_base),
        "targets": {
            name: {**placement(T), "unlocated": unlocated or None}
            for name, T, unlocated in zip(
                campaign.targets, registration.T_tool_target, describe_unobservable(registration), strict=True
            )
        },
        **left.summary(),
        "residuals": [
            {"row": campaign.row_of(i), "id": name, **dict(zip(names, values, strict=True))}
            for i, (name, values) in enumerate(zip(campaign.ids, left.distances * 1e3, strict=True))
        ],
    }


def _circle(
    circle: "taskcal.registration.AxisCircle", model: "taskcal.ErrorModel", campaign: "taskcal.Campaign"
) -> dict[str, Any]:
    import numpy as np

    return {
        "axis": model.robot.joint_names[circle.axis],
        "target": campaign.targets[circle.target],
        "rows": len(circle.rows),
        "arc_deg": float(np.degrees(circle.arc)),
        "radius_mm": circle.radius * 1e3,
        "centre_mm": circle.centre * 1e3,
        "normal": circle.normal,
        "residual_mm": circle.residual * 1e3,
    }


def _section(result: Mapping[str, Any]) -> Section:
    """Frames and residuals for people."""
    frames = [{"name": "robot base, in the tracker frame", **result["tracker_frame"]}]
    frames += [{"name": f"target {name}, in the tool frame", **target} for name, target in result["targets"].items()]
    title = f"Registration of {result['robot']} from {result['method']}, {result['rows']} rows"
    worst = sorted(result["residuals"], key=_largest, reverse=True)[:MAX_WORST]
    return Section(
        "Registration",
        TextTable.of("Circles in the tracker frame", CIRCLES, result["circles"]),
        TextTable.of(title, FRAMES, frames),
        Facts(
            (
                "residual, nominal (registered)",
                f"{result['mean_mm']:.3f} mm mean, {result['rms_mm']:.3f} rms, {result['max_mm']:.3f} maximum (3D)",
            ),
            (
                "largest residuals",
                ", ".join(f"row {row['row']} (id {row['id']}) {_largest(row):.3f} mm" for row in worst),
            ),
            *(
                (f"target {name}", target["unlocated"])
                for name, target in result["targets"].items()
                if target["unlocated"]
            ),
        ),
    )


def _largest(row: Mapping[str, Any]) -> float:
    """The largest residual among the row's targets; zero where none was seen."""
    return max((v for key, v in row.items() if key.endswith("_mm") and v == v), default=0.0)
