"""The loop with a virtual cell behind it: what goes wrong while one measures, and what becomes of it."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box
from taskcal.live.devices import Controller, DeviceError, JointReading, Shot
from taskcal.live.journal import Journal
from taskcal.live.runner import FIRST_SPEED_SHARE, Answer, Ending, Mover, Question, RunEvent, Runner
from taskcal.live.steering import Aim, Steering
from taskcal.live.stillness import MissedError, Rules, Taker
from taskcal.live.virtual import VirtualController, VirtualTracker
from taskcal.observations.point import Station

ROBOT = tc.load_robot("ur5")
MODEL = tc.ErrorModel(ROBOT)
AIM = Aim(model=MODEL, task=tc.default_task(MODEL), tolerance=3e-4, seed=3, candidates=60, effects=False)


class Session:
    """A session on a virtual robot, with something that happens as a pose is shown, and answers that are given."""

    def __init__(self, path: Path, aim: Aim = AIM, *, resume: bool = False, seed: str = "3", most: int = 40):
        self.journal = Journal(path, ROBOT)
        (self.journal.resume if resume else self.journal.begin)(
            aim.settings if resume else {**aim.settings, "begun": 0.0}
        )
        self.controller = VirtualController.open(seed, ROBOT, 1.0)
        self.cell = self.controller.cell
        self.notes: list[str] = []
        self.asked: list[str] = []
        self.answers: list[Answer] = []
        self.happens: dict[int, Callable[[], None]] = {}
        self.stop_at = 10_000
        self.taker = Taker(
            controller=self.controller,
            instrument=VirtualTracker.open(None, 1.0),
            rules=Rules(beam_s=3.0),
            stopped=lambda: len(self.journal.rows) + 1 >= self.stop_at,
        )
        self.runner = Runner(
            steering=Steering(replace(aim, most=most), self.journal),
            taker=self.taker,
            tell=self._tell,
            ask=self._ask,
            now=lambda: 0.0,
        )

    def run(self) -> Ending:
        """Measure, and let others go on with the campaign."""
        with closing(self.journal):
            return self.runner.run()

    def _tell(self, event: RunEvent) -> None:
        if event.kind == "note":
            self.notes.append(event.text)
        if event.kind == "pose" and event.step is not None:
            self.happens.pop(event.step.number, lambda: None)()

    def _ask(self, question: Question) -> Answer:
        self.asked.append(question.text)
        answer = self.answers.pop(0)
        assert answer in question.answers
        return answer


def test_it_ends_when_it_is_proven_and_the_error_is_as_said(tmp_path: Path) -> None:
    """By the posterior and by the poses kept out; beams that are lost on the way do not matter, and the truth agrees."""
    session = Session(tmp_path / "c.csv")
    session.cell.lost = 0.03
    outcome = session.run()
    assert outcome.reason == "proven"
    state = outcome.state
    assert state.met
    assert state.look is not None
    assert state.look.bound <= 3e-4
    assert state.look.kept_out == len(state.kept_out) >= 6
    calibration, q = session.runner.steering.calibration(), tc.reach_task(MODEL, AIM.task, 100, seed=5).q
    true = np.sqrt(np.mean(np.sum((calibration.predict(q)[:, 0] - session.cell.points(q)) ** 2, axis=1)))
    assert true < state.look.bound
    assert not session.asked


@pytest.mark.long
def test_a_wrong_row_is_dropped_and_a_true_one_kept(tmp_path: Path) -> None:
    """One wrong measurement is measured again; a robot that is off there twice is kept, and the first pose is looked at next."""
    session = Session(tmp_path / "c.csv", replace(AIM, tolerance=1e-6), most=18)
    instrument = session.taker.instrument
    true_read, wrong = instrument.read, {"left": 0}

    def read(timeout_s: float) -> Shot | None:
        shot = true_read(timeout_s)
        if shot is None or not wrong["left"]:
            return shot
        wrong["left"] -= 1
        return Shot(time_s=shot.time_s, point=shot.point + 1e-3)

    instrument.read = read
    session.happens = {14: lambda: wrong.update(left=4), 16: lambda: wrong.update(left=30)}

    def right() -> None:
        wrong.update(left=0)

    session.happens[17] = right
    session.run()
    assert [note.split(":")[0] for note in session.notes if "wrong" in note or "twice" in note] == [
        "the second measurement is as expected; the first was wrong, and is dropped",
        "twice the same",
    ]
    assert session.journal.rows[16].purpose == "reference"
    points = session.cell.points(np.stack([row.joints for row in session.journal.rows]))
    off = np.linalg.norm(points - np.stack([row.point for row in session.journal.rows]), axis=1)
    assert [k + 1 for k in np.flatnonzero(off > 5e-4)] == [16]


def test_a_tracker_that_was_moved_is_a_new_station(tmp_path: Path) -> None:
    """The first pose tells; rows from there have a station of their own, and the proof goes on with both.

    Row 17 was fitted as if it were right, so that a fit is due while the new station has one row.
    """
    session = Session(tmp_path / "c.csv", replace(AIM, tolerance=1e-6), most=32)

    def move() -> None:
        session.cell.T_tracker_base = se3.pose(se3.exp(np.array([0.0, 0.0, 0.4])), np.array([0.3, 0.1, 0.0])) @ (
            session.cell.T_tracker_base
        )

    session.happens, session.answers = {17: move}, ["moved"]
    session.run()
    assert len(session.asked) == 1
    rows = session.journal.rows
    assert [row.station for row in rows] == [1] * 17 + [2] * 15  # row 17 was measured before anybody knew
    assert session.journal.noted("excluded") == ([17],)
    calibration = session.runner.steering.calibration()
    assert set(calibration.stations) == {"1", "2"}
    assert "17" not in calibration.ids
    errors = session.runner.steering.kept_out_errors()
    assert len(errors) > 2
    assert errors.max() < 2e-4


@pytest.mark.long
def test_drift_asks_and_a_reflector_put_back_goes_on(tmp_path: Path) -> None:
    """A reflector that sits 0.5 mm off is seen at the first pose; once it is back, that is measured again, and nothing is lost."""
    session = Session(tmp_path / "c.csv", replace(AIM, tolerance=1e-6), most=22)
    seat = session.cell.target.copy()

    def slip() -> None:
        session.cell.target = seat + np.array([5e-4, 0.0, 0.0])

    def answer(question: Question) -> Answer:
        session.asked.append(question.text)
        session.cell.target = seat.copy()
        return "again"

    session.runner.ask = answer
    session.happens = {21: slip}
    outcome = session.run()
    assert len(session.asked) == 1
    assert "first pose" in session.asked[0]
    assert outcome.state.rows == 22
    off = session.cell.points(session.journal.rows[20].joints[None])[0] - session.journal.rows[20].point
    assert np.linalg.norm(off) < 1e-4


def test_lost_beams_and_a_stop_keep_what_is_there(tmp_path: Path) -> None:
    """A beam that stays lost asks, and a pose may be left out; a stop finishes the row in hand, and resuming goes on."""
    path = tmp_path / "c.csv"
    session = Session(path, most=40)

    def lose() -> None:
        session.cell.lost_until = session.cell.now + 12.0

    session.happens, session.answers, session.stop_at = {3: lose}, ["again", "skip"], 8
    outcome = session.run()
    assert outcome.reason == "stopped"
    assert 1 <= len(session.asked) <= 2
    before = len(session.journal.rows)
    assert before in (7, 8)
    resumed = Session(path, resume=True, most=13)
    assert resumed.run().state.rows == 13
    times = [row.time_s for row in resumed.journal.rows]
    assert times[:before] == [row.time_s for row in session.journal.rows]
    assert times == sorted(times)  # the clock begins anew at zero: that is said, and times go on
    assert sum("was set back" in note for note in resumed.notes) == 1


class _Counting(Controller):
    """Records motions, and stands where it was sent."""

    can_move = True

    def __init__(self) -> None:
        self.moves: list[tuple[np.ndarray, float]] = []

    @classmethod
    def open(cls, address: str | None, robot: tc.Robot, timeout_s: float) -> "_Counting":
        return cls()

    def read(self, timeout_s: float) -> JointReading:
        return JointReading(time_s=0.0, joints=np.zeros(6))

    def move(self, joints: np.ndarray, speed_fraction: float) -> None:
        self.moves.append((joints, speed_fraction))

    def close(self) -> None:
        pass


def test_driving_begins_slowly_and_keeps_clear() -> None:
    """The first motion has a tenth of the speed; one through a keep-out box is not begun; a controller only read refuses."""
    robot = tc.load_robot("abb-irb6660-205-1.9")
    model = tc.ErrorModel(robot)
    q = tc.reach_task(model, tc.default_task(model), 1, seed=0).q[0]
    away = q + np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    controller = _Counting()
    drive = Mover(controller=controller, aim=replace(AIM, model=model), speed=0.3)
    drive.go(q, away)
    drive.go(away, q)
    assert [speed for _, speed in controller.moves] == pytest.approx([0.3 * FIRST_SPEED_SHARE, 0.3])
    middle = model.poses(0.5 * (q + away)[None])[0]
    station = Station(
        position=np.array([5.0, 0.0, 1.0]),
        reach=20.0,
        nearest=0.5,
        reflectors=(),
        keep_out=(Box(pose=middle, size=np.full(3, 0.1)),),
    )
    blocked = replace(drive, aim=replace(drive.aim, station=station))
    assert blocked.clear(q, q)
    with pytest.raises(MissedError, match="not clear"):
        blocked.go(q, away)
    assert len(controller.moves) == 2
    with pytest.raises(DeviceError, match="only read"):
        super(_Counting, controller).move(q, 0.1)
