"""Points that only the running program knows, put through a function: which may be, and where they stand."""

import re
from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from robot_programs.core.program import Unresolved, Wrapped
from robot_programs.core.source import TextEdit
from robot_programs.krl.data import BUILT_IN, POSE, Data, File, Routine, Text
from robot_programs.krl.routines import callers_of, roots_of, routines_of
from robot_programs.krl.syntax import (
    RELATIVE_MOTIONS,
    Aggregate,
    Assignment,
    Call,
    Control,
    Declaration,
    MotionLine,
    Operand,
    Reference,
    Statement,
    Word,
    whole_call,
)
from robot_programs.krl.values import HERE, Names

MOTIONS = ("PTP", "LIN", "CIRC", "SPTP", "SLIN", "SCIRC")
"""Those to points, of which a function makes others."""

OF_PATH, OF_FRAME, OF_HERE, OF_ARC = "Path", "Frame", "Here", "Arc"

ENDINGS = ("", OF_PATH, OF_FRAME)
"""Of the names of three functions: of an E6POS of a PTP; of one of a line or arc, which keeps the status before; of a FRAME. Two
others give where the tool truly is, of which motions by a distance begin (`OF_HERE`), and the point at an angle on the circle from
there through two points (`OF_ARC`)."""

FRAMES = frozenset({"$NULLFRAME", "$WORLD", "$ROBROOT", "$BASE", "$TOOL", "BASE_DATA", "TOOL_DATA"})
"""Variables of the controller's that are frames, arrays without their index."""

HELD = ("$BASE", "$TOOL", "BASE_DATA", "TOOL_DATA")
"""Those that motions are counted in."""

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


def wrap(files: Sequence[File], motions: Container[Text], function: str, without: Container[str]) -> Iterator[Wrapped]:
    """Some motions, each with the edits that put a function around its points.

    Args:
        files: of the program.
        motions: places of motions.
        function: name of a function of an E6POS whose status and turn count; the names of two others begin with it, see `ENDINGS`.
        without: names of tools and bases, in lower case, one of which the program may have active.
    """
    data = Data(files=tuple(files), roots=roots_of(callers_of(routines_of(tuple(files)))))
    measured = _Measured.of(files, data)
    elsewhere: dict[Text, Wrapped] = {}
    own = [file for file in files if file.module != BUILT_IN]
    named = {name for file in own for name in file.mentions}
    coupled = (match[0] for file in own if (match := _COUPLED.search(file.source.text)))
    carried = next(iter(sorted(named & CARRIED)), "") or next(coupled, "")
    for file in files:
        for routine in file.sections:
            for line in routine.lines:
                if isinstance(line, MotionLine) and (file.number, line.start) in motions:
                    edits, obstacle = tuple[TextEdit, ...](), ""
                    try:
                        if carried:
                            raise Unresolved(f"a base may be moved ({carried})")
                        if without:
                            raise Unresolved("a tool or base was measured, and it is not known which is active")
                        elsewhere |= measured.elsewhere(routine)
                        _expect_points(line, routine, measured, named)
                        if line.keyword in RELATIVE_MOTIONS:
                            edits = tuple(_from_here(line, routine, function))
                        elif line.angle:
                            edits = tuple(_to_angle(line, routine, files, function))
                        else:
                            edits = tuple(_around(one, line, routine, files, function) for one in line.operands)
                    except Unresolved as reason:
                        obstacle = str(reason)
                    place = file.source.place(line.start)
                    yield Wrapped(place=place, name=line.keyword, edits=edits, obstacle=obstacle)
    yield from elsewhere.values()


def calls_function(line: Statement, function: str) -> bool:
    """Whether a function stands around a point of a motion."""
    names = {f"{function}{ending}".upper() for ending in ENDINGS}
    return isinstance(line, MotionLine) and any(word.upper in names for word in line.words)


def _expect_points(line: MotionLine, routine: Routine, measured: "_Measured", named: Container[str]) -> None:
    """See that a motion goes to points of which a function can make others.

    Raises:
        Unresolved: it does not.
    """
    relative = line.keyword in RELATIVE_MOTIONS
    if line.keyword not in (*MOTIONS, *RELATIVE_MOTIONS) or line.trouble or (relative and line.angle):
        raise Unresolved("it does not go to points that it names")
    if line.keyword.startswith("S") and "SPLINE" in named:
        raise Unresolved("it may be part of a SPLINE")
    if any(name.startswith(("$TOOL", "$BASE", "$IPO_MODE", "$LOAD")) for name in line.settings):
        raise Unresolved("it sets tool or base for itself, which the function does not see")
    # a distance is the same in whatever base: only the way along its axes counts
    for name in (*(name for operand in line.operands for name in _names(line, operand)), *(() if relative else HELD)):
        if measured.says(measured.names(routine).key(name), routine):
            raise Unresolved(f"'{name}' comes from where the robot stood, which is true already")


