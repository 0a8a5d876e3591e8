"""Drives that yield under what they carry."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taskcal.errors import TaskcalError
from taskcal.robot.effects.effect import DEFLECTION, Effect, frozen
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import LoadPath, at_motors, sample_poses
from taskcal.robot.effects.lumped_weights import yield_under_lumped_weights
from taskcal.robot.effects.motor_torque import motor_torque, motor_torque_by_joint
from taskcal.robot.load import Load
from taskcal.robot.parameter import ShownUnit
from taskcal.robot.robot import Robot

STATED_ERROR_SHARE = 0.3
"""Share by which a stated stiffness is expected to be wrong (1σ): it is rarely measured, and drives differ."""

MIN_STATED_SHARE = 0.1
"""A drive is taken to be built for this share of the largest torque among all drives at least, where it carries less."""

CERTAIN_SIGMAS = 3.0
"""Standard errors below zero from which on a compliance is called negative."""


@dataclass(frozen=True, kw_only=True)
class Compliance(Effect):
    """Drives that yield under the weight of what they carry, and under forces at the tool.

    Torques come by virtual work through the true load path: through a parallelogram's rod the forearm's moment goes to the
    motor of its crank, whose absolute angle yields, and the lower arm's motor carries its weight but not its moment. A
    coupling without a four-bar is the controller's way of counting, and each drive yields about its own axis.

    Where the robot file states the masses, each joint has one compliance, which acts on the torque of all known loads
    together. Where it does not, each motor has a parameter for a weight at each later joint and at the tool point: the
    product of compliance and weight, so that neither must be known.
    """

    key = "compliance"
    label = "compliance"
    summary = "drives that yield under the weight of what they carry, and under forces at the tool"

    load: Load | None = None
    """Payload, force and moment; by default the robot file's payload, and no force. It needs masses in the robot file."""

    @property
    def details(self) -> str:
        """Its tolerance, where that is another than usual."""
        return "" if self.tolerance == DEFLECTION else f" (±{self.tolerance * 1e3:g} mrad)"

    def under(self, load: Load) -> "Compliance":
        """The same drives under another load."""
        return replace(self, load=load)

    def remarks(self, robot: Robot, estimates: Mapping[str, tuple[float, float]]) -> list[str]:
        """Drives that would yield against their load, beyond doubt."""
        out: list[str] = []
        for joint, stiffness, slides in zip(robot.joint_names, robot.statics.stiffness, robot.prismatic, strict=True):
            if f"{joint}.compliance" not in estimates:
                continue
            unit = ShownUnit.of("m/N" if slides else "rad/Nm")
            deviation, error = estimates[f"{joint}.compliance"]
            total = deviation + (0.0 if stiffness is None else 1.0 / stiffness)
            if total < -CERTAIN_SIGMAS * error:
                out.append(
                    f"the compliance of {joint} is {total * unit.factor:.3g} ± {error * unit.factor:.2g} {unit.name}, but no "
                    "drive yields against its load: something else there has the shape of gravity; do not predict other "
                    "loads with it"
                )
        return out

    @classmethod
    def from_json(cls, options: Mapping[str, Any]) -> "Compliance":
        """The effect of these options, as `to_json` gives them."""
        load = options.get("load")
        others = frozen({name: value for name, value in options.items() if name != "load"})
        return cls(**others, load=None if load is None else Load(**frozen(load)))

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.compliance``, radians per newton metre, or ``J2.sag_J4`` …, radians per metre of lever.

        Raises:
            TaskcalError: there is a load, but no masses of the links.
        """
        if robot.statics.links is not None:
            return self._of_known_loads(robot)
        if self.load is not None:
            raise TaskcalError(
                f"{robot.name}: a load deflects drives whose compliance is known by itself, which takes masses; state mass_kg "
                "and centre_mm of every joint in the robot file"
            )
        return yield_under_lumped_weights(robot, self.chosen(robot), self.tolerance)

    def _of_known_loads(self, robot: Robot) -> LinearTerm:
        """One compliance for each joint, about the stated stiffness where there is one.

        The tolerances do not depend on the load, so that it may change between calibration and use.
        """
        motors = self.chosen(robot)
        own = motor_torque(robot, Load())(LoadPath.at(robot, sample_poses(robot)))
        largest = np.abs(own).max(axis=0)
        # a robot without weight gives no scale; 1 Nm keeps its tolerances finite
        built_for = np.maximum(largest, MIN_STATED_SHARE * max(float(largest.max()), 1.0))
        stiffness = [robot.statics.stiffness[m] for m in motors]
        load = self.load or Load()
        torque, slope = motor_torque(robot, load), motor_torque_by_joint(robot, load)
        return at_motors(
            robot,
            [f"{robot.joint_names[m]}.compliance" for m in motors],
            motors,
            [
                self.tolerance / built_for[m] if k is None else STATED_ERROR_SHARE / k
                for m, k in zip(motors, stiffness, strict=True)
            ],
            lambda path: torque(path)[:, motors],
            lambda path: slope(path)[:, motors],
            nominal=[0.0 if k is None else 1.0 / k for k in stiffness],
            per="Nm",
        )


SOFT = Compliance(tolerance=3e-3)
"""Drives of 10⁶ Nm/rad under some hundred kilograms, or of 10⁴ under some kilograms: milliradians per metre of lever."""
