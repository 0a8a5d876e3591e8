"""Which statements of a RAPID program move the robot, which routines they call, and which data they name and may change."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from robot_programs.core import flow
from robot_programs.core.flow import Node, bodies_of, lines_in
from robot_programs.core.program import Unresolved
from robot_programs.rapid.names import (
    CHANGING,
    FUNCTIONS,
    INSTRUCTIONS,
    LATE,
    MOTIONLESS,
    MOVING,
    RETURNING,
    SOFTENING,
    STIFFENING,
    SYSTEM_MOTION,
    Context,
    File,
    Scope,
    Symbol,
)
from robot_programs.rapid.parse import RESERVED
from robot_programs.rapid.resolve import CHANGED_BY, MOTION_FORMS, ONLY_EXTERNAL
from robot_programs.rapid.syntax import (
    Argument,
    Assignment,
    Call,
    Control,
    Expression,
    Instruction,
    Label,
    Line,
    Number,
    Parameter,
    Reference,
    Routine,
    Tail,
    Token,
    Unparsed,
    expressions_of,
    inside,
    parts,
)
from robot_programs.rapid.values import Values, steps

# Which statements of a routine move the robot, and which call what.


def is_read(instruction: Instruction, scope: Scope) -> bool:
    """Whether an instruction is one of the system's motions that are read."""
    return instruction.name.key in MOTION_FORMS and instruction.name.key not in scope.routines


def is_motion(instruction: Instruction, scope: Scope) -> bool:
    """Whether an instruction moves the robot by itself: one of the system's, or one that is given a target."""
    key = instruction.name.key
    if key in MOTIONLESS or key in scope.routines:
        return False
    return key.startswith(MOVING) or any(_is_target(argument.value, scope) for argument in instruction.arguments)


def _is_target(node: Expression | None, scope: Scope) -> bool:
    match node:
        case Call():
            return node.name.key in ("offs", "reltool")
        case Reference():
            return type_of(node.name.text, scope) in ("robtarget", "jointtarget")
        case _:
            return False


def moves(lines: Iterable[Line], scope: Scope) -> bool:
    """Whether some line may move the robot, or be reached from elsewhere."""
    return any(
        isinstance(line, Label | Unparsed)
        or (isinstance(line, Instruction) and (line.name.key not in MOTIONLESS or line.name.key in scope.routines))
        or any(calls(expression, scope) for expression in expressions_of(line))
        for line in lines
    )


def calls(node: Expression, scope: Scope) -> bool:
    """Whether an expression calls a function that may move the robot."""
    return any(
        isinstance(part, Call) and (part.name.key in scope.routines or part.name.key not in FUNCTIONS)
        for part in parts(node)
    )


def returns_values(node: Expression) -> bool:
    """Whether a function of the system in an expression changes what it is given."""
    return any(
        isinstance(part, Call) and (part.name.key in CHANGING or any(a.option in RETURNING for a in part.arguments))
        for part in parts(node)
    )


ANY_ROUTINE = Routine(
    start=0, end=0, name=Token("name", "", "", 0), kind="proc", local=False, parameters=(), declarations=(), body=(), handlers=(),
)  # fmt: skip
"""Stands for the routine that is called by a name that is not known, which may be any."""


def may_call(lines: Iterable[Line], scope: Scope) -> frozenset[Routine]:
    """Routines that some lines call, as `called`, and `ANY_ROUTINE` where one is called by a name that is not known."""
    lines = tuple(lines)
    late = any(isinstance(line, Instruction) and is_late(line, scope) for line in lines)
    return frozenset(called(lines, scope)) | ({ANY_ROUTINE} if late else frozenset[Routine]())


def is_late(instruction: Instruction, scope: Scope) -> bool:
    """Whether an instruction calls a procedure by a name that only the running program knows."""
    return instruction.name.key in LATE and instruction.name.key not in scope.routines


def called(lines: Iterable[Line], scope: Scope) -> Iterator[Routine]:
    """Routines of the files that some lines may call, those in text that was not understood included."""
    for line in lines:
        match line:
            case Instruction():
                yield from scope.routines.get(line.name.key, ())
            case Unparsed():
                for token in line.tokens:
                    yield from scope.routines.get(token.key, ()) if token.kind == "name" else ()
            case _:
                pass
        if isinstance(line, Instruction) and line.plain:
            continue
        for part in (part for expression in expressions_of(line) for part in parts(expression)):
            if isinstance(part, Call):
                yield from scope.routines.get(part.name.key, ())


