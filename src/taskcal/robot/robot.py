"""A robot: its chain from base to tool, its joint side, limits and tolerances."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import joints_checked
from taskcal.errors import ReachError, WrongValue, shortened
from taskcal.geometry import se3
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, Fixed, Joint, JointKind, Step
from taskcal.robot.joint_side import FourBarDrive, JointMap, JointSide
from taskcal.robot.statics import Statics
from taskcal_groundwork.said import Said

# What geometry cannot explain of a robot, stated or assumed before anything is measured.


@dataclass(frozen=True, kw_only=True)
class ModelError:
    """Gears, compliance, backlash, temperature: what stays when the geometry is known."""

    position: float
    """Standard deviation per axis of the TCP at a pose, metres."""
    source: str
    """Where the figure comes from, in words."""


TYPICAL = ModelError(
    position=0.26e-3,
    source="median of five measured robots, which had 0.06 to 1.34 mm",
)
"""For a robot whose file states none. The complete geometric model left 0.064, 0.204, 0.255, 0.326 and 1.337 mm of every measured
row of five robots (the documentation of the expected error names them). Those do not grow with the robots' reach (0.05, 0.05,
0.15, 0.32 and 1.34 mm per metre), so that the figure is no share of it."""


def model_error_of(robot: "Robot", given: float | None = None) -> ModelError:
    """The model error to assume of a robot that was not measured.

    Args:
        robot: the robot.
        given: what the user states, metres; zero for a robot that follows its geometry exactly.

    Returns:
        as given, as the robot's file states it, or that of a typical robot.
    """
    if given is not None:
        return ModelError(position=given, source="as given")
    if robot.model_error is None:
        return TYPICAL
    return robot.model_error


TWO_TURNS = 4.0 * np.pi
"""Radians."""

POINT_COLUMNS = ("x", "y", "z")
"""Names of a measured point's columns, in small letters, which are not those of a joint."""

UNLIMITED_SLIDE_M = 3.0
"""To either side of zero, or twice so far from its one limit, that a joint which slides without limits is sought, metres. A
convention."""


