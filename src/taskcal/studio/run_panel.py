"""What a page shows of a command that runs, or has run, for it: how far it is, how to end it, what it said."""

from nicegui import ui

from taskcal.studio.controls import button, command_line, message, set_attribute, text
from taskcal.studio.runs import CommandRun, Status
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts

LOOK_S = 0.25
"""Between two looks at a run."""


def show_run(studio: Studio, kind: str, texts: Texts, *, about: str = "") -> CommandRun | None:
    """Show the last run of a kind.

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

    timer = ui.timer(LOOK_S, look)
