"""Data lists: the points, frames and parameter sets that a KRL program names."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite, nan
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robot_programs.core import se3
from robot_programs.core.errors import InputError, shown
from robot_programs.core.program import Frame, Motion, Unresolved, angled_pose, pose_numbers, rotations
from robot_programs.core.source import Place, Source, TextEdit, renumbered
from robot_programs.krl.syntax import (
    Aggregate,
    Assignment,
    Begin,
    Beside,
    Call,
    Control,
    Declaration,
    End,
    Operand,
    Reference,
    Statement,
    bit_string,
    given_by_value,
    lines_of_words,
    parse,
    passed_in,
)

# What the data lists of a KRL program state: points, frames, parameter sets and numbers.


Text = tuple[int, int]
"""A line of the program, by number of the file and first character."""


@dataclass(frozen=True, eq=False, kw_only=True)
class File:
    """A file of a program."""

    number: int
    """Its place among the program's files."""
    source: Source
    statements: tuple[Statement, ...]
    read: frozenset[str] = frozenset()
    """Names of variables, and others, that its lines read."""

    @classmethod
    def of(cls, number: int, source: Source) -> "File":
        """The statements of a text."""
        read = set[str]()
        statements = tuple(parse(source.text, read))
        return cls(number=number, source=source, statements=statements, read=frozenset(read))

    @cached_property
    def module(self) -> str:
        """Name of the program to which it belongs: ``.src`` and ``.dat`` of one name are one module."""
        return self.source.path.stem.upper()

    @property
    def holds_data(self) -> bool:
        """Whether it is a data list."""
        return self.source.path.suffix.lower() == ".dat"

    @property
    def submits(self) -> bool:
        """Whether its routines run in the submit interpreter."""
        return self.source.path.suffix.lower() == ".sub"

    @property
    def heads(self) -> tuple[Begin, ...]:
        """The lines that begin its routines or data lists."""
        return tuple(line for line in self.statements if isinstance(line, Begin))

    @cached_property
    def serves_all(self) -> bool:
        """Whether it is a data list of the system, which every program sees."""
        return any(line.name.startswith("$") for line in self.heads)

    @cached_property
    def mentions(self) -> dict[str, list[int]]:
        """First characters at which each name stands in its text, in capitals."""
        out: dict[str, list[int]] = defaultdict(list)
        for words in lines_of_words(self.source.text):
            for word in words:
                if word.kind == "name":
                    out[word.upper].append(word.start)
        return out

    @cached_property
    def sections(self) -> tuple["Routine", ...]:
        """Its routines, or data lists, and the lines outside of any."""
        out: list[Routine] = []
        start, head = 0, None
        for i, line in enumerate((*self.statements, None)):
            if line is None or isinstance(line, Begin | End):
                out.append(Routine(file=self, head=head, lines=self.statements[start:i]))
                start, head = i + 1, line if isinstance(line, Begin) else None
        return tuple(out)


@dataclass(frozen=True, eq=False, kw_only=True)
class Routine:
    """A routine, local or global; or a data list, or lines outside of any."""

    file: File
    head: Begin | None
    """The line that begins it; None of lines outside of any."""
    lines: tuple[Statement, ...]
    """Those inside."""

    @property
    def name(self) -> str:
        """In capitals; empty of lines outside of any."""
        return "" if self.head is None else self.head.name

    @property
    def parameters(self) -> tuple[str, ...]:
        """In capitals."""
        return () if self.head is None else self.head.parameters

    @property
    def prefix(self) -> str:
        """Prefix of the keys of its own variables."""
        return f"{self.name}@{self.file.number}:"

    @cached_property
    def declared(self) -> frozenset[str]:
        """Variables that it declares."""
        return frozenset(v.name for line in self.lines if isinstance(line, Declaration) for v in line.variables)

    @cached_property
    def own(self) -> frozenset[str]:
        """Variables that no other knows: its parameters and those that it declares."""
        return self.declared.union(self.parameters)


