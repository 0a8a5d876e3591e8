"""Links of a robot as capsules, and their distances from each other, from boxes and from a beam."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from taskcal.geometry import se3
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, Joint, Step
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Part
from taskcal.short_repr import short_repr

SAMPLE_COUNT = 9
"""Points along a link's axis that are compared with a box."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Box:
    """A box that the robot must keep out of, in the robot's base."""

    pose: Float[np.ndarray, "4 4"]
    """Of its centre."""
    size: Float[np.ndarray, " 3"]
    """Edges, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Links:
    """The robot's links at some poses, each a capsule."""

    start: Float[np.ndarray, "n links 3"]
    """One end of each axis, in the base, metres."""
    end: Float[np.ndarray, "n links 3"]
    """The other."""
    radius: Float[np.ndarray, " links"]
    """Metres."""


def place_links(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Links:
    """The links of the nominal robot: from the base to the first joint, from joint to joint, and to the TCP.

    Robots whose file states no link radii have none.
    """
    robot = model.robot
    if robot.link_radii is None:
        return Links(start=np.zeros((len(q), 0, 3)), end=np.zeros((len(q), 0, 3)), radius=np.zeros(0))
    s = model.nominal.walk(q).s
    steps: list[Step] = []
    origins = [np.zeros((len(q), 3))]

    def fix(parts: tuple[Part, ...]) -> None:
        steps.extend(part.step for part in parts)

    def here() -> Float[np.ndarray, "n 3"]:
        return walk.poses(Chain.of(steps), s, np.zeros((0, 6)))[:, :3, 3]

    for joint in robot.joints:
        fix(joint.before)
        origins.append(here())
        steps.append(Joint(joint.kind))
        fix(joint.after)
    fix(robot.tool)
    origins.append(here())
    points = np.stack(origins, axis=1)
    return Links(start=points[:, :-1], end=points[:, 1:], radius=np.asarray(robot.link_radii))


def without_carriers(links: Links, tip: Float[np.ndarray, "n 3"]) -> Links:
    """The links without those at the end of the chain that surround a point on the tool in every posture.

    These carry the point: whatever it touches or is seen from, they cannot stay clear of by more than their own size. The
    last link, which is the tool, always does.

    Args:
        links: of the robot.
        tip: the point in every posture, in the base, metres.
    """
    count = links.start.shape[1]
    if not count or not len(tip):
        return links
    way = float(np.linalg.norm(tip[0] - links.end[0, -1]))
    kept = count - 1
    while kept:
        way += float(np.linalg.norm(links.end[0, kept] - links.start[0, kept]))
        if way > links.radius[kept - 1]:
            break
        kept -= 1
    return Links(start=links.start[:, :kept], end=links.end[:, :kept], radius=links.radius[:kept])


def segment_distance(
    p0: Float[np.ndarray, "n 3"],
    p1: Float[np.ndarray, "n 3"],
    q0: Float[np.ndarray, "n 3"],
    q1: Float[np.ndarray, "n 3"],
) -> Float[np.ndarray, " n"]:
    """Distance between two segments (Ericson 2005, section 5.1.9)."""
    u, v, w = p1 - p0, q1 - q0, p0 - q0
    a, e, f = (u * u).sum(-1), (v * v).sum(-1), (v * w).sum(-1)
    b, c = (u * v).sum(-1), (u * w).sum(-1)
    tiny = 1e-18
    denominator = a * e - b * b
    s = np.where(denominator > tiny, np.clip((b * f - c * e) / np.maximum(denominator, tiny), 0.0, 1.0), 0.0)
    t = np.where(e > tiny, np.clip((b * s + f) / np.maximum(e, tiny), 0.0, 1.0), 0.0)
    s = np.where(a > tiny, np.clip((b * t - c) / np.maximum(a, tiny), 0.0, 1.0), 0.0)
    return np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1)


