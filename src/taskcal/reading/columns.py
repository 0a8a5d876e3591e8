"""What a column of measurements means, by the many names that instruments and people give it."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from taskcal.observations import find_columns
from taskcal.robot.robot import POINT_COLUMNS
from taskcal.tables.table import ANGLES, LENGTHS, UNITS

# What makers call the joints of their robots, in columns of measurements.

_CALLED = (
    ("shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3"),
    ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3"),
    ("s", "l", "u", "r", "b", "t"),
    ("s", "l", "e", "u", "r", "b", "t"),
)
"""In the order of the joints: Universal Robots' driver and pendant, Yaskawa with six joints and with seven."""


def joints_called(texts: Sequence[str], count: int) -> dict[int, int]:
    """The joint of each column that a maker's name states, where all joints of one maker's set are there.

    Args:
        texts: names of the columns in small letters, their words parted by one blank.
        count: of the robot's joints.
    """
    plain = [re.sub(r"(?:^joint )|(?: joint)?(?: (?:angle|pos|position|value))?$", "", text) for text in texts]
    plain = [re.sub(r"^wrist(\d)$", r"wrist \1", text) for text in plain]
    for names in _CALLED:
        at = {k: names.index(text) for k, text in enumerate(plain) if text in names}
        if len(names) == count and sorted(at.values()) == list(range(count)):
            return at
    return {}


def logged_unit(text: str) -> str | None:
    """Unit of a joint's column in Universal Robots' real-time data, whose manual has radians; None of any other column."""
    return "rad" if re.fullmatch(r"(?:actual|target) q ?\[?[0-5]\]?", text) else None


MAX_COORDINATE_M = 100.0
"""Largest coordinate of a measurement, metres: beyond any robot, and the range of the instruments that measure one."""

MAX_NAME_LETTERS = 200
"""Letters of a column's name that may mean something; longer ones are text."""


def split_unit(name: str) -> tuple[str, str | None]:
    """A column's name in small letters, its words parted by one blank, and its unit where it ends with one; nothing of a text."""
    if len(name) > MAX_NAME_LETTERS:
        return "", None
    text = name.strip().casefold()
    bracketed = re.fullmatch(r"(.*?)\s*[\[({<]\s*([^\])}>]*?)\s*[\])}>]\s*", text)
    unit: str | None = None
    if bracketed and bracketed[2] in UNITS:
        text, unit = bracketed[1], UNITS[bracketed[2]]
    text = " ".join(word for word in re.split(r"[\s_\-./,:]+(?!$)|[\s_\-./,:]+$", text) if word) or text
    words = text.split(" ")
    if unit is None and len(words) > 1 and words[-1] in UNITS and not (words[-1] == "grad" and len(words) == 1):
        unit = UNITS[words[-1]]
        words = words[:-1]
        if words and words[-1] == "in" and len(words) > 1:
            words = words[:-1]
    return " ".join(words), unit


Kind = Literal[
    "id", "group", "joint", "position", "quaternion", "matrix", "euler", "uncertainty", "temperature", "time", "target", "station",
    "approach", "move", "nominal", "observed",
]  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """Meaning of one column."""

    kind: Kind
    index: int = 0
    """Of the joint from 0 (beyond the last where there are too many), of the axis, the quaternion's part (x, y, z, w) or the angle
    from 0, of the name among names of rows; row and column of a matrix as 10·i + j."""
    target: str = ""
    """Whose position or uncertainty it is, where the name says; what the kind of observation calls the column."""
    form: str = ""
    """Of angles: ``abc`` (KUKA), ``wpr`` (FANUC), ``rpy`` (roll, pitch, yaw), ``rotvec`` (a rotation vector) or ``rxyz`` (stated
    nowhere). Of an uncertainty: ``s`` where the name may be that of a position too."""
    unit: str | None = None
    """None where the name states none."""


_ID = (
    "id", "point id", "pointid", "point no", "point", "point name", "pointname", "pose", "pose id", "pose no", "row", "nr", "no",
    "number", "index", "#", "n", "nummer", "punkt", "punktnummer", "punkt nr", "punktname", "messpunkt", "position id", "pos nr",
    "pos no", "pos id", "zeile", "feature",
    "name", "label", "shot", "measurement", "messung", "frame",
)  # fmt: skip
"""Names of rows, the surest first; the `index` of a meaning is the place here."""

