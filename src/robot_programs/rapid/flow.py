"""The flow of a RAPID program: what holds where each motion begins, through calls, branches and loops."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from robot_programs.core.flow import DEEPEST, MOST_PASSES, with_called
from robot_programs.core.program import Diagnostic, Unresolved
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
    Value,
)
from robot_programs.rapid.parse import RESERVED
from robot_programs.rapid.resolve import CHANGED_BY, MOTION_FORMS, ONLY_EXTERNAL, Motion, Settings, following, resolve
from robot_programs.rapid.syntax import (
    Aggregate,
    Argument,
    Assignment,
    Branches,
    Call,
    Expression,
    Index,
    Instruction,
    Label,
    Leave,
    Loop,
    Number,
    Operation,
    Parameter,
    Reference,
    Routine,
    Statement,
    Token,
    Unparsed,
    parts,
)
from robot_programs.rapid.targets import TargetArgument
from robot_programs.rapid.values import ANY, NOWHERE, Before, Handed, Held, State, Values, merged

# What data hold behind an assignment.


def after_assignment(
    assignment: Assignment, scope: Scope, state: State, values: Values, volatile: frozenset[Symbol]
) -> State:
    """What holds behind an assignment.

    Args:
        assignment: the statement.
        scope: what names mean there.
        state: what holds before it.
        values: of data there.
        volatile: data that may change at any time, of which nothing is kept.
    """
    target = assignment.target
    try:
        symbol = scope.find(target.name.text)
    except Unresolved:
        return state
    if symbol is None:
        return state
    held = None if symbol in volatile else _assigned(assignment, symbol, scope, values)
    state = state.forgotten([symbol])
    return state if held is None else state.holding({symbol: held})


def counting(instruction: Instruction) -> Assignment | None:
    """The assignment that Incr, Decr, Add and Clear stand for (RAPID instructions); None where it is another instruction."""
    nodes = [argument.value for argument in instruction.arguments if not argument.option]
    if len(nodes) != len(instruction.arguments) or not nodes or not isinstance(target := nodes[0], Reference):
        return None
    at = {"start": instruction.start, "end": instruction.end}
    match instruction.name.key, nodes[1:]:
        case ("incr" | "decr") as key, []:
            one = Number(**at, value=1.0)
            value = Operation(**at, operator="+" if key == "incr" else "-", operands=(target, one))
        case "add", [node] if node is not None:
            value = Operation(**at, operator="+", operands=(target, node))
        case "clear", []:
            value = Number(**at, value=0.0)
        case _:
            return None
    return Assignment(**at, target=target, value=value)


def _assigned(assignment: Assignment, symbol: Symbol, scope: Scope, values: Values) -> Held | None:
    """What data hold of which something is assigned; None where the text does not tell."""
    target, node = assignment.target, assignment.value
    try:
        value = values.of(node, scope)
        path, _ = values.path(target, symbol, scope)
        if not path:
            name = values.found(node, scope).name if isinstance(node, Reference) else ""
            return Held(value=value, name=name, settable=values.settable(node, scope))
        whole = Reference(start=target.start, end=target.end, name=target.name, selectors=())
        settable = any(values.settable(part, scope) for part in (node, target, whole))
        return Held(value=_replaced(values.of(whole, scope), path, value), settable=settable)
    except Unresolved:
        return None


def _replaced(whole: Value, path: Sequence[int], value: Value) -> Value:
    """A record or an array with another component or element."""
    if not path:
        return value
    if not isinstance(whole, tuple) or path[0] >= len(whole):
        raise Unresolved("there is no such component")
    own = _replaced(whole[path[0]], path[1:], value)
    return (*whole[: path[0]], own, *whole[path[0] + 1 :])


# What a RAPID routine is given where it is called.

INITIAL: dict[str, Value] = {"num": 0.0, "dnum": 0.0, "bool": False, "string": ""}
"""What variables hold that are declared without a value (RAPID overview, variable declarations)."""


def given(instruction: Instruction, routine: Routine) -> Iterator[tuple[Parameter, Argument]]:
    """Parameters of a routine with the arguments of a call; those that are not given are missing."""
    required = iter([p for p in routine.parameters if not p.optional])
    for argument in instruction.arguments:
        named = next((p for p in routine.parameters if p.name.key == argument.option), None)
        parameter = named if argument.option else next(required, None)
        if parameter is not None:
            yield parameter, argument


def at_entry(state: State, called: Context, volatile: frozenset[Symbol]) -> State:
    """What holds at the start of a routine: variables of its own get their declared values there."""
    return state.forgotten(own_symbols(called)).holding(
        {
            symbol: held
            for symbol in called.declared
            if symbol not in volatile
            for held in [initial(symbol)]
            if held is not None
        }
    )


def initial(symbol: Symbol) -> Held | None:
    """What a variable holds where its declaration is reached; None where that is not known, and of other data."""
    declaration = symbol.declaration
    if declaration is None or declaration.storage != "var":
        return None
    if declaration.value is not None:
        return Held(value=0.0, declared=True)
    return None if declaration.array or symbol.type not in INITIAL else Held(value=INITIAL[symbol.type])


def own_symbols(context: Context) -> frozenset[Symbol]:
    """Variables and parameters of a routine."""
    routine = context.routine
    parameters = () if routine is None else routine.parameters
    return frozenset(context.declared) | {context.scope.own[p.name.key][0] for p in parameters}


def handed_over(
    instruction: Instruction, called: Context, scope: Scope, file: File, values: Values
) -> Iterator[tuple[Symbol, Held]]:
    """What the parameters of a routine hold where it is called, as far as the text tells.

    Args:
        instruction: the call.
        called: the routine.
        scope: where the call stands.
        file: the same.
        values: of data there.
    """
    if called.routine is None:
        return
    for parameter, argument in given(instruction, called.routine):
        symbol = called.scope.own[parameter.name.key][0]
        if argument.conditional or argument.value is None:
            continue
        try:
            held = _held(argument, scope, file, values)
        except Unresolved:
            continue
        handed = held.handed
        if handed is not None:
            handed = Handed(
                argument=handed.argument, file=handed.file, origin=handed.origin, literal=handed.literal,
                reads=handed.reads, parameters=(*handed.parameters, symbol),
            )  # fmt: skip
        settable = values.settable(argument.value, scope)
        yield symbol, Held(value=held.value, handed=handed, name=held.name, settable=settable)


def _held(argument: Argument, scope: Scope, file: File, values: Values) -> Held:
    """What an argument gives.

    Raises:
        Unresolved: the text does not tell.
    """
    node = argument.value
    assert node is not None
    if not isinstance(node, Reference):
        literal = node if isinstance(node, Aggregate) else None
        handed = Handed(argument=argument, file=file, origin=None, literal=literal)
        return Held(value=values.of(node, scope), handed=handed)
    found = values.found(node, scope)
    if found.handed is not None:  # a parameter is handed on
        literal = found.literal if isinstance(found.literal, Aggregate) else None
        reads = found.handed.reads | {(file, node.start)}
        handed = Handed(
            argument=found.handed.argument, file=found.handed.file, origin=found.origin, literal=literal, reads=reads,
            parameters=found.handed.parameters,
        )  # fmt: skip
        return Held(value=found.value, handed=handed, name=found.name)
    if found.origin is None:  # what was assigned to a variable of the caller has to be written where it is used
        return Held(value=found.value, name=found.name)
    handed = Handed(argument=argument, file=file, origin=found.origin, literal=None)
    return Held(value=found.value, handed=handed, name=found.name)


# Which statements of a routine move the robot, and which call what.


def nested(block: Iterable[Statement]) -> Iterator[Statement]:
    """Some statements and all that stand in them."""
    for statement in block:
        yield statement
        match statement:
            case Branches():
                for branch in statement.branches:
                    yield from nested(branch)
            case Loop():
                yield from nested(statement.body)
            case _:
                pass


def is_read(instruction: Instruction, scope: Scope) -> bool:
    """Whether an instruction is one of the system's motions that are read."""
    return instruction.name.key in MOTION_FORMS and instruction.name.key not in scope.routines


