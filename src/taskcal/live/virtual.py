"""The controller and the instrument ``virtual``: a simulated robot with effects that no fit is told, its person and its tracker.

Time is simulated, too: every reading lets some pass, and nothing waits.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.errors import shown
from taskcal.geometry import se3
from taskcal.live.devices import Controller, DeviceError, Instrument, JointReading, Shot
from taskcal.observations.base import TrackerNoise
from taskcal.observations.point import TRACKER_POSE
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import candidates
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.virtual.cell import draw_defects

# The figures below are conventions, of the size that robots and trackers have.

JOINT_PERIOD_S, SHOT_PERIOD_S, SHOT_LATENCY_S = 0.05, 0.2, 0.1
"""Between two readings of the joints, between two shots, and from a shot to its arrival."""

JOINT_SPEED = 1.0
"""Of a joint whose largest speed the robot's file does not state, radians or metres per second."""

JOINT_NOISE = 2e-6
"""Standard deviation of the joints that the controller states, radians or metres."""

JOG_ERROR = 2e-3
"""Standard deviation of where a person stops a joint about the pose that is shown, radians or metres."""

HIDDEN, HIDDEN_WAVES = 1.5e-5, 3
"""Amplitude, radians or metres, and number of the waves over all joints together, in each joint: nothing that any model has."""

DWELL_S = 6.0
"""For which a simulated program waits in each pose."""

MIN_LOST_S = 1.0
"""For which a beam that was lost is away."""


