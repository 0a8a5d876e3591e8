"""Motion instructions: ``L P[3] 500mm/sec CNT100 Offset,PR[2]``, from text to what they say.

FANUC's operator's manuals, section "Motion instructions": J moves the joints, L along a line, C along an arc through a point to
another one, A along arcs through the points of several instructions.
"""

import re
from dataclasses import dataclass, replace
from math import radians

from taskcal.programs.unresolved import Unresolved
from taskcal.programs.zone import THROUGH_TARGET, Zone

_KEYWORD = re.compile(r"\s*(?P<keyword>[JLCAS])(?=\s*P(R)?\s*\[)", re.IGNORECASE)
_OPERAND = re.compile(r"\s*(?P<kind>PR|P)\s*\[", re.IGNORECASE)
_NUMBER = re.compile(r"\s*(\d{1,5})\s*(:.*)?", re.DOTALL)
_PLAIN_SPEED = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(%|mm/sec|cm/min|inch/min|deg/sec|sec|msec)", re.IGNORECASE)
_OTHER_SPEED = re.compile(
    r"(?:A?R\[[^\]]*\]\s*(%|mm/sec|cm/min|inch/min|deg/sec|sec|msec)|max_speed|weld_speed)", re.IGNORECASE
)
_TERMINATION = re.compile(r"(FINE|CNT\s*\d+|CNT\s*A?R\[[^\]]*\]|C[DR]\s*\d+)(?![\w\[])", re.IGNORECASE)
_OPTION = re.compile(r"(?P<name>[A-Za-z_][A-Za-z_.]*)(?P<rest>[^\s\[]*(?:\[[^\]]*\][^\s\[]*)*)")

METRES_PER_SECOND = {"mm/sec": 1e-3, "cm/min": 1e-2 / 60.0, "inch/min": 0.0254 / 60.0}

_BEHIND = frozenset({"ta", "tb", "db"})
"""Options that begin a call or an assignment at a time before or behind the target; all that follows belongs to them."""
_WITHOUT_EFFECT = frozenset(
    {
        "acc",
        "ev",
        "pth",
        "mrot",
        "break",
        "arc",
        "start",
        "end",
        "weave",
        "sine",
        "circle",
        "figure",
        "spot",
        "ap_ld",
        "rt_ld",
    }
)
"""Options that do not change where the motion leads."""
_REFUSED = {
    "inc": "INC counts its position from where the tool is",
    "coord": "COORD moves it with another group",
    "rtcp": "RTCP lets the tool stand still",
    "voffset": "VOFFSET shifts it by what a camera saw",
    "ind.ev": "Ind.EV moves an extended axis on its own",
    "track": "it is corrected at run time by a sensor",
    "tast": "it is corrected at run time by a sensor",
    "avc": "it is corrected at run time by a sensor",
}


@dataclass(frozen=True, kw_only=True)
class Operand:
    """A position of a motion, as it is named."""

    register: bool
    """``PR[…]``, a register of the controller; otherwise ``P[…]``, a position of the program."""
    number: int | None
    """None where it is computed."""
    start: int
    end: int


@dataclass(frozen=True, kw_only=True)
class Offset:
    """A shift of the target by a register."""

    in_tool: bool
    """``Tool_Offset``; otherwise ``Offset``, in the user frame."""
    register: int | None
    """None where it is computed, or set by an instruction before."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A motion instruction as it is written; places are characters of the file."""

    keyword: str
    """J, L, C, A, or S for a spline."""
    keyword_at: int
    operands: tuple[Operand, ...] = ()
    """Its positions, the last of them the end."""
    termination: tuple[int, int] = (0, 0)
    """Where FINE or CNT stands; empty where neither does."""
    stops: bool = True
    zone: Zone | None = THROUGH_TARGET
    """How near it passes by; None where the text does not say: a corner by ``CNT`` depends on how the controller accelerates."""
    speed: float | None = None
    """Metres per second; None where the text does not say."""
    turn_speed: float | None = None
    """Radians per second; None where the text does not say."""
    wrist: bool = False
    """``Wjnt``: the wrist's joints move evenly instead of the orientation."""
    skips: bool = False
    """It may end before its target."""
    offsets: tuple[Offset, ...] = ()
    obstacle: str = ""
    """Why it cannot be read whole; empty where it can."""