def is_motion(instruction: Instruction, scope: Scope) -> bool:
    """Whether an instruction moves the robot by itself: one of the system's, or one that is given a target."""
    key = instruction.name.key
    if key in MOTIONLESS or key in scope.routines:
        return False
    return key.startswith(MOVING) or gets_target(instruction, scope)


def gets_target(instruction: Instruction, scope: Scope) -> bool:
    """Whether some argument of an instruction is a target."""
    return any(a.value is not None and _is_target(a.value, scope) for a in instruction.arguments)


def _is_target(node: Expression, scope: Scope) -> bool:
    match node:
        case Call():
            return node.name.key in ("offs", "reltool")
        case Reference():
            try:
                symbol = scope.find(node.name.text)
            except Unresolved:
                return False
            return symbol is not None and symbol.type in ("robtarget", "jointtarget")
        case _:
            return False


def moves(block: Iterable[Statement], scope: Scope) -> bool:
    """Whether some statement may move the robot, or be reached from elsewhere."""
    for statement in block:
        match statement:
            case Instruction():
                key = statement.name.key
                if key not in MOTIONLESS or key in scope.routines or _arguments_call(statement.arguments, scope):
                    return True
            case Assignment():
                if calls(statement.value, scope):
                    return True
            case Branches():
                if any(calls(c, scope) for c in statement.conditions):
                    return True
                if any(moves(branch, scope) for branch in statement.branches):
                    return True
            case Loop():
                if any(calls(c, scope) for c in statement.conditions) or moves(statement.body, scope):
                    return True
            case Leave():
                if statement.value is not None and calls(statement.value, scope):
                    return True
            case Label() | Unparsed():
                return True
    return False


def _arguments_call(arguments: Iterable[Argument], scope: Scope) -> bool:
    return any(a.value is not None and calls(a.value, scope) for a in arguments)


def calls(node: Expression, scope: Scope) -> bool:
    """Whether an expression calls a function that may move the robot."""
    return any(
        isinstance(part, Call) and (part.name.key in scope.routines or part.name.key not in FUNCTIONS)
        for part in parts(node)
    )


def _returns_values(node: Expression) -> bool:
    """Whether a function of the system in an expression changes what it is given."""
    return any(
        isinstance(part, Call) and (part.name.key in CHANGING or any(a.option in RETURNING for a in part.arguments))
        for part in parts(node)
    )


ANY_ROUTINE = Routine(
    start=0, end=0, name=Token("name", "", "", 0), kind="proc", local=False, parameters=(), declarations=(), body=(), handlers=(),
)  # fmt: skip
"""Stands for the routine that is called by a name that is not known, which may be any."""


def may_call(block: Iterable[Statement], scope: Scope) -> frozenset[Routine]:
    """Routines that some statements call, as `called`, and `ANY_ROUTINE` where one is called by a name that is not known."""
    block = tuple(block)
    late = any(isinstance(s, Instruction) and is_late(s, scope) for s in nested(block))
    return frozenset(called(block, scope)) | ({ANY_ROUTINE} if late else frozenset[Routine]())