@dataclass(frozen=True, eq=False, kw_only=True)
class Datum:
    """A variable with the value that its data list states."""

    file: File
    name: str
    """In capitals, with its index."""
    value: Aggregate | float | bool
    shared: bool
    """Other programs may use it, too."""
    declaration: Declaration | None
    """None for an element of an array, which has no declaration of its own."""
    start: int
    """First character of its name."""
    beside: Set[int] = frozenset()
    """First characters at which a routine declares arrays of its own, and sets elements of this one."""

    @property
    def aggregate(self) -> Aggregate:
        """Value of a variable that is a structure."""
        assert isinstance(self.value, Aggregate)
        return self.value

    @property
    def place(self) -> Place:
        """Place of its declaration."""
        return self.file.source.place(self.start)


def stated(file: File) -> Iterator[Datum]:
    """Variables to which a data list gives a structure, a number or a truth value."""
    shared: set[str] = set()
    for line in file.statements if file.holds_data else ():
        match line:
            case Declaration():
                shared.update(v.name for v in line.variables if line.shared)
                text = file.source.text
                own = [
                    (v.name, v.value, v.start, line, text[v.value.start : v.value.end])
                    for v in line.variables
                    if v.value is not None
                ]
            case Assignment():
                own = [(line.name, line.value, line.start, None, line.text)]
            case _:
                continue
        for name, operand, start, declaration, text in own:
            value = aggregate_of(operand) or plain_value(text)
            if value is not None:
                # of an array that others may use, only structures are taken for theirs
                for_all = name.partition("[")[0] in shared and (declaration is not None or isinstance(value, Aggregate))
                yield Datum(
                    file=file,
                    name=name,
                    value=value,
                    shared=file.serves_all or for_all,
                    declaration=declaration,
                    start=start,
                )


def set_once(routine: Routine) -> Iterator[Datum]:
    """Elements of a routine's own arrays whose lines set each of them once, to a structure of numbers."""
    lines = defaultdict[str, list[Assignment]](list)
    for line in routine.lines:
        if isinstance(line, Assignment) and line.index is not None and line.variable in routine.declared:
            lines[line.variable].append(line)
    declared = {v.start for line in routine.lines if isinstance(line, Declaration) for v in line.variables}
    for own in lines.values():
        values = {line.name: value for line in own if (value := aggregate_of(line.value)) is not None}
        known = all(word.text == "," or word.text.isdecimal() for line in own for word in line.index or ())
        if not known or len(values) < len(own):
            continue
        for line in own:
            yield Datum(
                file=routine.file, name=line.name, value=values[line.name], shared=False, declaration=None,
                start=line.start, beside=declared.union(one.start for one in own),
            )  # fmt: skip


GIVEN = Path("given.dat")
"""In place of a data list whose values are stated beside the files."""


def given_data(number: int, values: Mapping[str, str]) -> File:
    """A data list of the system with values that no file states; those with a type are declared, too.

    Args:
        number: of the file.
        values: by name, with its index where it is an element.

    Raises:
        InputError: one is no value.
    """
    lines = ["DEFDAT $GIVEN"]
    for name, value in values.items():
        own = File.of(number, Source.of(GIVEN, f"DEFDAT $GIVEN\n{name}={value}\nENDDAT\n".encode()))
        if [datum.name for datum in stated(own)] != ["".join(name.upper().split())] or len(own.statements) != 3:
            raise InputError(
                f"'{shown(value)}' is no value for {shown(name)}; give a structure such as "
                "{E6POS: X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 35}, or a number"
            )
        (datum,) = stated(own)
        type_ = datum.value.type if isinstance(datum.value, Aggregate) else ""
        lines += [f"DECL {type_} {name}"] if type_ else []
        lines.append(f"{name}={value}")
    return File.of(number, Source.of(GIVEN, "\n".join([*lines, "ENDDAT", ""]).encode()))


def aggregate_of(value: Operand | None) -> Aggregate | None:
    """The structure that a value is; None where it is none, or a product."""
    if value is None or len(value.parts) != 1:
        return None
    part = value.parts[0]
    return part if isinstance(part, Aggregate) else None


