"""The program: what is read with it, its correction, what was refused at which line, and what changed."""

import asyncio
import difflib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from nicegui import ui

from robot_programs.languages import language_of
from robot_programs.reading import read_program
from taskcal.errors import TaskcalError
from taskcal.identification.calibration import load_calibration
from taskcal.report.correction import correction_sections, doubts_section
from taskcal_studio.controls import (
    button,
    colour_bar,
    drop_zone,
    facts,
    line_of_text,
    message,
    set_attribute,
    text,
    tick,
)
from taskcal_studio.option_form import of_project, option_fields
from taskcal_studio.pages.cell_editor import AxisEditor, MeasuredEditor, Named, asked_axes, named_in
from taskcal_studio.project import CELL_ENDINGS, LAYOUT, PROGRAM_ENDINGS, Choices, Project, free_name
from taskcal_studio.results import corrected_of, read_result, robot_of
from taskcal_studio.runs import Status, Studio
from taskcal_studio.sections import show_sections
from taskcal_studio.stated_options import arguments, asked, offered
from taskcal_studio.steps import (
    begin,
    choose_calibration,
    choose_file,
    choose_or_drop,
    download,
    is_running,
    link,
    show_error,
    show_run,
)
from taskcal_studio.task_box import read_together
from taskcal_studio.texts import Texts
from taskcal_studio.verdict import AROUND, BOUNDS, is_lowered_by, show_verdict
from taskcal_studio.views import CellView, add_views

MAX_COMPARED_LINES = 20_000
"""Of a file; a comparison takes a time that grows with their square at worst."""

MAX_LINES = 400
"""Of a comparison that are shown; the corrected file has them all."""

MAX_LISTED_BYTES = 2_000_000
"""Of a program whose tools and parts are listed: it is read in a few seconds each time the page is shown."""

RESULT_KEYS = (
    "written",
    "targets",
    "refused",
    "remarks",
    "expected",
    "verdict",
    "added_lines",
    "smallest_singular_ratio",
)
"""That the page needs of what the command printed."""

LOW, HIGH = np.array([0.2, 0.5, 0.8]), np.array([0.45, 0.1, 0.0])
"""Colours of no error and of the largest: light blue and dark red, which differ in grey and to those who see no red, too."""


ACCEPT = "accept-uncertain"
"""Option that a refusal names where the calibration knows too little of the program's poses, and more poses help."""