def is_late(instruction: Instruction, scope: Scope) -> bool:
    """Whether an instruction calls a procedure by a name that only the running program knows."""
    return instruction.name.key in LATE and instruction.name.key not in scope.routines


def called(block: Iterable[Statement], scope: Scope) -> Iterator[Routine]:
    """Routines of the files that some statements may call, those in text that was not understood included."""
    for statement in nested(block):
        match statement:
            case Instruction():
                yield from scope.routines.get(statement.name.key, ())
                for argument in statement.arguments:
                    yield from _called_by(argument.value, scope)
            case Assignment():
                yield from _called_by(statement.target, scope)
                yield from _called_by(statement.value, scope)
            case Branches() | Loop():
                for condition in statement.conditions:
                    yield from _called_by(condition, scope)
            case Leave():
                yield from _called_by(statement.value, scope)
            case Unparsed():
                for token in statement.tokens:
                    if token.kind == "name":
                        yield from scope.routines.get(token.key, ())
            case _:
                pass


def _called_by(node: Expression | None, scope: Scope) -> Iterator[Routine]:
    for part in () if node is None else parts(node):
        if isinstance(part, Call):
            yield from scope.routines.get(part.name.key, ())


# What an instruction, a function, or text that was not understood may change.

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
    return function not in FUNCTIONS or function in CHANGING


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
    assigned = _assigned_by_change(tokens)
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


@dataclass(frozen=True, eq=False, kw_only=True)
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


@dataclass(frozen=True, eq=False, kw_only=True)
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Changes:
    """What a program changes of its data."""

    assigned: Mapping[Symbol, str]
    """How each variable is assigned to first, as "is assigned to in part.mod:4"; those that keep their value are missing."""
    parameters: frozenset[tuple[str, str]]
    """Keys of routines and of those of their parameters that they assign to."""
    lent: Mapping[Routine, Mapping[Symbol, str]] = field(default_factory=dict[Routine, Mapping[Symbol, str]])
    """How each routine gives tools and work objects to routines that are not in the files, which may change them."""


def changes(everywhere: Iterable[Context]) -> Changes:
    """What a program changes of its data."""
    everywhere = tuple(everywhere)
    assigned: dict[Symbol, str] = {}
    lent: dict[Routine, dict[Symbol, str]] = {}
    parameters: frozenset[tuple[str, str]] = frozenset()
    while True:
        more: set[tuple[str, str]] = set()
        for context in everywhere:
            for mention in mentions([context], parameters):
                symbol = symbol_of(mention) if mention.changes else None
                if symbol is None:
                    continue
                if symbol.declaration is not None and symbol.declaration.storage != "const":
                    routine = context.routine
                    own = lent.setdefault(routine, {}) if mention.lent_to and routine is not None else assigned
                    own.setdefault(symbol, _assignment(mention))
                elif symbol.parameter_of:
                    more.add((symbol.parameter_of, symbol.name.lower()))
        if more <= parameters:
            return Changes(assigned=assigned, parameters=parameters, lent=lent)
        parameters |= more  # what is handed to these changes too


def uses(everywhere: Iterable[Context], values: Values) -> Mapping[Symbol, tuple[Use, ...]]:
    """All references to each piece of data and each parameter."""
    uses_of: dict[Symbol, list[Use]] = {}
    for mention in mentions(everywhere):
        symbol = symbol_of(mention)
        if symbol is None or not (symbol.declaration or symbol.parameter_of):
            continue
        try:
            path, type_ = values.path(mention.reference, symbol, mention.scope)
        except Unresolved:
            path, type_ = None, symbol.type
        use = Use(file=mention.file, start=mention.reference.start, path=path, type=type_)
        uses_of.setdefault(symbol, []).append(use)
    return {key: tuple(value) for key, value in uses_of.items()}


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


def symbol_of(mention: Mention) -> Symbol | None:
    """What a reference stands for; None where that is not known."""
    try:
        return mention.scope.find(mention.reference.name.text)
    except Unresolved:
        return None


def mentions_in(
    block: Iterable[Statement], scope: Scope, file: File, changed: frozenset[tuple[str, str]]
) -> Iterator[Mention]:
    """Every reference to data in some statements; see `mentions`."""
    return _Walker(file, changed).statements(block, scope)


def mentions(everywhere: Iterable[Context], changed: frozenset[tuple[str, str]] = frozenset()) -> Iterator[Mention]:
    """Every reference to data in modules and routines.

    Args:
        everywhere: modules and routines.
        changed: keys of routines and of those of their parameters that they change.
    """
    for context in everywhere:
        walker = _Walker(context.file, changed)
        for symbol in context.declared:
            if symbol.declaration is not None and symbol.declaration.value is not None:
                yield from walker.read(symbol.declaration.value, context.scope)
        if context.routine is None:
            for unparsed in context.module.unparsed:
                yield from walker.unparsed(unparsed, context.scope)
        else:
            for block in (context.routine.body, *context.routine.handlers):
                yield from walker.statements(block, context.scope)


