"""The orientations of the tool in a task: their angles, the cone in which it may tilt, and how far it may turn about its axis."""

from dataclasses import replace

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from taskcal.studio.box_editor import BoxEditor
from taskcal.studio.controls import button, number, text
from taskcal.studio.task_box import FREE, THOUSANDTHS, ToolRoom
from taskcal.studio.texts import Texts

MOST = 6
"""Orientations that are edited here; a task file may have more."""


class OrientationEditor:
    """A group of numbers for every orientation."""

    def __init__(self, editor: BoxEditor, texts: Texts) -> None:
        """Show them; a change is saved at once.

        Args:
            editor: of the box in which the tool is turned so.
            texts: of the page.
        """
        self._editor, self._texts = editor, texts
        self._directions: list[TextElement] = []
        text("h2", texts("task.orientations"))
        text("p", texts("task.orientations_how")).classes("quiet")
        rooms = editor.box.rooms
        for k, room in enumerate(rooms):
            self._group(k, room, removable=len(rooms) > 1)
        if len(rooms) < MOST:
            button(texts("task.add_orientation"), lambda: self._renew((*self._rooms, self._rooms[-1])), plain=True)
        self._tell()

    @property
    def _rooms(self) -> tuple[ToolRoom, ...]:
        return self._editor.box.rooms

    def _group(self, k: int, room: ToolRoom, *, removable: bool) -> None:
        texts = self._texts
        with ui.element("fieldset").classes("orientation"):
            text("legend", texts("task.orientation", number=k + 1))
            with ui.element("div").classes("row"):
                for i, name in enumerate(("roll", "pitch", "yaw")):
                    number(
                        texts(f"task.{name}"), room.angles[i], lambda value, i=i: self._turn(k, i, value),
                        low=-360.0, high=360.0, step="any",
                    )  # fmt: skip
                number(
                    texts("task.cone"),
                    room.cone,
                    lambda value: self._change(k, cone=value),
                    low=0,
                    high=180,
                    step="any",
                )
                number(
                    texts("task.spin"),
                    room.spin,
                    lambda value: self._change(k, spin=value),
                    low=0,
                    high=FREE,
                    step="any",
                )
                if removable:
                    button(texts("task.remove_orientation", number=k + 1), lambda: self._remove(k), plain=True)
            told = text("p", "").classes("quiet")
            told.props("role=status")
            self._directions.append(told)

    def _remove(self, k: int) -> None:
        self._renew(tuple(room for other, room in enumerate(self._rooms) if other != k))

    def _turn(self, k: int, i: int, value: float) -> None:
        angles = list(self._rooms[k].angles)
        angles[i] = round(value, THOUSANDTHS)
        self._change(k, angles=tuple(angles))

    def _change(self, k: int, **changed: object) -> None:
        rounded = {name: round(v, THOUSANDTHS) if isinstance(v, float) else v for name, v in changed.items()}
        rooms = tuple(replace(room, **rounded) if other == k else room for other, room in enumerate(self._rooms))
        self._editor.change(replace(self._editor.box, rooms=rooms))
        self._tell()

    def _renew(self, rooms: tuple[ToolRoom, ...]) -> None:
        self._editor.save(replace(self._editor.box, rooms=rooms))
        ui.navigate.reload()

    def _tell(self) -> None:
        """Where the tool's z points, in words that need no convention of angles."""
        for place, orientation in zip(self._directions, self._editor.box.workspace.orientations, strict=True):
            x, y, z = orientation.rotation[:, 2]
            place.set_text(self._texts("task.points_to", direction=f"{x:+.3f} {y:+.3f} {z:+.3f}"))
