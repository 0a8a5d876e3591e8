"""The parts of a program's listing: its sections, and the instructions in one of them."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import nan

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core.program import Unresolved, angled_pose, pose_numbers
from robot_programs.core.robot import Robot, arm_bends
from robot_programs.core.source import Source, TextEdit, lines_of, numeral, renumbered

# Stretches of a text, each from behind a mark to the next one.


def stretches(marks: Iterable[re.Match[str]], end: int) -> Iterator[tuple[re.Match[str], int]]:
    """Each mark, with where the next one begins, or the text ends."""
    found = list(marks)
    return zip(found, [*(mark.start() for mark in found[1:]), end], strict=False)


# Frames and position registers as a controller's backup states them: text files of variables, ``.va``.
#
# ``SYSFRAME.VA`` (of older controllers ``SYSTEM.VA``) has the user frames in ``$MNUFRAME[group, number]`` and the
# tools in ``$MNUTOOL[group, number]``; ``POSREG.VA`` the position registers. Lengths are millimetres, angles
# degrees.

ROBOT_GROUP = 1

_VARIABLE = re.compile(r"^[ \t]*(?:\[[^\]\r\n]*\])?[ \t]*(?P<name>\$\w+)[ \t]+Storage:", re.MULTILINE | re.IGNORECASE)
_ELEMENT = re.compile(r"^[ \t]*\[(?P<group>\d+)[ \t]*,[ \t]*(?P<number>\d+)\][ \t]*=", re.MULTILINE)
_COMMENT = re.compile(r"'[^'\r\n]*'")
_POSE_VALUE = re.compile(r"\b(?P<name>[XYZWPR])[ \t]*:[ \t]*(?P<value>[-+]?(?:\d+(?:\.\d*)?|\.\d+))(?![\w.])")
_JOINT_VALUE = re.compile(
    r"\bJ(?P<number>\d)[ \t]*=[ \t]*(?P<value>[-+]?(?:\d+(?:\.\d*)?|\.\d+))[ \t]*(?P<unit>mm|deg)?(?![\w.])"
)
_EXTENDED = re.compile(r"\bEXT\d")
_REGISTER_CONFIGURATION = re.compile(r"\bConfig:[ \t]*(?P<text>[^\r\n]*)")


@dataclass(frozen=True, eq=False, kw_only=True)
class Register:
    """A position register."""

    T: Float[np.ndarray, "4 4"] | None = None
    """Its pose, metres; None where it has joints."""
    q: Float[np.ndarray, " joints"] | None = None
    """Its joint positions, radians; None where it has a pose."""
    values: Mapping[str, float] = field(default_factory=dict[str, float])
    """Its components as they are stated, millimetres and degrees."""
    configuration: str = ""
    extended: bool = False
    """It has positions of extended axes, too."""

    @property
    def is_pose(self) -> bool:
        """Whether it is stated as a pose, not as joints."""
        return self.T is not None

    def pose(self) -> Float[np.ndarray, "4 4"]:
        """The pose that it states, metres."""
        assert self.T is not None
        return self.T

    def joints(self, count: int) -> Float[np.ndarray, " joints"]:
        """The joint positions that it states, radians, however many they are."""
        assert self.q is not None
        return self.q


@dataclass(frozen=True, eq=False, kw_only=True)
class Variables:
    """Contents of the files of variables."""

    frames: dict[int, Float[np.ndarray, "4 4"]] = field(default_factory=dict[int, np.ndarray])
    """User frames in the world, by number, metres."""
    tools: dict[int, Float[np.ndarray, "4 4"]] = field(default_factory=dict[int, np.ndarray])
    """Tools in the flange, by number, metres."""
    registers: dict[int, Register] = field(default_factory=dict[int, Register])


def is_variables(source: Source) -> bool:
    """Whether a file states variables instead of a program."""
    return source.path.suffix.lower() == ".va"


def read_variables(sources: Sequence[Source]) -> Variables:
    """Contents of the files of variables for the robot's group."""
    out = Variables()
    for source in sources:
        if not is_variables(source):
            continue
        for name, number, text in _elements(source.text):
            pose = _pose_values(text)
            if name == "$POSREG":
                register = _stated_register(text, pose)
                if register is not None:
                    out.registers[number] = register
            elif pose:
                (out.frames if name == "$MNUFRAME" else out.tools)[number] = _pose(pose)
    return out


