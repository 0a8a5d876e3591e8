"""What an instruction, a function, or text that was not understood may change."""

from collections.abc import Callable, Iterator, Sequence

from taskcal.programs.rapid.expressions import RESERVED
from taskcal.programs.rapid.lexer import Token
from taskcal.programs.rapid.motion_forms import CHANGED_BY, MOTION_FORMS, ONLY_EXTERNAL
from taskcal.programs.rapid.names import Scope
from taskcal.programs.rapid.predefined import CHANGING, FUNCTIONS, INSTRUCTIONS, MOTIONLESS, SYSTEM_MOTION
from taskcal.programs.unresolved import Unresolved

MayChange = Callable[[str, str], bool]
"""Whether an instruction or a function, by its key, may change data of a type that it is given."""

_DECLARING = frozenset({"const", "pers", "var", "inout", "for"})
"""Words behind which a name is declared."""

_ASKING = frozenset({"if", "elseif", "while", "test", "case", "from", "to", "step", "return", "raise", "goto", "with"})
"""Words behind which a value or a name is read, while a statement may begin behind other reserved words."""

_BETWEEN = frozenset({"and", "or", "xor", "not", "div", "mod"})
"""Operators that are words."""


_CALIBRATING = ("mtool", "wobjcalib")
"""How instructions begin that change a tool or a work object."""


def instruction_may_change(instruction: str, type_: str) -> bool:
    """Whether an instruction may change data of a type that it is given.

    The system's motions take tools and work objects as persistent data, so that these could be changed, but are not; what
    searches or calibrates says so in its name. A routine that is not in the files may change all that it is given.
    """
    if instruction.startswith(_CALIBRATING) or instruction in CHANGING:
        return True
    if type_ in ("tooldata", "wobjdata"):
        return instruction not in INSTRUCTIONS and SYSTEM_MOTION.fullmatch(instruction) is None
    moves = instruction in MOTION_FORMS or instruction == ONLY_EXTERNAL
    return instruction not in MOTIONLESS and (not moves or instruction in CHANGED_BY)


def function_may_change(function: str, type_: str) -> bool:
    """Whether a function may change data that it is given, of any type."""
    return function not in FUNCTIONS


def is_strange(called: str, scope: Scope) -> bool:
    """Whether an instruction or a function, by its key, is neither of the system nor of the files."""
    if called in scope.routines or called in INSTRUCTIONS or called in FUNCTIONS or called in CHANGING:
        return False
    return SYSTEM_MOTION.fullmatch(called) is None and not called.startswith(_CALIBRATING)


def type_of(name: str, scope: Scope) -> str:
    """Type of the data of a name; empty where it is not known."""
    try:
        symbol = scope.find(name)
    except Unresolved:
        return ""
    return symbol.type if symbol else ""


def names_in_unparsed_text(
    tokens: Sequence[Token], scope: Scope, instruction: MayChange, function: MayChange
) -> Iterator[tuple[Token, bool]]:
    """Names in text that was not understood, and whether their data may change there.

    They may where an assignment follows, at the beginning of a statement, where they are declared, and behind an instruction
    or a function that may change what it is given. Where two values stand side by side, without a comma or an operator
    between them, a statement is taken to begin: its semicolon is what may be missing.

    Args:
        tokens: the text.
        scope: what names mean in it.
        instruction: whether an instruction may change what it is given.
        function: the same of functions.
    """
    assigned = _assigned(tokens)
    callers: set[tuple[MayChange, str]] = set()
    begins, declares, valued = True, False, False
    for i, token in enumerate(tokens):
        behind = tokens[i + 1] if i + 1 < len(tokens) else None
        if token.kind == "name" and token.key in RESERVED:
            valued = token.key in ("true", "false")
            if not valued and token.key not in _BETWEEN:
                callers, begins, declares = set(), token.key not in _ASKING, token.key in _DECLARING
            continue
        if token.kind != "name":
            if begins:  # no known statement begins so, and a procedure may be called by the value of a string
                callers = {(instruction, "")}
            begins, declares = token.key == ";", False
            callers = set() if begins else callers
            valued = token.kind in ("number", "text") or token.key in ("]", ")", "}")
            continue
        if i and tokens[i - 1].key in ("\\", ".") and not _is_value(behind):
            valued, begins = True, False
            continue
        data = _is_data(token, scope)
        if not data and behind is not None and behind.key == "(":
            callers.add((function, token.key))
        elif not data and not declares and (begins or valued or _is_value(behind)):
            callers, begins, valued = {(instruction, token.key)}, False, False
            continue
        type_ = type_of(token.text, scope)
        given = any(may_change(key, type_) for may_change, key in callers)
        yield token, begins or declares or given or i in assigned
        begins, valued = False, True


def _is_data(token: Token, scope: Scope) -> bool:
    try:
        return scope.find(token.text) is not None
    except Unresolved:
        return True


def _is_value(token: Token | None) -> bool:
    """Whether a value begins with a token."""
    if token is None:
        return False
    return token.key == "[" or token.kind in ("number", "text") or (token.kind == "name" and token.key not in RESERVED)


def _assigned(tokens: Sequence[Token]) -> frozenset[int]:
    """Which tokens are names that ``:=`` follows, behind their components and indices."""
    names: set[int] = set()
    name: int | None = None
    outside: list[int | None] = []
    for i, token in enumerate(tokens):
        match token.key:
            case ":=" if name is not None:
                names.add(name)
                name = None
            case "{":
                outside.append(name)
                name = None
            case "}" if outside:
                name = outside.pop()
            case ";":
                outside, name = [], None
            case ".":
                pass
            case _ if token.kind == "name" and i and tokens[i - 1].key == ".":
                pass
            case _ if token.kind == "name" and not (i and tokens[i - 1].key == "\\"):
                name = i
            case _:
                name = None
    return frozenset(names)
