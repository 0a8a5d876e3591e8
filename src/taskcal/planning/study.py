"""Studies: what task error to expect, over many true robots, by number of poses, by plan and by model.

Each true robot is drawn, measured by every plan and identified with every model from random numbers of its own, so that
the result depends on the seed alone, not on the engine, the number of workers or an interruption.

The robots have a model error: at every pose, measured or of the task, the point is off by white noise that no parameter
explains. On real robots it is alike at neighbouring poses.
"""

import hashlib
import json
import os
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from taskcal.analysis.identifiability import published_kept
from taskcal.arguments import Named, by_name, checked, chosen_options
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import (
    CampaignError,
    ClosureError,
    FileError,
    FitError,
    NothingLearntError,
    TaskcalError,
)
from taskcal.estimation.prior import GaussianPrior
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.checks.checks import by_tolerances
from taskcal.identification.effects import select_effects
from taskcal.identification.identify import attempt, fit_nominal
from taskcal.identification.options import FitOptions
from taskcal.io.codec import decode, describe
from taskcal.io.files import write_whole
from taskcal.io.json_file import SEAL, parse_json, sealed, unseal
from taskcal.io.text_file import read_text
from taskcal.io.toml_file import Ratio
from taskcal.observations.base import TrackerNoise
from taskcal.planning.expected_error import known_hyperparameters
from taskcal.planning.options import PlanOptions, StudyOptions
from taskcal.planning.plan import GOAL_POSES, PoseChoice
from taskcal.planning.selection import select
from taskcal.planning.task_map import allow_geometry
from taskcal.planning.workers import side_by_side
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import ModelError, model_error_of
from taskcal.tables.frame import frame_of
from taskcal.task.task import Task, enlarge, measuring_task, reach_task
from taskcal.virtual.cell import Truth, simulate

if TYPE_CHECKING:
    import pandas as pd


# The robots of a study: how large their defects are, and what single poses add.