def _elements(text: str) -> Iterator[tuple[str, int, str]]:
    """Variable, number and text of each element of the robot's group."""
    for variable, end in stretches(_VARIABLE.finditer(text), len(text)):
        name = variable["name"].upper()
        if name not in ("$MNUFRAME", "$MNUTOOL", "$POSREG"):
            continue
        for element, behind in stretches(_ELEMENT.finditer(text, variable.end(), end), end):
            if int(element["group"][-6:]) == ROBOT_GROUP:
                yield name, int(element["number"][-6:]), _COMMENT.sub("''", text[element.end() : behind], count=1)


def _pose_values(text: str) -> dict[str, float]:
    """X Y Z W P R that are stated; empty unless all are."""
    values = {match["name"]: float(match["value"]) for match in _POSE_VALUE.finditer(text)}
    return values if len(values) == len(POSE) else {}


def _pose(values: Mapping[str, float]) -> Float[np.ndarray, "4 4"]:
    return angled_pose(*(values[name] for name in "XYZRPW"))


def _stated_register(text: str, pose: Mapping[str, float]) -> Register | None:
    extended = _EXTENDED.search(text) is not None
    if pose:
        stated = _REGISTER_CONFIGURATION.search(text)
        configuration = "" if stated is None else stated["text"].strip()
        return Register(T=_pose(pose), values=pose, configuration=configuration, extended=extended)
    joints = list(_JOINT_VALUE.finditer(text))
    if not joints or any(match["unit"] == "mm" for match in joints):
        return None
    degrees = [float(match["value"]) for match in joints]
    return Register(q=np.radians(degrees), values=dict(zip(JOINTS, degrees, strict=False)), extended=extended)


# Positions of a program, as its section POS lists them; from text to numbers and back.
#
# One position has values of one motion group or several: frames and configuration, and X Y Z in millimetres with W
# P R in degrees, or joints J1 … in degrees; E1 … are extended axes of the group.

POSE = ("X", "Y", "Z", "W", "P", "R")
JOINTS = tuple(f"J{k}" for k in range(1, 10))
EXTENDED = ("E1", "E2", "E3")

# Listings have three decimals; a fourth and a fifth are read as well, and keep what is written within 0.1 µm on the arm.
DECIMALS = {**dict.fromkeys("XYZ", 4), **dict.fromkeys("WPR", 5), **dict.fromkeys((*JOINTS, *EXTENDED), 5)}

_BLOCK = re.compile(
    r"^[ \t]*(?P<head>P)\[[ \t]*(?P<number>\d{1,5})[ \t]*(?::[^\]\r\n]*)?\][ \t]*\{(?P<inside>[^}]*)\}[ \t]*;?",
    re.MULTILINE,
)
_GROUP = re.compile(r"\bGP[ \t]*(?P<number>\d)[ \t]*:", re.IGNORECASE)
_FRAME = re.compile(r"\b(?P<name>UF|UT)[ \t]*:[ \t]*(?P<value>\d+|F)", re.IGNORECASE)
REMOTE = tuple(f"R{name}" for name in POSE)
"""Components of positions that are taught with a remote TCP (RTCP): the tool stands still, and the robot holds the part."""