class _Walker:
    """Finds the references in a file."""

    def __init__(self, file: File, changed: frozenset[tuple[str, str]]):
        self.file, self.changed = file, changed

    def mention(self, reference: Reference, scope: Scope, changes: bool, *, lent_to: str = "") -> Iterator[Mention]:
        yield Mention(reference=reference, scope=scope, file=self.file, changes=changes, lent_to=lent_to)
        for selector in reference.selectors:
            if isinstance(selector, Index):
                for item in selector.items:
                    yield from self.read(item, scope)

    def statements(self, block: Iterable[Statement], scope: Scope) -> Iterator[Mention]:
        for statement in block:
            match statement:
                case Instruction():
                    yield from self.arguments(statement.arguments, statement.name, instruction_may_change, scope)
                case Assignment():
                    yield from self.mention(statement.target, scope, True)
                    yield from self.read(statement.value, scope)
                case Branches():
                    for condition in statement.conditions:
                        yield from self.read(condition, scope)
                    for branch in statement.branches:
                        yield from self.statements(branch, scope)
                case Loop():
                    for condition in statement.conditions:
                        yield from self.read(condition, scope)
                    yield from self.statements(statement.body, scope.with_counter(statement.counter))
                case Leave() if statement.value is not None:
                    yield from self.read(statement.value, scope)
                case Unparsed():
                    yield from self.unparsed(statement, scope)
                case _:
                    pass

    def unparsed(self, unparsed: Unparsed, scope: Scope) -> Iterator[Mention]:
        """Names in text that was not understood."""

        def given(otherwise: MayChange) -> MayChange:
            def may_change(key: str, type_: str) -> bool:
                if key not in scope.routines:
                    return otherwise(key, type_)
                return any(self.sets(key, p) for routine in scope.routines[key] for p in routine.parameters)

            return may_change

        may_change = given(instruction_may_change), given(function_may_change)
        for token, changes in names_in_unparsed_text(unparsed.tokens, scope, *may_change):
            reference = Reference(start=token.start, end=token.end, name=token, selectors=())
            yield Mention(reference=reference, scope=scope, file=self.file, changes=changes, unparsed=unparsed)

    def arguments(
        self, arguments: Iterable[Argument], name: Token, may_change: MayChange, scope: Scope
    ) -> Iterator[Mention]:
        """References in the arguments of an instruction or a function."""
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
                    changes = may_change(key, type_) or argument.option in RETURNING
                    lent = changes and type_ in ("tooldata", "wobjdata") and is_strange(key, scope)
                    yield from self.mention(reference, scope, changes, lent_to=name.text if lent else "")
                case value:
                    yield from self.read(value, scope)

    def sets(self, key: str, parameter: Parameter) -> bool:
        """Whether a routine changes what it is given for a parameter."""
        return parameter.changed and (key, parameter.name.key) in self.changed

    def read(self, expression: Expression, scope: Scope) -> Iterator[Mention]:
        match expression:
            case Reference():
                yield from self.mention(expression, scope, False)
            case Aggregate() if not expression.is_plain:
                for item in expression.items:
                    yield from self.read(item, scope)
            case Operation():
                for operand in expression.operands:
                    yield from self.read(operand, scope)
            case Call():
                arguments = expression.arguments
                if expression.name.key == "dim" and "dim" not in scope.routines:
                    arguments = arguments[1:]  # it reads how many elements there are, not what they hold
                yield from self.arguments(arguments, expression.name, function_may_change, scope)
            case _:
                pass


def _option(routine: Routine, name: str) -> Parameter | None:
    return next((p for p in routine.parameters if p.name.key == name), None)


# Which data statements and routines of a program may change.


@dataclass(frozen=True, eq=False, kw_only=True)
class Effects:
    """What may change where."""

    changes: Changes
    of_routine: Mapping[Routine, frozenset[Symbol]]
    """Data that a routine may change, by itself or by those that it calls."""
    volatile: frozenset[Symbol]
    """Data that may change at any time: in a trap, or where an error is handled."""
    _of_statement: dict[Statement, frozenset[Symbol]] = field(default_factory=dict[Statement, frozenset[Symbol]])
    _sets: dict[frozenset[Symbol], frozenset[Symbol]] = field(
        default_factory=dict[frozenset[Symbol], frozenset[Symbol]]
    )
    """Each set once: those of most statements are alike."""

    def of(self, statement: Statement, scope: Scope, file: File) -> frozenset[Symbol]:
        """Data that a statement may change, with all that stands in it and all that it calls."""
        if statement not in self._of_statement:
            own = _changed([statement], scope, file, self.changes)
            others = (self.of_routine.get(routine, frozenset[Symbol]()) for routine in may_call([statement], scope))
            changed = own.union(*others)
            self._of_statement[statement] = self._sets.setdefault(changed, changed)
        return self._of_statement[statement]

    def of_arguments(self, statement: Statement, scope: Scope, file: File) -> frozenset[Symbol]:
        """Data that a call may change by the parameters that it is given."""
        return _changed([statement], scope, file, self.changes)


def effects_of(everywhere: Iterable[Context], changes: Changes) -> Effects:
    """What the routines of a program may change."""
    own: dict[Routine, tuple[frozenset[Symbol], frozenset[Routine]]] = {}
    handled: dict[Routine, tuple[frozenset[Symbol], frozenset[Routine]]] = {}
    for context in everywhere:
        routine = context.routine
        if routine is None:
            continue
        handlers = [statement for handler in routine.handlers for statement in handler]
        handled[routine] = _own(handlers, context, changes)
        own[routine] = _own([*routine.body, *handlers], context, changes)
    own[ANY_ROUTINE] = frozenset[Symbol](), frozenset(own)
    of_routine = with_called(own)
    volatile = set[Symbol]()
    for routine, (changed, calls) in handled.items():
        volatile |= changed.union(*(of_routine[other] for other in calls))
        if routine.kind == "trap":
            volatile |= of_routine[routine]
    return Effects(changes=changes, of_routine=of_routine, volatile=frozenset(volatile))


