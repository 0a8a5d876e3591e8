"""What KRL's data and motions mean: data lists, tool, base and other settings, and what motion an instruction makes of them."""

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, Literal

import numpy as np
from jaxtyping import Float

from robot_programs.core.form import HERE, Ask, Assign, Do, Expression, Key, Line, Lit, Ref, Routine
from robot_programs.core.interpreter import FoundMotion, LanguageMeaning
from robot_programs.core.program import (
    THROUGH_TARGET,
    Cause,
    Frame,
    MissingKind,
    Motion,
    MotionFrames,
    MotionKind,
    Target,
    Unresolved,
    Zone,
    missing_in,
)
from robot_programs.core.values import Here, Lost, Origin, Settable, Structure, by_hand, plain
from robot_programs.krl.data import (
    BASE,
    MODE,
    ORIENTATION,
    PARAMETERS,
    PLACES,
    ROBROOT,
    STATE,
    TABLES,
    TOOL,
    Datum,
)
from robot_programs.krl.lower import (
    CARRIED,
    FRAME,
    MODE_OF,
    NUMBERED,
    OF_PARAMETERS,
    ORIENTED,
    PASSED,
    STANDING,
    WITH,
    LoweredKrl,
    MotionStep,
    is_stated,
)
from robot_programs.krl.points import (
    ACCURATE_BIT,
    CONSTANT,
    JOINT,
    VARIABLE,
    KrlSite,
    StatusTurn,
    WrittenPoint,
    auxiliary,
    axes_at_end,
    completed_pose,
    distance,
    external_axes,
    is_incomplete,
    moved_pose,
    to_angle,
    turned,
)
from robot_programs.krl.syntax import POINT_MOTIONS, RELATIVE_MOTIONS, Operand
from robot_programs.krl.values import (
    ARRAY,
    AXES,
    COMPONENT,
    FIELD,
    LENGTHS,
    POSE,
    ZERO,
    Real,
    SettableReal,
    StatedStructure,
    as_position,
    frame_of,
    framed,
    has_any,
    is_whole,
    number_in,
    operate,
    pose,
    real,
    whole,
    without_origin,
)
from taskcal_groundwork import se3

Table = Literal["tool", "base", "null", "own"]
"""Where a frame comes from: TOOL_DATA, BASE_DATA, the zero frame, or the program's own."""

EXTERNAL_KINEMATIC = "an external kinematic system"

WHOLE_PERCENT = 200.0
"""At $APO.CPTP = 100 % approximation begins in the middle of the motion (KST PLC mxAutomation Logix, structure APO)."""

NULL = Frame(name="$NULLFRAME", T=np.eye(4))
_ZEROS = ("$NULLFRAME", "$WORLD")
_MODES = {"#BASE": False, "#TCP": True}
"""Whether the tool stands still, by $IPO_MODE."""

_FRAME_KINDS: dict[str, MissingKind] = {TOOL: "tool", BASE: "part"}
"""What a name is that one of them is set to."""

_NOT_GIVEN = "is not in the files given"
_BEGINNING: Mapping[Key, Any] = {
    **{key: Lost(reason=f"{key} is not set before it", told=True) for key in (TOOL, BASE, PARAMETERS)},
    MODE: "#BASE", ORIENTATION: VARIABLE,
}  # fmt: skip
"""What holds where a program begins."""
_OWN = "is a variable of the program's own, whose value is known only at run time"
_RUN_TIME = "is known only at run time"
_WITHOUT_VALUE = "has no value in its data list, so that it is known only at run time"

_TAKES_UNKNOWN = frozenset({FRAME, NUMBERED, OF_PARAMETERS, MODE_OF, WITH, ORIENTED, PASSED, FIELD})


@dataclass(frozen=True, kw_only=True, slots=True)
class Held(Origin):
    """A frame as $TOOL or $BASE holds it."""

    name: str
    table: Table = "own"
    carrier: str = ""
    """What moves it; empty where it stands still."""


