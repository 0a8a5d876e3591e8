"""A calibration as a page and as tables: prediction error, residuals, parameters, uncertainty over a task, provenance."""

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from taskcal.analysis.identifiability import Identifiability, describe_combination, identifiability
from taskcal.analysis.sensitivity import sensitivity
from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.identification.calibration import (
    CORRELATIONS,
    COVERAGE_95,
    Calibration,
    informed_parameters,
    largest_correlations,
    list_stations,
)
from taskcal.identification.held_out import HeldOut, Outlier, Validation, share_inside
from taskcal.identification.residual_analysis import (
    MAX_P_VALUE,
    MIN_SHARE,
    Regressor,
    ResidualAnalysis,
    fit_smooth,
)
from taskcal.identification.uncertainty_budget import COVERAGE_FACTOR, UncertaintyBudget, budget_at
from taskcal.identification.validation import MeasuredErrors, measured_errors
from taskcal.planning.selection import Rung
from taskcal.planning.task_map import TaskUncertainty
from taskcal.registration.registration import Registration
from taskcal.report.camera import camera_section
from taskcal.report.chart import AXIS_COLOURS, BLUE, SERIES, SHAPES, VERMILION, Axis, Figure, Level, Panel, Series
from taskcal.report.content import (
    CALIBRATED,
    MILLIMETRES,
    NOMINAL,
    Block,
    Bullets,
    Chart,
    Column,
    Facts,
    LengthUnit,
    Numbers,
    Section,
    TextTable,
    decimals_of,
    describe_effective,
    millimetres,
    model_error_origin,
    moment,
    prior_scale_origin,
    signed,
)
from taskcal.report.page import Report, edited_entry
from taskcal.report.scene import robot_scene
from taskcal.report.sensitivity import draw_effects
from taskcal.report.task import draw_bands, draw_maps
from taskcal.robot.error_model import EXACT, ErrorModel
from taskcal.robot.parameter import ShownUnit
from taskcal.task.workspace import Workspace
from taskcal_groundwork.said import Said, joined, numeral, term

# Position errors as a publication reports them: per axis of the base, then in space.

ERRORS = (
    *(Column(Said("max {axis} mm", axis=axis), f"max_{axis}_mm", ".3f", optional=True) for axis in "xyz"),
    *(
        Column(Said("{name} mm", name=term(name)), f"{name}_mm", ".3f", optional=True)
        for name in ("max", "mean", "rms", "p95")
    ),
    *(Column(Said("{name} mrad", name=term(name)), f"{name}_mrad", ".3f", optional=True) for name in ("mean", "max")),
    Column(Said("points"), "n", "d", optional=True),
)
"""Columns of a `Validation.summary`."""


def tabulate_errors(
    summaries: Mapping[str, Mapping[str, float | int]], title: str = "", *, of: str = Said("rows"), note: str = ""
) -> TextTable:
    """Tabulate labelled `Validation.summary`s; axes are those of the robot's base.

    Args:
        summaries: by label; columns that none of them has are left out.
        title: of the table; what the columns are by default.
        of: title of the column of labels.
        note: what the table shows.
    """
    rows = [{"label": label, **summary} for label, summary in summaries.items()]
    along_axes = any("max_x_mm" in summary for summary in summaries.values())
    title = title or (
        Said("Position error (base-frame components: maximum; 3D: max, mean, rms, p95), mm")
        if along_axes
        else Said("Error: measured less predicted")
    )
    return TextTable.of(title, (Column(of, "label"), *ERRORS), rows, note=note)


# The result of a calibration in one sentence.


def verdict(
    robot: str,
    before: float,
    after: float,
    held_out: int | None,
    *,
    in_space: bool = True,
    angles: tuple[float, float] | None = None,
    digits: tuple[int, int] = (3, 3),
) -> Said:
    """State how the prediction error changes; the robot itself moves as before until its programs are corrected.

    Args:
        robot: its name.
        before: mean error of the nominal model, registered, millimetres.
        after: of the calibrated model, on the same points.
        held_out: number of held-out points of which these are means; None for fitted ones.
        in_space: whether the errors are distances in space, not those of single numbers such as lengths.
        angles: mean errors of angles that are measured by themselves, before and after, milliradians.
        digits: behind the point, of both errors.
    """
    where = _sample(held_out)
    said = Said(
        "{robot}: {what} {change} from {before} mm, {nominal}, to {after} mm, calibrated ({where}).",
        robot=robot,
        what=Said("the mean 3D prediction error") if in_space else Said("the mean prediction error"),
        change=Said("falls") if after < before else Said("does not fall"),
        before=numeral(before, f".{digits[0]}f"),
        nominal=NOMINAL,
        after=numeral(after, f".{digits[1]}f"),
        where=Said("ratio {ratio:.1f}, {where}", ratio=before / after, where=where) if after > 0.0 else where,
    )
    if angles is None:
        return said
    return Said(
        "{said} Mean error of the angles: {before:.3f} mrad, then {after:.3f} mrad.",
        said=said,
        before=angles[0],
        after=angles[1],
    )


def _sample(held_out: int | None) -> Said:
    """Of which points an error is the mean; None for fitted ones."""
    if held_out is None:
        return Said("fitted rows, optimistic: none were held out")
    return Said("{count} held-out points", count=held_out)


def are_exact(calibration: Calibration) -> bool:
    """Whether no robot is fitted, but poses that are taken as they are given."""
    return bool((calibration.model.tolerances <= EXACT).all())


def state_result(
    calibration: Calibration,
    before: Mapping[str, float | int],
    after: Mapping[str, float | int],
    *,
    name: str = "",
    digits: tuple[int, int] = (3, 3),
) -> Said:
    """State the result of a calibration.

    Args:
        calibration: the calibration.
        before: `Validation.summary` of the nominal model.
        after: of the calibrated one, on the same rows: those held out, or fitted where there are none.
        name: of the robot, where it is not its own.
        digits: behind the point, of both errors.
    """
    name, observed = name or calibration.model.robot.name, calibration.layout.observed
    count = None if calibration.held_out is None else int(after["n"])
    if are_exact(calibration):
        return Said(
            "{name}: the mean 3D error is {mean} mm ({where}), of poses that are taken as they are given.",
            name=name,
            mean=numeral(after["mean_mm"], f".{digits[1]}f"),
            where=_sample(count),
        )
    in_space = all(kind.width - kind.angles in (0, 3) for kind in observed)
    alone = any(kind.width == kind.angles for kind in observed)
    angles = (before["mean_mrad"], after["mean_mrad"]) if alone else None
    return verdict(name, before["mean_mm"], after["mean_mm"], count, in_space=in_space, angles=angles, digits=digits)


def fit_facts(calibration: Calibration) -> list[tuple[str, str]]:
    """State what a fit rests on: model error, prior, and where its targets are; label and text."""
    scale, targets = calibration.prior_scale, calibration.T_tool_target
    origin, given = model_error_origin(calibration), prior_scale_origin(calibration)
    first, *turns = (error * 1e3 for error in calibration.model_error)
    size = Said("{error:.3g} mm", error=first)
    for turn in turns:
        size = Said("{size} and {turn:.3g} mrad", size=size, turn=turn)
    error = Said("{size} per axis (1σ), {origin}", size=size, origin=origin) if any(calibration.model_error) else origin
    prior = Said("no prior") if scale is None else Said("{scale:.3g} times the tolerances", scale=scale)
    prior = joined(", ", [prior, given]) if scale is not None and given else prior
    if calibration.group_deviations is not None and scale is not None:
        prior = Said("estimated for each group of parameters")
    where = zip(calibration.targets, targets, describe_unobservable(calibration.layout.registration), strict=True)
    facts: list[tuple[str, str]] = [(Said("model error"), error)]
    facts += [(Said("prior scale"), prior)] if len(calibration.estimated) else []
    for name, T, unsure in where:
        at = Said("at {place} of the tool frame", place=state_placement(se3.placement(T)))
        facts.append((Said("target {name}", name=name), joined("; ", [at, unsure]) if unsure else at))
    return facts


