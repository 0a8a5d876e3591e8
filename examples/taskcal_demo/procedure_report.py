"""The published procedure as a page, as tables of the terminal, as JSON and as files to go on with."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from taskcal.analysis.identifiability import published_kept
from taskcal.identification.held_out import Validation
from taskcal.reading.writer import campaign_text
from taskcal.report.calibration import draw_parameters, draw_residuals
from taskcal.report.chart import GREY, INK, SERIES, SHAPES, VERMILION, Axis, Figure, Panel, Series
from taskcal.report.content import MICROMETRES, Bullets, Chart, Column, Commands, Numbers, Section, TextTable, Viewer
from taskcal.report.page import Report
from taskcal.report.scene import coloured_points, to_mm
from taskcal.report.sensitivity import draw_sensitivities, draw_singular_values, tabulate_all_eliminated
from taskcal.robot.error_model import COMPONENTS, ErrorModel
from taskcal_demo.procedure import (
    CIRCLES,
    INSIDE,
    ONE,
    OUTSIDE,
    SEVERAL,
    Fitted,
    Predictions,
    Procedure,
    frame_error,
    rms,
)

# Files that a run leaves in a folder: its campaigns, and the calibrations of the whole model.

NAMES = {ONE: "one-orientation", SEVERAL: "several-orientations"}
KINDS = {"campaign": "csv", "calibration": "json"}


def procedure_files(folder: Path) -> dict[str, Path]:
    """These files by what they hold."""
    return {
        f"{kind} {label}": folder / f"{kind}-{name}.{ending}"
        for label, name in NAMES.items()
        for kind, ending in KINDS.items()
    }


def procedure_contents(procedure: Procedure) -> dict[str, str]:
    """What is to be written in each file, by what it holds."""
    campaigns = {f"campaign {label}": campaign for label, campaign in procedure.campaigns.items()}
    whole = {f"calibration {label}": calibration for label, calibration in procedure.whole.items()}
    robot = procedure.model.robot
    return {
        **{name: campaign_text(campaign, robot) for name, campaign in campaigns.items()},
        **{name: calibration.to_text() for name, calibration in whole.items()},
    }


# The procedure's results for machines.


def procedure_json(procedure: Procedure) -> dict[str, Any]:
    """Machine-readable, in millimetres and micrometres."""
    mechanism = procedure.mechanism
    influences = {label: found.maximum(scaled=True) * 1e6 for label, found in procedure.sensitivities.items()}
    off, turned = frame_error(procedure.registration.T_tracker_base, procedure.truth.T_tracker_base)
    covered = {(p.campaign, p.model, p.where): p.share_inside(0.95) for p in procedure.predictions}
    return {
        "robot": procedure.model.robot.name,
        "seed": procedure.seed,
        "poses": {label: len(campaign) for label, campaign in procedure.campaigns.items()},
        "mechanism": {key: getattr(mechanism, key) for key in ("motorised", "passive", "mobility", "overconstraint")},
        "parameters": [
            {
                **{key: getattr(row, key) for key in ("name", "symbol", "published", "repeats", "eliminated")},
                "largest_influence_um": {label: values[:, i] for label, values in influences.items()},
            }
            for i, row in enumerate(procedure.elimination.rows)
        ],
        "elimination": {
            label: {key: getattr(found, key) for key in ("rank", "kept", "zero", "dependent", "condition_number")}
            for label, found in procedure.elimination.eliminations.items()
        },
        "registration": {
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
        },
        "fits": [
            {
                **{key: getattr(fit, key) for key in ("campaign", "model", "parameters")},
                **{key: _errors_json(getattr(fit, key)) for key in ("residual", "inside", "outside")},
                "inside_95": covered[fit.campaign, fit.model, INSIDE],
                "outside_95": covered[fit.campaign, fit.model, OUTSIDE],
            }
            for fit in procedure.fits
        ],
    }


def _errors_json(errors: Validation) -> dict[str, float]:
    summary = errors.summary()
    return {key: summary[key] for key in ("mean_mm", "max_mm", "max_x_mm", "max_y_mm", "max_z_mm")}


# Tables, the same for the page and for the terminal.

PUBLISHED_RESIDUALS = (180.3e-6, 95.7e-6, 122.2e-6, 91.9e-6)
"""Largest residuals in space and on X, Y, Z of Gutiérrez et al., measured robot, 33 parameters, metres."""


def overview(procedure: Procedure) -> tuple[TextTable, ...]:
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


def micrometres(label: str, value: str | Callable[[Any], object], form: str = ".1f") -> Column:
    """A column of lengths in metres."""
    return Column(label, value, form, 1e6)


def tabulate_model(model: ErrorModel) -> TextTable:
    """All parameters at a glance: a row per frame, the publication's symbols in the cells."""
    frames: dict[str, dict[str, str]] = {}
    for p in model.parameters:
        frame, component = p.name.split(".")
        frames.setdefault(frame, {})[component] = p.symbol or "·"
    width = len(COMPONENTS)
    rows: list[tuple[str, ...]] = []
    for frame, own in frames.items():
        others = [f"{component} = {symbol}" for component, symbol in own.items() if component not in COMPONENTS]
        cells = others or [own.get(component, "") for component in COMPONENTS]
        rows.append((frame, *cells, *[""] * (width - len(cells))))
    return TextTable.of_rows(
        f"The model's {len(model)} parameters",
        ("frame", *COMPONENTS),
        rows,
        text_columns=tuple(range(width + 1)),
        note="Rows and columns make our name (J3.ry), cells hold the publication's symbol (psi3). Translations t and "
        "rotations r of each joint's frame about its own axes, then of the tool's; the loop has three lengths.",
    )


