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
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from taskcal.adaptation.candidates import enlarge, measuring_task
from taskcal.adaptation.chosen_poses import PoseChoice
from taskcal.adaptation.geometry_allowance import allow_geometry
from taskcal.adaptation.plan_options import PlanOptions
from taskcal.adaptation.selection import select
from taskcal.adaptation.studied_robot import StudySetting, errors_before, robots_together, try_robots
from taskcal.adaptation.study_options import StudyChoices, StudyOptions
from taskcal.adaptation.virtual_robots import VirtualRobots
from taskcal.adaptation.workers import side_by_side
from taskcal.analysis.elimination_table import published_kept
from taskcal.arguments import expect_kinds, warn_renamed
from taskcal.errors import CampaignError, FileError, TaskcalError
from taskcal.files import write_whole
from taskcal.identification.fit_options import FitOptions
from taskcal.measurement.tracker import TrackerNoise
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from taskcal.text_file import read_text

if TYPE_CHECKING:
    import pandas as pd

POOL = 2000
"""Poses of the task's workspace that random plans are drawn from."""

GROUPS = 4
"""Of robots for each worker, at least: what is done is kept as often, and the last to end is not waited for long."""

Rows = list[tuple[int, list[dict[str, Any]]]]
"""Of robots, by their numbers."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class Study:
    """Task errors of every robot, plan, number of poses and model."""

    rows: tuple[Mapping[str, Any], ...]
    """One for each: robot, observe, plan, count, model; rms_mm and max_mm of the error of the predicted geometry over the task, and
    rms_with_model_error_mm of single poses, which have the model error beside it; and whether anything was learnt from the
    measurements, or else the nominal robot stands for the calibrated one, with its frames found."""
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
        return sum(not row.get("learnt", True) for row in self.rows)

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
        """What the accuracy leaves to the identified geometry, beside the model error of a single pose, metres.

        None if no accuracy is stated; zero if the model error alone takes all of it.
        """
        return allow_geometry(self.accuracy, self.model_error)

    def to_frame(self) -> "pd.DataFrame":
        """All rows."""
        import pandas as pd

        return pd.DataFrame(list(self.rows))

    def summary(self) -> list[dict[str, Any]]:
        """Quantiles over the robots of the rms error, for each plan, count and model, in the order asked for.

        Where the task states an accuracy, ``share_accurate`` is the share of robots that meet it at single poses.
        """
        groups: dict[tuple[str, str, int, str], list[Mapping[str, Any]]] = {}
        for row in self.rows:
            groups.setdefault((row["observe"], row["plan"], row["count"], row["model"]), []).append(row)
        return [
            {"observe": way, "plan": kind, "count": count, "model": model, **self._quantiles(rows)}
            for (way, kind, count, model), rows in groups.items()
        ]

    def _quantiles(self, rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
        """Of the robots of one plan, count and model."""
        geometry = np.array([row["rms_mm"] for row in rows])
        single = np.array([row["rms_with_model_error_mm"] for row in rows])
        accurate = {} if self.accuracy is None else {"share_accurate": float(np.mean(single <= self.accuracy * 1e3))}
        return {
            "median_mm": float(np.median(geometry)),
            "p05_mm": float(np.percentile(geometry, 5)),
            "p95_mm": float(np.percentile(geometry, 95)),
            "rms_mm": float(np.sqrt(np.mean(np.square(geometry)))),
            "rms_with_model_error_mm": float(np.sqrt(np.mean(np.square(single)))),
            **accurate,
        }

    def to_json(self) -> dict[str, Any]:
        """Former report: `summary`, and what the study rests on."""
        warn_renamed("Study.to_json", "summary", stacklevel=2)
        return {
            "robots": self.robots,
            "seed": self.seed,
            "accuracy_mm": None if self.accuracy is None else self.accuracy * 1e3,
            "model_error_mm": self.model_error * 1e3,
            "model_error_origin": self.model_error_origin,
            "summary": self.summary(),
        }


def study(
    model: ErrorModel,
    task: Task,
    *,
    engine: str = "loky",
    workers: int = -1,
    resume: str | Path | None = None,
    progress: Progress = lambda done, total: None,
    **options: Unpack[StudyChoices],
) -> Study:
    """Simulate many true robots and see how accurate the task becomes.

    Args:
        model: the model that the true robots are drawn from.
        task: what the robot has to do.
        engine: of joblib: ``loky``, ``threading``, ``sequential``, or ``dask:ADDRESS`` of a scheduler.
        workers: how many; −1 for one per core.
        resume: a file that keeps what is done; a study that was interrupted goes on from it.
        progress: called with the robots done and their total.
        **options: those of `StudyOptions`, each by its name, and all at once as ``options``; names replace what is in those.

            ``robots``: how many true robots.

            ``counts``: numbers of measured poses.

            ``plans``: ``planned`` by `plan`, ``random`` or ``grid`` in the task's own workspace.

            ``models``: ``all`` parameters, those ``selected`` for the task, the ``published`` ones, or ``published-damped``
            without prior; ``geometry`` without the model's effects, or ``auto`` with those that the data prove (`explain`).

            ``seed``: of everything.

            ``noise``: the tracker's.

            ``model_error``: standard deviation per axis of what no parameter explains, metres, which every robot has at every
            pose; by default that of the robot's file, or of a typical robot (`model_error_of`).

            ``calibration``: of this model; robots like that one, with defects and effects of the sizes that it found, and its
            model error, in place of the tolerances.

            ``observe``: how the robots are measured, each way as `simulate` has it; by a tracker by default.

    Raises:
        CampaignError: the calibration is of another robot or model, or has no prior.
        UnknownName: a plan, model or engine that does not exist.
        FileError: the file to resume from belongs to another study.
        ReachError: the robot does not reach the task.
    """
    expect_kinds({"model": ErrorModel, "task": Task}, model=model, task=task)
    chosen = StudyOptions.of(**options)
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
    function, most = partial(try_robots, setting), robots_together(setting)
    if engine == "loky" and most > 1 and robots:
        # here, so that what has to be compiled is compiled once, and said, before every worker would
        yield function(robots[:1])
        robots = robots[1:]
    yield from side_by_side(function, _in_groups(robots, most, engine, workers), engine, workers)


def _in_groups(robots: list[int], most: int, engine: str, workers: int) -> list[list[int]]:
    """Robots that are tried at once, so many at most, and so few that every worker gets some groups."""
    if workers < 1:
        workers = 1 if engine == "sequential" else os.cpu_count() or 1
    size = max(min(most, -(-len(robots) // (GROUPS * workers))), 1)
    return [robots[first : first + size] for first in range(0, len(robots), size)]


def _prepare(model: ErrorModel, task: Task, options: StudyOptions) -> StudySetting:
    seed, noise = options.seed, options.noise or TrackerNoise()
    robots = _robots(model, options)
    model_error = robots.model_error
    goal = reach_task(model, task, 200, seed)
    room = enlarge(task, model) if options.aligned else measuring_task(model, task)
    fixed: dict[str, np.ndarray] = {}
    asked = PlanOptions(seed=seed, noise=noise, model_error=model_error.position)
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
        pool=reach_task(model, room, POOL, seed + 1).q,
        cases=tuple(
            (way, kind, count) for way in options.observe for count in options.counts for kind in options.plans
        ),
        models=fits,
        noise=noise,
        seed=seed,
        robots=robots,
        aligned=options.aligned,
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
        data = json.loads(read_text(resume))
        done = {int(index): [_row(row) for row in rows] for index, rows in data["robots"].items()}
        fingerprint = data["study"]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FileError(resume, "does not hold a study; name another file, or remove it") from error
    if fingerprint != _fingerprint(setting):
        raise FileError(resume, "holds a study of other settings; name another file, or remove it to start afresh")
    return done


def _row(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row as it was written; a KeyError where it is not whole."""
    row = {"observe": "tracker", "learnt": True, **row}
    kinds = {"robot": int, "plan": str, "count": int, "model": str}
    errors = {"rms_mm": float, "max_mm": float, "rms_with_model_error_mm": float, "observe": str, "learnt": bool}
    return {key: kind(row[key]) for key, kind in (kinds | errors).items()}


def _append(path: Path, setting: StudySetting, done: Mapping[int, list[dict[str, Any]]]) -> None:
    content = {"study": _fingerprint(setting), "robots": {str(index): done[index] for index in sorted(done)}}
    write_whole(path, json.dumps(content))
