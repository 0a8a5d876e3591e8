"""What a user may state of a table that the file does not say."""

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from taskcal.measurement.rotation_columns import AngleForm
    from taskcal.tabular.csv_form import TableForm


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

    @property
    def form(self) -> "TableForm":
        """What is stated of the table."""
        from taskcal.tabular.csv_form import TableForm

        columns = None if self.columns is None else tuple(self.columns.split())
        if self.decimal is None:
            return TableForm(columns=columns, sheet=self.sheet)
        return TableForm(columns=columns, decimal="," if self.decimal is DecimalChoice.comma else ".", sheet=self.sheet)

    @property
    def angle_form(self) -> "AngleForm | None":
        """What is stated of angles."""
        return None if self.angles is None else self.angles.value
