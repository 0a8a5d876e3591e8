"""Which data statements and routines of a program may change."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from taskcal.programs.call_graph import with_called
from taskcal.programs.rapid.moving import ANY_ROUTINE, may_call, nested
from taskcal.programs.rapid.names import Context, File, Scope, Symbol
from taskcal.programs.rapid.predefined import SOFTENING, STIFFENING
from taskcal.programs.rapid.syntax import Instruction, Routine, Statement
from taskcal.programs.rapid.uses import Changes, mentions_in, symbol_of


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