def state_placement(placed: Mapping[str, Any]) -> Said:
    """State a pose: position in millimetres, and quaternion."""
    position = joined(" ", (numeral(value, ".3f") for value in placed["position_mm"]))
    quaternion = joined(" ", (numeral(value, ".6f") for value in placed["quaternion"]))
    return Said("{position} mm, quaternion {quaternion}", position=position, quaternion=quaternion)


# Held-out rows.

PARTS = {
    "neighbours": Said("groups of neighbouring poses"),
    "blocks": Said("blocks of consecutive rows"),
    "rows": Said("single rows"),
    "chosen": Said("groups of neighbouring poses among the rows that were not chosen"),
}
"""Rows that are held out together, in words."""

MAX_PARTS = 40
"""Parts that a table lists; more fill a page."""


def describe_held_out(held_out: HeldOut) -> Said:
    """State how rows were held out, and how much the parts differ."""
    means = held_out.part_means * 1e3
    kind = PARTS[held_out.by]
    parts = (
        Said("{count} folds of {kind}, each predicted by a fit of the others", count=held_out.folds, kind=kind)
        if held_out.folds
        else Said("{count} {kind}, excluded from the fit", count=len(means), kind=kind)
    )
    mean = Said("{parts}: mean {mean:.3f} mm", parts=parts, mean=held_out.validation.mean * 1e3)
    said = (
        Said("{mean}; a single part has no standard error", mean=mean)
        if len(means) < 2
        else Said(
            "{mean}, standard error {error:.3f} mm; parts from {low:.3f} to {high:.3f} mm",
            mean=mean,
            error=held_out.standard_error * 1e3,
            low=means.min(),
            high=means.max(),
        )
    )
    return said if held_out.inside is None else joined("; ", [said, describe_coverage(held_out.inside)])


def describe_coverage(inside: Float[np.ndarray, "..."]) -> Said:
    """State how many points are in their 95 % regions; NaN for those that have none."""
    share = share_inside(inside)
    if share is None:
        return Said("95 % regions not judged: these rows suffice only to locate what they were measured from")
    return Said(
        "coverage of the 95 % regions {share:.1f} % ({inside} of {count} points)",
        share=100 * share,
        inside=int(np.nansum(inside)),
        count=int(np.isfinite(inside).sum()),
    )


def held_out_section(calibration: Calibration) -> Section:
    """Make the section of held-out rows; an advice where there are none."""
    held_out = calibration.held_out
    if held_out is None:
        advice = Said(
            "No rows were held out, so that the error at other poses is not known: fit residuals underestimate it. Identify with "
            "--holdout 0.3, or with --folds 5, which uses every row."
        )
        return Section(Said("Held-out error"), advice)
    summaries = {NOMINAL: held_out.nominal_validation.summary(), CALIBRATED: held_out.validation.summary()}
    note = Said("The figure to quote. x, y and z are the axes of the robot's base.")
    return Section(
        Said("Held-out error"),
        Said("{said}.", said=describe_held_out(held_out)),
        tabulate_errors(summaries, Said("Position error of held-out rows"), of=Said("model"), note=note),
        _tabulate_parts(held_out) if 1 < len(held_out.part_means) <= MAX_PARTS else None,
    )


def _tabulate_parts(held_out: HeldOut) -> TextTable:
    """Mean and largest error of every part."""
    length = np.linalg.norm(held_out.residuals[..., :3], axis=2)
    parts = [
        (part, own[np.isfinite(own)]) for part in np.unique(held_out.part) for own in (length[held_out.part == part],)
    ]
    columns = (
        Column(Said("fold") if held_out.folds else Said("group"), lambda part: int(part[0]), "d"),
        Column(Said("points"), lambda part: len(part[1]), "d"),
        millimetres(Said("mean mm"), lambda part: part[1].mean()),
        millimetres(Said("max mm"), lambda part: part[1].max()),
    )
    return TextTable.of(
        Said("Part by part"),
        columns,
        [part for part in parts if len(part[1])],
        note=Said(
            "Where one part is much worse than the others, the poses around it are too few, or the robot differs there."
        ),
        folded=True,
    )


def ladder_section(rungs: Sequence[Rung]) -> Section:
    """Make the section of nested models, from the nominal one to all effects."""
    columns = (
        Column(Said("model"), lambda rung: term(rung.name)),
        Column(Said("parameters"), "parameters", "d"),
        millimetres(Said("mean mm"), "mean"),
        millimetres("p95 mm", "p95"),
    )
    chart = Chart(
        Said("Cross-validated error by model stage"),
        draw_ladder_rungs(rungs),
        Said(
            "A bar that is shorter than the one above it: this stage reduces the error. Equal bars: further parameters do not "
            "help. Neighbouring poses are held out together, in five parts."
        ),
    )
    return Section(Said("Error reduction by model stage"), chart, TextTable.of(Said("Nested models"), columns, rungs))


def draw_ladder_rungs(rungs: Sequence[Rung]) -> Figure:
    """Draw a bar for each nested model, with the 95th percentile as a tick."""
    places = range(len(rungs))
    mean = Series(kind="bars", name=Said("mean"), x=[1e3 * rung.mean for rung in rungs], y=places)
    tail = Series(
        name=Said("95th percentile"), shape="tick", colour=VERMILION, x=[1e3 * rung.p95 for rung in rungs], y=places
    )
    names = tuple(Said("{name} ({parameters})", name=term(rung.name), parameters=rung.parameters) for rung in rungs)
    x = Axis(title=Said("cross-validated 3D error"), unit="mm")
    return Figure(panels=(Panel(x=x, y=Axis(categories=names), series=(mean, tail)),))


# Parameters: estimates, or why there is none, and dependence.

MAX_TERMS = 6
"""Terms of a linear dependence that are written out."""


def parameters_section(calibration: Calibration) -> Section:
    """Make the section of parameters."""
    geometry = geometry_of(calibration)
    found = identifiability(geometry, calibration.q)
    estimated = len(calibration.estimated) > 0
    return Section(
        Said("Parameters"),
        Chart(
            Said("Effect of every parameter on the TCP at the measured poses"),
            draw_effects(sensitivity(geometry, calibration.q)),
            Said(
                "Far to the right: a geometric error of one tolerance (1σ) moves the tool far. Near zero: it hardly matters here, "
                "and is poorly determined by these poses. Along the robot's base axes, and in space."
            ),
        ),
        Chart(
            Said("Estimated parameters"),
            draw_parameters({"fit": calibration}),
            Said(
                "Bars are two standard errors. A bar that crosses zero: the geometric error is not significant. Linearly dependent "
                "parameters share the estimate."
            ),
        )
        if estimated
        else None,
        *tabulate_estimates(calibration, found),
        _tabulate_relations(geometry, found) if found.dependent or found.zero else None,
    )


def geometry_of(calibration: Calibration) -> ErrorModel:
    """The model without its effects."""
    return ErrorModel(calibration.model.robot, lengths_only=calibration.model.lengths_only)


def tabulate_estimates(calibration: Calibration, found: Identifiability) -> list[TextTable]:
    """Tabulate what was estimated: harmonics by their amplitudes, every parameter, and correlations.

    Args:
        calibration: the calibration.
        found: linear dependence of the geometry at the fitted poses.
    """
    correlations = [_tabulate_correlations(calibration)] if len(calibration.estimated) else []
    harmonics = tabulate_harmonics(calibration.summary()["parameters"])
    return [harmonics, tabulate_intervals(calibration, found), *correlations]


def with_interval(value: float, uncertainty: float) -> tuple[Said, Said]:
    """A value and its 95 % interval, with the same digits.

    Args:
        value: the best estimate.
        uncertainty: its standard uncertainty.
    """
    digits = decimals_of(uncertainty)
    half = COVERAGE_95 * uncertainty
    low, high = (signed(value + side, digits) for side in (-half, half))
    return signed(value, digits), Said("{low} to {high}", low=low, high=high)


