"""``taskcal identify``: a campaign in, a calibration out."""

import math
import re
import shlex
from collections import defaultdict
from collections.abc import Collection, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.campaign import CampaignOptions
from taskcal.cli.options.common import CampaignsArgument, OutputOptions, RobotOption, read_effects
from taskcal.cli.options.fit import FitCommandOptions, HoldoutOptions
from taskcal.cli.output import info, placement, say, show, show_facts, started_as, tell
from taskcal.cli.progress import bar_by_parts, bar_over
from taskcal.errors import CampaignError, FileError, FitError, TaskcalError
from taskcal.report.content import Column, Table, describe_effective, millimetres

if TYPE_CHECKING:
    from taskcal.identification.chunked_fit import ChunkedFit, ErrorsOfMany
    from taskcal.robot.effects import Effect


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Additions to the geometry."""

    effects: str = option(
        "none",
        "auto|none|LIST",
        "Non-geometric effects: 'auto' estimates all of them with their variances; a list adds the named effects without a "
        "significance test. None by default.",
    )
    field: bool = option(False, help="Try a smooth function of all joints at each joint, which 'auto' includes.")

    @property
    def searching(self) -> bool:
        """Whether anything but the geometry is asked for."""
        return self.field or self.effects != "none"


def command(
    *,
    campaign: CampaignsArgument,
    robot: RobotOption,
    output: Path = option(..., "CAL.json", "Output: the calibration.", also="-o"),
    holdout: HoldoutOptions,
    search: SearchOptions,
    fitting: FitCommandOptions,
    reading: CampaignOptions,
    parameters: bool = option(False, help="List the identified parameters."),
    out: OutputOptions,
) -> None:
    """Identify a robot's parameters, tracker frame and targets from a campaign.

    Rows excluded by --rows or --holdout are predicted and reported beside the fitted ones. With --folds, each row is predicted
    once, by a fit of the other parts.

    With --effects or --field, every step is cross-validated on the fitted rows; a table compares the models.
    """
    if reading.rows is not None and holdout.asked:
        raise typer.BadParameter(
            "use --rows or --holdout/--folds, not both: rows outside --rows are already held out",
            param_hint="--rows / --holdout, --folds",
        )
    if search.effects == "auto" and fitting.prior == "none":
        raise typer.BadParameter(
            "'auto' weighs effects by their evidence, which needs a prior; list the effects, or omit --prior none",
            param_hint="--effects / --prior",
        )
    effects = read_effects(search.effects) if search.searching else []
    inputs = [*campaign, robot, reading.points, reading.rows, fitting.registration_file, fitting.like]
    detecting = reading.images is not None and reading.images.is_dir()
    seen = output.with_suffix(".corners.csv") if detecting else None
    outputs = out.begin(
        "identify", [("--output", output), ("--images", seen)], [*inputs, reading.images, reading.board, reading.camera]
    )
    if any(map(has_too_many_rows, campaign)):
        if len(campaign) > 1:
            raise typer.BadParameter(
                f"a file of more than {WHOLE_ROWS} rows is fitted in parts, and alone; thin out its rows to join stations",
                param_hint="CAMPAIGN.csv",
            )
        refuse_what_needs_all_rows([reading, holdout, fitting, search], but=["mpe_to_sigma"])
        chunked, result = identify_parts(campaign[0], robot, fitting.noise())
        outputs.write({output: chunked.calibration.to_text()})
        result = {"calibration": output, **result}
        out.give(result, lambda: show_parts(result, chunked, parameters=parameters))
        return

    described = taskcal.load_robot(robot)
    from taskcal.identification.effects import tracker_error
    from taskcal.reading.writer import corners_text

    corners = reading.find_corners()
    stated = reading.read_options if corners is None else replace(reading.read_options, images=corners)
    with _explained(campaign, described, stated, FileError, CampaignError):
        read = reading.read(campaign, described, noise=fitting.noise(), corners=corners)

    model = taskcal.ErrorModel(described, lengths_only=fitting.lengths_only)
    if fitting.mpe_to_sigma is not None and read.whole.uncertainty is not None:
        info("--mpe-to-sigma has no effect: the campaign states its own uncertainties (u_mm)")
    fit = _Fit(model=model, fitting=fitting, search=search, effects=effects, seed=holdout.seed, fits=holdout.fits)
    with _explained(campaign, described, stated, CampaignError, FitError):
        calibration = holdout.fit(read, fit, fit.nominal, fitting.noise())
    for remark in calibration.remarks:
        info(remark)
    outputs.write({output: calibration.to_text(), seen: "" if corners is None else corners_text(corners)})

    fitted = read.whole.take(holdout.fitted_rows(read))
    result = {"calibration": output, **report(calibration, fitted, fit), "drift": read.drift, **_effects(fit)}
    result |= {} if seen is None else {"corners": seen}

    def show_all() -> None:
        tracker_mm = tracker_error(fitted, fitting.noise()) * 1e3
        again = reading.named_images(campaign)
        show_report(calibration, result, tracker_mm=tracker_mm, parameters=parameters, again=again)
        if fit.explanation is not None:
            show_explanation(fit.explanation)

    out.give(result, show_all)


@contextmanager
def _explained(
    campaign: Sequence[Path],
    robot: "taskcal.Robot",
    stated: "taskcal.reading.ReadOptions",
    *refusals: type[TaskcalError],
) -> Generator[None, None, None]:
    """Add to a refusal of the campaign what the doctor finds."""
    try:
        yield
    except refusals as refusal:
        if isinstance(refusal, FileError) and refusal.path not in map(str, campaign):
            raise  # of another file, of rows or points, which no diagnosis explains
        from taskcal.cli.commands.doctor import with_first_finding

        raise TaskcalError(with_first_finding(refusal, campaign, robot, stated)) from refusal


@dataclass(kw_only=True)
class _Fit:
    """The fit of some rows of the campaign; the first one is that of the calibration."""

    model: "taskcal.ErrorModel"
    fitting: FitCommandOptions
    search: SearchOptions
    effects: "list[Effect] | None"
    seed: int
    fits: int
    explanation: "taskcal.identification.Explanation | None" = None
    done: int = 0

    def __call__(self, measured: "taskcal.Campaign") -> "taskcal.Calibration":
        """Fit all rows of a campaign."""
        options = self.fitting.options(self.model, measured)
        self.done += 1
        fold = f"fold {self.done - 1} of {self.fits - 1}"
        if not self.search.searching:
            step = "identification" if self.done == 1 else fold
            with bar_by_parts(step) as show_step:
                show_step(step, self.done - 1, self.fits)
                return taskcal.identify(self.model, measured, options=options)
        from taskcal.identification.effects import search_steps

        for effect in self.effects or ():
            measured.check_told(effect.needs, effect.key)
        effects = None if self.effects is None else [one.referred(measured.conditions) for one in self.effects]
        search = taskcal.identification.EffectSearch(effects=effects, field=self.search.field, seed=self.seed)
        part = f"{fold}: " if self.done > 1 else ""
        with bar_over([f"{part}{step}" for step in search_steps(self.model, measured, search)]) as begin:
            explanation = taskcal.identification.select_effects(
                self.model, measured, search, options=options, progress=lambda step: begin(f"{part}{step}")
            )
        self.explanation = self.explanation or explanation
        return explanation.calibration

    def nominal(self, measured: "taskcal.Campaign") -> "taskcal.Calibration":
        """Fit tracker frame and targets of the nominal robot."""
        return taskcal.identification.fit_nominal(self.model, measured, self.fitting.options(self.model, measured))


# The result for machines.


def report(calibration: "taskcal.Calibration", measured: "taskcal.Campaign", fit: _Fit) -> dict[str, Any]:
    """A fit in millimetres and milliradians.

    Args:
        calibration: the fit.
        measured: the rows that were fitted, gross errors among them.
        fit: fits tracker frame and targets of the nominal robot.
    """
    from taskcal.identification.calibration import list_unknowns
    from taskcal.report.calibration import describe_unobservable
    from taskcal.report.camera import describe_camera
    from taskcal.report.content import model_error_origin, prior_scale_origin

    wrong = {row.id for row in calibration.left_out}
    right = measured.take([i for i, name in enumerate(measured.ids) if name not in wrong])
    held_out, registration = calibration.held_out, calibration.layout.registration
    before = taskcal.validate(fit.nominal(right), right) if held_out is None else held_out.nominal_validation
    tracked = calibration.layout.base_size > 0  # else the measuring frame is the robot's base
    return {
        **calibration.summary(),
        "rows": len(measured),
        "nominal": before.summary(),
        "fitted": taskcal.validate(calibration, right).summary(),
        "held_out": None if held_out is None else held_out.validation.summary(),
        "holdout": None if held_out is None else held_out.summary(),
        "model_error_origin": model_error_origin(calibration),
        "prior_scale_origin": prior_scale_origin(calibration) or None,
        "tracker_frame": placement(calibration.T_tracker_base) if tracked else None,
        "observations": list_unknowns(calibration),
        **describe_camera(calibration, right),
        "registration": {"method": registration.method, "file": registration.file or None},
        "targets": {
            name: {**placement(T), "located": not unlocated, "unlocated": unlocated or None}
            for name, T, unlocated in zip(
                calibration.targets, calibration.T_tool_target, describe_unobservable(registration), strict=True
            )
        },
    }


def _effects(fit: _Fit) -> dict[str, Any]:
    explanation = fit.explanation
    if explanation is None:
        return {}
    return {
        "explanation": explanation.summary(),
        "not_tried": dict(explanation.untried),
        "tracker_mm": explanation.tracker * 1e3,
        "collinear": [
            {
                "name": near.name,
                "share": near.share,
                "variance_inflation": near.inflation if math.isfinite(near.inflation) else None,
                "explained_by": dict(near.by),
            }
            for near in explanation.collinearities
        ],
    }


# The result for people: a sentence, next steps, and tables.

MAX_HELD_OUT_RATIO = 1.6
"""Ratio of held-out error to fit residual, beyond which more poses are recommended: the fit has more freedom than its rows."""

MAX_NOISE_RATIO = 2.0
"""Ratio of the error to tracker noise, beyond which non-geometric effects are recommended."""

MAX_NAMED_ROWS = 5
MAX_SHOWN_EFFECTS = 40
"""Parameters of effects that a terminal shows, whatever their significance."""

MIN_SIGNIFICANCE = 2.0
"""Standard errors from zero beyond which more of them are shown: 95 % of a normal distribution."""


def show_report(
    calibration: "taskcal.Calibration",
    result: Mapping[str, Any],
    *,
    tracker_mm: float,
    parameters: bool = False,
    again: str = "",
) -> None:
    """Print a calibration: the verdict, the errors, what to do next, and the rest.

    Args:
        calibration: the fit.
        result: what `report` returns of it.
        tracker_mm: mean 3D error of tracker noise alone.
        parameters: whether to print the parameters, too.
        again: options that name the images again, for a report that shows them.
    """
    from taskcal.identification.options import EXACT
    from taskcal.report import calibration as tables

    held_out = result["held_out"]
    exact = (calibration.model.tolerances <= EXACT).all()  # no robot, but poses that are given
    summaries = {} if exact else {tables.NOMINAL: result["nominal"]}
    summaries["fitted"] = result["fitted"]
    summaries |= {} if held_out is None else {"held out": held_out}
    after, before = (held_out or result["fitted"])["mean_mm"], result["nominal"]["mean_mm"]
    observed, now = calibration.layout.observed, held_out or result["fitted"]
    in_space = all(kind.width - kind.angles in (0, 3) for kind in observed)
    alone = any(kind.width == kind.angles for kind in observed)
    angles = (result["nominal"]["mean_mrad"], now["mean_mrad"]) if alone else None
    seen = held_out and held_out["n"]
    if exact:
        where = "fitted rows, optimistic: none were held out" if seen is None else f"{seen} held-out points"
        say(
            f"{result['robot']}: the mean 3D error is {after:.3f} mm ({where}), of poses that are taken as they are given."
        )
    else:
        say(tables.verdict(result["robot"], before, after, seen, in_space=in_space, angles=angles))
    tell()
    show(tables.tabulate_errors(summaries))
    steps = next_steps(calibration, result, tracker_mm, again)
    show_facts([("next" if number == 0 else "", step) for number, step in enumerate(steps)])
    tell()
    for table in (
        tables.tabulate_stations(calibration),
        tables.tabulate_left_out(calibration),
        tables.tabulate_outliers(calibration),
    ):
        if len(table):
            show(table)
    if parameters:
        _show_parameters(calibration, result)
    held = [] if calibration.held_out is None else [("held out", tables.describe_held_out(calibration.held_out))]
    show_facts([*held, *_facts(result, parameters=parameters)])


def next_steps(
    calibration: "taskcal.Calibration", result: Mapping[str, Any], tracker_mm: float, again: str = ""
) -> list[str]:
    """List the next steps, the most urgent first.

    Args:
        calibration: the fit.
        result: what `report` returns of it.
        tracker_mm: mean 3D error of tracker noise alone.
        again: options that name the images again, for a report that shows them.
    """
    import numpy as np

    from taskcal.report.calibration import are_most

    program, cal, held_out = started_as(), shlex.quote(str(result["calibration"])), result["held_out"]
    steps: list[str] = []
    mostly = are_most(len(calibration.outliers), int(np.isfinite(calibration.studentised).sum()))
    judged = [
        (outlier.row, mostly or alike)
        for outlier, alike in zip(calibration.outliers, calibration.shared_outliers, strict=True)
    ]
    wrong = {row.row for row in calibration.left_out} | {row for row, of_model in judged if not of_model}
    if wrong:
        steps.append(f"measure {_rows(wrong)} again, or leave them out: see below")
    of_model = {row for row, of_model in judged if of_model} - wrong
    if of_model:
        steps.append(
            f"do not measure {_rows(of_model)} again: neighbouring rows deviate alike, so the cause is model error; see below"
        )
    left, fitted = (held_out or result["fitted"])["mean_mm"], result["fitted"]["mean_mm"]
    if held_out is None:
        steps.append("estimate the held-out error: --holdout 0.3, or --folds 5 to use every row")
    elif left > MAX_HELD_OUT_RATIO * fitted:
        steps.append(
            f"measure more poses: the held-out error is {left / fitted:.1f} times the fit residual; {program} plan selects them"
        )
    turning = {
        name
        for name, kind in zip(calibration.targets, calibration.layout.kinds, strict=True)
        if kind.width == kind.angles
    }
    if any(target["unlocated"] for name, target in result["targets"].items() if name not in turning):
        steps.append(
            "measure in several orientations: these poses do not locate every target, so other orientations are uncertain by "
            "centimetres; or state how near to the TCP it sits (--target-within-mm)"
        )
    searched = "explanation" in result or calibration.model.effects
    if not (searched or calibration.model.robot.driven) and left > MAX_NOISE_RATIO * tracker_mm:
        kind = "fitted" if held_out is None else "held-out"
        steps.append(
            f"fit non-geometric effects (--effects auto): {kind} error {left:.3f} mm, tracker noise {tracker_mm:.3f} mm"
        )
    correcting = f"; correct a program: {program} correct -c {cal} PROGRAM" if result["parameters"] else ""
    steps.append(f"full report: {program} report {cal}{again}{correcting}")
    return steps


def _rows(numbers: Collection[int]) -> str:
    rows = sorted(numbers)
    more = f" and {len(rows) - MAX_NAMED_ROWS} more" if len(rows) > MAX_NAMED_ROWS else ""
    return f"rows {', '.join(map(str, rows[:MAX_NAMED_ROWS]))}{more}"


def _show_parameters(calibration: "taskcal.Calibration", result: Mapping[str, Any]) -> None:
    from taskcal.report.calibration import tabulate_parameters

    unclear = _unclear_effects(calibration)
    table = tabulate_parameters(
        calibration, leave_out=lambda name: _HARMONIC.match(name) is not None or name in unclear
    )
    if len(table):
        show(table)
    if unclear:
        say(
            f"{len(unclear)} more parameters of effects, within {MIN_SIGNIFICANCE:g} standard errors of zero or of the smooth "
            "field: see --json"
        )
    show_harmonics(result["parameters"])


def _unclear_effects(calibration: "taskcal.Calibration") -> set[str]:
    """Parameters of effects that have a meaning alone and may be zero; harmonics are shown by their amplitudes."""
    geometry = set(taskcal.ErrorModel(calibration.model.robot).names)
    names = {calibration.model.names[i]: i for i in calibration.estimated}
    effects = {name: i for name, i in names.items() if name not in geometry}
    if len(effects) <= MAX_SHOWN_EFFECTS:
        return set()
    return {
        name
        for name, i in effects.items()
        if not _HARMONIC.match(name)
        and (abs(calibration.estimate[i]) < MIN_SIGNIFICANCE * calibration.standard_errors[i] or ".field_" in name)
    }


def _facts(result: Mapping[str, Any], *, parameters: bool) -> list[tuple[str, str]]:
    from taskcal.report.camera import camera_facts

    scale = result["prior_scale"]
    pairs = [f"{c['a']} and {c['b']} {c['correlation']:+.3f}" for c in result["correlations"]]
    rotation = f" and {result['model_error_mrad']:.3g} mrad" if "model_error_mrad" in result else ""
    held = f", {result['prior_scale_origin']}" if result["prior_scale_origin"] else ""
    unseen = sum(p["seen"] is False for p in result["parameters"])
    fitted = bool(result["parameters"])
    facts = [("prior", f"{unseen} parameters prior-dominated (posterior 1σ ≥ 0.95 prior 1σ)")] if unseen else []
    facts += [
        ("model error", f"{result['model_error_mm']:.3g} mm{rotation} per axis (1σ), {result['model_error_origin']}"),
        *(
            [("prior scale", "no prior" if scale is None else f"{scale:.3g} times the tolerances{held}")]
            if fitted
            else []
        ),
        *([("largest correlations", "; ".join(pairs))] if parameters else []),
        ("tracker frame", _measuring_frame(result)),
    ]
    facts += camera_facts(result)
    for name, target in result["targets"].items():
        unsure = f"; {target['unlocated']}" if target["unlocated"] else ""
        facts.append((f"target {name}", f"at {_point(target)} of the tool frame{unsure}"))
    if parameters:
        ended = f"{result['reason']}; {result['iterations']} iterations in the last of {result['rounds']} rounds"
        facts.append(("convergence", ended))
    elif fitted:
        effective = describe_effective(result["effective_parameters"], result["parameter_groups"])
        facts.append(("parameters", f"{len(result['parameters'])} identified{effective}; --parameters lists them"))
    corners = f", and the corners to {result['corners']}, which --images takes as well" if "corners" in result else ""
    facts.append(("calibration", f"wrote {result['calibration']}{corners}"))
    return facts


def _measuring_frame(result: Mapping[str, Any]) -> str:
    if result["tracker_frame"] is None:
        unknowns = sum(len(one["unknowns"]) for one in result["observations"])
        return f"none: measured in the robot's base, with {unknowns} unknowns of the fixed objects fitted (see --json)"
    file, circles = result["registration"]["file"], result["registration"]["method"] == "circles"
    text = f"base at {_point(result['tracker_frame'])}"
    if not (file or circles):
        return text
    return f"{text}; registered from {f'{file}, ' if file else ''}{'circles' if circles else 'poses'}"


def _point(placed: Mapping[str, Any]) -> str:
    position = " ".join(f"{value:.3f}" for value in placed["position_mm"])
    quaternion = " ".join(f"{value:.6f}" for value in placed["quaternion"])
    return f"{position} mm, quaternion {quaternion}"


# Effects: the comparison of models, and harmonics by their amplitudes.

MAX_HARMONICS = 12
"""Harmonics that are shown, the strongest."""

MAX_NAMED_EFFECTS = 3
MAX_NAMED_COLLINEAR = 4


def show_explanation(explanation: "taskcal.identification.Explanation") -> None:
    """Print the comparison of the models, and the contribution of each effect among all others."""
    title = "Model comparison: mean 3D error, cross-validated, with the standard error (SE) of its change"
    columns = _of_stages("added to the rows above", millimetres("error mm", "cross_validated", ".4f"), "used")
    show(Table.of(title, columns, explanation.steps))
    if explanation.worths:
        title = "Effect contributions: increase of the error when the effect is removed"
        columns = _of_stages("effect", millimetres("increase mm", "worth", ".4f"), "supported")
        show(Table.of(title, columns, explanation.worths))
    facts = [("summary", _sentence(explanation))]
    if explanation.collinearities:
        named = [
            f"{near.name} is {_percent(near.share)} explained by {', '.join(near.by)}"
            for near in explanation.collinearities
        ]
        more = f"; and {len(named) - MAX_NAMED_COLLINEAR} more" if len(named) > MAX_NAMED_COLLINEAR else ""
        facts.append(
            (
                "poorly determined",
                f"at the fitted poses {'; '.join(named[:MAX_NAMED_COLLINEAR])}{more}. Individual values are poorly determined; "
                "predictions at similar poses are unaffected",
            )
        )
    if explanation.untried:
        facts.append(("not tried", "; ".join(f"{name}: {reason}" for name, reason in explanation.untried.items())))
    show_facts(facts)


def _of_stages(label: str, size: Column, accepted: str) -> tuple[Column, ...]:
    return (
        Column(label, "name"),
        Column("parameters", "parameters", "d"),
        size,
        millimetres("SE mm", "standard_error", ".4f"),
        Column(accepted, lambda stage: "yes" if stage.accepted else "no"),
        Column("reason", "reason"),
    )


def _percent(share: float) -> str:
    """Rounded down, so that only an exact repeat is 100 %."""
    return f"{math.floor(min(share + 1e-9, 1.0) * 1e4) / 1e2:g} %"


def _sentence(explanation: "taskcal.identification.Explanation") -> str:
    first, *others = explanation.steps
    steps = [f"geometry {first.cross_validated * 1e3:.4f} mm"]
    for stage in others:
        name = "all effects" if explanation.worths and stage is others[-1] else stage.name
        steps.append(f"with {name} {stage.cross_validated * 1e3:.4f} mm{'' if stage.accepted else ' (not used)'}")
    largest = [stage.name for stage in explanation.worths if stage.accepted][:MAX_NAMED_EFFECTS]
    if largest:
        steps.append(f"largest contributions {' and '.join(largest)}")
    return f"{', '.join(steps)}; tracker noise {explanation.tracker * 1e3:.4f} mm"


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


def show_harmonics(parameters: Sequence[Mapping[str, Any]]) -> None:
    """Print the strongest harmonics, if there are any."""
    harmonics = strongest_harmonics(parameters)
    if harmonics:
        more = f", the {MAX_HARMONICS} strongest of {len(harmonics)}" if len(harmonics) > MAX_HARMONICS else ""
        columns = (
            Column("joint", lambda row: row[0]),
            Column("periods per turn", lambda row: row[1], "g"),
            Column("amplitude mrad", lambda row: row[2], ".4f"),
            Column("1σ mrad", lambda row: row[3], ".4f"),
        )
        show(Table.of(f"Harmonics of the joint angles{more}", columns, harmonics[:MAX_HARMONICS]))


# A Parquet file with more rows than are held at once.

WHOLE_ROWS = 200_000
"""Rows of a Parquet file up to which it is read and fitted whole: about 1 GB."""

MAX_NAMED_LEFT_OUT = 100


def has_too_many_rows(path: Path) -> bool:
    """Whether a file is Parquet and has more rows than are fitted at once.

    Raises:
        FileError: it is a damaged one.
    """
    if not path.is_file():
        return False
    from taskcal.tables.parquet import count_rows

    return (count_rows(path) or 0) > WHOLE_ROWS


def refuse_what_needs_all_rows(groups: Sequence[Any], *, but: Sequence[str] = ()) -> None:
    """Check that no option was given that a fit in parts does not have.

    Args:
        groups: of options, each with its defaults.
        but: those that it has.

    Raises:
        typer.BadParameter: one was.
    """
    for group in groups:
        for given in fields(group):
            if given.name not in but and getattr(group, given.name) != given.default:
                raise typer.BadParameter(
                    f"not available for a file of more than {WHOLE_ROWS} rows, which is fitted in parts: geometry, tolerances and "
                    "a tracker alone; thin out its rows for this",
                    param_hint=f"--{given.name.replace('_', '-')}",
                )


def identify_parts(
    campaign: Path, robot: str, noise: "taskcal.TrackerNoise | None"
) -> tuple["ChunkedFit", dict[str, Any]]:
    """Identify a campaign in parts; returns the fit, and its report in millimetres.

    Raises:
        TaskcalError: the file or its rows do not determine it.
    """
    from taskcal.identification.chunked_fit import identify_in_chunks
    from taskcal.reading.chunked import campaign_in_chunks

    model = taskcal.ErrorModel(taskcal.load_robot(robot))
    reading, fitting = f"reading {campaign.name} in parts", "fitting all rows"
    with bar_over([reading, fitting]) as begin, campaign_in_chunks(campaign, model.robot) as chunked:
        for note in chunked.sample.notes:
            info(f"{campaign.name}: {note}")
        begin(fitting)
        fitted = identify_in_chunks(model, chunked, noise=noise)
        nominal = taskcal.validate(
            taskcal.identification.fit_nominal(model, chunked.sample, taskcal.identification.FitOptions(noise=noise)),
            chunked.sample,
        )
    for remark in fitted.calibration.remarks:
        info(remark)
    return fitted, {
        **fitted.calibration.summary(),
        "rows": fitted.rows,
        "left_out": list(fitted.left_out[:MAX_NAMED_LEFT_OUT]),
        "left_out_count": len(fitted.left_out),
        "nominal_of_sample": nominal.summary(),
        "fitted": _summary(fitted.fitted),
        "held_out_from_sample": _summary(fitted.unseen),
    }


def _summary(errors: "ErrorsOfMany") -> dict[str, float]:
    millimetres = {"mean": errors.mean, "rms": errors.rms, "max": errors.maximum}
    return {"n": errors.count, **{f"{name}_mm": value * 1e3 for name, value in millimetres.items()}}


def show_parts(result: Mapping[str, Any], fitted: "ChunkedFit", *, parameters: bool) -> None:
    """Print the report of a fit in parts."""
    from taskcal.report.calibration import tabulate_parameters

    if parameters:
        show(tabulate_parameters(fitted.calibration))
    all_rows, unseen = result["fitted"], result["held_out_from_sample"]
    say(
        f"{result['robot']}: mean 3D position error {result['nominal_of_sample']['mean_mm']:.3f} mm nominal, "
        f"{all_rows['mean_mm']:.3f} mm calibrated ({all_rows['n']} fitted points); a fit of the sample alone: "
        f"{unseen['mean_mm']:.3f} mm ({unseen['n']} held-out points)"
    )
    tell()
    left_out = ", ".join(map(str, fitted.left_out[:10])) + (", …" if len(fitted.left_out) > 10 else "")
    show_facts([
        ("maximum", f"{all_rows['max_mm']:.3f} mm of the fitted rows"),
        ("left out", f"{len(fitted.left_out)} rows with gross errors{f': {left_out}' if left_out else ''}"),
        ("model error", f"{result['model_error_mm']:.3g} mm per axis (1σ), from the sample"),
        ("calibration", f"wrote {result['calibration']}"),
    ])  # fmt: skip
