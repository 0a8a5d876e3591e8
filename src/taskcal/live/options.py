"""When a row that is measured live counts, how many there are, and how fast the robot is driven to them."""

from dataclasses import dataclass
from typing import Annotated, Literal

from taskcal_groundwork.options import Option, check


@dataclass(frozen=True, kw_only=True)
class RowOptions:
    """What is to be proven, when a row counts, and how many are measured."""

    accuracy: Annotated[
        float | None,
        Option(
            metavar="MM",
            help="Tolerance to be proven, 3D rms over the task; the task's by default.",
            unit="mm",
            low=0.0,
            ends=False,
        ),
    ] = None
    shots: Annotated[
        int | None,
        Option(metavar="N", help="Shots of a row, averaged; 3, or 1 where a person makes each.", low=1, high=1000),
    ] = None
    settle: Annotated[
        float,
        Option(
            metavar="S", help="Time for which the robot stands before it is measured.", unit="s", low=0.05, high=60.0
        ),
    ] = 1.0
    """Seconds."""
    max_scatter: Annotated[
        float,
        Option(metavar="MM", help="Scatter of the shots above which they are taken again.", unit="mm", low=1e-6),
    ] = 1e-4
    """Metres."""
    most: Annotated[int, Option(metavar="N", help="Rows at most.", low=1, high=100_000)] = 100
    effects: Annotated[
        Literal["auto", "none"], Option(help="Estimate non-geometric effects, too, or geometry alone.")
    ] = "auto"

    def __post_init__(self) -> None:
        check(RowOptions, self)


@dataclass(frozen=True, kw_only=True)
class Driving:
    """How fast Taskcal drives a robot, where it does."""

    speed_percent: Annotated[
        float, Option(metavar="P", help="With --drive: share of the joints' largest speeds.", low=0.1, high=100.0)
    ] = 10.0
