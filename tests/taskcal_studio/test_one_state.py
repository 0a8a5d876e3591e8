"""Of one state of a project everything says the same: its pages, the report, the certificate, and every command."""

import json
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from taskcal.cli import main
from taskcal.correction.correction import REMEDIES
from taskcal.correction.verdict import RULE, Decision, Subject, Why, judge
from taskcal.identification.calibration import load_calibration
from taskcal.report.verdict import with_program
from taskcal.task.task import load_task
from taskcal_groundwork.said import term
from taskcal_studio.pages import program_page, report_page
from taskcal_studio.project import LAYOUT, Choices, Project, begin_example
from taskcal_studio.results import StepStatus, contents, corrected_of, made, result_of, steps_of
from taskcal_studio.texts import Texts
from taskcal_studio.verdict import latest
from tests.laws.calibrations import calibrated

ROBOT = "abb-irb6660-205-1.9"

CELL = """[[tool]]
name = "tMill10"
flange = {{ position_mm = {position}, quaternion = {quaternion} }}
uncertainty_mm = {uncertainty}
"""


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example with a calibration."""
    folder = tmp_path_factory.mktemp("example")
    project = begin_example(folder)
    for name in ("calibrations", "corrected", "reports", "cells"):
        (folder / name).mkdir()
    calibrated(ROBOT).save(folder / "calibrations" / "c.json")
    project.choose(calibration="calibrations/c.json")
    return folder


@pytest.fixture
def project(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    """A copy of the example."""
    shutil.copytree(example, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return Project(tmp_path)


def measure_tool(project: Project, uncertainty_mm: float) -> None:
    """State the program's tool in a cell file, where the program has it."""
    text = project.path(project.choices.program).read_text()
    numbers = re.search(r"tMill10:=\[TRUE,\[\[([^\]]*)\],\[([^\]]*)\]\]", text)
    assert numbers
    w, x, y, z = numbers[2].split(",")
    cell = CELL.format(position=f"[{numbers[1]}]", quaternion=f"[{x}, {y}, {z}, {w}]", uncertainty=uncertainty_mm)
    project.path("cells/c.toml").write_text(cell)
    project.choose(cell="cells/c.toml")


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    """What a command says in JSON."""
    capsys.readouterr()
    main(list(arguments))
    return json.loads(capsys.readouterr().out)


def correct(project: Project, capsys: pytest.CaptureFixture[str], *more: str) -> Mapping[str, Any]:
    """Correct the chosen program as the page does, and keep what the command printed."""
    corrected, before = corrected_of(project.choices.program), contents(project)
    result = run(capsys, *program_page.arguments_of(project, project.choices), *more)
    (project.folder / result_of(corrected)).write_text(json.dumps(result))
    (project.folder / LAYOUT.made).write_text(json.dumps(made(project, corrected, before)))
    return result


def plain(page: str) -> str:
    """The words of a page of HTML."""
    return " ".join(re.sub(r"<[^>]*>", " ", page.replace("&#39;", "'").replace("&amp;", "&")).split())


def figures(verdict: Mapping[str, Any]) -> list[str]:
    """Every figure of a verdict, as it is shown."""
    shown = []
    for one in verdict["judgements"]:
        lengths = [one["expected_mm"], *(one["interval_mm"] or ())]
        shown += [f"{length:.3f}" for length in lengths if length is not None]
        shown += [f"{one['largest']} {one['share']:.0%}"] if one["largest"] else []
    return shown


