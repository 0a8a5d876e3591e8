"""The few controls that pages are made of: elements of HTML that browsers make reachable by keyboard themselves."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from nicegui import ui
from nicegui.element import Element
from nicegui.elements.mixins.text_element import TextElement

from taskcal.studio.texts import Texts

VALUE = "(event) => emit(event.target.value)"
CHECKED = "(event) => emit(event.target.checked)"


def text(tag: str, content: str) -> TextElement:
    """An element with text, which the browser shows as it is."""
    return TextElement(tag=tag, text=content)


def set_attribute(element: Element, name: str, value: object) -> None:
    """Set an attribute to a value that may hold anything; `props` would take it apart."""
    element.props[name] = value
    element.update()


def choice(
    label: str, options: Mapping[str, str], value: str, on_change: Callable[[str], Any], *, group: str = ""
) -> Element:
    """A list to choose from; only what it offers reaches the handler.

    Args:
        label: what is chosen.
        options: what is shown, by what is handed on.
        value: what is chosen now; an empty line is shown where that is none of the options.
        on_change: called with what is chosen.
        group: told to style sheets and tests.
    """

    async def handle(event: Any) -> None:
        if event.args in options:
            result = on_change(event.args)
            if result is not None:
                await result

    with ui.element("label").classes("row") as whole:
        text("span", label)
        select = ui.element("select").classes("value").on("change", handle, js_handler=VALUE)
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


def table(caption: str, header: Sequence[str], rows: Iterable[Sequence[str]], words: Iterable[int] = (0,)) -> Element:
    """A table of texts.

    Args:
        caption: what it shows.
        header: of its columns.
        rows: of cells.
        words: columns of words, set flush left; the others are numbers.
    """
    left = set(words)

    def cell(tag: str, column: int, content: str) -> TextElement:
        return text(tag, content).classes("words" if column in left else "")

    with ui.element("div").classes("scroll").props("tabindex=0 role=region") as around:
        set_attribute(around, "aria-label", caption)
        with ui.element("table").classes("plain"):
            text("caption", caption)
            with ui.element("thead"), ui.element("tr"):
                for column, name in enumerate(header):
                    cell("th", column, name).props("scope=col")
            with ui.element("tbody"):
                for row in rows:
                    with ui.element("tr"):
                        for column, content in enumerate(row):
                            cell("td", column, content)
    return around


def facts(pairs: Iterable[tuple[str, str]]) -> Element:
    """Labelled lines."""
    with ui.element("dl").classes("facts") as made:
        for label, said in pairs:
            text("dt", label)
            text("dd", said)
    return made


def message(said: str, *, fine: bool = False) -> TextElement:
    """Something that a user has to know, read out as it appears."""
    return (
        text("div", said).classes("message fine" if fine else "message").props(f"role={'status' if fine else 'alert'}")
    )


def command_line(line: str) -> TextElement:
    """What does the same on the command line, in the project's folder."""
    return text("code", line).classes("command")


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
        ui.element("span").classes("said").props("role=alert")
    return zone
