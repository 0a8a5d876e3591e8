"""Values of data that the text alone gives: constants, and variables that nothing assigns to."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from taskcal.programs.rapid.names import Scope, Symbol
from taskcal.programs.rapid.predefined import Value
from taskcal.programs.rapid.syntax import (
    Aggregate,
    Component,
    Expression,
    Index,
    Number,
    Operation,
    Reference,
    Text,
    Truth,
)
from taskcal.programs.unresolved import Unresolved

CHAIN = 100
"""Values that lead to others through more steps than this probably lead to themselves."""

MOST_ELEMENTS = 1e7
"""No array has more."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Origin:
    """Where a value is declared."""

    symbol: Symbol
    path: tuple[int, ...]
    """Which component or element of it, counted from 0."""
    type: str
    node: Expression | None
    """What is written there; None where only a larger whole is written."""
    selectors: tuple[Component | Index, ...]
    """How the reference says the path."""

    @property
    def name(self) -> str:
        """As ``p{3}`` or ``st{2}.pick``, with the value of each index."""
        items, text = iter(self.path), self.symbol.name
        for selector in self.selectors:
            match selector:
                case Index():
                    text += "{" + ",".join(str(next(items) + 1) for _ in selector.items) + "}"
                case Component():
                    next(items)
                    text += f".{selector.key}"
        return text


@dataclass(frozen=True, eq=False, kw_only=True)
class Values:
    """Reads values, given what is assigned to somewhere in the program."""

    assigned: Mapping[Symbol, str]
    """How, for each symbol: "is assigned to in part.mod:4"."""
    _known: dict[Expression, Value] = field(default_factory=dict[Expression, Value])
    """Values of what is written, so that each is computed once."""

    def of(self, expression: Expression, scope: Scope, depth: int = 0) -> Value:
        """The value of an expression.

        Raises:
            Unresolved: the text does not give it.
        """
        if depth > CHAIN:
            raise Unresolved("data refer to each other in a circle, or too deeply")
        match expression:
            case Number() | Text() | Truth():
                return expression.value
            case Aggregate():
                return tuple(self.of(item, scope, depth + 1) for item in expression.items)
            case Reference():
                return self._of_reference(expression, scope, depth)
            case Operation():
                return self._of_operation(expression, scope, depth)
            case _:
                raise Unresolved(f"the value of {expression.name.text}() is known only at run time")

    def number(self, expression: Expression, scope: Scope, depth: int = 0) -> float:
        """The value of an expression that has to be a number.

        Raises:
            Unresolved: the text does not give it, or it is none.
        """
        value = self.of(expression, scope, depth)
        if not isinstance(value, float):
            raise Unresolved("a number is expected where there is none")
        return value

    def origin(self, reference: Reference, scope: Scope, depth: int = 0) -> Origin:
        """Where the value of a reference is declared.

        Raises:
            Unresolved: it is not declared in the files, or its value is not known from the text.
        """
        symbol = scope.find(reference.name.text)
        if symbol is None:
            raise Unresolved(f"'{reference.name.text}' is not declared in the files; pass the module that declares it")
        if symbol in self.assigned:
            raise Unresolved(f"'{symbol.name}' {self.assigned[symbol]}, so its value is not known")
        if symbol.obstacle:
            raise Unresolved(symbol.obstacle)
        path, type_ = self.path(reference, symbol, scope, depth)
        node = symbol.declaration.value if symbol.declaration else None
        for item in path:
            if not isinstance(node, Aggregate) or item >= len(node.items):
                return Origin(symbol=symbol, path=path, type=type_, node=None, selectors=reference.selectors)
            node = node.items[item]
        return Origin(symbol=symbol, path=path, type=type_, node=node, selectors=reference.selectors)

    def path(self, reference: Reference, symbol: Symbol, scope: Scope, depth: int = 0) -> tuple[tuple[int, ...], str]:
        """Which component or element of its data a reference means, and the type of that.

        Raises:
            Unresolved: an index is not known, or there is no such component.
        """
        path: list[int] = []
        type_ = symbol.type
        for selector in reference.selectors:
            match selector:
                case Index():
                    for item in selector.items:
                        index = self.number(item, scope, depth + 1)
                        if not 1.0 <= index <= MOST_ELEMENTS or index != int(index):
                            raise Unresolved(f"{index:g} is not an index of '{symbol.name}'")
                        path.append(int(index) - 1)
                case Component():
                    names = [name for name, _ in scope.types.get(type_, ())]
                    if selector.key not in names:
                        raise Unresolved(f"'{symbol.name}' has no component '{selector.key}'")
                    path.append(names.index(selector.key))
                    type_ = scope.types[type_][path[-1]][1]
        return tuple(path), type_

    def _of_reference(self, reference: Reference, scope: Scope, depth: int) -> Value:
        origin = self.origin(reference, scope, depth)
        symbol = origin.symbol
        if origin.node is not None:
            return self._written(origin.node, symbol, depth)
        if symbol.declaration is not None and symbol.declaration.value is not None:
            value = self._written(symbol.declaration.value, symbol, depth)
        elif symbol.value is not None:
            value = symbol.value
        else:
            raise Unresolved(f"'{symbol.name}' is declared without a value")
        for item in origin.path:
            if not isinstance(value, tuple) or item >= len(value):
                raise Unresolved(f"'{symbol.name}' has no element {item + 1}")
            value = value[item]
        return value

    def _written(self, node: Expression, symbol: Symbol, depth: int) -> Value:
        if symbol.scope is None:
            raise Unresolved(f"'{symbol.name}' is declared without a value")
        if node not in self._known:
            self._known[node] = self.of(node, symbol.scope, depth + 1)
        return self._known[node]

    def _of_operation(self, operation: Operation, scope: Scope, depth: int) -> Value:
        if operation.operator == "()":
            return self.of(operation.operands[0], scope, depth + 1)
        values = [self.number(operand, scope, depth + 1) for operand in operation.operands]
        match operation.operator, values:
            case "-", [a]:
                return -a
            case "+", [a]:
                return a
            case "+", [a, b]:
                return a + b
            case "-", [a, b]:
                return a - b
            case "*", [a, b]:
                return a * b
            case "/", [a, b] if b != 0.0:
                return a / b
            case _:
                raise Unresolved(f"the operator {operation.operator.upper()} is not evaluated")
