"""Motions that cannot be rewritten as they should, where one that stays as it was may keep others from changing."""

from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

Path = TypeVar("Path")


def reject_in_turn(
    paths: Mapping[int, Path], conflicts: Callable[[Mapping[int, Path]], Iterable[tuple[int, str]]]
) -> dict[int, str]:
    """Take motions away until no conflict is left among the others.

    Args:
        paths: what each motion should become, by its number.
        conflicts: of some of them: motions that cannot, and why.

    Returns:
        the motions that were taken away, and why.
    """
    rejected: dict[int, str] = {}
    while True:
        rest = {i: path for i, path in paths.items() if i not in rejected}
        more = {i: why for i, why in conflicts(rest) if i in rest}
        if not more:
            return rejected
        rejected |= more
