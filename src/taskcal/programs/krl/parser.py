"""KRL text as statements: the grammar of declarations, assignments, calls and motions; other lines are passed over."""

from collections.abc import Sequence
from math import isfinite

from taskcal.programs.krl.lexer import Word, lines_of_words
from taskcal.programs.krl.syntax import (
    FRAMES_OF_DISTANCES,
    OTHER_MOTIONS,
    POINT_MOTIONS,
    RELATIVE_MOTIONS,
    Aggregate,
    Assignment,
    Begin,
    Call,
    Control,
    Declaration,
    Declared,
    End,
    Field,
    Motion,
    Operand,
    Reference,
    Statement,
)

PASSING = {"C_PTP", "C_DIS", "C_VEL", "C_ORI", "C_SPL"}

BLOCKS = {
    "IF": "ENDIF",
    "FOR": "ENDFOR",
    "WHILE": "ENDWHILE",
    "REPEAT": "UNTIL",
    "LOOP": "ENDLOOP",
    "SWITCH": "ENDSWITCH",
    "SPLINE": "ENDSPLINE",
    "PTP_SPLINE": "ENDSPLINE",
}
"""What opens a block, and what closes it."""

_STEERING = {*BLOCKS, *BLOCKS.values(), "ELSE", "CASE", "DEFAULT", "GOTO", "EXIT", "RETURN", "RESUME", "TRIGGER"}
_HARMLESS = {
    "WAIT", "INTERRUPT", "EXT", "EXTFCT", "EXTP", "EXTFCTP", "IMPORT", "SIGNAL", "ENUM", "STRUC", "PULSE", "HALT", "BRAKE",
    "CONTINUE", "ANIN", "ANOUT", "ASYPTP", "ASYCONT", "ASYSTOP", "CONST_VEL", "TIME_BLOCK", "STOP", "CHANNEL",
}  # fmt: skip
_ENDS = {"END", "ENDFCT", "ENDDAT"}
_BEGINS = {"DEF", "DEFFCT", "DEFDAT"}


def parse(text: str) -> list[Statement]:
    """The statements of a file, in order."""
    return [_statement(words) for words in lines_of_words(text)]


def parse_operand(words: Sequence[Word]) -> Operand:
    """An operand on its own."""
    cursor = _Cursor(words)
    return cursor.operand()


def _statement(words: list[Word]) -> Statement:
    start, end = words[0].start, words[-1].end
    shared = False
    while len(words) > 1 and words[0].upper in {"GLOBAL", "DECL", "CONST"}:
        shared = shared or words[0].upper == "GLOBAL"
        words = words[1:]
    first = words[0]
    keyword = first.upper
    if first.kind != "name" or keyword in _HARMLESS:
        return Statement(start=start, end=end)
    if keyword in _BEGINS:
        names = [word for word in words[1:] if word.kind == "name"]
        chosen = names[min(len(names) - 1, 1 if keyword == "DEFFCT" else 0)] if names else first
        return Begin(start=start, end=end, name=chosen.upper, parameters=_parameters(words))
    if keyword in _ENDS:
        return End(start=start, end=end)
    if keyword in POINT_MOTIONS | OTHER_MOTIONS:
        return _motion(words)
    if keyword in _STEERING:
        return Control(start=start, end=end, keyword=keyword)
    if len(words) == 2 and words[1].text == ":":
        return Control(start=start, end=end, keyword="LABEL")
    if len(words) > 1 and words[1].kind == "name":
        return _declaration(words, shared)
    if len(words) > 1 and words[1].text == "(":
        return Call(start=start, end=end, name=keyword, arguments=_arguments(words[1:]), changed=_handed_over(words))
    return _assignment(words)


def _assignment(words: list[Word]) -> Statement:
    start, end = words[0].start, words[-1].end
    equals = next((i for i, word in enumerate(words) if word.text == "="), None)
    if equals is None or equals + 1 == len(words):
        return Statement(start=start, end=end)
    cursor = _Cursor(words[equals + 1 :])
    return Assignment(
        start=start,
        end=end,
        name="".join(word.upper for word in words[:equals]),
        variable=words[0].upper,
        value=cursor.operand(),
        text="".join(word.upper for word in words[equals + 1 :]),
        changed=_handed_over(words[equals:]),
    )


def _declaration(words: list[Word], shared: bool) -> Declaration:
    cursor = _Cursor(words[1:])
    variables: list[Declared] = []
    while not cursor.done:
        name = cursor.take()
        if name.kind == "name":
            cursor.skip_brackets()
            value = None
            if cursor.at("="):
                cursor.take()
                value = cursor.operand()
            variables.append(Declared(name=name.upper, value=value, start=name.start, end=name.end))
        cursor.skip_to(",")
        cursor.accept(",")
    return Declaration(
        start=words[0].start, end=words[-1].end, type=words[0].upper, shared=shared, variables=tuple(variables)
    )


