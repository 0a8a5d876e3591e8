"""What a column of measurements means, by the many names that instruments and people give it."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Literal

from taskcal.errors import listed
from taskcal.observations import find_columns
from taskcal.robot.robot import POINT_COLUMNS, Robot
from taskcal.tables.table import ANGLES, LENGTHS, TIMES, UNITS, Table

MAX_COORDINATE_M = 100.0
"""Largest coordinate of a measurement, metres: beyond any robot, and the range of the instruments that measure one."""

MAX_NAME_LETTERS = 200
"""Letters of a column's name that may mean something; longer ones are text."""

Kind = Literal[
    "id", "group", "joint", "position", "quaternion", "matrix", "euler", "uncertainty", "temperature", "time", "target", "station",
    "approach", "move", "nominal", "observed", "azimuth", "clockwise", "elevation", "zenith", "either", "range", "theta", "clock",
    "valid", "counts", "axis",
]  # fmt: skip
"""What a column holds. From ``azimuth`` to ``theta`` are the parts of a direction, which `with_positions` reads; ``counts`` are of
an encoder, ``axis`` is one that may be beside the robot's own."""


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
    nowhere). Of an uncertainty along an axis: ``s`` where the name may be that of a position too, or ``u``. Of what is nominal:
    ``off`` where it is how far the robot was off."""
    unit: str | None = None
    """None where the name states none."""


# The vocabulary: what people write in headings, once for all that looks for it. Headings are compared in small letters, their words
# parted by one blank, without their unit (`split_unit`).


@dataclass(frozen=True)
class Word:
    """Headings of one meaning."""

    kind: Kind
    pattern: str
    """All of them; of names of rows the surest first. With groups for parts of the meaning: ``target`` and ``behind`` a
    target's name, ``number`` that of an axis or of a target without a name, ``joint`` a joint's name, ``part`` the axis or the
    part, ``row`` and ``column`` those of a matrix."""
    form: str = ""
    """As of a `Meaning`."""
    unit: str | None = None
    """With which alone it has this meaning."""
    index: int = 0
    """Of the meaning, where the pattern tells none."""


_TEMPERATURE = "temp|temperature|temperatur|t robot|robot temperature"
_OF = "(?:(?P<target>.+) )?"
_OF_FEWEST = "(?:(?P<target>.+?) )??"
"""A target's name before what has more than one word."""
_STOOD = "actual|ist|meas|measured"
_VALUE = "angle|pos|position|value"
_PLACE = "coord|coordinate|koordinate|pos|position"
_FILLER = rf"(?:{_PLACE}|{_STOOD}|act|messwert|p|tcp position)"
_COUNTED = r"(?P<joint>.+?)[ \[({]+(?:encoder )?"
_UNTIL_THE_END = r"\s*\d*[\s\])}]*"

