"""A calibration as a page: what it was worth, where the robot was off, what is left, and how well the tool is known over a task."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float

from taskcal.analysis.elimination_table import describe_combination
from taskcal.analysis.identifiability import Identifiability, identifiability
from taskcal.analysis.sensitivity import sensitivity
from taskcal.identification.calibration import Calibration, informed_parameters, largest_correlations
from taskcal.identification.held_out import HeldOut, Outlier, Validation
from taskcal.identification.residual_analysis import MAX_P_VALUE, MIN_SHARE, ResidualAnalysis
from taskcal.identification.uncertainty_budget import COVERAGE_FACTOR, UncertaintyBudget, budget_at
from taskcal.identification.validation import MeasuredErrors, measured_errors
from taskcal.planning.selection import Rung
from taskcal.planning.task_map import Uncertainty
from taskcal.registration.registration import Registration
from taskcal.report.content import (
    Block,
    Chart,
    Numbers,
    Points,
    Section,
    Table,
    Text,
    decimals_of,
    model_error_origin,
    prior_scale_origin,
    with_interval,
)
from taskcal.report.fit_figures import (
    draw_against,
    draw_before_after,
    draw_by_axis,
    draw_effects,
    draw_over_joints,
    draw_over_orientation,
    draw_parameters,
    draw_residuals,
    draw_shares,
)
from taskcal.report.page import Page
from taskcal.report.scene import robot_scene
from taskcal.report.task import draw_bands, draw_maps
from taskcal.report.theme import BLUE, INK, styled
from taskcal.robot.error_model import ErrorModel
from taskcal.task.workspace import Workspace

# Position errors as a publication reports them, for the terminal and for pages: per axis, then in space.

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


# What a calibration was worth, in one sentence.

NOMINAL = "nominal (registered)"
"""The robot as its maker describes it, with tracker frame and targets fitted to the measurements."""


def verdict(robot: str, before: float, after: float, held_out: int | None, *, in_space: bool = True) -> str:
    """The sentence: it is about predictions, since the robot goes where it went until its programs are corrected.

    Args:
        robot: its name.
        before: mean error of the nominal robot, registered, millimetres.
        after: of the calibrated one, on the same points.
        held_out: how many points that were not fitted these are means of; None for fitted ones.
        in_space: whether the errors are distances in space, not those of single numbers such as lengths.
    """
    where = f"{held_out} held-out points" if held_out is not None else "fitted rows, optimistic: none were held out"
    change = "falls" if after < before else "does not fall"
    ratio = f"ratio {before / after:.1f}, " if after > 0.0 else ""
    what = "mean 3D prediction error" if in_space else "mean prediction error"
    return (
        f"{robot}: the {what} {change} from {before:.3f} mm, {NOMINAL}, to {after:.3f} mm, calibrated ({ratio}{where})."
    )


# What rows that were held out say, for the terminal and for a calibration's page.

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


# What each part of a calibrated model is worth, as a section of its page.


def ladder_section(rungs: Sequence[Rung]) -> Section:
    """The section."""
    rows = [(rung.name, str(rung.parameters), f"{rung.mean * 1e3:.3f}", f"{rung.p95 * 1e3:.3f}") for rung in rungs]
    return Section(
        title="What each part of the model is worth",
        blocks=(
            Chart(
                title="Error on rows left out, from the nominal robot to the whole model",
                figure=draw_ladder_rungs(rungs),
                note="Every bar that is shorter than the one above it is a part of the model worth having; where bars stop getting "
                "shorter, more parameters no longer help. Neighbouring poses are left out together, in five parts.",
            ),
            Table.of_rows("Nested models", ("model", "parameters", "mean mm", "95 % below mm"), rows),
        ),
    )


def draw_ladder_rungs(rungs: Sequence[Rung]) -> go.Figure:
    """A bar for each nested model, with the 95th percentile as a tick."""
    names = [f"{rung.name} ({rung.parameters})" for rung in rungs][::-1]
    figure = go.Figure(
        go.Bar(
            x=[rung.mean * 1e3 for rung in rungs][::-1],
            y=names,
            orientation="h",
            name="mean",
            marker={"color": BLUE},
            text=[f"{rung.mean * 1e3:.3f}" for rung in rungs][::-1],
            textposition="auto",
            textangle=0,
            constraintext="none",
            hovertemplate="%{y}: %{x:.3f} mm<extra></extra>",
        )
    )
    figure.add_scatter(
        x=[rung.p95 * 1e3 for rung in rungs][::-1],
        y=names,
        mode="markers",
        name="95 % of the points are below",
        marker={"symbol": "line-ns-open", "size": 16, "color": INK, "line": {"width": 2.5}},
        hovertemplate="95 % below %{x:.3f} mm<extra></extra>",
    )
    styled(figure, height=150 + 42 * len(rungs), top=60)
    figure.update_xaxes(title_text="error in space on rows left out (mm)", rangemode="tozero")
    return figure


# The parameters of a calibration, as a section of its page: what was found of each, or why it was not, and relations.

CORRELATIONS = 10
"""That a page lists."""

MOST_TERMS = 6
"""Of a relation that are written out."""


def parameters_section(calibration: Calibration) -> Section:
    """The section."""
    q = calibration.q
    geometry = ErrorModel(calibration.model.robot, lengths_only=calibration.model.lengths_only)
    found = identifiability(geometry, q)
    blocks: list[Block] = [
        Chart(
            title="What each defect would do to the tool point at the measured poses",
            least_width=700,
            figure=draw_effects(sensitivity(geometry, q)),
            note="A high bar: a defect of one tolerance (1σ) moves the tool far. A bar near zero: it hardly matters here, and "
            "these poses say little of it. Along the robot's base axes, and in space.",
        )
    ]
    if len(calibration.estimated):
        blocks.append(
            Chart(
                title="Estimated parameters",
                least_width=700,
                figure=draw_parameters({"fit": calibration}),
                note="A bar that crosses zero: the data do not prove that this defect is there. Bars are two standard errors. "
                "Parameters that repeat each other share what is found.",
            )
        )
    blocks.append(tabulate_intervals(calibration, found))
    if found.dependent or found.zero:
        blocks.append(_tabulate_relations(geometry, found))
    if len(calibration.estimated):
        blocks.append(_tabulate_correlations(calibration))
    return Section(title="Parameters", blocks=tuple(blocks))


def tabulate_intervals(calibration: Calibration, found: Identifiability) -> Table:
    """Every parameter of the model with its 95 % interval, and whether it was estimated.

    Args:
        calibration: the calibration.
        found: which parameters of the geometry repeat others at the fitted poses.
    """
    informed, estimated = informed_parameters(calibration), set(calibration.estimated.tolist())
    rows: list[tuple[str, ...]] = []
    for i, p in enumerate(calibration.model.parameters):
        unit = p.shown
        value, interval = with_interval(
            float(calibration.estimate[i]) * unit.factor, float(calibration.standard_errors[i]) * unit.factor
        )
        kept = i in estimated
        why = _why(p.name, kept, informed.get(p.name), found)
        cells = (value, interval) if kept else ("0, held", interval)
        rows.append((p.label, *cells, f"{p.tolerance * unit.factor:.3g}", unit.name, why))
    return Table.of_rows(
        f"All {len(rows)} parameters: {len(estimated)} were estimated",
        ("parameter", "estimate", "95 % interval", "tolerance (1σ)", "unit", "kept, or why not"),
        rows,
        text_columns=(0, 4, 5),
        note="Digits are those that the standard error leaves. A parameter that was not estimated is held at zero, and counts with "
        "its tolerance in every uncertainty.",
        folded=True,
    )


def _why(name: str, kept: bool, informed: bool | None, found: Identifiability) -> str:
    """Whether a parameter was kept, or why not."""
    repeats = name in found.dependent or name in found.zero
    if kept and informed is False:
        return "kept; not seen: its interval is that of its tolerance"
    if kept:
        return "kept; known with those it repeats alone (see relations)" if repeats else "kept"
    if name in found.zero:
        return "left out: it does nothing to the tool point here"
    return "left out: it repeats others here (see relations)" if repeats else "left out by choice"


def _tabulate_relations(model: ErrorModel, found: Identifiability) -> Table:
    """What repeats what, exactly, at the fitted poses."""
    symbols = {p.name: p.symbol or p.name for p in model.parameters}
    rows = [(symbols[name], "0: no effect on the tool point") for name in found.zero]
    for name, terms in found.dependent.items():
        few = dict(sorted(terms.items(), key=lambda term: -abs(term[1]))[:MOST_TERMS])
        more = f" … ({len(terms) - MOST_TERMS} more)" if len(terms) > MOST_TERMS else ""
        rows.append((symbols[name], describe_combination(few, symbols) + more))
    return Table.of_rows(
        f"Relations: {len(rows)} parameters that repeat others at the measured poses",
        ("a defect in", "moves the tool point exactly as"),
        rows,
        text_columns=(0, 1),
        note="No measurement of the tool point at these poses tells the two sides apart, however good; what is found of them "
        "is shared in proportion to the tolerances. Per metre and radian.",
        folded=True,
    )


def _tabulate_correlations(calibration: Calibration) -> Table:
    rows = [
        (a, b, f"{value:+.3f}".replace("-", "−")) for a, b, value in largest_correlations(calibration, CORRELATIONS)
    ]
    size = float(np.max([abs(float(row[2].replace("−", "-"))) for row in rows], initial=0.0))
    return Table.of_rows(
        "Largest correlations of what was estimated",
        ("parameter", "and", "correlation"),
        rows,
        text_columns=(0, 1),
        note=f"The nearer to 1, the less the two are known one by one; the largest here is {size:.3f}. Predictions allow for it.",
        folded=True,
    )


# Where a calibration comes from, as a section of its page.


def provenance_section(calibration: Calibration) -> Section:
    """The section."""
    source = calibration.provenance
    rows = [
        ("robot", source.robot),
        ("robot file, digest", source.robot_digest),
        ("effects", ", ".join(effect.name for effect in calibration.model.effects) or "none"),
        ("campaign", source.campaign),
        ("campaign, digest", source.campaign_digest),
        *(("campaign, as read", note) for note in source.notes),
        ("rows", str(source.rows)),
        ("registration", _registered(calibration.layout.registration)),
        ("made", source.created),
        ("by Taskcal", source.version),
        *((str(key), _words(value)) for key, value in source.options.items()),
        (
            "ended",
            f"{calibration.reason}; {calibration.iterations} iterations in the last of {calibration.rounds} rounds",
        ),
    ]
    return Section(
        title="Where it comes from",
        blocks=(Table.of_rows("Provenance", ("entry", "value"), rows, text_columns=(0, 1)),),
    )


def _registered(registration: Registration) -> str:
    """Where the fit's start of tracker frame and targets came from."""
    return f"from {registration.method}{f', {registration.file}' if registration.file else ''}"


