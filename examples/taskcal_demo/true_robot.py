"""A true robot that no model of the fit describes: what it is made of, how large each part is, and why.

Nobody has published these of one machine. They are assumptions, as far as possible inside what catalogues allow:

- Defects of geometry: as the robot file states them, 0.3 mm and 0.3 mrad (1σ).
- Weights, drives and spring: as in `elastic_robot`.
- Links: main bearings of gears of this size turn by some 10⁻⁷ rad for a newton metre across their axis, a cast box beam of
  0.25 m and 20 mm wall by 4·10⁻⁸ over its length. Links and bearings together move the tool about a quarter as far as the
  drives do; 30 % more or less (1σ).
- Gears: 50 µrad (1σ) in the cosine and the sine of orders 1 and 2, and a ripple of an order between 8 and 45, of 10 µrad and
  half of it in its double. Catalogues allow one arc minute in all, 290 µrad from peak to peak, which the low orders use up.
  Twice the ripple is as plausible and leaves nearly twice the error: the order is the tooth's, and 60 poses do not find it.
- Lost motion: half of it 15 µrad (1σ) in the large axes and 30 µrad in the wrist. Catalogues allow half an arc minute, five to
  ten times as much, which a machine that repeats to 0.1 mm from all sides cannot have.
- Thermal expansion: iron, 10⁻⁵ per kelvin, that warms by 8 K (1σ) at work, each link in its own time.
- Tracker: as `TrackerNoise` states it.

Two unkind truths lie outside of this: axes that wobble besides (`AxisWobble`), and everything twice as large.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, Fixed, Joint, Step
from taskcal.robot.conditions import Conditions, drive_motion
from taskcal.robot.effects import Backlash, Compliance, Harmonics
from taskcal.robot.effects.base import Effect, LinearTerm, Quantity
from taskcal.robot.effects.load_path import LoadPath, motor_matrix
from taskcal.robot.effects.thermal import DRIFT, ThermalExpansion
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from
from taskcal.robot.statics import STANDARD_GRAVITY
from taskcal.virtual.cell import draw_defects

# Links that bend, twist and stretch under the weight they carry: what joints alone cannot yield to.

AXES = 6
"""Ways in which a link's end yields: along x, y, z and about them."""

TILTS = (3, 4)
"""Those of them that tilt an axis along z."""


