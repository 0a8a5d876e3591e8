"""Where the robot of a RAPID program stands: the base frame in ``MOC.cfg``, the motion parameters of a backup.

A section of such a file begins with its name and a colon, ``ROBOT:``; each of its records begins with ``-name`` and goes on in
the next line behind a backslash. ``base_frame_pos_x`` … are metres, ``base_frame_orient_u0`` … a quaternion, its scalar first;
what is not written keeps its value of zero displacement (Technical reference manual, System parameters, type Robot).
"""

import re

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.programs.source import Source

SUFFIX = ".cfg"

_DOMAIN = re.compile(r"\ufeff?\s*(\w+):CFG_")
_SECTION = re.compile(r"^(\w+):\s*$", re.MULTILINE)
_NAME = re.compile(r'-name\s+"([^"]*)"')
_NUMBER = re.compile(r"-base_frame_(pos_[xyz]|orient_u[0-3])\s+([^\s\\]+)")
_MOVED_BY = re.compile(r'-base_frame_\w+\s+"([^"]+)"')

_LENGTH = 0.01
"""How far the length of the quaternion may be from one."""


def base_frame(source: Source) -> Float[np.ndarray, "4 4"]:
    """Pose of the robot's base in the world.

    Raises:
        FileError: the file holds other parameters, no robot, several that stand in different places, or one that a track
            moves; or a number is not one.
    """
    domain = _DOMAIN.match(source.text)
    if domain is None or domain[1].upper() != "MOC":
        raise FileError(source.path, "holds no motion parameters; of a controller's .cfg files pass MOC.cfg only")
    frames = {name: _frame(record, name, source) for name, record in _robots(source.text)}
    if not frames:
        raise FileError(source.path, "has no robot in its section ROBOT")
    first, *others = frames.values()
    if any(np.abs(other - first).max() > 0.0 for other in others):
        raise FileError(
            source.path,
            f"has robots in different places ({', '.join(frames)}); leave it out and state base in [robot] of the cell file",
        )
    return first


def _robots(text: str) -> list[tuple[str, str]]:
    """Name and text of each record of the section ROBOT."""
    sections = list(_SECTION.finditer(text))
    ends = [*(section.start() for section in sections[1:]), len(text)]
    robots: list[tuple[str, str]] = []
    for section, end in zip(sections, ends, strict=True):
        if section[1].upper() != "ROBOT":
            continue
        body = text[section.end() : end]
        names = list(_NAME.finditer(body))
        behind = [*(name.start() for name in names[1:]), len(body)]
        robots += [(name[1], body[name.start() : at]) for name, at in zip(names, behind, strict=True)]
    return robots


def _frame(record: str, name: str, source: Source) -> Float[np.ndarray, "4 4"]:
    moved_by = _MOVED_BY.search(record)
    if moved_by:
        raise FileError(
            source.path,
            f"says that {moved_by[1]} moves the base of {name}; leave it out and state [robot] base and the [[axis]] that "
            "carries the robot in the cell file",
        )
    values = {"orient_u0": 1.0}
    for key, text in _NUMBER.findall(record):
        try:
            values[key] = float(text)
        except ValueError:
            raise FileError(source.path, f"base_frame_{key} of {name} is '{text}', which is not a number") from None
    xyz = np.array([values.get(f"pos_{axis}", 0.0) for axis in "xyz"])
    wxyz = np.array([values.get(f"orient_u{i}", 0.0) for i in range(4)])
    length = np.linalg.norm(wxyz)
    if not (np.isfinite(xyz).all() and abs(length - 1.0) <= _LENGTH):
        raise FileError(source.path, f"the base frame of {name} is not a pose: its quaternion has length {length:.4g}")
    return se3.pose(se3.from_quaternion(np.array([*wxyz[1:], wxyz[0]]) / length), xyz)
