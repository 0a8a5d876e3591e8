"""What an APT program is made of: statements."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from robot_programs.core.source import lines_of

# Words, numbers and separators of APT, with their places.

SEPARATORS = "/,()="
_TOKEN = re.compile(r"[/,()=]|[^/,()=]+")
_NUMBER = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)([eE][+-]?\d+)?")
MAX_NUMBER = 1e9


@dataclass(frozen=True, kw_only=True)
class Token:
    """A word, a number or a separator."""

    text: str
    start: int
    end: int

    @property
    def number(self) -> float | None:
        """Value as a number; None where it is not a number, or a larger one than any path has."""
        if not _NUMBER.fullmatch(self.text):
            return None
        value = float(self.text)
        return value if abs(value) <= MAX_NUMBER else None


def tokenize(text: str, start: int, end: int) -> list[Token]:
    """The tokens between two places of a text."""
    tokens: list[Token] = []
    for match in _TOKEN.finditer(text, start, end):
        word = match[0].strip()
        if word:
            begin = match.start() + match[0].index(word)
            tokens.append(Token(text=word, start=begin, end=begin + len(word)))
    return tokens


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
        """Arguments between commas after the slash; None where it is not so simple."""
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


# Words of APT, by what they mean for the motions around them.

_NO_MOTION = """
    PARTNO PPRINT INSERT LETTER REMARK FINI END CLPRNT NOPOST MACHIN MULTAX AUTOPS CHANNEL SWITCH PIVOTZ
    CUTTER TLDATA END-OF-PATH PAINT DISPLY PLOT INTOL OUTTOL TOLER CUTCOM CLEARP CLRSRF SAFETY
    CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH PSIS CUT DNTCUT ISN HEADER THICK VERIFY
    SPINDL COOLNT DELAY DWELL STOP OPSTOP OPSKIP SEQNO AUXFUN PREFUN REWIND CLAMP HEAD TMARK LEADER RESERV SELCTL SELECTL
"""
HARMLESS = frozenset(_NO_MOTION.split())
"""They move nothing, or say how to move, not where."""

_GO = "MOVARC ARCSLP TLON TLLFT TLRGT GO GOFWD GOBACK GOLFT GORGT GOUP GODOWN RETRCT GOCLER POCKET PROFIL CALL"
UNREAD_MOTIONS = frozenset(_GO.split())
"""Motions whose path is not written as numbers, or not in a form that is certain."""

BLOCKING = {
    "ORIGIN": "ORIGIN moves the coordinates",
    "TRANS": "TRANS moves the coordinates",
    "TRACUT": "TRACUT transforms the motions",
    "REFSYS": "REFSYS changes the coordinates",
    "ROTABL": "ROTABL turns the table",
    "ROTATE": "ROTATE turns the table",
    "ROTHED": "ROTHED turns the head",
    "MIRROR": "MIRROR reflects the motions",
    "INDEX": "COPY repeats motions elsewhere",
    "COPY": "COPY repeats motions elsewhere",
    "MACRO": "a macro is run from elsewhere",
    "LOOPST": "a loop runs motions again",
    "JUMPTO": "JUMPTO changes the order of motions",
    "IF": "IF changes the order of motions",
}
"""What makes motions uncertain from a statement on until it is cleared, and why."""

CLEARING = {"TERMAC": "MACRO", "LOOPND": "LOOPST"}
"""Words that end what others began."""

ENDING = {"NOMORE", "OFF"}
"""Arguments that end what their word began."""

INCH = 0.0254
UNITS = {"MM": 1e-3, "CM": 1e-2, "INCH": INCH, "INCHES": INCH, "IN": INCH}
"""Metres."""

FEEDS = {"MMPM": 1e-3 / 60.0, "IPM": INCH / 60.0, "MMPR": None, "IPR": None, "PERREV": None}
"""Metres per second; none per revolution of the spindle."""


# From the text of a file to its statements.

_LITERAL = ("PARTNO", "PPRINT", "INSERT", "LETTER", "REMARK")
"""Words whose line is text."""

_CARD = 72
"""Columns of a card that hold the statement; behind them CATIA numbers its points: PT 5, CIR 1."""
_CARD_NUMBER = re.compile(r"(PT|CIR)\s+\d+\s*")


def parse(text: str) -> Iterator[Statement]:
    """The statements of a text; those that a dollar sign continues are one."""
    tokens: list[Token] = []
    for start, end in lines_of(text, start=text.startswith("\ufeff")):
        line = text[start:end]
        if not tokens:
            stripped = line.lstrip()
            word = stripped[:6].upper()
            at = start + len(line) - len(stripped)
            if stripped.startswith("$$"):
                yield Statement(word="$$", text=stripped[2:], tokens=(), start=at, end=end)
                continue
            if word in _LITERAL:
                yield Statement(word=word, text=stripped[6:], tokens=(), start=at, end=end)
                continue
        if len(line) > _CARD and _CARD_NUMBER.fullmatch(line, _CARD):
            end = start + _CARD
        comment = text.find("$$", start, end)
        dollar = text.find("$", start, end)
        tokens += tokenize(text, start, dollar if dollar >= 0 else end)
        if tokens and (dollar < 0 or dollar == comment):
            yield _statement(tokens)
            tokens = []
    if tokens:
        yield _statement(tokens)


def _statement(tokens: list[Token]) -> Statement:
    if len(tokens) > 2 and tokens[1].text == ")":  # a label
        tokens = tokens[2:]
    word = " ".join(tokens[0].text.upper().split())
    return Statement(word=word, text="", tokens=tuple(tokens), start=tokens[0].start, end=tokens[-1].end)