VOCABULARY = (
    Word("approach", "(?P<joint>.+) approach"),
    Word("move", "(?P<joint>.+) move"),
    Word("temperature", f"{_TEMPERATURE}|t", unit="C"),
    Word("target", "target|reflector|smr|ziel|reflektor|prism|prisma|marker|target name"),
    Word("station", "station|station name|station id|station no|tracker station|tracker position|standpunkt"),
    # of points with names of their own, as SpatialAnalyzer has them
    Word("group", "group|point group|gruppe|punktgruppe|group name|collection|collection name"),
    Word(
        "id",
        "id|point id|pointid|point no|point|point name|pointname|pose|pose id|pose no|row|nr|no|number|index|#|n|nummer|punkt"
        "|punktnummer|punkt nr|punktname|messpunkt|position id|pos nr|pos no|pos id|zeile|feature|name|label|shot|measurement"
        "|messung|frame",
    ),
    Word("temperature", _TEMPERATURE),
    Word("time", "time|zeit|elapsed|elapsed time|t"),
    # how far the robot was off, what was asked for, and how it moved: nothing that says where it stood
    Word(
        "nominal",
        "(?:.* )?(?:dev|deviation|delta|abw|abweichung|dif|diff|difference|residual|error|err|fehler)(?: .*)?",
        form="off",
    ),
    Word(
        "nominal",
        "(?:.* )?(?:nom|nominal|soll|sollwert|design|goal|desired|commanded|command|cmd|setpoint|programmed)(?: .*)?"
        "|(?:.* )?(?:[xyz] (?:vel|velocity|speed|acc|acceleration|force)|(?:vel|velocity|speed|acc|acceleration|force) [xyz])"
        "|[dv][xyz]"
        "|(?:.* )?(?:normal|direction|dir|vector|force|moment|torque|gyro|omega|accel|magnet|field|euler|angle|rotation|rot|rotvec"
        "|rvec) [xyz]",
    ),
    Word("quaternion", f"{_OF}(?:q|quat|quaternion|rot q|orientation) ?(?P<part>[xyzw])"),
    Word("matrix", r"[rmt][ \[(]*(?P<row>[0-4])[\])]?[ \[(]*(?P<column>[0-4])[\])]?"),
    Word("matrix", "(?P<column>[noa])(?P<row>[xyz])"),
    Word("uncertainty", f"{_OF_FEWEST}(?:u|uncertainty|sigma|unsicherheit|std|stdev|standard uncertainty)", index=3),
    Word("uncertainty", f"{_OF}s[ _]?(?P<part>[xyz])", form="s"),
    Word("uncertainty", f"{_OF}u[ _]?(?P<part>[xyz])", form="u"),
    Word("uncertainty", f"{_OF}(?:sigma|std)[ _]?(?P<part>[xyz])"),
    Word("position", r"(?P<part>[xyz])(?P<number>\d{1,3})"),
    # beside the axes n o a of a hand
    Word("position", "p(?P<part>[xyz])"),
    Word("position", f"{_OF_FEWEST}(?:{_FILLER} )?(?P<part>[xyz])(?: (?:{_PLACE}|{_STOOD}|act))?(?: (?P<behind>.+))?"),
    # where an instrument turns to: seen from above an azimuth turns counter-clockwise, and what theodolites call Hz clockwise
    Word(
        "azimuth",
        f"{_OF_FEWEST}(?:azimuth|azimuth angle|az|azim|azimut|horizontal angle|hor angle|h angle|horizontalwinkel)",
    ),
    Word("clockwise", f"{_OF_FEWEST}(?:hz|hz angle|hz winkel)"),
    Word("elevation", f"{_OF_FEWEST}(?:elevation|elevation angle|elev|el|höhenwinkel|hoehenwinkel)"),
    Word("zenith", f"{_OF_FEWEST}(?:zenith|zenith angle|zenitwinkel|zenitdistanz|zenithdistanz|zenit|ze)"),
    # counted from the horizontal by some and from the zenith by others; beside Hz theodolites count it from the zenith
    Word("either", f"{_OF_FEWEST}(?:v|vertical|vertical angle|v angle|vertikalwinkel|v winkel|phi|φ)"),
    Word(
        "range",
        f"{_OF_FEWEST}(?:range|distance|dist|d|r|radius|slope distance|slope dist|sd|distanz|entfernung|schrägdistanz"
        "|schraegdistanz|schrägstrecke|strecke)",
    ),
    Word("theta", f"{_OF_FEWEST}(?:theta|θ)"),
    # when a row was recorded, by a clock, in units of which a campaign's time has none
    Word("clock", r"(?:time|t|zeit|stamp|time ?stamp)(?: ?[\[(]?(?P<unit>s|sec|ms|us|μs|ns)[\])]?)?"),
    Word("valid", "valid|is valid|visible|tracked|measured ok|point ok|gültig|gueltig"),
    # joints in other numbers than angles
    Word(
        "counts",
        f"{_COUNTED}(?:pulse?s?|cnts?|counts?|ticks?|incr?(?:ements?)?|inkr?(?:emente)?|enc|encoder|steps?){_UNTIL_THE_END}",
    ),
    Word("counts", f"{_COUNTED}(?:turns?|revs?|revolutions?|umdrehungen){_UNTIL_THE_END}", form="turns"),
    # axes beside the robot's own, as controllers call them
    Word("axis", r"(?:j|joint|a|axis|achse|q) ?(?P<number>\d{1,2})"),
    Word("axis", "(?:e|ext|eax|external|external axis|zusatzachse) ?[1-6]|linear axis|linearachse|rail|track"),
)
"""In the order in which they are tried."""

