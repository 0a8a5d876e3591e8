"""The robot file: its schema, and the robot it describes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Self

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationError, model_validator

from taskcal.errors import FileError, RobotError, TaskcalError
from taskcal.geometry.four_bar import FourBar
from taskcal.repeated import repeated
from taskcal.robot.expression import parse_linear
from taskcal.robot.joint_section import JointSection, StepSection
from taskcal.robot.joint_side import FourBarDrive, JointMap
from taskcal.robot.model_error import ModelError
from taskcal.robot.robot import CoupledLimit, DrivenJoint, Part, Published, Robot, RobotJoint, Tolerances
from taskcal.robot.statics import Body, Statics
from taskcal.robot.statics_section import PayloadSection, SpringSection, body
from taskcal.toml_file import Direction, Finite, NotNegative, Positive, Section, Sign, explain, read_toml


class FourBarSection(Section):
    """A four-bar that drives a joint from a motor elsewhere."""

    drives: str
    arm: str
    crank: str
    crank_mm: Positive
    rod_mm: Positive
    rocker_mm: Positive
    arm_mm: Positive
    crank_angle_deg: Finite = -90.0
    rocker_angle_deg: Finite = -90.0
    assembly: Sign = 1


class CoupledLimitSection(Section):
    """Limits on a linear combination of joints."""

    of: str
    range_deg: tuple[Finite, Finite]

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.range_deg[0] < self.range_deg[1]:
            raise ValueError(
                f"the lower limit {self.range_deg[0]:g} must be below the upper limit {self.range_deg[1]:g}"
            )
        return self


class ToleranceSection(Section):
    """Standard deviations of the defects."""

    translation_mm: Positive = 1.0
    rotation_mrad: Positive = 1.0
    length_mm: Positive | None = None
    parameter_mm: dict[str, Positive] = Field(default_factory=dict)
    parameter_mrad: dict[str, Positive] = Field(default_factory=dict)


class ModelErrorSection(Section):
    """What geometry does not explain."""

    position_mm: NotNegative
    source: str = "the robot file"

    def model_error(self) -> ModelError:
        """In metres."""
        return ModelError(position=self.position_mm * 1e-3, source=self.source)


class PublishedSection(Section):
    """What a publication says of the parameters."""

    source: str
    redundant: tuple[str, ...] = ()
    zero: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()


MOST_JOINTS = 50
"""Two arms of seven joints on a gantry have half as many."""


class RobotFile(Section):
    """A robot file."""

    name: str = Field(min_length=1)
    title: str = ""
    source: tuple[str, ...] = ()
    joint: tuple[JointSection, ...] = Field(min_length=1, max_length=MOST_JOINTS)
    tool: tuple[StepSection, ...] = ()
    flange: tuple[StepSection, ...] = ()
    four_bar: FourBarSection | None = None
    coupled_limit: tuple[CoupledLimitSection, ...] = ()
    payload: PayloadSection | None = None
    spring: SpringSection | None = None
    gravity: Direction = (0.0, 0.0, -1.0)
    link_radii_mm: tuple[Positive, ...] | None = None
    tolerance: ToleranceSection = ToleranceSection()
    model_error: ModelErrorSection | None = None
    symbols: dict[str, str] = Field(default_factory=dict)
    published: PublishedSection | None = None

    @model_validator(mode="after")
    def _names(self) -> Self:
        every = [joint.name for joint in self.joint]
        if twice := repeated(every):
            raise ValueError(f"two joints are named '{min(twice)}'")
        names = [joint.name for joint in self.own]
        if not names:
            raise ValueError("all joints are driven; at least one needs a motor")
        if self.four_bar is not None and len(names) < len(every):
            raise ValueError("a robot file has a four_bar or driven joints, not both")
        if self.link_radii_mm is not None and len(self.link_radii_mm) != len(names) + 1:
            raise ValueError(
                f"link_radii_mm has {len(self.link_radii_mm)} values; {len(names)} joints have {len(names) + 1} links: base to "
                "first joint, joint to joint, last joint to tool point"
            )
        weightless = [joint.name for joint in self.own if joint.mass_kg is None]
        if 0 < len(weightless) < len(names):
            raise ValueError(
                f"joint '{weightless[0]}' has no mass_kg, others have; state the mass of every joint, or of none"
            )
        reserved = {"tool", "base", "loop"} & set(every)
        if reserved:
            raise ValueError(f"a joint cannot be named '{min(reserved)}'; Taskcal uses that name for other parameters")
        return self

    @property
    def own(self) -> tuple[JointSection, ...]:
        """Joints with motors of their own."""
        return tuple(joint for joint in self.joint if not joint.driven)

    def robot(self) -> Robot:
        """The robot that the file describes.

        Raises:
            RobotError: an expression or a name in it means nothing.
        """
        names = [joint.name for joint in self.own]
        coordinates = sorted(enumerate(self.joint, start=1), key=lambda numbered: numbered[1].driven)
        matrix = np.array([_linear(f"joint {i}, angle", joint.angle or joint.name, names) for i, joint in coordinates])
        offset = [np.radians(j.offset_deg) if j.type == "revolute" else j.offset_mm * 1e-3 for _, j in coordinates]
        joints, behind = self._chain()
        return Robot(
            name=self.name,
            title=self.title or self.name,
            source=self.source,
            joints=joints,
            joint_map=JointMap(matrix=matrix, offset=np.array(offset)),
            four_bar=self._drive(names),
            tool=(*behind, *(step.part() for step in self.tool)),
            flange=(*behind, *(step.part() for step in self.flange)),
            coupled_limits=tuple(
                CoupledLimit(
                    text=c.of,
                    coefficients=_linear(f"coupled_limit {i}, of", c.of, names),
                    limits=_pair(np.radians(c.range_deg)),
                )
                for i, c in enumerate(self.coupled_limit, start=1)
            ),
            statics=self._statics(names),
            link_radii=None if self.link_radii_mm is None else tuple(r * 1e-3 for r in self.link_radii_mm),
            tolerances=_tolerances(self.tolerance),
            model_error=None if self.model_error is None else self.model_error.model_error(),
            symbols=_symbols(self.symbols, names),
            published=Published(**self.published.model_dump()) if self.published else Published(),
            description=self.model_dump(mode="json", exclude_defaults=True),
        )

    def _chain(self) -> tuple[tuple[RobotJoint, ...], tuple[Part, ...]]:
        """The robot's own joints with all that stands around them, and what stands behind the last."""
        joints: list[RobotJoint] = []
        waiting: list[Part] = []
        number = len(self.own)
        for i, joint in enumerate(self.joint, start=1):
            before, after = joint.parts(i)
            if joint.driven:
                mover = DrivenJoint(name=joint.name, kind=joint.type, number=number)
                waiting += [*before, Part(transform=np.eye(4), driven=mover), *after]
                number += 1
            else:
                joints.append(self._joint(joint, (*waiting, *before), after))
                waiting = []
        return tuple(joints), tuple(waiting)

    def _joint(self, joint: JointSection, before: tuple[Part, ...], after: tuple[Part, ...]) -> RobotJoint:
        if joint.type == "prismatic":
            unit, limits = 1e-3, joint.limits_mm
            speed, acceleration = joint.speed_mm_s, joint.acceleration_mm_s2
        else:
            unit, limits = np.pi / 180.0, joint.limits_deg
            speed, acceleration = joint.speed_deg_s, joint.acceleration_deg_s2
        return RobotJoint(
            name=joint.name,
            kind=joint.type,
            before=before,
            after=after,
            limits=(-np.inf, np.inf) if limits is None else _pair(np.array(limits) * unit),
            speed=np.inf if speed is None else speed * unit,
            acceleration=np.inf if acceleration is None else acceleration * unit,
            gear_ratio=joint.gear_ratio,
        )

    def _statics(self, names: list[str]) -> Statics:
        weights = [body(j.mass_kg, j.centre_mm) for j in self.own if j.mass_kg is not None and j.centre_mm is not None]
        direction = np.array(self.gravity)
        sliding = [joint.type == "prismatic" for joint in self.own]
        return Statics(
            links=tuple(weights) or None,
            payload=Body(mass=0.0, centre=(0.0, 0.0, 0.0)) if self.payload is None else self.payload.body(),
            stiffness=tuple(
                j.stiffness_nm_rad if j.stiffness_n_mm is None else j.stiffness_n_mm * 1e3 for j in self.own
            ),
            gravity=direction / np.linalg.norm(direction),
            spring=None if self.spring is None else self.spring.spring(names, sliding),
        )

    def _drive(self, names: list[str]) -> FourBarDrive | None:
        bar = self.four_bar
        if bar is None:
            return None
        return FourBarDrive(
            bar=FourBar(
                crank=bar.crank_mm * 1e-3,
                rod=bar.rod_mm * 1e-3,
                rocker=bar.rocker_mm * 1e-3,
                arm=bar.arm_mm * 1e-3,
                crank_angle=float(np.radians(bar.crank_angle_deg)),
                rocker_angle=float(np.radians(bar.rocker_angle_deg)),
                assembly=bar.assembly,
            ),
            arm=_linear("four_bar, arm", bar.arm, names),
            crank=_linear("four_bar, crank", bar.crank, names),
            output=_linear("four_bar, drives", bar.drives, names),
        )


