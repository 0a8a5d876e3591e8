"""The verdict as sentence, picture, table and section: the expected error, whether it keeps the tolerance, what to do next."""

import math
from collections.abc import Mapping
from typing import Any

from taskcal.report.chart import VERMILION, Axis, Figure, Level, Panel, Series
from taskcal.report.content import Block, Bullets, Column, NextStep, Section, Text, TextTable
from taskcal_groundwork.said import Said, term

COLUMNS = (
    Column(Said("error of"), lambda one: term(one["subject"])),
    Column(Said("tolerance"), lambda one: term(one["decision"])),
    Column(Said("expected mm"), "expected_mm", ".3f"),
    Column(Said("95 % interval"), lambda one: describe_interval(one["interval_mm"])),
    Column(Said("allowed mm"), "tolerance_mm", ".3f", optional=True),
    Column(Said("largest share"), lambda one: describe_largest(one)),
)

OWN_REMEDIES = {
    "no tolerance is stated": Said("choose a task and state its tolerance"),
    "the tolerance lies within the interval": Said("a smaller uncertainty would decide"),
}
"""Of reasons that name nothing to be measured."""


def describe_interval(interval: tuple[float, float] | list[float] | None) -> str:
    """An interval in millimetres, in words."""
    return "–" if interval is None else Said("{low:.3f} to {high:.3f}", low=interval[0], high=interval[1])


def describe_largest(judgement: Mapping[str, Any]) -> str:
    """The largest source of what is to be expected, and its share."""
    if judgement["largest"] is None:
        return "–"
    return Said("{source} {share:.0%}", source=term(judgement["largest"]), share=judgement["share"])


def tabulate_verdict(verdict: Mapping[str, Any]) -> TextTable:
    """Tabulate the verdict, as `Verdict.summary` has it; lengths in millimetres, 3D rms."""
    files, rule = verdict["program"], {"tool": term(verdict["tool"]), "rule": term(verdict["rule"])}
    program = Said("the program {files}", files=files) if files else Said("the program")
    note = (
        Said(
            "Measured target and tool point over {task}, {program} at its targets; the instrument's noise is not in it. "
            "Tool point: {tool}. {rule}",
            task=verdict["task"],
            program=program,
            **rule,
        )
        if verdict["task"]
        else Said(
            "At the targets of {program}; the instrument's noise is not in it. Tool point: {tool}. {rule}",
            program=program,
            **rule,
        )
    )
    return TextTable.of(Said("Verdict: expected error, 3D rms"), COLUMNS, verdict["judgements"], note=note)


def state_verdict(verdict: Mapping[str, Any]) -> Said:
    """State the decision on the last subject whose error is known, in one sentence that can be signed.

    Args:
        verdict: as `Verdict.summary` has it.
    """
    last = next_source(verdict)
    low, high = last["interval_mm"]
    known = Said(
        "{where} the {subject} is expected to be off by {expected:.3f} mm (3D rms), 95 % interval {low:.3f} to {high:.3f} mm",
        where=Said("Over the task “{task}”", task=verdict["task"])
        if verdict["task"] and last["subject"] != "program on the part"
        else Said("At the targets of the program ({program})", program=verdict["program"] or "–"),
        subject=term(last["subject"]),
        expected=last["expected_mm"],
        low=low,
        high=high,
    )
    allowed = last["tolerance_mm"]
    if allowed is None:
        return Said("{known}; no tolerance is stated.", known=known)
    if last["decision"] == "met":
        return Said("{known}, all of it within the tolerance of {allowed:.3f} mm: met.", known=known, allowed=allowed)
    if last["decision"] == "not met":
        return Said(
            "{known}, none of it within the tolerance of {allowed:.3f} mm: not met.", known=known, allowed=allowed
        )
    return Said("{known}; whether the tolerance of {allowed:.3f} mm is met is not known.", known=known, allowed=allowed)


