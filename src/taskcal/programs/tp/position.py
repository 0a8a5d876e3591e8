"""Positions of a program, as its section POS lists them; from text to numbers and back.

One position has values of one motion group or several: frames and configuration, and X Y Z in millimetres with W P R in degrees,
or joints J1 … in degrees; E1 … are extended axes of the group.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import nan

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.numeral import numeral, renumbered
from taskcal.programs.source import Edit
from taskcal.programs.tp.stretches import stretches
from taskcal.programs.tp.variables import ROBOT_GROUP
from taskcal.programs.unresolved import Unresolved
from taskcal.programs.zyx_angles import angles, rotation

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
_NAME = re.compile(r"\b([A-Z]\w*)[ \t]*=", re.IGNORECASE)


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
class Group:
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
        """It is stated as a pose, not as joints."""
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
        return se3.pose(rotation(r, p, w), np.array([x, y, z]) * 1e-3)

    def joints(self, count: int) -> Float[np.ndarray, " joints"]:
        """The joint positions that it states, radians.

        Raises:
            Unresolved: it is not complete, or has another number of joints.
        """
        stated = sum(name in self.components for name in JOINTS)
        if stated != count:
            raise Unresolved(f"its position has {stated} joints, and the robot {count}")
        if any(self.components[name].millimetres for name in JOINTS[:count]):
            raise Unresolved("a joint of its position slides, which is not provided for")
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
    groups: Mapping[int, Group]
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
        """Where the axes beside the robot's own stand, millimetres or degrees; NaN where the listing has stars."""
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


def _groups(text: str, start: int, end: int) -> dict[int, Group]:
    out: dict[int, Group] = {}
    for mark, behind in stretches(_GROUP.finditer(text, start, end), end):
        frames = {m["name"].upper(): m["value"] for m in _FRAME.finditer(text, mark.end(), behind)}
        configuration = _CONFIGURATION.search(text, mark.end(), behind)
        quoted = () if configuration is None else range(*configuration.span())
        out[int(mark["number"])] = Group(
            frame=_whole(frames.get("UF")),
            tool=_whole(frames.get("UT")),
            configuration="" if configuration is None else configuration["text"],
            configuration_at=(0, 0) if configuration is None else configuration.span("text"),
            components={
                m["name"].upper(): _component(m)
                for m in _COMPONENT.finditer(text, mark.end(), behind)
                if m.start() not in quoted
            },
            names=tuple(m[1].upper() for m in _NAME.finditer(text, mark.end(), behind) if m.start() not in quoted),
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


def pose_values(T: Float[np.ndarray, "4 4"], near: Group | None = None) -> dict[str, float]:
    """Values of X Y Z W P R of a pose, millimetres and degrees; angles near those of a position."""
    components: Mapping[str, Component] = {} if near is None else near.components
    old = [component.value or 0.0 for name in "RPW" if (component := components.get(name))]
    r, p, w = angles(T[:3, :3], (old[0], old[1], old[2])) if len(old) == 3 else angles(T[:3, :3])
    return dict(zip(POSE, [*(float(v) for v in T[:3, 3] * 1e3), w, p, r], strict=True))


def joint_values(q: Float[np.ndarray, " joints"]) -> dict[str, float]:
    """Values of J1 … of joint positions, degrees."""
    return dict(zip(JOINTS, np.degrees(q).tolist(), strict=False))


def edits_for(group: Group, values: Mapping[str, float]) -> list[Edit]:
    """The edits that give components other values, in the columns of the old ones where there is room."""
    out: list[Edit] = []
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
            out.append(Edit(start=component.start, end=component.end, text=f" {text}".rjust(width)))
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
