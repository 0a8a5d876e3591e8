"""The numbers of a rewritten target, as text."""

from itertools import zip_longest

import numpy as np

from taskcal.programs.program import Waypoint
from taskcal.programs.rapid.configuration import Configuration
from taskcal.programs.rapid.real import DEG_DECIMALS, MM_DECIMALS, quaternion_texts, real
from taskcal.programs.rapid.target_argument import TargetArgument, TargetType, configuration, leaves, pose_numbers
from taskcal.robot.robot import Robot

SAME_MM = 1e-4
SAME_QUATERNION = 1e-7
SAME_DEG = 1e-6
"""Numbers that change by no more keep their text."""

Texts = tuple[str | None, ...]
"""A text for each number of a target before its external axes; None where it keeps its own."""


SAME_WANTED_MM, SAME_WANTED = 1e-3, 2e-6
"""Texts that differ by no more, millimetres, and parts of a quaternion or degrees, want the same."""


def agree(target: TargetArgument, texts: Texts, others: Texts) -> bool:
    """Whether two texts of a target want the same numbers."""
    pairs = zip(texts, others, target.meant, strict=True)
    off = [abs((old if a is None else float(a)) - (old if b is None else float(b))) for a, b, old in pairs]
    if target.type == "jointtarget":
        return max(off) <= SAME_WANTED
    return max(off[:3]) <= SAME_WANTED_MM and max(off[3:7]) <= SAME_WANTED and max(off[7:]) == 0.0


def new_texts(target: TargetArgument, waypoint: Waypoint, robot: Robot) -> Texts:
    """What to write for a waypoint where a target stood."""
    if target.type == "jointtarget":
        degrees = np.degrees(waypoint.q)
        return tuple(
            None if abs(new - old) <= SAME_DEG else real(float(new), DEG_DECIMALS)
            for new, old in zip(degrees, target.meant, strict=True)
        )
    pose = _pose(waypoint)
    texts: list[str | None] = [
        None if abs(new - old) <= SAME_MM else real(new, MM_DECIMALS)
        for new, old in zip(pose[:3], target.meant[:3], strict=True)
    ]
    old = np.array(target.meant[3:7])
    new = np.array(pose[3:])
    new = new if new @ old >= 0.0 else -new
    if np.abs(new - old).max() <= SAME_QUATERNION:
        texts += [None] * 4
    else:
        written = quaternion_texts(tuple(float(v) for v in new))
        raw = (
            [leaf.value for leaf in leaves(target.literal)[3:7]]
            if target.literal and not target.shifted
            else [np.inf] * 4
        )
        texts += [
            None if abs(float(text) - value) <= SAME_QUATERNION else text
            for text, value in zip(written, raw, strict=True)
        ]
    stated = configuration(target.meant[7:])
    cf = Configuration.of(robot, waypoint.q, stated)
    pairs = zip((cf.cf1, cf.cf4, cf.cf6, cf.cfx), (stated.cf1, stated.cf4, stated.cf6, stated.cfx), strict=True)
    return (*texts, *(None if new == old else str(new) for new, old in pairs))


def fresh_text(type_: TargetType, waypoint: Waypoint, robot: Robot, like: TargetArgument) -> str:
    """An aggregate for a waypoint, with the external axes of a target."""
    if type_ == "jointtarget":
        numbers = [real(float(v), DEG_DECIMALS) for v in np.degrees(waypoint.q)]
        return _aggregate([numbers, external_texts(like, waypoint.external)])
    pose = _pose(waypoint)
    stated = like.meant[3:] if like.type == "robtarget" else None
    sign = 1.0 if stated is None or np.dot(pose[3:], stated[:4]) >= 0.0 else -1.0
    cf = Configuration.of(robot, waypoint.q, configuration(stated[4:]) if stated else None)
    return _aggregate(
        [
            [real(v, MM_DECIMALS) for v in pose[:3]],
            list(quaternion_texts(tuple(sign * v for v in pose[3:]))),
            [str(v) for v in (cf.cf1, cf.cf4, cf.cf6, cf.cfx)],
            external_texts(like, waypoint.external),
        ]
    )


def _pose(waypoint: Waypoint) -> tuple[float, ...]:
    if waypoint.T is None:
        raise ValueError("a motion to a pose needs one")
    return pose_numbers(waypoint.T)


def meant_text(target: TargetArgument, texts: Texts) -> str:
    """An aggregate for a target, its numbers replaced where there are new ones."""
    meant = target.meant
    if target.type == "jointtarget":
        own = [real(v, DEG_DECIMALS) for v in meant]
        groups = [6]
    else:
        own = [*(real(v, MM_DECIMALS) for v in meant[:3]), *quaternion_texts(meant[3:7])]
        own += [str(int(v)) for v in meant[7:]]
        groups = [3, 4, 4]
    numbers = iter([new if new is not None else old for new, old in zip(texts, own, strict=True)])
    return _aggregate([*([next(numbers) for _ in range(count)] for count in groups), external_texts(target)])


def external_texts(target: TargetArgument, positions: tuple[float, ...] = ()) -> list[str]:
    """The positions of external axes as they are written, or as they would be; or others, where these are numbers."""
    if target.literal is None:
        written = [real(v, MM_DECIMALS) for v in target.external]
    else:
        text = target.file.source.text
        written = [text[leaf.start : leaf.end] for leaf in leaves(target.literal)[-6:]]
    return [
        own if new is None or np.isnan(new) or new == old else real(new, MM_DECIMALS)
        for own, old, new in zip_longest(written, target.external, positions)
    ]


def _aggregate(groups: list[list[str]]) -> str:
    return "[" + ",".join("[" + ",".join(group) + "]" for group in groups) + "]"
