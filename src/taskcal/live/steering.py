"""What to measure next, what is known so far, and whether it is proven: pure functions of the rows, the settings and the notes.

The same rows give the same next pose, whether the measurement went on without a stop or was resumed.
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from hashlib import sha256
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.correction.correction import ErrorBudget
from taskcal.errors import CampaignError, FitError, ReachError
from taskcal.estimation.experiment_design import choose
from taskcal.estimation.matrices import single_threaded
from taskcal.identification.calibration import Calibration, covariance_on, residuals_on
from taskcal.identification.effects import explain
from taskcal.identification.holdout import with_held_out
from taskcal.identification.identify import fit_nominal, identify
from taskcal.identification.options import FitOptions
from taskcal.live.journal import Journal, Purpose, Row
from taskcal.observations.base import Measured, error_lengths
from taskcal.observations.instrument import Instrument, Measurable
from taskcal.observations.point import Station, Tracker
from taskcal.planning.options import PlanOptions
from taskcal.planning.plan import POOL_SEED, PoseChoice
from taskcal.registration.registration import PLAUSIBLE_SHARE, distances, nominal_poses, register_closely
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

START_ROWS = 12
"""Rows that are planned at once before the first fit: 36 numbers for the nine of frame and target and the six or more of a robot
that matter most. A convention."""

UNIT_ROWS = 5
"""Chosen rows from which on it is seen whether joints are in the unit that they are taken for: fifteen numbers for the nine of
tracker frame and target."""

DRAWS, DRAWN_ROWS = 150, 4
"""Sets of rows that are registered at most to find those that are right, and rows of each, whose twelve numbers are three more than
frame and target need. Up to nine rows these are all sets; of twelve with seven right, they lack one of right rows once in 10⁵
times."""

REFIT_GROWTH = 1.3
"""Of the fitted rows, after which all of them are fitted anew with all effects, which takes seconds; between, a row adds its
information to the posterior, which takes hundredths. A convention."""

KEPT_OUT_EVERY, REFERENCE_EVERY = 5, 10
"""Rows after which one is kept out, and the first pose is measured again. Conventions; once the posterior meets the tolerance, rows
are kept out up to the fewest of a look, and after it every second one, as these are lacking."""

MIN_KEPT_OUT, LOOK_GROWTH, MAX_KEPT_OUT = 6, 1.25, 1000
"""Rows kept out at a look, at least and at most, and how many times as many at the next. Conventions that make looks few."""

FALSE_STOP = 0.05
"""Probability of a stop although the error over the task is above the tolerance, over all looks together."""

SURPRISE_SIGMAS = 10.0
"""Standard deviations of prediction and noise together, from which on a row is measured again. A convention, as for a gross
error."""

DRIFT_SIGMAS, REPEATABILITY_M = 5.0, 5e-5
"""Standard deviations of the instrument, and beside these the pose repeatability that makers of industrial robots state, metres,
beyond which the reference pose has moved. A convention."""

CANDIDATES = 600
"""Poses to choose among: of 600 the best is a hundredth worse than of 10 000 (`plan.CANDIDATES`), and a step takes a tenth."""

MIN_STATION_ROWS = 4
"""Chosen rows of a station that take part in a fit; three points determine its frame."""

SAME_POSE = float(np.radians(3.0))
"""All joints nearer than that, radians or metres, are one pose, which is not chosen again."""


def _digest(data: Task | Station | Instrument) -> str:
    """Changes with whatever it states, of which a name says nothing."""
    text = json.dumps(asdict(data), default=lambda array: array.tolist(), sort_keys=True)
    return sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False, kw_only=True)
class Aim:
    """What is to be proven, and how far to go for it."""

    model: ErrorModel
    """Geometric; effects are found."""
    task: Task
    station: Station | None = None
    """With the one reflector; None for one at the TCP that is seen from everywhere."""
    observe: Instrument | None = None
    """What measures, if not a tracker."""
    tolerance: float | None = None
    """Rms in space over the task, metres; None to go on until `most`."""
    most: int = 100
    """Rows."""
    seed: int = 0
    candidates: int = CANDIDATES
    effects: bool = True
    """Whether non-geometric effects are estimated, too."""

    @property
    def instrument(self) -> Instrument:
        """What measures."""
        return self.observe or Tracker(station=self.station)

    @property
    def settings(self) -> dict[str, Any]:
        """With which a campaign has to go on."""
        task = _digest(replace(self.task, accuracy=None))
        return {
            "robot": self.model.robot.digest,
            "task": f"{self.task.name} ({task})",
            "station": None if self.station is None else _digest(self.station),
            "instrument": None if self.observe is None else f"{self.observe.name} ({_digest(self.observe)})",
            "tolerance_mm": None if self.tolerance is None else self.tolerance * 1e3,
            "seed": self.seed,
            "candidates": self.candidates,
            "effects": self.effects,
        }


class MeasurementPose(NamedTuple):
    """A pose to measure."""

    number: int
    purpose: Purpose
    q: Float[np.ndarray, " joints"]
    fixture: str = ""
    """At which it is measured; empty for a tracker."""


class Look(NamedTuple):
    """A test by the rows kept out."""

    kept_out: int
    rms: float
    """Of their errors in space as they judge the task, metres."""
    level: float
    """Probability that it passes although the error over the task is the tolerance."""
    bound: float
    """Upper bound of the error over the task at that level, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FitSoFar:
    """All chosen rows up to one, fitted with all effects."""

    calibration: Calibration
    choice: PoseChoice
    rows: Int[np.ndarray, " fitted"]
    """Indices of those that took part."""
    instrument: Instrument
    """With the fixtures that took part, in the calibration's order."""


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """What is known after some rows."""

    rows: int
    purpose: Purpose | None = None
    """Of the last row."""
    last: Float[np.ndarray, " joints"] | None = None
    """Its joints, radians."""
    budget: ErrorBudget | None = None
    """The error to be expected over the task; None before the first fit."""
    kept_out: Float[np.ndarray, " k"] = field(default_factory=lambda: np.zeros(0))
    """Errors in space of the rows kept out, metres."""
    look: Look | None = None
    """The last test."""
    met: bool = False
    """Whether all of the 95 % interval keeps the tolerance."""
    proven: bool = False
    """And the rows kept out say so, too."""
    consistent: bool = False
    """The same without a tracker: at the fixtures they are as expected, which proves nothing of the task."""
    more: int | None = None
    """Rows that are still needed, if the error falls with the root of their number; None where that is not known."""


