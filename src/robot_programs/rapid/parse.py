"""From the text of a file to its modules, before names have a meaning; what cannot be understood is passed over and reported."""

import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import ClassVar

from robot_programs.core.form import Ask, Expression, Hole, Lit, Op, Rec, Ref, Span
from robot_programs.core.kit import Cursor, Token
from robot_programs.core.program import Unresolved
from robot_programs.core.source import Source
from robot_programs.core.values import MAX_DEPTH, Structure
from robot_programs.rapid.syntax import (
    LIST,
    NAME,
    RESERVED,
    AggregateText,
    DataDeclaration,
    ModuleText,
    NotRead,
    RoutineParameter,
    RoutineText,
    SyntaxProblem,
    behind_header,
    key_of,
    number,
    words,
)
from robot_programs.rapid.values import Listed, TracedOrigin, plain, structured
from taskcal_groundwork.errors import FileError

# What is not understood of a file, and how much it may hold.

LIMITS: dict[str, tuple[int, str]] = {
    # of one statement or declaration; an array of a hundred thousand targets, each of lists of numbers, has fewer
    "words": (2_000_000, "has more than {:,} words in the statement that begins here; divide it into several"),
    # those in lists included: numbers in a list of nothing else count as one
    "values": (5_000_000, "has more than {:,} values; divide it into several files"),
    # of one instruction; those of the controller have twenty at most
    "arguments": (1000, "has more than {:,} arguments in one call; is it a RAPID module?"),
    # 360 000 motions with as many declared targets, in less than 500 MB
    "statements": (720_000, "has more than {:,} statements and declarations; divide it into several files"),
    "routines": (100_000, "has more than {:,} modules and routines; divide it into several files"),
    "problems": (100_000, "is not understood at more than {:,} places, such as: {}; is it a RAPID module?"),
    "passed over": (1_000_000, "is not understood in more than {:,} words, such as: {}; is it a RAPID module?"),
}
"""How much of something a file may hold, and what is said of one that holds more and would take gigabytes."""


class NotUnderstood(Unresolved):
    """The words at a place cannot be read."""

    def __init__(self, position: int, text: str):
        self.problem = SyntaxProblem(position=position, text=text)
        super().__init__(text)


class Notes:
    """What is not understood of a file, and how much was read of it."""

    def __init__(self, source: Source) -> None:
        self.source, self.problems = source, list[SyntaxProblem]()
        self.counted = dict.fromkeys(LIMITS, 0)

    def count(self, what: str, position: int) -> None:
        """Count what has a limit.

        Raises:
            FileError: there is more than in any program.
        """
        self.counted[what] += 1
        if self.counted[what] > LIMITS[what][0]:
            raise self.too_much(what, position)

    def too_much(self, what: str, position: int, example: str = "") -> FileError:
        """What is said of a file that holds more of something than any program."""
        limit, text = LIMITS[what]
        return FileError(self.source.path, text.format(limit, example), line=self.source.line(position))

    def note(self, problem: SyntaxProblem) -> None:
        """Record text that cannot be parsed.

        Raises:
            FileError: nothing of the file is, or hardly anything.
        """
        if len(self.problems) >= LIMITS["problems"][0]:
            raise self._not_understood("problems", self.problems)
        self.problems.append(problem)

    def _not_understood(self, what: str, problems: Iterable[SyntaxProblem]) -> FileError:
        first = min(problems, key=lambda problem: problem.position)
        return self.too_much(what, first.position, first.text)

    def passed_over(self, start: int, end: int, problem: SyntaxProblem) -> tuple[Token, ...]:
        """Words of text that is not understood.

        Raises:
            FileError: nothing of the file is, or hardly anything.
        """
        left = LIMITS["passed over"][0] - self.counted["passed over"]
        found = tuple(islice(words(self.source.text, start, end), left + 1))
        if len(found) > left:
            raise self._not_understood("passed over", [*self.problems, problem])
        self.counted["passed over"] += len(found)
        return found


# Expressions and arguments.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Argument:
    """An argument of an instruction or a function."""

    start: int
    end: int
    option: str = ""
    r"""Name of an optional one, as in ``\WObj:=w``, in lower case; empty for a required one."""
    value: Expression | None
    """None for a switch."""
    conditional: bool = False
    r"""It is passed on where the routine itself got it: ``\WObj?w``."""
    name: Token | None = None
    """Of data, or of those of which it is a part; None of any other value."""
    type: str = ""
    """Of such data, as far as it is known, in lower case."""


