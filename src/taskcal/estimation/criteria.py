"""By what poses are chosen."""

from typing import Literal

Criterion = Literal["task", "D", "A", "E", "O1", "O2", "O3", "O4", "O5"]
"""``task`` for the expected task error; the others are classical."""
