"""Rows where a robot program stands: which pose each belongs to, whatever was left out, repeated, or in another order."""

from collections import deque
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.errors import FileError, TaskcalError
from taskcal.live.devices import Instrument, Shot
from taskcal.live.hand import Hand
from taskcal.live.journal import Journal, Row
from taskcal.live.program import NAMED_ROWS, Program, ProgramRunner
from taskcal.live.runner import Answer, Ending, Question, RunEvent
from taskcal.live.steering import Steering
from taskcal.live.stillness import Rules, Taker
from taskcal.live.virtual import VirtualController, VirtualTracker
from tests.live.test_runner import AIM, MODEL, ROBOT

PLAN = tc.plan(MODEL, AIM.task, 20, candidates=200, refine=0).q
OUT = tc.reach_task(MODEL, AIM.task, 60, seed=9).q[:8]
TURNED = PLAN[18] + 0.05 * np.eye(6)[5]  # by the last joint alone
PROGRAM = Program(
    ids=(*(f"{k + 1}" for k in range(20)), "21", *(f"{k}-kept-out" for k in range(22, 30))),
    q=np.concatenate([PLAN, TURNED[None], OUT]),
    within=Rules().arrived,
)


class Session:
    """A session in which a program moves the robot; a person who is asked knows at which pose it is."""

    def __init__(self, path: Path, visits: np.ndarray, *, by_hand: bool = False):
        self.journal = Journal(path, ROBOT)
        self.aim = replace(AIM, tolerance=None) if by_hand else AIM
        self.journal.begin({**self.aim.settings, "begun": 0.0})
        self.notes: list[str] = []
        self.asked: list[str] = []
        self.left: tuple[str, ...] = ()
        self.lies: set[int] = set()
        self.busy: int | None = None
        """Rows after which nothing is read for a while."""
        cell = VirtualController.open("3", ROBOT, 1.0).cell
        self.visited = deque(visits)
        """Those to come; the first is where the robot is."""
        controller, instrument = Ordered(cell, visits), VirtualTracker(cell)
        if by_hand:
            cell.target = np.array([0.0, 0.0, 0.05])  # so that the last joint does not move it
            controller, instrument = Hand(ROBOT, ask=lambda _: pytest.fail("no joints are typed")), Written(self, cell)
        rules = Rules(shots=1 if by_hand else 3, beam_s=3.0)
        self.taker = Taker(controller=controller, instrument=instrument, rules=rules)

    def run(self) -> Ending:
        with closing(self.journal):
            return ProgramRunner(
                steering=Steering(self.aim, self.journal),
                taker=self.taker,
                tell=self._tell,
                ask=self._ask,
                now=lambda: 0.0,
                program=PROGRAM,
            ).run()

    def _tell(self, event: RunEvent) -> None:
        if event.kind == "note":
            self.notes.append(event.text)
        if event.left is not None:
            self.left = event.left.ids
        if event.state is not None and event.kind == "state" and event.state.rows == self.busy:
            for _ in range(600):
                self.taker.controller.read(1.0)

    def _ask(self, question: Question) -> Answer:
        self.asked.append(question.text)
        true = question.text.endswith(f"pose {PROGRAM.ids[self.visited[0]]}?")
        return "yes" if true or len(self.asked) in self.lies else "no"


class Ordered(VirtualController):
    """A robot whose program goes its own way."""

    name = ""

    def __init__(self, cell, visits: np.ndarray):
        super().__init__(cell)
        self._own = PROGRAM.q[visits]

    def visits(self, joints: np.ndarray) -> None:
        self.cell.visits = list(self._own)


class Written(Instrument):
    """Points that a person measures at each pose that the program comes to."""

    streams = False

    def __init__(self, session: Session, cell):
        self._session, self._points, self._begun = session, deque(cell.points(PROGRAM.q[session.visited])), False

    @classmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> Instrument:
        raise NotImplementedError

    def read(self, timeout_s: float) -> Shot | None:
        if self._begun:
            self._session.visited.popleft()
        self._begun = True
        if not self._points:
            raise TaskcalError("the program has ended")
        return Shot(time_s=0.0, point=self._points.popleft())

    def close(self) -> None: ...