def tabulate_intervals(calibration: Calibration, found: Identifiability) -> TextTable:
    """Tabulate every parameter of the model with its 95 % interval, and whether it was estimated.

    Args:
        calibration: the calibration.
        found: linear dependence of the geometry at the fitted poses.
    """
    informed, estimated = informed_parameters(calibration), set(calibration.estimated.tolist())
    parameters = calibration.model.parameters
    intervals = [
        with_interval(float(value) * p.shown.factor, float(error) * p.shown.factor)
        for p, value, error in zip(parameters, calibration.estimate, calibration.standard_errors, strict=True)
    ]
    columns = (
        Column(Said("parameter"), lambda i: parameters[i].label),
        Column(Said("estimate"), lambda i: intervals[i][0] if i in estimated else Said("0, fixed"), "s"),
        Column(Said("95 % interval"), lambda i: intervals[i][1], "s"),
        Column(Said("tolerance (1σ)"), lambda i: parameters[i].tolerance * parameters[i].shown.factor, ".3g"),
        Column(Said("unit"), lambda i: parameters[i].shown.name),
        Column(
            Said("status"),
            lambda i: _status(parameters[i].name, i in estimated, informed.get(parameters[i].name), found),
        ),
    )
    return TextTable.of(
        Said("All {count} parameters: {estimated} were estimated", count=len(parameters), estimated=len(estimated)),
        columns,
        range(len(parameters)),
        note=Said(
            "Digits are those that the standard error leaves. A parameter that was not estimated is fixed at zero, and counts "
            "with its tolerance in every uncertainty."
        ),
        folded=True,
    )


def _status(name: str, kept: bool, informed: bool | None, found: Identifiability) -> Said:
    """Whether a parameter was estimated, or why not."""
    dependent = name in found.dependent or name in found.zero
    if kept and informed is False:
        return Said("estimated; prior-dominated")
    if kept and dependent:
        return Said("estimated; determined only together with its dependent parameters")
    if kept:
        return Said("estimated")
    if name in found.zero:
        return Said("left out: no effect on the TCP here")
    return Said("left out: linearly dependent here") if dependent else Said("left out by choice")


def _tabulate_relations(model: ErrorModel, found: Identifiability) -> TextTable:
    """Exact linear dependence at the fitted poses."""
    symbols = {p.name: p.symbol or p.name for p in model.parameters}
    rows: list[tuple[str, str]] = [(symbols[name], Said("0: no effect on the TCP")) for name in found.zero]
    for name, terms in found.dependent.items():
        few = dict(sorted(terms.items(), key=lambda one: -abs(one[1]))[:MAX_TERMS])
        said, more = describe_combination(few, symbols), len(terms) - MAX_TERMS
        rows.append((symbols[name], Said("{said} … ({more} more)", said=said, more=more) if more > 0 else said))
    return TextTable.of_rows(
        Said("Linear dependence: {count} parameters equal others at the measured poses", count=len(rows)),
        (Said("a geometric error in"), Said("moves the TCP exactly as")),
        rows,
        text_columns=(0, 1),
        note=Said(
            "No measurement of the TCP at these poses separates the two sides; their estimate is shared in proportion to "
            "the tolerances. Per metre and radian."
        ),
        folded=True,
    )


def _tabulate_correlations(calibration: Calibration) -> TextTable:
    found = largest_correlations(calibration, CORRELATIONS)
    largest = max((round(abs(value), 3) for *_, value in found), default=0.0)
    columns = (
        Column(Said("parameter"), lambda pair: pair[0]),
        Column(Said("and"), lambda pair: pair[1]),
        Column(Said("correlation"), lambda pair: signed(pair[2], 3), "s"),
    )
    return TextTable.of(
        Said("Largest correlations of the estimated parameters"),
        columns,
        found,
        note=Said(
            "The nearer to 1, the less the two are determined individually; the largest here is {largest:.3f}. Predictions "
            "account for it.",
            largest=largest,
        ),
        folded=True,
    )


MAX_HARMONICS = 12
"""Harmonics that are shown, the strongest."""

_HARMONIC = re.compile(r"(.+)\.(?:cos|sin)(\d+(?:\.\d+)?)$")
"""Name of a cosine or sine of a joint's angle."""


def strongest_harmonics(parameters: Sequence[Mapping[str, Any]]) -> list[tuple[str, float, float, float]]:
    """Joint, order, amplitude and its standard error, mrad, of the harmonics, largest first."""
    parts: dict[tuple[str, float], list[Mapping[str, Any]]] = defaultdict(list)
    for parameter in parameters:
        match = _HARMONIC.match(parameter["name"])
        if match is not None:
            parts[match[1], float(match[2])].append(parameter)
    harmonics: list[tuple[str, float, float, float]] = []
    for (joint, order), (a, b) in ((key, pair) for key, pair in parts.items() if len(pair) == 2):
        x, y = a["estimate_mrad"], b["estimate_mrad"]
        size = (x**2 + y**2) ** 0.5
        errors = a["standard_error_mrad"], b["standard_error_mrad"]
        spread = ((x * errors[0]) ** 2 + (y * errors[1]) ** 2) ** 0.5 / size if size else max(errors)
        harmonics.append((joint, order, size, spread))
    return sorted(harmonics, key=lambda row: -row[2])


def tabulate_harmonics(parameters: Sequence[Mapping[str, Any]]) -> TextTable:
    """Tabulate the strongest harmonics."""
    harmonics = strongest_harmonics(parameters)
    shown = harmonics[:MAX_HARMONICS]
    columns = (
        Column(Said("joint"), lambda row: row[0]),
        Column(Said("periods per turn"), lambda row: row[1], "g"),
        Column(Said("amplitude mrad"), lambda row: row[2], ".4f"),
        Column("1σ mrad", lambda row: row[3], ".4f"),
    )
    title = Said(
        "Harmonics of the joint angles: the {count} strongest of {every}", count=len(shown), every=len(harmonics)
    )
    return TextTable.of(title, columns, shown, folded=True)


MAX_DRAWN = 40
"""Parameters of a unit that are drawn; more would hide those that matter."""


def draw_parameters(
    calibrations: Mapping[str, Calibration], truth: Float[np.ndarray, " p"] | None = None
) -> Mapping[str, Figure]:
    """Draw estimated parameters with two standard errors, beside the truth where it is known.

    Args:
        calibrations: calibrations of one model, each a view.
        truth: the true parameters, metres and radians.
    """
    return {label: _draw_estimates(one, truth) for label, one in calibrations.items()}


def _draw_estimates(calibration: Calibration, truth: Float[np.ndarray, " p"] | None) -> Figure:
    model = calibration.model
    groups: dict[tuple[bool, ShownUnit], list[int]] = {}  # one scale each: lengths and angles, then units of effects
    for i, parameter in enumerate(model.parameters):
        groups.setdefault((parameter.name in model.effect_names, parameter.shown), []).append(i)
    errors = calibration.standard_errors
    clear = np.abs(calibration.estimate) / np.where(errors > 0.0, errors, np.inf)
    panels: list[Panel] = []
    for (effect, unit), every in groups.items():
        columns = sorted(sorted(every, key=lambda i: -clear[i])[:MAX_DRAWN])
        title = (
            Said("effects in {unit}", unit=unit.name)
            if effect
            else {"mm": Said("lengths"), "mrad": Said("angles")}[unit.name]
        )
        if len(columns) < len(every):
            title = Said(
                "{title}: {count} of {every}, those largest over their standard errors",
                title=title,
                count=len(columns),
                every=len(every),
            )
        places, labels = range(len(columns)), [model.parameters[i].name for i in columns]
        value, half = calibration.estimate[columns] * unit.factor, 2.0 * errors[columns] * unit.factor
        name = Said("estimate, two standard errors")
        series = [Series(name=name, x=value, y=places, low=value - half, high=value + half, labels=labels)]
        if truth is not None:
            true = truth[columns] * unit.factor
            series.append(
                Series(
                    name=Said("truth"), x=true, y=places, labels=labels, hollow=True, colour=VERMILION, shape="diamond"
                )
            )
        x = Axis(title=Said("effect") if effect else Said("geometric error"), unit=unit.name)
        names = tuple(model.parameters[i].symbol or model.parameters[i].name for i in columns)
        zero = Level(at=0.0, name="", along="x")
        panels.append(Panel(title=title, x=x, y=Axis(categories=names), series=tuple(series), levels=(zero,)))
    return Figure(panels=tuple(panels), columns=2)


