"""The least-squares problem of a campaign: what was seen, its residuals about an estimate, and their derivatives.

There is one linearisation. A kind of observation is differentiated by the twist of its target and by its own unknowns; the twist
of the tool comes from the compiled walk. A tracker's points need no more than the walk, so that it gives their whitened rows as
well; those of other kinds are made of dense columns, some poses at a time.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import ClosureError
from taskcal.estimation.matrices import inverse_factors, single_threaded
from taskcal.estimation.noisy_rows import PoseNoise
from taskcal.geometry import se3
from taskcal.identification.layout import Layout
from taskcal.kernels import walk
from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.points import (
    POSES,
    SeenPoints,
    Walked,
    WhitenedEquations,
    normal_equations,
    propagate_points,
)
from taskcal.observations import Differential, Measured, Observation, Point, Pose, block_size
from taskcal.observations.base import TrackerNoise
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import Prepared

Equations = tuple[float, Float[np.ndarray, " z"], Float[np.ndarray, "z z"]]
"""Cost, gradient and information of whitened residuals."""

Propagated = tuple[Float[np.ndarray, "n targets b"], Float[np.ndarray, "n targets b b"]]
"""Residuals, and the covariance of what is predicted; NaN where nothing was measured."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Seen:
    """What was measured of each target of a layout."""

    position: Float[np.ndarray, "n targets 3"]
    """Each kind's numbers, metres."""
    rotation: Float[np.ndarray, "n 3 3"] | None
    """Measured rotations, for kinds that measure them."""
    valid: Bool[np.ndarray, "n targets"]
    """False where nothing was measured."""
    kinds: tuple[Observation, ...]
    """How each target was observed."""

    @classmethod
    def of(cls, campaign: Campaign) -> "Seen":
        """Make the measurements of a campaign."""
        return cls(
            position=np.ascontiguousarray(campaign.points),
            rotation=campaign.rotations,
            valid=np.ascontiguousarray(campaign.valid),
            kinds=campaign.observations,
        )

    def take(self, rows: Int[np.ndarray, " k"] | slice) -> "Seen":
        """Some of the rows; what they refer to keeps its number."""
        return Seen(
            position=self.position[rows],
            rotation=None if self.rotation is None else self.rotation[rows],
            valid=self.valid[rows],
            kinds=tuple(kind if kind.of is None else replace(kind, of=kind.of[rows]) for kind in self.kinds),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearisation:
    """Rows about an estimate; m numbers a pose, those of its targets one behind another, zero where nothing was measured."""

    valid: Bool[np.ndarray, "n targets"]
    residual: Float[np.ndarray, "n m"]
    """Measured less predicted, metres (and radians)."""
    by_entry: Float[np.ndarray, "n m z"]
    """Derivative of what is predicted by the entries of z."""
    by_tool: Float[np.ndarray, "n m 6"]
    """The same by the tool's twist: vx vy vz wx wy wz at its origin."""
    by_joint: Float[np.ndarray, "n m joints"]
    """The same by the joints' true positions; of no joints where that was not asked for."""

    @property
    def seen(self) -> Bool[np.ndarray, "n m"]:
        """Which numbers were measured."""
        return np.repeat(self.valid, self.residual.shape[1] // self.valid.shape[1], axis=1)

    def take(self, rows: Int[np.ndarray, " k"]) -> "Linearisation":
        """Some of the poses."""
        return Linearisation(
            valid=self.valid[rows],
            residual=self.residual[rows],
            by_entry=self.by_entry[rows],
            by_tool=self.by_tool[rows],
            by_joint=self.by_joint[rows],
        )

    @cached_property
    def units_of_noise(self) -> list[Float[np.ndarray, "n m m"]]:
        """Covariance of every pose for a unit of variance of each axis of position, of each axis of rotation, and of each joint."""
        (n, m), targets = self.residual.shape, self.valid.shape[1]
        kind = np.arange(m) % (m // targets) // 3
        axes = [np.broadcast_to(np.diag((kind == k).astype(float)), (n, m, m)) for k in range(m // targets // 3)]
        return axes + [c[:, :, None] * c[:, None, :] for c in np.moveaxis(self.by_joint, 2, 0)]

    def covariance(self, errors: PoseNoise, noise: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n m m"]:
        """Covariance of every pose, of the instrument's noise and of what single poses add; the identity where nothing was seen."""
        return errors.covariance(noise, self.units_of_noise, self.seen)

    @cached_property
    def _blocks(self) -> tuple[Float[np.ndarray, "seen b"], Float[np.ndarray, "seen b z"]]:
        """Residual and derivative of every target that was seen at a pose."""
        n, targets = self.valid.shape
        b, z = self.residual.shape[1] // targets, self.by_entry.shape[2]
        return self.residual.reshape(n, targets, b)[self.valid], self.by_entry.reshape(n, targets, b, z)[self.valid]

    def equations(self, whitener: Float[np.ndarray, "n targets b b"]) -> Equations:
        """Cost, gradient and information of the whitened residuals, as of `normal_equations`."""
        residual, by_entry = self._blocks
        W = whitener[self.valid]
        r = (W @ residual[:, :, None])[:, :, 0].ravel()
        A = (W @ by_entry).reshape(r.size, by_entry.shape[2])
        return 0.5 * float(r @ r), A.T @ r, A.T @ A

    def propagate(self, covariance: Float[np.ndarray, "z z"]) -> Propagated:
        """Residuals, and the covariance of what is predicted for one of the estimate."""
        left, by_entry = self._blocks
        shape, b = self.valid.shape, left.shape[1]
        residual, propagated = np.full((*shape, b), np.nan), np.full((*shape, b, b), np.nan)
        residual[self.valid] = left
        moved = by_entry.reshape(left.size, len(covariance)) @ covariance
        propagated[self.valid] = moved.reshape(by_entry.shape) @ np.swapaxes(by_entry, 1, 2)
        return residual, 0.5 * (propagated + np.swapaxes(propagated, -1, -2))


class Rows(NamedTuple):
    """The rows of a campaign at an estimate."""

    layout: Layout
    z: Float[np.ndarray, " z"]
    at: Walked
    """The walk there."""
    seen: Seen

    @classmethod
    def of_targets(
        cls,
        layout: Layout,
        z: Float[np.ndarray, " z"],
        q: Float[np.ndarray, "n joints"],
        prepared: Prepared | None = None,
    ) -> "Rows":
        """The targets as if a tracker measured them, in its own axes, where they are predicted."""
        at = layout.walked(q, z, prepared)
        shape, rotation = (len(q), len(layout.targets)), None
        if layout.pose:
            rotation = walk.poses(at.chain, at.s, at.e)[:, :3, :3] @ layout.frames(z)[1][0, :3, :3]
        kinds = (Pose(aligned=True) if layout.pose else Point(),) * shape[1]
        seen = Seen(position=np.zeros((*shape, 3)), rotation=rotation, valid=np.ones(shape, dtype=bool), kinds=kinds)
        return cls(layout, z, at, seen)

    def _take(self, rows: slice) -> "Rows":
        at = replace(self.at, s=self.at.s[rows], factor=self.at.factor[rows])
        return Rows(self.layout, self.z, at, self.seen.take(rows))

    @property
    def _points(self) -> SeenPoints | None:
        """For the compiled walk; None where another kind was measured, or a target has an error frame."""
        streamed = all(kind.streamed for kind in self.seen.kinds)
        turned = any(len(place.columns) > 3 for place in self.layout.places)
        return SeenPoints(self.seen.position, self.seen.valid) if streamed and not turned else None

    def linearise(self, *, joints: bool = False) -> Linearisation:
        """All residuals and derivatives.

        Args:
            joints: those by the joints' true positions, too.
        """
        layout, at, seen = self.layout, self.at, self.seen
        T, found, by_tool = self._differentiate()
        n, targets, b = by_tool.shape[:3]
        residual = np.zeros((n, targets, b))
        for t, (kind, one) in enumerate(zip(seen.kinds, found, strict=True)):
            residual[:, t, kind.block()] = one.residual
        by_tool = by_tool.reshape(n, targets * b, 6)
        by_entry = by_tool @ walk.columns(at.chain, at.s, at.e, at.layout, at.factor, angular=True)
        for t, (one, place, own) in enumerate(zip(found, layout.places, layout.own, strict=True)):
            numbers = t * b + np.array(seen.kinds[t].block())[:, None]
            place.add(self._by_place(t, one, T), by_entry, numbers)
            own.add(one.by_unknown, by_entry, numbers)
        by_joint = np.zeros((n, targets * b, 0))
        if joints:
            by_joint = by_tool @ joint_columns(at)[:, :, : len(layout.model.robot.joints)]
        residual, hidden = residual.reshape(n, -1), ~np.repeat(seen.valid, b, axis=1)
        for array in (residual, by_entry, by_tool, by_joint):
            array[hidden] = 0.0
        return Linearisation(valid=seen.valid, residual=residual, by_entry=by_entry, by_tool=by_tool, by_joint=by_joint)

    def _differentiate(
        self,
    ) -> tuple[Float[np.ndarray, "n 4 4"], list[Differential], Float[np.ndarray, "n targets b 6"]]:
        """Poses of the tool, what each kind is there, and its derivative by the tool's twist."""
        at, seen = self.at, self.seen
        T, (n, targets), b = walk.poses(at.chain, at.s, at.e), seen.valid.shape, block_size(seen.kinds)
        by_tool = np.zeros((n, targets, b, 6))
        places, unknowns = self.layout.frames(self.z)[1], self.layout.unknowns(self.z)
        found: list[Differential] = []
        for t, (kind, place, unknown) in enumerate(zip(seen.kinds, places, unknowns, strict=True)):
            one = kind.differentiate(T @ place, unknown, Measured(seen.position[:, t], seen.rotation))
            by_tool[:, t, kind.block()] = _by_tool(one, T, place)
            found.append(one)
        return T, found, by_tool

    def by_tool(self) -> Float[np.ndarray, "n targets b 6"]:
        """Derivative of what is predicted by the tool's twist: vx vy vz wx wy wz at its origin; zero where nothing was measured."""
        return np.where(self.seen.valid[..., None, None], self._differentiate()[2], 0.0)

    def _by_place(self, t: int, one: Differential, T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n w c"]:
        """Derivative by the target's place on the tool."""
        R, layout = T[:, :3, :3], self.layout
        if not layout.kinds[t].turned:
            return one.by_target[:, :, :3] @ R
        e = layout.places[t].of(self.z)
        R = R @ layout.registration.T_tool_target[t, :3, :3]
        about_x, about_y = se3.rotation("x", e[3])[:3, :3], se3.rotation("y", e[4])[:3, :3]
        axes = np.stack([np.eye(3)[0], about_x[:, 1], (about_x @ about_y)[:, 2]], axis=1)
        return np.concatenate([one.by_target[:, :, :3] @ R, one.by_target[:, :, 3:] @ (R @ axes)], axis=2)

    def equations(self, whitener: Float[np.ndarray, "n targets b b"]) -> Equations:
        """Cost, gradient and information of the whitened residuals, without keeping derivatives."""
        points = self._points
        if points is not None:
            return normal_equations(self.at, points, whitener)
        parts = in_chunks(lambda rows: self._take(rows).linearise().equations(whitener[rows]), len(self.at.s), POSES)
        cost, g, H = zip(*parts, strict=True)
        return sum(cost), np.sum(g, axis=0), np.sum(H, axis=0)

    @single_threaded
    def propagate(self, covariance: Float[np.ndarray, "z z"]) -> Propagated:
        """Residuals, and the covariance of what is predicted for one of the estimate, without keeping derivatives."""
        points = self._points
        if points is not None and len(covariance):
            return propagate_points(self.at, points, covariance)
        parts = in_chunks(lambda rows: self._take(rows).linearise().propagate(covariance), len(self.at.s), POSES)
        residual, propagated = zip(*parts, strict=True)
        return np.concatenate(residual), np.concatenate(propagated)

    def propagate_joints(self, variances: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "n targets b b"]:
        """Covariance of what is predicted where joints stand off, each by itself, at single poses.

        Args:
            variances: of the joints, rad² (m² where they slide); of none for those beyond.
        """
        moved = self.by_tool() @ joint_columns(self.at)[:, None, :, : len(variances)]
        return (moved * variances) @ np.swapaxes(moved, 2, 3)


def _by_tool(
    one: Differential, T: Float[np.ndarray, "n 4 4"], place: Float[np.ndarray, "4 4"]
) -> Float[np.ndarray, "n w 6"]:
    """Derivative by the tool's twist, of which a target that sits beside the tool's origin has v + w × arm."""
    arm = T[:, :3, :3] @ place[:3, 3]
    carried = np.cross(arm[:, None, :], np.eye(3))
    return np.concatenate(
        [one.by_target[:, :, :3], one.by_target[:, :, 3:] + one.by_target[:, :, :3] @ carried], axis=2
    )


def joint_columns(at: Walked) -> Float[np.ndarray, "n 6 coordinates"]:
    """Derivative of the tool's pose, at its origin, by the coordinates of the chain."""
    columns = at.chain.joint_columns
    return walk.columns(at.chain, at.s, at.e, columns, np.ones_like(at.s), angular=True)


class StatedRows(NamedTuple):
    """What is known of an estimate beside the measurements, whitened."""

    residual: Float[np.ndarray, " k"]
    """Stated less found."""
    by_entry: Float[np.ndarray, "k z"]


def stated_rows(layout: Layout, z: Float[np.ndarray, " z"], kinds: tuple[Observation, ...]) -> StatedRows:
    """Rows of what the kinds know of their own unknowns, such as distances of sockets."""
    parts = [StatedRows(np.zeros(0), np.zeros((0, len(z))))]
    for kind, unknown, own in zip(kinds, layout.unknowns(z), layout.own, strict=True):
        known = kind.stated(unknown)
        if len(known.residual) and not own.held:
            by_entry = np.zeros((len(known.residual), len(z)))
            by_entry[:, own.columns] = known.by_unknown
            parts.append(StatedRows(known.residual / known.uncertainty, by_entry / known.uncertainty[:, None]))
    return StatedRows(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


class StationTies(NamedTuple):
    """Reference points that stand beside the robot and were measured from several stations, whose frames they tie."""

    seen: Float[np.ndarray, "points stations 3"]
    """Mean of each in the campaign's frame, metres; NaN where a station did not see it."""
    variance: Float[np.ndarray, "points stations"]
    """Of each coordinate, m²: that of one reading, since readings from one station share most of a tracker's errors."""

    def rows(self, layout: Layout, z: Float[np.ndarray, " z"]) -> StatedRows:
        """Whitened rows: a point is at one place in the base, which is unknown and eliminated.

        The stations' predictions of that place, less their mean weighted by 1/variance, are the residuals of the best place.
        """
        there = ~np.isnan(self.seen[..., 0])
        weight = np.where(there, 1.0 / self.variance, 0.0)
        share = weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-300)
        place = np.zeros(self.seen.shape)
        by_entry = np.zeros((*self.seen.shape, len(z)))
        for k in range(self.seen.shape[1]):
            base = layout.bases[k]
            T = se3.inverse(layout.registration.T_tracker_base @ se3.error_transform(base.of(z)))
            place[:, k] = np.where(there[:, k, None], se3.apply(T, np.nan_to_num(self.seen[:, k])), 0.0)
            by_entry[:, k, :, base.columns] = -np.moveaxis(se3.by_twist(place[:, k]), 2, 0)
        root = np.sqrt(weight)[..., None]
        residual = root * (place - np.einsum("pk,pki->pi", share, place)[:, None])
        by_entry = root[..., None] * (by_entry - np.einsum("pk,pkiz->piz", share, by_entry)[:, None])
        return StatedRows(-residual[there].ravel(), by_entry[there].reshape(-1, len(z)))

    @classmethod
    def of(cls, campaign: Campaign, noise: TrackerNoise) -> "StationTies | None":
        """Those of a campaign; None where no reference point was measured from two stations."""
        stations = campaign.stations
        if stations is None or not campaign.reference_points:
            return None
        count, every = len(stations.names), np.stack([*campaign.reference_points.values()])
        local = se3.apply(se3.inverse(stations.T_first_station)[stations.of], every)
        variance = np.trace(noise.covariance(local), axis1=2, axis2=3) / 3.0
        there = ~np.isnan(every[..., 0])
        mean, each = np.full((len(every), count, 3), np.nan), np.ones((len(every), count))
        for p, k in np.ndindex(len(every), count):
            rows = there[p] & (stations.of == k)
            if rows.any():
                mean[p, k], each[p, k] = every[p, rows].mean(axis=0), variance[p, rows].mean()
        several = (~np.isnan(mean[..., 0])).sum(axis=1) > 1
        return cls(mean[several], each[several]) if several.any() else None


@dataclass(frozen=True, eq=False, kw_only=True)
class Problem:
    """A campaign to be fitted."""

    layout: Layout
    q: Float[np.ndarray, "n joints"]
    seen: Seen
    noise: Float[np.ndarray, "n targets b b"]
    """Covariance of the measurements, m² and rad²."""
    conditions: Conditions | None = None
    """How the poses were reached."""
    of: Int[np.ndarray, " n"] | None = None
    """Station of each row, of a tracker that was moved."""
    ties: StationTies | None = None
    """Of its stations."""

    def take(self, rows: Int[np.ndarray, " k"]) -> "Problem":
        """The problem of some of the rows."""
        conditions = None if self.conditions is None else self.conditions.take(rows)
        of = None if self.of is None else self.of[rows]
        return replace(
            self, q=self.q[rows], seen=self.seen.take(rows), noise=self.noise[rows], conditions=conditions, of=of
        )

    @cached_property
    def _parts(self) -> "list[tuple[Int[np.ndarray, ' k'] | slice, Problem]]":
        """Rows of each station, and their problem: the chain before them begins with the frame of that station."""
        if self.of is None:
            return [(slice(None), self)]
        rows = [(k, np.flatnonzero(self.of == k)) for k in np.unique(self.of).tolist()]
        return [(some, replace(self.take(some), of=None, layout=replace(self.layout, station=k))) for k, some in rows]

    @cached_property
    def _prepared(self) -> Prepared:
        return self.layout.model.prepare(self.q, self.conditions)

    @cached_property
    def _joint_side(self) -> tuple[np.ndarray, np.ndarray]:
        """Joint side where no entry of z moves it: it is evaluated once."""
        model, given = self.layout.model, self.layout.given
        at = model.walk(self.q, given, self.layout.parameter_columns, None if given is None else self._prepared)
        return at.s, at.factor

    def walked(self, z: Float[np.ndarray, " z"]) -> Walked:
        """The walk of every pose at an estimate."""
        if len(self.layout.columns.joint):
            return self.layout.walked(self.q, z, self._prepared)
        e = self.layout.model.error_frames(self.layout.parameters(z))
        return self.layout.with_frames(*self._joint_side, e, z)

    def rows(self, z: Float[np.ndarray, " z"]) -> Rows:
        """The rows at an estimate.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        return Rows(self.layout, z, self.walked(z), self.seen)

    def stated(self, z: Float[np.ndarray, " z"]) -> StatedRows:
        """Rows of what is known of the estimate beside the measurements of the targets."""
        known = stated_rows(self.layout, z, self.seen.kinds)
        if self.ties is None or self.layout.bases[0].held:
            return known
        return StatedRows(*map(np.concatenate, zip(known, self.ties.rows(self.layout, z), strict=True)))

    @property
    def measured_numbers(self) -> int:
        """How many numbers were measured."""
        return sum(kind.count_numbers(own) for kind, own in zip(self.seen.kinds, self.seen.valid.T, strict=True))

    def covariance(self, variances: Float[np.ndarray, " groups"]) -> Float[np.ndarray, "n targets b b"]:
        """Measurement noise and model error together: variance of position and, for poses, of rotation."""
        return self.noise + np.diag(np.repeat(variances, 3))

    def equations(self, whitener: Float[np.ndarray, "n targets b b"]) -> WhitenedEquations:
        """Cost, gradient and information as functions of z; the cost is infinite where a closed loop does not close.

        A step may lead there on the way to lengths that do close: the fit takes a shorter one then.
        """

        def evaluate(z: np.ndarray) -> Equations:
            try:
                parts = [part.rows(z).equations(whitener[rows]) for rows, part in self._parts]
                cost, g, H = (sum(values[1:], values[0]) for values in zip(*parts, strict=True))
            except ClosureError:
                return np.inf, np.zeros(len(z)), np.zeros((len(z), len(z)))
            r, A = self.stated(z)
            return cost + 0.5 * float(r @ r), g + A.T @ r, H + A.T @ A

        return evaluate

    def linearise(self, z: Float[np.ndarray, " z"], *, joints: bool = True) -> Linearisation:
        """Rows about an estimate.

        Args:
            z: the estimate.
            joints: with derivatives by the joints' true positions.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        parts = [part.rows(z).linearise(joints=joints) for _, part in self._parts]
        if len(parts) == 1:
            return parts[0]
        arrays = {f.name: np.concatenate([getattr(one, f.name) for one in parts]) for f in fields(Linearisation)}
        return Linearisation(**arrays).take(self._in_order)

    def propagate(self, z: Float[np.ndarray, " z"], covariance: Float[np.ndarray, "z z"]) -> Propagated:
        """Residuals at an estimate, and the covariance of what is predicted for one of the estimate."""
        parts = [part.rows(z).propagate(covariance) for _, part in self._parts]
        if len(parts) == 1:
            return parts[0]
        residual, propagated = (np.concatenate(values)[self._in_order] for values in zip(*parts, strict=True))
        return residual, propagated

    @property
    def _in_order(self) -> Int[np.ndarray, " n"]:
        """Of the rows of all stations, one station after another, those of the campaign in its order."""
        return np.argsort(np.concatenate([rows for rows, _ in self._parts if not isinstance(rows, slice)]))

    def information(
        self, z: Float[np.ndarray, " z"], whitener: Float[np.ndarray, "n targets b b"]
    ) -> Float[np.ndarray, "z z"]:
        """Information of the estimate, from the measurements and from what is stated."""
        return self.equations(whitener)(z)[2]


def problem_of(layout: Layout, campaign: Campaign, noise: TrackerNoise | None) -> Problem:
    """A campaign to be fitted in a layout."""
    return Problem(
        layout=layout,
        q=np.ascontiguousarray(campaign.q),
        seen=Seen.of(campaign),
        noise=campaign.covariances(noise),
        conditions=campaign.conditions,
        of=None if campaign.stations is None else campaign.stations.of,
        ties=StationTies.of(campaign, noise or TrackerNoise()),
    )


def whitener(covariance: Float[np.ndarray, "n targets b b"]) -> Float[np.ndarray, "n targets b b"]:
    """Lower triangular W with W·covariance·Wᵀ = I.

    Raises:
        numpy.linalg.LinAlgError: a covariance is not positive definite.
    """
    W = inverse_factors(covariance)
    if np.isnan(W[..., -1, -1]).any():
        raise np.linalg.LinAlgError("a covariance is not positive definite")
    return W
