"""The few controls that pages are made of: elements of HTML that browsers make reachable by keyboard themselves."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from nicegui import ui
from nicegui.element import Element
from nicegui.elements.mixins.text_element import TextElement

from taskcal.report.content import TextTable
from taskcal_studio.project import MAX_FILE_BYTES
from taskcal_studio.texts import Texts

# An input that both the user and the server set: what the user did last is not taken back by an answer to an
# earlier step.


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
        """Value on the server."""
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


class Dial:
    """A slider and a number, in a row, that show one value."""

    def __init__(
        self,
        name: str,
        label: str,
        unit: str,
        limits: tuple[float, float],
        take: Callable[[str, bool], None],
        every: float,
        step: str = "any",
    ) -> None:
        """Show no value yet.

        Args:
            name: of what is set, before the slider.
            label: what is set, as a screen reader says it.
            unit: of the number.
            limits: of the slider.
            take: called with what is set, and whether the user left it there.
            every: seconds between two calls at least.
            step: of the slider.
        """
        low, high = (f"{limit:.6g}" for limit in limits)
        with ui.element("div").classes("joint"):
            text("span", name)
            slider = ValueInput("range", label, "", min=low, max=high, step=step)
            slider.on_moved(lambda given: take(given, False), every)
            number = ValueInput("number", f"{label} ({unit})", "", step="any").classes("value")
        self._fields = tuple(field.on_left(lambda given: take(given, True)) for field in (slider, number))

    def show(self, value: str) -> None:
        """Set both, unless the user has set them again meanwhile."""
        for field in self._fields:
            field.show(value)


MAX_DISTANCE_MM = 1e5
"""Of a tool, a part, a positioner or a tracker from the origin, to each side: any hall is smaller."""

ANGLES = ("roll", "pitch", "yaw")
"""About fixed x, y, z, as the texts name them."""

MAX_COLUMNS = 9
"""Beyond which a table is set smaller, to fit beside the road."""

MAX_CELL = 40
"""Characters beyond which a cell of words is folded."""

COPY = """(event) => {
  const said = event.target.previousElementSibling;
  getSelection().selectAllChildren(said);
  if (navigator.clipboard) navigator.clipboard.writeText(said.textContent); else document.execCommand("copy");
}"""
"""Copy the text before a button, and show what was copied."""

CHOSEN: Mapping[str, str] = {
    "pointerdown": "(event) => { event.target.byKey = false; }",
    "keydown": """(event) => {
  const list = event.target;
  if (event.key !== "Enter") { list.byKey = event.key !== "Tab" || list.byKey; return; }
  list.byKey = false;
  if (list.value === (list.taken ?? list.dataset.was)) return;
  event.preventDefault();
  list.taken = list.value;
  emit(list.value);
}""",
    "change": """(event) => {
  const list = event.target;
  if (list.byKey) return;
  list.taken = list.value;
  emit(list.value);
}""",
    "blur": """(event) => {
  const list = event.target;
  if (!list.byKey || list.value === (list.taken ?? list.dataset.was)) return;
  list.byKey = false;
  list.taken = list.value;
  emit(list.value);
}""",
}
"""Of a list: by keys one goes through it, and takes what is there by Enter or by going on; browsers tell of every key's change."""

TYPED = "(event) => emit(event.target.value)"

CHECKED = "(event) => emit(event.target.checked)"


def text(tag: str, content: str) -> TextElement:
    """An element with text, which the browser shows as it is."""
    return TextElement(tag=tag, text=content)


def set_attribute(element: Element, name: str, value: object) -> None:
    """Set an attribute to a value that may hold anything; `props` would take it apart."""
    element.props[name] = value
    element.update()