_GROUP = ("group", "point group", "gruppe", "punktgruppe", "group name", "collection", "collection name")
"""Of points with names of their own, as SpatialAnalyzer has them."""

_TARGET = ("target", "reflector", "smr", "ziel", "reflektor", "prism", "prisma", "marker", "target name")
_STATION = ("station", "station name", "station id", "station no", "tracker station", "tracker position", "standpunkt")
_TEMPERATURE = ("temp", "temperature", "temperatur", "t robot", "robot temperature")
_TIME = ("time", "zeit", "elapsed", "elapsed time", "t")
_UNCERTAINTY = ("u", "uncertainty", "sigma", "unsicherheit", "std", "stdev", "standard uncertainty")

_JOINT = re.compile(
    r"(?:joint|axis|achse|gelenk|axe|motor|theta|θ|ax|rax|j|a|q|th)(?: (?:angle|pos|position|value|winkel))? ?(?P<number>\d{1,2})"
    r"(?: (?:angle|pos|position|value|winkel|actual|ist|meas|measured))?"
)
_JOINT_FROM_ZERO = re.compile(
    r"(?:actual|target)? ?(?:q|joint|joint position|joint positions|position) ?\[?(?P<number>\d{1,2})\]?"
)

_FILLER = r"(?:pos|position|coord|coordinate|koordinate|meas|measured|actual|act|ist|messwert|p|tcp position)"
_NOMINAL = re.compile(
    r"(?:.* )?(?:nom|nominal|soll|sollwert|design|goal|desired|commanded|command|cmd|setpoint|programmed)(?: .*)?"
    r"|(?:.* )?(?:dev|deviation|delta|abw|abweichung|dif|diff|difference|residual|error|err|fehler)(?: .*)?"
    r"|(?:.* )?(?:[xyz] (?:vel|velocity|speed|acc|acceleration|force)|(?:vel|velocity|speed|acc|acceleration|force) [xyz])"
    r"|[dv][xyz]"
    r"|(?:.* )?(?:normal|direction|dir|vector|force|moment|torque|gyro|omega|accel|magnet|field|euler|angle|rotation|rot|rotvec"
    r"|rvec) [xyz]"
)
"""What was asked for, how far the robot was off it, and how it moved: nothing that says where it stood."""

CALCULATED = frozenset({"target", "tcp", "t", "robot", "roboter", "flange", "flansch", "tool0", "eef"})
"""Names of positions that the controller was sent to or says of itself, where others beside them were measured."""
_CONTROLLER = frozenset({"controller", "ctrl", "fk", "pendant"})
"""Names of what nobody but the controller says."""
_REPORTED = frozenset({"actual", "act", "ist"})
"""What was measured, beside goals; what the controller reports, beside measurements."""
_NEUTRAL = frozenset({
    *"xyzwpq", "pos", "position", "pose", "coord", "coordinate", "koordinate", "quat", "quaternion", "orientation", "rot",
})  # fmt: skip
"""Words in a position's name that say nothing of whose it is."""
_AXIS = re.compile(
    rf"(?:(?P<before>.+?) )??(?:{_FILLER} )?(?P<axis>[xyz])"
    r"(?: (?:coord|coordinate|koordinate|pos|position|act|actual|ist|meas|measured))?"
    r"(?: (?P<after>.+))?"
)
_AXIS_OF_MATRIX = re.compile(r"p(?P<axis>[xyz])")
"""The position beside the axes ``n o a`` of a hand."""
_AXIS_NUMBERED = re.compile(r"(?P<axis>[xyz])(?P<number>\d{1,3})")
_SIGMA_AXIS = re.compile(r"(?:(?P<target>.+) )?(?:(?P<short>s|u)|sigma|std)[ _]?(?P<axis>[xyz])")
_QUATERNION = re.compile(r"(?:(?P<target>.+) )?(?:q|quat|quaternion|rot q|orientation) ?(?P<part>[xyzw])")
_QUATERNION_NUMBERED = re.compile(r"q(?:uat)? ?(?P<number>[0-4])")
_OF_BODY = re.compile(r"(?:(?P<target>.+) )?(?P<kind>[rt])(?P<part>[xyzw])")
"""A rigid body's rotation and translation, as Vicon Tracker writes them."""
_MATRIX = re.compile(r"(?P<letter>[rmt])[ \[(]*(?P<row>[0-4])[\])]?[ \[(]*(?P<column>[0-4])[\])]?")
_COLUMNS_OF_MATRIX = re.compile(r"(?P<column>[noa])(?P<row>[xyz])")
_ANGLES = {
    "rxyz": (
        ("rx", "ry", "rz"),
        ("rotx", "roty", "rotz"),
        *(tuple(f"{name} {a}" for a in "xyz") for name in ("rot", "r", "rotation", "euler", "angle", "orientation")),
    ),
    "abc": (("a", "b", "c"),),
    "wpr": (("w", "p", "r"),),
    "rpy": (("roll", "pitch", "yaw"),),
    "rotvec": tuple(tuple(f"{name} {a}" for a in "xyz") for name in ("rotvec", "rvec", "rot vec", "rotation vector")),
}
_ACTUAL = re.compile(r"^(?:act|actual|ist|measured|meas|feedback) (?=.)")
_ASKED = re.compile(r"^(?:cmd|command|commanded|target|desired|soll|goal|setpoint|nominal) (?=.)")
"""Before a joint: where it stood, and where it was sent."""

