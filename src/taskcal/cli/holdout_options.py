"""Which rows a fit does not see, as the command line is told."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from taskcal.cli.campaign_options import CampaignRead
from taskcal.cli.options import SeedOption

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.identification.holdout import Holdout
    from taskcal.measurement.campaign import Campaign

    Fit = Callable[[Campaign], Calibration]


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
