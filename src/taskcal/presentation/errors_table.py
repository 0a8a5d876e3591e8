"""Position errors as a publication reports them, for the terminal and for pages: per axis, then in space."""

from collections.abc import Mapping

from taskcal.presentation.content import Table

COLUMNS = {
    "max_x_mm": "max x mm",
    "max_y_mm": "max y mm",
    "max_z_mm": "max z mm",
    "max_mm": "max mm",
    "mean_mm": "mean mm",
    "rms_mm": "rms mm",
    "p95_mm": "p95 mm",
    "mean_mrad": "mean mrad",
    "max_mrad": "max mrad",
    "n": "points",
}
"""Of `Validation.summary`, and what they are called."""


def tabulate_errors(
    title: str, summaries: Mapping[str, Mapping[str, float | int]], *, of: str = "rows", note: str = ""
) -> Table:
    """A row for each labelled `Validation.summary`; axes are those of the robot's base.

    Args:
        title: of the table.
        summaries: by label; columns that none of them has are left out.
        of: what the labels are of.
        note: what the table shows.
    """
    columns = [key for key in COLUMNS if any(key in summary for summary in summaries.values())]
    rows = [
        (label, *(_text(summary[key]) if key in summary else "" for key in columns))
        for label, summary in summaries.items()
    ]
    return Table.of_rows(title, (of, *(COLUMNS[key] for key in columns)), rows, note=note)


def _text(value: float | int) -> str:
    return str(value) if isinstance(value, int) else f"{value:.3f}"