def _words(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {item}" for key, item in value.items())  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list | tuple):
        return ", ".join(str(item) for item in value) or "none"  # pyright: ignore[reportUnknownVariableType]
    return str(value)


# What a calibration leaves, as a section of its page.


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


# What a calibration left at the rows that it was fitted to, as a section of its page.


def residuals_section(calibration: Calibration, errors: MeasuredErrors | None) -> Section:
    """The section.

    Args:
        calibration: the calibration.
        errors: at the fitted rows; None where their joint positions are not known.
    """
    blocks: list[Block] = [] if errors is None else _figures(calibration, errors)
    blocks.insert(
        min(1, len(blocks)),
        Chart(
            title=f"Measured less predicted, target {calibration.targets[0]}",
            figure=draw_residuals({calibration.provenance.campaign or "the campaign": {"fit": calibration}}),
            note="A band about zero without steps, drifts or waves: what is left looks like chance. A step: something moved. "
            f"{_axes(calibration)}, pose by pose.",
        ),
    )
    blocks.append(_table(calibration))
    return Section(title="What is left at the fitted poses", blocks=tuple(blocks))


def _figures(calibration: Calibration, errors: MeasuredErrors) -> list[Block]:
    return [
        Chart(
            title="Error of every measured pose, nominal and calibrated",
            figure=draw_before_after(errors),
            note="Circles should lie far below the crosses, all of them: a circle among the crosses is a pose that the "
            "calibration did not make better. Of several targets the worst one counts.",
        ),
        Chart(
            title="What is left along each axis, by target",
            figure=draw_by_axis(calibration, errors),
            note="Boxes about zero and alike: no axis and no target stands out. A box off zero: this target, or this "
            "direction, is measured differently. Half of the values are in the box; single points are far out.",
        ),
        Chart(
            title="What is left over the position of each joint",
            least_width=700,
            figure=draw_over_joints(calibration, errors),
            note="A cloud that rises to one side, or waves, names the joint that errs there; an even one names none.",
        ),
        Chart(
            title="Error over the orientation of the tool",
            figure=draw_over_orientation(calibration, errors),
            note="Circles that rise to the right: the farther the tool is turned, the worse; then measure more orientations. "
            "Poses far to the right are few in most campaigns.",
        ),
    ]


def _axes(calibration: Calibration) -> str:
    """What the residuals of the first target are along."""
    kinds = calibration.layout.observed
    if not kinds or kinds[0].along_axes:
        return "Along the robot's base axes"
    return "The one number that was read" if kinds[0].width == 1 else "Along the sensor's axes"


def _table(calibration: Calibration) -> Table:
    base, residuals = calibration.T_tracker_base[:3, :3], calibration.residuals
    observed = calibration.layout.observed
    summaries = {
        name: Validation.of_residuals(residuals[:, [t]], base, observed[t : t + 1]).summary()
        for t, name in enumerate(calibration.targets)
        if not np.isnan(residuals[:, t]).all()
    }
    return tabulate_errors(
        "Residuals of the fitted rows",
        summaries,
        of="target",
        note="Residuals of fitted rows are a little too small; held-out rows are the measure. Any x, y and z are the axes of the "
        "robot's base.",
    )


# A calibration's tables, for the terminal and for its page.

MODEL, READING = "model error", "reading"
"""Likely causes of an outlier."""

SHARED_ERROR = (
    "Model error: neighbouring rows or poses err alike, so that measuring again does not help; identify effects (--effects auto), "
    "or measure more poses there. Where something moved for a while, taskcal doctor finds it."
)
SINGLE_ERROR = "Reading: it errs alone among its neighbours; measure again, or leave out."
MOSTLY_OUTLIERS = (
    "Most points are outliers, so that no single row is at fault: the model errs by more than was stated, or robot, target or "
    "tracker frame are not those that were calibrated."
)


def tabulate_parameters(calibration: Calibration, *, leave_out: Callable[[str], bool] = lambda _: False) -> Table:
    """Estimate, standard error and tolerance of every estimated parameter.

    Args:
        calibration: the calibration.
        leave_out: whether a parameter of this name is shown elsewhere.
    """
    informed = informed_parameters(calibration)
    rows: list[tuple[str, ...]] = []
    for i in calibration.estimated:
        p = calibration.model.parameters[i]
        if leave_out(p.name):
            continue
        unit = p.shown
        rows.append(
            (
                p.name,
                p.symbol,
                _signed(calibration.estimate[i] * unit.factor),
                f"{calibration.standard_errors[i] * unit.factor:.4f}",
                f"{p.tolerance * unit.factor:.4f}",
                unit.name,
                "not seen" if informed[p.name] is False else "",
            )
        )
    return Table.of_rows(
        f"The {len(rows)} identified parameters",
        ("parameter", "symbol", "estimate", "± 1σ", "tolerance", "unit", ""),
        rows,
        text_columns=(0, 1, 5, 6),
        note="Not seen: the measurements say nothing of it, its standard error is that of the prior.",
        folded=True,
    )


def tabulate_outliers(calibration: Calibration) -> Table:
    """Points that are too far off for chance, and whether the reading or the model is at fault."""
    mostly = are_most(len(calibration.outliers), int(np.isfinite(calibration.studentised).sum()))
    return tabulate_judged(calibration.outliers, calibration.shared_outliers, "residual mm", mostly=mostly)


def tabulate_judged(
    outliers: Sequence[Outlier], shared: Sequence[bool], length: str, *, mostly: bool, count: int | None = None
) -> Table:
    """Outliers, each with its likely cause.

    Args:
        outliers: the worst first.
        shared: whether neighbours have the same error, of each.
        length: title of the column with the length of the error.
        mostly: whether most points are outliers, so that none of them is at fault.
        count: how many are listed; all by default.
    """
    causes = ["" if mostly else MODEL if alike else READING for alike in shared]
    notes = ["Rows of the campaign, counted from 0, and lines of its file, counted from 1."]
    if mostly:
        notes.append(MOSTLY_OUTLIERS)
    else:
        notes += [{MODEL: SHARED_ERROR, READING: SINGLE_ERROR}[cause] for cause in dict.fromkeys(causes)]
    rows = [
        (
            _number(outlier.row),
            _number(outlier.line),
            outlier.id,
            outlier.target,
            f"{outlier.residual * 1e3:.3f}",
            f"{outlier.studentised:.1f}",
            cause,
        )
        for outlier, cause in zip(outliers, causes, strict=True)
    ][:count]
    more = f", the {len(rows)} worst of {len(outliers)}" if len(rows) < len(outliers) else ""
    header = ("row", "line", "id", "target", length, "over its 1σ", "likely cause")
    title = f"Outliers, too far off for chance{more}"
    return Table.of_rows(title, header, rows, text_columns=(2, 3, 6), note=" ".join(notes))


def are_most(outliers: int, points: int) -> bool:
    """Whether outliers are more than half of the points: then the uncertainty that was stated is wrong, not they."""
    return 2 * outliers > points


def describe_outliers(shared: Sequence[bool], *, mostly: bool) -> str:
    """How many there are, and what to do about them."""
    alone, alike = sum(not one for one in shared), sum(shared)
    if not shared:
        return "none"
    if mostly:
        return f"{len(shared)} too far off for chance. {MOSTLY_OUTLIERS}"
    advice = (
        [f"{alike} together with {'its' if alike == 1 else 'their'} neighbours: {MODEL}, do not measure again"]
        if alike
        else []
    )
    advice += (
        [f"{alone} alone among {'its' if alone == 1 else 'their'} neighbours: measure again, or leave out"]
        if alone
        else []
    )
    return f"{len(shared)} too far off for chance, {'; '.join(advice)}"


def tabulate_left_out(calibration: Calibration) -> Table:
    """Rows that were not fitted, since they contradict all others."""
    return Table.of_rows(
        "Rows that contradict all others, left out: measure again",
        ("row", "line", "id", "off by mm", "over its 1σ"),
        [
            (_number(row.row), _number(row.line), row.id, f"{row.distance * 1e3:.2f}", f"{row.studentised:.0f}")
            for row in calibration.left_out
        ],
        text_columns=(2,),
        note="Rows of the campaign, counted from 0, and lines of its file, counted from 1.",
    )


def _number(number: int | None) -> str:
    return "–" if number is None else str(number)


def _signed(value: float) -> str:
    text = f"{value:+.4f}"
    return text if float(text) else " 0.0000"


# What the poses do not say of the targets' places on the tool, and what is taken instead, in words.

CLEAR = 1e-6
"""Share of a direction that counts as present or absent."""


def describe_unobservable(registration: Registration) -> tuple[str, ...]:
    """For each target what the poses do not say of its place, empty where they say all.

    In directions that the poses do not determine the target, or what all targets have in common, is held at the tool
    point. In the others it is found from the data, however far off that is.
    """
    common = _common(registration.unobservable)
    return tuple("" if located else _say(common) for located in registration.located)


def _common(unlocated: Float[np.ndarray, "offsets offsets"]) -> tuple[int, Float[np.ndarray, "3 3"]] | None:
    """Number of targets, and the projector onto the directions in which they are undetermined together; None otherwise."""
    count = len(unlocated) // 3
    blocks = unlocated.reshape(count, 3, count, 3)
    directions = np.einsum("tisj->ij", blocks) / count
    same = np.kron(np.full((count, count), 1.0 / count), directions)
    return (count, directions) if np.allclose(same, unlocated, atol=CLEAR) else None


def _say(common: tuple[int, Float[np.ndarray, "3 3"]] | None) -> str:
    if common is None:
        return "the poses do not locate it in every direction: there it is taken as near to the tool point as the others allow"
    count, directions = common
    what = "it" if count == 1 else "the targets, but for their distances to each other"
    taken = "it is" if count == 1 else "their middle is"
    values, vectors = np.linalg.eigh(directions)
    rank = int((values > 0.5).sum())
    if rank == 3:
        return f"the poses do not locate {what}: {taken} taken at the tool point"
    if rank == 1:
        along = _axis(vectors[:, -1])
        return f"the poses do not locate {what}, along {along} of the tool: in that direction alone {taken} taken at the tool point"
    across = _axis(vectors[:, 0])
    return f"the poses do not locate {what}, across {across} of the tool: in those directions {taken} taken at the tool point"


def _axis(direction: Float[np.ndarray, " 3"]) -> str:
    """A direction in the tool frame, by the name of an axis where it is one."""
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) > 1.0 - CLEAR:
        return "xyz"[largest]
    return "({:.2f} {:.2f} {:.2f})".format(*(direction * np.sign(direction[largest]) + 0.0))


