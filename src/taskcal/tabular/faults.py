"""All that is wrong with a file, in one message."""

from collections.abc import Generator, Iterable
from contextlib import contextmanager

from taskcal.errors import FileError

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
