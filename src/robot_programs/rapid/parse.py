"""From the text of a file to its modules; what cannot be understood is passed over and reported."""

import re
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import ClassVar

from robot_programs.core import flow as form
from robot_programs.core.flow import Arm, Block, Branches, Leave, Loop, Node, Step, Unknown
from robot_programs.core.values import MAX_DEPTH, OperandReader
from robot_programs.rapid.syntax import (
    Aggregate,
    Argument,
    Assignment,
    Call,
    Component,
    Constant,
    Control,
    Declaration,
    Expression,
    Index,
    Instruction,
    Label,
    Module,
    Number,
    Operation,
    Parameter,
    Problem,
    Record,
    Reference,
    Routine,
    Tail,
    Token,
    TooMuch,
    Unparsed,
    Words,
    list_end,
    moved,
    named,
    number,
    words,
)

# The parser's lower half: words to expressions and arguments.

MAX_ARGUMENTS = 1000
"""Of one instruction; those of the controller have twenty at most."""

_RESERVED = """
    alias and backward case connect const default div do else elseif endfor endfunc endif endmodule endproc endrecord
    endtest endtrap endwhile error exit false for from func goto if inout local mod module nostepin not noview or pers
    proc raise readonly record retry return step sysmodule test then to trap true trynext undo var viewonly while with
    xor
"""
RESERVED = frozenset(_RESERVED.split())
"""Words that are not names."""


class NotUnderstood(Exception):
    """The words at a place cannot be read."""

    def __init__(self, position: int, text: str):
        self.position, self.text = position, text
        super().__init__(text)