def tabulate_influences(procedure: Procedure, limit: int | None = None) -> TextTable:
    """Largest influence of each parameter at its tolerance; with a limit, only the largest in space."""
    sets, parameters = procedure.sensitivities, procedure.model.parameters
    values = {
        label: np.vstack([found.maximum(scaled=True), found.maximum_in_space(scaled=True)])
        for label, found in sets.items()
    }
    order = list(range(len(parameters)))
    if limit is not None:
        order = sorted(order, key=lambda i: -max(float(each[3, i]) for each in values.values()))[:limit]
    columns = [
        Column("parameter", lambda i: parameters[i].label),
        *([Column("tolerance", lambda i: parameters[i].stated_tolerance, "s")] if limit is None else []),
        *(
            micrometres(f"{axis}\n{'one' if label == ONE else label}", row.__getitem__, ".0f")
            for label, each in values.items()
            for axis, row in zip(("X", "Y", "Z", "space"), each, strict=True)
        ),
    ]
    return TextTable.of(
        "Largest influence on the TCP (µm)" + ("" if limit is None else f": the {limit} strongest parameters"),
        columns,
        order,
        note="What a geometric error of one tolerance (1σ) does along the robot's base axes and in 3D, over the poses measured "
        f"in {' and in '.join(sets)}.",
        folded=limit is None,
    )


def tabulate_counts(procedure: Procedure) -> TextTable:
    """Tabulate the numbers of published and of identifiable parameters."""
    table, total = procedure.elimination, len(procedure.model)
    published, repeats = [row.published for row in table.rows], [row.repeats for row in table.rows]
    counts = [
        ("as published", sum(said in ("redundant", "dropped") for said in published), published.count("zero"), None),
        ("repeats of one other", sum(said not in ("", "zero") for said in repeats), repeats.count("zero"), None),
        *(
            (f"full elimination, {label}", len(found.dependent), len(found.zero), found.condition_number)
            for label, found in table.eliminations.items()
        ),
    ]
    columns = (
        Column("by", lambda row: row[0]),
        Column("redundant", lambda row: row[1], "d"),
        Column("no effect", lambda row: row[2], "d"),
        Column("remain", lambda row: total - row[1] - row[2], "d"),
        Column("condition", lambda row: row[3], ".0f"),
    )
    return TextTable.of(
        f"What remains of the {total} parameters",
        columns,
        counts,
        note="“Repeats of one other” finds parameters that act exactly like one other; “full elimination” also finds "
        "those that equal a combination of several. The publication calls psi5 redundant and drops alf6, which acts "
        "alike. The condition number is that of the remaining columns, scaled "
        "to unit length: the larger, the harder to tell them apart.",
    )