# What a reader wants of a calibration first: the verdict, four numbers, and what needs attention.


def summary_section(calibration: Calibration, errors: MeasuredErrors | None, over: Uncertainty | None) -> Section:
    """The section.

    Args:
        calibration: the calibration.
        errors: at the fitted rows; None where they are not known.
        over: uncertainty over a task, if one was named.
    """
    before, after = _errors(calibration, errors)
    held_out = calibration.held_out
    blocks: list[Block] = []
    if before is not None:
        robot = calibration.model.robot
        n = None if held_out is None else len(after)
        name, means = robot.title or robot.name, (before.mean * 1e3, after.mean * 1e3)
        blocks.append(Text((verdict(name, *means, n, in_space=after.in_space),)))
    blocks.append(Numbers(_numbers(calibration, before, after, over)))
    blocks.append(Points(_remarks(calibration)))
    return Section(title="In short", blocks=tuple(blocks))


def outliers_section(calibration: Calibration) -> Section:
    """Rows and points that are too far off for chance."""
    tables = [one for one in (tabulate_left_out(calibration), tabulate_outliers(calibration)) if len(one)]
    blocks: tuple[Block, ...] = tuple(tables) or (
        Text(("No point is too far off for chance, and no row was left out.",)),
    )
    return Section(title="Outliers", blocks=blocks)


