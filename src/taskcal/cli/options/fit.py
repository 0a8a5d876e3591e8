"""How a robot is fitted, as the command line is told."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskcal.cli.options.campaign import CampaignRead
from taskcal.cli.options.common import SeedOption, check_within, split_names
from taskcal.cli.options.registration import Method, RegistrationOption, registration_file, registration_of

if TYPE_CHECKING:
    from taskcal.campaigns.campaign import Campaign
    from taskcal.identification.calibration import Calibration
    from taskcal.identification.holdout import Holdout
    from taskcal.identification.options import FitOptions
    from taskcal.observations.base import TrackerNoise
    from taskcal.robot.error_model import ErrorModel

    Fit = Callable[[Campaign], Calibration]


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
        from taskcal.observations.base import TrackerNoise

        return None if self.mpe_to_sigma is None else TrackerNoise(mpe_to_sigma=self.mpe_to_sigma)

    def options(self, model: "ErrorModel", campaign: "Campaign") -> "FitOptions":
        """The options of the fit.

        Raises:
            CampaignError: the campaign does not give the registration.
            FileError: the registration's file is of another robot, or of other targets.
            TaskcalError: nothing is published of the robot.
        """
        from taskcal.estimation.prior import Cauchy, Huber, Squared
        from taskcal.identification.options import FitOptions

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


# Which rows a fit does not see, as the command line is told.


class GroupingChoice(StrEnum):
    """What is held out together."""

    neighbours = "neighbours"
    blocks = "blocks"
    rows = "rows"


@dataclass(frozen=True, kw_only=True)
class HoldoutOptions:
    """Rows that are held out.

    Raises:
        typer.BadParameter: the share is not between 0 and 1, or there are both a share and folds.
    """

    holdout: Annotated[
        float | None,
        typer.Option(
            "--holdout", metavar="SHARE", help="Hold about this share of the rows out of the fit, and predict it."
        ),
    ] = None
    folds: Annotated[
        int | None,
        typer.Option(
            "--folds",
            metavar="K",
            min=2,
            help="Hold each of K parts out in turn, and predict it from the others; the calibration is of all rows.",
        ),
    ] = None
    holdout_by: Annotated[
        GroupingChoice,
        typer.Option(
            "--holdout-by",
            help="What is held out together: neighbouring poses, blocks of rows that follow each other, or single rows at random, "
            "which flatters where poses lie side by side.",
        ),
    ] = GroupingChoice.neighbours
    seed: SeedOption = 0

    def __post_init__(self) -> None:
        if self.holdout is not None and not 0 < self.holdout < 1:
            raise typer.BadParameter(
                f"{self.holdout:g} is not a share between 0 and 1, such as 0.3", param_hint="--holdout"
            )
        if self.holdout is not None and self.folds is not None:
            raise typer.BadParameter(
                "choose one: a share that is held out once, or folds", param_hint="--holdout / --folds"
            )
        if not self.asked and self.holdout_by is not GroupingChoice.neighbours:
            raise typer.BadParameter("nothing is held out; give --holdout or --folds too", param_hint="--holdout-by")

    @property
    def asked(self) -> bool:
        """Whether rows are to be held out."""
        return self.holdout is not None or self.folds is not None

    @property
    def fits(self) -> int:
        """How many times the campaign is fitted."""
        return 1 + (self.folds or 0)

    def _holdout(self) -> "Holdout":
        from taskcal.identification.holdout import Holdout

        return Holdout(share=self.holdout, folds=self.folds, by=self.holdout_by.value, seed=self.seed)

    def fit(self, read: CampaignRead, fit: "Fit", nominal: "Fit") -> "Calibration":
        """The calibration of the rows that are to be fitted, with what it predicts of the others.

        Args:
            read: the campaign; rows that were not chosen are held out too.
            fit: of the rows of a campaign.
            nominal: of tracker frame and targets of the nominal robot.

        Raises:
            CampaignError: too few rows.
            FitError: a fit did not converge.
        """
        import numpy as np

        from taskcal.identification.holdout import hold_out, with_held_out

        if self.asked:
            return hold_out(fit, read.whole, self._holdout(), nominal)
        calibration = fit(read.campaign)
        others = np.setdiff1d(np.arange(len(read.whole)), read.rows)
        if not read.whole.take(others).valid.any():
            return calibration
        return with_held_out(calibration, read.whole, others, nominal)

    def fitted_rows(self, read: CampaignRead) -> list[int]:
        """Rows that the calibration has seen, but for those that cannot be right."""
        if self.holdout is None:
            return list(read.rows)
        out = {int(row) for row in self._holdout().choose(read.whole)}
        return [row for row in range(len(read.whole)) if row not in out]
