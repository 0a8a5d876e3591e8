"""What a measurement with noise tells apart, for the terminal and for pages."""

from collections.abc import Mapping

from taskcal.analysis.elimination_table import describe_combination
from taskcal.analysis.told_apart import ToldApart
from taskcal.presentation.content import Table

WEAKEST_SHOWN, TERMS_SHOWN = 5, 5
"""Directions that are shown, and terms of each."""


def tabulate_told_apart(told_apart: ToldApart, symbols: Mapping[str, str]) -> Table:
    """The directions that a measurement says least of.

    Args:
        told_apart: what it tells apart.
        symbols: of parameters by name, where they have any.
    """
    rows: list[tuple[str, ...]] = []
    for direction in told_apart.directions[:WEAKEST_SHOWN]:
        terms = list(direction.leading.items())
        shown = {name: round(share, 2) for name, share in terms[:TERMS_SHOWN]}
        more = " …" if len(terms) > TERMS_SHOWN else ""
        combination = describe_combination(shown, symbols) + more
        rows.append((combination, f"{direction.left:.3f}", "yes" if direction.information > 1.0 else "no"))
    return Table.of_rows(
        "Directions that such a measurement says least of, in units of the tolerances",
        ("direction", "σ left", "told apart"),
        rows,
        text_columns=(0, 2),
    )


def count_told_apart(told_apart: ToldApart) -> str:
    """How many directions are told apart, in words."""
    return (
        f"{told_apart.count} of {len(told_apart.directions)}: less than half of the tolerances' variance would be left"
    )
