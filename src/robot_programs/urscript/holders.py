"""Which variables may hold which numbers, and which come from where the robot stood."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from robot_programs.core.flow import reached
from robot_programs.urscript.syntax import Expression, File, plain_name
from robot_programs.urscript.values import POINTS

MEASURING = frozenset({
    "get_actual_tcp_pose", "get_target_tcp_pose", "get_actual_tool_flange_pose", "get_actual_joint_positions",
    "get_target_joint_positions", "get_actual_joint_positions_history", "get_target_waypoint",
})  # fmt: skip
"""Functions that say where the robot is or was: numbers of the nominal robot for where the true one stands."""


def is_measuring(call: Expression) -> bool:
    """Whether a call says where the robot is."""
    return call.name in MEASURING or (call.name == "get_forward_kin" and not call.parts)


@dataclass(frozen=True, eq=False, kw_only=True)
class Holders:
    """Which variables may hold which numbers, by the names of the variables, whatever function they are of."""

    files: Sequence[File]
    given: dict[str, set[str]] = field(default_factory=lambda: defaultdict[str, set[str]](set))
    """By variable, or function: variables whose value it is given as it is."""
    made: dict[str, set[str]] = field(default_factory=lambda: defaultdict[str, set[str]](set))
    """The same, and variables of which its value is computed."""
    read: set[str] = field(default_factory=set[str])
    """Variables that are read for something else than a motion's target."""
    of_literal: dict[tuple[int, int], str] = field(default_factory=dict[tuple[int, int], str])
    """By file and first character of numbers in brackets: the variable that they are given to."""

    def __post_init__(self) -> None:
        for routine in (routine for file in self.files for routine in file.routines):
            file = routine.file.number
            for name, default in routine.parameters:
                if default is not None:
                    self._to(file, default, name)
            for line in routine.lines:
                if line.index is not None:
                    self._to(file, line.index, "", kept=False)
                    self.read.add(plain_name(line.name))
                if line.value is not None:
                    target = {"assign": plain_name(line.name), "return": f"{routine.name}()"}.get(line.kind, "")
                    self._to(file, line.value, target, kept=line.kind in ("assign", "return", "evaluate"))

    @cached_property
    def read_at_last(self) -> set[str]:
        """Variables whose value is read for something else, there or where it is given to."""
        return reached(self.read, lambda name: self.given.get(name, ()))

    @cached_property
    def _parameters(self) -> Mapping[str, Sequence[str]]:
        routines = (routine for file in self.files for routine in file.routines if routine.kind)
        return {routine.name: [name for name, _ in routine.parameters] for routine in routines}

    def passed(self, call: Expression) -> Iterator[tuple[str, Expression]]:
        """Parameters, empty where there is none, and what a call of a function of the program gives them."""
        parameters = self._parameters.get(call.name, ())
        for position, (name, value) in enumerate(call.arguments):
            yield name or (parameters[position] if position < len(parameters) else ""), value

    def _made_of(self, names: Iterable[str]) -> set[str]:
        """Variables and functions of whose values some may be made."""
        return reached(names, lambda name: self.made.get(name, ()))

    def is_measured(self, expression: Expression) -> bool:
        """Whether an expression may be made of where the robot stood."""
        places = {f"{name}()" for name in (*MEASURING, "get_forward_kin")}
        return not places.isdisjoint(self._made_of(_made_of(expression)))

    def numbers_of(self, names: Iterable[str]) -> set[tuple[int, int]]:
        """Numbers in brackets, by file and first character, of which some variables may be made."""
        seen = self._made_of(names)
        return {literal for literal, name in self.of_literal.items() if name in seen}

    def _to(self, file: int, expression: Expression, target: str, *, kept: bool = True) -> None:
        """Follow an expression to a variable, or to a motion or nothing (empty); it may not be kept as it is."""
        match expression.kind:
            case "name":
                name = plain_name(expression.name)
                self._named(name, target, kept=kept and "." not in expression.name)
            case "list" | "pose":
                if target and kept:
                    self.of_literal[file, expression.start] = target
                for item in expression.parts:
                    whole = item.kind in ("list", "pose", "name", "index") and expression.kind == "list"
                    self._to(file, item, target, kept=kept and whole)
            case "index":
                self._to(file, expression.parts[0], target, kept=kept)
                self._to(file, expression.parts[1], target, kept=False)
            case "call":
                self._call(file, expression, target, kept=kept)
            case _:
                for operand in expression.parts:
                    self._to(file, operand, target, kept=False)

    def _named(self, name: str, target: str, *, kept: bool) -> None:
        if not kept:
            self.read.add(name)
        if target:
            self.made[target].add(name)
            if kept:
                self.given[target].add(name)

    def _call(self, file: int, call: Expression, target: str, *, kept: bool) -> None:
        if call.name in self._parameters or is_measuring(call):
            self._named(f"{call.name}()", target, kept=kept)
        if call.name in self._parameters:
            for name, value in self.passed(call):
                self._to(file, value, name, kept=bool(name))
            return
        points = POINTS.get(call.name, ())
        own = {"get_inverse_kin": 0, "pose_trans": 1}.get(call.name)
        for position, (name, value) in enumerate(call.arguments):
            if name in points or (not name and position < len(points)):
                self._to(file, value, "")
            elif call.name == "get_inverse_kin" and position:  # which solution it is, not where it is
                self._to(file, value, "", kept=False)
            elif call.name != "length":
                self._to(file, value, target, kept=kept and position == own)


def _made_of(expression: Expression) -> Iterator[str]:
    """Variables and functions of which a value is made, without those that only choose among solutions."""
    if expression.kind == "name":
        yield plain_name(expression.name)
    if expression.kind == "call" and (is_measuring(expression) or expression.name != "get_forward_kin"):
        yield f"{expression.name}()"
    for part in expression.parts[:1] if expression.name == "get_inverse_kin" else expression.parts:
        yield from _made_of(part)