def _names(line: MotionLine, operand: Operand) -> Iterator[str]:
    """Names of which a point is made, without those of components and indices."""
    yield from (part.name.partition("[")[0] for part in operand.parts if isinstance(part, Reference))
    yield from (word.upper for word in line.words_of(operand) if word.kind == "name")
    texts = (one.text for part in operand.parts if isinstance(part, Aggregate) for one in part.fields)
    yield from (name.upper() for text in texts for name in re.findall(r"[A-Za-z_$][\w$]*", text))


def _around(operand: Operand, line: MotionLine, routine: Routine, files: Sequence[File], function: str) -> TextEdit:
    """A point with the function around it that serves its type.

    What ``:`` gives has the type of its right side, and status and turn count in PTP alone (KUKA System Software, geometric
    operator; status and turn): the product with a FRAME is one, whatever stands before it.

    Raises:
        Unresolved: it has none.
    """
    text, joint = routine.file.source.text[operand.start : operand.end], line.keyword.endswith("PTP")
    parts = operand.parts
    if [_type_of(part, routine, files) for part in parts] == ["E6POS"] and isinstance(parts[0], Reference):
        return TextEdit(start=operand.start, end=operand.end, text=f"{function}{'' if joint else OF_PATH}({text})")
    frame = _as_frame(operand, line, routine, files)
    return TextEdit(start=operand.start, end=operand.end, text=f"{function}{OF_FRAME}({frame})")


def _as_frame(operand: Operand, line: MotionLine, routine: Routine, files: Sequence[File]) -> str:
    """A point as an expression of type FRAME.

    Raises:
        Unresolved: it may not be one; or the motion needs its status, and that is not known.
    """
    text, parts = routine.file.source.text[operand.start : operand.end], operand.parts
    joint, own = line.keyword.endswith("PTP"), [_type_of(part, routine, files) for part in parts]
    missing = [p for p in parts if isinstance(p, Aggregate) and not all(p.value(name) is not None for name in POSE)]
    if missing or (parts and isinstance(parts[0], Aggregate)) or "AXIS" in "".join(own):
        raise Unresolved("its point is no variable, and no product of variables and complete frames")
    if not parts and not _own_functions(line, operand, files):
        raise Unresolved("its point comes from a function that the files do not have")
    if joint and own[-1:] != ["FRAME"]:
        raise Unresolved(
            "its point is neither declared as E6POS nor as FRAME, whose status and turn are then not known"
        )
    return text if own == ["FRAME"] else f"{text}:$NULLFRAME"


def _to_angle(line: MotionLine, routine: Routine, files: Sequence[File], function: str) -> Iterator[TextEdit]:
    """An arc that ends at an angle as one to the point that is there.

    Raises:
        Unresolved: its points may be no frames.
    """
    text, (via, last) = routine.file.source.text, line.operands
    points = ",".join(_as_frame(one, line, routine, files) for one in line.operands)
    angle = text[line.angle[0].start : line.angle[-1].end]
    for start, end, share in ((via.start, via.end, "0.5"), (last.start, line.angle[-1].end, "1.0")):
        yield TextEdit(
            start=start, end=end, text=f"{function}{OF_FRAME}({function}{OF_ARC}({points},{share}*({angle})))"
        )


def _from_here(line: MotionLine, routine: Routine, function: str) -> Iterator[TextEdit]:
    """A motion by a distance as one to the point that is so far from where the tool truly is.

    Raises:
        Unresolved: the distance is not stated by numbers along the axes alone.
    """
    text = routine.file.source.text
    yield TextEdit(start=line.start, end=line.start + len(line.keyword), text=line.keyword.removesuffix("_REL"))
    for operand in line.operands:
        (*other, step) = operand.parts or (None,)
        if (
            other
            or not isinstance(step, Aggregate)
            or any(one.name not in "XYZ" and one.value != 0.0 for one in step.fields)
        ):
            raise Unresolved("its distance is not stated by X, Y and Z alone")
        stated = {one.name: one.text for one in step.fields if one.name in "XYZ"}
        whole = "{FRAME: " + ",".join(f"{name} {stated.get(name, 0)}" for name in POSE) + "}"
        parts = (f"{function}{OF_HERE}()", whole) if line.along == "#TOOL" else (whole, f"{function}{OF_HERE}()")
        point = f"{function}{OF_FRAME}({parts[0]}:{parts[1]})"
        yield TextEdit(
            start=operand.start, end=operand.end, text=f" {point}" if text[operand.start - 1].isalnum() else point
        )
    axes = (
        re.search(rf"\s*{line.along}\b", text[line.operands[-1].end : line.end], re.IGNORECASE) if line.along else None
    )
    if axes is not None:
        start = line.operands[-1].end + axes.start()
        yield TextEdit(start=start, end=start + len(axes[0]), text="")


