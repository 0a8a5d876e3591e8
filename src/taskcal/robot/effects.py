"""Physical effects on the joint side that geometry does not have, each linear in its parameters: δs = Φ(q)·ξ.

`model + Compliance()` adds one to a model. Its parameters are then identified, analysed and planned for like any other.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import TaskcalError, UnknownName
from taskcal.geometry import walk
from taskcal.geometry.chain import Chain, Joint
from taskcal.robot.joint_side import Shift
from taskcal.robot.robot import Robot

Basis = Callable[[np.ndarray], np.ndarray]

DEFLECTION = 3e-4
"""Default tolerance of a joint's deflection, radians: what gears and bearings of an industrial robot leave."""

GRAVITY = np.array([0.0, 0.0, -1.0])
"""Direction of gravity in the base of a robot that stands upright."""

SAME = 1e-6
"""Share of a column under which what is left of it is nothing of its own."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearTerm:
    """A joint-side term that is linear in its parameters."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    tolerances: tuple[float, ...]
    """Standard deviations expected of the parameters, in their units."""
    pairs: Int[np.ndarray, "pairs 2"]
    """Which chain coordinate each parameter moves: rows (coordinate, parameter)."""
    coordinates: int
    basis: Basis
    """Joint positions (n, joints) to ∂δs/∂ξ of every pair (n, pairs)."""

    def prepare(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n pairs"]:
        """The factors at joint positions q, which no parameter changes."""
        return np.ascontiguousarray(self.basis(q))

    def shift(
        self,
        q: Float[np.ndarray, "n joints"],
        xi: Float[np.ndarray, " p"],
        prepared: Float[np.ndarray, "n pairs"] | None = None,
    ) -> Shift:
        """δs at joint positions q and parameters ξ."""
        factor = self.prepare(q) if prepared is None else prepared
        place = np.zeros((len(self.pairs), self.coordinates))
        place[np.arange(len(self.pairs)), self.pairs[:, 0]] = xi[self.pairs[:, 1]]
        return Shift(value=factor @ place, factor=factor, slope=lambda: self._slope(q, place))

    def _slope(
        self, q: Float[np.ndarray, "n joints"], place: Float[np.ndarray, "pairs coordinates"]
    ) -> Float[np.ndarray, "n coordinates joints"]:
        """∂δs/∂q by central differences: an effect is small, and so is what its slope adds to a Newton step."""
        out = np.zeros((len(q), self.coordinates, q.shape[1]))
        for j in range(q.shape[1]):
            step = np.zeros(q.shape[1])
            step[j] = 1e-5
            out[:, :, j] = (self.basis(q + step) - self.basis(q - step)) @ place / 2e-5
        return out


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


@dataclass(frozen=True, kw_only=True)
class Harmonics(Effect):
    """Gear and encoder eccentricity: cosine and sine of each joint's own angle and its multiples.

    A compensating spring on an axis is of this shape too.
    """

    orders: tuple[int, ...] = (1, 2)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.cos1``, ``J2.sin1`` …, radians."""
        turning = [j for j in self.chosen(robot) if not robot.prismatic[j]]
        shapes = [(j, order, part) for j in turning for order in self.orders for part in ("cos", "sin")]
        columns = np.array([j for j, _, _ in shapes], dtype=np.int64)
        orders = np.array([order for _, order, _ in shapes])
        phases = np.array([0.0 if part == "cos" else 0.5 * np.pi for _, _, part in shapes])
        return _term(
            [f"{robot.joint_names[j]}.{part}{order}" for j, order, part in shapes],
            robot,
            columns,
            [self.tolerance] * len(shapes),
            lambda q: np.cos(robot.joint_map(q)[:, columns] * orders - phases),
        )


@dataclass(frozen=True, kw_only=True)
class EncoderGain(Effect):
    """A scale error of each joint: the joint turns a little more or less than the controller says."""

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.gain``, radians per radian."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        middle = robot.joint_map(np.zeros((1, len(robot.joints))))[0]
        return _term(
            [f"{robot.joint_names[j]}.gain" for j in joints],
            robot,
            joints,
            [self.tolerance] * len(joints),
            lambda q: (robot.joint_map(q) - middle)[:, joints],
        )


@dataclass(frozen=True, kw_only=True)
class Compliance(Effect):
    """Drives that yield under the weight of what they carry.

    The torque that unit weights at the later joints and at the tool point put on a motor is, by virtual work, their
    downward movement for a turn of that motor alone. That follows the true load path: through a parallelogram's rod the
    forearm's moment goes to the motor of its crank, whose absolute angle yields, and the lower arm's motor carries its
    weight but not its moment. A coupling without a four-bar is the controller's way of counting, and each drive yields
    about its own axis. Each parameter is the product of compliance and weight at one point, so neither must be known.
    """

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.sag_J4`` (weight at the origin of joint 4) … ``J2.sag_tool``, radians per metre of lever."""
        joints = len(robot.joints)
        levers = _Levers.of(robot)
        rng = np.random.default_rng(0)
        limits = np.clip(robot.limits, -1.5, 1.5)
        sample = rng.uniform(limits[:, 0], limits[:, 1], (64, joints))
        closing = levers.at(_closing(robot, sample))
        kept: list[tuple[int, int]] = []
        for j in self.chosen(robot):
            own: list[np.ndarray] = []
            for point in range(closing.shape[1]):
                column = closing[:, point, j]
                if _is_new(column, own):
                    own.append(column)
                    kept.append((j, point))
        labels = [*robot.joint_names, "tool"]
        motor = np.array([j for j, _ in kept], dtype=np.int64)
        point = np.array([p for _, p in kept], dtype=np.int64)
        drive = _drive(robot)
        moved = [(c, k) for k, j in enumerate(motor) for c in np.flatnonzero(drive[:, j])]
        coordinate, parameter = (np.array(column, dtype=np.int64) for column in zip(*moved, strict=True))
        gear = drive[coordinate, motor[parameter]]
        return LinearTerm(
            names=tuple(f"{robot.joint_names[j]}.sag_{labels[p]}" for j, p in kept),
            units=("rad",) * len(kept),
            tolerances=(self.tolerance,) * len(kept),
            pairs=np.stack([coordinate, parameter], axis=1),
            coordinates=joints,
            basis=lambda q: levers.at(q)[:, point[parameter], motor[parameter]] * gear,
        )


EFFECTS: Mapping[str, type[Effect]] = {kind.__name__: kind for kind in (Harmonics, EncoderGain, Compliance)}


def effect_from(data: Mapping[str, Any]) -> Effect:
    """The effect that `Effect.to_json` described.

    Raises:
        UnknownName: a kind that does not exist.
    """
    kind = str(data["kind"])
    if kind not in EFFECTS:
        raise UnknownName("effect", kind, EFFECTS)
    options: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items() if k != "kind"}
    return EFFECTS[kind](**options)


