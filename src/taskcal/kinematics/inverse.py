"""Joint positions that bring the tool to given poses: damped Newton with the analytic Jacobian, many poses at once."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import checked
from taskcal.errors import ClosureError, ReachError
from taskcal.geometry import se3
from taskcal.kernels import walk
from taskcal.kernels.chain import FIXED, PRISMATIC, REVOLUTE, Chain
from taskcal.kernels.chunks import in_chunks
from taskcal.robot.error_model import ErrorModel, Walk
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr
from taskcal_groundwork.said import Said

# How far an arm stretches: no posture leads beyond, so that a pose out there needs no search.
#
# Neighbouring axes of a serial chain stay at one distance, however its joints turn. From a point on the first axis
# to a point on the last, which the pose of the tool tells, it is never farther than along points of all axes. Where
# those lie on their axes is free; they are chosen so that the way is shortest. A joint that slides adds half its
# travel, counted from the middle.

MAX_ROUNDING = 1e-6
"""Share of the longest way, and metres, by which a pose may lie farther for all that rounding does."""

SMOOTHING_M = 1e-6
"""Distances are rounded off below this while the points are chosen, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch:
    """A ball that a point of the tool never leaves, of the nominal robot."""

    centre: Float[np.ndarray, "3"]
    """In the base, metres."""
    point: Float[np.ndarray, "3"]
    """In the tool's frame, metres."""
    longest: float
    """Metres; infinite where a joint slides without limits."""

    def admits(self, T: Float[np.ndarray, "n 4 4"]) -> Bool[np.ndarray, " n"]:
        """Whether tool poses in the base are near enough to be reached at all; none that is reached is left out."""
        points = T[:, :3, :3] @ self.point + T[:, :3, 3]
        distance = np.linalg.norm(points - self.centre, axis=1)
        return ~(distance > self.longest * (1.0 + MAX_ROUNDING) + MAX_ROUNDING)


@lru_cache(maxsize=16)
def stretch_of(model: ErrorModel) -> Stretch:
    """The ball that the arm of a nominal robot does not leave."""
    places, directions, middle, half, T_tool = _axes_at_home(model)
    if not len(places) or not np.isfinite(half).all():
        return Stretch(centre=np.zeros(3), point=np.zeros(3), longest=np.inf)

    def ways(along: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "parts 3"]:
        """Vectors from a point of each joint, after its motion, to the one of the next, before it."""
        behind = places + along[:, None] * directions
        before = behind + middle[:, None] * directions
        return before[1:] - behind[:-1]

    def length(along: Float[np.ndarray, " joints"]) -> tuple[float, Float[np.ndarray, " joints"]]:
        """Length of the whole way, and its derivative."""
        parts = ways(along)
        lengths = np.sqrt((parts**2).sum(axis=1) + SMOOTHING_M**2)
        units, derivative = parts / lengths[:, None], np.zeros(len(along))
        derivative[1:] += (units * directions[1:]).sum(axis=1)
        derivative[:-1] -= (units * directions[:-1]).sum(axis=1)
        return float(lengths.sum()), derivative

    from scipy.optimize import minimize

    along = minimize(length, np.zeros(len(places)), jac=True, method="BFGS").x
    behind = places + along[:, None] * directions
    return Stretch(
        centre=behind[0] + middle[0] * directions[0],
        point=(se3.inverse(T_tool) @ [*behind[-1], 1.0])[:3],
        longest=float(np.linalg.norm(ways(along), axis=1).sum() + half.sum()),
    )