@dataclass(frozen=True, eq=False, kw_only=True)
class VirtualRobots:
    """Robots of one model, which differ in their defects."""

    model: ErrorModel
    deviations: Float[np.ndarray, " p"]
    """Standard deviation of every parameter, metres and radians."""
    model_error: ModelError
    """What no parameter explains at a pose."""
    joint_error: Float[np.ndarray, " joints"]
    """Standard deviation of what every joint is off at a pose, radians (metres where it slides)."""
    origin: str = "drawn from the tolerances"
    """Where the sizes come from, in words."""
    prior: GaussianPrior | None = None
    """What a fit that is told the sizes expects; None for the tolerances."""

    @classmethod
    def of_tolerances(cls, model: ErrorModel, model_error: float | None) -> "VirtualRobots":
        """Make it from the tolerances of the robot's file."""
        nothing = np.zeros(len(model.robot.joints))
        error = model_error_of(model.robot, model_error)
        return cls(model=model, deviations=model.tolerances, model_error=error, joint_error=nothing)

    @classmethod
    def like(cls, calibration: Calibration, model_error: float | None) -> "VirtualRobots":
        """Robots like one that was calibrated: its parameters of the sizes that were found, and what single poses added.

        Raises:
            CampaignError: the calibration has no prior, whose scale tells the sizes.
        """
        if calibration.prior_scale is None:
            raise CampaignError(
                "the calibration has no prior, and does not say how large the defects of such robots are; identify with a prior"
            )
        model, known = calibration.model, known_hyperparameters(calibration)
        joints = np.zeros(len(model.robot.joints))
        joints[: len(known.joint_error)] = known.joint_error
        stated = ModelError(position=known.model_error[0], source=known.origin)
        error = stated if model_error is None else model_error_of(model.robot, model_error)
        sizes = known.deviations(model)
        prior, origin = GaussianPrior.of_deviations(sizes), "with defects of the sizes that the calibration found"
        return cls(model=model, deviations=sizes, model_error=error, joint_error=joints, origin=origin, prior=prior)

    def draw(self, rng: np.random.Generator) -> Float[np.ndarray, " p"]:
        """Defects of one robot."""
        return rng.normal(size=len(self.model)) * self.deviations

    def conditions(self, q: Float[np.ndarray, "n joints"]) -> Conditions | None:
        """Conditions of poses reached one after another, where the model asks for them."""
        return conditions_in_order(self.model.robot, q) if self.model.conditioned else None

    def measure(
        self,
        x: Float[np.ndarray, " p"],
        q: Float[np.ndarray, "n joints"],
        noise: TrackerNoise,
        rng: np.random.Generator,
        observe: str = "tracker",
        stations: int = 1,
    ) -> tuple[Campaign, Truth]:
        """A campaign, and the robot and cell that it is of; how it is measured as `simulate` has it."""
        return simulate(
            self.model,
            q,
            rng=rng,
            x=x,
            noise=noise,
            model_error=self.model_error.position,
            joint_error=self.joint_error,
            observe=observe,
            stations=stations,
        )

    def unexplained(
        self, truth: Truth, q: Float[np.ndarray, "n joints"], rng: np.random.Generator
    ) -> Float[np.ndarray, "n 3"]:
        """Pose-specific error of the TCP at each pose, metres."""
        white = self.model_error.position * rng.normal(size=(len(q), 3))
        if not self.joint_error.any():
            return white
        conditions = self.conditions(q)
        return white + (truth.points(q + self._joints_off(q, rng), conditions) - truth.points(q, conditions))[:, 0]

    def _joints_off(self, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return self.joint_error * rng.normal(size=q.shape) if self.joint_error.any() else np.zeros(q.shape)


# Residual task error after teaching work frame and TCP with the calibrated robot.
#
# Without a tracker nobody knows where the robot's base stands, or asks; and what a camera sees says nothing of a
# spindle beside it. Both are taught with the calibrated robot itself. What is left is the error of its shape, the
# same for every way to measure.


def aligned_errors(
    tool: Float[np.ndarray, "n 4 4"], true: Float[np.ndarray, "n 3"], weights: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """True less predicted TCPs, metres, with the frame and the TCP on the tool that make them least.

    Args:
        tool: poses of the tool that a calibration predicts, in the base.
        true: the true TCPs, in the base; some millimetres off, for which the equations are linear.
        weights: how much each pose counts.
    """
    p = tool[:, :3, 3]
    middle = np.average(p, axis=0, weights=weights)
    A = np.concatenate([se3.by_twist(p - middle), tool[:, :3, :3]], axis=2)
    root = np.sqrt(weights)
    x = np.linalg.lstsq((A * root[:, None, None]).reshape(-1, 9), ((true - p) * root[:, None]).reshape(-1), rcond=1e-9)[
        0
    ]
    return true - p - A @ x


# Robots of a study: each drawn, measured in every way, identified with every model, and compared with the truth.

MAX_ROBOTS_PER_TASK = 16
"""Robots of a worker's task, at most: a study that is interrupted loses what they take, at some 10 ms for each fit a second or
two."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StudySetting:
    """Everything that a robot of the study needs."""

    task_q: Float[np.ndarray, "n joints"]
    weights: Float[np.ndarray, " n"]
    plans: Mapping[str, Float[np.ndarray, "count joints"]]
    """Fixed plans, by kind and count."""
    pool: Float[np.ndarray, "pool joints"]
    cases: tuple[tuple[str, str, int], ...]
    """Way to measure, kind of plan, number of poses."""
    models: Mapping[str, FitOptions]
    noise: TrackerNoise
    seed: int
    robots: VirtualRobots
    aligned: bool = False
    """Whether errors are those that are left once frames were taught."""
    stations: int = 1


@dataclass(frozen=True, kw_only=True)
class StudyRow:
    """What came of one robot, measured in one way at so many poses of a plan, and identified with one model."""

    robot: int
    plan: str
    count: int
    model: str
    rms_mm: Ratio | None = None
    """Error of the predicted geometry over the task; None, as the other errors, where the campaign was not fitted."""
    max_mm: Ratio | None = None
    rms_with_model_error_mm: Ratio | None = None
    """Of single poses, which have the model error beside it."""
    observe: str
    learnt: bool = False
    """Whether anything was, from the measurements; else the nominal robot stands for the calibrated one, with its frames found."""
    failed: str = ""
    """Why the campaign was not fitted, such as a fit that did not converge."""


@dataclass(frozen=True, kw_only=True)
class StudyFile:
    """What was done of a study."""

    study: str
    """Fingerprint of its setting."""
    robots: Mapping[str, tuple[StudyRow, ...]]
    """Rows of each robot, by its number."""


def try_robots(setting: StudySetting, indices: Sequence[int]) -> list[tuple[int, list[dict[str, Any]]]]:
    """All ways to measure, plans and models of some of the true robots, by their numbers."""
    return [(index, _try(setting, index)) for index in indices]


def _try(setting: StudySetting, index: int) -> list[dict[str, Any]]:
    """Rows of one robot, from random numbers of its own: every way to measure and plan, and every model."""
    robots, rng = setting.robots, _own_numbers(setting, index)
    x, rows = robots.draw(rng), list[dict[str, Any]]()
    for observe, kind, count in setting.cases:
        q = setting.plans.get(f"{kind} {count}")
        if q is None:
            q = setting.pool[rng.permutation(len(setting.pool))[:count]]
        campaign, truth = robots.measure(x, q, setting.noise, rng, observe, setting.stations)
        # the same for all plans, and drawn beside the robot, which does not depend on it
        alone = np.random.default_rng(np.random.SeedSequence(setting.seed, spawn_key=(index, 1)))
        unexplained = robots.unexplained(truth, setting.task_q, alone)
        for name, options in setting.models.items():
            row = StudyRow(robot=index, plan=kind, count=count, model=name, observe=observe)
            try:
                found = _learn(robots.model, campaign, name, options)
                # where nothing is learnt, what is left to its user is the robot as it is
                off = _off(setting, fit_nominal(robots.model, campaign, options) if found is None else found, truth)
                row = replace(row, **_figures(setting.weights, off, off - unexplained * 1e3), learnt=found is not None)
            except (FitError, CampaignError, ClosureError) as error:
                row = replace(row, failed=str(error))
            rows.append(describe(row))
    return rows


def _figures(
    weights: Float[np.ndarray, " n"], off: Float[np.ndarray, "n 3"], single: Float[np.ndarray, "n 3"]
) -> dict[str, float]:
    """Errors of a row, of predictions that are so far off, millimetres, and of single poses."""
    error, alone = np.linalg.norm(off, axis=1), np.linalg.norm(single, axis=1)
    rms, at_a_pose = (float(np.sqrt(np.sum(weights * one**2))) for one in (error, alone))
    return {"rms_mm": rms, "max_mm": float(error.max()), "rms_with_model_error_mm": at_a_pose}


def _learn(model: ErrorModel, campaign: Campaign, name: str, options: FitOptions) -> Calibration | None:
    """Result of the named model; None where nothing was learnt, or tracker frame and targets alone."""
    geometry = ErrorModel(model.robot, lengths_only=model.lengths_only)
    try:
        if name == "auto":
            found = select_effects(geometry, campaign, options=options).calibration
        else:
            fit = attempt(geometry if name == "geometry" else model, campaign, options)
            found = by_tolerances(fit).calibration
    except NothingLearntError:
        return None
    return found if len(found.estimated) or options.keep == () else None


def _own_numbers(setting: StudySetting, index: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(setting.seed, spawn_key=(index,)))


def _off(setting: StudySetting, calibration: Calibration, truth: Truth) -> Float[np.ndarray, "n 3"]:
    """Predicted less true TCPs over the task, in the measuring frame, millimetres."""
    q, way = setting.task_q, setting.robots.conditions(setting.task_q)
    if not setting.aligned:
        return (calibration.predict(q, way) - truth.points(q, way))[:, 0] * 1e3
    true = truth.model.poses(q, truth.x, way)[:, :3, 3]
    off = aligned_errors(calibration.tool_in_base(q, way), true, setting.weights)
    return -1e3 * off @ truth.T_tracker_base[:3, :3].T


def errors_before(setting: StudySetting, robots: int) -> tuple[float, ...]:
    """Error of the nominal robot, with frames that were taught with it, of every robot, metres."""
    q, model = setting.task_q, setting.robots.model
    way, out = setting.robots.conditions(q), list[float]()
    for index in range(robots):
        true = model.poses(q, setting.robots.draw(_own_numbers(setting, index)), way)[:, :3, 3]
        off = aligned_errors(model.nominal.poses(q), true, setting.weights)
        out.append(float(np.sqrt(setting.weights @ (off**2).sum(axis=1))))
    return tuple(out)


POOL_POSES = 2000
"""Poses of the task's workspace that random plans are drawn from: many times those of a plan, so that two plans have few in
common. A convention."""

MIN_GROUPS_PER_WORKER = 4
"""Groups of robots for each worker, at least: what is done is kept as often, and the last to end is waited for a quarter of the
time at most."""

Rows = list[tuple[int, list[dict[str, Any]]]]
"""Of robots, by their numbers."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class Study:
    """Task errors of every robot, plan, number of poses and model."""

    rows: tuple[Mapping[str, Any], ...]
    """One for each robot, observe, plan, count and model, with the keys of `StudyRow`. Rows that failed are of campaigns that were
    not fitted; no figure counts them."""
    robots: int
    seed: int
    accuracy: float | None = None
    """Needed by the task, metres."""
    model_error: float = 0.0
    """Standard deviation per axis of what no parameter explains at a pose, metres."""
    model_error_origin: str = ""
    """Where that comes from, in words."""
    origin: str = "drawn from the tolerances"
    """Where the robots' defects come from, in words."""
    before: tuple[float, ...] = ()
    """Where errors are those that are left once frames were taught: the same of every robot before it is calibrated, metres."""

    def __repr__(self) -> str:
        plans, models = ({row[key] for row in self.rows} for key in ("plan", "model"))
        return (
            f"Study({self.robots} robots, {len(plans)} plans, {len({row['count'] for row in self.rows})} numbers of poses, "
            f"{len(models)} models: {len(self.rows)} rows, seed {self.seed})"
        )

    @property
    def unlearnt(self) -> int:
        """Rows with the nominal robot, since nothing was learnt from the measurements."""
        return sum(not row["learnt"] and not row["failed"] for row in self.rows)

    @property
    def failed(self) -> tuple[Mapping[str, Any], ...]:
        """Rows of campaigns that were not fitted, which no figure counts."""
        return tuple(row for row in self.rows if row["failed"])

    @property
    def aligned(self) -> bool:
        """Whether errors are those that are left once frames were taught."""
        return bool(self.before)

    def spread_before(self) -> dict[str, float]:
        """Median and 5 and 95 % quantiles over the robots of the error before calibration, metres; nothing without `before`."""
        if not self.before:
            return {}
        return {
            "median": float(np.median(self.before)),
            "p05": float(np.percentile(self.before, 5)),
            "p95": float(np.percentile(self.before, 95)),
        }

    @property
    def geometry_allowance(self) -> float | None:
        """Error that the accuracy leaves to the identified geometry, beside the model error of a single pose, metres.

        None if no accuracy is stated; zero if the model error alone takes all of it.
        """
        return allow_geometry(self.accuracy, self.model_error)

    def to_frame(self) -> "pd.DataFrame":
        """All rows.

        Raises:
            TaskcalError: pandas is not installed.
        """
        return frame_of(list(self.rows))

    def summary(self) -> list[dict[str, Any]]:
        """Quantiles over the robots of the rms error, for each plan, count and model, in the order asked for.

        ``robots`` are those that they are of, ``failed`` those whose campaigns were not fitted; where all failed, figures are None.
        Where the task states an accuracy, ``share_accurate`` is the share of robots that meet it at single poses.
        """
        groups: dict[tuple[str, str, int, str], list[Mapping[str, Any]]] = {}
        for row in self.rows:
            groups.setdefault((row["observe"], row["plan"], row["count"], row["model"]), []).append(row)
        return [
            {"observe": way, "plan": kind, "count": count, "model": model, **self._quantiles(rows)}
            for (way, kind, count, model), rows in groups.items()
        ]

    def _quantiles(self, rows: Sequence[Mapping[str, Any]]) -> dict[str, float | int | None]:
        """Quantiles over the robots of one plan, count and model."""
        fitted = [row for row in rows if not row["failed"]]
        geometry = np.array([row["rms_mm"] for row in fitted])
        single = np.array([row["rms_with_model_error_mm"] for row in fitted])
        figures: dict[str, Callable[[], np.floating[Any]]] = {
            "median_mm": lambda: np.median(geometry),
            "p05_mm": lambda: np.percentile(geometry, 5),
            "p95_mm": lambda: np.percentile(geometry, 95),
            "rms_mm": lambda: np.sqrt(np.mean(np.square(geometry))),
            "rms_with_model_error_mm": lambda: np.sqrt(np.mean(np.square(single))),
        }
        if (accuracy := self.accuracy) is not None:
            figures["share_accurate"] = lambda: np.mean(single <= accuracy * 1e3)
        return {
            "robots": len(fitted),
            "failed": len(rows) - len(fitted),
            **{name: float(figure()) if fitted else None for name, figure in figures.items()},
        }


@by_name(StudyOptions)
@checked
def study(
    _kind: Callable[Named, StudyOptions],
    model: ErrorModel,
    task: Task,
    engine: str = "loky",
    workers: int = -1,
    resume: str | Path | None = None,
    progress: Progress = lambda done, total: None,
    options: StudyOptions | None = None,
    *_args: Named.args,
    **_named: Named.kwargs,
) -> Study:
    """Simulate many true robots and see how accurate the task becomes.

    Args:
        model: the model that the true robots are drawn from.
        task: what the robot has to do.
        engine: of joblib: ``loky``, ``threading``, ``sequential``, or ``dask:ADDRESS`` of a scheduler.
        workers: how many; −1 for one per core.
        resume: a file that keeps what is done; a study that was interrupted goes on from it.
        progress: called with the robots done and their total.
        options: all at once; those that are named replace what is in them.

    Raises:
        CampaignError: the calibration is of another robot or model, or has no prior.
        UnknownName: a model or engine that does not exist.
        FileError: the file to resume from belongs to another study.
        ReachError: the robot does not reach the task.
        FitError: not a single campaign could be fitted; where some were, `Study.failed` has the others.
    """
    chosen = chosen_options(_kind, options, *_args, **_named)
    setting = _prepare(model, task, chosen)
    done = _read(resume, setting)
    progress(len(done), chosen.robots)
    left = [index for index in range(chosen.robots) if index not in done]
    with closing(_tried(setting, left, engine, workers)) as results:
        for found in results:
            done.update(found)
            if resume is not None:
                _append(Path(resume), setting, done)
            progress(len(done), chosen.robots)
    rows = [row for index in range(chosen.robots) for row in done[index]]
    if all(row["failed"] for row in rows):
        raise FitError(f"none of the {len(rows)} campaigns could be fitted: {rows[0]['failed']}")
    return Study(
        rows=tuple(rows),
        robots=chosen.robots,
        seed=chosen.seed,
        accuracy=task.accuracy,
        model_error=setting.robots.model_error.position,
        model_error_origin=setting.robots.model_error.source,
        origin=setting.robots.origin,
        before=errors_before(setting, chosen.robots) if setting.aligned else (),
    )


def _tried(setting: StudySetting, robots: list[int], engine: str, workers: int) -> Generator[Rows, None, None]:
    """Rows of some robots after another, as they are done."""
    function = partial(try_robots, setting)
    if engine == "loky" and robots:
        # here, so that what has to be compiled is compiled once, and said, before every worker would
        yield function(robots[:1])
        robots = robots[1:]
    yield from side_by_side(function, _in_groups(robots, engine, workers), engine, workers)


def _in_groups(robots: list[int], engine: str, workers: int) -> list[list[int]]:
    """Robots of each task, so few that every worker gets some groups."""
    if workers < 1:
        workers = 1 if engine == "sequential" else os.cpu_count() or 1
    size = max(min(MAX_ROBOTS_PER_TASK, -(-len(robots) // (MIN_GROUPS_PER_WORKER * workers))), 1)
    return [robots[first : first + size] for first in range(0, len(robots), size)]


def _prepare(model: ErrorModel, task: Task, options: StudyOptions) -> StudySetting:
    seed, noise = options.seed, options.noise or TrackerNoise()
    robots = _robots(model, options)
    model_error = robots.model_error
    goal = reach_task(model, task, GOAL_POSES, seed)
    room = enlarge(task, model) if options.aligned else measuring_task(model, task)
    fixed: dict[str, np.ndarray] = {}
    asked = PlanOptions(seed=seed, noise=noise, model_error=model_error.position, stations=options.stations)
    planning = PoseChoice.among(model, task, asked) if "planned" in options.plans else None
    for count in options.counts:
        if planning is not None:
            fixed[f"planned {count}"] = planning.choose(count).q
        if "grid" in options.plans:
            fixed[f"grid {count}"] = reach_task(model, room, count, 0).q
    fits = {name: replace(_fit_of(robots, task, name), noise=noise) for name in options.models}
    return StudySetting(
        task_q=goal.q,
        weights=goal.weights,
        plans=fixed,
        pool=reach_task(model, room, POOL_POSES, seed + 1).q,
        cases=tuple(
            (way, kind, count) for way in options.observe for count in options.counts for kind in options.plans
        ),
        models=fits,
        noise=noise,
        seed=seed,
        robots=robots,
        aligned=options.aligned,
        stations=options.stations,
    )


def _robots(model: ErrorModel, options: StudyOptions) -> VirtualRobots:
    known = options.calibration
    if known is None:
        return VirtualRobots.of_tolerances(model, options.model_error)
    if known.model.robot.digest != model.robot.digest or known.names != model.names:
        raise CampaignError("the calibration is of another robot or model; study the calibration's own model")
    return VirtualRobots.like(known, options.model_error)


def _fit_of(robots: VirtualRobots, task: Task, name: str) -> FitOptions:
    """Options of the identification that a model's name stands for."""
    model = robots.model
    if name == "selected":
        return FitOptions(keep=select(model, task, model_error=robots.model_error.position).kept)
    if name.startswith("published"):
        if not model.robot.published.source:
            raise TaskcalError(f"nothing is published of {model.robot.name}; leave out the model '{name}'")
        return FitOptions(keep=published_kept(model), prior=None if name.endswith("damped") else "tolerances")
    return FitOptions(prior=robots.prior) if name == "all" and robots.prior is not None else FitOptions()


def _fingerprint(setting: StudySetting) -> str:
    robots = setting.robots
    out = hashlib.sha256((robots.model.robot.digest + " ".join(robots.model.names)).encode())
    sizes = (
        (1e6 * robots.deviations, 1e6 * robots.joint_error) if robots.deviations is not robots.model.tolerances else ()
    )
    for array in (setting.task_q, setting.weights, setting.pool, *setting.plans.values(), *sizes):
        out.update(np.round(array, 9).tobytes())
    models = {name: (options.keep, options.prior is None) for name, options in setting.models.items()}
    cases = setting.cases if setting.aligned else [case[1:] for case in setting.cases]
    if setting.stations > 1:
        out.update(f"{setting.stations} stations".encode())
    out.update(
        json.dumps(
            [cases, models, setting.seed, vars(setting.noise), setting.robots.model_error.position],
            sort_keys=True,
        ).encode()
    )
    return out.hexdigest()[:16]


def _read(resume: str | Path | None, setting: StudySetting) -> dict[int, list[dict[str, Any]]]:
    if resume is None or not Path(resume).exists():
        return {}
    try:
        data = parse_json(read_text(resume), resume)
        content = decode(StudyFile, {key: data[key] for key in data.keys() - {SEAL}})
        done = {int(index): [describe(row) for row in rows] for index, rows in content.robots.items()}
    except (ValueError, AttributeError, RecursionError, TaskcalError) as error:
        raise FileError(resume, "does not hold a study; name another file, or remove it") from error
    unseal(resume, data, "restore it, or remove it to start afresh")
    if content.study != _fingerprint(setting):
        raise FileError(resume, "holds a study of other settings; name another file, or remove it to start afresh")
    return done


def _append(path: Path, setting: StudySetting, done: Mapping[int, list[dict[str, Any]]]) -> None:
    content = {"study": _fingerprint(setting), "robots": {str(index): done[index] for index in sorted(done)}}
    write_whole(path, json.dumps(sealed(content)))