# Provenance.


def provenance_section(calibration: Calibration) -> Section:
    """Make the section of provenance."""
    source, registration = calibration.provenance, calibration.layout.registration
    found = [term(registration.method), *filter(None, [registration.file])]
    rows: list[tuple[str, str]] = [
        (Said("robot"), source.robot),
        (Said("robot file, digest"), source.robot_digest),
        (Said("effects"), ", ".join(effect.name for effect in calibration.model.effects) or Said("none")),
        (Said("campaign"), source.campaign),
        (Said("campaign, digest"), source.campaign_digest),
        *((Said("campaign, as read"), note) for note in source.notes),
        (Said("rows"), str(source.rows)),
        (Said("registration"), Said("from {found}", found=joined(", ", found))),
        (Said("made"), moment(source.created)),
        (Said("by Taskcal"), source.version),
        *((str(key), say_option(value)) for key, value in source.options.items()),
        (Said("ended"), state_end(calibration.reason, calibration.iterations, calibration.rounds)),
    ]
    return Section(
        Said("Provenance"),
        TextTable.of_rows(Said("Provenance"), (Said("entry"), Said("value")), rows, text_columns=(0, 1)),
    )


def state_end(reason: str, iterations: int, rounds: int) -> Said:
    """State how a fit ended."""
    return Said(
        "{reason}; {iterations} iterations in the last of {rounds} rounds",
        reason=term(reason),
        iterations=iterations,
        rounds=rounds,
    )


def say_option(value: object) -> str:
    """Say the value of an option of a fit."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {item}" for key, item in value.items())  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list | tuple):
        return ", ".join(str(item) for item in value) or "none"  # pyright: ignore[reportUnknownVariableType]
    return str(value)


# Analysis of the residuals.

MAX_REGRESSORS = 8
"""Quantities that can be chosen in a figure."""

MIN_LEVERAGE = 0.3
"""Share of the largest movement by a turn, below which a pose does not determine that turn."""


def residual_analysis_section(analysis: ResidualAnalysis) -> Section:
    """Make the section of the residual analysis."""
    numbers = [
        (f"{analysis.rms * 1e3:.3f}", "mm", "3D residual (rms, mean of the targets)"),
        (f"{analysis.tracker * 1e3:.3f}", "mm", "expected of the tracker's noise alone"),
    ]
    if analysis.non_rigid is not None and analysis.rigid is not None:
        numbers += [
            (f"{analysis.rigid * 1e3:.3f}", "mm", "per coordinate: motion of all targets as one body (rms)"),
            (f"{analysis.non_rigid * 1e3:.3f}", "mm", "per coordinate: motion of targets against each other (rms)"),
        ]
    method = (
        f"A smooth function of each quantity is fitted to the residuals of {len(analysis.residual)} poses and predicts those of "
        "held-out poses. p is the probability of such a share if the quantity does not matter, by permutation among the poses."
    )
    judged = any(e.p_value is not None for e in analysis.explained)
    columns = (
        Column(Said("quantity"), lambda e: e.regressor.name),
        Column(Said("moves"), lambda e: e.regressor.moves),
        Column(Said("share"), lambda e: f"{round(100 * e.share, 1) + 0.0:.1f} %", "s"),
        Column("p", "p_value", ".2g"),
    )
    return Section(
        Said("Residual analysis"),
        method,
        Numbers(*numbers),
        Bullets(*_findings(analysis)),
        Chart(
            Said("Residual variance explained, by quantity"),
            draw_shares(analysis),
            "Each quantity by itself; correlated quantities share what they explain. Empty: not significant, as chance "
            f"gives as much more often than once in {1 / MAX_P_VALUE:.0f} or the share is under {100 * MIN_SHARE:.0f} %.",
        )
        if judged
        else None,
        Chart(
            Said("Residual against each quantity"),
            draw_against(analysis),
            Said("Turns are those of the joint that the measured points require, at poses that determine them."),
        )
        if analysis.explained
        else None,
        TextTable.of(
            f"Residual variance explained, by quantity: all {len(analysis.explained)}",
            columns,
            analysis.explained,
            note=Said("Share of the variance on held-out poses; below zero, the quantity predicts worse than none."),
            folded=True,
        ),
    )


def _findings(analysis: ResidualAnalysis) -> tuple[str, ...]:
    """The significant quantities in sentences."""
    proven = [e for e in analysis.explained if e.proven]
    out = [
        f"{e.regressor.name}, by the {e.regressor.moves}: {100 * e.share:.0f} % of the variance." for e in proven[:5]
    ]
    if not proven:
        out = [f"No tested quantity explains {100 * MIN_SHARE:.0f} % of it significantly."]
    if analysis.non_rigid is not None and analysis.rigid is not None and analysis.rigid > 3.0 * analysis.non_rigid:
        out.append(
            "The targets move as one body: the residual is motion of the robot or its stand, not of single readings."
        )
    return tuple(out)


def draw_shares(analysis: ResidualAnalysis) -> Figure:
    """Draw the share of the residual variance that goes with each quantity; empty where it is not significant."""
    rows = [e for e in analysis.explained if e.p_value is not None]
    names = tuple(f"{e.regressor.name}: {e.regressor.moves}" for e in rows)
    bars = Series(
        kind="bars",
        x=[100.0 * e.share for e in rows],
        y=range(len(rows)),
        hollow=[not e.proven for e in rows],
        labels=[f"{name}, p {e.p_value:.2g}" for name, e in zip(names, rows, strict=True)],
    )
    x = Axis(title=Said("share of the variance on held-out poses"), unit="%")
    return Figure(panels=(Panel(x=x, y=Axis(categories=names), series=(bars,)),))


def draw_against(analysis: ResidualAnalysis) -> Mapping[str, Figure]:
    """Draw the residual along the direction of each of the first quantities, against it, with the fitted smooth."""
    views: dict[str, Figure] = {}
    for regressor in [e.regressor for e in analysis.explained[:MAX_REGRESSORS]]:
        along, seen, unit = _along(regressor, analysis.residual)
        smooth = fit_smooth(regressor, analysis.residual) * 1e3
        u = regressor.values[:, 0] * regressor.scale
        order = np.argsort(u, kind="stable")
        curve = regressor.values.shape[1] == 1 and regressor.smooth
        names = list(AXIS_COLOURS) if along.shape[1] == 3 else [regressor.moves]
        series: list[Series] = []
        for d, name in enumerate(names):
            colour, own = AXIS_COLOURS.get(name, BLUE), seen[:, d]
            over = colour if len(names) > 1 else VERMILION
            series += [
                Series(name=name, x=u[own], y=along[own, d], colour=colour, shape=SHAPES[d], rows=np.flatnonzero(own).tolist()),
                Series(
                    kind="line" if curve else "points", name=f"{name}, fitted", x=u[order], y=smooth[order, d], colour=over,
                    shape="" if curve else "cross",
                ),
            ]  # fmt: skip
        x = Axis(title=regressor.name, unit=regressor.unit)
        panel = Panel(x=x, y=Axis(title=Said("residual"), unit=unit), series=tuple(series), height=320.0)
        views[f"{regressor.name} ({regressor.unit})"] = Figure(panels=(panel,))
    return views


def _along(
    regressor: Regressor, residual: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n directions"], Bool[np.ndarray, "n directions"], str]:
    """Movement along each direction that each pose's residual asks for, milli; where the pose determines it; its unit."""
    square = (regressor.carrier**2).sum(axis=1)
    along = np.einsum("nij,ni->nj", regressor.carrier, residual) / np.maximum(square, 1e-12)
    unit = "mrad" if regressor.moves.startswith("turn") else "mm"
    return 1e3 * along, square >= MIN_LEVERAGE**2 * square.max(axis=0), unit


