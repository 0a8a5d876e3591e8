"""Measuring live without a tracker: what the loop makes of seated balls and of lengths."""

import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.errors import UnitError
from taskcal.geometry import se3
from taskcal.live.devices import DeviceError
from taskcal.live.hand import Hand, HandReadings
from taskcal.live.journal import Journal, Row
from taskcal.live.runner import Answer, Ending, Question, RunEvent, Runner
from taskcal.live.steering import Aim, Steering
from taskcal.live.stillness import SEATED_WITHIN, MissedError, Rules, Taker
from taskcal.live.virtual import VirtualController, VirtualTracker
from taskcal.observations import Instrument, instrument_classes
from taskcal.observations.calibration_board import board_text
from taskcal.observations.point import Tracker
from taskcal.reading import ReadOptions
from taskcal_devices.folder import Folder
from tests.planning.without_tracker import CAMERA

ROBOT = tc.load_robot("ur5")
MODEL = tc.ErrorModel(ROBOT)
TASK = tc.default_task(MODEL)
TOOL = se3.translation(0.0, 0.0, 0.1)

BOARD = {
    "kind": "charuco", "columns": 6, "rows": 5, "square_mm": 50.0, "marker_mm": 36.0, "dictionary": "5X5_100",
    "measured": {"length_mm": 100.0, "u_mm": 0.02},
}  # fmt: skip


def instrument(name: str, folder: Path) -> tuple[Instrument, ReadOptions]:
    """An instrument in the task's cell; of sockets with a stated distance, which alone tells the robot's size."""
    if name == "pixels":
        board = folder / "board.toml"
        board.write_text(board_text(BOARD))
        observed = instrument_classes()[name].set_up(MODEL, TASK, TOOL, board=board, camera=CAMERA)
        return observed, ReadOptions(board=board)
    if name != "socket":
        return instrument_classes()[name].set_up(MODEL, TASK, TOOL), ReadOptions()
    stated = folder / "distances.csv"
    stated.write_text("socket_a,socket_b,distance_mm,u_mm\na,b,100,0.02\n")
    return instrument_classes()[name].set_up(MODEL, TASK, TOOL, distances=stated), ReadOptions(distances=stated)


class Session:
    """A session on a virtual robot, whose person goes near the pose shown, and seats there what touches."""

    def __init__(self, path: Path, name: str, *, resume: bool = False, most: int, tolerance: float = 2e-3):
        self.observed, self.options = instrument(name, path.parent)
        aim = Aim(
            model=MODEL, task=TASK, tolerance=tolerance, seed=3, candidates=100, effects=False,
            observe=self.observed, most=most,
        )  # fmt: skip
        self.journal = Journal(path, ROBOT, observe=self.observed, options=self.options)
        (self.journal.resume if resume else self.journal.begin)(
            aim.settings if resume else {**aim.settings, "begun": 0.0}
        )
        controller = VirtualController.open("3", ROBOT, 1.0)
        self.cell = controller.cell
        tracker = VirtualTracker.open(None, 1.0)
        tracker.observes(self.observed)
        tracker.knows([row.image for row in self.journal.rows])
        kind = self.observed.kind
        self.taker = Taker(
            controller=controller,
            instrument=tracker,
            rules=Rules(arrived=SEATED_WITHIN if kind.touched else Rules.arrived, shots=1 if kind.pictured else 3),
            kind=kind.key,
        )
        self.steering = Steering(aim, self.journal)
        self.runner = Runner(steering=self.steering, taker=self.taker, tell=self._tell, ask=self._ask, now=lambda: 0.0)

    def run(self) -> Ending:
        """Measure, and let others go on with the campaign."""
        with closing(self.journal):
            return self.runner.run()

    def _tell(self, event: RunEvent) -> None:
        pass

    def _ask(self, question: Question) -> Answer:
        raise AssertionError(question.text)


