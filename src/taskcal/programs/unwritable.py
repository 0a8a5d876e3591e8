"""Motions that cannot be rewritten as they should, where one that stays as it was may keep others from changing."""

from collections.abc import Callable, Container, Hashable, Iterable, Mapping
from typing import TypeVar

from taskcal.programs.program import Visit
from taskcal.programs.source import Place

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


def keep_together(visits: Iterable[Visit], staying: Container[int], changing: Container[int]) -> dict[int, str]:
    """Motions that have to stay because another one of their path stays that goes to the same target, and why.

    Args:
        visits: of the program.
        staying: numbers of motions that were refused.
        changing: numbers of motions that are to be written.
    """
    visits = tuple(visits)
    stays: dict[Hashable, Place] = {}
    for visit in visits:
        if visit.number is None or visit.number in staying:
            stays.setdefault(visit.target, visit.place)
    return {
        visit.number: f"shares its target with the motion in {stays[visit.target]}, which stays as it is: the way between them "
        "would be another one"
        for visit in visits
        if visit.number is not None and visit.number in changing and visit.target in stays
    }
