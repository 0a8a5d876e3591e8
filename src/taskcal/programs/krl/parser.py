"""KRL text as statements: the grammar of declarations, assignments, calls and motions; other lines are passed over."""

from collections.abc import Sequence

from taskcal.programs.krl.cursor import PASSING, Cursor
from taskcal.programs.krl.lexer import Word, lines_of_words
from taskcal.programs.krl.syntax import (
    FRAMES_OF_DISTANCES,
    OTHER_MOTIONS,
    POINT_MOTIONS,
    RELATIVE_MOTIONS,
    Assignment,
    Begin,
    Beside,
    Call,
    Control,
    Declaration,
    Declared,
    End,
    Motion,
    Operand,
    Statement,
)

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

_STEERING = {*BLOCKS, *BLOCKS.values(), "ELSE", "CASE", "DEFAULT", "GOTO", "EXIT", "RETURN", "RESUME"}
_HARMLESS = {
    "WAIT", "EXT", "EXTFCT", "EXTP", "EXTFCTP", "IMPORT", "SIGNAL", "ENUM", "STRUC", "PULSE", "HALT", "BRAKE",
    "CONTINUE", "ASYPTP", "ASYCONT", "ASYSTOP", "CONST_VEL", "TIME_BLOCK", "STOP", "CHANNEL",
}  # fmt: skip
_BESIDE = {"INTERRUPT", "TRIGGER", "ANIN", "ANOUT"}
_VERBS = {"ON": "ON", "ENABLE": "ON", "OFF": "OFF", "DISABLE": "OFF"}
_OPERATORS = {"AND", "OR", "EXOR", "NOT", "B_AND", "B_OR", "B_EXOR", "B_NOT"}
_BY_VALUE = {"ABS", "SQRT", "SIN", "COS", "TAN", "ACOS", "ATAN2", "INV_POS", "VARSTATE", "EK", "LK", "EB"}
"""Functions of the controller, which change nothing that they are given."""
_ENDS = {"END", "ENDFCT", "ENDDAT"}
_BEGINS = {"DEF", "DEFFCT", "DEFDAT"}


def parse(text: str) -> list[Statement]:
    """The statements of a file, in order."""
    return [_statement(words) for words in lines_of_words(text)]


def parse_operand(words: Sequence[Word]) -> Operand:
    """An operand on its own."""
    cursor = Cursor(words)
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
    if keyword in _BESIDE:
        return _beside(words, shared)
    if keyword in _BEGINS:
        names = [word for word in words[1:] if word.kind == "name"]
        chosen = names[min(len(names) - 1, 1 if keyword == "DEFFCT" else 0)] if names else first
        given = _parameters(words)
        return Begin(
            start=start,
            end=end,
            name=chosen.upper,
            parameters=tuple(name for name, _ in given),
            by_value=tuple(value for _, value in given),
        )
    if keyword in _ENDS:
        return End(start=start, end=end)
    if keyword in POINT_MOTIONS | OTHER_MOTIONS:
        return _motion(words)
    if keyword in _STEERING:
        return Control(start=start, end=end, keyword=keyword, words=tuple(words[1:]), changed=_handed_over(words[1:]))
    if len(words) == 2 and words[1].text == ":":
        return Control(start=start, end=end, keyword="LABEL", words=(first,))
    if len(words) > 1 and words[1].kind == "name":
        return _declaration(words, shared)
    if len(words) > 1 and words[1].text == "(":
        return Call(start=start, end=end, name=keyword, arguments=arguments_of(words[1:]))
    return _assignment(words)


