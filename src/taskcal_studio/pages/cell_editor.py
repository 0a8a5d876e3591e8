"""The cell file, as a person states it: how tools and parts were measured, and what external axes carry."""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tomli_w
from jaxtyping import Float
from nicegui import ui

from robot_programs.core.program import Motion
from taskcal.correction.cell import AXES, MIN_POINTS, MIN_TIPS, CellFile, ExternalAxis, load_cell
from taskcal.errors import FileError, TaskcalError, shown
from taskcal.geometry import se3
from taskcal.geometry.euler import from_angles, to_angles
from taskcal.io.codec import decode
from taskcal.io.files import write_whole
from taskcal.io.toml_file import parse_toml, toml_of
from taskcal.robot.robot import Robot
from taskcal.tables.table import number_of
from taskcal_studio.controls import (
    ANGLES,
    MAX_DISTANCE_MM,
    button,
    choice,
    line_of_text,
    lines_of_text,
    message,
    number,
    text,
)
from taskcal_studio.project import CELL_ENDINGS, LAYOUT, Project
from taskcal_studio.texts import Texts

Kind = Literal["axis", "tool", "part"]

NAMED_BY: Mapping[Kind, str] = {"axis": "number", "tool": "name", "part": "name"}
"""Key by which a section is told from others of its kind."""

WAYS: Mapping[str, tuple[str, tuple[float, ...]]] = {
    f"{way} {sign}{letter}": (key, tuple(-float(k == i) if sign else float(k == i) for k in range(3)))
    for way, key in (("slides", "slides_along"), ("turns", "turns_about"))
    for i, letter in enumerate("xyz")
    for sign in ("", "−")
}
"""How an axis may move: key and direction in the cell file."""

_ASKED = re.compile(r"write \[\[axis\]\] number = ([1-6])\b")


def asked_axes(reasons: Iterable[str]) -> list[int]:
    """Numbers of the external axes that a correction asks for, in the reasons for which it refused motions."""
    return sorted({int(found[1]) for reason in reasons if (found := _ASKED.search(reason))})


def stated_axis(section: Mapping[str, Any], carries: str, way: str) -> dict[str, Any] | None:
    """An axis of the cell file that carries and moves as chosen; None while that is not complete.

    Args:
        section: as the file has it, with its number at least.
        carries: nothing, robot or part.
        way: one of `WAYS`, or ``file`` for that of the section.
    """
    number = {"number": section["number"]}
    if carries == "nothing":
        return {**number, "carries": "nothing"}
    if not carries or not way:
        return None
    kept = [
        *(("slides_along", "turns_about") if way == "file" else ()),
        *(("frame", "unit") if carries == "part" else ()),
    ]
    moved = {} if way == "file" else {WAYS[way][0]: list(WAYS[way][1])}
    return {**number, "carries": carries, **moved, **{key: section[key] for key in kept if key in section}}


def with_section(written: str, kind: Kind, section: Mapping[str, Any]) -> str:
    """A cell file's text with an axis, a tool or a part in place of what it said of that one.

    One that is new is added at its end; where one is changed, the file's comments are lost. A section of a name alone is taken
    out.
    """
    content = parse_toml(written, Path("cell.toml"))
    key = NAMED_BY[kind]
    others = [one for one in content.get(kind, []) if not _same(one[key], section[key])]
    kept = [*others, section] if set(section) != {"name"} else others
    wanted = {**content, kind: kept}
    lines = [f"{key} = {_value(value)}\n" for key, value in section.items()]
    added = "".join([written.rstrip("\n"), "\n\n" if written.strip() else "", f"[[{kind}]]\n", *lines])
    with suppress(FileError):  # a file may state its axes within one line
        if parse_toml(added, Path("cell.toml")) == wanted:
            return added
    return tomli_w.dumps(wanted if kept else {name: value for name, value in wanted.items() if name != kind})


def _same(one: Any, other: Any) -> bool:
    """Whether two sections are of one axis, or of one name, letter case aside."""
    return str(one).casefold() == str(other).casefold()


