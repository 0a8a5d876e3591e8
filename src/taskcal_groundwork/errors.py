"""What cannot be read or written, in words that name file, line, value and remedy."""

from collections.abc import Generator, Iterable
from contextlib import contextmanager
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


def listed(texts: Iterable[object], most: int, between: str = ", ") -> str:
    """Texts in a row; where they are more than so many the first, and how many more there are: ``1, 2 and 5 more``."""
    every = [str(text) for text in texts]
    more = [f"and {len(every) - most} more"] if len(every) > most else []
    if between == ", ":
        return " ".join([between.join(every[:most]), *more])
    return between.join([*every[:most], *more])


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


class InputError(Exception):
    """Something the data, a file or a request cannot give; the message names the value and a remedy."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Make it again elsewhere, as it comes from a worker, of its message: not of what the message was made of."""
        return type(self).__new__, (type(self), *self.args), self.__dict__


class FileError(InputError):
    """A file that cannot be read as what it should be.

    The message starts with ``file:line: column``, as far as they are known, so that editors can jump there.
    """

    def __init__(self, path: object, message: str, *, line: int | None = None, column: str | None = None):
        self.path, self.line, self.column = str(path), line, column
        place = str(path) if line is None else f"{path}:{line}"
        where = place if column is None else f"{place}: column '{column}'"
        super().__init__(f"{where}: {message}")


class WrongKind(InputError, TypeError):
    """An argument of another kind than the function needs, such as a file's name in place of what the file holds."""


# All that is wrong with a file, in one message.

MAX_SHOWN = 20
"""Faults in one message; whoever mends these sees the next."""

MAX_MET = 2000
"""After which the search for others ends: each costs time and a kilobyte, and a large file may have one in every line."""


class FaultyFile(FileError):
    """A file with several faults; the place is that of the first."""

    def __init__(self, faults: Iterable[FileError]):
        self.faults = tuple(faults)
        first = self.faults[0]
        rest = len(self.faults) - MAX_SHOWN
        count = f"at least {rest}" if len(self.faults) >= MAX_MET else str(rest)
        shown = [str(fault) for fault in self.faults[:MAX_SHOWN]]
        more = [f"and {count} more fault{'s' if rest > 1 else ''}"] if rest > 0 else []
        super().__init__(first.path, "", line=first.line, column=first.column)
        self.args = ("\n".join(shown + more),)


class Faults:
    """Faults as they are met; reading goes on past each to find the next."""

    def __init__(self) -> None:
        self._met: list[FileError] = []

    @contextmanager
    def collecting(self) -> Generator[None]:
        """Note what is raised inside, and go on behind it; after many, end there.

        Raises:
            FaultyFile: there were many.
        """
        try:
            yield
        except FaultyFile as several:
            self._met.extend(several.faults)
        except FileError as fault:
            self._met.append(fault)
        if len(self._met) >= MAX_MET:
            self.raise_any()

    def raise_any(self) -> None:
        """Raise what was met, in the order of the file's lines.

        Raises:
            FileError: there was a fault; several are one error.
        """
        if len(self._met) == 1:
            raise self._met[0]
        if self._met:
            raise FaultyFile(sorted(self._met, key=lambda fault: fault.line or 0))


class WrongValue(InputError, ValueError):
    """An argument of the right kind whose value a function cannot use; the message names it, its row, and what would work."""


def advise(name: str, known: Iterable[str]) -> str:
    """Suggestion for an unknown name: the nearest known ones, or all."""
    known = list(known)
    near = get_close_matches(name[:SHOWN_CHARACTERS], known, n=3, cutoff=0.5)
    if near:
        return "did you mean " + " or ".join(f"'{shown(n)}'" for n in near) + "?"
    return "known: " + listed(map(shown, known), 12)


class UnknownName(InputError):
    """A name that is not among the known ones; the message lists the nearest or all of them."""

    def __init__(self, kind: str, name: str, known: Iterable[str], hint: str = ""):
        super().__init__(f"no {kind} '{shown(name)}'{f' {hint}' if hint else ''}; {advise(name, known)}")