@dataclass(eq=False, kw_only=True)
class KrlMeaning(LanguageMeaning):
    """Data and motions of the files of a program."""

    PASSES: ClassVar = 90
    SET: ClassVar = "is set before it, and to what is known only at run time"
    HANDS_BACK: ClassVar = True
    ARMED: ClassVar = True
    GROWS: ClassVar = True
    INDEX_BY_HAND: ClassVar = True
    PLACES: ClassVar = True
    apart = tuple(TABLES)

    lowered: LoweredKrl
    given_frames: Mapping[str, Frame]
    """By name in capitals: tools and bases that no data list states."""
    known: dict[Key, Any] = field(default_factory=dict[Key, Any])
    """What is declared, made once."""
    made: dict[tuple[str, tuple[float, ...]], Frame] = field(default_factory=dict[tuple[str, tuple[float, ...]], Frame])
    """Frames met so far, so that one frame is one object."""
    standing: dict[Frame, Frame] = field(default_factory=dict[Frame, Frame])
    """Frames that stand in the world, in the robot's own base."""

    # Data.

    def declared(self, key: Key) -> Any:
        """What data lists state."""
        if key not in self.known:
            self.known[key] = self._declared(str(key))
        return self.known[key]

    def _declared(self, key: str) -> Any:
        if key in _ZEROS:
            return ZERO
        if key in PLACES:
            return Here(key)
        if key in STATE:
            return Lost(reason="is not known")
        lost = Lost(reason=self._unstated(key))
        elements = {index: self._stated(datum) for index, datum in self.lowered.names.data.get(key, {}).items()}
        if "" in elements:
            return elements[""]
        parts = {place: one for index, one in elements.items() if (place := _place(index)) is not None}
        for name, frame in self.given_frames.items():
            variable, _, index = name.partition("[")
            if variable != key:
                continue
            value = framed(frame.T, "FRAME")
            if not index:
                return value
            if (place := _place(index.rstrip("]"))) is not None:
                parts.setdefault(place, value)
        arrays = (*TABLES, "MACHINE_FRAME_DAT", "MACHINE_DEF")
        return Structure(kind=ARRAY, parts=parts, rest=lost) if parts or key in arrays else lost

    def _stated(self, datum: Datum) -> Any:
        value = datum.value
        if isinstance(value, Structure):
            assert value.origin is not None
            return replace(value, origin=replace(value.origin, owner=datum))
        if isinstance(value, bool):
            return by_hand(value)
        return SettableReal(value) if datum.variable in self.lowered.names.real_numbers else Settable(value)

    def _unstated(self, key: str) -> str:
        """What is said of a variable that no data list states."""
        if "@" in key:
            return _OWN
        if key in self.lowered.names.types and key not in TABLES:
            return _WITHOUT_VALUE
        return _RUN_TIME if key.startswith("$") else _NOT_GIVEN

    def part_names(self, value: Structure, indices: Sequence[float]) -> Sequence[Any]:
        """The index of an element, or its indices."""
        for index in indices:
            if index != int(index) or not 0 < index < 1e6:
                raise Unresolved(f"{index:g} is not an index")
        return (int(indices[0]) if len(indices) == 1 else tuple(map(int, indices)),)

    def blank(self, key: Key, names: Sequence[Any], lost: Lost) -> Any:
        """Anything of which a part is set, with whatever other parts it has."""
        return Structure(kind=ARRAY, parts={}, rest=lost)

    def coerced(self, key: Key, value: Any) -> Any:
        """What a variable holds that is set to a value: of its type, and with numbers that stand nowhere in the text."""
        name = _name(key)
        match value:
            case Structure() if key in (TOOL, BASE):
                return value
            case Structure(origin=Held(carrier=carrier)) if carrier:
                return Lost(reason=f"{name} is set to a base that is carried by {carrier}", told=True)
            case Structure() if not is_whole(value):
                return Lost(reason=f"{name} keeps components of before", told=True)
            case Structure():
                once = self.lowered.names.set_once.get(value.origin.at[:2]) if value.origin is not None else None
                if once is not None and value.origin is not None:
                    return replace(value, origin=replace(value.origin, owner=once))
                return without_origin(value)
            case float():
                return self._number(name, value)
            case _:
                return value

    def _number(self, name: str, value: float) -> Any:
        names = self.lowered.names
        if name in names.whole_numbers and not value.is_integer():
            return Lost(reason=f"{name} is INT and set to {value:g}, which the controller rounds", told=True)
        if name in names.real_numbers:
            return real(value)
        return (
            value if not isinstance(value, Real) else Settable(value) if isinstance(value, Settable) else float(value)
        )

    def by_hand(self, value: Any) -> Any:
        """A value as one that an operator may change."""
        return real(Settable(value)) if isinstance(value, Real) else by_hand(value)

    def given(self, ask: Do | Ask, argument: Expression, parameter: Key, value: Any) -> Any:
        """What a parameter holds that is given a value."""
        return self._number(_name(parameter), value) if isinstance(value, float) else without_origin(value)

    def is_settable(self, key: Key) -> bool:
        """Whether a data list states it."""
        return key in self.lowered.names.data

    def is_fixed(self, key: Key) -> bool:
        """Whether it is of the controller, which alone sets it."""
        return key in PLACES or key in _ZEROS

    def is_armed_alone(self, key: Key) -> bool:
        """Whether it is a setting."""
        return key in STATE

    def beside(self, routine: Routine, key: Key) -> Lost | None:
        """What is said of what an interrupt, a TRIGGER or a followed signal sets."""
        source, end = self.lowered.ran_by.get(routine, ("", ""))
        if not source:
            return None
        name = _name(key)
        text = f"{name} may be set at any time by {source}; {end} and set {name} again before the motion"
        return Lost(reason=text, told=True)

    def lost_all(self, keys: Iterable[Key] | None, why: str) -> Mapping[Key, Any]:
        """What the settings hold that are no longer known."""
        if keys is None and not why:
            return _BEGINNING
        lost = Lost(reason=why, told=True)
        return dict.fromkeys(STATE if keys is None else STATE.intersection(keys), lost)

    def fresh(self, routine: Routine) -> Mapping[Key, Any]:
        """What holds where a program begins that nothing calls."""
        return _BEGINNING

    def how_set(self, by: Line | Ask, ref: Ref) -> str:
        """Where a datum is set, or may be."""
        if "@" in str(ref.key):
            return _OWN
        source = self.lowered.files[by.at[0]].source
        return f"is changed by the program, at {source.place(by.at[1])}"

    def lost(self, ref: Ref, name: str, reason: str) -> str:
        """What is said of a datum that is not known."""
        key = str(ref.key)
        if reason == self.SET and ref.path:
            return f"which element of {ref.name} is set before it is known only at run time"
        if "@" in key:
            return f"{ref.name} {_OWN}"
        if reason == _NOT_GIVEN:
            return self._missing(name)
        if key in STATE or reason in (self.SET, _RUN_TIME):
            changed = next(iter(self.flow.changes.paths.get(ref.key, {}).values()), reason)
            return f"{name} {changed}"
        return Cause(f"{name} {reason}", of=[reason])

    @staticmethod
    def _missing(name: str) -> Cause:
        variable = name.partition("[")[0]
        files = "$config.dat" if variable in TABLES else "the .dat that states it"
        return Cause(f"{name} {_NOT_GIVEN}; pass {files}", (name, TABLES.get(variable, "data")))

    def computed_index(self, name: str, why: Unresolved) -> Unresolved:
        """What is said where an index is not known."""
        text = f"which element of {name} is meant is known only at run time: {why}"
        return Unresolved(Cause(text, of=[why]))

    def where(self, place: Here, look: Callable[[Key], Any]) -> Any:
        """The position of the robot, with the tool and base that hold."""
        before = look(HERE)
        if place.name == "$POS_ACT" and isinstance(before, FoundMotion) and before.motion.end.T is not None:
            try:
                frames = self._frames(look(TOOL), look(BASE), look(MODE))
            except Unresolved:
                frames = None
            if frames is not None and _same_frames(before.motion, frames):
                return framed(before.motion.end.T, "$POS_ACT")
        raise Unresolved(f"{place.name} {_RUN_TIME}")

    # Operators.

    def takes_unknown(self, sign: str) -> bool:
        """Whether an operator says itself what is not known."""
        return sign in _TAKES_UNKNOWN

    def operate(self, sign: str, values: Sequence[Any]) -> Any:
        """Value of an operator; those are here that set tool, base and other settings."""
        own = self.operators.get(sign)
        if own is not None:
            return own(*values)
        if sign in (":", "INV_POS", COMPONENT):
            _refuse_carried(*values)
        return operate(sign, values)

    @cached_property
    def operators(self) -> Mapping[str, Callable[..., Any]]:
        """The operators of `lower`."""
        return {
            FRAME: self._named, NUMBERED: self._numbered, OF_PARAMETERS: self._of_parameters, MODE_OF: _mode, CARRIED: _carried,
            STANDING: _standing, WITH: self._with_component, ORIENTED: _oriented, PASSED: _passed, FIELD: _field,
        }  # fmt: skip

    def function(self, ask: Ask, values: Sequence[Any]) -> Any:
        """No function is known whose value would be here."""
        raise Unresolved(f"what {ask.name}() gives is known only at run time")

    def _held(self, name: str, value: Structure, table: Table) -> Structure:
        pose(as_position(value, lambda reason: f"{name} {reason}"))  # refuses what is not complete
        parts: dict[Hashable, Any] = {one: value.parts[one] for one in POSE}
        return Structure(kind="FRAME", parts=parts, origin=Held(at=(0, 0, 0), owner=None, name=name, table=table))

    def _named(self, names: tuple[str, str], value: Any, *indices: Any) -> Structure:
        """What $TOOL or $BASE is set to, by its name, or by that of the variable itself.

        Args:
            names: of the variable, and of the frame if it has one.
            value: the frame.
            indices: of which it is an element.
        """
        target, name = names
        if name == ROBROOT:
            root = self.robroot
            return self._held(name, framed(np.eye(4) if root is None else root, "FRAME"), "own")
        if isinstance(value, Lost):
            needed: list[tuple[str, MissingKind]] = [
                (one, _FRAME_KINDS[target] if kind == "data" else kind) for one, kind in missing_in(value.reason)
            ]
            raise Unresolved(Cause(f"{target}: {value.reason}", *needed) if needed else value.reason)
        if not isinstance(value, Structure) or value.kind == ARRAY:
            raise Unresolved(f"{target} is set to something that the text does not state as a frame")
        _refuse_carried(value)
        if name in _ZEROS:
            return self._held("$NULLFRAME", ZERO, "null")
        table: Table = "tool" if name == "TOOL_DATA" else "base" if name == "BASE_DATA" else "own"
        index = f"[{','.join(f'{one:g}' for one in indices)}]" if indices else ""
        return self._held(f"{name}{index}" if name else target, value, table)

    def _with_component(self, frame: Any, value: Any, part: tuple[str, str]) -> Structure:
        name, component = part
        if isinstance(frame, Lost):
            raise Unresolved(frame.reason)
        if isinstance(value, Lost):
            raise Unresolved(value.reason)
        if isinstance(value, Structure) or component not in frame.parts:
            raise Unresolved(f"what {name}.{component} is set to is not evaluated")
        _refuse_carried(frame)
        return self._held(name, replace(frame, parts={**frame.parts, component: value}, origin=None), "own")

    def _numbered(self, array: str, number: Any, elements: Any) -> Structure:
        """An element of TOOL_DATA or BASE_DATA; the zero frame for number 0."""
        if not isinstance(number, float):
            raise Unresolved(f"which element of {array} is meant is not stated as a number")
        if not number:
            return self._held("$NULLFRAME", ZERO, "null")
        found = self._element(array, elements, number)
        if not isinstance(found, Structure):
            raise Unresolved(f"{array}[{number:g}] is no frame")
        return self._held(f"{array}[{number:g}]", found, "tool" if array == "TOOL_DATA" else "base")

    def _element(self, array: str, elements: Any, number: float) -> Any:
        """An element of an array.

        Raises:
            Unresolved: it is not known.
        """
        name = f"{array}[{number:g}]"
        if not isinstance(elements, Structure) or not number.is_integer():
            raise Unresolved(self._missing(name))
        found = plain(elements.part(int(number)))
        if isinstance(found, Lost):
            ref = Ref(at=(0, 0, 0), name=array, key=array, path=((),))
            raise Unresolved(found.reason if found.told else self.lost(ref, name, found.reason))
        return found

    def _of_parameters(self, array: str, parameters: Any, elements: Any, *mechanisms: Any) -> Structure:
        """Tool or base of a set of frame parameters (FDAT)."""
        number = number_in(_parameters(parameters), "TOOL_NO" if array == "TOOL_DATA" else "BASE_NO")
        value = self._numbered(array, number, elements)
        return self._on_its_mechanism(value, number, *mechanisms) if mechanisms and number else value

    def _on_its_mechanism(self, value: Structure, number: float, bases: Any, machines: Any) -> Structure:
        """A base of a set of frame parameters, given as if it stood still, on what carries it by $config.dat."""
        base = f"BASE_DATA[{number:g}]"
        carried = bases.parts.get(int(number), bases.rest)
        if isinstance(carried, Lost) and carried.reason == _NOT_GIVEN:
            return value
        try:
            index = number_in(self._element("MACHINE_FRAME_DAT", bases, number), "MACH_DEF_INDEX")
            if index == 0:
                return value
            if index is None:
                raise Unresolved(f"MACHINE_FRAME_DAT[{number:g}] has no MACH_DEF_INDEX")
            machine = self._element("MACHINE_DEF", machines, index)
        except Unresolved as trouble:
            raise Unresolved(Cause(f"what carries {base} is not known: {trouble}", of=[trouble])) from None
        kind, controller = plain(machine.parts.get("MECH_TYPE", "")), number_in(machine, "COOP_KRC_INDEX")
        match kind:
            case "#NONE":
                return value
            case "#ROBOT" if controller == 1:
                return value
            case "#EASYS" | "#EBSYS" | "#ECSYS" | "#EDSYS" | "#EESYS" | "#EFSYS" if controller == 1:
                assert isinstance(value.origin, Held)
                return replace(value, origin=replace(value.origin, carrier=EXTERNAL_KINEMATIC))
            case _:
                text = (
                    f"{base} is carried by MACHINE_DEF[{index:g}], which is no external kinematic system of this robot"
                )
                raise Unresolved(f"{text}, and where it is this program does not tell")

    # Tool and part.

    def frame(self, value: Structure) -> Frame:
        """A frame that $TOOL or $BASE holds, made once."""
        assert isinstance(value.origin, Held)
        if value.origin.table == "null":
            return NULL
        numbers = tuple(float(value.parts[name]) for name in POSE)
        key = value.origin.name, numbers
        if key not in self.made:
            self.made[key] = Frame(name=value.origin.name, T=frame_of(value))
        return self.made[key]

    @cached_property
    def robroot(self) -> Float[np.ndarray, "4 4"] | None:
        """Pose of the robot in the world: $ROBROOT of $machine.dat, or as code sets it once; None where neither says it.

        Raises:
            Unresolved: code sets it in several ways, or to something that is no frame.
        """
        value, changed = self.declared(ROBROOT), self.flow.changes.paths.get(ROBROOT)
        if changed:
            lines = (line for routine in self.lowered.all for line in routine.lines if isinstance(line, Assign))
            match [line for line in lines if line.target.key == ROBROOT]:
                case [Assign(target=Ref(path=()), value=Lit(value=Structure() as value))]:
                    pass
                case _:
                    raise Unresolved(f"{ROBROOT} {next(iter(changed.values()))}")
        return pose(value) if isinstance(value, Structure) else None

    def _frames(self, tool: Any, base: Any, mode: Any) -> MotionFrames:
        """Tool and part of a motion, as its poses mean them: what stands still is given in the robot's own base.

        Raises:
            Unresolved: the text does not tell them.
        """
        reasons = list(dict.fromkeys(why for one in (tool, base) if (why := _unknown(one))))
        if reasons:  # names that have to be stated are said together
            raise Unresolved(Cause("; ".join(reasons), of=reasons) if all(map(missing_in, reasons)) else reasons[0])
        in_hand = _MODES.get(mode) if isinstance(mode, str) else None
        if in_hand is None:
            raise Unresolved("whether the robot holds tool or part ($IPO_MODE) is not stated before it")
        carrier = base.origin.carrier
        if not in_hand:
            part = self.frame(base)
            return MotionFrames(
                tool=self.frame(tool),
                part=part if carrier else self._standing(part),
                part_in_hand=False,
                carrier=carrier,
            )
        if carrier or tool.origin.carrier:
            raise Unresolved("$IPO_MODE is #TCP, and the base is one that moves")
        # With #TCP the part hangs on the flange; its frame is one of TOOL_DATA, the fixed tool one of BASE_DATA, whichever of
        # the two variables holds it: bas.src and hand-written programs differ in that
        tables = tool.origin.table, base.origin.table
        if {*tables} <= {"tool", "base", "null"} and tables[0] != tables[1]:
            held, standing = (tool, base) if tables[0] == "tool" or tables[1] == "base" else (base, tool)
            return MotionFrames(
                tool=self._standing(self.frame(standing)), part=self.frame(held), part_in_hand=True, carrier=carrier
            )
        raise Unresolved(
            "$IPO_MODE is #TCP, and which frame is the part's and which the fixed tool's is not clear; take one from "
            "TOOL_DATA and one from BASE_DATA"
        )

    def _standing(self, frame: Frame) -> Frame:
        root = self.robroot
        if root is None:
            return frame
        if frame not in self.standing:
            T = se3.inverse(root) @ frame.T
            self.standing[frame] = frame if np.array_equal(T, frame.T) else Frame(name=frame.name, T=T)
        return self.standing[frame]

    # Motions.

    def incomplete(self, line: Any, why: Unresolved, settings: Mapping[str, Any]) -> Unresolved:
        """What is said of a motion with a point that is not known: names that have to be stated are said together."""
        if not missing_in(why):
            return why
        try:
            self._frames(settings["tool"], settings["base"], settings["mode"])
        except Unresolved as trouble:
            if missing_in(trouble):
                reasons = list(dict.fromkeys([str(why), str(trouble)]))
                return Unresolved(Cause("; ".join(reasons), of=reasons))
        return why

    def motion(self, line: Any, points: Sequence[Any], settings: Mapping[str, Any]) -> FoundMotion:
        """The motion of an instruction."""
        assert isinstance(line, MotionStep)
        try:
            return self._motion(line, points, settings)
        except Unresolved as why:
            raise self.incomplete(line, why, settings) from None

    def _motion(self, line: MotionStep, points: Sequence[Any], settings: Mapping[str, Any]) -> FoundMotion:
        statement, section = line.statement, line.routine
        kind = POINT_MOTIONS[statement.keyword]
        written = [self._written(line, one, line.points[own], points[own]) for one, own in line.operands]
        first = written[-1].first
        relative = statement.keyword in RELATIVE_MOTIONS
        leans = relative or is_incomplete(first) or bool(statement.angle)
        orients = self.lowered.names.orients and kind in ("linear", "circular")
        orientation = settings["orientation"] if orients else VARIABLE
        try:
            frames = self._frames(settings["tool"], settings["base"], settings["mode"])
        except Unresolved as why:
            frames, unknown = None, why
        else:
            unknown = None
        before = _before(settings["before"](), frames) if leans or orientation == CONSTANT else None
        end = self._target(line, written[-1], kind, before)
        if end.q is not None:
            if kind != "joint":
                raise Unresolved(f"{statement.keyword} is given axis positions")
            kind = "axes"
        via = None
        if kind == "circular":
            assert end.T is not None
            via = auxiliary(written[0], end.T, relative, before, section.file.source.place(written[0].operand.start))
            if statement.angle:
                via, end = to_angle(settings["angle"], via, end, before)
        if orientation != VARIABLE:
            via, end = (None if one is None else turned(one, orientation, before) for one in (via, end))
            assert end is not None
        if frames is None:
            if kind != "axes":
                assert unknown is not None
                raise unknown
            in_hand = isinstance(settings["mode"], str) and bool(_MODES.get(settings["mode"]))
            base = settings["base"]
            carrier = base.origin.carrier if isinstance(base, Structure) and isinstance(base.origin, Held) else ""
            frames = MotionFrames(tool=NULL, part=NULL, part_in_hand=in_hand, carrier=carrier)  # reached with any tool
        along = kind in ("linear", "circular")
        move = Motion(
            kind=kind,
            end=end,
            via=via,
            tool=frames.tool,
            part=frames.part,
            part_in_hand=frames.part_in_hand,
            speed=_number(settings["speed"]) if along else None,
            turn_speed=_turn_speed(settings["turn speed"]) if along else None,
            stops=not statement.passing,
            # the shape of a spline depends on all its points: they are corrected, and it is left whole
            divisible=orientation != JOINT and not line.in_spline,
            zone=_zone(statement.passing, kind, settings),
            routine=section.name,
            place=section.file.source.place(statement.start),
            external=external_axes(first, relative=relative),
            carrier=frames.carrier,
        )
        site = KrlSite(
            file=section.file, motion=statement, written=tuple(written), leans=leans or first.kind == "$POS_ACT"
        )
        return FoundMotion(motion=move, written=site, meaning=_meaning(move, site))

    def _written(
        self, line: MotionStep, operand: Operand, expressions: Sequence[Expression], values: Sequence[Any]
    ) -> WrittenPoint:
        """Place of the numbers of a point."""
        stated, datum, computed = list[Structure](), None, True
        for k, (expression, value) in enumerate(zip(expressions, values, strict=True)):
            said = partial(self.lost, expression, expression.name) if isinstance(expression, Ref) else None
            if isinstance(expression, Ref) and not isinstance(value, Structure):
                raise Unresolved(f"{expression.name} is set to something that is not a position")
            stated.append(as_position(value, said))
            if k == 0 and is_stated(expression) and isinstance(value.origin, StatedStructure):
                named, by = isinstance(expression, Ref), value.origin.owner
                datum = by if named and isinstance(by, Datum) else None
                computed = named and datum is None
        return WrittenPoint(
            operand=operand, stated=tuple(stated), datum=datum, file=line.routine.file, computed=computed
        )

    def _target(self, line: MotionStep, written: WrittenPoint, kind: MotionKind, before: Motion | None) -> Target:
        first, last = written.first, written.stated[-1]
        source = line.routine.file.source
        place = source.place(written.operand.start) if written.datum is None else written.datum.place
        name = "" if written.datum is None else written.datum.name
        relative = line.statement.keyword in RELATIVE_MOTIONS
        if has_any(first, AXES) and not has_any(first, POSE):
            if len(written.stated) > 1:
                raise Unresolved("a frame is added to axis positions")
            q = axes_at_end(first, before, relative=relative)
            return Target(name=name, T=None, q=q, posture=None, place=place)
        if relative:
            T = moved_pose(distance(written), before, by_tool=line.statement.along == "#TOOL")
        else:
            T = written.with_offset(completed_pose(first, before))
        S, turn = whole(last, "S"), whole(last, "T")
        if S is not None and S & ACCURATE_BIT:
            self.lowered.say(
                line.routine.file,
                written.operand.start,
                "the point was taught with the controller's own absolute accuracy (bit 4 of S); where that is on, a corrected "
                "program would correct twice",
            )
        # S and T count in PTP only: LIN and CIRC keep the posture in which they start
        stated = kind == "joint" and (S is not None or turn is not None)
        return Target(name=name, T=T, q=None, posture=StatusTurn(S=S, T=turn) if stated else None, place=place)


