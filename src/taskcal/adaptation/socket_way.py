"""A ball on the tool, put into sockets: postures that a socket allows, reached along its axis."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box, Links, clear_of_boxes, clear_of_itself, place_links, without_carriers
from taskcal.kinematics.inverse import JUMP_RAD, Reached, solve_near
from taskcal.measurement.observation import Sockets, Way
from taskcal.measurement.observation.socket_distance import SocketDistance
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.task.task import Task
from taskcal.task.turn_section import towards
from taskcal.task.workspace import Orientation

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

    way: ClassVar[Way] = "socket"
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