def _errors(calibration: Calibration, errors: MeasuredErrors | None) -> tuple[Validation | None, Validation]:
    """Errors before and after: on rows that were not fitted where there are any."""
    held_out = calibration.held_out
    if held_out is not None:
        return held_out.nominal_validation, held_out.validation
    if errors is not None:
        return Validation.of_residuals(errors.before, np.eye(3)), Validation.of_residuals(errors.after, np.eye(3))
    base, kinds = calibration.T_tracker_base[:3, :3], calibration.layout.observed
    return None, Validation.of_residuals(calibration.residuals, base, kinds)


def _numbers(
    calibration: Calibration, before: Validation | None, after: Validation, over: Uncertainty | None
) -> tuple[tuple[str, str, str], ...]:
    """Four numbers: before, after, what 95 % stay below, and how far to trust a prediction."""
    rows = "rows that were not fitted" if calibration.held_out is not None else "the fitted rows"
    what = "mean 3D prediction error" if after.in_space else "mean prediction error"
    items = [(f"{after.mean * 1e3:.3f}", "mm", f"{what} of the calibrated model, on {rows}")]
    if before is not None:
        items.insert(0, (f"{before.mean * 1e3:.3f}", "mm", f"{what} of the nominal model (registered), on {rows}"))
    items.append((f"{after.p95 * 1e3:.3f}", "mm", "error that 95 % of these points stay below"))
    if over is not None:
        items.append(
            (f"{over.target * 1e3:.3f}", "mm", f"uncertainty of the target over {over.task} (1σ in space, rms)")
        )
    else:
        items.append((f"{after.maximum * 1e3:.3f}", "mm", "largest error of these points"))
    return tuple(items)