MAX_JOINED, PATH = 1000, "#7b8794"
"""Targets of a program, at most, that are joined by lines, and the colour of these; more lie so close that they show the path."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    files = {path: path for path in project.files(LAYOUT.programs, PROGRAM_ENDINGS)}
    if files:
        choose_file(project, texts, "program", files)
    drop_zone(texts, "program", texts("program.drop"), PROGRAM_ENDINGS, several=True)
    if not choices.program:
        text("p", texts("program.none"))
        return
    if not project.calibrations():
        return
    chosen = choose_calibration(project, texts)
    result = read_result(project, corrected_of(choices.program), *RESULT_KEYS)
    reasons = [] if result is None else [item.get("reason", "") for item in result["refused"]]
    named = await asyncio.to_thread(_named, project)
    asked = asked_axes(reasons)
    last = studio.run_of("correct")
    failed = last is not None and last.status is Status.refused
    is_open = failed or bool(asked) or is_lowered_by(result and result["verdict"], "tool", "part")
    facts([(texts("program.read"), ", ".join(read_together(project, choices.program)))])
    if _has_own_kinematics(choices):  # it is asked for before a correction is refused for want of it
        _controller(project, texts)
    with ui.element("details").props(f"id={BOUNDS}") as bounds:
        set_attribute(bounds, "open", bool(reasons))
        text("summary", texts("program.bounds"))
        option_fields(project, texts, of_project(project, "correct"), *offered("correct"))
    run = show_run(studio, "correct", texts, about=choices.program)
    if chosen and not is_running(run):
        button(texts("program.correct"), lambda: begin_correction(studio), plain=result is not None)
    # a correction that is withheld has a result, whose verdict says what to lower; one that is refused has none
    refused = [] if run is None or run.status is not Status.refused or run.result is not None else run.messages
    uncertain = any(ACCEPT in said for said in refused)
    if uncertain:
        link(texts("plan.title"), "/plan")
    if result is not None:
        await _show(result, project, texts)
        uncertain |= not result["written"] and bool(result["corrected"])
    if uncertain and not is_running(run):
        button(texts("program.write_anyway"), lambda: begin_correction(studio, accept_uncertain=True), plain=True)
    _around(studio, texts, asked, named, is_open=is_open)
    for path in () if result is None else result["written"]:
        lines = await asyncio.to_thread(_changes, project, path)
        _compare(Path(path).name, lines, texts)


def _named(project: Project) -> list[Named] | None:
    """Tools and parts of the program; None where it takes long to read."""
    choices = project.choices
    sources = [project.path(path) for path in read_together(project, choices.program)]
    if sum(source.stat().st_size for source in sources) > MAX_LISTED_BYTES:
        return None
    with suppress(OSError, TaskcalError):  # of a program that is not read the correction says why
        return named_in(read_program(*sources, robot=robot_of(project)).motions)
    return []


def _around(
    studio: Studio, texts: Texts, asked: Sequence[int], named: Sequence[Named] | None, *, is_open: bool
) -> None:
    """Edit the cell file (measured tools and parts, external axes)."""
    project = studio.project
    choices = project.choices
    cells = {path: path for path in project.files(LAYOUT.cells, CELL_ENDINGS)}

    with ui.element("details").props(f"id={AROUND}") as around:
        set_attribute(around, "open", is_open)
        text("summary", texts("program.around"))
        text("p", texts("program.around_how")).classes("quiet")
        choose_file(project, texts, "cell", cells, none=texts("program.no_cell"))
        drop_zone(texts, "cell", texts("program.drop_cell"), CELL_ENDINGS)
        text("h2", texts("measured.title"))
        if named is None:
            text("p", texts("measured.large")).classes("quiet")
        try:
            robot = robot_of(project)
            for one in named or ():
                MeasuredEditor(project, robot, one, texts)
        except TaskcalError as error:
            show_error(project, error)
        text("p", texts("program.missing_how")).classes("quiet")
        button(texts("program.missing"), lambda: begin_correction(studio, missing=True), plain=True)
        line_of_text(texts("program.tool"), choices.tool, lambda value: project.choose(tool=value))
        line_of_text(texts("program.part"), choices.part, lambda value: project.choose(part=value))
        AxisEditor(project, asked, texts)
        if not _has_own_kinematics(choices):
            _controller(project, texts)
        tick(texts("program.helper"), choices.helper, lambda value: project.choose(helper=value))


def _has_own_kinematics(choices: Choices) -> bool:
    """Whether controllers of the program's language compute with what the factory measured of the arm."""
    return bool(language_of(Path(choices.program)).controller_kinematics)


def _controller(project: Project, texts: Texts) -> None:
    """With which kinematics the controller computes."""
    nominal = project.choices.nominal_controller
    text("p", texts("program.controller_how")).classes("quiet")
    choose_or_drop(project, texts, "kinematics", none=texts("program.no_kinematics"))
    tick(texts("program.nominal"), nominal, lambda value: project.choose(nominal_controller=value))


def arguments_of(project: Project, choices: Choices, *, missing: str = "", accept_uncertain: bool = False) -> list[str]:
    """Arguments of ``taskcal`` for a correction."""
    return asked(
        "correct",
        arguments("correct", choices.options),
        programs=read_together(project, choices.program),
        calibration=choices.calibration,
        output=LAYOUT.corrected,
        report=report_of_correction(choices),
        task=choices.task,
        cell=choices.cell,
        tool=choices.tool,
        part=choices.part,
        controller_kinematics=choices.kinematics,
        nominal_controller=choices.nominal_controller,
        helper=choices.helper,
        all_rows=True,
        missing=missing,
        accept_uncertain=accept_uncertain,
    )


def begin_correction(studio: Studio, *, missing: bool = False, accept_uncertain: bool = False) -> None:
    """Correct the program as chosen.

    Args:
        studio: whose program it is.
        accept_uncertain: whether it is written by this run even if its uncertainty exceeds the correction.
        missing: whether tools and parts that no file declares are written into a new cell file, which is then the chosen one.
    """
    project = studio.project
    choices = project.choices
    outputs = [*map(corrected_of, read_together(project, choices.program)), report_of_correction(choices)]
    chosen = dict[str, str]()
    if missing:
        taken = [Path(path).name for path in project.files(LAYOUT.cells, CELL_ENDINGS)]
        chosen["cell"] = f"{LAYOUT.cells}/{free_name(f'{Path(choices.program).stem}-cell.toml', taken)}"
    written = chosen.get("cell", "")
    arguments = arguments_of(project, choices, missing=written, accept_uncertain=accept_uncertain)
    begin(studio, "correct", arguments, outputs=outputs, chosen=chosen, page="program")


