"""What a calibration leaves, as a section of its page."""

from taskcal.identification.residual_analysis import MAX_P_VALUE, MIN_SHARE, ResidualAnalysis
from taskcal.presentation.content import Block, Chart, Numbers, Points, Section, Table, Text
from taskcal.presentation.residual_analysis_figures import draw_against, draw_shares


def residual_analysis_section(analysis: ResidualAnalysis, rows: str) -> Section:
    """The section.

    Args:
        analysis: the remainder.
        rows: which poses they are, in words.
    """
    numbers = [
        (f"{analysis.rms * 1e3:.3f}", "mm", "is left in space (rms, mean of the targets)"),
        (f"{analysis.tracker * 1e3:.3f}", "mm", "of it would be left by the tracker's noise alone"),
    ]
    if analysis.non_rigid is not None and analysis.rigid is not None:
        numbers += [
            (f"{analysis.rigid * 1e3:.3f}", "mm", "per coordinate is motion of all targets as one body (rms)"),
            (f"{analysis.non_rigid * 1e3:.3f}", "mm", "per coordinate is motion of targets against each other (rms)"),
        ]
    blocks: list[Block] = [Numbers(tuple(numbers)), Points(_said(analysis))]
    if any(e.p_value is not None for e in analysis.explained):
        blocks.append(
            Chart(
                title="What the remainder goes with",
                figure=draw_shares(analysis),
                note="Each quantity by itself; quantities that go together share what they explain. Grey: not proven, as chance "
                f"gives as much more often than once in {1 / MAX_P_VALUE:.0f} or the share is under {100 * MIN_SHARE:.0f} %.",
            )
        )
    if analysis.explained:
        blocks.append(
            Chart(
                title="The remainder against each quantity",
                figure=draw_against(analysis),
                note="Turns are those that the measured points ask of the joint; poses in which they hardly tell are left out.",
            )
        )
    table = [
        (
            e.regressor.name,
            e.regressor.moves,
            f"{round(100 * e.share, 1) + 0.0:.1f}",
            "" if e.p_value is None else f"{e.p_value:.2g}",
        )
        for e in analysis.explained
    ]
    blocks.append(
        Table.of_rows(
            f"All {len(table)} quantities",
            ("quantity", "moves", "share %", "p"),
            table,
            text_columns=(0, 1),
            note="Share of the variance on poses left out; below zero, the quantity predicts worse than nothing.",
            folded=True,
        )
    )
    method = Text(
        (
            f"A smooth function of each quantity is fitted to the residuals of {rows} and predicts those of poses left out. p is "
            "the chance of such a share where the quantity does not matter, from shuffling it among the poses.",
        )
    )
    return Section(title="What is left, and what it goes with", blocks=(method, *blocks))


def _said(analysis: ResidualAnalysis) -> tuple[str, ...]:
    """The evidence in sentences."""
    proven = [e for e in analysis.explained if e.proven]
    out = [
        f"{e.regressor.name}, by the {e.regressor.moves}: {100 * e.share:.0f} % of the variance." for e in proven[:5]
    ]
    if not proven:
        out = [f"Nothing that was tried is proven to explain {100 * MIN_SHARE:.0f} % of it."]
    if analysis.non_rigid is not None and analysis.rigid is not None and analysis.rigid > 3.0 * analysis.non_rigid:
        out.append(
            "The targets move as one body: what is left is the motion of the robot or of its stand, not of single measurements."
        )
    return tuple(out)