def plain_value(text: str) -> float | bool | None:
    """The number or truth value that a text is; None where it is neither."""
    text = text.strip().upper()
    if text in ("TRUE", "FALSE"):
        return text == "TRUE"
    try:
        value = float(text)
    except ValueError:
        return bit_string(text)
    return value if isfinite(value) else None


# Positions in KRL: X Y Z in millimetres, A B C or A1 … A6 in degrees, S and T; from text to numbers and back.

POSE = ("X", "Y", "Z", "A", "B", "C")
AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
EXTERNAL = ("E1", "E2", "E3", "E4", "E5", "E6")

# KRL's REAL is a 32-bit float: nine digits in all, so 0.1 µm within metres and 1e-6° within a turn.
DECIMALS = {**dict.fromkeys("XYZ", 5), **dict.fromkeys("ABC", 6), **dict.fromkeys((*AXES, *EXTERNAL), 6)}


def has_pose(aggregate: Aggregate) -> bool:
    """Whether any component of a pose is stated."""
    return any(component.name in POSE for component in aggregate.fields)


def has_axes(aggregate: Aggregate) -> bool:
    """Whether any axis is stated."""
    return any(component.name in AXES for component in aggregate.fields)


def pose(aggregate: Aggregate, *, needed: tuple[str, ...] = POSE) -> Float[np.ndarray, "4 4"]:
    """The pose that a complete position states, metres.

    Raises:
        Unresolved: a needed component is missing or no number.
    """
    return angled_pose(*(_stated(aggregate, name, needed) for name in POSE))


def literal_poses(rows: Float[np.ndarray, "n 6"], like: Motion) -> Float[np.ndarray, "n 4 4"] | None:
    """The poses of X Y Z A B C; see `LiteralForm.poses`."""
    return se3.pose(rotations(rows[:, 3:]), rows[:, :3] * 1e-3) if np.isfinite(rows).all() else None


def rotation_stated(aggregate: Aggregate) -> bool:
    """Whether the angles are stated.

    Raises:
        Unresolved: some are, and others not.
    """
    stated = [name for name in "ABC" if aggregate.field(name)]
    if len(stated) in (1, 2):
        raise Unresolved(f"of its angles it states {' and '.join(stated)} only")
    return bool(stated)


def axes(aggregate: Aggregate, *, needed: tuple[str, ...] = AXES) -> Float[np.ndarray, " joints"]:
    """The joint positions that a complete axis position states, radians; zero for what is neither stated nor needed.

    Raises:
        Unresolved: a needed axis is missing or no number.
    """
    return np.radians([_stated(aggregate, name, needed) for name in AXES])


def _stated(aggregate: Aggregate, name: str, needed: tuple[str, ...]) -> float:
    component = aggregate.field(name)
    if component is None and name not in needed:
        return 0.0
    if component is None:
        raise Unresolved(f"{name} is not stated, so it keeps its value of before")
    if component.value is None:
        raise Unresolved(f"{name} is '{component.text}', which is not a number")
    return component.value


def whole(aggregate: Aggregate, name: str) -> int | None:
    """The whole number of 31 bits in a component; None where there is none."""
    value = aggregate.value(name)
    return int(value) if value is not None and 0 <= value < 2**31 and value == int(value) else None


def external(aggregate: Aggregate) -> tuple[float, ...]:
    """Positions of the external axes, millimetres or degrees; NaN where none is stated.

    Raises:
        Unresolved: one is not a number.
    """
    out: list[float] = []
    for name in EXTERNAL:
        axis = aggregate.field(name)
        if axis is not None and axis.value is None:
            raise Unresolved(f"{name} is '{axis.text}', which is not a number")
        out.append(nan if axis is None or axis.value is None else axis.value)
    return tuple(out)


def pose_values(T: Float[np.ndarray, "4 4"], near: Aggregate | None = None) -> dict[str, float]:
    """Values of X Y Z A B C of a pose, millimetres and degrees; angles near those of a position."""
    old = tuple((near.value(name) if near else None) or 0.0 for name in "ABC")
    return dict(zip(POSE, pose_numbers(T, (old[0], old[1], old[2])), strict=True))


