"""The report: a page of the calibration to be kept and printed, who measured what with what, and all reports that there are."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote

import tomli_w
from nicegui import ui
from pydantic import ValidationError

from taskcal.correction.verdict import judge
from taskcal.errors import TaskcalError
from taskcal.identification.calibration import load_calibration
from taskcal.io.files import write_whole
from taskcal.io.toml_file import explain, read_toml
from taskcal.report.page import ReportHeader
from taskcal.report.verdict import with_program
from taskcal.task.task import load_task
from taskcal_studio.controls import button, line_of_text, message, set_attribute, text
from taskcal_studio.project import LAYOUT, Project
from taskcal_studio.results import corrected_of, options_of_images, read_result, report_of, result_of
from taskcal_studio.runs import Studio
from taskcal_studio.stated_options import asked
from taskcal_studio.steps import begin, choose_calibration, is_running, link, show_error, show_run
from taskcal_studio.texts import Texts


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    chosen = choose_calibration(project, texts)
    run = show_run(studio, "report", texts, about=choices.calibration) if chosen else None
    _list(project, texts)
    if chosen:
        _head(project, texts)
    if chosen and not is_running(run):
        button(texts("report.make"), lambda: begin_report(studio))


def _list(project: Project, texts: Texts) -> None:
    """Reports that there are."""
    reports = project.files(LAYOUT.reports, (".html",))
    if not reports:
        return
    text("h2", texts("report.there"))
    with ui.element("ul"):
        for path in reports:
            with ui.element("li").classes("row"):
                link(Path(path).name, f"/file/{quote(path)}").props("target=_blank rel=noopener")
                keep = link(texts("report.keep"), f"/file/{quote(path)}?keep=1")
                set_attribute(keep, "aria-label", f"{texts('report.keep')}: {Path(path).name}")


def _head(project: Project, texts: Texts) -> None:
    """Fields of the report's head, each saved as it is left."""
    text("h2", texts("report.head"))
    text("p", texts("report.head_how")).classes("quiet")
    try:
        known = head_of(project)
    except TaskcalError as error:
        show_error(project, error)
        return
    said = ui.element("div")

    def put(field: str) -> Callable[[str], None]:
        def take(value: str) -> None:
            said.clear()
            try:
                save_head(project, field, value)
            except TaskcalError as error:
                with said:
                    message(str(error))

        return take

    with ui.element("div").classes("fields"):
        for field in ReportHeader.model_fields:
            line_of_text(texts.named("report", field), known.get(field, ""), put(field))


def head_of(project: Project) -> dict[str, str]:
    """Fields of the project's head that are given, as text.

    Raises:
        FileError: its file is not as it should be.
    """
    path = project.path(LAYOUT.header)
    if not path.is_file():
        return {}
    return {key: str(value) for key, value in read_toml(path, ReportHeader).model_dump().items() if value is not None}


def save_head(project: Project, field: str, value: str) -> None:
    """Write one field of the head; an empty one is left out.

    Raises:
        TaskcalError: it is not what the field takes, such as a date; the others stay.
    """
    given = head_of(project) | {field: value}
    try:
        head = ReportHeader.model_validate_strings({key: one for key, one in given.items() if one})
    except ValidationError as error:
        raise TaskcalError(explain(error, ReportHeader)) from error
    with project.change(LAYOUT.header, joins=True):
        write_whole(project.path(LAYOUT.header), tomli_w.dumps(head.model_dump(exclude_none=True)))


def begin_report(studio: Studio) -> None:
    """Make the report and the certificate of the chosen calibration."""
    project = studio.project
    begin(studio, "report", arguments_of(project), outputs=reports_of(project), page="report")


def reports_of(project: Project) -> tuple[str, str]:
    """Paths of the report and the certificate of the chosen calibration."""
    report = report_of(project.choices.calibration)
    return report, f"{report.removesuffix('.html')}-certificate.html"


def is_judged(project: Project) -> bool:
    """Whether the chosen program was corrected by the chosen calibration for the chosen task, so that the report judges it."""
    choices = project.choices
    if not (choices.task and choices.program):
        return False
    with suppress(OSError, TaskcalError):
        judged = judge(load_calibration(project.path(choices.calibration)), load_task(project.path(choices.task)))
        return with_program(judged.summary(), read_result(project, corrected_of(choices.program))) is not None
    return False


def arguments_of(project: Project) -> list[str]:
    """Arguments of ``taskcal`` for a report."""
    choices = project.choices
    report, certificate = reports_of(project)
    images = options_of_images(project) if choices.campaign else {}
    if images and choices.images in project.image_folders():
        images["images"] = choices.images
    return asked(
        "report",
        calibration=choices.calibration,
        task=choices.task,
        corrected=result_of(corrected_of(choices.program)) if is_judged(project) else "",
        campaign=choices.campaign,
        **images,
        header=LAYOUT.header if project.path(LAYOUT.header).is_file() else "",
        output=report,
        certificate=certificate,
    )
