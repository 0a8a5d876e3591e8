"""``taskcal identify``: a campaign in, a calibration out."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from taskcal.campaigns.campaign import Campaign
from taskcal.cli.command import grouped
from taskcal.cli.commands.robots import placement
from taskcal.cli.options.campaign import CampaignOptions
from taskcal.cli.options.common import CampaignArgument, OutputOptions, RobotOption
from taskcal.cli.options.effects import is_harmonic, show_harmonics
from taskcal.cli.options.fit import FitCommandOptions, HoldoutOptions, PriorChoice
from taskcal.cli.output import (
    bar_by_parts,
    bar_over,
    info,
    say,
    show,
    show_errors,
    show_facts,
    started_as,
    tell,
    write_json,
)
from taskcal.cli.outputs import check_outputs
from taskcal.errors import CampaignError, FileError, FitError, TaskcalError
from taskcal.identification.calibration import Calibration, list_unknowns
from taskcal.identification.validation import validate
from taskcal.registration.registration import Registration
from taskcal.report.calibration import (
    NOMINAL,
    are_most,
    describe_held_out,
    describe_unobservable,
    tabulate_left_out,
    tabulate_outliers,
    tabulate_parameters,
)
from taskcal.report.calibration import verdict as sentence
from taskcal.report.content import model_error_origin, prior_scale_origin
from taskcal.robot.error_model import ErrorModel

if TYPE_CHECKING:
    from taskcal.cli.outputs import Outputs
    from taskcal.identification.chunked_fit import ChunkedFit, ErrorsOfMany
    from taskcal.identification.effects import Explanation
    from taskcal.identification.options import FitOptions
    from taskcal.observations.base import TrackerNoise
    from taskcal.robot.effects import Effect
    from taskcal.robot.robot import Robot


# ``taskcal identify`` of a Parquet file with more rows than are held at once.

WHOLE_ROWS = 200_000
"""Of a Parquet file, up to which it is read and fitted whole."""

MOST_NAMED = 100
"""Rows left out that are named."""


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
    """See that no option was given that a fit in parts has not got.

    Args:
        groups: of options, each with its defaults.
        but: those that it has.

    Raises:
        typer.BadParameter: one was.
    """
    for group in groups:
        for option in fields(group):
            if option.name not in but and getattr(group, option.name) != option.default:
                raise typer.BadParameter(
                    f"a file of more than {WHOLE_ROWS} rows is fitted in parts, by geometry, tolerances and a tracker alone; "
                    "thin out its rows for this",
                    param_hint=f"--{option.name.replace('_', '-')}",
                )


def identify_parts(
    campaign: Path, robot: str, output: Path, outputs: "Outputs", noise: "TrackerNoise | None"
) -> tuple[dict[str, Any], "ChunkedFit"]:
    """Identify a campaign in parts, and write the calibration; returns what is reported, in millimetres.

    Raises:
        TaskcalError: the file or its rows cannot give it.
    """
    from taskcal.identification.chunked_fit import identify_in_chunks
    from taskcal.identification.identify import fit_nominal
    from taskcal.identification.options import FitOptions
    from taskcal.identification.validation import validate
    from taskcal.reading.chunked import campaign_in_chunks
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    model = ErrorModel(load_robot(robot))
    reading, fitting = f"reading {campaign.name} in parts", "fitting all rows"
    with bar_over([reading, fitting]) as begin, campaign_in_chunks(campaign, model.robot) as chunked:
        for note in chunked.sample.notes:
            info(f"{campaign.name}: {note}")
        begin(fitting)
        fitted = identify_in_chunks(model, chunked, noise=noise)
        nominal = validate(fit_nominal(model, chunked.sample, FitOptions(noise=noise)), chunked.sample)
    calibration = fitted.calibration
    for remark in calibration.remarks:
        info(remark)
    outputs.write({output: calibration.to_text()})
    return {
        "calibration": output,
        **calibration.summary(),
        "rows": fitted.rows,
        "left_out": list(fitted.left_out[:MOST_NAMED]),
        "left_out_count": len(fitted.left_out),
        "nominal_of_sample": nominal.summary(),
        "fitted": _summary(fitted.fitted),
        "held_out_from_sample": _summary(fitted.unseen),
    }, fitted


def _summary(errors: "ErrorsOfMany") -> dict[str, float]:
    return {
        "n": errors.count,
        "mean_mm": errors.mean * 1e3,
        "rms_mm": errors.rms * 1e3,
        "max_mm": errors.maximum * 1e3,
    }


def show_parts(result: Mapping[str, Any], fitted: "ChunkedFit", *, as_json: bool, parameters: bool) -> None:
    """Print what is reported."""
    if as_json:
        write_json(result)
        return
    from taskcal.report.calibration import tabulate_parameters

    if parameters:
        show(tabulate_parameters(fitted.calibration))
    all_rows, unseen = result["fitted"], result["held_out_from_sample"]
    say(
        f"{result['robot']}: {all_rows['mean_mm']:.3f} mm mean error in space on {all_rows['n']} fitted points; a fit of the "
        f"sample alone leaves {unseen['mean_mm']:.3f} mm on the {unseen['n']} that were not in it, the nominal robot "
        f"{result['nominal_of_sample']['mean_mm']:.3f} mm"
    )
    tell()
    left_out = ", ".join(map(str, fitted.left_out[:10])) + (", …" if len(fitted.left_out) > 10 else "")
    show_facts([
        ("largest", f"{all_rows['max_mm']:.3f} mm of the rows that were fitted"),
        ("left out", f"{len(fitted.left_out)} rows that cannot be right{f': {left_out}' if left_out else ''}"),
        ("model error", f"{result['model_error_mm']:.3g} mm per axis (1σ), from the sample"),
        ("calibration", f"wrote {result['calibration']}"),
    ])  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """What may be added to the geometry."""

    effects: Annotated[
        str,
        typer.Option(
            "--effects",
            metavar="auto|none|LIST",
            help="What the joints do beside the geometry: 'auto' takes all at once, each as large as the data say; or add some "
            "of those listed below, unproven. None by default.",
        ),
    ] = "none"
    field: Annotated[
        bool,
        typer.Option(
            "--field",
            help="Try a smooth function of all joints at each joint, which 'auto' has among all others.",
        ),
    ] = False

    @property
    def searching(self) -> bool:
        """Whether anything but the geometry is asked for."""
        return self.field or self.effects != "none"

    def named(self) -> "list[Effect] | None":
        """Effects that are named; None where they are to be found.

        Raises:
            typer.BadParameter: a name that means no effect.
        """
        from taskcal.cli.options.effects import read_effects

        return read_effects(self.effects)


@dataclass(frozen=True, kw_only=True)
class ShownOptions(OutputOptions):
    """How the result is given, and how much of it."""

    parameters: Annotated[bool, typer.Option("--parameters", help="List the parameters that were identified.")] = False


@grouped
def command(
    campaign: CampaignArgument,
    robot: RobotOption,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="CAL.json", readable=False, help="Calibration to write.")
    ],
    reading: CampaignOptions,
    holdout: HoldoutOptions,
    fitting: FitCommandOptions,
    search: SearchOptions,
    out: ShownOptions,
) -> None:
    """Identify a robot's parameters from a campaign, with tracker frame and targets.

    Rows that are not fitted, by --rows or --holdout, are predicted and reported beside the fitted ones; with --folds, each row is,
    once, by a fit of the other parts.

    With --effects or --field, every step is cross-validated on the fitted rows, and a table says what it was worth.
    """
    if reading.rows is not None and holdout.asked:
        raise typer.BadParameter(
            "choose one: rows that --rows leaves out are held out already", param_hint="--rows / --holdout, --folds"
        )
    if search.effects == "auto" and fitting.prior is PriorChoice.none:
        raise typer.BadParameter(
            "effects are found by their evidence, which needs a prior; name them, or leave out --prior none",
            param_hint="--effects / --prior",
        )
    effects = search.named() if search.searching else []
    inputs = [campaign, robot, reading.points, reading.rows, fitting.registration_file]
    outputs = check_outputs("identify", [("--output", output)], inputs, force=out.force)
    if has_too_many_rows(campaign):
        refuse_what_needs_all_rows([reading, holdout, fitting, search], but=["mpe_to_sigma"])
        result, chunked = identify_parts(campaign, robot, output, outputs, fitting.noise())
        show_parts(result, chunked, as_json=out.as_json, parameters=out.parameters)
        return
    from taskcal.robot.catalogue import load_robot

    described = load_robot(robot)
    try:
        read = reading.read(campaign, described, noise=fitting.noise())
    except FileError as refusal:
        if refusal.path != str(campaign):  # of another file, of rows or points, which no diagnosis explains
            raise
        raise _explained_refusal(refusal, campaign, described) from refusal
    from taskcal.robot.error_model import ErrorModel  # after the file was read: the compiler takes a while to import

    model = ErrorModel(described, lengths_only=fitting.lengths_only)
    if fitting.mpe_to_sigma is not None and read.whole.uncertainty is not None:
        info("--mpe-to-sigma has no effect: the campaign states its own uncertainties (u_mm)")
    fit = _Fit(model=model, fitting=fitting, search=search, effects=effects, seed=holdout.seed, fits=holdout.fits)
    try:
        calibration = holdout.fit(read, fit, fit.nominal)
    except (CampaignError, FitError) as refusal:
        raise _explained_refusal(refusal, campaign, model.robot) from refusal
    for remark in calibration.remarks:
        info(remark)
    outputs.write({output: calibration.to_text()})
    from taskcal.identification.effects import tracker_error

    fitted = holdout.fitted_rows(read)
    reported = report(calibration, read.whole.take(fitted), fit.nominal)
    result = {"calibration": output, **reported, "drift": read.drift, **_explained(fit.explanation)}
    if out.as_json:
        write_json(result)
    else:
        tracker_mm = tracker_error(read.whole.take(fitted), fitting.noise()) * 1e3
        show_report(calibration, result, tracker_mm=tracker_mm, parameters=out.parameters)
        if fit.explanation is not None:
            from taskcal.cli.options.effects import show_explanation

            show_explanation(fit.explanation)


@dataclass(kw_only=True)
class _Fit:
    """The fit of some rows of the campaign; the first one is that of the calibration."""

    model: "ErrorModel"
    fitting: FitCommandOptions
    search: SearchOptions
    effects: "list[Effect] | None"
    seed: int
    fits: int
    explanation: "Explanation | None" = None
    done: int = 0

    def __call__(self, measured: "Campaign") -> "Calibration":
        """Fit all rows of a campaign."""
        options = self.fitting.options(self.model, measured)
        self.done += 1
        if not self.search.searching:
            from taskcal.identification.identify import identify

            step = "identification" if self.done == 1 else f"fold {self.done - 1} of {self.fits - 1}"
            with bar_by_parts(step) as show:
                show(step, self.done - 1, self.fits)
                return identify(self.model, measured, options=options)
        part = f"fold {self.done - 1} of {self.fits - 1}: " if self.done > 1 else ""
        explanation = _explain(
            self.model, measured, self.effects, options, field=self.search.field, seed=self.seed, part=part
        )
        self.explanation = self.explanation or explanation
        return explanation.calibration

    def nominal(self, measured: "Campaign") -> "Calibration":
        """Fit tracker frame and targets of the nominal robot."""
        from taskcal.identification.identify import fit_nominal

        return fit_nominal(self.model, measured, self.fitting.options(self.model, measured))


def _explained_refusal(refusal: TaskcalError, campaign: Path, robot: "Robot") -> TaskcalError:
    """The refusal, and what the doctor finds."""
    from taskcal.cli.commands.doctor import with_first_finding

    return TaskcalError(with_first_finding(refusal, campaign, robot))


def _explain(
    model: "ErrorModel",
    measured: "Campaign",
    effects: "list[Effect] | None",
    options: "FitOptions",
    *,
    field: bool,
    seed: int,
    part: str,
) -> "Explanation":
    from taskcal.cli.options.effects import refer_to
    from taskcal.identification.effects import EffectSearch, search_steps, select_effects

    search = EffectSearch(effects=refer_to(measured, effects), field=field, seed=seed)
    with bar_over([f"{part}{step}" for step in search_steps(model, measured, search)]) as say:
        return select_effects(model, measured, search, options=options, progress=lambda step: say(f"{part}{step}"))


def _explained(explanation: "Explanation | None") -> dict[str, Any]:
    if explanation is None:
        return {}
    from taskcal.cli.options.effects import collinearities_json

    return {
        "explanation": explanation.summary(),
        "not_tried": dict(explanation.untried),
        "tracker_mm": explanation.tracker * 1e3,
        "collinear": collinearities_json(explanation),
    }


# What a user wants to know of a fit first: what it was worth, and what to do next.

MUCH_WORSE = 1.6
"""Times the fitted error, beyond which held-out rows say that there are too few."""

MUCH_UNEXPLAINED = 2.0
"""Times the tracker's noise, beyond which it is worth asking what else the joints do."""

