"""Names for new data of a program, which nothing in it has yet."""

from collections.abc import Iterable


class FreshNames:
    """Names that no word of a program's files has, letter case aside."""

    def __init__(self, words: Iterable[str], *, longest: int, usual: int | None = None, reserved: Iterable[str] = ()):
        """What is in use.

        Args:
            words: all of the program's; read when the first name is asked for.
            longest: characters that a name may have.
            usual: characters that one may have where none of the words is longer.
            reserved: words of the language.
        """
        self._words, self._reserved = words, reserved
        self._longest, self._usual = longest, longest if usual is None else usual
        self._taken: set[str] | None = None

    def like(self, name: str) -> str:
        """A fresh name that begins like another one, numbered from 2 on."""
        taken = self._in_use()
        number = 2
        while True:
            ending = f"_{number}"
            candidate = name[: self._longest - len(ending)] + ending
            if candidate.lower() not in taken:
                taken.add(candidate.lower())
                return candidate
            number += 1

    def nearest(self, name: str) -> str:
        """The name itself where it is free, else a fresh one like it."""
        taken = self._in_use()
        if name.lower() in taken:
            return self.like(name)
        taken.add(name.lower())
        return name

    def _in_use(self) -> set[str]:
        if self._taken is None:
            words = {word.lower() for word in self._words}
            self._longest = min(self._longest, max(self._usual, *map(len, words), 0))
            self._taken = words | {word.lower() for word in self._reserved}
        return self._taken
