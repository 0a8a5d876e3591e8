"""The parts of a robot file that say what the robot carries and how it yields."""

from collections.abc import Sequence
from typing import Self

import numpy as np
from pydantic import model_validator

from taskcal.errors import RobotError, UnknownName
from taskcal.robot.statics import Body, CoilSpring
from taskcal.toml_file import Finite, NotNegative, Positive, Section

Point = tuple[Finite, Finite, Finite]


class PayloadSection(Section):
    """What the flange carries, tool included."""

    mass_kg: NotNegative
    centre_mm: Point = (0.0, 0.0, 0.0)

    def body(self) -> Body:
        """The payload."""
        return body(self.mass_kg, self.centre_mm)


class SpringSection(Section):
    """A coil spring beside an axis."""

    joint: str
    rate_n_mm: Positive
    free_length_mm: NotNegative
    crank_mm: Positive
    anchor_mm: Positive
    aligned_deg: Finite

    @model_validator(mode="after")
    def _long(self) -> Self:
        if self.crank_mm == self.anchor_mm:
            raise ValueError(
                f"crank_mm and anchor_mm are both {self.crank_mm:g}: the spring would have no length where they line up"
            )
        return self

    def spring(self, names: Sequence[str], sliding: Sequence[bool]) -> CoilSpring:
        """The spring.

        Raises:
            RobotError: it helps a joint that does not turn, or does not exist.
        """
        turning = [name for name, slides in zip(names, sliding, strict=True) if not slides]
        if self.joint not in turning:
            raise RobotError(f"spring, joint: {UnknownName('turning joint', self.joint, turning)}")
        return CoilSpring(
            joint=list(names).index(self.joint),
            rate=self.rate_n_mm * 1e3,
            free_length=self.free_length_mm * 1e-3,
            crank=self.crank_mm * 1e-3,
            anchor=self.anchor_mm * 1e-3,
            aligned=float(np.radians(self.aligned_deg)),
        )


def body(mass_kg: float, centre_mm: Point) -> Body:
    """A mass and its centre, in SI units."""
    x, y, z = centre_mm
    return Body(mass=mass_kg, centre=(x * 1e-3, y * 1e-3, z * 1e-3))
