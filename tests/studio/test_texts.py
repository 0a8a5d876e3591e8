"""Every text stands in every language, is used, and has the same places to fill."""

import re
from pathlib import Path
from string import Formatter

import taskcal.studio
from taskcal.studio.texts import LANGUAGES, Texts, catalogue, preferred

SOURCES = "\n".join(path.read_text() for path in Path(taskcal.studio.__file__).parent.rglob("*.py"))


def places(text: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(text) if name}


def test_every_text_stands_in_every_language_with_the_same_places() -> None:
    for key, texts in catalogue().items():
        assert set(texts) == set(LANGUAGES), key
        assert len({frozenset(places(text)) for text in texts.values()}) == 1, key
        assert all(text.strip() == text and text for text in texts.values()), key


def test_every_text_that_pages_ask_for_is_there() -> None:
    asked = set(re.findall(r'texts\(\s*"([a-z_]+\.[a-z_]+)"', SOURCES))
    assert asked
    assert asked <= catalogue().keys(), asked - catalogue().keys()


def test_a_text_is_filled_in_and_the_browser_s_first_language_of_ours_is_taken() -> None:
    assert Texts("de")("robot.joints_of", robot="X") == "Gelenke von X und ihre Grenzen"
    assert preferred("fr;q=0.9, de-CH;q=0.8, en;q=0.7") == "de"
    assert preferred("en-GB,de;q=0.5") == "en"
    assert preferred("tlh, *;q=nonsense") == "en"
