"""The report: a page of the calibration to be kept and printed, and all reports that there are."""

from pathlib import Path
from urllib.parse import quote

from nicegui import ui

from taskcal.studio.controls import button, set_attribute, text
from taskcal.studio.project import LAYOUT, Choices
from taskcal.studio.runs import Studio
from taskcal.studio.steps import begin, choose_calibration, is_running, link, show_run
from taskcal.studio.texts import Texts


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    chosen = choose_calibration(project, texts)
    run = show_run(studio, "report", texts, about=choices.calibration) if chosen else None
    if chosen and not is_running(run):
        arguments = arguments_of(choices)
        button(texts("report.make"), lambda: begin(studio, "report", arguments, folders=(LAYOUT.reports,)))
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


def arguments_of(choices: Choices) -> list[str]:
    """Arguments of ``taskcal`` for a report."""
    report, certificate = (
        f"{LAYOUT.reports}/{Path(choices.calibration).stem}{which}.html" for which in ("", "-certificate")
    )
    options = ["--task", choices.task] if choices.task else []
    options += ["--campaign", choices.campaign] if choices.campaign else []
    return ["report", choices.calibration, *options, "--output", report, "--certificate", certificate, "--json"]
