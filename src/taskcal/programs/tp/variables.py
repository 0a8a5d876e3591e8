"""Frames and position registers as a controller's backup states them: text files of variables, ``.va``.

``SYSFRAME.VA`` (of older controllers ``SYSTEM.VA``) has the user frames in ``$MNUFRAME[group, number]`` and the tools in
``$MNUTOOL[group, number]``; ``POSREG.VA`` the position registers. Lengths are millimetres, angles degrees.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.source import Source
from taskcal.programs.tp.stretches import stretches
from taskcal.programs.zyx_angles import rotation

ROBOT_GROUP = 1

_VARIABLE = re.compile(r"^[ \t]*(?:\[[^\]\r\n]*\])?[ \t]*(?P<name>\$\w+)[ \t]+Storage:", re.MULTILINE | re.IGNORECASE)
_ELEMENT = re.compile(r"^[ \t]*\[(?P<group>\d+)[ \t]*,[ \t]*(?P<number>\d+)\][ \t]*=", re.MULTILINE)
_COMMENT = re.compile(r"'[^'\r\n]*'")
_POSE_VALUE = re.compile(r"\b(?P<name>[XYZWPR])[ \t]*:[ \t]*(?P<value>[-+]?(?:\d+(?:\.\d*)?|\.\d+))(?![\w.])")
_JOINT_VALUE = re.compile(
    r"\bJ(?P<number>\d)[ \t]*=[ \t]*(?P<value>[-+]?(?:\d+(?:\.\d*)?|\.\d+))[ \t]*(?P<unit>mm|deg)?(?![\w.])"
)
_EXTENDED = re.compile(r"\bEXT\d")
_CONFIGURATION = re.compile(r"\bConfig:[ \t]*(?P<text>[^\r\n]*)")


@dataclass(frozen=True, eq=False, kw_only=True)
class Register:
    """A position register."""

    T: Float[np.ndarray, "4 4"] | None = None
    """Its pose, metres; None where it has joints."""
    q: Float[np.ndarray, " joints"] | None = None
    """Its joint positions, radians; None where it has a pose."""
    configuration: str = ""
    extended: bool = False
    """It has positions of extended axes, too."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Variables:
    """What the files of variables say."""

    frames: dict[int, Float[np.ndarray, "4 4"]] = field(default_factory=dict[int, np.ndarray])
    """User frames in the world, by number, metres."""
    tools: dict[int, Float[np.ndarray, "4 4"]] = field(default_factory=dict[int, np.ndarray])
    """Tools in the flange, by number, metres."""
    registers: dict[int, Register] = field(default_factory=dict[int, Register])


def is_variables(source: Source) -> bool:
    """Whether a file states variables instead of a program."""
    return source.path.suffix.lower() == ".va"


def read_variables(sources: Sequence[Source]) -> Variables:
    """What the files of variables among some files say of the robot's group."""
    out = Variables()
    for source in sources:
        if not is_variables(source):
            continue
        for name, number, text in _elements(source.text):
            pose = _pose(text)
            if name == "$POSREG":
                register = _register(text, pose)
                if register is not None:
                    out.registers[number] = register
            elif pose is not None:
                (out.frames if name == "$MNUFRAME" else out.tools)[number] = pose
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


def _pose(text: str) -> Float[np.ndarray, "4 4"] | None:
    values = {match["name"]: float(match["value"]) for match in _POSE_VALUE.finditer(text)}
    if len(values) < 6:
        return None
    position = np.array([values["X"], values["Y"], values["Z"]]) * 1e-3
    return se3.pose(rotation(values["R"], values["P"], values["W"]), position)


def _register(text: str, pose: Float[np.ndarray, "4 4"] | None) -> Register | None:
    extended = _EXTENDED.search(text) is not None
    if pose is not None:
        stated = _CONFIGURATION.search(text)
        return Register(T=pose, configuration="" if stated is None else stated["text"].strip(), extended=extended)
    joints = list(_JOINT_VALUE.finditer(text))
    if not joints or any(match["unit"] == "mm" for match in joints):
        return None
    return Register(q=np.radians([float(match["value"]) for match in joints]), extended=extended)