def test_rows_of_a_program_are_those_of_the_joints_read(tmp_path: Path) -> None:
    """In any order, one twice, some never: what a row is for follows from where it was, and the proof is as without a program."""
    order = np.random.default_rng(1).permutation(29)
    order = np.concatenate([order[:10], order[5:6], order[10:]])
    session = Session(tmp_path / "c.csv", order)
    outcome = session.run()
    assert (outcome.reason, session.asked) == ("proven", [])
    rows = session.journal.rows[1:]  # the first is where the robot stood before the program, which is said
    assert ["at no pose" in note for note in session.notes] == [True]
    for row, k in zip(rows, order, strict=False):
        assert np.abs(row.joints - PROGRAM.q[k]).max() < 1e-4
    said = [row.purpose for row in rows]
    assert said[10] == "reference"
    assert said[:10] == ["kept-out" if k > 20 else "chosen" for k in order[:10]]
    assert set(session.left) >= {PROGRAM.ids[k] for k in order[len(rows) :]}
    calibration, q = Steering(AIM, session.journal), tc.reach_task(MODEL, AIM.task, 100, seed=5).q
    calibration.update()
    cell = VirtualController.opened[0]
    true = np.linalg.norm(calibration.calibration().predict(q)[:, 0] - cell.points(q), axis=1)
    assert np.sqrt(np.mean(true**2)) < AIM.tolerance


def test_points_say_which_pose_of_a_program_they_are(tmp_path: Path) -> None:
    """Five are asked for; then one is left out and one comes twice; what may be either of two poses is not taken, and said."""
    order = np.array([*range(6), *range(21, 27), *range(7, 19), 18, 20, 19, 27, 28])
    session = Session(tmp_path / "c.csv", order, by_hand=True)
    with pytest.raises(TaskcalError, match="the program has ended"):
        session.run()
    assert len(session.asked) == NAMED_ROWS
    measured = [PROGRAM.at(row.joints) for row in session.journal.rows]
    assert measured == [k for k in order if k not in (18, 20)]
    assert set(session.notes) == {"no row: the target may be at one of the poses 19, 21; not taken"}
    assert set(session.left) == {"7", "19", "21"}


def test_a_pose_that_was_named_wrongly_is_refused(tmp_path: Path) -> None:
    session = Session(tmp_path / "c.csv", np.array([0, 1, 3, 4, 5, 6, 7]), by_hand=True)
    session.lies = {3}
    with pytest.raises(TaskcalError, match="do not fit their points"):
        session.run()
    assert len(session.journal.rows) == NAMED_ROWS


def test_a_robot_that_leaves_too_early_leaves_its_pose_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskcal.live.virtual.DWELL_S", 1.3)
    session = Session(tmp_path / "c.csv", np.arange(4))
    session.taker = replace(session.taker, stopped=lambda: len(session.notes) > 1)
    assert session.run().reason == "stopped"
    assert len(session.journal.rows) == 1
    assert "no row: the robot moved" in session.notes[0]


def test_a_pose_that_the_robot_left_unread_is_said(tmp_path: Path) -> None:
    """While a fit takes half a minute the program goes on."""
    session = Session(tmp_path / "c.csv", np.arange(29))
    session.aim, session.busy = replace(session.aim, most=5), 3
    session.run()
    assert ["went on while nothing was read" in note for note in session.notes] == [False, True]
    assert PROGRAM.ids[2] in session.left


def test_named_poses_are_judged_by_rows_of_their_station(tmp_path: Path) -> None:
    """After a move by those of the new place alone, however few there were at the old one."""
    session = Session(tmp_path / "c.csv", np.arange(6, 9), by_hand=True)
    points = VirtualController.opened[0].points(PROGRAM.q)
    row = Row(number=1, purpose="chosen", station=1, time_s=0.0, joints=PROGRAM.q[0], point=points[0, [1, 2, 0]])
    session.journal.append(row)
    session.journal.note({"moved": 2, "excluded": []})
    for k in range(1, 1 + NAMED_ROWS):
        session.journal.append(replace(row, number=k + 1, station=2, joints=PROGRAM.q[k], point=points[k]))
    with pytest.raises(TaskcalError, match="the program has ended"):
        session.run()
    assert [PROGRAM.at(row.joints) for row in session.journal.rows[-3:]] == [6, 7, 8]
    assert not session.asked


def test_a_plan_that_the_robot_cannot_visit_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    path.write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,-90,90,0,0,0\n0,-90,9000,0,0,0\n")
    with pytest.raises(FileError, match=r":3.*J3 = 9000"):
        Program.read(path, ROBOT)
