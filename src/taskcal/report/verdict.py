"""The verdict as a table, a section and a certificate: the expected error, whether it keeps the tolerance, what to do next."""

from collections.abc import Mapping
from typing import Any

from taskcal.correction.verdict import Verdict
from taskcal.identification.calibration import Calibration
from taskcal.report.content import Block, Column, Numbers, Section, Table
from taskcal.report.page import Page

COLUMNS = (
    Column("error of", "subject"),
    Column("tolerance", "decision"),
    Column("expected mm", "expected_mm", ".3f"),
    Column("95 % interval", lambda one: describe_interval(one["interval_mm"])),
    Column("allowed mm", "tolerance_mm", ".3f", optional=True),
    Column("largest share", lambda one: describe_largest(one)),
)


def describe_interval(interval: tuple[float, float] | list[float] | None) -> str:
    """An interval in millimetres, in words."""
    return "–" if interval is None else f"{interval[0]:.3f} to {interval[1]:.3f}"


def describe_largest(judgement: Mapping[str, Any]) -> str:
    """The largest source of what is to be expected, and its share."""
    return "–" if judgement["largest"] is None else f"{judgement['largest']} {judgement['share']:.0%}"


def tabulate_verdict(verdict: Verdict) -> Table:
    """Tabulate the verdict; lengths in millimetres, 3D rms."""
    over = (
        f"measured target and tool point over {verdict.task}, the program at its targets"
        if verdict.task
        else "at the targets"
    )
    note = f"{over[0].upper()}{over[1:]}; the instrument's noise is not in it. {_reasons(verdict)}".strip()
    return Table.of(
        "Verdict: expected error, 3D rms", COLUMNS, [one.summary() for one in verdict.judgements], note=note
    )


def _reasons(verdict: Verdict) -> str:
    """Why it is not known of some whether they keep the tolerance, each reason once."""
    by_reason: dict[str, list[str]] = {}
    for one in verdict.judgements:
        if one.reason:
            by_reason.setdefault(one.reason, []).append(one.subject)
    every = len(verdict.judgements)
    said = ((reason, "" if len(of) == every else f" of the {' and the '.join(of)}") for reason, of in by_reason.items())
    return " ".join(f"Not known{which}: {reason}." for reason, which in said)


def next_step(verdict: Verdict) -> str:
    """What lowers the largest share of the error, of the last subject whose error is known."""
    budget = next(one.budget for one in reversed(verdict.judgements) if one.budget is not None)
    source, share, remedy = budget.largest
    return f"{share:.0%} of what is left is {source}: {remedy}"


def verdict_section(verdict: Verdict) -> Section:
    """Make the section of the verdict."""
    step = next_step(verdict)
    return Section("Verdict", tabulate_verdict(verdict), f"Next: {step}.")


# The certificate: one sheet to be signed, without figures; the report is its annex.

SIGNED = ("calibrated by", "checked by")

BLANK = "…" * 12
"""A line to write on."""


def certificate_page(calibration: Calibration, verdict: Verdict | None) -> Page:
    """Make the certificate of a calibration.

    Args:
        calibration: the calibration.
        verdict: over a task, where one was named.
    """
    robot, source, held_out = calibration.model.robot, calibration.provenance, calibration.held_out
    blocks: list[Block | str] = []
    if held_out is None:
        blocks.append("No rows were held out: the error at other poses was not measured.")
    else:
        before, after = held_out.nominal_validation, held_out.validation
        blocks.append(
            Numbers(
                (f"{before.mean * 1e3:.3f}", "mm", "before: mean 3D error of the nominal robot, registered"),
                (f"{after.mean * 1e3:.3f}", "mm", "after: mean 3D error of the calibrated robot"),
                (f"{after.p95 * 1e3:.3f}", "mm", "after: 95th percentile"),
                (f"{after.maximum * 1e3:.3f}", "mm", "after: largest error"),
            )
        )
        blocks.append(f"Errors of {len(held_out)} rows that were not fitted, as measured.")
    if verdict is None:
        blocks.append("No task was named, so that no tolerance is judged.")
    else:
        blocks.append(tabulate_verdict(verdict))
    blocks.append(
        "Intervals are of 95 %. Uncertainty by JCGM 100:2008 (GUM): covariance of the estimated parameters, and what the model "
        "does not explain. Valid for the robot, tool and range as measured."
    )
    signed = Table.of_rows(
        "Signatures",
        ("", "name", "date", "signature"),
        [(role, BLANK, BLANK, BLANK) for role in SIGNED],
        text_columns=(0, 1, 2, 3),
    )
    return Page(
        title="Certificate of calibration",
        sections=(Section("Result", *blocks), Section("Signed", signed)),
        lead=f"{robot.title or robot.name}, {source.rows} rows of {source.campaign or 'a campaign'}, fitted {source.created[:10]}.",
        source=f"campaign {source.campaign_digest}, robot {source.robot_digest}",
    )
