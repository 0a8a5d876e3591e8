"""The published procedure as a page, as tables of the terminal, as JSON and as files to go on with."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots
from scipy.special import chdtri

from taskcal.analysis.identifiability import published_kept
from taskcal.demo.procedure import (
    CIRCLES,
    INSIDE,
    ONE,
    OUTSIDE,
    SEVERAL,
    Errors,
    Fitted,
    Predictions,
    Procedure,
    frame_error,
    rms,
)
from taskcal.reading.writer import campaign_text
from taskcal.report.calibration import draw_parameters, draw_residuals
from taskcal.report.content import MICROMETRES, Chart, Commands, Numbers, Points, Section, Table, Text
from taskcal.report.page import report_html
from taskcal.report.sensitivity import draw_sensitivities, draw_singular_values
from taskcal.report.theme import BLUE, GREY, INK, SERIES, VERMILION, styled, styled_space, switch
from taskcal.robot.error_model import COMPONENTS, ErrorModel
from taskcal.robot.parameter import Parameter

# Files that a run leaves in a folder: its campaigns, and the calibrations of the whole model.

NAMES = {ONE: "one-orientation", SEVERAL: "several-orientations"}
KINDS = {"campaign": "csv", "calibration": "json"}


def procedure_names() -> tuple[str, ...]:
    """Names of all these files."""
    return tuple(f"{kind}-{name}.{ending}" for name in NAMES.values() for kind, ending in KINDS.items())


def procedure_contents(procedure: Procedure, folder: Path) -> tuple[dict[str, Path], dict[Path, str | bytes]]:
    """Which file holds what, and what is to be written in each."""
    files: dict[str, Path] = {}
    contents: dict[Path, str | bytes] = {}
    for label, campaign in procedure.campaigns.items():
        files[f"campaign {label}"] = folder / f"campaign-{NAMES[label]}.csv"
        contents[files[f"campaign {label}"]] = campaign_text(campaign, procedure.model.robot)
    for fit in procedure.fits:
        if fit.parameters == len(procedure.model):
            files[f"calibration {fit.campaign}"] = folder / f"calibration-{NAMES[fit.campaign]}.json"
            contents[files[f"calibration {fit.campaign}"]] = fit.calibration.to_text()
    return files, contents


# The procedure's results for machines.


def procedure_json(procedure: Procedure) -> dict[str, Any]:
    """Machine-readable, in millimetres and micrometres."""
    mechanism = procedure.mechanism
    return {
        "robot": procedure.model.robot.name,
        "seed": procedure.seed,
        "poses": {label: len(campaign) for label, campaign in procedure.campaigns.items()},
        "mechanism": {
            "motorised": mechanism.motorised,
            "passive": mechanism.passive,
            "mobility": mechanism.mobility,
            "overconstraint": mechanism.overconstraint,
        },
        "parameters": _parameters_json(procedure),
        "elimination": {
            label: {
                "rank": found.rank,
                "kept": found.kept,
                "zero": found.zero,
                "dependent": found.dependent,
                "condition_number": found.condition_number,
            }
            for label, found in procedure.elimination.eliminations.items()
        },
        "registration": _registration(procedure),
        "fits": _fits(procedure),
    }


def _parameters_json(procedure: Procedure) -> list[dict[str, Any]]:
    scaled = {label: found.maximum(scaled=True) * 1e6 for label, found in procedure.sensitivities.items()}
    return [
        {
            "name": row.name,
            "symbol": row.symbol,
            "published": row.published,
            "repeats": row.repeats,
            "eliminated": row.eliminated,
            "largest_influence_um": {label: values[:, i] for label, values in scaled.items()},
        }
        for i, row in enumerate(procedure.elimination.rows)
    ]


def _registration(procedure: Procedure) -> dict[str, Any]:
    off, turned = frame_error(procedure.registration.T_tracker_base, procedure.truth.T_tracker_base)
    return {
        "poses": len(procedure.sweeps),
        "circles": [
            {
                "axis": procedure.model.robot.joint_names[circle.axis],
                "rows": len(circle.rows),
                "radius_mm": circle.radius * 1e3,
                "residual_mm": circle.residual * 1e3,
            }
            for circle in procedure.circles
        ],
        "frame_error_mm": off * 1e3,
        "frame_error_mrad": turned * 1e3,
    }


def _fits(procedure: Procedure) -> list[dict[str, Any]]:
    covered = {(p.campaign, p.model, p.where): p.share_inside(0.95) for p in procedure.predictions}
    return [
        {
            "campaign": fit.campaign,
            "model": fit.model,
            "parameters": fit.parameters,
            "residual": _errors_json(fit.residual),
            "inside": _errors_json(fit.inside),
            "outside": _errors_json(fit.outside),
            "inside_95": covered[fit.campaign, fit.model, INSIDE],
            "outside_95": covered[fit.campaign, fit.model, OUTSIDE],
        }
        for fit in procedure.fits
    ]


def _errors_json(errors: Errors) -> dict[str, float]:
    x, y, z = (value * 1e3 for value in errors.per_axis)
    return {
        "mean_mm": errors.mean * 1e3,
        "max_mm": errors.maximum * 1e3,
        "max_x_mm": x,
        "max_y_mm": y,
        "max_z_mm": z,
    }


# Tables, the same for the page and for the terminal.

PUBLISHED_RESIDUALS = "180.3", "95.7", "122.2", "91.9"
"""Largest residuals in space and on X, Y, Z of Gutiérrez et al., measured robot, 33 parameters, µm."""


def overview(procedure: Procedure) -> tuple[Table, ...]:
    """The tables that fit a terminal."""
    return (
        tabulate_model(procedure.model),
        tabulate_influences(procedure, 10),
        tabulate_counts(procedure),
        tabulate_relations(procedure),
        tabulate_registration(procedure),
        tabulate_residuals(procedure),
        tabulate_held_out(procedure),
    )


def tabulate_model(model: ErrorModel) -> Table:
    """All parameters at a glance: a row per frame, the publication's symbols in the cells."""
    symbols = {p.name: p.symbol or "·" for p in model.parameters}
    frames = list(dict.fromkeys(p.name.split(".")[0] for p in model.parameters))
    rows: list[tuple[str, ...]] = []
    for frame in frames:
        names = [f"{frame}.{c}" for c in COMPONENTS]
        if names[0] in symbols:
            rows.append((frame, *(symbols.get(name, "") for name in names)))
        else:
            mine = [n for n in symbols if n.startswith(frame + ".")]
            rows.append((frame, *(f"{n.split('.')[1]} = {symbols[n]}" for n in mine), *[""] * (6 - len(mine))))
    return Table.of_rows(
        f"The model's {len(model)} parameters",
        ("frame", *COMPONENTS),
        rows,
        text_columns=tuple(range(7)),
        note="Rows and columns make our name (J3.ry), cells hold the publication's symbol (psi3). Translations t and "
        "rotations r of each joint's frame about its own axes, then of the tool's; the loop has three lengths.",
    )


