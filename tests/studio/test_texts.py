"""Every text stands in every language, is used, and has the same places to fill."""

import ast
import json
import re
from pathlib import Path
from string import Formatter

import taskcal.live
import taskcal.studio
from taskcal.cli.commands import measure
from taskcal.diagnosis.diagnose import MISTAKES
from taskcal.live.devices import Said
from taskcal.live.stillness import MissedError
from taskcal.observations.point import Tracker
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.studio.pages.measurements_page import mend
from taskcal.studio.texts import LANGUAGES, LIBRARY_LANGUAGE, Texts, catalogue, preferred, sentences
from taskcal.task.default_task import default_task, task_text
from taskcal.task.task import load_task

SOURCES = "\n".join(path.read_text() for path in Path(taskcal.studio.__file__).parent.rglob("*.py"))


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
    assert texts.named("doctor", "a finding of tomorrow") == "a finding of tomorrow"


def test_why_poses_fall_away_is_said_in_the_page_s_language(tmp_path: Path) -> None:
    model = ErrorModel(load_robot("ur5"))
    (tmp_path / "task.toml").write_text(task_text(default_task(model)))
    lost = Tracker().find(model, load_task(tmp_path / "task.toml"), 20, 0).lost
    assert lost
    assert [reason for reason in lost if Texts("de").named("lost", reason) == reason] == []


def test_every_sentence_of_the_live_loop_is_in_every_language() -> None:
    """Templates stand as literals where they are said; none is left untranslated, and none is translated that nobody says."""
    said = [
        call.args[0]
        for path in (*Path(taskcal.live.__file__).parent.glob("*.py"), Path(measure.__file__))
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") in ("Said", "MissedError")
    ]
    templates = {one.value for one in said if isinstance(one, ast.Constant)}
    assert len([one for one in said if not isinstance(one, ast.Constant)]) == 1  # in MissedError itself
    assert templates == sentences().keys()
    for template, other in sentences().items():
        assert set(other) == set(LANGUAGES) - {LIBRARY_LANGUAGE}, template
        assert {frozenset(places(text)) for text in other.values()} == {frozenset(places(template))}, template


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