def choice(
    label: str,
    options: Mapping[str, str],
    value: str,
    on_change: Callable[[str], Any],
    *,
    group: str = "",
    bare: bool = False,
) -> Element:
    """A list to choose from; only what it offers reaches the handler.

    Args:
        label: what is chosen.
        options: what is shown, by what is handed on.
        value: what is chosen now; an empty line is shown where that is none of the options.
        on_change: called with what is chosen.
        group: told to style sheets and tests.
        bare: whether the label is for screen readers alone.
    """

    async def handle(event: Any) -> None:
        if event.args in options:
            result = on_change(event.args)
            if result is not None:
                await result

    with ui.element("label").classes("row") as whole:
        if not bare:
            text("span", label)
        select = ui.element("select").classes("value")
        for event, script in CHOSEN.items():
            select.on(event, handle, js_handler=script)
        set_attribute(select, "data-was", value if value in options else "")
        set_attribute(select, "aria-label", label)
        set_attribute(select, "data-name", group or label)
    with select:
        for key, shown in (({} if value in options else {"": "–"}) | dict(options)).items():
            option = text("option", shown)
            set_attribute(option, "value", key)
            if key == value or (not key and value not in options):
                set_attribute(option, "selected", True)
    return whole


def button(label: str, on_click: Callable[[], Any], *, plain: bool = False) -> TextElement:
    """A button."""
    made = text("button", label).classes("act plain" if plain else "act").props("type=button")
    made.on("click", lambda _: on_click(), args=[])
    return made


def tabulated(
    shown: TextTable, rows: Sequence[int] = (), *, texts: Texts | None = None, classes: Mapping[str, str] | None = None
) -> Element:
    """A table as reports and the command line have it.

    Args:
        shown: the table.
        rows: that each of its rows stands for, by which a page selects it.
        texts: of the page, in whose language it is said; without, as it is.
        classes: of cells, by what stands in them.
    """

    def said(content: str) -> str:
        return content if texts is None else texts.said(content)

    def cell(tag: str, column: int, content: str) -> TextElement:
        kind = "words long" if len(content) > MAX_CELL else "words"
        own = (classes or {}).get(content, "")
        return text(tag, said(content)).classes(f"{kind} {own}" if column in shown.text_columns else "")

    with ui.element("div").classes("scroll").props("tabindex=0 role=region") as around:
        set_attribute(around, "aria-label", said(shown.title))
        if len(rows):
            around.props("data-steps")
        with ui.element("table").classes("plain dense" if len(shown.header) > MAX_COLUMNS else "plain"):
            text("caption", said(shown.title))
            with ui.element("thead"), ui.element("tr"):
                for column, name in enumerate(shown.header):
                    cell("th", column, name).props("scope=col")
            with ui.element("tbody"):
                for number, row in enumerate(shown.rows):
                    with ui.element("tr") as line:
                        if len(rows):
                            line.props(f"data-row={rows[number]}")
                        for column, content in enumerate(row):
                            cell("td", column, content)
    if shown.note:
        text("p", said(shown.note)).classes("quiet")
    return around


def number(
    label: str, value: float, on_change: Callable[[float], Any], low: float, high: float, *, step: str = "any"
) -> Element:
    """A number to type; what is not one, or out of its bounds, is not handed on.

    Args:
        label: what it is.
        value: what it is now.
        on_change: called with a number within the bounds.
        low: the least.
        high: the largest.
        step: of the arrows beside it.
    """
    accepted = value

    def handle(given: str) -> None:
        nonlocal accepted
        with suppress(ValueError):
            if low <= float(given) <= high:
                accepted = float(given)
                on_change(accepted)
        field.show(f"{accepted:.10g}")

    field = ValueInput("number", label, f"{value:.10g}", min=f"{low:g}", max=f"{high:g}", step=step)
    return labelled(label, field.on_left(handle).classes("value"))


def tick(label: str, value: bool, on_change: Callable[[bool], Any]) -> Element:
    """A box to tick."""
    with ui.element("label").classes("row") as whole:
        box = (
            ui.element("input")
            .props("type=checkbox")
            .on("change", lambda e: on_change(e.args is True), js_handler=CHECKED)
        )
        set_attribute(box, "checked", value)
        text("span", label)
    return whole


