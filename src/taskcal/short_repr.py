"""A line that says what a result is, in place of all its numbers."""

from collections.abc import Collection, Mapping
from dataclasses import fields
from typing import Any, TypeVar

T = TypeVar("T", bound=type[Any])

LONGEST = 380
"""Characters of a representation; a console's page is soon full of arrays."""

LONGEST_VALUE = 60
"""Characters of one value."""


def short_repr(cls: T) -> T:
    """Class decorator: show arrays by their shape, long collections by their size, and leave out what is empty."""
    setattr(cls, "__repr__", _represent)  # noqa: B010  (a type checker takes it for that of the class itself)
    return cls


def _represent(self: Any) -> str:
    shown = [f"{f.name}={text}" for f in fields(self) if f.repr and (text := _value(getattr(self, f.name)))]
    out = ", ".join(shown)
    if len(out) > LONGEST:
        out = out[: out.rindex(", ", 0, LONGEST)] + ", …"
    return f"{type(self).__name__}({out})"


def _value(value: object) -> str:
    """A value in short; empty for what is not worth a word."""
    import numpy as np  # where options are described, nothing needs it yet

    if value is None or value is False or (isinstance(value, Collection) and not len(value)):
        return ""
    if isinstance(value, np.ndarray):
        return f"<{'×'.join(map(str, value.shape))}>" if value.ndim else f"{value.item()!r}"
    if isinstance(value, float):
        return f"{value:.4g}"
    text = repr(value)
    if len(text) <= LONGEST_VALUE and "array(" not in text:
        return text
    if isinstance(value, str):
        return f"{text[: LONGEST_VALUE - 2]}…'"
    if isinstance(value, Mapping | Collection):
        return f"<{len(value)}>"
    return f"{type(value).__name__}(…)"
