"""Taking a row: joints and target are measured only while both stand, and averaged over the standstill."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from taskcal.live.devices import Controller, DeviceError, Instrument, JointReading, Shot
from taskcal.observations.point import Point
from taskcal.reading.pictures import Corners
from taskcal_groundwork.said import Said


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
    latest_s: float = 4.0
    """By which points may arrive later than joints of the same time, or earlier, where no motion has shown by how much, seconds. A
    convention: software that filters and exports a point takes up to three."""

    @property
    def still(self) -> float:
        """Range of the joints while the robot stands, radians or metres."""
        return 3.0 * self.max_speed

    @property
    def apart_m(self) -> float:
        """Between two shots, beyond which they are of two places: five times their scatter, which noise does not reach."""
        return 5.0 * self.max_scatter_m


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
    return bool((np.abs(slope) <= rules.max_speed).all() and (np.ptp(q, axis=0) <= rules.still).all())


def scatter_of(points: Float[np.ndarray, "shots 3"]) -> float:
    """Rms distance of shots from their mean, of the degrees of freedom that they have, metres; 0 for one."""
    off = points - points.mean(axis=0)
    return float(np.sqrt((off**2).sum() / max(len(points) - 1, 1)))


MOTIONS = 3
"""Last motions that tell how late points are. A convention: one at which the joints were not read, as in a fit, tells little."""

UNBIDDEN = 3
"""Shots in one wait that were made before the robot stood, from which on an instrument of lines sends them by itself."""


@dataclass(eq=False, kw_only=True)
class Together:
    """Whether joints and points are of the same stop: where both have stood for longer than one can be later than the other.

    How late that is, is seen as they leave a stop that they had together.
    """

    row: Taken | None = None
    """The last row."""
    left_s: float = 0.0
    """When joints of the last row's stop last arrived."""
    gone: bool = False
    """Whether the robot has left that stop."""
    away: list[float] = field(default_factory=list)
    """When shots arrived, one after another, that are not at the last row's place."""
    departed: bool = False
    """Whether it is known how late they left it."""
    here: JointReading | None = None
    """The first of the readings of this standstill."""
    run: Shot | None = None
    """The first of the shots that stand."""
    times_s: tuple[float, float] | None = None
    """Of the first row's joints and of its points, as the devices count them."""
    lags: deque[float] = field(default_factory=lambda: deque(maxlen=MOTIONS))
    """By which points left a stop after the joints, at the last motions, seconds."""

    def late_s(self, rules: Rules) -> float:
        """How late either is at most, seconds."""
        return min(abs(min(self.lags, default=rules.latest_s)), rules.latest_s)

    def see_joints(self, one: JointReading, rules: Rules) -> None:
        """Take up joints that arrived."""
        if self.here is None or (np.abs(one.joints - self.here.joints) > rules.still).any():
            self.here = one
        if self.row is None or self.gone:
            return
        if (np.abs(one.joints - self.row.joints) <= rules.still).all():
            self.left_s = one.time_s
        else:
            self.gone = True

    def see_shot(self, shot: Shot, rules: Rules) -> None:
        """Take up a shot that arrived."""
        if not shot.valid:
            return
        if self.run is None or np.linalg.norm(shot.point - self.run.point) > rules.apart_m:
            self.run = shot
        if self.row is None or self.departed:
            return
        away = np.linalg.norm(shot.point - self.row.point) > rules.apart_m
        self.away = [*self.away, shot.time_s][:2] if away else []
        if len(self.away) > 1 and self.gone:  # a single one may be an outlier
            self.departed = True
            self.lags.append(self.away[1] - self.left_s)

    def stale(self, shot: Shot, joints: Float[np.ndarray, " joints"], rules: Rules) -> bool:
        """Whether a shot is still at the place of the last row, which the robot has left."""
        return (
            self.row is not None
            and bool((np.abs(joints - self.row.joints) > rules.left).any())
            and bool(np.linalg.norm(shot.point - self.row.point) <= rules.apart_m)
        )

    def stand(self, shot: Shot, rules: Rules, *, joints: bool) -> bool:
        """Whether the points, and the joints where these are read, have stood for long enough by a shot."""
        begun = [self.run.time_s] if self.run is not None else [shot.time_s]
        if joints and self.here is not None:
            begun.append(self.here.time_s)
        return shot.time_s >= max(begun) + rules.settle_s + self.late_s(rules)

    def took(self, row: Taken) -> None:
        """Take up a row."""
        self.row, self.left_s = row, row.time_s
        self.gone, self.departed, self.away = False, False, []


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
    together: Together = field(default_factory=Together)

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
                taken = Taken(
                    time_s=readings[-1].time_s,
                    joints=joints,
                    point=points.mean(axis=0),
                    scatter=scatter,
                    shots=len(points),
                    corners=shots[-1].corners,
                )
                self._compare_clocks(taken.time_s, shots[-1].time_s)
                self.together.took(taken)
                return taken
        if self.together.row is None and self._pairs and self.controller.streams and self.instrument.streams:
            raise MissedError(
                "joints and points have not stood together for {needed_s:.1f} s, before which it is not known how late points "
                "arrive; let robot and target stand for so long once",
                needed_s=self.rules.settle_s + self.rules.latest_s,
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
            typed = self.controller.read(self.rules.wait_s)
            self.together.see_joints(typed, self.rules)
            return [typed]
        readings: list[JointReading] = []
        begun: float | None = None
        while True:
            one = self.controller.read(self.rules.read_s)
            self.together.see_joints(one, self.rules)
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
        before, waiting, apart = 0, True, False
        while len(shots) < rules.shots:
            shot = self._read(0.0 if waiting else limit)
            if shot is not None:
                self.together.see_shot(shot, rules)
            old = shot is not None and shot.time_s < since
            if (waiting and (old or shot is None)) or (old and not self._pairs):
                before, waiting = before + old, waiting and old
                continue  # one of many that waited while the robot moved, or the end of these
            waiting = False
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
                waited, apart = max(waited, shot.time_s - lost_since) if self.instrument.streams else 0.0, False
            elif old or not self._belongs(shot, readings[-1], flows=self.instrument.streams or before >= UNBIDDEN):
                shots.clear()
                apart, waited = True, max(waited, shot.time_s - lost_since, readings[-1].time_s - lost_since)
            else:
                shots.append(shot)
                waited, lost_since = 0.0, shot.time_s
            if waited > patience:
                raise (
                    self._apart(waited)
                    if apart
                    else MissedError(
                        "no valid shot for {waited_s:.0f} s while the robot stood; see that the instrument sees the target, "
                        "and sends what it reads then",
                        waited_s=waited,
                    )
                )
            if self.stopped() and waited > rules.settle_s and not shots:
                raise StoppedError
        return shots

    @property
    def _pairs(self) -> bool:
        """Whether it has to be seen that points are of the joints' stop."""
        return self.kind == Point.key and not self.instrument.on_request

    def _belongs(self, shot: Shot, reading: JointReading, *, flows: bool) -> bool:
        """Whether a shot is of the stop at which the joints were read.

        Raises:
            MissedError: a single one is not.
        """
        if not self._pairs:
            return True
        stale = self.together.stale(shot, reading.joints, self.rules)
        if stale and not flows:
            raise self._apart(0.0)
        return not stale and (not flows or self.together.stand(shot, self.rules, joints=self.controller.streams))

    def _compare_clocks(self, joints_s: float, points_s: float) -> None:
        """See that the times of joints and points that arrive together advance alike, from the second row on.

        Raises:
            DeviceError: they do not.
        """
        first = self.together.times_s = self.together.times_s or (joints_s, points_s)
        joints_s, points_s = joints_s - first[0], points_s - first[1]
        if self.controller.streams and self.instrument.streams and abs(joints_s - points_s) > self.rules.latest_s:
            raise DeviceError(
                f"since the first row the joints of the controller '{self.controller.name}' count {joints_s:.1f} s, and the points "
                f"of the instrument '{self.instrument.name}' {points_s:.1f} s: these are not the times at which they arrive; see "
                "the clocks of both, and go on (--resume)"
            )

    def _apart(self, waited_s: float) -> MissedError:
        """Points that do not belong to the joints that are read."""
        return MissedError(
            "the points of the instrument '{instrument}' do not follow the joints of the controller '{controller}': "
            "{waited_s:.0f} s after the robot stood they have not come to rest, or are where the last row was measured; see that "
            "the target is on the tool, and which of the two delivers late",
            instrument=self.instrument.name,
            controller=self.controller.name,
            waited_s=waited_s,
        )
