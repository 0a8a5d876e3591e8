"""The least-squares problem of a campaign: the robot's chain between the tracker's frame and the targets."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import ClosureError
from taskcal.estimation.matrices import inverse_factors
from taskcal.geometry import se3
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, ErrorFrame, Fixed
from taskcal.kernels.covariance import propagate
from taskcal.kernels.normal_equations import SQUARED, WhitenedEquations, normal_equations
from taskcal.kernels.observations import Observations, Points, Walked
from taskcal.kernels.walk import Columns
from taskcal.observations import Observation
from taskcal.observations.pose import turn_by_rotation
from taskcal.registration.registration import Registration
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import COMPONENTS, ErrorModel, Prepared

# The rows of a campaign about an estimate, kept: a fit of few rows weighs and propagates the same ones again and
# again.

MOST_NUMBERS = 1_000_000
"""Of the derivatives that are kept (8 MB). More are streamed: to read them again would take longer than to work them out."""


class KeptRows(NamedTuple):
    """What was seen, linearised by all that is unknown."""

    valid: Bool[np.ndarray, "n targets"]
    residual: Float[np.ndarray, "seen b"]
    """Measured less predicted, of every target that was seen at a pose."""
    by_entry: Float[np.ndarray, "seen b z"]
    """Derivative of what is predicted."""

    @classmethod
    def of(cls, walked: Walked, seen: Observations) -> "KeptRows":
        """Of points and poses of a tracker, or of observations that are linearised by the twist of the chain's end."""
        if seen.linear is None:
            residual, columns = (rows[seen.valid] for rows in tracker_rows(walked, seen))
            if seen.rotation is not None:
                columns[:, 3:] = turn_by_rotation(residual[:, 3:]) @ columns[:, 3:]
            return cls(seen.valid, residual, columns)
        n, targets, b = seen.linear.residual.shape
        return cls(
            seen.valid,
            seen.linear.residual[seen.valid],
            by_entry(walked, seen).reshape(n, targets, b, -1)[seen.valid],
        )

    def equations(
        self, whitener: Float[np.ndarray, "n targets b b"]
    ) -> tuple[float, Float[np.ndarray, " z"], Float[np.ndarray, "z z"]]:
        """Cost, gradient and information of the squared whitened residuals, as of `normal_equations`."""
        W = whitener[self.valid]
        r = (W @ self.residual[:, :, None]).reshape(-1)
        A = (W @ self.by_entry).reshape(len(r), self.by_entry.shape[2])
        return 0.5 * float(r @ r), A.T @ r, A.T @ A

    def propagate(
        self, covariance: Float[np.ndarray, "z z"]
    ) -> tuple[Float[np.ndarray, "n targets b"], Float[np.ndarray, "n targets b b"]]:
        """Residuals, and the covariance of what is predicted; NaN where nothing was measured. As `propagate` of the geometry."""
        shape, b = self.valid.shape, self.residual.shape[1]
        residual, propagated = np.full((*shape, b), np.nan), np.full((*shape, b, b), np.nan)
        residual[self.valid] = self.residual
        moved = self.by_entry.reshape(self.residual.size, len(covariance)) @ covariance
        propagated[self.valid] = moved.reshape(self.by_entry.shape) @ np.swapaxes(self.by_entry, 1, 2)
        return residual, 0.5 * (propagated + np.swapaxes(propagated, -1, -2))

    def moved(self, step: Float[np.ndarray, " z"]) -> Float[np.ndarray, "n targets b"]:
        """By how much what is predicted moves with a step of the estimate, to first order; zero where nothing was measured."""
        out = np.zeros((*self.valid.shape, self.residual.shape[1]))
        out[self.valid] = self.by_entry @ step
        return out


def by_entry(walked: Walked, seen: Observations) -> Float[np.ndarray, "n m z"]:
    """Derivative of what is predicted by the entries of an estimate, the blocks of a pose's targets one behind another."""
    assert seen.linear is not None
    n, targets, b = seen.linear.residual.shape
    twist = walk.columns(walked.chain, walked.s, walked.e, walked.layout, walked.factor, angular=True)
    out = seen.linear.by_end.reshape(n, targets * b, 6) @ twist
    for t, columns in enumerate(seen.linear.columns):
        own = columns >= 0
        out[:, t * b : (t + 1) * b, columns[own]] += seen.linear.by_unknown[:, t][:, :, own]
    return out


