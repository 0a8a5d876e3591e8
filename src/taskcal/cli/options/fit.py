"""Options of a fit: parameters, prior, loss, registration and hold-out."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.campaign import CampaignRead
from taskcal.cli.options.common import (
    TARGET_WITHIN_MM,
    SeedOption,
    TargetWithinOption,
    UnsealedOption,
    read_calibration,
    split_names,
    within,
)
from taskcal.cli.output import warn_of_edits

if TYPE_CHECKING:
    Fit = Callable[[taskcal.Campaign], taskcal.Calibration]

Method = Literal["poses", "circles"]
"""How tracker frame and targets are registered."""


def register_by(
    method: Method, model: "taskcal.ErrorModel", campaign: "taskcal.Campaign"
) -> "taskcal.registration.Registration":
    """The registration of a campaign.

    Raises:
        CampaignError: the campaign does not determine it, or is not of this robot.
    """
    from taskcal.registration.plausibility import check_plausible

    registered = (
        taskcal.registration.register_from_circles(model, campaign)
        if method == "circles"
        else taskcal.register(model, campaign)
    )
    check_plausible(registered, model, campaign)
    return registered


@dataclass(frozen=True, kw_only=True)
class FitCommandOptions:
    """Options of a fit.

    Raises:
        typer.BadParameter: two options that contradict one another.
    """

    keep: str | None = option(
        None,
        "NAME,…",
        "Parameters to fit: names, symbols or frames (J2, tool); 'published', or 'none' for the frames alone.",
    )
    lengths_only: bool = option(False, help="Fit only the nominal lengths of the robot file, such as d2 and RL4.")
    prior: Literal["tolerances", "none"] = option("tolerances", help="Prior of the parameters.")
    loss: Literal["squared", "huber", "cauchy"] = option("squared", help="Loss; robust ones give outliers less weight.")
    frames: Literal["fit", "fixed"] = option("fit", help="Fit tracker frame and targets, or hold them as registered.")
    registration: str = option(
        "poses",
        "poses|circles|REG.json",
        "Start values of tracker frame and targets: all poses, axis circles, or a file of taskcal register.",
    )
    model_error_mm: float | None = option(
        None, "MM", "Model error, 1σ per axis; estimated by default.", callback=within(1e-6, 1e3)
    )
    gross_errors: Literal["leave out", "keep"] = option(
        "leave out", help="Reject gross errors (at most 10 % of the rows) and list them, or keep them."
    )
    target_within_mm: TargetWithinOption = TARGET_WITHIN_MM
    prior_scale: float | None = option(
        None, "FACTOR", "Factor of the tolerances; estimated by default.", callback=within(1e-6, 1e6)
    )
    like: Path | None = option(
        None,
        "OTHER.json",
        "Calibration of a robot of the same make: its sizes and model error are expected of this one, unless this robot's rows "
        "contradict them.",
    )
    unsealed: UnsealedOption = False
    mpe_to_sigma: float | None = option(
        None,
        "FACTOR",
        "Tracker 1σ per maximum permissible error; 0.5 by default, 0.577 if rectangular.",
        callback=within(1e-3, 1e3),
    )

    def __post_init__(self) -> None:
        if self.prior == "none" and self.prior_scale is not None:
            raise typer.BadParameter("without a prior there is nothing to scale", param_hint="--prior-scale / --prior")
        if self.prior == "none" and self.like is not None:
            raise typer.BadParameter(
                "a sibling tells the size of the prior; keep the prior, or omit --like", param_hint="--like / --prior"
            )
        names = self._names
        if self.lengths_only and names == ["published"]:
            raise typer.BadParameter(
                "--keep published selects geometric errors, not lengths; omit one",
                param_hint="--lengths-only / --keep",
            )

    @property
    def _names(self) -> list[str] | None:
        return split_names(self.keep, "--keep")

    @property
    def registration_file(self) -> Path | None:
        """The file that is read, if one is named."""
        return None if self.registration in ("poses", "circles") else Path(self.registration)

    def noise(self) -> "taskcal.TrackerNoise | None":
        """The tracker's; None for the default."""
        return None if self.mpe_to_sigma is None else taskcal.TrackerNoise(mpe_to_sigma=self.mpe_to_sigma)

    def options(self, model: "taskcal.ErrorModel", campaign: "taskcal.Campaign") -> "taskcal.identification.FitOptions":
        """The options of the fit.

        Raises:
            CampaignError: the campaign does not determine the registration.
            FileError: the registration's file is of another robot, or of other targets; or that of --like is no calibration.
            TaskcalError: nothing is published of the robot.
        """
        registration = register_by("circles", model, campaign) if self.registration == "circles" else None
        if self.registration_file is not None:
            path = self.registration_file
            registration = taskcal.registration.load_registration(path, model, campaign, unsealed=self.unsealed)
            warn_of_edits("" if registration.file == path.name else f"not as it was registered: {registration.file}")
        return taskcal.identification.FitOptions(
            keep=_kept(model, self._names),
            prior=None if self.prior == "none" else "tolerances",
            loss={"squared": taskcal.estimation.Squared, "huber": taskcal.Huber, "cauchy": taskcal.estimation.Cauchy}[
                self.loss
            ](),
            noise=self.noise(),
            registration=registration,
            frames=self.frames,
            model_error="estimate" if self.model_error_mm is None else self.model_error_mm * 1e-3,
            prior_scale="estimate" if self.prior_scale is None else self.prior_scale,
            gross_errors=self.gross_errors,
            target_within=self.target_within_mm * 1e-3,
            like=None if self.like is None else read_calibration(self.like, unsealed=self.unsealed),
        )


