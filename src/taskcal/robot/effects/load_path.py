"""Load path of a robot: the bodies that each motor moves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Int, Shaped

from taskcal.geometry.expressions import trace
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain
from taskcal.robot.effects.base import LinearTerm
from taskcal.robot.robot import Robot

NO_ERRORS = np.zeros((0, 6))
"""Of a nominal chain."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadPath:
    """The nominal robot where it stands, and what each motor moves there while the others hold.

    Where a four-bar stands between motor and link, motors are the controller's joints: the crank's turn is absolute.
    Without one, a coupling is taken for the controller's way of counting, and each drive acts about its own axis.
    """

    coordinates: Shaped[np.ndarray, "n coordinates"]
    """Of the chain, radians or metres."""
    by_motor: Shaped[np.ndarray, "n coordinates motors"]
    """∂(coordinates)/∂(motors)."""
    motors: Shaped[np.ndarray, "n motors"]
    """Where the motors' outputs stand, radians or metres."""
    by_joint: Shaped[np.ndarray, "n coordinates joints"]
    """∂(coordinates)/∂q."""
    motors_by_joint: Shaped[np.ndarray, "motors joints"]
    """∂(motors)/∂q."""
    curvature: Shaped[np.ndarray, "n coordinates motors joints"]
    """∂(by_motor)/∂q."""

    @classmethod
    def at(cls, robot: Robot, q: Shaped[np.ndarray, "n joints"]) -> "LoadPath":
        """The load path at joint positions q.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        if q.dtype == object:
            return cls._traced(robot, q)
        q = np.asarray(q, dtype=float)
        s = robot.joint_map(q)
        if robot.four_bar is None:
            one, matrix = np.eye(s.shape[1]), robot.joint_map.matrix
            return cls(
                coordinates=s,
                by_motor=np.broadcast_to(one, (len(q), *one.shape)),
                motors=s,
                by_joint=np.broadcast_to(matrix, (len(q), *matrix.shape)),
                motors_by_joint=matrix,
                curvature=np.zeros((len(q), *one.shape, q.shape[1])),
            )
        shift = robot.four_bar.shift(q, np.zeros(3))
        by_motor = robot.joint_map.matrix + shift.by_joint
        return cls(
            coordinates=s + shift.value,
            by_motor=by_motor,
            motors=q,
            by_joint=by_motor,
            motors_by_joint=np.eye(q.shape[1]),
            curvature=robot.four_bar.curvature(q),
        )

    @classmethod
    def _traced(cls, robot: Robot, q: Any) -> "LoadPath":
        """The same in expressions, without the derivatives by the joints, which follow from these."""
        s, _ = robot.joint_side.traced(q, robot.joint_side.loop_numbers(np.zeros(3)))
        by_joint = np.array([q[0, 0].pool.derivatives(list(s[0]), one) for one in q[0]], dtype=object).T
        coupled = robot.four_bar is not None
        return cls(
            coordinates=s,
            by_motor=(by_joint if coupled else np.eye(len(s[0])))[None],
            motors=q if coupled else s,
            by_joint=by_joint[None],
            motors_by_joint=np.eye(len(q[0])) if coupled else by_joint,
            curvature=np.full((1, *by_joint.shape, len(q[0])), np.nan),
        )

    def torque(
        self,
        chain: Chain,
        force: Shaped[np.ndarray, "*n rows"],
        point: Shaped[np.ndarray, " 3"] | None = None,
    ) -> Shaped[np.ndarray, "n motors"]:
        """Torque on every motor, newton metres (newtons where it slides), of a force at the end of a chain, by virtual work.

        Args:
            chain: from the base to where the force acts.
            force: newtons, in base axes, at all poses or at each; with six rows the moment behind it, newton metres.
            point: where it acts in the frame of the chain's end, metres; its origin by default.
        """
        if not chain.joints:
            return np.zeros(self.motors.shape)
        J = self._columns(chain, point, angular=force.shape[-1] == 6)
        at_coordinates = np.einsum("...r,...rc->...c", force, J)
        return np.einsum("nc,ncm->nm", at_coordinates, self.by_motor[:, : chain.joints])

    def torque_by_joint(
        self,
        chain: Chain,
        force: Shaped[np.ndarray, "*n rows"],
        point: Shaped[np.ndarray, " 3"] | None = None,
        *,
        turning: bool = False,
    ) -> Shaped[np.ndarray, "n motors joints"]:
        """Derivative of `torque` by the controller's joints.

        A joint j turns what stands behind it: ∂(v_k, w_k)/∂s_j = w_j × (v_k, w_k) for k behind j, and ∂v_k/∂s_j = w_k × v_j
        for k before j, where w_k itself stays.

        Args:
            chain: from the base to where the force acts.
            force: as of `torque`.
            point: as of `torque`.
            turning: whether force and moment turn with the chain's end.
        """
        if not chain.joints:
            return np.zeros((*self.motors.shape, self.by_joint.shape[2]))
        J = self._columns(chain, point, angular=True)
        v, w = np.swapaxes(J[:, :3], 1, 2), np.swapaxes(J[:, 3:], 1, 2)
        whole = np.zeros((len(J), 6))
        whole[:, : force.shape[-1]] = force
        f, m = whole[:, :3], whole[:, 3:]
        behind = np.triu(np.ones((chain.joints, chain.joints)))  # rows j, columns k, with j itself
        turned = np.einsum("nr,njkr->njk", f, np.cross(w[:, :, None], v[:, None])) * behind
        second = turned + np.swapaxes(turned * (1.0 - np.eye(chain.joints)), 1, 2)
        second += np.einsum("nr,njkr->njk", m, np.cross(w[:, :, None], w[:, None])) * behind
        if turning:
            second += np.einsum("njr,nkr->njk", np.cross(w, f[:, None]), v) + np.einsum(
                "njr,nkr->njk", np.cross(w, m[:, None]), w
            )
        first = np.einsum("nr,nrc->nc", whole, J)
        own = slice(chain.joints)
        return np.einsum("njk,nkm,nji->nmi", second, self.by_motor[:, own], self.by_joint[:, own]) + np.einsum(
            "nc,ncmi->nmi", first, self.curvature[:, own]
        )

    def _columns(
        self, chain: Chain, point: Shaped[np.ndarray, " 3"] | None, *, angular: bool
    ) -> Shaped[np.ndarray, "n rows joints"]:
        if self.coordinates.dtype == object:
            traced = trace(chain, self.coordinates[0, : chain.joints], NO_ERRORS)
            end = traced.T[:3, 3] + (0.0 if point is None else traced.T[:3, :3] @ point)
            return traced.columns(end, angular=angular)[None]
        own = np.ascontiguousarray(self.coordinates[:, : chain.joints])
        layout = chain.joint_columns
        return walk.columns(chain, own, np.zeros((0, 6)), layout, np.ones_like(own), angular=angular, point=point)

    def rotations(self, chain: Chain) -> Shaped[np.ndarray, "n 3 3"]:
        """Rotation of a chain's end."""
        if self.coordinates.dtype == object:
            return trace(chain, self.coordinates[0], NO_ERRORS).T[None, :3, :3]
        return walk.poses(chain, self.coordinates, NO_ERRORS)[:, :3, :3]