def tracker_rows(
    walked: Walked, seen: Observations
) -> tuple[Float[np.ndarray, "n targets b"], Float[np.ndarray, "n targets b z"]]:
    """Measured less predicted of a tracker's points or poses, and the derivative of what is predicted by the entries of z.

    What belongs to a target that was not seen means nothing. A rotation is derived as a turn of what is predicted.
    """
    T, pose = walk.poses(walked.chain, walked.s, walked.e), seen.rotation is not None
    n, targets, b, points = len(T), seen.valid.shape[1], seen.rows, walked.points
    residual, out = np.empty((n, targets, b)), np.empty((n, targets, b, walked.layout.count))
    for t, offset in enumerate(points.position):
        columns = walk.columns(
            walked.chain, walked.s, walked.e, walked.layout, walked.factor, angular=pose, point=offset
        )
        residual[:, t, :3] = seen.position[:, t] - T[:, :3, 3] - T[:, :3, :3] @ offset
        if seen.rotation is not None:
            turned = seen.rotation @ np.swapaxes(points.turn @ T[:, :3, :3], 1, 2)
            turned[~seen.valid[:, t]] = np.eye(3)
            residual[:, t, 3:] = se3.log(turned)
            columns[:, 3:] = points.turn @ columns[:, 3:]
        if points.columns[t, 0] >= 0:
            columns[:, b - 3 :, points.columns[t]] = points.turning if pose else T[:, :3, :3]
        out[:, t] = columns
    return residual, out


