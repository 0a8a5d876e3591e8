"""Names that stand several times where each must be one's own."""

from collections import Counter
from collections.abc import Iterable
from typing import TypeVar

Item = TypeVar("Item")


def repeated(items: Iterable[Item]) -> list[Item]:
    """Those that are there twice and more, each once, in the order in which they come first."""
    return [item for item, times in Counter(items).items() if times > 1]
