"""Declarations and statements of a routine; what cannot be understood is passed over and noted."""

from taskcal.programs.rapid.expressions import ExpressionParser, NotUnderstood
from taskcal.programs.rapid.lexer import Token, words
from taskcal.programs.rapid.syntax import (
    Assignment,
    Branches,
    Declaration,
    Expression,
    Instruction,
    Label,
    Leave,
    Loop,
    Problem,
    Statement,
    Unparsed,
)
from taskcal.programs.rapid.words import TooMuch

MOST_STATEMENTS = 850_000
"""Statements and declarations of a file; 400 000 motions with as many declared targets are 50 MB."""

MOST_PROBLEMS = 100_000
"""Places of a file that are not understood; nobody reads of more."""

MOST_UNPARSED = 1_000_000
"""Words of a file that are not understood."""

STORAGE = ("const", "pers", "var")
ROUTINE_END = {"proc": "endproc", "func": "endfunc", "trap": "endtrap"}
HANDLERS = ("error", "undo", "backward")
_INNER_ENDS = ("endif", "elseif", "else", "endfor", "endwhile", "endtest", "case", "default")
_ROUTINE_ENDS = (*ROUTINE_END.values(), "endmodule", "module", "proc", "func", "trap")
_BLOCK_ENDS = frozenset((*_INNER_ENDS, *HANDLERS, *_ROUTINE_ENDS, "record", "endrecord"))
"""Words that a statement cannot begin with: a block ends before them, whether they close it or were meant for another."""

_LEAVING = ("return", "goto", "raise", "retry", "trynext", "exit")