def _axes_at_home(
    model: ErrorModel,
) -> tuple[
    Float[np.ndarray, "joints 3"],
    Float[np.ndarray, "joints 3"],
    Float[np.ndarray, " joints"],
    Float[np.ndarray, " joints"],
    Float[np.ndarray, "4 4"],
]:
    """Places and directions of all axes with every chain coordinate at zero, the middle and half of their travel, and the tool."""
    chain, T = model.chain, np.eye(4)
    places: list[np.ndarray] = []
    directions: list[np.ndarray] = []
    travel: list[tuple[float, float]] = []
    for kind, index in zip(chain.kind, chain.index, strict=True):
        if kind == FIXED:
            T = T @ np.vstack([chain.fixed[index], [0.0, 0.0, 0.0, 1.0]])
        elif kind in (REVOLUTE, PRISMATIC):
            places.append(T[:3, 3].copy())
            directions.append(T[:3, 2].copy())
            travel.append(_travel(model, int(index)) if kind == PRISMATIC else (0.0, 0.0))
    low, high = np.array(travel).reshape(-1, 2).T
    bounded = np.isfinite(low) & np.isfinite(high)
    middle = np.where(bounded, 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0)), 0.0)
    half = np.where(bounded, 0.5 * (high - low), np.inf) if len(low) else np.zeros(0)
    return np.array(places).reshape(-1, 3), np.array(directions).reshape(-1, 3), middle, half, T


def _travel(model: ErrorModel, coordinate: int) -> tuple[float, float]:
    """Smallest and largest value of a chain coordinate that slides, metres; infinite where that is not known."""
    joint_map = model.robot.joint_map
    if model.robot.four_bar is not None or coordinate >= len(joint_map.offset):
        return -np.inf, np.inf
    factors = joint_map.matrix[coordinate]
    used = factors != 0.0
    ends = factors[used, None] * model.robot.limits[used]
    offset = float(joint_map.offset[coordinate])
    return offset + float(ends.min(axis=1).sum()), offset + float(ends.max(axis=1).sum())


# One damped Newton step of joint positions towards tool poses, many at once.

RADIANS_PER_METRE = 2.0
"""Radians that a metre counts like: about what turns an arm's end by its own length."""

MAX_JOINT_STEP = 0.5
"""No joint moves farther in one step, radians or metres."""

DAMPING = 1e-3
"""Of the square of what is left, up to `MAX_DAMPED`: it fades with the error, so that the last steps are pure Newton, and tames
singular poses (Wampler 1986)."""

MAX_DAMPED = 4.0
"""Radians²."""

ROUNDING_SHARE = 1e-15
"""Of JJᵀ's trace, and its absolute value where no joint moves anything: damping that there always is, so that there is a step."""

NO_TILT = 1e-12
"""Sine of an angle between two axes that has no direction."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Goal:
    """Goal pose of a frame on the tool."""

    T: Float[np.ndarray, "n 4 4"]
    """Poses in the base."""
    tip: Float[np.ndarray, "4 4"]
    """Pose of the frame in the tool."""
    free_spin: bool
    """Whether it may turn about its own z axis."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Freedom:
    """How many directions of motion of a frame on the tool the joints command, where these are fewer than a pose has.

    A SCARA commands three of the position and one of the rotation, a Cartesian robot of three axes none of the rotation. Such a
    robot meets a pose as far as it can: the position first, then the rotation. Counted of the nominal robot: what a defect of a
    milliradian adds is no direction that a joint commands.
    """

    position: int
    rotation: int
    """Beside the position; with a free spin of two."""

    @property
    def rank(self) -> int:
        """Directions in all."""
        return self.position + self.rotation

    @property
    def whole(self) -> bool:
        """Whether the joints command all that a pose has."""
        return self.rank == ALL_DIRECTIONS

    def __str__(self) -> str:
        return Said("the joints move the tool in {rank} of six directions", rank=self.rank)


ALL_DIRECTIONS = 6
"""Of a pose."""

FREEDOM_POSES = 16
"""Postures all over the ranges of which that with the most directions counts: single ones may be singular."""

MIN_COMMANDED_RATIO = 1e-6
"""Singular value over the largest, under which no joint commands a direction: numbers of robot files are rounded to this."""


def freedom_of(model: ErrorModel, tip: Float[np.ndarray, "4 4"] | None = None, *, free_spin: bool = False) -> Freedom:
    """Directions that the joints of a robot command.

    Args:
        model: of the robot.
        tip: pose, in the tool, of the frame that moves; the tool itself by default.
        free_spin: whether that frame may turn about its own z axis.
    """
    frame = np.eye(4) if tip is None else tip
    return _freedom(model.robot, tuple(map(float, frame.ravel())), free_spin)