_APPROACH = re.compile(r"(?P<joint>.+) approach")
_MOVE = re.compile(r"(?P<joint>.+) move")


def meanings(
    names: Sequence[str], units: Sequence[str], joints: Sequence[str], parts: Sequence[int] = ()
) -> list[Meaning | None]:
    """Meaning of each column; None for columns without one here.

    Args:
        names: of the columns.
        units: from a row of units, empty where it states none.
        joints: names of the robot's joints, in order.
        parts: columns of a quaternion, the scalar first, whose names may be those of joints too.
    """
    split = [split_unit(name) for name in names]
    parted = [
        (text, unit or UNITS.get(under) or logged_unit(text)) for (text, unit), under in zip(split, units, strict=True)
    ]
    texts = [text for text, _ in parted]
    joint_at, left = _joints_stood([("", None) if k in parts else one for k, one in enumerate(parted)], joints)
    # w x y z in this order
    numbered = {k: (part - 1) % 4 for part, k in enumerate(parts)} or _numbered_quaternion(texts, joint_at)
    bodies = _bodies(texts)
    angles = _angles(texts, joint_at)
    own = {_spoken(joint): k for k, joint in enumerate(joints)}
    out: list[Meaning | None] = []
    for k, (text, unit) in enumerate(parted):
        if k in joint_at:
            out.append(Meaning(kind="joint", index=joint_at[k], unit=unit))
        elif k in left:
            out.append(Meaning(kind="nominal"))
        elif k in numbered:
            out.append(Meaning(kind="quaternion", index=numbered[k]))
        elif k in bodies:
            kind, index, target = bodies[k]
            out.append(Meaning(kind=kind, index=index, target=_target(target, names[k]), unit=unit))
        elif k in angles:
            out.append(Meaning(kind="euler", index=angles[k][1], form=angles[k][0], unit=unit))
        else:
            out.append(_meaning(text, unit, names[k], own, len(joints)))
    tracked = any(meaning is not None and meaning.kind == "position" for meaning in out)
    # joints and rotations of poses are no columns of another kind
    free = ["" if k in joint_at or k in angles else text for k, text in enumerate(texts)]
    for k, column in find_columns(free, tracked=tracked).items():
        out[k] = Meaning(kind="observed", target=column, unit=parted[k][1])
    return _with_translation(_without_calculated(out, texts))


def contradiction(name: str, under: str) -> tuple[str, str] | None:
    """The units of a column's name and of the row of units, where they differ."""
    unit, other = split_unit(name)[1], UNITS.get(under)
    return (unit, other) if unit and other and unit != other else None


def _with_translation(known: list[Meaning | None]) -> list[Meaning | None]:
    """The last column of a matrix of three or four rows and four columns is the position, where no other columns are."""
    at = {m.index: k for k, m in enumerate(known) if m is not None and m.kind == "matrix"}
    if len(at) < 12 or any(m is not None and m.kind == "position" for m in known):
        return known
    first = min(index % 10 for index in at)
    places = [at.get(10 * (first + axis) + first + 3) for axis in range(3)]
    if None in places:
        return known
    out = list(known)
    for axis, k in enumerate(places):
        assert k is not None
        meaning = known[k]
        out[k] = Meaning(kind="position", index=axis, unit=None if meaning is None else meaning.unit)
    return out