def test_a_person_reads_and_says_when_it_is_seated(tmp_path: Path) -> None:
    """Enter confirms a ball in its socket, a number is a length in the column's unit; a word and another count are asked for
    again, and *no* leaves the pose out."""
    answers: list[str] = []
    asked: list[str] = []

    def ask(text: str) -> str:
        asked.append(text)
        return answers.pop(0)

    with HandReadings.open(None, 1.0) as hand:
        hand.asks(ask)
        hand.observes(instrument("socket", tmp_path)[0])
        hand.show("second/b")
        answers[:] = ["seated", ""]
        shot = hand.read(0.0)
        assert shot is not None
        assert (shot.kind, shot.valid, len(asked)) == ("socket", True, 2)
        assert all("second/b" in text for text in asked)
        hand.observes(instrument("wire", tmp_path)[0])
        hand.show("left")
        answers[:] = ["1 2", "long", "1250,5"]
        shot = hand.read(0.0)
        assert shot is not None
        np.testing.assert_allclose(shot.point, [1.2505, 0.0, 0.0])
        assert "d_mm" in asked[-1]
        answers[:] = ["no"]
        with pytest.raises(MissedError, match="left"):
            hand.read(0.0)
        with pytest.raises(DeviceError, match="--observe"):
            hand.observes(Tracker())


def test_a_person_types_both_reading_and_joints_once(tmp_path: Path) -> None:
    """Where joints and readings are typed, a row is one answer for each; none is taken for what was measured before."""
    pose = np.radians([10.0, -90.0, 90.0, -90.0, 90.0, 0.0])
    answers = ["", "10 -90 90 -90 90 0"]
    with Hand.open(None, ROBOT, 1.0) as joints, HandReadings.open(None, 1.0) as hand:
        joints.asks(lambda _: answers.pop(0), SEATED_WITHIN)
        hand.asks(lambda _: answers.pop(0))
        hand.observes(instrument("socket", tmp_path)[0])
        joints.show(pose)
        hand.show("second/b")
        taken = Taker(controller=joints, instrument=hand, rules=Rules(shots=1), kind="socket").take(pose)
    np.testing.assert_allclose(taken.joints, pose)
    assert (answers, taken.shots) == ([], 1)


def test_a_line_of_another_fixture_or_kind_is_not_taken(tmp_path: Path) -> None:
    """What a folder's line names has to be what is measured."""
    written = tmp_path / "lengths.txt"
    written.write_text("d_mm anchor\n")
    controller = VirtualController.open("3", ROBOT, 1.0)
    with Folder.open(str(written), 1.0) as folder:
        folder.observes(instrument("wire", tmp_path)[0])
        taker = Taker(controller=controller, instrument=folder, rules=Rules(shots=1, tries=1), kind="distance")
        with written.open("a") as file:
            file.write("812.5 right\n812.5 right\n")
        time.sleep(0.2)
        controller.cell.now = time.monotonic() - 2.0  # it stands for the time to settle before the line
        with pytest.raises(MissedError, match="'right' was measured, and not 'left'"):
            taker.take(None, fixture="left")
        with pytest.raises(DeviceError, match="distance"):
            replace(taker, kind="point").take(None)