def report_of_correction(choices: Choices) -> str:
    """Path of the report on the correction of a program."""
    return f"{LAYOUT.reports}/{Path(choices.program).stem}-correction.html"


async def _show(result: Mapping[str, Any], project: Project, texts: Texts) -> None:
    placed = await asyncio.to_thread(_place, result, project) if result["written"] else None
    if placed is not None:
        _along(*placed, texts)
    show_sections(doubts_section(result), texts)
    show_verdict(result["verdict"], texts)
    try:
        calibration = await asyncio.to_thread(load_calibration, project.path(project.choices.calibration))
        show_sections(correction_sections(result, calibration.model.robot), texts)
    except TaskcalError as error:
        show_error(project, error)
    if not result["written"]:
        message(texts("program.withheld"))
        return
    with ui.element("div").classes("row"):
        for path in (*result["written"], *([result["report"]] if result["report"] else [])):
            download(texts, path)


def _place(result: Mapping[str, Any], project: Project) -> tuple[np.ndarray, np.ndarray, list[str]] | None:
    """Targets in the base, metres, their errors before and after, millimetres, and where they stand in the text."""
    try:
        sources = [project.path(path) for path in result["program"]]
        motions = read_program(*sources, robot=robot_of(project)).motions
    except TaskcalError:
        return None  # a tool or part of the cell file is needed to read it; the numbers are in the table and the report
    if len(motions) != len(result["targets"]):
        return None  # the program was changed since
    points: list[Float[np.ndarray, " 3"]] = []
    errors: list[tuple[float, float]] = []
    places: list[str] = []
    for move, target in zip(motions, result["targets"], strict=True):
        if move.end.T is None or move.part_in_hand or target["before_mm"] is None or target["after_mm"] is None:
            continue
        points.append((move.part.T @ move.end.T)[:3, 3])
        errors.append((target["before_mm"], target["after_mm"]))
        places.append(f"{target['file']}:{target['line']} {target['target']}")
    return (np.array(points), np.array(errors), places) if len(points) > 1 else None


def rounded_up(value: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that is no smaller than a value; the least positive one for zero."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-6)))
    return float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value * (1.0 - 1e-12)))


def _along(points: np.ndarray, errors: np.ndarray, places: list[str], texts: Texts) -> None:
    """The targets, coloured by their errors before or after, on one scale."""
    text("h2", texts("program.along"))
    limit_mm = rounded_up(float(errors.max()))
    colours = LOW + (errors / limit_mm)[:, :, None] * (HIGH - LOW)

    def pick(number: int) -> None:
        before, after = (texts.number(float(error), ".4f") for error in errors[number])
        view.mark(points[number : number + 1])
        picked.set_text(f"{places[number]}: {before} mm → {after} mm")

    view = CellView(None, np.zeros((0, 0)), cloud=points, colours=colours[:, 0], on_pick=pick, targets=1)
    if len(points) <= MAX_JOINED:
        view.draw_arrows(range(len(points) - 1), np.diff(points, axis=0), 1.0, PATH)
    with ui.element("div").classes("row"):
        tick(texts("program.show_after"), False, lambda after: view.colour(colours[:, int(after)]))
        add_views(view, texts("program.along_of", count=len(points)), texts)
    colour_bar(LOW.tolist(), HIGH.tolist(), limit_mm)
    picked = text("p", texts("program.colours")).props("role=status")
    text("p", " × ".join(f"{edge * 1e3:.0f}" for edge in np.ptp(points, axis=0).tolist()) + " mm").classes("quiet")


def _changes(project: Project, corrected: str) -> list[str]:
    """Changes of a file, line by line; none where it is too long to be compared."""
    before = project.path(f"{LAYOUT.programs}/{Path(corrected).name}")
    after = project.path(corrected)
    if not before.is_file() or not after.is_file():
        return []
    old, new = (path.read_bytes().decode("utf-8", "replace").splitlines() for path in (before, after))
    if max(len(old), len(new)) > MAX_COMPARED_LINES:
        return []
    return list(difflib.unified_diff(old, new, f"{LAYOUT.programs}/{before.name}", corrected, n=1, lineterm=""))


def _compare(name: str, lines: list[str], texts: Texts) -> None:
    if not lines:
        return
    text("h2", texts("program.changes", name=name))
    shown = text("pre", "\n".join(lines[:MAX_LINES])).classes("command listing").props("tabindex=0 role=region")
    set_attribute(shown, "aria-label", texts("program.changes", name=name))
    if len(lines) > MAX_LINES:
        text("p", texts("program.more_lines", count=len(lines) - MAX_LINES)).classes("quiet")