class ExpressionParser(Words, OperandReader[Expression]):
    """Reads expressions from words, one after the other."""

    BINDING: ClassVar = {
        "or": 1, "xor": 1, "and": 2, "=": 3, "<>": 3, "<": 3, ">": 3, "<=": 3, ">=": 3, "+": 4, "-": 4,
        "*": 5, "/": 5, "div": 5, "mod": 5,
    }  # fmt: skip
    PREFIXES: ClassVar = {"-": 6, "+": 6, "not": 6}

    def skip(self, *keys: str) -> bool:
        """Read a word if it is one of these."""
        if self.next.kind in ("name", "symbol") and self.next.key in keys:
            self.take()
            return True
        return False

    def expect(self, key: str) -> Token:
        """Read a word that has to stand here."""
        if not (self.next.kind in ("name", "symbol") and self.next.key == key):
            raise self.problem(f"'{key.upper()}' is missing before")
        return self.take()

    def name(self) -> Token:
        """Read a name that is not a reserved word."""
        if self.next.kind != "name" or self.next.key in RESERVED:
            raise self.problem("a name is missing before")
        return self.take()

    def problem(self, what: str) -> NotUnderstood:
        """An error at the next word."""
        token = self.next
        shown = "the end of the file" if token.kind == "end" else f"'{token.text[:32]}'"
        return NotUnderstood(token.start, f"{what} {shown}")

    @property
    def place(self) -> int:
        """First character of the next word."""
        return self.next.start

    @property
    def sign(self) -> str:
        """The next word as an operator."""
        return self.next.key if self.next.kind in ("name", "symbol") else ""

    def expression(self, weakest: int = 0) -> Expression:
        """Read an expression."""
        self.count_values()
        return super().expression(weakest)

    def operation(self, start: int, sign: str, *operands: Expression) -> Expression:
        """An operator with its operands; a number has its sign."""
        number, *others = operands
        if isinstance(number, Number) and not others and sign in "+-":
            return Number(start=start, end=number.end, value=-number.value if sign == "-" else number.value)
        return Operation(start=start, end=operands[-1].end, operator=sign, operands=operands)

    def single(self) -> Expression:
        """Read a value, a list or a name with what belongs to it."""
        token = self.next
        self.height = 0
        match token.kind:
            case "number":
                self.take()
                return Number(start=token.start, end=self.end, value=number(token))
            case "text":
                self.take()
                if len(token.text) < 2 or not token.text.endswith('"'):
                    raise NotUnderstood(token.start, "the string that begins here does not end in its line")
                return Constant(start=token.start, end=token.end, value=token.text[1:-1].replace('""', '"'))
            case "name" if token.key in ("true", "false"):
                self.take()
                return Constant(start=token.start, end=token.end, value=token.key == "true")
            case "name":
                return self._named()
            case _:
                return self._bracketed(token)

    def _bracketed(self, token: Token) -> Expression:
        if token.key == "[" and (end := self._numbers(token.start)):
            self.take()
            self.jump(end)
            literal = Aggregate(start=token.start, end=end, content=self.text)
            self.grow(0 if literal.is_plain else 1)
            return literal
        if self.skip("["):
            items = self._list("]")
            self.grow(self.height)
            return Aggregate(start=token.start, end=self.end, content=items)
        if self.skip("("):
            inner = self.expression()
            self.expect(")")
            self.grow(self.height)
            return Operation(start=token.start, end=self.end, operator="()", operands=(inner,))
        raise self.problem("a value is missing before")

    def _numbers(self, start: int) -> int:
        """End of a list of nothing but numbers; 0 where there is none, or where its signs are nested too deeply."""
        return list_end(self.text, start) if self.depth + 3 <= MAX_DEPTH else 0

    def _list(self, closing: str) -> tuple[Expression, ...]:
        if self.skip(closing):
            return ()
        items = [self.expression()]
        height = self.height
        while self.skip(","):
            items.append(self.expression())
            height = max(height, self.height)
        self.expect(closing)
        self.height = height
        return tuple(items)

    def _named(self) -> Expression:
        name = self.name()
        if self.skip("("):
            arguments = self.arguments(")")
            self.expect(")")
            self.grow(self.height)
            return Call(start=name.start, end=self.end, name=name, arguments=arguments)
        return self.selected(name)

    def selected(self, name: Token) -> Reference:
        """Read the components and indices behind a name."""
        selectors: list[Component | Index] = []
        height = 0
        while True:
            if self.skip("."):
                if self.next.kind != "name":
                    raise self.problem("a component's name is missing before")
                selectors.append(Component(key=self.take().key))
            elif self.skip("{"):
                selectors.append(Index(items=self._list("}")))
                self.grow(self.height)
                height = max(height, self.height)
            else:
                self.height = height
                return Reference(start=name.start, end=self.end, name=name, selectors=tuple(selectors))

    def arguments(self, closing: str) -> tuple[Argument, ...]:
        """Read arguments up to a closing symbol, which is left."""
        arguments: list[Argument] = []
        height = 0
        while not (self.next.kind == "symbol" and self.next.key == closing):
            if arguments and not self.skip(",") and self.next.key != "\\":
                what = "a comma or a semicolon" if closing == ";" else "a comma"
                raise self.problem(f"{what} is missing before")
            if self.next.kind == "symbol" and self.next.key == closing:
                raise self.problem("an argument is missing before")
            start = self.next.start
            if len(arguments) == MAX_ARGUMENTS:
                raise TooMuch(start, f"has more than {MAX_ARGUMENTS:,} arguments in one call; is it a RAPID module?")
            if self.skip("\\"):
                arguments.append(self._option(start))
            else:
                value = self.expression()
                arguments.append(Argument(start=start, end=self.end, option="", value=value))
            height = max(height, self.height)
        self.height = height
        return tuple(arguments)

    def _option(self, start: int) -> Argument:
        if self.next.kind != "name":
            raise self.problem("the name of an option is missing before")
        name = self.take()
        value, conditional = None, False
        if self.skip(":="):
            value = self.expression()
        elif self.skip("?"):
            value, conditional = self.selected(self.name()), True
        return Argument(start=start, end=self.end, option=name.key, value=value, conditional=conditional)


# Declarations and statements of a routine; what cannot be understood is passed over and noted.

MAX_STATEMENTS = 720_000
"""Statements and declarations of a file: 360 000 motions with as many declared targets, in less than 500 MB."""

MAX_PROBLEMS = 100_000
"""Places of a file that are not understood; nobody reads of more."""

