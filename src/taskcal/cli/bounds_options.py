"""The options by which ``taskcal correct`` is told how far it may go."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated

import typer

from taskcal.cli.options import check_above_zero

if TYPE_CHECKING:
    from taskcal.correction.correction import Bounds


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
