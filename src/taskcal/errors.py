"""The few kinds of error a user of Taskcal can meet; each says what is wrong, where, and what would work."""

from collections.abc import Iterable
from difflib import get_close_matches


class TaskcalError(Exception):
    """Something the data, a file or a request cannot give; the message names the value and a remedy."""


class FileError(TaskcalError):
    """A file that cannot be read as what it should be.

    The message starts with ``file:line: column``, as far as they are known, so that editors can jump there.
    """

    def __init__(self, path: object, message: str, *, line: int | None = None, column: str | None = None):
        self.path, self.line, self.column = str(path), line, column
        place = str(path) if line is None else f"{path}:{line}"
        where = place if column is None else f"{place}: column '{column}'"
        super().__init__(f"{where}: {message}")


class RobotError(TaskcalError):
    """A robot description that does not describe a robot."""


class UnknownName(TaskcalError):
    """A name that is not among the known ones; the message lists the nearest or all of them."""

    def __init__(self, kind: str, name: str, known: Iterable[str], hint: str = ""):
        known = list(known)
        near = get_close_matches(name, known, n=3, cutoff=0.5)
        if near:
            advice = "did you mean " + " or ".join(f"'{n}'" for n in near) + "?"
        else:
            shown = ", ".join(known[:12]) + (", …" if len(known) > 12 else "")
            advice = f"known: {shown}"
        super().__init__(f"no {kind} '{name}'{f' {hint}' if hint else ''}; {advice}")


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


class FitError(TaskcalError):
    """An identification that did not come to a trustworthy end."""
