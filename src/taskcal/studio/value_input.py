"""An input that both the user and the server set: what the user did last is not taken back by an answer to an earlier step."""

from collections.abc import Callable
from typing import Any

from nicegui.element import Element


class ValueInput(Element, component="value_input.js"):
    """A slider, a number or a line of text."""

    def __init__(self, kind: str, label: str, value: str, **attributes: str) -> None:
        """Show a value.

        Args:
            kind: of input, as HTML has it.
            label: what is set, as a screen reader says it.
            value: what it is now.
            attributes: other ones of the element.
        """
        super().__init__()
        self.props.update({"type": kind, "aria-label": label, **attributes, "value": value, "answered": 0, "tells": []})

    @property
    def value(self) -> str:
        """What the server has it at."""
        return self.props["value"]

    def show(self, value: str) -> None:
        """Set it, unless the user has set it again meanwhile."""
        if value != self.value:
            self.props["value"] = value
            self.update()

    def on_moved(self, handle: Callable[[str], Any], every: float) -> "ValueInput":
        """Call a function with the values that the user goes through, and with where each move ends.

        Args:
            handle: the function.
            every: seconds between two calls at least.
        """
        return self._on("moved", handle, every)

    def on_left(self, handle: Callable[[str], Any]) -> "ValueInput":
        """Call a function with the values that the user settles on."""
        return self._on("left", handle, 0.0)

    def _on(self, event: str, handle: Callable[[str], Any], every: float) -> "ValueInput":
        def take(said: Any) -> None:
            try:
                handle(str(said.args["value"]).strip())
            finally:
                self.props["answered"] = max(self.props["answered"], int(said.args["said"]))
                self.update()

        self.props["tells"] = [*self.props["tells"], event]
        self.on(event, take, throttle=every)
        return self
