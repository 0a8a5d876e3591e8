"""What a RAPID routine is given where it is called."""

from collections.abc import Iterator

from taskcal.programs.rapid.held import Handed, Held, State
from taskcal.programs.rapid.names import Context, File, Scope, Symbol
from taskcal.programs.rapid.predefined import Value
from taskcal.programs.rapid.syntax import Aggregate, Argument, Instruction, Parameter, Reference, Routine
from taskcal.programs.rapid.values import Values
from taskcal.programs.unresolved import Unresolved

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