def _motion(words: list[Word]) -> Motion:
    keyword = words[0].upper
    cursor = _Cursor(words[1:])
    operands, passing = [cursor.operand()], list[str]()
    trouble = "" if keyword in POINT_MOTIONS else "arcs and splines by distances are not read"
    along = ""
    while cursor.accept(","):
        if cursor.at_name({"CA"}):
            trouble = trouble or "the arc ends at the angle CA, not in the point"
            cursor.skip_to("", *PASSING, "WITH")
        else:
            operands.append(cursor.operand())
    settings: dict[str, tuple[Word, ...]] = {}
    while not cursor.done:
        word = cursor.take()
        if word.upper in PASSING:
            passing.append(word.upper)
        elif keyword in RELATIVE_MOTIONS and word.upper in FRAMES_OF_DISTANCES:
            along = word.upper
        elif word.upper == "WITH":
            settings = cursor.settings()
        elif word.text != ",":
            trouble = trouble or f"'{word.text}' is not understood"
    if keyword in POINT_MOTIONS and len(operands) != (2 if keyword.endswith("CIRC") else 1):
        trouble = trouble or f"{keyword} is given {len(operands)} points"
    return Motion(
        start=words[0].start,
        end=words[-1].end,
        keyword=keyword,
        operands=tuple(operands),
        passing=tuple(passing),
        settings=settings,
        along=along,
        trouble=trouble,
    )


def _parameters(words: list[Word]) -> tuple[str, ...]:
    """Names in the parentheses of a routine's head, such as ``(N :IN, P :OUT)``."""
    opening = next((i for i, word in enumerate(words) if word.text == "("), len(words))
    groups = _arguments(words[opening:])
    return tuple(group[0].upper for group in groups if group and group[0].kind == "name")


def _arguments(words: list[Word]) -> tuple[tuple[Word, ...], ...]:
    """What stands between the commas of a pair of parentheses."""
    out: list[tuple[Word, ...]] = []
    depth, current = 0, list[Word]()
    for word in words:
        depth += (word.text in "([{") - (word.text in ")]}")
        if depth == 0:
            break
        if depth == 1 and word.text == ",":
            out.append(tuple(current))
            current = []
        elif not (depth == 1 and word.text == "("):
            current.append(word)
    return (*out, tuple(current))


def _handed_over(words: Sequence[Word]) -> tuple[str, ...]:
    """Variables in the parentheses of a call, which the routine may change."""
    out: list[str] = []
    inside: list[bool] = []
    for before, word in zip([None, *words], words, strict=False):
        if word.text == "(":
            inside.append(before is not None and before.kind == "name")
        elif word.text == ")" and inside:
            inside.pop()
        elif word.kind == "name" and any(inside):
            out.append(word.upper)
    return tuple(out)


class _Cursor:
    """The words of a line, one after the other."""

    def __init__(self, words: Sequence[Word]):
        self._words = words
        self._next = 0

    @property
    def done(self) -> bool:
        return self._next >= len(self._words)

    def at(self, text: str) -> bool:
        return not self.done and self._words[self._next].text == text

    def at_name(self, names: set[str]) -> bool:
        return not self.done and self._words[self._next].upper in names

    def at_kind(self, kind: str) -> bool:
        return not self.done and self._words[self._next].kind == kind

    def take(self) -> Word:
        self._next += 1
        return self._words[self._next - 1]

    def accept(self, text: str) -> bool:
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
        words = self._words[self._next : self._next + 3]
        if len(words) == 3 and words[1].kind == "number" and words[2].text == "]":
            self._next += 3
            return Reference(name=f"{name.upper}[{words[1].text}]", start=name.start, end=words[2].end)
        return None

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
        before = self._words[self._next - 1].end
        start = self._next
        self.skip_to(",", "}")
        words = self._words[start : self._next]
        if self.done or not words:
            return None
        text = "".join(word.text for word in words)
        return Field(
            name=name.upper,
            text=text,
            value=_number(words),
            start=words[0].start,
            end=words[-1].end,
            touches=before == words[0].start,
        )


def _number(words: Sequence[Word]) -> float | None:
    """A literal number with its sign, or a bit string such as ``'B1010'``."""
    last = words[-1]
    if len(words) == 1 and last.kind == "string":
        return _bits(last.upper)
    if last.kind != "number" or len(words) > 2 or (len(words) == 2 and words[0].text not in {"+", "-"}):
        return None
    value = float(last.text) * (-1.0 if words[0].text == "-" else 1.0)
    return value if isfinite(value) else None


def _bits(text: str) -> float | None:
    digits, base = text[2:-1], {"'B": 2, "'H": 16}.get(text[:2])
    if base is None or not digits or len(digits) > 32 or not set(digits) <= set("0123456789ABCDEF"[:base]):
        return None
    return float(int(digits, base))
