"""Where loads go: what the turn of each motor moves, through the robot's true load path."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import ClosureError
from taskcal.geometry import walk
from taskcal.geometry.chain import Chain
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadPath:
    """The nominal robot where it stands, and what each motor moves there while the others hold.

    Where a four-bar stands between motor and link, motors are the controller's joints: the crank's turn is absolute.
    Without one, a coupling is taken for the controller's way of counting, and each drive acts about its own axis.
    """

    coordinates: Float[np.ndarray, "n coordinates"]
    """Of the chain, radians or metres."""
    by_motor: Float[np.ndarray, "n coordinates motors"]
    """∂(coordinates)/∂(motors)."""
    motors: Float[np.ndarray, "n motors"]
    """Where the motors' outputs stand, radians or metres."""

    @classmethod
    def at(cls, robot: Robot, q: Float[np.ndarray, "n joints"]) -> "LoadPath":
        """The load path at joint positions q.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        q = np.asarray(q, dtype=float)
        s = robot.joint_map(q)
        if robot.four_bar is None:
            one = np.eye(s.shape[1])
            return cls(coordinates=s, by_motor=np.broadcast_to(one, (len(q), *one.shape)), motors=s)
        shift = robot.four_bar.shift(q, np.zeros(3))
        return cls(coordinates=s + shift.value, by_motor=robot.joint_map.matrix + shift.by_joint, motors=q)

    def torque(
        self,
        chain: Chain,
        force: Float[np.ndarray, "*n rows"],
        point: Float[np.ndarray, " 3"] | None = None,
    ) -> Float[np.ndarray, "n motors"]:
        """Torque on every motor, newton metres (newtons where it slides), of a force at the end of a chain, by virtual work.

        Args:
            chain: from the base to where the force acts.
            force: newtons, in base axes, at all poses or at each; with six rows the moment behind it, newton metres.
            point: where it acts in the frame of the chain's end, metres; its origin by default.
        """
        if not chain.joints:
            return np.zeros(self.motors.shape)
        own = np.ascontiguousarray(self.coordinates[:, : chain.joints])
        layout, angular = walk.Columns.of_joints(chain), force.shape[-1] == 6
        J = walk.columns(chain, own, np.zeros((0, 6)), layout, np.ones_like(own), angular=angular, point=point)
        at_coordinates = np.einsum("...r,...rc->...c", force, J)
        return np.einsum("nc,ncm->nm", at_coordinates, self.by_motor[:, : chain.joints])


def drive(robot: Robot) -> Float[np.ndarray, "coordinates motors"]:
    """Coordinates that the turn of each motor moves, its four-bar taken for a parallelogram."""
    return np.eye(len(robot.joints)) if robot.four_bar is None else robot.joint_map.matrix


def moved_by_motors(robot: Robot) -> Bool[np.ndarray, "coordinates motors"]:
    """Which coordinates the turn of each motor moves at any pose."""
    bar = robot.four_bar
    if bar is None:
        return np.eye(len(robot.joints), dtype=bool)
    return (robot.joint_map.matrix != 0) | np.outer(bar.output != 0, (bar.arm != 0) | (bar.crank != 0))


def sample_poses(robot: Robot, count: int = 64) -> Float[np.ndarray, "k joints"]:
    """Some joint positions inside the limits at which loops close: enough to see how large loads become."""
    limits = np.clip(robot.limits, -1.5, 1.5)
    q = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))
    sound = q[[bool(inside) and _closes(robot, row) for inside, row in zip(robot.inside_limits(q), q, strict=True)]]
    return sound if len(sound) > count // 4 else q


def _closes(robot: Robot, q: Float[np.ndarray, " joints"]) -> bool:
    if robot.four_bar is None:
        return True
    try:
        robot.four_bar.shift(q[None], np.zeros(3))
    except ClosureError:
        return False
    return True


def at_motors(
    robot: Robot,
    names: Sequence[str],
    motors: Sequence[int],
    tolerances: Sequence[float],
    turns: Callable[[Float[np.ndarray, "n joints"], LoadPath], Float[np.ndarray, "n p"]],
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
        turns: turn of its motor for a unit of each parameter, at joint positions q and the load path there.
        nominal: values that the parameters deviate from; nil by default.
        per: what the parameters are per, for a motor that turns: ``m`` of lever, ``Nm`` of torque.
    """
    moved = moved_by_motors(robot)
    rows = [(c, k) for k, motor in enumerate(motors) for c in np.flatnonzero(moved[:, motor])]
    pairs: Int[np.ndarray, "pairs 2"] = np.array(rows, dtype=np.int64).reshape(-1, 2)
    coordinate, parameter = pairs.T
    motor = np.array(motors, dtype=np.int64)[parameter]

    def basis(q: np.ndarray) -> np.ndarray:
        path = LoadPath.at(robot, q)
        return turns(q, path)[:, parameter] * path.by_motor[:, coordinate, motor]

    def by_joint(q: np.ndarray) -> np.ndarray:
        # the walk and the closure are compiled for real numbers; what an effect's slope adds to a Newton step is small
        return np.stack([(basis(q + h) - basis(q - h)) / 2e-5 for h in 1e-5 * np.eye(q.shape[1])], axis=2)

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
    """Of a turn; a motor that slides has forces for torques, and the lever of a height is a number."""
    if not slides:
        return f"rad/{per}" if per else "rad"
    return "m/N" if per == "Nm" else "m"