# Where the fitted rows were measured.


def range_section(calibration: Calibration) -> Section:
    """Make the section of the joint range that was measured."""
    return Section(
        Said("Measured range"),
        Said(
            "Predictions and corrections inside this range interpolate between measured poses. Outside of it they extrapolate, and "
            "their uncertainty grows: measure there before you rely on them."
        ),
        tabulate_range(calibration),
    )


def tabulate_range(calibration: Calibration) -> TextTable:
    """Tabulate the measured range of every joint, beside its limits."""
    robot, measured = calibration.model.robot, calibration.measured_range

    def limits(j: int) -> str:
        return measured.interval(j, *robot.limits[j]) if np.isfinite(robot.limits[j]).all() else Said("none")

    columns = (
        Column(Said("joint"), lambda j: robot.joint_names[j]),
        Column(Said("measured"), measured.describe, "s"),
        Column(Said("limits"), limits, "s"),
    )
    return TextTable.of(Said("Joint range of the fitted rows"), columns, range(len(robot.joints)))


# Residuals of the fitted rows.


def residuals_section(calibration: Calibration, errors: MeasuredErrors | None) -> Section:
    """Make the section of fit residuals.

    Args:
        calibration: the calibration.
        errors: at the fitted rows; None where their joint positions are not known.
    """
    kinds = calibration.layout.observed
    along = not kinds or kinds[0].along_axes
    axes = Said("Along the robot's base axes") if along else Said("Along the sensor's axes")
    if kinds and not along and kinds[0].width == 1:
        axes = Said("The one number that was read")
    blocks: list[Block] = [] if errors is None else _error_charts(calibration, errors)
    blocks.insert(
        0,
        Chart(
            Said("Measured less predicted, target {target}", target=calibration.targets[0]),
            draw_residuals({calibration.provenance.campaign or Said("the campaign"): {"fit": calibration}}),
            Said(
                "A band about zero without steps, drifts or waves: the residuals look like chance. A step: something moved. "
                "{axes}, pose by pose.",
                axes=axes,
            ),
        ),
    )
    note = Said(
        "Fit residuals underestimate the error; quote the held-out error. x, y and z are the axes of the robot's base."
    )
    summaries = residuals_by_target(calibration)
    blocks.append(tabulate_errors(summaries, Said("Residuals of the fitted rows"), of=Said("target"), note=note))
    return Section(Said("Fit residuals"), *blocks)


def residuals_by_target(calibration: Calibration) -> dict[str, dict[str, float | int]]:
    """`Validation.summary` of the residuals of each target that was seen; of one that angles alone are measured of, no lengths."""
    base, kinds, residuals = calibration.T_tracker_base[:3, :3], calibration.layout.observed, calibration.residuals
    summaries = {
        name: Validation.of_residuals(residuals[:, [t]], base, kinds[t : t + 1]).summary()
        for t, name in enumerate(calibration.targets)
        if not np.isnan(residuals[:, t]).all()
    }
    angles = {name for name, kind in zip(calibration.targets, kinds, strict=True) if kind.width == kind.angles}
    return {
        name: {key: value for key, value in summary.items() if name not in angles or not key.endswith("_mm")}
        for name, summary in summaries.items()
    }


def _error_charts(calibration: Calibration, errors: MeasuredErrors) -> list[Block]:
    return [
        Chart(
            Said("Residuals along each axis, by target"),
            draw_by_axis(calibration, errors),
            Said(
                "Boxes about zero and alike: no axis and no target stands out. A box off zero: this target, or this "
                "direction, is measured differently. Half of the values are in the box; single points are far out."
            ),
        ),
        Chart(
            Said("Residuals against joint angle"),
            draw_over_joints(calibration, errors),
            Said("A trend or wave indicates an error of this joint; a flat scatter does not."),
        ),
        Chart(
            Said("Error against the rotation of the tool"),
            draw_over_orientation(calibration, errors),
            Said(
                "A circle for every measured pose, of several targets the worst; a circle among the crosses is a pose at which the "
                "calibration does not reduce the error. Circles that rise to the right: the error grows with the rotation; then "
                "measure more orientations. Most campaigns have few poses far to the right."
            ),
        ),
    ]


def draw_residuals(
    calibrations: Mapping[str, Mapping[str, Calibration]], start: str = "", unit: LengthUnit = MILLIMETRES
) -> Mapping[str, Figure]:
    """Draw residuals of a target, pose by pose: in base axes, the sensor's, or the one number that was read.

    It is the first target of which lengths were measured.

    Args:
        calibrations: a panel for each campaign, in it the models to choose from, in the same order in all.
        start: beginning of the name of the model that is shown first; the last by default.
        unit: of the residuals.
    """
    models = [list(panel) for panel in calibrations.values()]
    first = next((m for m, name in enumerate(models[0]) if start and name.startswith(start)), len(models[0]) - 1)
    views: dict[str, Figure] = {}
    for m in sorted(range(len(models[0])), key=lambda m: m != first):
        chosen = {label: list(panel.values())[m] for label, panel in calibrations.items()}
        # models of several campaigns may differ in their count of parameters
        name = " / ".join(dict.fromkeys(names[m] for names in models))
        views[name] = Figure(panels=tuple(_residual_panel(label, one, unit) for label, one in chosen.items()))
    if len(calibrations) == 1:
        views = {name: replace(one, panels=(replace(one.panels[0], title=""),)) for name, one in views.items()}
    return views


def _residual_panel(campaign: str, calibration: Calibration, unit: LengthUnit) -> Panel:
    values = _first_residuals(calibration) * unit.factor
    several = values.shape[1] > 1
    series = tuple(
        Series(
            name=letter if several else "",
            x=np.arange(1, len(values) + 1),
            y=values[:, k],
            colour=colour,
            shape=SHAPES[k],
            labels=[Said("pose {n}, id {name}", n=n, name=name) for n, name in enumerate(calibration.ids, start=1)],
            rows=range(len(values)),
        )
        for k, (letter, colour) in enumerate(list(AXIS_COLOURS.items())[: values.shape[1]])
    )
    y = Axis(title=Said("residual"), unit=unit.name)
    return Panel(
        title=Said("measured in {campaign}", campaign=campaign), x=Axis(title=Said("measured pose")), y=y, series=series
    )


def _first_residuals(calibration: Calibration) -> Float[np.ndarray, "n axes"]:
    """Residuals of the first target of which lengths were measured, metres."""
    kinds = calibration.layout.observed
    first = next((t for t, kind in enumerate(kinds) if kind.width > kind.angles), 0)
    residual = calibration.residuals[:, first, :3]
    if not kinds or kinds[first].along_axes:
        return residual @ calibration.T_tracker_base[:3, :3]
    return residual[:, : kinds[first].width - kinds[first].angles]