def _name(key: Key) -> str:
    """Name of the variable of a key."""
    return str(key).rpartition(":")[2]


def _place(index: str) -> Any:
    """An index, or several, by their text; None where it is none."""
    numbers = [int(one) for one in index.split(",") if one.isdecimal()]
    if len(numbers) != index.count(",") + 1:
        return None
    return numbers[0] if len(numbers) == 1 else tuple(numbers)


def _unknown(value: Any) -> str:
    """Why $TOOL or $BASE is not known; empty where it is."""
    if isinstance(value, Structure) and isinstance(value.origin, Held):
        return ""
    if isinstance(value, Structure):
        lost = next((one for one in value.parts.values() if isinstance(one, Lost)), None)
        value = lost or Lost(reason="is not the same on all ways that lead to it")
    if not isinstance(value, Lost):
        return "tool or base is no frame"
    return value.reason if value.told else Cause(f"it {value.reason}", of=[value.reason])


def _refuse_carried(*values: Any) -> None:
    for value in values:
        if isinstance(value, Structure) and isinstance(value.origin, Held) and value.origin.carrier:
            raise Unresolved(f"a base that is carried by {value.origin.carrier} is only known at run time")


def _parameters(value: Any) -> Structure:
    """A set of parameters.

    Raises:
        Unresolved: it is none, or not known.
    """
    if isinstance(value, Lost):
        raise Unresolved(value.reason)
    if isinstance(value, Structure) and value.kind == ARRAY and isinstance(value.rest, Lost):
        raise Unresolved(value.rest.reason)
    if not isinstance(value, Structure):
        raise Unresolved("FDAT_ACT is not set to a set of parameters")
    return value


