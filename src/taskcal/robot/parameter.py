"""A parameter of an error model, and the unit in which people see it; inside, values are SI."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from taskcal.robot.robot import Robot


@dataclass(frozen=True)
class ShownUnit:
    """Display unit of values in an SI unit."""

    name: str
    """``mm``, ``mrad``, ``mrad/m`` …"""
    factor: float
    """From the SI unit to this one."""

    @classmethod
    def of(cls, unit: str) -> "ShownUnit":
        """The shown unit of a SI unit: thousandths, or millionths per newton, newton metre or kelvin, of which there are many."""
        if unit.endswith(("/N", "/Nm", "/K")):
            return cls(f"µ{unit}", 1e6)
        return cls(f"m{unit}", 1e3)

    @property
    def key(self) -> str:
        """The same where names may only hold letters, as keys of JSON."""
        return self.name.replace("/", "_per_").replace("µ", "u").lower()

    @property
    def influence(self) -> str:
        """Unit of millimetres for one of it."""
        return f"mm/({self.name})" if "/" in self.name else f"mm/{self.name}"


@dataclass(frozen=True)
class Parameter:
    """One defect."""

    name: str
    unit: str
    """``m`` or ``rad``; of an effect also ``rad/rad``, ``rad/m`` (of lever), ``rad/Nm`` …"""
    tolerance: float
    """Standard deviation that manufacturing leaves, in that unit."""
    symbol: str = ""
    """Its name in the robot file, if it has one there."""

    @property
    def label(self) -> str:
        """The name, with the robot file's symbol behind it."""
        return f"{self.name} ({self.symbol})" if self.symbol else self.name

    @property
    def shown(self) -> ShownUnit:
        """The unit in which people see it."""
        return ShownUnit.of(self.unit)

    @property
    def stated_tolerance(self) -> str:
        """The tolerance in that unit, in words."""
        return f"{self.tolerance * self.shown.factor:g} {self.shown.name}"


def parameters_of(
    robot: Robot, names: Sequence[str], units: Sequence[str], stated: Mapping[str, float]
) -> tuple[Parameter, ...]:
    """Parameters with the tolerances and symbols of a robot.

    Args:
        robot: the robot; a tolerance that its file states for a parameter counts more than any other.
        names: of the parameters.
        units: of the parameters.
        stated: tolerances of those that effects bring, by name.
    """
    tolerances = robot.tolerances
    default = {"m": tolerances.translation, "rad": tolerances.rotation}
    return tuple(
        Parameter(
            name=name,
            unit=unit,
            tolerance=tolerances.overrides.get(
                name, tolerances.length if name.startswith("loop.") else stated.get(name) or default[unit]
            ),
            symbol=robot.symbols.get(name, ""),
        )
        for name, unit in zip(names, units, strict=True)
    )
