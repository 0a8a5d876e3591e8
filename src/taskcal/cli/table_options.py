"""What a user may state of a table that the file does not say."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from taskcal.measurement.reader import ReadOptions
    from taskcal.tabular.decimal_mark import DecimalMark


class DecimalChoice(StrEnum):
    """What marks the decimals of a number."""

    point = "point"
    comma = "comma"


class AngleChoice(StrEnum):
    """What three angles of a pose mean."""

    abc = "abc"
    wpr = "wpr"
    rpy_deg = "rpy-deg"
    rpy_rad = "rpy-rad"
    fixed_xyz_deg = "fixed-xyz-deg"
    fixed_xyz_rad = "fixed-xyz-rad"
    moving_xyz_deg = "moving-xyz-deg"
    moving_xyz_rad = "moving-xyz-rad"
    rotation_vector_rad = "rotation-vector-rad"
    rotation_vector_deg = "rotation-vector-deg"
    none = "none"


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """How a table of measurements is read, where its file leaves it open."""

    columns: Annotated[
        str | None,
        typer.Option(
            "--columns", metavar="'NAME …'", help="Names of the columns, separated by spaces; - for a column to skip."
        ),
    ] = None
    decimal: Annotated[
        DecimalChoice | None, typer.Option("--decimal", help="Decimal mark, where the numbers alone are ambiguous.")
    ] = None
    sheet: Annotated[str | None, typer.Option("--sheet", metavar="NAME", help="Sheet to read from a workbook.")] = None
    angles: Annotated[
        AngleChoice | None,
        typer.Option("--angles", help="Convention of a pose's three angles, where the column names do not state it."),
    ] = None
    points: Annotated[
        Path | None,
        typer.Option(
            "--points",
            metavar="FILE",
            readable=False,
            help="Separate file with the measured points, if the campaign holds joints only.",
        ),
    ] = None

    distances: Annotated[
        Path | None,
        typer.Option(
            "--distances",
            metavar="FILE",
            readable=False,
            help="Stated distances of sockets: columns socket_a, socket_b, distance_mm, and u_mm where known.",
        ),
    ] = None

    wire_scale: Annotated[
        bool,
        typer.Option(
            "--wire-scale",
            help="Fit the scale of measured lengths (d_mm) too; the robot's size is then nominal.",
        ),
    ] = False

    @property
    def read_options(self) -> "ReadOptions":
        """What is stated, as the reader takes it."""
        from taskcal.measurement.reader import ReadOptions
        from taskcal.tabular.csv_form import TableForm

        marks: dict[DecimalChoice | None, DecimalMark | None] = {
            None: None,
            DecimalChoice.point: ".",
            DecimalChoice.comma: ",",
        }
        columns = None if self.columns is None else tuple(self.columns.split())
        return ReadOptions(
            form=TableForm(columns=columns, decimal=marks[self.decimal], sheet=self.sheet),
            angles=None if self.angles is None else self.angles.value,
            points=self.points,
            distances=self.distances,
            wire_scale=self.wire_scale,
        )