def save_section(project: Project, kind: Kind, section: Mapping[str, Any]) -> None:
    """Put a section into the chosen cell file, or into a new one that becomes the chosen.

    Raises:
        TaskcalError: it is none that a cell file has; the file is then as before.
    """
    chosen = project.choices.cell
    path = project.path(chosen or f"{LAYOUT.cells}/cell.toml")
    try:
        before = path.read_text(encoding="utf-8") if chosen else ""
        written = with_section(before, kind, section)
        decode(CellFile, parse_toml(written, path), brief=True)
        if chosen:
            with project.change(chosen, joins=True):
                write_whole(path, written)
        else:
            with project.change():
                project.choose(cell=project.put(LAYOUT.cells, "cell.toml", written.encode(), CELL_ENDINGS))
    except (OSError, ValueError) as error:  # a disk; a file that was made no TOML since the page was shown
        raise TaskcalError(f"{path.name} cannot be changed: {error}") from error


def _value(value: Any) -> str:
    """Write a value as TOML, on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(one)}" for key, one in value.items()) + " }"
    return "[" + ", ".join(map(_value, value)) + "]" if isinstance(value, list) else json.dumps(value)


def _name(axis: int) -> str:
    return ExternalAxis(number=axis, carries="nothing").name


class AxisEditor:
    """Two lists for every external axis, and numbers for where a positioner stands."""

    def __init__(self, project: Project, asked: Iterable[int], texts: Texts) -> None:
        """Show them; what is complete is saved at once, in the chosen cell file or a new one.

        Args:
            project: whose cell file it is.
            asked: axes that a program moves; those that the cell file has are shown, too.
            texts: of the page.
        """
        self._project, self._texts = project, texts
        chosen = project.choices.cell
        content: Mapping[str, Any] = {}
        if chosen:
            try:
                load_cell(project.path(chosen))
                content = toml_of(project.path(chosen))
            except (OSError, TaskcalError) as error:  # it went between both readings; it is not a cell file
                message(str(error))
                return
        stated = {section["number"]: section for section in content.get("axis", [])}
        numbers = sorted({*asked, *stated})
        text("h2", texts("axis.title"))
        text("p", texts("axis.how")).classes("quiet")
        with ui.element("div") as groups:
            for axis in numbers:
                self._group(axis, stated.get(axis, {"number": axis}))
        others = {str(axis): _name(axis) for axis in range(1, AXES + 1) if axis not in numbers}

        def add(value: str) -> None:
            if others.pop(value, None):
                with groups:
                    self._group(int(value), {"number": int(value)})

        choice(texts("axis.add"), dict(others), "", add, group="axis-added")

    def _group(self, axis: int, section: dict[str, Any]) -> None:
        texts = self._texts
        ways = {key: texts(f"axis.{key.split()[0]}", direction=key.split()[1]) for key in WAYS}
        way = next((key for key, (kind, d) in WAYS.items() if tuple(section.get(kind, ())) == d), "")
        if not way and {"slides_along", "turns_about"} & section.keys():
            ways["file"], way = texts("axis.as_file"), "file"
        carried = {kind: texts(f"axis.{kind}") for kind in ("nothing", "robot", "part")}
        carries = str(section.get("carries", ""))

        state = [carries, way]

        def choose(k: int, value: str) -> None:
            state[k] = value
            complete = stated_axis(section, *state)
            if complete is None:
                told.set_text(texts("axis.unfinished"))
            else:
                self._write(complete)

        with ui.element("fieldset").classes("orientation"):
            text("legend", _name(axis))
            with ui.element("div").classes("row"):
                choice(texts("axis.carries"), carried, carries, lambda value: choose(0, value), group=f"axis-{axis}")
                choice(texts("axis.moves"), ways, way, lambda value: choose(1, value), group=f"axis-{axis}-moves")
            told = text("p", "").classes("quiet").props("role=status")
            if carries == "part":
                self._frame(section)

    def _frame(self, section: dict[str, Any]) -> None:
        """Frame of an axis that carries the part, with the axis at zero."""

        def put(frame: dict[str, Any]) -> None:
            section["frame"] = frame
            self._write(section, again=False)

        text("p", self._texts("axis.frame")).classes("quiet")
        pose_numbers(self._texts, section.get("frame"), put)

    def _write(self, section: dict[str, Any], *, again: bool = True) -> None:
        try:
            save_section(self._project, "axis", section)
        except TaskcalError as error:
            message(str(error))
            return
        if again:
            ui.navigate.reload()


def pose_numbers(texts: Texts, pose: Mapping[str, Any] | None, on_change: Callable[[dict[str, Any]], Any]) -> None:
    """Six numbers of a pose: millimetres, and degrees of roll, pitch and yaw about fixed axes.

    Args:
        texts: of the page.
        pose: as cell files have it; none is all zero.
        on_change: called with the pose as cell files have it.
    """
    place = np.array((pose or {}).get("position_mm", [0.0, 0.0, 0.0]), dtype=float)
    quaternion = np.array((pose or {}).get("quaternion", [0.0, 0.0, 0.0, 1.0]), dtype=float)
    turn = np.degrees(to_angles("rpy", se3.from_quaternion(quaternion)))

    def put(numbers: np.ndarray, i: int, value: float) -> None:
        numbers[i] = value
        turned = se3.to_quaternion(from_angles("rpy", np.radians(turn)))
        on_change({"position_mm": place.tolist(), "quaternion": turned.tolist()})

    with ui.element("div").classes("row"):
        for i, letter in enumerate("xyz"):
            label = texts("axis.at", axis=letter)
            number(label, place[i], partial(put, place, i), -MAX_DISTANCE_MM, MAX_DISTANCE_MM)
        for i, name in enumerate(ANGLES):
            number(texts(f"task.{name}"), turn[i], partial(put, turn, i), -360.0, 360.0)


# How a tool or a part was measured: one of the ways that a cell file knows, with the numbers that it takes.

HELD = ("flange", "tip_deg", "reflectors_mm", "target")
STANDING = ("tracker", "touched_deg")
"""Ways, by the keys of the cell file; of what the robot holds, and of what stands still."""

POSES = ("flange", "target", "tracker")
"""Of them, those that are a pose."""


@dataclass(frozen=True, kw_only=True)
class Named:
    """A tool or a part that a program names."""

    kind: Literal["tool", "part"]
    name: str
    held: bool
    T: Float[np.ndarray, "4 4"]
    """As the program has it."""

    @property
    def ways(self) -> tuple[str, ...]:
        """Ways to measure it."""
        return HELD if self.held else STANDING


def named_in(motions: Iterable[Motion]) -> list[Named]:
    """Tools and parts of motions, each once, in their order; those without a name are left out."""
    found: dict[tuple[str, str], Named] = {}
    for move in motions:
        one = Named(kind="tool", name=move.tool.name, held=not move.part_in_hand, T=move.tool.T)
        other = Named(kind="part", name=move.part.name, held=move.part_in_hand, T=move.part.T)
        for named in (one, other):
            if named.name:
                found.setdefault((named.kind, named.name.casefold()), named)
    return list(found.values())


def rows_of(given: str, columns: int, *, names: bool = False) -> list[tuple[str, list[float]]]:
    """Lines of numbers, apart by blanks, commas or semicolons, with points or commas as decimal marks.

    Args:
        given: the lines; empty ones do not count.
        columns: numbers of each.
        names: whether a name stands before the numbers.

    Raises:
        TaskcalError: a line has others, or it is not clear what its commas are.
    """
    rows: list[tuple[str, list[float]]] = []
    for count, line in enumerate(given.splitlines(), 1):
        if not line.strip():
            continue
        name, rest = "", line.strip()
        if names:
            name, *others = re.split(r"[\s;=]+", rest, maxsplit=1)
            rest = "".join(others)
        ways = {tuple(re.split(r"[;,\s]+", rest)), tuple(re.split(r"[;\s]+", rest.replace(",", ".")))}
        read = {tuple(map(float, way)) for way in ways if len(way) == columns and all(map(is_number, way))}
        if len(read) != 1:
            what = f"a name and {columns} numbers" if names else f"{columns} numbers"
            raise TaskcalError(f"line {count}, '{shown(line.strip())}', is not {what} apart by blanks or semicolons")
        rows.append((name, list(read.pop())))
    return rows


def is_number(given: str) -> bool:
    """Whether a text is a finite number."""
    return bool(np.isfinite(number_of(given)))


def as_lines(rows: Iterable[tuple[str, Sequence[float]]]) -> str:
    """Lines that `rows_of` reads."""
    return "\n".join(" ".join([*filter(None, [name]), *(f"{value:.10g}" for value in row)]) for name, row in rows)


def measured_section(
    before: Mapping[str, Any], way: str, given: str | Mapping[str, Any], joints: int, **more: Any
) -> dict[str, Any]:
    """Section of the cell file for a tool or a part that is measured in a way.

    Args:
        before: the section that there is, with the name at least.
        way: its key; empty for the controller's value alone.
        given: lines of numbers, or a pose.
        joints: of the robot.
        more: uncertainty_mm and touched_with; empty ones are left out.

    Raises:
        TaskcalError: the lines are not the numbers that they have to be, or too few.
    """
    kept = {key: before[key] for key in ("name", "controller") if key in before}
    if not way:
        return kept
    if isinstance(given, str):
        names = way == "reflectors_mm"
        rows = rows_of(given, 3 if names else joints, names=names)
        least = MIN_TIPS if way == "tip_deg" else MIN_POINTS
        if len(rows) < least:
            raise TaskcalError(f"{len(rows)} lines are too few; it takes {least}")
        if names and len({name for name, _ in rows}) < len(rows):
            raise TaskcalError("two lines have the same name")
        value: Any = dict(rows) if names else [row for _, row in rows]
    else:
        value = dict(given)
    return {**kept, way: value, **{key: one for key, one in more.items() if one}}


class MeasuredEditor:
    """How a tool or a part was measured: a list of the ways, the numbers of one, and a button that saves them."""

    def __init__(self, project: Project, robot: Robot, named: Named, texts: Texts) -> None:
        """Show what the cell file says of it.

        Args:
            project: whose cell file it is.
            robot: whose joints rows of angles have.
            named: the tool or the part.
            texts: of the page.
        """
        self._project, self._robot, self._named, self._texts = project, robot, named, texts
        section = cell_sections(project).get((named.kind, named.name.casefold()), {})
        self._section: dict[str, Any] = {"name": named.name, **section}
        self._way = next((way for way in named.ways if way in section), "")
        ways = {key or "-": texts(f"measured.{key or 'controller'}") for key in ("", *named.ways)}
        with ui.element("fieldset").classes("orientation"):
            text("legend", texts(f"measured.{named.kind}", name=named.name))
            choice(texts("measured.how"), ways, self._way or "-", self._choose, group=f"{named.kind}-{named.name}")
            self._fields = ui.element("div")
            self._said = ui.element("div")
        self._show()

    def _choose(self, way: str) -> None:
        self._way = "" if way == "-" else way
        self._show()

    def _show(self) -> None:
        self._fields.clear()
        way, section, texts = self._way, self._section, self._texts
        self._more: dict[str, Any] = {key: section.get(key) for key in ("uncertainty_mm", "touched_with")}
        self._given: Any = section.get(way, "")
        with self._fields:
            if way:
                text("p", texts(f"measured.{way}_how")).classes("quiet")
                self._numbers(way)
                uncertainty = self._more["uncertainty_mm"] or 0.0
                number(texts("measured.uncertainty"), uncertainty, self._take("uncertainty_mm"), 0.0, 1e3)
            if way == "touched_deg":
                line_of_text(
                    texts("measured.touched_with"), self._more["touched_with"] or "", self._take("touched_with")
                )
            else:
                self._more["touched_with"] = None
            if way or any(key in section for key in self._named.ways):
                button(texts("measured.save"), self._save)

    def _numbers(self, way: str) -> None:
        label = self._texts(f"measured.{way}")
        if way in POSES:
            if not self._given:
                T = self._named.T if way == "flange" else np.eye(4)
                rotation = se3.to_quaternion(T[None, :3, :3])[0]
                self._given = {"position_mm": (T[:3, 3] * 1e3).tolist(), "quaternion": rotation.tolist()}
            pose_numbers(self._texts, self._given, self._put)
            return
        rows = self._given.items() if isinstance(self._given, Mapping) else [("", row) for row in self._given]
        self._given = as_lines(rows)
        lines_of_text(label, self._given, self._put)

    def _put(self, given: Any) -> None:
        self._given = given

    def _take(self, key: str) -> Callable[[Any], None]:
        def take(value: Any) -> None:
            self._more[key] = value

        return take

    def _save(self) -> None:
        self._said.clear()
        try:
            section = measured_section(self._section, self._way, self._given, len(self._robot.joints), **self._more)
            save_section(self._project, self._named.kind, section)
        except TaskcalError as error:
            with self._said:
                message(str(error))
            return
        ui.navigate.reload()


def cell_sections(project: Project) -> Mapping[tuple[str, str], Mapping[str, Any]]:
    """Sections of tools and parts of the chosen cell file, by kind and name in small letters.

    Raises:
        TaskcalError: it is not a cell file.
    """
    chosen = project.choices.cell
    if not chosen:
        return {}
    load_cell(project.path(chosen))
    content = toml_of(project.path(chosen))
    return {(kind, one["name"].casefold()): one for kind in ("tool", "part") for one in content.get(kind, [])}