class StatementParser(ExpressionParser):
    """Takes declarations and statements from tokens."""

    def __init__(self, text: str):
        super().__init__(text)
        self.problems: list[Problem] = []
        self._unparsed = 0
        """Words so far that are not understood."""
        self._statements = 0

    def note(self, position: int, text: str) -> Problem:
        """Note what cannot be understood.

        Raises:
            TooMuch: nothing of the file is, or hardly anything.
        """
        if len(self.problems) >= MOST_PROBLEMS:
            raise self._not_understood(f"at more than {MOST_PROBLEMS:,} places", self.problems[0])
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
        if self._statements > MOST_STATEMENTS:
            raise TooMuch(
                self.next.start,
                f"has more than {MOST_STATEMENTS:,} statements and declarations; divide it into several files",
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
            if self._unparsed > MOST_UNPARSED:
                raise self._not_understood(f"in more than {MOST_UNPARSED:,} words", [*self.problems, problem][0])
            tokens.append(token)
        return Unparsed(start=first, end=self.end, tokens=tuple(tokens), problem=problem)

    def declaration(self) -> Declaration:
        """Take a declaration of data."""
        start = self.next.start
        local = self.skip("local")
        self.skip("task")
        storage = self.take().key
        type_, name = self.name(), self.name()
        array = self.next.key == "{"
        if array:
            self.selected(name)
        value = self.expression() if self.skip(":=") else None
        self.expect(";")
        return Declaration(
            start=start, end=self.end, storage=storage, local=local, type=type_, name=name, array=array, value=value
        )

    def body(self, declarations: list[Declaration]) -> tuple[Statement, ...]:
        """Statements up to a handler or the end of the routine; an ENDIF or the like on the way closes nothing."""
        statements = [*self._block(declarations)]
        while self.next.key in _INNER_ENDS:
            stray = self.take()
            noted = self.note(stray.start, f"'{stray.text}' closes nothing")
            statements += [self.unparsed(stray.start, noted), *self._block(declarations)]
        return tuple(statements)

    def _block(self, declarations: list[Declaration]) -> tuple[Statement, ...]:
        statements: list[Statement] = []
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
                    statements.append(self._statement(declarations))
            except NotUnderstood as problem:
                self.depth = depth
                noted = self.note(problem.position, problem.text)
                self.recover(first, _ROUTINE_ENDS)
                statements.append(self.unparsed(first, noted))
        return tuple(statements)

    def _statement(self, declarations: list[Declaration]) -> Statement:
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

    def _simple(self) -> Statement:
        """An instruction, an assignment or a label."""
        name = self.name()
        start = name.start
        if self.skip(":"):
            return Label(start=start, end=self.end)
        if self.next.key in (".", "{", ":="):
            target = self.selected(name)
            self.expect(":=")
            value = self.expression()
            self.expect(";")
            return Assignment(start=start, end=self.end, target=target, value=value)
        arguments = self.arguments(";")
        self.expect(";")
        return Instruction(start=start, end=self.end, name=name, arguments=arguments)

    def _leave(self) -> Leave:
        keyword = self.take()
        value = None if self.next.key == ";" else self.expression()
        self.expect(";")
        return Leave(start=keyword.start, end=self.end, keyword=keyword.key, value=value)

    def _connect(self) -> Statement:
        """CONNECT gives an interrupt its trap: an instruction without arguments that matter here."""
        name = self.take()
        self.selected(self.name())
        self.expect("with")
        self.name()
        self.expect(";")
        return Instruction(start=name.start, end=self.end, name=name, arguments=())

    def _late_bound(self) -> Statement:
        """``%"name"% arguments;`` calls a procedure whose name is known only at run time."""
        name = self.take()
        self.expression()
        self.expect("%")
        arguments = self.arguments(";")
        self.expect(";")
        return Instruction(start=name.start, end=self.end, name=name, arguments=arguments)

    def _placeholder(self) -> Statement:
        """``<SMT>`` and the like, where a statement is still to be written."""
        first = self.take().start
        name = self.name()
        self.expect(">")
        return self.unparsed(
            first, Problem(position=name.start, text=f"'<{name.text}>' stands for what is still to be written")
        )

    def _if(self, declarations: list[Declaration]) -> Statement:
        start = self.take().start
        conditions: list[Expression] = [self.expression()]
        if not self.skip("then"):
            return self._compact_if(start, conditions[0], declarations)
        self.enter()
        branches = [self._block(declarations)]
        otherwise = False
        while True:
            if self.skip("elseif"):
                conditions.append(self.expression())
                self.expect("then")
            elif self.skip("else"):
                otherwise = True
            else:
                break
            branches.append(self._block(declarations))
        self._close("endif", start)
        return Branches(
            start=start, end=self.end, conditions=tuple(conditions), branches=tuple(branches), exhaustive=otherwise
        )

    def _compact_if(self, start: int, condition: Expression, declarations: list[Declaration]) -> Statement:
        self.enter()
        self.count()
        inner = self._statement(declarations)
        self.depth -= 1
        if isinstance(inner, Instruction):
            inner = Instruction(
                start=inner.start, end=inner.end, name=inner.name, arguments=inner.arguments, compact=True
            )
        return Branches(start=start, end=self.end, conditions=(condition,), branches=((inner,),), exhaustive=False)

    def _test(self, declarations: list[Declaration]) -> Statement:
        start = self.take().start
        conditions: list[Expression] = [self.expression()]
        self.enter()
        branches: list[tuple[Statement, ...]] = []
        otherwise = False
        while True:
            if self.skip("case"):
                conditions.append(self.expression())
                while self.skip(","):
                    conditions.append(self.expression())
                self.expect(":")
            elif self.skip("default"):
                self.expect(":")
                otherwise = True
            else:
                break
            branches.append(self._block(declarations))
        self._close("endtest", start)
        return Branches(
            start=start, end=self.end, conditions=tuple(conditions), branches=tuple(branches), exhaustive=otherwise
        )

    def _for(self, declarations: list[Declaration]) -> Statement:
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

    def _while(self, declarations: list[Declaration]) -> Statement:
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
    ) -> Loop:
        self.enter()
        body = self._block(declarations)
        self._close(closing, start)
        return Loop(start=start, end=self.end, counter=counter, conditions=tuple(conditions), body=body)

    def _close(self, keyword: str, start: int) -> None:
        """Read the word that closes a block."""
        self.depth -= 1
        if not self.skip(keyword):
            self.note(start, f"{keyword.upper()} is missing for what begins here")
