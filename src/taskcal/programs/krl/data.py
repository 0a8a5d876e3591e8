"""Data lists: the points, frames and parameter sets that a KRL program names."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from taskcal.programs.krl.position import AXES, EXTERNAL, POSE, pose
from taskcal.programs.krl.syntax import (
    Aggregate,
    Assignment,
    Begin,
    Call,
    Declaration,
    Declared,
    End,
    Operand,
    Statement,
)
from taskcal.programs.source import Place, Source
from taskcal.programs.unresolved import Unresolved

BUILT_IN = "BAS"
"""KUKA's own routine for motion parameters, and its module: what it does is known, whether or not its text is passed."""

READ = frozenset({*POSE, *AXES, *EXTERNAL, "S", "T", "TOOL_NO", "BASE_NO", "IPO_FRAME"})
"""Components of points, frames and parameter sets that matter for where the robot goes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class File:
    """A file of a program."""

    number: int
    """Its place among the program's files."""
    source: Source
    statements: tuple[Statement, ...]

    @property
    def module(self) -> str:
        """Name of the program to which it belongs: ``.src`` and ``.dat`` of one name are one module."""
        return self.source.path.stem.upper()

    @property
    def holds_data(self) -> bool:
        """Whether it is a data list."""
        return self.source.path.suffix.lower() == ".dat"

    @cached_property
    def serves_all(self) -> bool:
        """Whether it is a data list of the system, which every program sees."""
        return any(isinstance(line, Begin) and line.name.startswith("$") for line in self.statements)


@dataclass(frozen=True, eq=False, kw_only=True)
class Datum:
    """A variable with the value that its data list states."""

    file: File
    name: str
    """In capitals, with its index."""
    aggregate: Aggregate
    shared: bool
    """Other programs may use it, too."""
    declaration: Declaration | None
    """None for an element of an array, which has no declaration of its own."""
    start: int
    """First character of its name."""

    @property
    def place(self) -> Place:
        """Where it stands."""
        return self.file.source.place(self.start)


@dataclass(frozen=True, eq=False, kw_only=True)
class Data:
    """What the data lists of a program say, and what its code changes of it."""

    files: tuple[File, ...]

    @cached_property
    def _own(self) -> dict[tuple[str, str], Datum]:
        return {(datum.file.module, datum.name): datum for file in self.files for datum in _stated(file)}

    @cached_property
    def _shared(self) -> dict[str, Datum]:
        return {datum.name: datum for datum in self._own.values() if datum.shared}

    @cached_property
    def _local(self) -> set[tuple[str, str]]:
        """Variables that a routine declares for itself, and what it is given."""
        out: set[tuple[str, str]] = set()
        for file in self.files:
            for line in file.statements if not file.holds_data else ():
                match line:
                    case Declaration():
                        out |= {(file.module, variable.name) for variable in line.variables}
                    case Begin():
                        out |= {(file.module, name) for name in line.parameters}
                    case _:
                        pass
        return out

    @cached_property
    def _changed(self) -> dict[str, list[tuple[str, Place]]]:
        """By variable or element: the modules in which code assigns it or hands it to a routine, and where."""
        out: dict[str, list[tuple[str, Place]]] = {}
        for file in self.files:
            if file.holds_data or file.module == BUILT_IN:
                continue
            for line, own in _lines_with_own_names(file):
                names: tuple[str, ...] = ()
                if isinstance(line, Assignment):
                    names = (*_element(line), *line.changed)
                elif isinstance(line, Call) and line.name != BUILT_IN:
                    names = line.changed
                for name in names:
                    if name.partition("[")[0] not in own:
                        out.setdefault(name, []).append((file.module, file.source.place(line.start)))
        return out

    @cached_property
    def robroot(self) -> Float[np.ndarray, "4 4"] | None:
        """Where the robot stands in the world: $ROBROOT of $machine.dat, or as code sets it once; None where neither says it.

        Raises:
            Unresolved: code sets it in several ways, or to something that is no frame.
        """
        if "$ROBROOT" not in self._changed:
            return pose(self._shared["$ROBROOT"].aggregate) if "$ROBROOT" in self._shared else None
        lines = [
            line
            for file in self.files
            for line in file.statements
            if not file.holds_data and isinstance(line, Assignment) and line.variable == "$ROBROOT"
        ]
        aggregate = _aggregate(lines[0].value) if len(lines) == 1 and lines[0].name == "$ROBROOT" else None
        if aggregate is None:
            raise Unresolved(f"$ROBROOT is changed by the program, at {self._changed['$ROBROOT'][0][1]}")
        return pose(aggregate)

    def find(self, name: str, module: str) -> Datum:
        """The variable that a name means in a module.

        Raises:
            Unresolved: no data list states it, or the program changes it.
        """
        variable = name.partition("[")[0]
        datum = None if (module, variable) in self._local else self._own.get((module, name), self._shared.get(name))
        elements = {name, variable}
        for where, place in (change for element in elements for change in self._changed.get(element, [])):
            if where == module or (datum is not None and datum.shared):
                raise Unresolved(f"{name} is changed by the program, at {place}")
        if datum is None and (module, variable) in self._local:
            raise Unresolved(f"{name} is a variable of the program's own, whose value is known only at run time")
        if datum is None:
            files = "$config.dat" if variable in ("TOOL_DATA", "BASE_DATA") else "the .dat that states it"
            hint = "" if variable.startswith("$") else f"; pass {files}"
            raise Unresolved(f"{name} is not in the files given{hint}")
        return datum