def _beside(words: list[Word], shared: bool) -> Beside:
    upper = [word.upper for word in words]
    start, end, keyword = words[0].start, words[-1].end, words[0].upper
    if keyword in ("ANIN", "ANOUT"):
        verb, rest = "".join(upper[1:2]), words[2:]
        action = _assignment(rest) if verb == "ON" and rest else None
        return Beside(
            start=start, end=end, keyword=keyword, verb=verb, number=tuple(rest), shared=shared, action=action
        )
    if keyword == "TRIGGER" or "DECL" in upper:
        first = upper.index("DECL") + 1 if "DECL" in upper else len(words)
        number = words[first : upper.index("WHEN", first)] if "WHEN" in upper[first:] else words[first:]
        verb = "ON" if keyword == "TRIGGER" else "DECL"
        rest = words[upper.index("DO") + 1 :] if "DO" in upper else []
        return Beside(
            start=start,
            end=end,
            keyword=keyword,
            verb=verb,
            number=tuple(number),
            shared=shared,
            action=_action(rest) if rest else None,
        )
    verb = _VERBS.get("".join(upper[1:2]), "")
    return Beside(start=start, end=end, keyword=keyword, verb=verb, number=tuple(words[2:]), shared=shared)


def _action(words: list[Word]) -> Statement:
    """The statement after DO, without its priority; a name alone is called."""
    words = words[: next((i for i, word in enumerate(words) if i and word.upper == "PRIO"), len(words))]
    if len(words) == 1 and words[0].kind == "name":
        return Call(start=words[0].start, end=words[0].end, name=words[0].upper, arguments=((),))
    return _statement(words)


def _assignment(words: list[Word]) -> Statement:
    start, end = words[0].start, words[-1].end
    equals = next((i for i, word in enumerate(words) if word.text == "="), None)
    if equals is None or equals + 1 == len(words):
        return Statement(start=start, end=end)
    cursor = Cursor(words[equals + 1 :])
    index, component = _behind_name(words[1:equals])
    return Assignment(
        start=start,
        end=end,
        name="".join(word.upper for word in words[:equals]),
        variable=words[0].upper,
        value=cursor.operand(),
        text="".join(word.upper for word in words[equals + 1 :]),
        index=index,
        component=component,
        words=tuple(words[equals + 1 :]),
        changed=_handed_over(words[equals:]),
    )


def _behind_name(words: list[Word]) -> tuple[tuple[Word, ...] | None, str]:
    """Index and components of what is assigned to, such as ``[N].X``."""
    if not words or words[0].text != "[":
        return None, "".join(word.upper for word in words).removeprefix(".")
    depth, end = 0, len(words)
    for i, word in enumerate(words):
        depth += (word.text == "[") - (word.text == "]")
        if depth == 0:
            end = i
            break
    return tuple(words[1:end]), "".join(word.upper for word in words[end + 1 :]).removeprefix(".")


def _declaration(words: list[Word], shared: bool) -> Declaration:
    cursor = Cursor(words[1:])
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
    cursor = Cursor(words[1:])
    operands, passing = [cursor.operand()], list[str]()
    trouble = "" if keyword in POINT_MOTIONS else f"{keyword} is not read; write SPL to a complete point"
    arc, along = keyword.removesuffix("_REL").endswith("CIRC"), ""
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
        elif keyword in RELATIVE_MOTIONS and not (arc and word.upper == "#TOOL") and word.upper in FRAMES_OF_DISTANCES:
            along = word.upper
        elif word.upper == "WITH":
            settings = cursor.settings()
        elif word.text != ",":
            trouble = trouble or f"'{word.text}' is not understood behind {keyword}"
    if keyword in POINT_MOTIONS and len(operands) != (2 if arc else 1):
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
        words=tuple(words[1:]) if any(word.text == "(" for word in words) else (),
    )


def _parameters(words: list[Word]) -> tuple[tuple[str, bool], ...]:
    """Names in the parentheses of a routine's head, such as ``(N :IN, P :OUT)``, and whether each is given by value."""
    opening = next((i for i, word in enumerate(words) if word.text == "("), len(words))
    groups = arguments_of(words[opening:])
    return tuple((group[0].upper, group[-1].upper == "IN") for group in groups if group and group[0].kind == "name")


def arguments_of(words: Sequence[Word]) -> tuple[tuple[Word, ...], ...]:
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
            inside.append(before is not None and before.kind == "name" and before.upper not in _OPERATORS | _BY_VALUE)
        elif word.text == ")" and inside:
            inside.pop()
        elif word.kind == "name" and any(inside):
            out.append(word.upper)
    return tuple(out)