def draw_histogram(before: Validation | None, after: Validation, tolerances: Mapping[str, float]) -> Figure:
    """Draw how many points have which error, nominal and calibrated, with tolerances, metres."""
    models = {NOMINAL: before, CALIBRATED: after}
    errors = {name: _lengths(one) for name, one in models.items() if one is not None}
    top = max(float(max(values.max(initial=0.0) for values in errors.values())), 1e-6)
    count = int(np.clip(np.sqrt(len(errors[CALIBRATED])) * 2, MIN_BINS, MAX_BINS))
    edges = np.linspace(0.0, top * (1.0 + 1e-9), count + 1)
    series = tuple(
        Series(
            kind="steps",
            name=name,
            x=edges,
            y=np.histogram(values, edges)[0],
            colour=VERMILION if name == NOMINAL else BLUE,
            dash=name == NOMINAL,
        )
        for name, values in errors.items()
    )
    levels = tuple(Level(at=at * 1e3, name=name, along="x") for name, at in tolerances.items())
    x = Axis(title=Said("3D error") if after.in_space else Said("error"), unit="mm", zero=True)
    return Figure(panels=(Panel(x=x, y=Axis(title=Said("points"), zero=True), series=series, levels=levels),))


def _lengths(errors: Validation) -> Float[np.ndarray, " n"]:
    """Errors that are lengths, millimetres; where there is none, all."""
    chosen = np.isfinite(errors.errors)
    if errors.lengths is not None and (chosen & errors.lengths).any():
        chosen &= errors.lengths
    return errors.errors[chosen] * 1e3


MIN_BINS, MAX_BINS = 12, 40
"""Of a histogram, which has about twice the square root of the number of points: the long tail of the nominal errors takes half."""


def draw_over_orientation(calibration: Calibration, errors: MeasuredErrors) -> Figure:
    """Draw the 3D error over the tool's rotation from its mean orientation, nominal and calibrated; the worst target counts."""
    turned = turn_from_mean(calibration.model.poses(errors.q)[:, :3, :3])
    series: list[Series] = []
    for name, values, colour, shape in (
        (NOMINAL, errors.before, VERMILION, "x"),
        (CALIBRATED, errors.after, BLUE, "circle"),
    ):
        length = 1e3 * np.linalg.norm(values[..., :3], axis=2)
        length = np.where(np.isfinite(length), length, -1.0).max(axis=1)  # the worst of the targets that were seen
        seen = np.where(length >= 0.0, length, np.nan)
        labels = [Said("id {name}", name=name) for name in calibration.ids]
        series.append(
            Series(name=name, x=turned, y=seen, colour=colour, shape=shape, labels=labels, rows=range(len(seen)))
        )
    x = Axis(title=Said("rotation of the tool from its mean orientation"), unit="°", zero=True)
    return Figure(panels=(Panel(x=x, y=Axis(title=Said("3D error"), unit="mm", zero=True), series=tuple(series)),))


def turn_from_mean(rotations: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, " n"]:
    """Angle of each orientation from the mean of all, degrees."""
    mean = se3.nearest_rotation(rotations.mean(axis=0))
    return np.degrees(np.linalg.norm(se3.log(mean.T @ rotations), axis=1))


def draw_over_joints(calibration: Calibration, errors: MeasuredErrors) -> Figure:
    """Draw the 3D residual over each joint's position."""
    robot, targets = calibration.model.robot, calibration.targets
    length = np.linalg.norm(errors.after[..., :3], axis=2) * 1e3
    position = errors.q * np.where(robot.prismatic, 1e3, 180.0 / np.pi)
    several = len(targets) > 1
    panels = tuple(
        Panel(
            x=Axis(title=name, unit="mm" if slides else "°"),
            y=Axis(title=Said("residual"), unit="mm", zero=True),
            height=170.0,
            series=tuple(
                Series(
                    name=target if several else "",
                    x=position[:, k],
                    y=length[:, t],
                    colour=SERIES[(t + 1) % len(SERIES)],
                    shape=SHAPES[t % len(SHAPES)],
                    labels=[Said("id {name}", name=name) for name in calibration.ids],
                    rows=range(len(length)),
                )
                for t, target in enumerate(targets)
            ),
        )
        for k, (name, slides) in enumerate(zip(robot.joint_names, robot.prismatic, strict=True))
    )
    return Figure(panels=panels, columns=3, shared="y")


def draw_by_axis(calibration: Calibration, errors: MeasuredErrors) -> Figure:
    """Draw the spread of the residuals along the axes of the robot's base, a box for each target."""
    targets = [t for t in range(len(calibration.targets)) if np.isfinite(errors.after[:, t, 0]).any()]
    series = tuple(
        Series(
            kind="boxes",
            name=calibration.targets[t],
            x=errors.after[:, t, :3].ravel() * 1e3,
            y=np.tile(np.arange(3), len(errors.q)),
            colour=SERIES[(t + 1) % len(SERIES)],
        )
        for t in targets
    )
    x = Axis(title=Said("measured less predicted"), unit="mm")
    zero = Level(at=0.0, name="", along="x")
    return Figure(panels=(Panel(x=x, y=Axis(categories=("X", "Y", "Z")), series=series, levels=(zero,)),))


# Outliers, each with its likely cause.

MODEL, READING = Said("model error"), Said("reading")
"""Likely causes of an outlier."""

SHARED_ERROR = Said(
    "Model error: neighbouring rows or poses have similar errors, so that measuring again does not help; fit effects "
    "(--effects auto), or measure more poses there. Where something moved for a while, taskcal doctor finds it."
)
SINGLE_ERROR = Said("Reading: isolated among its neighbours; measure again, or leave out.")
MOSTLY_OUTLIERS = Said(
    "Most points are outliers, so that no single row is at fault: the model error exceeds the stated one, or robot, target or "
    "tracker frame are not those that were calibrated."
)
COUNTED = Said("Rows of the campaign, counted from 0, and lines of its file, counted from 1.")


def tabulate_outliers(calibration: Calibration) -> TextTable:
    """Tabulate outliers of the fit, and whether the reading or the model is at fault."""
    mostly = are_most(len(calibration.outliers), int(np.isfinite(calibration.studentised).sum()))
    return tabulate_judged(calibration.outliers, calibration.shared_outliers, Said("residual mm"), mostly=mostly)


def tabulate_judged(
    outliers: Sequence[Outlier], shared: Sequence[bool], length: str, *, mostly: bool, count: int | None = None
) -> TextTable:
    """Tabulate outliers, each with its likely cause.

    Args:
        outliers: the worst first.
        shared: whether neighbours have the same error, of each.
        length: title of the column with the length of the error.
        mostly: whether most points are outliers, so that none of them is at fault.
        count: how many are listed; all by default.
    """
    causes = ["" if mostly else MODEL if alike else READING for alike in shared]
    remedies = {MODEL: SHARED_ERROR, READING: SINGLE_ERROR, "": MOSTLY_OUTLIERS}
    columns = (
        Column(Said("row"), lambda judged: judged[0].row, "d"),
        Column(Said("line"), lambda judged: judged[0].line, "d"),
        Column(Said("id"), lambda judged: judged[0].id),
        Column(Said("target"), lambda judged: judged[0].target),
        millimetres(length, lambda judged: judged[0].residual),
        Column(Said("error / 1σ"), lambda judged: judged[0].studentised, ".1f"),
        Column(Said("likely cause"), lambda judged: judged[1]),
    )
    rows = list(zip(outliers, causes, strict=True))[:count]
    title = Said("Outliers (significance level 1 % for the campaign)")
    if len(rows) < len(outliers):
        title = Said("{title}, the {count} worst of {every}", title=title, count=len(rows), every=len(outliers))
    note = joined(" ", [COUNTED, *(remedies[cause] for cause in dict.fromkeys(causes))])
    return TextTable.of(title, columns, rows, note=note)


def are_most(outliers: int, points: int) -> bool:
    """Whether outliers are more than half of the points: then the stated uncertainty is wrong, not they."""
    return 2 * outliers > points


def describe_outliers(shared: Sequence[bool], *, mostly: bool) -> Said:
    """Count outliers by their cause, with what to do about them."""
    alone, alike = sum(not one for one in shared), sum(shared)
    if not shared:
        return Said("none")
    count = Said("{count} outliers", count=len(shared)) if len(shared) > 1 else Said("1 outlier")
    if mostly:
        return Said("{count}. {why}", count=count, why=MOSTLY_OUTLIERS)
    causes = (
        [Said("{count} with similar errors nearby: {cause}, do not measure again", count=alike, cause=MODEL)]
        if alike
        else []
    )
    causes += [Said("{count} isolated: measure again, or leave out", count=alone)] if alone else []
    return joined(", ", [count, joined("; ", causes)])


