"""RAPID lowered to the one form: what statements change, call and read, with the names resolved."""

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from robot_programs.core import flow
from robot_programs.core.flow import Arm, Block, Branches, FlowStep, Leave, Node, Unknown
from robot_programs.core.form import Arming, Ask, Assign, Check, Do, Expression, Hole, Key, Lit, Op, Rec, Ref, Span
from robot_programs.core.kit import Token
from robot_programs.core.program import Cause, Unresolved
from robot_programs.core.values import MAX_DEPTH
from robot_programs.rapid.names import (
    BY_NAME,
    CHANGING,
    FUNCTIONS,
    INSTRUCTIONS,
    LATE,
    MOTIONLESS,
    MOVING,
    OFFSETTING,
    RETURNING,
    SHIFTING,
    SOFTENING,
    STIFFENING,
    SYSTEM_MOTION,
    ModuleFile,
    Procedure,
    Scope,
    Symbol,
)
from robot_programs.rapid.parse import ROUTINE_ENDS, Argument, Notes, NotUnderstood, RapidReader
from robot_programs.rapid.resolve import (
    CHANGED_BY,
    MOTION_FORMS,
    ONLY_EXTERNAL,
    MotionArguments,
    MoveInstruction,
    layout,
)
from robot_programs.rapid.syntax import (
    LIST,
    NAME,
    RESERVED,
    DataDeclaration,
    ModuleText,
    NotRead,
    RoutineText,
    SyntaxProblem,
    key_of,
)
from robot_programs.rapid.values import TARGETS

# Statements and their blocks.

LEAVING = ("GOTO", "RETURN", "RAISE", "RETRY", "TRYNEXT", "EXIT")
"""Statements behind which control does not go on."""

HANDLERS = ("ERROR", "UNDO", "BACKWARD")
_BLOCKS: Mapping[str, tuple[str, Mapping[str, str], str]] = {
    "IF": ("THEN", {"ELSEIF": "THEN", "ELSE": ""}, "ENDIF"), "TEST": ("", {"CASE": ":", "DEFAULT": ":"}, "ENDTEST"),
    "FOR": ("DO", {}, "ENDFOR"), "WHILE": ("DO", {}, "ENDWHILE"),
}  # fmt: skip
"""Blocks: what ends the header, further branches with what ends theirs, and the end."""
_INNER_ENDS = ("ENDIF", "ELSEIF", "ELSE", "ENDFOR", "ENDWHILE", "ENDTEST", "CASE", "DEFAULT")
_BLOCK_ENDS = frozenset((*_INNER_ENDS, *HANDLERS, *ROUTINE_ENDS))
"""Words that a statement cannot begin with: a block ends before them, whether they close it or were meant for another."""

_COLON = re.compile(r"(?:[\s\ufeff]+|![^\n]*)*+:(?!=)")

# What an instruction, a function, or text that was not understood may change.

_DECLARING = frozenset({"const", "pers", "var", "inout", "for"})
"""Words behind which a name is declared."""

_ASKING = frozenset({"if", "elseif", "while", "test", "case", "from", "to", "step", "return", "raise", "goto", "with"})
"""Words behind which a value or a name is read, while a statement may begin behind other reserved words."""

_BETWEEN = frozenset({"and", "or", "xor", "not", "div", "mod"})
"""Operators that are words."""


_VALUES = ("number", "text", "list")
"""Kinds of words that are values."""

_CALIBRATING = ("mtool", "wobjcalib")
"""How instructions begin that change a tool or a work object."""


def may_change(called: str, type_: str, *, function: bool) -> bool:
    """Whether an instruction or a function of the system, by its key, may change data of a type that it is given.

    The system's motions take tools and work objects as persistent data, so that these could be changed, but are not; what
    searches or calibrates says so in its name. A routine that is not in the files may change all that it is given.
    """
    if function:
        return called not in FUNCTIONS or called in CHANGING
    if called.startswith(_CALIBRATING) or called in CHANGING:
        return True
    if type_ in ("tooldata", "wobjdata"):
        return called not in INSTRUCTIONS and SYSTEM_MOTION.fullmatch(called) is None
    moves = called in MOTION_FORMS or called == ONLY_EXTERNAL
    return called not in MOTIONLESS and (not moves or called in CHANGED_BY)


def is_strange(called: str, scope: Scope) -> bool:
    """Whether an instruction or a function, by its key, is neither of the system nor of the files."""
    if called in scope.routines or called in INSTRUCTIONS or called in FUNCTIONS or called in CHANGING:
        return False
    return SYSTEM_MOTION.fullmatch(called) is None and not called.startswith(_CALIBRATING)


def type_of(name: str, scope: Scope) -> str:
    """Type of the data of a name; empty where it is not known."""
    symbol = scope.known(name)
    return "" if symbol is None else symbol.type


