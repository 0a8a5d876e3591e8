"""KRL text as statements: the grammar of declarations, assignments, calls and motions; other lines are passed over."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from robot_programs.core.flow import (
    Arm,
    Block,
    Body,
    Branches,
    Group,
    Label,
    Leave,
    Loop,
    Node,
    Step,
    bodies_of,
    lines_in,
)
from robot_programs.krl.syntax import (
    FRAMES_OF_DISTANCES,
    OTHER_MOTIONS,
    PASSING,
    POINT_MOTIONS,
    RELATIVE_MOTIONS,
    Assignment,
    Begin,
    Beside,
    Call,
    Control,
    Cursor,
    Declaration,
    Declared,
    End,
    Motion,
    Operand,
    Statement,
    Word,
    lines_of_words,
    split_at_commas,
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
        return Control(
            start=start, end=end, keyword=keyword, words=tuple(words[1:]), changed=_passed_to_calls(words[1:])
        )
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
        changed=_passed_to_calls(words[equals:]),
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
    """Arguments between the commas of a pair of parentheses."""
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


def _passed_to_calls(words: Sequence[Word]) -> tuple[str, ...]:
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


# The blocks of a KRL routine as a tree: branches, loops and splines with the lines inside.

SPLINES = {"SPLINE", "PTP_SPLINE"}
LOOPS = {"FOR", "WHILE", "REPEAT", "LOOP"}

MAX_DEPTH = 24
"""Blocks in each other, in one routine, and labels to which a GOTO behind them leads."""

_INNER = {"IF": {"ELSE"}, "SWITCH": {"CASE", "DEFAULT"}}
_CLOSING = frozenset(BLOCKS.values())
_KINDS: Mapping[str, Literal["counted", "while", "until", "endless"]] = {
    "FOR": "counted",
    "WHILE": "while",
    "REPEAT": "until",
    "LOOP": "endless",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Condition:
    """On what it depends whether a branch is taken, or a loop goes on."""

    words: tuple[Word, ...]
    cases: tuple[tuple[Word, ...], ...] | None = None
    """Of a SWITCH: the values for which a branch is taken; None of what is true or false itself."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Tree:
    """The lines of a routine."""

    body: Body
    odd: Control | None
    """The line at which its blocks do not match; its lines then stand side by side. None where all match."""


def tree_of(lines: Sequence[Statement], matters: Callable[[Statement], bool]) -> Tree:
    """The tree of a routine's lines.

    Args:
        lines: its lines, in order.
        matters: whether a line is of any consequence; the others are left out.
    """
    kept = [line for line in lines if matters(line)]
    builder = _Builder(lines=kept)
    nodes = builder.body(None)
    if builder.odd is not None:
        nodes = tuple(_single(line, loops=0) for line in kept)
    backward, entered = _labels(nodes)
    body = Body(nodes=nodes, size=1 + len(lines), backward=backward, entered=entered)
    return Tree(body=body, odd=builder.odd)


def _single(line: Statement, *, loops: int) -> Node:
    """A line that is no block.

    Args:
        line: the line.
        loops: how many loops it stands in.
    """
    if not isinstance(line, Control):
        return Step(line=line)
    match line.keyword:
        case "LABEL":
            return Label(line=line, name=_name_of_label(line))
        case "GOTO":
            return Leave(line=line, way="jump", label=_name_of_label(line))
        case "EXIT" if loops:
            return Leave(line=line, way="exit")
        case "RETURN":
            return Leave(line=line, way="return")
        case "RESUME":
            return Leave(line=line, way="stop")
        case _:
            return Step(line=line)


class _Builder:
    def __init__(self, lines: list[Statement]):
        self.lines, self.at = lines, 0
        self.odd: Control | None = None
        self.depth = self.loops = 0

    def body(self, opening: Control | None) -> Block:
        """Lines up to the one that ends the block, or its branch; that one is not taken."""
        nodes: list[Node] = []
        own = set[str]() if opening is None else {BLOCKS[opening.keyword], *_INNER.get(opening.keyword, ())}
        while self.at < len(self.lines) and self.odd is None:
            line = self.lines[self.at]
            keyword = line.keyword if isinstance(line, Control) else ""
            if keyword in own:
                return tuple(nodes)
            self.at += 1
            if isinstance(line, Control) and (keyword in _CLOSING or keyword in ("ELSE", "CASE", "DEFAULT")):
                self.odd = line
            elif isinstance(line, Control) and keyword in BLOCKS:
                nodes.append(self._block(line))
            else:
                nodes.append(_single(line, loops=self.loops))
        if opening is not None:
            self.odd = self.odd or opening
        return tuple(nodes)

    def _block(self, opening: Control) -> Node:
        begins, branches = opening, list[tuple[Control, Block]]()
        self.depth += 1
        self.loops += opening.keyword in LOOPS
        if self.depth > MAX_DEPTH:
            self.odd = opening
        while True:
            branches.append((begins, self.body(opening)))
            if self.odd is not None:
                return Step(line=opening)
            end = self.lines[self.at]
            assert isinstance(end, Control)
            self.at += 1
            if end.keyword == BLOCKS[opening.keyword]:
                break
            begins = end
        self.depth -= 1
        self.loops -= opening.keyword in LOOPS
        (_, body) = branches[0]
        if opening.keyword in LOOPS:
            return _loop(opening, body, end)
        if opening.keyword in SPLINES:
            return Group(line=opening, body=body)
        # before the first CASE there is no branch
        arms = branches[opening.keyword == "SWITCH" :]
        return Branches(line=opening, name=opening.keyword, arms=tuple(_arm(opening, line, own) for line, own in arms))