def _kept(model: "taskcal.ErrorModel", names: list[str] | None) -> tuple[str, ...] | None:
    """Parameters to fit; ``published`` stands for a publication's choice, ``none`` for the frames alone.

    Raises:
        TaskcalError: nothing is published of the robot.
    """
    if names == ["none"]:
        return ()
    if names != ["published"]:
        return None if names is None else tuple(names)
    from taskcal.errors import TaskcalError

    if not model.robot.published.source:
        raise TaskcalError(
            f"--keep published: the robot file of {model.robot.name} names no publication; name the parameters"
        )
    return taskcal.analysis.published_kept(model)


@dataclass(frozen=True, kw_only=True)
class HoldoutOptions:
    """Rows that are held out.

    Raises:
        typer.BadParameter: the share is not between 0 and 1, or there are both a share and folds.
    """

    holdout: float | None = option(None, "SHARE", "Hold out about this share of the rows, and predict it.")
    folds: int | None = option(None, "K", "Hold out each of K parts in turn, and predict it; then fit all rows.", min=2)
    holdout_by: Literal["neighbours", "blocks", "rows"] = option(
        "neighbours",
        help="Hold out groups of neighbouring poses, blocks of consecutive rows, or single rows at random (optimistic for "
        "clustered poses).",
    )
    seed: SeedOption = 0

    def __post_init__(self) -> None:
        if self.holdout is not None and not 0 < self.holdout < 1:
            raise typer.BadParameter(
                f"{self.holdout:g} is not a share between 0 and 1, such as 0.3", param_hint="--holdout"
            )
        if self.holdout is not None and self.folds is not None:
            raise typer.BadParameter("use --holdout or --folds, not both", param_hint="--holdout / --folds")
        if not self.asked and self.holdout_by != "neighbours":
            raise typer.BadParameter("nothing is held out; give --holdout or --folds too", param_hint="--holdout-by")

    @property
    def asked(self) -> bool:
        """Whether rows are to be held out."""
        return self.holdout is not None or self.folds is not None

    @property
    def fits(self) -> int:
        """Number of fits of the campaign."""
        return 1 + (self.folds or 0)

    def _holdout(self) -> "taskcal.identification.Holdout":

        return taskcal.identification.Holdout(share=self.holdout, folds=self.folds, by=self.holdout_by, seed=self.seed)

    def fit(
        self, read: CampaignRead, fit: "Fit", nominal: "Fit", noise: "taskcal.TrackerNoise | None"
    ) -> "taskcal.Calibration":
        """The calibration of the rows that are to be fitted, with its predictions of the others.

        Args:
            read: the campaign; rows that were not chosen are held out too.
            fit: of the rows of a campaign.
            nominal: of tracker frame and targets of the nominal robot.
            noise: the tracker's; None for the default.

        Raises:
            CampaignError: too few rows.
            FitError: a fit did not converge.
        """
        import numpy as np

        from taskcal.identification.holdout import with_held_out

        if self.asked:
            return taskcal.identification.hold_out(fit, read.whole, self._holdout(), nominal, noise=noise)
        calibration = fit(read.campaign)
        others = np.setdiff1d(np.arange(len(read.whole)), read.rows)
        if not read.whole.take(others).valid.any():
            return calibration
        return with_held_out(calibration, read.whole, others, nominal, noise=noise)

    def fitted_rows(self, read: CampaignRead) -> list[int]:
        """Rows that the calibration was fitted to, gross errors among them."""
        if self.holdout is None:
            return list(read.rows)
        out = {int(row) for row in self._holdout().choose(read.whole)}
        return [row for row in range(len(read.whole)) if row not in out]