MAX_NAMED_IN_VERDICT = 5
"""Rows that are named."""


def verdict(calibration: Calibration, result: Mapping[str, Any]) -> str:
    """The fit in a sentence.

    Args:
        calibration: the fit.
        result: what `calibration_report.report` says.
    """
    held_out = result["held_out"]
    after = (held_out or result["fitted"])["mean_mm"]
    in_space = all(kind.width >= 3 for kind in calibration.layout.observed)
    before, number = result["nominal"]["mean_mm"], held_out and held_out["n"]
    return sentence(result["robot"], before, after, number, in_space=in_space)


def next_steps(calibration: Calibration, result: Mapping[str, Any], tracker_mm: float) -> list[str]:
    """What to do next, the most urgent first.

    Args:
        calibration: the fit.
        result: what `calibration_report.report` says.
        tracker_mm: mean error in space that the tracker's noise alone would leave.
    """
    taskcal, cal, held_out = started_as(), result["calibration"], result["held_out"]
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
            f"do not measure {_rows(of_model)} again: model error, since their neighbours err alike; see below"
        )
    if held_out is None:
        steps.append("see what it predicts: --holdout 0.3 gives rows away for that, --folds 5 gives none away")
    elif held_out["mean_mm"] > MUCH_WORSE * result["fitted"]["mean_mm"]:
        steps.append(
            f"measure more poses: rows that were not fitted are {held_out['mean_mm'] / result['fitted']['mean_mm']:.1f} times as "
            f"far off as those that were; {taskcal} plan says which"
        )
    if any(target["unlocated"] for target in result["targets"].values()):
        steps.append("measure in several orientations: these poses do not locate every target")
    left = (held_out or result["fitted"])["mean_mm"]
    searched = "explanation" in result or calibration.model.effects
    if not (searched or calibration.model.robot.driven) and left > MUCH_UNEXPLAINED * tracker_mm:
        steps.append(
            f"ask what else the joints do: --effects auto; {left:.3f} mm are left, the tracker alone would leave {tracker_mm:.3f}"
        )
    steps.append(f"look at the whole: {taskcal} report {cal}; use it: {taskcal} correct -c {cal} PROGRAM")
    return steps