def test_lengths_in_metres_are_refused_after_eight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Long before the first fit, as soon as an anchor has so many that their unit is seen."""
    session = Session(tmp_path / "c.csv", "wire", most=40)
    shot = session.cell.shot
    monkeypatch.setattr(session.cell, "shot", lambda: replace(one := shot(), point=one.point * 1e-3))
    with pytest.raises(UnitError, match="metres where millimetres are"):
        session.run()
    at = [row.fixture for row in session.journal.rows]
    assert max(map(at.count, at)) == 8


def test_distances_of_sockets_left_out_do_not_count(tmp_path: Path) -> None:
    """What is stated of a socket that no row names, as of one that a person leaves out, hinders no fit of the others."""
    stated = tmp_path / "d.csv"
    stated.write_text("socket_a,socket_b,distance_mm,u_mm\nfirst/a,first/b,100,0.02\nsecond/a,second/b,100.5,0.03\n")
    observed = instrument_classes()["socket"].set_up(MODEL, TASK, TOOL, distances=stated)
    journal = Journal(tmp_path / "c.csv", ROBOT, observe=observed, options=ReadOptions(distances=stated))
    journal.begin({})
    for number, name in enumerate(["first/a", "second/a", "second/b"], 1):
        journal.append(
            Row(
                number=number,
                purpose="chosen",
                station=1,
                time_s=number,
                joints=0.1 * np.arange(6),
                point=np.zeros(3),
                fixture=name,
            )
        )
    journal.close()
    (both,), (alone,) = (journal.campaign(np.arange(count)).observations for count in (3, 2))
    assert both.stated_text() == "socket_a,socket_b,distance_mm,u_mm\nsecond/a,second/b,100.500000,0.030000\n"
    assert (both.tells_scale, alone.tells_scale) == (True, False)


@pytest.mark.long
@pytest.mark.parametrize("name", ["socket", "wire"])
def test_without_a_tracker_it_ends_as_consistent_never_proven(tmp_path: Path, name: str) -> None:
    """The calibration is that of the same rows offline, the truth is as expected, and resuming knows all that was measured."""
    session = Session(tmp_path / "c.csv", name, most=80)
    outcome = session.run()
    assert (outcome.reason, outcome.state.proven, outcome.state.consistent) == ("consistent", False, True)
    calibration, rows = session.steering.calibration(), session.journal.rows
    chosen = [row.number - 1 for row in rows if row.purpose == "chosen"]
    campaign = tc.read_campaign(session.journal.path, ROBOT, options=session.options)
    offline = tc.identify(MODEL, campaign.take(chosen))
    np.testing.assert_allclose(calibration.z, offline.z, atol=1e-9)
    again = Session(tmp_path / "c.csv", name, resume=True, most=80)
    again.journal.close()
    for row, same in zip(rows, again.journal.rows, strict=True):
        assert (row.id, row.fixture, row.time_s) == (same.id, same.fixture, same.time_s)
        np.testing.assert_array_equal([*row.joints, *row.point], [*same.joints, *same.point])
    assert_as_expected(session, outcome)


@pytest.mark.long
def test_images_end_as_consistent_and_resume_as_they_were(tmp_path: Path) -> None:
    """The calibration is that of the chosen rows and the file of corners offline; a session that goes on knows the same."""
    path = tmp_path / "c.csv"
    first = Session(path, "pixels", most=13, tolerance=1e-3)
    assert first.run().reason == "most"
    session = Session(path, "pixels", resume=True, most=80, tolerance=1e-3)
    outcome = session.run()
    assert (outcome.reason, outcome.state.proven, outcome.state.consistent) == ("consistent", False, True)
    calibration, rows = session.steering.calibration(), session.journal.rows
    header, *lines = path.read_text().splitlines(keepends=True)
    own = "".join(line for line, row in zip(lines, rows, strict=True) if row.purpose == "chosen")
    (tmp_path / "chosen.csv").write_text(header + own)
    board, corners = tmp_path / "board.toml", tmp_path / "c.corners.csv"
    for name, ids in (("c.csv", tuple(row.id for row in rows)), ("chosen.csv", calibration.ids)):
        campaign = tc.read_campaign(tmp_path / name, ROBOT, options=ReadOptions(board=board, images=corners))
        assert campaign.ids == ids
    np.testing.assert_allclose(calibration.z, tc.identify(MODEL, campaign).z, atol=1e-9)
    again = Session(path, "pixels", resume=True, most=80, tolerance=1e-3)
    with closing(again.journal):
        state = again.steering.update()
    np.testing.assert_allclose(state.kept_out, outcome.state.kept_out, rtol=1e-9)
    assert state.consistent
    assert_as_expected(session, outcome)


@pytest.mark.long
def test_a_landmark_in_a_wrist_sensor_is_fitted(tmp_path: Path) -> None:
    """After the rows that the landmarks need the error over the task is known, and as expected."""
    session = Session(tmp_path / "c.csv", "camera", most=15)
    outcome = session.run()
    assert outcome.reason == "most"
    assert_as_expected(session, outcome)


def assert_as_expected(session: Session, outcome: Ending) -> None:
    assert outcome.state.budget is not None
    low, high = outcome.state.budget.interval
    assert low < high <= 2e-3
    assert true_error(session, session.steering.calibration()) < 2.0 * high


def true_error(session: Session, calibration: tc.Calibration) -> float:
    """Of the target over the task, wherever the base is: rms in space, metres."""
    assert session.cell.scene is not None
    q = tc.reach_task(MODEL, TASK, 100, seed=5).q
    found = calibration.predict(q)[:, 0]
    true = (session.cell.model.poses(q, session.cell.x) @ session.cell.scene.T_tool_target)[:, :3, 3]
    off, about = found - true, true - true.mean(axis=0)
    rigid = se3.by_twist(about).reshape(-1, 6)
    left = off.reshape(-1) - rigid @ np.linalg.lstsq(rigid, off.reshape(-1), rcond=None)[0]
    return float(np.sqrt(np.mean(np.sum(left.reshape(-1, 3) ** 2, axis=1))))
