"""What external axes carry: asked for where a program moves one of which the cell file says nothing, and written there."""

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
import tomli_w
from nicegui import ui

from taskcal.correction.cell_file import load_cell
from taskcal.correction.external_axis import AXES, ExternalAxis
from taskcal.errors import TaskcalError
from taskcal.files import write_whole
from taskcal.geometry import se3
from taskcal.geometry.euler import from_angles, to_angles
from taskcal.studio.controls import choice, message, number, text
from taskcal.studio.project import CELL_ENDINGS, LAYOUT, Project
from taskcal.studio.texts import Texts

FARTHEST_MM = 1e5
"""That a positioner stands from the world's origin, to each side."""

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


def with_axis(written: str, section: Mapping[str, Any]) -> str:
    """A cell file's text with an axis in place of what it said of that one.

    An axis that is new is added at its end; where one is changed, the file's comments are lost.
    """
    content = tomllib.loads(written)
    others = [one for one in content.get("axis", []) if one["number"] != section["number"]]
    wanted = {**content, "axis": [*others, section]}
    lines = [f"{key} = {_value(value)}\n" for key, value in section.items()]
    added = "".join([written.rstrip("\n"), "\n\n" if written.strip() else "", "[[axis]]\n", *lines])
    with suppress(tomllib.TOMLDecodeError):  # a file may state its axes within one line
        if tomllib.loads(added) == wanted:
            return added
    return tomli_w.dumps(wanted)


def _value(value: Any) -> str:
    """As TOML, on one line."""
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
                content = tomllib.loads(project.path(chosen).read_text(encoding="utf-8"))
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
        """Where the frame of an axis that carries the part is, with the axis at zero."""
        texts = self._texts
        frame = section.get("frame", {"position_mm": [0.0, 0.0, 0.0]})
        place = np.array(frame["position_mm"], dtype=float)
        turn = np.degrees(
            to_angles("rpy", se3.from_quaternion(np.array(frame.get("quaternion", [0.0, 0.0, 0.0, 1.0]))))
        )

        def put(numbers: np.ndarray, i: int, value: float) -> None:
            numbers[i] = value
            quaternion = se3.to_quaternion(from_angles("rpy", np.radians(turn)))
            section["frame"] = {"position_mm": place.tolist(), "quaternion": quaternion.tolist()}
            self._write(section, again=False)

        text("p", texts("axis.frame")).classes("quiet")
        with ui.element("div").classes("row"):
            for i, letter in enumerate("xyz"):
                number(
                    texts("axis.at", axis=letter), place[i], lambda value, i=i: put(place, i, value),
                    low=-FARTHEST_MM, high=FARTHEST_MM, step="any",
                )  # fmt: skip
            for i, name in enumerate(("roll", "pitch", "yaw")):
                number(
                    texts(f"task.{name}"), turn[i], lambda value, i=i: put(turn, i, value),
                    low=-360.0, high=360.0, step="any",
                )  # fmt: skip

    def _write(self, section: dict[str, Any], *, again: bool = True) -> None:
        """Put an axis into the cell file, or into a new one."""
        project, chosen = self._project, self._project.choices.cell
        try:
            if chosen:
                path = project.path(chosen)
                write_whole(path, with_axis(path.read_text(encoding="utf-8"), section))
            else:
                begun = with_axis("", section).encode()
                project.choose(cell=project.put(LAYOUT.cells, "cell.toml", begun, CELL_ENDINGS))
        except (OSError, ValueError, TaskcalError) as error:
            # a disk; a file that was made no TOML since the page was shown; a path that leads out of the project
            message(str(error))
            return
        if again:
            ui.navigate.reload()
