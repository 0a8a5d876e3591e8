"""Measuring programs that ``taskcal plan`` writes beside the plan."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from taskcal.adaptation.measuring_way import MeasuringWay
    from taskcal.adaptation.planned import Plan
    from taskcal.programs.program import Move
    from taskcal.programs.source import Source
    from taskcal.robot.error_model import ErrorModel
    from taskcal.robot.robot import Robot

SLOW = 0.02
"""Speed of the tool point into a socket and out of it, in RAPID, metres per second."""


class Stop(NamedTuple):
    """Where one motion of a program ends."""

    q: "np.ndarray"
    note: str
    halts: bool = True
    waits: bool = False
    speed: float | None = None
    """Metres per second; None for the program's."""


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
        from taskcal.programs.composing import moves_to_joints

        notes = [f"pose {k}" for k in range(len(q))]
        return tuple(self._composed(path, robot, moves_to_joints(robot, q, path), notes) for path in self.paths)

    def compose_observed(self, model: "ErrorModel", plan: "Plan") -> "tuple[Source, ...]":
        """Programs of a plan without a tracker: a file for each anchor, or place of a block, where there are several.

        Into a socket they go slowly along its axis, wait there, and go out the same way.

        Raises:
            TaskcalError: a language cannot say it.
        """
        import numpy as np

        assert plan.way is not None
        assert plan.of is not None
        stage = plan.way.stages[plan.of]
        return tuple(
            self._visiting(path, model, plan, np.flatnonzero(stage == number))
            for paths in self.paths_of(plan.way)
            for number, path in enumerate(paths)
        )

    def paths_of(self, way: "MeasuringWay") -> tuple[tuple[Path, ...], ...]:
        """Of each file that was asked for, those that are written: one, or one for each of the stages, numbered from 1."""
        count = int(way.stages.max()) + 1
        if count == 1:
            return tuple((path,) for path in self.paths)
        return tuple(tuple(path.with_stem(f"{path.stem}_{k + 1}") for k in range(count)) for path in self.paths)

    def _visiting(self, path: Path, model: "ErrorModel", plan: "Plan", rows: "np.ndarray") -> "Source":
        """The program of some of the poses."""
        import numpy as np

        from taskcal.adaptation.socket_way import SocketWay
        from taskcal.programs.composing import moves_to_joints

        way, of = plan.way, plan.of
        assert way is not None
        assert of is not None
        visits = plan.q[:, None]
        if isinstance(way, SocketWay):
            inward = way.visits(model.nominal, plan.q, of)
            visits = np.concatenate([inward, inward[:, -2::-1]], axis=1)
        seat, via = visits.shape[1] // 2, {one.pose: one.via for one in plan.tight}
        slow = min(self.speed_mm_s * 1e-3, SLOW)
        said = {seat: "seated: read the joints", 0: "approach", 2 * seat: "out"} if seat else {}
        stops: list[Stop] = []
        for row in rows:
            round_by = via.get(int(row))
            stops += [Stop(q, f"on the way to pose {row}") for q in ([] if round_by is None else round_by)]
            unsafe = "not clear from the pose before" if row in via and round_by is None else ""
            for k, q in enumerate(visits[row]):
                remark = unsafe if unsafe and not k else said.get(k, "")
                note = " ".join(part for part in (f"pose {row}", plan.names[row], remark) if part)
                stops.append(Stop(q, note, halts=k in (0, seat, 2 * seat), waits=k == seat, speed=slow if k else None))
        moves = moves_to_joints(
            model.robot,
            np.stack([stop.q for stop in stops]),
            path,
            stops=[stop.halts for stop in stops],
            waits=[stop.waits for stop in stops],
            speeds=[stop.speed for stop in stops],
        )
        return self._composed(path, model.robot, moves, [stop.note for stop in stops])

    def _composed(self, path: Path, robot: "Robot", moves: "Sequence[Move]", notes: list[str]) -> "Source":
        from taskcal.programs.composing import compose_program

        return compose_program(
            path,
            robot,
            moves,
            notes=notes,
            wait_s=self.wait_s,
            speed=self.speed_mm_s * 1e-3,
            joint_speed_percent=self.speed_percent,
        )

    def check(self, robot: "Robot") -> None:
        """See, before anything is computed, that a program can be written to each file.

        Raises:
            TaskcalError: it cannot.
        """
        import numpy as np

        self.compose(robot, np.empty((0, len(robot.joints))))