def _loop(opening: Control, body: Block, end: Control) -> Node:
    kind = _KINDS[opening.keyword]
    if not body:  # without any line of consequence
        return Leave(line=opening, way="stop") if kind == "endless" else Step(line=opening)
    condition = Condition(words=end.words if kind == "until" else opening.words)
    return Loop(line=opening, name=opening.keyword, kind=kind, condition=condition, body=body, end=end)


def _arm(opening: Control, line: Control, body: Block) -> Arm:
    own = None if line is opening else line
    if line.keyword in ("ELSE", "DEFAULT"):
        return Arm(line=own, condition=None, body=body)
    words = opening.words
    if opening.keyword == "SWITCH":
        return Arm(line=own, condition=Condition(words=words, cases=split_at_commas(line.words)), body=body)
    words = words[:-1] if words and words[-1].upper == "THEN" else words
    return Arm(line=own, condition=Condition(words=words), body=body)


def _name_of_label(line: Control) -> str:
    """Name of a label or a GOTO, in capitals."""
    return line.words[0].upper if line.words else ""


def _labels(nodes: Block) -> tuple[frozenset[str], frozenset[str]]:
    """Labels to which a GOTO behind them leads, and those to which one leads from outside the block that they are in."""
    gotos = [line for line in lines_in(nodes) if isinstance(line, Control) and line.keyword == "GOTO"]
    backward, entered = set[str](), set[str]()

    def visit(body: Block) -> None:
        own = [node for node in body if isinstance(node, Label)]
        within = {line.start for line in lines_in(body)} if own else set[int]()
        for label in own:
            for line in gotos:
                if _name_of_label(line) == label.name and line.start > label.line.start:
                    backward.add(label.name)
                if _name_of_label(line) == label.name and line.start not in within:
                    entered.add(label.name)
        for node in body:
            for inner in bodies_of(node):
                visit(inner)

    visit(nodes)
    if len(backward) > MAX_DEPTH:
        return frozenset(), frozenset(entered | backward)
    return frozenset(backward), frozenset(entered)


# What routines are given by value, and what they may change of their caller's.


def given_by_value(lines: Iterable[Statement]) -> Mapping[str, tuple[bool, ...]]:
    """By name of a routine: which of its parameters are given by value; only where all routines of the name agree."""
    out: dict[str, tuple[bool, ...]] = {}
    for line in lines:
        if isinstance(line, Begin):
            same = out.setdefault(line.name, line.by_value)
            if same != line.by_value:
                out[line.name] = ()
    return out


def passed_by_reference(line: Call, by_value: Mapping[str, tuple[bool, ...]]) -> tuple[str, ...]:
    """Variables that a call may change: those given to parameters that are not by value, or to functions on the way.

    A parameter that does not say how it is given may be changed (KUKA System Software, transfer of parameters).
    """
    modes = by_value.get(line.name, ())
    out: list[str] = []
    for i, words in enumerate(line.arguments):
        if i < len(modes) and modes[i] and not any(word.text == "(" for word in words):
            continue
        out += [word.upper for word in words if word.kind == "name"]
    return tuple(out)


def whole_call(words: Sequence[Word]) -> Call | None:
    """The function whose value is all of an expression; None where it is anything else."""
    if len(words) < 3 or words[0].kind != "name" or words[1].text != "(":
        return None
    depth = 0
    for i, word in enumerate(words[1:]):
        depth += (word.text == "(") - (word.text == ")")
        if depth == 0 and i + 2 < len(words):
            return None
    given = arguments_of(words[1:])
    if any(word.text == "(" for group in given for word in group):
        return None
    return Call(start=words[0].start, end=words[-1].end, name=words[0].upper, arguments=given)


def passed_in_assignment(line: Assignment, by_value: Mapping[str, tuple[bool, ...]]) -> tuple[str, ...]:
    """Variables that the functions in an assignment may change."""
    called = whole_call(line.words)
    return line.changed if called is None or called.name not in by_value else passed_by_reference(called, by_value)


def passed_in_motion(line: Motion, by_value: Mapping[str, tuple[bool, ...]]) -> tuple[str, ...]:
    """Variables that the program's functions in a motion may change; the controller's own change nothing."""
    out: list[str] = []
    for i, (name, behind) in enumerate(pairwise(line.words)):
        if name.kind == "name" and behind.text == "(" and name.upper in by_value:
            given = arguments_of(line.words[i + 1 :])
            out += passed_by_reference(Call(start=line.start, end=line.end, name=name.upper, arguments=given), by_value)
    return tuple(out)
