"""A way of measuring without a tracker: what stands in the cell, what the tool carries, and which postures that allows."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.stats import qmc

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import (
    Box,
    Links,
    clear_of_boxes,
    clear_of_itself,
    line_is_free,
    place_links,
    without_carriers,
)
from taskcal.kinematics.inverse import JUMP_RAD, Reached, closes, solve_near
from taskcal.observations import Boards, Landmarks, Lengths, Measured, Observation, Sockets
from taskcal.observations.distance import FEWEST
from taskcal.observations.socket import CALLIPER, SocketDistance
from taskcal.planning.candidates import Measurable, enlarge
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.task.orientation import towards
from taskcal.task.task import Task, reach_task
from taskcal.task.workspace import Orientation
from taskcal.virtual.station import Standing


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuringWay(ABC):
    """What stands, and what the tool carries; a subclass says which postures may be measured, and what is read in them."""

    way: ClassVar[str]
    """What options call it: the instrument of its kind of observation."""
    label: ClassVar[str]
    """What each thing that stands is called, and the column that names it."""
    directed: ClassVar[bool] = True
    """Whether it matters how each thing is turned."""
    filled_in: ClassVar[str]
    """What is to be done with the file of a plan."""
    fewest: ClassVar[int]
    """Rows that each of the things needs."""
    standing: Standing
    T_tool_tip: Float[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))
    """What the tool carries, ball, wire's end or sensor, roughly; its z axis points away from the tool."""
    keep_out: tuple[Box, ...] = ()
    """Boxes that neither robot nor line of sight may enter."""

    @property
    def things(self) -> int:
        """How many stand."""
        return len(self.standing.names)

    def tip(self, model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Where the nominal robot has what the tool carries, in the base."""
        return model.poses(q) @ self.T_tool_tip

    def line_is_free(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"], links: Links
    ) -> Bool[np.ndarray, " n"]:
        """Whether the straight line from the thing of each row to the tool misses the links and the boxes."""
        free, links = np.ones(len(tip), dtype=bool), without_carriers(links, tip[:, :3, 3])
        for k in range(self.things):
            mine = of == k
            own = Links(start=links.start[mine], end=links.end[mine], radius=links.radius)
            free[mine] = line_is_free(self.standing.position[k], tip[mine, :3, 3], own, self.keep_out)
        return free

    @classmethod
    @abstractmethod
    def arrange(
        cls,
        p: Float[np.ndarray, "n 3"],
        pointing: Float[np.ndarray, " 3"],
        limits: tuple[float, float] | None,
        reach: float,
    ) -> Standing:
        """Where things could stand for a task, where nobody says where they do.

        Args:
            p: places of the tip in the task, metres.
            pointing: unit vector in which the tip points.
            limits: distances that the instrument measures, metres; its defaults where none are given.
            reach: of the robot, metres.
        """

    @abstractmethod
    def goals(
        self, model: ErrorModel, task: Task, thing: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in which one of the things may be measured, for numbers u in [0, 1)."""

    @abstractmethod
    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """Postures that cannot be measured although the robot reaches them clear of itself, by reason.

        Args:
            model: of the nominal robot.
            q: the postures, radians.
            of: which of the things is measured in each.
            links: of the robot in each.
        """

    @abstractmethod
    def observation(self, of: Int[np.ndarray, " n"]) -> Observation:
        """The kind of observation, with the thing of each row."""

    @property
    @abstractmethod
    def unknown(self) -> Float[np.ndarray, " u"]:
        """The kind's own unknowns, as they are stated."""

    def columns(self, of: Int[np.ndarray, " n"]) -> dict[str, list[str]]:
        """Columns of a campaign behind its joints: what each row is of, and empty cells for what is to be read."""
        kind = self.observation(of)
        rotations = np.tile(np.eye(3), (len(of), 1, 1)) if kind.width == 6 else None
        cells = kind.cells(Measured(np.zeros((len(of), 3)), rotations)) or {}
        return {name: texts if name in (self.label, "place") else [""] * len(of) for name, texts in cells.items()}

    @property
    def stages(self) -> Int[np.ndarray, " things"]:
        """Which of the things stand at the same time: things of one number do."""
        return np.zeros(self.things, dtype=np.int64)

    def rotations(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n 3 3"] | None:
        """Rotations that would be measured; None for kinds that measure none."""
        return None


# A camera on the wrist that sees landmarks which stand: postures in which they are in its sight.

FIELD_OF_VIEW = np.radians(40.0)
"""Full angle of the cone that the camera sees, by default: the smaller side of the picture of a common lens."""

NEAREST, FARTHEST = 0.2, 0.6
"""Distances from which a landmark is measured, by default, metres."""

TILT = np.radians(45.0)
"""Largest angle between a landmark's normal and the line of sight by default; flatter, patterns are measured badly."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class CameraWay(MeasuringWay):
    """Landmarks, and a camera on the tool that looks along its z axis."""

    way: ClassVar[str] = "camera"
    filled_in: ClassVar[str] = "fill in what the camera measures in the plan's file, row by row; identify then reads it"
    label: ClassVar[str] = "landmark"
    fewest: ClassVar[int] = 5
    field_of_view: float = FIELD_OF_VIEW
    """Full angle, radians."""
    nearest: float = NEAREST
    farthest: float = FARTHEST
    """From the camera, metres."""
    tilt: float = TILT
    """Largest angle between a landmark's normal and the line of sight, radians."""

    @classmethod
    def arrange(
        cls,
        p: Float[np.ndarray, "n 3"],
        pointing: Float[np.ndarray, " 3"],
        limits: tuple[float, float] | None,
        reach: float,
    ) -> Standing:
        """Before the tool."""
        low, high = limits or (NEAREST, FARTHEST)
        return _landmarks(p, pointing, 0.5 * (low + high))

    def goals(
        self, model: ErrorModel, task: Task, thing: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The camera anywhere before the landmark, turned so that it sees it somewhere in its picture."""
        before = Orientation(rotation=towards(self.standing.direction[thing]), cone=self.tilt)
        sight = before.sample(u[:, :3])[:, :, 2]
        aim = np.stack([towards(-direction) for direction in sight])
        turned = Orientation(rotation=np.eye(3), cone=0.5 * self.field_of_view, spin=np.pi).sample(u[:, 3:])
        # the number that a turn of the cone about its own axis would use is free for the distance
        distance = self.nearest + (self.farthest - self.nearest) * u[:, 2]
        position = self.standing.position[thing] + distance[:, None] * sight
        return se3.pose(aim @ turned, position) @ se3.inverse(self.T_tool_tip)

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """A landmark out of sight, or hidden by the robot."""
        tip = self.tip(model, q)
        sight = self.standing.position[of] - tip[:, :3, 3]
        distance = np.linalg.norm(sight, axis=1)
        edge = 1e-9
        within = (distance >= self.nearest - edge) & (distance <= self.farthest + edge)
        seen = (sight * tip[:, :3, 2]).sum(axis=1) >= (np.cos(0.5 * self.field_of_view) - edge) * distance
        faces = -(sight * self.standing.direction[of]).sum(axis=1) >= (np.cos(self.tilt) - edge) * distance
        return {
            "the landmark too near, too far, out of the picture or too flat": ~(within & seen & faces),
            "the landmark behind the robot": ~self.line_is_free(tip, of, links),
        }

    def observation(self, of: Int[np.ndarray, " n"]) -> Landmarks:
        """Landmarks, with that of each row."""
        return Landmarks(landmarks=self.standing.names, of=of)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Their places."""
        return self.standing.position.reshape(-1)


# A camera on the wrist that sees boards which stand, and how they are turned.


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class BoardWay(CameraWay):
    """Boards in place of landmarks; about their directions they may be turned anyhow."""

    way: ClassVar[str] = "board"

    def observation(self, of: Int[np.ndarray, " n"]) -> Boards:
        """Boards, with that of each row."""
        return Boards(landmarks=self.standing.names, of=of)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Their places, and how they are turned."""
        turned = np.stack([se3.log(R) for R in self._turned])
        return np.concatenate([self.standing.position, turned], axis=1).reshape(-1)

    @property
    def _turned(self) -> Float[np.ndarray, "things 3 3"]:
        return np.stack([towards(direction) for direction in self.standing.direction])

    def rotations(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n 3 3"] | None:
        """Of the boards in the camera's frame."""
        return np.swapaxes(tip[:, :3, :3], 1, 2) @ self._turned[of]


# A ball on the tool, put into sockets: postures that a socket allows, reached along its axis.

CONE = np.radians(45.0)
"""Tilt that a socket allows by default. The stem alone would allow more: a 20 mm ball on an 8 mm stem leans 70° and more over a
socket that ends where it carries the ball. But the flange must clear the block: one of 80 mm on a stem of 100 mm does at 45°."""

APPROACH = 0.05
"""From so far a socket is approached along its axis, metres."""

AROUND, BELOW = 0.03, 0.06
"""How far a block reaches beyond its sockets on every side, and below the balls in them, metres."""

STEPS, STRAIGHT = 5, 2e-4
"""Steps of the way into a socket, in each of which the joints turn evenly; and how far the ball may leave the axis meanwhile,
metres."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class SocketWay(MeasuringWay):
    """Sockets, and a ball at the tip of the tool, whose stem runs along the tip's z axis."""

    way: ClassVar[str] = "socket"
    filled_in: ClassVar[str] = (
        "the rows name the sockets; the joints are those of the plan: before identifying, overwrite them by what the "
        "controller shows with the ball seated"
    )
    label: ClassVar[str] = "socket"
    fewest: ClassVar[int] = 5
    distances: tuple[SocketDistance, ...] = ()
    """Stated ones between sockets."""
    cone: float = CONE
    """Largest angle between the stem and the socket's axis, radians."""
    distance: float = APPROACH
    """From which a socket is approached, metres."""

    @property
    def blocks(self) -> tuple[Box, ...]:
        """One under the sockets of each place, up to the middle of the balls."""
        boxes: list[Box] = []
        places = np.array(self.standing.places)
        for place in dict.fromkeys(self.standing.places):
            own = places == place
            axis = self.standing.direction[own].mean(axis=0)
            axis = axis if np.linalg.norm(axis) > 1e-6 else self.standing.direction[own][0]
            R = _along(towards(axis), self.standing.position[own])
            local = self.standing.position[own] @ R
            margin = np.array([AROUND, AROUND, 0.0])
            low, high = local.min(axis=0) - margin, local.max(axis=0) + margin
            low[2] -= BELOW
            boxes.append(Box(pose=se3.pose(R, R @ (0.5 * (low + high))), size=high - low))
        return tuple(boxes)

    @classmethod
    def arrange(
        cls,
        p: Float[np.ndarray, "n 3"],
        pointing: Float[np.ndarray, " 3"],
        limits: tuple[float, float] | None,
        reach: float,
    ) -> Standing:
        """A block where the tool works."""
        return _blocks(p, pointing)

    def goals(
        self, model: ErrorModel, task: Task, thing: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The ball in the socket, the stem tilted within the cone and turned at will."""
        inward = Orientation(rotation=towards(-self.standing.direction[thing]), cone=self.cone, spin=np.pi)
        tip = se3.pose(inward.sample(u[:, :3]), np.tile(self.standing.position[thing], (len(u), 1)))
        return tip @ se3.inverse(self.T_tool_tip)

    def tilt(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, " n"]:
        """Angle between the stem and the socket's axis, radians."""
        cosine = -(self.tip(model, q)[:, :3, 2] * self.standing.direction[of]).sum(axis=1)
        return np.arccos(np.clip(cosine, -1.0, 1.0))

    def out(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], share: float = 1.0
    ) -> Reached:
        """Postures on the way out of the sockets, along their axes, the tool turned as in the socket."""
        T = model.poses(q)
        T[:, :3, 3] += share * self.distance * self.standing.direction[of]
        found = solve_near(model, T, q)
        return replace(found, reached=found.reached & (np.abs(found.q - q).max(axis=1) < JUMP_RAD))

    def visits(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n steps joints"]:
        """Postures from the start of each approach into the socket, the last one, radians."""
        ways = [self.out(model, q, of, step / STEPS).q for step in range(STEPS, 0, -1)]
        return np.stack([*ways, q], axis=1)

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """Links in a block, and a way out that is not reached or not clear."""
        ball, axis = self.standing.position[of], self.standing.direction[of]
        blocked = ~self._clear(links, ball)
        stuck, last = np.zeros(len(q), dtype=bool), q
        for step in range(1, STEPS + 1):
            out = self.out(model, q, of, step / STEPS)
            away = place_links(model, out.q)
            moved = ball + step / STEPS * self.distance * axis
            stuck |= ~(
                out.reached & self._clear(away, moved) & clear_of_itself(away) & clear_of_boxes(away, self.keep_out)
            )
            beside = self.tip(model, 0.5 * (last + out.q))[:, :3, 3] - ball
            beside -= (beside * axis).sum(axis=1)[:, None] * axis
            stuck |= np.linalg.norm(beside, axis=1) > STRAIGHT
            last = out.q
        return {"too near the block": blocked, "no clear way out of the socket": stuck}

    def _clear(self, links: Links, ball: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
        """Whether the links stay out of the blocks, but for what carries the ball, which the cone keeps clear."""
        return clear_of_boxes(without_carriers(links, ball), self.blocks)

    def observation(self, of: Int[np.ndarray, " n"]) -> Sockets:
        """Sockets, with the socket of each row."""
        return Sockets(sockets=self.standing.names, of=of, distances=self.distances)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Centres."""
        return self.standing.position.reshape(-1)

    @property
    def stages(self) -> Int[np.ndarray, " things"]:
        """By place."""
        places = self.standing.places
        names = list(dict.fromkeys(places))
        return np.array([names.index(place) for place in places])


def _along(R: Float[np.ndarray, "3 3"], points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3 3"]:
    """The rotation turned about its z axis, so that its x axis runs along the points."""
    flat = (points - points.mean(axis=0)) @ R[:, :2]
    x, y = np.linalg.svd(flat, full_matrices=True)[2][0]
    return R @ se3.exp(np.array([0.0, 0.0, np.arctan2(y, x)]))


# A wire from the tool to anchors: postures in which it is long enough, short enough, and free.

SHORTEST, LONGEST = 0.1, 2.0
"""Length of a wire by default, metres: draw-wire sensors are sold from half a metre to many; two metres are common."""

ANGLE = np.radians(110.0)
"""Largest angle between the wire and the tool's axis by default: tied to a swivel at the tip, it must not lean on the tool."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class WireWay(MeasuringWay):
    """Anchors, and the wire's end on the tool."""

    way: ClassVar[str] = "wire"
    directed: ClassVar[bool] = False
    filled_in: ClassVar[str] = "fill in d_mm in the plan's file, row by row; identify then reads it"
    label: ClassVar[str] = "anchor"
    fewest: ClassVar[int] = FEWEST
    shortest: float = SHORTEST
    longest: float = LONGEST
    """Lengths that the instrument measures, metres."""
    angle: float = ANGLE
    """Largest angle between the wire and the direction in which the tool points, radians."""
    scaled: bool = False
    """Whether the instrument's scale is unknown."""

    @classmethod
    def arrange(
        cls,
        p: Float[np.ndarray, "n 3"],
        pointing: Float[np.ndarray, " 3"],
        limits: tuple[float, float] | None,
        reach: float,
    ) -> Standing:
        """Around the task."""
        low, high = limits or (SHORTEST, LONGEST)
        length = float(np.clip(FAR_SHARE * reach, low + (high - low) / 4, (low + high) / 2))
        return _anchors(p, pointing, length)

    def goals(
        self, model: ErrorModel, task: Task, thing: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses around the task."""
        room = enlarge(task, model).workspace
        assert room is not None
        return room.place(u)

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """A wire that is too short or too long, leans on the tool, or meets the robot."""
        tip = self.tip(model, q)
        way = self.standing.position[of] - tip[:, :3, 3]
        length = np.linalg.norm(way, axis=1)
        within = (length >= self.shortest) & (length <= self.longest)
        steep = (way * tip[:, :3, 2]).sum(axis=1) < np.cos(self.angle) * length
        return {
            "the wire too short or too long": ~within,
            "the wire leaning on the tool": steep,
            "the wire across the robot": ~self.line_is_free(tip, of, links),
        }

    def observation(self, of: Int[np.ndarray, " n"]) -> Lengths:
        """Lengths, with the anchor of each row."""
        return Lengths(anchors=self.standing.names, of=of, scaled=self.scaled)

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Anchors and offsets, then the scale."""
        own = np.concatenate([self.standing.position, np.zeros((self.things, 1))], axis=1).reshape(-1)
        return np.concatenate([own, np.zeros(int(self.scaled))])

    @property
    def stages(self) -> Int[np.ndarray, " things"]:
        """One anchor at a time."""
        return np.arange(self.things)


# Ways from posture to posture that are not clear, all joints moving at once, and postures by which to go round.

BETWEEN = 12
"""Postures that are looked at between two."""

MORE = 64
"""Postures beside those of the plan by which ways round are looked for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TightWay:
    """A pose that cannot be driven to from the one before without links near each other, a keep-out box or a block."""

    pose: int
    via: Float[np.ndarray, "stops joints"] | None
    """Postures by which it can, one after another, radians; None where no way round is found."""


def ends_of_ways(
    model: ErrorModel, way: MeasuringWay, q: Float[np.ndarray, "count joints"], of: Int[np.ndarray, " count"]
) -> Float[np.ndarray, "count joints"]:
    """Where the ways between poses begin and end: before the sockets, otherwise at the poses themselves, radians."""
    return way.visits(model, q, of)[:, 0] if isinstance(way, SocketWay) else q


def find_tight_ways(
    model: ErrorModel, way: MeasuringWay, q: Float[np.ndarray, "count joints"], of: Int[np.ndarray, " count"]
) -> tuple[TightWay, ...]:
    """The ways of a plan that are not clear, among what stands at the same time.

    Where a robot's file states no link radii, none is found.

    Args:
        model: of the nominal robot.
        way: of measuring.
        q: the postures in their order, radians.
        of: which of the things is measured in each.
    """
    ends, stage = ends_of_ways(model, way, q, of), way.stages[of]
    here = np.flatnonzero(stage[1:] == stage[:-1]) + 1
    tight = here[~_clear(model, way, ends[here - 1], ends[here])]
    return tuple(
        TightWay(pose=int(pose), via=via)
        for number in np.unique(stage[tight])
        for pose, via in _ways_round(model, way, ends, np.flatnonzero(stage == number), tight[stage[tight] == number])
    )


def _ways_round(
    model: ErrorModel,
    way: MeasuringWay,
    ends: Float[np.ndarray, "count joints"],
    poses: Int[np.ndarray, " own"],
    tight: Int[np.ndarray, " t"],
) -> list[tuple[int, Float[np.ndarray, "stops joints"] | None]]:
    """For each of some poses, the shortest way from the one before by others of its stage and by postures among them.

    A roadmap (Kavraki and others 1996), with the poses themselves for most of its nodes.
    """
    own = ends[poses]
    more = qmc.Sobol(own.shape[1], rng=0).random(MORE) * np.ptp(own, axis=0) + own.min(axis=0)
    nodes = np.concatenate([own, more[closes(model, more)]])
    a, b = np.triu_indices(len(nodes), 1)
    length = np.abs(nodes[a] - nodes[b]).max(axis=1)
    clear = _clear(model, way, nodes[a], nodes[b])
    roads = coo_array((length[clear], (a[clear], b[clear])), shape=(len(nodes), len(nodes))).tocsr()
    start = np.searchsorted(poses, tight) - 1
    before = dijkstra(roads, directed=False, indices=start, return_predecessors=True)[1]
    out: list[tuple[int, Float[np.ndarray, "stops joints"] | None]] = []
    for pose, row, first in zip(tight, before, start, strict=True):
        passed = [first + 1]
        while passed[-1] != first and row[passed[-1]] >= 0:
            passed.append(int(row[passed[-1]]))
        out.append((int(pose), nodes[passed[-2:0:-1]] if passed[-1] == first else None))
    return out


def _clear(
    model: ErrorModel, way: MeasuringWay, start: Float[np.ndarray, "n joints"], end: Float[np.ndarray, "n joints"]
) -> Bool[np.ndarray, " n"]:
    boxes = (*way.keep_out, *(way.blocks if isinstance(way, SocketWay) else ()))
    share = np.linspace(0.0, 1.0, BETWEEN + 2)[1:-1, None]
    between = (start[:, None] + share * (end - start)[:, None]).reshape(-1, start.shape[1])
    links = place_links(model, between)
    clear = clear_of_itself(links) & clear_of_boxes(links, boxes)
    return np.asarray(clear.reshape(-1, BETWEEN).all(axis=1))


# Postures that a way of measuring without a tracker allows, looked for all over the joints' ranges.

MIDDLES, STARTS = 8, 64
"""Of each thing, goals whose postures are looked for from so many starts all over the ranges."""

TRIES = 3
"""Starts, out of the postures found so, for each goal."""

SAME = 1e-9
"""Difference of poses that are one, metres and radians."""

FAR_AND_WIDE = 4096
"""Postures among which the one nearest to a thing that is not reached is looked for."""


def find_observable(model: ErrorModel, task: Task, way: MeasuringWay, count: int, seed: int) -> Measurable:
    """Postures in which things can be measured, as many for each of them, and which thing each is of.

    Args:
        model: of the nominal robot.
        task: what the robot has to do.
        way: of measuring.
        count: how many goals to try.
        seed: of the goals.

    Raises:
        ReachError: there is none for one of the things; the message says why.
    """
    each = -(-count // way.things)
    found = [_reach(model, task, way, thing, each, seed + thing) for thing in range(way.things)]
    _refuse_unreached(model, way, found)
    q = np.concatenate(found)
    of = np.repeat(np.arange(way.things), [len(part) for part in found])
    ok, faults = check_observable(model, way, q, of)
    lost = {"not reached": each * way.things - len(q), **faults}
    for thing, name in enumerate(way.standing.names):
        if not ok[of == thing].any():
            own = check_observable(model, way, found[thing], np.full(len(found[thing]), thing))[1]
            reasons = ", ".join(f"{number} {reason}" for reason, number in own.items() if number)
            raise ReachError(
                f"{way.label} '{name}' cannot be measured in any of {len(found[thing])} postures that reach it: {reasons}; "
                "move it, or turn it"
            )
    return Measurable(q=q[ok], rows=np.flatnonzero(ok), visible=of[ok, None] == np.arange(way.things), lost=lost)


def check_observable(
    model: ErrorModel, way: MeasuringWay, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
) -> tuple[Bool[np.ndarray, " n"], dict[str, int]]:
    """Whether each posture can be measured, and how many cannot, each counted for the first reason that holds."""
    links = place_links(model, q)
    reasons = {
        "links too near each other": ~clear_of_itself(links),
        "in a keep-out box": ~clear_of_boxes(links, way.keep_out),
        **way.faults(model, q, of, links),
    }
    ok, lost = np.ones(len(q), dtype=bool), dict[str, int]()
    for reason, holds in reasons.items():
        lost[reason] = int((ok & holds).sum())
        ok &= ~holds
    return ok, lost


def _reach(
    model: ErrorModel, task: Task, way: MeasuringWay, thing: int, count: int, seed: int
) -> Float[np.ndarray, "reached joints"]:
    """Postures for goals of a thing, from all that were found for the first few of them."""
    goals = way.goals(model, task, thing, qmc.Halton(6, rng=seed).random(count))
    limits = np.clip(model.robot.limits, -np.pi, np.pi)
    starts = qmc.scale(qmc.Sobol(len(limits), rng=seed).random(STARTS), limits[:, 0], limits[:, 1])
    starts = starts[closes(model, starts)]
    first = goals[:MIDDLES]
    end = solve_near(model, np.repeat(first, len(starts), axis=0), np.tile(starts, (len(first), 1)), iterations=60)
    pool = end.q[end.reached]
    q, reached = np.zeros((count, len(limits))), np.zeros(count, dtype=bool)
    rng = np.random.default_rng(seed)
    for _ in range(TRIES if len(pool) else 0):
        left = np.flatnonzero(~reached)
        end = solve_near(model, goals[left], pool[rng.integers(len(pool), size=len(left))])
        q[left], reached[left] = end.q, end.reached
    return _unwound(model, q[reached])


def _unwound(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints"]:
    """The postures with every joint within half a turn of zero that may be, so that ways between them are short."""
    turned = np.where(model.robot.prismatic, q, np.remainder(q + np.pi, 2.0 * np.pi) - np.pi)
    same = model.robot.inside_limits(turned) & closes(model, turned)
    same[same] = np.abs(model.poses(turned[same]) - model.poses(q[same])).max(axis=(1, 2)) < SAME
    return np.where(same[:, None], turned, q)


def _refuse_unreached(model: ErrorModel, way: MeasuringWay, found: list[Float[np.ndarray, "_ joints"]]) -> None:
    """See that the robot reaches everything that stands.

    Raises:
        ReachError: it does not; the message says what, and how near it comes.
    """
    missed = [thing for thing, q in enumerate(found) if not len(q)]
    if not missed:
        return
    limits = np.clip(model.robot.limits, -np.pi, np.pi)
    q = qmc.scale(qmc.Sobol(len(limits), rng=0).random(FAR_AND_WIDE), limits[:, 0], limits[:, 1])
    tip = way.tip(model, q[closes(model, q)])[:, :3, 3]
    said: list[str] = []
    for thing in missed:
        position = way.standing.position[thing]
        x, y, z = position * 1e3
        near = float(np.linalg.norm(tip - position, axis=1).min()) * 1e3
        said.append(
            f"{way.label} '{way.standing.names[thing]}' at x {x:.0f}, y {y:.0f}, z {z:.0f} mm, "
            f"{np.linalg.norm(position) * 1e3:.0f} mm from the base (however turned, the tool comes within about {near:.0f} mm)"
        )
    raise ReachError(
        f"{model.robot.name} does not reach inside its limits as it has to: {'; '.join(said)}; move what stands, "
        "or turn it towards the robot"
    )


# Where sockets, anchors or landmarks could stand for a task, where nobody says where they do.

POSES = 60
"""Of the task, whose tool points say where to stand."""

PLACES = ("first", "second", "third")
"""Where a block stands, one after another."""

APART = 0.1
"""Distance of the two sockets of a block, metres."""

NEARLY_UP = np.radians(30.0)
"""A block whose sockets would lean less stands upright."""

ANCHORS: dict[str, tuple[float, float]] = {"front": (0.0, 30.0), "left": (80.0, 0.0), "right": (-80.0, 15.0)}
"""Each anchor's angle about the direction in which the tool points, from the way out from the robot, and its angle towards
that direction; degrees."""

FAR_SHARE = 0.5
"""How far an anchor stands from the middle of the task, over the robot's reach, as far as the wire allows."""

LANDMARKS = ("a", "b", "c")


def way_named(name: str) -> type[MeasuringWay]:
    """The way of measuring that an option names, not with a tracker."""
    return {way.way: way for way in (SocketWay, WireWay, CameraWay, BoardWay)}[name]


def stand_by_default(
    way: str,
    model: ErrorModel,
    task: Task,
    T_tool_tip: Float[np.ndarray, "4 4"],
    limits: tuple[float, float] | None = None,
) -> Standing:
    """Sockets where the tool works, anchors around it, or landmarks before it.

    Args:
        way: of measuring, not with a tracker, by name.
        model: of the robot.
        task: what the robot has to do.
        T_tool_tip: what the tool carries; its z axis points away from the tool.
        limits: lengths of a wire, or distances of a camera, metres; their defaults where none are given.

    Raises:
        ReachError: the robot does not reach the task.
    """
    tip = model.poses(reach_task(model, task, POSES).q) @ T_tool_tip
    p, pointing = tip[:, :3, 3], tip[:, :3, 2].mean(axis=0)
    pointing = tip[0, :3, 2] if np.linalg.norm(pointing) < 0.1 else pointing / np.linalg.norm(pointing)
    return way_named(way).arrange(p, pointing, limits, model.robot.reach)


def block_distances() -> tuple[SocketDistance, ...]:
    """Known of the block that is assumed: how far apart its sockets are, as a good calliper tells it."""
    return tuple(
        SocketDistance(a=f"{place}/a", b=f"{place}/b", distance=APART, uncertainty=CALLIPER, statement="a,b")
        for place in PLACES
    )


def _blocks(p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"]) -> Standing:
    """A block with two sockets at three places, as far from one another as the task has room."""
    up = np.array([0.0, 0.0, 1.0])
    axis = up if -pointing @ up > np.cos(NEARLY_UP) else -pointing
    side = _outward(p.mean(axis=0), axis)[1]
    names: list[str] = []
    position: list[np.ndarray] = []
    for place, middle in zip(PLACES, _far_apart(p, len(PLACES)), strict=True):
        middle = np.maximum(middle, [-np.inf, -np.inf, BELOW])
        names += [f"{place}/a", f"{place}/b"]
        position += [middle - 0.5 * APART * side, middle + 0.5 * APART * side]
    return Standing(names=tuple(names), position=np.stack(position), direction=np.tile(axis, (len(names), 1)))


def _anchors(p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], length: float) -> Standing:
    """Three anchors on different sides of the task, and at different heights."""
    middle = p.mean(axis=0)
    outward, side = _outward(middle, pointing)
    position = [
        middle + length * (np.cos(lean) * (np.cos(around) * outward + np.sin(around) * side) + np.sin(lean) * pointing)
        for around, lean in np.radians(list(ANCHORS.values()))
    ]
    return Standing(
        names=tuple(ANCHORS),
        position=_on_the_floor(np.stack(position)),
        direction=np.tile(-pointing, (len(ANCHORS), 1)),
    )


def _landmarks(p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], distance: float) -> Standing:
    """Three landmarks before the tool, as far from one another as the task has room, all facing it."""
    position = _on_the_floor(_far_apart(p, len(LANDMARKS)) + distance * pointing)
    return Standing(names=LANDMARKS, position=position, direction=np.tile(-pointing, (len(LANDMARKS), 1)))


def _on_the_floor(position: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Not lower than the robot's base, which may stand on a table."""
    return np.maximum(position, [-np.inf, -np.inf, 0.0])


def _outward(
    middle: Float[np.ndarray, " 3"], axis: Float[np.ndarray, " 3"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Across an axis: away from the robot's base, and to the left of that."""
    for wish in (middle * [1.0, 1.0, 0.0], np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        across = wish - (wish @ axis) * axis
        if np.linalg.norm(across) > 0.3 * max(float(np.linalg.norm(wish)), 1e-3):
            outward = across / np.linalg.norm(across)
            return outward, np.cross(axis, outward)
    raise AssertionError("no axis is along both x and z")


def _far_apart(p: Float[np.ndarray, "n 3"], count: int) -> Float[np.ndarray, "count 3"]:
    """Some of the points, each the one farthest from those before; the first is farthest from the middle."""
    chosen = [int(np.argmax(np.linalg.norm(p - p.mean(axis=0), axis=1)))]
    while len(chosen) < count:
        chosen.append(int(np.argmax(np.linalg.norm(p[:, None] - p[chosen], axis=2).min(axis=1))))
    return p[chosen]
