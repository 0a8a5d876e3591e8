"""Errors of gears that recur with the turns of the motor."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import LoadPath, at_motors
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class MotorHarmonics(Effect):
    """Cosine and sine of each motor's own angle and its multiples: strain-wave gears err twice in a turn of the motor.

    It takes the joints' gear ratios from the robot file. Behind a four-bar the motor turns with its crank.
    """

    key = "motor"
    label = "motor harmonics"
    asks_for = "the robot file states no gear ratio"
    summary = "once and twice in a turn of the motor, for joints whose `gear_ratio` the robot file states"

    orders: tuple[int, ...] = (1, 2)
    """Periods in a turn of the motor."""
    tolerance: float = 1e-4
    """Largest deflection expected of each parameter (1σ), at the joint, radians."""

    def suits(self, robot: Robot) -> bool:
        """Whether the robot file states a gear ratio."""
        return any(robot.joints[j].gear_ratio is not None for j in self.chosen(robot))

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.motor_cos1``, ``J2.motor_sin1`` …, radians at the joint, for joints whose ratio is stated.

        Raises:
            TaskcalError: no joint has a gear ratio, or one that was named has none.
        """
        ratios = [joint.gear_ratio for joint in robot.joints]
        geared = [j for j in self.chosen(robot) if ratios[j] is not None]
        missing = [name for name in self.joints or () if robot.joints[robot.joint_names.index(name)].gear_ratio is None]
        if missing or not geared:
            whose = f"joint {missing[0]}" if missing else "any joint"
            raise TaskcalError(
                f"{robot.name}: the robot file states no gear_ratio of {whose}; add it, or use Harmonics"
            )
        shapes = [(j, order, part) for j in geared for order in self.orders for part in ("cos", "sin")]
        motors = [j for j, _, _ in shapes]
        periods = np.array([order * (ratios[j] or 0.0) for j, order, _ in shapes])
        phases = np.array([0.0 if part == "cos" else 0.5 * np.pi for _, _, part in shapes])

        def turns(path: LoadPath) -> Float[np.ndarray, "n p"]:
            return np.cos(path.motors[:, motors] * periods - phases)

        def turns_by_joint(path: LoadPath) -> Float[np.ndarray, "n p joints"]:
            by_angle = -np.sin(path.motors[:, motors] * periods - phases) * periods
            return by_angle[:, :, None] * path.motors_by_joint[motors]

        return at_motors(
            robot,
            [f"{robot.joint_names[j]}.motor_{part}{order}" for j, order, part in shapes],
            motors,
            [self.tolerance] * len(shapes),
            turns,
            turns_by_joint,
        )
