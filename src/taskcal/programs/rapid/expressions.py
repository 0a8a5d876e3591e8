"""The parser's lower half: words to expressions and arguments."""

from taskcal.programs.rapid.lexer import Token, list_end, number
from taskcal.programs.rapid.syntax import (
    Aggregate,
    Argument,
    Call,
    Component,
    Expression,
    Index,
    Number,
    Operation,
    Reference,
    Text,
    Truth,
)
from taskcal.programs.rapid.words import TooMuch, Words

DEPTH = 60
"""Brackets and blocks nested deeper than this are no program."""

MOST_ARGUMENTS = 1000
"""Of one instruction; those of the controller have twenty at most."""

_RESERVED = """
    alias and backward case connect const default div do else elseif endfor endfunc endif endmodule endproc endrecord
    endtest endtrap endwhile error exit false for from func goto if inout local mod module nostepin not noview or pers
    proc raise readonly record retry return step sysmodule test then to trap true trynext undo var viewonly while with
    xor
"""
RESERVED = frozenset(_RESERVED.split())
"""Words that are not names."""

_BINDING = {
    "or": 1, "xor": 1, "and": 2, "=": 3, "<>": 3, "<": 3, ">": 3, "<=": 3, ">=": 3, "+": 4, "-": 4,
    "*": 5, "/": 5, "div": 5, "mod": 5,
}  # fmt: skip
"""Operators between two values; those with higher numbers bind tighter."""


class NotUnderstood(Exception):
    """The words at a place cannot be read."""

    def __init__(self, position: int, text: str):
        self.position, self.text = position, text
        super().__init__(text)


class ExpressionParser(Words):
    """Reads expressions from words, one after the other."""

    def __init__(self, text: str):
        super().__init__(text)
        self.depth = 0
        """Brackets and blocks that are open."""
        self.height = 0
        """Values inside values of the expression read last."""

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

    def enter(self) -> None:
        """Count a bracket or block that opens."""
        self.depth += 1
        if self.depth > DEPTH:
            raise self.problem(f"brackets or blocks are nested deeper than {DEPTH} at")

    def grow(self, height: int) -> None:
        """Note that the expression read last contains others of some height."""
        self.height = height + 1
        if self.height > DEPTH:
            raise self.problem(f"an expression is nested deeper than {DEPTH} at")

    def expression(self) -> Expression:
        """Read an expression."""
        self.count_value()
        self.enter()
        try:
            return self._operation(0)
        finally:
            self.depth -= 1

    def _operation(self, weakest: int) -> Expression:
        """Operands joined by operators that bind tighter than the weakest (precedence climbing)."""
        left = self._unary()
        height = self.height
        while self.next.kind in ("name", "symbol") and _BINDING.get(self.next.key, 0) > weakest:
            operator = self.take().key
            right = self._operation(_BINDING[operator])
            left = Operation(start=left.start, end=right.end, operator=operator, operands=(left, right))
            self.grow(max(height, self.height))
            height = self.height
        return left

    def _unary(self) -> Expression:
        token = self.next
        if not self.skip("-", "+", "not"):
            return self._primary()
        self.enter()
        try:
            operand = self._unary()
        finally:
            self.depth -= 1
        if isinstance(operand, Number) and token.key in "+-":
            value = -operand.value if token.key == "-" else operand.value
            return Number(start=token.start, end=operand.end, value=value)
        self.grow(self.height)
        return Operation(start=token.start, end=operand.end, operator=token.key, operands=(operand,))

    def _primary(self) -> Expression:
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
                return Text(start=token.start, end=token.end, value=token.text[1:-1].replace('""', '"'))
            case "name" if token.key in ("true", "false"):
                self.take()
                return Truth(start=token.start, end=token.end, value=token.key == "true")
            case "name":
                return self._named()
            case _:
                if token.key == "[" and (end := self._numbers(token.start)):
                    self.jump(end)
                    self.grow(0)
                    return Aggregate(start=token.start, end=end, held=self.text)
                if self.skip("["):
                    items = self._list("]")
                    self.grow(self.height)
                    return Aggregate(start=token.start, end=self.end, held=items)
                if self.skip("("):
                    inner = self.expression()
                    self.expect(")")
                    self.grow(self.height)
                    return Operation(start=token.start, end=self.end, operator="()", operands=(inner,))
                raise self.problem("a value is missing before")

    def _numbers(self, start: int) -> int:
        """Behind a list of nothing but numbers; 0 where there is none, or where its signs are nested too deeply."""
        return list_end(self.text, start) if self.depth + 2 <= DEPTH else 0

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
            if len(arguments) == MOST_ARGUMENTS:
                raise TooMuch(start, f"has more than {MOST_ARGUMENTS:,} arguments in one call; is it a RAPID module?")
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