def _oriented(parameters: Any) -> str:
    """$ORI_TYPE by a set of motion parameters (LDAT)."""
    found = plain(_parameters(parameters).parts.get("ORI_TYP", VARIABLE))
    if not isinstance(found, str):
        raise Unresolved("what ORI_TYP says is not known")
    return found


def _passed(kind: str, parameters: Any, before: Any = None) -> float:
    """A component of $APO by a set of motion parameters (LDAT, PDAT), as KUKA's bas.src sets it.

    Args:
        kind: which one it is, where the set says which is set.
        parameters: the set.
        before: the component where it is not the one that is set.
    """
    stated = _parameters(parameters)
    mode = plain(stated.parts.get("APO_MODE", "#CPTP"))
    size = before if kind and (mode == "#CDIS") != (kind == "#CDIS") else number_in(stated, "APO_DIST")
    if not isinstance(size, float) or size < 0.0:
        raise Unresolved("how near motions pass by their targets is not known")
    return float(size)


def _mode(parameters: Any) -> str:
    """$IPO_MODE by a set of frame parameters (FDAT)."""
    found = plain(_parameters(parameters).parts.get("IPO_FRAME", "#BASE"))
    if found not in _MODES:
        raise Unresolved("what IPO_FRAME says is not known")
    return found