_CONFIGURATION = re.compile(r"\b[CK]ONFIG[ \t]*:[ \t]*'(?P<text>[^'\r\n]*)'", re.IGNORECASE)
_COMPONENT = re.compile(
    r"\b(?P<name>[XYZWPR]|J\d|E\d)[ \t]*=(?P<blank>[ \t]*)(?P<number>[-+]?(?:\d+(?:\.\d*)?|\.\d+)|\*+)"
    r"[ \t]*(?P<unit>mm|deg)?(?![\w.])",
    re.IGNORECASE,
)
"""A number that runs into something else is damaged, and not a component."""
_COMPONENT_NAME = re.compile(r"\b([A-Z]\w*)[ \t]*=", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class Component:
    """A value of a position."""

    value: float | None
    """None where the listing has stars for it."""
    text: str
    start: int
    """First blank before the number."""
    end: int
    millimetres: bool


@dataclass(frozen=True, kw_only=True)
class MotionGroup:
    """A position's values of one motion group."""

    frame: int | None
    """Number of the user frame; None for the one that is set when the motion runs."""
    tool: int | None
    configuration: str
    configuration_at: tuple[int, int]
    """Where it stands; empty where it is not stated."""
    components: Mapping[str, Component]
    """By name."""
    names: tuple[str, ...]
    """All that the listing states a value for, in capitals, whether or not they are known here."""

    def check(self) -> None:
        """See that what the listing states is known.

        Raises:
            Unresolved: it is not.
        """
        unknown = [name for name in self.names if name not in (*POSE, *JOINTS, *EXTENDED)]
        if self.names and not unknown:
            return
        stated = f"is stated by {', '.join(self.names)}" if self.names else "states no component"
        if unknown and set(unknown) <= set(REMOTE):
            raise Unresolved(
                f"{stated}: so positions are listed that were taught with a remote TCP (RTCP), and which frames they relate is "
                "in no document at hand; teach it without RTCP, or change its representation to joints"
            )
        what = f", of which {', '.join(unknown)} is not known" if unknown else ""
        raise Unresolved(f"{stated}{what}; known are X Y Z W P R, J1 to J9 and E1 to E3")

    @property
    def is_pose(self) -> bool:
        """Whether it is stated as a pose, not as joints."""
        return "X" in self.components

    def value(self, name: str) -> float:
        """A component's number.

        Raises:
            Unresolved: there is none.
        """
        component = self.components.get(name)
        if component is None or component.value is None:
            raise Unresolved(f"its position does not state {name}, but {', '.join(self.components) or 'nothing'}")
        return component.value

    def pose(self) -> Float[np.ndarray, "4 4"]:
        """The pose that it states, metres.

        Raises:
            Unresolved: it is not complete.
        """
        x, y, z, w, p, r = (self.value(name) for name in POSE)
        return angled_pose(x, y, z, r, p, w)

    def joints(self, count: int) -> Float[np.ndarray, " joints"]:
        """The joint positions that it states, radians.

        Raises:
            Unresolved: it is not complete, or has another number of joints.
        """
        stated = sum(name in self.components for name in JOINTS)
        if stated != count:
            raise Unresolved(f"its position has {stated} joints, and the robot {count}")
        if any(self.components[name].millimetres for name in JOINTS[:count]):
            raise Unresolved("prismatic joints are not supported in TP positions")
        return np.radians([self.value(name) for name in JOINTS[:count]])


@dataclass(frozen=True, kw_only=True)
class Position:
    """A position of the program."""

    number: int
    start: int
    """Its first character."""
    end: int
    """Behind its semicolon."""
    number_at: tuple[int, int]
    groups: Mapping[int, MotionGroup]
    """By number of the motion group."""

    @property
    def external(self) -> tuple[tuple[int, str], ...]:
        """Group and name of the axes beside the robot's own, in the order in which they are numbered.

        Those of the robot's group come first, then the axes of each further group.
        """
        own = tuple((1, name) for name in EXTENDED if 1 in self.groups and name in self.groups[1].components)
        return own + tuple(
            (number, name)
            for number, group in sorted(self.groups.items())
            if number != 1
            for name in (*JOINTS, *EXTENDED)
            if name in group.components
        )

    def external_positions(self) -> tuple[float, ...]:
        """Positions of the axes beside the robot's own, millimetres or degrees; NaN where the listing has stars."""
        values = (self.groups[number].components[name].value for number, name in self.external)
        return tuple(nan if value is None else value for value in values)


def read_positions(text: str, start: int, end: int) -> Iterator[Position]:
    """The positions of a part of a file."""
    for block in _BLOCK.finditer(text, start, end):
        yield Position(
            number=int(block["number"]),
            start=block.start("head"),
            end=block.end(),
            number_at=block.span("number"),
            groups=_groups(text, *block.span("inside")),
        )


def _groups(text: str, start: int, end: int) -> dict[int, MotionGroup]:
    out: dict[int, MotionGroup] = {}
    for mark, behind in stretches(_GROUP.finditer(text, start, end), end):
        frames = {m["name"].upper(): m["value"] for m in _FRAME.finditer(text, mark.end(), behind)}
        configuration = _CONFIGURATION.search(text, mark.end(), behind)
        quoted = () if configuration is None else range(*configuration.span())
        out[int(mark["number"])] = MotionGroup(
            frame=_whole(frames.get("UF")),
            tool=_whole(frames.get("UT")),
            configuration="" if configuration is None else configuration["text"],
            configuration_at=(0, 0) if configuration is None else configuration.span("text"),
            components={
                m["name"].upper(): _component(m)
                for m in _COMPONENT.finditer(text, mark.end(), behind)
                if m.start() not in quoted
            },
            names=tuple(
                m[1].upper() for m in _COMPONENT_NAME.finditer(text, mark.end(), behind) if m.start() not in quoted
            ),
        )
    return out


def _whole(text: str | None) -> int | None:
    return int(text) if text is not None and text.isdecimal() and len(text) < 6 else None


def _component(match: "re.Match[str]") -> Component:
    number = match["number"]
    return Component(
        value=None if number.startswith("*") else float(number),
        text=number,
        start=match.start("blank"),
        end=match.end("number"),
        millimetres=(match["unit"] or "").lower() == "mm",
    )


def pose_values(T: Float[np.ndarray, "4 4"], near: MotionGroup | None = None) -> dict[str, float]:
    """Values of X Y Z W P R of a pose, millimetres and degrees; angles near those of a position."""
    components: Mapping[str, Component] = {} if near is None else near.components
    old = [component.value or 0.0 for name in "RPW" if (component := components.get(name))]
    x, y, z, r, p, w = pose_numbers(T, (old[0], old[1], old[2]) if len(old) == 3 else (0.0, 0.0, 0.0))
    return dict(zip(POSE, (x, y, z, w, p, r), strict=True))


def joint_values(q: Float[np.ndarray, " joints"]) -> dict[str, float]:
    """Values of J1 … of joint positions, degrees."""
    return dict(zip(JOINTS, np.degrees(q).tolist(), strict=False))


def edits_for(group: MotionGroup, values: Mapping[str, float]) -> list[TextEdit]:
    """The edits that give components other values, in the columns of the old ones where there is room."""
    out: list[TextEdit] = []
    for name, value in values.items():
        component = group.components.get(name)
        if component is None:
            continue
        decimals = DECIMALS[name]
        text = (
            numeral(value, decimals)
            if component.value is None
            else renumbered(component.text, component.value, value, decimals)
        )
        if text != component.text:
            width = component.end - component.start
            out.append(TextEdit(start=component.start, end=component.end, text=f" {text}".rjust(width)))
    return out


def listed(frames: tuple[int, int], values: Mapping[str, float], configuration: str, newline: str) -> str:
    """A new position in the form of a listing, from its number's closing bracket on.

    Args:
        frames: numbers of user frame and tool.
        values: of a pose or of joints, millimetres and degrees.
        configuration: of a pose.
        newline: how lines end.
    """
    stated = f"\t\tCONFIG : '{configuration}'," if configuration else "\t"
    parts = [
        f"{name}{'=' if name in JOINTS else ' ='} {numeral(value, DECIMALS[name]):>9} {' mm' if name in 'XYZ' else 'deg'}"
        for name, value in values.items()
    ]
    rows = f",{newline}\t".join(",\t".join(parts[k : k + 3]) for k in range(0, len(parts), 3))
    heading = f"\tUF : {frames[0]}, UT : {frames[1]},{stated}"
    return f"]{{{newline}   GP{ROBOT_GROUP}:{newline}{heading}{newline}\t{rows}{newline}}};"


_SECTION = re.compile(r"^[ \t]*/(PROG|ATTR|APPL|MN|POS|END)\b[^\r\n]*(?:\r?\n|$)", re.MULTILINE | re.IGNORECASE)
_LINE = re.compile(r"[ \t]*(?P<number>\d*)[ \t]*:")
_POSITION = re.compile(r"^[ \t]*(?P<head>P)\[[^\r\n]*\{", re.MULTILINE)
_NAME = re.compile(r"/PROG[ \t]+(?P<name>[^\s;]+)", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class Instruction:
    """An instruction of the program, over one line or several."""

    start: int
    """First character of its first line."""
    number: tuple[int, int]
    """Where its number stands; empty where it has none."""
    body: int
    """Behind the colon."""
    end: int
    """Behind its last character, the semicolon."""
    text: str
    """From the body to the end, with what begins its further lines blanked out."""


@dataclass(frozen=True, eq=False)
class Listing:
    """A program's listing."""

    text: str

    @cached_property
    def sections(self) -> dict[str, tuple[int, int]]:
        """Extent of the first section of each name, without the line that names it."""
        out: dict[str, tuple[int, int]] = {}
        for mark, end in stretches(_SECTION.finditer(self.text), len(self.text)):
            out.setdefault(mark[1].upper(), (mark.end(), end))
        return out

    @cached_property
    def positions(self) -> dict[int, Position]:
        """Positions of the section POS, by number."""
        return {position.number: position for position in self._blocks}

    @cached_property
    def _blocks(self) -> tuple[Position, ...]:
        return tuple(read_positions(self.text, *self.sections.get("POS", (0, 0))))

    def fault(self) -> tuple[int, str] | None:
        """Place and fault of a position that is not whole or has the number of another one; None where all are sound."""
        closed = {position.start for position in self._blocks}
        for head in _POSITION.finditer(self.text, *self.sections.get("POS", (0, 0))):
            if head.start("head") not in closed:
                return head.start("head"), "the position that begins here is not closed by }; is the file whole?"
        numbers: set[int] = set()
        for position in self._blocks:
            if position.number in numbers:
                return position.start, f"P[{position.number}] is listed a second time; which one counts is not known"
            numbers.add(position.number)
        return None

    @cached_property
    def name(self) -> str:
        """Name of the program; empty where it is not stated."""
        match = _NAME.search(self.text)
        return "" if match is None else match["name"]

    @cached_property
    def instructions(self) -> tuple[Instruction, ...]:
        """Instructions of the section MN, in their order."""
        return tuple(_instructions(self.text, *self.sections.get("MN", (0, 0))))


def _instructions(text: str, start: int, end: int) -> Iterator[Instruction]:
    opened: tuple[int, tuple[int, int], int] | None = None
    pieces: list[str] = []
    behind = start
    for first, last in lines_of(text, start, end):
        mark = _LINE.match(text, first, last)
        if mark is None:
            continue
        if opened is not None and mark["number"]:  # the one before has no semicolon
            yield _instruction(opened, behind, pieces)
            opened = None
        if opened is None:
            opened, pieces = (first, mark.span("number"), mark.end()), [text[mark.end() : last]]
        else:
            pieces += [" " * (mark.end() - behind), text[mark.end() : last]]
        behind = last
        if text[first:last].rstrip().endswith(";"):
            yield _instruction(opened, first + len(text[first:last].rstrip()), pieces)
            opened = None
    if opened is not None:
        yield _instruction(opened, behind, pieces)


def _instruction(opened: tuple[int, tuple[int, int], int], end: int, pieces: list[str]) -> Instruction:
    start, number, body = opened
    return Instruction(start=start, number=number, body=body, end=end, text="".join(pieces)[: end - body])


METRES_PER_SECOND = {"mm/sec": 1e-3, "cm/min": 1e-2 / 60.0, "inch/min": 0.0254 / 60.0}


# The configuration of a position: which of the postures that reach its pose is meant.
#
# ``N U T, 0, 0, 0`` says: no flip of the wrist (F: flipped), elbow up (D: down), wrist in front of axis 1 (B:
# behind), and the turns of three axes, 0 from −180° to 180°, 1 up to 540°, and so on.
#
# A position that a controller printed both ways (axis 5 at −81.55°, N U T) shows that axis 5 is negative without
# flip. The last number is that of axis 6; the first two are of axes 1 and 4 or of axes 4 and 5, as the controller
# is set up, so that they agree here where either does. With the wrist behind axis 1 it is not known which elbow is
# called up: either counts.

EDGE_TOLERANCE_RAD = np.radians(1e-6)
"""This near to the border between two values either is right, radians."""

POSTURE_TOLERANCE_RAD = np.radians(1.0)
"""Postures of one pose differ by far more; its printed numbers are rounded, so that its joints are not exact, radians."""

_TEXT = re.compile(r"(?P<flip>[NF])\s*(?P<elbow>[UD])\s*(?P<front>[TB])\s*(?:,\s*(-?\d)\s*,\s*(-?\d)\s*,\s*(-?\d)\s*)?")


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """The configuration of a position."""

    flip: bool
    up: bool
    front: bool
    turns: tuple[int, int, int]

    def __str__(self) -> str:
        letters = f"{'F' if self.flip else 'N'} {'U' if self.up else 'D'} {'T' if self.front else 'B'}"
        return f"{letters}, {self.turns[0]}, {self.turns[1]}, {self.turns[2]}"

    @classmethod
    def parse(cls, text: str) -> "Configuration":
        """Read a configuration.

        Raises:
            Unresolved: it is of another form, such as that of an arm with another number of axes.
        """
        match = _TEXT.fullmatch(text.strip().upper())
        if match is None:
            raise Unresolved(f"its configuration '{text.strip()}' is not understood; known is N U T, 0, 0, 0")
        first, second, third = (int(turn or 0) for turn in match.groups()[3:])
        return cls(
            flip=match["flip"] == "F",
            up=match["elbow"] == "U",
            front=match["front"] == "T",
            turns=(first, second, third),
        )

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture is the one meant; any is, of a robot without six turning joints."""
        right = np.ones(len(q), dtype=bool)
        if len(robot.joint_names) != 6 or any(robot.prismatic):
            return right
        right &= np.where(self.flip, q[:, 4] > -POSTURE_TOLERANCE_RAD, q[:, 4] < POSTURE_TOLERANCE_RAD)
        bends = arm_bends(robot, q)
        if bends is not None:
            right &= np.where(self.front, bends[:, 0] > -POSTURE_TOLERANCE_RAD, bends[:, 0] < POSTURE_TOLERANCE_RAD)
            if self.front:
                right &= np.where(self.up, bends[:, 1] > -POSTURE_TOLERANCE_RAD, bends[:, 1] < POSTURE_TOLERANCE_RAD)
        low, high = _turns(q - POSTURE_TOLERANCE_RAD), _turns(q + POSTURE_TOLERANCE_RAD)
        first, second, third = ((low <= turn) & (turn <= high) for turn in self.turns)
        return right & third[:, 5] & ((first[:, 0] & second[:, 3]) | (first[:, 3] & second[:, 4]))

    def of(self, robot: Robot, q: Float[np.ndarray, " joints"]) -> "Configuration":
        """The configuration of a posture.

        What the posture does not decide stays as it is here: on a border, and where the robot has no such arm. Turns are kept
        where they agree.

        Args:
            robot: the robot.
            q: joint positions, radians.
        """
        if len(robot.joint_names) != 6 or any(robot.prismatic):
            return self
        bends = arm_bends(robot, q[None])
        front, up = self.front, self.up
        if bends is not None:
            front = _decided(bends[0, 0], self.front)
            up = _decided(bends[0, 1], self.up) if front else self.up
        decided = Configuration(flip=_decided(q[4], self.flip), up=up, front=front, turns=self.turns)
        if decided.agrees(robot, q[None])[0]:
            return decided
        first, second, third = _turns(q[[0, 3, 5]]).tolist()
        return Configuration(flip=decided.flip, up=up, front=front, turns=(first, second, third))


def _decided(angle: float, otherwise: bool) -> bool:
    return otherwise if abs(angle) < EDGE_TOLERANCE_RAD else bool(angle > 0.0)


def _turns(q: Float[np.ndarray, "*n"]) -> Int[np.ndarray, "*n"]:
    """Whole turns of joints: 0 from −180° to 180°."""
    return np.sign(q).astype(np.int64) * np.floor((np.abs(q) + np.pi) / (2.0 * np.pi)).astype(np.int64)
