"""The few kinds of error a user of Taskcal can meet; each says what is wrong, where, and what would work."""

from collections.abc import Iterable
from difflib import get_close_matches

from robot_programs.core.errors import MAX_MET as MAX_MET
from robot_programs.core.errors import MAX_SHOWN as MAX_SHOWN
from robot_programs.core.errors import SHOWN_CHARACTERS as SHOWN_CHARACTERS
from robot_programs.core.errors import Faults as Faults
from robot_programs.core.errors import FaultyFile as FaultyFile
from robot_programs.core.errors import FileError as FileError
from robot_programs.core.errors import InputError as InputError
from robot_programs.core.errors import WrongKind as WrongKind
from robot_programs.core.errors import printable as printable
from robot_programs.core.errors import shortened as shortened
from robot_programs.core.errors import shown as shown

TaskcalError = InputError
"""Something the data, a file or a request cannot give; the message names the value and a remedy.

The library of robot programs, which knows nothing of Taskcal, raises the same classes."""


class WrongValue(TaskcalError, ValueError):
    """An argument of the right kind whose value a function cannot use; the message names it, its row, and what would work."""


class RobotError(TaskcalError):
    """A robot description that does not describe a robot."""


def advise(name: str, known: Iterable[str]) -> str:
    """Suggestion for an unknown name: the nearest known ones, or all."""
    known = list(known)
    near = get_close_matches(name[:SHOWN_CHARACTERS], known, n=3, cutoff=0.5)
    if near:
        return "did you mean " + " or ".join(f"'{shown(n)}'" for n in near) + "?"
    return "known: " + ", ".join(shown(n) for n in known[:12]) + (", …" if len(known) > 12 else "")


class UnknownName(TaskcalError):
    """A name that is not among the known ones; the message lists the nearest or all of them."""

    def __init__(self, kind: str, name: str, known: Iterable[str], hint: str = ""):
        super().__init__(f"no {kind} '{shown(name)}'{f' {hint}' if hint else ''}; {advise(name, known)}")


class ClosureError(TaskcalError):
    """A closed loop that cannot be assembled at a pose."""

    def __init__(self, pose: int, detail: str):
        self.pose, self.detail = pose, detail
        super().__init__(f"the four-bar does not close at pose {pose}: {detail}")

    def counted_from(self, first: int) -> "ClosureError":
        """The same error where the poses it counts are part of more."""
        return ClosureError(self.pose + first, self.detail)


class ReachError(TaskcalError):
    """A pose that the robot cannot reach, or joints outside its limits."""


class CampaignError(TaskcalError):
    """Measurements that cannot give what was asked of them."""


class UnitError(CampaignError):
    """Numbers that must be in another unit than their file says."""


class OpenFrameError(CampaignError):
    """Rows that leave the rotation of the tracker frame open, whatever else is right with them."""


class FitError(TaskcalError):
    """An identification that did not come to a trustworthy end."""


class NothingLearntError(FitError):
    """Rows that no parameter explains, so that all that was measured would be taken for error."""
