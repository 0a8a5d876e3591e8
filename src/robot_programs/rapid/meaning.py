"""What RAPID's data and motions mean: values of declarations, functions, targets with where they stand, and how motions move."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from robot_programs.core import flow
from robot_programs.core.form import (
    Ask,
    Assign,
    Check,
    Do,
    Expression,
    Key,
    Line,
    Lit,
    Op,
    Rec,
    Ref,
    Routine,
    asks_in,
    changed,
    expressions,
    inside,
)
from robot_programs.core.interpreter import FoundMotion, Interpreter, LanguageMeaning, Path
from robot_programs.core.program import THROUGH_TARGET, Cause, Unresolved, Zone
from robot_programs.core.values import Lost, Settable, Structure, operated
from robot_programs.rapid.lower import SOFT, Instructed, LoweredRapid, Unread
from robot_programs.rapid.names import DATA, LATE, ModuleFile, Symbol, Value
from robot_programs.rapid.resolve import (
    MOTION_FORMS,
    Manner,
    MoveInstruction,
    RapidSite,
    Settings,
    TargetArgument,
    TargetType,
    in_base,
    speeds,
    target_numbers,
    zone_of,
)
from robot_programs.rapid.values import (
    COMPUTED,
    MAX_BLANK,
    MAX_ELEMENTS,
    OPERATORS,
    TARGETS,
    Listed,
    PassedArgument,
    TracedOrigin,
    frames_of,
    plain,
    plain_once,
    structured,
)

MAX_PASSES = 4
"""As many lines as the program has, so many times, are gone through again for calls and the turns of loops; behind that, what
routines set is taken as not known."""

MAX_REFERENCES = 200
"""Values that lead to others through more steps than this probably lead to themselves."""

PER_REFERENCE = 5
"""Steps from a datum to the value that is declared, beside those of its expression."""

MAX_RECORDS = 10
"""Records in each other; a record that holds itself is an error."""

INITIAL: Mapping[str, Value] = {"num": 0.0, "dnum": 0.0, "bool": False, "string": ""}
"""What variables hold that are declared without a value (RAPID overview, variable declarations)."""

NAMED = (*TARGETS, "tooldata", "wobjdata")
"""Types of data that are told by where they are declared."""

_CIRCLE = Lost(reason="cannot be followed: data refer to each other in a circle, or too deeply")
_SHIFTS = ("offs", "reltool")


@dataclass(eq=False, kw_only=True)
class RapidMeaning(LanguageMeaning):
    """Data and motions of the modules of a program."""

    PASSES: ClassVar = MAX_PASSES
    SET: ClassVar = "is assigned to, so its value is not known"

    files: Sequence[ModuleFile]
    lowered: LoweredRapid
    settings: Settings
    soft: dict[MoveInstruction, None] = field(default_factory=dict[MoveInstruction, None])
    """Motions in which a servo may give way."""
    known: dict[Key, Any] = field(default_factory=dict[Key, Any])
    """What is declared, made once."""
    depth: int = 0
    """Steps through declared values that are being made, each for the one before."""
    pure: dict[Routine, bool] = field(default_factory=dict[Routine, bool])
    """Which functions only compute a value, as far as that was asked."""
    softens: bool = False
    """Whether something lets servos give way."""

    def begin(self, flow: Interpreter) -> None:
        """Take what goes through the program; what is declared may be known otherwise then."""
        super().begin(flow)
        self.known.clear()

    # Data.

    def declared(self, key: Key) -> Any:
        """The value of a declaration."""
        if key not in self.known:
            steps = PER_REFERENCE + _height(self.lowered.values.get(key) if isinstance(key, Symbol) else None)
            if self.depth + steps > MAX_REFERENCES:
                return _CIRCLE
            self.known[key] = _CIRCLE
            self.depth += steps
            try:
                self.known[key] = self._declared(key)
            finally:
                self.depth -= steps
        return self.known[key]

    def _declared(self, key: Key) -> Any:
        if not isinstance(key, Symbol) or key is SOFT:
            return Lost(reason="is not known")
        if key in self.lowered.values and key.declaration is not None:
            value = self.flow.evaluated(self.lowered.values[key])
            return self._owned(value, key, (), key.type, key.declaration.dimensions, key.name)
        if key.value is not None:
            return self._owned(structured(key.value), key, (), key.type, 0, key.name)
        return Lost(reason=key.obstacle.removeprefix(f"'{key.name}' ") or "is declared without a value")

    def _owned(self, value: Any, symbol: Symbol, path: Path, type_: str, dimensions: int, name: str) -> Any:
        """A declared value, with where its parts are declared."""
        persistent = symbol.declaration is not None and symbol.declaration.storage == "pers"
        if not isinstance(value, Structure):
            return _alone(value, persistent=persistent)
        origin, parts = value.origin, value.parts
        constant = symbol.declaration is not None and symbol.declaration.storage == "const"
        named = isinstance(origin, TracedOrigin) and constant and is_constant(origin.owner) and not origin.path
        if named and type_ in TARGETS and isinstance(origin, TracedOrigin) and origin.symbol.type == type_:
            return value  # declared by the name of another one
        types = symbol.scope.types if symbol.scope is not None else {}
        if isinstance(parts, Listed) or (type_ in NAMED and not dimensions):
            parts = _alone(value, persistent=persistent).parts
        else:
            inner = parts_of(type_, dimensions, types, name)
            parts = {
                at: self._owned(part, symbol, (*path, at), *inner(int(str(at))))
                if isinstance(part, Structure) or persistent else part
                for at, part in parts.items()
            }  # fmt: skip
        literal = origin.literal if isinstance(origin, TracedOrigin) and origin.owner is None else None
        at = (0, 0, 0) if origin is None else origin.at
        return replace(
            value, parts=parts, origin=TracedOrigin(at=at, owner=symbol, path=path, name=name, literal=literal)
        )

    def stated(self, ref: Ref) -> Path:
        """Places of the parts of parts to which a path leads, as far as its indices are numbers."""
        found = list[Hashable]()
        for index in parts_named(ref):
            if not isinstance(index, Lit) or not isinstance(index.value, float):
                break
            found.append(int(index.value) - 1)
        return tuple(found)

    def part_names(self, value: Structure, indices: Sequence[float]) -> Sequence[Hashable]:
        """Places, counted from 0."""
        names = list[Hashable]()
        for index in indices:
            if not 1.0 <= index <= MAX_ELEMENTS or index != int(index):
                raise Unresolved(f"{index:g} is not an index")
            names.append(int(index) - 1)
        return names

    def called(self, ref: Ref, indices: Sequence[float]) -> str:
        """Name of the data, which is that of their parts."""
        return ref.name

    def lost(self, ref: Ref, name: str, reason: str) -> str:
        """What is said of data that are not known: where they are set first, if that may be anywhere."""
        anywhere = plain(self.flow.known_anywhere(ref.key))
        return super().lost(ref, name, anywhere.reason if isinstance(anywhere, Lost) else reason)

    def computed_index(self, name: str, why: Unresolved) -> Unresolved:
        """What is said where an index is not known."""
        return why

    def how_set(self, by: Line | Ask, ref: Ref) -> str:
        """Where data are set, or may be."""
        source = self.files[ref.at[0]].source
        place = source.place(ref.at[1])
        match by:
            case Unread():
                how = f"may be assigned to in {place}, which is not understood ({by.problem.trouble(source)})"
            case Instructed() | Ask() if ref in by.lends:
                named = f"{by.name}, which is not in the files given,"
                how = f"may be changed by {'the procedure that is called by name' if by.name in LATE else named} in {place}"
            case _:
                how = f"is assigned to in {place}"
        return f"{how}, so its value is not known"

    def is_settable(self, key: Key) -> bool:
        """Whether data are persistent."""
        return isinstance(key, Symbol) and key.declaration is not None and key.declaration.storage == "pers"

    def is_fixed(self, key: Key) -> bool:
        """Whether data are constant, or the system's."""
        return isinstance(key, Symbol) and key is not SOFT and not (key.may_change or key.parameter_of)

    def initial(self, key: Key) -> Any:
        """What a variable holds when it is declared anew; None of other data."""
        if not isinstance(key, Symbol) or key.declaration is None or key.declaration.storage != "var":
            return None
        nothing = Lost(reason=key.obstacle)
        value = self.declared(key) if key.declaration.value_at else self._blank(key, lambda t: INITIAL.get(t, nothing))
        return None if isinstance(value, Lost) else value

    def fresh(self, routine: Routine) -> Mapping[Key, Any]:
        """In main the declared values of variables: a controller declares them anew where the program pointer is moved to main.

        It keeps them where main begins again behind its end.
        """
        found: dict[Key, Any] = {SOFT: False} if self.softens else {}
        if routine.begins:
            for module in self.lowered.modules:
                for symbol in module.declared:
                    value = self.initial(symbol)
                    if value is not None:
                        found[symbol] = value
        return found

    def blank(self, key: Key, names: Sequence[Hashable], lost: Lost) -> Any:
        """Data of which nothing is known, by their components."""
        if not isinstance(key, Symbol):
            return lost
        value = self._blank(key, lambda _: lost)
        for name in names:
            value = value.parts.get(name, lost) if isinstance(value, Structure) else lost
        return value

    def _blank(self, symbol: Symbol, leaf: Callable[[str], Value]) -> Any:
        """A value of the type of data, without any that is declared; `Lost` where there are very many elements."""
        if symbol.scope is None or symbol.declaration is None:
            return Lost(reason=symbol.obstacle)
        value, count = _blank(symbol.type, symbol.scope.types, leaf), 1.0
        for size in reversed(self.lowered.sizes.get(symbol, ())):
            number = self.flow.evaluated(size)
            count *= number if isinstance(number, float) else 0.0
            if not 1.0 <= count <= MAX_BLANK or number != int(number):
                return Lost(reason="has too many elements")
            value = Structure(kind="", parts=dict.fromkeys(range(int(number)), value))
        return value

    def coerced(self, key: Key, value: Any) -> Any:
        """What data hold when a value is assigned to them: its numbers stand elsewhere, of which the name is kept."""
        if isinstance(value, Lost):
            said = next(iter(self.flow.changes.paths.get(key, {}).values()), self.SET)
            return (
                value
                if value.reason in (said, self.SET)
                else Lost(reason=Cause(f"{said}: {value.reason}", of=[value.reason]))
            )
        if not isinstance(value, Structure) or value.origin is None:
            return value
        origin = value.origin
        name = origin.name if isinstance(origin, TracedOrigin) else ""
        return replace(value, origin=TracedOrigin(at=(0, 0, 0), owner=None, name=name, assigned=True) if name else None)

    def given(self, ask: Do | Ask, argument: Expression, parameter: Key, value: Any) -> Any:
        """What a parameter holds, with how it was given that."""
        if not isinstance(value, Structure) or not isinstance(parameter, Symbol):
            return value
        if not isinstance(argument, Ref):
            if not self.computes(argument):
                return replace(value, origin=None)
            literal = (
                value.origin.literal
                if isinstance(value.origin, TracedOrigin) and isinstance(argument, Lit | Rec)
                else None
            )
            passed = PassedArgument(argument=argument.at, parameters=(parameter,))
            return replace(value, origin=TracedOrigin(at=argument.at, owner=None, literal=literal, passed=passed))
        return self._handed(value, argument, parameter)

    def _handed(self, value: Structure, argument: Ref, parameter: Symbol) -> Structure:
        origin = value.origin
        if isinstance(origin, TracedOrigin) and not origin.assigned:
            passed = origin.passed
            if passed is None:
                passed = PassedArgument(argument=argument.at, parameters=(parameter,))
            else:
                passed = replace(
                    passed, reads=passed.reads | {argument.at[:2]}, parameters=(*passed.parameters, parameter),
                    selected=passed.selected or bool(argument.path),
                )  # fmt: skip
            value = replace(value, origin=replace(origin, passed=passed))
        if isinstance(value.parts, Listed) or not any(
            isinstance(p, Structure) and p.origin for p in value.parts.values()
        ):
            return value
        parts = {
            at: self._handed(part, argument, parameter) if isinstance(part, Structure) else part
            for at, part in value.parts.items()
        }
        return replace(value, parts=parts)

    # Operators and functions.

    def operate(self, sign: str, values: Sequence[Any]) -> Any:
        """Value of an operator; brackets leave it as it is, and the step of a loop leads to its end."""
        match sign, values:
            case "()", [value]:
                return value
            case "step", _:
                return 1.0 if operated("<=", values) else -1.0
            case _:
                return operated(sign, [plain(value) for value in values], OPERATORS)

    def function(self, ask: Ask, values: Sequence[Any]) -> Any:
        """Value of a function of the system."""
        key = ask.name.lower()
        if key not in COMPUTED:
            raise Unresolved(f"the value of {ask.name}() is known only at run time")
        count = len(values) - len(ask.options)
        options = dict(zip(ask.options, map(plain, values[count:]), strict=True))
        found = structured(COMPUTED[key]([plain(value) for value in values[:count]], options))
        if key in _SHIFTS and isinstance(found, Structure) and isinstance(values[0], Structure):
            return replace(found, origin=TracedOrigin(at=ask.at, owner=None, base=values[0]))
        return found

    def computes(self, expression: Expression) -> bool:
        """Whether the functions in an expression only give values."""
        return all(
            not (ask.changes or ask.moves) and all(map(self._only_computes, ask.routines))
            for ask in asks_in(expression)
        )

    def _only_computes(self, routine: Routine) -> bool:
        """Whether a function does nothing but give a value, so that its call can be left out once that is known."""
        if routine not in self.pure:
            self.pure[routine] = False  # of one that calls itself nothing is known
            own = {*routine.variables, *routine.parameters} - routine.returning
            self.pure[routine] = not routine.handlers and all(
                self._line_computes(line, own) for line in flow.lines_in(routine.nodes)
            )
        return self.pure[routine]

    def _line_computes(self, line: Any, own: set[Key]) -> bool:
        match line:
            case Assign():
                return line.target.key in own and self.computes(line.target) and self.computes(line.value)
            case Check():
                return all(map(self.computes, line.conditions))
            case _:
                return False

    # Motions.

    def incomplete(self, line: Any, why: Unresolved, settings: Mapping[str, Any]) -> Unresolved:
        """What is said of a motion to a target that is not known: all that has to be stated, at once."""
        if self._is_shifted(line):
            return Unresolved(self.settings.shift)
        try:
            self._manner(line, settings)
        except Unresolved as reason:
            return Unresolved(Cause(f"{reason}; {why}", of=[reason, why]))
        return why

    def motion(self, line: Any, points: Sequence[Any], settings: Mapping[str, Any]) -> FoundMotion:
        """The motion of an instruction."""
        assert isinstance(line, MoveInstruction)
        if self._is_shifted(line):
            raise Unresolved(self.settings.shift)
        for point in line.points:
            if isinstance(point, Ask | Rec | Ref) and not self.computes(point):
                raise Unresolved("its point comes from a function that does more than compute it")
        type_ = MOTION_FORMS[line.key].target
        try:
            manner = self._manner(line, settings)
        except Unresolved as reason:
            try:
                self._targets(line, points, type_)
            except Unresolved as other:
                raise Unresolved(Cause(f"{reason}; {other}", of=[reason, other])) from None
            raise
        (end, *via) = self._targets(line, points, type_)[::-1]
        if self.softens and settings.get("soft") is not False:
            self.soft[line] = None
        by = via[0] if via else None
        found = RapidSite(line=line, file=self.files[line.at[0]], end=end, via=by, manner=manner)
        meaning = (*_meaning(end), *(_meaning(by) if by else ()), manner.meaning)
        return FoundMotion(motion=None, written=found, meaning=meaning)

    def _is_shifted(self, line: MoveInstruction) -> bool:
        return bool(self.settings.shift) and MOTION_FORMS[line.key].kind != "axes"

    def _targets(self, line: MoveInstruction, points: Sequence[Any], type_: TargetType) -> list[TargetArgument]:
        return [self._target(one, value, type_, one) for one, value in zip(line.points, points, strict=True)]

    def _target(self, point: Expression, value: Any, type_: TargetType, argument: Expression) -> TargetArgument:
        """A target: data, what Offs or RelTool shifts, or what stands in the argument."""
        origin = value.origin if isinstance(value, Structure) else None
        traced = origin if isinstance(origin, TracedOrigin) and not origin.assigned else None
        what, named = "the target", point if isinstance(point, Ref) else None
        if isinstance(point, Ask):
            if not point.routines and point.name.lower() in _SHIFTS and traced is not None and type_ == "robtarget":
                return self._shifted(point, value, traced, argument)
            traced, what = None, f"what {point.name}() returns"
        declared = traced if traced is not None and traced.owner is not None else None
        passed, literal = (None, None) if traced is None else (traced.passed, traced.literal)
        if named is not None:
            name = named.name.strip("'") if declared is None else declared.name
            what = f"'{name}'"
        try:
            meant, external = target_numbers(plain(value), type_, what)
        except Unresolved:
            if named is None:
                raise
            meant, external = target_numbers(self._told(plain(value), named), type_, what)
        at = argument.at if passed is None else passed.argument
        file = self.files[at[0]]
        return TargetArgument(
            argument=at, type=type_, origin=declared, literal=literal,
            file=file if declared is None else declared.symbol.file or file,
            passed=passed, read_at=0 if passed is None else point.at[1],
            whole=passed is None or not (passed.selected or (named is not None and named.path)),
            meant=meant, external=external,
        )  # fmt: skip

    def _shifted(self, point: Ask, value: Any, traced: TracedOrigin, argument: Expression) -> TargetArgument:
        base = self._target(point.arguments[0], traced.base, "robtarget", argument)
        inner, file = base, self.files[argument.at[0]]
        if inner.passed is not None:
            # what the call gives is read for other numbers than these, which the motion has to state
            inner = replace(inner, argument=argument.at, origin=None, literal=None, file=file, passed=None)
        meant, _ = target_numbers(plain(value), "robtarget", "the target")
        return replace(
            inner, meant=meant, base=base, along_part=point.name.lower() == "offs",
            read_at=point.arguments[0].at[1],
        )  # fmt: skip

    def _manner(self, line: MoveInstruction, settings: Mapping[str, Any]) -> Manner:
        """How a motion moves.

        Raises:
            Unresolved: the text does not say.
        """
        key = (id(line.settings), *map(id, settings.values()))
        known = self.settings.manners.get(key)
        if known is not None:
            return known[0]
        options, form = line.options, MOTION_FORMS[line.key]
        frames = in_base(frames_of(*self._frames(line, settings)), self.settings)
        if "id" in options and frames.carrier:
            raise Unresolved(
                f"\\ID synchronises it with another mechanism, and its work object '{frames.part.name}' moves with "
                f"{frames.carrier}, whose place then is not in the text"
            )
        stops, zone = self._zone(line, settings)
        speed, turn_speed = speeds(_read(settings.get("speed")), _read(settings.get("v")), stated="v" in settings)
        manner = Manner(
            frames=frames, stops=stops, zone=zone,
            speed=speed if form.speed_counts or "on" in options else None, turn_speed=turn_speed,
            divisible=form.repeats and not options & {"on", "off", "id"},
            external_offset="" if "noeoffs" in options else self.settings.external_offset,
            meanings=self.settings.meanings,
        )  # fmt: skip
        self.settings.manners[key] = manner, (line.settings, settings)  # which keep what the key names
        return manner

    def _frames(self, line: MoveInstruction, settings: Mapping[str, Any]) -> list[tuple[str, Value]]:
        """Names and values of the tool and the work object."""
        found, unknown = list[tuple[str, Value]](), list[Unresolved]()
        for name in ("tool", "wobj"):
            if name not in line.settings:
                found.append(("wobj0", DATA["wobj0"][1]))
                continue
            try:
                found.append(self._frame(line.settings[name], settings[name]))
            except Unresolved as why:
                unknown.append(why)
        if unknown:
            raise Unresolved(Cause("; ".join(map(str, unknown)), of=unknown))
        return found

    def _frame(self, stated: Expression, value: Any) -> tuple[str, Value]:
        named = stated.operands[0] if isinstance(stated, Op) and stated.sign == "()" else stated
        if isinstance(value, Lost):
            said = self.lost(stated, stated.name, value.reason) if isinstance(stated, Ref) else value.reason
            raise Unresolved(said)
        own = plain_once(value) if isinstance(value, Structure) else value
        if not isinstance(named, Ref):
            return "", own
        own = self._told(own, named)
        origin = value.origin if isinstance(value, Structure) else None
        file, start, end = named.at
        if not isinstance(origin, TracedOrigin):
            return named.name.strip("'"), own
        if origin.owner is not None and origin.passed is None:
            return self.files[file].source.text[start:end], own
        return origin.name or named.name.strip("'"), own

    def _told(self, value: Any, ref: Ref) -> Any:
        """A value in tuples in which what is not known is said of the data whose value it is."""
        if isinstance(value, Lost):
            return Lost(reason=self.lost(ref, ref.name, value.reason))
        return tuple(self._told(part, ref) for part in value) if isinstance(value, tuple) else value

    def _zone(self, line: MoveInstruction, settings: Mapping[str, Any]) -> tuple[bool, Zone | None]:
        if "inpos" in line.options or "zone" not in line.settings:
            return True, THROUGH_TARGET
        stated, value = line.settings["zone"], settings["zone"]
        data = plain_once(value) if isinstance(value, Structure) else value
        first = data[0] if isinstance(data, tuple) and data else data
        if isinstance(first, Lost):
            said = self.lost(stated, stated.name, first.reason) if isinstance(stated, Ref) else first.reason
            note = f"the zone of a motion is not known, which is taken as a stop: {said}"
            self.settings.notes.setdefault(note, (self.files[line.at[0]], stated.at[1]))
            return True, THROUGH_TARGET
        return zone_of(data, _read(settings.get("z")), stated="z" in settings)


