"""The loop: shows a pose, takes its row, writes it, and judges; events go out and answers come in, with no terminal in between."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import median
from typing import Literal

import numpy as np
from jaxtyping import Float

from taskcal.kinematics.clearance import clear_of_boxes, clear_of_itself, place_links
from taskcal.live.devices import Controller
from taskcal.live.journal import Journal, Row
from taskcal.live.steering import Aim, MeasurementPose, State, Steering
from taskcal.live.stillness import MissedError, StoppedError, Taken, Taker
from taskcal_groundwork.said import Said

Answer = Literal["again", "skip", "moved", "keep", "yes", "no", "stop"]
"""Measure again; leave the pose out; the tracker was moved, and stands elsewhere from now on; go on as it is; the robot is at the
pose that is named, or at another one; stop."""

MEANINGS: dict[Answer, str] = {
    "again": "measure again (once ball or reflector is back in its place, the beam is there, …)",
    "skip": "leave this pose out",
    "moved": "the tracker was moved: a new station from here on",
    "keep": "go on as it is",
    "yes": "the robot is at this pose",
    "no": "it is at another pose",
    "stop": "stop; the rows stay, and --resume goes on",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class RunEvent:
    """What happened; of some kinds one field has it."""

    kind: Literal["pose", "left", "row", "state", "note"]
    text: Said | None = None
    """In words, of a note."""
    step: MeasurementPose | None = None
    taken: Taken | None = None
    state: State | None = None
    next_error: float | None = None
    """Expected over the task after the pose that is shown, metres."""
    left: "Left | None" = None
    pose_s: float | None = None
    """Time that a pose takes, median of the last ones, seconds."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Left:
    """What a robot program still has to visit."""

    ids: tuple[str, ...]
    """Of its poses that were not measured, those first that bring most."""
    next_error: float | None
    """Expected over the task after the one that brings most, metres; None before the first fit, and where no such pose is left."""
    all: float | None
    """Expected after all of them, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Question:
    """Asked where a person has to decide."""

    text: Said
    answers: tuple[Answer, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Ending:
    """How it ended."""

    state: State
    reason: Literal["proven", "consistent", "most", "visited", "stopped"]


FIRST_SPEED_SHARE = 0.1
"""Of the speed limit, with which the robot is driven to the first pose, so that a person sees in time where it goes."""

PATH_STEP = float(np.radians(2.0))
"""Between postures at which a motion is checked for clearance, radians or metres: 3.5 % of the arm's length at most."""

PACE_ROWS = 10
"""Last rows whose time counts for that of the next. A convention."""


@dataclass(eq=False, kw_only=True)
class Mover:
    """Moves the robot, joint by joint on a straight way, if that is clear."""

    controller: Controller
    aim: Aim
    speed: float
    """Share of the joints' largest speeds."""
    first: bool = True

    def clear(self, start: Float[np.ndarray, " joints"], end: Float[np.ndarray, " joints"]) -> bool:
        """Whether links meet neither each other nor the station's boxes on the way, as far as the files state these."""
        steps = max(int(np.ceil(np.abs(end - start).max() / PATH_STEP)), 1)
        q = start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - start)
        links = place_links(self.aim.model, q)
        return bool((clear_of_itself(links) & clear_of_boxes(links, self.aim.instrument.obstacles)).all())

    def go(self, start: Float[np.ndarray, " joints"], end: Float[np.ndarray, " joints"]) -> None:
        """Begin the motion, the first one slowly.

        Raises:
            MissedError: the way is not clear.
            DeviceError: the controller refuses.
        """
        if not self.clear(start, end):
            raise MissedError(
                "the straight way of all joints to the pose is not clear; jog the robot there, and measure again"
            )
        self.controller.move(end, self.speed * (FIRST_SPEED_SHARE if self.first else 1.0))
        self.first = False


