"""What pages ask of the command line: whole file sets, and values that cannot be taken for options."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.languages import languages
from taskcal.errors import TaskcalError
from taskcal.report.page import read_header
from taskcal_studio.pages import identify_page, plan_page, program_page, report_page
from taskcal_studio.project import Choices, Project
from taskcal_studio.stated_options import asked
from taskcal_studio.task_box import read_together


def test_a_page_asks_for_what_the_command_declares() -> None:
    """Arguments, flags and options with values are told apart by the command's own description, and no other is written."""
    given = {"programs": ["a.src", "a.dat"], "calibration": "c.json", "helper": True, "all_rows": False, "tool": ""}
    assert asked("correct", **given) == ["correct", "a.src", "a.dat", "--calibration=c.json", "--helper", "--json"]
    assert asked("robots import", ["--tip=a"], source="t.csv") == ["robots", "import", "t.csv", "--tip=a", "--json"]
    with pytest.raises(KeyError, match="calibrations"):
        asked("correct", calibrations="c.json")


def test_files_of_one_program_are_read_together(tmp_path: Path) -> None:
    (tmp_path / "programs").mkdir()
    for name in ("part.src", "part.dat", "other.dat", "part.mod", "BASE.sys", "path.csv", "path.mod"):
        (tmp_path / "programs" / name).write_text("")
    project = Project(tmp_path)
    assert read_together(project, "programs/part.src") == ["programs/part.src", "programs/part.dat"]
    assert read_together(project, "programs/part.mod") == ["programs/part.mod", "programs/BASE.sys"]
    assert read_together(project, "programs/path.csv") == ["programs/path.csv"]


def test_values_from_the_project_s_file_are_no_options(tmp_path: Path) -> None:
    project = Project(tmp_path)
    options = {"effects": "--json", "holdout": "", "model-error-mm": "0.05", "field": "true"}
    project.choose(robot="--help", campaign="campaigns/a.csv", options={"identify": options})
    arguments, calibration = identify_page.arguments_of(project)
    assert calibration == "calibrations/a-listed.json"
    assert "--help" not in arguments
    assert arguments[:2] == ["identify", "campaigns/a.csv"]
    assert not any(argument.startswith("--holdout") for argument in arguments)
    assert {"--effects=--json", "--model-error-mm=0.05", "--field"} <= set(arguments)
    choices = Choices(name="x", program="programs/a.mod", calibration="calibrations/c.json", tool="--force")
    assert "--tool=--force" in program_page.arguments_of(Project(tmp_path), choices)
    assert "--force" not in program_page.arguments_of(Project(tmp_path), choices)
    assert "--helper" not in program_page.arguments_of(Project(tmp_path), choices)
    assert "--helper" in program_page.arguments_of(Project(tmp_path), choices.model_copy(update={"helper": True}))
    controllers = {"nominal_controller": True, "kinematics": "cells/calibration.conf"}
    said = program_page.arguments_of(Project(tmp_path), choices.model_copy(update=controllers))
    assert {"--nominal-controller", "--controller-kinematics=cells/calibration.conf"} <= set(said)
    assert not [one for one in program_page.arguments_of(Project(tmp_path), choices) if "controller" in one]
    project.choose(calibration="calibrations/c.json", campaign="")
    assert report_page.arguments_of(project) == [
        *(
            "report",
            "calibrations/c.json",
            "--output=reports/c.html",
            "--certificate=reports/c-certificate.html",
            "--json",
        ),
    ]


def test_a_plan_is_in_any_language_and_for_what_measures() -> None:
    """Programs as every language has them, each beside the plan's table; options of images only where images are taken."""
    choices = Choices(
        name="x", task="tasks/a.toml", board="boards/b.toml", camera="cameras/c.toml", observing={"roll-deg": "5"}
    )
    written = {}
    for language in ("", *(one.name for one in languages())):
        arguments = plan_page.arguments_of(choices.model_copy(update={"language": language}))
        written[language] = [Path(one.partition("=")[2]).name for one in arguments if one.startswith("--program=")]
        assert not [one for one in arguments if one.startswith(("--board", "--camera", "--roll"))]
    assert {Path(name).suffix for names in written.values() for name in names} == {
        *(".mod", ".src", ".ls", ".script", ".csv")
    }
    assert written[""] == written["APT"] == []
    assert written["CSV"] == ["m_a_60_path.csv"]
    images = plan_page.arguments_of(
        choices.model_copy(update={"observe": "pixels", "options": {"plan": {"roll-deg": "5", "kept-out": "6"}}})
    )
    assert {"--observe=pixels", "--board=boards/b.toml", "--camera=cameras/c.toml", "--roll-deg=5"} <= set(images)
    assert "--program=plans/m_a_60_px.mod" in images
    assert not [one for one in images if one.startswith(("--kept-out", "--landmarks"))]


def test_a_fit_replaces_no_calibration(tmp_path: Path) -> None:
    """Whatever the name that is wanted, the file is a new one in its folder."""
    project = Project(tmp_path)
    (tmp_path / "calibrations").mkdir()
    for name in ("", "spring", "../../etc/x", "a b/ü", "--json", "con"):
        project.choose(campaign="campaigns/a.csv", fit_name=name)
        for _ in range(3):
            arguments, calibration = identify_page.arguments_of(project)
            assert f"--output={calibration}" in arguments
            file = project.path(calibration)
            assert file.parent == tmp_path.resolve() / "calibrations"
            assert not file.exists()
            file.write_text("{}")


def test_a_head_is_kept_field_by_field(tmp_path: Path) -> None:
    """What is wrong is refused with its field, and takes nothing of the others."""
    project = Project(tmp_path)
    given = {"serial_number": "66-01", "date": "2026-11-26", "temperature_C": "20.5", "operator": "A. B."}
    for field, value in given.items():
        report_page.save_head(project, field, value)
    for field, wrong in (("date", "yesterday"), ("temperature_C", "warm"), ("operator", "x" * 301)):
        with pytest.raises(TaskcalError, match=field):
            report_page.save_head(project, field, wrong)
    assert report_page.head_of(project) == given
    assert dict(read_header(tmp_path / "header.toml"))["serial number"] == "66-01"
    assert "--header=header.toml" in report_page.arguments_of(project)
    report_page.save_head(project, "operator", "")
    assert "operator" not in report_page.head_of(project)


@given(value=st.floats(0.0, 1e3))
def test_a_scale_ends_at_a_round_number(value: float) -> None:
    """One, two or five times a power of ten, no smaller than the largest error, and no other is nearer."""
    end = program_page.rounded_up(value)
    mantissa = end / 10.0 ** math.floor(math.log10(end) + 1e-9)
    assert min(abs(mantissa - step) for step in (1.0, 2.0, 5.0)) < 1e-6
    assert value <= end * (1.0 + 1e-9)
    assert end <= 2.5 * max(value, 1e-6) * (1.0 + 1e-9)
