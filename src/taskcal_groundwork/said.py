"""A sentence that knows its template and its values, so that it can be said in another language."""

from collections.abc import Iterable, Mapping
from typing import Any


class Said(str):
    """What a person is told or asked in words, with its values in their places, so that a page can say it in its language."""

    template: str
    """English, with places to fill as `str.format` has them; catalogues of other languages have it as their key."""
    values: Mapping[str, "str | float"]

    def __new__(cls, template: str, **values: str | float) -> "Said":
        """Fill the places in; a value may be a sentence itself."""
        whole = super().__new__(cls, template.format(**values))
        whole.template, whole.values = template, values
        return whole

    @property
    def parts(self) -> dict[str, Any]:
        """Template and values, for lines of JSON."""
        values = {name: value.parts if isinstance(value, Said) else value for name, value in self.values.items()}
        return {"template": self.template, "values": values}


def joined(between: str, parts: Iterable[str | float]) -> Said:
    """Texts one after the other.

    Args:
        between: what stands between two of them.
        parts: the texts.
    """
    values = {f"part{number}": part for number, part in enumerate(parts)}
    return Said(between.join(f"{{{name}}}" for name in values), **values)


def numeral(value: float, form: str) -> Said:
    """A number by its format, with the comma of the page's language."""
    return Said(f"{{number:{form}}}", number=value)


def term(text: str) -> Said:
    """A text of the library's own vocabulary, such as a decision, that a page can say in its language."""
    return Said(text.replace("{", "{{").replace("}", "}}"))