def tabulate_relations(procedure: Procedure) -> TextTable:
    """Tabulate the parameters of the published reduced model that depend on others, with their relations."""
    kept, sets = set(published_kept(procedure.model)), procedure.elimination.eliminations

    def relation(label: str) -> Column:
        return Column(
            label,
            lambda row: "independent" if row.eliminated[label] == "kept" else f"= {row.eliminated[label]}",
        )

    return TextTable.of(
        f"Of the published {len(kept)}, these repeat others",
        (Column("parameter", lambda row: f"{row.name} ({row.symbol})"), *map(relation, sets)),
        [row for row in procedure.elimination.rows if row.name in kept and set(row.eliminated.values()) != {"kept"}],
        note="A combination moves the TCP exactly as the parameter does, at every pose of the set, to first "
        "order. Coefficients are in metres and radians: 0.3·t1z means 0.3 mm of t1z for 1 mrad of the parameter.",
    )


def tabulate_elimination(procedure: Procedure) -> TextTable:
    """Every parameter: what was published of it, and what each set of poses says."""
    return tabulate_all_eliminated(
        procedure.elimination,
        note="“Equal to” names the one other parameter that it equals at all poses; the last columns say what full "
        "elimination from left to right finds: kept, zero, or the combination that it equals.",
    )


def _by_campaign(procedure: Procedure, rows: Callable[[str], Sequence[Any]]) -> dict[str, Sequence[Any]]:
    """Rows of a table for each campaign, by the heading of their group."""
    return {f"measured in {campaign}": rows(campaign) for campaign in procedure.campaigns}


def _fits_of(procedure: Procedure) -> dict[str, Sequence[Fitted]]:
    return _by_campaign(procedure, lambda campaign: [f for f in procedure.fits if f.campaign == campaign])


def tabulate_registration(procedure: Procedure) -> TextTable:
    """Tracker frame and target from circles, held, beside the fit that finds them by itself."""
    kept, true = len(published_kept(procedure.model)), procedure.truth.T_tracker_base
    starts = {
        "circles, held": CIRCLES,
        "in the fit": f"published {kept}, damped",
        "in the fit, prior": f"published {kept}, prior",
    }

    def off(row: tuple[str, Fitted]) -> tuple[float, float]:
        return frame_error(row[1].calibration.T_tracker_base, true)

    columns = (
        Column("tracker frame and target", lambda row: row[0]),
        Column("base off\nmm", lambda row: off(row)[0], ".3f", 1e3),
        Column("turned\nmrad", lambda row: off(row)[1], ".3f", 1e3),
        *(
            micrometres(f"{key}\nµm", lambda row, key=key: getattr(row[1], key).mean)
            for key in ("residual", "inside", "outside")
        ),
    )
    return TextTable.of(
        f"Registration of the tracker, with the published {kept}",
        columns,
        _by_campaign(
            procedure, lambda campaign: [(name, procedure.fit(campaign, start)) for name, start in starts.items()]
        ),
        note=f"Circles: {len(procedure.sweeps)} more poses in which one motor turns at a time, as in the publication's figure 6; "
        "what they give is held in the fit. How far the base is from where it truly is says little: J1 and the base "
        "cannot be told apart, and the first may stand for the second. Mean residual, and mean error on new poses, 3D.",
    )