def axis_values(q: Float[np.ndarray, " joints"]) -> dict[str, float]:
    """Values of A1 … of joint positions, degrees."""
    return dict(zip(AXES, np.degrees(q).tolist(), strict=False))


def _field_text(name: str, text: str, was: float, value: float) -> str:
    """A component's text with a value: as it is where that is its value already, to the digits that KRL holds."""
    if name in ("S", "T"):
        return text if was == value else _integer(text, int(value))
    return renumbered(text, was, value, DECIMALS[name])


def _integer(old: str, value: int) -> str:
    base = {"'B": "b", "'H": "X"}.get(old[:2].upper())
    return str(value) if base is None else f"{old[:2]}{value:0{len(old) - 3}{base}}'"


def edits_for(aggregate: Aggregate, values: Mapping[str, float]) -> list[TextEdit]:
    """The edits that give a position's components other values; those without a number of their own stay as they are."""
    out: list[TextEdit] = []
    for stated in aggregate.fields:
        if stated.name in values and stated.value is not None:
            text = _field_text(stated.name, stated.text, stated.value, values[stated.name])
            if text != stated.text:
                blank = " " if stated.touches else ""
                out.append(TextEdit(start=stated.start, end=stated.end, text=blank + text))
    return out


BUILT_IN = "BAS"
"""KUKA's own routine for motion parameters, and its module: what it does is known, whether or not its text is passed."""

TABLES = ("TOOL_DATA", "BASE_DATA")
"""The controller's tools and bases."""

READ = frozenset({*POSE, *AXES, *EXTERNAL, "S", "T", "TOOL_NO", "BASE_NO", "IPO_FRAME"})
"""Components of points, frames and parameter sets that matter for where the robot goes."""


class NotInFiles(Unresolved):
    """A variable that no data list states, and that nothing in the files changes."""

    SAYS = "is not in the files given"

    @classmethod
    def is_said(cls, reason: str) -> bool:
        """Whether a reason is this one."""
        return cls.SAYS in reason


