"""What data hold behind an assignment."""

from collections.abc import Sequence

from taskcal.programs.rapid.held import Held, State
from taskcal.programs.rapid.names import Scope, Symbol
from taskcal.programs.rapid.predefined import Value
from taskcal.programs.rapid.syntax import Assignment, Instruction, Number, Operation, Reference
from taskcal.programs.rapid.values import Values
from taskcal.programs.unresolved import Unresolved


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
