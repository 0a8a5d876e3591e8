"""``taskcal identify``: a campaign in, a calibration out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.campaign import CampaignOptions
from taskcal.cli.options.common import CampaignArgument, OutputOptions, RobotOption
from taskcal.cli.options.fit import FitCommandOptions, HoldoutOptions, PriorChoice
from taskcal.cli.output import check_outputs, info, say, show, show_facts, tell, write_json
from taskcal.cli.progress import bar_by_parts, bar_over
from taskcal.errors import CampaignError, FileError, FitError, TaskcalError

if TYPE_CHECKING:
    from taskcal.campaigns.campaign import Campaign
    from taskcal.cli.output import Outputs
    from taskcal.identification.calibration import Calibration
    from taskcal.identification.chunked_fit import ChunkedFit, ErrorsOfMany
    from taskcal.identification.effects import Explanation
    from taskcal.identification.options import FitOptions
    from taskcal.observations.base import TrackerNoise
    from taskcal.robot.effects import Effect
    from taskcal.robot.error_model import ErrorModel
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
    """Identify a robot's parameters, tracker frame and targets from a campaign.

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
    from taskcal.cli.fit_report import report, show_report

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


# What ``taskcal identify`` says of a calibration.