def tabulate_left_out(calibration: Calibration) -> TextTable:
    """Tabulate rejected rows, which contradict all others."""
    columns = (
        Column(Said("row"), "row", "d"),
        Column(Said("line"), "line", "d"),
        Column(Said("id"), "id"),
        millimetres(Said("error mm"), "distance", ".2f"),
        Column(Said("error / 1σ"), "studentised", ".0f"),
    )
    title = Said("Gross errors, rejected: measure these rows again")
    return TextTable.of(title, columns, calibration.left_out, note=COUNTED)


def tabulate_stations(calibration: Calibration) -> TextTable:
    """Tabulate where a tracker stood that was moved; empty where no station is named."""
    columns = (
        Column(Said("station"), "name"),
        Column(Said("rows"), "rows", "d"),
        *(Column(f"{axis} mm", lambda one, k=k: one["position_mm"][k], ".3f") for k, axis in enumerate("xyz")),
        *(Column(f"1σ {axis} mm", lambda one, k=k: one["standard_error_mm"][k], ".3f") for k, axis in enumerate("xyz")),
        *(
            Column(f"1σ r{axis} mrad", lambda one, k=k: one["standard_error_mrad"][k], ".4f")
            for k, axis in enumerate("xyz")
        ),
    )
    note = Said(
        "Origin of the robot's base in the tracker frame of each station; 1σ along and about its axes, geometry unknown."
    )
    return TextTable.of(Said("Stations of the tracker"), columns, list_stations(calibration), note=note)


# Target offsets that the poses do not determine.

MAX_UNDETERMINED = 1e-6
"""Share of a direction that counts as absent: of projectors, whose rounding is of the order of 1e-9."""


def describe_unobservable(registration: Registration) -> tuple[str, ...]:
    """Describe non-identifiable target offsets and the values assumed for them; empty for a target that is determined.

    In directions that the poses do not determine, the target, or the mean of all targets, is held at the TCP. In
    the others it is estimated, however far away it is.
    """
    sentence = _describe_common(registration.unobservable)
    return tuple("" if located else sentence for located in registration.located)


def _describe_common(unlocated: Float[np.ndarray, "offsets offsets"]) -> str:
    count = len(unlocated) // 3
    directions = np.einsum("tisj->ij", unlocated.reshape(count, 3, count, 3)) / count
    common = np.kron(np.full((count, count), 1.0 / count), directions)
    if not np.allclose(common, unlocated, atol=MAX_UNDETERMINED):
        return Said(
            "offset not identifiable in every direction from these poses; there held as near to the TCP as possible"
        )
    what = Said("offset") if count == 1 else Said("common offset of all targets")
    values, vectors = np.linalg.eigh(directions)
    rank = int((values > 0.5).sum())
    if rank == 3:
        return Said("{what} not identifiable from these poses; held at the TCP", what=what)
    along, across = (_axis(vectors[:, k]) for k in (-1, 0))
    where = Said("along {axis}", axis=along) if rank == 1 else Said("across {axis}", axis=across)
    return Said(
        "{what} not identifiable {where} of the tool from these poses; held at the TCP there", what=what, where=where
    )


def _axis(direction: Float[np.ndarray, " 3"]) -> str:
    """A direction in the tool frame, by the name of an axis where it is one."""
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) > 1.0 - MAX_UNDETERMINED:
        return "xyz"[largest]
    return "({:.2f} {:.2f} {:.2f})".format(*(direction * np.sign(direction[largest]) + 0.0))


# Summary: the verdict, four numbers, and what needs attention.


QUANTILE_ERROR = 2.1
"""Standard error of a 95th percentile over that of the mean, of normal errors: √(0.05 · 0.95) / φ(1.645), for a quantile's variance
is p (1 − p) / (n f²)."""


def summary_section(
    calibration: Calibration,
    errors: MeasuredErrors | None,
    over: TaskUncertainty | None,
    judged: Mapping[str, Any] | None = None,
    space: Workspace | None = None,
) -> Section:
    """Make the first section.

    Args:
        calibration: the calibration.
        errors: at the fitted rows; None where they are not known.
        over: uncertainty over a task, if one was named.
        judged: the verdict, which has the tolerances, as `Verdict.summary` has it.
        space: the task's workspace.
    """
    before, after = _before_after(calibration, errors)
    held_out = calibration.held_out
    sample = Said("held-out rows") if held_out is not None else Said("fitted rows")
    what = Said("mean 3D prediction error") if after.in_space else Said("mean prediction error")
    robot, said, nominal = calibration.model.robot, None, None
    doubt = _standard_error(after, held_out)
    worth, tail = (decimals_of(factor * doubt * 1e3) for factor in (1.0, QUANTILE_ERROR))
    if before is not None:
        worth_before = decimals_of(_standard_error(before, None) * 1e3)
        told = (before.summary(), after.summary())
        said = state_result(calibration, *told, name=robot.title, digits=(worth_before, worth))
        of_nominal = Said("{what} of the nominal model (registered), {sample}", what=what, sample=sample)
        nominal = (numeral(before.mean * 1e3, f".{worth_before}f"), "mm", of_nominal)
    return Section(
        Said("Summary"),
        said,
        Numbers(
            nominal,
            (
                numeral(after.mean * 1e3, f".{worth}f"),
                "mm",
                Said("{what} of the calibrated model, {sample}", what=what, sample=sample),
            ),
            (
                numeral(after.p95 * 1e3, f".{tail}f"),
                "mm",
                Said("95th percentile of the error, {sample}", sample=sample),
            ),
            (numeral(after.maximum * 1e3, f".{tail}f"), "mm", Said("largest error, {sample}", sample=sample))
            if over is None
            else (
                numeral(over.target * 1e3, f".{decimals_of(over.target * 1e3)}f"),
                "mm",
                Said("standard uncertainty of the target over {task} (3D, rms)", task=over.task),
            ),
        ),
        None if errors is None else robot_scene(calibration, errors, space),
        Chart(
            Said("Error of the {sample}, nominal and calibrated", sample=sample),
            draw_histogram(before, after, _tolerances(judged)),
            Said(
                "The farther left, the better. Points beyond a tolerance miss it by themselves; the verdict judges the rms over "
                "the task."
            ),
        ),
        Bullets(*remarks) if (remarks := _remarks(calibration)) else None,
        Facts(*fit_facts(calibration)),
        tabulate_stations(calibration) if calibration.stations else None,
    )


def _standard_error(errors: Validation, held_out: HeldOut | None) -> float:
    """Of the mean error, metres: from the scatter of the parts that were held out, or of the points."""
    by_part = held_out.standard_error if held_out is not None else np.nan
    return by_part if np.isfinite(by_part) else float(np.nanstd(errors.errors)) / np.sqrt(max(len(errors), 1))


def _tolerances(judged: Mapping[str, Any] | None) -> dict[str, float]:
    """Tolerances by their names, metres."""
    stated = {one["subject"]: one["tolerance_mm"] for one in (judged or {"judgements": ()})["judgements"]}
    found = {subject: tolerance * 1e-3 for subject, tolerance in stated.items() if tolerance is not None}
    if len(set(found.values())) == 1:
        return {Said("tolerance"): next(iter(found.values()))}
    return {
        Said("tolerance of the {subject}", subject=term(subject)): tolerance for subject, tolerance in found.items()
    }


def outliers_section(calibration: Calibration) -> Section:
    """Make the section of rejected rows and outliers."""
    tables = [one for one in (tabulate_left_out(calibration), tabulate_outliers(calibration)) if len(one)]
    return Section(Said("Outliers"), *(tables or [Said("No outliers and no rejected rows.")]))