def tabulate_influences(procedure: Procedure, limit: int | None = None) -> Table:
    """Largest influence of each parameter at its tolerance; with a limit, only the largest in space."""
    sets = procedure.sensitivities
    per_axis = {label: found.maximum(scaled=True) * 1e6 for label, found in sets.items()}
    in_space = {label: found.maximum_in_space(scaled=True) * 1e6 for label, found in sets.items()}
    order = list(range(len(procedure.model)))
    if limit is not None:
        order = sorted(order, key=lambda i: -max(float(values[i]) for values in in_space.values()))[:limit]
    whole = limit is None
    rows: list[tuple[str, ...]] = []
    for i in order:
        parameter = procedure.model.parameters[i]
        cells = [f"{v:.0f}" for label in sets for v in (*per_axis[label][:, i], in_space[label][i])]
        rows.append((parameter.label, *((_tolerance(parameter),) if whole else ()), *cells))
    short = {ONE: "one"}
    columns = [f"{axis}\n{short.get(label, label)}" for label in sets for axis in ("X", "Y", "Z", "space")]
    return Table.of_rows(
        "Largest influence on the tool point (µm)" + ("" if whole else f": the {limit} strongest parameters"),
        ("parameter", *(("tolerance",) if whole else ()), *columns),
        rows,
        note="What a defect of one tolerance (1σ) does along the robot's base axes and in space, over the poses measured in "
        f"{' and in '.join(sets)}.",
        folded=whole,
    )


def _tolerance(parameter: Parameter) -> str:
    return f"{parameter.tolerance * parameter.shown.factor:g} {parameter.shown.name}"


def tabulate_counts(procedure: Procedure) -> Table:
    """Tabulate the numbers of published and of identifiable parameters."""
    elimination = procedure.elimination
    total = len(procedure.model)
    published = [row.published for row in elimination.rows]
    dropped = sum(said in ("zero", "redundant", "dropped") for said in published)
    zero = published.count("zero")
    rows: list[tuple[str, ...]] = [
        ("as published", str(dropped - zero), str(zero), str(total - dropped), ""),
    ]
    repeats = [row.repeats for row in elimination.rows]
    zero = repeats.count("zero")
    alone = sum(bool(r) for r in repeats) - zero
    rows.append(("repeats of one other", str(alone), str(zero), str(total - alone - zero), ""))
    for label, found in elimination.eliminations.items():
        condition = f"{found.condition_number:.0f}"
        rows.append(
            (f"full elimination, {label}", str(len(found.dependent)), str(len(found.zero)), str(found.rank), condition)
        )
    return Table.of_rows(
        f"What remains of the {total} parameters",
        ("by", "redundant", "no effect", "remain", "condition"),
        rows,
        note="“Repeats of one other” finds parameters that act exactly like one other; “full elimination” also finds "
        "those that equal a combination of several. The publication calls psi5 redundant and drops alf6, which acts "
        "alike. The condition number is that of the remaining columns, scaled "
        "to unit length: the larger, the harder to tell them apart.",
    )


