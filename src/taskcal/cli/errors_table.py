"""The table of position errors on the terminal."""

from collections.abc import Mapping

from taskcal.cli.output import show


def show_errors(title: str, summaries: Mapping[str, Mapping[str, float | int]]) -> None:
    """Print a row for each labelled `Validation.summary`; axes are those of the robot's base."""
    from taskcal.presentation.errors_table import tabulate_errors

    show(tabulate_errors(title, summaries))