@pytest.mark.parametrize("uncertainty", [0.02, *(pytest.param(one, marks=pytest.mark.slow) for one in (None, 5.0))])
def test_everything_says_the_same_of_one_state(
    project: Project, capsys: pytest.CaptureFixture[str], uncertainty: float | None
) -> None:
    """Nothing was measured of the tool; it was measured; it was measured so badly that nothing is written."""
    if uncertainty is not None:
        measure_tool(project, uncertainty)
    judged = judge(load_calibration(project.path("calibrations/c.json")), load_task(project.path(project.choices.task)))
    assert latest(judged.summary(), project) == judged.summary()
    corrected = correct(project, capsys)
    verdict = corrected["verdict"]
    assert bool(corrected["written"]) == (uncertainty != 5.0)
    assert verdict["program"] == Path(project.choices.program).name
    assert verdict["judgements"][2]["expected_mm"] == pytest.approx(corrected["expected"]["after_mm"])
    assert latest(judged.summary(), project) == verdict  # the page of the result, which shows what the program's shows
    reported = run(capsys, *report_page.arguments_of(project))
    assert reported["verdict"] == verdict
    pages = [report_page.reports_of(project)[0], report_page.reports_of(project)[1], corrected["report"]]
    for path in pages:
        page = plain(Path(path).read_text(encoding="utf-8"))
        assert [figure for figure in figures(verdict) if figure not in page] == []
        assert RULE in page
        assert verdict["tool"] in page
        assert "no corrected program" not in page
        for one in verdict["judgements"]:
            assert one["decision"] in page
            assert [reason for reason in one["reasons"] if reason["why"] not in page] == []
    main([argument for argument in report_page.arguments_of(project) if argument != "--json"] + ["--force"])
    told = " ".join(capsys.readouterr().out.split())
    assert [figure for figure in figures(verdict) if figure.split()[-1] not in told] == []
    ruled = run(
        capsys, "validate", "calibrations/c.json", project.choices.campaign, "--reregister", "--accept", "0.1", "--json"
    )
    assert ruled["acceptance"]["of"] == "rms"
    assert "3D rms" in RULE


@pytest.mark.slow
def test_a_report_takes_no_correction_of_another_state(project: Project, capsys: pytest.CaptureFixture[str]) -> None:
    """By another calibration, or for another task, the program was not corrected; the command refuses it, the page leaves it."""
    correct(project, capsys)
    asked = report_page.arguments_of(project)
    assert any(one.startswith("--corrected=") for one in asked)
    task = project.path(project.choices.task)
    task.write_text(task.read_text().replace("position_mm = 0.", "position_mm = 1."))
    assert main(asked) == 1
    assert "was corrected by this calibration for this task" in capsys.readouterr().err
    assert not any(one.startswith("--corrected=") for one in report_page.arguments_of(project))


@pytest.mark.parametrize(
    "spoilt", ["null", "[]", "{}", '{"verdict": {"judgements": []}, "written": []}', '{"verdict": 1}']
)
def test_what_is_no_result_of_a_correction_is_none(spoilt: str) -> None:
    judged = {"task": "t", "judgements": [{"tolerance_mm": 1.0, "expected_mm": 0.1}]}
    assert with_program(judged, json.loads(spoilt)) is None


@pytest.mark.slow
def test_an_override_holds_for_one_run_and_is_on_page_and_certificate(
    project: Project, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "accept_uncertain" not in Choices.model_fields
    measure_tool(project, 5.0)
    plainly = correct(project, capsys)
    assert not plainly["written"]
    assert plainly["verdict"]["override"] is None
    result = correct(project, capsys, "--accept-uncertain")
    assert result["written"]
    assert steps_of(project)["program"].state is StepStatus.overridden
    why = result["verdict"]["override"]["why"]
    run(capsys, *report_page.arguments_of(project))
    for path in (*report_page.reports_of(project), result["report"]):
        assert f"on request, for one run alone, although {why}" in plain(Path(path).read_text(encoding="utf-8"))
    assert not correct(project, capsys)["written"]


def test_every_word_of_a_verdict_is_in_every_language() -> None:
    said = (*Why.__args__, *Subject.__args__, *Decision.__args__, *REMEDIES, *REMEDIES.values(), RULE)
    assert [one for one in said if Texts("de").said(term(one)) == one] == []