def _own(
    block: Iterable[Statement], context: Context, changes: Changes
) -> tuple[frozenset[Symbol], frozenset[Routine]]:
    block = tuple(block)
    changed = _changed(block, context.scope, context.file, changes)
    return changed, may_call(block, context.scope)


SOFT = Symbol(name="SoftAct", type="bool")
"""Whether a servo gives way."""


def _changed(block: Iterable[Statement], scope: Scope, file: File, changes: Changes) -> frozenset[Symbol]:
    block = tuple(block)
    symbols = (symbol_of(mention) for mention in mentions_in(block, scope, file, changes.parameters) if mention.changes)
    soft = any(
        isinstance(s, Instruction) and s.name.key in (SOFTENING, STIFFENING) and s.name.key not in scope.routines
        for s in nested(block)
    )
    return frozenset(symbol for symbol in symbols if symbol is not None) | ({SOFT} if soft else frozenset[Symbol]())


LEAVING = ("exitcycle", "systemstopaction")

MOST_TURNS = 1000
"""A loop of more turns is not gone through turn by turn."""


Resolve = Callable[[Instruction, Scope, Context, State], int | None]
"""Resolves a motion, given what holds before it, and says its number; None where it could not be resolved."""


@dataclass(eq=False, kw_only=True)
class Flow:
    """The routines of a program, and how far they have been followed."""

    contexts: Mapping[Routine, Context]
    effects: Effects
    values: Values
    resolve: Resolve
    left: int
    """How many statements may still be gone through for calls and the turns of loops, in all."""
    anywhere: set[Routine] = field(default_factory=set[Routine])
    """Routines that are called where that is not followed, so that anything may hold there."""
    all_ways: bool = False
    """Ways that are never taken are gone through, too."""
    scopes: dict[Loop, Scope] = field(default_factory=dict[Loop, Scope])
    """Of the bodies of loops, so that one counter is one symbol."""
    sizes: dict[Routine | Loop, int] = field(default_factory=dict[Routine | Loop, int])

    def through(self, context: Context, entry: State, inside: tuple[Routine, ...] = ()) -> State:
        """Go through a routine.

        Args:
            context: the routine.
            entry: what holds at its start, its parameters included.
            inside: routines that are being gone through.

        Returns:
            What holds behind it.
        """
        routine = context.routine
        if routine is None:
            return entry
        # an error handler may move the robot and then resume anywhere
        resumes = any(moves(handler, context.scope) for handler in routine.handlers)
        walk = _Walk(flow=self, context=context, always=ANY if resumes else frozenset(), inside=(*inside, routine))
        end = walk.block(routine.body, context.scope, entry)
        own = self.effects.of_routine[routine] if routine.handlers else frozenset[Symbol]()
        for handler in routine.handlers:
            walk.block(handler, context.scope, replace(entry, before=ANY).forgotten(own))
        return merged([*walk.returns, end])

    def size(self, of: Routine | Loop, body: Iterable[Statement]) -> int:
        """How many statements a routine or a loop has."""
        if of not in self.sizes:
            self.sizes[of] = 1 + sum(1 for _ in nested(body))
        return self.sizes[of]

    def may(self, statements: int) -> bool:
        """Whether so many statements may still be gone through once more; if so, they count."""
        if statements > self.left:
            return False
        self.left -= statements
        return True


