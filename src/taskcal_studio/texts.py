"""Texts of the pages in each language, from ``texts.toml``."""

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from taskcal.report.chart import plain
from taskcal_groundwork.said import Said

LANGUAGES = {"en": "English", "de": "Deutsch"}
"""By the code that browsers use."""

LIBRARY_LANGUAGE = "en"
"""Of what the library and its commands say."""


@cache
def _content() -> Mapping[str, Mapping[str, Mapping[str, str]]]:
    return tomllib.loads((Path(__file__).parent / "texts.toml").read_text(encoding="utf-8"))


@cache
def catalogue() -> Mapping[str, Mapping[str, str]]:
    """Texts by language, by key."""
    return {
        f"{page}.{key}": languages
        for page, texts in _content().items()
        if page != "said"
        for key, languages in texts.items()
    }


def sentences() -> Mapping[str, Mapping[str, str]]:
    """Sentences of the library's own in other languages, by their English templates."""
    return _content()["said"]


class Texts:
    """The texts of one language."""

    def __init__(self, language: str) -> None:
        """Take a language of `LANGUAGES`."""
        self.language = language

    def __call__(self, key: str, **values: object) -> str:
        """The text of a key, with values in its places."""
        return catalogue()[key][self.language].format(**values)

    def number(self, value: float, form: str) -> str:
        """A number by its format, with the comma of the language, and its space before a percent sign."""
        said = plain(value, form)
        return said.replace(".", ",").replace("%", "\N{NO-BREAK SPACE}%") if self.language == "de" else said

    def sentence(self, parts: Mapping[str, Any]) -> str:
        """A sentence that the library says, by its English template and values; in English where the catalogue lacks it.

        Args:
            parts: as `taskcal_groundwork.said.Said` has them.
        """
        template = parts["template"]
        values = {
            name: self.sentence(value)
            if isinstance(value, dict)
            else _Spoken(value, self)
            if isinstance(value, float)
            else value
            for name, value in parts["values"].items()
        }
        return sentences().get(template, {}).get(self.language, template).format(**values)

    def said(self, text: str) -> str:
        """A text of the library in the page's language, where it knows its template and values; else as it is."""
        return self.sentence(text.parts) if isinstance(text, Said) else text

    def named(self, group: str, name: str, **values: object) -> str:
        """The text of what the library names, such as a finding of the doctor; its own name where the catalogue has none."""
        key = f"{group}.{re.sub('[^a-z]+', '_', name)}"
        return self(key, **values) if key in catalogue() else name


class _Spoken(float):
    """A number that is put into a text by the text's own format, with the comma of the language."""

    _texts: Texts

    def __new__(cls, value: float, texts: Texts) -> "_Spoken":
        number = super().__new__(cls, value)
        number._texts = texts
        return number

    def __format__(self, form: str) -> str:
        return self._texts.number(float(self), form)


def preferred(accepted: str) -> str:
    """The language that a browser's ``Accept-Language`` asks for first; English where it asks for none of ours."""
    wanted: list[tuple[float, int, str]] = []
    for place, part in enumerate(accepted.split(",")):
        code, _, weight = part.strip().partition(";q=")
        try:
            wanted.append((-float(weight or 1.0), place, code.split("-")[0].lower()))
        except ValueError:
            continue
    return next((code for _, _, code in sorted(wanted) if code in LANGUAGES), "en")