def error_bound(errors: Float[np.ndarray, " k"], level: float) -> float:
    """Upper bound of the rms error from errors at random poses, with a probability of `level` to be too low, metres.

    The squared error of a pose spreads at most like one squared normal number, where all errors lie along one line; along three
    directions it spreads less, and the bound is the safer.
    """
    from scipy.special import gammaincinv

    n = len(errors)
    return float(np.sqrt(np.sum(errors**2) / (2.0 * gammaincinv(0.5 * n, level))))


def level_of(look: int) -> float:
    """Level of a look, counted from 1: all levels of ever so many looks add up to `FALSE_STOP`."""
    return FALSE_STOP / (look * (look + 1))


def as_campaign(rows: Sequence[Row], calibration: Calibration) -> Campaign:
    """Rows as measurements of a calibration's target, each in the frame of its station or at its fixture, which it has to know."""
    campaign = Campaign(
        ids=tuple(row.id for row in rows),
        q=np.stack([row.joints for row in rows]),
        targets=calibration.targets,
        points=np.stack([row.point for row in rows])[:, None],
    )
    known, kind = calibration.layout.stations, calibration.layout.kinds[0]
    if not kind.in_tracker:
        of = np.array([kind.named.index(row.fixture) for row in rows], dtype=np.int64) if kind.things else None
        return replace(campaign, observations=(replace(kind, of=of),))
    names = ("1",) if known is None else known.names
    of = np.array([names.index(str(row.station)) for row in rows], dtype=np.int64)
    T = np.tile(np.eye(4), (len(names), 1, 1))
    return replace(campaign, stations=Stations(names=names, of=of, T_first_station=T))


def rows_to_look(error: float, tolerance: float, look: int) -> int:
    """Rows kept out at which the bound of a look is within the tolerance, if the error over the task is the expected one.

    A look at fewer would most likely fail, and take its share of `FALSE_STOP`.

    Args:
        error: expected over the task, metres.
        tolerance: to be proven, metres.
        look: its number, from 1.
    """
    from scipy.special import gammaincinv

    n = np.arange(MIN_KEPT_OUT, MAX_KEPT_OUT + 1)
    passes = error * np.sqrt(n / (2.0 * gammaincinv(0.5 * n, level_of(look)))) <= tolerance
    return int(n[passes.argmax()]) if passes.any() else MAX_KEPT_OUT


