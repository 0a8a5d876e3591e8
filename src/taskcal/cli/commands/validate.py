"""``taskcal validate``: how well a calibration predicts another campaign."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.campaign import CampaignOptions
from taskcal.cli.options.common import (
    CalibrationArgument,
    CampaignsArgument,
    UnsealedOption,
    read_calibration,
)
from taskcal.cli.output import info
from taskcal.cli.run import JsonOption, Result

if TYPE_CHECKING:
    import taskcal.report.comparison

MAX_OFF_STORED_M = 1e-9
"""Difference between stored and computed residuals that rounding may leave, metres (radians): predictions some metres away are
rounded by 1e-15 m in each of some thousand operations, and a tracker resolves 1e-7 m."""

MAX_WORST = 10
"""Points that are listed, the largest errors."""


@dataclass(frozen=True, kw_only=True)
class AcceptanceOptions:
    """Whether and how a decision is made."""

    accept: float | None = option(
        None,
        "LIMIT",
        "Pass or fail by this limit, mm, with a guard band (JCGM 106); exit status 1 for fail.",
        low=0.0,
        ends=False,
    )
    accept_of: Literal["rms", "max", "p95", "mean"] = option(
        "rms", help="Error statistic compared with the limit; rms is that of the verdict."
    )

    def decide(self, examination: "taskcal.identification.Examination") -> "taskcal.identification.Acceptance | None":
        """The decision; None where no limit was given."""
        return (
            None
            if self.accept is None
            else taskcal.identification.accept(examination, self.accept * 1e-3, self.accept_of)
        )


def command(
    *,
    calibration: CalibrationArgument,
    unsealed: UnsealedOption = False,
    campaign: CampaignsArgument,
    reregister: bool = option(
        False, help="Refit tracker frame and targets to this campaign, with the robot's geometry fixed."
    ),
    all_rows: bool = option(False, help="List every point, not only the largest errors."),
    acceptance: AcceptanceOptions,
    reading: CampaignOptions,
    as_json: JsonOption = False,
) -> Result:
    """Validate a calibration against a campaign; optional pass/fail decision."""
    calibrated = read_calibration(calibration, unsealed=unsealed)
    known = None if reregister or reading.board is None else calibrated.targets
    measured = reading.read(campaign, calibrated.model.robot, targets=known).campaign
    if reading.targets is None and not reregister:
        measured = _shared_targets(measured, calibrated)
    examination = taskcal.identification.examine(calibrated, measured, reregister=reregister)
    for remark in examination.validation.remarks:
        info(remark)
    decision = acceptance.decide(examination)
    frames = "tracker frame and targets refitted" if reregister else "frames of the calibration"
    if not measured.tracked:
        frames = "fixed objects located by the calibrated robot, from these rows"
    where = f"{calibrated.model.robot.name} on {' '.join(map(str, campaign))} ({frames})"
    failed = decision is not None and not decision.accepted
    if (off := examination.off_stored) is not None and off > MAX_OFF_STORED_M:
        failed = (
            f"{calibration}: its stored residuals of this campaign, to which it was fitted, are not met: by {off * 1e3:.3g} mm. "
            "The file was edited, or an effect's code has changed since; identify again"
        )
    return Result(
        summary={**examination.summary(), "acceptance": None if decision is None else decision.summary()},
        sections=lambda: [
            taskcal.report.comparison.examination_section(examination, where, decision, None if all_rows else MAX_WORST)
        ],
        failed=failed,
    )


def _shared_targets(measured: "taskcal.Campaign", calibration: "taskcal.Calibration") -> "taskcal.Campaign":
    """The campaign without targets that the calibration does not know, where it knows others of it."""
    shared = [name for name in measured.targets if name in calibration.targets]
    if not shared or len(shared) == len(measured.targets):
        return measured
    left_out = ", ".join(name for name in measured.targets if name not in shared)
    info(f"leaving out {left_out}: the calibration knows {', '.join(calibration.targets)}")
    return measured.of_targets(shared)
