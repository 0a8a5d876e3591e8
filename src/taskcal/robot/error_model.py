"""The error model: one parameter for every defect that the mechanism leaves free."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.arguments import checked, joints_checked, repeated
from taskcal.errors import TaskcalError, UnknownName
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, ErrorFrame, Joint, Step
from taskcal.kernels.chunks import in_chunks
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Effect, LinearTerm
from taskcal.robot.effects.base import terms_on
from taskcal.robot.joint_side import FourBarDrive, Slope, Walk
from taskcal.robot.parameter import Parameter, parameters_of
from taskcal.robot.robot import Part, Robot
from taskcal.robot.statics import Load

# Where a robot's chain has error frames, and which of their slots are parameters.

COMPONENTS = ("tx", "ty", "tz", "rx", "ry", "rz")

EXACT = 2e-9
"""Tolerance, metres or radians, up to which a parameter is taken for exact: those of a wrist whose pose is given have 1 nm."""


def error_steps(robot: Robot, *, lengths_only: bool) -> tuple[list[Step], list[list[str]]]:
    """Steps of the chain with its error frames, and the names of each frame's six slots; empty ones are no parameters.

    An error frame follows every joint, driven ones included, and the tool; or, with ``lengths_only``, every nominal length,
    of which only the length's own slot has a name.
    """
    steps: list[Step] = []
    slots: list[list[str]] = []

    def defect(name: str) -> None:
        if not lengths_only:
            steps.append(ErrorFrame())
            slots.append([f"{name}.{c}" for c in COMPONENTS])

    def add(parts: tuple[Part, ...]) -> None:
        for part in parts:
            steps.append(part.step)
            if part.driven is not None:
                defect(part.driven.name)
            if lengths_only and part.symbol:
                steps.append(ErrorFrame())
                slots.append([part.symbol if c == part.axis else "" for c in range(6)])

    for joint in robot.joints:
        add(joint.before)
        steps.append(Joint(joint.kind))
        defect(joint.name)
        add(joint.after)
    if lengths_only:  # a length of the tool is no dimension of the robot
        steps += [part.step for part in robot.tool]
    else:
        add(robot.tool)
    defect("tool")
    return steps, slots


Prepared = tuple[Float[np.ndarray, "_ _"] | None, ...]


class SymbolicCoordinates(NamedTuple):
    """Chain coordinates as expressions."""

    still: Any
    """Without what effects add."""
    moved: Any
    factors: list[Any]
    """Movement of a coordinate for a unit of each parameter of an effect, by the pairs of its term."""
    kept: list[Any]
    """What is positive where the closed loop assembles as it was built."""


@joints_checked
class ErrorModel:
    """Six geometric errors per joint frame, six of the tool, and those of the lengths of a closed loop.

    The error frame of a joint follows its rotation: E = T(tx, ty, tz)·Rx·Ry·Rz in the joint's own frame; the tool's
    follows the tool's transform. With ``lengths_only`` the model has the robot's nominal dimensions as its only
    parameters.

    Args:
        robot: the robot.
        lengths_only: the nominal lengths instead of the defects.
    """

    robot: Robot
    lengths_only: bool
    parameters: tuple[Parameter, ...]
    """In the order of every x, column and covariance."""
    steps: tuple[Step, ...]
    """The chain from base to tool, with its error frames."""
    terms: tuple[FourBarDrive | LinearTerm, ...]
    """On the joint side: the four-bar, if there is one, and the effects."""

    effects: tuple[Effect, ...]
    """Those that were added to the robot's own terms."""
    effect_names: tuple[str, ...]
    """Names of their parameters."""
    effect_terms: tuple[LinearTerm, ...]
    """What each does on this robot."""

    @checked
    def __init__(self, robot: Robot, *, lengths_only: bool = False, effects: Sequence[Effect] = ()):
        self.robot = robot
        self.lengths_only = lengths_only
        self.effects = tuple(effects)
        if self.effects and robot.driven:
            raise TaskcalError(
                f"{robot.name} has joints that others drive ({robot.driven[0].name}); how effects pass through their linkage is "
                "not modelled: identify it without effects"
            )
        steps, slots = error_steps(robot, lengths_only=lengths_only)
        added, self.steps = terms_on(self.effects, robot, steps)
        self._idle = tuple(term.nominal is None for term in added)
        self.effect_names = tuple(name for term in added for name in term.names)
        self.terms = (*(() if robot.four_bar is None else (robot.four_bar,)), *added)
        self.effect_terms = tuple(added)
        named = [(f, c, name) for f, frame in enumerate(slots) for c, name in enumerate(frame) if name]
        units = ["m" if c < 3 else "rad" for _, c, _ in named]
        names = [name for _, _, name in named]
        self._frame_slots = np.full((len(slots), 6), -1)
        for k, (f, c, _) in enumerate(named):
            self._frame_slots[f, c] = k
        self._frame_count = len(names)
        estimated = added if lengths_only else self.terms
        self._fixed_terms = len(self.terms) - len(estimated)
        for term in estimated:
            names += term.names
            units += term.units
        stated = {name: t for term in added for name, t in zip(term.names, term.tolerances, strict=True)}
        if twice := repeated(names):
            raise TaskcalError(f"two effects have a parameter '{min(twice)}'; add each effect once")
        self.parameters = parameters_of(robot, names, units, stated)
        unknown = set(robot.tolerances.overrides) - set(names)
        if unknown and not lengths_only:
            raise UnknownName("parameter", min(unknown), names, f"(a tolerance of {robot.name})")

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse changes once the model is made: its chain and parameters would not follow.

        Raises:
            AttributeError: always then.
        """
        if "parameters" in vars(self):
            raise AttributeError(f"{name} of {self!r} cannot be set; model + effect is a model with one more effect")
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        return f"ErrorModel({self.robot.name}: {len(self.parameters)} parameters)"

    def __len__(self) -> int:
        return len(self.parameters)

    def __add__(self, effect: Effect) -> "ErrorModel":
        """The model with one more effect on the joint side."""
        return ErrorModel(self.robot, lengths_only=self.lengths_only, effects=(*self.effects, effect))

    @cached_property
    def conditioned(self) -> bool:
        """Whether an effect depends on how a pose is reached."""
        return any(term.given is not None for term in self.effect_terms)

    @cached_property
    def nominal(self) -> "ErrorModel":
        """A model with the same poses where every parameter is zero: without the effects that are nothing there."""
        if not any(self._idle):
            return self
        known = [effect for effect, idle in zip(self.effects, self._idle, strict=True) if not idle]
        return ErrorModel(self.robot, lengths_only=self.lengths_only, effects=known)

    def under(self, load: Load) -> "ErrorModel":
        """Return the model for another load, such as a payload or a process force, with the same parameters.

        A compliance that was identified under one load so predicts what another one does.

        Args:
            load: payload, force and moment.

        Raises:
            TaskcalError: the model has no `Compliance`, or the robot file states no masses.
        """
        loaded = [effect.under(load) for effect in self.effects]
        if all(effect is None for effect in loaded):
            raise TaskcalError("the model does not yield to loads; add Compliance() to it before it is identified")
        effects = [other or effect for other, effect in zip(loaded, self.effects, strict=True)]
        return ErrorModel(self.robot, lengths_only=self.lengths_only, effects=effects)

    def prepare(self, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None) -> Prepared:
        """Factors of `walk` at joint positions q under conditions, which no parameter changes; None for the four-bar."""
        loop = [None] * (len(self.terms) - len(self.effect_terms))
        return (*loop, *(term.prepare(q, conditions) for term in self.effect_terms))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameter names, in order."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def tolerances(self) -> Float[np.ndarray, " p"]:
        """Tolerance of every parameter (1σ), metres and radians."""
        return np.array([p.tolerance for p in self.parameters])

    @cached_property
    def chain(self) -> Chain:
        """The chain as arrays."""
        return Chain.of(self.steps)

    def indices(self, names: Iterable[str]) -> Int[np.ndarray, " kept"]:
        """Positions of the named parameters, in the model's order.

        A name may also be a symbol of the robot file, or a joint's or ``tool``, which stands for its six parameters.

        Raises:
            UnknownName: no such parameter.
        """
        chosen: set[int] = set()
        for name in names:
            wanted = self._named(name)
            if not name or not wanted:
                joints = self.robot.joint_names
                hint = f"in {self.robot.name}; joint frames run from {joints[0]} to {joints[-1]}, then tool"
                raise UnknownName("parameter", name, self.names, hint + (" and loop" if self.robot.four_bar else ""))
            chosen.update(wanted)
        return np.array(sorted(chosen), dtype=np.int64)

    def _named(self, name: str) -> list[int]:
        """Positions of the parameters that a name stands for."""
        return [i for i, p in enumerate(self.parameters) if name in (p.name, p.symbol) or p.name.startswith(f"{name}.")]

    @cached_property
    def _pairs(self) -> Int[np.ndarray, "pairs 2"]:
        """Rows (chain coordinate, parameter) of all joint-side terms."""
        rows: list[np.ndarray] = [np.empty((0, 2), dtype=np.int64)]
        first = self._frame_count
        if first < len(self.parameters):
            for term in self.terms[self._fixed_terms :]:
                rows.append(term.pairs + np.array([0, first]))
                first += len(term.names)
        return np.concatenate(rows)

    def layout(
        self, columns: Sequence[int] | Int[np.ndarray, " p"] | None = None, count: int | None = None
    ) -> walk.Columns:
        """Columns of a walk: parameter k has column `columns[k]`, −1 for none; by default its own number."""
        target = np.arange(len(self.parameters)) if columns is None else np.asarray(columns)
        frames = np.where(self._frame_slots < 0, -1, target[self._frame_slots] if len(target) else -1)
        used = self._used_pairs(target)
        pairs = self._pairs[used]
        return walk.Columns(
            frames=np.ascontiguousarray(frames),
            joint=np.ascontiguousarray(pairs[:, 0]),
            column=np.ascontiguousarray(target[pairs[:, 1]]) if len(pairs) else pairs[:, 1].copy(),
            count=len(self.parameters) if count is None else count,
        )

    @cached_property
    def _layout(self) -> walk.Columns:
        return self.layout()

    def _used_pairs(self, target: np.ndarray) -> np.ndarray:
        return target[self._pairs[:, 1]] >= 0 if len(self._pairs) else np.zeros(0, dtype=bool)

    def error_frames(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, "frames 6"]:
        """Values of the chain's error frames at parameter values x."""
        e = np.zeros(self._frame_slots.shape)
        held = self._frame_slots >= 0
        e[held] = x[self._frame_slots[held]]
        return e

    def loop_deviations(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, " 3"]:
        """Deviations of the four-bar's crank, rod and rocker from nominal at parameter values x; zero where they are none."""
        estimated = self.robot.four_bar is not None and not self._fixed_terms
        return x[self._frame_count :][:3] if estimated else np.zeros(3)

    def coordinates(self, q: Any, x: Float[np.ndarray, " p"], loop: Any, conditions: Any = None) -> SymbolicCoordinates:
        """Chain coordinates at joint positions that are expressions.

        Args:
            q: joint positions, expressions (1, joints).
            x: parameter values, metres and radians.
            loop: the closed loop's lengths as of `JointSide.loop_numbers`, numbers or expressions.
            conditions: how the pose is reached, in expressions; nothing is known of it by default.

        Raises:
            TaskcalError: an effect decides by comparisons, or uses what is not analytic.
        """
        own, kept = self.robot.joint_side.traced(q, loop)
        still = np.concatenate([own[0], np.zeros(self.chain.joints - own.shape[1])])
        moved, factors, first = still.copy(), list[Any](), len(x) - len(self.effect_names)
        for effect, term in zip(self.effects, self.effect_terms, strict=True):
            try:
                given = term.given
                rows = term.basis(q) if given is None or conditions is None else given(q, conditions)
            except TypeError as error:
                raise TaskcalError(f"{effect.name} cannot be written as code: {error}") from error
            value = x[first : first + len(term.names)] + (0.0 if term.nominal is None else term.nominal)
            for factor, (coordinate, parameter) in zip(rows[0], term.pairs, strict=True):
                moved[coordinate] = moved[coordinate] + factor * value[parameter]
            factors += list(rows[0])
            first += len(term.names)
        return SymbolicCoordinates(still, moved, factors, kept)

    def walk(
        self,
        q: Float[np.ndarray, "n joints"],
        x: Float[np.ndarray, " p"] | None = None,
        columns: Int[np.ndarray, " p"] | None = None,
        prepared: Prepared | None = None,
    ) -> Walk:
        """Chain coordinates, error frames and joint-side factors at q and x; factors for the layout of `columns`.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        q = np.ascontiguousarray(q, dtype=float)
        self.robot.check_shape(q)
        x = np.zeros(len(self.parameters)) if x is None else np.asarray(x, dtype=float)
        if x.shape != (len(self.parameters),):
            raise ValueError(
                f"x has shape {x.shape}; {self!r} needs ({len(self.parameters)},), in the order of its names"
            )
        used = self._used_pairs(np.arange(len(x)) if columns is None else columns)
        loop, first, pair = self.robot.four_bar, self._frame_count, 0
        xi, slopes = self.loop_deviations(x), list[Slope]()
        if loop is not None:
            if not self._fixed_terms:
                first, pair = first + 3, len(loop.wanted.which)
            slopes.append(lambda: loop.slope(q, xi))
        s, factor = self.robot.joint_side.at(q, xi, used[:pair], self.chain.joints)
        factors = [factor]
        for i, term in enumerate(self.effect_terms, start=len(slopes)):
            shift = term.shift(q, x[first : first + len(term.names)], None if prepared is None else prepared[i])
            s[:, : shift.value.shape[1]] += shift.value
            slopes.append(shift.slope)
            factors.append(shift.jacobian[:, used[pair : pair + len(term.pairs)]])
            first, pair = first + len(term.names), pair + len(term.pairs)
        if len(factors) > 1:
            factor = np.concatenate(factors, axis=1)
        return Walk(s=s, e=self.error_frames(x), factor=factor, slopes=tuple(slopes))

    @checked
    def poses(
        self,
        q: Float[np.ndarray, "n joints"],
        x: Float[np.ndarray, " p"] | None = None,
        conditions: Conditions | None = None,
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the base.

        Args:
            q: controller joint positions, radians (metres where a joint slides).
            x: parameter values in the order of `names`, metres and radians; the nominal robot by default.
            conditions: how the poses are reached, for effects that depend on it; as in the middle by default.

        Raises:
            ReachError: joint positions that can only be degrees.
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        if x is None and self.nominal is not self:
            return self.nominal.poses(q, None, conditions)
        q = np.asarray(q, dtype=float)
        self.robot.check_radians(q)
        out = np.empty((len(q), 4, 4))

        def fill(rows: slice) -> None:
            prepared = None if conditions is None else self.prepare(q[rows], conditions.take(rows))
            at = self.walk(q[rows], x, prepared=prepared)
            walk.poses(self.chain, at.s, at.e, out=out[rows])

        in_chunks(fill, len(q))
        return out

    @checked
    def jacobian(
        self,
        q: Float[np.ndarray, "n joints"],
        x: Float[np.ndarray, " p"] | None = None,
        *,
        angular: bool = True,
        out: Float[np.ndarray, "n rows p"] | None = None,
    ) -> Float[np.ndarray, "n rows p"]:
        """Derivative of the tool pose with respect to every parameter: rows vx vy vz wx wy wz in base axes.

        Args:
            q: controller joint positions, radians (metres where a joint slides).
            x: parameter values, metres and radians; the nominal robot by default.
            angular: all six rows, else the three of the TCP.
            out: where to write them, best what an earlier call gave; new memory takes as long as the sensitivities do.

        Raises:
            ClosureError: a closed loop cannot be assembled at some pose.
        """
        q, layout = np.asarray(q, dtype=float), self._layout
        self.robot.check_radians(q)
        room = walk.allocate_columns(layout, len(q), angular=angular, out=out)

        def fill(rows: slice) -> None:
            at = self.walk(q[rows], x)
            walk.columns(self.chain, at.s, at.e, layout, at.factor, angular=angular, out=room[rows])

        in_chunks(fill, len(q))
        return room

    def joint_jacobian(
        self, q: Float[np.ndarray, "n joints"], x: Float[np.ndarray, " p"] | None = None
    ) -> Float[np.ndarray, "n 6 joints"]:
        """Derivative of the tool pose with respect to the controller's joints: rows vx vy vz wx wy wz in base axes."""
        at = self.walk(q, x)
        layout = self.chain.joint_columns
        ones = np.ones((len(at.s), self.chain.joints))
        by_coordinate = walk.columns(self.chain, at.s, at.e, layout, ones, angular=True)
        return by_coordinate @ self.slope(at.slopes)

    def slope(self, slopes: Sequence[Slope]) -> Float[np.ndarray, "m coordinates joints"]:
        """∂s/∂q of the joint map and of some joint-side terms; m is 1 where none changes it from pose to pose."""
        matrix = self.robot.joint_map.matrix
        moved = [slope() for slope in slopes]
        out = np.zeros((max(map(len, moved), default=1), self.chain.joints, matrix.shape[1]))
        for part in (matrix[None], *moved):
            out[:, : part.shape[1]] += part
        return out