def tabulate_relations(procedure: Procedure) -> Table:
    """Tabulate the parameters of the published reduced model that depend on others, with their relations."""
    kept = set(published_kept(procedure.model))
    sets = list(procedure.elimination.eliminations)
    rows = [
        (
            f"{row.name} ({row.symbol})",
            *("independent" if row.eliminated[s] == "kept" else f"= {row.eliminated[s]}" for s in sets),
        )
        for row in procedure.elimination.rows
        if row.name in kept and any(row.eliminated[s] != "kept" for s in sets)
    ]
    return Table.of_rows(
        f"Of the published {len(kept)}, these repeat others",
        ("parameter", *sets),
        rows,
        text_columns=tuple(range(len(sets) + 1)),
        note="A combination moves the tool point exactly as the parameter does, at every pose of the set, to first "
        "order. Coefficients are in metres and radians: 0.3·t1z means 0.3 mm of t1z for 1 mrad of the parameter.",
    )


def tabulate_elimination(procedure: Procedure) -> Table:
    """Every parameter: what was published of it, and what each set of poses says."""
    sets = list(procedure.elimination.eliminations)
    rows = [
        (row.name, row.symbol, row.published, row.repeats, *(row.eliminated[s] for s in sets))
        for row in procedure.elimination.rows
    ]
    return Table.of_rows(
        f"Elimination of all {len(rows)} parameters",
        ("parameter", "symbol", "published", "repeats", *sets),
        rows,
        text_columns=tuple(range(4 + len(sets))),
        note="“repeats” names the one other parameter that it equals at all poses; the last columns say what full "
        "elimination from left to right finds: kept, zero, or the combination that it equals.",
        folded=True,
    )


def tabulate_registration(procedure: Procedure) -> Table:
    """Tracker frame and target from circles, held, beside the fit that finds them by itself."""
    kept, true = len(published_kept(procedure.model)), procedure.truth.T_tracker_base

    def row(name: str, label: str, start: str) -> tuple[str, ...]:
        fit = procedure.fit(label, start)
        off, turned = frame_error(fit.calibration.T_tracker_base, true)
        errors = (f"{e.mean * 1e6:.1f}" for e in (fit.residual, fit.inside, fit.outside))
        return (name, f"{off * 1e3:.3f}", f"{turned * 1e3:.3f}", *errors)

    groups = tuple(
        (
            f"measured in {label}",
            (
                row("circles, held", label, CIRCLES),
                row("in the fit", label, f"published {kept}, damped"),
                row("in the fit, prior", label, f"published {kept}, prior"),
            ),
        )
        for label in procedure.campaigns
    )
    return Table(
        title=f"Registration of the tracker, with the published {kept}",
        header=(
            "tracker frame and target",
            "base off\nmm",
            "turned\nmrad",
            "residual\nµm",
            "inside\nµm",
            "outside\nµm",
        ),
        groups=groups,
        note=f"Circles: {len(procedure.sweeps)} more poses in which one motor turns at a time, as in the publication's figure 6; "
        "what they give is held in the fit. How far the base is from where it truly is says little: J1 and the base "
        "cannot be told apart, and the first may stand for the second. Mean residual, and mean error on new poses, in space.",
    )


def tabulate_residuals(procedure: Procedure) -> Table:
    """Tabulate the fit residuals of each model."""
    groups = tuple(
        (
            f"measured in {campaign}",
            tuple((f.model, str(f.parameters), *_axes(f.residual)) for f in procedure.fits if f.campaign == campaign),
        )
        for campaign in procedure.campaigns
    )
    published = ("real robot, as published", (("published 33", "33", "", *PUBLISHED_RESIDUALS),))
    return Table(
        title="Residuals on the measured poses (µm)",
        header=("model", "fitted", "mean", "max", "X", "Y", "Z"),
        groups=(*groups, published),
        note="Measured less predicted: mean and largest in space, largest on each axis of the robot's base. “fitted” "
        "counts the model's parameters; tracker frame and target are fitted with them, but where circles are held. “Lengths” is "
        "the publication's first model: the nominal lengths alone.",
    )


def tabulate_held_out(procedure: Procedure) -> Table:
    """Errors on poses that were not measured, for every model."""
    groups = tuple(
        (
            f"measured in {campaign}",
            tuple(
                (f.model, *(f"{v * 1e6:.1f}" for e in (f.inside, f.outside) for v in (e.mean, e.maximum)))
                for f in procedure.fits
                if f.campaign == campaign
            ),
        )
        for campaign in procedure.campaigns
    )
    return Table(
        title="Errors on new poses (µm)",
        header=("model", "inside\nmean", "inside\nmax", "outside\nmean", "outside\nmax"),
        groups=groups,
        note="True less predicted tool point in the tracker frame, in space. Inside: new poses in the workspace and the "
        "orientations that were measured. Outside: the same workspace with the tool tilted by up to 40° from the "
        "single orientation, and turned by up to 40° about its axis.",
    )


