"""Position errors as a publication reports them: per axis, then in space."""

from collections.abc import Mapping

from taskcal.cli.output import show_table

_COLUMNS = {
    "max_x_mm": "max x mm",
    "max_y_mm": "max y mm",
    "max_z_mm": "max z mm",
    "max_mm": "max in space mm",
    "mean_mm": "mean mm",
    "rms_mm": "rms mm",
    "p95_mm": "p95 mm",
    "mean_mrad": "mean mrad",
    "max_mrad": "max mrad",
    "n": "points",
}


def show_errors(title: str, summaries: Mapping[str, Mapping[str, float | int]]) -> None:
    """Print a row for each labelled `Validation.summary`; axes are those of the robot's base."""
    columns = [key for key in _COLUMNS if any(key in summary for summary in summaries.values())]
    rows = [
        (label, *(_text(summary[key]) if key in summary else "" for key in columns))
        for label, summary in summaries.items()
    ]
    show_table(title, ("rows", *(_COLUMNS[key] for key in columns)), rows)


def _text(value: float | int) -> str:
    return str(value) if isinstance(value, int) else f"{value:.4f}"
