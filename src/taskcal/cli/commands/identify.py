"""``taskcal identify``: a campaign in, a calibration out."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.drift import DriftChoice, DriftOption, compensate
from taskcal.cli.options import (
    ForceOption,
    JsonOption,
    ReferencePointsOption,
    RobotOption,
    RowsOption,
    SeedOption,
    TargetsOption,
    check_within,
    split_names,
)
from taskcal.cli.output import announce_compilation, note, working, write_json
from taskcal.cli.outputs import check_outputs
from taskcal.cli.registration import Method, RegistrationOption, registration_file, registration_of

if TYPE_CHECKING:
    from taskcal.measurement.campaign import Campaign
    from taskcal.robot.error_model import ErrorModel


class PriorChoice(StrEnum):
    """What is known of the parameters beforehand."""

    tolerances = "tolerances"
    none = "none"


class LossChoice(StrEnum):
    """How much a large residual counts."""

    squared = "squared"
    huber = "huber"
    cauchy = "cauchy"


class GrossErrorsChoice(StrEnum):
    """What becomes of rows that cannot be right."""

    leave_out = "leave out"
    keep = "keep"


class FramesChoice(StrEnum):
    """What becomes of tracker frame and targets."""

    fit = "fit"
    fixed = "fixed"


def command(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN.csv", readable=False, help="Joints and where the targets were seen.")
    ],
    robot: RobotOption,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="CAL.json", readable=False, help="Calibration to write.")
    ],
    rows: RowsOption = None,
    holdout: Annotated[
        float | None,
        typer.Option("--holdout", metavar="SHARE", help="Hold this share of the rows out, at random, and predict it."),
    ] = None,
    seed: SeedOption = 0,
    targets: TargetsOption = None,
    reference_points: ReferencePointsOption = None,
    keep: Annotated[
        str | None,
        typer.Option(
            "--keep",
            metavar="NAME,…",
            help="Parameters to fit, by name or symbol, or frames such as J2 or tool; 'published' for the choice of the "
            "robot's publication, 'none' for tracker frame and targets alone. All by default.",
        ),
    ] = None,
    lengths_only: Annotated[
        bool,
        typer.Option(
            "--lengths-only",
            help="Fit the nominal lengths of the robot file alone (such as d2 and RL4), not the defects of its frames.",
        ),
    ] = False,
    prior: Annotated[PriorChoice, typer.Option("--prior", help="Prior of the parameters.")] = PriorChoice.tolerances,
    loss: Annotated[
        LossChoice, typer.Option("--loss", help="Robust losses give outliers less weight.")
    ] = LossChoice.squared,
    frames: Annotated[
        FramesChoice,
        typer.Option("--frames", help="Refine tracker frame and targets with the fit, or hold them as registered."),
    ] = FramesChoice.fit,
    registration: RegistrationOption = Method.poses.value,
    model_error: Annotated[
        float | None,
        typer.Option("--model-error", metavar="MM", help="What geometry cannot explain (1σ); estimated by default."),
    ] = None,
    gross_errors: Annotated[
        GrossErrorsChoice,
        typer.Option(
            "--gross-errors",
            help="Leave out rows that cannot be right beside all others, up to a tenth of them, and say which; or keep them.",
        ),
    ] = GrossErrorsChoice.leave_out,
    target_within: Annotated[
        float,
        typer.Option(
            "--target-within", metavar="MM", min=0.0, max=1e5, help="How far from the tool point a target may be found."
        ),
    ] = 1000.0,
    prior_scale: Annotated[
        float | None,
        typer.Option("--prior-scale", metavar="FACTOR", help="Factor of the tolerances; estimated by default."),
    ] = None,
    mpe_to_sigma: Annotated[
        float | None,
        typer.Option(
            "--mpe-to-sigma",
            metavar="FACTOR",
            help="1σ of the tracker per maximum permissible error; 0.5 by default, 0.577 for a "
            "rectangular distribution.",
        ),
    ] = None,
    effects: Annotated[
        str,
        typer.Option(
            "--effects",
            metavar="auto|none|LIST",
            help="What the joints do beside the geometry: 'auto' takes what the data prove; or add some of those listed below, "
            "unproven. None by default.",
        ),
    ] = "none",
    field: Annotated[
        bool, typer.Option("--field", help="Learn over the joints what is left, if cross-validation proves it.")
    ] = False,
    drift: DriftOption = DriftChoice.follow,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Identify a robot's parameters from a campaign, with tracker frame and targets.

    Rows that are not fitted, by --rows or --holdout, are predicted and reported beside the fitted ones.

    With --effects or --field, every step is cross-validated on the fitted rows, and a table says what it was worth.
    """
    if rows is not None and holdout is not None:
        raise typer.BadParameter(
            "choose one: rows that --rows leaves out are held out already", param_hint="--rows / --holdout"
        )
    if holdout is not None and not 0 < holdout < 1:
        raise typer.BadParameter(f"{holdout:g} is not a share between 0 and 1, such as 0.3", param_hint="--holdout")
    if prior is PriorChoice.none and prior_scale is not None:
        raise typer.BadParameter("without a prior there is nothing to scale", param_hint="--prior-scale / --prior")
    for option, value, least, most in (
        ("--model-error", model_error, 1e-6, 1e3),
        ("--prior-scale", prior_scale, 1e-6, 1e6),
        ("--mpe-to-sigma", mpe_to_sigma, 1e-3, 1e3),
    ):
        check_within(value, least, most, option)
    wanted, fixed, names = (
        split_names(targets, "--targets"),
        split_names(reference_points, "--reference-points"),
        split_names(keep, "--keep"),
    )
    if effects == "auto" and prior is PriorChoice.none:
        raise typer.BadParameter(
            "effects are found by their evidence, which needs a prior; name them, or leave out --prior none",
            param_hint="--effects / --prior",
        )
    asked = None
    if field or effects != "none":
        from taskcal.cli.effects import read_effects

        asked = read_effects(effects)
    if lengths_only and names == ["published"]:
        raise typer.BadParameter(
            "the published choice is one of defects, not of lengths", param_hint="--lengths-only / --keep"
        )
    read = [campaign, robot, rows, registration_file(registration)]
    outputs = check_outputs("identify", [("--output", output)], read, force=force)
    from taskcal.cli.calibration_report import report, show
    from taskcal.estimation.loss import Cauchy, Huber, Squared
    from taskcal.identification.fit_options import FitOptions
    from taskcal.identification.identify import identify
    from taskcal.measurement.reader import read_campaign
    from taskcal.measurement.tracker import TrackerNoise
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    model = ErrorModel(load_robot(robot), lengths_only=lengths_only)
    measured = read_campaign(campaign, model.robot, targets=wanted, reference_points=fixed)
    if mpe_to_sigma is not None and measured.uncertainty is not None:
        note("--mpe-to-sigma has no effect: the campaign states its own uncertainties (u_mm)")
    noise = None if mpe_to_sigma is None else TrackerNoise(mpe_to_sigma=mpe_to_sigma)
    measured, moved = compensate(measured, drift, noise)
    chosen, others = _divide(measured, rows, holdout, seed, campaign)
    announce_compilation()
    options = FitOptions(
        keep=_kept(model, names),
        prior=None if prior is PriorChoice.none else "tolerances",
        loss={LossChoice.squared: Squared, LossChoice.huber: Huber, LossChoice.cauchy: Cauchy}[loss](),
        noise=noise,
        registration=registration_of(registration, model, measured.take(chosen)),
        frames="fixed" if frames is FramesChoice.fixed else "fit",
        model_error="estimate" if model_error is None else model_error * 1e-3,
        prior_scale="estimate" if prior_scale is None else prior_scale,
        gross_errors="keep" if gross_errors is GrossErrorsChoice.keep else "leave out",
        target_within=target_within * 1e-3,
    )
    explanation = None
    if field or effects != "none":
        from taskcal.cli.effects import refer_to
        from taskcal.identification.effect_selection import EffectSearch, select_effects

        asked = refer_to(measured, asked)
        with working("geometry") as say:
            search = EffectSearch(effects=asked, field=field, seed=seed)
            explanation = select_effects(model, measured.take(chosen), search, options=options, progress=say)
        calibration = explanation.calibration
    else:
        calibration = identify(model, measured.take(chosen), options=options)
    for remark in calibration.remarks:
        note(remark)
    outputs.write({output: calibration.to_text()})
    result: dict[str, Any] = {"calibration": output, **report(calibration, measured, chosen, others), "drift": moved}
    if explanation is not None:
        from taskcal.cli.effects import collinearities_json

        result |= {
            "explanation": explanation.to_json(),
            "tracker_mm": explanation.tracker * 1e3,
            "collinear": collinearities_json(explanation),
            "near_dependent": collinearities_json(explanation),  # former key, until the next release
        }
    if as_json:
        write_json(result)
    else:
        show(result)
        if explanation is not None:
            from taskcal.cli.effects import show_explanation

            show_explanation(explanation)