def names_in_unparsed_text(
    tokens: Sequence[Token], scope: Scope, changes: Callable[[str, bool, str], bool]
) -> Iterator[tuple[Token, bool]]:
    """Names in text that was not understood, and whether their data may change there.

    They may where an assignment follows, at the beginning of a statement, where they are declared, and behind an instruction
    or a function that may change what it is given. Where two values stand side by side, without a comma or an operator
    between them, a statement is taken to begin: its semicolon is what may be missing.

    Args:
        tokens: the text.
        scope: what names mean in it.
        changes: whether an instruction, or a function, by its key, may change data of a type that it is given.
    """
    keys = [token.text.lower() for token in tokens]
    assigned = _assigned_by_change(tokens, keys)
    callers: set[tuple[str, bool]] = set()
    begins, declares, valued = True, False, False
    for i, (token, own) in enumerate(zip(tokens, keys, strict=True)):
        behind = tokens[i + 1] if i + 1 < len(tokens) else None
        if token.kind == "name" and own in RESERVED:
            valued = own in ("true", "false")
            if not valued and own not in _BETWEEN:
                callers, begins, declares = set(), own not in _ASKING, own in _DECLARING
            continue
        if token.kind != "name":
            if begins:  # no known statement begins so, and a procedure may be called by the value of a string
                callers = {("", False)}
            begins, declares = own == ";", False
            callers = set() if begins else callers
            valued = token.kind in _VALUES or own in ("]", ")", "}")
            continue
        if i and keys[i - 1] in ("\\", ".") and not _is_value(behind):
            valued, begins = True, False
            continue
        data = _is_data(token, scope)
        if not data and behind is not None and behind.text == "(":
            callers.add((own, True))
        elif not data and not declares and (begins or valued or _is_value(behind)):
            callers, begins, valued = {(own, False)}, False, False
            continue
        type_ = type_of(token.text, scope)
        given = any(changes(key, function, type_) for key, function in callers)
        yield token, begins or declares or given or i in assigned
        begins, valued = False, True


def _is_data(token: Token, scope: Scope) -> bool:
    try:
        return scope.find(token.text) is not None
    except Unresolved:
        return True


def _is_value(token: Token | None) -> bool:
    """Whether a value begins with a token."""
    if token is None:
        return False
    return token.text == "[" or token.kind in _VALUES or (token.kind == "name" and token.text.lower() not in RESERVED)


def _assigned_by_change(tokens: Sequence[Token], keys: Sequence[str]) -> frozenset[int]:
    """Which tokens are names that ``:=`` follows, behind their components and indices."""
    names: set[int] = set()
    name: int | None = None
    outside: list[int | None] = []
    for i, token in enumerate(tokens):
        match token.text:
            case ":=" if name is not None:
                names.add(name)
                name = None
            case "{":
                outside.append(name)
                name = None
            case "}" if outside:
                name = outside.pop()
            case ";":
                outside, name = [], None
            case ".":
                pass
            case _ if token.kind == "name" and i and keys[i - 1] == ".":
                pass
            case _ if token.kind == "name" and not (i and keys[i - 1] == "\\"):
                name = i
            case _:
                name = None
    return frozenset(names)


# Lines of the form, with what RAPID needs of their text.

SOFT = Symbol(name="SoftAct", type="bool")
"""Whether a servo gives way."""

STOPPING = ("exitcycle", "systemstopaction")

FRAMES = ("tool", "wobj")
"""Names of a motion's settings that are its tool and its work object."""


class Reading(Check):
    """A line that reads data, and neither changes anything nor steers the program."""