def tabulate_parameters(procedure: Procedure) -> Table:
    """Estimates of the whole model beside the truth."""
    whole = {f.campaign: f.calibration for f in procedure.fits if f.parameters == len(procedure.model)}
    rows: list[tuple[str, ...]] = []
    for i, parameter in enumerate(procedure.model.parameters):
        unit = parameter.shown
        cells = [
            f"{calibration.estimate[i] * unit.factor:.3f} ± {calibration.standard_errors[i] * unit.factor:.3f}"
            for calibration in whole.values()
        ]
        rows.append((parameter.label, unit.name, f"{procedure.truth.x[i] * unit.factor:.3f}", *cells))
    return Table.of_rows(
        f"All {len(procedure.model)} parameters: estimates and truth",
        ("parameter", "unit", "truth", *whole),
        rows,
        text_columns=(0, 1),
        note="Estimate ± one standard error, identified with the prior.",
        folded=True,
    )


def _axes(errors: Errors) -> tuple[str, ...]:
    return tuple(f"{value * 1e6:.1f}" for value in (errors.mean, errors.maximum, *errors.per_axis))


# Figures of predictions on poses that were not measured: how large the errors are, where, and whether it was
# foreseen.

LEVELS = np.linspace(0.0, 1.0, 101)
TICKS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000]


def draw_held_out(fits: Sequence[Fitted]) -> go.Figure:
    """Mean and largest error of every model, inside the measured orientations and outside."""
    campaigns = list(dict.fromkeys(f.campaign for f in fits))
    titles = [
        f"measured in {campaign}: {where}"
        for campaign in campaigns
        for where in ("same orientations", "turned farther")
    ]
    figure = make_subplots(
        rows=len(campaigns),
        cols=2,
        shared_yaxes=True,
        shared_xaxes="all",  # pyright: ignore[reportArgumentType]
        subplot_titles=titles,
        horizontal_spacing=0.04,
        vertical_spacing=0.14,
    )
    for row, campaign in enumerate(campaigns, start=1):
        mine = [f for f in fits if f.campaign == campaign]
        names = [f.model for f in mine]
        for col, errors in enumerate(([f.inside for f in mine], [f.outside for f in mine]), start=1):
            mean, largest = np.array([[e.mean, e.maximum] for e in errors]).T * 1e6
            first = row == col == 1
            for name, low, high in zip(names, mean, largest, strict=True):
                figure.add_scatter(
                    x=[low, high],
                    y=[name, name],
                    mode="lines",
                    line={"color": "#b8c1ca", "width": 5},
                    showlegend=False,
                    hoverinfo="skip",
                    row=row,
                    col=col,
                )
            for values, label, colour, symbol, side in (
                (mean, "mean", BLUE, "circle", "middle left"),
                (largest, "largest", VERMILION, "diamond", "middle right"),
            ):
                figure.add_scatter(
                    x=values,
                    y=names,
                    mode="markers+text",
                    text=[f" {v:.0f} " for v in values],
                    textposition=side,
                    textfont={"size": 13},
                    marker={"color": colour, "symbol": symbol, "size": 11},
                    name=label,
                    legendgroup=label,
                    showlegend=first,
                    hovertemplate="%{y}: %{x:.1f} µm<extra>" + label + "</extra>",
                    cliponaxis=False,
                    row=row,
                    col=col,
                )
    styled(figure, height=230 * len(campaigns) + 130, top=90)
    errors = [value * 1e6 for f in fits for e in (f.inside, f.outside) for value in (e.mean, e.maximum)]
    span = [np.log10(min(errors)) - 0.35, np.log10(max(errors)) + 0.35]
    figure.update_xaxes(type="log", range=span, tickvals=TICKS, tickfont={"size": 12})
    figure.update_xaxes(title_text="error of the predicted tool point (µm)", row=len(campaigns))
    figure.update_yaxes(autorange="reversed", ticks="")
    figure.update_layout(legend={"y": 1.07})
    return figure


def draw_error_over_angle(predictions: Sequence[Predictions]) -> go.Figure:
    """Error of every new pose over the rotation of its tool from the one measured orientation."""
    figure = go.Figure()
    shapes = ("circle", "diamond", "square", "cross")
    for k, label in enumerate(dict.fromkeys(_fit_label(p) for p in predictions)):
        mine = [p for p in predictions if _fit_label(p) == label]
        figure.add_scatter(
            x=np.degrees(np.concatenate([p.angle for p in mine])),
            y=np.concatenate([p.length for p in mine]) * 1e6,
            mode="markers",
            name=label,
            marker={"color": SERIES[k % len(SERIES)], "symbol": shapes[k % len(shapes)], "size": 5, "opacity": 0.65},
            hovertemplate="%{x:.1f}°: %{y:.1f} µm<extra>" + label + "</extra>",
        )
    styled(figure, height=440)
    figure.update_xaxes(title_text="rotation of the tool from the single measured orientation (°)")
    figure.update_yaxes(title_text="error of the predicted tool point (µm)", type="log", tickvals=TICKS)
    return figure