def _divide(
    measured: "Campaign", rows: str | None, holdout: float | None, seed: int, source: Path
) -> tuple[list[int], list[int]]:
    """Rows to fit and rows held out."""
    import numpy as np

    from taskcal.cli.rows import choose_rows

    everything = range(len(measured))
    if rows is not None:
        chosen = choose_rows(rows, len(measured), source)
        return chosen, sorted(set(everything) - set(chosen))
    if holdout is not None:
        fitted, held_out = measured.split(holdout, np.random.default_rng(seed))
        return [fitted.row_of(i) for i in range(len(fitted))], [held_out.row_of(i) for i in range(len(held_out))]
    return list(everything), []


def _kept(model: "ErrorModel", names: list[str] | None) -> tuple[str, ...] | None:
    """Parameters to fit; ``published`` stands for a publication's choice, ``none`` for the frames alone.

    Raises:
        TaskcalError: nothing is published of the robot.
    """
    if names == ["none"]:
        return ()
    if names != ["published"]:
        return None if names is None else tuple(names)
    from taskcal.analysis.elimination_table import published_kept
    from taskcal.errors import TaskcalError

    if not model.robot.published.source:
        raise TaskcalError(
            f"--keep published: the robot file of {model.robot.name} names no publication; name the parameters"
        )
    return published_kept(model)
