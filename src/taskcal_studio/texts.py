"""Texts of the pages in each language, from ``texts.toml``."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from string import Formatter
from typing import Any

from taskcal.report.chart import plain
from taskcal_groundwork.said import Said, term

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


NUMBER = r"[-+−]?\d[\d.]*(?:e[-+]?\d+)?%?"
"""A number as the library writes it."""


MIN_LETTERS = 8
"""Of a sentence, beside its places, by which it is known again, unless all of these are numbers: 'of' is in many texts."""


@cache
def _forms() -> Sequence[tuple[re.Pattern[str], str]]:
    """Sentences that have words as patterns, those with most of them first, and their templates."""
    found: list[tuple[int, re.Pattern[str], str]] = []
    for template in sentences():
        parts = [(text, name, form) for text, name, form, _ in Formatter().parse(template)]
        words, names = "".join(text for text, *_ in parts), [name for _, name, _ in parts if name]
        sure = len(re.findall("[a-z]", words)) >= MIN_LETTERS or all(form for _, name, form in parts if name)
        if sure and len(set(names)) == len(names):
            places = (f"(?P<{name}>{NUMBER if form else '.+?'})" if name else "" for _, name, form in parts)
            whole = "".join(re.escape(text) + place for (text, *_), place in zip(parts, places, strict=True))
            found.append((len(words), re.compile(rf"{whole}\.?", re.IGNORECASE | re.DOTALL), template))
    return [(pattern, template) for _, pattern, template in sorted(found, key=lambda one: -one[0])]


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
        return _spoken(plain(value, form), self.language)

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
        if template not in sentences() and not values and self.language != LIBRARY_LANGUAGE:
            return self.stored(template.format())
        return sentences().get(template, {}).get(self.language, template).format(**values)

    def stored(self, text: str) -> str:
        """A sentence of the library that a file or a command's output has without its values; as it is where none is known.

        The template that it was made of is found by its words, and its values are what stands in the places.
        """
        for pattern, template in _forms():
            if found := pattern.fullmatch(text):
                plain_places = re.sub(r"\{(\w+):[^}]*\}", r"{\1}", sentences()[template][self.language])
                said = plain_places.format(**{name: self._value(value) for name, value in found.groupdict().items()})
                said = said[0].upper() + said[1:] if text[0].isupper() else said
                return f"{said}." if text.endswith(".") and not said.endswith(".") else said
        return text

    def _value(self, text: str) -> str:
        """What stands in a place: a number, a sentence of its own, or a name."""
        if re.fullmatch(NUMBER, text):
            return _spoken(text, self.language)
        return self.sentence(term(text).parts)

    def said(self, text: str) -> str:
        """A text of the library in the page's language, where it knows its template and values; else as it is."""
        return self.sentence(text.parts) if isinstance(text, Said) else text

    def named(self, group: str, name: str, **values: object) -> str:
        """The text of what the library names, such as a finding of the doctor; its own name where the catalogue has none."""
        key = f"{group}.{re.sub('[^a-z]+', '_', name)}"
        return self(key, **values) if key in catalogue() else name


def _spoken(number: str, language: str) -> str:
    return number.replace(".", ",").replace("%", "\N{NO-BREAK SPACE}%") if language == "de" else number


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
