"""The joints along a path of tool poses: one continuous branch from a starting posture, or the poses where it ends and why."""

from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.geometry import se3
from taskcal.kinematics.inverse import (
    JUMP_RAD,
    RADIANS_PER_METRE,
    ROUNDED_POSE,
    Freedom,
    NewtonEnd,
    conditioning,
    follow,
    freedom_of,
    newton_steps,
)
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal_groundwork.said import Said

STRIDE = 0.2
"""The posture is followed from pose to pose where the tool has moved as far as this, radians and half metres; between
them, poses are solved all at once."""

MAX_SWING_RAD = 0.3
"""Where a joint moves farther than this from stride to stride, radians, the posture is followed in shorter ones."""

MAX_REPAIRED = 2048
"""Poses that are solved one after another, at most, before a new stretch begins."""

STRIDES_AHEAD = 64
"""Strides among which a branch that has ended is looked for again at a time."""

MAX_STEEPNESS = 100.0
"""Radians (half metres) that a joint may move for each that the tool does; more is a jump. About an axis of the wrist it
is reached half a degree from the singular posture."""

JOINT_ROUNDING = 1e-6
"""What a joint may move besides, radians or metres."""

MIN_SINGULAR_RATIO = 0.02
"""Smallest over largest singular value under which a posture is called singular."""


NOT_TURNED = "cannot be turned so"
"""Why a pose is rejected that a robot of few joints meets in place."""