def _rows(numbers: Collection[int]) -> str:
    rows = sorted(numbers)
    more = f" and {len(rows) - MAX_NAMED_IN_VERDICT} more" if len(rows) > MAX_NAMED_IN_VERDICT else ""
    return f"rows {', '.join(map(str, rows[:MAX_NAMED_IN_VERDICT]))}{more}"


# What ``taskcal identify`` says of a calibration.

MAX_SHOWN = 40
"""Parameters of effects that a terminal shows, whatever they are."""

CLEAR = 2.0
"""Standard errors from zero beyond which more of them are shown."""


def report(calibration: Calibration, measured: Campaign, nominal: Callable[[Campaign], Calibration]) -> dict[str, Any]:
    """Everything that a reader of the fit asks for, in millimetres and milliradians.

    Args:
        calibration: the fit.
        measured: the rows that were fitted, those that cannot be right among them.
        nominal: the fit of tracker frame and targets of the nominal robot.
    """
    wrong = {row.id for row in calibration.left_out}
    right = measured.take([i for i, name in enumerate(measured.ids) if name not in wrong])
    held_out = calibration.held_out
    before = validate(nominal(right), right) if held_out is None else held_out.nominal_validation
    return {
        **calibration.summary(),
        "rows": len(measured),
        "nominal": before.summary(),
        "fitted": validate(calibration, right).summary(),
        "held_out": None if held_out is None else held_out.validation.summary(),
        "holdout": None if held_out is None else held_out.summary(),
        "model_error_origin": model_error_origin(calibration),
        "prior_scale_origin": prior_scale_origin(calibration) or None,
        "tracker_frame": placement(calibration.T_tracker_base) if _in_tracker(calibration) else None,
        "observations": list_unknowns(calibration),
        "registration": _registered(calibration.layout.registration),
        "targets": {
            name: {**placement(T), "located": not unlocated, "unlocated": unlocated or None}
            for name, T, unlocated in zip(
                calibration.targets,
                calibration.T_tool_target,
                describe_unobservable(calibration.layout.registration),
                strict=True,
            )
        },
    }