def motor_matrix(robot: Robot) -> Shaped[np.ndarray, "coordinates motors"]:
    """Coordinates that the turn of each motor moves, its four-bar taken for a parallelogram."""
    return np.eye(len(robot.joints)) if robot.four_bar is None else robot.joint_map.matrix


def moved_by_motors(robot: Robot) -> Bool[np.ndarray, "coordinates motors"]:
    """Find the chain coordinates that each motor moves."""
    bar = robot.four_bar
    if bar is None:
        return np.eye(len(robot.joints), dtype=bool)
    return (robot.joint_map.matrix != 0) | np.outer(bar.output != 0, (bar.arm != 0) | (bar.crank != 0))


def sample_poses(robot: Robot, count: int = 64) -> Shaped[np.ndarray, "k joints"]:
    """Some joint positions inside the limits at which loops close: enough to see how large loads become."""
    limits = np.clip(robot.limits, -1.5, 1.5)
    q = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))
    sound = robot.inside_limits(q)
    if robot.four_bar is not None:
        sound &= robot.four_bar.closes(q, np.zeros(3))
    return q[sound] if sound.sum() > count // 4 else q


def at_motors(
    robot: Robot,
    names: Sequence[str],
    motors: Sequence[int],
    tolerances: Sequence[float],
    turns: Callable[[LoadPath], Shaped[np.ndarray, "n p"]],
    turns_by_joint: Callable[[LoadPath], Shaped[np.ndarray, "n p joints"]],
    nominal: Sequence[float] | None = None,
    *,
    per: str = "",
) -> LinearTerm:
    """A term of which each parameter turns one motor.

    Args:
        robot: the robot.
        names: of the parameters.
        motors: number of the motor that each one turns.
        tolerances: of the parameters.
        turns: turn of its motor for a unit of each parameter, where the load path stands.
        turns_by_joint: its derivative by the controller's joints.
        nominal: values that the parameters deviate from; zero by default.
        per: what the parameters are per, for a motor that turns: ``m`` of lever, ``Nm`` of torque.
    """
    moved = moved_by_motors(robot)
    rows = [(c, k) for k, motor in enumerate(motors) for c in np.flatnonzero(moved[:, motor])]
    pairs: Int[np.ndarray, "pairs 2"] = np.array(rows, dtype=np.int64).reshape(-1, 2)
    coordinate, parameter = pairs.T
    motor = np.array(motors, dtype=np.int64)[parameter]

    def basis(q: np.ndarray) -> np.ndarray:
        path = LoadPath.at(robot, q)
        return turns(path)[:, parameter] * path.by_motor[:, coordinate, motor]

    def by_joint(q: np.ndarray) -> np.ndarray:
        path = LoadPath.at(robot, q)
        geared = turns_by_joint(path)[:, parameter] * path.by_motor[:, coordinate, motor][:, :, None]
        return geared + turns(path)[:, parameter, None] * path.curvature[:, coordinate, motor]

    return LinearTerm(
        names=tuple(names),
        units=tuple(_unit(per, slides=bool(robot.prismatic[motor])) for motor in motors),
        tolerances=tuple(tolerances),
        pairs=pairs,
        coordinates=len(robot.joints),
        basis=basis,
        by_joint=by_joint,
        nominal=None if nominal is None else np.array(nominal, dtype=float),
    )


def _unit(per: str, *, slides: bool) -> str:
    """Unit of a turn; a motor that slides has forces for torques, and the lever of a height is a number."""
    if not slides:
        return f"rad/{per}" if per else "rad"
    return "m/N" if per == "Nm" else "m"
