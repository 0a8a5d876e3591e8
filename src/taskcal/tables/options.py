"""What a user states of a table."""

from dataclasses import dataclass
from typing import Annotated, Literal

from taskcal_groundwork.options import Option

DecimalMark = Literal[".", ","]
HiddenRows = Literal["keep", "drop"]
"""What becomes of rows of numbers that are hidden or struck out."""
AngleForm = Literal[
    "abc", "wpr", "rpy-deg", "rpy-rad", "fixed-xyz-deg", "fixed-xyz-rad", "moving-xyz-deg", "moving-xyz-rad", "rotation-vector-rad",
    "rotation-vector-deg", "none",
]  # fmt: skip
"""What three angles mean: KUKA's A B C (moving z y x, degrees), FANUC's W P R (fixed x y z, degrees), roll, pitch and yaw (fixed
x y z), three angles about fixed or moving x y z, a rotation vector as Universal Robots writes it; or nothing is read of them."""


@dataclass(frozen=True, kw_only=True)
class TableForm:
    """What the user states of a table whose form leaves it open; nothing by default."""

    columns: Annotated[
        tuple[str, ...] | None,
        Option(
            metavar="'NAME …'",
            help="Names of the columns, separated by spaces; - for a column to skip.",
            kind=str,
            several=" ",
        ),
    ] = None
    """For a file that has none, or others."""
    decimal: Annotated[
        DecimalMark | None,
        Option(
            help="Decimal mark, where the numbers alone are ambiguous.",
            kind=Literal["point", "comma"],
            words={"point": ".", "comma": ","},
        ),
    ] = None
    sheet: Annotated[str | None, Option(metavar="NAME", help="Sheet to read from a workbook.")] = None
    hidden_rows: Annotated[
        HiddenRows | None,
        Option(help="Read or leave out rows that a workbook hides, as by a filter, or strikes out."),
    ] = None