MAX_UNPARSED_WORDS = 1_000_000
"""Words of a file that are not understood."""

STORAGE = ("const", "pers", "var")
ROUTINE_END = {"proc": "endproc", "func": "endfunc", "trap": "endtrap"}
HANDLERS = ("error", "undo", "backward")
_INNER_ENDS = ("endif", "elseif", "else", "endfor", "endwhile", "endtest", "case", "default")
_ROUTINE_ENDS = (*ROUTINE_END.values(), "endmodule", "module", "proc", "func", "trap")
_BLOCK_ENDS = frozenset((*_INNER_ENDS, *HANDLERS, *_ROUTINE_ENDS, "record", "endrecord"))
"""Words that a statement cannot begin with: a block ends before them, whether they close it or were meant for another."""

_LEAVING = ("return", "goto", "raise", "retry", "trynext", "exit")

_ARGUMENT = re.compile(
    r"\s*(?P<comma>,\s*)?(?P<begin>\\\s*(?P<option>[^\W\d]\w*)\s*:=\s*)?(?P<value>(?P<name>[^\W\d]\w*)|\[)"
)
"""An argument that is a name, or begins a list."""
_CLOSING = re.compile(r"\s*;")

_DECLARED = re.compile(r"\s+([^\W\d]\w*)\s+([^\W\d]\w*)\s*:=\s*(?=\[)")
"""Type and name of data that a list follows."""

_TARGETS = {"movej": 1, "movel": 1, "movec": 2, "moveabsj": 1}
"""Arguments in front of the tail, of motions that make up long programs."""

MAX_TAIL_LENGTH = 200
"""Characters of a tail; longer ones are read each time."""


