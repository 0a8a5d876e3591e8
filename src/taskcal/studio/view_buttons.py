"""The directions from which a scene is seen: a button for each, and a key while the scene has the focus."""

from collections.abc import Callable
from typing import Any

from nicegui import ui

from taskcal.studio.controls import button, set_attribute, text
from taskcal.studio.robot_view import VIEWS
from taskcal.studio.texts import Texts

PRESSED = "(event) => { if (/^[1-9]$/.test(event.key) && !event.ctrlKey && !event.altKey && !event.metaKey) emit(event.key); }"


def add_views(scene: ui.scene, look: Callable[[str], None], label: str, texts: Texts) -> None:
    """Say what a scene shows, and add its views; in a row of elements, so that others can follow.

    Args:
        scene: the scene.
        look: called with the name of a view.
        label: what the scene shows, for those who do not see it.
        texts: of the page.
    """
    names = tuple(VIEWS)

    def press(event: Any) -> None:
        number = int(event.args)
        if number <= len(names):
            look(names[number - 1])

    scene.props("role=img tabindex=0")
    set_attribute(scene, "aria-label", label)
    scene.on("keydown", press, js_handler=PRESSED)
    for number, name in enumerate(names, 1):
        shown = button(texts(f"robot.view_{name}"), lambda name=name: look(name), plain=True)
        set_attribute(shown, "aria-keyshortcuts", str(number))
    text("span", texts("robot.view_keys", count=len(names))).classes("quiet")
