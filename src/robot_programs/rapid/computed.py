"""Targets that only the running program knows, put through a function: which may be, and the edits that do so."""

from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence

from robot_programs.core.flow import reached
from robot_programs.core.program import Unresolved, Wrapped
from robot_programs.core.source import TextEdit
from robot_programs.rapid.changes import is_read
from robot_programs.rapid.names import Context, Scope, Symbol
from robot_programs.rapid.resolve import CHANGED_BY, MOTION_FORMS, layout
from robot_programs.rapid.syntax import (
    Argument,
    Assignment,
    Call,
    Control,
    Expression,
    Instruction,
    Line,
    Reference,
    Routine,
    Unparsed,
    expressions_of,
    parts,
)

MEASURING = frozenset({"crobt", "cpos", "cjointt"})
"""Functions that say where the robot stands (RAPID functions CRobT, CPos, CJointT): numbers of the nominal robot for where the true
one is, so that a motion there by other numbers would lead elsewhere."""

Measured = frozenset[Symbol | str]
"""Data that come from where the robot stood, and the keys of functions that do."""


def wrap(
    everywhere: Sequence[Context],
    motions: Container[Instruction],
    function: str,
    without: Container[str],
    shift: str,
) -> Iterator[Wrapped]:
    """The motions that are read among some instructions, each with the edits that put a function around its targets.

    Args:
        everywhere: modules and routines.
        motions: instructions.
        function: name of a function of a robtarget, a tool and a work object.
        without: keys of tools and work objects with which motions do not get it.
        shift: why poses may be shifted; empty if they are not.
    """
    measured = _measured(everywhere)
    for context in everywhere:
        if context.routine is None:
            continue
        source = context.file.source
        for line in context.lines:
            if isinstance(line, Instruction) and line in motions and is_read(line, context.scope):
                edits, obstacle = tuple[TextEdit, ...](), ""
                try:
                    edits = tuple(_edits(line, context, measured, function, shift, without))
                except Unresolved as reason:
                    obstacle = str(reason)
                yield Wrapped(place=source.place(line.start), name=line.name.text, edits=edits, obstacle=obstacle)


def calls_function(instruction: Instruction, function: str) -> bool:
    """Whether a function stands around an argument of an instruction."""
    key = function.lower()
    return any(isinstance(a.value, Call) and a.value.name.key == key for a in instruction.arguments)


def _edits(
    instruction: Instruction, context: Context, measured: Measured, function: str, shift: str, without: Container[str]
) -> Iterator[TextEdit]:
    scope, text = context.scope, context.file.source.text
    form, where = MOTION_FORMS[instruction.name.key], layout(instruction)
    if form.kind == "axes":
        raise Unresolved("it goes to joint positions, of which the function makes none")
    if not form.ends_there:
        raise Unresolved("it ends where it finds something")
    if shift:
        raise Unresolved(shift)
    frames = [where.tool, *([where.options["wobj"]] if "wobj" in where.options else [])]
    for frame in frames:
        if not isinstance(frame.value, Reference):
            raise Unresolved("its tool or work object is no data")
        symbol = scope.known(frame.value.name.text)
        if frame.value.name.key in without or (without and symbol is not None and symbol.parameter_of):
            raise Unresolved(
                f"'{frame.value.name.text}' was measured, or may be what was, which the function does not know"
            )
    targets = [target for target in (where.via, where.to) if target is not None]
    for argument in (*targets, *frames):
        if argument.value is None:
            raise Unresolved("its target is not in the text (*)")
        if measured & _read([argument.value], scope):
            raise Unresolved(
                f"'{text[argument.start : argument.end]}' comes from where the robot stood (CRobT, CPos, CJointT or a search), "
                "which is true already"
            )
    names = [text[frame.value.start : frame.value.end] for frame in frames if frame.value is not None]
    given = ",".join([*names, "wobj0"][:2])
    for target in targets:
        own = text[target.start : target.end]
        yield TextEdit(start=target.start, end=target.end, text=f"{function}({own},{given})")


# Which data come from where the robot stood, whatever the order in which they are set.


def _measured(everywhere: Sequence[Context]) -> Measured:
    own = {context.routine: context.scope for context in everywhere if context.routine is not None}
    made_of: dict[Symbol | str, set[Symbol | str]] = defaultdict(set)
    for context in everywhere:
        for line in context.lines:
            for made, of in _made_by(line, context, own):
                for one in of:
                    made_of[one] |= made
    return frozenset(reached(MEASURING, lambda one: made_of.get(one, ())))


def _made_by(line: Line, context: Context, own: Mapping[Routine, Scope]) -> Iterator[tuple[Measured, Measured]]:
    """What a statement gives values, and of what: data, and functions by their keys, which may return what they read."""
    scope, routine = context.scope, context.routine
    match line:
        case Unparsed():
            names = [token for token in line.tokens if token.kind == "name"]
            yield _known([name.text for name in names], scope), MEASURING.intersection(name.key for name in names)
        case Assignment():
            yield _known([line.target.name.text], scope), _read([line.value], scope)
        case Control() if routine is not None:
            yield frozenset({routine.name.key}), _read(line.conditions, scope)
        case Instruction() if not line.plain:
            if line.name.key in CHANGED_BY:
                yield _named([a for a in line.arguments if not a.option][1:2], scope), MEASURING
            yield from _passed(line, scope, own)
        case _:
            pass
    for part in (part for expression in expressions_of(line) for part in parts(expression)):
        if isinstance(part, Call):
            yield from _passed(part, scope, own)


def _passed(
    call: Instruction | Call, scope: Scope, own: Mapping[Routine, Scope]
) -> Iterator[tuple[Measured, Measured]]:
    """The same of a call: all parameters of what it gives, and data of the parameters that it gives them to."""
    given = _read([a.value for a in call.arguments if a.value is not None], scope)
    for routine in scope.routines.get(call.name.key, ()):
        symbols = {p: own[routine].own[p.name.key][0] for p in routine.parameters}
        yield frozenset(symbols.values()), given
        yield _named(call.arguments, scope), frozenset(symbol for p, symbol in symbols.items() if p.changed)


def _named(arguments: Iterable[Argument], scope: Scope) -> Measured:
    return _known([a.value.name.text for a in arguments if isinstance(a.value, Reference)], scope)


def _known(names: Iterable[str], scope: Scope) -> Measured:
    return frozenset(symbol for name in names if (symbol := scope.known(name)) is not None)


def _read(nodes: Iterable[Expression], scope: Scope) -> Measured:
    """Data and functions in expressions."""
    inside = [part for node in nodes for part in parts(node)]
    called = frozenset(part.name.key for part in inside if isinstance(part, Call))
    return called | _known([part.name.text for part in inside if isinstance(part, Reference)], scope)