@dataclass(frozen=True, kw_only=True)
class DrivenJoint:
    """A joint without a motor of its own: a linkage moves it with others, as it keeps the flange of a palletiser level."""

    name: str
    kind: JointKind
    number: int
    """Its chain coordinate; those of the robot's own joints come first."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Part:
    """An elementary part of the chain: one fixed translation or rotation, or a driven joint."""

    transform: Float[np.ndarray, "4 4"]
    """Pose of its end in its start."""
    symbol: str = ""
    """Symbol of its length, where it is one of the robot's nominal dimensions."""
    axis: int = 0
    """Axis of that length: 0, 1 or 2 for x, y or z."""
    driven: DrivenJoint | None = None
    """The joint that it is; its transform is then none."""

    @property
    def step(self) -> Step:
        """The step of a chain that the part stands for."""
        return Fixed(self.transform) if self.driven is None else Joint(self.driven.kind, self.driven.number)


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotJoint:
    """A motorised joint with the fixed parts around it."""

    name: str
    kind: JointKind
    before: tuple[Part, ...]
    """Fixed parts from the previous joint frame to the joint's axis, its local z."""
    after: tuple[Part, ...]
    """Fixed parts behind the joint's error frame (standard DH)."""
    limits: tuple[float, float]
    """Controller joint positions it can take, radians or metres."""
    speed: float = np.inf
    """Largest speed, radians or metres per second."""
    acceleration: float = np.inf
    """Largest acceleration, radians or metres per second squared."""
    gear_ratio: float | None = None
    """Turns of the motor for one turn of the joint; None where the file does not say."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CoupledLimit:
    """Limits on a linear combination of controller joint positions."""

    text: str
    coefficients: Float[np.ndarray, " joints"]
    limits: tuple[float, float]
    """Radians or metres."""


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """Standard deviations of the defects that manufacturing leaves, in metres and radians."""

    translation: float = 1e-3
    rotation: float = 1e-3
    length: float = 1e-3
    """Of the lengths of a closed loop."""
    overrides: Mapping[str, float] = field(default_factory=dict[str, float])
    """By parameter name."""


@dataclass(frozen=True, kw_only=True)
class Published:
    """Statements of a publication on the robot's parameters, by Taskcal's names."""

    source: str = ""
    redundant: tuple[str, ...] = ()
    """Said to repeat others."""
    zero: tuple[str, ...] = ()
    """Said to be without effect."""
    dropped: tuple[str, ...] = ()
    """Left out of its identified model."""


@joints_checked
@dataclass(frozen=True, eq=False, kw_only=True)
class Robot:
    """A serial robot, possibly with a four-bar in its drive."""

    name: str
    title: str
    source: tuple[str, ...]
    """Where the numbers come from."""
    joints: tuple[RobotJoint, ...]
    joint_map: JointMap
    four_bar: FourBarDrive | None
    tool: tuple[Part, ...]
    """Fixed parts from the last joint frame to the tool."""
    flange: tuple[Part, ...]
    """Fixed parts from the last joint frame to the controller's flange, in which it counts its tools."""
    coupled_limits: tuple[CoupledLimit, ...]
    statics: Statics
    """Masses, payload, stiffness and the direction of gravity."""
    link_radii: tuple[float, ...] | None
    """Radii of the capsules around the links, from base to first joint, joint to joint, last joint to TCP, metres;
    None where the file does not say."""
    tolerances: Tolerances
    symbols: Mapping[str, str]
    """Parameter names of a publication, by Taskcal's names."""
    published: Published
    description: Mapping[str, Any]
    """Content of the robot file, so that a calibration can carry its robot."""
    model_error: ModelError | None = None
    """What geometry does not explain; None where the file does not say."""
    links: tuple[str, str] | None = None
    """What other descriptions of the robot call the links of its base and of its tool; None where the file does not say."""

    def __repr__(self) -> str:
        prismatic = sum(self.prismatic)
        slides = f", {prismatic} sliding" if prismatic else ""
        loop = ", four-bar" if self.four_bar else ""
        return f"Robot({shortened(self.name, 80)}: {len(self.joints)} joints{slides}{loop}, reach {self.reach:.2f} m)"

    @cached_property
    def digest(self) -> str:
        """Hash of the description, for provenance."""
        return hashlib.sha256(json.dumps(self.description, sort_keys=True).encode()).hexdigest()[:16]

    @cached_property
    def joint_side(self) -> JointSide:
        """Couplings and four-bar together, as the compiled passes take them."""
        return JointSide(joint_map=self.joint_map, four_bar=self.four_bar)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the controller's joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names of the joints in columns of files: by their number where the name is that of a measured point's column."""
        return tuple(
            f"q{k}" if name.casefold() in POINT_COLUMNS else name for k, name in enumerate(self.joint_names, start=1)
        )

    @property
    def limits(self) -> Float[np.ndarray, "joints 2"]:
        """Lower and upper limit of every joint, radians or metres."""
        return np.array([joint.limits for joint in self.joints])

    def bounded_limits(self, turn: float = np.pi) -> Float[np.ndarray, "joints 2"]:
        """Limits between which postures are sought, radians or metres.

        Args:
            turn: of a joint that turns, to either side of zero at most, radians.
        """
        low, high = self.limits.T
        far = np.where(self.prismatic, UNLIMITED_SLIDE_M, turn)
        low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2.0 * far, -far))
        high = np.where(np.isfinite(high), high, low + 2.0 * far)
        within = np.clip(low, -turn, turn), np.clip(high, -turn, turn)
        beyond = np.array(self.prismatic) | (within[0] >= within[1])
        return np.column_stack([np.where(beyond, low, within[0]), np.where(beyond, high, within[1])])

    @cached_property
    def driven(self) -> tuple[DrivenJoint, ...]:
        """Joints that others move, in the order of the chain."""
        parts = [part for joint in self.joints for part in (*joint.before, *joint.after)] + list(self.tool)
        return tuple(part.driven for part in parts if part.driven is not None)

    @property
    def has_linkage(self) -> bool:
        """Whether a four-bar or driven joints move parts with others."""
        return self.four_bar is not None or bool(self.driven)

    @property
    def T_flange_tool(self) -> Float[np.ndarray, "4 4"]:
        """Nominal pose of the robot's own tool in the controller's flange."""
        return se3.inverse(_product(self.flange)) @ _product(self.tool)

    @property
    def speed_limits(self) -> Float[np.ndarray, " joints"]:
        """Largest speed of every joint, radians or metres per second; infinite where not stated."""
        return np.array([joint.speed for joint in self.joints])

    @property
    def acceleration_limits(self) -> Float[np.ndarray, " joints"]:
        """Largest acceleration of every joint, radians or metres per second squared; infinite where not stated."""
        return np.array([joint.acceleration for joint in self.joints])

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Whether each joint is a sliding one, its positions metres."""
        return tuple(joint.kind == "prismatic" for joint in self.joints)

    @property
    def reach(self) -> float:
        """Sum of the lengths of all fixed parts and sliding ranges, metres: no point of the tool is farther away.

        The range of a joint without limits is that in which postures are sought.
        """
        parts = [p for joint in self.joints for p in (*joint.before, *joint.after)] + list(self.tool)
        slides = np.abs(self.bounded_limits()[list(self.prismatic)]).max(axis=1, initial=0.0).sum()
        return float(sum(np.linalg.norm(p.transform[:3, 3]) for p in parts) + slides)

    def steps(self) -> list[Step]:
        """The nominal chain, from base to tool."""
        out: list[Step] = []
        for joint in self.joints:
            out += [part.step for part in joint.before]
            out.append(Joint(joint.kind))
            out += [part.step for part in joint.after]
        return out + [part.step for part in self.tool]

    def joint_frames(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints 4 4"]:
        """Nominal frames behind each joint in the base.

        Args:
            q: controller joint positions, radians (metres where a joint slides).

        Raises:
            ClosureError: the four-bar cannot be assembled at some pose.
        """
        s = self._coordinates(q)
        return np.stack([walk.poses(chain, s, np.zeros((0, 6))) for chain in self._joint_chains], axis=1)

    def tool_poses(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Nominal poses of the tool in the base; arguments and errors as of `joint_frames`, and of `check_radians`."""
        self.check_radians(q)
        return walk.poses(Chain.of(self.steps()), self._coordinates(q), np.zeros((0, 6)))

    @cached_property
    def _joint_chains(self) -> tuple[Chain, ...]:
        """Chains from the base through each joint."""
        steps = self.steps()
        own = [k for k, step in enumerate(steps) if isinstance(step, Joint) and step.number is None]
        return tuple(Chain.of(steps[: k + 1]) for k in own)

    def _coordinates(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n coordinates"]:
        """Nominal chain coordinates at joint positions, those of driven joints included."""
        q, count = np.ascontiguousarray(q, dtype=float), len(self.joints) + len(self.driven)
        return self.joint_side.at(q, np.zeros(3), np.zeros(0, dtype=bool), count)[0]

    def _limited(self) -> list[tuple[str, Float[np.ndarray, " joints"], tuple[float, float], bool]]:
        """Name, coefficients, limits and whether it slides, of every joint and coupled limit."""
        own = [
            (j.name, np.eye(len(self.joints))[i], j.limits, j.kind == "prismatic") for i, j in enumerate(self.joints)
        ]
        return own + [(c.text, c.coefficients, c.limits, False) for c in self.coupled_limits]

    def inside_limits(self, q: Float[np.ndarray, "n joints"], slack: float = 1e-6) -> Bool[np.ndarray, " n"]:
        """Whether each pose is inside all limits; `slack` forgives rounding, radians or metres."""
        inside = np.ones(len(q), dtype=bool)
        for _, coefficients, (low, high), _ in self._limited():
            value = q @ coefficients
            inside &= (value >= low - slack) & (value <= high + slack)
        return inside

    def outside_limits(self, q: Float[np.ndarray, "n joints"], slack: float = 1e-6) -> list[tuple[int, str]]:
        """Rows of q outside a limit, with the reason in words; `slack` forgives rounding, radians or metres."""
        out: list[tuple[int, str]] = []
        for name, coefficients, (low, high), slides in self._limited():
            value = q @ coefficients
            scale = 1e3 if slides else 180 / np.pi
            for row in np.flatnonzero((value < low - slack) | (value > high + slack)):
                said = {"name": name, "value": value[row] * scale, "low": low * scale, "high": high * scale}
                if slides:
                    reason = Said("{name} = {value:.3f} mm is outside {low:g} to {high:g} mm", **said)
                else:
                    reason = Said("{name} = {value:.3f}° is outside {low:g} to {high:g}°", **said)
                out.append((int(row), reason))
        return sorted(out)

    def check_shape(self, q: Float[np.ndarray, "n joints"]) -> None:
        """Refuse joint positions of another number of joints.

        Raises:
            WrongValue: they are.
        """
        if q.ndim != 2 or q.shape[1] != len(self.joints):
            raise WrongValue(f"q has shape {q.shape}; {self.name} needs (n, {len(self.joints)}), in radians")

    def check_radians(self, q: Float[np.ndarray, "n joints"]) -> None:
        """Refuse joint positions that can only be degrees: more than two turns, and beyond the joint's limits.

        Raises:
            WrongValue: as `check_shape`.
            ReachError: one can only be degrees; the message names it.
        """
        self.check_shape(q)
        if not len(q) or np.abs(q).max() <= TWO_TURNS:
            return
        low, high = self.limits.T
        wrong = (np.abs(q) > TWO_TURNS) & ((q < low) | (q > high)) & ~np.array(self.prismatic)
        if wrong.any():
            row, joint = np.argwhere(wrong)[0]
            raise ReachError(
                f"{self.name}: pose {row}: {self.joints[joint].name} = {q[row, joint]:g} rad is more than two turns and beyond its "
                "limits; these look like degrees: give radians, np.radians(q)"
            )

    def check_limits(self, q: Float[np.ndarray, "n joints"]) -> None:
        """Raise a `ReachError` that names the first pose outside the limits and how many there are."""
        outside = self.outside_limits(q)
        if outside:
            row, reason = outside[0]
            rows = len({r for r, _ in outside})
            raise ReachError(f"{self.name}: pose {row}: {reason} ({rows} of {len(q)} poses are outside limits)")


def _product(parts: tuple[Part, ...]) -> Float[np.ndarray, "4 4"]:
    T = np.eye(4)
    for part in parts:
        T = T @ part.transform
    return T