_SINGLY: tuple[Kind, ...] = (
    "approach", "move", "temperature", "target", "station", "group", "id", "time", "nominal", "quaternion", "matrix", "uncertainty",
    "position",
)  # fmt: skip
"""What a column may be whatever stands beside it."""


def find_word(text: str, *kinds: Kind, unit: str | None = None) -> tuple[Word, re.Match[str]] | None:
    """The first word of some kinds that a heading is, and its match; None where it is none.

    Args:
        text: as of `split_unit`.
        kinds: among which it is sought.
        unit: as of `split_unit`.
    """
    tried = (word for word in VOCABULARY if word.kind in kinds and word.unit in (None, unit))
    found = ((word, re.fullmatch(word.pattern, text)) for word in tried)
    return next(((word, match) for word, match in found if match), None)


# Columns that mean something together.

_JOINT = re.compile(
    rf"(?:joint|axis|achse|gelenk|axe|motor|theta|θ|ax|rax|j|a|q|th)(?: (?:{_VALUE}|winkel))? ?(?P<number>\d{{1,2}})"
    rf"(?: (?:{_VALUE}|winkel|{_STOOD}))?"
)
_JOINT_FROM_ZERO = re.compile(
    r"(?:actual|target)? ?(?:q|joint|joint position|joint positions|position) ?\[?(?P<number>\d{1,2})\]?"
)
_MAKERS = (
    ("shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3"),
    ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3"),
    ("s", "l", "u", "r", "b", "t"),
    ("s", "l", "e", "u", "r", "b", "t"),
)
"""Joints in their order: Universal Robots' driver and pendant, Yaskawa with six joints and with seven."""
_IN_RADIANS = re.compile(r"(?:actual|target) q ?\[?[0-5]\]?")
"""Joints in Universal Robots' real-time data, whose manual has radians."""
_ACTUAL = re.compile(r"^(?:act|actual|ist|measured|meas|feedback) (?=.)")
_ASKED = re.compile(r"^(?:cmd|command|commanded|target|desired|soll|goal|setpoint|nominal) (?=.)")
"""Before a joint: where it stood, and where it was sent."""

_NUMBERED_PART = re.compile(r"q(?:uat)? ?(?P<number>\d{1,2})")
_OF_BODY = re.compile(r"(?:(?P<target>.+) )?(?P<kind>[rt])(?P<part>[xyzw])")
"""A rigid body's rotation and translation, as Vicon Tracker writes them."""
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

CALCULATED = frozenset({"target", "tcp", "t", "robot", "roboter", "flange", "flansch", "tool0", "eef"})
"""Names of positions that the controller was sent to or says of itself, where others beside them were measured."""
_CONTROLLER = frozenset({"controller", "ctrl", "fk", "pendant"})
"""Names of what nobody but the controller says."""
_REPORTED = frozenset({"actual", "act", "ist"})
"""What was measured, beside goals; what the controller reports, beside measurements."""
_NEUTRAL = frozenset({*"xyzwpq", *_PLACE.split("|"), "pose", "quat", "quaternion", "orientation", "rot"})
"""Words in a position's name that say nothing of whose it is."""


def _words(text: str) -> list[str]:
    return [word for word in re.split(r"[\s_\-./,:]+", text) if word] or [text]


