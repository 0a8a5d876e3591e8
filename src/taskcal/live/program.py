"""Rows wherever a robot program stands: each belongs to a pose by the joints that were read, or by its point, never by number."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError, FileError, TaskcalError, listed
from taskcal.identification.calibration import residuals_on
from taskcal.identification.identify import fit_nominal
from taskcal.identification.options import FitOptions
from taskcal.live.journal import Purpose, Row
from taskcal.live.runner import Ending, Left, RunEvent, Runner
from taskcal.live.steering import KEPT_OUT_EVERY, MIN_KEPT_OUT, REFERENCE_EVERY, MeasurementPose, State, as_campaign
from taskcal.live.stillness import MissedError, Rules, Taken
from taskcal.reading.joints import no_joint, read_joints
from taskcal.robot.robot import Robot
from taskcal.tables.forms import read_csv
from taskcal_groundwork.said import Said

NAMED_ROWS = 5
"""Rows whose poses a person names where no joints are read; fifteen numbers for the nine of tracker frame and target."""

NOMINAL_WITHIN_M = 0.02
"""Of the nominal robot, with tracker frame and target found from rows, within which a point may be a pose's: five times the mean
error of the worst of five measured robots (4.1 mm)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Program:
    """Poses that a robot program visits, in its order."""

    ids: tuple[str, ...]
    """As `Row.id` has them: they state what each is for."""
    q: Float[np.ndarray, "n joints"]
    """Radians."""
    within: float
    """All joints nearer than that are the pose, radians or metres."""

    @classmethod
    def read(cls, path: Path, robot: Robot) -> "Program":
        """Read the table that ``taskcal plan`` wrote beside the program.

        Raises:
            FileError: it has no joints of the robot, no rows, or a pose beyond the robot's limits.
        """
        table = read_csv(path)
        q = read_joints(table, robot)
        if q is None:
            raise table.header_error(no_joint(robot, 0))
        if not len(q):
            raise FileError(path, "has no poses; give the table that taskcal plan wrote with the program (-o)")
        if beyond := robot.outside_limits(q):
            row, reason = beyond[0]
            raise table.error(f"{reason}; give the table that taskcal plan wrote for this robot", row)
        ids = table.texts("id") if "id" in table else [str(row + 1) for row in range(len(q))]
        return cls(ids=tuple(ids), q=q, within=Rules.arrived)

    @classmethod
    def of(cls, q: Float[np.ndarray, "n joints"], out: Float[np.ndarray, "m joints"]) -> "Program":
        """Poses for the fit, with others in among them that are kept out to judge it, and the first one again and again.

        Args:
            q: for the fit, in the order of visiting, radians.
            out: poses of the task that chance chose, radians.
        """
        ids, visits, fitted, kept = list[str](), list[np.ndarray](), list(q), list(out)
        while fitted or kept:
            number = len(ids) + 1
            if number > 1 and number % REFERENCE_EVERY == 1:
                purpose, pose = "-reference", q[0]
            elif kept and (number % KEPT_OUT_EVERY == 0 or not fitted):
                purpose, pose = "-kept-out", kept.pop(0)
            else:
                purpose, pose = "", fitted.pop(0)
            ids.append(f"{number}{purpose}")
            visits.append(pose)
        return cls(ids=tuple(ids), q=np.stack(visits), within=Rules.arrived)

    def ids_for(self, purpose: Purpose) -> Bool[np.ndarray, " n"]:
        """Which poses state a purpose."""
        return np.array([one.endswith(f"-{purpose}") for one in self.ids])

    def near(self, joints: Float[np.ndarray, " joints"]) -> Bool[np.ndarray, " n"]:
        """Which poses joints are at."""
        return np.abs(self.q - joints).max(axis=1) <= self.within

    def at(self, joints: Float[np.ndarray, " joints"]) -> int | None:
        """The pose that joints are nearest to; None where they are at none."""
        off = np.abs(self.q - joints).max(axis=1)
        return int(off.argmin()) if off.min() <= self.within else None

    def left(self, rows: Sequence[Row]) -> Int[np.ndarray, " k"]:
        """Poses that no row was measured at."""
        done = np.zeros(len(self.q), dtype=bool)
        for row in rows:
            done |= self.near(row.joints)
        return np.flatnonzero(~done & ~self.ids_for("reference"))


