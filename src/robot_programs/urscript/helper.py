"""URScript functions of a pose, and of joint positions, that move it while the program runs, for the TCP that is active.

Poses are in metres and rotation vectors in the robot's base, functions in radians (Script manual, e-Series: get_inverse_kin,
get_forward_kin, pose_trans, norm, popup, thread scheduling, scoping rules). A controller's inverse is that of its own arm, as the
factory measured it; the robot file must have that, too, which the function sees for itself by get_forward_kin.

Targets of motions are put through these functions as far as the text tells which they may be.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from math import e
from typing import NamedTuple

from robot_programs.core import flow
from robot_programs.core.form import Ask, Assign, Do, Expression, Key, Line, Lit, Op, Rec, Ref, expressions, inside
from robot_programs.core.helper import (
    MEASURED,
    Dialect,
    Gift,
    HelperModule,
    Makings,
    indented,
    measured,
    returned,
    values_in,
)
from robot_programs.core.program import Unresolved, Wrapped
from robot_programs.core.source import Source, TextEdit
from robot_programs.core.values import Structure
from robot_programs.urscript.lower import MOTIONS, Function, MotionCall, Return
from robot_programs.urscript.syntax import REST_OF_LINE, parse
from robot_programs.urscript.values import ACTIVE_TCP, ELEMENT, IN_FEATURE, NEAR_HERE
from taskcal_groundwork.errors import shown

# Which data may hold which numbers, and which come from where the robot stood.

MEASURING = frozenset({
    "get_actual_tcp_pose", "get_target_tcp_pose", "get_actual_tool_flange_pose", "get_actual_joint_positions",
    "get_target_joint_positions", "get_actual_joint_positions_history", "get_target_waypoint",
})  # fmt: skip
"""Functions that say where the robot is or was: numbers of the nominal robot for where the true one stands."""

_KEPT = {ELEMENT: 0, "get_inverse_kin": 0, "pose_trans": 1, IN_FEATURE: 2}
"""Which operand an operator keeps as it is, in other coordinates."""

Numbers = tuple[int, int]
"""File and first character of numbers in brackets."""


def is_measuring(expression: Expression) -> bool:
    """Whether it says where the robot is."""
    if not isinstance(expression, Op):
        return isinstance(expression, Lit) and expression.value == NEAR_HERE
    return expression.sign in MEASURING or (expression.sign == "get_forward_kin" and not expression.operands)


MAKINGS = Makings(measures=is_measuring, operands={"get_inverse_kin": 1, "length": 0})
"""An inverse is told which solution it is, not where."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Holders:
    """Which data may hold which numbers."""

    routines: Sequence[Function]
    given: dict[Key, set[Key]] = field(default_factory=lambda: defaultdict[Key, set[Key]](set))
    """By datum: data whose value it is given as it is."""
    read: set[Key] = field(default_factory=set[Key])
    """Data that are read for something else than a motion's target."""
    of_literal: dict[Numbers, Key] = field(default_factory=dict[Numbers, Key])
    """The datum that numbers are given to."""
    items: dict[Numbers, set[Key]] = field(default_factory=dict[Numbers, set[Key]])
    """Data of which numbers are computed that stand in brackets."""

    def __post_init__(self) -> None:
        for routine in self.routines:
            for _, key, value in values_in(routine):
                self._to(value, key)
            for line in routine.lines:
                self._read_by(line)

    def _read_by(self, line: Line) -> None:
        """What a line reads and gives to no datum."""
        match line:
            case Assign():
                for index in (one for one in expressions(line) if one is not line.value):
                    self._to(index, None, kept=False)
                    self.read.add(line.target.key)
            case MotionCall():
                for one in line.points:
                    self._to(one, None)
                for one in line.given.values():
                    if one not in line.points:
                        self._to(one, None, kept=False)
            case Do():
                for one in () if line.routines else line.arguments:
                    self._to(one, None, kept=False)
            case Return():
                pass
            case _:
                for one in expressions(line):
                    self._to(one, None, kept=not isinstance(one, Op))

    @cached_property
    def read_at_last(self) -> set[Key]:
        """Data whose value is read for something else, there or where it is given to."""
        return flow.reached(self.read, lambda key: self.given.get(key, ()))

    @cached_property
    def _gifts(self) -> Sequence[Gift]:
        return tuple(MAKINGS.gifts(self.routines))

    @cached_property
    def _measured(self) -> Set[Key]:
        return {MEASURED, *measured(self._gifts)}

    def is_measured(self, expression: Expression) -> bool:
        """Whether an expression may be made of where the robot stood."""
        return not self._measured.isdisjoint(MAKINGS.of(expression))

    @cached_property
    def _made(self) -> Mapping[Key, Set[Key]]:
        """By datum: data of which its value is made."""
        found = defaultdict[Key, set[Key]](set)
        for gift in self._gifts:
            found[gift.to] |= gift.of
        return found

    def numbers_of(self, keys: Iterable[Key]) -> set[Numbers]:
        """Numbers in brackets of which some data may be made."""
        seen = flow.reached(keys, lambda key: self._made.get(key, ()))
        return {literal for literal, key in self.of_literal.items() if key in seen}

    def _to(self, expression: Expression, target: Key, *, kept: bool = True) -> None:
        """Follow an expression to a datum, or to a motion or nothing (None); it may not be kept as it is."""
        match expression:
            case Ref():
                self._named(
                    expression.key, target, kept=kept and not any(isinstance(step, str) for step in expression.path)
                )
                for index in (index for step in expression.path if isinstance(step, tuple) for index in step):
                    self._to(index, target, kept=False)
            case Lit(value=Structure() as value):
                self._literal(value, target, kept=kept)
            case Rec():
                self._record(expression, target, kept=kept)
            case Op(sign="length"):
                pass
            case Op():
                for number, operand in enumerate(expression.operands):
                    chooses = expression.sign == "get_inverse_kin" and number  # which solution it is, not where it is
                    own = kept and _KEPT.get(expression.sign) == number
                    self._to(operand, None if chooses else target, kept=own)
            case Ask():
                for routine in expression.routines:
                    self._named(returned(routine), target, kept=kept)
            case _:
                pass

    def _record(self, expression: Rec, target: Key, *, kept: bool) -> None:
        if expression.kind != "struct":
            self.items[expression.at[:2]] = set(MAKINGS.of(expression))
            if target is not None and kept:
                self.of_literal[expression.at[:2]] = target
        for item in expression.parts.values():
            whole = expression.kind != "pose" and (
                item.sign == ELEMENT if isinstance(item, Op) else not isinstance(item, Ask)
            )
            self._to(item, target, kept=kept and whole)

    def _literal(self, value: Structure, target: Key, *, kept: bool) -> None:
        if target is not None and kept and value.origin is not None:
            self.of_literal[value.origin.at[:2]] = target
        for part in value.parts.values():
            if isinstance(part, Structure):
                self._literal(part, target, kept=kept and value.kind == "list")

    def _named(self, key: Key, target: Key, *, kept: bool) -> None:
        if not kept:
            self.read.add(key)
        elif target is not None:
            self.given[target].add(key)


