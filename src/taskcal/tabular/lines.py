"""The lines of a text, one after another."""

from collections.abc import Iterator

_AT_ONCE = 1 << 16
"""Characters that are parted into lines at once: all lines of a large file take several times the memory of its text."""


def lines_of(text: str) -> Iterator[str]:
    """What stands between the line feeds of a text."""
    begin = 0
    while (end := text.find("\n", begin + _AT_ONCE)) >= 0:
        yield from text[begin:end].split("\n")
        begin = end + 1
    yield from text[begin:].split("\n")