class StatedRows(NamedTuple):
    """What is known of an estimate beside the measurements, whitened."""

    residual: Float[np.ndarray, " k"]
    """Stated less found."""
    by_entry: Float[np.ndarray, "k z"]


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameLayout:
    """The chain from tracker to target, and how an estimate z is laid out: kept parameters, base, targets.

    The base frame of the registration is followed by an error frame ``base.*``; a measured point adds its offset in the
    tool frame, ``smr1.tx …``, a measured pose an error frame of its own. What turns and what moves is measured by different
    parts of an instrument, whose axes need not agree: ``orientation.*`` turns all measured rotations against the axes in which
    positions are measured.
    """

    model: ErrorModel
    kept: Int[np.ndarray, " kept"]
    """Model parameters that are estimated; the others stay at zero."""
    registration: Registration
    targets: tuple[str, ...]
    pose: bool
    """Whether poses were measured, not points."""
    fixed_frames: bool = False
    """Whether tracker frame and targets are held where the registration put them."""
    turned: bool = False
    """Whether measured rotations may be turned against the axes of the positions."""

    @property
    def observed(self) -> tuple[type[Observation], ...]:
        """Kind of observation of each target; none where a tracker measured all."""
        return ()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the entries of z."""
        kept = tuple(self.model.names[i] for i in self.kept)
        if self.fixed_frames:
            return kept
        per_target = COMPONENTS if self.pose else COMPONENTS[:3]
        labels = ["target" if name == "tool" else name for name in self.targets]
        turn = COMPONENTS[3:] if self.turned else ()
        return (
            kept
            + tuple(f"base.{c}" for c in COMPONENTS)
            + tuple(f"{t}.{c}" for t in labels for c in per_target)
            + tuple(f"orientation.{c}" for c in turn)
        )

    @cached_property
    def chain(self) -> Chain:
        """From tracker to the tool, or to the target where poses were measured."""
        end = [Fixed(self.registration.T_tool_target[0]), ErrorFrame()] if self.pose else []
        return Chain.of([Fixed(self.registration.T_tracker_base), ErrorFrame(), *self.model.steps, *end])

    @cached_property
    def columns(self) -> Int[np.ndarray, " p"]:
        """Column of every model parameter, −1 for those held."""
        columns = np.full(len(self.model), -1)
        columns[self.kept] = np.arange(len(self.kept))
        return columns

    @cached_property
    def layout(self) -> Columns:
        """Columns of z in the walk."""
        inner = self.model.layout(self.columns, count=len(self.names))
        k = len(self.kept)
        first = np.full(6, -1) if self.fixed_frames else k + np.arange(6)
        frames = [first, *inner.frames]
        if self.pose:
            frames.append(np.full(6, -1) if self.fixed_frames else k + 6 + np.arange(6))
        return Columns(frames=np.array(frames), joint=inner.joint, column=inner.column, count=inner.count)

    @cached_property
    def point_columns(self) -> Int[np.ndarray, "targets 3"]:
        """Columns of the target offsets, or of the turn of what was measured."""
        count = len(self.targets)
        if self.turned and not self.fixed_frames:
            return len(self.kept) + 12 + np.arange(3)[None]
        if self.fixed_frames or self.pose:
            return np.full((count, 3), -1)
        return len(self.kept) + 6 + np.arange(3 * count).reshape(count, 3)

    def start(self) -> Float[np.ndarray, " z"]:
        """The registered nominal robot."""
        z = np.zeros(len(self.names))
        if not (self.fixed_frames or self.pose):
            z[len(self.kept) + 6 :] = self.registration.T_tool_target[:, :3, 3].reshape(-1)
        return z

    def parameters(self, z: Float[np.ndarray, " z"]) -> Float[np.ndarray, " p"]:
        """Model parameters of an estimate, zero where not kept."""
        x = np.zeros(len(self.model))
        x[self.kept] = z[: len(self.kept)]
        return x

    def walked(
        self, q: Float[np.ndarray, "n joints"], z: Float[np.ndarray, " z"], prepared: Prepared | None = None
    ) -> Walked:
        """The walk from tracker to targets at joint positions q."""
        at = self.model.walk(q, self.parameters(z), self.columns, prepared)
        return self.reframed(at.s, at.factor, at.e, z)

    def reframed(self, s: np.ndarray, factor: np.ndarray, e: np.ndarray, z: np.ndarray) -> Walked:
        """The model's walk with the frames of an estimate around it."""
        k = len(self.kept)
        free = not self.fixed_frames
        base = z[k : k + 6] if free else np.zeros(6)
        rows = [base[None], e]
        if self.pose:
            rows.append((z[k + 6 : k + 12] if free else np.zeros(6))[None])
            offsets = np.zeros((1, 3))
        elif free:
            offsets = z[k + 6 :].reshape(-1, 3)
        else:
            offsets = self.registration.T_tool_target[:, :3, 3]
        points = Points(np.ascontiguousarray(offsets), self.point_columns)
        if self.turned:
            turn = self.turn(z)
            points = points._replace(turn=se3.exp(turn), turning=se3.left_jacobian(turn))
        return Walked(self.chain, s, np.concatenate(rows), self.layout, factor, points)

    def turn(self, z: Float[np.ndarray, " z"]) -> Float[np.ndarray, " 3"]:
        """Rotation vector of measured rotations against the axes of the positions, as estimated."""
        return np.zeros(3) if self.fixed_frames or not self.turned else z[len(self.kept) + 12 :]

    @property
    def base_size(self) -> int:
        """Columns of the tracker's frame."""
        return 6

    @property
    def block_size(self) -> int:
        """Numbers of a target's block: three of position, and three of rotation where any were measured."""
        return 6 if self.pose else 3

    def linearised(
        self, walked: Walked, z: Float[np.ndarray, " z"], seen: Observations, kinds: tuple[Observation, ...]
    ) -> Observations:
        """What was seen as the compiled passes take it at an estimate: a tracker's points and poses as they are."""
        return seen

    def stated(self, z: Float[np.ndarray, " z"], kinds: tuple[Observation, ...]) -> StatedRows | None:
        """What is known of the frames beside the measurements; None for nothing."""
        return None

    def nowhere(self, walked: Walked, z: Float[np.ndarray, " z"]) -> Observations:
        """Targets as if measured where they are predicted, for the covariance of a prediction."""
        shape = len(walked.s), len(self.targets)
        T = walk.poses(walked.chain, walked.s, walked.e)[:, :3, :3] if self.pose else None
        return Observations(position=np.zeros((*shape, 3)), rotation=T, valid=np.ones(shape, dtype=bool))

    def frames(self, z: Float[np.ndarray, " z"]) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "targets 4 4"]]:
        """Tracker to base, and tool to every target, as estimated."""
        if self.fixed_frames:
            return self.registration.T_tracker_base, self.registration.T_tool_target
        k = len(self.kept)
        base = self.registration.T_tracker_base @ se3.error_transform(z[k : k + 6])
        if self.pose:
            return base, self.registration.T_tool_target @ se3.error_transform(z[k + 6 : k + 12])
        offsets = z[k + 6 :].reshape(-1, 3)
        return base, se3.pose(np.broadcast_to(np.eye(3), (len(offsets), 3, 3)), offsets)


