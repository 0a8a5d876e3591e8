"""A RAPID module with a function of a robtarget, a tooldata and a wobjdata that moves the target while the program runs.

Robtargets are in millimetres and quaternions, functions in degrees, numbers in single precision (Technical reference manual,
RAPID Instructions, Functions and Data types, 3HAC050917: num, robtarget, orient, CalcJointT, PoseMult, PoseVect, PoseInv,
ErrWrite, EXIT).

Targets of motions are put through this function as far as the text tells which they may be.
"""

from collections.abc import Container, Iterator, Mapping
from math import cos, degrees

from robot_programs.core.form import Ask, Assign, Expression, Key, Line, MoveLine, Ref, expressions
from robot_programs.core.helper import (
    MEASURED,
    Dialect,
    Gift,
    HelperModule,
    Makings,
    indented,
    measured,
    returned,
    single,
)
from robot_programs.core.program import Unresolved, Wrapped
from robot_programs.core.source import Source, TextEdit
from robot_programs.rapid.lower import FRAMES, LoweredRapid, Unread
from robot_programs.rapid.names import Procedure, Symbol, Value
from robot_programs.rapid.parse import Argument, arguments_of
from robot_programs.rapid.resolve import MOTION_FORMS, MoveInstruction, layout
from robot_programs.rapid.syntax import key_of

RAPID = Dialect(
    number=single,
    functions={"sin": "Sin({0})", "cos": "Cos({0})", "sqrt": "Sqrt({0})", "exp": "Exp({0})", "atan2": "ATan2({0},{1})"},
    variable="t{{{0}}}",
    assignment="{0}:={1};",
    degrees={f"q{{{k}}}": f"j.rax_{k}" for k in range(1, 7)},
)

PLACE = ("at.x", "at.y", "at.z")
"""Where a target is in the world, millimetres."""

RESULTS = tuple(f"{name}.{letter}" for name in ("shift", "turn") for letter in "xyz")
"""Shift in the world, millimetres, and half of the turn."""


def rapid_helper(module: HelperModule, first: Source, free_axes: Container[int]) -> Source:
    """The module, whose correction computes `RESULTS`; external axes but for the free ones have to be at zero."""
    axes = [
        f'IF Abs(p.extax.eax_{a})<1E+08 AND p.extax.eax_{a}<>0 TaskcalStop "axis {a} is away from zero";'
        for k, a in enumerate("abcdef", start=1)
        if k not in free_axes
    ]
    joints = [
        f'IF Abs(now.robax.rax_{k}-first.robax.rax_{k})>{single(degrees(module.joint))} TaskcalStop "axis {k} would swing";'
        for k in range(1, 7)
    ]
    words = {
        "AXES": indented(axes, 4), "JOINTS": indented(joints, 6), "BODY": indented(module.correction.lines, 4),
        "SHIFT": single(module.shift * 1e3), "COSINE": single(cos(0.5 * module.turn) ** 2),
        "SETTLED_MM": single(module.settled * 1e3), "LEVER_MM": single(module.lever * 1e3),
    }  # fmt: skip
    return module.written("rapid", ".mod", first, words, inside=False)


# Targets that only the running program knows, put through a function: which may be, and the edits that do so.

MEASURING = frozenset({"crobt", "cpos", "cjointt"})
"""Functions that say where the robot stands (RAPID functions CRobT, CPos, CJointT): numbers of the nominal robot for where the true
one is, so that a motion there by other numbers would lead elsewhere."""


def wrap(
    form: LoweredRapid,
    motions: Container[Line],
    function: str,
    without: Container[str],
    shift: str,
    declared: Mapping[Symbol, Value],
) -> Iterator[Wrapped]:
    """The motions that are read among some lines, each with the edits that put a function around its targets.

    Args:
        form: the program.
        motions: lines.
        function: name of a function of a robtarget, a tool and a work object.
        without: keys of tools and work objects with which motions do not get it.
        shift: why poses may be shifted; empty if they are not.
        declared: what tools and work objects are declared as.
    """
    known = {MEASURED, *measured(_gifts(form))}
    lines = (line for routine in form.all for line in routine.lines)
    assigned = {line.target.key for line in lines if isinstance(line, Assign) and not line.target.path}
    for routine in form.procedures:
        source = routine.file.source
        for line in routine.lines:
            if isinstance(line, MoveInstruction) and line in motions and line.key in MOTION_FORMS:
                edits = _edits(line, routine, known, function, shift, without, declared, assigned)
                yield Wrapped.of(source.place(line.at[1]), line.name, edits)