# What an instruction, a function, or text that was not understood may change.

_DECLARING = frozenset({"const", "pers", "var", "inout", "for"})
"""Words behind which a name is declared."""

_ASKING = frozenset({"if", "elseif", "while", "test", "case", "from", "to", "step", "return", "raise", "goto", "with"})
"""Words behind which a value or a name is read, while a statement may begin behind other reserved words."""

_BETWEEN = frozenset({"and", "or", "xor", "not", "div", "mod"})
"""Operators that are words."""


_CALIBRATING = ("mtool", "wobjcalib")
"""How instructions begin that change a tool or a work object."""


def may_change(called: str, type_: str, *, function: bool) -> bool:
    """Whether an instruction or a function of the system, by its key, may change data of a type that it is given.

    The system's motions take tools and work objects as persistent data, so that these could be changed, but are not; what
    searches or calibrates says so in its name. A routine that is not in the files may change all that it is given.
    """
    if function:
        return called not in FUNCTIONS or called in CHANGING
    if called.startswith(_CALIBRATING) or called in CHANGING:
        return True
    if type_ in ("tooldata", "wobjdata"):
        return called not in INSTRUCTIONS and SYSTEM_MOTION.fullmatch(called) is None
    moves = called in MOTION_FORMS or called == ONLY_EXTERNAL
    return called not in MOTIONLESS and (not moves or called in CHANGED_BY)


def _only_reads(instruction: Instruction, scope: Scope) -> bool:
    """Whether an instruction is a motion to a place that is given by values and names alone, most lines of long programs."""
    return (
        instruction.plain
        and is_read(instruction, scope)
        and instruction.name.key not in CHANGED_BY
        and RETURNING.isdisjoint(instruction.options)
    )


def is_strange(called: str, scope: Scope) -> bool:
    """Whether an instruction or a function, by its key, is neither of the system nor of the files."""
    if called in scope.routines or called in INSTRUCTIONS or called in FUNCTIONS or called in CHANGING:
        return False
    return SYSTEM_MOTION.fullmatch(called) is None and not called.startswith(_CALIBRATING)


def type_of(name: str, scope: Scope) -> str:
    """Type of the data of a name; empty where it is not known."""
    symbol = scope.known(name)
    return "" if symbol is None else symbol.type


def names_in_unparsed_text(
    tokens: Sequence[Token], scope: Scope, changes: Callable[[str, bool, str], bool]
) -> Iterator[tuple[Token, bool]]:
    """Names in text that was not understood, and whether their data may change there.

    They may where an assignment follows, at the beginning of a statement, where they are declared, and behind an instruction
    or a function that may change what it is given. Where two values stand side by side, without a comma or an operator
    between them, a statement is taken to begin: its semicolon is what may be missing.

    Args:
        tokens: the text.
        scope: what names mean in it.
        changes: whether an instruction, or a function, by its key, may change data of a type that it is given.
    """
    assigned = _assigned_by_change(tokens)
    callers: set[tuple[str, bool]] = set()
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
                callers = {("", False)}
            begins, declares = token.key == ";", False
            callers = set() if begins else callers
            valued = token.kind in ("number", "text") or token.key in ("]", ")", "}")
            continue
        if i and tokens[i - 1].key in ("\\", ".") and not _is_value(behind):
            valued, begins = True, False
            continue
        data = _is_data(token, scope)
        if not data and behind is not None and behind.key == "(":
            callers.add((token.key, True))
        elif not data and not declares and (begins or valued or _is_value(behind)):
            callers, begins, valued = {(token.key, False)}, False, False
            continue
        type_ = type_of(token.text, scope)
        given = any(changes(key, function, type_) for key, function in callers)
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


def _assigned_by_change(tokens: Sequence[Token]) -> frozenset[int]:
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


