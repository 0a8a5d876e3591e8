"""What rows that were held out say, for the terminal and for a calibration's page."""

import numpy as np

from taskcal.identification.calibration import Calibration
from taskcal.identification.held_out import HeldOut
from taskcal.presentation.content import Block, Section, Table, Text
from taskcal.presentation.errors_table import tabulate_errors
from taskcal.presentation.verdict import NOMINAL

PARTS = {
    "neighbours": "groups of neighbouring poses",
    "blocks": "blocks of rows that follow each other",
    "rows": "single rows",
    "chosen": "groups of neighbouring poses among the rows that were not chosen",
}
"""What is held out together, in words."""

MOST_PARTS = 40
"""That a table lists."""


def describe_held_out(held_out: HeldOut) -> str:
    """How rows were held out, and how much the parts differ."""
    means = held_out.part_means * 1e3
    mean = held_out.validation.mean * 1e3
    kind = PARTS[held_out.by]
    folds = f"{held_out.folds} folds of {kind}" if held_out.folds else f"{len(means)} {kind}"
    seen = "each predicted by a fit of the others" if held_out.folds else "not seen by the fit"
    if len(means) < 2:
        return f"{folds}, {seen}: {mean:.3f} mm on average; a single part does not tell how far to trust that"
    spread = f"{mean:.3f} ± {held_out.standard_error * 1e3:.3f} mm (1σ) on average"
    return f"{folds}, {seen}: {spread}, from {means.min():.3f} to {means.max():.3f} mm in single ones"


def held_out_section(calibration: Calibration) -> Section:
    """The section of a calibration's page; an advice where nothing was held out."""
    held_out = calibration.held_out
    if held_out is None:
        advice = (
            "No rows were held out, so that this page cannot say how well the robot is predicted where it was not measured: "
            "residuals of fitted rows are always a little too small. Identify with --holdout 0.3, or with --folds 5, which "
            "gives up no row."
        )
        return Section(title="Rows that were not fitted", blocks=(Text((advice,)),))
    summaries = {
        NOMINAL: held_out.nominal_validation.summary(),
        "calibrated": held_out.validation.summary(),
    }
    sentence = describe_held_out(held_out)
    blocks: list[Block] = [
        Text((f"{sentence[0].upper()}{sentence[1:]}.",)),
        tabulate_errors(
            "Error of rows that were not fitted",
            summaries,
            of="robot",
            note="This is the number to believe. Any x, y and z are the axes of the robot's base.",
        ),
    ]
    if 1 < len(held_out.part_means) <= MOST_PARTS:
        blocks.append(_tabulate_parts(held_out))
    return Section(title="Rows that were not fitted", blocks=tuple(blocks))


def _tabulate_parts(held_out: HeldOut) -> Table:
    """The mean error of every part."""
    length = np.linalg.norm(held_out.residuals[..., :3], axis=2) * 1e3
    rows = [
        (str(part), str(int(np.isfinite(own).sum())), f"{np.nanmean(own):.3f}", f"{np.nanmax(own):.3f}")
        for part in np.unique(held_out.part)
        if np.isfinite(own := length[held_out.part == part]).any()
    ]
    return Table.of_rows(
        "Part by part",
        ("fold" if held_out.folds else "group", "points", "mean mm", "max mm"),
        rows,
        text_columns=(),
        note="Where one part is much worse than the others, the poses around it are too few, or the robot differs there.",
        folded=True,
    )
