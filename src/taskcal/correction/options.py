"""How far a program may be corrected, and how placements of its part are looked at: frozen values, each option declared once."""

from dataclasses import dataclass
from math import radians
from typing import Annotated

from taskcal.arguments import checked
from taskcal_groundwork.options import Option, check


@checked
@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Bounds of a correction.

    Raises:
        WrongValue: one that is not above zero.
    """

    tolerance: Annotated[
        float | None,
        Option(
            metavar="MM",
            help="Maximum deviation from lines and arcs; by default 0.02, or a fifth of the uncertainty if larger, up to all of it "
            "if the program would grow by more than half.",
            unit="mm",
            low=0.0,
            ends=False,
        ),
    ] = None
    """Of the true tool's distance from its path between corrected targets, metres; None for `TOLERANCE`, or a fifth of what the
    calibration must expect at the targets where that is more."""
    shift: Annotated[
        float,
        Option(
            metavar="MM",
            help="Maximum shift of a target; larger corrections are rejected.",
            named="max-shift",
            unit="mm",
            low=0.0,
            ends=False,
        ),
    ] = 5e-3
    """Metres."""
    turn: Annotated[
        float,
        Option(
            metavar="DEG",
            help="Maximum rotation of a target; larger corrections are rejected.",
            named="max-turn",
            unit="deg",
            low=0.0,
            ends=False,
        ),
    ] = radians(1.0)
    """Radians."""
    joint: Annotated[
        float,
        Option(
            metavar="DEG",
            help="Maximum joint change at a target.",
            named="max-joint",
            unit="deg",
            low=0.0,
            ends=False,
        ),
    ] = radians(5.0)
    """Of a revolute joint, radians."""

    def __post_init__(self) -> None:
        check(Bounds, self)


@checked
@dataclass(frozen=True, kw_only=True)
class PlacementOptions:
    """Options of placements; `dataclasses.replace` gives others.

    Raises:
        WrongValue: a number that cannot be.
    """

    touched_off: Annotated[
        bool, Option(help="The part is touched off in place: an error common to all targets is removed.")
    ] = False
    """Or it is measured where it is put: a shift and a turn of the part do not count."""
    force: Annotated[
        tuple[float, float, float] | None,
        Option(metavar="X,Y,Z", help="Process force on the tool, newtons, in the base frame.", named="force-n"),
    ] = None
    """The calibration needs a `Compliance` effect for it, and without one the robot's file stiffnesses."""
    accept_uncertain: Annotated[
        bool,
        Option(help="Rank placements even where the uncertainty exceeds three times the robot's tolerances."),
    ] = False
    """They count as possible even where the calibration knows less than the robot's tolerances do."""
    count: Annotated[int, Option(help="Poses of a task.", low=1, alone=True)] = 30
    seed: Annotated[int, Option(help="Seed of their choice.", low=0, alone=True)] = 0

    def __post_init__(self) -> None:
        check(PlacementOptions, self)
