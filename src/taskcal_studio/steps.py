"""Parts that pages share: a file is chosen, a command runs, and what it printed is kept and read again."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from taskcal.errors import TaskcalError
from taskcal.io.files import write_all, write_whole
from taskcal_groundwork.said import term
from taskcal_studio.controls import button, choice, command_line, drop_zone, message, set_attribute, text
from taskcal_studio.files import KINDS
from taskcal_studio.project import LAYOUT, Project
from taskcal_studio.results import MADE_FROM, contents, made, result_of
from taskcal_studio.runs import CommandRun, Status, Studio
from taskcal_studio.texts import Texts

POLL_S = 0.25
"""Between two looks at a run."""


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


def choose_or_drop(project: Project, texts: Texts, name: str, *, none: str = "") -> None:
    """A list for one of the project's choices, as `choose_file`, of the files of its kind, and a place to drop one."""
    kind = KINDS[name]
    files = {path: path for path in project.files(kind.folder, kind.endings)}
    if files:
        choose_file(project, texts, name, files, none=none)
    drop_zone(texts, name, texts(f"choose.drop_{name}"), kind.endings)


def choose_calibration(project: Project, texts: Texts) -> bool:
    """A list of the calibrations; whether one is chosen."""
    found = {path: Path(path).stem for path in project.calibrations()}
    choose_file(project, texts, "calibration", found)
    return project.choices.calibration in found


def begin(
    studio: Studio,
    kind: str,
    arguments: list[str],
    *,
    outputs: Sequence[str] = (),
    chosen: Mapping[str, str] | None = None,
    page: str = "",
    moves: Mapping[str, str] | None = None,
) -> None:
    """Run a command, and show its page.

    Args:
        studio: whose command it is.
        kind: of run.
        arguments: of ``taskcal``.
        outputs: files of the project that the command writes; of the first, if it is a result, what the command prints is kept
            beside it, and from what it was made.
        chosen: files that it makes, by the choice that each becomes, unless the user chooses another one meanwhile.
        page: that shows the run; the one that is shown by default.
        moves: files that it writes, by the places where they are put in the end.
    """
    project = studio.project
    before = project.choices
    product = next((path for path in outputs[:1] if Path(path).parts[0] in MADE_FROM), "")

    async def keep(run: CommandRun) -> None:
        kept = [result_of(product), LAYOUT.made] if product else []
        with project.change(*kept, *(moves or {}), before=former):
            for place, written in (moves or {}).items():
                if project.path(written).is_file():
                    write_whole(project.path(place), project.path(written).read_bytes())
                    project.path(written).unlink()
            if product:
                record = json.dumps(made(project, product, made_from), indent=1)
                write_all({project.path(result_of(product)): run.output, project.path(LAYOUT.made): record})
            now = project.choices
            present = {name: path for name, path in (chosen or {}).items() if project.path(path).is_file()}
            still = {name: path for name, path in present.items() if getattr(now, name) == getattr(before, name)}
            project.choose(**still)

    try:
        former = project.contents(outputs)
        made_from = contents(project) if product else {}
        for path in (*outputs, *(chosen or {}).values(), *(moves or {})):
            project.path(path).parent.mkdir(exist_ok=True)
        studio.start(kind, arguments, keep)
    except (OSError, TaskcalError) as error:
        show_error(project, error)
        return
    if page:
        ui.navigate.to(f"/{page}")
    else:
        ui.navigate.reload()


def show_run(
    studio: Studio, kind: str, texts: Texts, *, about: str = "", ended: Callable[[], None] = ui.navigate.reload
) -> CommandRun | None:
    """Show the last run of a kind: its progress, how to cancel it, its messages.

    A run that goes on is followed in every tab that shows it, whichever tab began it; the page is shown anew as it ends.

    Args:
        studio: whose runs they are.
        kind: of run.
        texts: of the page.
        about: a file that the run must have been about, one of its arguments; any where it is empty.
        ended: called as a run that goes on ends.

    Returns:
        the run; None where there was none.
    """
    run = studio.run_of(kind)
    if run is None or (about and about not in run.arguments):
        return None
    command_line(run.line, texts)
    if run.status is Status.running:
        _follow(run, texts, ended)
        return run
    if run.status is Status.cancelled:
        message(texts("run.cancelled"), fine=True)
    for said in run.messages:
        message(_in_language(said.removeprefix("error: "), texts), fine=not said.startswith("error: "))
    return run


def _in_language(said: str, texts: Texts) -> str:
    """A message in the page's language, as far as the catalogue has it: whole, or behind the file that it is of."""
    file, colon, of_it = said.partition(": ")
    whole = texts.said(term(said))
    return f"{file}{colon}{texts.said(term(of_it))}" if whole == said and colon and " " not in file else whole


def is_running(run: CommandRun | None) -> bool:
    """Whether a run goes on."""
    return run is not None and run.status is Status.running


def _follow(run: CommandRun, texts: Texts, ended: Callable[[], None]) -> None:
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
            ended()

    timer = ui.timer(POLL_S, look)