@dataclass(eq=False, kw_only=True)
class Runner:
    """One session of a campaign."""

    steering: Steering
    taker: Taker
    tell: Callable[[RunEvent], None]
    ask: Callable[[Question], Answer]
    drive: Mover | None = None
    """None where the robot is moved by a person or a program of its own."""
    now: Callable[[], float] = time.time
    """Seconds since 1970."""

    def __post_init__(self) -> None:
        self._doubt = self._asked_again = False
        self._here: Float[np.ndarray, " joints"] | None = None
        since_s = self.now() - float(self._journal.settings["begun"])
        last_s = max((row.time_s for row in self._journal.rows), default=0.0)
        self._base_s, self._set_back = max(since_s, last_s), since_s < last_s
        self._first_s: float | None = None

    @property
    def _journal(self) -> Journal:
        return self.steering.journal

    def run(self) -> Ending:
        """Measure until it is proven, there are enough rows, or the person stops; every row is on the disk before the next.

        Raises:
            TaskcalError: a connection is lost, the disk refuses, or no pose is left; what was measured stays.
        """
        if self._journal.dropped:
            self._note(Said("a line that was half-written when the last session ended was taken off"))
        if self._set_back:
            self._note(
                Said("this computer's clock was set back since the last session: times go on behind the last row's")
            )
        state = State(rows=0)
        try:
            while True:
                state = self.steering.update()
                if (outcome := self._pose(state)) is not None:
                    return outcome
        except StoppedError:
            return Ending(state=state, reason="stopped")

    def _note(self, text: Said) -> None:
        """Tell something in words."""
        self.tell(RunEvent(kind="note", text=text))

    def _pose(self, state: State) -> Ending | None:
        """One pose, from its choice to its row; or how it ended."""
        if (outcome := self._ended(state)) is not None:
            return outcome
        step, error = self.steering.next(state, doubt=self._doubt, clear=self._clear())
        self.tell(RunEvent(kind="pose", step=step, state=state, next_error=error))
        row = self._row(step)
        if row is None:
            self.steering.skip(step)
        else:
            self._journal.append(row)
        return None

    def _ended(self, state: State) -> Ending | None:
        """Tell what is known; how it ended, if it did."""
        self.tell(RunEvent(kind="state", state=state, pose_s=self._pace()))
        if state.proven or state.consistent:
            return Ending(state=state, reason="proven" if state.proven else "consistent")
        if state.rows >= self.steering.aim.most:
            return Ending(state=state, reason="most")
        if self.taker.stopped():
            return Ending(state=state, reason="stopped")
        return None

    def _clear(self) -> Callable[[Float[np.ndarray, " joints"]], bool] | None:
        drive, here = self.drive, self._here
        return None if drive is None or here is None else lambda q: drive.clear(here, q)

    def _pace(self) -> float | None:
        times = [row.time_s for row in self._journal.rows[-PACE_ROWS - 1 :]]
        return median(np.diff(times)) if len(times) > 1 else None

    def _decide(self, text: Said, *answers: Answer) -> Answer:
        """The person's answer.

        Raises:
            StoppedError: it is to stop.
        """
        answer = self.ask(Question(text=text, answers=(*answers, "stop")))
        if answer == "stop":
            raise StoppedError
        return answer

    def _row(self, step: MeasurementPose) -> Row | None:
        """The row of a pose; None where it is left out."""
        go = True
        while True:
            try:
                row = self._measured(step, go=go)
            except MissedError as missed:
                if self._decide(missed.said, "again", "skip") == "skip":
                    self._doubt = False
                    return None
                continue
            if step.purpose == "reference":
                answer = self._compare(row)
                if answer == "again":
                    go = False
                    continue
                return replace(row, station=self.steering.station)
            return self._checked(step, row)

    def _measured(self, step: MeasurementPose, *, go: bool = True) -> Row:
        """Go to a pose and measure; or measure where the robot is.

        Raises:
            MissedError: it does not arrive, or the target is not seen.
            StoppedError: the person asked to stop.
        """
        controller = self.taker.controller
        if go and self.drive is not None:
            here = controller.read(self.taker.rules.read_s).joints
            self.drive.go(here, step.q)
        elif go:
            controller.show(step.q)
        if go:
            self.taker.instrument.show(step.fixture)
        return self._row_of(step, self.taker.take(step.q, fixture=step.fixture))

    def _row_of(self, step: MeasurementPose, taken: Taken) -> Row:
        """A row that was taken, which is told."""
        self.tell(RunEvent(kind="row", step=step, taken=taken))
        self._here = taken.joints
        self._first_s = taken.time_s if self._first_s is None else self._first_s
        return Row(
            number=step.number,
            purpose=step.purpose,
            station=self.steering.station,
            time_s=self._base_s + taken.time_s - self._first_s,
            joints=taken.joints,
            point=taken.point,
            fixture=step.fixture,
            corners=taken.corners,
        )

    def _checked(self, step: MeasurementPose, row: Row) -> Row:
        """A row as it is expected; or the second of two that agree, where it is not."""
        off = self.steering.surprise(row)
        if off is None:
            return row
        self._note(Said("the target is {off_mm:.3f} mm from where it is expected: measured again", off_mm=off * 1e3))
        again = self._measured(step, go=False)
        if (still := self.steering.surprise(again)) is None:
            self._note(Said("the second measurement is as expected; the first was wrong, and is dropped"))
            return again
        self._note(
            Said("twice the same: kept, {off_mm:.3f} mm off; the first pose is measured again next", off_mm=still * 1e3)
        )
        self._journal.note({"surprise": row.number})
        self._doubt = True
        return again

    def _compare(self, row: Row) -> Answer:
        """Compare the reference pose with what it was, and ask where it has moved; wrong rows before it was mended do not count.

        Raises:
            StoppedError: the person stops.
        """
        self._doubt = False
        off = self.steering.drift(row)
        if off is None:
            if self._asked_again and (wrong := self._surprises()):
                self._journal.note({"excluded": wrong})
            self._asked_again = False
            return "keep"
        tracked = self.steering.aim.instrument.kind.in_tracker
        off_mm = off * 1e3
        if tracked:
            said = Said(
                "at the first pose, measured again, the target is {off_mm:.3f} mm from where it was: reflector or tracker was "
                "moved, or the robot",
                off_mm=off_mm,
            )
        else:
            said = Said(
                "at the first pose of '{fixture}', measured again, the target is {off_mm:.3f} mm from where it was: what stands "
                "there was moved, or the robot",
                fixture=row.fixture,
                off_mm=off_mm,
            )
        answers: tuple[Answer, ...] = ("again", "moved", "keep") if tracked else ("again", "keep")
        answer = self._decide(said, *answers)
        self._asked_again = answer == "again"
        if answer == "moved":
            self._journal.note({"moved": row.number, "excluded": self._surprises()})
        return answer

    def _surprises(self) -> list[int]:
        """Numbers of the rows since the last reference that were not where they were expected."""
        last = max((one.number for one in self._journal.rows if one.purpose == "reference"), default=0)
        return [number for number in self._journal.noted("surprise") if number > last]
