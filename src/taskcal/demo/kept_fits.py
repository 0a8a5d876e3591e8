"""Calibrations that are kept as they are found, so that a long run goes on where it was interrupted."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taskcal.files import write_whole
from taskcal.identification.calibration import Calibration
from taskcal.identification.calibration_file import load_calibration
from taskcal.identification.provenance import package_version
from taskcal.measurement.campaign import Campaign
from taskcal.robot.error_model import ErrorModel

DIGITS = 16
"""Of the digest that names a file."""


@dataclass(frozen=True, kw_only=True)
class KeptFits:
    """A fit that is made once for each campaign by each version of the package.

    Who works on the fit itself deletes the folder: within a version its files are taken as they are.
    """

    folder: Path
    """Where the calibrations are, named by what they were fitted to; made if absent."""
    fit: Callable[[ErrorModel, Campaign], Calibration]

    def __call__(self, model: ErrorModel, campaign: Campaign) -> Calibration:
        """The calibration, from its file if there is one."""
        path = self.folder / f"{digest(model, campaign)}.json"
        if not path.exists():
            calibration = self.fit(model, campaign)
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, calibration.to_text())
        return load_calibration(path)


def digest(model: ErrorModel, campaign: Campaign) -> str:
    """A name for what is fitted: the version of the package, the model, and all numbers of the campaign."""
    conditions = campaign.conditions
    parts = [package_version(), repr(model), *campaign.targets]
    arrays = [
        campaign.q,
        campaign.points,
        conditions.approach,
        conditions.move,
        conditions.temperature,
        conditions.time,
    ]
    h = hashlib.sha256("\n".join(parts).encode())
    for array in arrays:
        h.update(b"none" if array is None else np.ascontiguousarray(array).tobytes())
    return h.hexdigest()[:DIGITS]
