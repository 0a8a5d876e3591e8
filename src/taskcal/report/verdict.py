"""The verdict as a table and a section: what error is to be expected, whether it keeps the tolerance, and what to do next."""

from collections.abc import Mapping
from typing import Any

from taskcal.correction.verdict import Verdict
from taskcal.report.content import Column, Section, Table

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