def _linear(place: str, text: str, names: list[str]) -> Float[np.ndarray, " names"]:
    try:
        return parse_linear(text, names)
    except TaskcalError as error:
        raise RobotError(f"{place}: {error}") from error


def _pair(limits: np.ndarray) -> tuple[float, float]:
    return float(limits[0]), float(limits[1])


def _tolerances(section: ToleranceSection) -> Tolerances:
    length = section.translation_mm if section.length_mm is None else section.length_mm
    overrides = {**section.parameter_mm, **section.parameter_mrad}
    return Tolerances(
        translation=section.translation_mm * 1e-3,
        rotation=section.rotation_mrad * 1e-3,
        length=length * 1e-3,
        overrides={name: value * 1e-3 for name, value in overrides.items()},
    )


def _symbols(section: Mapping[str, str], names: list[str]) -> dict[str, str]:
    """Symbols by parameter name; a key ``tx`` … ``rz`` is a pattern in which {} becomes the joint's number."""
    out = {key: value for key, value in section.items() if "." in key}
    for key in set(section) - set(out):
        for number, name in enumerate(names, start=1):
            out[f"{name}.{key}"] = section[key].replace("{}", str(number))
    return out


def read_robot(path: Path) -> Robot:
    """Read a robot file.

    Raises:
        FileError: it is missing, no TOML, or does not describe a robot.
    """
    described = read_toml(path, RobotFile)
    try:
        return described.robot()
    except TaskcalError as error:
        raise FileError(path, str(error)) from error


def robot_from(data: Mapping[str, object]) -> Robot:
    """The robot of a description already parsed, as in a robot file.

    Raises:
        RobotError: it does not describe a robot.
    """
    try:
        return RobotFile.model_validate(data).robot()
    except ValidationError as error:
        raise RobotError(explain(error, RobotFile)) from error