def draw_coverage(predictions: Sequence[Predictions]) -> go.Figure:
    """Whether errors are as large as was stated: beside the stated uncertainty, and inside the stated ellipsoids."""
    figure = make_subplots(
        rows=1, cols=2, horizontal_spacing=0.12, subplot_titles=["pose by pose", "share inside the stated ellipsoid"]
    )
    limits = chdtri(3, 1.0 - LEVELS)
    low = high = 1.0
    for k, p in enumerate(predictions):
        colour, label = SERIES[k % len(SERIES)], f"{_fit_label(p)}; {p.where}"
        stated, actual = p.stated * 1e6, p.length * 1e6
        low, high = min(low, stated.min()), max(high, stated.max(), actual.max())
        figure.add_scatter(
            x=stated,
            y=actual,
            mode="markers",
            name=label,
            legendgroup=label,
            marker={"color": colour, "size": 4, "opacity": 0.5},
            hovertemplate="stated %{x:.1f} µm, actual %{y:.1f} µm<extra>" + label + "</extra>",
            row=1,
            col=1,
        )
        figure.add_scatter(
            x=100.0 * LEVELS,
            y=100.0 * np.mean(p.squared_distance[:, None] <= limits, axis=0),
            mode="lines",
            name=label,
            legendgroup=label,
            showlegend=False,
            line={"color": colour, "width": 2.5},
            hovertemplate="%{x:.0f} % ellipsoid holds %{y:.0f} %<extra>" + label + "</extra>",
            row=1,
            col=2,
        )
    for col, ends in ((1, [low, high]), (2, [0.0, 100.0])):
        figure.add_scatter(
            x=ends,
            y=ends,
            mode="lines",
            line={"color": INK, "width": 1.2, "dash": "dash"},
            name="as stated",
            showlegend=col == 1,
            hoverinfo="skip",
            row=1,
            col=col,
        )
    styled(figure, height=560, top=70)
    figure.update_layout(legend={"y": -0.17, "yanchor": "top", "itemsizing": "constant"}, margin={"b": 150})
    figure.update_xaxes(
        title_text="stated standard uncertainty in space (µm)", type="log", tickvals=TICKS, row=1, col=1
    )
    figure.update_yaxes(title_text="actual error in space (µm)", type="log", tickvals=TICKS, row=1, col=1)
    figure.update_xaxes(title_text="stated probability (%)", range=[0, 100], row=1, col=2)
    figure.update_yaxes(title_text="new poses inside (%)", range=[0, 102], row=1, col=2)
    return figure