@lru_cache(maxsize=64)
def _freedom(robot: Robot, tip: tuple[float, ...], free_spin: bool) -> Freedom:
    model = ErrorModel(robot)
    q = spread_postures(robot, FREEDOM_POSES)
    at = model.walk(q[closes(model, q)])
    frame = np.array(tip).reshape(4, 4)
    goal = Goal(T=np.tile(np.eye(4), (len(at.s), 1, 1)), tip=frame, free_spin=free_spin)
    J = Conditioned.of(model.chain, at, _slope(model, at), goal).J

    def rank(part: Float[np.ndarray, "n rows joints"]) -> int:
        s = np.linalg.svd(part, compute_uv=False)
        return int((s > MIN_COMMANDED_RATIO * s[:, :1]).sum(axis=1).max(initial=0))

    position = rank(J[:, :3])
    return Freedom(position=position, rotation=rank(J) - position)


def spread_postures(robot: Robot, count: int, seed: int = 0) -> Float[np.ndarray, "count joints"]:
    """Joint positions spread evenly over the ranges, radians or metres; closed loops need not assemble there."""
    from scipy.stats import qmc

    low, high = robot.bounded_limits().T
    return low + (high - low) * qmc.Sobol(len(low), rng=seed).random(count)


@dataclass(frozen=True, eq=False, kw_only=True)
class Conditioned:
    """Residual of a pose at the frame on the tool, and its Jacobian by the joints.

    Rows are the position's, times `RADIANS_PER_METRE`, and the angles about the axes of the base; where the spin is free, the
    angles about the frame's own x and y axes.
    """

    J: Float[np.ndarray, "n rows joints"]
    left: Float[np.ndarray, "n rows"]
    off: Float[np.ndarray, "n 2"]
    """Distance and angle from the goal, metres and radians."""

    @classmethod
    def of(
        cls, chain: Chain, at: Walk, by_joint: Float[np.ndarray, "m coordinates joints"], goal: Goal
    ) -> "Conditioned":
        """Condition of a walked chain, with ∂s/∂q at every pose, or one for all."""
        end = np.empty((len(at.s), 4, 4))
        ones, layout = np.ones((len(at.s), chain.joints)), chain.joint_columns
        J = walk.columns(chain, at.s, at.e, layout, ones, angular=True, point=goal.tip[:3, 3].copy(), poses=end)
        J = J @ by_joint
        T = end @ goal.tip
        distance, turn = goal.T[:, :3, 3] - T[:, :3, 3], _turn_left(T[:, :3, :3], goal)
        off = np.sqrt(np.stack([np.einsum("ni,ni->n", v, v) for v in (distance, turn)], axis=1))
        if goal.free_spin:
            to_tip = np.swapaxes(T[:, :3, :2], 1, 2)
            turn = (to_tip @ turn[:, :, None])[:, :, 0]
            J = np.concatenate([J[:, :3], to_tip @ J[:, 3:]], axis=1)
        J[:, :3] *= RADIANS_PER_METRE
        return cls(J=J, left=np.concatenate([RADIANS_PER_METRE * distance, turn], axis=1), off=off)

    def step(self, rows: Bool[np.ndarray, " n"]) -> Float[np.ndarray, "k joints"]:
        """Change of the joints that leads some poses nearer to their goals, radians or metres: Jᵀ(JJᵀ + damping)⁻¹·left."""
        J, left = self.J[rows], self.left[rows]
        A = J @ np.swapaxes(J, 1, 2)
        diagonal = np.einsum("nii->ni", A)  # a view
        square = np.minimum(np.einsum("ni,ni->n", left, left), MAX_DAMPED)
        diagonal += (DAMPING * square + ROUNDING_SHARE * (1.0 + diagonal.sum(axis=1)))[:, None]
        step = (np.swapaxes(np.linalg.solve(A, left[:, :, None]), 1, 2) @ J)[:, 0]
        return _shortened(step)

    def step_within(self, freedom: Freedom) -> tuple[Float[np.ndarray, "n joints"], Float[np.ndarray, "n 2"]]:
        """Change of the joints that leads nearer to the goals as far as they command it, the position first.

        Returns:
            radians or metres; and the distance and angle that the joints could still take away, metres and radians.
        """
        position, turn = self.J[:, :3], self.J[:, 3:]
        first, distance, moved = _commanded(position, self.left[:, :3], freedom.position)
        beside = turn - (turn @ moved) @ np.swapaxes(moved, 1, 2)
        then, angle, _ = _commanded(beside, self.left[:, 3:] - (turn @ first[:, :, None])[:, :, 0], freedom.rotation)
        return _shortened(first + then), np.stack([distance / RADIANS_PER_METRE, angle], axis=1)


