"""The lines of a text, one after another."""

from collections.abc import Iterator

_AT_ONCE = 1 << 16
"""Characters that are parted into lines at once: all lines of a large file take several times the memory of its text."""


def lines_of(text: str) -> Iterator[str]:
    """What stands between the line feeds of a text."""
    for part in parts_of(text):
        yield from part.removesuffix("\n").split("\n")
    if text.endswith("\n") or not text:
        yield ""


def parts_of(text: str) -> Iterator[str]:
    """A text divided behind some of its line feeds."""
    begin = 0
    while begin < len(text):
        end = text.find("\n", begin + _AT_ONCE) + 1 or len(text)
        yield text[begin:end]
        begin = end
