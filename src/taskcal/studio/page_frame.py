"""What surrounds every page: the road on the left, the project's name, language and colours, and a place for the page."""

from collections.abc import Awaitable, Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from taskcal.studio.controls import text
from taskcal.studio.studio import Studio
from taskcal.studio.texts import LANGUAGES, LIBRARY_LANGUAGE, Texts, preferred

LANGUAGE_COOKIE = "taskcal-language"
THEME_COOKIE = "taskcal-theme"

THEMES: Mapping[str, bool | None] = {"auto": None, "light": False, "dark": True}


@dataclass(frozen=True)
class Page:
    """A page of the road."""

    key: str
    """Its path without the slash, and where its texts stand."""
    build: "Callable[[Studio, Texts], Awaitable[None]]"
    """Fills it, once the browser shows what surrounds it."""


def add_page(page: Page, road: tuple[Page, ...], studio: Studio) -> None:
    """Make a page of the server."""

    async def show() -> None:
        client = ui.context.client
        cookies, headers = client.request.cookies, client.request.headers
        chosen = cookies.get(LANGUAGE_COOKIE, "")
        language = chosen if chosen in LANGUAGES else preferred(headers.get("accept-language", ""))
        theme = cookies.get(THEME_COOKIE, "auto")
        texts = Texts(language)
        ui.page_title(f"{texts(f'{page.key}.title')} – {studio.project.choices.name} – Taskcal")
        ui.dark_mode(THEMES.get(theme))
        with _surroundings(page, road, studio, texts, theme if theme in THEMES else "auto"):
            place = ui.element("div").classes("page")
            with place:
                waiting = text("p", texts("frame.loading")).props("role=status").classes("quiet")
        await client.connected(timeout=30)
        with place:
            await page.build(studio, texts)
            waiting.delete()
            place.props("data-ready=1")

    ui.page(f"/{page.key}", response_timeout=30)(show)


@contextmanager
def _surroundings(
    page: Page, road: tuple[Page, ...], studio: Studio, texts: Texts, theme: str
) -> Generator[None, None, None]:
    here = Path(__file__).parent
    ui.add_css(here / "studio.css")
    ui.add_head_html(f"<script>document.documentElement.lang = '{texts.language}';</script>")
    ui.add_head_html(f"<script>{(here / 'drop.js').read_text(encoding='utf-8')}</script>")
    text("a", texts("frame.skip")).props("href=#content").classes("skip")
    with ui.element("header").classes("top"):
        text("span", "Taskcal").classes("brand")
        text("span", studio.project.choices.name).classes("project")
        with ui.element("div").classes("settings"):
            for code, name in LANGUAGES.items():
                _setting(page, "language", code, name, on=code == texts.language).props(f"lang={code}")
            for name in THEMES:
                _setting(page, "theme", name, texts(f"frame.{name}"), on=name == theme)
    with ui.element("div").classes("body"):
        with ui.element("nav").classes("road").props(f'aria-label="{texts("frame.road")}"'), ui.element("ol"):
            for step in road:
                with ui.element("li"):
                    link = text("a", texts(f"{step.key}.title")).props(f"href=/{step.key}")
                    if step is page:
                        link.props("aria-current=page")
        with ui.element("main").props("id=content tabindex=-1"):
            text("h1", texts(f"{page.key}.title"))
            text("p", texts(f"{page.key}.purpose")).classes("quiet")
            yield
            if texts.language != LIBRARY_LANGUAGE:
                text("p", texts("frame.library_language")).classes("quiet")


def _setting(page: Page, name: str, value: str, shown: str, *, on: bool) -> TextElement:
    link = text("a", shown).props(f"href=/settings?{name}={value}&page={page.key}")
    return link.props("aria-current=true") if on else link
