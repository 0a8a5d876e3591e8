"""From the text of a file to its modules; what cannot be understood is passed over and reported."""

from collections.abc import Callable

from taskcal.programs.rapid.expressions import NotUnderstood
from taskcal.programs.rapid.lexer import Token
from taskcal.programs.rapid.statements import HANDLERS, ROUTINE_END, STORAGE, StatementParser
from taskcal.programs.rapid.syntax import (
    Declaration,
    Module,
    Parameter,
    Problem,
    Record,
    Routine,
    Statement,
    Unparsed,
)
from taskcal.programs.rapid.words import TooMuch

MOST_ROUTINES = 100_000
"""Modules and routines of a file; a whole cell has some thousands."""


def parse(text: str) -> tuple[tuple[Module, ...], tuple[Problem, ...]]:
    """The modules of a file, and what could not be understood.

    Raises:
        TooMuch: there is more of something than in any program.
    """
    parser = _Parser(text)
    modules = parser.modules()
    return modules, tuple(parser.problems)


class _Parser(StatementParser):
    """Modules, and what they declare."""

    def __init__(self, text: str):
        super().__init__(text)
        self._routines = 0

    def modules(self) -> tuple[Module, ...]:
        modules: list[Module] = []
        strays = 0
        while self.next.kind != "end":
            self.begin()
            if self.next.key == "module":
                modules.append(self._module())
            else:
                strays += 1
                if strays == 1:
                    self.note(self.next.start, f"'{self.next.text[:32]}' stands outside any MODULE and is not read")
                self.take()
        return tuple(modules)

    def _module(self) -> Module:
        start = self.take().start
        self._count_routine(start)
        name = self._or_nameless(self.name)
        if self.skip("("):
            while self.next.kind != "end" and not self.skip(")"):
                self.take()
        declarations: list[Declaration] = []
        records: list[Record] = []
        routines: list[Routine] = []
        unparsed: list[Unparsed] = []
        while self.next.kind != "end" and self.next.key not in ("module", "endmodule"):
            self.begin()
            self.count()
            first = self.next.start
            try:
                match self.after_scope():
                    case "const" | "pers" | "var":
                        declarations.append(self.declaration())
                    case "proc" | "func" | "trap":
                        routines.append(self._routine())
                    case "record":
                        records.append(self._record())
                    case "alias":
                        self._to_semicolon()
                    case _:
                        raise self.problem("a declaration or a routine is missing before")
            except NotUnderstood as problem:
                self.depth = 0
                noted = self.note(problem.position, problem.text)
                self.recover(first, ("proc", "func", "trap", "record", "local", *STORAGE, "module", "endmodule"))
                unparsed.append(self.unparsed(first, noted))
        if not self.skip("endmodule"):
            self.note(self.end, f"ENDMODULE of the module '{name.text}' is missing")
        return Module(
            start=start, end=self.end, name=name, declarations=tuple(declarations), records=tuple(records),
            routines=tuple(routines), unparsed=tuple(unparsed),
        )  # fmt: skip

    def _or_nameless(self, read: Callable[[], Token]) -> Token:
        try:
            return read()
        except NotUnderstood as problem:
            self.note(problem.position, problem.text)
            return Token("name", "", "", problem.position)

    def _to_semicolon(self) -> None:
        while self.next.kind != "end" and self.take().key != ";":
            pass

    # declarations

    def _record(self) -> Record:
        self.skip("local")
        self.expect("record")
        name = self.name()
        components: list[tuple[str, str]] = []
        while not self.skip("endrecord"):
            type_, component = self.name(), self.name()
            self.expect(";")
            components.append((component.key, type_.key))
        return Record(name=name, components=tuple(components))

    # routines

    def _count_routine(self, position: int) -> None:
        self._routines += 1
        if self._routines > MOST_ROUTINES:
            raise TooMuch(
                position, f"has more than {MOST_ROUTINES:,} modules and routines; divide it into several files"
            )

    def _routine(self) -> Routine:
        start = self.next.start
        self._count_routine(start)
        local = self.skip("local")
        kind = self.take().key
        if kind == "func":
            self.name()
        name = self.name()
        parameters = self._parameters() if self.skip("(") else ()
        declarations: list[Declaration] = []
        body = self.body(declarations)
        handlers: list[tuple[Statement, ...]] = []
        while self.next.key in HANDLERS:
            self.take()
            if self.skip("("):
                self.arguments(")")
                self.expect(")")
            handlers.append(self.body(declarations))
        closing = ROUTINE_END[kind]
        if not self.skip(closing):
            self.note(self.next.start, f"{closing.upper()} of '{name.text}' is missing")
        return Routine(
            start=start, end=self.end, name=name, kind=kind, local=local, parameters=parameters,
            declarations=tuple(declarations), body=body, handlers=tuple(handlers),
        )  # fmt: skip

    def _parameters(self) -> tuple[Parameter, ...]:
        parameters: list[Parameter] = []
        while not self.skip(")"):
            if parameters and not self.skip(",", "|") and self.next.key != "\\":
                raise self.problem("a comma is missing before")
            optional = self.skip("\\")
            changed = self.skip("inout", "var", "pers")
            type_ = self.name()
            name = self.name()
            if self.skip("{"):
                while self.next.kind != "end" and not self.skip("}"):
                    self.take()
            parameters.append(Parameter(name=name, type=type_.key, optional=optional, changed=changed))
        return tuple(parameters)
