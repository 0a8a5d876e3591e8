"""Taking a row: joints and target are measured only while both stand, and averaged over the standstill."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.live.devices import Controller, DeviceError, Instrument, JointReading, Said, Shot
from taskcal.observations.point import Point
from taskcal.reading.pictures import Corners


class StoppedError(Exception):
    """The person ended the measurement; what was taken before is kept."""


class MissedError(Exception):
    """A row that could not be taken, with the reason in words; the person decides what to do."""

    def __init__(self, template: str, **values: str | float):
        self.said = Said(template, **values)
        super().__init__(self.said)

    @classmethod
    def of(cls, said: Said) -> "MissedError":
        """Because of what was said elsewhere."""
        return cls(said.template, **said.values)


SEATED_WITHIN = float(np.radians(15.0))
"""From the pose that is shown, within which the robot has arrived where something touches, radians or metres: fixtures are stated
roughly, and near a singularity a centimetre turns a wrist by many degrees. A convention; joints are read, not assumed."""


@dataclass(frozen=True, kw_only=True)
class Rules:
    """When a row counts."""

    settle_s: float = 1.0
    """For which the robot has to stand before the first shot, and the readings of which show it, seconds. A convention: arms of
    industrial robots ring for some tenths."""
    max_speed: float = 1e-4
    """Speed of every joint below which it stands, radians or metres per second: 0.1 mm/s at an arm of a metre, and ten times what
    the noise of an encoder of 10⁻⁵ rad shows over `settle_s`."""
    arrived: float = float(np.radians(2.0))
    """From the pose that is shown, within which a person has arrived, radians or metres. Joints are read, not assumed, so that the
    row is as good there."""
    shots: int = 3
    """Valid shots of which a row is the mean."""
    max_scatter_m: float = 1e-4
    """Scatter of the shots, rms in space, above which they are taken again: two and a half times what a tracker has at 5 m by its
    specification (`TrackerNoise`)."""
    tries: int = 3
    """Of the shots, before the person is asked."""
    wait_s: float = 600.0
    """For the robot to arrive, before the person is asked."""
    beam_s: float = 30.0
    """For a shot that is valid, before the person is asked."""
    read_s: float = 5.0
    """Limit of each read of a stream."""
    late_share: float = 0.5
    """Of `settle_s`, by which a measurement that a person or software makes may be read late; those before are of the way. A
    convention: half the time to settle is more than files and networks take, and software that waits for a standstill is later."""
    left: float = 2e-3
    """From where it stood, beyond which the robot has left, radians or metres: twenty times what a robot that stands may move in
    `settle_s`, and a hundredth of what lies between two poses. A convention."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Taken:
    """A row: means over the standstill."""

    time_s: float
    """Of the last reading of the joints, as the devices count it."""
    joints: Float[np.ndarray, " joints"]
    point: Float[np.ndarray, " 3"]
    scatter: float
    """Of the shots, rms in space, metres; 0 for one."""
    shots: int
    corners: Corners | None = None
    """Of an image, what it shows."""


def stands(readings: Sequence[JointReading], rules: Rules) -> bool:
    """Whether the newest readings cover the time to settle, and nothing moves in it.

    The speed is the slope of a line through each joint's readings, which the noise of single ones hardly turns, and the whole
    range must be what such a speed would give, so that a joint that went and came back does not stand.
    """
    if not readings or readings[-1].moving:
        return False
    begin = readings[-1].time_s - rules.settle_s
    inside = [one for one in readings if one.time_s >= begin - 1e-9]
    if len(inside) < 2 or inside[0].time_s - begin > 0.5 * rules.settle_s or readings[0].time_s > begin + 1e-9:
        return False
    if any(one.moving for one in inside):
        return False
    t, q = np.array([one.time_s for one in inside]), np.stack([one.joints for one in inside])
    t = t - t.mean()
    slope = t @ (q - q.mean(axis=0)) / (t @ t)
    return bool((np.abs(slope) <= rules.max_speed).all() and (np.ptp(q, axis=0) <= 3.0 * rules.max_speed).all())


