"""Values of data that the text gives: constants, variables that nothing assigns to, and what the flow of the program tells."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from taskcal.programs.rapid.computed import operated
from taskcal.programs.rapid.functions import COMPUTED
from taskcal.programs.rapid.held import Handed, Held, Origin, Variables
from taskcal.programs.rapid.names import Scope, Symbol
from taskcal.programs.rapid.predefined import Value
from taskcal.programs.rapid.syntax import (
    Aggregate,
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
from taskcal.programs.unresolved import Unresolved

CHAIN = 100
"""Values that lead to others through more steps than this probably lead to themselves."""

MOST_ELEMENTS = 1e7
"""No array has more."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """What a reference stands for."""

    value: Value
    type: str
    origin: Origin | None
    """Where it is declared; None where it was assigned or computed."""
    handed: Handed | None
    """How the parameter got it that the reference names; None where it names none, or what it holds was assigned to it."""
    literal: Expression | None
    """What holds it in the text: of its declaration, or of the argument that a parameter was given."""
    name: str
    """Of the data that are meant, such as a parameter's argument."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Values:
    """Reads values, given what is assigned to somewhere in the program."""

    assigned: Mapping[Symbol, str]
    """How, for each symbol: "is assigned to in part.mod:4"."""
    variables: Variables = field(default_factory=dict[Symbol, Held])
    """What the flow of the program tells of variables and parameters at the place where values are read."""
    _known: dict[Expression, Value] = field(default_factory=dict[Expression, Value])
    """Values of what is declared, so that each is computed once."""

    def at(self, variables: Variables) -> "Values":
        """Values where the flow of the program tells these."""
        return Values(assigned=self.assigned, variables=variables, _known=self._known)

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
            case Aggregate() if expression.is_plain and depth < CHAIN:
                return expression.numbers
            case Aggregate():
                return tuple(self.of(item, scope, depth + 1) for item in expression.items)
            case Reference():
                return self._of_reference(expression, scope, depth)
            case Operation():
                return self._of_operation(expression, scope, depth)
            case Call():
                return self._of_call(expression, scope, depth)

    def number(self, expression: Expression, scope: Scope, depth: int = 0) -> float:
        """The value of an expression that has to be a number.

        Raises:
            Unresolved: the text does not give it, or it is none.
        """
        value = self.of(expression, scope, depth)
        if not isinstance(value, float):
            raise Unresolved("a number is expected where there is none")
        return value

    def settable(self, expression: Expression, scope: Scope) -> bool:
        """Whether an operator may change what an expression gives by hand: it reads persistent data."""
        match expression:
            case Reference():
                symbol = scope.find(expression.name.text)
                held = None if symbol is None else self.variables.get(symbol)
                declaration = None if symbol is None else symbol.declaration
                own = declaration is not None and declaration.storage == "pers" if held is None else held.settable
                indices = (item for s in expression.selectors if isinstance(s, Index) for item in s.items)
                return own or any(self.settable(item, scope) for item in indices)
            case Aggregate() if not expression.is_plain:
                return any(self.settable(item, scope) for item in expression.items)
            case Operation():
                return any(self.settable(operand, scope) for operand in expression.operands)
            case Call():
                return any(a.value is not None and self.settable(a.value, scope) for a in expression.arguments)
            case _:
                return False

    def found(self, reference: Reference, scope: Scope, depth: int = 0) -> Found:
        """What a reference stands for.

        Raises:
            Unresolved: it is not declared in the files, or its value is not known from the text.
        """
        symbol = scope.find(reference.name.text)
        if symbol is None:
            raise Unresolved(f"'{reference.name.text}' is not declared in the files; pass the module that declares it")
        held = self.variables.get(symbol)
        if held is None and symbol in self.assigned:
            raise Unresolved(f"'{symbol.name}' {self.assigned[symbol]}, so its value is not known")
        if held is None and symbol.obstacle:
            raise Unresolved(symbol.obstacle)
        path, type_ = self.path(reference, symbol, scope, depth)
        if held is None or held.declared:
            origin = Origin(
                symbol=symbol, path=path, type=type_, node=_written_at(symbol, path), selectors=reference.selectors
            )
            value = self._declared(origin, depth)
            return Found(value=value, type=type_, origin=origin, handed=None, literal=origin.node, name=origin.name)
        value = _component(held.value, path, symbol)
        if held.handed is None:
            name = held.name if held.name and not path else symbol.name
            return Found(value=value, type=type_, origin=None, handed=None, literal=None, name=name)
        return _through(held.handed, value, path, type_, reference)

    def origin(self, reference: Reference, scope: Scope, depth: int = 0) -> Origin:
        """Where the value of a reference is declared.

        Raises:
            Unresolved: it is not declared in the files, or its value is not known from the text, or was assigned.
        """
        origin = self.found(reference, scope, depth).origin
        if origin is None:
            raise Unresolved(f"'{reference.name.text}' holds what was assigned to it")
        return origin

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
        return self.found(reference, scope, depth).value

    def _declared(self, origin: Origin, depth: int) -> Value:
        """The declared value of data, which does not follow what its parts hold later."""
        symbol = origin.symbol
        if origin.node is not None:
            return self._written(origin.node, symbol, depth)
        if symbol.declaration is not None and symbol.declaration.value is not None:
            value = self._written(symbol.declaration.value, symbol, depth)
        elif symbol.value is not None:
            value = symbol.value
        else:
            raise Unresolved(f"'{symbol.name}' is declared without a value")
        return _component(value, origin.path, symbol)

    def _written(self, node: Expression, symbol: Symbol, depth: int) -> Value:
        if symbol.scope is None:
            raise Unresolved(f"'{symbol.name}' is declared without a value")
        if isinstance(node, Number) and depth < CHAIN:
            return node.value
        if node not in self._known:
            self._known[node] = Values(assigned=self.assigned, _known=self._known).of(node, symbol.scope, depth + 1)
        return self._known[node]

    def _of_call(self, call: Call, scope: Scope, depth: int) -> Value:
        key = call.name.key
        if key in scope.routines or key not in COMPUTED:
            raise Unresolved(f"the value of {call.name.text}() is known only at run time")
        required = [a.value for a in call.arguments if not a.option and a.value is not None]
        options = {a.option: a.value for a in call.arguments if a.option and not a.conditional and a.value is not None}
        if len(required) + len(options) != len(call.arguments):
            raise Unresolved(f"the value of {call.name.text}() is known only at run time")
        given = [self.of(node, scope, depth + 1) for node in required]
        return COMPUTED[key](given, {name: self.of(node, scope, depth + 1) for name, node in options.items()})

    def _of_operation(self, operation: Operation, scope: Scope, depth: int) -> Value:
        if operation.operator == "()":
            return self.of(operation.operands[0], scope, depth + 1)
        return operated(operation.operator, [self.of(operand, scope, depth + 1) for operand in operation.operands])