def draw_interval(judgement: Mapping[str, Any], subject: str, expected: str, tolerance: str) -> Figure:
    """Draw the interval of an expected error beside its tolerance.

    Args:
        judgement: of a subject whose error is known.
        subject: what it is called.
        expected: what its mark stands for.
        tolerance: what the line stands for.
    """
    low, high = judgement["interval_mm"]
    error = Series(
        x=[judgement["expected_mm"]],
        y=[0.0],
        low=[low],
        high=[high],
        name=expected,
        labels=(subject,),
        shape="diamond",
    )
    allowed = judgement["tolerance_mm"]
    levels = () if allowed is None else (Level(at=allowed, name=tolerance, colour=VERMILION, along="x"),)
    axis = Axis(unit="mm", zero=True)
    return Figure(panels=(Panel(x=axis, y=Axis(categories=("",)), series=(error,), levels=levels),))


def state_reasons(verdict: Mapping[str, Any]) -> list[Said]:
    """State why it is not known of some whether they keep the tolerance, each reason once; and what was overridden."""
    said: list[Said] = []
    for reason, of in subjects_of(verdict):
        why = _why(reason, reason["remedy"])
        if len(of) == len(verdict["judgements"]):
            said.append(Said("Not known: {why}.", why=why))
        else:
            first, *others = map(term, of)
            subjects = Said("{first} and the {second}", first=first, second=others[0]) if others else first
            said.append(Said("Not known of the {subjects}: {why}.", subjects=subjects, why=why))
    if verdict["override"] is not None:
        why = _why(verdict["override"])
        said.append(Said("Override: the program was written on request, for one run alone, although {why}.", why=why))
    return said


def _why(reason: Mapping[str, Any], remedy: str = "") -> Said:
    """Why it is not known whether a tolerance is met, of what, and what to do."""
    said, remedy = term(reason["why"]), remedy or OWN_REMEDIES.get(reason["why"], "")
    if reason["detail"]:
        said = Said("{why} ({detail})", why=said, detail=term(reason["detail"]))
    return Said("{why}: {remedy}", why=said, remedy=term(remedy)) if remedy else said


def subjects_of(verdict: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], list[str]]]:
    """Reasons why it is not known whether a tolerance is met, each with the subjects of which it is not."""
    found: list[tuple[Mapping[str, Any], list[str]]] = []
    for one in verdict["judgements"]:
        for reason in one["reasons"]:
            same = next((of for other, of in found if other == reason), None)
            if same is None:
                found.append((reason, [one["subject"]]))
            else:
                same.append(one["subject"])
    return found


def next_source(verdict: Mapping[str, Any]) -> Mapping[str, Any]:
    """The last judgement whose error is known, of which the largest share is to be lowered next."""
    return next(one for one in reversed(verdict["judgements"]) if one["largest"] is not None)


def verdict_section(verdict: Mapping[str, Any]) -> Section:
    """Make the section of the verdict: what lowers the largest share of the last error that is known is the step to take."""
    last = next_source(verdict)
    words = Said(
        "largest share of the remaining error: {source}, {share:.0%}; {remedy}",
        share=last["share"],
        source=term(last["largest"]),
        remedy=term(last["remedy"]),
    )
    return Section(Said("Verdict"), *verdict_blocks(verdict), NextStep(words, about=last["largest"]))


def verdict_blocks(verdict: Mapping[str, Any]) -> list[Block | str]:
    """Make what says the verdict: its sentence, its table and what is not known."""
    reasons = state_reasons(verdict)
    return [
        Text(state_verdict(verdict), leads=True),
        tabulate_verdict(verdict),
        *([Bullets(*reasons)] if reasons else []),
    ]


def with_program(verdict: Mapping[str, Any], result: Any) -> Mapping[str, Any] | None:
    """The verdict with the line of a program, where that was corrected by the same calibration for the same task.

    Args:
        verdict: on the calibration alone.
        result: what `taskcal correct --json` printed.

    Returns:
        the verdict of the correction; None where it is of another state, or no program was written and no reason says so.
    """
    try:
        corrected = result["verdict"]
        (one, *_), (other, *_, program) = verdict["judgements"], corrected["judgements"]
        same = verdict["task"] == corrected["task"] and all(
            math.isclose(one[key] or 0.0, other[key] or 0.0) for key in ("tolerance_mm", "expected_mm")
        )
        verdict_section(corrected)
        return corrected if same and (result["written"] or program["reasons"]) else None
    except (KeyError, TypeError, ValueError, AttributeError, StopIteration):
        return None
