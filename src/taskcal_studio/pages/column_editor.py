"""What a user states of a file of measurements: what its columns are and what else it leaves open, and a second file."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.reading.reader import read_measurements
from taskcal.robot.robot import Robot
from taskcal.tables.forms import read_table
from taskcal.tables.options import TableForm
from taskcal.tables.table import Table
from taskcal_groundwork.options import arguments_of, read
from taskcal_studio.controls import button, choice, drop_zone, set_attribute, text
from taskcal_studio.option_form import option_fields
from taskcal_studio.project import CAMPAIGN_ENDINGS, LAYOUT, free_name
from taskcal_studio.runs import Studio
from taskcal_studio.stated_options import GROUPS, Statements, asked, offered
from taskcal_studio.steps import begin, choose_file, show_error
from taskcal_studio.texts import Texts

SHOWN_ROWS = 5

COLUMNS = "columns"
"""Option that is stated over the columns themselves."""

MAX_CHOSEN_COLUMNS = 40
"""Of a table whose columns are chosen here; a wider one is of motion capture, whose names are read."""


def begin_rewriting(studio: Studio, ending: str, stated: Sequence[str] = (), **given: str) -> None:
    """Write the campaign anew, beside the old file, and use that from then on."""
    project = studio.project
    before = project.choices.campaign
    taken = [Path(path).name for path in project.files(LAYOUT.campaigns)]
    after = f"{LAYOUT.campaigns}/{free_name(f'{Path(before).stem}-{ending}.csv', taken)}"
    arguments = asked("convert", stated, file=before, robot=project.choices.robot, **given, output=after)
    begin(studio, "convert", arguments, outputs=[after], chosen={"campaign": after})


def offered_names(robot: Robot) -> list[str]:
    """Names that a column may be given."""
    joints = [
        f"{name}_{unit}"
        for name, slides in zip(robot.joint_names, robot.prismatic, strict=True)
        for unit in (("mm", "m") if slides else ("deg", "rad"))
    ]
    return ["-", "id", "target", *joints, *(f"{axis}_{unit}" for unit in ("mm", "m") for axis in "xyz")]


def stated_columns(header: Sequence[str], chosen: Sequence[str]) -> str:
    """Names for ``--columns``: those that were chosen, else those of the file; empty where none was.

    Args:
        header: of the file; an empty one is a column without a name, which is skipped.
        chosen: of every column, empty where it stays as it is.
    """
    if not any(chosen):
        return ""
    return " ".join(one or re.sub(r"\s+", "_", name.strip()) or "-" for one, name in zip(chosen, header, strict=True))


class ColumnEditor:
    """The first rows of a file as they stand, a list over each column, and a button that writes the file anew."""

    def __init__(self, studio: Studio, robot: Robot, texts: Texts, *, is_open: bool = False) -> None:
        """Show them; nothing is changed before the button.

        Args:
            studio: whose project has the file.
            robot: that was measured.
            texts: of the page.
            is_open: whether all of it is shown at once, as where the file cannot be read as it is.
        """
        self._is_open, self._robot = is_open, robot
        self._header: Sequence[str] = ()
        self._chosen: list[str] = []
        self._studio, self._texts = studio, texts
        self._stated: dict[str, str] = {}
        with ui.element("details") as around:
            set_attribute(around, "open", is_open)
            text("summary", texts("measurements.correct"))
            text("p", texts("measurements.correct_how")).classes("quiet")
            self._rows = ui.element("div")
            self._header, self._chosen = self._columns()
            stated = Statements(command="convert", now=lambda: self._stated, keep=self._state)
            option_fields(studio.project, texts, stated, *(name for name in offered("convert") if name != COLUMNS))
            button(texts("measurements.write"), self._write)
        self._second_file()

    def _columns(self) -> tuple[Sequence[str], list[str]]:
        """Show the rows as the file is read with what is stated of it; names that were chosen stay with the same columns."""
        project, form = self._studio.project, read(TableForm, self._stated).made()
        self._rows.clear()
        try:
            table = read_table(
                project.path(project.choices.campaign), replace(form, hidden_rows=form.hidden_rows or "keep")
            )
        except TaskcalError as error:
            if self._stated:  # of the file as it is the page says so
                with self._rows:
                    show_error(project, error)
            return (), []
        chosen = self._chosen if table.header == self._header else [""] * len(table.header)
        if len(chosen) <= MAX_CHOSEN_COLUMNS:
            with self._rows:
                self._show(table, chosen, offered_names(self._robot))
        return table.header, chosen

    def _show(self, table: Table, chosen: list[str], names: Sequence[str]) -> None:
        texts = self._texts

        def take(k: int, name: str) -> None:
            chosen[k] = "" if name == "=" else name

        with ui.element("div").classes("scroll").props("tabindex=0 role=region") as around:
            set_attribute(around, "aria-label", texts("measurements.columns"))
            with ui.element("table").classes("plain dense"):
                text("caption", texts("measurements.columns"))
                with ui.element("thead"), ui.element("tr"):
                    for k, name in enumerate(table.header):
                        given = {"=": name or texts("measurements.nameless"), **{one: one for one in names}}
                        label = texts("measurements.column", number=k + 1)
                        with ui.element("th").props("scope=col"):
                            choice(label, given, chosen[k] or "=", partial(take, k), group=f"column-{k}", bare=True)
                with ui.element("tbody"):
                    for row in table.cells[:SHOWN_ROWS]:
                        with ui.element("tr"):
                            for cell in row:
                                text("td", cell)

    def _state(self, name: str, given: str) -> None:
        self._stated[name] = given
        self._header, self._chosen = self._columns()

    def _write(self) -> None:
        texts = {**self._stated, COLUMNS: stated_columns(self._header, self._chosen)}
        begin_rewriting(self._studio, "plain", arguments_of(GROUPS["convert"], texts))

    def _second_file(self) -> None:
        """Joints in this file, points in another: both are written into one."""
        project, texts = self._studio.project, self._texts
        choices = project.choices
        others = {path: path for path in project.files(LAYOUT.campaigns, CAMPAIGN_ENDINGS) if path != choices.campaign}
        with ui.element("details") as around:
            set_attribute(around, "open", self._is_open or bool(choices.points))
            text("summary", texts("measurements.second"))
            text("p", texts("measurements.second_how")).classes("quiet")
            drop_zone(texts, "points", texts("measurements.drop_points"), CAMPAIGN_ENDINGS)
            choose_file(project, texts, "points", others, none=texts("measurements.no_points"))
            if choices.points in others:
                button(texts("measurements.join"), lambda: self.join(choices.points))

    def join(self, points: str) -> None:
        """Write the joints of the file and the points of another one into one; they are told apart by what they hold."""
        project = self._studio.project
        other = project.choices.campaign
        if self._has_joints(points) and not self._has_joints(other):
            project.choose(campaign=points)
            points = other
        project.choose(points="")
        begin_rewriting(self._studio, "joined", points=points)

    def _has_joints(self, path: str) -> bool:
        with suppress(TaskcalError):
            return read_measurements(self._studio.project.path(path), self._robot).q is not None
        return False