@dataclass(eq=False, kw_only=True)
class VirtualCell:
    """A robot as it is, where it stands now, and what the tracker sees."""

    robot: Robot
    model: ErrorModel
    x: Float[np.ndarray, " p"]
    waves: Float[np.ndarray, "joints waves joints"]
    phases: Float[np.ndarray, "joints waves"]
    target: Float[np.ndarray, " 3"]
    """Centre of the reflector in the tool frame, metres."""
    rng: np.random.Generator
    hidden: float = HIDDEN
    lost: float = 0.0
    """Probability of a shot that the beam is lost."""
    T_tracker_base: Float[np.ndarray, "4 4"] = field(default_factory=lambda: TRACKER_POSE)
    now: float = 0.0
    start: Float[np.ndarray, " joints"] = field(default_factory=lambda: np.zeros(0))
    goal: Float[np.ndarray, " joints"] = field(default_factory=lambda: np.zeros(0))
    begun: float = 0.0
    arrives: float = 0.0
    lost_until: float = 0.0
    visits: list[Float[np.ndarray, " joints"]] = field(default_factory=list)
    """Poses that a program has not come to yet."""

    @classmethod
    def drawn(cls, robot: Robot, seed: int) -> "VirtualCell":
        """A robot with defects of its tolerances, compliance and gear errors among them, and with waves that no model has."""
        rng = np.random.default_rng(seed)
        model = ErrorModel(robot)
        for effect in candidates(robot, Conditions())[:2]:
            model = model + effect
        n = len(robot.joints)
        home = np.clip(0.0, *robot.limits.T)
        return cls(
            robot=robot,
            model=model,
            x=draw_defects(model, rng),
            waves=rng.normal(size=(n, HIDDEN_WAVES, n)),
            phases=rng.uniform(0.0, 2.0 * np.pi, size=(n, HIDDEN_WAVES)),
            target=0.03 * rng.normal(size=3),
            rng=rng,
            start=home,
            goal=home,
        )

    def points(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3"]:
        """Where the reflector is at joints, in the tracker's frame, metres."""
        off = self.hidden * np.sin(np.einsum("jwk,nk->njw", self.waves, q) + self.phases).sum(axis=2)
        T = self.T_tracker_base @ self.model.poses(q + off, self.x)
        return se3.apply(T, self.target)

    def go(self, joints: Float[np.ndarray, " joints"], speed_fraction: float) -> None:
        """Begin to move, all joints together."""
        self.start, self.begun = self.joints(self.now), self.now
        self.goal = np.array(joints, dtype=float)
        speed = np.where(np.isfinite(self.robot.speed_limits), self.robot.speed_limits, JOINT_SPEED) * speed_fraction
        self.arrives = self.now + float(np.max(np.abs(self.goal - self.start) / speed))

    def joints(self, at: float) -> Float[np.ndarray, " joints"]:
        """Where the robot is at a time."""
        share = 1.0 if at >= self.arrives else max(at - self.begun, 0.0) / (self.arrives - self.begun)
        return self.start + share * (self.goal - self.start)

    def shot(self) -> Shot:
        """What the tracker measures next."""
        self.now += SHOT_PERIOD_S
        if self.rng.random() < self.lost:
            self.lost_until = self.now + MIN_LOST_S
        if self.now < self.lost_until:
            return Shot(time_s=self.now, point=np.full(3, np.nan), reason="beam lost")
        point = self.points(self.joints(self.now - SHOT_LATENCY_S)[None])[0]
        return Shot(time_s=self.now, point=self.rng.multivariate_normal(point, TrackerNoise().covariance(point)))


class VirtualController(Controller):
    """The controller of a simulated robot; without ``--drive`` a simulated person jogs it near the pose that is shown."""

    name: ClassVar[str] = "virtual"
    reached: ClassVar[str] = "SEED"
    can_move: ClassVar[bool] = True
    opened: ClassVar[list[VirtualCell]] = []
    """The cell that was opened last, which the instrument measures."""

    def __init__(self, cell: VirtualCell):
        self.cell = cell
        self.opened[:] = [cell]

    @classmethod
    def open(cls, address: str | None, robot: Robot, timeout_s: float) -> "VirtualController":
        """Draw a robot.

        Raises:
            DeviceError: the address is not a seed.
        """
        seed = address or "0"
        if not seed.isdecimal():
            raise DeviceError(
                f"the address of the controller 'virtual' is the seed of its robot, and '{shown(seed)}' is none; "
                "write for example 1"
            )
        return cls(VirtualCell.drawn(robot, int(seed)))

    def read(self, timeout_s: float) -> JointReading:
        """The joints, a moment later."""
        cell = self.cell
        cell.now += JOINT_PERIOD_S
        if cell.visits and cell.now > cell.arrives + DWELL_S:
            cell.go(cell.visits.pop(0), 1.0)
        q = cell.joints(cell.now)
        return JointReading(
            time_s=cell.now, joints=q + JOINT_NOISE * cell.rng.normal(size=len(q)), moving=cell.now < cell.arrives
        )

    def show(self, joints: Float[np.ndarray, " joints"]) -> None:
        """The person goes there, or nearly."""
        near = joints + JOG_ERROR * self.cell.rng.normal(size=len(joints))
        inside = self.cell.robot.inside_limits(near[None])[0]
        self.cell.go(near if inside else joints, 1.0)

    def visits(self, joints: Float[np.ndarray, "n joints"]) -> None:
        """Start a program."""
        self.cell.visits = list(joints)

    def move(self, joints: Float[np.ndarray, " joints"], speed_fraction: float) -> None:
        """Begin a motion."""
        self.cell.go(joints, speed_fraction)

    def close(self) -> None:
        """Nothing is open."""


class VirtualTracker(Instrument):
    """A tracker that sees the simulated robot's reflector from everywhere."""

    name: ClassVar[str] = "virtual"

    def __init__(self, cell: VirtualCell):
        self._cell = cell

    @classmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> "VirtualTracker":
        """See the robot of the virtual controller.

        Raises:
            DeviceError: there is none, or an address or columns are given.
        """
        if address is not None or columns:
            given = shown(columns if address is None else address)
            raise DeviceError(
                f"the instrument 'virtual' has no address and no columns, and '{given}' is given; leave it out"
            )
        if not VirtualController.opened:
            raise DeviceError("the instrument 'virtual' measures the robot of --controller virtual, and none is open")
        return cls(VirtualController.opened[0])

    def read(self, timeout_s: float) -> Shot | None:
        """The next shot."""
        return self._cell.shot()

    def close(self) -> None:
        """Nothing is open."""
