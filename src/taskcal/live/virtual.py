"""The controller and the instrument ``virtual``: a simulated robot with effects that no fit is told, its person and its tracker.

Time is simulated, too: every reading lets some pass, and nothing waits.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.errors import shown
from taskcal.geometry import se3
from taskcal.live.devices import Controller, DeviceError, Instrument, JointReading, Shot
from taskcal.live.stillness import MissedError
from taskcal.observations.base import Measured, Scene, TrackerNoise
from taskcal.observations.camera import FEWEST_CORNERS
from taskcal.observations.instrument import Instrument as CellInstrument
from taskcal.observations.point import TRACKER_POSE, Point
from taskcal.reading.pictures import Corners
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import candidates
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.virtual.cell import OutOfReachError, TrueRobot, draw_defects, visit
from taskcal_groundwork.said import Said

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

MODEL_ERROR_M = 3e-5
"""Standard deviation per axis of what no model has, where it is measured without a tracker, metres."""

MISPLACED_M = 2e-3
"""Standard deviation of where fixtures, and what the tool carries, are about where they are stated, metres."""

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
    scene: Scene | None = None
    """What is measured without a tracker, where it truly is; None for a tracker."""
    reading: Measured | None = None
    """What an instrument without a tracker reads where the robot goes to."""
    camera: CellInstrument | None = None
    """What takes images, as it truly is; None for what reads numbers."""
    images: int = 0
    """How many were taken."""

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

    @property
    def kind(self) -> str:
        """Key of the kind of observation."""
        return Point.key if self.scene is None else self.scene.observation.key

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

    def observe(self, observed: CellInstrument) -> None:
        """Set up fixtures near where they are stated, those of one place together, and what the tool carries near where it is."""
        names, places = observed.fixtures.names, observed.fixtures.places
        unknown, own = observed.unknown.copy(), len(observed.unknown) // len(names)
        shift = {place: MISPLACED_M * self.rng.normal(size=own) for place in places if place}
        for k, place in enumerate(places):
            unknown[k * own : (k + 1) * own] += shift.get(place, MISPLACED_M * self.rng.normal(size=own))
        T = observed.T_tool_targets[0] @ se3.translation(*(MISPLACED_M * self.rng.normal(size=3)))
        self.scene = Scene(observed.observation(np.arange(len(names))), observed.targets[0], T, unknown)
        self.camera = None if observed.looked_for is None else observed.as_fitted(self.scene.observation, unknown, T)

    def visit(self, fixture: str) -> None:
        """Where the robot goes, measure a fixture: the person seats there what touches, so that the robot stands elsewhere.

        Raises:
            OutOfReachError: it cannot be measured there.
        """
        assert self.scene is not None
        kind, unknown = self.scene.observation, self.scene.unknown
        here = replace(kind, of=np.array([kind.named.index(fixture)])) if kind.things else kind

        def seated(T: np.ndarray, _: np.ndarray) -> np.ndarray:
            off = here.differentiate(T, unknown, here.blank(1))
            moved = np.linalg.pinv(off.by_target[:, :, :3]) @ off.residual[..., None]
            return se3.pose(T[:, :3, :3], T[:, :3, 3] + moved[..., 0])

        robot = TrueRobot(
            model=self.model,
            x=self.x,
            T_tracker_base=np.eye(4),
            joint_error=np.zeros(len(self.goal)),
            model_error=MODEL_ERROR_M,
        )
        scene = self.scene._replace(observation=here, approach=seated if kind.touched else None)
        found = visit(robot, scene, self.goal[None], conditions=None, rng=self.rng)
        self.goal, self.reading = found.q[0], found.read

    def _image(self, q: Float[np.ndarray, " joints"]) -> Shot:
        """What the camera sees where the robot is."""
        assert self.scene is not None
        assert self.camera is not None
        assert self.camera.looked_for is not None
        (board, *_), lens = self.camera.looked_for
        target = self.model.poses(q[None], self.x)[0] @ self.scene.T_tool_target
        target[:3, 3] += MODEL_ERROR_M * self.rng.normal(size=3)
        ids, pixel = self.camera.sight(target, self.rng)
        self.images += 1
        name = f"{self.images:04d}.png"
        wrong = None if len(ids) >= FEWEST_CORNERS else Said("{image} does not show the board", image=name)
        corners = Corners(
            source="virtual",
            images=(name,),
            width=lens.width,
            height=lens.height,
            image=np.zeros(len(ids), dtype=int),
            board=(board.name,) * len(ids),
            id=ids,
            pixel=pixel,
        )
        return Shot(
            time_s=self.now, point=np.zeros(3), kind=self.kind, reason=wrong or "", corners=corners, wrong=wrong
        )

    def shot(self) -> Shot:
        """What the tracker, or another instrument, measures next."""
        self.now += SHOT_PERIOD_S
        if self.rng.random() < self.lost:
            self.lost_until = self.now + MIN_LOST_S
        if self.now < self.lost_until:
            return Shot(time_s=self.now, point=np.full(3, np.nan), kind=self.kind, reason="beam lost")
        if self.camera is not None:
            return self._image(self.joints(self.now - SHOT_LATENCY_S))
        if self.reading is not None:
            return Shot(time_s=self.now, point=self.reading.points[0], kind=self.kind)
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
    """A tracker that sees the simulated robot's reflector from everywhere, or what else measures it."""

    name: ClassVar[str] = "virtual"
    on_request: ClassVar[bool] = True

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

    def observes(self, observed: CellInstrument) -> None:
        """Fixtures of this instrument, if it is not a tracker."""
        if not observed.kind.in_tracker:
            self._cell.observe(observed)

    def knows(self, images: Sequence[str]) -> None:
        """The next image has the next number."""
        self._cell.images = len(images)

    def show(self, fixture: str) -> None:
        """What is measured at the pose to which the robot goes.

        Raises:
            MissedError: it cannot be measured there.
        """
        if self._cell.scene is None or self._cell.camera is not None:
            return
        try:
            self._cell.visit(fixture)
        except OutOfReachError as error:
            raise MissedError("it cannot be measured there: {reason}", reason=str(error)) from error

    def read(self, timeout_s: float) -> Shot | None:
        """The next shot."""
        return self._cell.shot()

    def close(self) -> None:
        """Nothing is open."""
