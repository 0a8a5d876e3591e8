"""The words of a module as they are read: one after the other, so that a file's words are never all in memory."""

from taskcal.programs.rapid.lexer import Token, tokenize, words_from

MOST_WORDS = 2_000_000
"""Of one statement or declaration; an array of a hundred thousand targets, each of lists of numbers, has fewer."""


MOST_VALUES = 5_000_000
"""Values of a file, those in lists included: numbers in a list of nothing else count as one."""


class TooMuch(Exception):
    """A file holds more of something than any program, and would take gigabytes."""

    def __init__(self, position: int, text: str):
        self.position, self.text = position, text
        super().__init__(text)


class Words:
    """Words that are read one after the other."""

    def __init__(self, text: str):
        self.text = text
        self._coming = tokenize(text)
        self._later: Token | None = None
        """The word behind the next one, where it was looked at."""
        self.next = next(self._coming)
        """The word that is to be read next."""
        self.end = 0
        """Behind the word read last."""
        self._left = MOST_WORDS
        """Words that may still be read before another statement begins."""
        self._begun = 0
        """Where the last one began."""
        self._values = MOST_VALUES
        """Values that may still be read."""

    def begin(self) -> None:
        """Note that a statement or a declaration begins at the next word."""
        self._left, self._begun = MOST_WORDS, self.next.start

    def take(self) -> Token:
        """Read a word.

        Raises:
            TooMuch: the statement has more words than any.
        """
        token = self.next
        if token.kind == "end":
            return token
        if not self._left:
            raise TooMuch(
                self._begun,
                f"has more than {MOST_WORDS:,} words in the statement that begins here; divide it into several",
            )
        self._left -= 1
        self.end = token.start + len(token.text)
        if self._later is None:
            self.next = next(self._coming)
        else:
            self.next, self._later = self._later, None
        return token

    def jump(self, end: int) -> None:
        """Go on behind some text, of which no word but the next one has been looked at."""
        self.take()
        self.end, self._coming = end, words_from(self.text, end)
        self.next = next(self._coming)

    def count_value(self) -> None:
        """Count a value.

        Raises:
            TooMuch: there are more than in any program.
        """
        if not self._values:
            raise TooMuch(self.next.start, f"has more than {MOST_VALUES:,} values; divide it into several files")
        self._values -= 1

    def behind_next(self) -> Token:
        """The word behind the next one, of which there has to be one."""
        if self._later is None:
            self._later = next(self._coming)
        return self._later
