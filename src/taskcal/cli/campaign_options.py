"""What every command that reads a campaign lets the user say of it: its form, rows, targets, reference points, drift."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from taskcal.cli.drift import DriftChoice, compensate
from taskcal.cli.options import split_names
from taskcal.cli.output import info
from taskcal.cli.table_options import TableOptions

if TYPE_CHECKING:
    from taskcal.measurement.campaign import Campaign
    from taskcal.measurement.tracker import TrackerNoise
    from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class CampaignRead:
    """A campaign, and which of its rows are to be used."""

    whole: "Campaign"
    rows: tuple[int, ...]
    """Numbers of the rows to use, counted from 0."""
    drift: dict[str, Any] | None
    """What was done about reference points that moved; None where nothing was."""

    @property
    def campaign(self) -> "Campaign":
        """The rows to use."""
        return self.whole if self.rows == tuple(range(len(self.whole))) else self.whole.take(list(self.rows))


@dataclass(frozen=True, kw_only=True)
class CampaignOptions(TableOptions):
    """How a campaign is read.

    Raises:
        typer.BadParameter: a list has an empty name, or one that stands twice.
    """

    rows: Annotated[
        str | None,
        typer.Option(
            "--rows",
            metavar="A:B|FILE",
            help="Rows to use, counted from 0: A:B without B, or a file with one number per line.",
        ),
    ] = None
    targets: Annotated[
        str | None,
        typer.Option(
            "--targets", metavar="NAME,…", help="Targets to use; by default all that are not reference points."
        ),
    ] = None
    reference_points: Annotated[
        str | None,
        typer.Option(
            "--reference-points",
            metavar="NAME,…",
            help="Fixed points beside the robot; by default those whose names begin with 'base'.",
        ),
    ] = None
    drift: Annotated[
        DriftChoice,
        typer.Option(
            "--drift",
            help="Compensate drift by the reference points if they moved by more than their noise, or ignore them.",
        ),
    ] = DriftChoice.follow

    def __post_init__(self) -> None:
        split_names(self.targets, "--targets")
        split_names(self.reference_points, "--reference-points")

    def read(
        self,
        path: Path,
        robot: "Robot",
        *,
        targets: Sequence[str] | None = None,
        noise: "TrackerNoise | None" = None,
    ) -> CampaignRead:
        """Read a campaign of a robot.

        Args:
            path: its file.
            robot: that was measured.
            targets: those to read where the user names none; None for all that are not reference points.
            noise: the tracker's, by which reference points are judged.

        Raises:
            FileError: it cannot be read, or does not have what was asked for.
            CampaignError: it does not have such a row.
        """
        from taskcal.cli.rows import choose_rows
        from taskcal.measurement.reader import read_campaign

        chosen = split_names(self.targets, "--targets") or targets
        whole = read_campaign(
            path,
            robot,
            targets=chosen,
            reference_points=split_names(self.reference_points, "--reference-points"),
            options=self.read_options,
        )
        for note in whole.notes:
            info(f"{path.name}: {note}")
        whole, drift = compensate(whole, self.drift, noise)
        rows = range(len(whole)) if self.rows is None else choose_rows(self.rows, len(whole), path)
        return CampaignRead(whole=whole, rows=tuple(rows), drift=drift)


@dataclass(frozen=True, kw_only=True)
class MeasuredOptions(CampaignOptions):
    """A campaign that may be given, and how it is read.

    Raises:
        typer.BadParameter: how to read a campaign, and no campaign.
    """

    of_others: ClassVar[tuple[str, ...]] = ()
    """Options that speak of something else too, where a command has it."""

    campaign: Annotated[
        Path | None,
        typer.Option("--campaign", metavar="CAMPAIGN.csv", readable=False, help="Measurements to use."),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.campaign is not None:
            return
        for option in fields(CampaignOptions):
            if getattr(self, option.name) != option.default and option.name not in self.of_others:
                raise typer.BadParameter(
                    "there is no campaign that it could speak of; give one with --campaign",
                    param_hint=f"--{option.name.replace('_', '-')}",
                )

    @property
    def inputs(self) -> tuple[str | Path | None, ...]:
        """Files that are read."""
        return self.campaign, self.points, self.rows, self.distances