def tabulate_residuals(procedure: Procedure) -> TextTable:
    """Tabulate the fit residuals of each model."""
    fitted = {
        heading: [(f.model, f.parameters, e.mean, e.maximum, *e.per_axis) for f in fits for e in (f.residual,)]
        for heading, fits in _fits_of(procedure).items()
    }
    columns = (
        Column("model", lambda row: row[0]),
        Column("fitted", lambda row: row[1], "d"),
        *(micrometres(name, lambda row, k=k: row[k]) for k, name in enumerate(("mean", "max", "X", "Y", "Z"), 2)),
    )
    return TextTable.of(
        "Residuals on the measured poses (µm)",
        columns,
        {**fitted, "real robot, as published": [("published 33", 33, None, *PUBLISHED_RESIDUALS)]},
        note="Measured less predicted: mean and largest 3D error, largest on each axis of the robot's base. “fitted” "
        "counts the model's parameters; tracker frame and target are fitted with them, but where circles are held. “Lengths” is "
        "the publication's first model: the nominal lengths alone.",
    )


def tabulate_held_out(procedure: Procedure) -> TextTable:
    """Errors on poses that were not measured, for every model."""
    sizes = {"mean": "mean", "max": "maximum"}
    columns = (
        Column("model", "model"),
        *(
            micrometres(f"{where}\n{name}", lambda fit, where=where, size=size: getattr(getattr(fit, where), size))
            for where in ("inside", "outside")
            for name, size in sizes.items()
        ),
    )
    return TextTable.of(
        "Errors on new poses (µm)",
        columns,
        _fits_of(procedure),
        note="True less predicted TCP in the tracker frame, 3D. Inside: new poses in the workspace and the "
        "orientations that were measured. Outside: the same workspace with the tool tilted by up to 40° from the "
        "single orientation, and turned by up to 40° about its axis.",
    )


def tabulate_parameters(procedure: Procedure) -> TextTable:
    """Estimates of the whole model beside the truth."""
    parameters = procedure.model.parameters

    def estimate(label: str) -> Column:
        found = procedure.whole[label]

        def cell(i: int) -> str:
            factor = parameters[i].shown.factor
            return f"{found.estimate[i] * factor:.3f} ({found.standard_errors[i] * factor:.3f})"

        return Column(label, cell, "s")

    columns = (
        Column("parameter", lambda i: parameters[i].label),
        Column("unit", lambda i: parameters[i].shown.name),
        Column("truth", lambda i: procedure.truth.x[i] * parameters[i].shown.factor, ".3f"),
        *map(estimate, procedure.whole),
    )
    return TextTable.of(
        f"All {len(parameters)} parameters: estimates and truth",
        columns,
        range(len(parameters)),
        note="Estimate with its standard error in brackets, identified with the prior.",
        folded=True,
    )


# Figures of predictions on poses that were not measured: how large the errors are, where, and whether it was
# foreseen.

LEVELS = np.linspace(0.0, 1.0, 101)


def draw_held_out(fits: Sequence[Fitted]) -> Figure:
    """Mean and largest error of every model, inside the measured orientations and outside."""
    places = {"inside": "same orientations", "outside": "turned farther"}
    panels: list[Panel] = []
    for campaign in dict.fromkeys(f.campaign for f in fits):
        mine = [f for f in fits if f.campaign == campaign]
        for where, title in places.items():
            mean, largest = (
                np.array([getattr(getattr(f, where), of) for f in mine]) * 1e6 for of in ("mean", "maximum")
            )
            series = (
                Series(name="mean", x=mean, y=range(len(mine)), low=mean, high=largest),
                Series(name="largest", x=largest, y=range(len(mine)), colour=VERMILION, shape="diamond"),
            )
            x = Axis(title="error of the predicted TCP", unit="µm", log=True)
            y = Axis(categories=tuple(f.model for f in mine))
            panels.append(Panel(title=f"measured in {campaign}: {title}", x=x, y=y, series=series))
    return Figure(panels=tuple(panels), columns=2, shared="x")


