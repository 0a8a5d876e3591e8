"""The words of a line of KRL, taken one after the other: operands, structures and what WITH sets."""

from collections.abc import Sequence
from itertools import pairwise
from math import isfinite

from taskcal.programs.krl.lexer import Word, bit_string
from taskcal.programs.krl.syntax import FRAMES_OF_DISTANCES, Aggregate, Field, Operand, Reference

PASSING = {"C_PTP", "C_DIS", "C_VEL", "C_ORI", "C_SPL"}
QUOTES = ("'", '"')


class Cursor:
    """The words of a line, one after the other."""

    def __init__(self, words: Sequence[Word]):
        self._words = words
        self._next = 0

    @property
    def done(self) -> bool:
        """Whether all words are taken."""
        return self._next >= len(self._words)

    def at(self, text: str) -> bool:
        """Whether a symbol comes next."""
        return not self.done and self._words[self._next].text == text

    def at_name(self, names: set[str]) -> bool:
        """Whether one of some names comes next."""
        return not self.done and self._words[self._next].upper in names

    def at_kind(self, kind: str) -> bool:
        """Whether a word of a kind comes next."""
        return not self.done and self._words[self._next].kind == kind

    def take(self) -> Word:
        """The next word."""
        self._next += 1
        return self._words[self._next - 1]

    def accept(self, text: str) -> bool:
        """Take a symbol, if it comes next."""
        matches = self.at(text)
        self._next += matches
        return matches

    def skip_to(self, *stops: str) -> None:
        """Pass over words up to one that stops, outside of any bracket."""
        depth = 0
        while not self.done:
            word = self._words[self._next]
            if depth == 0 and word.upper in stops:
                return
            depth += (word.text in "([{") - (word.text in ")]}")
            self._next += 1

    def skip_brackets(self) -> None:
        """Pass over an index or a size."""
        if self.accept("["):
            self.skip_to("]")
            self.accept("]")

    def settings(self) -> dict[str, tuple[Word, ...]]:
        """Assignments behind WITH, by the name of what they set."""
        out: dict[str, tuple[Word, ...]] = {}
        while not self.done and not self.at_name(PASSING):
            start = self._next
            self.skip_to("=", *PASSING)
            name = "".join(word.upper for word in self._words[start : self._next])
            self.accept("=")
            start = self._next
            self.skip_to(",", *PASSING)
            out[name] = tuple(self._words[start : self._next])
            self.accept(",")
        return out

    def operand(self) -> Operand:
        """Aggregates and variables joined by colons; no parts where it is anything else."""
        if self.done:
            last = self._words[-1].end if self._words else 0
            return Operand(parts=(), start=last, end=last)
        start = self._next
        parts: list[Aggregate | Reference] = []
        known = True
        while True:
            part = self._part()
            if part is None:
                known = False
                break
            parts.append(part)
            if not self.accept(":"):
                break
        if not (self.done or self.at(",") or self.at_name({*PASSING, *FRAMES_OF_DISTANCES, "WITH"})):
            known = False
        if not known:
            self.skip_to(",", *PASSING, *FRAMES_OF_DISTANCES, "WITH")
        words = self._words[start : max(self._next, start + 1)]
        return Operand(parts=tuple(parts) if known else (), start=words[0].start, end=words[-1].end)

    def _part(self) -> Aggregate | Reference | None:
        if self.at("{"):
            return self._aggregate()
        if not self.at_kind("name") or self.at_name({*PASSING, "WITH"}):
            return None
        name = self.take()
        if not self.at("["):
            return Reference(name=name.upper, start=name.start, end=name.end)
        opening = self._next
        self.skip_brackets()
        words = self._words[opening : self._next]
        if words[-1].text != "]" or len(words) < 3 or self.at("."):
            return None
        plain = len(words) == 3 and words[1].kind == "number"
        return Reference(
            name=f"{name.upper}{''.join(word.upper for word in words)}",
            start=name.start,
            end=words[-1].end,
            index=() if plain else split_at_commas(words[1:-1]),
        )

    def _aggregate(self) -> Aggregate | None:
        opening = self.take()
        kind = ""
        if self.at_kind("name") and self._next + 1 < len(self._words) and self._words[self._next + 1].text == ":":
            kind = self.take().upper
            self.take()
        fields: dict[str, Field] = {}
        while not self.at("}"):
            field = self._field()
            if field is None or field.name in fields:
                return None
            fields[field.name] = field
            if not self.accept(",") and not self.at("}"):
                return None
        return Aggregate(type=kind, fields=tuple(fields.values()), start=opening.start, end=self.take().end)

    def _field(self) -> Field | None:
        if not self.at_kind("name"):
            return None
        name = self.take()
        self.skip_brackets()
        behind = self._words[self._next - 1].end
        start = self._next
        self.skip_to(",", "}")
        words = self._words[start : self._next]
        if (
            self.done or not words or any(word.text in QUOTES for word in words)
        ):  # a quote that is a word has no other end
            return None
        text = _joined(words)
        return Field(
            name=name.upper,
            text=text,
            value=_number(words),
            start=words[0].start,
            end=words[-1].end,
            touches=behind == words[0].start,
        )


def _joined(words: Sequence[Word]) -> str:
    """Words in a row, those that no symbol parts with a blank between them."""
    apart = ("symbol" not in (before.kind, word.kind) for before, word in pairwise(words))
    return words[0].text + "".join(f" {w.text}" if blank else w.text for blank, w in zip(apart, words[1:], strict=True))


def _number(words: Sequence[Word]) -> float | None:
    """A literal number with its sign, or a bit string such as ``'B1010'``."""
    last = words[-1]
    if len(words) == 1 and last.kind == "string":
        return bit_string(last.upper)
    if last.kind != "number" or len(words) > 2 or (len(words) == 2 and words[0].text not in {"+", "-"}):
        return None
    value = float(last.text) * (-1.0 if words[0].text == "-" else 1.0)
    return value if isfinite(value) else None


def split_at_commas(words: Sequence[Word]) -> tuple[tuple[Word, ...], ...]:
    """What stands between commas that are in no bracket."""
    groups: list[list[Word]] = [[]]
    depth = 0
    for word in words:
        depth += (word.text in "([{") - (word.text in ")]}")
        if depth == 0 and word.text == ",":
            groups.append([])
        else:
            groups[-1].append(word)
    return tuple(tuple(group) for group in groups)
