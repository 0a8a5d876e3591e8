"""Parts that pages share: a file is chosen, a command runs, and what it printed is kept and read again."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from taskcal.errors import TaskcalError
from taskcal.io.files import write_whole
from taskcal.io.json_file import parse_json
from taskcal.robot.catalogue import load_robot
from taskcal.robot.robot import Robot
from taskcal.studio.controls import button, choice, command_line, message, set_attribute, text
from taskcal.studio.project import RESULT, Project
from taskcal.studio.runs import CommandRun, Status, Studio
from taskcal.studio.texts import Texts

POLL_S = 0.25
"""Between two looks at a run."""


def robot_of(project: Project) -> Robot:
    """Load the project's robot.

    Raises:
        TaskcalError: it has none yet, or its file describes none.
    """
    named = project.choices.robot
    if not named:
        raise TaskcalError("choose a robot first")
    return load_robot(project.path(named) if "/" in named else named)


def show_error(project: Project, error: Exception) -> None:
    """Show an error, with the project's files named as from its folder."""
    message(str(error).replace(f"{project.folder}/", ""))


def link(label: str, href: str) -> TextElement:
    """A link to a page, or to a file of the project."""
    made = text("a", label)
    set_attribute(made, "href", href)
    return made


def download(texts: Texts, path: str) -> None:
    """A link that downloads a file of the project."""
    link(texts("program.download", name=Path(path).name), f"/file/{quote(path)}?keep=1").classes("act plain")


def is_missing(project: Project, texts: Texts, **pages: str) -> bool:
    """Whether a choice is missing; links to the pages where each is made.

    Args:
        project: whose choices they are.
        texts: of the page.
        pages: key of the page by the name of the choice.
    """
    missing = [page for name, page in pages.items() if not getattr(project.choices, name)]
    for page in missing:
        text("p", texts("identify.missing"))
        link(texts(f"{page}.title"), f"/{page}")
    return bool(missing)


def choose_file(project: Project, texts: Texts, name: str, files: Mapping[str, str], *, none: str = "") -> None:
    """A list for one of the project's choices; the page is shown anew with it.

    Args:
        project: whose choice it is.
        texts: of the page.
        name: of the choice, and its text.
        files: what is shown, by path.
        none: what is shown for no file; it cannot be chosen by default.
    """

    def take(path: str) -> None:
        project.choose(**{name: "" if path == "-" else path})
        ui.navigate.reload()

    chosen = getattr(project.choices, name)
    choice(texts(f"choose.{name}"), ({"-": none} if none else {}) | dict(files), chosen or ("-" if none else ""), take)


def choose_calibration(project: Project, texts: Texts) -> bool:
    """A list of the calibrations, or a link to where one is made; whether one is chosen."""
    found = {path: Path(path).stem for path in project.calibrations()}
    if found:
        choose_file(project, texts, "calibration", found)
    else:
        text("p", texts("result.none"))
        link(texts("identify.title"), "/identify")
    return project.choices.calibration in found


def begin(
    studio: Studio,
    kind: str,
    arguments: list[str],
    *,
    folders: tuple[str, ...] = (),
    result: str = "",
    chosen: Mapping[str, str] | None = None,
) -> None:
    """Run a command, and show the page anew.

    Args:
        studio: whose command it is.
        kind: of run.
        arguments: of ``taskcal``.
        folders: of the project that the command writes in.
        result: file that keeps what it prints.
        chosen: files that it makes, by the choice that each becomes, unless the user chooses another one meanwhile.
    """
    project = studio.project
    before = project.choices

    async def keep(run: CommandRun) -> None:
        if result:
            write_whole(project.path(result), run.output)
        now = project.choices
        made = {name: path for name, path in (chosen or {}).items() if project.path(path).is_file()}
        project.choose(**{name: path for name, path in made.items() if getattr(now, name) == getattr(before, name)})

    try:
        for folder in folders:
            project.path(folder).mkdir(exist_ok=True)
        studio.start(kind, arguments, keep)
    except (OSError, TaskcalError) as error:
        show_error(project, error)
        return
    ui.navigate.reload()


def result_of(path: str) -> str:
    """The file that keeps what a command printed of another file."""
    return path.removesuffix(".json") + RESULT


def read_result(project: Project, path: str, *keys: str) -> Mapping[str, Any] | None:
    """Read what a command printed of a file; None where that is not there, as for one that was put here by hand.

    Args:
        project: whose file it is.
        path: of the file that the command wrote.
        keys: that the result must have.
    """
    with suppress(OSError, ValueError, TaskcalError):
        file = project.path(result_of(path))
        content = parse_json(file.read_text(encoding="utf-8"), file)
        if isinstance(content, dict) and set(keys) <= content.keys():
            return content
    return None


def show_run(studio: Studio, kind: str, texts: Texts, *, about: str = "") -> CommandRun | None:
    """Show the last run of a kind: its progress, how to cancel it, its messages.

    A run that goes on is followed in every tab that shows it, whichever tab began it; the page is shown anew as it ends.

    Args:
        studio: whose runs they are.
        kind: of run.
        texts: of the page.
        about: a file that the run must have been about, one of its arguments; any where it is empty.

    Returns:
        the run; None where there was none.
    """
    run = studio.run_of(kind)
    if run is None or (about and about not in run.arguments):
        return None
    command_line(run.line)
    if run.status is Status.running:
        _follow(run, texts)
        return run
    if run.status is Status.cancelled:
        message(texts("run.cancelled"), fine=True)
    for said in run.messages:
        message(said.removeprefix("error: "), fine=not said.startswith("error: "))
    return run


def is_running(run: CommandRun | None) -> bool:
    """Whether a run goes on."""
    return run is not None and run.status is Status.running


def _follow(run: CommandRun, texts: Texts) -> None:
    with ui.element("div").classes("row"):
        bar = ui.element("progress")
        set_attribute(bar, "aria-label", texts("run.progress"))
        step = text("span", texts("run.starting")).props("role=status")
        button(texts("run.cancel"), run.cancel, plain=True)

    def look() -> None:
        progress = run.progress
        if progress.step:
            counted = "" if progress.of is None else f" ({progress.done + 1}/{progress.of})"
            step.set_text(f"{progress.step}{counted}")
        if progress.of:
            set_attribute(bar, "max", progress.of)
            set_attribute(bar, "value", progress.done)
        if run.status is not Status.running:
            timer.deactivate()
            ui.navigate.reload()

    timer = ui.timer(POLL_S, look)