class Steering:
    """Chooses poses and judges, by the journal's rows and notes."""

    def __init__(self, aim: Aim, journal: Journal):
        self.aim, self.journal = aim, journal
        self._fit: FitSoFar | None = None
        self._beside = lru_cache(maxsize=4)(journal.beside)  # images are looked at again and again while nothing is new
        self._skipped: list[Float[np.ndarray, " joints"]] = []

    @cached_property
    def _start(self) -> tuple[PoseChoice, Measurable, Measurable]:
        """The choice without measurements, the poses to begin with, and those that chance chooses among: of the task itself."""
        aim = self.aim
        options = PlanOptions(
            seed=aim.seed, station=aim.station, observe=aim.instrument, candidates=aim.candidates, refine=0
        )
        choice = PoseChoice.among(aim.model, aim.task, options)
        own = aim.instrument.own_poses(
            aim.model, aim.task, choice.measurable, aim.candidates, aim.seed + POOL_SEED, MIN_KEPT_OUT
        )
        planned = choice.choose(self.start_rows)
        return choice, Measurable(q=planned.q, rows=planned.candidate, visible=planned.visible, lost={}), own

    @property
    def start_rows(self) -> int:
        """Rows that are planned at once before the first fit: as many as every fixture needs, where there are any."""
        instrument = self.aim.instrument
        return START_ROWS if self._tracked else max(START_ROWS, instrument.rows_each * instrument.count)

    @property
    def _tracked(self) -> bool:
        return self.aim.instrument.kind.in_tracker

    def _step(self, purpose: Purpose, among: Measurable, pose: int) -> MeasurementPose:
        """One of some poses as the next one."""
        names = self.aim.instrument.fixtures.names
        fixture = "" if self._tracked else names[int(among.visible[pose].argmax())]
        return MeasurementPose(len(self.journal.rows) + 1, purpose, among.q[pose], fixture)

    def skip(self, step: MeasurementPose) -> None:
        """Do not choose a pose again, which cannot be measured."""
        self._skipped.append(step.q)

    # Rows by what they are for.

    def _excluded(self) -> set[int]:
        return {number for numbers in self.journal.noted("excluded") for number in numbers}

    @property
    def station(self) -> int:
        """Of the tracker, from 1."""
        return 1 + len(self.journal.noted("moved"))

    @property
    def counting(self) -> list[Row]:
        """The rows that were not found wrong."""
        excluded = self._excluded()
        return [row for row in self.journal.rows if row.number not in excluded]

    def _numbers(self, purpose: Purpose) -> Int[np.ndarray, " k"]:
        """Indices of the rows of a purpose that count."""
        return np.array([row.number - 1 for row in self.counting if row.purpose == purpose], dtype=np.int64)

    def _fitting(self) -> Int[np.ndarray, " k"]:
        """Indices of the rows to fit: chosen ones, of stations and fixtures that have enough of them."""
        chosen = self._numbers("chosen")
        if not self._tracked:
            at = [self.journal.rows[k].fixture for k in chosen]
            return chosen[np.array([at.count(one) >= self.aim.instrument.rows_each for one in at], dtype=bool)]
        station = np.array([self.journal.rows[k].station for k in chosen], dtype=np.int64)
        count = np.bincount(station, minlength=2)
        return chosen[(count[station] >= MIN_STATION_ROWS) | (station == 1)]

    # The posterior.

    @single_threaded
    def _fitted(self, rows: Int[np.ndarray, " k"]) -> FitSoFar:
        aim = self.aim
        try:
            calibration = self._identified(self._read(rows))
        except (CampaignError, FitError):
            self._refuse_contradiction(rows)  # says what can be done in a measurement that goes on
            raise
        instrument, measurable = self._standing(calibration)
        options = PlanOptions(seed=aim.seed, station=aim.station, observe=instrument, calibration=calibration)
        choice = PoseChoice.among(calibration.model, aim.task, options, measurable)
        return FitSoFar(
            calibration=calibration,
            choice=choice,
            rows=rows,
            instrument=instrument,
        )

    def _standing(self, calibration: Calibration) -> tuple[Instrument, Measurable]:
        """The instrument with the fixtures that a calibration knows, in its order, and the postures in which these are measured."""
        instrument, measurable = self.aim.instrument, self._start[0].measurable
        if self._tracked:
            return instrument, measurable
        layout = calibration.layout
        fitted = instrument.as_fitted(layout.kinds[0], layout.unknowns(calibration.z)[0], calibration.T_tool_target[0])
        known = [instrument.fixtures.names.index(name) for name in fitted.fixtures.names]
        some = measurable.visible[:, known].any(axis=1)
        return fitted, replace(
            measurable, q=measurable.q[some], rows=measurable.rows[some], visible=measurable.visible[some][:, known]
        )

    def _read(self, rows: Int[np.ndarray, " k"]) -> Campaign:
        """Rows as they are read from the file, without those of stations that have too few for their frame."""
        if self.journal.corners_path is not None:
            return self.journal.campaign(rows)  # other images would tell of the camera
        known = {self.journal.rows[k].station for k in rows}
        those = np.flatnonzero([row.station in known for row in self.journal.rows])
        return self.journal.campaign(those).take(np.searchsorted(those, rows))

    def _identified(self, campaign: Campaign) -> Calibration:
        return (
            explain(self.aim.model, campaign, seed=self.aim.seed).calibration
            if self.aim.effects
            else identify(self.aim.model, campaign)
        )

    def update(self) -> State:
        """Take up the rows that were added: by a fit where it is time for one, and look at the rows kept out where it is.

        Raises:
            TaskcalError: the rows determine no calibration.
        """
        fitting, fits = self._fitting(), self.journal.noted("fit")
        if len(fitting) < self.start_rows:
            self._refuse_contradiction(fitting)
            return self._state()
        if self._fit is None and fits and fits[-1] <= len(fitting):
            self._fit = self._fitted(fitting[: fits[-1]])
        if self._is_due(fitting):
            self._refit(fitting)
        budget = self._budget_with(self._gained(fitting)[0])
        if self._meets(budget) and not self._meets(self._budget_of_fit()):
            self._refit(fitting)  # what would end it is not taken from an approximation
            budget = self._budget_of_fit()
        return self._judged(budget)

    def _refuse_contradiction(self, fitting: Int[np.ndarray, " k"]) -> None:
        """See that joints and points are of one another, and joints in the unit that they are taken for.

        Raises:
            CampaignError: they contradict each other, in some rows, or in all and agree in another unit; or lengths must be in
                another.
        """
        if not self._tracked:
            self._check_readings()
            return
        first = fitting[np.array([self.journal.rows[k].station == 1 for k in fitting], dtype=bool)]
        if len(first) < UNIT_ROWS or self._agrees(campaign := self._read(first)):
            return
        turning = ~np.array(self.aim.model.robot.prismatic)
        for meant, taken, factor in (("radians", "degrees", 180.0 / np.pi), ("degrees", "radians", np.pi / 180.0)):
            if self._agrees(replace(campaign, q=np.where(turning, campaign.q * factor, campaign.q))):
                raise CampaignError(
                    f"joints and points of the first {len(first)} rows contradict each other, and agree if the joints are "
                    f"{meant}: {meant} were taken for {taken}. Mend that where the joints come from, the head of the program's "
                    "table or the controller's driver, and begin another campaign"
                )
        self._keep_out_wrong(first, campaign)

    def _keep_out_wrong(self, rows: Int[np.ndarray, " k"], campaign: Campaign) -> None:
        """Note which rows contradict all others, so that resuming goes on with those that are right.

        Args:
            rows: of the first station, which contradict each other.
            campaign: as they are read.

        Raises:
            CampaignError: some are wrong; or which ones they are cannot be told of so many.
        """
        right = self._right(campaign)
        if right.sum() >= max(UNIT_ROWS, len(rows) // 2 + 1) and not right.all() and self._agrees(campaign.take(right)):
            wrong = [self.journal.rows[k].number for k in rows[~right]]
            self.journal.note({"excluded": wrong})
            raise CampaignError(
                f"joints and points of row{'s' * (len(wrong) > 1)} {', '.join(map(str, wrong))} contradict the {right.sum()} "
                "others: kept out of the fit from here on. See that points belong to the joints of their own stop, that the "
                "instrument does not deliver late, and that the target is firm; then go on with the others (--resume)"
            )
        if len(rows) >= 2 * UNIT_ROWS:
            raise CampaignError(
                f"of the first {len(rows)} rows no more than half agree with the nominal robot, and which of them are right "
                "cannot be told. See that points belong to the joints of their own stop, and that the robot is the one that is "
                "named (taskcal doctor tries what else may be wrong); then begin another campaign"
            )

    def _right(self, campaign: Campaign) -> Bool[np.ndarray, " k"]:
        """The most rows that the nominal robot can have been at, by the registrations of few of them."""
        model, rng, n = self.aim.model, np.random.default_rng(self.aim.seed), len(campaign)
        if n <= START_ROWS:
            sets = rng.permutation(list(combinations(range(n), DRAWN_ROWS)))[:DRAWS]
        else:
            sets = [np.sort(rng.choice(n, size=DRAWN_ROWS, replace=False)) for _ in range(DRAWS)]
        T, limit = nominal_poses(model, campaign), PLAUSIBLE_SHARE * model.robot.reach
        best = np.zeros(n, dtype=bool)
        for drawn in sets:
            near = self._near(campaign, T, drawn) <= limit
            if near.sum() >= DRAWN_ROWS:  # once more by all that agree
                near = self._near(campaign, T, np.flatnonzero(near)) <= limit
            best = near if near.sum() > best.sum() else best
        return best

    def _near(
        self, campaign: Campaign, T: Float[np.ndarray, "n 4 4"], rows: Int[np.ndarray, " k"]
    ) -> Float[np.ndarray, " n"]:
        """How far each row is from where the nominal robot has it, registered by some of them, metres."""
        return distances(register_closely(campaign.take(rows), T[rows]), campaign, T)[:, 0]

    def _check_readings(self) -> None:
        """See that readings without a tracker are in the unit that they are taken for, as far as few rows tell.

        Raises:
            UnitError: they are not.
        """
        rows, names = self.journal.rows, self.aim.instrument.fixtures.names
        if rows:
            of = np.array([names.index(row.fixture) for row in rows], dtype=np.int64)
            tool = self.aim.model.poses(np.stack([row.joints for row in rows]))
            self.aim.instrument.observation(of).check_unit(tool, Measured(np.stack([row.point for row in rows])))

    def _agrees(self, campaign: Campaign) -> bool:
        """Whether the nominal robot can have been at the rows' joints where its target was measured."""
        try:
            fit_nominal(self.aim.model, campaign, FitOptions())
        except (CampaignError, FitError, ReachError):
            return False
        return True

    def _is_due(self, fitting: Int[np.ndarray, " k"]) -> bool:
        """Whether it is time for a fit: at first, after many rows, where a station is new, or fitted rows count no more."""
        if self._fit is None or len(fitting) >= math.ceil(REFIT_GROWTH * len(self._fit.rows)):
            return True
        new = not all(self.located(self.journal.rows[k]) for k in fitting)
        return new or not np.array_equal(self._fit.rows, fitting[: len(self._fit.rows)])

    def _refit(self, fitting: Int[np.ndarray, " k"]) -> None:
        self._fit = self._fitted(fitting)
        self.journal.note({"fit": len(fitting)})

    def _gained(self, fitting: Int[np.ndarray, " k"]) -> tuple[Float[np.ndarray, "d d"], Float[np.ndarray, "e e"]]:
        """Information of the rows after the fit, in the directions of both experiments."""
        assert self._fit is not None
        both = self._fit.choice.judged, self._fit.choice.weighing
        new = [self.journal.rows[k] for k in fitting[len(self._fit.rows) :]]
        if not new:
            return np.zeros_like(both[0].prior), np.zeros_like(both[1].prior)
        q, names = np.stack([row.joints for row in new]), np.array(self._fit.instrument.fixtures.names)
        seen = np.stack([names == row.fixture for row in new])
        judged, chosen = (one.rows(q, seen).reshape(-1, one.basis.shape[1]) for one in both)
        return judged.T @ judged, chosen.T @ chosen

    def _budget_of_fit(self) -> ErrorBudget:
        """The error over the task, with its interval, by the fit alone."""
        assert self._fit is not None
        return self._budget_with(np.zeros_like(self._fit.choice.judged.prior))

    def _budget_with(self, gained: Float[np.ndarray, "d d"]) -> ErrorBudget:
        fit = self._fit
        assert fit is not None
        judged, single = fit.choice.judged, fit.choice.single
        assert single is not None
        WC = judged.task @ np.linalg.inv(judged.prior + gained)
        return ErrorBudget(
            correction=0.0,
            left=0.0,
            variances={"geometry": float(np.trace(WC)) + judged.left, "model error": single},
            variance_of_mean_square=2.0 * float(np.sum(WC * WC.T)),
        )

    def _meets(self, budget: ErrorBudget) -> bool:
        return self.aim.tolerance is not None and budget.interval[1] <= self.aim.tolerance

    # The rows kept out.

    def _campaign(self, rows: Sequence[Row]) -> Campaign:
        assert self._fit is not None
        if self.journal.corners_path is not None:
            return self._beside(tuple(rows), tuple(self._fit.rows.tolist()))
        return as_campaign(rows, self._fit.calibration)

    def located(self, row: Row) -> bool:
        """Whether the frame of a row's station is known, or where its fixture is."""
        if self._fit is None:
            return False
        if not self._tracked:
            return row.fixture in self._fit.instrument.fixtures.names
        known = self._fit.calibration.layout.stations
        return row.station == 1 if known is None else str(row.station) in known.names

    def kept_out_errors(self) -> Float[np.ndarray, " k"]:
        """Errors in space of the rows kept out, by the calibration without them, metres."""
        rows = self._kept_out()
        return self._lengths(rows) if rows else np.zeros(0)

    def _kept_out(self) -> list[Row]:
        return [row for row in (self.journal.rows[k] for k in self._numbers("kept-out")) if self.located(row)]

    def _judging(self, errors: Float[np.ndarray, " k"], budget: ErrorBudget) -> Float[np.ndarray, " k"]:
        """Errors of the rows kept out as they judge the task: at its own poses as they are.

        At fixtures it is how many times as far off they are as expected there that is taken to hold of the task, too.
        """
        if self._tracked or not len(errors):
            return errors
        assert self._fit is not None
        return budget.after * np.sqrt(self._squares(self._kept_out()) / self._fit.instrument.kind.width)

    def _lengths(self, rows: Sequence[Row]) -> Float[np.ndarray, " k"]:
        """Lengths of the residuals of rows that are located, metres."""
        assert self._fit is not None
        calibration = self._fit.calibration
        return error_lengths(residuals_on(calibration, self._campaign(rows)), calibration.layout.kinds)[:, 0]

    def _judged(self, budget: ErrorBudget) -> State:
        errors, tolerance = self.kept_out_errors(), self.aim.tolerance
        looks = [Look(*look) for look in self.journal.noted("look")]
        due = 0 if tolerance is None else rows_to_look(budget.after, tolerance, len(looks) + 1)
        due = max(due, math.ceil(LOOK_GROWTH * looks[-1].kept_out) if looks else 0)
        met = self._meets(budget)
        if met and len(errors) >= due:
            level = level_of(len(looks) + 1)
            judging = self._judging(errors, budget)
            look = Look(len(errors), float(np.sqrt(np.mean(judging**2))), level, error_bound(judging, level))
            self.journal.note({"look": list(look)})
            looks.append(look)
        last = looks[-1] if looks else None
        passed = met and last is not None and tolerance is not None and last.bound <= tolerance
        more = None
        if tolerance is not None and budget.uncertainty and not passed:
            fitted = len(self._fitting())
            by_posterior = fitted * ((budget.interval[1] / tolerance) ** 2 - 1.0)
            more = max(math.ceil(by_posterior), due - len(errors), 0)
        return replace(
            self._state(),
            budget=budget,
            kept_out=errors,
            look=last,
            met=met,
            proven=passed and self._tracked,
            consistent=passed and not self._tracked,
            more=more,
        )

    def _state(self) -> State:
        """What is known without a fit."""
        rows = self.journal.rows
        last = rows[-1] if rows else None
        return State(rows=len(rows), purpose=last.purpose if last else None, last=last.joints if last else None)

    # The next pose.

    def purpose(self, state: State, *, doubt: bool = False) -> Purpose:
        """What the next row is for.

        Args:
            state: after the rows so far.
            doubt: whether the last row was far from where it was expected.
        """
        number = len(self.journal.rows) + 1
        if state.budget is None:
            return "chosen"
        if doubt or (number % REFERENCE_EVERY == 1 and self.journal.rows[-1].purpose != "reference"):
            return "reference"
        chosen = self._numbers("chosen")
        here = sum(self.journal.rows[k].station == self.station for k in chosen)
        every = KEPT_OUT_EVERY
        if state.met:
            every = 1 if len(state.kept_out) < MIN_KEPT_OUT else 2
        return "kept-out" if number % every == 0 and here >= MIN_STATION_ROWS else "chosen"

    def next(
        self, state: State, *, doubt: bool = False, clear: Callable[[Float[np.ndarray, " joints"]], bool] | None = None
    ) -> tuple[MeasurementPose, float | None]:
        """The next pose, and the error over the task that is expected after it, metres, where it is chosen for that.

        Args:
            state: after the rows so far.
            doubt: measure the first pose again.
            clear: whether the robot gets to joints; by default it is not asked.

        Raises:
            ReachError: no pose is left.
        """
        number, purpose = len(self.journal.rows) + 1, self.purpose(state, doubt=doubt)
        if purpose == "reference":
            first = self._first_like(self.journal.rows[-1])
            return MeasurementPose(number, purpose, first.joints, first.fixture), None
        if purpose == "kept-out":
            own = self._start[2]
            return self._step(purpose, own, self._drawn(own, number, clear)), None
        start, planned, _ = self._start
        if self._fit is None:
            done = sum(row.purpose == "chosen" for row in self.journal.rows) + len(self._skipped)
            if done < len(planned.q):
                return self._step(purpose, planned, done), None
            free = self._free(start.measurable.q)
            free = free[self._lacking(start.measurable.visible[free])]
            pose = int(free[np.random.default_rng([self.aim.seed, number]).integers(len(free))])
            return self._step(purpose, start.measurable, pose), None
        pose, error = self._best(clear)
        return self._step(purpose, self._fit.choice.measurable, pose), error

    def _first_like(self, row: Row) -> Row:
        """The first row at the fixture of another one."""
        return next(one for one in self.counting if one.fixture == row.fixture)

    def _lacking(self, visible: Bool[np.ndarray, "n targets"]) -> Bool[np.ndarray, " n"]:
        """Which of some postures are of a fixture that has too few rows; all, where there is none of these."""
        at = [self.journal.rows[k].fixture for k in self._numbers("chosen")]
        few = [at.count(name) < self.aim.instrument.rows_each for name in self.aim.instrument.fixtures.names]
        lacking = np.asarray(visible[:, few].any(axis=1))
        return np.ones(len(visible), dtype=bool) if self._tracked or not lacking.any() else lacking

    def _free(self, q: Float[np.ndarray, "n joints"]) -> Int[np.ndarray, " k"]:
        """Which poses were neither measured nor skipped.

        Raises:
            ReachError: there is none.
        """
        free = np.flatnonzero(self._is_free(q))
        if not len(free):
            raise ReachError("every candidate pose was measured or skipped; begin another campaign with another --seed")
        return free

    def _is_free(self, q: Float[np.ndarray, "n joints"]) -> np.ndarray:
        done = [*(row.joints for row in self.journal.rows), *self._skipped]
        free = np.ones(len(q), dtype=bool)
        for one in done:
            free &= (np.abs(q - one) > SAME_POSE).any(axis=1)
        return free

    def _drawn(self, own: Measurable, number: int, clear: Callable[[Float[np.ndarray, " joints"]], bool] | None) -> int:
        """A pose that chance chooses."""
        order = np.random.default_rng([self.aim.seed, number]).permutation(self._free(own.q))
        return next((int(k) for k in order if clear is None or clear(own.q[k])), int(order[0]))

    @single_threaded
    def _best(self, clear: Callable[[Float[np.ndarray, " joints"]], bool] | None) -> tuple[int, float]:
        """The candidate that lowers the expected error most, and that error, metres."""
        assert self._fit is not None
        choice, (judged, gained) = self._fit.choice, self._gained(self._fitting())
        q, seen = choice.measurable.q, choice.measurable.visible
        free = self._free(q)
        while len(free):
            among = replace(
                choice.candidates,
                rows=choice.candidates.rows[free],
                prior=choice.candidates.prior + gained,
                signal=choice.candidates.signal + gained,
                of=None,
            )
            best = int(choose(among, 1, sweeps=0).chosen[0])
            at = free[best]
            if clear is None or clear(q[at]):
                X = choice.judged.rows(q[at : at + 1], seen[at : at + 1]).reshape(-1, choice.judged.basis.shape[1])
                return int(at), self._budget_with(judged + X.T @ X).after
            free = np.delete(free, best)
        raise ReachError("the robot gets to no candidate on a straight way that is clear; move it, and resume")

    @single_threaded
    def errors_after(
        self, q: Float[np.ndarray, "n joints"]
    ) -> tuple[Float[np.ndarray, " n"], float] | tuple[None, None]:
        """The error over the task that is expected after each of some poses alone, and after all of them, metres.

        Args:
            q: the poses, radians.

        Returns:
            both; None of both before the first fit.
        """
        if self._fit is None:
            return None, None
        judged, gained = self._fit.choice.judged, self._gained(self._fitting())[0]
        if not len(q):
            return np.zeros(0), self._budget_with(gained).after
        X = judged.rows(q, np.ones((len(q), 1), dtype=bool)).reshape(len(q), -1, judged.basis.shape[1])
        information = np.swapaxes(X, 1, 2) @ X
        single = np.array([self._budget_with(gained + one).after for one in information])
        return single, self._budget_with(gained + information.sum(axis=0)).after

    # Rows that are not what was expected.

    def surprise(self, row: Row) -> float | None:
        """How far a row is from where it is expected, metres, if prediction and noise allow far less; else None."""
        if not self.located(row) or self._fit is None:
            return None
        off, expected = self.distances([row])
        return None if expected[0] else float(off[0])

    def distances(self, rows: Sequence[Row]) -> tuple[Float[np.ndarray, " k"], Bool[np.ndarray, " k"]]:
        """How far rows of a station that is located are from where they are expected, metres, and whether that may be."""
        return self._lengths(rows), self._squares(rows) <= SURPRISE_SIGMAS**2

    def _squares(self, rows: Sequence[Row]) -> Float[np.ndarray, " k"]:
        """Squares of the residuals of rows that are located, over their covariance by prediction and noise."""
        assert self._fit is not None
        campaign = self._campaign(rows)
        residual = residuals_on(self._fit.calibration, campaign)[:, 0]
        covariance = covariance_on(self._fit.calibration, campaign, campaign.covariances())[:, 0]
        return np.einsum("ni,ni->n", residual, np.linalg.solve(covariance, residual[..., None])[..., 0])

    def drift(self, row: Row) -> float | None:
        """How far a pose that was measured before has moved, metres, where that is beyond noise; else None."""
        here = [one for one in self.counting if (one.station, one.fixture) == (row.station, row.fixture)]
        same = [one for one in here if (np.abs(one.joints - row.joints) <= SAME_POSE).all()]
        if not same or not self.located(row) or self._fit is None:
            return None
        campaign, kinds = self._campaign([same[0], row]), self._fit.calibration.layout.kinds
        residual = residuals_on(self._fit.calibration, campaign)
        off = float(error_lengths(residual[1:] - residual[:1], kinds)[0, 0])
        block = kinds[0].block()[: kinds[0].width - kinds[0].angles]
        noise = float(np.sqrt(2.0 * campaign.covariances()[1, 0, block, block].sum()))
        return off if off > DRIFT_SIGMAS * noise + REPEATABILITY_M else None

    def calibration(self) -> Calibration:
        """The calibration of all chosen rows, with its errors at those kept out.

        Raises:
            CampaignError: there are too few.
        """
        fitting, kept_out = self._fitting(), self._numbers("kept-out")
        if len(fitting) < self.start_rows:
            raise CampaignError(
                f"{len(fitting)} rows are too few for a calibration; measure {self.start_rows} or more, and resume (--resume)"
            )
        if self._fit is None or len(self._fit.rows) < len(fitting):
            self._fit = self._fitted(fitting)
        kept_out = np.array([k for k in kept_out if self.located(self.journal.rows[k])], dtype=np.int64)
        if not len(kept_out):
            return self._fit.calibration
        campaign = self._read(np.union1d(fitting, kept_out))
        out = np.flatnonzero(np.isin(np.union1d(fitting, kept_out), kept_out))

        def nominal(rows: Campaign) -> Calibration:
            return fit_nominal(self.aim.model, rows, FitOptions())

        return with_held_out(self._fit.calibration, campaign, out, nominal)