class RapidReader(Cursor):
    """Reads expressions from the words of a file, which are looked for one after the other, so that they are never all in memory.

    Names stand for themselves; where they have a meaning, that is said by `datum` and `asked`.
    """

    BINDING: ClassVar = {
        "OR": 1, "XOR": 1, "AND": 2, "=": 3, "<>": 3, "<": 3, ">": 3, "<=": 3, ">=": 3, "+": 4, "-": 4,
        "*": 5, "/": 5, "DIV": 5, "MOD": 5,
    }  # fmt: skip
    PREFIXES: ClassVar = {"-": 6, "+": 6, "NOT": 6}

    def __init__(self, notes: Notes, file: int = 0) -> None:
        super().__init__((), file)
        self.text, self.notes = notes.source.text, notes
        self._end = Token("end", "", len(self.text))
        self.names = 0
        """How many were read."""
        self.type = ""
        """Of the data read last."""
        self.jump(behind_header(self.text))

    # Words.

    def jump(self, place: int) -> None:
        """Go on with the word at a place, or the one behind it."""
        self._behind, self._coming = place, words(self.text, place, len(self.text))

        self._next = next(self._coming, self._end)
        self.begin()

    def begin(self) -> None:
        """Note that a statement or a declaration begins at the next word."""
        self._left, self._begun = LIMITS["words"][0], self._next.start

    @property
    def next(self) -> Token:
        """The next word; one without text at the end."""
        return self._next

    @property
    def behind_next(self) -> Token:
        """The word after that."""
        return next(words(self.text, self._next.end, len(self.text)), self._end)

    @property
    def done(self) -> bool:
        """Whether no word is left."""
        return self._next.kind == "end"

    @property
    def end(self) -> int:
        """Behind the word read last."""
        return self._behind

    def take(self) -> Token:
        """Read a word; at the end of the file none.

        Raises:
            FileError: the statement has more words than any.
        """
        word = self._next
        if word.kind == "end":
            return word
        if not self._left:
            raise self.notes.too_much("words", self._begun)
        self._left -= 1
        self._behind = word.start + len(word.text)
        self._next = next(self._coming, self._end)
        return word

    def expect(self, text: str) -> None:
        """Read a word that has to stand here."""
        if not self.accept(text):
            raise self.problem(f"'{text}' is missing before")

    def name(self) -> Token:
        """Read a name that is not a reserved word."""
        if self._next.kind != "name" or self._next.text.lower() in RESERVED:
            raise self.problem("a name is missing before")
        return self.take()

    def note(self, position: int, text: str) -> SyntaxProblem:
        """Record what cannot be parsed."""
        return self.noted(NotUnderstood(position, text))

    def noted(self, error: NotUnderstood) -> SyntaxProblem:
        """Record an error."""
        self.notes.note(error.problem)
        return error.problem

    def after_scope(self) -> str:
        """The word behind LOCAL or TASK, in capitals."""
        return self.behind_next.upper if self.at("LOCAL", "TASK") else self.next.upper

    def recover(self, first: int, stops: Iterable[str]) -> None:
        """Go on behind the next semicolon, or before a word that begins or ends something."""
        if self.place == first:
            self.take()
        while not (self.done or self.at(*stops)):
            if self.take().text == ";":
                return

    def problem(self, what: str) -> NotUnderstood:
        """An error at the next word."""
        length = 1 if self._next.kind == "list" else 32
        shown = "the end of the file" if self.done else f"'{self._next.text[:length]}'"
        return NotUnderstood(self.place, f"{what} {shown}")

    # Expressions.

    def datum(self, name: Token, path: Sequence[str | tuple[Expression, ...]], at: Span) -> Expression:
        """Data, or a part of them."""
        return Ref(at=at, name=name.text, key=key_of(name), path=tuple(path))

    def asked(self, name: Token, arguments: Sequence[Argument], at: Span) -> Expression:
        """The value of a function."""
        return Ask(at=at, name=name.text, arguments=tuple(one.value for one in arguments if one.value is not None))

    def expression(self, weakest: int = 0) -> Expression:
        """Read an expression."""
        self.notes.count("values", self.place)
        return super().expression(weakest)

    def operation(self, start: int, sign: str, *operands: Expression) -> Expression:
        """An operator with its operands; a number has its sign, but for one in brackets."""
        if len(operands) == 1 and operands[0].at[2] != self.end:
            return Op(at=self.span(start), sign=sign.lower(), operands=operands)
        return super().operation(start, sign, *operands)

    def single(self) -> Expression:
        """Read a value, a list or a name with what belongs to it."""
        start, word = self.place, self.next
        self.height = 0
        match word.kind:
            case "list":
                return self._literal(word)
            case "number":
                self.take()
                return Lit(at=self.span(start), value=number(word.text))
            case "text":
                self.take()
                if len(word.text) < 2 or not word.text.endswith('"'):
                    raise NotUnderstood(start, "the string that begins here does not end in its line")
                return Lit(at=self.span(start), value=word.text[1:-1].replace('""', '"'))
            case "name" if word.upper in ("TRUE", "FALSE"):
                self.take()
                return Lit(at=self.span(start), value=word.upper == "TRUE")
            case "name":
                return self._named()
            case _:
                return self._bracketed()

    def _literal(self, word: Token) -> Lit:
        if self.depth + 3 > MAX_DEPTH:
            raise self.problem(f"brackets or blocks are nested deeper than {MAX_DEPTH} at")
        self.take()
        found = self.literal(word.start, word.end)
        self.grow(1 if found.value.parts.node.is_nested else 0)
        return found

    def literal(self, start: int, end: int) -> Lit:
        """A list of nothing but numbers."""
        at, written = (self.file, start, end), AggregateText(text=self.text, start=start, end=end)
        origin = TracedOrigin(at=at, owner=None, literal=written)
        return Lit(at=at, value=Structure(kind="", parts=Listed(written), origin=origin))

    def _bracketed(self) -> Expression:
        start = self.place
        if self.accept("["):
            places, items = self._list("]")
            self.grow(self.height)
            at = self.span(start)
            if all(one.at[1] == place and _is_written(one) for place, one in zip(places, items, strict=True)):
                values = tuple(plain(one.value) for one in items if isinstance(one, Lit))
                written = AggregateText(text=self.text, start=start, end=self.end, is_literal=False)
                origin = TracedOrigin(at=at, owner=None, literal=written)
                return Lit(at=at, value=Structure(kind="", parts=structured(values).parts, origin=origin))
            return Rec(at=at, parts=dict(enumerate(items)))
        if self.accept("("):
            inner = self.expression()
            self.expect(")")
            self.grow(self.height)
            return inner
        raise self.problem("a value is missing before")

    def _list(self, closing: str) -> tuple[list[int], list[Expression]]:
        """Values up to a closing bracket, with the places where they begin."""
        if self.accept(closing):
            return [], []
        places, items, height = list[int](), list[Expression](), 0
        while not items or self.accept(","):
            places.append(self.place)
            items.append(self.expression())
            height = max(height, self.height)
        self.expect(closing)
        self.height = height
        return places, items

    def _named(self) -> Expression:
        name = self.name()
        self.names += 1
        if self.accept("("):
            arguments = self.arguments(")")
            self.expect(")")
            self.grow(self.height)
            return self.asked(name, arguments, self.span(name.start))
        return self.selected(name)

    def selected(self, name: Token) -> Expression:
        """Read the components and indices behind a name."""
        path: list[str | tuple[Expression, ...]] = []
        height = 0
        while True:
            if self.accept("."):
                if self.next.kind != "name":
                    raise self.problem("a component's name is missing before")
                path.append(key_of(self.take()))
            elif self.at("{"):
                path.append(self.indices())
                self.grow(self.height)
                height = max(height, self.height)
            else:
                self.height = height
                return self.datum(name, path, self.span(name.start))

    def indices(self) -> tuple[Expression, ...]:
        """Read indices in their brackets."""
        self.take()
        return tuple(self._list("}")[1])

    def arguments(self, closing: str) -> list[Argument]:
        """Read arguments up to a closing symbol, which is left."""
        found: list[Argument] = []
        height = 0
        while not self.at(closing):
            if found and not self.accept(",") and not self.at("\\"):
                what = "a comma or a semicolon" if closing == ";" else "a comma"
                raise self.problem(f"{what} is missing before")
            if self.at(closing):
                raise self.problem("an argument is missing before")
            if len(found) == LIMITS["arguments"][0]:
                raise self.notes.too_much("arguments", self.place)
            found.append(self._option(self.place) if self.accept("\\") else self._given(self.place))
            height = max(height, self.height)
        self.height = height
        return found

    def _option(self, start: int) -> Argument:
        if self.next.kind != "name":
            raise self.problem("the name of an option is missing before")
        option = key_of(self.take())
        self.height = 0
        if self.accept(":="):
            return self._given(start, option)
        if self.accept("?"):
            name = self.name()
            value = self.selected(name)
            return Argument(
                start=start, end=self.end, option=option, value=value, conditional=True, name=name, type=self.type
            )
        return Argument(start=start, end=self.end, option=option, value=None)

    def _given(self, start: int, option: str = "") -> Argument:
        first = self.next
        value = self.expression()
        is_data = isinstance(value, Ref | Hole) and value.at[1:] == (first.start, self.end)
        return Argument(
            start=start, end=self.end, option=option, value=value, name=first if is_data else None,
            type=self.type if is_data else "",
        )  # fmt: skip