def draw_error_over_angle(predictions: Sequence[Predictions]) -> Figure:
    """Error of every new pose over the rotation of its tool from the one measured orientation."""
    series: list[Series] = []
    for k, label in enumerate(dict.fromkeys(_fit_label(p) for p in predictions)):
        mine = [p for p in predictions if _fit_label(p) == label]
        angle, length = (np.concatenate([getattr(p, key) for p in mine]) for key in ("angle", "length"))
        colour, shape = SERIES[k % len(SERIES)], SHAPES[k % len(SHAPES)]
        series.append(Series(name=label, x=np.degrees(angle), y=length * 1e6, colour=colour, shape=shape))
    x = Axis(title="rotation of the tool from the single measured orientation", unit="°")
    y = Axis(title="error of the predicted TCP", unit="µm", log=True)
    return Figure(panels=(Panel(x=x, y=y, series=tuple(series), height=340.0),))


def draw_coverage(predictions: Sequence[Predictions]) -> Figure:
    """Whether errors are as large as was stated: beside the stated uncertainty, and inside the stated ellipsoids."""
    limits = chdtri(3, 1.0 - LEVELS)
    poses: list[Series] = []
    shares: list[Series] = []
    for k, p in enumerate(predictions):
        name, colour = f"{_fit_label(p)}; {p.where}", SERIES[k % len(SERIES)]
        inside = 100.0 * np.mean(p.squared_distance[:, None] <= limits, axis=0)
        shape = SHAPES[k % len(SHAPES)]
        poses.append(Series(name=name, x=p.stated * 1e6, y=p.length * 1e6, colour=colour, shape=shape))
        shares.append(Series(kind="line", name=name, x=100.0 * LEVELS, y=inside, colour=colour))
    stated = np.concatenate([p.stated for p in predictions]) * 1e6
    diagonals = (
        Series(kind="line", name="as stated", x=ends, y=ends, colour=INK, dash=True)
        for ends in ([stated.min(), stated.max()], [0.0, 100.0])
    )
    left, right = ((*series, diagonal) for series, diagonal in zip((poses, shares), diagonals, strict=True))
    panels = (
        Panel(
            title="pose by pose",
            x=Axis(title="stated standard uncertainty in space", unit="µm", log=True),
            y=Axis(title="actual error in space", unit="µm", log=True),
            series=left,
            height=320.0,
        ),
        Panel(
            title="share inside the stated ellipsoid",
            x=Axis(title="stated probability", unit="%", span=(0.0, 100.0)),
            y=Axis(title="new poses inside", unit="%", span=(0.0, 100.0)),
            series=right,
            height=320.0,
        ),
    )
    return Figure(panels=panels, columns=2)


def draw_workspace(predictions: Sequence[Predictions], measured: Mapping[str, Float[np.ndarray, "n 3"]]) -> Viewer:
    """New poses where they are in the workspace, coloured by the error of their prediction; the first is shown at first.

    Args:
        predictions: layers to choose from; all share one logarithmic scale of colours.
        measured: for each campaign, the TCPs that were measured, in the base, metres.
    """
    top = float(np.ceil(2.0 * np.log10(max(p.length.max() for p in predictions) * 1e6)) / 2.0)
    layers = [
        {
            **coloured_points(
                f"{_fit_label(p)}; {p.where}",
                p.position,
                np.log10(np.maximum(p.length * 1e6, 1e-3)),
                (0.0, top),
                [f"{e:.1f} µm, turned {a:.0f}°" for e, a in zip(p.length * 1e6, np.degrees(p.angle), strict=True)],
            ),
            "off": k > 0,
        }
        for k, p in enumerate(predictions)
    ]
    layers += [
        {
            "kind": "points", "label": f"measured poses, {name}", "colour": GREY, "size": 2.2, "square": True,
            "at": to_mm(points), "off": name != predictions[0].campaign,
        }
        for name, points in measured.items()
    ]  # fmt: skip
    return Viewer(
        title="Where the errors are in the workspace",
        layers=tuple(layers),
        note=f"Dark 1 µm to bright {10.0**top:.0f} µm, logarithmic, in all layers alike; squares are the measured poses, in base "
        "coordinates.",
    )


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