# The functions as text.


def _decimal(value: float) -> str:
    """Without an exponent."""
    text = f"{value:.15f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text


URSCRIPT = Dialect(
    number=_decimal,
    functions={
        "sin": "sin({0})", "cos": "cos({0})", "sqrt": "sqrt({0})", "exp": f"pow({e!r},{{0}})", "atan2": "atan2({0},{1})",
    },
    variable="tc_t[{0}]",
    assignment="{0} = {1}",
)  # fmt: skip

FUNCTION = "taskcal_corrected"

JOINTS, PLACE = (tuple(f"tc_{of}[{k}]" for k in range(count)) for of, count in (("q", 6), ("pose", 3)))
"""Joint positions, radians; and where a pose is in the base, metres."""

RESULTS = tuple(f"tc_d[{k}]" for k in range(12))
"""Shift, metres, and rotation vector; places of the flange and of a point beside it, metres."""


def urscript_helper(module: HelperModule, first: Source, same_m: float, beside_m: Sequence[float]) -> Source:
    """The functions, whose correction computes `RESULTS`; they have their place in the program's own file.

    Args:
        module: what they compute.
        first: file of the program.
        same_m: distance below which the controller's flange is where the results have it, metres.
        beside_m: the point beside the flange, in it, metres.
    """
    words = {
        "ROBOT": module.robot, "ZEROS": ",".join(["0.0"] * (module.correction.variables + 1)),
        "RESULTS": ",".join(["0.0"] * len(RESULTS)), "SHIFT": _decimal(module.shift), "TURN": _decimal(module.turn),
        "JOINT": _decimal(module.joint), "SAME": _decimal(same_m), "BESIDE": ",".join(map(str, beside_m)),
        "SETTLED": _decimal(module.settled), "LEVER": _decimal(0.5 * module.lever), "BODY": indented(module.correction.lines, 2),
    }  # fmt: skip
    return module.written("urscript", ".script", first, words, inside=True)