def _is_written(one: Expression) -> bool:
    """Whether a value is a number, or a list of nothing but numbers."""
    if not isinstance(one, Lit):
        return False
    value = one.value
    if not isinstance(value, Structure):
        return type(value) is float
    if isinstance(value.parts, Listed):
        return not value.parts.node.is_nested
    return not any(isinstance(part, Structure) for part in value.parts.values())


def arguments_of(source: Source, start: int) -> list[Argument]:
    """The arguments of the instruction that begins at a place, names without a meaning."""
    reader = RapidReader(Notes(source))
    reader.jump(start)
    reader.take()
    return reader.arguments(";")


# Declarations, and heads of routines; what cannot be understood is passed over and noted.

STORAGE = ("CONST", "PERS", "VAR")
_ROUTINES = ("PROC", "FUNC", "TRAP")
ROUTINE_ENDS = ("ENDPROC", "ENDFUNC", "ENDTRAP", "ENDMODULE", "MODULE", *_ROUTINES)
"""Words in no routine, where one ends at the latest."""

_STATEMENTS = re.compile(
    rf'(?:[^"!a-z_\x80-\U0010ffff]++|(?!(?:{"|".join((*STORAGE, "LOCAL", "TASK", *ROUTINE_ENDS))})\b)\w++|"(?:[^"\n]|"")*+"?|'
    r"![^\n]*+|\W)*+",
    re.IGNORECASE,
)
"""Text up to a word with which a declaration may begin or a routine end, but for those in strings and comments."""
_PLAIN = re.compile(
    rf"(?P<storage>{NAME}) \s+ (?P<type>{NAME}) \s+ (?P<name>{NAME}) \s* := \s* (?P<list>{LIST}) \s* ;", re.VERBOSE
)
"""A declaration of data that are a list of nothing but numbers."""