# The sections of the page.


def procedure_page(procedure: Procedure, *, next_steps: str) -> Report:
    """Make the page of a run of the procedure.

    Args:
        procedure: what was found.
        next_steps: commands to go on with.
    """
    model = procedure.model
    return Report(
        title="Adapting a robot's geometric model to its task",
        sections=(
            _summary(procedure),
            _mechanism(procedure),
            _sensitivity(procedure),
            _elimination(procedure),
            _identification(procedure),
            _held_out(procedure),
            _uncertainty(procedure),
            _parameters(procedure),
            Section(
                "Your own robot",
                "The same with your robot: measure some sixty poses in the task's workspace, with the tool orientations of the "
                "task and somewhat more, and hold a few poses out.",
                Commands(next_steps),
            ),
        ),
        lead=f"The procedure of Gutiérrez, Chanal, Durieux and Duc on a virtual {model.robot.title or model.robot.name}, "
        "and what goes past it.",
        source=f"seed {procedure.seed}; robot {model.robot.name}, {len(next(iter(procedure.campaigns.values())))} poses in each "
        "campaign. The publication: Gutiérrez, Chanal, Durieux, Duc, Adaptation of the geometric model of a 6 dof serial robot to "
        "the task space",
    )


def _summary(procedure: Procedure) -> Section:
    one, several = (procedure.fit(label, "all") for label in (ONE, SEVERAL))
    rank = procedure.elimination.eliminations[ONE].rank
    nominal = procedure.fit(SEVERAL, "nominal").inside.mean
    return Section(
        "Summary",
        Numbers(
            (f"{rank} of {len(procedure.model)}", "", "parameters identifiable in one orientation"),
            (um(nominal), "µm", f"mean 3D error in {SEVERAL}, nominal (registered)"),
            (um(several.inside.mean), "µm", f"mean 3D error, calibrated in {SEVERAL}, at held-out poses there"),
            (um(one.outside.mean), "µm", "mean 3D error, calibrated in one orientation, at other orientations"),
        ),
        Bullets(*summary_points(procedure)),
        "The robot is virtual: its geometric errors are drawn from the tolerances (one standard deviation: 0.3 mm and 0.3 mrad "
        "unless its file says otherwise) and its tracker has the noise of a Leica AT901, ±(15 µm + 6 µm/m) taken as two standard "
        "deviations. So the truth is known, and errors are errors, not residuals. It does not bend, warm up or backlash; a real "
        "robot leaves more.",
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


def _mechanism(procedure: Procedure) -> Section:
    found, model = procedure.mechanism, procedure.model
    lengths = ", ".join(
        f"{part.symbol} {1e3 * float(np.linalg.norm(part.transform[:3, 3])):g}"
        for joint in model.robot.joints
        for part in joint.before
        if part.symbol
    )
    columns = (
        Column("parameter", "name"),
        Column("symbol", "symbol"),
        Column("tolerance (1σ)", "stated_tolerance", "s"),
    )
    return Section(
        "Mechanism and model",
        f"{found.explanation[0].upper()}{found.explanation[1:]}.",
        f"The nominal model has the lengths {lengths} mm." if lengths else None,
        "Every geometric error that the mechanism leaves free is a parameter.",
        tabulate_model(model),
        TextTable.of("All parameters with their tolerances", columns, model.parameters, folded=True),
    )


def _sensitivity(procedure: Procedure) -> Section:
    return Section(
        "Sensitivity",
        "How far does each geometric error move the TCP? The sensitivity S = ∂X/∂ξ answers at every pose; shown is its largest "
        "value over the measured poses. Scaled by the tolerance, it is the error to expect from that geometric error alone. A "
        "large influence does not make a parameter identifiable: the next section says why.",
        Chart(
            "Largest influence of each parameter on X, Y and Z",
            draw_sensitivities(procedure.sensitivities, procedure.elimination.eliminations),
            "Along the robot's base axes. Empty marks: parameters that repeat others at these poses. Influence of a geometric "
            "error as large as its tolerance, or per unit.",
        ),
        tabulate_influences(procedure),
    )


def _elimination(procedure: Procedure) -> Section:
    kept, eliminations = published_kept(procedure.model), procedure.elimination.eliminations
    said = " and ".join(
        f"{sum(name not in found.kept for name in kept)} in {label}" for label, found in eliminations.items()
    )
    gaps = "; ".join(
        f"in {label} the last that counts is {power_text(last)}, the next {power_text(following)}"
        for label, found in eliminations.items()
        if 0 < found.rank < len(found.singular_values)
        for last, following in [found.singular_values[found.rank - 1 : found.rank + 1]]
    )
    return Section(
        "Identifiable parameters",
        "Two parameters that move the TCP in the same way at every pose are not separable, however good the tracker. Gaussian "
        "elimination of the stacked sensitivities finds them, and the relations between them.",
        f"The published {len(kept)} are not all identifiable: of them, {said} repeat others. A least-squares fit without prior has "
        "no unique answer for these; only its damping keeps them from running away.",
        tabulate_counts(procedure),
        tabulate_relations(procedure),
        Chart(
            "Singular values of the stacked sensitivities",
            draw_singular_values(eliminations),
            f"Filled: counted as rank. The gap is clear: {gaps}. Below it there is only rounding. Values under 10⁻¹⁸ are "
            "drawn there.",
        ),
        tabulate_elimination(procedure),
    )


def _identification(procedure: Procedure) -> Section:
    """Fitted parameters and fit residuals of each model."""
    panels = {
        label: {f.model: f.calibration for f in procedure.fits if f.campaign == label} for label in procedure.campaigns
    }
    return Section(
        "Identification and residuals",
        "The tracker frame and the target are fitted together with the parameters; nothing has to be registered beforehand. The "
        "publication registers the tracker from circles that single motors draw; that way, held, stands beside it. “Damped, no "
        "prior” is after the published way, Levenberg–Marquardt without a prior; it ends early, once the objective falls by less "
        "than a millionth of itself or the next step is small beside the standard errors.",
        "All models of geometric errors with fitted frames leave nearly the same residuals, close to the tracker's noise; the "
        "lengths alone do not. Residuals therefore cannot say which model is better; new poses can. The published residuals are "
        "those of a real robot, with gravity and all else that geometry does not explain, so they are larger.",
        tabulate_registration(procedure),
        tabulate_residuals(procedure),
        Chart(
            "Residuals, pose by pose",
            draw_residuals(panels, "all", MICROMETRES),
            "Measured less predicted, along the robot's base axes, by each model.",
        ),
    )


def _undamped(procedure: Procedure) -> list[Predictions]:
    """Predictions of the published model, fitted in one orientation without a prior."""
    start = f"published {len(published_kept(procedure.model))}, damped"
    return [p for p in procedure.predictions if p.model.startswith(start) and p.campaign == ONE]


def _of_whole(procedure: Procedure) -> list[Predictions]:
    """Predictions of the models with all parameters."""
    return [p for p in procedure.predictions if p.model.startswith("all")]


def _held_out(procedure: Procedure) -> Section:
    """Errors on poses that were not measured."""
    whole = _of_whole(procedure)
    base = {label: found.T[:, :3, 3] for label, found in procedure.poses.items()}
    return Section(
        "Errors at held-out poses",
        "Predictions of each model are compared with the true robot at new poses. In the measured orientation even a redundant "
        "model predicts well: its dependent parameters have equal effects there.",
        "One orientation is good inside and poor outside for a simple reason. With the tool always turned alike, geometric errors "
        "of the wrist and the tool move the TCP like geometric errors of the arm. The fit may blame either; when the tool turns, "
        "the two part company. No fit can repair that, only measuring in several orientations. Without prior the blame goes "
        "anywhere; with it, to where the tolerances make it likely, which need not be where it belongs: with another seed the "
        "prior helps more, or not at all.",
        tabulate_held_out(procedure),
        Chart(
            "Mean and largest error of each model on new poses",
            draw_held_out(procedure.fits),
            "Logarithmic scale. Same orientations: those of the campaign. Turned farther: tilted by up to 40° and "
            "turned by up to 40° about the tool's axis. The largest errors can come from poses near the wrist's "
            "singularity, where its joints turn farther than at any measured pose.",
        ),
        Chart(
            "Error against the rotation of the tool",
            draw_error_over_angle([*whole, *_undamped(procedure)]),
            "Every point is a new pose. Measured in one orientation, the error grows with the rotation away from it.",
        ),
        draw_workspace(whole, base),
    )


def _uncertainty(procedure: Procedure) -> Section:
    """Stated uncertainty compared with the errors."""
    chosen = _of_whole(procedure)
    far, undamped = (
        next(p for p in some if p.campaign == ONE and p.where == OUTSIDE) for some in (chosen, _undamped(procedure))
    )
    stated, actual, stated_without, actual_without = (
        length_text(rms(getattr(p, key))) for p in (far, undamped) for key in ("stated", "length")
    )
    columns = (
        Column("calibration", lambda p: f"{p.model}, {p.campaign}"),
        Column("new poses", "where"),
        micrometres("stated", lambda p: rms(p.stated)),
        micrometres("actual", lambda p: rms(p.length)),
        Column("in 95 % ellipsoid", lambda p: 100 * p.share_inside(0.95), ".0f"),
    )
    return Section(
        "Does the calibration know how wrong it is?",
        "A calibration states an uncertainty for every pose, measured or not: an ellipsoid about the predicted TCP. It "
        "comes from the tracker's noise, from the poses that were measured and from the prior.",
        f"With the prior, the statement grows where the tool turns away from what was measured ({stated} stated, {actual} actual, "
        "root mean square). Out there it rests on the tolerances, not on measurements, and one robot can be luckier or unluckier "
        "than its tolerances say; where poses were measured it rests on them. Without prior, nothing holds the directions that the "
        f"poses do not determine, and the statement means nothing: {stated_without} stated, {actual_without} actual.",
        "All errors here come from one robot and one campaign, so they rise and fall together: a curve may leave the diagonal by "
        "chance. Another seed draws another robot, and gives other curves.",
        TextTable.of(
            "Stated uncertainty and actual error (µm, root mean square in space), and share inside (%)",
            columns,
            [*chosen, undamped],
            note="Where the statement is right, stated and actual agree, and 95 % of the poses lie inside.",
        ),
        Chart(
            "Stated uncertainty against actual error",
            draw_coverage(chosen),
            "Left: points about the dashed line are as wrong as stated. Right: a curve above the dashed line is "
            "cautious, one below it overconfident.",
        ),
    )


def _parameters(procedure: Procedure) -> Section:
    """Estimates beside the truth."""
    return Section(
        "Estimated parameters",
        "Parameters that repeat each other share what is found; their standard errors stay near the tolerance and say so. "
        "Combinations that matter to the TCP are known far better than any one of them. J1.tz and J1.rz repeat the tracker "
        "frame, which is fitted too. Read the predictions, not the single parameters.",
        Chart(
            "Estimated parameters and the truth",
            draw_parameters(procedure.whole, procedure.truth.x),
            "All parameters with their prior. Bars are two standard errors: about one truth in twenty lies outside.",
        ),
        tabulate_parameters(procedure),
    )