def split_unit(name: str) -> tuple[str, str | None]:
    """A column's name in small letters, its words parted by one blank, and its unit where it ends with one; nothing of a text."""
    if len(name) > MAX_NAME_LETTERS:
        return "", None
    text = name.strip().casefold()
    bracketed = re.fullmatch(r"(.*?)\s*[\[({<]\s*([^\])}>]*?)\s*[\])}>]\s*", text)
    unit: str | None = None
    if bracketed and bracketed[2] in UNITS:
        text, unit = bracketed[1], UNITS[bracketed[2]]
    words = _words(text)
    if unit is None and len(words) > 1 and words[-1] in UNITS:
        unit = UNITS[words.pop()]
        if words[-1] == "in" and len(words) > 1:
            words.pop()
    return " ".join(words), unit


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
    parted: list[tuple[str, str | None]] = []
    for (text, unit), under in zip(map(split_unit, names), units, strict=True):
        parted.append((text, unit or UNITS.get(under) or ("rad" if _IN_RADIANS.fullmatch(text) else None)))
    texts = [text for text, _ in parted]
    own = {" ".join(_words(joint.strip().casefold())): k for k, joint in enumerate(joints)}
    joint_at, left = _joints_stood([("", None) if k in parts else one for k, one in enumerate(parted)], own)
    numbered = parts or numbered_parts(["" if k in joint_at else name for k, name in enumerate(names)])
    angles = _angles(texts, joint_at)
    known = {k: Meaning(kind="euler", index=i, form=form, unit=parted[k][1]) for k, (form, i) in angles.items()}
    known |= _bodies(parted, names)
    # w x y z in this order
    known |= {k: Meaning(kind="quaternion", index=(part - 1) % 4) for part, k in enumerate(numbered)}
    known |= {k: Meaning(kind="nominal") for k in left}
    known |= {k: Meaning(kind="joint", index=joint, unit=parted[k][1]) for k, joint in joint_at.items()}
    out = [known.get(k) or _singly(*parted[k], name, own) for k, name in enumerate(names)]
    tracked = any(meaning is not None and meaning.kind == "position" for meaning in out)
    # joints and rotations of poses are no columns of another kind
    free = ["" if k in joint_at or k in angles else text for k, text in enumerate(texts)]
    for k, column in find_columns(free, tracked=tracked).items():
        out[k] = Meaning(kind="observed", target=column, unit=parted[k][1])
    return _with_translation(_without_calculated(out, texts))


def _singly(text: str, unit: str | None, name: str, joints: Mapping[str, int]) -> Meaning | None:
    """Meaning of a column by itself."""
    found = find_word(text, *_SINGLY, unit=unit)
    if found is None:
        return None
    word, at = found[0], found[1].groupdict()
    if word.kind in ("approach", "move"):
        match = _JOINT.fullmatch(at["joint"])
        index = joints.get(at["joint"], int(match["number"]) - 1 if match else -1)
        return Meaning(kind=word.kind, index=index, unit=unit) if 0 <= index < len(joints) else None
    if word.kind == "nominal":
        return Meaning(kind=word.kind, form=word.form)
    target = f"target{at['number']}" if "number" in at else _target(name, at.get("target"), at.get("behind"))
    if word.kind == "id":
        index = word.pattern.split("|").index(text)
    elif "row" in at:
        index = 10 * _PLACES[at["row"]] + _PLACES[at["column"]]
    else:
        index = "xyzw".index(at["part"]) if "part" in at else word.index
    return Meaning(kind=word.kind, index=index, target=target, form=word.form, unit=unit)


_PLACES = {**{str(k): k for k in range(5)}, **dict(zip("xyznoa", (1, 2, 3, 1, 2, 3), strict=True))}
"""Rows and columns of a matrix by their letters."""


def _target(name: str, *words: str | None) -> str:
    """A target's name as the file writes it, where its words stand in the column's name together."""
    text = " ".join(filter(None, words))
    return "" if not text or re.fullmatch(_FILLER, text) else as_written(text, name)


def as_written(text: str, name: str) -> str:
    """Words of a heading as a column's name has them, or as they are where it does not have them together."""
    # a name with a comma could not be chosen in a list
    found = re.search(r"[\s_\-./:]+".join(map(re.escape, text.split(" "))), name, re.IGNORECASE)
    return found[0] if found else text


def _with_translation(known: list[Meaning | None]) -> list[Meaning | None]:
    """The last column of a matrix of three or four rows and four columns is the position, where no other columns are."""
    at = {m.index: k for k, m in enumerate(known) if m is not None and m.kind == "matrix"}
    if len(at) < 12 or any(m is not None and m.kind == "position" for m in known):
        return known
    first = min(index % 10 for index in at)
    places = [at.get(10 * (first + axis) + first + 3) for axis in range(3)]
    if None in places:
        return known
    axes = {k: axis for axis, k in enumerate(places)}
    return [Meaning(kind="position", index=axes[k], unit=m.unit) if m and k in axes else m for k, m in enumerate(known)]


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


def _joints_stood(parted: Sequence[tuple[str, str | None]], own: Mapping[str, int]) -> tuple[dict[int, int], set[int]]:
    """The joint of each column that holds where one stood, or else was sent; and the columns of the latter beside the former."""
    asked = {k for k, (text, _) in enumerate(parted) if _ASKED.match(text)}
    stood = _joints([("" if k in asked else _ACTUAL.sub("", text), unit) for k, (text, unit) in enumerate(parted)], own)
    if not asked:
        return stood, set()
    sent = _joints([(_ASKED.sub("", text) if k in asked else "", unit) for k, (text, unit) in enumerate(parted)], own)
    return (stood, asked & sent.keys()) if stood else (sent, set())


