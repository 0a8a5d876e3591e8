"""What a user states of a file of measurements: what its columns are, its decimal mark, and a second file with the points."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.reading.reader import read_measurements
from taskcal.robot.robot import Robot
from taskcal.studio.controls import button, choice, drop_zone, set_attribute, text
from taskcal.studio.project import CAMPAIGN_ENDINGS, LAYOUT, free_name
from taskcal.studio.runs import Studio
from taskcal.studio.steps import begin, choose_file
from taskcal.studio.texts import Texts
from taskcal.tables.forms import TableForm, read_table
from taskcal.tables.table import Table

SHOWN_ROWS = 5

MAX_CHOSEN_COLUMNS = 40
"""Of a table whose columns are chosen here; a wider one is of motion capture, whose names are read."""

ANGLES = ("abc", "wpr", "rpy-deg", "rpy-rad", "rotation-vector-rad", "rotation-vector-deg", "none")
"""What three angles of a pose may be, as ``taskcal convert`` names it."""


def begin_rewriting(studio: Studio, ending: str, options: list[str]) -> None:
    """Write the campaign anew, beside the old file, and use that from then on."""
    project = studio.project
    before = project.choices.campaign
    taken = [Path(path).name for path in project.files(LAYOUT.campaigns)]
    after = f"{LAYOUT.campaigns}/{free_name(f'{Path(before).stem}-{ending}.csv', taken)}"
    arguments = ["convert", before, *options, "--output", after]
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
        self._studio, self._texts = studio, texts
        self._stated = {"decimal": "", "angles": ""}
        with ui.element("details") as around:
            set_attribute(around, "open", is_open)
            text("summary", texts("measurements.correct"))
            text("p", texts("measurements.correct_how")).classes("quiet")
            self._header, self._chosen = self._columns(robot)
            marks = {"-": texts("measurements.told"), "point": "1.5", "comma": "1,5"}
            choice(texts("measurements.decimal"), marks, "-", self._state("decimal"))
            angles = {"-": texts("measurements.told"), **{form: form for form in ANGLES}}
            choice(texts("measurements.angles"), angles, "-", self._state("angles"))
            button(texts("measurements.write"), self._write)
        self._second_file()

    def _columns(self, robot: Robot) -> tuple[Sequence[str], list[str]]:
        project = self._studio.project
        try:
            table = read_table(project.path(project.choices.campaign), TableForm(hidden_rows="keep"))
        except TaskcalError:  # the page says so
            return (), []
        chosen = [""] * len(table.header)
        if len(chosen) <= MAX_CHOSEN_COLUMNS:
            self._show(table, chosen, offered_names(robot))
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
                        offered = {"=": name or texts("measurements.nameless"), **{one: one for one in names}}
                        label = texts("measurements.column", number=k + 1)
                        with ui.element("th").props("scope=col"):
                            choice(label, offered, "=", partial(take, k), group=f"column-{k}", bare=True)
                with ui.element("tbody"):
                    for row in table.cells[:SHOWN_ROWS]:
                        with ui.element("tr"):
                            for cell in row:
                                text("td", cell)

    def _state(self, name: str) -> Callable[[str], None]:
        def state(value: str) -> None:
            self._stated[name] = "" if value == "-" else value

        return state

    def _write(self) -> None:
        stated = {"columns": stated_columns(self._header, self._chosen), **self._stated}
        self._convert("plain", [f"--{name}={value}" for name, value in stated.items() if value])

    def _convert(self, ending: str, options: list[str]) -> None:
        robot = self._studio.project.choices.robot
        begin_rewriting(self._studio, ending, [*options, f"--robot={robot}", "--json"])

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
        self._convert("joined", [f"--points={points}"])

    def _has_joints(self, path: str) -> bool:
        with suppress(TaskcalError):
            return read_measurements(self._studio.project.path(path), self._robot).q is not None
        return False