def parse_motion(text: str, at: int) -> Motion | None:
    """The motion that an instruction is; None where it is not one.

    Args:
        text: the instruction.
        at: its first character's place in the file.
    """
    begin = _KEYWORD.match(text)
    if begin is None:
        return None
    motion = Motion(keyword=begin["keyword"].upper(), keyword_at=at + begin.start("keyword"))
    if motion.keyword == "S":
        return replace(motion, obstacle="how a spline runs between its points is not known")
    try:
        operands, behind = _operands(text, begin.end(), at, 2 if motion.keyword == "C" else 1)
        return _behind_operands(text.rstrip("; \t\r\n"), behind, at, replace(motion, operands=operands))
    except Unresolved as reason:
        return replace(motion, obstacle=str(reason))


def _operands(text: str, position: int, at: int, count: int) -> tuple[tuple[Operand, ...], int]:
    operands: list[Operand] = []
    for _ in range(count):
        begin = _OPERAND.match(text, position)
        if begin is None:
            raise Unresolved("the end of its arc is missing")
        close = _closing(text, begin.end())
        number = _NUMBER.fullmatch(text[begin.end() : close])
        operands.append(
            Operand(
                register=begin["kind"].upper() == "PR",
                number=None if number is None else int(number[1]),
                start=at + begin.start("kind"),
                end=at + close + 1,
            )
        )
        position = close + 1
    return tuple(operands), position


def _closing(text: str, position: int) -> int:
    """Where the bracket closes that is open at a position.

    Raises:
        Unresolved: it does not.
    """
    depth = 1
    for k in range(position, len(text)):
        depth += {"[": 1, "]": -1}.get(text[k], 0)
        if depth == 0:
            return k
    raise Unresolved("a bracket is not closed")


def _behind_operands(text: str, position: int, at: int, motion: Motion) -> Motion:
    """A motion with what stands behind its positions.

    Raises:
        Unresolved: its speed is not understood, or it does not say how it ends.
    """
    position = _blanks(text, position)
    speed = _PLAIN_SPEED.match(text, position) or _OTHER_SPEED.match(text, position)
    if speed is None:
        raise Unresolved("its speed is not understood")
    amount = float(speed[1]) if speed.re is _PLAIN_SPEED else 0.0
    if amount > 0.0:
        unit = speed[2].lower()
        along = amount * METRES_PER_SECOND[unit] if unit in METRES_PER_SECOND else None
        motion = replace(motion, speed=along, turn_speed=radians(amount) if unit == "deg/sec" else None)
    termination = _TERMINATION.match(text, _blanks(text, speed.end()))
    if termination is None:
        raise Unresolved("it says neither FINE nor CNT")
    ending = "".join(termination[1].upper().split())
    motion = replace(
        motion,
        termination=(at + termination.start(), at + termination.end()),
        stops=ending in ("FINE", "CNT0"),
        zone=_zone(ending),
    )
    try:
        return _with_options(motion, text, termination.end())
    except Unresolved as reason:
        return replace(motion, obstacle=str(reason))


def _zone(ending: str) -> Zone | None:
    """Of a termination without blanks: ``CD`` says the distance from the target where the corner begins, millimetres.

    ``CR`` says a length, too, but no document at hand whether it is that distance or the corner's radius.
    """
    if ending in ("FINE", "CNT0"):
        return THROUGH_TARGET
    if not ending.startswith("CD"):
        return None
    return Zone(distance=float(ending[2:]) / 1e3, turn_distance=float(ending[2:]) / 1e3)


def _blanks(text: str, position: int) -> int:
    return position + len(text[position:]) - len(text[position:].lstrip())


def _with_options(motion: Motion, text: str, position: int) -> Motion:
    """A motion with what stands behind its termination.

    Raises:
        Unresolved: an option that leads elsewhere, or is not known.
    """
    offsets: list[Offset] = []
    while (position := _blanks(text, position)) < len(text):
        option = _OPTION.match(text, position)
        if option is None:  # the value of the option before
            while position < len(text) and not text[position].isspace():
                position += 1
            continue
        name, rest = option["name"].lower(), option["rest"]
        position = option.end()
        if name in _BEHIND:
            break
        if name in _REFUSED:
            raise Unresolved(_REFUSED[name])
        if name in ("offset", "tool_offset"):
            offsets.append(Offset(in_tool=name == "tool_offset", register=_register(rest)))
        elif name == "wjnt":
            motion = replace(motion, wrist=True)
        elif name == "skip":
            motion = replace(motion, skips=True)
        elif name not in _WITHOUT_EFFECT:
            raise Unresolved(f"its option '{option[0]}' is not provided for")
    return replace(motion, offsets=tuple(offsets))


def _register(text: str) -> int | None:
    match = re.fullmatch(r",\s*PR\[\s*(\d{1,5})\s*(:[^\]]*)?\]", text, re.IGNORECASE)
    return None if match is None else int(match[1])