def _carried(value: Structure) -> Structure:
    """A frame on an external kinematic system."""
    assert isinstance(value.origin, Held)
    return replace(value, origin=replace(value.origin, carrier=EXTERNAL_KINEMATIC))


def _standing(value: Structure) -> Structure:
    """A frame that SBASE sets, which knows BASE_DATA alone.

    Raises:
        Unresolved: something carries it.
    """
    carrier = value.origin.carrier if isinstance(value.origin, Held) else ""
    if carrier:
        raise Unresolved(f"SBASE sets a base that is carried by {carrier}; whether it then moves is not known")
    return value


def _field(value: Any, written: tuple[str, str]) -> Any:
    """A component of a position as it is written: a number, whatever it is computed of."""
    name, text = written
    if isinstance(value, float) and math.isfinite(value):
        return real(value) if name in LENGTHS else value
    if name not in LENGTHS:  # it counts as not stated
        return text.upper()
    if name not in (*POSE, *AXES):
        raise Unresolved(f"{name} is '{text}', which is not a number")
    trouble = value.reason if isinstance(value, Lost) else f"'{text}' is not a number"
    raise Unresolved(Cause(f"{name} is '{text}', and {trouble}", of=[trouble]))


def _same_frames(before: Motion, frames: MotionFrames) -> bool:
    return before.tool is frames.tool and before.part is frames.part and before.part_in_hand == frames.part_in_hand