def _alone(value: Any, *, persistent: bool) -> Any:
    """A value of whose parts it is not told where they stand."""
    if not isinstance(value, Structure):
        return Settable(value) if persistent and type(value) is float else value
    if isinstance(value.parts, Listed):
        parts: Mapping[Hashable, Any] = Listed(value.parts.node, persistent=persistent)
    else:
        parts = {at: _alone(part, persistent=persistent) for at, part in value.parts.items()}
    return replace(value, parts=parts, origin=None)


def _height(expression: Expression | None) -> int:
    """Expressions in expressions."""
    match expression:
        case Op():
            return 1 + max(map(_height, expression.operands))
        case Ask():
            return 1 + max(map(_height, expression.arguments), default=0)
        case Rec():
            return 1 + max(map(_height, expression.parts.values()), default=0)
        case Ref(path=(indices,)) if isinstance(indices, tuple):
            return 1 + max(map(_height, indices))
        case _:
            return 0


def _read(value: Any) -> Any:
    """A setting in tuples; None where it is not known."""
    if isinstance(value, Structure):
        return plain_once(value)
    return None if isinstance(value, Lost) else value


def _meaning(target: TargetArgument) -> tuple[object, ...]:
    if target.origin is None and target.passed is None and target.literal is not None and not target.shifted:
        return (target.argument,)  # whose text says all of it
    origin = None if target.origin is None else (target.origin.symbol, target.origin.path)
    return (target.argument, origin, target.shifted, target.meant, target.external, target.read_at)


