"""A study as a page: the spread of the task error, and its quantiles."""

from collections import Counter

from taskcal.errors import listed, shown
from taskcal.planning.study import Study
from taskcal.report.chart import SERIES, Axis, Figure, Level, Panel, Series
from taskcal.report.content import NOMINAL, Chart, Column, Facts, Section, TextTable, state_model_error
from taskcal.report.page import Report
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

MAX_REASONS, MAX_ROBOTS = 3, 10
"""Reasons why campaigns were not fitted, and robots of each, that are named."""


def draw_study(study: Study) -> Figure:
    """Draw a box of rms errors of the geometry over all robots for every plan, number of poses and model.

    A line shows what the accuracy that the task needs leaves to the geometry, beside the model error of a single pose.
    """
    rows = [row for row in study.rows if not row["failed"]]
    kinds = [f"{row['observe']}, " if study.aligned else "" for row in rows]
    names = [f"{kind}{row['plan']}, {row['count']} poses" for kind, row in zip(kinds, rows, strict=True)]
    places = list(dict.fromkeys(names))
    series: list[Series] = []
    for k, model in enumerate(dict.fromkeys(row["model"] for row in study.rows)):
        own = [
            (row["rms_mm"], places.index(name)) for row, name in zip(rows, names, strict=True) if row["model"] == model
        ]
        colour = SERIES[(k + 1) % len(SERIES)]
        x, y = ([one[end] for one in own] for end in (0, 1))
        series.append(Series(kind="boxes", name=model, x=x, y=y, colour=colour))
    levels: tuple[Level, ...] = ()
    if study.geometry_allowance:
        needed = f"accuracy that the task needs{', less the model error' if study.model_error else ''}"
        levels = (Level(at=study.geometry_allowance * 1e3, name=needed, along="x"),)
    x = Axis(title="true task error, rms", unit="mm", log=True)
    return Figure(panels=(Panel(x=x, y=Axis(categories=tuple(places)), series=tuple(series), levels=levels),))


def tabulate_study(study: Study, task: str) -> TextTable:
    """Tabulate quantiles over the robots for each instrument, plan, number of poses and model.

    Args:
        study: what it found.
        task: the task's name.
    """
    columns = [
        *([Column("measured by", "observe")] if study.aligned else []),
        Column("plan", "plan"),
        Column("poses", "count", "d"),
        Column("model", "model"),
        *([Column("robots", "robots", "d")] if study.failed else []),
        Column("median mm", "median_mm", ".3f"),
        Column("p05 mm", "p05_mm", ".3f"),
        Column("p95 mm", "p95_mm", ".3f"),
        Column("rms mm", "rms_mm", ".3f"),
        Column("at a pose mm", "rms_with_model_error_mm", ".3f"),
    ]
    if study.accuracy is not None:
        columns.append(Column(f"within {study.accuracy * 1e3:g} mm", "share_accurate", ".0%"))
    count = f"{study.robots} simulated robots{', those that were fitted' if study.failed else ''}"
    title = f"True 3D rms error of the identified geometry over '{task}', {count}"
    return TextTable.of(title, columns, study.summary())


def describe_unlearnt(study: Study) -> str:
    """State how many campaigns determine no parameter, and what counts in their place."""
    return (
        f"from {study.unlearnt} of {len(study.rows)} campaigns, whose rows determine no parameter beside the model error: the "
        f"{NOMINAL} model counts for them; measure more poses"
    )


def describe_failed(study: Study) -> str:
    """State how many campaigns were not fitted, by reason, with the robots."""
    by_reason: dict[str, list[int]] = {}
    for row in study.failed:
        by_reason.setdefault(row["failed"], []).append(row["robot"])
    reasons = sorted(by_reason.items(), key=lambda item: -len(item[1]))
    named = [f"{_robots(numbers)}: {shown(reason, 200)}" for reason, numbers in reasons[:MAX_REASONS]]
    more = f"; and for {len(reasons) - MAX_REASONS} other reasons" if len(reasons) > MAX_REASONS else ""
    return f"{len(study.failed)} of {len(study.rows)} campaigns, which no figure counts. {'; '.join(named)}{more}"


def _robots(numbers: list[int]) -> str:
    """Robots in words, with how often each is named."""
    counts = Counter(numbers)
    named = [f"{number}{f' ({times} campaigns)' if times > 1 else ''}" for number, times in counts.items()]
    return f"robot{'s' if len(named) > 1 else ''} {listed(named, MAX_ROBOTS)}"


def study_section(study: Study, robot: str, task: str) -> Section:
    """Make the section of a study.

    Args:
        study: what it found.
        robot: its name.
        task: likewise.
    """
    before = {name: 1e3 * value for name, value in study.spread_before().items()}
    return Section(
        "Error over the task",
        f"Each robot is simulated, {study.origin}, measured by every plan with the noise of its instrument, identified, and "
        f"compared with the truth over the task {_frame(study)}.",
        Chart(
            "Task error over all robots",
            draw_study(study),
            "A low box: small errors; a long one: large spread. Boxes reach from the first to the third quartile, with the median "
            "in them. Logarithmic scale.",
        ),
        tabulate_study(study, task),
        Facts(
            ("robots", f"{study.robots} {robot} {study.origin}, seed {study.seed}"),
            ("model error", state_model_error(study.model_error * 1e3, study.model_error_origin)),
            (
                "at a pose",
                "rms of model error and identification error; compared with the required accuracy. The model error is in the "
                "measurements of every robot; it is uncorrelated here, but spatially correlated on a real robot",
            ),
            ("not fitted", describe_failed(study)) if study.failed else None,
            ("not identifiable", describe_unlearnt(study)) if study.unlearnt else None,
            (
                "before",
                f"nominal, frames taught: median {before['median']:.2f} mm (5 to 95 %: {before['p05']:.2f} to {before['p95']:.2f})",
            )
            if study.aligned
            else None,
        ),
    )


def study_page(model: ErrorModel, task: Task, study: Study) -> Report:
    """Make the page of a study.

    Args:
        model: the model that the robots were drawn from.
        task: what they have to do.
        study: what it found.
    """
    robot = model.robot.title or model.robot.name
    return Report(
        title=f"Study of {task.name}",
        sections=(study_section(study, model.robot.name, task.name),),
        lead=f"{study.robots} simulated robots of type {robot}.",
        source=f"robot {model.robot.name}; seed {study.seed}",
    )


def _frame(study: Study) -> str:
    """The frame of the errors, in words."""
    if not study.aligned:
        return "in the tracker frame"
    return "after teaching work frame and TCP with the calibrated robot, so that all instruments are judged alike"
