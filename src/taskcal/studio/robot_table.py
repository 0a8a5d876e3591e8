"""A table of Denavit–Hartenberg parameters that was dropped: shown, its convention asked for, and made into a robot file."""

import re
from pathlib import Path

from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.studio.command_run import CommandRun, Status
from taskcal.studio.controls import button, choice, message, text
from taskcal.studio.file_names import free_name
from taskcal.studio.project import LAYOUT
from taskcal.studio.run_panel import show_run
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts

CONVENTIONS = ("dh", "mdh")
UNITS = ("mm,deg", "mm,rad", "m,deg", "m,rad")

LINES, LONGEST = 40, 4000
"""Of the table that are shown, and characters."""


class RobotTable:
    """What a page asks about a table."""

    def __init__(self, studio: Studio, table: str, texts: Texts) -> None:
        """Show it.

        Args:
            studio: whose project it lies in.
            table: its path from the project's folder.
            texts: of the page.
        """
        self._studio, self._table, self._texts = studio, table, texts
        self._convention = self._units = ""
        text("h2", texts("robot.table"))
        text("p", texts("robot.table_how"))
        content = studio.project.path(table).read_bytes()[:LONGEST].decode("utf-8", "replace")
        listing = text("pre", "\n".join(content.splitlines()[:LINES])).classes("command listing")
        listing.props("tabindex=0 role=region").props["aria-label"] = texts("robot.table")
        conventions = {name: texts(f"robot.convention_{name}") for name in CONVENTIONS}
        choice(texts("robot.convention"), conventions, "", lambda name: setattr(self, "_convention", name))
        units = {"": texts("measurements.told")} | {name: name for name in UNITS}
        choice(texts("robot.units"), units, "", lambda name: setattr(self, "_units", name))
        run = show_run(studio, "robot", texts, about=table)
        if run is None or run.status is not Status.running:
            button(texts("robot.make"), self._make)
        self._said = ui.element("div")

    def _make(self) -> None:
        project = self._studio.project
        self._said.clear()
        with self._said:
            if not self._convention:
                message(self._texts("robot.convention_missing"))
                return
            taken = [Path(path).name for path in project.files(LAYOUT.robots)]
            stem = re.sub(r"[^\w-]+", "-", Path(self._table).stem)
            made = f"{LAYOUT.robots}/{free_name(f'{stem}.toml', taken)}"
            units = ["--units", self._units] if self._units else []
            arguments = [
                "robots",
                "import",
                self._table,
                "--convention",
                self._convention,
                *units,
                "--output",
                made,
                "--json",
            ]

            async def take(run: CommandRun) -> None:
                if project.path(made).is_file():
                    project.choose(robot=made)

            try:
                self._studio.start("robot", arguments, take)
            except TaskcalError as error:
                message(str(error))
                return
        ui.navigate.reload()