def draw_workspace(predictions: Sequence[Predictions], measured: Mapping[str, Float[np.ndarray, "n 3"]]) -> go.Figure:
    """New poses where they are in the workspace, coloured by the error of their prediction.

    Args:
        predictions: views to choose from; all share one logarithmic scale of colours.
        measured: for each campaign, the tool points that were measured, in the base, metres.
    """
    figure = go.Figure()
    top = float(np.ceil(2.0 * np.log10(max(p.length.max() for p in predictions) * 1e6)) / 2.0)
    for k, p in enumerate(predictions):
        x, y, z = p.position.T * 1e3
        figure.add_scatter3d(
            x=x,
            y=y,
            z=z,
            mode="markers",
            name="new poses",
            visible=k == 0,
            marker={
                "size": 5,
                "color": np.log10(np.maximum(p.length * 1e6, 1e-3)),
                "colorscale": "Viridis",
                "cmin": 0.0,
                "cmax": top,
                "colorbar": {
                    "title": {"text": "error (µm)"},
                    "tickvals": np.log10(TICKS).tolist(),
                    "ticktext": [str(t) for t in TICKS],
                    "len": 0.8,
                },
            },
            customdata=np.stack([p.length * 1e6, np.degrees(p.angle)], axis=1),
            hovertemplate="%{customdata[0]:.1f} µm, turned %{customdata[1]:.0f}°<extra></extra>",
        )
        x, y, z = measured[p.campaign].T * 1e3
        figure.add_scatter3d(
            x=x,
            y=y,
            z=z,
            mode="markers",
            name="measured poses",
            visible=k == 0,
            marker={"size": 3, "symbol": "cross", "color": GREY},
            hoverinfo="skip",
        )
    styled_space(figure, distance=1.6)
    if len(predictions) > 1:
        count = 2 * len(predictions)
        choices = {
            f"{_fit_label(p)}; {p.where}": ({"visible": [j // 2 == k for j in range(count)]},)
            for k, p in enumerate(predictions)
        }
        switch(figure, choices, y=1.02)
    return figure


def _fit_label(p: Predictions) -> str:
    return f"measured in {p.campaign}, {p.model}"


# Numbers as the demonstration's page says them.


def length_text(metres: float) -> str:
    """A length with its unit."""
    return f"{um(metres)} µm" if metres < 1e-3 else f"{metres * 1e3:.3g} mm"


def power_text(value: float) -> str:
    """A number as a power of ten."""
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits}·10" + str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def um(metres: float) -> str:
    """A length in micrometres, without the unit."""
    return f"{metres * 1e6:.0f}" if metres >= 2e-5 else f"{metres * 1e6:.1f}"


# The second half of the procedure's page: identification, errors on new poses, uncertainty, parameters.


def identification_section(procedure: Procedure) -> Section:
    """Section of the identification: fitted parameters and fit residuals of each model."""
    panels = {
        label: {f.model: f.calibration for f in procedure.fits if f.campaign == label} for label in procedure.campaigns
    }
    return Section(
        title="Identification and residuals",
        blocks=(
            Text(
                (
                    "The tracker frame and the target are fitted together with the parameters; nothing has to be registered "
                    "beforehand. The publication registers the tracker from circles that single motors draw; that way, held, "
                    "stands beside it. “Damped, no prior” is after the published way, Levenberg–Marquardt without a prior; it ends "
                    "early, once the objective falls by less than a millionth of itself or the next step is small beside the "
                    "standard errors.",
                    "All models of defects with fitted frames leave nearly the same residuals, close to the tracker's noise; "
                    "the lengths alone do not. Residuals therefore "
                    "cannot say which model is better; new poses can. The published residuals are those of a real robot, with "
                    "gravity and all else that geometry does not explain, so they are larger.",
                )
            ),
            tabulate_registration(procedure),
            tabulate_residuals(procedure),
            Chart(
                title="Residuals, pose by pose",
                figure=draw_residuals(panels, "all", MICROMETRES),
                note="Measured less predicted, along the robot's base axes. The list at the right changes the model.",
            ),
        ),
    )


def held_out_section(procedure: Procedure) -> Section:
    """Errors on poses that were not measured."""
    kept = len(published_kept(procedure.model))
    whole = [p for p in procedure.predictions if p.model.startswith("all")]
    undamped = [
        p for p in procedure.predictions if p.model.startswith(f"published {kept}, damped") and p.campaign == ONE
    ]
    base = {label: found.T[:, :3, 3] for label, found in procedure.poses.items()}
    return Section(
        title="Errors at held-out poses",
        blocks=(
            Text(
                (
                    "Predictions of each model are compared with the true robot at new poses. In the measured orientation even a "
                    "redundant model predicts well: its dependent parameters have equal effects there.",
                    "One orientation is good inside and poor outside for a simple reason. With the tool always turned alike, "
                    "defects of the wrist and the tool move the tool point like defects of the arm. The fit may blame either; "
                    "when the tool turns, the two part company. No fit can repair that, only measuring in several orientations. "
                    "Without prior the blame goes anywhere; with it, to where the tolerances make it likely, which need not be "
                    "where it belongs: with another seed the prior helps more, or not at all.",
                )
            ),
            tabulate_held_out(procedure),
            Chart(
                title="Mean and largest error of each model on new poses",
                figure=draw_held_out(procedure.fits),
                note="Logarithmic scale. Same orientations: those of the campaign. Turned farther: tilted by up to 40° and "
                "turned by up to 40° about the tool's axis. The largest errors can come from poses near the wrist's "
                "singularity, where its joints turn farther than at any measured pose.",
            ),
            Chart(
                title="Error against the rotation of the tool",
                figure=draw_error_over_angle([*whole, *undamped]),
                note="Every point is a new pose. Measured in one orientation, the error grows with the rotation away from it.",
            ),
            Chart(
                title="Where the errors are in the workspace",
                figure=draw_workspace(whole, base),
                note="Rotate with the mouse. All views share one scale of colours; crosses are the measured poses, in base "
                "coordinates.",
            ),
        ),
    )


def uncertainty_section(procedure: Procedure) -> Section:
    """Stated uncertainty compared with the errors."""
    kept = len(published_kept(procedure.model))
    chosen = [p for p in procedure.predictions if p.model.startswith("all")]
    far = next(p for p in chosen if p.campaign == ONE and "farther" in p.where)
    undamped = [
        p
        for p in procedure.predictions
        if p.model.startswith(f"published {kept}, damped") and p.campaign == ONE and "farther" in p.where
    ]
    rows = [
        (
            f"{p.model}, {p.campaign}",
            p.where,
            f"{rms(p.stated) * 1e6:.1f}",
            f"{rms(p.length) * 1e6:.1f}",
            f"{100 * p.share_inside(0.95):.0f} %",
        )
        for p in (*chosen, *undamped)
    ]
    return Section(
        title="Does the calibration know how wrong it is?",
        blocks=(
            Text(
                (
                    "A calibration states an uncertainty for every pose, measured or not: an ellipsoid about the predicted "
                    "tool point. It comes from the tracker's noise, from the poses that were measured and from the prior.",
                    "With the prior, the statement grows where the tool turns away from what was measured "
                    f"({length_text(rms(far.stated))} stated, {length_text(rms(far.length))} actual, "
                    "root mean square). Out there it rests on the tolerances, not on measurements, and one robot can be luckier "
                    "or unluckier than its tolerances say; where poses were measured it rests on them."
                    + _without_prior(undamped),
                    "All errors here come from one robot and one campaign, so they rise and fall together: a curve may leave "
                    "the diagonal by chance. Another seed draws another robot, and gives other curves.",
                )
            ),
            Table.of_rows(
                "Stated uncertainty and actual error (µm, root mean square in space)",
                ("calibration", "new poses", "stated", "actual", "in 95 % ellipsoid"),
                rows,
                text_columns=(0, 1),
                note="Where the statement is right, stated and actual agree, and 95 % of the poses lie inside.",
            ),
            Chart(
                title="Stated uncertainty against actual error",
                figure=draw_coverage(chosen),
                note="Left: points about the dashed line are as wrong as stated. Right: a curve above the dashed line is "
                "cautious, one below it overconfident.",
            ),
        ),
    )


def parameters_section(procedure: Procedure) -> Section:
    """Estimates beside the truth."""
    whole = {f.campaign: f.calibration for f in procedure.fits if f.parameters == len(procedure.model)}
    return Section(
        title="Estimated parameters",
        blocks=(
            Text(
                (
                    "Parameters that repeat each other share what is found; their standard errors stay near the tolerance and "
                    "say so. Combinations that matter to the tool point are known far better than any one of them. J1.tz and "
                    "J1.rz repeat the tracker frame, which is fitted too. Read the predictions, not the single parameters.",
                )
            ),
            Chart(
                title="Estimated parameters and the truth",
                figure=draw_parameters(whole, procedure.truth.x),
                note="All parameters with their prior. Bars are two standard errors: about one truth in twenty lies outside.",
            ),
            tabulate_parameters(procedure),
        ),
    )


def _without_prior(predictions: Sequence[Predictions]) -> str:
    if not predictions:
        return ""
    stated, actual = rms(predictions[0].stated), rms(predictions[0].length)
    return (
        " Without prior, nothing holds the directions that the poses do not determine, and the statement means nothing: "
        f"{length_text(stated)} stated, {length_text(actual)} actual."
    )


def procedure_html(procedure: Procedure, *, next_steps: str, version: str) -> str:
    """The page of a run of the procedure.

    Args:
        procedure: what was found.
        next_steps: commands to go on with.
        version: of the package, for the footer.
    """
    model = procedure.model
    sections = [
        _summary(procedure),
        _mechanism(procedure),
        _sensitivity(procedure),
        _elimination(procedure),
        identification_section(procedure),
        held_out_section(procedure),
        uncertainty_section(procedure),
        parameters_section(procedure),
        Section(title="Your own robot", blocks=(Text((_OWN,)), Commands(next_steps))),
    ]
    return report_html(
        "Adapting a robot's geometric model to its task",
        sections,
        lead=f"The procedure of Gutiérrez, Chanal, Durieux and Duc on a virtual {model.robot.title or model.robot.name}, "
        "and what goes past it.",
        footer=f"Taskcal {version}; seed {procedure.seed}; robot {model.robot.name}, "
        f"{len(next(iter(procedure.campaigns.values())))} poses in each campaign. The publication: Gutiérrez, Chanal, "
        "Durieux, Duc, Adaptation of the geometric model of a 6 dof serial robot to the task space.",
    )


def summary_points(procedure: Procedure) -> tuple[str, ...]:
    """Points of the summary, with the numbers of this run."""
    kept = len(published_kept(procedure.model))
    one, several = (procedure.fit(label, "all") for label in (ONE, SEVERAL))
    reduced = procedure.fit(ONE, "identifiable")
    undamped = procedure.fit(ONE, f"published {kept}, damped")
    ranks = procedure.elimination.eliminations
    return (
        f"Of {len(procedure.model)} parameters the publication keeps {kept}. Only {ranks[ONE].rank} are identifiable in "
        f"one tool orientation, {ranks[SEVERAL].rank} when the tool also turns by {SEVERAL}: the others are dependent.",
        f"Redundant parameters do no harm where each has a prior from its tolerance: measured in one orientation, all "
        f"{len(procedure.model)} are wrong by {um(one.inside.mean)} µm on average there and by {um(one.outside.mean)} µm on "
        f"turned tools, the {reduced.parameters} identifiable ones by {um(reduced.inside.mean)} and "
        f"{um(reduced.outside.mean)} µm. Without a prior, damping alone holds the {kept}: {um(undamped.inside.mean)} and "
        f"{um(undamped.outside.mean)} µm.",
        f"Measured in one orientation, the model is good in that orientation ({um(one.inside.mean)} µm on average) and poor "
        f"in others ({um(one.outside.mean)} µm). Measured in {SEVERAL}, it is wrong by {um(several.inside.mean)} µm there "
        f"and by {um(several.outside.mean)} µm when turned farther.",
        "Errors are in the tracker frame. In the robot's base frame predictions are less certain: the zero of the first "
        "axis and the base are not separable.",
    )


def _summary(procedure: Procedure) -> Section:
    one, several = (procedure.fit(label, "all") for label in (ONE, SEVERAL))
    nominal = procedure.fit(SEVERAL, "nominal")
    ranks = procedure.elimination.eliminations
    return Section(
        title="Summary",
        blocks=(
            Numbers(
                (
                    (
                        f"{ranks[ONE].rank} of {len(procedure.model)}",
                        "",
                        "parameters identifiable in one orientation",
                    ),
                    (
                        um(nominal.inside.mean),
                        "µm",
                        f"mean 3D error in {SEVERAL}, nominal (registered)",
                    ),
                    (um(several.inside.mean), "µm", f"mean 3D error, calibrated in {SEVERAL}, at held-out poses there"),
                    (
                        um(one.outside.mean),
                        "µm",
                        "mean 3D error, calibrated in one orientation, at other orientations",
                    ),
                )
            ),
            Points(summary_points(procedure)),
            Text(
                (
                    "The robot is virtual: its defects are drawn from the tolerances (one standard deviation: 0.3 mm and "
                    "0.3 mrad unless its file says otherwise) and its tracker has the noise of a Leica AT901, ±(15 µm + "
                    "6 µm/m) taken as two standard deviations. So the truth is known, and errors are errors, not residuals. "
                    "It does not bend, warm up or backlash; a real robot leaves more.",
                )
            ),
        ),
    )


def _mechanism(procedure: Procedure) -> Section:
    found, model = procedure.mechanism, procedure.model
    lengths = ", ".join(
        f"{part.symbol} {1e3 * float(np.linalg.norm(part.transform[:3, 3])):g}"
        for joint in model.robot.joints
        for part in joint.before
        if part.symbol
    )
    explanation = found.explanation[0].upper() + found.explanation[1:] + "."
    nominal = (f"The nominal model has the lengths {lengths} mm.",) if lengths else ()
    parameters = [(p.name, p.symbol, p.shown.name, f"{p.tolerance * p.shown.factor:g}") for p in model.parameters]
    listed = Table.of_rows(
        "All parameters with their tolerances",
        ("parameter", "symbol", "unit", "tolerance (1σ)"),
        parameters,
        text_columns=(0, 1, 2),
        folded=True,
    )
    return Section(
        title="Mechanism and model",
        blocks=(
            Text((explanation, *nominal, "Every defect that the mechanism leaves free is a parameter.")),
            tabulate_model(model),
            listed,
        ),
    )


def _sensitivity(procedure: Procedure) -> Section:
    return Section(
        title="Sensitivity",
        blocks=(
            Text(
                (
                    "How far does each defect move the tool point? The sensitivity S = ∂X/∂ξ answers at every pose; shown is "
                    "its largest value over the measured poses. Scaled by the tolerance, it is the error to expect from that "
                    "defect alone. A large influence does not make a parameter identifiable: the next section says why.",
                )
            ),
            Chart(
                title="Largest influence of each parameter on X, Y and Z",
                figure=draw_sensitivities(procedure.sensitivities, procedure.elimination.eliminations),
                note="Along the robot's base axes. Pale bars: parameters that repeat others at these poses. The buttons "
                "change between the influence of a defect as large as its tolerance and the influence per unit.",
            ),
            tabulate_influences(procedure),
        ),
    )


def _elimination(procedure: Procedure) -> Section:
    kept = published_kept(procedure.model)
    counts = {
        label: sum(name not in found.kept for name in kept)
        for label, found in procedure.elimination.eliminations.items()
    }
    said = " and ".join(f"{count} in {label}" for label, count in counts.items())
    gaps = "; ".join(
        f"in {label} the last that counts is {power_text(last)}, the next {power_text(following)}"
        for label, found in procedure.elimination.eliminations.items()
        if 0 < found.rank < len(found.singular_values)
        for last, following in [found.singular_values[found.rank - 1 : found.rank + 1]]
    )
    return Section(
        title="Identifiable parameters",
        blocks=(
            Text(
                (
                    "Two parameters that move the TCP in the same way at every pose are not separable, however good "
                    "the tracker. Gaussian elimination of the stacked sensitivities finds them, and the relations between them.",
                    f"The published {len(kept)} are not all identifiable: of them, {said} repeat others. A least-squares fit "
                    "without prior has no unique answer for these; only its damping keeps them from running away.",
                )
            ),
            tabulate_counts(procedure),
            tabulate_relations(procedure),
            Chart(
                title="Singular values of the stacked sensitivities",
                figure=draw_singular_values(procedure.elimination.eliminations),
                note=f"Filled: counted as rank. The gap is clear: {gaps}. Below it there is only rounding. Values under "
                "10⁻¹⁸ are drawn there.",
            ),
            tabulate_elimination(procedure),
        ),
    )


_OWN = (
    "The same with your robot: measure some sixty poses in the task's workspace, with the tool orientations of the task and "
    "somewhat more, and hold a few poses out."
)