@dataclass(frozen=True, kw_only=True)
class ElasticLinks(Effect, abstract=True):
    """The end of a link shifts by the force, and turns by the moment, that it carries there.

    For virtual robots only: it is not registered, so that no fit ever tries it.
    """

    turns: tuple[float, ...]
    """Of the ends of the first links, the stand before axis 1 being the first, radians per newton metre; with the bearing."""
    shifts: tuple[float, ...]
    """Of the same, metres per newton."""
    spread: float = 0.3
    """Standard deviation of both from robot to robot, as a share."""

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.turn`` and ``J2.shift``, of what carries axis 2: deviations from the stated compliance."""
        count, first = len(self.turns), len(robot.joints)
        names = [f"{robot.joint_names[link]}.{part}" for link in range(count) for part in ("shift", "turn")]
        nominal = np.stack([self.shifts, self.turns], axis=1).ravel()
        pairs = [(first + AXES * link + c, 2 * link + (c >= 3)) for link in range(count) for c in range(AXES)]
        return LinearTerm(
            names=tuple(names),
            units=("m/N", "rad/Nm") * count,
            tolerances=tuple((self.spread * nominal).tolist()),
            pairs=np.array(pairs),
            coordinates=first + AXES * count,
            basis=lambda q: carried(robot, count, q),
            nominal=nominal,
        )

    def extend(self, robot: Robot, steps: Sequence[Step]) -> tuple[Step, ...]:
        """Three slides and three turns before each of the first axes."""
        return _before_axes(robot, steps, len(self.turns), range(AXES))


def carried(robot: Robot, count: int, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n columns"]:
    """Force and moment that the end of each of the first links carries, in the frame of the axis there, N and Nm."""
    coordinates = LoadPath.at(robot, q).coordinates
    steps: list[Step] = []
    ends: list[np.ndarray] = []
    bodies: list[tuple[float, np.ndarray]] = []

    def pose() -> Float[np.ndarray, "n 4 4"]:
        chain = Chain.of(steps)
        return walk.poses(chain, np.ascontiguousarray(coordinates[:, : chain.joints]), np.zeros((0, 6)))

    for joint, link in zip(robot.joints, robot.statics.links or (), strict=True):
        steps += [Fixed(part.transform) for part in joint.before]
        ends.append(pose())
        steps.append(Joint("prismatic" if joint.kind == "prismatic" else "revolute"))
        steps += [Fixed(part.transform) for part in joint.after]
        bodies.append((link.mass, se3.apply(pose(), np.array(link.centre))))
    steps += [Fixed(part.transform) for part in robot.flange]
    payload = robot.statics.payload
    bodies.append((payload.mass, se3.apply(pose(), np.array(payload.centre))))
    out: list[np.ndarray] = []
    for number, end in enumerate(ends[:count]):
        inward = np.swapaxes(end[:, :3, :3], 1, 2)
        force, moment = np.zeros((len(q), 3)), np.zeros((len(q), 3))
        for mass, centre in bodies[number:]:
            weight = mass * STANDARD_GRAVITY * robot.statics.gravity
            force += weight
            moment += np.cross(centre - end[:, :3, 3], weight)
        out += [np.einsum("nij,nj->ni", inward, force), np.einsum("nij,nj->ni", inward, moment)]
    return np.concatenate(out, axis=1)


def _before_axes(robot: Robot, steps: Sequence[Step], count: int, ways: Sequence[int]) -> tuple[Step, ...]:
    """The chain with joints before each of the first axes, one for each of `ways` in which the axis yields there."""
    out: list[Step] = []
    link = 0
    for step in steps:
        if isinstance(step, Joint):
            if link < count:
                out += _yielding(len(robot.joints) + len(ways) * link, ways)
            link += 1
        out.append(step)
    return tuple(out)


def _yielding(first: int, ways: Sequence[int]) -> list[Step]:
    """Slides along x, y and z, then turns about them, each in the frame where it stands; those of `ways` alone."""
    turned_to_z = (se3.rotation("y", np.pi / 2), se3.rotation("x", -np.pi / 2), np.eye(4))
    steps: list[Step] = []
    for number, c in enumerate(ways, first):
        R = turned_to_z[c % 3]
        steps += [Fixed(R), Joint("prismatic" if c < 3 else "revolute", number), Fixed(se3.inverse(R))]
    return steps


# An IRB 6660 that bends: weights, drives that yield, a spring on axis 2, and gears that err.
#
# Nobody has published these of the machine that was measured. They are assumed here, in the bounds that follow;
# none of them was tuned until a residual came out as published:
#
# - Weights: 850 kg that move, about half of a machine of 1.7 t, with a spindle of 120 kg where 205 kg may hang. -
# Stiffness: gears of this size have 300 to 1200 Nm per arc minute by their makers' catalogues, 1 to 4·10⁶ Nm/rad,
# and those of wrists a tenth to a fifth of it. On robots of 240 to 270 kg payload 10⁵ to some 10⁶ Nm/rad were
# found, the bearings' share included (Dumas, Caro, Garnier and Furet 2011; Klimchik, Wu, Dumas, Caro, Furet and
# Pashkevich 2013). - Spring: it takes half of the lower arm's load in the reference task. - Gears: gears of robots
# are allowed one arc minute, 290 µrad from peak to peak. Orders 1 and 2, cosine and sine, have 50 µrad each (1σ);
# what recurs 20 times in a turn has 30 µrad. Which orders a gear has depends on its make.

WEIGHTS = (
    (0.0, (0.0, 0.0, 0.0)),  # the first axis is upright: what turns with it loads no drive
    (250.0, (350.0, 0.0, 0.0)),
    (350.0, (100.0, 150.0, 0.0)),
    (80.0, (0.0, 0.0, -250.0)),
    (40.0, (0.0, 0.0, 0.0)),
    (10.0, (0.0, 0.0, 150.0)),
)
"""Mass in kg and centre in mm of what moves with each joint, in the joint's frame."""

SPINDLE = {"mass_kg": 120.0, "centre_mm": [50.0, 0.0, 120.0]}
SPRING = {
    "joint": "J2",
    "rate_n_mm": 40.0,
    "free_length_mm": 300.0,
    "crank_mm": 200.0,
    "anchor_mm": 700.0,
    "aligned_deg": 0.0,
}

STIFFNESS = 2e6
"""Of the drives of axes 1 to 3, Nm/rad, in the middle of the bounds on a logarithmic scale."""

WRIST = 0.2
"""Share of it that the drives of the wrist have."""

GEARS = Harmonics(tolerance=5e-5)
"""What the gears' class says of their eccentricity, known without any measurement."""

RIPPLE = Harmonics(orders=(20,), tolerance=3e-5)
"""What recurs several times in a turn; which order it has is not known to who calibrates."""