def _joints(parted: Sequence[tuple[str, str | None]], own: Mapping[str, int]) -> dict[int, int]:
    """The joint of each column that holds one: by the robot's own names, by number from 1, or by number from 0.

    A number beyond the last joint is one where an angle's unit says that a joint is meant.
    """
    texts, count = [text if unit not in ("C", "s") else "" for text, unit in parted], len(own)
    by_name = {k: own[text] for k, text in enumerate(texts) if text in own} or _joints_of_makers(texts, count)
    from_one, from_zero = (
        {k: int(m["number"]) for k, text in enumerate(texts) if (m := pattern.fullmatch(text))}
        for pattern in (_JOINT, _JOINT_FROM_ZERO)
    )
    if set(from_zero.values()) == set(range(count)) and len(from_zero) == count:
        return by_name or from_zero
    lettered = {k for k in from_one if texts[k][0] != "q"}
    if {from_one[k] for k in lettered} >= set(range(1, count + 1)):
        # q1 … q4 beside a full set of joints are the parts of a quaternion
        from_one = {k: from_one[k] for k in lettered}
    numbered = {
        k: number - 1 for k, number in from_one.items() if number >= 1 and (number <= count or parted[k][1] in ANGLES)
    }
    points = {k for k, j in by_name.items() if texts[k] in POINT_COLUMNS and j in numbered.values()}
    return {**numbered, **{k: j for k, j in by_name.items() if k not in points}}


def _joints_of_makers(texts: Sequence[str], count: int) -> dict[int, int]:
    """The joint of each column that a maker's name states, where all joints of one maker's set are there."""
    plain = [re.sub(rf"(?:^joint )|(?: joint)?(?: (?:{_VALUE}))?$", "", text) for text in texts]
    plain = [re.sub(r"^wrist(\d)$", r"wrist \1", text) for text in plain]
    for names in _MAKERS:
        at = {k: names.index(text) for k, text in enumerate(plain) if text in names}
        if len(names) == count and sorted(at.values()) == list(range(count)):
            return at
    return {}


def numbered_parts(names: Sequence[str]) -> list[int]:
    """Columns ``Q0 … Q3`` or ``Q1 … Q4`` without a unit, where no others are numbered so; else none."""
    at = {
        int(m["number"]): k
        for k, (text, unit) in enumerate(map(split_unit, names))
        if unit is None and (m := _NUMBERED_PART.fullmatch(text))
    }
    first = min(at, default=0)
    return [at[first + part] for part in range(4)] if sorted(at) in ([0, 1, 2, 3], [1, 2, 3, 4]) else []


def _bodies(parted: Sequence[tuple[str, str | None]], names: Sequence[str]) -> dict[int, Meaning]:
    """Columns ``RX RY RZ RW``, and ``TX TY TZ`` beside these or in an export of Vicon Nexus."""
    texts = {text for text, _ in parted}
    at: dict[tuple[str, str], dict[str, int]] = {}
    for k, (text, _) in enumerate(parted):
        if match := _OF_BODY.fullmatch(text):
            at.setdefault((match["target"] or "", match["kind"]), {})[match["part"]] = k
    out: dict[int, Meaning] = {}
    for (target, kind), parts in at.items():
        of_body = "sub frame" in texts or at.get((target, "r"), {}).keys() == {*"xyzw"}
        of: Literal["quaternion", "position"] = "quaternion" if kind == "r" else "position"
        if kind == "r" and parts.keys() != {*"xyzw"}:
            continue
        if kind == "t" and not (of_body and parts.keys() == {*"xyz"} and f"{target} x".strip() not in texts):
            continue
        for part, k in parts.items():
            out[k] = Meaning(kind=of, index="xyzw".index(part), target=_target(names[k], target), unit=parted[k][1])
    return out