# Targets that only the running program knows, put through a function: which may be, and the edits that do so.

HERE = "get_target_joint_positions()"
"""Near which a pose is reached that says no joint positions: where the motion before ends."""


def wrap(
    motions: Iterable[MotionCall],
    source: Source,
    holders: Holders,
    function: str,
    *,
    without: Collection[str],
    keep_joints: bool,
) -> Iterator[Wrapped]:
    """Some motions, each with the edit that puts a function around its target.

    Args:
        motions: their calls.
        source: the text.
        holders: of the program.
        function: name of a function of a pose and joint positions near it; that of joint positions ends in ``_joints``.
        without: tools and parts that it does not know; where there are some, the active ones may be among them.
        keep_joints: leave motions to joint positions as they are.
    """
    kinds = _kinds(holders)
    for line in motions:
        edits = _edits(line, source.text, holders, kinds, function, without, keep_joints=keep_joints)
        yield Wrapped.of(source.place(line.at[1]), line.name, edits)


def _edits(
    line: MotionCall,
    text: str,
    holders: Holders,
    kinds: "Kinds",
    function: str,
    without: Collection[str],
    *,
    keep_joints: bool,
) -> Iterator[TextEdit]:
    if without:
        raise Unresolved("a tool or part was measured, and it is not known which is active")
    if line.name not in MOTIONS:
        raise Unresolved("it is steered while it goes, and has no target")
    motion, names = MOTIONS[line.name]
    if names[0] not in line.given:
        raise Unresolved(f"its arguments are not those of {line.name}({', '.join(names)})")
    if motion == "circular":
        raise Unresolved("the first point of an arc has no orientation, from which joint positions follow")
    target, near = line.given[names[0]], HERE
    inverse = False
    if isinstance(target, Op) and target.sign == "get_inverse_kin" and len(target.operands) == 3:
        inverse, (target, qnear, tcp) = True, target.operands
        if tcp.at != qnear.at and not (isinstance(tcp, Lit) and tcp.value == ACTIVE_TCP):
            raise Unresolved("get_inverse_kin is given a TCP of its own")
        stated = text[qnear.at[1] : qnear.at[2]]
        if not (isinstance(qnear, Lit) and qnear.value == NEAR_HERE and stated.startswith("get_inverse_kin")):
            near = stated
            if any(isinstance(one, Ask | Op) and not is_measuring(one) for one in inside(qnear)):
                raise Unresolved(f"the joint positions near it, {shown(near)}, would be computed twice")
    own = text[target.at[1] : target.at[2]]
    if holders.is_measured(target):
        raise Unresolved(f"'{shown(own)}' comes from where the robot stood, which is true already")
    found = kinds.of(target) or (frozenset({"pose"}) if inverse else frozenset[str]())
    if found == frozenset({"joints"}) and not inverse:
        if keep_joints:
            raise Unresolved("it goes to joint positions, which are to be kept")
        yield TextEdit(start=target.at[1], end=target.at[2], text=f"{function}_joints({own})")
        return
    if found != frozenset({"pose"}):
        raise Unresolved(f"the text does not tell whether '{shown(own)}' is a pose or joint positions")
    yield TextEdit(start=target.at[1], end=target.at[2], text=f"{function}({own}, {near})")


