"""The few kinds of error a user of Taskcal can meet; each says what is wrong, where, and what would work."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any
from unicodedata import category

SHOWN_CHARACTERS = 80
"""Of a value in a message; one wrong cell may be as long as a file."""


def shown(value: object, characters: int = SHOWN_CHARACTERS) -> str:
    """A value as a message shows it: on one line, without control characters, and shortened where it is long.

    What stands between is left out, and the length is told: ``1111…111 (20000 characters)``.
    """
    return printable(shortened(str(value), characters))


def shortened(text: str, characters: int) -> str:
    """Text of at most so many characters: beginning and end, and how long it is, where it is longer."""
    if len(text) <= characters:
        return text
    return f"{text[: 2 * characters // 3]}…{text[-(characters // 4) :]} ({len(text)} characters)"


def printable(text: str, *, keep: str = "") -> str:
    """Text with its control characters as visible escapes, so that none is a command to a terminal.

    Args:
        text: any text.
        keep: control characters that may stay, such as line feeds.
    """
    if text.isprintable():
        return text
    return "".join(c if c in keep or not _commands(c) else c.encode("unicode_escape").decode("ascii") for c in text)


def _commands(character: str) -> bool:
    """Whether a character is a control or format one, a line or paragraph separator, or half of one that was not decoded."""
    return category(character) in ("Cc", "Cf", "Cs", "Zl", "Zp")


class TaskcalError(Exception):
    """Something the data, a file or a request cannot give; the message names the value and a remedy."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Make it again elsewhere, as it comes from a worker, of its message: not of what the message was made of."""
        return type(self).__new__, (type(self), *self.args), self.__dict__


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


class WrongKind(TaskcalError, TypeError):
    """An argument of another kind than the function needs, such as a file's name in place of what the file holds."""


def advise(name: str, known: Iterable[str]) -> str:
    """What a name that is not among the known ones may be meant for: the nearest of them, or all."""
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


class FitError(TaskcalError):
    """An identification that did not come to a trustworthy end."""


class NothingLearntError(FitError):
    """Rows that no parameter explains, so that all that was measured would be taken for error."""