def parts_named(ref: Ref) -> Iterator[Expression]:
    """Numbers of the parts of parts that are named."""
    return (index for step in ref.path if isinstance(step, tuple) for index in step)


def is_constant(owner: Key) -> bool:
    """Whether data are constant."""
    return isinstance(owner, Symbol) and owner.declaration is not None and owner.declaration.storage == "const"


Types = Mapping[str, tuple[tuple[str, str], ...]]
"""Components of records, each with its type."""


def parts_of(type_: str, dimensions: int, types: Types, name: str) -> Callable[[int], tuple[str, int, str]]:
    """Of parts by their places: type, dimensions and name."""

    def inner(at: int) -> tuple[str, int, str]:
        if dimensions:
            own = f"{name[:-1]},{at + 1}}}" if name.endswith("}") and not name.endswith("}}") else f"{name}{{{at + 1}}}"
            return type_, dimensions - 1, own
        components = types.get(type_, ())
        if at >= len(components):
            return "", 0, name
        return components[at][1], 0, f"{name}.{components[at][0]}"

    return inner


def _blank(type_: str, types: Types, leaf: Callable[[str], Any], depth: int = 0) -> Any:
    if type_ not in types or depth > MAX_RECORDS:
        return leaf(type_)
    inner = (_blank(component, types, leaf, depth + 1) for _, component in types[type_])
    return Structure(kind="", parts=dict[Hashable, Any](enumerate(inner)))