def _without_calculated(known: list[Meaning | None], texts: Sequence[str]) -> list[Meaning | None]:
    """Positions and quaternions that the controller calculates are none of a target where others were measured."""
    said = {
        k: (_measured_rank(text), m.kind)
        for k, (text, m) in enumerate(zip(texts, known, strict=True))
        if m is not None and m.kind in ("position", "quaternion") and not m.target.casefold().startswith("base")
    }
    best = max((2 if rank is None else rank for rank, kind in said.values() if kind == "position"), default=1)
    return [
        Meaning(kind="nominal") if k in said and (rank := said[k][0]) is not None and rank < max(best, 1) else meaning
        for k, meaning in enumerate(known)
    ]


def _measured_rank(text: str) -> int | None:
    """Rank of a position or a quaternion by the words of its name: measured before reported before calculated.

    Returns:
        0 for what only a controller says, 1 for what it says or a goal, 2 for what it reports or was measured beside goals, 3 for
        any other name; None for no name, which is never left out for another's sake.
    """
    words = {
        word[1:] if word[:1] in {*"qrt"} and word[1:] in {*"xyzw"} else word for word in text.split(" ")
    } - _NEUTRAL
    if not words:
        return None
    if words & _CONTROLLER:
        return 0
    if not words <= CALCULATED | _REPORTED:
        return 3
    return 2 if words & _REPORTED else 1


def _spoken(name: str) -> str:
    """A name in small letters, its words parted by one blank."""
    return " ".join(re.split(r"[\s_\-./]+", name.strip().casefold()))


def _joints_stood(parted: Sequence[tuple[str, str | None]], joints: Sequence[str]) -> tuple[dict[int, int], set[int]]:
    """The joint of each column that holds where one stood, or else was sent; and the columns of the latter beside the former."""
    asked = {k for k, (text, _) in enumerate(parted) if _ASKED.match(text)}
    stood = _joints(
        [("" if k in asked else _ACTUAL.sub("", text), unit) for k, (text, unit) in enumerate(parted)], joints
    )
    if not asked:
        return stood, set()
    sent = _joints(
        [(_ASKED.sub("", text) if k in asked else "", unit) for k, (text, unit) in enumerate(parted)], joints
    )
    return (stood, asked & sent.keys()) if stood else (sent, set())


def _joints(parted: Sequence[tuple[str, str | None]], joints: Sequence[str]) -> dict[int, int]:
    """The joint of each column that holds one: by the robot's own names, by number from 1, or by number from 0.

    A number beyond the last joint is one where an angle's unit says that a joint is meant.
    """
    texts = [text if unit not in ("C", "s") else "" for text, unit in parted]
    own = {_spoken(name): k for k, name in enumerate(joints)}
    by_name = {k: own[text] for k, text in enumerate(texts) if text in own} or joints_called(texts, len(joints))
    from_one = {k: int(m["number"]) for k, text in enumerate(texts) if (m := _JOINT.fullmatch(text))}
    from_zero = {k: int(m["number"]) for k, text in enumerate(texts) if (m := _JOINT_FROM_ZERO.fullmatch(text))}
    if set(from_zero.values()) == set(range(len(joints))) and len(from_zero) == len(joints):
        return by_name or from_zero
    lettered = {k for k in from_one if texts[k][0] != "q"}
    if {from_one[k] for k in lettered} >= set(range(1, len(joints) + 1)):
        # q1 … q4 beside a full set of joints are the parts of a quaternion
        from_one = {k: from_one[k] for k in lettered}
    angular = {k for k, (_, unit) in enumerate(parted) if unit in ANGLES}
    numbered = {
        k: number - 1 for k, number in from_one.items() if number >= 1 and (number <= len(joints) or k in angular)
    }
    points = {k for k, j in by_name.items() if texts[k] in POINT_COLUMNS and j in numbered.values()}
    return {**numbered, **{k: j for k, j in by_name.items() if k not in points}}


