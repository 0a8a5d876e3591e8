"""``taskcal identify``: a campaign in, a calibration out."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.campaign_options import CampaignOptions
from taskcal.cli.fit_options import FitCommandOptions, PriorChoice
from taskcal.cli.holdout_options import HoldoutOptions
from taskcal.cli.identify_in_chunks import (
    has_too_many_rows,
    identify_parts,
    refuse_what_needs_all_rows,
    show_parts,
)
from taskcal.cli.option_groups import grouped
from taskcal.cli.options import CampaignArgument, OutputOptions, RobotOption
from taskcal.cli.output import info, write_json
from taskcal.cli.outputs import check_outputs
from taskcal.cli.steps_bar import bar_by_parts, bar_over
from taskcal.errors import CampaignError, FileError, FitError, TaskcalError

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.identification.explanation import Explanation
    from taskcal.identification.fit_options import FitOptions
    from taskcal.measurement.campaign import Campaign
    from taskcal.robot.effects import Effect
    from taskcal.robot.error_model import ErrorModel
    from taskcal.robot.robot import Robot


FIELD_IS_AN_EFFECT = (
    "--field is deprecated: no field of the tool's position is learned any more. A smooth function of all joints is tried at each "
    "joint, as '--effects auto' does among all other effects; '--effects field' adds it unproven"
)


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
            help="Former option: tries a smooth function of all joints at each joint, which 'auto' has among all others.",
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
        from taskcal.cli.effects import read_effects

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
    if search.field:
        info(FIELD_IS_AN_EFFECT)
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
    from taskcal.cli.calibration_report import report, show_report
    from taskcal.identification.effect_selection import tracker_error

    fitted = holdout.fitted_rows(read)
    reported = report(calibration, read.whole.take(fitted), fit.nominal)
    result = {"calibration": output, **reported, "drift": read.drift, **_explained(fit.explanation)}
    if out.as_json:
        write_json(result)
    else:
        tracker_mm = tracker_error(read.whole.take(fitted), fitting.noise()) * 1e3
        show_report(calibration, result, tracker_mm=tracker_mm, parameters=out.parameters)
        if fit.explanation is not None:
            from taskcal.cli.effects import show_explanation

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
        from taskcal.identification.nominal_fit import fit_nominal

        return fit_nominal(self.model, measured, self.fitting.options(self.model, measured))


def _explained_refusal(refusal: TaskcalError, campaign: Path, robot: "Robot") -> TaskcalError:
    """The refusal, and what the doctor finds."""
    from taskcal.cli.diagnosis import with_first_finding

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
    from taskcal.cli.effects import refer_to
    from taskcal.identification.effect_selection import EffectSearch, select_effects
    from taskcal.identification.search_steps import search_steps

    search = EffectSearch(effects=refer_to(measured, effects), field=field, seed=seed)
    with bar_over([f"{part}{step}" for step in search_steps(model, measured, search)]) as say:
        return select_effects(model, measured, search, options=options, progress=lambda step: say(f"{part}{step}"))


def _explained(explanation: "Explanation | None") -> dict[str, Any]:
    if explanation is None:
        return {}
    from taskcal.cli.effects import collinearities_json

    return {
        "explanation": explanation.summary(),
        "not_tried": dict(explanation.untried),
        "tracker_mm": explanation.tracker * 1e3,
        "collinear": collinearities_json(explanation),
        "near_dependent": collinearities_json(explanation),  # former key, until the next release
    }