class Labelled(Do):
    """A label of a GOTO."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Instructed(Do):
    """An instruction of the system, or one that is not in the files."""

    name: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Unread(Do):
    """Text that is not understood."""

    words: tuple[Token, ...]
    problem: SyntaxProblem
    names: tuple[Ref, ...]
    """Data that it names."""


NOTED = frozenset({"confj", "confl", *SHIFTING, *OFFSETTING, SOFTENING, "singarea", *BY_NAME})
"""Instructions that act on motions elsewhere."""


@dataclass(frozen=True, eq=False, kw_only=True)
class NotedInstruction:
    """An instruction of which something is to be said, or a word in text that is not understood that may be one."""

    file: ModuleFile
    word: Token
    options: frozenset[str]
    kind: str = ""
    """``late`` where it calls a procedure by a name that only the running program knows, ``strange`` where it is not known."""

    @property
    def key(self) -> str:
        """Its name in lower case."""
        return self.word.text.lower()


@dataclass(eq=False, kw_only=True)
class LoweredRapid:
    """A program in the one form."""

    files: Sequence[ModuleFile]
    modules: Sequence[Procedure]
    """In place of modules, what is declared in them, and what is not understood outside of routines."""
    procedures: Sequence[Procedure]
    """The routines in the order of the text."""
    values: dict[Symbol, Expression] = field(default_factory=dict[Symbol, Expression])
    """Of data that are declared with a value."""
    sizes: dict[Symbol, tuple[Expression, ...]] = field(default_factory=dict[Symbol, tuple[Expression, ...]])
    """Of arrays."""
    softens: bool
    """Whether something may let servos give way."""
    instructions: list[NotedInstruction] = field(default_factory=list[NotedInstruction])
    """Of which something is to be said, in the order of the text."""

    @property
    def all(self) -> tuple[Procedure, ...]:
        """All routines, and what stands for modules."""
        return (*self.procedures, *(one for one in self.modules if one.nodes))

    @property
    def declared(self) -> Iterator[Symbol]:
        """All that is declared."""
        return (symbol for one in (*self.modules, *self.procedures) for symbol in one.declared)


def lowered(
    files: Mapping[ModuleFile, Notes], found: Sequence[tuple[Procedure, ModuleText | RoutineText]]
) -> LoweredRapid:
    """A program in the one form.

    Args:
        files: with what is not understood of them.
        found: modules and routines with their text.

    Raises:
        FileError: a file holds too much.
    """
    procedures = [one for one, text in found if isinstance(text, RoutineText)]
    modules = [one for one, text in found if isinstance(text, ModuleText)]
    softens = any(SOFTENING in file.source.text.lower() for file in files)
    form = LoweredRapid(files=tuple(files), modules=modules, procedures=procedures, softens=softens)
    for one, text in found:
        _Lowering(one, form, files[one.file]).lower(text)
    return form


_MOVE = re.compile(
    rf"(?P<name> move(?:[jlc]|absj) ) (?: (?<=[cC]) \s* (?P<via> \b{NAME} | {LIST}) \s* , )? \s* (?P<to> \b{NAME} | {LIST} )"
    r"(?P<tail> [^;\"!]{0,200}+ ; )?",
    re.VERBOSE | re.IGNORECASE,
)
"""Motions that make up long programs, whose targets are names or lists of numbers, and the rest up to the semicolon."""


class _Lowering(RapidReader):
    """A module or routine, lowered to nodes."""

    def __init__(self, procedure: Procedure, form: LoweredRapid, notes: Notes) -> None:
        super().__init__(notes, procedure.file.number)
        self.procedure, self.form, self.scope = procedure, form, procedure.scope
        self.tails: dict[tuple[str, Scope, str], MoveInstruction] = {}
        """Motions with names alone behind their targets, by instruction, scope and text there: that of most lines is alike."""
        self.passed: Mapping[int, DataDeclaration | NotRead] = {}
        """What is declared among the statements, by its first character."""

    def lower(self, text: ModuleText | RoutineText) -> None:
        """Give the routine its nodes, or the module one for each text that is not understood."""
        for symbol in self.procedure.declared:
            self._declared(symbol)
        if isinstance(text, ModuleText):
            self.procedure.nodes = tuple(node for one in text.unread for node in self._not_read(*one))
            return
        self.jump(text.body_at)
        self.depth, self.passed = 0, {one.start: one for one in text.passed}
        self.procedure.nodes, *handlers = self._bodies()
        self.procedure.handlers = tuple(handlers)
        self.procedure.unread = frozenset(
            word.text.lower() for line in self.procedure.lines if isinstance(line, Unread) for word in line.words
        )  # a GOTO may stand there

    def _declared(self, symbol: Symbol) -> None:
        own = symbol.declaration
        if own is None:
            return
        counted, self.depth = self.notes.counted["values"], 0
        if own.dimensions:
            self.jump(own.sizes_at)
            self.form.sizes[symbol] = self.indices()
        if own.literal is not None:
            self.form.values[symbol] = own.literal
        elif own.value_at:
            self.jump(own.value_at)
            self.form.values[symbol] = self.expression()
        self.notes.counted["values"] = counted  # as when they were read without the meaning of names

    # Expressions.

    def datum(self, name: Token, path: Sequence[str | tuple[Expression, ...]], at: Span) -> Expression:
        """Data, or a part of them; a hole where nothing of that name is known."""
        self.type = ""
        try:
            symbol = self.scope.find(name.text)
        except Unresolved as why:
            return Hole(at=at, why=str(why))
        if symbol is None:
            why = f"'{name.text}' is not declared in the files; pass the module that declares it"
            return Hole(at=at, why=Cause(why, (name.text, "other")))
        found, of = list[Expression](), symbol.type
        for step in path:
            if isinstance(step, tuple):
                found += step
                continue
            names = [one for one, _ in self.scope.types.get(of, ())]
            if step not in names:
                return Hole(at=at, why=f"'{symbol.name}' has no component '{step}'")
            number = names.index(step)
            found.append(Lit(at=at, value=number + 1.0))
            of = self.scope.types[of][number][1]
        self.type = of
        return Ref(at=at, name=f"'{symbol.name}'", key=symbol, path=(tuple(found),) if found else ())

    def asked(self, name: Token, arguments: Sequence[Argument], at: Span) -> Ask:
        """The value of a function."""
        key = key_of(name)
        if key in self.scope.routines:
            own = self.scope.routines[key]
            return Ask(
                at=at, name=name.text, arguments=self._given_to(arguments, own), routines=own,
                changes=self._extra(arguments, key, own, function=True),
            )  # fmt: skip
        required = [a.value for a in arguments if not a.option and a.value is not None]
        options = [(a.option, a.value) for a in arguments if a.option and not a.conditional and a.value is not None]
        others = [a.value for a in arguments if a.conditional and a.value is not None]
        given, names = [*required, *(value for _, value in options)], [name for name, _ in options]
        if len(given) < len(arguments):
            given += [*others, Hole(at=at, why=f"the value of {name.text}() is known only at run time")]
            names += ["?"] * (len(others) + 1)
        changes, lends = self._changed(arguments[1:] if key == "dim" else arguments, key, function=True)
        return Ask(
            at=at, name=name.text, arguments=tuple(given), options=tuple(names),
            changes=changes, lends=lends, moves=key not in FUNCTIONS,
        )  # fmt: skip

    def _given_to(self, arguments: Sequence[Argument], routines: Sequence[Procedure]) -> tuple[Expression, ...]:
        """What the parameters of a routine are given, and what else there is."""
        hole = Hole(at=(self.file, 0, 0), why="it is not given")
        found: list[Expression] = [hole] * len(routines[0].given)
        rest: list[Expression] = []
        for number, argument in _matched(arguments, routines[0]):
            if argument.value is None:
                continue
            if number is None or argument.conditional:
                rest.append(argument.value)
            else:
                found[number] = argument.value
        return (*found, *rest)

    # What calls and instructions change.

    def _changed(
        self, arguments: Iterable[Argument], key: str, *, function: bool = False
    ) -> tuple[tuple[Ref, ...], tuple[Ref, ...]]:
        """Data that an instruction or a function may change, and tools and work objects that one may that is not in the files."""
        changes, lends = list[Ref](), list[Ref]()
        for argument in arguments:
            ref = self._ref(argument.name, argument.value)
            if ref is None or not isinstance(ref.key, Symbol):
                continue
            if may_change(key, ref.key.type, function=function) or argument.option in RETURNING:
                frame = ref.key.may_change and ref.key.type in ("tooldata", "wobjdata")
                (lends if frame and is_strange(key, self.scope) else changes).append(ref)
        return tuple(changes), tuple(lends)

    def _extra(
        self, arguments: Sequence[Argument], key: str, routines: Sequence[Procedure], *, function: bool = False
    ) -> tuple[Ref, ...]:
        """Data that a call gives to no parameter, so that they may be changed."""
        known = set(arguments)
        for routine in routines:
            known &= {argument for number, argument in _matched(arguments, routine) if number is not None}
        others = [a for a in arguments if a not in known]
        return sum(self._changed(others, key, function=function), ()) if others else ()

    def _ref(self, name: Token | None, value: Expression | None) -> Ref | None:
        """Data that may be changed."""
        if name is None or value is None:
            return None
        if isinstance(value, Hole):  # a component or an index that is not there
            symbol = self.scope.known(name.text)
            value = None if symbol is None else Ref(at=value.at, name=f"'{symbol.name}'", key=symbol)
        return value if isinstance(value, Ref) and _may_change(value.key) else None

    # Statements.

    def _bodies(self) -> Iterator[Block]:
        """Nodes of a routine, and of its handlers."""
        yield tuple(self._body())
        while self.at(*HANDLERS):
            start, problem = self.take().start, None
            try:
                if self.accept("("):
                    self.arguments(")")
                    self.expect(")")
            except NotUnderstood as error:
                problem = self.noted(error)
                self.recover(start, ROUTINE_ENDS)
            unread = () if problem is None else self._not_read(start, self.end, problem)
            yield (*unread, *self._body())

    def _body(self) -> Iterator[Node]:
        """Nodes up to a handler or the end of the routine; an ENDIF or the like on the way closes nothing."""
        yield from self._block()
        while self.at(*_INNER_ENDS):
            stray = self.take()
            noted = self.note(stray.start, f"'{stray.text}' closes nothing")
            yield from self._not_read(stray.start, stray.end, noted)
            yield from self._block()

    def _block(self) -> Block:
        found = list[Node]()
        while not self.done and (key := self.next.upper) not in _BLOCK_ENDS:
            first, depth, noted = self.place, self.depth, len(self.form.instructions)
            if key == ";":
                self.take()
                continue
            if (passed := self.passed.get(first)) is not None:
                self.jump(passed.end)
                found += self._not_read(*passed) if isinstance(passed, NotRead) else ()
                continue
            if key in ("LOCAL", "TASK") and self.after_scope() in ROUTINE_ENDS:
                break
            self.begin()
            self.notes.count("statements", first)
            try:
                found += self._statement(key)
            except NotUnderstood as error:
                self.depth = depth
                del self.form.instructions[noted:]  # the words of the text are looked at below
                problem = self.noted(error)
                self.recover(first, ROUTINE_ENDS)
                found += self._not_read(first, self.end, problem)
        return tuple(found)

    def _statement(self, key: str) -> Sequence[Node]:
        """Nodes of a statement.

        Raises:
            NotUnderstood: it is not one.
        """
        first = self.next
        match key:
            case "IF" | "TEST" | "FOR" | "WHILE":
                return [self._blocks(key)]
            case "<":  # ``<SMT>`` and the like, where a statement is still to be written
                self.take()
                name = self.name()
                self.expect(">")
                problem = SyntaxProblem(
                    position=name.start, text=f"'<{name.text}>' stands for what is still to be written"
                )
                return self._not_read(first.start, self.end, problem)
            case _:
                line = self._alike()
                if line is not None:
                    return [FlowStep(line=line)]
        label = _COLON.match(self.text, first.end)
        if label is not None and first.kind == "name" and first.text.lower() not in RESERVED:
            self.jump(label.end())
            return [flow.Label(line=Labelled(at=self.span(first.start), moves=True), name=key_of(first))]
        return list(self._simple())

    def _not_read(self, start: int, end: int, problem: SyntaxProblem) -> Sequence[Node]:
        """Text that is not understood: what it may change, and which routines it may call."""
        found = self.notes.passed_over(start, end, problem)
        given_to: list[str] = []

        def may(key: str, function: bool, type_: str) -> bool:
            if key not in self.scope.routines:
                return may_change(key, type_, function=function)
            given_to.append(key)
            return False

        named, changes, asks = list[Ref](), list[Ref](), list[Ask]()
        for word, changed in names_in_unparsed_text(found, self.scope, may):
            symbol = self.scope.known(word.text)
            if symbol is not None:
                ref = Ref(at=(self.file, word.start, word.end), name=f"'{symbol.name}'", key=symbol)
                (changes if changed and _may_change(symbol) else named).append(ref)
                for key in given_to if _may_change(symbol) else ():
                    own = self.scope.routines[key]
                    count = max(len(routine.parameters) for routine in own)
                    asks.append(Ask(at=ref.at, name=key, arguments=(ref,) * count, routines=own))
            given_to.clear()
        names = [word for word in found if word.kind == "name"]
        keys = [word.text.lower() for word in names]
        options, routines = frozenset(keys), dict[Procedure, None]()
        for word, key in zip(names, keys, strict=True):
            routines |= dict.fromkeys(self.scope.routines.get(key, ()) if self.procedure.kind else ())
            if key in NOTED:
                self.form.instructions.append(NotedInstruction(file=self.procedure.file, word=word, options=options))
        line = Unread(
            at=(self.file, start, end), routines=tuple(routines), arguments=tuple(asks),
            changes=tuple(changes), moves=True, words=found, problem=problem, names=tuple(named),
        )  # fmt: skip
        traps = tuple(routine for routine in line.routines if routine.beside)
        return [Unknown(line=line), *([FlowStep(line=Arming(at=line.at, routines=traps))] if traps else [])]

    def _blocks(self, key: str) -> Node:
        """IF, TEST, FOR or WHILE with the blocks in it."""
        start, outer, counter = self.take().start, self.scope, None
        behind, branches, closing = _BLOCKS[key]
        if key == "FOR":
            counter = self.name()
            self.expect("FROM")
        read = [self.expression()]
        if key == "FOR":
            self.expect("TO")
            read.append(self.expression())
            read += [self.expression()] if self.accept("STEP") else []
        self.enter()
        if key == "IF" and not self.at("THEN"):
            self.notes.count("statements", self.place)
            arms = [Arm(condition=read[0], body=tuple(map(_compact, self._statement(self.next.upper))))]
            self.depth -= 1
            return Branches(line=Check(at=self.span(start), conditions=tuple(read)), name="IF", arms=tuple(arms))
        symbol, arms = None, list[Arm]()
        if key != "TEST":
            self.expect(behind)
            if counter is not None:
                symbol, self.scope = outer.with_counter(counter)
            try:
                arms.append(Arm(condition=read[0], body=self._block()))
            finally:
                self.scope = outer
        while (branch := self.next.upper) in branches:
            self.take()
            cases = [] if branch in ("ELSE", "DEFAULT") else [self.expression()]
            while branch == "CASE" and self.accept(","):
                cases.append(self.expression())
            if branch != "ELSE":
                self.expect(branches[branch])
            condition = None if not cases else cases[0] if key == "IF" else _is_one(read[0], cases)
            arms.append(Arm(condition=condition, body=self._block()))
            read += cases
        self.depth -= 1
        if not self.accept(closing):
            self.note(start, f"{closing} is missing for what begins here")
        at = self.span(start)
        if key in ("IF", "TEST"):
            arms.sort(key=lambda arm: arm.condition is None)  # taken where none of the others is, wherever it stands
            return Branches(line=Check(at=at, conditions=tuple(read)), name="IF", arms=tuple(arms))
        if symbol is None:
            line = Check(at=at, conditions=tuple(read))
            return flow.Loop(line=line, name="WHILE", kind="while", condition=read[0], body=arms[0].body)
        if len(read) == 2:  # the step is that towards the end
            read.append(Op(at=at, sign="step", operands=tuple(read)))
        line = Check(at=at, conditions=tuple(read), counter=Ref(at=at, name=f"'{symbol.name}'", key=symbol))
        return flow.Loop(line=line, name="FOR", kind="counted", body=arms[0].body)

    def _simple(self) -> Iterator[Node]:
        """A statement without others in it.

        Raises:
            NotUnderstood: it is none.
        """
        first = self.next
        match first.upper:
            case key if key in LEAVING:
                self.take()
                label = key_of(self.name()) if key == "GOTO" and self.next.kind == "name" else ""
                conditions = () if self.at(";") else (self.expression(),)
                line = Check(at=self._ended(first), conditions=conditions)
                yield Leave(line=line, way="jump" if label else "return" if key == "RETURN" else "stop", label=label)
            case "CONNECT":
                self.take()
                self.selected(self.name())
                self.expect("WITH")
                named = self.scope.routines.get(key_of(self.name()), ())
                at, traps = self._ended(first), tuple(routine for routine in named if routine.beside)
                yield FlowStep(line=Arming(at=at, routines=traps) if traps else Reading(at=at))
            case "%":
                self.take()
                self.expression()
                self.expect("%")
                arguments = self.arguments(";")
                yield from self._instruction(first, arguments, self._ended(first))
            case _:
                name = self.name()
                if self.at(".", "{", ":="):
                    target = self.selected(name)
                    self.expect(":=")
                    value, ref = self.expression(), self._ref(name, target)
                    yield FlowStep(line=self._assignment(self._ended(first), ref, target, value))
                else:
                    arguments = self.arguments(";")
                    yield from self._instruction(name, arguments, self._ended(first))

    def _ended(self, first: Token) -> Span:
        """Place of a statement that ends here."""
        self.expect(";")
        return self.span(first.start)

    def _assignment(self, at: Span, target: Ref | None, stated: Expression, value: Expression) -> Assign | Check:
        if target is None:
            return Reading(at=at, conditions=(value, stated))
        return Assign(at=at, target=target, value=value)

    def _instruction(self, name: Token, arguments: Sequence[Argument], at: Span) -> Iterator[Node]:
        key = key_of(name)
        options = frozenset(argument.option for argument in arguments if argument.option)
        own = self.scope.routines.get(key)
        kind = "late" if key in LATE and own is None else "strange" if is_strange(key, self.scope) else ""
        if kind or key in NOTED:
            file = self.procedure.file
            self.form.instructions.append(NotedInstruction(file=file, word=name, options=options, kind=kind))
        if own is not None:
            sure = not own[0].local or own[0].scope.module is self.scope.module
            yield FlowStep(
                line=Do(
                    at=at, routines=own, arguments=self._given_to(arguments, own), why=self._set_in(name.start),
                    changes=self._extra(arguments, key, own), sure=sure,
                )
            )  # fmt: skip
        elif key in MOTION_FORMS:
            yield FlowStep(line=self._motion(name, arguments, options))
            if key in CHANGED_BY or not RETURNING.isdisjoint(options):
                changes, _ = self._changed(arguments, key)
                yield FlowStep(line=Do(at=at, changes=changes, why=self._set_in(name.start)))
        elif (counted := self._counted(key, arguments, at)) is not None:
            yield FlowStep(line=counted)
        else:
            given = tuple(argument.value for argument in arguments if argument.value is not None)
            if key in STOPPING:
                yield Leave(line=Reading(at=at, conditions=given), way="stop")
                return
            if key in (SOFTENING, STIFFENING):
                soft = Lit(at=at, value=key == SOFTENING)
                yield FlowStep(line=Assign(at=at, target=Ref(at=at, name="SoftAct", key=SOFT), value=soft))
            changes, lends = self._changed(arguments, key)
            if key != ONLY_EXTERNAL and self._moves(key, arguments):
                yield FlowStep(line=self._unread_motion(name, arguments, options, "this motion is not read", ()))
            if changes or lends or key not in MOTIONLESS:
                yield FlowStep(
                    line=Instructed(
                        at=at, arguments=given, changes=changes, lends=lends, why=self._set_in(name.start),
                        moves=key not in MOTIONLESS, any=kind == "late", name=name.text,
                    )
                )  # fmt: skip
            else:
                yield FlowStep(line=Reading(at=at, conditions=given))

    def _set_in(self, place: int) -> str:
        """What is said behind the name of data that an instruction may change."""
        return f"is assigned to in {self.notes.source.place(place)}, so its value is not known"

    def _counted(self, key: str, arguments: Sequence[Argument], at: Span) -> Assign | Check | None:
        """The assignment that Incr, Decr, Add and Clear stand for (RAPID instructions); None where it is another instruction."""
        values = [argument.value for argument in arguments if not argument.option and argument.value is not None]
        if len(values) != len(arguments) or not arguments or arguments[0].name is None:
            return None
        target, *others = values
        match key, others:
            case (("incr" | "decr"), []):
                one = Lit(at=at, value=1.0)
                value = Op(at=at, sign="+" if key == "incr" else "-", operands=(target, one))
            case "add", [by]:
                value = Op(at=at, sign="+", operands=(target, by))
            case "clear", []:
                value = Lit(at=at, value=0.0)
            case _:
                return None
        return self._assignment(at, self._ref(arguments[0].name, target), target, value)

    # Motions.

    def _moves(self, key: str, arguments: Iterable[Argument]) -> bool:
        """Whether an instruction moves the robot by itself: one of the system's, or one that is given a target."""
        if key in MOTIONLESS:
            return False
        return key.startswith(MOVING) or any(
            type_of(argument.name.text, self.scope) in TARGETS if argument.name is not None
            else isinstance(argument.value, Ask) and argument.value.name.lower() in ("offs", "reltool")
            for argument in arguments
        )  # fmt: skip

    def _alike(self) -> MoveInstruction | None:
        """Read a motion that says what another one does, but for its targets; None where it is something else."""
        start = self.place
        found = _MOVE.match(self.text, start)
        if found is None or self.depth + 4 > MAX_DEPTH:
            return None
        name, via, to, behind = found.group("name", "via", "to", "tail")
        like = self.tails.get((name.lower(), self.scope, behind))
        if like is None or len(like.points) != (1 if via is None else 2) or _is_reserved(via) or _is_reserved(to):
            return None
        type_ = MOTION_FORMS[like.key].target
        points = (self._plain_target(*found.span("to"), type_),)
        if via is not None:
            points = (self._plain_target(*found.span("via"), type_), *points)
        self.jump(found.end())
        return MoveInstruction(
            at=(self.file, start, found.end()), points=points, settings=like.settings, ends=like.ends, name=name,
            options=like.options, routine=like.routine, scope=self.scope, shared=True,
        )  # fmt: skip

    def _plain_target(self, start: int, end: int, type_: str) -> Expression:
        """A target that is a name, or a list of numbers."""
        self.notes.count("values", start)
        if self.text[start] == "[":
            return self.literal(start, end)
        name = Token("name", sys.intern(self.text[start:end]), start)
        value = self.datum(name, (), (self.file, start, end))
        return self._target(Argument(start=start, end=end, value=value, name=name, type=self.type), type_)

    def _unread_motion(
        self, name: Token, arguments: Sequence[Argument], options: frozenset[str], why: str, given: Sequence[Expression]
    ) -> MoveInstruction:
        settings = {str(k): one for k, one in enumerate(given)}
        return MoveInstruction(
            at=self.span(name.start), settings=settings, why=why, ends=False, name=name.text, options=options,
            routine=self.procedure.name, scope=self.scope, finds=self._finds(name, arguments),
        )  # fmt: skip

    def _finds(self, name: Token, arguments: Sequence[Argument]) -> Ref | None:
        required = [argument for argument in arguments if not argument.option]
        if name.text.lower() not in CHANGED_BY or len(required) < 2:
            return None
        return self._ref(required[1].name, required[1].value)

    def _motion(self, name: Token, arguments: Sequence[Argument], options: frozenset[str]) -> MoveInstruction:
        key, at = key_of(name), self.span(name.start)
        form = MOTION_FORMS[key]
        try:
            where = layout(key, arguments)
        except Unresolved as why:
            given = [argument.value for argument in arguments if argument.value is not None]
            return self._unread_motion(name, arguments, options, str(why), given)
        points = tuple(self._target(one, form.target) for one in (where.via, where.to) if one is not None)
        settings, found = self._settings(where, arguments), _MOVE.match(self.text, name.start)
        shared = found is not None and found.end("to") == where.to.end and self._is_plain(where, arguments)
        line = MoveInstruction(
            at=at, points=points, settings=settings, ends=form.ends_there, name=name.text, options=options,
            routine=self.procedure.name, scope=self.scope, shared=shared, finds=self._finds(name, arguments),
        )  # fmt: skip
        if shared:
            self.tails[key, self.scope, self.text[where.to.end : at[2]]] = line
        return line

    def _is_plain(self, where: MotionArguments, arguments: Sequence[Argument]) -> bool:
        """Whether all behind the targets is names, of data that neither are nor hold targets."""
        behind = arguments[1 + (where.via is not None) :]
        return all(
            one.name is not None and one.end == one.name.end and not one.conditional
            and self.scope.holds_no_target(type_of(one.name.text, self.scope)) for one in behind
        )  # fmt: skip

    def _target(self, argument: Argument, type_: str) -> Expression:
        match argument.value:
            case Ref() as ref:
                if argument.name is not None and argument.type == type_:
                    return ref
                if argument.name is not None:
                    return Hole(at=ref.at, why=f"'{argument.name.text}' is {argument.type}, not {type_}")
            case Hole() as hole if argument.name is not None:
                return hole
            case None:
                return Hole(at=(self.file, 0, 0), why="the target is missing")
            case value if value.at[1] == argument.start and (isinstance(value, Ask | Rec) or _is_list(value)):
                return value
            case _:
                pass
        return Hole(at=argument.value.at, why=f"the target is not a {type_}")

    def _settings(self, where: MotionArguments, arguments: Iterable[Argument]) -> dict[str, Expression]:
        """On what a motion depends beside its targets."""
        options = where.options
        found, part = {"tool": self._frame(where.tool, "tool", "tooldata")}, options.get("wobj")
        if part is not None:
            found["wobj"] = self._frame(part, "work object", "wobjdata")
        read = {"speed": where.speed, "zone": where.zone, "v": options.get("v"), "z": options.get("z")}
        for name, argument in read.items():
            if argument is not None and argument.value is not None:
                found[name] = _whole(argument.value)
        own = {where.via, where.to, where.tool, part, *read.values()}
        others = (argument.value for argument in arguments if argument not in own)
        if self.form.softens:
            found["soft"] = Ref(at=(self.file, where.to.start, where.to.end), name="SoftAct", key=SOFT)
        found |= {f"other {k}": one for k, one in enumerate(others) if one is not None}
        return found

    def _frame(self, argument: Argument, what: str, type_: str) -> Expression:
        value, name = argument.value, argument.name
        if value is None:
            return Hole(at=(self.file, 0, 0), why=f"the {what} is missing")
        if name is None:
            return value
        try:
            unknown = self.scope.find(name.text) is None
        except Unresolved:
            unknown = False
        if unknown:
            why = f"unknown {what} '{name.text}'; pass the module that declares it"
            return Hole(at=value.at, why=Cause(why, (name.text, "tool" if what == "tool" else "part")))
        if isinstance(value, Ref) and argument.type != type_:
            return Hole(at=value.at, why=f"'{name.text}' is {argument.type}, not {type_}")
        return _whole(value)


