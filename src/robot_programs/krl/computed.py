"""Points that only the running program knows, put through a function: which may be, and where they stand."""

import re
from collections.abc import Container, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from robot_programs.core.program import Unresolved
from robot_programs.core.source import TextEdit
from robot_programs.krl.data import BUILT_IN, POSE, File, Routine, Text
from robot_programs.krl.syntax import (
    Aggregate,
    Assignment,
    Call,
    Control,
    Declaration,
    MotionLine,
    Operand,
    Reference,
    Statement,
)
from robot_programs.krl.values import HERE

MOTIONS = ("PTP", "LIN", "CIRC", "SPTP", "SLIN", "SCIRC")
"""Those to points, of which a function makes others."""

OF_PATH, OF_FRAME = "Path", "Frame"

ENDINGS = ("", OF_PATH, OF_FRAME)
"""Of the names of three functions: of an E6POS of a PTP; of one of a line or arc, which keeps the status before; of a FRAME."""

FRAMES = frozenset({"$NULLFRAME", "$WORLD", "$ROBROOT", "$BASE", "$TOOL", "BASE_DATA", "TOOL_DATA"})
"""Variables of the controller's that are frames, arrays without their index."""

CARRIED = frozenset({"EK", "LK", "EB"})
"""Functions by which a base moves with an external axis, another robot or a conveyor; the controller's own BAS has them all."""

_COUPLED = re.compile(
    r"#(?:EX|LK|EB)_BASE\b|MACHINE_FRAME_DAT(?=\[\d+\]\s*=\s*\{[^}]*MACH_DEF_INDEX\s+[1-9])", re.IGNORECASE
)
"""A command by which BAS has them set a base, or a base of ``$config.dat`` that stands on another kinematic system."""

MEASURING = frozenset(
    {*HERE, "$POS_INT", "$AXIS_INT", "$POS_RET", "$AXIS_RET", "$POS_FOR", "$AXIS_FOR", "$POS_BACK", "FORWARD"}
)
"""Where the robot is or was: numbers of the nominal robot for where the true one stands."""


class Wrapped(NamedTuple):
    """A motion that is given a function, or not."""

    file: File
    line: MotionLine
    edits: tuple[TextEdit, ...]
    obstacle: str
    """Why it is not; empty where it is."""


def wrap(files: Sequence[File], motions: Container[Text], function: str, without: Container[str]) -> Iterator[Wrapped]:
    """Some motions, each with the edits that put a function around its points.

    Args:
        files: of the program.
        motions: places of motions.
        function: name of a function of an E6POS whose status and turn count; the names of two others begin with it, see `ENDINGS`.
        without: names of tools and bases, in lower case, one of which the program may have active.
    """
    measured = _measured(files)
    own = [file for file in files if file.module != BUILT_IN]
    named = {name for file in own for name in file.mentions}
    coupled = (match[0] for file in own if (match := _COUPLED.search(file.source.text)))
    carried = next(iter(sorted(named & CARRIED)), "") or next(coupled, "")
    for file in files:
        for routine in file.sections:
            for line in routine.lines:
                if isinstance(line, MotionLine) and (file.number, line.start) in motions:
                    try:
                        if carried:
                            raise Unresolved(f"a base may be moved ({carried})")
                        if without:
                            raise Unresolved("a tool or base was measured, and it is not known which is active")
                        _expect_points(line, measured, named)
                        edits = tuple(_around(one, line, routine, files, function) for one in line.operands)
                    except Unresolved as reason:
                        yield Wrapped(file, line, (), str(reason))
                        continue
                    yield Wrapped(file, line, edits, "")


def calls_function(line: Statement, function: str) -> bool:
    """Whether a function stands around a point of a motion."""
    names = {f"{function}{ending}".upper() for ending in ENDINGS}
    return isinstance(line, MotionLine) and any(word.upper in names for word in line.words)


def _expect_points(line: MotionLine, measured: Container[str], named: Container[str]) -> None:
    """See that a motion goes to points of which a function can make others.

    Raises:
        Unresolved: it does not.
    """
    if line.keyword not in MOTIONS or line.trouble or line.along:
        raise Unresolved("it does not go to points that it names")
    if line.keyword.startswith("S") and "SPLINE" in named:
        raise Unresolved("it may be part of a SPLINE")
    if any(name.startswith(("$TOOL", "$BASE", "$IPO_MODE", "$LOAD")) for name in line.settings):
        raise Unresolved("it sets tool or base for itself, which the function does not see")
    for name in (name for operand in line.operands for name in _names(line, operand)):
        if name in measured:
            raise Unresolved(f"'{name}' comes from where the robot stood, which is true already")