# What variables are: poses, joint positions, or lists of them. They keep the type that they are given first.

_KINDS = {
    **dict.fromkeys(("pose_trans", IN_FEATURE, "pose_inv", "pose_add", "pose_sub", "interpolate_pose", "get_forward_kin"), "pose"),
    **{name: "joints" if "joint" in name else "pose" for name in MEASURING}, "get_tcp_offset": "pose", "get_inverse_kin": "joints",
}  # fmt: skip
_LIST = "[]"


def _listed(kinds: Iterable[frozenset[str]], length: int) -> frozenset[str]:
    found = frozenset(f"{kind}{_LIST}" for kind in frozenset[str]().union(*kinds))
    return found or (frozenset({"joints"}) if length == 6 else found)


def _elements(kinds: Iterable[str]) -> frozenset[str]:
    return frozenset(kind.removesuffix(_LIST) for kind in kinds if kind.endswith(_LIST))


def _stated(value: object) -> frozenset[str]:
    if not isinstance(value, Structure):
        return frozenset()
    if value.kind == "pose":
        return frozenset({"pose"})
    return _listed([_stated(part) for part in value.parts.values()], len(value.parts))


class Kinds(NamedTuple):
    """What data are, and what functions return."""

    by_key: dict[Key, set[str]]

    def of(self, expression: Expression) -> frozenset[str]:
        """What an expression may be, ``pose`` or ``joints`` or lists of them; empty where it is not known."""
        match expression:
            case Lit():
                return _stated(expression.value)
            case Rec():
                parts = [self.of(part) for part in expression.parts.values()]
                return frozenset({"pose"}) if expression.kind == "pose" else _listed(parts, len(parts))
            case Ref():
                found = frozenset(self.by_key.get(expression.key, ()))
                for _ in expression.path:
                    found = _elements(found)
                return found
            case Ask():
                return frozenset[str]().union(*(self.by_key.get(returned(one), ()) for one in expression.routines))
            case Op(sign=sign, operands=operands):
                if sign == ELEMENT:
                    return _elements(self.of(operands[0]))
                own = _KINDS.get(sign)
                return frozenset({own}) if own else frozenset[str]().union(*map(self.of, operands))
            case _:
                return frozenset()


def _kinds(holders: Holders) -> Kinds:
    kinds, before = Kinds(defaultdict[Key, set[str]](set)), -1
    while before < (before := sum(map(len, kinds.by_key.values()))):
        for routine in holders.routines:
            for line, key, value in values_in(routine):
                found = kinds.of(value)
                is_element = isinstance(line, Assign) and value is line.value and line.target.path
                kinds.by_key[key] |= {f"{kind}{_LIST}" for kind in found} if is_element else found
    return kinds


# Where the function's text goes.


def with_function(source: Source, function: Source) -> Source:
    """A file with some functions in it.

    A program is declared as a function without parameters, and may declare others in itself (Script manual, "Scoping rules"); they
    come first in it. Other files, of which PolyScope makes a part of a program, begin with them.
    """
    outside, *units = parse(source, 0)
    own = [unit for unit in units if unit.parent is outside]
    start, indent = 0, ""
    if len(own) == 1 and own[0].kind == "def" and not own[0].parameters and outside.calls <= {own[0].name}:
        rest = REST_OF_LINE.match(source.text, own[0].head.begins)
        start, indent = (
            (own[0].head.begins, "") if rest is None else (rest.end(), source.indent(own[0].head.start) + "  ")
        )
    lines = [indent + line if line else line for line in function.text.splitlines()]
    text = source.newline.join([*([""] if start and not indent else []), *lines, ""])
    return source.edited([TextEdit(start=start, end=start, text=text)])
