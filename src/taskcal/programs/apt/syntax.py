"""What an APT program is made of: statements."""

from dataclasses import dataclass

from taskcal.programs.apt.lexer import SEPARATORS, Token


@dataclass(frozen=True, kw_only=True)
class Statement:
    """A statement, possibly over several lines; or a comment."""

    word: str
    """Its first word in capitals, ``$$`` of a comment."""
    text: str
    """Of a comment or a line of text: what follows the word."""
    tokens: tuple[Token, ...]
    """From the first word on; empty for a comment or a line of text."""
    start: int
    end: int

    @property
    def arguments(self) -> tuple[Token, ...] | None:
        """What stands between commas behind the slash; None where it is not so simple."""
        behind = self.tokens[2:]
        if len(self.tokens) < 2 or self.tokens[1].text != "/":
            return () if len(self.tokens) == 1 else None
        if len(behind) % 2 == 0 or any((t.text == ",") != (i % 2 == 1) for i, t in enumerate(behind)):
            return None
        given = behind[::2]
        return None if any(t.text in SEPARATORS for t in given) else given

    @property
    def words(self) -> tuple[str, ...]:
        """The arguments in capitals; none where they are not simple."""
        return tuple(token.text.upper() for token in self.arguments or ())

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The arguments, where all are numbers."""
        return numbers(self.arguments or ())


def numbers(tokens: tuple[Token, ...]) -> tuple[float, ...] | None:
    """Values of tokens, where all are numbers."""
    values = [token.number for token in tokens]
    finite = tuple(value for value in values if value is not None)
    return finite if len(finite) == len(values) else None
