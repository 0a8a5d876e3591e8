"""The report: a page of the calibration to be kept and printed, who measured what with what, and all reports that there are."""

from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import tomli_w
from nicegui import ui
from pydantic import ValidationError

from taskcal.errors import TaskcalError
from taskcal.io.files import write_whole
from taskcal.io.toml_file import explain, read_toml
from taskcal.report.page import ReportHeader
from taskcal.studio.controls import button, line_of_text, message, set_attribute, text
from taskcal.studio.project import LAYOUT, Project
from taskcal.studio.results import options_of_images, report_of
from taskcal.studio.runs import Studio
from taskcal.studio.steps import begin, choose_calibration, is_running, link, show_error, show_run
from taskcal.studio.texts import Texts


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    chosen = choose_calibration(project, texts)
    run = show_run(studio, "report", texts, about=choices.calibration) if chosen else None
    if chosen:
        _head(project, texts)
    if chosen and not is_running(run):
        button(texts("report.make"), lambda: begin_report(studio))
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


def arguments_of(project: Project) -> list[str]:
    """Arguments of ``taskcal`` for a report."""
    choices = project.choices
    report, certificate = reports_of(project)
    options = ["--task", choices.task] if choices.task else []
    images = options_of_images(project)
    images += [f"--images={choices.images}"] if images and choices.images in project.image_folders() else []
    options += ["--campaign", choices.campaign, *images] if choices.campaign else []
    options += ["--header", LAYOUT.header] if project.path(LAYOUT.header).is_file() else []
    return ["report", choices.calibration, *options, "--output", report, "--certificate", certificate, "--json"]