def elastic_robot(robot: Robot, stiffness: float = STIFFNESS) -> Robot:
    """The robot with weights, spring and drives that yield.

    Args:
        robot: an IRB 6660-205/1.9 without weights.
        stiffness: of the drives of axes 1 to 3, Nm/rad; those of the wrist have their share of it.
    """
    described = robot.description
    joints = [
        {**joint, "mass_kg": mass, "centre_mm": list(centre), "stiffness_nm_rad": stiffness * (1.0 if i < 3 else WRIST)}
        for i, (joint, (mass, centre)) in enumerate(zip(described["joint"], WEIGHTS, strict=True))
    ]
    return robot_from({**described, "joint": joints, "payload": SPINDLE, "spring": SPRING})


def elastic_model(robot: Robot, stiffness: float = STIFFNESS) -> ErrorModel:
    """The model from which true robots are drawn: defects and eccentric gears, and drives 30 % softer or stiffer (1σ).

    Args:
        robot: an IRB 6660-205/1.9 without weights.
        stiffness: as of `elastic_robot`.
    """
    return ErrorModel(elastic_robot(robot, stiffness)) + Compliance() + GEARS


# Gears that err with the turn of their own drive: eccentric, and with a ripple whose size changes over the turn.


@dataclass(frozen=True, kw_only=True)
class GearErrors(Effect, abstract=True):
    """Orders 1 and 2 of eccentric wheels, and a ripple of an order of each gear's own, with its double.

    The orders are those of the teeth, and no whole numbers; the ripple's size changes over the turn. The gear errs with
    the angle of its motor's output, which behind a four-bar is not that of the joint. For virtual robots only: it is not
    registered, so that no fit ever tries it.
    """

    orders: tuple[float, ...]
    """Of each gear's ripple, periods in a turn of its output."""
    swell: tuple[float, ...]
    """Where each gear's ripple is largest, radians."""
    depth: float = 0.5
    """By how much of its mean the ripple grows and falls over a turn."""
    eccentricity: float = 5e-5
    """Cosine and sine of orders 1 and 2 (1σ), radians."""
    ripple: float = 1e-5
    """Cosine and sine of the ripple's own order (1σ), radians; its double has half of it."""

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J1.once_cos`` …, ``J1.ripple_sin`` …, radians."""
        gears = len(robot.joints)
        kinds = ("once", "twice", "ripple", "double")
        sizes = (self.eccentricity, self.eccentricity, self.ripple, 0.5 * self.ripple)
        shapes = [(j, k, part) for j in range(gears) for k in range(len(kinds)) for part in (0, 1)]
        parameter, coordinate = np.nonzero(motor_matrix(robot)[:, [j for j, _, _ in shapes]].T)
        geared = motor_matrix(robot)[coordinate, np.array([j for j, _, _ in shapes])[parameter]]

        def basis(q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n pairs"]:
            own = np.array(self.orders)
            multiples = np.stack([np.ones(gears), np.full(gears, 2.0), own, 2.0 * own], axis=1)
            angle = q[:, :, None] * multiples
            size = 1.0 + self.depth * np.cos(q - np.array(self.swell))[:, :, None] * (np.arange(len(kinds)) >= 2)
            waves = np.stack([size * np.cos(angle), size * np.sin(angle)], axis=3)
            return waves.reshape(len(q), -1)[:, parameter] * geared

        return LinearTerm(
            names=tuple(f"{robot.joint_names[j]}.{kinds[k]}_{('cos', 'sin')[part]}" for j, k, part in shapes),
            units=("rad",) * len(shapes),
            tolerances=tuple(sizes[k] for _, k, _ in shapes),
            pairs=np.stack([coordinate, parameter], axis=1),
            coordinates=gears,
            basis=basis,
        )


# Axes that wobble: what no effect of a fit can express, for none tilts an axis with the position of its joint.


@dataclass(frozen=True, kw_only=True)
class AxisWobble(Effect, abstract=True):
    """Each axis tilts, about two directions across it, once and twice per turn and with the sum of its angle and the next joint's.

    Of the part once per turn, geometry expresses the half that turns with the link beyond; of the rest no effect of a fit
    does, all of which turn joints about their axes. For virtual robots only: it is not registered, so that no fit ever tries it.
    """

    tolerance: float = 5e-5
    """Cosine and sine of each tilt (1σ), radians: as the gears' eccentricity, 10 µm over a bearing's diameter of 0.2 m."""

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J1.tilt_x_cos_J1``, ``J1.tilt_y_sin_2J1``, ``J1.tilt_x_cos_J1J2`` …, radians."""
        joints, own = len(robot.joints), np.eye(len(robot.joints))
        angles = np.concatenate([own, 2.0 * own, own[:-1] + own[1:]])
        axis = np.array([*range(joints), *range(joints), *range(joints - 1)])
        names = robot.joint_names
        labels = [*names, *(f"2{n}" for n in names), *(f"{a}{b}" for a, b in pairwise(names))]
        shapes = [(k, across, part) for k in range(len(angles)) for across in (0, 1) for part in (0, 1)]
        of, across, part = np.array(shapes).T

        def basis(q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n pairs"]:
            return np.cos((q @ angles.T)[:, of] - 0.5 * np.pi * part)

        return LinearTerm(
            names=tuple(f"{names[axis[k]]}.tilt_{'xy'[a]}_{('cos', 'sin')[p]}_{labels[k]}" for k, a, p in shapes),
            units=("rad",) * len(shapes),
            tolerances=(self.tolerance,) * len(shapes),
            pairs=np.stack([joints + len(TILTS) * axis[of] + across, np.arange(len(shapes))], axis=1),
            coordinates=joints + len(TILTS) * joints,
            basis=basis,
        )

    def extend(self, robot: Robot, steps: Sequence[Step]) -> tuple[Step, ...]:
        """Two turns across each axis before it."""
        return _before_axes(robot, steps, len(robot.joints), TILTS)


# Lost motion as gears have it: after a reversal the joint falls behind little by little, not at once.

WIDTHS, SHARES = (2e-4, 1e-3, 5e-3), (0.5, 0.3, 0.2)
"""Half the way, radians of the joint, on which each share of the lost motion is taken up after a reversal."""


def lost_motion(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints"]:
    """Position of each drive within its lost motion, from −1 to 1, at joint positions reached one after another.

    Play operators of several widths, side by side (Prandtl and Ishlinskii); at the first position every drive is in the
    middle. Where only the direction counts, this is its sign.

    Args:
        robot: the robot.
        q: joint positions in the order in which they are reached, each joint turning in one direction between two, radians.
    """
    turn = np.diff(q @ drive_motion(robot).T, axis=0, prepend=(q @ drive_motion(robot).T)[:1])
    widths = np.array(WIDTHS)[:, None]
    state = np.zeros((len(WIDTHS), q.shape[1]))
    out = np.empty_like(q)
    for i, step in enumerate(turn):
        state = np.clip(state + step, -widths, widths)
        out[i] = np.array(SHARES) @ (state / widths)
    return out


# A robot whose links warm up each in its own time and by its own share.


LONG_S = 1e12
"""After which everything is as warm as it gets, seconds."""


@dataclass(frozen=True, kw_only=True)
class UnevenExpansion(ThermalExpansion, abstract=True):
    """Each named joint's length grows towards its own end, in its own time; the stand under the base is the slowest.

    For virtual robots only: it is not registered, so that no fit ever tries it.
    """

    tolerance: float = 8e-5
    """Expansion of every length until it is warm (1σ), metres per metre; the stand moves and tilts as much per metre."""
    time_constants: tuple[float, ...]
    """Of the stand, then of each named joint's length, seconds."""
    needs: ClassVar[tuple[Quantity, ...]] = ("time",)
    per: ClassVar[str] = ""
    least: ClassVar[float] = 0.0

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters of `ThermalExpansion`, each with its own course."""
        term = super().term(robot)
        gain = (
            term.given(np.zeros((1, len(robot.joints))), Conditions(time=np.array([LONG_S])))[0] if term.given else 0.0
        )
        constants = np.array([*[self.time_constants[0]] * len(DRIFT), *self.time_constants[1:]])

        def given(q: Float[np.ndarray, "n joints"], conditions: Conditions) -> Float[np.ndarray, "n pairs"]:
            if conditions.time is None:
                return term.basis(q)
            return gain * (1.0 - np.exp(-conditions.time[:, None] / constants))

        return replace(term, given=given)

    def rise(self, conditions: Conditions) -> Float[np.ndarray, " n"] | None:
        """Temperature rise of a robot that is warm throughout."""
        return None if conditions.time is None else np.ones(len(conditions.time))


LINK_TURNS = (1.2e-8, 3.5e-8, 6e-8, 1.5e-7)
"""Of what carries axes 1 to 4, its bearing included, radians per newton metre."""

LINK_SHIFTS = (3e-10, 1.2e-9, 4e-9, 8e-9)
"""Of the same, metres per newton."""

GROWING = ("J1", "J2", "J3")
"""Column, lower arm and forearm grow; the wrist has no length to speak of."""

TIME_CONSTANTS = (7200.0, 5400.0, 1500.0, 2700.0)
"""Of the stand and of these, seconds: the lower arm stands by three motors, the column by the cold floor."""

LOST, LOST_IN_WRIST = 1.5e-5, 3e-5
"""Half the lost motion (1σ), radians."""

RIPPLE_ORDERS = 8.0, 45.0

HOUR = 3600.0
MEASURED_FROM, MEASURED_UNTIL = 1.0 * HOUR, 1.75 * HOUR
"""Since the robot began to work, seconds: it warms up for an hour before it is measured."""

MILLED_FROM, MILLED_UNTIL = 2.0 * HOUR, 2.25 * HOUR
"""After another quarter of an hour the parts are in place and touched off; the program takes a quarter at most."""


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """How large each part of the truth is, as a multiple of what is assumed; 0 leaves it out."""

    links: float = 1.0
    drives: float = 1.0
    gears: float = 1.0
    lost_motion: float = 1.0
    expansion: float = 1.0
    geometry: float = 1.0
    wobble: float = 0.0
    """Of the axes: left out of what is assumed."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueRobot:
    """One robot with its defects."""

    model: ErrorModel
    x: Float[np.ndarray, " p"]

    def measured(self, q: Float[np.ndarray, "n joints"]) -> Conditions:
        """State of poses measured one after another: position of each drive within its lost motion, and the time."""
        return self._reached(q, MEASURED_FROM, MEASURED_UNTIL)

    def milled(
        self, q: Float[np.ndarray, "n joints"], progress: Float[np.ndarray, " n"] | None = None
    ) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the base on the ways of a program, reached one after another.

        Args:
            q: joint positions.
            progress: how much of the program is done at each, 0 to 1, which tells the time; evenly by default.
        """
        conditions = self._reached(q, MILLED_FROM, MILLED_UNTIL)
        if progress is not None:
            conditions = replace(conditions, time=MILLED_FROM + progress * (MILLED_UNTIL - MILLED_FROM))
        return self.model.poses(q, self.x, conditions)

    def touching(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the base where it touches parts, one place after another, before the milling begins."""
        return self.model.poses(q, self.x, self._reached(q, MILLED_FROM, MILLED_FROM))

    def _reached(self, q: Float[np.ndarray, "n joints"], begin: float, end: float) -> Conditions:
        return Conditions(approach=lost_motion(self.model.robot, q), time=np.linspace(begin, end, len(q)))


def draw_true_robot(robot: Robot, rng: np.random.Generator, sizes: Sizes | None = None) -> TrueRobot:
    """Draw a robot: its gears' own orders, then everything that has a size.

    Args:
        robot: an IRB 6660-205/1.9 as its controller knows it.
        rng: source of all that differs from robot to robot.
        sizes: of the parts of the truth.
    """
    s = sizes or Sizes()
    joints = len(robot.joints)
    orders, swell = rng.uniform(*RIPPLE_ORDERS, size=joints), rng.uniform(-np.pi, np.pi, size=joints)
    warm = UnevenExpansion(joints=GROWING, time_constants=TIME_CONSTANTS)
    expansion = replace(warm, tolerance=s.expansion * warm.tolerance)
    large, wrist = robot.joint_names[:3], robot.joint_names[3:]
    gears = GearErrors(orders=tuple(orders.tolist()), swell=tuple(swell.tolist()))
    effects: dict[Effect, float] = {
        Compliance(): s.drives,
        expansion: s.expansion,
        ElasticLinks(
            turns=tuple(s.links * c for c in LINK_TURNS),
            shifts=tuple(s.links * c for c in LINK_SHIFTS),
        ): s.links,
        replace(gears, eccentricity=s.gears * gears.eccentricity, ripple=s.gears * gears.ripple): s.gears,
        Backlash(joints=large, tolerance=s.lost_motion * LOST): s.lost_motion,
        Backlash(joints=wrist, tolerance=s.lost_motion * LOST_IN_WRIST): s.lost_motion,
        AxisWobble(tolerance=s.wobble * AxisWobble.tolerance): s.wobble,
    }
    heavy = elastic_robot(robot, STIFFNESS / s.drives if s.drives else STIFFNESS)
    model = ErrorModel(heavy, effects=[effect for effect, size in effects.items() if size])
    x = draw_defects(model, rng)
    x[: len(ErrorModel(robot))] *= s.geometry
    return TrueRobot(model=model, x=x)


UNKIND: Mapping[str, Sizes] = {
    "axis wobble": Sizes(wobble=1.0),
    "twice as large": Sizes(links=2.0, drives=2.0, gears=2.0, lost_motion=2.0, expansion=2.0, geometry=2.0),
}
"""Truths that keep less to what is assumed: with an error of a form that no effect has, and with everything twice as large."""