def _compact(node: Node) -> Node:
    """A node of the statement of an IF without THEN."""
    is_motion = isinstance(node, FlowStep) and isinstance(node.line, MoveInstruction)
    return FlowStep(line=replace(node.line, compact=True)) if is_motion else node


def _is_reserved(name: str | None) -> bool:
    return name is not None and name[0] != "[" and name.lower() in RESERVED


def _whole(one: Expression) -> Expression:
    """An expression whose value says all, where it is not known."""
    return Op(at=one.at, sign="()", operands=(one,)) if isinstance(one, Ref) and one.path else one


def _is_list(one: Expression) -> bool:
    return isinstance(one, Lit) and not isinstance(one.value, float | bool | str)


def _may_change(key: Key) -> bool:
    return isinstance(key, Symbol) and (key.may_change or bool(key.parameter_of))


def _is_one(tested: Expression, cases: Sequence[Expression]) -> Expression:
    """The condition that a value is one of some."""
    ways: list[Expression] = [Op(at=tested.at, sign="=", operands=(tested, case)) for case in cases]
    while len(ways) > 1:  # in pairs, so that many are not nested deeply
        pairs = (tuple(ways[i : i + 2]) for i in range(0, len(ways), 2))
        ways = [pair[0] if len(pair) == 1 else Op(at=tested.at, sign="or", operands=pair) for pair in pairs]
    return ways[0]


def _matched(arguments: Iterable[Argument], routine: Procedure) -> Iterator[tuple[int | None, Argument]]:
    """Arguments of a call with the numbers of the parameters of a routine to which they are given; None for none."""
    required = iter([k for k, one in enumerate(routine.given) if not one.optional])
    numbers = {key_of(one.name): k for k, one in reversed([*enumerate(routine.given)])}
    for argument in arguments:
        yield numbers.get(argument.option) if argument.option else next(required, None), argument
