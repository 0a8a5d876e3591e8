"""What all effects share: the joints that have them, how large they are, how they are described."""

from dataclasses import dataclass
from typing import Any

from taskcal.errors import TaskcalError, UnknownName
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.robot import Robot

DEFLECTION = 3e-4
"""Default tolerance of a joint's deflection, radians: what gears and bearings of an industrial robot leave."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """What all effects share."""

    joints: tuple[str, ...] | None = None
    """Names of the joints that have it; all by default."""
    tolerance: float = DEFLECTION
    """Largest deflection expected of each parameter (1σ), radians (metres where the joint slides)."""

    def chosen(self, robot: Robot) -> list[int]:
        """Numbers of its joints.

        Raises:
            UnknownName: a joint that the robot does not have.
        """
        names = robot.joint_names
        for name in self.joints or ():
            if name not in names:
                raise UnknownName("joint", name, names, f"of {robot.name}")
        return [i for i, name in enumerate(names) if self.joints is None or name in self.joints]

    def to_json(self) -> dict[str, Any]:
        """Its kind and options."""
        return {
            "kind": type(self).__name__,
            **{k: list(v) if isinstance(v, tuple) else v for k, v in vars(self).items()},
        }

    def term(self, robot: Robot) -> LinearTerm:
        """The effect on a robot."""
        raise TaskcalError(f"{type(self).__name__} is no effect of its own")
