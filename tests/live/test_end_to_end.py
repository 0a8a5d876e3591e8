"""A simulated robot and tracker behind counterparts of real protocols, in real time: what the loop makes of them."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.geometry import se3
from taskcal.live.devices import Controller, DeviceError, Instrument, controller_of, instrument_of
from taskcal.live.journal import Journal, Row
from taskcal.live.runner import Answer, Question, RunEvent, Runner
from taskcal.live.steering import Aim, Steering
from taskcal.live.stillness import Rules, Taker
from taskcal.live.virtual import VirtualCell
from tests.taskcal_devices.peers import PATIENCE_S, OpcUaPeer, RtdePeer, point_stamped, relayed, rosbridge, serving

ROBOT = tc.load_robot("ur5")
MODEL = tc.ErrorModel(ROBOT)
AIM = Aim(model=MODEL, task=tc.default_task(MODEL), seed=3, candidates=60, effects=False)
RULES = Rules(settle_s=0.25, max_speed=5e-4, beam_s=PATIENCE_S, tries=20)
"""Faster than on a real robot, which rings; the noise of the joints is that of the simulated one. On a busy machine readings stay
away for a while, which is no standstill."""

LATENCY_S, PERIOD_S, LOST = 0.02, 0.01, 0.02
"""Of the tracker: from a shot to its arrival, between two shots, and the share of shots at which the beam is lost."""

MOTION_S = 0.1


@dataclass
class LiveCell:
    """The simulated robot in real time, where a person goes to each pose that is shown, or nearly."""

    cell: VirtualCell = field(default_factory=lambda: VirtualCell.drawn(ROBOT, 3))
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))
    lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        self.start, self.goal, self.begun = self.cell.start, self.cell.goal, -np.inf

    def go(self, q: np.ndarray) -> None:
        with self.lock:
            self.start, self.begun = self._at(time.monotonic()), time.monotonic()
            self.goal = q + 2e-3 * self.rng.normal(size=len(q))

    def _at(self, when: float) -> np.ndarray:
        return self.start + min(max((when - self.begun) / MOTION_S, 0.0), 1.0) * (self.goal - self.start)

    def joints(self) -> np.ndarray:
        with self.lock:
            return self._at(time.monotonic()) + 2e-6 * self.rng.normal(size=len(self.goal))

    def shots(self) -> Iterator[tuple[np.ndarray, float]]:
        """Points, metres, NaN where the beam is lost, and when they were measured; each after its latency."""
        while True:
            measured = time.monotonic()
            with self.lock:
                point = self.cell.points(self._at(measured)[None])[0] + 1e-5 * self.rng.normal(size=3)
                seen = self.rng.random() > LOST
            time.sleep(LATENCY_S)
            yield point if seen else np.full(3, np.nan), measured


@contextmanager
def rtde(cell: LiveCell) -> Iterator[tuple[str, str]]:
    with serving(RtdePeer(joints=cell.joints, period_s=0.005)) as at:
        yield "rtde", at


@contextmanager
def opcua(cell: LiveCell) -> Iterator[tuple[str, str]]:
    peer, done = OpcUaPeer({"Arm": {f"A{k}": "deg" for k in range(1, 7)}}), threading.Event()

    def write() -> None:
        while not done.wait(0.01):
            for k, q in enumerate(np.degrees(cell.joints()), 1):
                peer.positions["Arm", f"A{k}"].write_value(float(q))

    writer = threading.Thread(target=write)
    writer.start()
    try:
        yield "opcua", peer.address
    finally:
        done.set()
        writer.join()
        peer.stop()


@contextmanager
def tcp(cell: LiveCell) -> Iterator[tuple[str, str]]:
    def serve(connection) -> None:
        connection.sendall(b"x_mm y_mm z_mm\n")
        for point, _ in cell.shots():
            line = " ".join(f"{value:.6f}" for value in 1e3 * np.nan_to_num(point)) + "\r\n"
            connection.sendall(line[:9].encode())
            connection.sendall(line[9:].encode())

    with serving(serve) as at:
        yield "tcp", at


@contextmanager
def ros_points(cell: LiveCell) -> Iterator[tuple[str, str]]:
    def messages(topic: str) -> Iterator[dict]:
        for point, measured in cell.shots():
            yield point_stamped(point, 1e9 + measured)

    with rosbridge(messages) as at:
        yield "ros", f"{at}/tracker/point"


def unexpected(question: Question) -> Answer:
    pytest.fail(question.text)


def session(
    cell: LiveCell,
    path: Path,
    read: Controller,
    seen: Instrument,
    happens: dict[int, Callable],
    ask: Callable[[Question], Answer] = unexpected,
    most: int = 14,
) -> Runner:
    """A session, which goes on with a campaign that is there; something may happen as a pose is shown."""
    journal, resume = Journal(path, ROBOT), path.exists()
    (journal.resume if resume else journal.begin)(AIM.settings if resume else {**AIM.settings, "begun": time.time()})

    def person(event: RunEvent) -> None:
        if event.kind == "pose" and event.step is not None:
            cell.go(event.step.q)
            happens.pop(event.step.number, lambda: None)()

    taker = Taker(controller=read, instrument=seen, rules=RULES)
    steering = Steering(replace(AIM, most=most), journal)
    return Runner(steering=steering, taker=taker, tell=person, ask=ask)


Peer = Callable[[LiveCell], AbstractContextManager[tuple[str, str]]]


@pytest.mark.long
@pytest.mark.parametrize(("joints", "points"), [(rtde, tcp), (opcua, ros_points)])
def test_rows_are_the_truth_and_give_the_offline_result(joints: Peer, points: Peer, tmp_path: Path) -> None:
    """Noise, latency and lost beams on both connections, one of which is cut on the way, and made again."""
    cell, path = LiveCell(), tmp_path / "c.csv"
    with joints(cell) as (controller, at), points(cell) as (instrument, seen_at), relayed(at) as (relay, cut):

        @contextmanager
        def connected() -> Iterator[tuple[Controller, Instrument]]:
            with (
                controller_of(controller).open(relay, ROBOT, PATIENCE_S) as read,
                instrument_of(instrument).open(seen_at, PATIENCE_S) as seen,
            ):
                yield read, seen

        with connected() as devices:
            runner = session(cell, path, *devices, {6: cut})
            with pytest.raises(DeviceError, match=f"'{controller}' at {relay} was lost"):
                runner.run()
        runner.steering.journal.close()
        begun = path.read_text()
        with connected() as devices:
            runner = session(cell, path, *devices, {})
            assert runner.run().reason == "most"
    assert path.read_text().startswith(begun)
    assert begun.count("\n") == 6  # a header, and the rows before the cut
    campaign = tc.read_campaign(path, ROBOT)
    off = np.linalg.norm(cell.cell.points(campaign.q) - campaign.points[:, 0], axis=1)
    assert len(off) == 14
    assert off.max() < 5e-5
    chosen = np.flatnonzero([row.purpose == "chosen" for row in runner.steering.journal.rows])
    live, offline = runner.steering.calibration(), tc.identify(MODEL, campaign.take(chosen))
    np.testing.assert_allclose(live.predict(campaign.q), offline.predict(campaign.q), rtol=0, atol=1e-9)


SLIPPED, MOVED, LAST = 15, 17, 23
"""Rows: shown as the reflector slips, as the tracker is moved, and the last one."""


def begun(cell: LiveCell, path: Path) -> None:
    """A campaign of its first poses, as measured before."""
    journal = Journal(path, ROBOT)
    journal.begin({**AIM.settings, "begun": time.time()})
    steering = Steering(AIM, journal)
    for number in range(1, SLIPPED):
        step, _ = steering.next(steering.update())
        q, at = step.q, cell.cell.points(step.q[None])[0] + 1e-5 * cell.rng.normal(size=3)
        journal.append(Row(number=number, purpose=step.purpose, station=1, time_s=20.0 * number, joints=q, point=at))
    journal.close()


@pytest.mark.long
def test_slipped_reflector_and_moved_tracker_leave_no_trace(tmp_path: Path) -> None:
    """Both are noticed at once and asked about; what was measured wrongly is not fitted, and the rest is the truth.

    Rows that count no more call for a fit while the new station has too few rows to be fitted.
    """
    cell, path, asked = LiveCell(), tmp_path / "c.csv", list[str]()
    begun(cell, path)
    seat, first = cell.cell.target, cell.cell.T_tracker_base
    second = se3.pose(se3.exp(np.array([0.0, 0.0, 0.4])), np.array([0.3, 0.1, 0.0])) @ first

    def slip() -> None:
        cell.cell.target = seat + np.array([3e-3, 0.0, 0.0])

    def move() -> None:
        cell.cell.T_tracker_base = second

    def answer(question: Question) -> Answer:
        asked.append(question.text)
        cell.cell.target = seat
        return "again" if len(asked) == 1 else "moved"

    with (
        rtde(cell) as (controller, at),
        tcp(cell) as (instrument, seen_at),
        controller_of(controller).open(at, ROBOT, PATIENCE_S) as read,
        instrument_of(instrument).open(seen_at, PATIENCE_S) as seen,
    ):
        runner = session(cell, path, read, seen, {SLIPPED: slip, MOVED: move}, answer, LAST)
        assert runner.run().reason == "most"
    assert len(asked) == 2
    steering = runner.steering
    rows = steering.journal.rows
    wrong = {number for numbers in steering.journal.noted("excluded") for number in numbers}
    assert wrong == {SLIPPED, MOVED}
    for row in rows:
        if row.number not in wrong:
            cell.cell.T_tracker_base = first if row.station == 1 else second
            assert np.linalg.norm(cell.cell.points(row.joints[None])[0] - row.point) < 5e-5, row.id
    assert {row.station for row in rows} == {1, 2}
    chosen = [row.number - 1 for row in rows if row.purpose == "chosen" and row.number not in wrong]
    campaign = tc.read_campaign(path, ROBOT).take(chosen)
    live, offline = steering.calibration(), tc.identify(MODEL, campaign)
    assert set(live.stations) == {"1", "2"}
    np.testing.assert_allclose(live.predict(campaign.q), offline.predict(campaign.q), rtol=0, atol=1e-9)
