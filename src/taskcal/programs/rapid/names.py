"""Which declaration a name stands for, by RAPID's rules of scope."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from taskcal.programs.rapid.lexer import Token
from taskcal.programs.rapid.predefined import DATA, TYPES, Value
from taskcal.programs.rapid.syntax import Declaration, Module, Routine
from taskcal.programs.source import Source
from taskcal.programs.unresolved import Unresolved


@dataclass(frozen=True, eq=False, kw_only=True)
class File:
    """A file with its modules."""

    source: Source
    modules: tuple[Module, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Symbol:
    """Data that a name can stand for."""

    name: str
    type: str
    """In lower case."""
    declaration: Declaration | None = None
    """None for what is not declared as data in the files."""
    file: File | None = None
    scope: "Scope | None" = None
    """Where its value is to be read."""
    value: Value | None = None
    """Of predefined data."""
    obstacle: str = ""
    """Why it has no value in the text."""
    parameter_of: str = ""
    """Key of the routine whose parameter it is."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Scope:
    """What names mean at some place: own names first, then those of the module, then those of all modules."""

    module: Mapping[str, list[Symbol]]
    shared: Mapping[str, list[Symbol]]
    own: Mapping[str, list[Symbol]] = field(default_factory=dict[str, list[Symbol]])
    types: Mapping[str, tuple[tuple[str, str], ...]]
    routines: Mapping[str, tuple[Routine, ...]]
    """All routines of the files."""

    def find(self, name: str) -> Symbol | None:
        """What a name stands for; None where nothing of that name is known.

        Raises:
            Unresolved: it is declared several times.
        """
        key = name.lower()
        for names in (self.own, self.module, self.shared):
            declared = names.get(key)
            if declared:
                if len(declared) > 1:
                    raise Unresolved(f"'{name}' is declared {len(declared)} times")
                return declared[0]
        if key in DATA:
            type_, value = DATA[key]
            return Symbol(name=name, type=type_, value=value)
        return None

    def with_counter(self, counter: Token | None) -> "Scope":
        """The scope inside a FOR, which declares its counter."""
        if counter is None:
            return self
        symbol = Symbol(name=counter.text, type="num", obstacle=f"'{counter.text}' counts a loop")
        return Scope(
            module=self.module, shared=self.shared, own={**self.own, counter.key: [symbol]}, types=self.types,
            routines=self.routines,
        )  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class Context:
    """A module or routine with the scope that holds in it."""

    file: File
    module: Module
    routine: Routine | None
    scope: Scope
    declared: tuple[Symbol, ...]
    """Data declared right here."""


def contexts(files: Iterable[File]) -> Iterator[Context]:
    """Every module and every routine of the files, in the order of the text, with its names."""
    files = tuple(files)
    shared: dict[str, list[Symbol]] = {}
    types = dict(TYPES)
    named: dict[str, list[Routine]] = {}
    routines: dict[str, tuple[Routine, ...]] = {}
    of_module: dict[int, dict[str, list[Symbol]]] = {}
    scopes: dict[int, Scope] = {}
    for file in files:
        for module in file.modules:
            own = of_module[id(module)] = {}
            scope = scopes[id(module)] = Scope(module=own, shared=shared, types=types, routines=routines)
            for symbol in _declared(module.declarations, file, scope):
                key = symbol.name.lower()
                own.setdefault(key, []).append(symbol)
                if symbol.declaration is not None and not symbol.declaration.local:
                    shared.setdefault(key, []).append(symbol)
            types.update({record.name.key: record.components for record in module.records})
            for routine in module.routines:
                named.setdefault(routine.name.key, []).append(routine)
    routines.update({key: tuple(same) for key, same in named.items()})
    for file in files:
        for module in file.modules:
            scope = scopes[id(module)]
            declared = tuple(symbol for symbols in scope.module.values() for symbol in symbols)
            yield Context(file=file, module=module, routine=None, scope=scope, declared=declared)
            for routine in module.routines:
                yield _inside(routine, file, module, scope)


def _inside(routine: Routine, file: File, module: Module, outer: Scope) -> Context:
    own: dict[str, list[Symbol]] = {}
    scope = Scope(module=outer.module, shared=outer.shared, own=own, types=outer.types, routines=outer.routines)
    for parameter in routine.parameters:
        why = f"'{parameter.name.text}' is a parameter of the routine '{routine.name.text}'"
        own[parameter.name.key] = [
            Symbol(name=parameter.name.text, type=parameter.type, obstacle=why, parameter_of=routine.name.key)
        ]
    declared = tuple(_declared(routine.declarations, file, scope))
    for symbol in declared:
        own.setdefault(symbol.name.lower(), []).append(symbol)
    return Context(file=file, module=module, routine=routine, scope=scope, declared=declared)


def _declared(declarations: Iterable[Declaration], file: File, scope: Scope) -> Iterator[Symbol]:
    for declaration in declarations:
        yield Symbol(
            name=declaration.name.text, type=declaration.type.key, declaration=declaration, file=file, scope=scope,
            obstacle="" if declaration.value else f"'{declaration.name.text}' is declared without a value",
        )  # fmt: skip