def _names(line: MotionLine, operand: Operand) -> Iterator[str]:
    """Names of which a point is made, without those of components and indices."""
    yield from (part.name.partition("[")[0] for part in operand.parts if isinstance(part, Reference))
    yield from (word.upper for word in line.words_of(operand) if word.kind == "name")


def _around(operand: Operand, line: MotionLine, routine: Routine, files: Sequence[File], function: str) -> TextEdit:
    """A point with the function around it that serves its type.

    What ``:`` gives has the type of its right side, and status and turn count in PTP alone (KUKA System Software, geometric
    operator; status and turn): the product with a FRAME is one, whatever stands before it.

    Raises:
        Unresolved: it has none.
    """
    text, parts = routine.file.source.text[operand.start : operand.end], operand.parts
    joint, own = line.keyword.endswith("PTP"), [_type_of(part, routine, files) for part in parts]
    if own == ["E6POS"] and isinstance(parts[0], Reference):
        return TextEdit(start=operand.start, end=operand.end, text=f"{function}{'' if joint else OF_PATH}({text})")
    missing = [p for p in parts if isinstance(p, Aggregate) and not all(p.value(name) is not None for name in POSE)]
    if missing or (parts and isinstance(parts[0], Aggregate)) or "AXIS" in "".join(own):
        raise Unresolved("its point is no variable, and no product of variables and complete frames")
    if not parts and not _own_functions(line, operand, files):
        raise Unresolved("its point comes from a function that the files do not have")
    if joint and own[-1:] != ["FRAME"]:
        raise Unresolved(
            "its point is neither declared as E6POS nor as FRAME, whose status and turn are then not known"
        )
    frame = text if own == ["FRAME"] else f"{text}:$NULLFRAME"
    return TextEdit(start=operand.start, end=operand.end, text=f"{function}{OF_FRAME}({frame})")


def _own_functions(line: MotionLine, operand: Operand, files: Sequence[File]) -> bool:
    """Whether all functions that compute a point stand in the files, or do geometry alone."""
    words = line.words_of(operand)
    called = {word.upper for word, behind in pairwise(words) if word.kind == "name" and behind.text == "("}
    return bool(words) and called <= {head.name for file in files for head in file.heads} | {"INV_POS"}


def _type_of(part: Aggregate | Reference, routine: Routine, files: Sequence[File]) -> str:
    """Type of a part of a point; empty where it is not known."""
    if isinstance(part, Reference):
        return "FRAME" if part.name.partition("[")[0] in FRAMES else _type(part.name, routine, files)
    return part.type or ("FRAME" if all(field.name in POSE for field in part.fields) else "")


def _type(name: str, routine: Routine, files: Sequence[File]) -> str:
    """Declared type of a variable; empty where it is not known, or there are several."""
    own, module = name.partition("[")[0], routine.file.module
    types = {
        line.type
        for line in routine.lines
        if isinstance(line, Declaration)
        for one in line.variables
        if one.name == own
    }
    if not types:
        types = {
            line.type
            for file in files
            for line in file.statements
            if file.holds_data
            and isinstance(line, Declaration)
            and (file.module == module or line.shared or file.serves_all)
            for one in line.variables
            if one.name == own
        }
    return next(iter(types)).upper() if len(types) == 1 else ""


def _measured(files: Sequence[File]) -> frozenset[str]:
    """Names, whatever they mean where, that are given values from where the robot stood."""
    lines = [(routine, line) for file in files for routine in file.sections for line in routine.lines]
    parameters = {routine.name: routine.parameters for routine, _ in lines}
    found, before = set(MEASURING), 0
    while len(found) > before:
        before = len(found)
        for routine, line in lines:
            match line:
                case Assignment() if not found.isdisjoint(word.upper for word in line.words):
                    found.add(line.variable.partition("[")[0])
                case Control(keyword="RETURN") if not found.isdisjoint(word.upper for word in line.words):
                    found.add(routine.name)
                case Call():
                    for parameter, words in zip(parameters.get(line.name, ()), line.arguments, strict=False):
                        given = {word.upper for word in words if word.kind == "name"}
                        if parameter in found or not found.isdisjoint(given):
                            found |= {parameter, *given}
                case _:
                    pass
    return frozenset(found)
