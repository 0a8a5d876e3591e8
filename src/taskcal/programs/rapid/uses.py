"""Where a program names its data, and where it may change them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from taskcal.programs.rapid.changes import (
    MayChange,
    function_may_change,
    instruction_may_change,
    is_strange,
    names_in_unparsed_text,
    type_of,
)
from taskcal.programs.rapid.lexer import Token
from taskcal.programs.rapid.names import Context, File, Scope, Symbol
from taskcal.programs.rapid.predefined import LATE
from taskcal.programs.rapid.syntax import (
    Aggregate,
    Argument,
    Assignment,
    Branches,
    Call,
    Expression,
    Index,
    Instruction,
    Leave,
    Loop,
    Operation,
    Parameter,
    Reference,
    Routine,
    Statement,
    Unparsed,
)
from taskcal.programs.rapid.values import Values
from taskcal.programs.unresolved import Unresolved


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
                    changes = may_change(key, type_)
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