def _term(
    names: Sequence[str], robot: Robot, coordinates: Int[np.ndarray, " p"], tolerances: Sequence[float], basis: Basis
) -> LinearTerm:
    """A term of which each parameter moves one coordinate."""
    slides = [robot.prismatic[c] for c in coordinates]
    return LinearTerm(
        names=tuple(names),
        units=tuple("m" if slide else "rad" for slide in slides),
        tolerances=tuple(tolerances),
        pairs=np.stack([coordinates, np.arange(len(names))], axis=1),
        coordinates=len(robot.joints),
        basis=basis,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Levers:
    """How far points of the robot go down for a turn of each motor."""

    robot: Robot
    chains: tuple[Chain, ...]
    """From the base to the origin of each joint but the first, and to the tool."""

    @classmethod
    def of(cls, robot: Robot) -> "_Levers":
        steps = robot.steps()
        joints = [k for k, step in enumerate(steps) if isinstance(step, Joint)]
        return cls(robot=robot, chains=tuple(Chain.of(steps[:k]) for k in (*joints, len(steps))))

    def at(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n points joints"]:
        """∂(height)/∂q of every point, metres per radian; a weight of one newton makes that torque, in newton metres."""
        robot = self.robot
        q = np.asarray(q, dtype=float)
        s, by_q = robot.joint_map(q), _drive(robot)
        if robot.four_bar is not None:
            shift = robot.four_bar.shift(q, np.zeros(3))
            s, by_q = s + shift.value, by_q + shift.by_joint
        out = np.zeros((len(q), len(self.chains), q.shape[1]))
        for k, chain in enumerate(self.chains):
            if not chain.joints:
                continue
            own = np.ascontiguousarray(s[:, : chain.joints])
            layout = walk.Columns.of_joints(chain)
            J = walk.columns(chain, own, np.zeros((0, 6)), layout, np.ones_like(own), angular=False)
            down = np.einsum("i,nij->nj", GRAVITY, J)
            full = np.zeros((len(q), robot.joint_map.matrix.shape[0]))
            full[:, : chain.joints] = down
            out[:, k] = full @ by_q if by_q.ndim == 2 else np.einsum("nc,ncj->nj", full, by_q)
        return out


def _drive(robot: Robot) -> Float[np.ndarray, "coordinates motors"]:
    """Coordinates that the turn of each motor moves, its four-bar taken for a parallelogram."""
    return np.eye(len(robot.joints)) if robot.four_bar is None else robot.joint_map.matrix


def _closing(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "k joints"]:
    """Those of some positions that are inside the limits, where loops close."""
    inside = q[robot.inside_limits(q)]
    return inside if len(inside) > 16 else q


def _is_new(column: Float[np.ndarray, " n"], others: list[Float[np.ndarray, " n"]]) -> bool:
    """Whether a column says something that a combination of the others does not."""
    size = float(np.linalg.norm(column))
    if size < SAME * np.sqrt(len(column)):
        return False
    if not others:
        return True
    basis = np.stack(others, axis=1)
    rest = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
    return float(np.linalg.norm(rest)) > SAME * size