# Where a program names its data, and where it may change them.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Mention:
    """A reference to data."""

    reference: Reference
    scope: Scope
    file: File
    changes: bool
    """The value may change here."""
    unparsed: Unparsed | None = None
    """The text that was not understood, where it stands in such."""
    lent_to: str = ""
    """The routine that is not in the files, to which it gives a tool or a work object; empty otherwise."""

    @property
    def symbol(self) -> Symbol | None:
        """Data that it names; None where that is not known."""
        return self.scope.known(self.reference.name.text)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Use:
    """A reference to data, with what it covers."""

    file: File
    start: int
    """First character of the reference."""
    path: tuple[int, ...] | None
    """The component or element; None where that is not known."""
    type: str = ""
    """Of what it covers, in lower case; empty where that is not known."""

    def overlaps(self, path: tuple[int, ...]) -> bool:
        """Whether it reads any of what stands at a path of the data."""
        return self.path is None or all(a == b for a, b in zip(self.path, path, strict=False))


MAX_COMPONENTS = 100
"""Components and elements of one variable that are told apart by what is assigned to them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Changes:
    """Changes of a program to its data."""

    assigned: Mapping[Symbol, Mapping[tuple[int, ...], str]]
    """Components of each variable, how they are assigned to first, as "is assigned to in part.mod:4"; others keep their value."""
    parameters: frozenset[tuple[str, str]]
    """Keys of routines and of those of their parameters that they assign to."""
    lent: Mapping[Routine, Mapping[Symbol, str]] = field(default_factory=dict[Routine, Mapping[Symbol, str]])
    """How each routine gives tools and work objects to routines that are not in the files, which may change them."""


def changes(everywhere: Iterable[Context]) -> Changes:
    """Changes of a program to its data."""
    everywhere = tuple(everywhere)
    assigned: dict[Symbol, dict[tuple[int, ...], str]] = {}
    lent: dict[Routine, dict[Symbol, str]] = {}
    parameters: frozenset[tuple[str, str]] = frozenset()
    while True:
        more: set[tuple[str, str]] = set()
        for context in everywhere:
            for mention in mentions([context], parameters, changing=True):
                symbol = mention.symbol if mention.changes else None
                if symbol is None:
                    continue
                if symbol.may_change:
                    routine = context.routine
                    if mention.lent_to and routine is not None:
                        lent.setdefault(routine, {}).setdefault(symbol, _assignment(mention))
                    else:
                        _note(
                            assigned.setdefault(symbol, {}),
                            _stated_path(mention.reference, symbol, mention.scope),
                            mention,
                        )
                elif symbol.parameter_of:
                    more.add((symbol.parameter_of, symbol.name.lower()))
        if more <= parameters:
            return Changes(assigned=assigned, parameters=parameters, lent=lent)
        parameters |= more  # what is passed to these changes too


def uses(everywhere: Iterable[Context], values: Values) -> Mapping[Symbol, tuple[Use, ...]]:
    """All references to each piece of data and each parameter, but for data without targets in the tails of motions."""
    uses_of: dict[Symbol, list[Use]] = {}
    for mention in mentions(everywhere):
        symbol = mention.symbol
        if symbol is None or not (symbol.declaration or symbol.parameter_of):
            continue
        try:
            path, type_ = values.path(mention.reference, symbol, mention.scope)
        except Unresolved:
            path, type_ = None, symbol.type
        use = Use(file=mention.file, start=mention.reference.start, path=path, type=type_)
        uses_of.setdefault(symbol, []).append(use)
    return {key: tuple(value) for key, value in uses_of.items()}


def _note(own: dict[tuple[int, ...], str], path: tuple[int, ...], mention: Mention) -> None:
    """Note that a component is assigned to; one inside another, and one of very many, stands for the whole."""
    if any(path[:k] in own for k in range(len(path) + 1)):
        return
    if len(own) >= MAX_COMPONENTS:
        path = ()
    inner = [other for other in own if other[: len(path)] == path]
    how = own[inner[0]] if inner else _assignment(mention)
    for other in inner:
        del own[other]
    own[path] = how


def _stated_path(reference: Reference, symbol: Symbol, scope: Scope) -> tuple[int, ...]:
    """Component or element that a reference names, as far as its indices are numbers."""
    path: list[int] = []
    with suppress(Unresolved):
        for at, _, _ in steps(reference, symbol, scope, _stated):
            path.append(at)
    return tuple(path)


def _stated(index: Expression) -> float:
    if not isinstance(index, Number):
        raise Unresolved("which element is meant is computed")
    return index.value


def _assignment(mention: Mention) -> str:
    source = mention.file.source
    place = source.place(mention.reference.start)
    if mention.lent_to:
        late = mention.lent_to == LATE[0]
        by = "the procedure that is called by name" if late else f"{mention.lent_to}, which is not in the files given,"
        return f"may be changed by {by} in {place}"
    if mention.unparsed is None:
        return f"is assigned to in {place}"
    return f"may be assigned to in {place}, which is not understood ({mention.unparsed.trouble(source)})"


def mentions(
    everywhere: Iterable[Context], changed: frozenset[tuple[str, str]] = frozenset(), *, changing: bool = False
) -> Iterator[Mention]:
    """Every reference to data in modules and routines.

    Args:
        everywhere: modules and routines.
        changed: keys of routines and of those of their parameters that they change.
        changing: whether lines may be left out that change nothing.
    """
    for context in everywhere:
        walker = _Walker(context.file, changed, changing=changing)
        for symbol in context.declared:
            if symbol.declaration is not None and symbol.declaration.value is not None:
                yield from walker.read(symbol.declaration.value, context.scope)
        if context.routine is None:
            for unparsed in context.module.unparsed:
                yield from walker.unparsed(unparsed, context.scope)
        else:
            yield from walker.nodes(context.routine.nodes, context.scope)


class _Walker:
    """Finds the references in a file."""

    def __init__(self, file: File, changed: frozenset[tuple[str, str]], *, changing: bool):
        self.file, self.changed, self.changing = file, changed, changing
        self._naming: dict[tuple[Tail | None, Scope], bool] = {}

    def names_targets(self, tail: Tail | None, scope: Scope) -> bool:
        """Whether a tail names data that may be or hold targets."""
        if (tail, scope) not in self._naming:
            named = (argument.value for argument in (() if tail is None else tail.arguments))
            types = [type_of(node.name.text, scope) for node in named if isinstance(node, Reference)]
            self._naming[tail, scope] = not all(scope.holds_no_target(type_) for type_ in types)
        return self._naming[tail, scope]

    def mention(self, reference: Reference, scope: Scope, changes: bool, *, lent_to: str = "") -> Iterator[Mention]:
        yield Mention(reference=reference, scope=scope, file=self.file, changes=changes, lent_to=lent_to)
        for item in inside(reference):
            yield from self.read(item, scope)

    def nodes(self, nodes: Iterable[Node], scope: Scope) -> Iterator[Mention]:
        for node in nodes:
            line: Line = node.line
            match line:
                case Instruction() if _only_reads(line, scope):
                    if not self.changing:
                        for argument in line.arguments if self.names_targets(line.tail, scope) else line.first:
                            if isinstance(argument.value, Reference):
                                yield from self.mention(argument.value, scope, False)
                case Instruction():
                    yield from self.arguments(line.arguments, line.name, scope)
                case Assignment():
                    yield from self.mention(line.target, scope, True)
                    yield from self.read(line.value, scope)
                case Unparsed():
                    yield from self.unparsed(line, scope)
                case _:
                    for expression in expressions_of(line):
                        yield from self.read(expression, scope)
            own = scope.with_counter(line.counter) if isinstance(line, Control) else scope
            for body in bodies_of(node):
                yield from self.nodes(body, own)

    def unparsed(self, unparsed: Unparsed, scope: Scope) -> Iterator[Mention]:

        def may(key: str, function: bool, type_: str) -> bool:
            if key not in scope.routines:
                return may_change(key, type_, function=function)
            return any(self.sets(key, p) for routine in scope.routines[key] for p in routine.parameters)

        for token, changes in names_in_unparsed_text(unparsed.tokens, scope, may):
            reference = Reference(start=token.start, end=token.end, name=token, selectors=())
            yield Mention(reference=reference, scope=scope, file=self.file, changes=changes, unparsed=unparsed)

    def arguments(
        self, arguments: Iterable[Argument], name: Token, scope: Scope, *, function: bool = False
    ) -> Iterator[Mention]:
        key = name.key
        routines = scope.routines.get(key, ())  # several of one name: what any of them does
        required = [iter([p for p in routine.parameters if not p.optional]) for routine in routines]
        for argument in arguments:
            parameters = [
                _option(routine, argument.option) if argument.option else next(own, None)
                for routine, own in zip(routines, required, strict=True)
            ]
            match argument.value:
                case None:
                    pass
                case Reference() as reference if parameters and None not in parameters:
                    changes = any(p is not None and self.sets(key, p) for p in parameters)
                    yield from self.mention(reference, scope, changes)
                case Reference() as reference:
                    type_ = type_of(reference.name.text, scope)
                    changes = may_change(key, type_, function=function) or argument.option in RETURNING
                    lent = changes and type_ in ("tooldata", "wobjdata") and is_strange(key, scope)
                    yield from self.mention(reference, scope, changes, lent_to=name.text if lent else "")
                case value:
                    yield from self.read(value, scope)

    def sets(self, key: str, parameter: Parameter) -> bool:
        return parameter.changed and (key, parameter.name.key) in self.changed

    def read(self, expression: Expression, scope: Scope) -> Iterator[Mention]:
        match expression:
            case Reference():
                yield from self.mention(expression, scope, False)
            case Call():
                arguments = expression.arguments
                if expression.name.key == "dim" and "dim" not in scope.routines:
                    arguments = arguments[1:]  # it reads how many elements there are, not what they hold
                yield from self.arguments(arguments, expression.name, scope, function=True)
            case _:
                for part in inside(expression):
                    yield from self.read(part, scope)


def _option(routine: Routine, name: str) -> Parameter | None:
    return next((p for p in routine.parameters if p.name.key == name), None)


# Which data statements and routines of a program may change.


@dataclass(frozen=True, eq=False, kw_only=True)
class Effects(flow.Effects[Routine, Symbol]):
    """Data that statements and routines may change."""

    changes: Changes
    _of_line: dict[Line, frozenset[Symbol]] = field(default_factory=dict[Line, frozenset[Symbol]])
    _sets: dict[frozenset[Symbol], frozenset[Symbol]] = field(
        default_factory=dict[frozenset[Symbol], frozenset[Symbol]]
    )
    """Each set once: those of most lines are alike."""

    def of(self, node: Node, scope: Scope, file: File) -> frozenset[Symbol]:
        """Data that a statement may change, with all that stands in it and all that it calls."""
        if isinstance(node.line, Instruction) and _only_reads(node.line, scope):
            return frozenset[Symbol]()
        if node.line not in self._of_line:
            own = changed_by([node], scope, file, self.changes)
            others = (self.within.get(r, frozenset[Symbol]()) for r in may_call(lines_in([node]), scope))
            changed = own.union(*others)
            self._of_line[node.line] = self._sets.setdefault(changed, changed)
        return self._of_line[node.line]


def effects_of(everywhere: Iterable[Context], changes: Changes) -> Effects:
    """Data that the routines of a program may change."""
    own: dict[Routine, frozenset[Symbol]] = {}
    calls: dict[Routine, frozenset[Routine]] = {}
    beside: list[Routine] = []
    for context in everywhere:
        if (routine := context.routine) is None:
            continue
        handling = replace(routine, body=tuple(n for handler in routine.handlers for n in handler), handlers=())
        beside += [handling, *([routine] if routine.kind == "trap" else [])]
        for one in (routine, handling):
            own[one] = changed_by(one.nodes, context.scope, context.file, changes)
            calls[one] = may_call(one.lines, context.scope)
    if any(ANY_ROUTINE in called for called in calls.values()):
        own[ANY_ROUTINE], calls[ANY_ROUTINE] = frozenset[Symbol](), frozenset(own)
    return Effects(own=own, calls=calls, beside=beside, changes=changes)


def changed_in(expression: Expression, context: Context, scope: Scope, changes: Changes) -> frozenset[Symbol]:
    """Data that the functions in an expression are given and may change."""
    walker = _Walker(context.file, changes.parameters, changing=True)
    symbols = (mention.symbol for mention in walker.read(expression, scope) if mention.changes)
    return frozenset(symbol for symbol in symbols if symbol is not None)


SOFT = Symbol(name="SoftAct", type="bool")
"""Whether a servo gives way."""


def changed_by(nodes: Sequence[Node], scope: Scope, file: File, changes: Changes) -> frozenset[Symbol]:
    """Data that statements may change by themselves and by the parameters that they give, not by what they call."""
    walker = _Walker(file, changes.parameters, changing=True)
    symbols = (mention.symbol for mention in walker.nodes(nodes, scope) if mention.changes)
    soft = any(
        isinstance(line, Instruction)
        and line.name.key in (SOFTENING, STIFFENING)
        and line.name.key not in scope.routines
        for line in lines_in(nodes)
    )
    return frozenset(symbol for symbol in symbols if symbol is not None) | ({SOFT} if soft else frozenset[Symbol]())