def _remarks(calibration: Calibration) -> tuple[str, ...]:
    """What needs attention, and what the fit rests on."""
    outliers, left_out = len(calibration.outliers), len(calibration.left_out)
    said = [f"{remark[0].upper()}{remark[1:].rstrip('.')}." for remark in calibration.remarks]
    if left_out:
        said.append(f"{_counted(left_out, 'row')} left out, since no fit of the others has them there: see Outliers.")
    if outliers:
        mostly = are_most(outliers, int(np.isfinite(calibration.studentised).sum()))
        said.append(
            f"Points: {describe_outliers(calibration.shared_outliers, mostly=mostly).rstrip('.')}. See Outliers."
        )
    described = zip(calibration.targets, describe_unobservable(calibration.layout.registration), strict=True)
    said += [f"Target {name}: {sentence}." for name, sentence in described if sentence]
    rotation = "".join(f" and {e * 1e3:.3f} mrad" for e in calibration.model_error[1:])
    size = (
        f"{calibration.model_error[0] * 1e3:.3f} mm{rotation} per axis (1σ), " if any(calibration.model_error) else ""
    )
    said.append(f"Model error: {size}{model_error_origin(calibration)}.")
    scale, origin = calibration.prior_scale, prior_scale_origin(calibration)
    if scale is not None:
        said.append(
            f"Defects are about {scale:.2g} times what the tolerances say{f' ({origin})' if origin else ''}."
            if calibration.group_deviations is None
            else "Each group of parameters has a size of its own, found from the data."
        )
    return tuple(said)