def line_of_text(label: str, value: str, on_change: Callable[[str], Any]) -> Element:
    """A line to type."""

    def handle(given: str) -> None:
        field.show(given)
        on_change(given)

    field = ValueInput("text", label, value, size="50", maxlength="2000")
    return labelled(label, field.on_left(handle).classes("value"))


def lines_of_text(label: str, value: str, on_change: Callable[[str], Any]) -> Element:
    """Several lines to type or to paste."""
    with ui.element("label").classes("lines") as whole:
        text("span", label)
        field = ui.element("textarea").classes("value").props("rows=5 spellcheck=false")

        def take(given: str) -> None:
            set_attribute(field, "value", given)  # else it is empty where it is drawn anew
            on_change(given)

        field.on("change", lambda event: take(str(event.args)), js_handler=TYPED)
        set_attribute(field, "value", value)
        set_attribute(field, "aria-label", label)
    return whole


def labelled(label: str, field: Element) -> Element:
    """A field in a row behind its label."""
    with ui.element("label").classes("row") as whole:
        text("span", label)
    field.move(whole)
    return whole


def facts(pairs: Iterable[tuple[str, str]]) -> Element:
    """Labelled lines."""
    with ui.element("dl").classes("facts") as made:
        for label, said in pairs:
            text("dt", label)
            text("dd", said)
    return made


def headline(said: str, of: str = "", *, style: str = "") -> None:
    """What a page is about, in large type, and a sentence on it.

    Args:
        said: in a few words.
        of: the sentence; none where it follows.
        style: class of the words.
    """
    text("p", said).classes(f"headline {style}")
    if of:
        text("p", of)


def message(said: str, *, fine: bool = False) -> TextElement:
    """Something that a user has to know, read out as it appears."""
    return (
        text("div", said).classes("message fine" if fine else "message").props(f"role={'status' if fine else 'alert'}")
    )


def colour_bar(low: Sequence[float], high: Sequence[float], limit_mm: float) -> None:
    """The colours from no error to the largest, with the numbers at both ends.

    Args:
        low: colour of no error, red, green and blue from 0 to 1.
        high: of the largest.
        limit_mm: the largest.
    """

    def css(colour: Sequence[float]) -> str:
        return f"rgb({' '.join(f'{255 * part:.0f}' for part in colour)})"

    with ui.element("div").classes("row colour-bar"):
        text("span", "0 mm")
        ui.element("span").classes("bar").style(f"background: linear-gradient(to right, {css(low)}, {css(high)})")
        text("span", f"{limit_mm:g} mm")


def command_line(line: str, texts: Texts) -> None:
    """Command line that does the same, in the project's folder: folded, to be copied."""
    with ui.element("details").classes("as-command"):
        text("summary", texts("run.as_command"))
        text("code", line).classes("command")
        # navigator.clipboard is there for pages of this machine and of https alone
        copy = text("button", texts("run.copy")).props("type=button").classes("act plain")
        copy.on("click", js_handler=COPY)


def drop_zone(texts: Texts, kind: str, label: str, endings: Sequence[str], *, several: bool = False) -> Element:
    """A place to drop files on, or to choose them by keyboard; the page is shown anew with what came of them.

    Args:
        texts: of the page.
        kind: of file, as the server's ``/drop`` knows it.
        label: what to drop.
        endings: of the files.
        several: whether more than one may be dropped at once.
    """
    with ui.element("label").classes("drop") as zone:
        text("span", label)
        chooser = ui.element("input").props(f"type=file data-kind={kind}{' multiple' if several else ''}")
        set_attribute(chooser, "accept", ",".join(endings))
        set_attribute(chooser, "data-working", texts("frame.sending"))
        set_attribute(chooser, "data-most", MAX_FILE_BYTES)
        set_attribute(chooser, "data-large", texts("frame.too_large", name="{name}", most=MAX_FILE_BYTES // 1_000_000))
        ui.element("span").classes("said").props("role=alert")
    return zone
