"""Texts of the pages in each language, from ``texts.toml``."""

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from taskcal.report.chart import plain

LANGUAGES = {"en": "English", "de": "Deutsch"}
"""By the code that browsers use."""

LIBRARY_LANGUAGE = "en"
"""Of what the library and its commands say."""


@cache
def catalogue() -> Mapping[str, Mapping[str, str]]:
    """Texts by language, by key."""
    content = tomllib.loads((Path(__file__).parent / "texts.toml").read_text(encoding="utf-8"))
    return {f"{page}.{key}": languages for page, texts in content.items() for key, languages in texts.items()}


class Texts:
    """The texts of one language."""

    def __init__(self, language: str) -> None:
        """Take a language of `LANGUAGES`."""
        self.language = language

    def __call__(self, key: str, **values: object) -> str:
        """The text of a key, with values in its places."""
        return catalogue()[key][self.language].format(**values)

    def number(self, value: float, form: str) -> str:
        """A number by its format, with the comma of the language."""
        said = plain(value, form)
        return said.replace(".", ",") if self.language == "de" else said

    def named(self, group: str, name: str, **values: object) -> str:
        """The text of what the library names, such as a finding of the doctor; its own name where the catalogue has none."""
        key = f"{group}.{re.sub('[^a-z]+', '_', name)}"
        return self(key, **values) if key in catalogue() else name


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