@dataclass(eq=False, kw_only=True)
class _Walk:
    """One pass through a routine."""

    flow: Flow
    context: Context
    always: Before
    inside: tuple[Routine, ...]
    returns: list[State] = field(default_factory=list[State])
    """What holds where the routine is left before its end."""

    def block(self, block: Iterable[Statement], scope: Scope, state: State) -> State:
        for statement in block:
            if self.always - state.before:
                state = replace(state, before=state.before | self.always)
            if self.flow.all_ways and not state.reached:
                state = State(before=ANY)
            state = self.statement(statement, scope, state)
        return state

    def statement(self, statement: Statement, scope: Scope, state: State) -> State:
        match statement:
            case Instruction():
                return self._instruction(statement, scope, state)
            case Assignment():
                return self._assignment(statement, scope, state)
            case Branches():
                return self._branches(statement, scope, state)
            case Loop():
                return self._loop(statement, scope, state)
            case Leave():
                if statement.value is not None:
                    state = self._asked(statement, [statement.value], scope, state)
                if statement.keyword == "return":
                    self.returns.append(state)
                return NOWHERE
            case Label() | Unparsed():
                self.flow.anywhere.update(called([statement], scope))
                return self._lost(state)

    def _assignment(self, assignment: Assignment, scope: Scope, state: State) -> State:
        state = self._asked(assignment, [assignment.value], scope, state)
        values = self.flow.values.at(state.variables)
        return after_assignment(assignment, scope, state, values, self.flow.effects.volatile)

    def _lost(self, state: State) -> State:
        """Where control may come from anywhere in the routine: what nothing ever changes still holds."""
        changed = self.flow.effects.changes.assigned.keys()
        parameters = {symbol for symbol in state.variables if self._assigned(symbol.parameter_of, symbol.name)}
        return replace(state, before=ANY).forgotten(changed | parameters | {SOFT})

    def _assigned(self, routine: str, parameter: str) -> bool:
        return (routine, parameter.lower()) in self.flow.effects.changes.parameters

    def _asked(self, statement: Statement, expressions: Iterable[Expression], scope: Scope, state: State) -> State:
        """What holds behind the functions in some expressions of a statement."""
        expressions = tuple(expressions)
        moving = any(calls(expression, scope) for expression in expressions)
        if not moving and not any(map(_returns_values, expressions)):
            return state
        self.flow.anywhere.update(called([statement], scope))
        state = state.forgotten(self.flow.effects.of(statement, scope, self.context.file))
        return replace(state, before=ANY) if moving and state.reached else state

    def _instruction(self, instruction: Instruction, scope: Scope, state: State) -> State:
        key = instruction.name.key
        effects = self.flow.effects
        if is_read(instruction, scope):
            number = self.flow.resolve(instruction, scope, self.context, state)
            state = state.forgotten(effects.of(instruction, scope, self.context.file))
            return state.behind(number) if MOTION_FORMS[key].ends_there else state.behind(None)
        if key in scope.routines:
            return self._call(instruction, scope, state)
        if (counted := counting(instruction)) is not None:
            return self._assignment(counted, scope, state)
        if key in LEAVING:
            return NOWHERE
        if is_late(instruction, scope):
            self.flow.anywhere.update(self.flow.contexts)
            return self._lost(state)
        if key != ONLY_EXTERNAL and is_motion(instruction, scope):
            self.flow.resolve(instruction, scope, self.context, state)
        moved = key == ONLY_EXTERNAL or is_motion(instruction, scope) or moves([instruction], scope)
        self.flow.anywhere.update(called([instruction], scope))
        state = state.forgotten(effects.of(instruction, scope, self.context.file))
        if key in (SOFTENING, STIFFENING) and SOFT not in effects.volatile:
            state = state.holding({SOFT: Held(value=key == SOFTENING)})
        return replace(state, before=ANY) if moved and state.reached else state

    def _call(self, instruction: Instruction, scope: Scope, state: State) -> State:
        flow, file = self.flow, self.context.file
        (routine, *others) = scope.routines[instruction.name.key]
        context = flow.contexts[routine]
        asked = [a.value for a in instruction.arguments if a.value is not None]
        if any(calls(node, scope) for node in asked):
            flow.anywhere.update(r for r in called([instruction], scope) if r is not routine)
        cost = flow.size(routine, routine.body)
        hidden = routine.local and context.module is not self.context.module
        if others or hidden or routine in self.inside or len(self.inside) > DEEPEST or not flow.may(cost):
            flow.anywhere.update((routine, *others))
            state = state.forgotten(flow.effects.of(instruction, scope, file))
            return replace(state, before=ANY) if state.reached else state
        handed = dict(handed_over(instruction, context, scope, file, flow.values.at(state.variables)))
        changed = flow.effects.of_arguments(instruction, scope, file)
        state = state.forgotten(changed)
        behind = flow.through(context, at_entry(state, context, flow.effects.volatile).holding(handed), self.inside)
        return behind.forgotten(changed | own_symbols(context))

    def _branches(self, statement: Branches, scope: Scope, state: State) -> State:
        """IF and TEST; of an IF only the branches that may be taken, as far as the text tells."""
        state = self._asked(statement, statement.conditions, scope, state)
        tests = len(statement.conditions) != len(statement.branches) - statement.exhaustive
        ends: list[State] = []
        for i, branch in enumerate(statement.branches):
            last = statement.exhaustive and i == len(statement.branches) - 1
            taken = True if last and not tests else None
            if not last and not tests:
                taken = self._truth(statement.conditions[i], scope, state)
            if taken is not False:
                ends.append(self.block(branch, scope, state))
            if taken:
                return merged(ends)
        return merged(ends if statement.exhaustive else [*ends, state])

    def _truth(self, condition: Expression, scope: Scope, state: State) -> bool | None:
        """Whether a condition holds; None where the text does not tell."""
        if self.flow.all_ways:
            return None
        values = self.flow.values.at(state.variables)
        try:
            value = None if values.settable(condition, scope) else values.of(condition, scope)
        except Unresolved:
            return None
        return value if isinstance(value, bool) else None

    def _loop(self, loop: Loop, scope: Scope, state: State) -> State:
        state = self._asked(loop, loop.conditions, scope, state)
        inside = self.flow.scopes.setdefault(loop, scope.with_counter(loop.counter))
        if not state.reached:
            return self._some_turns(loop, inside, state)
        if loop.counter is None:
            return self._while(loop, inside, state)
        counts = self._counts(loop, scope, state)
        size = self.flow.size(loop, loop.body)
        if counts is None or not self.flow.may(size * len(counts)):
            return self._some_turns(loop, inside, state)
        counter = inside.own[loop.counter.key][0]
        for count in counts:
            state = self.block(loop.body, inside, state.holding({counter: Held(value=count)}))
        return state.forgotten([counter])

    def _counts(self, loop: Loop, scope: Scope, state: State) -> list[float] | None:
        """What a FOR counts; None where the text does not tell, or it is much."""
        if self.flow.all_ways:
            return None
        values = self.flow.values.at(state.variables)
        try:
            if any(values.settable(bound, scope) for bound in loop.conditions):
                return None
            first, last, *step = (values.number(bound, scope) for bound in loop.conditions)
        except Unresolved:
            return None
        by = step[0] if step else (1.0 if first <= last else -1.0)
        turns = (last - first) / by + 1.0 if by else 0.0
        if not by or not 0.0 <= turns <= MOST_TURNS:
            return [] if by and turns < 0.0 else None
        return [first + k * by for k in range(int(turns + 1e-9))]

    def _while(self, loop: Loop, inside: Scope, state: State) -> State:
        (condition,) = loop.conditions
        size = self.flow.size(loop, loop.body)
        for _ in range(MOST_TURNS if any(isinstance(part, Reference) for part in parts(condition)) else 0):
            holds = self._truth(condition, inside, state)
            if holds is False:
                return state
            if holds is None or not self.flow.may(size):
                break
            before, state = state, self.block(loop.body, inside, state)
            if not state.reached or merged([before, state]).variables == before.variables:
                break
        endless = self._truth(condition, inside, state.forgotten(self.flow.effects.of(loop, inside, self.context.file)))
        behind = self._some_turns(loop, inside, state)
        return NOWHERE if endless else behind

    def _some_turns(self, loop: Loop, inside: Scope, state: State) -> State:
        """A loop of which it is not known how often it is gone through."""
        state = state.forgotten(self.flow.effects.of(loop, inside, self.context.file))
        if state.reached and moves(loop.body, inside):
            state = replace(state, before=state.before | ANY)
        return merged([state, self.block(loop.body, inside, state)])


