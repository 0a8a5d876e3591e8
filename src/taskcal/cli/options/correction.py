"""The options by which a command is told what stands around the robot."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskcal.cli.options.common import check_above_zero

if TYPE_CHECKING:
    from taskcal.correction.correction import Bounds


@dataclass(frozen=True, kw_only=True)
class CellOptions:
    """What was measured around the robot.

    Raises:
        typer.BadParameter: a name of the cell file, without the file.
    """

    cell: Annotated[
        Path | None,
        typer.Option(
            "--cell",
            metavar="CELL.toml",
            readable=False,
            help="What was measured of tools and parts; by default all are where the controller has them.",
        ),
    ] = None
    tool: Annotated[
        str | None,
        typer.Option("--tool", metavar="NAME", help="Tool of the cell file, for APT and CSV, which name none."),
    ] = None
    part: Annotated[
        str | None,
        typer.Option("--part", metavar="NAME", help="Part of the cell file, for APT and CSV, which name none."),
    ] = None

    def __post_init__(self) -> None:
        for name, option in ((self.tool, "--tool"), (self.part, "--part")):
            if name is not None and self.cell is None:
                raise typer.BadParameter(
                    f"'{name}' is a name of the cell file; give that with --cell", param_hint=option
                )


# The options by which ``taskcal correct`` is told how far it may go.


@dataclass(frozen=True, kw_only=True)
class BoundsOptions:
    """How far the correction may go.

    Raises:
        typer.BadParameter: a bound is not above zero.
    """

    tolerance_mm: Annotated[
        float | None,
        typer.Option(
            "--tolerance-mm",
            metavar="MM",
            help="The true tool keeps to lines and arcs within this; by default 0.02, or a fifth of the uncertainty where that "
            "is more, up to all of it where the program would grow by more than half.",
            show_default=False,
        ),
    ] = None
    max_shift_mm: Annotated[
        float,
        typer.Option(
            "--max-shift-mm", metavar="MM", help="Largest shift of a target; beyond it the target is rejected."
        ),
    ] = 5.0
    max_turn_deg: Annotated[
        float,
        typer.Option(
            "--max-turn-deg", metavar="DEG", help="Largest rotation of a target; beyond it the target is rejected."
        ),
    ] = 1.0
    max_joint_deg: Annotated[
        float, typer.Option("--max-joint-deg", metavar="DEG", help="No joint is moved farther at a target.")
    ] = 5.0

    def __post_init__(self) -> None:
        for bound in fields(self):
            value = getattr(self, bound.name)
            if value is not None:
                check_above_zero(value, f"--{bound.name.replace('_', '-')}")

    def bounds(self) -> "Bounds":
        """In metres and radians."""
        from math import radians

        from taskcal.correction.correction import Bounds

        return Bounds(
            tolerance=None if self.tolerance_mm is None else self.tolerance_mm * 1e-3,
            shift=self.max_shift_mm * 1e-3,
            turn=radians(self.max_turn_deg),
            joint=radians(self.max_joint_deg),
        )
