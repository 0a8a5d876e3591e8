"""The path of a tool in a part's frame: lines and arcs, as a controller interpolates them, on a robot, with rounded corners."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core.program import Motion, Zone
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

MAX_STRAIGHT_SHARE = 1e-6
"""An arc whose via point is nearer to its chord than this share of the chord is a line."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Segments:
    """Many segments at once; along each, orientation turns about one axis in step with the distance travelled."""

    start: Float[np.ndarray, "m 4 4"]
    """Pose of the tool in the part's frame, metres; NaN where it is not known."""
    end: Float[np.ndarray, "m 4 4"]
    via: Float[np.ndarray, "m 3"]
    """A point on the arc, metres; NaN for a line."""

    @cached_property
    def turn(self) -> Float[np.ndarray, "m 3"]:
        """Rotation from start to end in the start's axes, radians; NaN where an end is not known."""
        out = np.full((len(self.start), 3), np.nan)
        both_known = np.isfinite(self.start[:, 0, 0] + self.end[:, 0, 0])
        if both_known.any():
            R = np.swapaxes(self.start[both_known, :3, :3], 1, 2) @ self.end[both_known, :3, :3]
            out[both_known] = se3.log(R)
        return out

    @cached_property
    def _arc(self) -> tuple[Bool[np.ndarray, " m"], Float[np.ndarray, "m 3"], Float[np.ndarray, "m 3"], np.ndarray]:
        """Whether each segment is an arc, its centre, its axis, and the angles of its via point and of its end."""
        a, v, b = self.start[:, :3, 3], self.via, self.end[:, :3, 3]
        u, w = v - a, b - a
        with np.errstate(invalid="ignore", divide="ignore"):
            normal = np.cross(u, w)
            square = (normal**2).sum(axis=1)
            chord = np.maximum((w**2).sum(axis=1), (u**2).sum(axis=1))
            is_arc = square > (MAX_STRAIGHT_SHARE * chord) ** 2
            # centre of the circle through three points, from the first
            uu, ww = (u**2).sum(axis=1)[:, None], (w**2).sum(axis=1)[:, None]
            center = a + np.cross(uu * w - ww * u, normal) / (2.0 * square[:, None])
            axis = normal / np.sqrt(square)[:, None]
            angles = np.stack([_angle(a - center, point - center, axis) for point in (v, b)], axis=1)
        return is_arc, center, axis, angles

    @property
    def is_arc(self) -> Bool[np.ndarray, " m"]:
        """Whether each segment is an arc."""
        return self._arc[0]

    @property
    def arc_angle(self) -> Float[np.ndarray, " m"]:
        """Angle that each arc spans about its centre, 0 to 2π; zero for a line."""
        is_arc, _, _, angles = self._arc
        return np.where(is_arc, angles[:, 1], 0.0)

    @property
    def via_share(self) -> Float[np.ndarray, " m"]:
        """Share of an arc's length at which its via point lies; NaN for a line."""
        is_arc, _, _, angles = self._arc
        return np.where(is_arc, angles[:, 0] / np.where(is_arc, angles[:, 1], 1.0), np.nan)

    @cached_property
    def length(self) -> Float[np.ndarray, " m"]:
        """Length of the TCP's path, metres."""
        is_arc, center, _, angles = self._arc
        radius = np.linalg.norm(self.start[:, :3, 3] - center, axis=1)
        straight = np.linalg.norm(self.end[:, :3, 3] - self.start[:, :3, 3], axis=1)
        return np.where(is_arc, radius * angles[:, 1], straight)

    def at(self, segment: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 4 4"]:
        """Poses at shares of the length, 0 to 1, of some segments."""
        start, end = self.start[segment], self.end[segment]
        R = start[:, :3, :3] @ se3.exp(share[:, None] * self.turn[segment])
        p = start[:, :3, 3] + share[:, None] * (end[:, :3, 3] - start[:, :3, 3])
        is_arc, center, axis, angles = (array[segment] for array in self._arc)
        if is_arc.any():
            spoke = start[is_arc, :3, 3] - center[is_arc]
            turned = se3.exp(axis[is_arc] * (share * angles[:, 1])[is_arc, None])
            p[is_arc] = center[is_arc] + (turned @ spoke[:, :, None])[:, :, 0]
        return se3.pose(R, p)

    def direction(self, segment: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 3"]:
        """Unit vectors along some segments; zero where the TCP stays."""
        out = self.end[segment, :3, 3] - self.start[segment, :3, 3]
        is_arc, center, axis, _ = (array[segment] for array in self._arc)
        if is_arc.any():
            spoke = self.at(segment[is_arc], share[is_arc])[:, :3, 3] - center[is_arc]
            out[is_arc] = np.cross(axis[is_arc], spoke)
        size = np.linalg.norm(out, axis=1, keepdims=True)
        return np.where(size > 1e-9, out / np.maximum(size, 1e-9), 0.0)


def _angle(
    a: Float[np.ndarray, "m 3"], b: Float[np.ndarray, "m 3"], axis: Float[np.ndarray, "m 3"]
) -> Float[np.ndarray, " m"]:
    """Angle from a to b about an axis, 0 to 2π."""
    sine = (np.cross(a, b) * axis).sum(axis=1)
    return np.arctan2(sine, (a * b).sum(axis=1)) % (2.0 * np.pi)


# Where what the robot holds and what stands still are on a robot: as its controller knows it, as calibrated, or as it truly
# is.

PosesAlong = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From joint positions (n, joints), each in a motion (n) at a share of its length (n), to poses (n, 4, 4) of the robot's own
tool in its base."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Placement:
    """Frames of the held and of the fixed object."""

    T_tool_grasped: Float[np.ndarray, "4 4"]
    """What is held, in the robot's own tool."""
    T_base_fixed: Float[np.ndarray, "4 4"]
    """What stands still, in the base."""
    part_in_hand: bool
    """The part is held, and the tool stands still."""

    def tool_in_part(self, T_base_tool: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the program's tool in its part for poses of the robot's own tool in the base."""
        X = se3.inverse(self.T_base_fixed) @ T_base_tool @ self.T_tool_grasped
        return se3.inverse(X) if self.part_in_hand else X

    def robot_tool(self, T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the robot's own tool for poses of the program's tool in its part: the inverse of `tool_in_part`."""
        X = se3.inverse(T) if self.part_in_hand else T
        return self.T_base_fixed @ X @ se3.inverse(self.T_tool_grasped)


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedMotions:
    """The motions of a program on a robot, with where their tools and parts are."""

    tool_in_base: PosesAlong
    placements: tuple[Placement, ...]
    number: Int[np.ndarray, " m"]
    """Number of every motion's placement."""

    @classmethod
    def nominal(cls, robot: Robot, motions: Sequence[Motion]) -> "PlacedMotions":
        """The motions on a robot as its controller knows it."""
        model, from_tool = ErrorModel(robot), se3.inverse(robot.T_flange_tool)
        examples, number = distinct_frames(motions)
        placements = tuple(
            Placement(
                T_tool_grasped=from_tool @ (move.part.T if move.part_in_hand else move.tool.T),
                T_base_fixed=move.tool.T if move.part_in_hand else move.part.T,
                part_in_hand=move.part_in_hand,
            )
            for move in examples
        )
        return cls(tool_in_base=lambda q, move, share: model.poses(q), placements=placements, number=number)

    def tool_in_part(
        self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"], q: Float[np.ndarray, "k joints"]
    ) -> Float[np.ndarray, "k 4 4"]:
        """Poses of the program's tool in its part, for joint positions in some motions at shares of their lengths."""
        return self.seen(move, self.tool_in_base(q, move, share))

    def seen(self, move: Int[np.ndarray, " k"], T_base_tool: Float[np.ndarray, "k 4 4"]) -> Float[np.ndarray, "k 4 4"]:
        """Poses of the program's tool in its part, for poses of the robot's own tool in the base."""
        out = np.empty_like(T_base_tool)
        for rows, placement in self._rows(move):
            out[rows] = placement.tool_in_part(T_base_tool[rows])
        return out

    def robot_tool(self, move: Int[np.ndarray, " k"], T: Float[np.ndarray, "k 4 4"]) -> Float[np.ndarray, "k 4 4"]:
        """Poses of the robot's own tool in the base, for poses of the program's tool in its part."""
        out = np.empty_like(T)
        for rows, placement in self._rows(move):
            out[rows] = placement.robot_tool(T[rows])
        return out

    def segments(
        self,
        motions: Sequence[Motion],
        end: Float[np.ndarray, "m 4 4"],
        via: Float[np.ndarray, "m 3"],
        ended: Bool[np.ndarray, " m"],
    ) -> Segments:
        """Segments of the tool's path: where tool or part changes, from where the tool before ended there.

        Args:
            motions: the motions.
            end: tool in part where each ends, metres.
            via: points on the arcs, metres; NaN for others.
            ended: motions of which the end is known.
        """
        before = np.array([-1 if move.follows is None else move.follows for move in motions], dtype=np.int64)
        rows = np.flatnonzero(before >= 0)
        rows = rows[ended[before[rows]]]
        start = np.full_like(end, np.nan)
        start[rows] = self.seen(rows, self.robot_tool(before[rows], end[before[rows]]))
        return Segments(start=start, end=end, via=via)

    def _rows(self, move: Int[np.ndarray, " k"]) -> list[tuple[Int[np.ndarray, " _"], Placement]]:
        own = self.number[move]
        return [(np.flatnonzero(own == k), self.placements[k]) for k in np.unique(own)]


def distinct_frames(motions: Sequence[Motion]) -> tuple[list[Motion], Int[np.ndarray, " m"]]:
    """The first motion with each tool and part, and for every motion the number of that with its own."""
    numbers: dict[tuple[object, ...], int] = {}
    of_objects: dict[tuple[int, int, bool], int] = {}
    examples: list[Motion] = []
    own: list[int] = []
    for move in motions:
        objects = (id(move.tool), id(move.part), move.part_in_hand)
        if objects in of_objects:  # as nearly all
            own.append(of_objects[objects])
            continue
        key = (move.tool.name, move.tool.T.tobytes(), move.part.name, move.part.T.tobytes(), move.part_in_hand)
        if key not in numbers:
            numbers[key] = len(examples)
            examples.append(move)
        of_objects[objects] = numbers[key]
        own.append(numbers[key])
    return examples, np.array(own, dtype=np.int64)


# Corners that a tool rounds: where it leaves one motion for the next without a stop, and where it has joined that.
#
# The makers say: a corner path, a parabola, begins at the edge of the zone, which never reaches farther than half
# of the way to the position before or behind (ABB, RAPID reference manual, data type zonedata, and Motion and I/O
# principles, corner paths); approximation begins at the earliest at the stated distance from the target, and at
# half of the motion (KUKA, KST PLC mxAutomation, APO and PTP_APO).

PosesInMotions = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From numbers of motions (n) and shares of their lengths (n) to poses (n, 4, 4) of the tool in the part's frame."""

MIN_LENGTH_M = 1e-6
"""A motion whose TCP goes less far only turns the tool, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RoundedCorners:
    """Rounded corners of a program."""

    before: Int[np.ndarray, " m"]
    """Motion that each one joins from in a rounded corner; −1 where it begins in the target before."""
    after: Int[np.ndarray, " m"]
    """Motion for which each one is left in a rounded corner; −1 where it goes to its target."""
    entry: Float[np.ndarray, "m 2"]
    """Share of its length where it is joined: by the TCP, and by the orientation; zero in the target before."""
    exit: Float[np.ndarray, "m 2"]
    """Share of its length that is not gone any more: by the TCP, and by the orientation."""
    joined: Float[np.ndarray, "m 4 4"]
    """Tool in part where a motion of the joints is joined; NaN for others, which say their paths themselves."""
    left: Float[np.ndarray, "m 4 4"]
    """The same where one is left."""

    @classmethod
    def none(cls, m: int) -> "RoundedCorners":
        """Corners of a program that meets all its targets."""
        nobody, nothing, nowhere = np.full(m, -1), np.zeros((m, 2)), np.broadcast_to(np.nan, (m, 4, 4))
        return cls(before=nobody, after=nobody, entry=nothing, exit=nothing, joined=nowhere, left=nowhere)

    def only(self, kept: Bool[np.ndarray, " m"]) -> "RoundedCorners":
        """Corners at the ends of some motions."""
        after = np.where(kept, self.after, -1)
        before = np.where((self.before >= 0) & kept[np.maximum(self.before, 0)], self.before, -1)
        return replace(
            self,
            before=before,
            after=after,
            entry=np.where((before >= 0)[:, None], self.entry, 0.0),
            exit=np.where((after >= 0)[:, None], self.exit, 0.0),
        )


def find_corners(
    motions: Sequence[Motion], segments: Segments, known: Bool[np.ndarray, " m"], driven: PosesInMotions
) -> RoundedCorners:
    """Corners that the tool rounds in a program.

    Args:
        motions: the motions.
        segments: tool in part along lines and arcs, and from start to end of motions of the joints.
        known: motions whose start is known, and which can be executed.
        driven: tool in part along motions of the joints.
    """
    corners = RoundedCorners.none(len(motions))
    length, angle = segments.length, np.linalg.norm(segments.turn, axis=1)
    before, after = corners.before.copy(), corners.after.copy()
    entry, exit_ = corners.entry.copy(), corners.exit.copy()
    lengths, angles = length.tolist(), angle.tolist()
    for i, j in enumerate(_followers(motions)):
        zone = motions[i].zone
        if j < 0 or motions[i].stops or zone is None or not zone.rounds:
            continue
        if not (known[i] and known[j] and _in_common(motions[i], motions[j])):
            continue
        exit_[i], entry[j] = _shares(zone, lengths[i], lengths[j], angles[i], angles[j])
        if exit_[i, 0] > 0.0 or exit_[i, 1] > 0.0:
            after[i], before[j] = j, i
    chords = []
    by_joints = np.array([move.kind in ("joint", "axes") for move in motions], dtype=bool)
    for partner, share in ((before, entry.max(axis=1, initial=0.0)), (after, 1.0 - exit_.max(axis=1, initial=0.0))):
        T, rows = corners.left, np.flatnonzero((partner >= 0) & by_joints)
        if len(rows):
            T = T.copy()
            T[rows] = driven(rows, share[rows])
        chords.append(T)
    return RoundedCorners(before=before, after=after, entry=entry, exit=exit_, joined=chords[0], left=chords[1])


def _followers(motions: Sequence[Motion]) -> list[int]:
    """The motion behind each one; −1 where there is none, or more than one may come."""
    followers = [-1] * len(motions)
    several: set[int] = set()
    for j, move in enumerate(motions):
        if move.follows is not None:
            if followers[move.follows] >= 0:
                several.add(move.follows)
            followers[move.follows] = j
    return [-1 if i in several else j for i, j in enumerate(followers)]


def _in_common(first: Motion, second: Motion) -> bool:
    """Whether two motions have tool and part in common."""
    if first.tool is second.tool and first.part is second.part:
        return first.part_in_hand == second.part_in_hand
    return first.part_in_hand == second.part_in_hand and all(
        a is b or (a.name == b.name and np.array_equal(a.T, b.T))
        for a, b in ((first.tool, second.tool), (first.part, second.part))
    )


def _shares(
    zone: Zone, length: float, next_length: float, angle: float, next_angle: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Shares of two motions that a corner between them takes: of the first and of the second, by point and orientation."""
    if length > MIN_LENGTH_M and next_length > MIN_LENGTH_M:
        most = min(length / 2.0, next_length / 2.0, zone.share * length)
        point, turn = min(zone.distance, most), min(max(zone.distance, zone.turn_distance), most)
        return (point / length, turn / length), (point / next_length, turn / next_length)
    if length <= MIN_LENGTH_M and next_length <= MIN_LENGTH_M and angle > 0.0 and next_angle > 0.0:
        size = min(zone.angle, angle / 2.0, next_angle / 2.0, zone.share * angle)
        return (size / angle, size / angle), (size / next_angle, size / next_angle)
    return (0.0, 0.0), (0.0, 0.0)  # between a path and a turn on the spot, half of which is no way at all


# The path of a tool that rounds its corners.

STRAIGHT_M, STRAIGHT_RAD = 1e-6, 1e-6
"""A corner whose target the tool passes by nearer than this, metres and radians, is none."""

END_SHARE = 1e-12

POINT, TURN = 0, 1
"""Columns of the sizes of a corner: for the TCP, and for the orientation."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RoundedPath:
    """Segments of a tool's path, with the corners between them rounded.

    In a corner the TCP goes along a cubic Bézier curve that touches both motions where they are left and joined: between
    lines it is the parabola, between two pieces of one arc the arc to fourth order. The orientation turns as both motions
    turn it, the one running out while the other sets in. A share of a motion's length is that of its segment; the
    corner is half passed where the motion would have ended.
    """

    segments: Segments
    corners: RoundedCorners

    def at(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 4 4"]:
        """Poses at shares of the lengths of some motions, 0 to 1; at the end also where the start is not known."""
        at_end = share >= 1.0 - END_SHARE
        T = np.where(at_end[:, None, None], self.segments.end[move], self.segments.at(move, share))
        passage = self._passage(move, share, POINT)
        if len(passage.rows):
            T[passage.rows, :3, 3] = _bezier(self._controls(passage), passage.u[:, None])
        passage = self._passage(move, share, TURN)
        if len(passage.rows):
            T[passage.rows, :3, :3] = self._orientations(passage)
        return T

    def direction(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 3"]:
        """Unit vectors along the path; zero where the TCP stays."""
        out = self.segments.direction(move, share)
        passage = self._passage(move, share, POINT)
        if len(passage.rows):
            A, C, D, B = self._controls(passage)
            u = passage.u[:, None]
            along = (1.0 - u) ** 2 * (C - A) + 2.0 * u * (1.0 - u) * (D - C) + u**2 * (B - D)
            size = np.linalg.norm(along, axis=1, keepdims=True)
            out[passage.rows] = np.where(size > 1e-12, along / np.maximum(size, 1e-12), 0.0)
        return out

    def inside(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
        """Whether the tool is in a corner there."""
        leaving = 1.0 - share < self.corners.exit[move].max(axis=1, initial=0.0)
        return leaving | (share < self.corners.entry[move].max(axis=1, initial=0.0))

    def bent(self) -> "RoundedPath":
        """The path without corners that are as good as straight."""
        rows = np.flatnonzero(self.corners.after >= 0)
        T, P = self.at(rows, np.ones(len(rows))), self.segments.end[rows]
        off = np.linalg.norm(T[:, :3, 3] - P[:, :3, 3], axis=1)
        turn = np.linalg.norm(se3.log(np.swapaxes(P[:, :3, :3], 1, 2) @ T[:, :3, :3]), axis=1)
        kept = np.zeros(len(self.corners.after), dtype=bool)
        kept[rows] = (off > STRAIGHT_M) | (turn > STRAIGHT_RAD)
        return replace(self, corners=self.corners.only(kept))

    @cached_property
    def _runs(self) -> tuple[Segments, Segments]:
        """Segments that are left and that are joined; for a motion of the joints, the chord over the corner."""
        own, corners = self.segments, self.corners
        left, joined = _is_known(corners.left), _is_known(corners.joined)
        return (
            replace(own, start=np.where(left[:, None, None], corners.left, own.start)) if left.any() else own,
            replace(own, end=np.where(joined[:, None, None], corners.joined, own.end)) if joined.any() else own,
        )

    def _passage(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"], part: int) -> "_Passage":
        corners = self.corners
        leaving = 1.0 - share < corners.exit[move, part]
        rows = np.flatnonzero(leaving | (share < corners.entry[move, part]))
        own, leaving, share = move[rows], leaving[rows], share[rows]
        first = np.where(leaving, own, corners.before[own])
        second = np.where(leaving, corners.after[own], own)
        exit_, entry = corners.exit[first, part], corners.entry[second, part]
        from_target = np.where(leaving, (share - 1.0) / exit_, share / entry)
        # shares of the chords of motions of the joints, which reach over the wider of both corners
        widest = corners.exit[first].max(axis=1, initial=0.0), corners.entry[second].max(axis=1, initial=0.0)
        return _Passage(
            rows=rows,
            first=first,
            second=second,
            u=(1.0 + from_target) / 2.0,
            exit=np.where(_is_known(corners.left)[first], exit_ / widest[0], exit_),
            entry=np.where(_is_known(corners.joined)[second], entry / widest[1], entry),
        )

    def _controls(self, passage: "_Passage") -> tuple[Float[np.ndarray, "k 3"], ...]:
        """Control points of the curves: where the first motion is left, two on the tangents, where the second is joined."""
        (left, joined), first, second = self._runs, passage.first, passage.second
        A = left.at(first, 1.0 - passage.exit)[:, :3, 3]
        B = joined.at(second, passage.entry)[:, :3, 3]
        C = A + _handle(left, first, passage.exit) * left.direction(first, 1.0 - passage.exit)
        D = B - _handle(joined, second, passage.entry) * joined.direction(second, passage.entry)
        return A, C, D, B

    def _orientations(self, passage: "_Passage") -> Float[np.ndarray, "k 3 3"]:
        (left, joined), u = self._runs, passage.u
        R_first = left.at(passage.first, 1.0 - passage.exit * (1.0 - u) ** 2)[:, :3, :3]
        R_target = self.segments.end[passage.first, :3, :3]
        R_second = joined.at(passage.second, passage.entry * u**2)[:, :3, :3]
        return R_first @ np.swapaxes(R_target, 1, 2) @ R_second


@dataclass(frozen=True, eq=False, kw_only=True)
class _Passage:
    """Places of the tool in corners."""

    rows: Int[np.ndarray, " k"]
    """Which places they are."""
    first: Int[np.ndarray, " k"]
    """Motion that is left."""
    second: Int[np.ndarray, " k"]
    """Motion that is joined."""
    u: Float[np.ndarray, " k"]
    """How far the corner is passed, 0 to 1."""
    exit: Float[np.ndarray, " k"]
    """Share of the first motion, or of its chord, that the corner takes."""
    entry: Float[np.ndarray, " k"]
    """The same of the second."""


def _bezier(controls: tuple[Float[np.ndarray, "k 3"], ...], u: Float[np.ndarray, "k 1"]) -> Float[np.ndarray, "k 3"]:
    A, C, D, B = controls
    v = 1.0 - u
    return v**3 * A + 3.0 * u * v**2 * C + 3.0 * u**2 * v * D + u**3 * B


def _handle(run: Segments, motion: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 1"]:
    """Distance of a control point from the end of its curve, metres.

    Two thirds of the way to the target make the parabola between lines; on an arc, a little more keeps to the circle.
    """
    half = np.minimum(run.arc_angle[motion] * share, np.pi / 2.0) / 2.0
    bow = np.where(half > 1e-4, np.tan(half) / np.maximum(half, 1e-4), 1.0)
    return (2.0 / 3.0 * bow * run.length[motion] * share)[:, None]


def _is_known(T: Float[np.ndarray, "m 4 4"]) -> Bool[np.ndarray, " m"]:
    return np.isfinite(T[:, 0, 0])
