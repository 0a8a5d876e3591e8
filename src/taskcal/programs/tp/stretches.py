"""Stretches of a text, each from behind a mark to the next one."""

import re
from collections.abc import Iterable, Iterator


def stretches(marks: Iterable[re.Match[str]], end: int) -> Iterator[tuple[re.Match[str], int]]:
    """Each mark, with where the next one begins, or the text ends."""
    before: re.Match[str] | None = None
    for mark in marks:
        if before is not None:
            yield before, mark.start()
        before = mark
    if before is not None:
        yield before, end