def _before_after(calibration: Calibration, errors: MeasuredErrors | None) -> tuple[Validation | None, Validation]:
    """Errors before and after: on held-out rows where there are any."""
    held_out = calibration.held_out
    if held_out is not None:
        return held_out.nominal_validation, held_out.validation
    base, kinds = calibration.T_tracker_base[:3, :3], calibration.layout.observed
    if errors is not None:
        before, after = (Validation.of_residuals(one, np.eye(3), kinds) for one in (errors.before, errors.after))
        return before, after
    return None, Validation.of_residuals(calibration.residuals, base, kinds)


def _remarks(calibration: Calibration) -> tuple[str, ...]:
    """Statements that need attention."""
    outliers, rejected = len(calibration.outliers), len(calibration.left_out)
    told = [term(f"{remark[0].upper()}{remark[1:].rstrip('.')}.") for remark in calibration.remarks]
    if rejected == 1:
        told.append(Said("1 row rejected as a gross error: see Outliers."))
    elif rejected:
        told.append(Said("{count} rows rejected as gross errors: see Outliers.", count=rejected))
    if outliers:
        mostly = are_most(outliers, int(np.isfinite(calibration.studentised).sum()))
        said = describe_outliers(calibration.shared_outliers, mostly=mostly)
        told.append(Said("{said} See Outliers.", said=said if mostly else Said("{said}.", said=said)))
    return tuple(told)


# Uncertainty budgets, and the uncertainty over a task.

_BUDGET_RULE = Said(
    "The sources are independent and add as squares (GUM, JCGM 100:2008, 5.1). A: from the residuals of this campaign; B: known "
    "beforehand."
)


def predicted_uncertainty_section(budget: UncertaintyBudget, where: str) -> Section:
    """Make the section of the positions that a calibration predicts.

    Args:
        budget: of a predicted position.
        where: over which poses, in words.
    """
    text = Said(
        "Standard uncertainty of the predicted position of the first target, rms over {where}. {rule} The tracker's noise is in "
        "the first line, as far as it went into the fit; measuring a point again adds the tracker's own.",
        where=where,
        rule=_BUDGET_RULE,
    )
    return _budget_section(Said("Uncertainty of a predicted position"), text, budget)


def corrected_uncertainty_section(budget: UncertaintyBudget) -> Section:
    """Make the section of the targets of a corrected program."""
    text = Said(
        "Standard uncertainty of the tool at a target of the corrected program, rms over its targets. {rule} Tool and part are "
        "as uncertain as the cell file states, or else as they are built. Not included: deflection by cutting forces, unless the "
        "calibration has them, and wear of the tool.",
        rule=_BUDGET_RULE,
    )
    return _budget_section(Said("Uncertainty of a corrected position"), text, budget)


def _budget_section(title: str, text: str, budget: UncertaintyBudget) -> Section:
    combined = budget.combined
    form = f".{decimals_of(combined * 1e3)}f"
    columns = (
        Column(Said("source"), lambda row: row[0]),
        Column(Said("type"), lambda row: row[1]),
        millimetres("u, mm", lambda row: row[2], form),
        Column(Said("share %"), lambda row: row[3], "s"),
    )
    ordered = sorted(budget.contributions, key=lambda one: -one.deviation)
    rows = [
        (term(one.source), one.evaluation, one.deviation, f"{100.0 * one.deviation**2 / max(combined**2, 1e-300):.0f}")
        for one in ordered
    ]
    expanded = Said("expanded uncertainty U along one axis (k = {factor:g})", factor=COVERAGE_FACTOR)
    rows += [
        (Said("combined standard uncertainty u, 3D"), "", combined, "100"),
        (expanded, "", budget.expanded, ""),
    ]
    if ordered:
        largest = term(ordered[0].source)
        text = Said("{text} The largest contribution is {source}.", text=text, source=largest)
    return Section(title, text, TextTable.of(Said("Uncertainty budget"), columns, rows))


def task_uncertainty_section(over: TaskUncertainty) -> Section:
    """Make the section of the uncertainty over a task."""
    reach = f" {over.unreachable:.1%} of its poses are out of reach and left out." if over.unreachable else ""
    text = (
        f"Standard uncertainty over {over.task}, 3D, rms. Measured target in the tracker frame: {over.target * 1e3:.3f} mm; TCP "
        f"of the robot file in the tracker frame: {over.after * 1e3:.3f} mm. By the tolerances alone, in the robot's base: TCP "
        f"{over.before * 1e3:.3f} mm. The first two include the model error and unknown approach, last move and temperature.{reach}"
    )
    difference = (
        "Measurements of a single target locate that target, not its offset from the tool. The offset is estimated by the fit, so "
        "that the TCP is only as certain as the tolerances of tool and last axis; several targets, or measured poses, "
        "reduce its uncertainty."
    )
    if over.slices:
        chart = Chart(
            Said("Uncertainty over the workspace (3D standard uncertainty)"),
            draw_maps(over.slices, over.maps),
            Said(
                "Bright is worse: measure more poses there. In the tool orientation of the task's middle. White: out of the "
                "robot's reach. Each view has its own scale of colours."
            ),
        )
    else:
        chart = Chart(
            Said("95 % intervals pose by pose"),
            draw_bands(over.deviations),
            Said("The higher the line, the wider the interval about the prediction. Along the robot's base axes."),
        )
    return Section(Said("TCP uncertainty over the task"), text, difference, chart)


def calibration_sections(
    calibration: Calibration,
    *,
    judged: Mapping[str, Any] | None = None,
    over: TaskUncertainty | None = None,
    space: Workspace | None = None,
    campaign: Campaign | None = None,
    images: Path | None = None,
    remainder: ResidualAnalysis | None = None,
    rungs: Sequence[Rung] = (),
) -> list[Section]:
    """Make the sections of a calibration.

    Args:
        calibration: the calibration.
        judged: the verdict, which has the tolerances, as `Verdict.summary` has it.
        over: uncertainty over a task, if one was named.
        space: the task's workspace.
        campaign: whose corners are shown, if one was named.
        images: folder of its images, if they are to be shown.
        remainder: its residuals.
        rungs: nested models, on that campaign.
    """
    errors = measured_errors(calibration)
    sections = [
        summary_section(calibration, errors, over, judged, space),
        held_out_section(calibration),
        range_section(calibration),
        residuals_section(calibration, errors),
    ]
    pictured = camera_section(calibration, campaign, images)
    sections += [] if pictured is None else [pictured]
    if remainder is not None:
        sections.append(residual_analysis_section(remainder))
    if errors is not None:
        budget = budget_at(calibration, calibration.q)
        sections.append(predicted_uncertainty_section(budget, Said("the measured poses")))
    if over is not None:
        sections.append(task_uncertainty_section(over))
    sections.append(parameters_section(calibration))
    if rungs:
        sections.append(ladder_section(rungs))
    return [*sections, outliers_section(calibration), provenance_section(calibration)]


def calibration_page(calibration: Calibration, sections: Sequence[Section]) -> Report:
    """Make the page of a calibration.

    Args:
        calibration: the calibration.
        sections: as `calibration_sections` makes them, behind that of the verdict.
    """
    model, source, count = calibration.model, calibration.provenance, len(calibration.kept)
    fitted = f"{count} parameters" if count == len(model) else f"{count} of {len(model)} parameters"
    rows = f"{fitted} from {source.rows} rows of {source.campaign or 'a campaign'}"
    known = describe_effective(rows, calibration.effective_parameters, calibration.parameter_groups)
    return Report(
        title=f"Calibration of the {model.robot.title or model.robot.name}",
        sections=sections,
        lead=f"{known}. All lengths are in millimetres.",
        source=f"calibration by Taskcal {source.version}, {source.created}",
        header=(edited_entry(calibration.edit_warning),) if calibration.edited else (),
    )
