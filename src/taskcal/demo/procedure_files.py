"""What a run of the procedure leaves in a folder: its campaigns, and the calibrations of the whole model."""

from pathlib import Path

from taskcal.demo.procedure import ONE, SEVERAL, Procedure
from taskcal.measurement.writer import campaign_text

NAMES = {ONE: "one-orientation", SEVERAL: "several-orientations"}
KINDS = {"campaign": "csv", "calibration": "json"}


def procedure_names() -> tuple[str, ...]:
    """Names of all these files."""
    return tuple(f"{kind}-{name}.{ending}" for name in NAMES.values() for kind, ending in KINDS.items())


def procedure_contents(procedure: Procedure, folder: Path) -> tuple[dict[str, Path], dict[Path, str | bytes]]:
    """Which file holds what, and what is to be written in each."""
    files: dict[str, Path] = {}
    contents: dict[Path, str | bytes] = {}
    for label, campaign in procedure.campaigns.items():
        files[f"campaign {label}"] = folder / f"campaign-{NAMES[label]}.csv"
        contents[files[f"campaign {label}"]] = campaign_text(campaign, procedure.model.robot)
    for fit in procedure.fits:
        if fit.parameters == len(procedure.model):
            files[f"calibration {fit.campaign}"] = folder / f"calibration-{NAMES[fit.campaign]}.json"
            contents[files[f"calibration {fit.campaign}"]] = fit.calibration.to_text()
    return files, contents