# The motions that were found in a RAPID program, each with all the ways that lead to it.


@dataclass(eq=False, kw_only=True)
class _Occurrence:
    """A motion that some ways through the program lead to."""

    motion: Motion
    before: Before


@dataclass(eq=False, kw_only=True)
class Findings:
    """Resolves motions, and keeps what comes of it."""

    settings: Settings
    files: Sequence[File]
    seldom: bool = False
    """Only motions are resolved that no way led to so far, reached or not."""
    found: list[_Occurrence] = field(default_factory=list[_Occurrence])
    by_meaning: dict[tuple[object, ...], int] = field(default_factory=dict[tuple[object, ...], int])
    reasons: dict[Instruction, tuple[File, str]] = field(default_factory=dict[Instruction, tuple[File, str]])
    """Why motions could not be resolved on some way, the first reason of each."""
    soft: dict[Instruction, File] = field(default_factory=dict[Instruction, File])
    """Motions in which a servo may give way."""
    seen: set[Instruction] = field(default_factory=set[Instruction])
    """Motions that some way led to."""
    late: set[Instruction] = field(default_factory=set[Instruction])
    """Those of them that were found when all others were."""

    def __call__(self, instruction: Instruction, scope: Scope, context: Context, state: State) -> int | None:
        """Resolve a motion; says its number, or None where that could not be done."""
        if self.seldom and instruction in self.seen and instruction not in self.late:
            return None
        if not self.seldom and not state.reached:
            return None
        if instruction not in self.seen:
            self.seen.add(instruction)
            if self.seldom:
                self.late.add(instruction)
        name = context.routine.name.text if context.routine else ""
        settings = replace(self.settings, values=self.settings.values.at(state.variables))
        try:
            if not is_read(instruction, scope):
                raise Unresolved("this motion is not read")
            motion = resolve(instruction, scope, context.file, settings, name)
        except Unresolved as reason:
            self.reasons.setdefault(instruction, (context.file, str(reason)))
            return None
        if settings.soft and (SOFT not in state.variables or state.variables[SOFT].value is True):
            self.soft[instruction] = context.file
        return self._number(motion, state.before)

    def _number(self, motion: Motion, before: Before) -> int:
        move = motion.move
        meaning = (
            motion.instruction, *_meaning(motion.end), *(_meaning(motion.via) if motion.via else ()), move.tool.name,
            move.tool.T.tobytes(), move.part.name, move.part.T.tobytes(), move.part_in_hand, move.carrier, move.speed,
            move.turn_speed, move.stops, move.zone,
        )  # fmt: skip
        number = self.by_meaning.setdefault(meaning, len(self.found))
        if number == len(self.found):
            self.found.append(_Occurrence(motion=motion, before=before))
        else:
            self.found[number].before |= before
        return number

    def motions(self) -> list[Motion]:
        """All that can be rewritten, in the order of the text."""
        order = {id(file): i for i, file in enumerate(self.files)}
        kept = [i for i, found in enumerate(self.found) if not self._is_torn(found.motion)]
        kept.sort(key=lambda i: (order[id(self.found[i].motion.file)], self.found[i].motion.instruction.start, i))
        number = {old: new for new, old in enumerate(kept)}
        many: dict[Instruction, int] = {}
        for i in kept:
            instruction = self.found[i].motion.instruction
            many[instruction] = many.get(instruction, 0) + 1
        out: list[Motion] = []
        for i in kept:
            found = self.found[i]
            (first, *others) = found.before or ANY
            follows = None if others or first is None else number.get(first)
            instruction = found.motion.instruction
            texts_motions = many[instruction] + (
                instruction in self.reasons
            )  # those of calls that nobody could follow, too
            out.append(following(found.motion, follows, self.settings, texts_motions))
        return out

    def _is_torn(self, motion: Motion) -> bool:
        """Whether a motion's own text would have to change, while on other ways nobody knows where it leads."""
        if motion.instruction not in self.reasons:
            return False
        return any(target.handed is None for target in (motion.end, motion.via) if target is not None)

    def diagnostics(self, motions: Iterable[Motion]) -> Iterator[Diagnostic]:
        """Why motions stay as they are, on all ways or on some."""
        partly = {motion.instruction for motion in motions}
        for instruction, (file, reason) in self.reasons.items():
            where = " in some calls" if instruction in partly else ""
            text = f"{instruction.name.text} stays as it is{where}: {reason}"
            yield Diagnostic(place=file.source.place(instruction.start), text=text)
        for instruction, file in self.soft.items():
            text = (
                f"a servo may be soft here ({self.settings.soft}): the robot gives way, and the tool is not where the program "
                "says; corrected as if it were stiff"
            )
            yield Diagnostic(place=file.source.place(instruction.start), text=text)