def _commanded(
    J: Float[np.ndarray, "n rows joints"], left: Float[np.ndarray, "n rows"], rank: int
) -> tuple[Float[np.ndarray, "n joints"], Float[np.ndarray, " n"], Float[np.ndarray, "n joints rank"]]:
    """Step by the directions of a Jacobian that joints command, the size of what is left along them, and the joints' directions."""
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    U, s, V = U[:, :, :rank], s[:, :rank], np.swapaxes(Vt[:, :rank], 1, 2)
    along = (left[:, None] @ U)[:, 0]
    square = (along**2).sum(axis=1)
    damping = DAMPING * np.minimum(square, MAX_DAMPED) + ROUNDING_SHARE * (1.0 + (s**2).sum(axis=1))
    step = (V @ (along * s / (s**2 + damping[:, None]))[:, :, None])[:, :, 0]
    return step, np.sqrt(square), V


def _shortened(step: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints"]:
    """A step of which no joint moves farther than `MAX_JOINT_STEP`."""
    far = np.abs(step).max(axis=1, initial=0.0)
    return step * (MAX_JOINT_STEP / np.maximum(far, MAX_JOINT_STEP))[:, None]


def _turn_left(R: Float[np.ndarray, "n 3 3"], goal: Goal) -> Float[np.ndarray, "n 3"]:
    """Rotation vector from a frame to its goal; with free spin the shortest one that takes its z axis there."""
    target = goal.T[:, :3, :3]
    if not goal.free_spin:
        return se3.log(target @ np.swapaxes(R, 1, 2))
    across = np.cross(R[:, :, 2], target[:, :, 2])
    sine, cosine = np.linalg.norm(across, axis=1), np.einsum("ni,ni->n", R[:, :, 2], target[:, :, 2])
    tilted = sine > NO_TILT
    scale = np.where(tilted, np.arctan2(sine, cosine) / np.where(tilted, sine, 1.0), 1.0)
    opposite = ~tilted & (cosine <= 0.0)  # any way round is as short
    return np.where(opposite[:, None], np.pi * R[:, :, 0], scale[:, None] * across)


Spin = Literal["fixed", "free"]

POSITION_TOLERANCE_M, ROTATION_TOLERANCE_RAD = 1e-9, 1e-9
"""A pose is reached within these, metres and radians."""

Miss = tuple[float, float]
"""Distance and angle by which a pose may be missed in directions that no joint commands, metres and radians."""

ROUNDED_POSE: Miss = (1e-5, 1e-3)
"""That the nominal robot may miss: numbers of programs and tables are rounded to some micrometres, and to hundredths of a
degree."""

REAL_ROBOT: Miss = (5e-3, 0.05)
"""That a robot with defects may miss, far more than defects are: with its joints it cannot take them away."""

ANY_MISS: Miss = (np.inf, np.inf)
"""Whatever is left in directions that no joint commands."""

POSES = 2048
"""Poses that are solved at a time; of 1024 to 8192 the fastest, for their matrices stay in the second cache."""

STEP_MARGIN = 0.1
"""Share of them at which the steps end."""

SAME_POSTURE_RAD = 1e-6
"""Postures nearer to each other than this are one, radians."""

MARGIN_DIGITS = 6
"""Digits to which the margins of postures, and how far they are from the middle, are compared."""

JUMP_RAD = np.pi / 3
"""Within a short step of the tool, a joint that turns farther has left its branch."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Reached:
    """Joint positions for some poses."""

    q: Float[np.ndarray, "n joints"]
    """Radians; where a pose was not reached, the closest found."""
    reached: Bool[np.ndarray, " n"]
    """Whether the pose is met, inside all limits."""


@checked
def solve_near(
    model: ErrorModel,
    T: Float[np.ndarray, "n 4 4"],
    seed: Float[np.ndarray, "n joints"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    iterations: int = 25,
    tip: Float[np.ndarray, "4 4"] | None = None,
    spin: Spin = "fixed",
    miss: Miss | None = None,
) -> Reached:
    """Solve each pose from its own seed, and stay on the seed's branch.

    Where the pose leaves the robot some freedom, every step is the shortest that serves. A robot that commands fewer than six
    directions meets a pose as far as it can, the position first.

    Args:
        model: the model; the pose met is that of its tool.
        T: tool poses in the base.
        seed: joint positions to start from, radians.
        x: parameter values; the nominal robot by default.
        iterations: Newton steps at most.
        tip: pose, in the tool, of the frame that shall be at T; the tool itself by default.
        spin: ``free`` where that frame may turn about its own z axis, as a spindle may.
        miss: distance and angle that may be left of a pose in directions that no joint commands, metres and radians; by default
            the rounding of numbers for the nominal robot, and what defects may be for another.
    """
    end = newton_steps(model, T, seed, x, iterations=iterations, tip=tip, spin=spin, miss=miss)
    return Reached(q=end.q, reached=end.met & model.robot.inside_limits(end.q))


@dataclass(frozen=True, eq=False, kw_only=True)
class NewtonEnd:
    """Result of the Newton steps."""

    q: Float[np.ndarray, "n joints"]
    """Radians."""
    off: Float[np.ndarray, "n 2"]
    """Distance and angle that are left, metres and radians; infinite where a closed loop does not assemble."""
    open: Float[np.ndarray, "n 2"]
    """What the joints could still take away of that."""
    miss: Miss
    """What may be left beside it."""

    @property
    def met(self) -> Bool[np.ndarray, " n"]:
        """Whether the pose is met, limits aside."""
        taken = (self.open < [POSITION_TOLERANCE_M, ROTATION_TOLERANCE_RAD]) & (self.off <= self.miss)
        return taken[:, 0] & taken[:, 1]


def newton_steps(
    model: ErrorModel,
    T: Float[np.ndarray, "n 4 4"],
    seed: Float[np.ndarray, "n joints"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    iterations: int,
    tip: Float[np.ndarray, "4 4"] | None = None,
    spin: Spin = "fixed",
    miss: Miss | None = None,
) -> NewtonEnd:
    """Newton steps from the seeds, each pose until it is met with a margin; arguments as of `solve_near`."""
    free = spin == "free"
    frame = np.eye(4) if tip is None else np.ascontiguousarray(tip, dtype=float)
    freedom = freedom_of(model, frame, free_spin=free)
    whole = freedom.rank == ALL_DIRECTIONS - free
    off = np.full((len(seed), 2), np.inf)
    end = NewtonEnd(
        q=np.array(seed, dtype=float),
        off=off,
        open=off if whole else off.copy(),
        miss=miss or (ROUNDED_POSE if x is None else REAL_ROBOT),
    )

    def solve(rows: slice) -> None:
        q, off, goal = end.q[rows], end.off[rows], T[rows]
        active = np.arange(len(q))
        for k in range(iterations + 1):
            try:
                at = model.walk(q[active], x)
            except ClosureError:
                closing = closes(model, q[active], x)
                off[active[~closing]] = end.open[rows][active[~closing]] = np.inf
                active = active[closing]
                at = model.walk(q[active], x)
            if not len(active):
                break
            aim = Goal(T=goal[active], tip=frame, free_spin=free)
            asked = Conditioned.of(model.chain, at, _slope(model, at), aim)
            off[active] = left = asked.off
            ahead = None
            if not whole:
                ahead, left = asked.step_within(freedom)
                end.open[rows][active] = left
            far = (left / [POSITION_TOLERANCE_M, ROTATION_TOLERANCE_RAD]).max(axis=1) > STEP_MARGIN
            active = active[far]
            if k < iterations:
                q[active] += asked.step(far) if ahead is None else ahead[far]

    in_chunks(solve, len(seed), POSES)
    return end


def conditioning(
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    tip: Float[np.ndarray, "4 4"] | None = None,
) -> Float[np.ndarray, " n"]:
    """Smallest over largest singular value of what the joints do to the tool, a metre counting as two radians.

    Of as many as there are directions that they command. 0 at a singular posture, and where a closed loop does not assemble.
    Arguments as of `solve_near`.
    """
    frame = np.eye(4) if tip is None else np.ascontiguousarray(tip, dtype=float)
    ratio, last = np.zeros(len(q)), max(freedom_of(model, frame).rank, 1) - 1

    def fill(rows: slice) -> None:
        closing = closes(model, q[rows], x)
        if closing.any():
            at = model.walk(q[rows][closing], x)
            goal = Goal(T=np.tile(np.eye(4), (len(at.s), 1, 1)), tip=frame, free_spin=False)
            s = np.linalg.svd(Conditioned.of(model.chain, at, _slope(model, at), goal).J, compute_uv=False)
            ratio[rows][closing] = s[:, last] / s[:, 0]

    in_chunks(fill, len(q))
    return ratio


def _slope(model: ErrorModel, at: Walk) -> Float[np.ndarray, "m coordinates joints"]:
    """∂s/∂q of the robot's own joint side.

    The slopes of effects are left out: they are thousandths, so that a Newton step without them gains three digits, and
    cost a dozen evaluations each.
    """
    return model.slope(at.slopes[: len(at.slopes) - len(model.effects)])


def closes(
    model: ErrorModel, q: Float[np.ndarray, "n joints"], x: Float[np.ndarray, " p"] | None = None
) -> Bool[np.ndarray, " n"]:
    """Whether the closed loops of a robot assemble at each pose."""
    four_bar = model.robot.four_bar
    if four_bar is None:
        return np.ones(len(q), dtype=bool)
    return four_bar.closes(q, np.zeros(3) if x is None else model.loop_deviations(x))


def find_posture(
    model: ErrorModel, T: Float[np.ndarray, "4 4"], *, miss: Miss = ROUNDED_POSE
) -> Float[np.ndarray, " joints"]:
    """A posture for one pose, of all that are found the one deepest inside the limits and farthest from singular.

    Raises:
        ReachError: no seed leads to the pose inside the limits.
    """
    return find_postures(model, T, miss=miss)[0]


def find_postures(
    model: ErrorModel, T: Float[np.ndarray, "4 4"], *, miss: Miss = ROUNDED_POSE
) -> Float[np.ndarray, "postures joints"]:
    """The postures that reach one pose inside the limits, found from seeds all over the joint ranges, the best first.

    Of a robot with more joints than a pose needs, these are some of infinitely many.

    Raises:
        ReachError: no seed leads to the pose inside the limits.
    """
    known = model if model.effects or model.lengths_only else _plain(model.robot)
    return _postures(known, np.asarray(T, dtype=float).tobytes(), miss).copy()


@lru_cache(maxsize=16)
def _plain(robot: Robot) -> ErrorModel:
    """The model of a robot without effects, one for all that are asked where its poses are."""
    return ErrorModel(robot)


@lru_cache(maxsize=256)
def _postures(model: ErrorModel, pose: bytes, miss: Miss) -> Float[np.ndarray, "postures joints"]:
    """Find them once for a model and a pose: a plan asks for the middle of its task several times, a studio for every page."""
    T = np.frombuffer(pose).reshape(4, 4)
    if not stretch_of(model).admits(T[None])[0]:
        raise _out_of_reach(model, T)
    seeds = np.concatenate([model.robot.bounded_limits().mean(axis=1)[None], spread_postures(model.robot, 256)])
    closing = closes(model, seeds, None)
    goal = np.broadcast_to(T, (int(closing.sum()), 4, 4))
    solution = solve_near(model, goal, seeds[closing], iterations=60, miss=miss)
    if not solution.reached.any():
        raise _out_of_reach(model, T)
    q = _best_first(model, solution.q[solution.reached])
    different = q[:1]
    for posture in q[1:]:
        if (np.abs(different - posture).max(axis=1) > SAME_POSTURE_RAD).all():
            different = np.concatenate([different, posture[None]])
    return different


def _best_first(model: ErrorModel, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints"]:
    """Sort IK solutions by margin; break ties by distance to mid-range.

    A wrist and the same wrist turned over are often alike in their margin; what rounding does must not choose between them.
    """
    middle = model.robot.bounded_limits(2.0 * np.pi).mean(axis=1)
    away = np.abs(q - middle).max(axis=1)
    return q[np.lexsort((np.round(away, MARGIN_DIGITS), -np.round(posture_margin(model, q), MARGIN_DIGITS)))]


def _out_of_reach(model: ErrorModel, T: Float[np.ndarray, "4 4"]) -> ReachError:
    x, y, z = T[:3, 3] * 1e3
    return ReachError(
        f"{model.robot.name} does not reach the tool pose at x {x:.0f}, y {y:.0f}, z {z:.0f} mm with this orientation inside "
        "its limits; move the workspace, turn the tool, or widen the limits in the robot file"
    )


def posture_margin(model: ErrorModel, q: np.ndarray) -> np.ndarray:
    """Distance from limits and singular postures, 0 to 1."""
    low, high = model.robot.bounded_limits(2.0 * np.pi).T
    room = (np.minimum(q - low, high - q) / (high - low) * 2.0).min(axis=1)
    s = np.linalg.svd(model.joint_jacobian(q), compute_uv=False)
    return np.minimum(room, 4.0 * s[:, max(freedom_of(model).rank, 1) - 1] / s[:, 0])


def follow(
    model: ErrorModel,
    T: Float[np.ndarray, "n 4 4"],
    start: Float[np.ndarray, " joints"],
    x: Float[np.ndarray, " p"] | None = None,
    *,
    steps: int = 12,
    tip: Float[np.ndarray, "4 4"] | None = None,
    miss: Miss | None = None,
) -> Reached:
    """Solve poses on the branch of a starting posture, each along a straight path from it in small steps.

    Args:
        model: the model.
        T: tool poses in the base.
        start: posture that the branch is taken from, radians.
        x: parameter values; the nominal robot by default.
        steps: how many steps the path is divided into.
        tip: pose, in the tool, of the frame that shall be at T; the tool itself by default.
        miss: as of `solve_near`.
    """
    home = model.poses(start[None], x)[0] @ (np.eye(4) if tip is None else tip)
    q = np.tile(start, (len(T), 1))
    turn = se3.log(T[:, :3, :3] @ home[:3, :3].T)
    stayed = np.ones(len(T), dtype=bool)
    for k in range(1, steps):
        share = k / steps
        R = se3.exp(share * turn) @ home[:3, :3]
        p = home[:3, 3] + share * (T[:, :3, 3] - home[:3, 3])
        # in between, two Newton steps keep up; only the end must be exact
        ahead = newton_steps(model, se3.pose(R, p), q, x, iterations=2, tip=tip).q
        stayed &= np.abs(ahead - q).max(axis=1) < JUMP_RAD
        q = ahead
    end = solve_near(model, T, q, x, tip=tip, miss=miss)
    stayed &= np.abs(end.q - q).max(axis=1) < JUMP_RAD
    return Reached(q=end.q, reached=end.reached & stayed)
