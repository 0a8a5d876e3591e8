"""What pages ask of the command line: whole file sets, and values that cannot be taken for options."""

from pathlib import Path

from taskcal.studio.pages import identify_page, program_page, report_page
from taskcal.studio.project import Choices, Project
from taskcal.studio.task_box import read_together


def test_files_of_one_program_are_read_together(tmp_path: Path) -> None:
    (tmp_path / "programs").mkdir()
    for name in ("part.src", "part.dat", "other.dat", "part.mod", "BASE.sys", "path.csv", "path.mod"):
        (tmp_path / "programs" / name).write_text("")
    project = Project(tmp_path)
    assert read_together(project, "programs/part.src") == ["programs/part.src", "programs/part.dat"]
    assert read_together(project, "programs/part.mod") == ["programs/part.mod", "programs/BASE.sys"]
    assert read_together(project, "programs/path.csv") == ["programs/path.csv"]


def test_values_from_the_project_s_file_are_no_options(tmp_path: Path) -> None:
    choices = Choices(name="x", robot="--help", effects="--json", campaign="campaigns/a.csv", holdout=0.0, robust=True)
    arguments, calibration = identify_page.arguments_of(choices)
    assert calibration == "calibrations/a-listed-robust.json"
    assert "--help" not in arguments
    assert arguments[:2] == ["identify", "campaigns/a.csv"]
    assert not any(argument.startswith("--holdout") for argument in arguments)
    choices = Choices(name="x", program="programs/a.mod", calibration="calibrations/c.json", tool="--force")
    assert "--tool=--force" in program_page.arguments_of(Project(tmp_path), choices)
    assert "--force" not in program_page.arguments_of(Project(tmp_path), choices)
    assert report_page.arguments_of(choices) == [
        *("report", "calibrations/c.json", "--output", "reports/c.html", "--certificate", "reports/c-certificate.html"),
        "--json",
    ]
