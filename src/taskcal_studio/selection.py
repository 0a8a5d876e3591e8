"""The row that a page shows: selected in a table, a chart or a scene, it is selected in all of them."""

from collections.abc import Callable
from typing import Any

from nicegui import ui

CLICKED = """(event) => {
  const row = event.target.closest("[data-row]");
  if (row) emit(row.dataset.row);
}"""

STEPPED = """(event) => {
  const step = {ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1}[event.key];
  if (!step || event.ctrlKey || event.altKey || event.metaKey || !event.target.matches("[data-steps]")) return;
  event.preventDefault();
  emit(step);
}"""


class RowSelection:
    """A part of a page within which all show the same row."""

    def __init__(self, count: int) -> None:
        """Begin with the first of so many rows.

        Elements of the part have the numbers of their rows as ``data-row``; those with ``data-steps`` go from row to row by the
        arrow keys while they have the focus.
        """
        self.row, self._count = 0, count
        self._followers: list[Callable[[int], object]] = []
        self._area = ui.element("div").on("click", self._clicked, js_handler=CLICKED)
        self._area.on("keydown", self._stepped, js_handler=STEPPED)

    def __enter__(self) -> "RowSelection":
        self._area.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._area.__exit__(*_)
        if self._count:
            self.choose(self.row)

    def follow(self, show: Callable[[int], object]) -> None:
        """Call a function with every row that is selected."""
        self._followers.append(show)

    def choose(self, row: int) -> None:
        """Select a row; none that there is not."""
        if not 0 <= row < self._count:
            return
        self.row = row
        for show in self._followers:
            show(row)
        ui.run_javascript(f"taskcalMark('{self._area.html_id}', {row})")

    def _clicked(self, event: Any) -> None:
        if isinstance(event.args, str) and event.args.isdecimal():
            self.choose(int(event.args[:9]))

    def _stepped(self, event: Any) -> None:
        self.choose(self.row + (1 if event.args == 1 else -1))
