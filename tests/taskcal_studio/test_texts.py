"""Every text stands in every language, is used, and has the same places to fill."""

import ast
import inspect
import json
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from string import Formatter

import numpy as np
import pytest

import taskcal
import taskcal.live
import taskcal_devices
import taskcal_groundwork.options
import taskcal_studio
from robot_programs.core.source import Place
from taskcal.cli.commands import measure
from taskcal.correction.correction import REMEDIES
from taskcal.correction.verdict import OWN_TOOL, RULE, Decision, Subject, Why
from taskcal.diagnosis.diagnose import MISTAKES
from taskcal.estimation.least_squares import Ended
from taskcal.identification.calibration import Calibration
from taskcal.identification.checks import checks
from taskcal.identification.holdout import hold_out
from taskcal.identification.identify import identify
from taskcal.identification.options import Holdout
from taskcal.identification.uncertainty_budget import REACHED, UNEXPLAINED
from taskcal.live.stillness import MissedError
from taskcal.observations.point import Tracker
from taskcal.registration.registration import Method
from taskcal.report import calibration as calibration_report
from taskcal.report import camera, content, correction, plan, verdict
from taskcal.report.calibration import calibration_sections, say_option
from taskcal.report.content import Bullets, Chart, Facts, Numbers, Section, Text, TextTable, moment
from taskcal.report.correction import group_remarks
from taskcal.report.page import ReportHeader
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.default_task import default_task, task_text
from taskcal.task.task import load_task
from taskcal.virtual.cell import simulate
from taskcal_groundwork.said import Said, term
from taskcal_studio.pages.measurements_page import mend
from taskcal_studio.stated_options import GROUPS, offered
from taskcal_studio.texts import LANGUAGES, LIBRARY_LANGUAGE, Texts, catalogue, preferred, sentences

SAYING = [
    path for package in (taskcal.live, taskcal_devices) for path in sorted(Path(package.__file__).parent.glob("*.py"))
]
"""Files that say to people what happens while measuring."""
SOURCES = "\n".join(path.read_text() for path in Path(taskcal_studio.__file__).parent.rglob("*.py"))


