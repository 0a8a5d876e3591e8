"""Campaigns of a fleet that are not identified yet: each identified as by ``taskcal identify``, side by side."""

from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath

from taskcal.adaptation.fleet_files import FleetFiles, RobotFiles, SentFile, laid_out, read_file, reason_of
from taskcal.adaptation.workers import side_by_side
from taskcal.errors import TaskcalError
from taskcal.files import write_whole
from taskcal.identification.calibration import Calibration
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.holdout import Holdout, hold_out
from taskcal.identification.identify import identify_parameters
from taskcal.identification.nominal_fit import fit_nominal
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.drift import compensate_drift
from taskcal.measurement.reader import read_campaign
from taskcal.robot.error_model import ErrorModel

FOLDS = 5
"""Parts that are held out in turn, so that each calibration says what it predicts."""


@dataclass(frozen=True, kw_only=True)
class IdentifiedCampaign:
    """What became of a campaign."""

    campaign: str
    calibration: str
    """The file that was written, or would have been."""
    refusal: str | None
    """Why there is none."""


def without_calibration(robot: RobotFiles) -> tuple[str, ...]:
    """Campaigns of a robot beside which there is no calibration of the same name."""
    return tuple(name for name in robot.campaigns if _beside(name) not in robot.calibrations)


def _beside(campaign: str) -> str:
    return str(PurePosixPath(campaign).with_suffix(".json"))


def identify_campaigns(
    files: FleetFiles, model: ErrorModel, *, folds: int = FOLDS, engine: str = "loky", workers: int = -1
) -> Generator[IdentifiedCampaign, None, None]:
    """Identify every campaign that has no calibration, and write it beside the campaign, as ``NAME.json``.

    Args:
        files: of the fleet.
        model: of all robots.
        folds: parts that are held out in turn; the calibration is that of all rows.
        engine: of `side_by_side`.
        workers: how many; −1 for one per core.

    Yields:
        each as it is done; one that cannot be read or identified with the reason.

    Raises:
        TaskcalError: a calibration cannot be written.
    """
    sent = _sent([name for robot in files.robots for name in without_calibration(robot)], files.folder)
    with closing(side_by_side(partial(_identified, model, folds), sent, engine, workers)) as results:
        for name, text, refusal in results:
            if text is not None:
                write_whole(files.folder / _beside(name), text)
            yield IdentifiedCampaign(campaign=name, calibration=_beside(name), refusal=refusal)


def _sent(names: Sequence[str], folder: Path) -> Generator[SentFile | tuple[str, str], None, None]:
    """Files as there is room for them, or a name and the reason why it cannot be read."""
    for name in names:
        try:
            yield read_file(folder, name)
        except TaskcalError as refusal:
            yield name, reason_of(refusal, folder)


def _identified(model: ErrorModel, folds: int, sent: SentFile | tuple[str, str]) -> tuple[str, str | None, str | None]:
    """Name, the calibration's text, and the reason why there is none."""
    if isinstance(sent, tuple):
        return sent[0], None, sent[1]
    with laid_out([sent]) as folder:
        try:
            campaign = read_campaign(folder / sent.name, model.robot)
            followed = compensate_drift(campaign)
            campaign = replace(followed.campaign, notes=(*campaign.notes, *followed.remarks))
            return sent.name, _fitted(model, campaign, folds).to_text(), None
        except TaskcalError as refusal:
            return sent.name, None, reason_of(refusal, folder)


def _fitted(model: ErrorModel, campaign: Campaign, folds: int) -> Calibration:
    def fit(rows: Campaign) -> Calibration:
        return identify_parameters(model, rows)

    def nominal(rows: Campaign) -> Calibration:
        return fit_nominal(model, rows, FitOptions())

    return hold_out(fit, campaign, Holdout(folds=folds), nominal)