def parse(notes: Notes) -> tuple[ModuleText, ...]:
    """The modules of a file; what is not understood is noted.

    Raises:
        FileError: there is more of something than in any program.
    """
    return _Parser(notes).modules()


class _Parser(RapidReader):
    """Modules, their declarations and the heads of their routines."""

    # Modules.

    def modules(self) -> tuple[ModuleText, ...]:
        modules: list[ModuleText] = []
        strays = 0
        while not self.done:
            self.begin()
            if self.at("MODULE"):
                modules.append(self._module())
            else:
                strays += 1
                if strays == 1 and not modules:  # what stands behind a module is no part of it, and is kept as it is
                    self.note(self.place, f"'{self.next.text[:32]}' stands outside any MODULE and is not read")
                self.take()
        return tuple(modules)

    def _module(self) -> ModuleText:
        start = self.take().start
        self.notes.count("routines", start)
        module = ModuleText(start=start, name=self._module_name())
        if self.accept("("):
            while not self.done and not self.accept(")"):
                self.take()
        while not (self.done or self.at("MODULE", "ENDMODULE")):
            self.begin()
            self.notes.count("statements", self.place)
            first = self.place
            try:
                self._part(module, first)
            except NotUnderstood as problem:
                self.depth = 0
                noted = self.noted(problem)
                self.recover(first, (*_ROUTINES, "RECORD", "LOCAL", *STORAGE, "MODULE", "ENDMODULE"))
                module.unread.append(NotRead(first, self.end, noted))
        if not self.accept("ENDMODULE"):
            self.note(self.end, f"ENDMODULE of the module '{module.name.text}' is missing")
        module.end = self.end
        return module

    def _part(self, module: ModuleText, first: int) -> None:
        match self.after_scope():
            case key if key in STORAGE:
                module.declarations.append(self._declaration())
            case key if key in _ROUTINES:
                module.routines.append(self._routine())
            case "RECORD":
                self._record(module)
            case "ALIAS":
                self.recover(first, ())
            case _:
                raise self.problem("a declaration or a routine is missing before")

    def _module_name(self) -> Token:
        try:
            return self.name()
        except NotUnderstood as problem:
            return Token("name", "", self.noted(problem).position)

    def _record(self, module: ModuleText) -> None:
        self.accept("LOCAL")
        self.expect("RECORD")
        name = self.name()
        components: list[tuple[str, str]] = []
        while not self.accept("ENDRECORD"):
            type_, component = self.name(), self.name()
            self.expect(";")
            components.append((key_of(component), key_of(type_)))
        module.records[key_of(name)] = tuple(components)

    def _declaration(self) -> DataDeclaration:
        start = self.place
        local = self.accept("LOCAL")
        self.accept("TASK")
        plain = _PLAIN.match(self.text, self.place)
        if (
            plain is not None
            and self.depth + 3 <= MAX_DEPTH
            and RESERVED.isdisjoint((plain["type"].lower(), plain["name"].lower()))
        ):
            return self._plain_declaration(start, local, plain)
        storage = self.take().text.lower()
        type_, name = self.name(), self.name()
        sizes_at, value_at, dimensions, literal = self.place, 0, 0, None
        if self.at("{"):
            found = self.selected(name)
            dimensions = len(found.path[0]) if isinstance(found, Ref) and isinstance(found.path[0], tuple) else 0
        if self.accept(":="):
            value_at, names = self.place, self.names
            value = self.expression()
            if self.names == names and isinstance(value, Lit) and value.at[1] == value_at:
                literal = value
        self.expect(";")
        return DataDeclaration(
            start=start, end=self.end, storage=storage, local=local, type=type_, name=name, dimensions=dimensions,
            sizes_at=sizes_at, value_at=value_at, literal=literal,
        )  # fmt: skip

    def _plain_declaration(self, start: int, local: bool, found: re.Match[str]) -> DataDeclaration:
        """A declaration of a list of nothing but numbers, not word by word."""
        self.notes.count("values", start)
        self.jump(found.end())
        type_, name = (Token("name", sys.intern(found[one]), found.start(one)) for one in ("type", "name"))
        return DataDeclaration(
            start=start, end=found.end(), storage=found["storage"].lower(), local=local, type=type_, name=name,
            value_at=found.start("list"), literal=self.literal(*found.span("list")),
        )  # fmt: skip

    # Routines.

    def _routine(self) -> RoutineText:
        start = self.place
        self.notes.count("routines", start)
        local = self.accept("LOCAL")
        kind = self.take().upper
        if kind == "FUNC":
            self.name()
        name = self.name()
        parameters = tuple(self._parameters()) if self.accept("(") else ()
        body_at, passed = self.end, tuple(self._passed())
        if not self.accept(f"END{kind}"):
            self.note(self.place, f"END{kind} of '{name.text}' is missing")
        return RoutineText(
            start=start, end=self.end, name=name, kind=kind.lower(), local=local, parameters=parameters,
            passed=passed, body_at=body_at,
        )  # fmt: skip

    def _parameters(self) -> Iterator[RoutineParameter]:
        first = True
        while not self.accept(")"):
            if not first and not self.accept(",", "|") and not self.at("\\"):
                raise self.problem("a comma is missing before")
            first, optional = False, self.accept("\\")
            changed = self.accept("INOUT", "VAR", "PERS")
            type_, name = self.name(), self.name()
            if self.accept("{"):
                while not self.done and not self.accept("}"):
                    self.take()
            yield RoutineParameter(name=name, type=key_of(type_), optional=optional, changed=changed)

    def _passed(self) -> Iterator[DataDeclaration | NotRead]:
        """Declarations among the statements up to the end of the routine; the statements are passed over."""
        place = self.end
        while found := _STATEMENTS.match(self.text, place):
            start = found.end()
            self.jump(start)
            behind = self.after_scope()
            if self.done or behind in ROUTINE_ENDS:
                return
            if behind in STORAGE:
                self.notes.count("statements", start)
                try:
                    yield self._declaration()
                except NotUnderstood as problem:
                    self.depth = 0
                    noted = self.noted(problem)
                    self.recover(start, ROUTINE_ENDS)
                    yield NotRead(start, self.end, noted)
            else:
                self.take()
            place = self.end
