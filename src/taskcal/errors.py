"""The few kinds of error a user of Taskcal can meet; each says what is wrong, where, and what would work."""

from taskcal_groundwork.errors import MAX_MET as MAX_MET
from taskcal_groundwork.errors import MAX_SHOWN as MAX_SHOWN
from taskcal_groundwork.errors import SHOWN_CHARACTERS as SHOWN_CHARACTERS
from taskcal_groundwork.errors import Faults as Faults
from taskcal_groundwork.errors import FaultyFile as FaultyFile
from taskcal_groundwork.errors import FileError as FileError
from taskcal_groundwork.errors import InputError as InputError
from taskcal_groundwork.errors import UnknownName as UnknownName
from taskcal_groundwork.errors import WrongKind as WrongKind
from taskcal_groundwork.errors import WrongValue as WrongValue
from taskcal_groundwork.errors import advise as advise
from taskcal_groundwork.errors import listed as listed
from taskcal_groundwork.errors import printable as printable
from taskcal_groundwork.errors import shortened as shortened
from taskcal_groundwork.errors import shown as shown

TaskcalError = InputError
"""Something the data, a file or a request cannot give; the message names the value and a remedy.

The library of robot programs, which knows nothing of Taskcal, raises the same classes."""


class RobotError(TaskcalError):
    """A robot description that does not describe a robot."""


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
