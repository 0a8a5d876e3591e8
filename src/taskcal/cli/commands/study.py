"""``taskcal study``: the expected task error after calibration, over many simulated robots."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import option, output_option
from taskcal.cli.options.common import (
    EngineOptions,
    ModelOptions,
    TaskOption,
    choose_names,
    split_names,
)
from taskcal.cli.options.observing import TRACKER, check_instruments
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import info
from taskcal.cli.progress import bar_by_parts, is_watched
from taskcal.cli.run import File, Result, count_as_written
from taskcal.observations import instrument_classes
from taskcal.planning.options import MODELS, PLANS, StudyOptions
from taskcal.tables.frame import csv_of
from taskcal_groundwork.options import Written

if TYPE_CHECKING:
    import taskcal.report.study


@dataclass(frozen=True, kw_only=True)
class CaseOptions:
    """Plans, instruments and models of a study.

    Raises:
        typer.BadParameter: a list has something else than numbers or names of plans.
    """

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
    choice: Written[StudyOptions],
    cases: CaseOptions,
    running: EngineOptions,
    resume: Path | None = option(
        None, "FILE.json", "Save progress to this file, and resume from it after an interruption.", writes="updated"
    ),
    output: Path | None = output_option(None, "ROWS.csv", "Output CSV: every single result."),
    page: PageOptions,
) -> Result:
    """Predict the task error after calibration, by simulating many robots.

    Each is drawn from the tolerances, or from the posterior of a calibration, with a model error at every pose. It is measured by
    every plan, identified with every model, and compared with the truth.
    """
    model, calibration = of.load()
    described = taskcal.load_task(task)
    study = _run(model, calibration, described, choice, cases, running, resume)
    return Result(
        summary=_result(model.robot.name, study) | ({} if output is None else {"rows": output}),
        sections=lambda: [taskcal.report.study.study_section(study, model.robot.name, described.name)],
        files=[File("rows", output, csv_of(study.rows))],
        page=lambda: taskcal.report.study.study_page(model, described, study),
    )


def _run(
    model: "taskcal.ErrorModel",
    calibration: "taskcal.Calibration | None",
    task: "taskcal.Task",
    choice: Written[StudyOptions],
    cases: CaseOptions,
    running: EngineOptions,
    resume: Path | None,
) -> "taskcal.Study":
    options = choice.made(
        plans=choose_names(cases.kinds, "--plans", PLANS),
        models=choose_names(cases.models, "--models", MODELS),
        observe=[check_instruments(name) for name in cases.instruments],
        counts=_numbers(cases.counts),
        calibration=calibration,
    )
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
            options=options,
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
