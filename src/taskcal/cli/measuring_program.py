"""Measuring programs that ``taskcal plan`` writes beside the plan."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    import numpy as np

    from taskcal.programs.source import Source
    from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class MeasuringOptions:
    """Programs that drive the robot through the poses to measure, and how they drive it."""

    program: Annotated[
        list[Path] | None,
        typer.Option(
            "--program",
            metavar="MEASURE.mod",
            readable=False,
            help="Write a robot program that stops in every pose: RAPID .mod, KRL .src, TP .ls or .csv; may be given repeatedly.",
        ),
    ] = None
    wait_s: Annotated[
        float,
        typer.Option(
            "--wait-s", min=0.0, max=600.0, metavar="S", help="How long it waits in each pose for the tracker."
        ),
    ] = 3.0
    speed_mm_s: Annotated[
        float,
        typer.Option(
            "--speed-mm-s", min=0.1, max=10_000.0, metavar="MM/S", help="Its speed of the tool point, in RAPID."
        ),
    ] = 250.0
    speed_percent: Annotated[
        float,
        typer.Option(
            "--speed-percent", min=0.1, max=100.0, metavar="P", help="Its share of the joints' speeds, in KRL."
        ),
    ] = 10.0

    @property
    def paths(self) -> tuple[Path, ...]:
        """Files to write."""
        return tuple(self.program or ())

    def compose(self, robot: "Robot", q: "np.ndarray") -> "tuple[Source, ...]":
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
                wait_s=self.wait_s,
                speed=self.speed_mm_s * 1e-3,
                joint_speed_percent=self.speed_percent,
            )
            for path in self.paths
        )

    def check(self, robot: "Robot") -> None:
        """See, before anything is computed, that a program can be written to each file.

        Raises:
            TaskcalError: it cannot.
        """
        import numpy as np

        self.compose(robot, np.empty((0, len(robot.joints))))
