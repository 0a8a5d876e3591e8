"""Robots from Universal Robots' own files: the kinematics YAML of the ROS driver, calibration.conf, and programs (.urp)."""

import math
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from taskcal.errors import FileError, TaskcalError, printable, shown
from taskcal.geometry import se3
from taskcal.io.text_file import read_bytes, read_text
from taskcal.robot.importers.base import RobotImporter
from taskcal.robot.importers.urdf import steps_of
from taskcal.robot.robot import Robot

LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
"""Of the driver, from the base."""

PLACE = ("x", "y", "z", "roll", "pitch", "yaw")
MAX_SIZE_MB = 0.1
MAX_NUMBER = 1e3
"""Metres and radians; calibrated tables have d of hundreds of metres."""

URP_HEAD_BYTES = 100_000
"""Of an unpacked program: its kinematics stand in the first thousand."""

_KINEMATICS = re.compile(r'<kinematics\s[^>]*\bstatus="(?P<status>\w*)"[^>]*>(?P<inside>.*?)</kinematics>', re.DOTALL)
"""Of the controller on which a program was saved; waypoints have theirs as ``Kinematics``."""
_LINEARIZED = "LINEARIZED"
"""Status of kinematics that the factory measured; ``NOT_INITIALIZED`` and ``NOT_LINEARIZED`` are those of no arm."""
_VALUES = re.compile(r'<(?P<key>deltaTheta|a|d|alpha)\s+value="(?P<values>[^"]*)"')

_LINE = re.compile(r"(?P<indent> *)(?P<key>[A-Za-z_][\w]*):(?:\s+(?P<value>[^#]*?))?\s*(?:#.*)?")
_ROW = re.compile(r"\s*(?P<key>(?:delta_)?(?:theta|a|d|alpha))\s*=\s*\[(?P<values>[^\]]*)\]\s*")


def describe_kinematics_yaml(path: str | Path, name: str | None = None) -> dict[str, Any]:
    """A robot file's content from the ``kinematics`` YAML of Universal Robots' ROS driver.

    Args:
        path: the file, as ``ur_calibration`` and ``taskcal export`` write it.
        name: the robot's name; the file's by default.

    Raises:
        FileError: a link or a number is lacking.
    """
    path = Path(path)
    places = _places(path)
    joints: list[dict[str, Any]] = []
    for i, (link, joint) in enumerate(zip(LINKS, JOINTS, strict=True), start=1):
        if link not in places:
            raise FileError(path, f"no entry for link '{link}'; UR's kinematics have {', '.join(LINKS)}")
        lacking = [key for key in PLACE if key not in places[link]]
        if lacking:
            raise FileError(path, f"has no {lacking[0]} of the link '{link}'")
        x, y, z, roll, pitch, yaw = (places[link][key] for key in PLACE)
        T = se3.rotation("z", yaw) @ se3.rotation("y", pitch) @ se3.rotation("x", roll)
        joints.append({"name": joint, "steps": steps_of(se3.translation(x, y, z) @ T, str(i))})
    return {
        "name": name or printable(path.stem),
        "source": [f"imported from {printable(path.name)}: kinematics of the ROS driver"],
        "joint": joints,
    }


def _places(path: Path) -> dict[str, dict[str, float]]:
    """Numbers of each link; the driver's files are two levels of keys, of which one reads no more than that."""
    places: dict[str, dict[str, float]] = {}
    link = ""
    text = read_text(path, MAX_SIZE_MB, otherwise="is not UTF-8 text; UR's kinematics are")
    for number, line in enumerate(text.split("\n"), start=1):
        if not line.strip() or line.lstrip().startswith(("#", "---", "%")):
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            raise FileError(
                path, f"'{shown(line.strip())}' is not a line of UR's kinematics, such as '    x: 0.425'", line=number
            )
        key, value = match["key"], match["value"]
        if not value:
            link = key
        elif key in PLACE:
            if link in LINKS:
                places.setdefault(link, {})[key] = _number(path, value, number)
        elif key != "hash":
            raise FileError(path, f"'{shown(key)}' is not a key of UR's kinematics", line=number)
    if not places:
        raise FileError(path, f"is not UR's kinematics: it has none of {', '.join(LINKS)}")
    return places


def arm_rows(path: str | Path) -> dict[str, list[float]]:
    """Rows of an arm's table, metres and radians: ``a``, ``d``, ``alpha`` and ``theta``, or ``delta_a`` … to add to a nominal one.

    Args:
        path: ``calibration.conf`` or ``urcontrol.conf`` of a UR's controller, or a program of PolyScope (``.urp``).

    Raises:
        FileError: a row has not six numbers; or the program was not saved on an arm whose kinematics were measured.
    """
    path = Path(path)
    return _rows_of_program(path) if path.suffix.lower() == ".urp" else _rows_of_conf(path)


def _rows_of_conf(path: Path) -> dict[str, list[float]]:
    rows: dict[str, list[float]] = {}
    text = read_text(path, MAX_SIZE_MB, otherwise="is not UTF-8 text; a controller's files are")
    for number, line in enumerate(text.split("\n"), start=1):
        match = _ROW.fullmatch(line.partition("#")[0])
        if match is not None:
            rows[match["key"]] = _row(path, match["key"], match["values"], number)
    return rows


