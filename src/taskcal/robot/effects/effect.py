"""What all effects share: the joints that have them, how large they are, how they are described."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from taskcal.errors import TaskcalError, UnknownName
from taskcal.geometry.chain import Step
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

    def suits(self, robot: Robot) -> bool:
        """Whether what is known of a robot gives reason to look for the effect."""
        return bool(self.chosen(robot))

    def extend(self, robot: Robot, steps: Sequence[Step]) -> tuple[Step, ...]:
        """The chain with the joints that the effect adds to the robot's own, which its term then moves; by default none."""
        return tuple(steps)

    def to_json(self) -> dict[str, Any]:
        """Its kind and options."""
        return {"kind": type(self).__name__, **_listed(asdict(self))}

    @classmethod
    def from_json(cls, options: Mapping[str, Any]) -> "Effect":
        """The effect of these options, as `to_json` gives them."""
        return cls(**frozen(options))

    def term(self, robot: Robot) -> LinearTerm:
        """The effect on a robot."""
        raise TaskcalError(f"{type(self).__name__} is no effect of its own")


def _listed(value: Any) -> Any:
    """As JSON has it: lists for tuples."""
    if isinstance(value, dict):
        return {name: _listed(inner) for name, inner in value.items()}
    return [_listed(inner) for inner in value] if isinstance(value, tuple) else value


def frozen(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with tuples for the lists of JSON."""
    return {name: _tupled(value) for name, value in options.items()}


def _tupled(value: Any) -> Any:
    return tuple(_tupled(inner) for inner in value) if isinstance(value, list) else value