def _angles(texts: Sequence[str], joint_at: Mapping[int, int], of: str = "") -> dict[int, tuple[str, int]]:
    """Three columns of angles, where all three are there; by themselves, or behind the name of the only target."""
    for form, triples in _ANGLES.items():
        for triple in triples:
            at = [
                next((k for k, text in enumerate(texts) if text == of + name and k not in joint_at), None)
                for name in triple
            ]
            if None not in at:
                return {k: (form, i) for i, k in enumerate(at) if k is not None}
    target = "" if of else _only_target(texts)
    return _angles(texts, joint_at, target) if target else {}


def _only_target(texts: Sequence[str]) -> str:
    """The name, with a blank behind it, of the only target that was measured, where all are named; empty where there are more."""
    named = {
        text[:-1] for text in texts if re.fullmatch(r".+ x", text) and {text[:-1] + "y", text[:-1] + "z"} <= {*texts}
    }
    ranks = {name: _measured_rank(f"{name}x") or 0 for name in named if not name.startswith("base")}
    best = [name for name, rank in ranks.items() if rank == max(ranks.values())]
    return best[0] if len(best) == 1 and not {*"xyz"} <= {*texts} else ""


# A table and what its columns mean.


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredTable(Table):
    """A table of measurements whose columns have a meaning."""

    known: tuple[Meaning | None, ...]
    """Meaning of each column; None where it means nothing here."""
    robot: Robot
    """That was measured."""

    @classmethod
    def of_table(cls, table: Table, robot: Robot, known: Iterable[Meaning | None]) -> "MeasuredTable":
        """A table whose columns have these meanings; what is asked for of one of the two counts for both."""
        own = {one.name: getattr(table, one.name) for one in fields(table) if one.init}
        measured = cls(**own, robot=robot, known=tuple(known))
        object.__setattr__(measured, "_used", table._used)
        return measured

    def of(self, kind: Kind) -> list[tuple[str, Meaning]]:
        """Name and meaning of every column of a kind."""
        columns = zip(self.header, self.known, strict=True)
        return [(name, meaning) for name, meaning in columns if meaning is not None and meaning.kind == kind]

    def by_joint(self, kind: Kind) -> dict[int, tuple[str, Meaning]]:
        """Name and meaning of each joint's column of a kind.

        Raises:
            FileError: a joint has two, or there is a joint too many.
        """
        at: dict[int, tuple[str, Meaning]] = {}
        for name, meaning in self.of(kind):
            if meaning.index >= len(self.robot.joints):
                count = len(self.robot.joints)
                message = f"is a joint that {self.robot.name} does not have; it has {count}: is it the right robot?"
                raise self.header_error(f"'{name}' {message}")
            if meaning.index in at:
                joint, twice = self.robot.joint_names[meaning.index], f"by '{at[meaning.index][0]}' and '{name}'"
                other = f", or name the joint's q{meaning.index + 1}" if joint.casefold() in POINT_COLUMNS else ""
                raise self.header_error(f"joint {joint} is given twice, {twice}; keep one{other}")
            at[meaning.index] = (name, meaning)
        return at

    def by_target(self, kind: Kind) -> dict[str, dict[int, tuple[str, Meaning]]]:
        """Name and meaning of the columns of a kind by target in small letters, and by index."""
        out: dict[str, dict[int, tuple[str, Meaning]]] = {}
        for name, meaning in self.of(kind):
            out.setdefault(meaning.target.casefold(), {})[meaning.index] = (name, meaning)
        return out

    @cached_property
    def unread(self) -> set[str]:
        """Columns of known meaning that are not read: parts of an uncertainty, rotations beside others, times without a unit."""
        parts, out = self.by_target("uncertainty"), set[str]()
        for name, meaning in self.of("uncertainty"):
            own = parts[meaning.target.casefold()]
            out |= {name} if meaning.index != 3 and (3 in own or len(own) < 3) else set()
        quaternion, matrix = bool(self.of("quaternion")), len(self.of("matrix")) >= 9
        beside: dict[Kind, bool] = {"matrix": quaternion or not matrix, "euler": quaternion or matrix}
        out |= {name for kind, unread in beside.items() if unread for name, _ in self.of(kind)}
        for kind in ("time", "temperature"):
            columns = self.of(kind)
            read = [name for name, meaning in columns if kind == "temperature" or meaning.unit in TIMES]
            out |= {name for name, _ in columns} - set(read[:1])
        return out


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
        where=listed(said, 2, "; "),
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
