"""``taskcal validate``: how well a calibration predicts another campaign."""

from dataclasses import dataclass
from typing import Literal

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.campaign import CampaignOptions
from taskcal.cli.options.common import (
    CalibrationArgument,
    CampaignsArgument,
    JsonOption,
    UnsealedOption,
    above_zero,
    read_calibration,
)
from taskcal.cli.output import error, info, show, show_facts, tell_edits, write_json

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
        callback=above_zero,
    )
    accept_of: Literal["max", "p95", "rms", "mean"] = option("max", help="Error statistic compared with the limit.")

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
) -> None:
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
    if as_json:
        write_json({**examination.summary(), "acceptance": None if decision is None else decision.summary()})
    else:
        frames = "tracker frame and targets refitted" if reregister else "frames of the calibration"
        if measured.observations:
            frames = "fixed objects located by the calibrated robot, from these rows"
        statistic = "Position error" if examination.validation.has_axes else "Error"
        title = f"{statistic} of {calibrated.model.robot.name} on {' '.join(map(str, campaign))} ({frames})"
        tell_edits()
        _show(title, examination, decision, None if all_rows else MAX_WORST)
    if (off := examination.off_stored) is not None and off > MAX_OFF_STORED_M:
        error(
            f"{calibration}: its stored residuals of this campaign, to which it was fitted, are not met: by {off * 1e3:.3g} mm. "
            "The file was edited, or an effect's code has changed since; identify again"
        )
        raise typer.Exit(1)
    if decision is not None and not decision.accepted:
        raise typer.Exit(1)


def _show(
    title: str,
    examination: "taskcal.identification.Examination",
    decision: "taskcal.identification.Acceptance | None",
    worst: int | None,
) -> None:
    from taskcal.report import comparison as tables
    from taskcal.report.calibration import are_most, describe_outliers, tabulate_errors

    parts = {label.replace("_", " measured "): part.summary() for label, (part, _) in examination.by_range().items()}
    show(tabulate_errors({"predicted": examination.validation.summary(), **parts}, title))
    show(tables.tabulate_points(examination, worst))
    if examination.outliers:
        show(tables.tabulate_examined_outliers(examination, worst))
    mostly = are_most(len(examination.outliers), len(examination.validation))
    outliers = describe_outliers(examination.shared, mostly=mostly)
    facts = [("95 % regions", tables.describe_regions(examination)), ("outliers", outliers)]
    if examination.validation.compared:
        facts.insert(0, ("stated distances", tables.describe_compared(examination)))
    if decision is not None:
        facts += [("decision", tables.describe_decision(decision)), ("decision rule", tables.describe_rule(decision))]
    show_facts(facts)


def _shared_targets(measured: "taskcal.Campaign", calibration: "taskcal.Calibration") -> "taskcal.Campaign":
    """The campaign without targets that the calibration does not know, where it knows others of it."""
    shared = [name for name in measured.targets if name in calibration.targets]
    if not shared or len(shared) == len(measured.targets):
        return measured
    left_out = ", ".join(name for name in measured.targets if name not in shared)
    info(f"leaving out {left_out}: the calibration knows {', '.join(calibration.targets)}")
    return measured.of_targets(shared)
