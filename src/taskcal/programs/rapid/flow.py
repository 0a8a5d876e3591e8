"""The order of motions: which motion ends where another one begins, as far as the text tells."""

from collections.abc import Callable, Iterable, Iterator

from taskcal.programs.rapid.motion_forms import MOTION_FORMS, ONLY_EXTERNAL
from taskcal.programs.rapid.names import Context, Scope
from taskcal.programs.rapid.predefined import FUNCTIONS, MOTIONLESS, MOVING
from taskcal.programs.rapid.syntax import (
    Aggregate,
    Argument,
    Assignment,
    Branches,
    Call,
    Expression,
    Instruction,
    Label,
    Leave,
    Loop,
    Operation,
    Reference,
    Statement,
    Unparsed,
)
from taskcal.programs.unresolved import Unresolved

Before = frozenset[int | None]
"""Numbers of the motions that may have been the last one, None for any; empty where control does not come."""

ANY: Before = frozenset([None])

Resolve = Callable[[Instruction, Scope, int | None], int | None]
"""Resolves a motion, given the one before, and says its number; None where it could not be resolved."""

LEAVING = ("exitcycle", "systemstopaction")


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


def follow_routine(context: Context, resolve: Resolve) -> None:
    """Resolve the motions of a routine in the order of its text."""
    routine = context.routine
    if routine is None:
        return
    # an error handler may move the robot and then resume anywhere
    resumes = any(_moves(handler, context.scope) for handler in routine.handlers)
    walker = _Walker(resolve, ANY if resumes else frozenset())
    walker.block(routine.body, context.scope, ANY)
    for handler in routine.handlers:
        walker.block(handler, context.scope, ANY)


class _Walker:
    def __init__(self, resolve: Resolve, always: Before):
        self.resolve, self.always = resolve, always

    def block(self, block: Iterable[Statement], scope: Scope, before: Before) -> Before:
        for statement in block:
            before = self.statement(statement, scope, before | self.always)
        return before

    def statement(self, statement: Statement, scope: Scope, before: Before) -> Before:
        match statement:
            case Instruction() if is_read(statement, scope):
                follows = next(iter(before)) if len(before) == 1 else None
                number = self.resolve(statement, scope, follows)
                return frozenset([number]) if MOTION_FORMS[statement.name.key].ends_there else ANY
            case Instruction() if statement.name.key == ONLY_EXTERNAL:
                return ANY
            case Instruction():
                if statement.name.key in LEAVING:
                    return frozenset()
                if is_motion(statement, scope):
                    self.resolve(statement, scope, None)
                    return ANY
                return ANY if _moves([statement], scope) else before
            case Branches():
                before = self._asked(statement.conditions, scope, before)
                after = frozenset() if statement.exhaustive else before
                for branch in statement.branches:
                    after |= self.block(branch, scope, before)
                return after
            case Loop():
                before = self._asked(statement.conditions, scope, before)
                inside = scope.with_counter(statement.counter)
                if _moves(statement.body, inside):
                    before |= ANY
                return before | self.block(statement.body, inside, before)
            case Leave():
                return frozenset()
            case Label() | Unparsed():
                return ANY
            case _:
                return ANY if _moves([statement], scope) else before

    @staticmethod
    def _asked(conditions: Iterable[Expression], scope: Scope, before: Before) -> Before:
        return ANY if any(_calls(condition, scope) for condition in conditions) else before


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


def _moves(block: Iterable[Statement], scope: Scope) -> bool:
    """Whether some statement may move the robot, or be reached from elsewhere."""
    for statement in block:
        match statement:
            case Instruction():
                key = statement.name.key
                if key not in MOTIONLESS or key in scope.routines or _arguments_call(statement.arguments, scope):
                    return True
            case Assignment():
                if _calls(statement.value, scope):
                    return True
            case Branches():
                if any(_calls(c, scope) for c in statement.conditions):
                    return True
                if any(_moves(branch, scope) for branch in statement.branches):
                    return True
            case Loop():
                if any(_calls(c, scope) for c in statement.conditions) or _moves(statement.body, scope):
                    return True
            case Leave():
                if statement.value is not None and _calls(statement.value, scope):
                    return True
            case Label() | Unparsed():
                return True
    return False


def _arguments_call(arguments: Iterable[Argument], scope: Scope) -> bool:
    return any(a.value is not None and _calls(a.value, scope) for a in arguments)


def _calls(node: Expression, scope: Scope) -> bool:
    """Whether an expression calls a function that may move the robot."""
    match node:
        case Call():
            if node.name.key in scope.routines or node.name.key not in FUNCTIONS:
                return True
            return _arguments_call(node.arguments, scope)
        case Operation():
            return any(_calls(operand, scope) for operand in node.operands)
        case Aggregate():
            return any(_calls(item, scope) for item in node.items)
        case _:
            return False