def _meaning(target: TargetArgument) -> tuple[object, ...]:
    origin = None if target.origin is None else (target.origin.symbol, target.origin.path)
    return (target.argument, origin, target.shifted, target.meant, target.external, target.read_at)


# Where a RAPID program begins, and what holds there.

LEAST_LEFT = 5000
"""As many statements may be gone through again in any program."""

MAIN = "main"
"""The routine in which a program begins, again and again."""


def follow_program(everywhere: Sequence[Context], effects: Effects, values: Values, findings: Findings) -> None:
    """Go through a program from each routine that nothing calls, and find its motions."""
    contexts = {context.routine: context for context in everywhere if context.routine is not None}
    size = sum(1 for routine in contexts for _ in nested(routine.statements))
    flow = Flow(
        contexts=contexts, effects=effects, values=values, resolve=findings, left=MOST_PASSES * size + LEAST_LEFT
    )
    roots = _roots(contexts)
    lent = _lent(contexts, effects)

    def begin(routine: Routine) -> None:
        own = lent.get(routine)
        flow.values = Values(assigned={**own, **values.assigned}) if own else values
        findings.settings = replace(findings.settings, values=flow.values)

    for routine, context in contexts.items():
        if routine in roots:
            begin(routine)
            flow.through(context, at_entry(_start(flow, context, everywhere), context, effects.volatile))
    done = set[Routine]()
    while flow.anywhere - done:  # called where that is not followed: anything may hold there
        for routine in [routine for routine in contexts if routine in flow.anywhere - done]:
            done.add(routine)
            begin(routine)
            flow.through(contexts[routine], at_entry(State(before=ANY), contexts[routine], effects.volatile))
    findings.seldom = flow.all_ways = True
    flow.left = 0
    for routine, context in contexts.items():
        if any(_is_left(statement, context, findings) for statement in nested(routine.statements)):
            begin(routine)
            flow.through(context, at_entry(State(before=ANY), context, effects.volatile))


def _lent(contexts: Mapping[Routine, Context], effects: Effects) -> dict[Routine, dict[Symbol, str]]:
    """Tools and work objects that are given to routines that are not in the files, on any way that leads through a routine.

    They may be changed there, and stay so when the way is gone again. A routine that nothing in the files calls is a program of
    its own, such as one by which an operator calibrates a tool: the others start from what the files declare.
    """
    own = effects.changes.lent
    if not own:
        return {}
    calls = {routine: may_call(routine.statements, context.scope) for routine, context in contexts.items()}
    if any(ANY_ROUTINE in others for others in calls.values()):
        calls[ANY_ROUTINE] = frozenset(contexts)
    within = with_called({r: (frozenset(own.get(r, {}).items()), others) for r, others in calls.items()})
    callers: dict[Routine, set[Routine]] = {routine: set() for routine in calls}
    for routine, others in calls.items():
        for other in others:
            callers[other].add(routine)
    given = with_called({routine: (within[routine], frozenset(ways)) for routine, ways in callers.items()})
    return {routine: dict(sorted(lent, key=lambda one: one[1])) for routine, lent in given.items()}


def _is_left(statement: object, context: Context, findings: Findings) -> bool:
    if not isinstance(statement, Instruction) or statement in findings.seen:
        return False
    return is_read(statement, context.scope) or is_motion(statement, context.scope)


def _roots(contexts: dict[Routine, Context]) -> frozenset[Routine]:
    """Routines that nothing calls, and those that are called from elsewhere as well: traps and functions."""
    own = frozenset(
        other
        for routine, context in contexts.items()
        for other in called(routine.statements, context.scope)
        if other is not routine
    )
    return frozenset(r for r in contexts if r not in own or r.kind != "proc" or r.name.key == MAIN)


def _start(flow: Flow, context: Context, everywhere: Sequence[Context]) -> State:
    """What holds where a root begins: in main the declared values of variables, if it leaves them as they were.

    A controller declares variables anew where the program pointer is moved to main, and keeps them where main begins again
    behind its end.
    """
    routine, effects = context.routine, flow.effects
    softened = any(SOFT in changed for changed in effects.of_routine.values()) and SOFT not in effects.volatile
    stiff = {SOFT: Held(value=False)} if softened else {}
    if routine is None or routine.name.key != MAIN:
        return State(before=ANY, variables=stiff)
    fresh = {symbol: held for symbol, held in _declared(everywhere).items() if symbol not in effects.volatile} | stiff
    if not fresh:
        return State(before=ANY)
    start = State(before=ANY, variables=fresh)
    quiet = Flow(
        contexts=flow.contexts, effects=flow.effects, values=flow.values, resolve=lambda *_: None, left=flow.left
    )
    while True:
        behind = quiet.through(context, at_entry(start, context, flow.effects.volatile))
        again = merged([start, behind])
        if len(again.variables) >= len(start.variables) or not behind.reached:
            return start
        kept = {symbol: held for symbol, held in start.variables.items() if symbol in again.variables}
        start = State(before=ANY, variables=kept)


def _declared(everywhere: Sequence[Context]) -> dict[Symbol, Held]:
    return {
        symbol: held
        for context in everywhere
        if context.routine is None
        for symbol in context.declared
        for held in [initial(symbol)]
        if held is not None
    }
