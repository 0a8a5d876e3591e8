"""How a robot is fitted, as the command line is told."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskcal.cli.options import check_within, split_names
from taskcal.cli.registration import Method, RegistrationOption, registration_file, registration_of

if TYPE_CHECKING:
    from taskcal.identification.fit_options import FitOptions
    from taskcal.measurement.campaign import Campaign
    from taskcal.measurement.tracker import TrackerNoise
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


class FramesChoice(StrEnum):
    """What becomes of tracker frame and targets."""

    fit = "fit"
    fixed = "fixed"


class GrossErrorsChoice(StrEnum):
    """What becomes of rows that cannot be right."""

    leave_out = "leave out"
    keep = "keep"


@dataclass(frozen=True, kw_only=True)
class FitCommandOptions:
    """How a robot is fitted.

    Raises:
        typer.BadParameter: a number out of its bounds, or two options that contradict one another.
    """

    keep: Annotated[
        str | None,
        typer.Option(
            "--keep",
            metavar="NAME,…",
            help="Parameters to fit, by name or symbol, or frames such as J2 or tool; 'published' for the choice of the "
            "robot's publication, 'none' for tracker frame and targets alone. All by default.",
        ),
    ] = None
    lengths_only: Annotated[
        bool,
        typer.Option(
            "--lengths-only",
            help="Fit the nominal lengths of the robot file alone (such as d2 and RL4), not the defects of its frames.",
        ),
    ] = False
    prior: Annotated[PriorChoice, typer.Option("--prior", help="Prior of the parameters.")] = PriorChoice.tolerances
    loss: Annotated[LossChoice, typer.Option("--loss", help="Robust losses give outliers less weight.")] = (
        LossChoice.squared
    )
    frames: Annotated[
        FramesChoice,
        typer.Option("--frames", help="Refine tracker frame and targets with the fit, or hold them as registered."),
    ] = FramesChoice.fit
    registration: RegistrationOption = Method.poses.value
    model_error_mm: Annotated[
        float | None,
        typer.Option("--model-error-mm", metavar="MM", help="What geometry cannot explain (1σ); estimated by default."),
    ] = None
    gross_errors: Annotated[
        GrossErrorsChoice,
        typer.Option(
            "--gross-errors",
            help="Leave out rows that cannot be right beside all others, up to a tenth of them, and say which; or keep them.",
        ),
    ] = GrossErrorsChoice.leave_out
    target_within_mm: Annotated[
        float,
        typer.Option(
            "--target-within-mm",
            metavar="MM",
            min=0.0,
            max=1e5,
            help="How far from the tool point a target may be found.",
        ),
    ] = 1000.0
    prior_scale: Annotated[
        float | None,
        typer.Option("--prior-scale", metavar="FACTOR", help="Factor of the tolerances; estimated by default."),
    ] = None
    mpe_to_sigma: Annotated[
        float | None,
        typer.Option(
            "--mpe-to-sigma",
            metavar="FACTOR",
            help="1σ of the tracker per maximum permissible error; 0.5 by default, 0.577 for a "
            "rectangular distribution.",
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.prior is PriorChoice.none and self.prior_scale is not None:
            raise typer.BadParameter("without a prior there is nothing to scale", param_hint="--prior-scale / --prior")
        check_within(self.model_error_mm, 1e-6, 1e3, "--model-error-mm")
        check_within(self.prior_scale, 1e-6, 1e6, "--prior-scale")
        check_within(self.mpe_to_sigma, 1e-3, 1e3, "--mpe-to-sigma")
        names = self._names()
        if self.lengths_only and names == ["published"]:
            raise typer.BadParameter(
                "the published choice is one of defects, not of lengths", param_hint="--lengths-only / --keep"
            )

    def _names(self) -> list[str] | None:
        return split_names(self.keep, "--keep")

    @property
    def registration_file(self) -> Path | None:
        """The file that is read, if one is named."""
        return registration_file(self.registration)

    def noise(self) -> "TrackerNoise | None":
        """The tracker's; None for the default."""
        from taskcal.measurement.tracker import TrackerNoise

        return None if self.mpe_to_sigma is None else TrackerNoise(mpe_to_sigma=self.mpe_to_sigma)

    def options(self, model: "ErrorModel", campaign: "Campaign") -> "FitOptions":
        """The options of the fit.

        Raises:
            CampaignError: the campaign does not give the registration.
            FileError: the registration's file is of another robot, or of other targets.
            TaskcalError: nothing is published of the robot.
        """
        from taskcal.estimation.loss import Cauchy, Huber, Squared
        from taskcal.identification.fit_options import FitOptions

        return FitOptions(
            keep=_kept(model, self._names()),
            prior=None if self.prior is PriorChoice.none else "tolerances",
            loss={LossChoice.squared: Squared, LossChoice.huber: Huber, LossChoice.cauchy: Cauchy}[self.loss](),
            noise=self.noise(),
            registration=registration_of(self.registration, model, campaign),
            frames="fixed" if self.frames is FramesChoice.fixed else "fit",
            model_error="estimate" if self.model_error_mm is None else self.model_error_mm * 1e-3,
            prior_scale="estimate" if self.prior_scale is None else self.prior_scale,
            gross_errors="keep" if self.gross_errors is GrossErrorsChoice.keep else "leave out",
            target_within=self.target_within_mm * 1e-3,
        )


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
