"""What is damaged at random: files of one kind, and what reads them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.readers.damage import Content, Files, damaged


@dataclass(frozen=True, kw_only=True)
class Reader:
    """Files of one kind, and what reads them."""

    files: Callable[[], Files]
    """Sound ones, each with its name."""
    read: Callable[[Path], object]
    damage: Callable[[np.random.Generator, Content, list[Content]], Content] = damaged
    """One of them by the dice: its bytes, and those of all."""
    sample: int = 150
    """Cases of the sample that every check runs; fewer where a case starts a process."""


def named(name: str, *texts: str) -> Callable[[], Files]:
    """Files of one name."""
    return lambda: [(name, text.encode()) for text in texts]
