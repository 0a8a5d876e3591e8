"""The verdict as both the result and the program show it: decision, expected error, and where its largest share is lowered."""

from collections.abc import Mapping
from typing import Any

from taskcal.correction.correction import LEFT
from taskcal.report.verdict import draw_interval, next_source, verdict_section, with_program
from taskcal_groundwork.said import term
from taskcal_studio.controls import headline, text
from taskcal_studio.project import Project
from taskcal_studio.results import corrected_of, read_result
from taskcal_studio.sections import show_block
from taskcal_studio.texts import Texts
from taskcal_studio.views import figure

COLOURS = {"met": "good", "not met": "bad", "not known": "quiet"}

AROUND, BOUNDS = "around", "bounds"
"""Parts of the program's page, on tools and parts, and on the bounds of a correction, as links have them."""

PAGES = {
    "geometry": ("plan.title", "/plan"),
    "model error": ("identify.title", "/identify"),
    "tool": ("program.around", f"/program#{AROUND}"),
    "part": ("program.around", f"/program#{AROUND}"),
    LEFT: ("program.bounds", f"/program#{BOUNDS}"),
}
"""Text and address of where each source is lowered."""


def latest(judged: Mapping[str, Any], project: Project) -> Mapping[str, Any]:
    """The verdict with the chosen program's line, where that was corrected by this calibration for this task."""
    program = project.choices.program
    result = read_result(project, corrected_of(program)) if program else None
    return with_program(judged, result) or judged


def is_lowered_by(verdict: Mapping[str, Any] | None, *sources: str) -> bool:
    """Whether one of some sources is what to lower next."""
    return verdict is not None and next_source(verdict)["largest"] in sources


def show_verdict(verdict: Mapping[str, Any], texts: Texts) -> None:
    """Show a verdict, as `Verdict.summary` gives it: first the decision in large type, with its interval.

    Decisions have no colour where one was overridden.
    """
    links = {source: (texts(label), address) for source, (label, address) in PAGES.items()}
    section, last = verdict_section(verdict), next_source(verdict)
    colours = {} if verdict["override"] else COLOURS
    subject, decision = (texts.said(term(last[key])) for key in ("subject", "decision"))
    sentence, *blocks = section.blocks
    text("h2", texts.said(section.title))
    headline(f"{subject}: {decision}", style=colours.get(last["decision"], "quiet"))
    show_block(sentence, texts)
    drawn = draw_interval(last, subject, texts("verdict.expected_error"), texts("verdict.decision"))
    figure(texts("verdict.interval_of", subject=subject), drawn, texts)
    for block in blocks:
        show_block(block, texts, links=links, classes=colours)
