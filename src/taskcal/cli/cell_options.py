"""The options by which a command is told what stands around the robot."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer


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