def _own_functions(line: MotionLine, operand: Operand, files: Sequence[File]) -> bool:
    """Whether all functions that compute a point stand in the files, or do geometry alone."""
    words = line.words_of(operand)
    called = {word.upper for word, behind in pairwise(words) if word.kind == "name" and behind.text == "("}
    return bool(words) and called <= {head.name for file in files for head in file.heads} | {"INV_POS"}


def _type_of(part: Aggregate | Reference, routine: Routine, files: Sequence[File]) -> str:
    """Type of a part of a point; empty where it is not known."""
    if isinstance(part, Reference):
        if part.name.partition("[")[0] in FRAMES:
            return "FRAME"
        return _type(part.name, routine, files) or ("E6POS" if _of_inline_form(part.name, routine) else "")
    return part.type or ("FRAME" if all(field.name in POSE for field in part.fields) else "")


def _of_inline_form(name: str, routine: Routine) -> bool:
    """Whether a point is one of an inline form, which declares it as E6POS; home positions are axes."""
    of_point = {line.text for line in routine.lines if isinstance(line, Assignment) and line.variable == "FDAT_ACT"}
    return name.startswith("X") and f"F{name[1:]}" in of_point and not name.startswith("XHOME")


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


@dataclass(frozen=True, eq=False, kw_only=True)
class _Measured:
    """What the program's own variables have from where the robot stood."""

    data: Data
    places: dict[str, dict[Text, Routine]]
    """By key of a variable, or name of a function: the lines that give it such a value, and their routines."""
    known: dict[Routine, Names]

    @classmethod
    def of(cls, files: Sequence[File], data: Data) -> "_Measured":
        """What is so in some files."""
        own = [routine for file in files if file.module != BUILT_IN for routine in file.sections]
        out = cls(data=data, places={}, known={})
        called: dict[str, list[Routine]] = defaultdict(list)
        for routine in own:
            called[routine.name].append(routine)
        before = -1
        while before < (before := sum(map(len, out.places.values()))):
            for routine in own:
                for line in routine.lines:
                    for key in out._given_by(line, routine, called):
                        out.places.setdefault(key, {})[routine.file.number, line.start] = routine
        return out

    def names(self, routine: Routine) -> Names:
        """What names mean in a routine."""
        if routine not in self.known:
            self.known[routine] = Names.of(routine, self.data)
        return self.known[routine]

    def says(self, key: str, routine: Routine) -> bool:
        """Whether a variable has such a value in a routine.

        Tools and bases that a program of its own measures count as what the data list states, as in all motions.
        """
        others = self.places.get(key, {}).values()
        return key in MEASURING or any(key not in HELD or not self.data.apart(routine.name, o.name) for o in others)

    def elsewhere(self, routine: Routine) -> dict[Text, Wrapped]:
        """Where tools and bases are so in a program other than that of a routine."""
        why = "it is set from where the robot stood, in a program of its own; its value is taken as true"
        return {
            (number, start): Wrapped(place=other.file.source.place(start), name=key, obstacle=why)
            for key in HELD
            for (number, start), other in self.places.get(key, {}).items()
            if self.data.apart(routine.name, other.name)
        }

    def _given_by(self, line: Statement, routine: Routine, called: Mapping[str, Sequence[Routine]]) -> set[str]:
        """Keys of what a line gives such a value."""
        match line:
            case Assignment():
                call = whole_call(line.words)
                given = set[str]() if call is None else self._passed(call, routine, called)
                if self._any(line.words, routine):
                    given.add(self.names(routine).key(line.variable.partition("[")[0]))
                return given
            case Control(keyword="RETURN") if self._any(line.words, routine):
                return {routine.name}
            case Call():
                return self._passed(line, routine, called)
            case _:
                return set()

    def _passed(self, call: Call, routine: Routine, called: Mapping[str, Sequence[Routine]]) -> set[str]:
        """Keys of what a call gives such a value: parameters, and variables that are passed by reference."""
        out, modes = set[str](), self.data.by_value.get(call.name, ())
        for other in called.get(call.name, ()):
            for k, (parameter, words) in enumerate(zip(other.parameters, call.arguments, strict=False)):
                key = self.names(other).key(parameter)
                if self._any(words, routine):
                    out.add(key)
                elif key in self.places and not (k < len(modes) and modes[k]):
                    out |= _keys(words, self.names(routine))
        return out

    def _any(self, words: Iterable[Word], routine: Routine) -> bool:
        return any(self.says(key, routine) for key in _keys(words, self.names(routine)))


def _keys(words: Iterable[Word], names: Names) -> set[str]:
    """Keys of the variables of which an expression is made."""
    before = (None, *words)
    return {
        names.key(word.upper)
        for dot, word in pairwise(before)
        if word is not None and word.kind == "name" and (dot is None or dot.text != ".")
    }