def _before(found: Any, frames: MotionFrames | None) -> Motion | None:
    """The motion before, if tool and base are still the same."""
    before = found.motion if isinstance(found, FoundMotion) else None
    if before is None or before.end.q is not None:
        return before
    return before if frames is not None and _same_frames(before, frames) else None


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, float) else None


def _turn_speed(value: Any) -> float | None:
    """Radians per second; None where the text does not tell."""
    return math.radians(value) if isinstance(value, float) and value > 0.0 else None


def _zone(passing: Sequence[str], kind: MotionKind, settings: Mapping[str, Any]) -> Zone | None:
    """Zone in which a motion passes by its target; None where the text does not tell.

    Args:
        passing: its words for that.
        kind: of the motion.
        settings: on which it depends, with those of $APO.
    """
    words = set(passing)
    if not words:
        return THROUGH_TARGET
    distance, share = (
        one if isinstance(one, float) and one >= 0.0 else None for one in (settings["distance"], settings["share"])
    )
    if words <= {"C_DIS", "C_SPL"}:
        return None if distance is None else Zone(distance=distance / 1e3, turn_distance=distance / 1e3)
    if words == {"C_PTP"} and kind in ("joint", "axes") and share is not None:
        return Zone(distance=math.inf, angle=math.inf, share=share / WHOLE_PERCENT)
    return None  # from which speed or orientation on is not a place that the text gives


def _meaning(move: Motion, site: KrlSite) -> tuple[Any, ...]:
    """Equal where motions of one line do the same, from numbers of the same places."""
    return (
        *_bits(move.end.T, move.end.q), *_bits(None if move.via is None else move.via.T, None),
        move.end.posture, *(None if w.datum is None else (w.datum.file.number, w.datum.start) for w in site.written),
        id(move.tool), id(move.part), move.part_in_hand, move.carrier, move.speed, move.turn_speed, move.stops,
        move.zone, repr(move.external), move.divisible,
    )  # fmt: skip


def _bits(T: Float[np.ndarray, "4 4"] | None, q: Float[np.ndarray, " joints"] | None) -> tuple[object, ...]:
    return (None if T is None else T.tobytes(), None if q is None else q.tobytes())
