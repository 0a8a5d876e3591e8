"""The robot file: its schema, and the robot it describes."""

import ast
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationError, model_validator

from taskcal.arguments import repeated
from taskcal.errors import FileError, RobotError, TaskcalError, UnknownName, shown
from taskcal.geometry import se3
from taskcal.geometry.four_bar import FourBar
from taskcal.io.toml_file import (
    Direction,
    FileSection,
    Finite,
    NotNegative,
    Positive,
    Sign,
    Stiffness,
    explain,
    read_toml,
)
from taskcal.kernels.chain import JointKind
from taskcal.robot.joint_side import FourBarDrive, JointMap
from taskcal.robot.robot import CoupledLimit, DrivenJoint, ModelError, Part, Published, Robot, RobotJoint, Tolerances
from taskcal.robot.statics import Body, CoilSpring, Statics

# The parts of a robot file that say what the robot carries and how it yields.

Point = tuple[Finite, Finite, Finite]


class PayloadSection(FileSection):
    """Payload of the flange, tool included."""

    mass_kg: NotNegative
    centre_mm: Point = (0.0, 0.0, 0.0)

    def body(self) -> Body:
        """The payload."""
        return body(self.mass_kg, self.centre_mm)


class SpringSection(FileSection):
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


# The parts of a robot file that say how its chain runs: elementary steps, rows of a table, joints.


class StepSection(FileSection):
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


class DHSection(FileSection):
    """A row of a Denavit–Hartenberg table, but for the joint's offset."""

    alpha_deg: Finite = 0.0
    a_mm: Finite = 0.0
    d_mm: Finite = 0.0


class JointSection(FileSection):
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


# Linear expressions in joint names, such as ``-(J2 + J3)`` or ``J3 - 0.5*J2``.

MAX_CHARACTERS = 200
"""Characters; so that brackets and signs are never nested deeper than Python follows."""


def parse_linear(text: str, names: Sequence[str]) -> Float[np.ndarray, " names"]:
    """Coefficients of a linear expression over the given names.

    Raises:
        RobotError: the text is not a linear expression without a constant.
        UnknownName: it uses a name that is not among `names`.
    """
    if len(text) > MAX_CHARACTERS:
        raise RobotError(f"'{shown(text)}' is longer than {MAX_CHARACTERS} characters; write for example '-(J2 + J3)'")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError) as error:  # of the parser: syntax, NUL, nesting
        raise RobotError(f"'{shown(text)}' is not an expression; write for example '-(J2 + J3)'") from error
    terms = _terms(tree, text)
    if "" in terms:
        raise RobotError(f"'{shown(text)}' has a constant {terms['']:g}; put it into the joint's offset")
    out = np.zeros(len(names))
    for name, value in terms.items():
        if name not in names:
            raise UnknownName("joint", name, names, f"(in '{shown(text)}')")
        out[list(names).index(name)] = value
    return out


def _terms(node: ast.expr, text: str) -> dict[str, float]:
    """Coefficient of each name; the constant under the empty name."""
    match node:
        case ast.Name(id=name):
            return {name: 1.0}
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as value):
            return {"": float(value)} if value else {}
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return {name: -value for name, value in _terms(inner, text).items()}
        case ast.UnaryOp(op=ast.UAdd(), operand=inner):
            return _terms(inner, text)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
            sign = 1.0 if isinstance(op, ast.Add) else -1.0
            out = _terms(left, text)
            for name, value in _terms(right, text).items():
                out[name] = out.get(name, 0.0) + sign * value
            return out
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            a, b = _terms(left, text), _terms(right, text)
            if isinstance(op, ast.Mult) and set(a) <= {""}:
                a, b = b, a
            factor = b.get("", 0.0)
            if set(b) <= {""} and (factor or isinstance(op, ast.Mult)):
                return {
                    name: value * factor if isinstance(op, ast.Mult) else value / factor for name, value in a.items()
                }
        case _:
            pass
    raise RobotError(f"'{shown(text)}' is not linear in joint names; write for example '-(J2 + J3)'")


class FourBarSection(FileSection):
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


class CoupledLimitSection(FileSection):
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


class ToleranceSection(FileSection):
    """Standard deviations of the defects."""

    translation_mm: Positive = 1.0
    rotation_mrad: Positive = 1.0
    length_mm: Positive | None = None
    parameter_mm: dict[str, Positive] = Field(default_factory=dict)
    parameter_mrad: dict[str, Positive] = Field(default_factory=dict)


class ModelErrorSection(FileSection):
    """Model error of such robots."""

    position_mm: NotNegative
    source: str = "the robot file"

    def model_error(self) -> ModelError:
        """Model error in metres."""
        return ModelError(position=self.position_mm * 1e-3, source=self.source)


class PublishedSection(FileSection):
    """Statements of a publication on the parameters."""

    source: str
    redundant: tuple[str, ...] = ()
    zero: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()


MAX_JOINTS = 50
"""Two arms of seven joints on a gantry have half as many."""


class RobotFile(FileSection):
    """A robot file."""

    name: str = Field(min_length=1)
    title: str = ""
    source: tuple[str, ...] = ()
    links: tuple[Annotated[str, Field(min_length=1)], Annotated[str, Field(min_length=1)]] | None = None
    joint: tuple[JointSection, ...] = Field(min_length=1, max_length=MAX_JOINTS)
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
                "first joint, joint to joint, last joint to TCP"
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
            links=self.links,
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
