"""Which statements of a routine move the robot, and which call what."""

from collections.abc import Iterable, Iterator

from taskcal.programs.rapid.lexer import Token
from taskcal.programs.rapid.motion_forms import MOTION_FORMS
from taskcal.programs.rapid.names import Scope
from taskcal.programs.rapid.predefined import FUNCTIONS, LATE, MOTIONLESS, MOVING
from taskcal.programs.rapid.syntax import (
    Argument,
    Assignment,
    Branches,
    Call,
    Expression,
    Instruction,
    Label,
    Leave,
    Loop,
    Reference,
    Routine,
    Statement,
    Unparsed,
    parts,
)
from taskcal.programs.unresolved import Unresolved


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
