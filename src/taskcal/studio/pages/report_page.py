"""The report: a page of the calibration to be kept and printed, and all reports that there are."""

from pathlib import Path
from urllib.parse import quote

from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.studio.controls import button, choice, message, set_attribute, text
from taskcal.studio.project import LAYOUT, Choices
from taskcal.studio.run_panel import show_run
from taskcal.studio.runs import Status
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    found = {path: Path(path).stem for path in project.calibrations()}
    if found:

        def take(path: str) -> None:
            project.choose(calibration=path)
            ui.navigate.reload()

        choice(texts("result.choose"), found, choices.calibration, take)
        run = show_run(studio, "report", texts, about=choices.calibration)
        if choices.calibration in found and (run is None or run.status is not Status.running):
            button(texts("report.make"), lambda: _begin(studio))
    else:
        text("p", texts("result.none"))
        text("a", texts("identify.title")).props("href=/identify")
    reports = project.files(LAYOUT.reports, (".html",))
    if not reports:
        return
    text("h2", texts("report.there"))
    with ui.element("ul"):
        for path in reports:
            with ui.element("li").classes("row"):
                look = text("a", Path(path).name).props("target=_blank rel=noopener")
                set_attribute(look, "href", f"/file/{quote(path)}")
                keep = text("a", texts("report.keep"))
                set_attribute(keep, "href", f"/file/{quote(path)}?keep=1")
                set_attribute(keep, "aria-label", f"{texts('report.keep')}: {Path(path).name}")


def arguments_of(choices: Choices) -> list[str]:
    """What ``taskcal`` is called with for a report."""
    report = f"{LAYOUT.reports}/{Path(choices.calibration).stem}.html"
    options = ["--task", choices.task] if choices.task else []
    options += ["--campaign", choices.campaign] if choices.campaign else []
    return ["report", choices.calibration, *options, "--output", report, "--json"]


def _begin(studio: Studio) -> None:
    project = studio.project
    try:
        project.path(LAYOUT.reports).mkdir(exist_ok=True)
        studio.start("report", arguments_of(project.choices))
    except (OSError, TaskcalError) as error:
        message(str(error))
        return
    ui.navigate.reload()