def _counted(number: int, noun: str) -> str:
    return (
        f"1 {noun} was"
        if number == 1 and noun == "row"
        else f"1 {noun} is"
        if number == 1
        else (f"{number} {noun}s were" if noun == "row" else f"{number} {noun}s are")
    )


# An uncertainty budget, as a section of a page.

_RULE = (
    "The sources are independent and add as squares (GUM, JCGM 100:2008, 5.1). A: from the residuals of this campaign; B: known "
    "beforehand."
)


def predicted_uncertainty_section(budget: UncertaintyBudget, where: str) -> Section:
    """Of the positions that a calibration predicts.

    Args:
        budget: of a predicted position.
        where: over which poses, in words.
    """
    text = (
        f"How far the first target may be from where it is predicted, on average over {where}. {_RULE} The tracker's noise is in "
        "the first line, as far as it went into the fit; measuring a point again adds the tracker's own."
    )
    return _section("Uncertainty of a predicted position", text, budget)


def corrected_uncertainty_section(budget: UncertaintyBudget) -> Section:
    """Of the targets of a corrected program."""
    text = (
        f"How far the tool may be from a target of the corrected program, on average over its targets. {_RULE} Tool and part are "
        "as uncertain as the cell file says that they were measured, or else as they are built. Not in it: what cutting forces "
        "bend, unless the calibration was told of them, and wear of the tool."
    )
    return _section("Uncertainty of a corrected position", text, budget)


