"""What the data lists of a KRL program state: points, frames, parameter sets and numbers."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

from taskcal.programs.krl.lexer import bit_string
from taskcal.programs.krl.syntax import Aggregate, Assignment, Begin, Declaration, Declared, Operand, Statement
from taskcal.programs.source import Place, Source


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


def stated(file: File) -> Iterator[Datum]:
    """Variables to which a data list gives an aggregate."""
    if not file.holds_data:
        return
    declared_shared: set[str] = set()
    for line in file.statements:
        if isinstance(line, Declaration):
            for variable in line.variables:
                if line.shared:
                    declared_shared.add(variable.name)
                aggregate = aggregate_of(variable.value)
                if aggregate is not None:
                    yield _datum(file, line, variable, aggregate)
        elif isinstance(line, Assignment):
            aggregate = aggregate_of(line.value)
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


def aggregate_of(value: Operand | None) -> Aggregate | None:
    """The structure that a value is; None where it is none, or a product."""
    if value is None or len(value.parts) != 1:
        return None
    part = value.parts[0]
    return part if isinstance(part, Aggregate) else None


def number_texts(line: Statement, file: File) -> Iterator[tuple[str, str, bool]]:
    """Names with the text of their values, as a line of a data list states them, and whether it shares them."""
    match line:
        case Declaration():
            for variable in line.variables:
                if variable.value is not None and aggregate_of(variable.value) is None:
                    yield variable.name, file.source.text[variable.value.start : variable.value.end], line.shared
        case Assignment():
            yield line.name, line.text, False
        case _:
            pass


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
