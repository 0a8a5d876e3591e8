"""What a run of the procedure leaves in a folder: its campaigns, and the calibrations of the whole model."""

from pathlib import Path

from taskcal.demo.procedure import ONE, SEVERAL, Procedure
from taskcal.measurement.writer import write_campaign

NAMES = {ONE: "one-orientation", SEVERAL: "several-orientations"}


def write_procedure(procedure: Procedure, folder: Path) -> dict[str, Path]:
    """Write them, and say which file holds what.

    Raises:
        OSError: a file cannot be written.
    """
    files: dict[str, Path] = {}
    for label, campaign in procedure.campaigns.items():
        files[f"campaign {label}"] = folder / f"campaign-{NAMES[label]}.csv"
        write_campaign(files[f"campaign {label}"], campaign, procedure.model.robot)
    for fit in procedure.fits:
        if fit.parameters == len(procedure.model):
            files[f"calibration {fit.campaign}"] = folder / f"calibration-{NAMES[fit.campaign]}.json"
            fit.calibration.save(files[f"calibration {fit.campaign}"])
    return files