def _in_tracker(calibration: Calibration) -> bool:
    """Whether a tracker measured anything; else the measuring frame is the robot's base."""
    return calibration.layout.base_size > 0


def _registered(registration: Registration) -> dict[str, str | None]:
    return {"method": registration.method, "file": registration.file or None}


def show_report(
    calibration: Calibration, result: Mapping[str, Any], *, tracker_mm: float, parameters: bool = False
) -> None:
    """Print a calibration and what `report` says of it: the verdict, the errors, what to do next, and the rest.

    Args:
        calibration: the fit.
        result: what `report` says of it.
        tracker_mm: mean error in space that the tracker's noise alone would leave.
        parameters: whether to print the parameters, too.
    """
    summaries = {NOMINAL: result["nominal"], "fitted": result["fitted"]}
    if result["held_out"] is not None:
        summaries["held out"] = result["held_out"]
    say(verdict(calibration, result))
    tell()
    title = "Position error: largest along the axes of the robot's base, then in space"
    show_errors(title if "max_x_mm" in result["fitted"] else "Error: measured less predicted", summaries)
    steps = next_steps(calibration, result, tracker_mm)
    show_facts([("next" if number == 0 else "", step) for number, step in enumerate(steps)])
    tell()
    for table in (tabulate_left_out(calibration), tabulate_outliers(calibration)):
        if len(table):
            show(table)
    if parameters:
        _show_parameters(calibration, result)
    held_out = [] if calibration.held_out is None else [("held out", describe_held_out(calibration.held_out))]
    show_facts([*held_out, *_facts(result, parameters=parameters)])