def templates_of_options() -> set[str]:
    """What options say to people on a page: what each is, and why it cannot be."""
    modules = {module for groups in GROUPS.values() for module in map(inspect.getmodule, groups)}
    calls = [
        call.args[0]
        for path in (taskcal_groundwork.options.__file__, *(module.__file__ for module in modules))
        for call in ast.walk(ast.parse(Path(path).read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") in ("OptionError", "Said")
    ]
    said = {one.value for one in calls if isinstance(one, ast.Constant)} | set(
        taskcal_groundwork.options.OUTSIDE.values()
    )
    return said | {one.option.help for command in GROUPS for one in offered(command).values()}


OF_OPTIONS = templates_of_options()
UNITS = {"mm", "mrad", "px", "rms", "ppm", "deg"}
SHOWN = tuple(str(module.__file__) for module in (verdict, calibration_report, camera, content, correction, plan))
"""Modules of sections that pages show."""
OF_SHOWN = tuple(
    f"{Path(taskcal.__file__).parent}/{name}.py"
    for name in (
        *(f"correction/{part}" for part in ("cell", "controller", "correct", "correction", "frames", "verdict")),
        *(f"identification/checks/{part}" for part in ("checks", "course", "digits")),
        *(f"identification/{part}" for part in ("calibration", "effects", "identify", "measured_range", "sibling")),
        *("identification/uncertainty_budget", "kinematics/inverse", "kinematics/tracing", "registration/length_scale"),
        *("campaigns/drift", "robot/robot", *(f"robot/effects/{part}" for part in ("base", "drives", "gears"))),
        *("cli/commands/correct", "cli/commands/identify", "cli/options/common"),
        *(f"observations/{part}" for part in ("distance", "instrument", "landmark", "pixels", "point", "socket")),
        "report/sensitivity",
        "report/diagnosis",
    )
)
"""Modules that say something of these sections, among else."""
REMARKING = tuple(
    f"{Path(taskcal.__file__).parent}/{name}.py"
    for name in (
        *(f"identification/checks/{part}" for part in ("checks", "course", "digits")),
        *(f"identification/{part}" for part in ("effects", "measured_range", "sibling")),
        *("campaigns/drift", "correction/correct", "kinematics/tracing", "registration/length_scale"),
    )
)
"""Modules whose remarks and reasons pages show."""
OF_REPORTS_ALONE = {
    "analyses that only reports have": {
        "residual_analysis_section",
        "_findings",
        "draw_against",
        "task_uncertainty_section",
    },
    "heads of pages that are printed": {"calibration_page", "correction_page", "plan_page"},
    "figures that only reports have": {"draw_errors", "draw_program", "plan_scene"},
    "terminals, which are English": {"_without_spare", "camera_facts", "_known_to"},
    "refusals, and keys of files": {
        *("_describe_motion", "_seen", "describe_camera", "other_joints", "correct", "find_correction"),
    },
    "programmers": {"Explanation"},
}
"""Functions of these modules whose words no page shows, by the reason."""
OF_VERDICTS = {*Why.__args__, *Subject.__args__, *Decision.__args__, *REMEDIES, *REMEDIES.values(), RULE, OWN_TOOL}


OF_FITS = {
    *(one.template for one in vars(checks).values() if isinstance(one, checks.Safeguard) and one.does != "refuses"),
    *(ended.value for ended in Ended),
    *Method.__args__,
    *("max", "mean", "rms", "p95", "base", "tool", "pinhole", "fisheye"),
    *(UNEXPLAINED, REACHED, "parameters, tracker frame and target: posterior covariance"),
    "geometry, effects and their sizes have converged",
}


def places(text: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(text) if name}


def test_texts_exist_in_every_language_with_same_placeholders() -> None:
    """Every text exists in every language with the same placeholders."""
    for key, texts in catalogue().items():
        assert set(texts) == set(LANGUAGES), key
        assert len({frozenset(places(text)) for text in texts.values()}) == 1, key
        assert all(text.strip() == text and text for text in texts.values()), key


def test_every_text_that_pages_ask_for_is_there() -> None:
    asked = set(re.findall(r'texts\(\s*"([a-z_]+\.[a-z_]+)"', SOURCES))
    assert asked
    assert asked <= catalogue().keys(), asked - catalogue().keys()


def test_every_option_of_a_page_has_its_texts() -> None:
    """Its label, and its choices, are texts of the catalogue, and no other option is there."""
    asked = {"no_file", "quoted"}
    for command in GROUPS:
        for one in offered(command).values():
            words = {word for word in (*one.choices, *one.option.suggested) if re.search("[a-z]", word)}
            more = {"own"} if one.option.suggested and not one.names_file else set()
            more |= {"empty"} if words and one.written(one.default) is None and not one.names_file else set()
            asked |= {re.sub("[^a-z]+", "_", f"{one.name} {word}".strip()) for word in {"", *words, *more}}
    assert asked == {key.removeprefix("option.") for key in catalogue() if key.startswith("option.")}


def test_text_is_filled_in_preferred_browser_language() -> None:
    """A text is filled in, in the first supported language of the browser."""
    assert Texts("de")("robot.joints_of", robot="X") == "Gelenke von X und ihre Grenzen"
    assert preferred("fr;q=0.9, de-CH;q=0.8, en;q=0.7") == "de"
    assert preferred("en-GB,de;q=0.5") == "en"
    assert preferred("tlh, *;q=nonsense") == "en"


def test_what_the_library_names_has_its_texts() -> None:
    texts = Texts("de")
    for finding in MISTAKES:
        assert texts.named("doctor", finding) != finding
        assert texts.named("mend", finding, subject="J1") != finding
    for field in ReportHeader.model_fields:
        assert texts.named("report", field) != field
    assert texts.named("doctor", "a finding of tomorrow") == "a finding of tomorrow"


def test_why_poses_fall_away_is_said_in_the_page_s_language(tmp_path: Path) -> None:
    model = ErrorModel(load_robot("ur5"))
    (tmp_path / "task.toml").write_text(task_text(default_task(model)))
    lost = Tracker().find(model, load_task(tmp_path / "task.toml"), 20, 0).lost
    assert lost
    assert [reason for reason in lost if Texts("de").said(term(reason)) == reason] == []


def said_in(path: Path) -> list[ast.expr]:
    """Templates of a module's sentences."""
    calls = (one for one in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(one, ast.Call))
    found = [call.args[0] for call in calls if getattr(call.func, "id", "") in ("Said", "MissedError")]
    return [part for one in found for part in ([one.body, one.orelse] if isinstance(one, ast.IfExp) else [one])]


def has_words(text: str) -> bool:
    """Whether something of it is said in another way in another language: not units and places alone."""
    return bool(set(re.findall("[A-Za-z]{2,}", re.sub(r"\{[^}]*\}", "", text))) - UNITS)


def test_every_sentence_of_the_library_is_in_every_language() -> None:
    """Templates stand as literals where they are said; none is left untranslated, and none is translated that nobody says."""
    paths = (*SAYING, Path(measure.__file__), *map(Path, SHOWN + OF_SHOWN))
    said = [one for path in paths for one in said_in(path)]
    templates = {one.value for one in said if isinstance(one, ast.Constant)} | OF_OPTIONS | OF_VERDICTS | OF_FITS
    composed = [ast.unparse(one) for one in said if not isinstance(one, ast.Constant)]
    assert composed == ["template", "self.template"]  # of MissedError and of Safeguard themselves
    assert {one for one in templates if has_words(one)} == {one for one in sentences() if has_words(one)}
    assert templates >= sentences().keys()
    for template, other in sentences().items():
        assert set(other) == set(LANGUAGES) - {LIBRARY_LANGUAGE}, template
        assert {frozenset(places(text)) for text in other.values()} == {frozenset(places(template))}, template


def composed_in(source: str) -> Iterator[tuple[str, str]]:
    """Sentences that are put together where no page can translate them, with the function that says each; not those of errors."""
    for top in ast.parse(source).body:
        inner = {
            id(part)
            for one in ast.walk(top)
            for hidden in (
                [one] if isinstance(one, ast.Raise) else [one.slice] if isinstance(one, ast.Subscript) else []
            )
            for part in ast.walk(hidden)
        }
        for one in ast.walk(top):
            if isinstance(one, ast.JoinedStr) and id(one) not in inner:
                text = "…".join(str(part.value) for part in one.values if isinstance(part, ast.Constant))
                if has_words(text) and " " in text:
                    yield getattr(top, "name", ""), text


def test_no_sentence_that_a_page_shows_is_composed() -> None:
    """One would stay English in the midst of another language; what a report's page or a terminal has alone may be."""
    own = {name for names in OF_REPORTS_ALONE.values() for name in names}
    found = {
        name: text for path in SHOWN + REMARKING for name, text in composed_in(Path(path).read_text(encoding="utf-8"))
    }
    assert {name: text for name, text in found.items() if name not in own} == {}
    assert own == found.keys()
    example = 'def f(x): return f"{x} of them"\ndef g(x): raise E(f"no {x} there")'
    assert [name for name, _ in composed_in(example)] == ["f"]


def spoken_in(section: Section) -> Iterator[str]:
    """Every text of a section."""
    yield section.title
    for block in section.blocks:
        if isinstance(block, TextTable):
            yield from (block.title, *block.header, *(cell for row in block.rows for cell in row), block.note)
        elif isinstance(block, Text):
            yield block.words
        elif isinstance(block, Bullets):
            yield from block.items
        elif isinstance(block, Facts):
            yield from (text for item in block.items for text in item)
        elif isinstance(block, Numbers):
            yield from (text for value, _, what in block.items for text in (value, what))
        elif isinstance(block, Chart):
            views = block.figure if isinstance(block.figure, dict) else {"": block.figure}
            collected: list[str] = [block.title, block.note, *views]
            for one in views.values():
                one.said(partial(_collect, collected))
            yield from collected


def _collect(collected: list[str], text: str) -> str:
    collected.append(text)
    return text


def calibration_with(holdout: Holdout) -> Calibration:
    """A fit with an outlier; of targets that no pose tells apart where nothing is held out."""
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    if not holdout.asked:
        q = np.where(np.arange(6) < 3, rng.uniform(-1.0, 1.0, (30, 6)), 0.3)
        targets = {"a": np.zeros(3), "b": np.array([0.1, 0.0, 0.0])}
        return identify(model, simulate(model, q, rng=rng, targets=targets)[0])
    campaign, _ = simulate(model, rng.uniform(-1.2, 1.2, (40, 6)), rng=rng)
    campaign.points[3, 0] += 0.0007
    return hold_out(partial(identify, model), campaign, holdout, partial(identify, model, keep=()))


@pytest.mark.parametrize("holdout", [Holdout(share=0.3), Holdout(folds=3), Holdout()], ids=["share", "folds", "none"])
def test_what_a_page_shows_of_a_calibration_is_in_its_language(holdout: Holdout) -> None:
    """Every text of its sections is a sentence that the page's language has, or the name of something."""
    calibration, texts = calibration_with(holdout), Texts("de")
    source, model = calibration.provenance, calibration.model
    remarks = {f"{one[0].upper()}{one[1:].rstrip('.')}." for one in calibration.remarks}
    names = {*calibration.targets, *remarks, *model.names, "fit"}
    names |= {text for one in model.parameters for text in (one.label, one.symbol, one.name, one.shown.name)}
    names |= {source.robot, source.robot_digest, source.campaign, source.campaign_digest, source.created}
    names |= {text for key, value in source.options.items() for text in (key, say_option(value))}
    found = [one for section in calibration_sections(calibration) for one in spoken_in(section)]
    english = {one for one in found if texts.said(one) == one and has_words(one)} - names
    assert {one for one in english if has_words(re.sub(r"\w+\.\w+", "", one))} == set()
    assert len(found) > 300


def test_a_sentence_is_said_with_the_comma_of_the_language() -> None:
    missed = MissedError(next(one for one in sentences() if one.startswith("no valid shot")), waited_s=31.4)
    beyond = Said("{joint} is {off:.1f} from the pose; go nearer, or mend what was typed.", joint="J1_deg", off=3.04)
    row = json.loads(json.dumps(Said("no row: {reason}", reason=missed.said).parts))
    assert Texts("en").sentence(row) == f"no row: {missed}"
    assert Texts("de").sentence(row).startswith("Keine Zeile: kein gültiger Messwert seit 31 s")
    assert "3,0" in Texts("de").sentence(beyond.parts)
    assert Texts("de").sentence(Said("of another package").parts) == "of another package"


def test_a_finding_s_line_stands_beside_its_translation() -> None:
    finding = {"id": "joint-sign", "subject": ["J3"], "fix": "reverse the sign of J3"}
    assert mend(finding, Texts("en")) == "reverse the sign of J3"
    assert mend(finding, Texts("de")) == "Das Vorzeichen von J3 umkehren (reverse the sign of J3)"


def test_a_sentence_that_was_stored_is_said_in_the_page_s_language() -> None:
    """Of a file or a command's output, whose texts have no values any more: they are found by the words of the template."""
    texts, prior = Texts("de"), "Model error and prior scale had not settled when the search for them ended."
    assert texts.said(term(prior)).startswith("Modellfehler und Skala des Vorwissens standen noch nicht fest,")
    assert Texts("en").said(term(prior)) == prior
    length = (
        "robot file in doubt: J2.tx is +1.25 mm (u 0.10 mm; these poses do not tell it from J3.tx), where the tolerance is 0.3 mm: "
        "compare this length of the robot file with the maker's, correct it and identify again. The controller computes with its "
        "own lengths, and a program that is corrected by wrong ones gets worse"
    )
    said = texts.said(term(length))
    for part in (
        "Roboterdatei in Zweifel: J2.tx ist +1,25 mm (u 0,10 mm; diese",
        "von J3.tx)",
        "von 0,3 mm: Vergleichen",
    ):
        assert part in said
    rejected = (
        "would move a joint by 41.8°, and 5° are allowed (--max-joint-deg); near a singular posture a small correction swings "
        "the joints"
    )
    (line,) = group_remarks([(Place(path=Path("part.ls"), line=7), rejected)])
    assert texts.said(line).startswith(
        "part.ls:7: bewegte ein Gelenk um 41,8°, und 5° sind erlaubt (--max-joint-deg); nahe einer"
    )
    assert texts.said(term("a sentence of tomorrow, 3.5 mm")) == "a sentence of tomorrow, 3.5 mm"
    assert texts.said(moment("2026-11-30T13:34:53+00:00")) == "30.11.2026, 13:34 UTC"