def gap_between_links(links: Links) -> Float[np.ndarray, " n"]:
    """The least gap between two links that are not neighbours, metres: negative where they meet, infinite where there are none.

    Links are neighbours if the length between them along the chain is shorter than their radii together: these overlap in
    every posture.
    """
    n, count = links.start.shape[:2]
    gap = np.full(n, np.inf)
    if not n:
        return gap
    lengths = np.linalg.norm(links.end - links.start, axis=2).max(axis=0)
    for i in range(count):
        for j in range(i + 1, count):
            room = links.radius[i] + links.radius[j]
            if lengths[i + 1 : j].sum() <= room or lengths[i] == 0.0 or lengths[j] == 0.0:
                continue
            apart = segment_distance(links.start[:, i], links.end[:, i], links.start[:, j], links.end[:, j])
            gap = np.minimum(gap, apart - room)
    return gap


def clear_of_itself(links: Links) -> Bool[np.ndarray, " n"]:
    """Whether no two links meet that are not neighbours, as `gap_between_links` has them."""
    return gap_between_links(links) > 0.0


def gap_to_boxes(links: Links, boxes: tuple[Box, ...]) -> Float[np.ndarray, " n"]:
    """The least gap between a link and a box, metres: at most zero where one reaches into one, infinite where there are none.

    The fixed link from base to first joint is left out; it may stand in a box.
    """
    gap = np.full(len(links.start), np.inf)
    share = np.linspace(0.0, 1.0, SAMPLE_COUNT)[:, None]
    for box in boxes:
        inverse = se3.inverse(box.pose)
        for k in range(1, links.start.shape[1]):
            points = links.start[:, k, None] + share * (links.end[:, k, None] - links.start[:, k, None])
            local = np.abs(se3.apply(inverse, points)) - 0.5 * box.size
            distance = np.linalg.norm(np.maximum(local, 0.0), axis=2)
            gap = np.minimum(gap, distance.min(axis=1) - links.radius[k])
    return gap


def clear_of_boxes(links: Links, boxes: tuple[Box, ...]) -> Bool[np.ndarray, " n"]:
    """Whether every link stays outside every box; the fixed link from base to first joint may stand in one."""
    return gap_to_boxes(links, boxes) > 0.0


def beam_is_free(
    source: Float[np.ndarray, " 3"], target: Float[np.ndarray, "n 3"], links: Links, boxes: tuple[Box, ...]
) -> Bool[np.ndarray, " n"]:
    """Whether the straight line from the tracker to a target on the tool misses links and boxes.

    The last link carries the target and is left out: whether it hides the target is the acceptance angle's matter.
    """
    others = Links(start=links.start[:, :-1], end=links.end[:, :-1], radius=links.radius[:-1])
    return line_is_free(source, target, others, boxes)


def line_is_free(
    source: Float[np.ndarray, " 3"], target: Float[np.ndarray, "n 3"], links: Links, boxes: tuple[Box, ...]
) -> Bool[np.ndarray, " n"]:
    """Whether the straight line between two points misses all of some links, and boxes."""
    n = len(target)
    free = np.ones(n, dtype=bool)
    start = np.broadcast_to(source, (n, 3))
    for k in range(links.start.shape[1]):
        free &= segment_distance(start, target, links.start[:, k], links.end[:, k]) > links.radius[k]
    for box in boxes:
        free &= ~_meets_box(se3.apply(se3.inverse(box.pose), start), se3.apply(se3.inverse(box.pose), target), box.size)
    return free


def _meets_box(
    a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"], size: Float[np.ndarray, " 3"]
) -> Bool[np.ndarray, " n"]:
    """Whether a segment meets a box about the origin, by slabs."""
    along = np.where(np.abs(b - a) < 1e-12, 1e-12, b - a)
    first, second = (-0.5 * size - a) / along, (0.5 * size - a) / along
    enter = np.minimum(first, second).max(axis=1)
    leave = np.maximum(first, second).min(axis=1)
    return (enter <= leave) & (leave >= 0.0) & (enter <= 1.0)