def _show_parameters(calibration: Calibration, result: Mapping[str, Any]) -> None:
    unclear = _unclear_effects(calibration)
    table = tabulate_parameters(calibration, leave_out=lambda name: is_harmonic(name) or name in unclear)
    if len(table):
        show(table)
    if unclear:
        say(
            f"{len(unclear)} more parameters of effects, within {CLEAR:g} standard errors of zero or of the smooth field, are in "
            "--json"
        )
    show_harmonics(result["parameters"])


def _unclear_effects(calibration: Calibration) -> set[str]:
    """Parameters of effects that stand for themselves and may be zero; those of harmonics are told by their amplitudes."""
    geometry = set(ErrorModel(calibration.model.robot).names)
    effects = [i for i in calibration.estimated if calibration.model.names[i] not in geometry]
    if len(effects) <= MAX_SHOWN:
        return set()
    names = {calibration.model.names[i]: i for i in effects if not is_harmonic(calibration.model.names[i])}
    return {
        name
        for name, i in names.items()
        if abs(calibration.estimate[i]) < CLEAR * calibration.standard_errors[i] or ".field_" in name
    }


def _facts(result: Mapping[str, Any], *, parameters: bool) -> list[tuple[str, str]]:
    scale = result["prior_scale"]
    pairs = [f"{c['a']} and {c['b']} {c['correlation']:+.3f}" for c in result["correlations"]]
    rotation = f" and {result['model_error_mrad']:.3g} mrad" if "model_error_mrad" in result else ""
    held = f", {result['prior_scale_origin']}" if result["prior_scale_origin"] else ""
    facts = [
        ("model error", f"{result['model_error_mm']:.3g} mm{rotation} per axis (1σ), {result['model_error_origin']}"),
        ("prior scale", "no prior" if scale is None else f"{scale:.3g} times the tolerances{held}"),
        *([("largest correlations", "; ".join(pairs))] if parameters else []),
        ("tracker frame", _measuring_frame(result)),
    ]
    for name, target in result["targets"].items():
        unsure = f"; {target['unlocated']}" if target["unlocated"] else ""
        facts.append((f"target {name}", f"at {_point(target)} of the tool frame{unsure}"))
    ended = f"{result['reason']}; {result['iterations']} iterations in the last of {result['rounds']} rounds"
    unseen = sum(p["seen"] is False for p in result["parameters"])
    if unseen:
        facts.insert(
            0, ("not seen", f"{unseen} parameters: the data say next to nothing of them, their 1σ is that of the prior")
        )
    if parameters:
        facts.append(("ended", ended))
    else:
        facts.append(("parameters", f"{len(result['parameters'])} were identified: --parameters lists them"))
    facts.append(("calibration", f"wrote {result['calibration']}"))
    return facts


def _measuring_frame(result: Mapping[str, Any]) -> str:
    if result["tracker_frame"] is None:
        stands = sum(len(one["unknowns"]) for one in result["observations"])
        return f"none: measured in the robot's base, with {stands} numbers of what stands fitted (see --json)"
    return f"base at {_point(result['tracker_frame'])}{_found_from(result['registration'])}"


def _found_from(registration: Mapping[str, str | None]) -> str:
    """Where the fit's start of tracker frame and targets comes from, unless it is all poses as ever."""
    file = f"{registration['file']}, " if registration["file"] else ""
    from_circles = registration["method"] == "circles"
    return f"; registered from {file}{'circles' if from_circles else 'poses'}" if file or from_circles else ""


def _point(placed: Mapping[str, Any]) -> str:
    position = " ".join(f"{value:.3f}" for value in placed["position_mm"])
    quaternion = " ".join(f"{value:.6f}" for value in placed["quaternion"])
    return f"{position} mm, quaternion {quaternion}"