def calls_function(line: Line, function: str) -> bool:
    """Whether a function stands around an argument of a line."""
    own = (*line.points, *line.settings.values()) if isinstance(line, MoveLine) else expressions(line)
    return any(isinstance(one, Ask) and one.name.lower() == function.lower() for one in own)


def _edits(
    line: MoveInstruction,
    routine: Procedure,
    measured_data: Container[Key],
    function: str,
    shift: str,
    without: Container[str],
    declared: Mapping[Symbol, Value],
    assigned: Container[Key],
) -> Iterator[TextEdit]:
    scope, text = routine.scope, routine.file.source.text
    form, where = MOTION_FORMS[line.key], layout(line.key, arguments_of(routine.file.source, line.at[1]))
    if form.kind == "axes":
        raise Unresolved("it goes to joint positions, of which the function makes none")
    if not form.ends_there:
        raise Unresolved("it ends where it finds something")
    if shift:
        raise Unresolved(shift)
    frames = [where.tool, *([where.options["wobj"]] if "wobj" in where.options else [])]
    for frame in frames:
        if frame.name is None:
            raise Unresolved("its tool or work object is no data")
        symbol = scope.known(frame.name.text)
        unsure = symbol is not None and (symbol.parameter_of or symbol in assigned)
        if key_of(frame.name) in without or (without and unsure):
            raise Unresolved(f"'{frame.name.text}' was measured, or may be what was, which the function does not know")
        if why := _why_it_stops(frame.name.text, declared.get(symbol) if symbol and _is_whole(frame) else None):
            raise Unresolved(f"{why}: there the function would only stop the program")
    targets = [target for target in (where.via, where.to) if target is not None]
    stated = [*line.points, *(line.settings[name] for name in FRAMES if name in line.settings)]
    for argument, one in zip((*targets, *frames), stated, strict=True):
        if argument.value is None:
            raise Unresolved("its target is not in the text (*)")
        if any(key in measured_data for key in _MAKINGS.of(one)):
            raise Unresolved(
                f"'{text[argument.start : argument.end]}' comes from where the robot stood (CRobT, CPos, CJointT or a search), "
                "which is true already"
            )
    names = [text[frame.value.at[1] : frame.value.at[2]] for frame in frames if frame.value is not None]
    given = ",".join([*names, "wobj0"][:2])
    for target in targets:
        own = text[target.start : target.end]
        yield TextEdit(start=target.start, end=target.end, text=f"{function}({own},{given})")


def _is_whole(frame: Argument) -> bool:
    """Whether an argument names data, not a part of them."""
    return frame.name is not None and frame.name.end == frame.end


def _why_it_stops(name: str, value: Value | None) -> str:
    """Why the function, which serves a held tool and a part that stands still, stops with one of these; empty where not known.

    Of data that the files do not declare, or parameters, it decides as it runs.
    """
    match value:
        case (bool(held), _, _):
            return "" if held else f"the tool '{name}' stands still (robhold is FALSE)"
        case (bool(held), bool(fixed), unit, _, _):
            if held:
                return f"the robot holds the work object '{name}' (robhold is TRUE)"
            return "" if fixed else f"the work object '{name}' is moved by '{unit}' (ufprog is FALSE)"
        case _:
            return ""


# Which data come from where the robot stood.


def _is_measuring(expression: Expression) -> bool:
    """Whether it is one of `MEASURING`."""
    return isinstance(expression, Ask) and expression.name.lower() in MEASURING


_MAKINGS = Makings(measures=_is_measuring)


def _gifts(form: LoweredRapid) -> Iterator[Gift]:
    """What the lines of a program give, and what searches and text that is not understood may."""
    yield from _MAKINGS.gifts(form.all)
    for routine in form.all:
        for line in routine.lines:
            match line:
                case Unread() if not MEASURING.isdisjoint(word.text.lower() for word in line.words):
                    given = [returned(routine), *(ref.key for ref in line.names + line.changes)]
                case MoveInstruction(finds=Ref() as found):
                    given = [found.key]
                case _:
                    given = []
            yield from (Gift(routine, line, key, frozenset({MEASURED})) for key in given)