# Where a program names its data.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Reference:
    """A reference to data, with what it covers."""

    file: ModuleFile
    start: int
    """First character of the reference."""
    path: tuple[int, ...] | None
    """The component or element; None where that is not known."""
    type: str = ""
    """Of what it covers, in lower case; empty where that is not known."""
    through: Symbol | None = None
    """The data to which it refers, where their declaration names these."""

    def overlaps(self, path: tuple[int, ...]) -> bool:
        """Whether it reads any of what stands at a path of the data."""
        return self.path is None or all(a == b for a, b in zip(self.path, path, strict=False))


def uses(meaning: RapidMeaning) -> Mapping[Symbol, tuple[Reference, ...]]:
    """All references to each piece of data and each parameter, but for data without targets in the tails of motions."""
    lowered, uses_of = meaning.lowered, dict[Symbol, list[Reference]]()
    for ref in _all_of(lowered):
        symbol = ref.key
        if not isinstance(symbol, Symbol) or not (symbol.declaration or symbol.parameter_of):
            continue
        path, type_ = _path(ref, symbol, meaning)
        use = Reference(file=lowered.files[ref.at[0]], start=ref.at[1], path=path, type=type_)
        uses_of.setdefault(symbol, []).append(use)
    return _through_names(uses_of, lowered)