def numbered_parts(names: Sequence[str]) -> list[int]:
    """Columns ``Q0 … Q3`` or ``Q1 … Q4`` without a unit, where no others are numbered so; else none."""
    at = {
        int(m["number"]): k
        for k, (text, unit) in enumerate(map(split_unit, names))
        if unit is None and (m := re.fullmatch(r"q(?:uat)? ?(?P<number>\d{1,2})", text))
    }
    first = min(at, default=0)
    return [at[first + part] for part in range(4)] if sorted(at) in ([0, 1, 2, 3], [1, 2, 3, 4]) else []


def _bodies(texts: Sequence[str]) -> dict[int, tuple[Literal["quaternion", "position"], int, str]]:
    """Kind, index and target of columns ``RX RY RZ RW``, and of ``TX TY TZ`` beside these or in an export of Vicon Nexus."""
    at: dict[tuple[str, str], dict[str, int]] = {}
    for k, text in enumerate(texts):
        if match := _OF_BODY.fullmatch(text):
            at.setdefault((match["target"] or "", match["kind"]), {})[match["part"]] = k
    out: dict[int, tuple[Literal["quaternion", "position"], int, str]] = {}
    for (target, kind), parts in at.items():
        if kind == "r" and parts.keys() == {*"xyzw"}:
            out |= {k: ("quaternion", "xyzw".index(part), target) for part, k in parts.items()}
        of_body = "sub frame" in texts or at.get((target, "r"), {}).keys() == {*"xyzw"}
        if kind == "t" and of_body and parts.keys() == {*"xyz"} and f"{target} x".strip() not in texts:
            out |= {k: ("position", "xyz".index(part), target) for part, k in parts.items()}
    return out


def _numbered_quaternion(texts: Sequence[str], joint_at: dict[int, int]) -> dict[int, int]:
    """Four columns q1 … q4 (ABB) or q0 … q3 (scalar first) where the joints have other columns."""
    at = {
        int(m["number"]): k
        for k, text in enumerate(texts)
        if (m := _QUATERNION_NUMBERED.fullmatch(text)) and k not in joint_at
    }
    first = min(at, default=0)
    if sorted(at) != list(range(first, first + 4)):
        return {}
    # w x y z in this order
    return {at[first + part]: (part - 1) % 4 for part in range(4)}


def _angles(texts: Sequence[str], joint_at: dict[int, int]) -> dict[int, tuple[str, int]]:
    """Three columns of angles, where all three are there."""
    for form, triples in _ANGLES.items():
        for triple in triples:
            at = [
                next((k for k, text in enumerate(texts) if text == name and k not in joint_at), None) for name in triple
            ]
            if None not in at:
                return {k: (form, i) for i, k in enumerate(at) if k is not None}
    return {}


def _meaning(text: str, unit: str | None, name: str, own: dict[str, int], count: int) -> Meaning | None:
    """Meaning of a column other than joints, angles and numbered parts of a quaternion."""
    if match := _APPROACH.fullmatch(text):
        return _of_joint("approach", match["joint"], unit, own, count)
    if match := _MOVE.fullmatch(text):
        return _of_joint("move", match["joint"], unit, own, count)
    if unit == "C" and text in (*_TEMPERATURE, "t"):
        return Meaning(kind="temperature", unit=unit)
    kinds: tuple[tuple[Kind, tuple[str, ...]], ...] = (
        ("target", _TARGET),
        ("station", _STATION),
        ("group", _GROUP),
        ("id", _ID),
        ("temperature", _TEMPERATURE),
        ("time", _TIME),
    )
    for kind, names in kinds:
        if text in names:
            return Meaning(kind=kind, unit=unit, index=names.index(text))
    if _NOMINAL.fullmatch(text):
        return Meaning(kind="nominal")
    if match := _QUATERNION.fullmatch(text):
        return Meaning(kind="quaternion", index="xyzw".index(match["part"]), target=_target(match["target"], name))
    if match := _MATRIX.fullmatch(text):
        return Meaning(
            kind="matrix", index=10 * int(match["row"]) + int(match["column"]), form=match["letter"], unit=unit
        )
    if match := _COLUMNS_OF_MATRIX.fullmatch(text):
        return Meaning(
            kind="matrix", index=10 * ("xyz".index(match["row"]) + 1) + "noa".index(match["column"]) + 1, form="n"
        )
    return _measured(text, unit, name)


