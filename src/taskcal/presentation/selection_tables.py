"""The tables of a choice of parameters, for the terminal and for its page."""

from taskcal.adaptation.selection import Selection
from taskcal.presentation.content import Table
from taskcal.robot.error_model import ErrorModel


def tabulate_ladder(selection: Selection) -> Table:
    """Error over the task by size of the model; cross-validated where there were measurements."""
    crossed = any(nested.cross_validated is not None for nested in selection.ladder)
    rows = [
        (
            str(nested.size),
            f"{nested.expected * 1e3:.3f}",
            *(["" if nested.cross_validated is None else f"{nested.cross_validated * 1e3:.3f}"] if crossed else []),
            "chosen" if nested.size == len(selection.kept) else "",
        )
        for nested in selection.ladder
    ]
    header = ("parameters", "expected mm (rms)", *(["cross-validated mm (mean)"] if crossed else []), "")
    return Table.of_rows(
        "Error in space over the task, by size of the model", header, rows, text_columns=(len(header) - 1,), folded=True
    )


def tabulate_dropped(selection: Selection, model: ErrorModel) -> Table:
    """Parameters that were dropped, in the order in which they went, and why."""
    symbols = {p.name: p.symbol for p in model.parameters}
    whole = {own[0]: name for name, own in selection.groups.items()}
    inside = {name for own in selection.groups.values() for name in own[1:]}
    return Table.of_rows(
        f"The {len(selection.dropped)} dropped parameters, in the order in which they went",
        ("parameter", "symbol", "why"),
        [
            (whole.get(name, name), symbols[name] if whole.get(name, name) == name else "", reason)
            for name, reason in selection.dropped.items()
            if name not in inside
        ],
        text_columns=(0, 1, 2),
        folded=True,
    )