def _section(title: str, text: str, budget: UncertaintyBudget) -> Section:
    combined = budget.combined * 1e3
    digits = decimals_of(combined)
    rows = [
        (
            one.source,
            one.evaluation,
            f"{one.deviation * 1e3:.{digits}f}",
            f"{100.0 * one.deviation**2 / max(budget.combined**2, 1e-300):.0f}",
        )
        for one in sorted(budget.contributions, key=lambda one: -one.deviation)
    ]
    rows += [
        ("combined standard uncertainty, in space", "", f"{combined:.{digits}f}", "100"),
        (
            f"expanded uncertainty along one axis, k = {COVERAGE_FACTOR:g}",
            "",
            f"{budget.expanded * 1e3:.{digits}f}",
            "",
        ),
    ]
    largest = max(budget.contributions, key=lambda one: one.deviation, default=None)
    see = "" if largest is None else f" The largest part is {largest.source}."
    return Section(
        title=title,
        blocks=(
            Text((text + see,)),
            Table.of_rows("Uncertainty budget", ("source", "type", "u, mm", "share %"), rows, text_columns=(0, 1)),
        ),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Beside:
    """What a page shows beside the calibration itself, each if it was asked for."""

    over: Uncertainty | None = None
    """Uncertainty over a task."""
    space: Workspace | None = None
    """The task's workspace."""
    remainder: ResidualAnalysis | None = None
    """What is left on a campaign."""
    rungs: Sequence[Rung] = ()
    """What each part of the model is worth on that campaign."""
    header: Sequence[tuple[str, str]] = ()
    """Whom and what the page is for: labels and what belongs to them."""


def calibration_page(calibration: Calibration, beside: Beside, *, version: str) -> Page:
    """The page of a calibration.

    Args:
        calibration: the calibration.
        beside: what else is shown.
        version: of the package that makes the page.
    """
    model, source = calibration.model, calibration.provenance
    errors = measured_errors(calibration)
    sections = [summary_section(calibration, errors, beside.over)]
    if errors is not None:
        scene = robot_scene(calibration, errors, beside.space)
        sections.append(Section(title="The robot", blocks=(scene,)))
    sections += [held_out_section(calibration), residuals_section(calibration, errors)]
    if beside.remainder is not None:
        sections.append(residual_analysis_section(beside.remainder, f"{len(beside.remainder.residual)} poses"))
    if errors is not None:
        sections.append(predicted_uncertainty_section(budget_at(calibration, calibration.q), "the measured poses"))
    if beside.over is not None:
        sections.append(_task(beside.over))
    sections.append(parameters_section(calibration))
    if beside.rungs:
        sections.append(ladder_section(beside.rungs))
    sections += [outliers_section(calibration), provenance_section(calibration)]
    robot = model.robot.title or model.robot.name
    return Page(
        title=f"Calibration of the {robot}",
        sections=tuple(sections),
        lead=f"{len(calibration.kept)} of {len(model)} parameters from {source.rows} rows of {source.campaign or 'a campaign'}. "
        "All lengths are in millimetres.",
        footer=f"Page by Taskcal {version}; calibration by Taskcal {source.version}, {source.created}.",
        header=tuple(beside.header),
    )


def _task(over: Uncertainty) -> Section:
    reach = f" {over.unreachable:.1%} of its poses are out of reach and left out." if over.unreachable else ""
    text = (
        f"Standard deviations over {over.task} in space, root mean square, in the tracker's frame: the measured target is "
        f"known to {over.target * 1e3:.3f} mm, the tool point to {over.after * 1e3:.3f} mm. By the tolerances alone, in the "
        f"robot's own base, the tool point is known to {over.before * 1e3:.3f} mm. Model error comes on top.{reach}"
    )
    difference = (
        "Measurements of a single point say where that point is, not where it sits on the tool. That is found with the fit, so "
        "that the tool point itself is known only as far as the tolerances of tool and last axis say; several targets, or "
        "measured poses, make it sharper."
    )
    chart: Block
    if over.slices:
        chart = Chart(
            title="Uncertainty over the workspace (1σ in space)",
            least_width=700,
            figure=draw_maps(over.slices, over.maps),
            note="Bright is worse: go there with care, or measure more poses there. In the tool orientation of the task's "
            "middle. White: out of the robot's reach there. Each view has its own scale of colours.",
        )
    else:
        chart = Chart(
            title="Uncertainty pose by pose (±1.96σ)",
            figure=draw_bands(over.deviations),
            note="The wider the band, the less is known of the tool there. Along the robot's base axes, about what is predicted.",
        )
    return Section(title="How well the tool is known over the task", blocks=(Text((text, difference)), chart))