def _element(line: Assignment) -> tuple[str, ...]:
    """What an assignment changes: one element of an array, or all of a variable; nothing where no motion reads that component."""
    name, bracket, rest = line.name.partition("[")
    index, _, behind = rest.partition("]")
    component = (behind if bracket else name).rpartition(".")[2] if "." in line.name else ""
    if component and component not in READ:
        return ()
    return (f"{name}[{index}]" if bracket and index.isdecimal() else line.variable,)


def _lines_with_own_names(file: File) -> Iterator[tuple[Statement, frozenset[str]]]:
    """Lines of a program, with the names that their routine declares for itself: its parameters and its variables."""
    start = 0
    for i, line in enumerate((*file.statements, None)):
        if line is not None and not isinstance(line, Begin | End):
            continue
        body = file.statements[start:i]
        head = file.statements[start - 1] if start else None
        own = set(head.parameters) if isinstance(head, Begin) else set[str]()
        own |= {v.name for at in body if isinstance(at, Declaration) for v in at.variables}
        for at in body:
            yield at, frozenset(own)
        start = i + 1


def _stated(file: File) -> Iterator[Datum]:
    """Variables to which a data list gives an aggregate."""
    if not file.holds_data:
        return
    declared_shared: set[str] = set()
    for line in file.statements:
        if isinstance(line, Declaration):
            for variable in line.variables:
                if line.shared:
                    declared_shared.add(variable.name)
                aggregate = _aggregate(variable.value)
                if aggregate is not None:
                    yield _datum(file, line, variable, aggregate)
        elif isinstance(line, Assignment):
            aggregate = _aggregate(line.value)
            if aggregate is not None:
                yield Datum(
                    file=file,
                    name=line.name,
                    aggregate=aggregate,
                    shared=file.serves_all or line.variable in declared_shared,
                    declaration=None,
                    start=line.start,
                )


def _datum(file: File, line: Declaration, variable: Declared, aggregate: Aggregate) -> Datum:
    return Datum(
        file=file,
        name=variable.name,
        aggregate=aggregate,
        shared=file.serves_all or line.shared,
        declaration=line,
        start=variable.start,
    )


def _aggregate(value: Operand | None) -> Aggregate | None:
    if value is None or len(value.parts) != 1:
        return None
    part = value.parts[0]
    return part if isinstance(part, Aggregate) else None