def _all_of(lowered: LoweredRapid) -> Iterator[Ref]:
    for value in lowered.values.values():
        yield from _refs(value)
    for routine in lowered.all:
        for line in routine.lines:
            yield from refs_in(line)


def refs_in(line: Line) -> Iterator[Ref]:
    """Data that a line names, each place once."""
    whole: Sequence[Expression] = expressions(line)
    if isinstance(line, MoveInstruction) and line.shared:
        whole = line.points
    found = [ref for one in whole for ref in _refs(one)]
    more = [
        *changed(line),
        *(line.lends if isinstance(line, Do) else ()),
        *(line.names if isinstance(line, Unread) else ()),
    ]
    if not more:
        yield from found
        return
    found += [ref for one in more for ref in _refs(one)]
    yield from {ref.at: ref for ref in reversed(found)}.values()


def _refs(expression: Expression) -> Iterator[Ref]:
    counted = {  # of which is asked how many elements there are
        one.arguments[0]
        for one in inside(expression)
        if isinstance(one, Ask) and one.name.lower() == "dim" and one.arguments and not one.routines
    }
    return (one for one in inside(expression) if isinstance(one, Ref) and one not in counted)


def _path(ref: Ref, symbol: Symbol, meaning: RapidMeaning) -> tuple[tuple[int, ...] | None, str]:
    path = list[int]()
    type_, dimensions = symbol.type, symbol.declaration.dimensions if symbol.declaration else 0
    for index in parts_named(ref):
        number: Any = index.value if isinstance(index, Lit) else meaning.flow.evaluated(index)
        if not isinstance(number, float) or number < 1.0:
            return None, symbol.type
        path.append(int(number) - 1)
        types = symbol.scope.types if symbol.scope is not None else meaning.lowered.modules[0].scope.types
        type_, dimensions, _ = parts_of(type_, dimensions, types, "")(path[-1])
    return tuple(path), type_