class Outcome(IntEnum):
    """Outcome of following a path to a pose."""

    REACHED = 0
    OUT_OF_REACH = 1
    """No posture near the branch meets it."""
    OUTSIDE_LIMITS = 2
    """It is met outside a joint's or a coupled limit."""
    SINGULAR = 3
    """The joints would jump there, by a singular posture."""
    BRANCH_LOST = 4
    """The joints would jump there, to another branch."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Traced:
    """Postures along a path.

    From one reached pose to the next no joint moves farther than `MAX_STEEPNESS` times the tool's motion, nor than `JUMP_RAD` where
    the tool moves by less than `STRIDE`. After a rejected pose a new stretch may begin.
    """

    q: Float[np.ndarray, "n joints"]
    """Radians; where a pose was rejected, the posture reached last."""
    outcome: Int[np.ndarray, " n"]
    """`Outcome` of each pose."""
    off: Float[np.ndarray, "n 2"]
    """Distance and angle that are left, metres and radians."""
    singularity: Float[np.ndarray, " n"]
    """Smallest over largest singular value of the tool's motion by the joints, a metre counting as two radians; 0 where
    a posture is singular."""

    @property
    def reached(self) -> Bool[np.ndarray, " n"]:
        """Whether each pose is met, inside all limits, without a jump on the way to it."""
        return self.outcome == Outcome.REACHED


def not_turned(angle: float, freedom: Freedom) -> Said:
    """Why a pose is not reached that is only so many degrees off, by a robot of few joints."""
    return Said(
        "cannot be turned so: the nearest posture leaves {angle:.3g}°, as {freedom}", angle=angle, freedom=str(freedom)
    )


def rejections(robot: Robot, traced: Traced) -> list[tuple[int, str]]:
    """Rows that were rejected, with the reason in words."""
    outside, freedom = dict(reversed(robot.outside_limits(traced.q))), freedom_of(ErrorModel(robot))
    out: list[tuple[int, str]] = []
    for row in np.flatnonzero(~traced.reached):
        match Outcome(traced.outcome[row]):
            case Outcome.OUT_OF_REACH if np.isinf(traced.off[row, 0]):
                reason = Said("out of reach: the four-bar does not close on the way to it")
            case Outcome.OUT_OF_REACH:
                distance, angle = traced.off[row, 0] * 1e3, np.degrees(traced.off[row, 1])
                reason = Said(
                    "out of reach on this branch: the nearest posture leaves {distance:.3g} mm and {angle:.3g}°",
                    distance=distance,
                    angle=angle,
                )
                if not freedom.whole and traced.off[row, 0] < ROUNDED_POSE[0]:
                    reason = not_turned(angle, freedom)
            case Outcome.OUTSIDE_LIMITS:
                reason = outside[int(row)]
            case Outcome.SINGULAR:
                reason = Said(
                    "the joints would jump at a singular posture ({off:.2g} from it)", off=traced.singularity[row]
                )
            case _:
                reason = Said("the joints would jump to another branch")
        out.append((int(row), reason))
    return out


def trace(
    model: ErrorModel,
    T: Float[np.ndarray, "n 4 4"],
    start: Float[np.ndarray, " joints"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    tip: Float[np.ndarray, "4 4"] | None = None,
) -> Traced:
    """Solve the poses of a path in their order, on the branch of a starting posture and without jumps.

    The posture is followed along the path in strides; the poses between are solved at once from postures interpolated in
    the joints, and each step from pose to pose is then held against the tool's motion.

    Args:
        model: the model.
        T: tool poses in the base, in the order of the path; between poses far apart the tool is taken to move straight.
        start: posture to begin with, radians; the path from it to the first pose is taken straight too.
        x: parameter values; the nominal robot by default.
        tip: pose, in the tool, of the frame that shall be at T; the tool itself by default.
    """
    path = TracedPath(model=model, T=T, x=x, tip=np.eye(4) if tip is None else tip)
    return solve_path(path, _seeds(path, start)) if len(T) else solve_path(path, np.zeros((0, len(start))))


def solve_path(path: "TracedPath", seed: Float[np.ndarray, "n joints"]) -> Traced:
    """Solve the poses of a path from seeds near the postures looked for, and say what became of each.

    Where the tool moves farther than `STRIDE` in one step, the seeds join one posture to the next.
    """
    robot = path.model.robot
    end = path.solve(path.T, seed)
    stayed = np.abs(end.q - seed).max(axis=1, initial=0.0) < JUMP_RAD
    end, lost = _link(path, end, end.met & robot.inside_limits(end.q), stayed)
    ratio = conditioning(path.model, end.q, path.x, tip=path.tip)
    outcome = np.where(
        lost, np.where(ratio < MIN_SINGULAR_RATIO, Outcome.SINGULAR, Outcome.BRANCH_LOST), Outcome.REACHED
    )
    outcome[~robot.inside_limits(end.q)] = Outcome.OUTSIDE_LIMITS
    outcome[~end.met] = Outcome.OUT_OF_REACH
    return Traced(q=end.q, outcome=outcome, off=end.off, singularity=ratio)


@dataclass(frozen=True, eq=False, kw_only=True)
class TracedPath:
    """Poses to be met, and the frame of the tool that meets them."""

    model: ErrorModel
    T: Float[np.ndarray, "n 4 4"]
    x: Float[np.ndarray, " p"] | None
    tip: Float[np.ndarray, "4 4"]

    def solve(
        self, T: Float[np.ndarray, "n 4 4"], seed: Float[np.ndarray, "n joints"], iterations: int = 15
    ) -> NewtonEnd:
        """Newton steps of the frame to poses T."""
        return newton_steps(self.model, T, seed, self.x, iterations=iterations, tip=self.tip)

    def pose(self, q: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "4 4"]:
        """Pose of the frame in a posture."""
        return self.model.poses(q[None], self.x)[0] @ self.tip

    def motion(self, a: Float[np.ndarray, "n 4 4"], b: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, " n"]:
        """Motion of the tool from a to b, radians and half metres."""
        chord = np.linalg.norm(b[:, :3, :3] - a[:, :3, :3], axis=(1, 2))
        angle = 2.0 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0))
        return np.hypot(RADIANS_PER_METRE * np.linalg.norm(b[:, :3, 3] - a[:, :3, 3], axis=1), angle)

    def walk(
        self, q: Float[np.ndarray, " joints"], a: Float[np.ndarray, "4 4"], b: Float[np.ndarray, "4 4"]
    ) -> Float[np.ndarray, " joints"] | None:
        """Posture at pose b, straight from posture q at pose a; None where a step would jump."""
        motion = float(self.motion(a[None], b[None])[0])
        turn = se3.log(b[:3, :3] @ a[:3, :3].T)
        least = max(1, int(np.ceil(motion / STRIDE)))
        for steps in (least, 4 * least, 16 * least):
            share = np.arange(1, steps + 1)[:, None] / steps
            between = se3.pose(se3.exp(share * turn) @ a[:3, :3], a[:3, 3] + share * (b[:3, 3] - a[:3, 3]))
            at = q
            for pose in (*between[:-1], b):
                ahead = self.solve(pose[None], at[None])
                if not ahead.met[0] or np.abs(ahead.q[0] - at).max() > _allowed(motion / steps):
                    break
                at = ahead.q[0]
            else:
                return at
        return None


def _allowed(motion: Float[np.ndarray, " n"] | float) -> Float[np.ndarray, " n"] | float:
    """Largest motion of a joint for a motion of the tool, radians or metres."""
    return np.minimum(MAX_STEEPNESS * motion + JOINT_ROUNDING, JUMP_RAD)


def _seeds(path: TracedPath, start: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "n joints"]:
    """Postures near the ones looked for, interpolated between those followed in strides."""
    travel = np.concatenate([[0.0], np.cumsum(path.motion(path.T[:-1], path.T[1:]))])
    anchor = np.diff(np.floor(travel / STRIDE), prepend=-1.0) > 0.0
    anchor[-1] = True
    coming = list(reversed(np.flatnonzero(anchor).tolist()))
    q, at, row = start, path.pose(start), -1
    postures: dict[int, np.ndarray] = {}
    while coming:
        ahead = path.walk(q, at, path.T[coming[-1]])
        if ahead is None:
            rows = coming[: -STRIDES_AHEAD - 1 : -1]
            found = follow(path.model, path.T[rows], q, path.x, tip=path.tip)
            first = int(np.argmax(found.reached)) if found.reached.any() else len(rows)
            del coming[len(coming) - first :]
            if first == len(rows):
                continue
            ahead = found.q[first]
        elif 0 <= row < coming[-1] - 1 and np.abs(ahead - q).max() > MAX_SWING_RAD:
            coming.append((row + coming[-1]) // 2)
            continue
        row = coming.pop()
        q, at = ahead, path.T[row]
        postures[row] = q
    if not postures:
        return np.tile(start, (len(travel), 1))
    known = travel[list(postures)]
    return np.stack([np.interp(travel, known, column) for column in np.array(list(postures.values())).T], axis=1)


def _link(
    path: TracedPath, end: NewtonEnd, good: Bool[np.ndarray, " n"], stayed: Bool[np.ndarray, " n"]
) -> tuple[NewtonEnd, Bool[np.ndarray, " n"]]:
    """Hold each step between good poses against the tool's motion, or against the seed where the tool moved far.

    Where one is too large, what follows is solved from its predecessor until both agree.

    Returns:
        the postures, and which of those that meet their pose are rejected all the same.
    """
    rows = np.flatnonzero(good)
    q, off, lost = end.q.copy(), end.off.copy(), ~good
    lost[rows[:1]] = ~stayed[rows[:1]]
    motion = path.motion(path.T[rows[:-1]], path.T[rows[1:]])

    def holds(k: int | slice) -> Bool[np.ndarray, "..."]:
        i, j = rows[:-1][k], rows[1:][k]
        change = np.abs(q[j] - q[i]).max(axis=-1)
        return np.where(motion[k] > STRIDE, stayed[j], change <= _allowed(motion[k]))

    done = -1
    for k in np.flatnonzero(~holds(slice(None))).tolist():
        if k < done:
            continue
        for done in range(k, min(k + MAX_REPAIRED, len(motion))):
            if done > k and holds(done):
                break
            i, j = rows[done], rows[done + 1]
            ahead = path.walk(q[i], path.T[i], path.T[j])
            if ahead is not None:
                q[j] = ahead
                off[j] = path.solve(path.T[j : j + 1], ahead[None], 0).off[0]
                stayed[j] = True
            if not holds(done) or not path.model.robot.inside_limits(q[j : j + 1])[0]:
                lost[j] = True  # what follows begins anew from its own posture
                break
        else:
            lost[rows[done + 1]] |= done + 1 < len(motion)
    return replace(end, q=q, off=off), lost


# The same posture with joints turned by whole turns.

MAX_TURNS = 4
"""Whole turns of a joint among which its period is looked for."""


def turned(robot: Robot, q: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "k joints"]:
    """All postures inside the limits that differ from q by whole turns of revolute joints, the nearest to q first.

    They bring the tool to the same pose: a joint that moves an axis by a ratio is turned until all its axes have made
    whole turns. A joint without limits is turned once either way.

    Args:
        robot: the robot.
        q: joint positions, radians; they may lie outside the limits.
    """
    choices = [_positions(robot, j, float(q[j])) for j in range(len(q))]
    postures = np.array(list(product(*choices))).reshape(-1, len(q))
    postures = postures[robot.inside_limits(postures)]
    return postures[np.argsort(np.abs(postures - q).sum(axis=1), kind="stable")]


def _positions(robot: Robot, j: int, value: float) -> list[float]:
    """Positions of joint j that leave the tool where it is."""
    period = _period(robot, j)
    if period is None:
        return [value]
    limits = robot.limits[j]
    low, high = np.where(np.isinf(limits), (value - period, value + period), limits)
    first, last = np.ceil((low - value) / period - 1e-9), np.floor((high - value) / period + 1e-9)
    return [value + k * period for k in np.arange(first, last + 1)]


def _period(robot: Robot, j: int) -> float | None:
    """The turn of joint j after which the tool is where it was, radians; None for a joint that has none."""
    if robot.prismatic[j]:
        return None
    ratios = [robot.joint_map.matrix[:, j]]
    if robot.four_bar is not None:
        ratios.append(np.array([robot.four_bar.arm[j], robot.four_bar.crank[j]]))
    ratio = np.concatenate(ratios)
    driven = [joint.kind == "prismatic" for joint in robot.driven]
    slides = np.array([*robot.prismatic, *driven, *[False] * (len(ratio) - len(robot.prismatic) - len(driven))])
    if ratio[slides].any():
        return None
    for turns in range(1, MAX_TURNS + 1):
        if np.allclose(turns * ratio, np.round(turns * ratio), rtol=0.0, atol=1e-9):
            return 2.0 * np.pi * turns
    return None
