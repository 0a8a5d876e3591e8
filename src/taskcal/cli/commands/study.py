"""``taskcal study``: the expected task error after calibration, over many simulated robots."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.common import (
    EngineOptions,
    ModelErrorOption,
    ModelOptions,
    SeedOption,
    TaskOption,
    choose_names,
    metres,
    split_names,
)
from taskcal.cli.options.observing import TRACKER, check_instruments
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import count_as_written, files_of_task, info, show, show_facts
from taskcal.cli.progress import bar_by_parts, is_watched
from taskcal.observations import instrument_classes
from taskcal.tables.frame import csv_of

if TYPE_CHECKING:
    from taskcal.planning.study import PlanKind
    from taskcal.report.page import Page


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """Plans, models and number of robots of a study.

    Raises:
        typer.BadParameter: a list has something else than numbers or names of plans.
    """

    robots: int = option(200, "N", "Virtual robots to draw.", min=1)
    counts: str = option("30,60", "N,…", "Numbers of measured poses.")
    plans: str | None = option(
        None,
        "PLAN,…",
        "Selection of the poses: planned, random, grid; by default planned and random, or random with --observe.",
    )
    observe: str = option(
        "tracker",
        "INSTRUMENT,…",
        f"Instruments: {', '.join(instrument_classes())}, or several at once, as socket+wire.",
    )
    models: str = option(
        "all",
        "MODEL,…",
        "Identified models: all, selected, published, published-damped, geometry (no effects), or auto (significant effects).",
    )
    stations: int = option(1, "N", "Places that the tracker is moved to, as many poses at each.", min=1)
    model_error_mm: ModelErrorOption = None
    seed: SeedOption = 0

    @property
    def instruments(self) -> list[str]:
        """Names of the instruments, or of several with a plus between."""
        return split_names(self.observe, "--observe") or []

    @property
    def kinds(self) -> str:
        """Kinds of plans."""
        return self.plans or ("planned,random" if self.instruments == [TRACKER] else "random")

    def __post_init__(self) -> None:
        _numbers(self.counts)


def command(
    *,
    of: ModelOptions,
    task: TaskOption,
    choice: StudyOptions,
    running: EngineOptions,
    resume: Path | None = option(
        None, "FILE.json", "Save progress to this file, and resume from it after an interruption."
    ),
    output: Path | None = option(None, "ROWS.csv", "Output CSV: every single result.", also="-o"),
    page: PageOptions,
) -> None:
    """Predict the task error after calibration, by simulating many robots.

    Each is drawn from the tolerances, or from the posterior of a calibration, with a model error at every pose. It is measured by
    every plan, identified with every model, and compared with the truth.
    """
    outputs = page.begin(
        "study",
        [("--output", output), ("--resume", resume)],
        [of.robot, of.calibration, *files_of_task(task)],
        updated=("--resume",),
    )

    model, calibration = of.load()
    described = taskcal.load_task(task)
    study = _run(model, calibration, described, choice, running, resume)

    def make() -> "Page":
        from taskcal.report.study import study_page

        return study_page(model, described, study)

    rows = {} if output is None else {output: csv_of(study.rows)}
    made = page.write(outputs, rows, make)
    result = _result(model.robot.name, study) | ({} if output is None else {"rows": output})
    page.give(result, lambda: _show(study, result, described.name, page.in_words(made)))


def _run(
    model: "taskcal.ErrorModel",
    calibration: "taskcal.Calibration | None",
    task: "taskcal.Task",
    choice: StudyOptions,
    running: EngineOptions,
    resume: Path | None,
) -> "taskcal.Study":
    from taskcal.planning.study import MODELS, PLANS

    kinds = cast("list[PlanKind]", choose_names(choice.kinds, "--plans", PLANS))
    models = choose_names(choice.models, "--models", MODELS)
    instruments = [check_instruments(name) for name in choice.instruments]
    with bar_by_parts("poses to measure", choice.robots) as show:
        tenths = 0

        def advance(done: int, total: int) -> None:
            nonlocal tenths
            if resume is not None and resume.exists():
                count_as_written(resume)
            show("robots", done, total)
            if 10 * done // total > tenths and done < total and not is_watched():
                tenths = 10 * done // total
                info(f"{done} of {total} robots")

        return taskcal.study(
            model,
            task,
            calibration=calibration,
            robots=choice.robots,
            counts=_numbers(choice.counts),
            plans=kinds,
            models=models,
            observe=instruments,
            stations=choice.stations,
            seed=choice.seed,
            model_error=metres(choice.model_error_mm),
            engine=running.engine_name,
            workers=running.max_workers,
            resume=resume,
            progress=advance,
        )


def _numbers(text: str) -> list[int]:
    """Numbers of poses from a list with commas."""
    names = split_names(text, "--counts") or []
    for name in names:
        if not (name.isascii() and name.isdigit() and int(name) > 0):
            raise typer.BadParameter(
                f"'{name}' is not a number of poses; write for example 30,60", param_hint="--counts"
            )
    return [int(name) for name in names]


def _result(robot: str, study: "taskcal.Study") -> dict[str, Any]:
    return {
        "robot": robot,
        "robots": study.robots,
        "seed": study.seed,
        "accuracy_mm": None if study.accuracy is None else study.accuracy * 1e3,
        "model_error_mm": study.model_error * 1e3,
        "model_error_origin": study.model_error_origin,
        "before_mm": {name: 1e3 * value for name, value in study.spread_before().items()},
        "unlearnt": study.unlearnt,
        "failed": [
            {key: row[key] for key in ("robot", "observe", "plan", "count", "model", "failed")} for row in study.failed
        ],
        "summary": study.summary(),
    }


def _show(study: "taskcal.Study", result: Mapping[str, Any], task: str, pages: str) -> None:
    from taskcal.report.content import state_model_error
    from taskcal.report.study import describe_failed, describe_unlearnt, tabulate_study

    show(tabulate_study(study, task))
    facts = [("robots", f"{result['robots']} {result['robot']} {study.origin}, seed {result['seed']}")]
    facts.append(("model error", state_model_error(result["model_error_mm"], result["model_error_origin"])))
    facts.append(("at a pose", "rms of model error and identification error; compared with the required accuracy"))
    if study.failed:
        facts.append(("not fitted", describe_failed(study)))
    if study.unlearnt:
        facts.append(("not identifiable", describe_unlearnt(study)))
    if study.aligned:
        before = {name: 1e3 * value for name, value in study.spread_before().items()}
        facts.append(
            (
                "before",
                f"nominal, frames taught: median {before['median']:.2f} mm (5 to 95 %: {before['p05']:.2f} to {before['p95']:.2f})",
            )
        )
        facts.append(("errors", "remaining after work frame and TCP were taught with the robot"))
    facts += [("rows", f"wrote {result['rows']}")] if "rows" in result else []
    facts += [("report", f"wrote {pages}")] if pages else []
    show_facts(facts)