def _written_at(symbol: Symbol, path: tuple[int, ...]) -> Expression | None:
    """What is written at a path of declared data; None where only a larger whole is."""
    return _inside(symbol.declaration.value if symbol.declaration else None, path)


def _inside(node: Expression | None, path: tuple[int, ...]) -> Expression | None:
    for item in path:
        if not isinstance(node, Aggregate) or item >= len(node.items):
            return None
        node = node.items[item]
    return node


def _component(value: Value, path: tuple[int, ...], symbol: Symbol) -> Value:
    for item in path:
        if not isinstance(value, tuple) or item >= len(value):
            raise Unresolved(f"'{symbol.name}' has no element {item + 1}")
        value = value[item]
    return value


def _through(handed: Handed, value: Value, path: tuple[int, ...], type_: str, reference: Reference) -> Found:
    """What a reference to a parameter stands for, whose argument is written in a call."""
    literal, origin = _inside(handed.literal, path), handed.origin
    if origin is not None:
        origin = replace(
            origin,
            path=(*origin.path, *path),
            type=type_,
            node=_inside(origin.node, path) if origin.node is not None else None,
            selectors=(*origin.selectors, *reference.selectors),
        )
        literal = origin.node
    name = reference.name.text if origin is None else origin.name
    return Found(value=value, type=type_, origin=origin, handed=handed, literal=literal, name=name)