@dataclass(frozen=True, eq=False, kw_only=True)
class Data:
    """Data lists of a program, and what its code changes of them."""

    files: tuple[File, ...]
    given: Mapping[str, Frame] = field(default_factory=dict[str, Frame])
    """By name in capitals: tools and bases that no data list states, given beside the files."""
    roots: Mapping[str, frozenset[str]] = field(default_factory=dict[str, frozenset[str]])
    """By name of a routine: the routines that nothing calls, from which it is reached."""
    elements: Mapping[tuple[int, int], frozenset[str]] = field(default_factory=dict[tuple[int, int], frozenset[str]])
    """By file and first character of an assignment by a computed index: the elements that it sets, where that is known."""
    refused: set[str] = field(default_factory=set[str])
    """Variables that were asked for in vain, because code changes them."""
    taken: dict[str, set[str]] = field(default_factory=lambda: defaultdict[str, set[str]](set))
    """By name of what is stated beside the files: the programs that take it."""
    set_elsewhere: dict[str, Place] = field(default_factory=dict[str, Place])
    """Tools and bases that were taken as the data list states them, and where a program of its own changes them."""

    @cached_property
    def _own(self) -> dict[tuple[str, str, bool], Datum]:
        """By module and name, apart for structures and for numbers and truth values."""
        return {
            (file.module, datum.name, isinstance(datum.value, Aggregate)): datum
            for file in self.files
            for datum in stated(file)
        }

    @cached_property
    def _shared(self) -> dict[tuple[str, bool], Datum]:
        return {(name, structure): datum for (_, name, structure), datum in self._own.items() if datum.shared}

    def _meant(self, name: str, module: str, routine: str, *, structure: bool) -> Datum | None:
        """What a name means in a routine, as data lists state it; None where they do not."""
        if (module, routine, name.partition("[")[0]) in self._local:
            return None
        datum = self._own.get((module, name, structure), self._shared.get((name, structure)))
        if datum is not None and datum.file.source.path == GIVEN:
            self.taken[name].add(module)
        return datum

    @cached_property
    def _local(self) -> set[tuple[str, str, str]]:
        """By module and routine: variables that a routine declares for itself, and what it is given; no other knows them."""
        return {
            (file.module, routine.name, name)
            for file in self.files
            if not file.holds_data
            for routine in file.sections
            for name in routine.own
        }

    @cached_property
    def set_once(self) -> Mapping[tuple[Routine, str], Datum]:
        """Elements of arrays that routines set once, by routine and name."""
        routines = (routine for file in self.files if not file.holds_data for routine in file.sections)
        return {(routine, datum.name): datum for routine in routines for datum in set_once(routine)}

    @cached_property
    def always(self) -> frozenset[str]:
        """Routines of the submit interpreter, which runs beside every program."""
        return frozenset(line.name for file in self.files if file.submits for line in file.heads)

    @cached_property
    def by_value(self) -> Mapping[str, tuple[bool, ...]]:
        """By name of a routine: which of its parameters are given by value."""
        return given_by_value(line for file in self.files for line in file.statements)

    @cached_property
    def _changed(self) -> dict[str, list[tuple[str, str, Place]]]:
        """By variable or element: module and routine in which code assigns it or hands it to a routine, and where."""
        out: dict[str, list[tuple[str, str, Place]]] = {}
        for file in self.files:
            if file.holds_data or file.module == BUILT_IN:
                continue
            for routine, line in ((one, line) for one in file.sections for line in one.lines):
                names = _changed_by(line, self.by_value)
                if isinstance(line, Assignment) and (file.number, line.start) in self.elements:
                    names = (*self.elements[file.number, line.start], *passed_in(line, self.by_value))
                for name in names:
                    if name.partition("[")[0] not in routine.own:
                        place = file.source.place(line.start)
                        out.setdefault(name, []).append((file.module, routine.name, place))
        return out

    @cached_property
    def whole_numbers(self) -> frozenset[str]:
        """Variables that a data list or a routine declares as INT."""
        return self._declared_as("INT")

    @cached_property
    def real_numbers(self) -> frozenset[str]:
        """Variables that data lists and routines declare as REAL, and none as INT."""
        return self._declared_as("REAL") - self.whole_numbers

    def _declared_as(self, type_: str) -> frozenset[str]:
        lines = (line for file in self.files for line in file.statements if isinstance(line, Declaration))
        return frozenset(variable.name for line in lines if line.type == type_ for variable in line.variables)

    @cached_property
    def listed(self) -> Mapping[str, frozenset[str]]:
        """By module: variables of its own data list, of which other programs know nothing."""
        out: dict[str, set[str]] = {}
        for file in self.files:
            for line in file.statements if file.holds_data and not file.serves_all else ():
                if isinstance(line, Declaration) and not line.shared:
                    out.setdefault(file.module, set()).update(variable.name for variable in line.variables)
        return {module: frozenset(names) for module, names in out.items()}

    @cached_property
    def _for_all(self) -> frozenset[str]:
        """Variables of data lists that all programs know, with a value or without."""
        files = (file for file in self.files if file.holds_data)
        lines = ((file, line) for file in files for line in file.statements if isinstance(line, Declaration))
        return frozenset(v.name for file, line in lines if line.shared or file.serves_all for v in line.variables)

    def number(self, name: str, module: str, routine: str = "") -> float | bool | None:
        """The number or truth value that a data list states for a variable, if no line of code ever changes it."""
        datum = self._meant(name, module, routine, structure=False)
        if datum is None or self._changed.keys() & {name, name.partition("[")[0]}:
            return None
        assert not isinstance(datum.value, Aggregate)
        return datum.value

    @cached_property
    def initial_frames(self) -> tuple[float | None, float | None]:
        """Numbers of the tool and the base that BAS(#INITMOV) sets, by the bas.src of the files; None where it does not say."""
        tool: float | None = None
        base: float | None = None
        files = (file for file in self.files if file.module == BUILT_IN and not file.holds_data)
        routines = (routine for file in files for routine in file.sections if routine.name == "INITMOV")
        for line in (line for routine in routines for line in routine.lines):
            match line:
                case Assignment(name="$TOOL", value=Operand(parts=(Reference(name=name),))) if name.startswith(
                    "TOOL_DATA["
                ):
                    tool = _as_number(name[len("TOOL_DATA[") : -1])
                case Call(name="TOOL", arguments=((word,),)):
                    tool = _as_number(word.text)
                case Call(name="BASE", arguments=((word,),)):
                    base = _as_number(word.text)
                case _:
                    pass
        return tool, base

    @cached_property
    def robroot(self) -> Float[np.ndarray, "4 4"] | None:
        """Pose of the robot in the world: $ROBROOT of $machine.dat, or as code sets it once; None where neither says it.

        Raises:
            Unresolved: code sets it in several ways, or to something that is no frame.
        """
        if "$ROBROOT" not in self._changed:
            stated = self._shared.get(("$ROBROOT", True))
            return None if stated is None else pose(stated.aggregate)
        lines = [
            line
            for file in self.files
            for line in file.statements
            if not file.holds_data and isinstance(line, Assignment) and line.variable == "$ROBROOT"
        ]
        aggregate = aggregate_of(lines[0].value) if len(lines) == 1 and lines[0].name == "$ROBROOT" else None
        if aggregate is None:
            raise Unresolved(f"$ROBROOT is changed by the program, at {self._changed['$ROBROOT'][0][2]}")
        return pose(aggregate)

    def find(self, name: str, module: str, routine: str = "") -> Datum:
        """The variable that a name means in a module, or in one of its routines.

        Raises:
            Unresolved: no data list states it, or the program changes it.
        """
        variable = name.partition("[")[0]
        datum = self._meant(name, module, routine, structure=True)
        elements = dict.fromkeys((name, variable))  # in one order, so that one place is named each time
        for where, changing, place in (change for element in elements for change in self._changed.get(element, [])):
            if datum is not None and variable in TABLES and self.apart(routine, changing):
                self.set_elsewhere.setdefault(name, place)
            elif where == module or (datum is not None and datum.shared):
                self.refused.add(variable)
                raise Unresolved(f"{name} is changed by the program, at {place}")
        if datum is None and (module, routine, variable) in self._local:
            raise Unresolved(f"{name} is a variable of the program's own, whose value is known only at run time")
        declared = self.listed.get(module, frozenset()) | self._for_all
        if datum is None and variable not in TABLES and variable in declared:
            raise Unresolved(f"{name} has no value in its data list, so that it is known only at run time")
        if datum is None and variable.startswith("$"):
            raise Unresolved(f"{name} is known only at run time")
        if datum is None:
            files = "$config.dat" if variable in TABLES else "the .dat that states it"
            raise NotInFiles(f"{name} {NotInFiles.SAYS}; pass {files}")
        return datum

    def apart(self, routine: str, other: str) -> bool:
        """Whether no run of the program comes through both of two routines."""
        roots, others = self.roots.get(routine, frozenset()), self.roots.get(other, frozenset())
        return bool(roots) and bool(others) and not roots & others and not others & self.always


def _changed_by(line: Statement, by_value: Mapping[str, tuple[bool, ...]]) -> tuple[str, ...]:
    """Variables and elements that a line assigns or hands to a routine."""
    match line:
        case Assignment():
            return (*_element(line), *passed_in(line, by_value))
        case Beside(action=action) if action is not None:
            return _changed_by(action, by_value)
        case Control(keyword="FOR") if line.words:
            return (line.words[0].upper, *passed_in(line, by_value))
        case Call(name="BAS"):
            return ()
        case _:
            return passed_in(line, by_value)


def _as_number(text: str) -> float | None:
    value = plain_value(text)
    return value if isinstance(value, float) else None


def _element(line: Assignment) -> tuple[str, ...]:
    """Names that an assignment changes: an element, or all of a variable; none where no motion reads that component."""
    name, bracket, rest = line.name.partition("[")
    index, _, behind = rest.partition("]")
    component = (behind if bracket else name).rpartition(".")[2] if "." in line.name else ""
    if component and component not in READ:
        return ()
    return (f"{name}[{index}]" if bracket and index.isdecimal() else line.variable,)
