"""The rotation of a tool about its own axis along a path, where a path leaves it open, as spindles and torches do.

Postures are followed along the path for a grid of angles; the sequence of them that costs least is found by dynamic
programming (Viterbi 1967), as redundancy is resolved along paths since Nakamura and Hanafusa (1987).
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import checked
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import (
    JUMP_RAD,
    RADIANS_PER_METRE,
    SAME_POSTURE_RAD,
    find_postures,
    posture_margin,
    solve_near,
)
from taskcal.kinematics.tracing import rejections, trace
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr

GRID_ANGLES = 24
"""Spins tried, a whole turn of them."""

SEARCH_STRIDE = 4
"""At each so many of them postures are sought all over the joint ranges; the others' are followed from there."""

GUIDE_STRIDE = 0.15
"""Between guide poses the tool moves not farther than this, radians and half metres."""

MIN_COMFORTABLE_MARGIN = 0.1
"""A constant spin will do where no posture comes nearer than this to limits and singular postures; see `posture_margin`."""

SMOOTHING_ROUNDS = 6
"""How often a spin that changes is averaged with its neighbours."""

MAX_TIE = 1e-9
"""Relative difference of costs below which rounding decides."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Spun:
    """A path with its spin."""

    T: Float[np.ndarray, "n 4 4"]
    """Poses of the frame in the base, its spin chosen, metres."""
    q: Float[np.ndarray, "n joints"]
    """Joint positions, radians; continuous along the path."""
    spin: Float[np.ndarray, " n"]
    """Rotation about the frame's z against one that is carried along the path without turning, radians."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _States:
    """Postures at one guide pose, each with the best sequence that leads to it."""

    q: Float[np.ndarray, "m joints"]
    turn: Int[np.ndarray, " m"]
    """Spin in steps of the grid, not wrapped."""
    cost: Float[np.ndarray, " m"]
    """Of the postures that lead to it."""
    tightest: Float[np.ndarray, " m"]
    """Least posture margin of those."""
    before: Int[np.ndarray, " m"]
    """Which state at the guide pose before it comes from."""

    def take(self, rows: np.ndarray) -> "_States":
        return _States(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


@dataclass(frozen=True, eq=False, kw_only=True)
class _Guide:
    """Poses spread evenly along the path, with the spin that is carried along."""

    model: ErrorModel
    x: Float[np.ndarray, " p"] | None
    tip: Float[np.ndarray, "4 4"]
    T: Float[np.ndarray, "k 4 4"]
    travel: Float[np.ndarray, " k"]
    """How far the tool has moved, radians and half metres."""

    def at(self, k: int, turn: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 4 4"]:
        """Guide pose k with spins in steps of the grid."""
        return self.T[k] @ about_z(turn * (2.0 * np.pi / GRID_ANGLES))


@checked
def choose_spin(
    model: ErrorModel,
    T: Float[np.ndarray, "n 4 4"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    tip: Float[np.ndarray, "4 4"] | None = None,
) -> Spun:
    """Choose a frame's rotation about its own z along a path, so that the robot can follow it without jumps.

    The joint positions keep inside all limits. A spin that is constant along the path, carried with the axis without turning
    about it, is taken wherever one keeps clear of limits and singular postures; else it changes so that the sum of

        |Δq|² / Δs + Δs / m

    over steps Δs of the tool's motion is least, q in radians and metres, and m is the `posture_margin`.

    Args:
        model: the model.
        T: poses of the frame in the base, in the order of the path, metres; their rotation about z does not matter.
        x: parameter values; the nominal robot by default.
        tip: pose of the frame in the model's tool; the tool itself by default.

    Raises:
        ReachError: no spin lets the robot follow the path; names the pose where the best one ends.
    """
    tip = np.eye(4) if tip is None else tip
    carried = carried_along(T)
    travel = tool_travel(carried)
    guide = _guide(model, x, tip, carried, travel)
    layers = [_first(guide)]
    held = _search(guide, layers[0], steps=(0,))
    if len(held) == len(guide.travel) and held[-1].tightest.max() >= MIN_COMFORTABLE_MARGIN:
        best = _least(held[-1], held[-1].tightest >= MIN_COMFORTABLE_MARGIN)
        layers = held
    else:
        layers = _search(guide, layers[0], steps=(0, -1, 1))
        if len(layers) < len(guide.travel):
            row = int(np.searchsorted(travel, guide.travel[len(layers)]))
            x_, y, z = T[row, :3, 3] * 1e3
            raise ReachError(
                f"{model.robot.name} cannot follow the path beyond pose {row} (x {x_:.0f}, y {y:.0f}, z {z:.0f} mm): no rotation "
                "about the tool's axis keeps inside its limits without a jump; move the part, or tilt the tool"
            )
        best = _least(layers[-1], np.ones(len(layers[-1].q), dtype=bool))
    turns, start = _traced_back(layers, best)
    return _followed(guide, carried, travel, turns, start)


def about_z(angle: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 4 4"]:
    """Pure rotations about z, radians."""
    out = np.zeros((*angle.shape, 4, 4))
    out[..., 0, 0] = out[..., 1, 1] = np.cos(angle)
    out[..., 1, 0] = np.sin(angle)
    out[..., 0, 1] = -out[..., 1, 0]
    out[..., 2, 2] = out[..., 3, 3] = 1.0
    return out


def carried_along(T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 4 4"]:
    """Poses of a path with a spin of their own: of the first by a rule, carried along by the shortest rotations of z."""
    z = T[:, :3, 2]
    near = np.eye(3)[np.argmin(np.abs(z[0]))]
    out = T.copy()
    cross = np.cross(z[:-1], z[1:])
    sine, cosine = np.linalg.norm(cross, axis=1), (z[:-1] * z[1:]).sum(axis=1)
    axis = cross / np.maximum(sine, 1e-300)[:, None]
    shortest = se3.exp(axis * np.arctan2(sine, cosine)[:, None]) if len(T) > 1 else np.empty((0, 3, 3))
    x = near - (near @ z[0]) * z[0]
    for k in range(len(T)):
        if k and sine[k - 1] > 0.0:
            x = shortest[k - 1] @ x
        x = x - (x @ z[k]) * z[k]
        x /= np.linalg.norm(x)
        out[k, :3, 0] = x
    out[:, :3, 1] = np.cross(z, out[:, :3, 0])
    return out


def tool_travel(T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, " n"]:
    """Path length of the tool up to each pose without its spin, radians and half metres."""
    shift = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1)
    tilt = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(np.diff(T[:, :3, 2], axis=0), axis=1), 1.0))
    return np.concatenate([[0.0], np.cumsum(np.hypot(RADIANS_PER_METRE * shift, tilt))])


def _guide(
    model: ErrorModel,
    x: Float[np.ndarray, " p"] | None,
    tip: Float[np.ndarray, "4 4"],
    carried: Float[np.ndarray, "n 4 4"],
    travel: Float[np.ndarray, " n"],
) -> _Guide:
    at = np.linspace(0.0, travel[-1], int(np.ceil(travel[-1] / GUIDE_STRIDE)) + 1)
    between = np.stack([np.interp(at, travel, column) for column in carried[:, :3].reshape(len(travel), 12).T], axis=1)
    parts = between.reshape(-1, 3, 4)
    z = parts[:, :, 2] / np.linalg.norm(parts[:, :, 2], axis=1, keepdims=True)
    y = np.cross(z, parts[:, :, 0])
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return _Guide(
        model=model, x=x, tip=tip, T=se3.pose(np.stack([np.cross(y, z), y, z], axis=2), parts[:, :, 3]), travel=at
    )


def _first(guide: _Guide) -> _States:
    """All postures at the first pose, for every spin of the grid."""
    found: list[np.ndarray] = []
    turns: list[int] = []
    for turn in range(0, GRID_ANGLES, SEARCH_STRIDE):
        goal = guide.at(0, np.array([turn]))
        try:
            postures = find_postures(guide.model, (goal @ se3.inverse(guide.tip))[0])
        except ReachError:
            continue
        found.append(postures)
        turns += [turn] * len(postures)
    states = _solved(guide, np.concatenate(found), np.array(turns)) if found else None
    if states is None or not len(states.q):
        x, y, z = guide.T[0, :3, 3] * 1e3
        raise ReachError(
            f"{guide.model.robot.name} does not reach the start of the path, x {x:.0f}, y {y:.0f}, z {z:.0f} mm, with any rotation "
            "about the tool's axis; move the part, or tilt the tool"
        )
    for _ in range(SEARCH_STRIDE // 2):
        step = np.repeat([0, -1, 1], len(states.q))
        states = _solved(guide, np.tile(states.q, (3, 1)), np.tile(states.turn, 3) + step)
    return states


def _solved(guide: _Guide, seed: Float[np.ndarray, "m joints"], turn: Int[np.ndarray, " m"]) -> _States:
    """Postures at the first pose, from seeds near them."""
    solved = solve_near(guide.model, guide.at(0, turn), seed, guide.x, tip=guide.tip)
    q = solved.q[solved.reached]
    margin = posture_margin(guide.model, q)
    states = _States(
        q=q,
        turn=turn[solved.reached],
        cost=GUIDE_STRIDE / np.maximum(margin, 1e-9),
        tightest=margin,
        before=np.zeros(len(q), dtype=np.int64),
    )
    return states.take(_cheapest(states))


def _search(guide: _Guide, first: _States, steps: tuple[int, ...]) -> list[_States]:
    """Follow all postures along the guide, each with the spins that `steps` of the grid lead to; as far as any gets."""
    layers = [first]
    for k in range(1, len(guide.travel)):
        last, ds = layers[-1], guide.travel[k] - guide.travel[k - 1]
        source = np.repeat(np.arange(len(last.q)), len(steps))
        turn = last.turn[source] + np.tile(steps, len(last.q))
        seed = last.q[source]
        solved = solve_near(guide.model, guide.at(k, turn), seed, guide.x, tip=guide.tip)
        change = solved.q - seed
        good = np.flatnonzero(solved.reached & (np.abs(change).max(axis=1) < JUMP_RAD))
        if not len(good):
            break
        q, margin = solved.q[good], posture_margin(guide.model, solved.q[good])
        states = _States(
            q=q,
            turn=turn[good],
            cost=last.cost[source[good]] + (change[good] ** 2).sum(axis=1) / ds + ds / np.maximum(margin, 1e-9),
            tightest=np.minimum(last.tightest[source[good]], margin),
            before=source[good],
        )
        layers.append(states.take(_cheapest(states)))
    return layers


def _cheapest(states: _States) -> Int[np.ndarray, " k"]:
    """Rows of the cheapest among states that are one posture with one spin."""
    alike = np.column_stack([np.round(states.q / (100.0 * SAME_POSTURE_RAD)), states.turn % GRID_ANGLES])
    order = np.argsort(states.cost, kind="stable")
    _, first = np.unique(alike[order], axis=0, return_index=True)
    return np.sort(order[first])


def _least(states: _States, among: Bool[np.ndarray, " m"]) -> int:
    """The state that costs least; of mirrored postures, which cost the same but for rounding, always the same one."""
    cost = np.where(among, states.cost, np.inf)
    tied = np.flatnonzero(cost <= cost.min() * (1.0 + MAX_TIE))
    q = np.round(states.q[tied], 6)
    keys = [*q.T[::-1], np.round(np.abs(q).sum(axis=1), 5)]
    return int(tied[np.lexsort(keys)[0]])


def _traced_back(layers: list[_States], best: int) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " joints"]]:
    """Spin at every guide pose that leads to a state, radians, and the posture it begins with."""
    turns = np.empty(len(layers))
    for k in range(len(layers) - 1, -1, -1):
        turns[k] = layers[k].turn[best]
        if k:
            best = int(layers[k].before[best])
    return turns * (2.0 * np.pi / GRID_ANGLES), layers[0].q[best]


def _followed(
    guide: _Guide,
    carried: Float[np.ndarray, "n 4 4"],
    travel: Float[np.ndarray, " n"],
    turns: Float[np.ndarray, " k"],
    start: Float[np.ndarray, " joints"],
) -> Spun:
    """The whole path with a spin known at the guide poses: smoothed if the robot can follow it so."""
    smooth = turns.copy()
    for _ in range(SMOOTHING_ROUNDS):
        smooth[1:-1] = (smooth[:-2] + 2.0 * smooth[1:-1] + smooth[2:]) / 4.0
    reason = ""
    for angles in (smooth, turns) if np.ptp(turns) else (turns,):
        spin = np.interp(travel, guide.travel, angles)
        T = carried @ about_z(spin)
        traced = trace(guide.model, T, start, guide.x, tip=guide.tip)
        if traced.reached.all():
            return Spun(T=T, q=traced.q, spin=spin)
        row, why = rejections(guide.model.robot, traced)[0]
        reason = f"pose {row}: {why}"
    raise ReachError(
        f"{guide.model.robot.name} cannot follow the path with the rotation found about the tool's axis; {reason}"
    )
