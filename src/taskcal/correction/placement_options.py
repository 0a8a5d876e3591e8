"""How placements of a part are looked at: one frozen value."""

from dataclasses import dataclass
from typing import TypedDict, Unpack

from taskcal.arguments import with_choices


class PlacementChoices(TypedDict, total=False):
    """`PlacementOptions` by keywords: all of them at once, some of them, or some that replace those of a whole."""

    options: "PlacementOptions | None"
    force: tuple[float, float, float] | None
    touched_off: bool
    count: int
    seed: int


@dataclass(frozen=True, kw_only=True)
class PlacementOptions:
    """Options of placements; `dataclasses.replace` gives others."""

    force: tuple[float, float, float] | None = None
    """Of the process on the tool, newtons, in axes of the base. The calibration needs a `Compliance` effect for it, and without
    one the robot's file stiffnesses."""
    touched_off: bool = False
    """The part is touched off or measured where it is put, so that what is common to all targets, a shift and a turn of the part,
    does not count."""
    count: int = 30
    """Poses of a task."""
    seed: int = 0
    """Of their choice."""

    @classmethod
    def of(cls, **choices: Unpack[PlacementChoices]) -> "PlacementOptions":
        """Options by keywords, those not named as in ``options``, or as by default.

        Raises:
            TypeError: an option that does not exist; the message names all.
        """
        return with_choices(choices.pop("options", None) or cls(), choices, "placements")