class StatementParser(ExpressionParser):
    """Takes declarations and statements from tokens."""

    def __init__(self, text: str):
        super().__init__(text)
        self.problems: list[Problem] = []
        self._unparsed = 0
        """Words so far that are not understood."""
        self._statements = 0
        self._tails: dict[str, Tail] = {}
        """By their texts."""

    def note(self, position: int, text: str) -> Problem:
        """Record a statement that cannot be parsed.

        Raises:
            TooMuch: nothing of the file is, or hardly anything.
        """
        if len(self.problems) >= MAX_PROBLEMS:
            raise self._not_understood(f"at more than {MAX_PROBLEMS:,} places", self.problems[0])
        self.problems.append(Problem(position=position, text=text))
        return self.problems[-1]

    def _not_understood(self, where: str, one: Problem) -> TooMuch:
        return TooMuch(one.position, f"is not understood {where}, such as: {one.text}; is it a RAPID module?")

    def count(self) -> None:
        """Count a statement or a declaration.

        Raises:
            TooMuch: there are more than in any program.
        """
        self._statements += 1
        if self._statements > MAX_STATEMENTS:
            raise TooMuch(
                self.next.start,
                f"has more than {MAX_STATEMENTS:,} statements and declarations; divide it into several files",
            )

    def after_scope(self) -> str:
        """Key of the word behind LOCAL or TASK."""
        return self.behind_next().key if self.next.key in ("local", "task") else self.next.key

    def recover(self, first: int, stops: tuple[str, ...]) -> None:
        """Go on behind the next semicolon, or before a word that begins or ends something."""
        if self.next.start == first:
            self.take()
        while self.next.kind != "end" and self.next.key not in stops:
            if self.take().key == ";":
                return

    def unparsed(self, first: int, problem: Problem) -> Unparsed:
        """The text since its first word, which is not understood.

        Raises:
            TooMuch: nothing of the file is, or hardly anything.
        """
        tokens: list[Token] = []
        for token in words(self.text, first, self.end):
            self._unparsed += 1
            if self._unparsed > MAX_UNPARSED_WORDS:
                raise self._not_understood(f"in more than {MAX_UNPARSED_WORDS:,} words", [*self.problems, problem][0])
            tokens.append(token)
        return Unparsed(start=first, end=self.end, tokens=tuple(tokens), problem=problem)

    def declaration(self) -> Declaration:
        """Take a declaration of data."""
        start = self.next.start
        local = self.skip("local")
        self.skip("task")
        storage, plain = self.next.key, self._plain_declaration()
        if plain is None:
            self.take()
            type_, name = self.name(), self.name()
            selectors = self.selected(name).selectors if self.next.key == "{" else ()
            dimensions = selectors[0].items if selectors and isinstance(selectors[0], Index) else ()
            value = self.expression() if self.skip(":=") else None
            self.expect(";")
        else:
            (type_, name, value), dimensions = plain, ()
        return Declaration(
            start=start, end=self.end, storage=storage, local=local, type=type_, name=name, dimensions=dimensions, value=value,
        )  # fmt: skip

    def _plain_declaration(self) -> tuple[Token, Token, Aggregate] | None:
        """Type, name and list of numbers of a declaration, not word by word; None where there is another, and nothing is read."""
        storage, text = self.next, self.text
        found = None if self.looked_ahead else _DECLARED.match(text, storage.end)
        at = self._numbers(found.end()) if found else 0
        closing = _CLOSING.match(text, at) if at else None
        if found is None or closing is None:
            return None
        type_, name = named(found[1], found.start(1)), named(found[2], found.start(2))
        if type_.key in RESERVED or name.key in RESERVED:
            return None
        self.count_values()
        self.jump(closing.end())
        return type_, name, Aggregate(start=found.end(), end=at, content=text)

    def body(self, declarations: list[Declaration]) -> Block:
        """Statements up to a handler or the end of the routine; an ENDIF or the like on the way closes nothing."""
        nodes = [*self._block(declarations)]
        while self.next.key in _INNER_ENDS:
            stray = self.take()
            noted = self.note(stray.start, f"'{stray.text}' closes nothing")
            nodes += [Unknown(line=self.unparsed(stray.start, noted)), *self._block(declarations)]
        return tuple(nodes)

    def _block(self, declarations: list[Declaration]) -> Block:
        nodes: list[Node] = []
        while self.next.kind != "end" and self.next.key not in _BLOCK_ENDS:
            if self.skip(";"):
                continue
            self.begin()
            self.count()
            first = self.next.start
            depth = self.depth
            try:
                if self.next.key in ("local", "task", *STORAGE):
                    if self.after_scope() not in STORAGE:
                        break
                    declarations.append(self.declaration())
                else:
                    nodes.append(self._statement(declarations))
            except NotUnderstood as problem:
                self.depth = depth
                noted = self.note(problem.position, problem.text)
                self.recover(first, _ROUTINE_ENDS)
                nodes.append(Unknown(line=self.unparsed(first, noted)))
        return tuple(nodes)

    def _statement(self, declarations: list[Declaration]) -> Node:
        match self.next.key:
            case "if":
                return self._if(declarations)
            case "test":
                return self._test(declarations)
            case "for":
                return self._for(declarations)
            case "while":
                return self._while(declarations)
            case key if key in _LEAVING:
                return self._leave()
            case "connect":
                return self._connect()
            case "%":
                return self._late_bound()
            case "<":
                return self._placeholder()
            case _:
                return self._simple()

    def _simple(self) -> Node:
        plain = self._plain()
        if plain is not None:
            return Step(line=plain)
        name = self.name()
        start = name.start
        if self.skip(":"):
            return form.Label(line=Label(start=start, end=self.end), name=name.key)
        if self.next.key in (".", "{", ":="):
            target = self.selected(name)
            self.expect(":=")
            value = self.expression()
            self.expect(";")
            return Step(line=Assignment(start=start, end=self.end, target=target, value=value))
        arguments = self.arguments(";")
        self.expect(";")
        return Step(line=Instruction(start=start, end=self.end, name=name, first=arguments))

    def _plain(self) -> Instruction | None:
        """An instruction that is given names and lists of numbers alone, most lines of long programs, not word by word.

        None where there is another statement, of which nothing is read.
        """
        first, text, at = self.next, self.text, self.next.end
        if first.kind != "name" or first.key in RESERVED or self.looked_ahead or self.depth + 4 > MAX_DEPTH:
            return None
        arguments: list[Argument] = []
        targets, behind, tail = _TARGETS.get(first.key, 0), 0, None
        while (found := _ARGUMENT.match(text, at)) and len(arguments) < MAX_ARGUMENTS:
            comma, option, word = found.group("comma", "option", "name")
            start = found.start("value")
            at = found.end() if word else self._numbers(start)
            if not at or (comma and not arguments) or (arguments and not comma and not option):
                return None
            if word:
                name = named(word, start)
                if name.key in RESERVED:
                    return None
                value: Expression = Reference(start=start, end=at, name=name, selectors=())
            else:
                value = Aggregate(start=start, end=at, content=text)
            begin, key = (found.start("begin"), sys.intern(option.lower())) if option else (start, "")
            arguments.append(Argument(start=begin, end=at, option=key, value=value))
            if len(arguments) == targets and not any(argument.option for argument in arguments):
                behind, end = at, text.find(";", at, at + MAX_TAIL_LENGTH) + 1
                tail = self._tails.get(text[at:end])
                if tail is not None:
                    return self._instruction(first, arguments, tail, end)
        closing = _CLOSING.match(text, at)
        if closing is None:
            return None
        if behind and all(isinstance(argument.value, Reference) for argument in arguments[targets:]):
            tail = self._tail(arguments[targets:], behind, closing.end())
        return self._instruction(first, arguments[:targets] if tail else arguments, tail, closing.end())

    def _tail(self, arguments: Sequence[Argument], start: int, end: int) -> Tail:
        """Keep arguments for other lines that have the same text from some character on."""
        options = frozenset(argument.option for argument in arguments if argument.option)
        tail = Tail(arguments=moved(arguments, -start), options=options)
        self._tails[self.text[start:end]] = tail
        return tail

    def _instruction(self, name: Token, first: Sequence[Argument], tail: Tail | None, end: int) -> Instruction:
        """An instruction of names and lists of numbers, behind which the next word is."""
        self.count_values(len(first) + (0 if tail is None else len(tail.arguments)))
        self.jump(end)
        return Instruction(start=name.start, end=end, name=name, first=tuple(first), tail=tail, plain=True)

    def _leave(self) -> Node:
        keyword = self.take()
        label = ""
        if keyword.key == "goto" and self.next.kind == "name":
            label = self.name().key
        read = () if self.next.key == ";" else (self.expression(),)
        self.expect(";")
        line = Control(start=keyword.start, end=self.end, conditions=read)
        if label:
            return Leave(line=line, way="jump", label=label)
        return Leave(line=line, way="return" if keyword.key == "return" else "stop")

    def _connect(self) -> Node:
        """CONNECT gives an interrupt its trap: an instruction without arguments that matter here."""
        name = self.take()
        self.selected(self.name())
        self.expect("with")
        self.name()
        self.expect(";")
        return Step(line=Instruction(start=name.start, end=self.end, name=name, first=()))

    def _late_bound(self) -> Node:
        """``%"name"% arguments;`` calls a procedure whose name is known only at run time."""
        name = self.take()
        self.expression()
        self.expect("%")
        arguments = self.arguments(";")
        self.expect(";")
        return Step(line=Instruction(start=name.start, end=self.end, name=name, first=arguments))

    def _placeholder(self) -> Node:
        """``<SMT>`` and the like, where a statement is still to be written."""
        first = self.take().start
        name = self.name()
        self.expect(">")
        problem = Problem(position=name.start, text=f"'<{name.text}>' stands for what is still to be written")
        return Unknown(line=self.unparsed(first, problem))

    def _if(self, declarations: list[Declaration]) -> Node:
        start = self.take().start
        condition = self.expression()
        if not self.skip("then"):
            return self._compact_if(start, condition, declarations)
        self.enter()
        read = [condition]
        arms: list[tuple[Expression | None, Block]] = [(condition, self._block(declarations))]
        while True:
            if self.skip("elseif"):
                read.append(self.expression())
                self.expect("then")
                arms.append((read[-1], self._block(declarations)))
            elif self.skip("else"):
                arms.append((None, self._block(declarations)))
            else:
                break
        self._close("endif", start)
        return self._branches(start, read, arms)

    def _compact_if(self, start: int, condition: Expression, declarations: list[Declaration]) -> Node:
        self.enter()
        self.count()
        inner = self._statement(declarations)
        self.depth -= 1
        if isinstance(inner, Step) and isinstance(inner.line, Instruction):
            inner = Step(line=replace(inner.line, compact=True))
        return self._branches(start, [condition], [(condition, (inner,))])

    def _branches(
        self, start: int, read: Sequence[Expression], branches: Iterable[tuple[Expression | None, Block]]
    ) -> Branches:
        """Branches with their conditions.

        Args:
            start: where they begin.
            read: what the text reads to decide them, in its order.
            branches: each with its condition; None of one that is taken where none of the others is, wherever it stands.
        """
        arms = sorted((Arm(condition=one, body=body) for one, body in branches), key=lambda arm: arm.condition is None)
        line = Control(start=start, end=self.end, conditions=tuple(read))
        return Branches(line=line, name="IF", arms=tuple(arms))

    def _test(self, declarations: list[Declaration]) -> Node:
        start = self.take().start
        tested = self.expression()
        self.enter()
        read = [tested]
        arms: list[tuple[Expression | None, Block]] = []
        while True:
            if self.skip("case"):
                cases = [self.expression()]
                while self.skip(","):
                    cases.append(self.expression())
                self.expect(":")
                read += cases
                arms.append((_is_one(tested, cases), self._block(declarations)))
            elif self.skip("default"):
                self.expect(":")
                arms.append((None, self._block(declarations)))
            else:
                break
        self._close("endtest", start)
        return self._branches(start, read, arms)

    def _for(self, declarations: list[Declaration]) -> Node:
        start = self.take().start
        counter = self.name()
        self.expect("from")
        conditions = [self.expression()]
        self.expect("to")
        conditions.append(self.expression())
        if self.skip("step"):
            conditions.append(self.expression())
        self.expect("do")
        return self._loop(start, counter, conditions, "endfor", declarations)

    def _while(self, declarations: list[Declaration]) -> Node:
        start = self.take().start
        condition = self.expression()
        self.expect("do")
        return self._loop(start, None, [condition], "endwhile", declarations)

    def _loop(
        self,
        start: int,
        counter: Token | None,
        conditions: list[Expression],
        closing: str,
        declarations: list[Declaration],
    ) -> Node:
        self.enter()
        body = self._block(declarations)
        self._close(closing, start)
        line = Control(start=start, end=self.end, conditions=tuple(conditions), counter=counter)
        if counter is None:
            return Loop(line=line, name="WHILE", kind="while", condition=conditions[0], body=body)
        return Loop(line=line, name="FOR", kind="counted", body=body)

    def _close(self, keyword: str, start: int) -> None:
        """Read the word that closes a block."""
        self.depth -= 1
        if not self.skip(keyword):
            self.note(start, f"{keyword.upper()} is missing for what begins here")


def _is_one(tested: Expression, cases: Sequence[Expression]) -> Expression:
    """The condition that a value is one of some."""
    at = {"start": tested.start, "end": tested.end}
    ways = [Operation(**at, operator="=", operands=(tested, case)) for case in cases]
    while len(ways) > 1:  # in pairs, so that many are not nested deeply
        pairs = (tuple(ways[i : i + 2]) for i in range(0, len(ways), 2))
        ways = [pair[0] if len(pair) == 1 else Operation(**at, operator="or", operands=pair) for pair in pairs]
    return ways[0]


MAX_ROUTINES = 100_000
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
                if strays == 1 and not modules:  # what stands behind a module is no part of it, and is kept as it is
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
                        self.recover(first, ())
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
        if self._routines > MAX_ROUTINES:
            raise TooMuch(
                position, f"has more than {MAX_ROUTINES:,} modules and routines; divide it into several files"
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
        handlers: list[Block] = []
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