MAX_NAMES = 10
"""Constants that are declared by the name of one that is declared by the name of another, and so on."""


def _through_names(
    uses_of: Mapping[Symbol, Sequence[Reference]], lowered: LoweredRapid
) -> Mapping[Symbol, tuple[Reference, ...]]:
    """References to data, those to constants that are declared by names of targets counted for these targets."""
    named = {
        (id(lowered.files[ref.at[0]]), ref.at[1]): (symbol, path)
        for symbol, value in lowered.values.items()
        if symbol.type in TARGETS and is_constant(symbol)
        for path, ref in _named_in(value, symbol)
    }

    def followed(use: Reference, depth: int = 0) -> Iterator[Reference]:
        symbol, path = named.get((id(use.file), use.start), (None, ()))
        if symbol is None or depth > MAX_NAMES:
            yield use
            return
        for other in uses_of.get(symbol, ()):
            if other.overlaps(path):
                rest = () if other.path is None else other.path[len(path) :]
                yield from followed(replace(other, path=rest, through=symbol), depth + 1)

    return {key: tuple(one for use in own for one in followed(use)) for key, own in uses_of.items()}


def _named_in(value: Expression, symbol: Symbol) -> Iterator[tuple[tuple[int, ...], Ref]]:
    """Targets that the declaration of a constant names, with the path at which they stand."""
    waiting: list[tuple[tuple[int, ...], Expression]] = [((), value)]
    while waiting:
        path, one = waiting.pop()
        match one:
            case Rec():
                waiting += [((*path, k), part) for k, part in enumerate(one.parts.values())]
            case Ref(path=(), key=Symbol() as other) if other is not symbol and other.type == symbol.type:
                if is_constant(other):
                    yield path, one
            case _:
                pass
