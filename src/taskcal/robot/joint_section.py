"""The parts of a robot file that say how its chain runs: elementary steps, rows of a table, joints."""

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from taskcal.geometry import se3
from taskcal.geometry.chain import JointKind
from taskcal.robot.robot import Part
from taskcal.robot.statics_section import Point
from taskcal.toml_file import Finite, NotNegative, Positive, Section, Stiffness


class StepSection(Section):
    """One elementary step: exactly one translation or rotation."""

    tx_mm: Finite | None = None
    ty_mm: Finite | None = None
    tz_mm: Finite | None = None
    rx_deg: Finite | None = None
    ry_deg: Finite | None = None
    rz_deg: Finite | None = None
    symbol: str = ""

    @model_validator(mode="after")
    def _one(self) -> Self:
        stated = [k for k, v in self.model_dump(exclude={"symbol"}).items() if v is not None]
        if len(stated) != 1:
            raise ValueError(
                f"a step is one of tx_mm ty_mm tz_mm rx_deg ry_deg rz_deg; this one has {stated or 'none'}"
            )
        if self.symbol and stated[0].endswith("_deg"):
            raise ValueError("only a length can have a symbol")
        return self

    def part(self) -> Part:
        """The fixed part it stands for."""
        ((key, value),) = ((k, v) for k, v in self.model_dump(exclude={"symbol"}).items() if v is not None)
        axis = "xyz".index(key[1])
        if key.endswith("_deg"):
            return Part(transform=se3.rotation(key[1], np.radians(value)))
        offset = np.zeros(3)
        offset[axis] = value * 1e-3
        return Part(transform=se3.translation(*offset), symbol=self.symbol, axis=axis)


class DHSection(Section):
    """A row of a Denavit–Hartenberg table, but for the joint's offset."""

    alpha_deg: Finite = 0.0
    a_mm: Finite = 0.0
    d_mm: Finite = 0.0


class JointSection(Section):
    """A joint with the parts that lead to it: elementary steps, or a row of a table."""

    name: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,79}$")
    type: JointKind = "revolute"
    steps: tuple[StepSection, ...] = ()
    dh: DHSection | None = None
    mdh: DHSection | None = None
    angle: str = ""
    driven: bool = False
    offset_deg: Finite = 0.0
    offset_mm: Finite = 0.0
    limits_deg: tuple[Finite, Finite] | None = None
    limits_mm: tuple[Finite, Finite] | None = None
    speed_deg_s: Positive | None = None
    speed_mm_s: Positive | None = None
    acceleration_deg_s2: Positive | None = None
    acceleration_mm_s2: Positive | None = None
    mass_kg: NotNegative | None = None
    centre_mm: Point | None = None
    stiffness_nm_rad: Stiffness | None = None
    stiffness_n_mm: Stiffness | None = None
    gear_ratio: Positive | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if sum((bool(self.steps), self.dh is not None, self.mdh is not None)) > 1:
            raise ValueError("give the parts before the joint once: as steps, dh or mdh")
        if self.driven:
            self._see_what_drives_it()
        sliding = self.type == "prismatic"
        if (self.offset_deg if sliding else self.offset_mm) or (self.limits_deg if sliding else self.limits_mm):
            raise ValueError(f"a {self.type} joint has its offset and limits in {'mm' if sliding else 'degrees'}")
        turns, slides = (self.speed_deg_s, self.acceleration_deg_s2), (self.speed_mm_s, self.acceleration_mm_s2)
        if any(value is not None for value in (turns if sliding else slides)):
            raise ValueError(f"a {self.type} joint has its speed and acceleration in {'mm' if sliding else 'degrees'}")
        if (self.stiffness_nm_rad if sliding else self.stiffness_n_mm) is not None:
            raise ValueError(f"a {self.type} joint has its stiffness in {'N/mm' if sliding else 'Nm/rad'}")
        if sliding and self.gear_ratio is not None:
            raise ValueError("a prismatic joint has no gear_ratio: its motor does not turn with it")
        if (self.mass_kg is None) != (self.centre_mm is None):
            raise ValueError("state mass_kg and centre_mm together, or neither")
        limits = self.limits_mm if sliding else self.limits_deg
        if limits and not limits[0] < limits[1]:
            raise ValueError(f"the lower limit {limits[0]:g} must be below the upper limit {limits[1]:g}")
        return self

    def _see_what_drives_it(self) -> None:
        if not self.angle:
            raise ValueError("a driven joint needs angle, which says what moves it, such as '-(J2 + J3)'")
        own = ("limits", "speed", "acceleration", "mass", "centre", "stiffness", "gear")
        stated = [key for key in self.model_fields_set if key.startswith(own)]
        if stated:
            raise ValueError(f"a driven joint has no motor of its own, and so no {min(stated)}")

    def parts(self, number: int) -> tuple[tuple[Part, ...], tuple[Part, ...]]:
        """Fixed parts before the joint, and behind its error frame."""
        if self.dh:
            # Rz(θ)·Tz(d)·Tx(a)·Rx(α): everything but the rotation follows the joint
            return (), (
                *_length(2, self.dh.d_mm, f"d{number}"),
                *_length(0, self.dh.a_mm, f"a{number}"),
                *_turn(self.dh.alpha_deg),
            )
        if self.mdh:
            # Rx(α)·Tx(a)·Rz(θ)·Tz(d): d lies along the joint's axis, so it may as well come first
            m = self.mdh
            return (*_turn(m.alpha_deg), *_length(0, m.a_mm, f"a{number}"), *_length(2, m.d_mm, f"d{number}")), ()
        return tuple(step.part() for step in self.steps), ()


def _length(axis: int, value_mm: float, symbol: str) -> tuple[Part, ...]:
    offset = np.zeros(3)
    offset[axis] = value_mm * 1e-3
    return (Part(transform=se3.translation(*offset), symbol=symbol, axis=axis),) if value_mm else ()


def _turn(alpha_deg: float) -> tuple[Part, ...]:
    return (Part(transform=se3.rotation("x", np.radians(alpha_deg))),) if alpha_deg else ()