@dataclass(eq=False, kw_only=True)
class ProgramRunner(Runner):
    """A session in which a program of the controller's own moves the robot.

    A row is taken wherever the robot stands. Poses may be left out, repeated, and in any order.
    """

    program: Program

    def __post_init__(self) -> None:
        super().__post_init__()
        self.taker = replace(self.taker, rules=replace(self.taker.rules, tries=1))
        self._leaves = True
        self._noted: Said | None = None
        self._read_s: float | None = None
        """When the joints of the last row were read, until the next are."""
        self._point: Float[np.ndarray, " 3"] | None = None
        if self._journal.rows:
            self._here, self._point = self._journal.rows[-1].joints, self._journal.rows[-1].point

    def run(self) -> Ending:
        """As `Runner.run`, until every pose of the program is measured at the latest."""
        out = int(self.program.ids_for("kept-out").sum())
        if self.steering.aim.tolerance is not None and out < MIN_KEPT_OUT:
            self._note(
                Said(
                    "the program keeps {out} poses out, so that it alone proves nothing; {needed} or more do (taskcal plan "
                    "--kept-out)",
                    out=out,
                    needed=MIN_KEPT_OUT,
                )
            )
        self.taker.controller.visits(self.program.q)
        return super().run()

    def _note(self, text: Said) -> None:
        """Tell something, once while it stays the same."""
        if text != self._noted:
            super()._note(text)
        self._noted = text

    def _pose(self, state: State) -> Ending | None:
        """One row, from a standstill to the file; or how it ended."""
        if (outcome := self._ended(state)) is not None:
            return outcome
        left = self.program.left(self.steering.counting)
        if not len(left):
            return Ending(state=state, reason="visited")
        self.tell(RunEvent(kind="left", state=state, left=self._left(left, first=state.met)))
        while (row := self._next()) is None:
            pass
        self._journal.append(row)
        return None

    def _left(self, left: Int[np.ndarray, " k"], *, first: bool) -> Left:
        """The poses that are left, those first that bring most; the kept-out ones first where only these are lacking."""
        out = self.program.ids_for("kept-out")[left]
        fitted, kept = left[~out], left[out]
        errors, together = self.steering.errors_after(self.program.q[fitted])
        order = np.arange(len(fitted)) if errors is None else np.argsort(errors, kind="stable")
        ranked = [*kept, *fitted[order]] if first else [*fitted[order], *kept]
        return Left(
            ids=tuple(self.program.ids[k] for k in ranked),
            next_error=float(errors.min()) if errors is not None and len(errors) else None,
            all=together,
        )

    def _next(self) -> Row | None:
        """The row of the next standstill; None where it has none."""
        self._see_whether_it_went_on()
        try:
            taken = self._taken()
        except MissedError as missed:
            self._note(Said("no row: {reason}", reason=missed.said))
            return None
        self._noted, self._leaves, self._point, self._read_s = None, True, taken.point, taken.time_s
        if self.program.at(taken.joints) is None:
            off = np.abs(self.program.q - taken.joints).max(axis=1)
            self._note(
                Said(
                    "the robot stands at no pose of the program (the nearest, {pose}, is {off_deg:.0f}° off); what is measured "
                    "here is taken as a row all the same",
                    pose=self.program.ids[int(off.argmin())],
                    off_deg=float(np.degrees(off.min())),
                )
            )
        step = MeasurementPose(len(self._journal.rows) + 1, self._purpose(taken.joints), taken.joints)
        row = self._row_of(step, taken)
        if step.purpose == "reference":
            if self._compare(row) == "again":
                self._leaves = False
                return None
            return replace(row, station=self.steering.station)
        try:
            return self._checked(step, row)
        except MissedError:
            self._note(Said("the robot left before the row could be measured again, which is dropped"))
            return None

    def _see_whether_it_went_on(self) -> None:
        """Tell of a time in which nothing was read, as in a fit, and in which the robot went on: it may have stood there."""
        since, self._read_s = self._read_s, None
        if since is None or self._here is None or not self.taker.controller.streams:
            return
        one = self.taker.controller.read(self.taker.rules.read_s)
        away_s, moved = one.time_s - since, np.abs(one.joints - self._here) > self.taker.rules.left
        if away_s > self.taker.rules.settle_s and moved.any():
            self._note(
                Said(
                    "the robot went on while nothing was read for {away_s:.0f} s, as in a fit; a pose where it stood only then "
                    "stays left: let it wait longer (taskcal plan --wait-s)",
                    away_s=away_s,
                )
            )

    def _purpose(self, joints: Float[np.ndarray, " joints"]) -> Purpose:
        """What a row is for, by where it was measured: a pose that was measured before shows whether anything has moved."""
        here = [one for one in self.steering.counting if one.station == self.steering.station]
        if any((np.abs(one.joints - joints) <= self.program.within).all() for one in here):
            return "reference"
        pose = self.program.at(joints)
        return "kept-out" if pose is not None and self.program.ids_for("kept-out")[pose] else "chosen"

    def _taken(self) -> Taken:
        """What is measured at the next standstill.

        Raises:
            MissedError: it cannot be measured, or it is not known at which pose it is.
        """
        if self.taker.controller.streams:
            return self.taker.take(None, after=self._here if self._leaves else None)
        taken = self.taker.take_point(self._point if self._leaves else None)
        self._point = taken.point  # it is not asked for twice
        return replace(taken, joints=self.program.q[self._paired(taken.point)])

    def _measured(self, step: MeasurementPose, *, go: bool = True) -> Row:
        """Measure once more where the robot stands.

        Raises:
            MissedError: it has left.
        """
        rules = replace(self.taker.rules, wait_s=2.0 * self.taker.rules.settle_s)
        return self._row_of(step, replace(self.taker, rules=rules).take(step.q))

    # Where no joints are read: which pose of the program a point belongs to.

    def _paired(self, point: Float[np.ndarray, " 3"]) -> int:
        """The pose at which a point was measured.

        Raises:
            MissedError: it is at none, or may be at several.
            TaskcalError: the poses that were named cannot be those of their points.
        """
        program, station = self.program, self.steering.station
        blank = Row(number=0, purpose="chosen", station=station, time_s=0.0, joints=program.q[0], point=point)
        tried = [replace(blank, number=k, joints=q) for k, q in enumerate(program.q)]
        if self.steering.located(blank):
            off, fits = self.steering.distances(tried)
            return self._only(np.flatnonzero(fits), off)
        order = self._in_order()
        named = [k for k, row in enumerate(self._journal.rows) if row.station == station]
        if len(named) < NAMED_ROWS:
            return self._asked(order, point)
        off = self._off_nominal(named, tried)
        return self._asked([k for k in order if off[k] <= NOMINAL_WITHIN_M], point, sure=True)

    def _only(self, fits: Int[np.ndarray, " k"], off: Float[np.ndarray, " n"]) -> int:
        ids = self.program.ids
        if not len(fits):
            near = int(off.argmin())
            raise MissedError(
                "the target is at no pose of the program; pose {pose}, the nearest, is {off_mm:.1f} mm away",
                pose=ids[near],
                off_mm=float(off[near] * 1e3),
            )
        first = int(fits[0])
        if not self.program.near(self.program.q[first])[fits].all():
            poses = listed((ids[k] for k in fits), 4)
            raise MissedError("the target may be at one of the poses {poses}; not taken", poses=poses)
        return first

    def _in_order(self) -> list[int]:
        """The poses from the one after that of the last row on, each once."""
        program, rows = self.program, self._journal.rows
        last = program.at(rows[-1].joints) if rows else None
        begin = 0 if last is None else last + 1
        return [(begin + k) % len(program.q) for k in range(len(program.q))]

    def _asked(self, among: Sequence[int], point: Float[np.ndarray, " 3"], *, sure: bool = False) -> int:
        """The pose that a person names; without a question where it can be one alone."""
        place = dict(zip(("x_mm", "y_mm", "z_mm"), (point * 1e3).tolist(), strict=True))
        if sure and len(among) and self.program.near(self.program.q[among[0]])[list(among)].all():
            return among[0]
        for k in among:
            asked = Said(
                "the target stands at {x_mm:.1f} {y_mm:.1f} {z_mm:.1f} mm: is the robot at pose {pose}?",
                pose=self.program.ids[k],
                **place,
            )
            answer = self._decide(asked, "yes", "no", "skip")
            if answer == "yes":
                return k
            if answer == "skip":
                break
        raise MissedError(
            "the target stands at {x_mm:.1f} {y_mm:.1f} {z_mm:.1f} mm, and its pose is not known; not taken", **place
        )

    def _off_nominal(self, named: Sequence[int], tried: Sequence[Row]) -> Float[np.ndarray, " n"]:
        """How far a point is from where the nominal robot has the target at each pose, metres.

        Raises:
            TaskcalError: rows that were measured are too far from there themselves.
        """
        rows, campaign = [self._journal.rows[k] for k in named], self._journal.campaign(np.array(named))
        wrong = "the poses that were named do not fit their points: {}; begin another campaign, and name them anew"
        try:
            nominal = fit_nominal(self.steering.aim.model, campaign, FitOptions())
        except CampaignError as error:
            raise TaskcalError(wrong.format(error)) from error
        own = np.linalg.norm(residuals_on(nominal, as_campaign(rows, nominal))[:, 0], axis=1)
        if own.max() > NOMINAL_WITHIN_M:
            raise TaskcalError(wrong.format(f"row {rows[int(own.argmax())].number} is {own.max() * 1e3:.0f} mm off"))
        return np.linalg.norm(residuals_on(nominal, as_campaign(tried, nominal))[:, 0], axis=1)