def observe(campaign: Campaign) -> Observations:
    """The campaign as the compiled passes take it."""
    return Observations(
        position=np.ascontiguousarray(campaign.points),
        rotation=campaign.rotations,
        valid=np.ascontiguousarray(campaign.valid),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Problem:
    """A campaign to be fitted."""

    frames: FrameLayout
    q: Float[np.ndarray, "n joints"]
    seen: Observations
    noise: Float[np.ndarray, "n targets b b"]
    """Covariance of the measurements, m² and rad²."""
    kinds: tuple[Observation, ...] = ()
    """How each target was observed; none where a tracker measured all."""
    conditions: Conditions | None = None
    """How the poses were reached."""

    def take(self, rows: Int[np.ndarray, " k"]) -> "Problem":
        """The problem of some of a tracker's rows."""
        rotation = self.seen.rotation
        seen = Observations(
            position=self.seen.position[rows],
            rotation=None if rotation is None else rotation[rows],
            valid=self.seen.valid[rows],
        )
        conditions = None if self.conditions is None else self.conditions.take(rows)
        return Problem(frames=self.frames, q=self.q[rows], seen=seen, noise=self.noise[rows], conditions=conditions)

    @cached_property
    def _constant(self) -> bool:
        """Whether no kept parameter moves the joint side, so that it is evaluated once."""
        return not len(self.frames.layout.joint)

    @cached_property
    def _prepared(self) -> Prepared:
        return self.frames.model.prepare(self.q, self.conditions)

    @cached_property
    def _joint_side(self) -> tuple[np.ndarray, np.ndarray]:
        at = self.frames.model.walk(self.q, None, self.frames.columns)
        return at.s, at.factor

    def walked(self, z: Float[np.ndarray, " z"]) -> Walked:
        """The walk of every pose at an estimate."""
        if not self._constant:
            return self.frames.walked(self.q, z, self._prepared)
        e = self.frames.model.error_frames(self.frames.parameters(z))
        return self.frames.reframed(*self._joint_side, e, z)

    def covariance(self, variances: Float[np.ndarray, " groups"]) -> Float[np.ndarray, "n targets b b"]:
        """Measurement noise and model error together: variance of position and, for poses, of rotation."""
        return self.noise + np.diag(np.repeat(variances, 3))

    def equations(self, whitener: Float[np.ndarray, "n targets b b"], loss: int, threshold: float) -> WhitenedEquations:
        """Cost, gradient and information as functions of z; the cost is infinite where a closed loop does not close.

        A step may lead there on the way to lengths that do close: the fit takes a shorter one then.
        """

        def evaluate(z: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
            try:
                if loss == SQUARED and self._kept_at(z):
                    cost, g, H = self.kept_rows(z).equations(whitener)
                else:
                    walked = self.walked(z)
                    cost, g, H = normal_equations(walked, self.linearised(walked, z), whitener, loss, threshold)
            except ClosureError:
                return np.inf, np.zeros(len(z)), np.zeros((len(z), len(z)))
            stated = self.frames.stated(z, self.kinds)
            if stated is None:
                return cost, g, H
            r, A = stated
            return cost + 0.5 * float(r @ r), g + A.T @ r, H + A.T @ A

        return evaluate

    @cached_property
    def keeps_rows(self) -> bool:
        """Whether rows are kept, since they are few."""
        return self.noise[..., 0].size * len(self.frames.names) <= MOST_NUMBERS

    def _kept_at(self, z: Float[np.ndarray, " z"]) -> bool:
        """Whether rows about an estimate are there, or worth keeping now: those of a tracker are streamed in less time at first."""
        return self.keeps_rows and (bool(self.kinds) or z.tobytes() in self._latest)

    @cached_property
    def _latest(self) -> dict[bytes, KeptRows]:
        return {}

    def kept_rows(self, z: Float[np.ndarray, " z"]) -> KeptRows:
        """Rows about an estimate, those of the latest one kept.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        key = z.tobytes()
        if key not in self._latest:
            walked = self.walked(z)
            rows = KeptRows.of(walked, self.linearised(walked, z))
            self._latest.clear()
            self._latest[key] = rows
        return self._latest[key]

    def linearised(self, walked: Walked, z: Float[np.ndarray, " z"]) -> Observations:
        """What was seen, as the compiled passes take it at an estimate."""
        return self.frames.linearised(walked, z, self.seen, self.kinds)

    def propagate(
        self, z: Float[np.ndarray, " z"], covariance: Float[np.ndarray, "z z"]
    ) -> tuple[Float[np.ndarray, "n targets b"], Float[np.ndarray, "n targets b b"]]:
        """Residuals at an estimate, and the covariance of what is predicted for one of the estimate."""
        if self.keeps_rows:
            return self.kept_rows(z).propagate(covariance)
        walked = self.walked(z)
        return propagate(walked, self.linearised(walked, z), covariance)

    def information(
        self, z: Float[np.ndarray, " z"], whitener: Float[np.ndarray, "n targets b b"]
    ) -> Float[np.ndarray, "z z"]:
        """Of the estimate, by the measurements and by what is stated."""
        return self.equations(whitener, SQUARED, 1.0)(z)[2]


def whitener(covariance: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n targets b b"]:
    """Lower triangular W with W·covariance·Wᵀ = I.

    Raises:
        numpy.linalg.LinAlgError: a covariance is not positive definite.
    """
    W = inverse_factors(covariance)
    if np.isnan(W[..., -1, -1]).any():
        raise np.linalg.LinAlgError("a covariance is not positive definite")
    return W


# A campaign's residuals and their derivatives at an estimate, as one dense block a pose.


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearisation:
    """What every pose says; m numbers a pose, those of its targets one behind another, zero where a beam was lost."""

    residual: Float[np.ndarray, "n m"]
    """Measured less predicted in the tracker frame, metres (then radians, for poses)."""
    by_entry: Float[np.ndarray, "n m z"]
    """Derivative of what is predicted by the entries of z."""
    by_joint: Float[np.ndarray, "n m joints"]
    """Derivative of what is predicted by the joints' true positions."""
    seen: Bool[np.ndarray, "n m"]

    def take(self, rows: Int[np.ndarray, " k"]) -> "Linearisation":
        """Some of the poses."""
        return Linearisation(
            residual=self.residual[rows],
            by_entry=self.by_entry[rows],
            by_joint=self.by_joint[rows],
            seen=self.seen[rows],
        )


def linearise_rows(problem: Problem, z: Float[np.ndarray, " z"]) -> Linearisation:
    """The rows of a problem about an estimate.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    if problem.kinds:
        return _linearise_kinds(problem, z)
    at, pose = problem.walked(z), problem.frames.pose
    joints = len(problem.frames.model.robot.joints)
    residual, by_z = tracker_rows(at, problem.seen)
    n, _, width = residual.shape
    moved = [joint_columns(at, offset, angular=pose)[:, :, :joints] for offset in at.points.position]
    if pose:
        moved[0][:, 3:] = at.points.turn @ moved[0][:, 3:]
    seen = np.repeat(problem.seen.valid, width, axis=1)
    made = (residual.reshape(n, -1), by_z.reshape(n, seen.shape[1], -1), np.concatenate(moved, axis=1))
    for array in made:
        array[~seen] = 0.0
    return Linearisation(residual=made[0], by_entry=made[1], by_joint=made[2], seen=seen)


def _linearise_kinds(problem: Problem, z: Float[np.ndarray, " z"]) -> Linearisation:
    """The same where what was seen is linearised by the twist of the tool."""
    at = problem.walked(z)
    seen, tool = problem.linearised(at, z), np.zeros(3)
    assert seen.linear is not None
    joints = joint_columns(at, tool, angular=True)[:, :, : len(problem.frames.model.robot.joints)]
    n, targets, b = seen.linear.residual.shape
    made = (
        seen.linear.residual.reshape(n, -1),
        by_entry(at, seen),
        seen.linear.by_end.reshape(n, targets * b, 6) @ joints,
    )
    valid = np.repeat(seen.valid, b, axis=1)
    for array in made:
        array[~valid] = 0.0
    return Linearisation(residual=made[0], by_entry=made[1], by_joint=made[2], seen=valid)


def joint_columns(
    at: Walked, offset: Float[np.ndarray, " 3"], *, angular: bool
) -> Float[np.ndarray, "n rows coordinates"]:
    """Derivative of a target by the coordinates of the chain."""
    layout = walk.Columns.of_joints(at.chain)
    return walk.columns(at.chain, at.s, at.e, layout, np.ones_like(at.s), angular=angular, point=offset)
