"""The verdict as both the result and the program show it: decision, expected error, and where its largest share is lowered."""

from collections.abc import Mapping
from typing import Any

from nicegui import ui

from taskcal.correction.correction import LEFT
from taskcal.studio.controls import text
from taskcal.studio.project import Project
from taskcal.studio.results import corrected_of, read_result
from taskcal.studio.steps import link
from taskcal.studio.texts import Texts

COLOURS = {"met": "good", "not met": "bad", "not known": "quiet"}

PAGES = {"geometry": "plan", "model error": "identify", "tool": "program", "part": "program", LEFT: "program"}
"""Where each source is lowered."""


def of_program(project: Project) -> Mapping[str, Any] | None:
    """The verdict that the correction of the chosen program printed; None where there is none."""
    program = project.choices.program
    result = read_result(project, corrected_of(program), "verdict") if program else None
    return None if result is None else result["verdict"]


def latest(judged: Mapping[str, Any], project: Project) -> Mapping[str, Any]:
    """The verdict with the program's line, where the program was corrected by this calibration for this task."""
    corrected = of_program(project)
    if corrected is None or corrected["judgements"][0] != judged["judgements"][0]:
        return judged
    return corrected


def next_source(verdict: Mapping[str, Any]) -> Mapping[str, Any]:
    """The last judgement whose error is known, of which the largest share is to be lowered next."""
    return next(one for one in reversed(verdict["judgements"]) if one["largest"] is not None)


def is_lowered_by(verdict: Mapping[str, Any] | None, *sources: str) -> bool:
    """Whether one of some sources is what to lower next."""
    return verdict is not None and next_source(verdict)["largest"] in sources


def show_verdict(verdict: Mapping[str, Any], texts: Texts) -> None:
    """Show a verdict, as `Verdict.summary` gives it."""
    text("h2", texts("verdict.title"))
    header = ("subject", "decision", "expected", "interval", "allowed", "largest")
    with (
        ui.element("div").classes("scroll").props("tabindex=0 role=region") as around,
        ui.element("table").classes("plain"),
    ):
        around.props["aria-label"] = texts("verdict.title")
        over = texts("verdict.over", task=verdict["task"]) if verdict["task"] else texts("verdict.over_targets")
        text("caption", over).classes("long")
        with ui.element("thead"), ui.element("tr"):
            for key in header:
                words = "words" if key in ("subject", "decision", "largest") else ""
                text("th", texts(f"verdict.{key}")).props("scope=col").classes(words)
        with ui.element("tbody"):
            for judgement in verdict["judgements"]:
                _row(judgement, texts)
    reasons = dict.fromkeys(one["reason"] for one in verdict["judgements"] if one["reason"])
    for reason in reasons:
        text("p", texts.named("verdict", reason)).classes("quiet")
    last = next_source(verdict)
    page = PAGES[last["largest"]]
    with ui.element("p"):
        share = f"{last['share']:.0%}"
        source = texts.named("verdict", last["largest"])
        text("span", texts("verdict.next", share=share, source=source) + " ")
        link(texts("program.around" if page == "program" else f"{page}.title"), f"/{page}")


def _row(judgement: Mapping[str, Any], texts: Texts) -> None:
    known = judgement["expected_mm"] is not None
    low, high = judgement["interval_mm"] or (0.0, 0.0)
    allowed = judgement["tolerance_mm"]
    with ui.element("tr"):
        text("td", texts.named("verdict", judgement["subject"])).classes("words")
        decision = judgement["decision"]
        text("td", texts.named("verdict", decision)).classes(f"words {COLOURS[decision]}")
        text("td", texts.number(judgement["expected_mm"], ".3f") if known else "–")
        text("td", f"{texts.number(low, '.3f')} – {texts.number(high, '.3f')}" if known else "–")
        text("td", "–" if allowed is None else texts.number(allowed, ".3f"))
        source = texts.named("verdict", judgement["largest"] or "")
        text("td", f"{source} {judgement['share']:.0%}" if known else "–").classes("words")
