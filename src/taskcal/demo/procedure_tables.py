"""Tables of the published procedure, the same for the page and for the terminal."""

from taskcal.analysis.elimination_table import published_kept
from taskcal.demo.procedure import CIRCLES, ONE, Errors, Procedure, frame_error
from taskcal.report.content import Table
from taskcal.robot.error_model import COMPONENTS, ErrorModel
from taskcal.robot.parameter import Parameter

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
    """How many parameters the publication keeps, and how many can be told apart."""
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
    """Those of the published reduced model that repeat others, and what they repeat."""
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
    """What each model leaves of the measurements that it was fitted to."""
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