def scatter_of(points: Float[np.ndarray, "shots 3"]) -> float:
    """Rms distance of shots from their mean, of the degrees of freedom that they have, metres; 0 for one."""
    off = points - points.mean(axis=0)
    return float(np.sqrt((off**2).sum() / max(len(points) - 1, 1)))


@dataclass(eq=False, kw_only=True)
class Taker:
    """Takes rows from a controller and an instrument."""

    controller: Controller
    instrument: Instrument
    rules: Rules
    stopped: Callable[[], bool] = lambda: False
    """Asked between readings, until the robot stands: a row that has begun is finished."""
    kind: str = Point.key
    """Key of the kind of observation that is measured."""

    def take(
        self,
        pose: Float[np.ndarray, " joints"] | None,
        *,
        after: Float[np.ndarray, " joints"] | None = None,
        fixture: str = "",
    ) -> Taken:
        """Wait until the robot stands at a pose, then measure.

        Args:
            pose: radians; None for wherever it is.
            after: where it stood before, and has to leave first, radians.
            fixture: that is measured, where there are any.

        Raises:
            MissedError: it does not arrive, the beam stays lost, or the shots scatter.
            StoppedError: the person asked to stop, before the robot stood.
            DeviceError: a connection is lost.
        """
        for _ in range(self.rules.tries):
            asked = [self._read(0.0) for _ in range(self.rules.shots)] if self.instrument.asked else []
            readings = self._standstill(pose, after)
            shots = [shot for shot in asked if shot is not None] or self._shots(readings)
            if shots is None:
                continue
            self._check_fixture(shots, fixture)
            points = np.stack([shot.point for shot in shots])
            scatter = scatter_of(points)
            if scatter <= self.rules.max_scatter_m:
                joints = np.mean([one.joints for one in readings], axis=0)
                return Taken(
                    time_s=readings[-1].time_s,
                    joints=joints,
                    point=points.mean(axis=0),
                    scatter=scatter,
                    shots=len(points),
                    corners=shots[-1].corners,
                )
        raise MissedError(
            "the robot moved, or {shots} shots scattered by more than {limit_mm:g} mm (tries: {tries}); see that robot, target and "
            "instrument stand firmly",
            shots=self.rules.shots,
            limit_mm=self.rules.max_scatter_m * 1e3,
            tries=self.rules.tries,
        )

    def _read(self, limit_s: float) -> Shot | None:
        """The next shot.

        Raises:
            DeviceError: it is of another kind of observation.
        """
        shot = self.instrument.read(limit_s)
        if shot is not None and shot.kind != self.kind:
            raise DeviceError(
                f"the instrument '{self.instrument.name}' sends readings of the kind '{shot.kind}', and '{self.kind}' is "
                "measured; state its columns (--columns), or what is observed (--observe)"
            )
        return shot

    def _check_fixture(self, shots: Sequence[Shot], fixture: str) -> None:
        for shot in shots:
            if shot.fixture not in ("", fixture):
                raise MissedError(
                    "'{found}' was measured, and not '{asked}'; measure that one", found=shot.fixture, asked=fixture
                )

    def take_point(self, after: Float[np.ndarray, " 3"] | None) -> Taken:
        """Wait until the target stands, where no joints are read; the row has none.

        Args:
            after: where it stood before, and has to leave first, where the instrument streams; metres.

        Raises:
            MissedError: the shots scatter, or there are too few of them.
            StoppedError: the person asked to stop.
            DeviceError: the connection is lost.
        """
        rules, shots = self.rules, list[Shot]()
        while True:
            shot = self._read(0.2 * rules.settle_s)
            if self.stopped() and not shots:
                raise StoppedError
            if shot is None:
                continue
            if not shot.valid:
                shots = []
                continue
            if self.instrument.streams:
                if after is not None and np.linalg.norm(shot.point - after) <= rules.left:
                    continue
                after = None
                shots = [*(old for old in shots if old.time_s >= shot.time_s - 1.5 * rules.settle_s), shot]
                if not stands([JointReading(time_s=one.time_s, joints=one.point) for one in shots], rules):
                    continue
            elif shots and np.linalg.norm(shot.point - shots[-1].point) > rules.left:
                few, shots = len(shots), [shot]
                if rules.shots > 1:
                    raise MissedError(
                        "{few} of {shots} shots before the target moved on; measure it again there",
                        few=few,
                        shots=rules.shots,
                    )
            else:
                shots.append(shot)
            if self.instrument.streams or len(shots) == rules.shots:
                points = np.stack([one.point for one in shots])
                if (scatter := scatter_of(points)) > rules.max_scatter_m:
                    raise MissedError(
                        "{shots} shots scattered by {scatter_mm:.3f} mm; measure them again",
                        shots=len(shots),
                        scatter_mm=scatter * 1e3,
                    )
                return Taken(
                    time_s=shot.time_s, joints=np.zeros(0), point=points.mean(axis=0), scatter=scatter, shots=len(shots)
                )

    def _standstill(
        self, pose: Float[np.ndarray, " joints"] | None, after: Float[np.ndarray, " joints"] | None
    ) -> list[JointReading]:
        """Readings of the standstill, which goes on."""
        if not self.controller.streams:
            own = self.instrument.streams or self.instrument.asked
            while not own and self.instrument.read(0.0) is not None:
                pass  # what was measured before the pose was asked for
            return [self.controller.read(self.rules.wait_s)]
        readings: list[JointReading] = []
        begun: float | None = None
        while True:
            one = self.controller.read(self.rules.read_s)
            begun = one.time_s if begun is None else begun
            oldest = one.time_s - 1.5 * self.rules.settle_s
            readings = [*(old for old in readings if old.time_s >= oldest), one]
            if after is not None:
                if (np.abs(one.joints - after) <= self.rules.left).all():
                    readings = []
                else:
                    after = None
            if stands(readings, self.rules) and (pose is None or self._arrived(one, pose)):
                begin = one.time_s - self.rules.settle_s
                return [old for old in readings if old.time_s >= begin - 1e-9]
            if self.stopped():
                raise StoppedError
            if one.time_s - begun > self.rules.wait_s:
                if pose is None:
                    raise MissedError(
                        "the robot has not stood anywhere else for {wait_s:g} s", wait_s=self.rules.wait_s
                    )
                off = float(np.degrees(np.abs(one.joints - pose).max()))
                raise MissedError(
                    "the robot does not stand at the pose after {wait_s:g} s ({off_deg:.1f}° off)",
                    wait_s=self.rules.wait_s,
                    off_deg=off,
                )

    def _arrived(self, reading: JointReading, pose: Float[np.ndarray, " joints"]) -> bool:
        return bool((np.abs(reading.joints - pose) <= self.rules.arrived).all())

    def _shots(self, readings: list[JointReading]) -> list[Shot] | None:
        """Valid shots, one after another, while the robot stands, whose readings are added; None where it moves."""
        rules, shots = self.rules, list[Shot]()
        since = (
            readings[-1].time_s if self.instrument.streams else readings[0].time_s + rules.late_share * rules.settle_s
        )
        if not (self.instrument.streams or self.controller.streams):
            since = readings[-1].time_s if self.instrument.unbidden else -np.inf  # a person makes both, in any order
        waited, lost_since = 0.0, readings[-1].time_s
        patience = rules.beam_s if self.instrument.streams else rules.wait_s
        limit = min(rules.read_s, 0.2 * rules.settle_s)  # so that joints are read often enough to show the standstill
        while len(shots) < rules.shots:
            shot = self._read(limit)
            if shot is not None and shot.time_s < since:
                continue  # one of many that waited while the robot moved
            if self.controller.streams:
                readings.append(self.controller.read(rules.read_s))
                if not stands(readings, rules):
                    return None
            if shot is None:
                waited += limit
            elif shot.wrong is not None:
                raise MissedError.of(shot.wrong)
            elif not shot.valid:
                shots.clear()
                waited = max(waited, shot.time_s - lost_since) if self.instrument.streams else 0.0
            else:
                shots.append(shot)
                waited, lost_since = 0.0, shot.time_s
            if waited > patience:
                raise MissedError(
                    "no valid shot for {waited_s:.0f} s while the robot stood; see that the instrument sees the target, "
                    "and sends what it reads then",
                    waited_s=waited,
                )
            if self.stopped() and waited > rules.settle_s and not shots:
                raise StoppedError
        return shots
