"""Measuring programs that ``taskcal plan`` writes beside the plan."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    import numpy as np

    from taskcal.programs.source import Source
    from taskcal.robot.robot import Robot

ProgramsOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--program",
        metavar="MEASURE.mod",
        readable=False,
        help="Write a robot program that stops in every pose: RAPID .mod, KRL .src or .csv; may be given several times.",
    ),
]
WaitOption = Annotated[
    float,
    typer.Option("--wait-s", min=0.0, max=600.0, metavar="S", help="How long it waits in each pose for the tracker."),
]
SpeedOption = Annotated[
    float,
    typer.Option("--speed-mm-s", min=0.1, max=10_000.0, metavar="MM/S", help="Its speed of the tool point, in RAPID."),
]
JointSpeedOption = Annotated[
    float,
    typer.Option("--speed-percent", min=0.1, max=100.0, metavar="P", help="Its share of the joints' speeds, in KRL."),
]


def compose_measuring(
    paths: Sequence[Path],
    robot: "Robot",
    q: "np.ndarray",
    *,
    wait_s: float,
    speed_mm_s: float,
    speed_percent: float,
) -> "tuple[Source, ...]":
    """Programs that visit poses, each with a comment that says which pose of the plan it is.

    Raises:
        TaskcalError: a language cannot say it, or its suffix is not known.
    """
    from taskcal.programs.composing import compose_program, moves_to_joints

    return tuple(
        compose_program(
            path,
            robot,
            moves_to_joints(robot, q, path),
            notes=[f"pose {k}" for k in range(len(q))],
            wait_s=wait_s,
            speed=speed_mm_s * 1e-3,
            joint_speed_percent=speed_percent,
        )
        for path in paths
    )