def _rows_of_program(path: Path) -> dict[str, list[float]]:
    try:
        head = zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(read_bytes(path), URP_HEAD_BYTES)
    except zlib.error as error:
        raise FileError(path, "is not packed as programs of PolyScope (.urp) are") from error
    stated = _KINEMATICS.search(head.decode("utf-8", "replace"))
    if stated is None:
        raise FileError(
            path, "states no kinematics; save the program on the robot's controller, or use its calibration.conf"
        )
    if stated["status"] != _LINEARIZED:
        raise FileError(
            path,
            f"was saved where the arm's kinematics are not known (status '{shown(stated['status'], 40)}'); save it on the robot's "
            "controller, or use its calibration.conf",
        )
    rows = {m["key"]: _row(path, m["key"], m["values"], None) for m in _VALUES.finditer(stated["inside"])}
    if len(rows) < 4:
        raise FileError(
            path, f"states no whole table of the arm: deltaTheta, a, d and alpha, but {', '.join(rows) or 'none'}"
        )
    return {"theta" if key == "deltaTheta" else key: row for key, row in rows.items()}


def _row(path: Path, key: str, text: str, line: int | None) -> list[float]:
    values = [_number(path, word, line) for word in text.split(",") if word.strip()]
    if len(values) != len(JOINTS):
        raise FileError(path, f"{key} has {len(values)} numbers; a UR has {len(JOINTS)} joints", line=line)
    return values


def describe_calibration_conf(
    path: str | Path, nominal: Robot | None = None, name: str | None = None
) -> dict[str, Any]:
    """A robot file's content from ``calibration.conf`` of a UR's controller, the tables of its ``urcontrol.conf``, or a ``.urp``.

    Args:
        path: the file; metres and radians, as the controller writes them.
        nominal: the robot of its type, to which the deltas of ``calibration.conf`` are added.
        name: the robot's name; the nominal one's by default.

    Raises:
        FileError: rows are lacking or have not six numbers, or it has deltas only and no nominal robot is named.
    """
    path = Path(path)
    rows = arm_rows(path)
    table = _table_of(path, rows, nominal)
    joints: list[dict[str, Any]] = []
    for i in range(len(JOINTS)):
        alpha, a, d, theta = (float(table[key][i]) for key in ("alpha", "a", "d", "theta"))
        joint: dict[str, Any] = {} if nominal is None else dict(nominal.description["joint"][i])
        joint |= {
            "dh": {"alpha_deg": math.degrees(alpha), "a_mm": a * 1e3, "d_mm": d * 1e3},
            "offset_deg": math.degrees(theta),
        }
        joints.append({"name": joint.get("name", JOINTS[i]), **joint})
    base: dict[str, Any] = {} if nominal is None else dict(nominal.description)
    source = [
        f"imported from {printable(path.name)}" + ("" if nominal is None else f", its deltas added to {nominal.name}")
    ]
    base.pop("model_error", None)
    return {
        **base,
        "name": name or (printable(path.stem) if nominal is None else f"{nominal.name}-calibrated"),
        "source": source,
        "joint": joints,
    }


def _table_of(path: Path, rows: dict[str, list[float]], nominal: Robot | None) -> dict[str, np.ndarray]:
    """alpha, a, d and theta, metres and radians."""
    deltas = {key: rows[key] for key in rows if key.startswith("delta_")}
    if nominal is None:
        lacking = [key for key in ("alpha", "a", "d") if key not in rows]
        if lacking and deltas:
            raise FileError(
                path,
                "has deltas only; name the robot of its type with --nominal; taskcal robots lists those of the catalogue",
            )
        if lacking:
            raise FileError(
                path, f"has no row '{lacking[0]} = […]'; it is neither a calibration.conf nor a urcontrol.conf of a UR"
            )
        own = {key: np.array(rows.get(key, [0.0] * 6)) for key in ("alpha", "a", "d", "theta")}
    else:
        if not deltas:
            raise FileError(path, "has no deltas (delta_a = […]) to add to a nominal robot")
        if missing := [key for key in ("delta_theta", "delta_a", "delta_d", "delta_alpha") if key not in deltas]:
            raise FileError(path, f"has no row '{missing[0]} = […]', but other deltas; is the file whole?")
        described = nominal.description["joint"]
        if len(described) != len(JOINTS) or any("dh" not in joint for joint in described):
            raise TaskcalError(
                f"{nominal.name} is not a UR with a standard table; taskcal robots lists those of the catalogue"
            )
        dh = [joint["dh"] for joint in described]
        own = {
            "alpha": np.radians([row.get("alpha_deg", 0.0) for row in dh]),
            "a": np.array([row.get("a_mm", 0.0) for row in dh]) * 1e-3,
            "d": np.array([row.get("d_mm", 0.0) for row in dh]) * 1e-3,
            "theta": np.radians([joint.get("offset_deg", 0.0) for joint in described]),
        }
    return {key: value + np.array(deltas.get(f"delta_{key}", [0.0] * 6)) for key, value in own.items()}


def _number(path: Path, text: str, line: int | None) -> float:
    try:
        value = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if not abs(value) <= MAX_NUMBER:
        raise FileError(path, f"'{shown(text.strip())}' is not a number of metres or radians", line=line)
    return value


KINEMATICS = RobotImporter(
    name="UR's kinematics",
    suffixes=(".yaml", ".yml"),
    describe=lambda path, options: describe_kinematics_yaml(path, **options),
)

CALIBRATION_CONF = RobotImporter(
    name="UR's calibration",
    suffixes=(".conf", ".urp"),
    options=("nominal",),
    describe=lambda path, options: describe_calibration_conf(path, **options),
    whole=False,
)
