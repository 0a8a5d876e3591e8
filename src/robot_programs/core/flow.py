"""Which routines of a program call which, in any language."""

from collections.abc import Hashable, Mapping
from typing import TypeVar

Routine = TypeVar("Routine", bound=Hashable)
Thing = TypeVar("Thing", bound=Hashable)

DEEPEST = 12
"""Calls in each other that are followed."""

MOST_PASSES = 4
"""As many lines as the program has, so many times, are gone through again for calls; behind that, what routines set is taken as
not known."""


def with_called(
    own: Mapping[Routine, tuple[frozenset[Thing], frozenset[Routine]]],
) -> dict[Routine, frozenset[Thing]]:
    """What each routine has, by itself or by those that it calls.

    Args:
        own: of each routine what it has by itself, and which it calls; those that are not keys count for nothing.
    """
    total = {name: has for name, (has, _) in own.items()}
    while True:
        wider = {
            name: total[name].union(*(total[other] for other in calls if other in total))
            for name, (_, calls) in own.items()
        }
        if wider == total:
            return total
        total = wider
