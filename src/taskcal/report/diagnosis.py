"""A campaign in sections: what was read of it, and the mistakes that the doctor finds in it."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import listed
from taskcal.report.content import Column, Facts, Section, TextTable
from taskcal_groundwork.said import Said, joined, numeral, term

MAX_SUBJECTS = 6
"""Of a finding that are named."""

CONDITIONS = {
    "temperature": Said("temperature"),
    "time": Said("time"),
    "approach": Said("approach direction"),
    "move": Said("last move"),
}
"""What rows may tell beside joints and points, by its field of a campaign."""


def campaign_section(campaign: Campaign) -> Section:
    """What was read of a campaign."""
    told = [words for name, words in CONDITIONS.items() if getattr(campaign, name) is not None]
    return Section(
        Said("Import summary"),
        Facts(
            (Said("poses"), numeral(len(campaign), "d")),
            (Said("targets on the tool"), ", ".join(campaign.targets)),
            (Said("missing points (beam lost)"), numeral(int((~campaign.valid).sum()), "d")),
            (Said("fixed reference points"), ", ".join(campaign.reference_points) or "–"),
            (Said("conditions of the rows"), joined(", ", told) if told else "–"),
        ),
    )


def name_subjects(subjects: Sequence[str]) -> str:
    """What a finding concerns: joints, columns, rows."""
    return listed(subjects, MAX_SUBJECTS)


def findings_table(
    findings: Sequence[Mapping[str, Any]], named: Callable[[Mapping[str, Any]], str] | None = None, *more: Column
) -> TextTable:
    """Findings as the doctor's JSON has them.

    Args:
        findings: the findings.
        named: words for one; its id by default.
        more: further columns.
    """
    columns = (
        Column(Said("finding"), named or (lambda finding: term(finding["id"]))),
        Column(Said("of"), lambda finding: name_subjects(finding["subject"])),
        Column(Said("error, mm"), "error_before_mm", ".2f"),
        Column(Said("error if fixed, mm"), "error_after_mm", ".2f"),
        Column(Said("confidence"), "confidence", ".0%"),
        *more,
    )
    return TextTable.of("", columns, findings)