def _measured(text: str, unit: str | None, name: str) -> Meaning | None:
    """A position or its uncertainty."""
    if text in _UNCERTAINTY:
        return Meaning(kind="uncertainty", index=3, unit=unit)
    if match := re.fullmatch(rf"(?P<target>.+) (?:{'|'.join(_UNCERTAINTY)})", text):
        return Meaning(kind="uncertainty", index=3, target=_target(match["target"], name), unit=unit)
    if match := _SIGMA_AXIS.fullmatch(text):
        return Meaning(
            kind="uncertainty",
            index="xyz".index(match["axis"]),
            target=_target(match["target"], name),
            form=match["short"] or "",
            unit=unit,
        )
    if match := _AXIS_NUMBERED.fullmatch(text):
        return Meaning(kind="position", index="xyz".index(match["axis"]), target=f"target{match['number']}", unit=unit)
    if match := _AXIS_OF_MATRIX.fullmatch(text):
        return Meaning(kind="position", index="xyz".index(match["axis"]), unit=unit)
    if match := _AXIS.fullmatch(text):
        target = _target(" ".join(filter(None, (match["before"], match["after"]))), name)
        return Meaning(kind="position", index="xyz".index(match["axis"]), target=target, unit=unit)
    return None


def _of_joint(
    kind: Literal["approach", "move"], text: str, unit: str | None, own: dict[str, int], count: int
) -> Meaning | None:
    """Meaning of a column on the approach or the last move of a joint."""
    match = _JOINT.fullmatch(text)
    index = own.get(text, int(match["number"]) - 1 if match else -1)
    return Meaning(kind=kind, index=index, unit=unit) if 0 <= index < count else None


def _target(words: str | None, name: str) -> str:
    """A target's name as the file writes it, where its words stand in the column's name together."""
    if not words or re.fullmatch(_FILLER, words):
        return ""
    pattern = r"[\s_\-./:]+".join(map(re.escape, words.split(" ")))
    found = re.search(pattern, name, re.IGNORECASE)
    return found[0] if found else words


# Units that a file states above its table, as in ``// Units: Millimeters``.

MAX_UNIT_LINE_LETTERS = 300
MAX_UNIT_LINES = 200
"""Above a table, that may state units."""

_UNITS_LINE = re.compile(r"\b(?:units?|einheit(?:en)?)\b(?P<rest>.*)", re.IGNORECASE)
_VALUES_IN = re.compile(
    r"\b(?:values?|coordinates?|positions?|lengths?|distances?|points?|dimensions?|joints?|angles?|axes|x,? ?y,? ?z"
    r"|[ajq]\d|werte|koordinaten|winkel|längen|maße)\b\W*"
    r"(?:(?:(?:are|all|alle|sind)\W+)*(?:in\s+|[(\[])\s*|(?:(?:are|all|alle|sind)\W+)+)(?P<unit>[a-zµ°]+)",
    re.IGNORECASE,
)
_WORD = re.compile(r"[a-zµ°]+", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class StatedUnits:
    """Units that hold for all columns without one."""

    length: str | None
    angle: str | None
    where: str
    """The lines that say so."""


def stated_units(preamble: Sequence[str]) -> StatedUnits:
    """The unit of length and that of angle that the lines above a table state; None where none does, or two differ."""
    named: set[str] = set()
    said: list[str] = []
    for line in preamble[:MAX_UNIT_LINES]:
        units = set(_units_of(line)) if len(line) <= MAX_UNIT_LINE_LETTERS else set()
        if units:
            named |= units
            said.append(line.strip())
    lengths, angles = named & LENGTHS.keys(), named & ANGLES.keys()
    return StatedUnits(
        length=min(lengths) if len(lengths) == 1 else None,
        angle=min(angles) if len(angles) == 1 else None,
        where="; ".join(said[:2]),
    )


def _units_of(line: str) -> Iterable[str]:
    """Units of length and of angle that a line states."""
    match = _UNITS_LINE.search(line)
    if match:
        rest = re.sub(r"^.*?[:=]", "", match["rest"])
        words = _WORD.findall(re.sub(r"^\s*(?:are\s+)?in\s+(?=\S)", "", rest).casefold())
        # between other units it is a word of the sentence
        words = words if len(words) == 1 else [word for word in words if word != "in"]
    else:
        words = [found["unit"].casefold() for found in _VALUES_IN.finditer(line)]
    return [UNITS[word] for word in words if UNITS.get(word) in {*LENGTHS, *ANGLES}]
