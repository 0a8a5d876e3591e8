"""What commands write: nothing that is read, nothing twice, and nothing of others without --force."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from taskcal.cli import main, output
from taskcal.cli.output import check_outputs, files_of_task
from taskcal.errors import FileError
from tests.cli.conftest import IRB6660, Run

TABLE = "joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\nJ2,90,300,200,0\n"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "table.csv"
    path.write_text(TABLE)
    return path


def test_edits_are_said_once_each_to_people_and_programs(capsys: pytest.CaptureFixture[str]) -> None:
    output.begin_account()
    for warning in ("one", "", "two", "one"):
        output.warn_of_edits(warning)
    output.tell_edits()
    assert capsys.readouterr().out.splitlines() == ["warning: one", "warning: two"]
    assert output.with_edits({"a": 1}) == {"a": 1, "edited": ("one", "two")}
    output.begin_account()
    output.tell_edits()
    assert capsys.readouterr().out == ""
    assert output.with_edits({"a": 1}) == {"a": 1}


def test_own_output_is_replaced_but_edited_file_is_kept(tmp_path: Path) -> None:
    """A file that the command wrote is replaced; one that was edited is kept."""
    path = tmp_path / "plan.csv"
    check_outputs("plan", [("--output", path)]).write({path: "first"})
    check_outputs("plan", [("--output", path)]).write({path: "second"})
    path.write_text("second, and an afternoon of measurements")
    with pytest.raises(
        FileError, match=r"plan.csv: exists and was not written by taskcal plan, or was edited since; .*--force"
    ):
        check_outputs("plan", [("--output", path)])
    check_outputs("plan", [("--output", path)], force=True).write({path: b"third"})
    check_outputs("plan", [("--output", path)])


def test_what_another_command_wrote_or_a_person_is_not_replaced(tmp_path: Path) -> None:
    own, other = tmp_path / "a.csv", tmp_path / "b.csv"
    check_outputs("plan", [("--output", own)]).write({own: "first"})
    other.write_text("mine")
    for path in (own, other):
        with pytest.raises(FileError, match="--force"):
            check_outputs("simulate", [("--output", path)])


def test_a_kill_between_the_note_and_the_file_leaves_it_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    check_outputs("plan", [("--output", path)]).write({path: "first"})

    def killed(*_: object) -> None:
        raise SystemExit

    ready = check_outputs("plan", [("--output", path)])
    with monkeypatch.context() as patch:
        patch.setattr(output, "write_all", killed)
        with pytest.raises(SystemExit):
            ready.write({path: "second"})
    check_outputs("plan", [("--output", path)])


def test_no_note_can_be_kept_and_the_next_run_asks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "state").write_text("a file where the folder should be")
    monkeypatch.setenv("TASKCAL_STATE_DIR", str(tmp_path / "state"))
    path = tmp_path / "a.csv"
    check_outputs("plan", [("--output", path)]).write({path: "first"})
    assert path.read_text() == "first"
    with pytest.raises(FileError, match="--force"):
        check_outputs("plan", [("--output", path)])


def test_the_oldest_notes_are_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TASKCAL_STATE_DIR", str(tmp_path / "state"))
    monkeypatch.setattr(output, "MAX_NOTES", 3)
    for name in "abcdefgh":
        check_outputs("plan", [("--output", tmp_path / name)]).write({tmp_path / name: "x"})
    assert len(list((tmp_path / "state/written").iterdir())) == 3
    check_outputs("plan", [("--output", tmp_path / "h")])


@pytest.mark.parametrize("spelling", ["{0}/a", "{0}/../{1}/a", "{0}/link", "{0}/hard", "{0}/folder/a"])
@pytest.mark.parametrize("force", [False, True])
def test_an_input_is_never_an_output_however_it_is_spelled(tmp_path: Path, spelling: str, force: bool) -> None:
    given = tmp_path / "a"
    given.write_text("read")
    (tmp_path / "link").symlink_to(given)
    os.link(given, tmp_path / "hard")
    (tmp_path / "folder").symlink_to(tmp_path)
    path = Path(spelling.format(tmp_path, tmp_path.name))
    with pytest.raises(FileError, match="would overwrite an input file"):
        check_outputs("plan", [("--output", path)], [given], force=force)


def test_an_input_that_is_yet_to_be_made_is_no_output_either(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="would overwrite an input file"):
        check_outputs("plan", [("--output", tmp_path / "a.toml")], [tmp_path / "a.toml"])


@pytest.mark.parametrize("exists", [False, True])
def test_two_outputs_are_never_one_file(tmp_path: Path, exists: bool) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "a")
    if exists:
        (tmp_path / "a").write_text("")
    with pytest.raises(typer.BadParameter, match="cannot be one file"):
        check_outputs("plan", [("--output", tmp_path / "a"), ("--report", tmp_path / "link")], force=True)


def test_output_names_are_compared_as_the_folder_folds_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Names that differ only in letter case are one file in a folder that ignores case."""
    named = [("--output", tmp_path / "Part.csv"), ("--report", tmp_path / "part.CSV")]
    monkeypatch.setattr(output, "_folds_case", lambda folder: True)
    with pytest.raises(typer.BadParameter):
        check_outputs("plan", named)
    monkeypatch.setattr(output, "_folds_case", lambda folder: False)
    check_outputs("plan", named)


def test_whether_a_folder_folds_case_is_seen_by_trying(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    assert output._folds_case(tmp_path) == (tmp_path / "A").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_task_brings_its_list_of_poses(tmp_path: Path) -> None:
    task = tmp_path / "task.toml"
    task.write_text('name = "x"\nposes = "list.csv"\n')
    assert files_of_task(task) == [task, tmp_path / "list.csv"]
    task.write_text("not TOML [")
    assert files_of_task(task) == [task]
    assert files_of_task(None) == []


def test_identify_overwrites_neither_robot_nor_rows(run: Run, tmp_path: Path, table: Path) -> None:
    assert run("robots", "import", table, "--convention", "dh", "-o", tmp_path / "r.toml").status == 0
    (tmp_path / "c.csv").write_text("id,J1_deg,J2_deg,x_mm,y_mm,z_mm\n")
    (tmp_path / "rows.txt").write_text("0\n1\n")
    for name in ("r.toml", "rows.txt", "c.csv"):
        before = (tmp_path / name).read_bytes()
        options = ["--robot", tmp_path / "r.toml", tmp_path / "c.csv", "--rows", tmp_path / "rows.txt"]
        ended = run("identify", *options, "-o", tmp_path / name, "--force")
        assert (ended.status, (tmp_path / name).read_bytes()) == (1, before)
        assert "would overwrite an input file" in ended.err


def test_the_page_of_a_correction_does_not_replace_the_program(run: Run, cell: Path, tmp_path: Path) -> None:
    program = tmp_path / "path.csv"
    program.write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,10,20,5,-40,10\n3,12,22,6,-42,12\n")
    (tmp_path / "out").mkdir()
    page = tmp_path / "out" / "path.csv"
    ended = run(
        "correct", "--accept-uncertain", "-c", cell / "cal.json", program, "-o", tmp_path / "out", "--report", page
    )
    assert ended.status == 2
    assert not page.exists()


def test_import_and_report_replace_only_what_they_wrote(run: Run, cell: Path, tmp_path: Path, table: Path) -> None:
    robot, page = tmp_path / "r.toml", tmp_path / "p.html"
    commands = {
        robot: ["robots", "import", table, "--convention", "dh", "-o", robot],
        page: ["report", cell / "cal.json", "-o", page],
    }
    for path, command in commands.items():
        path.write_text("mine")
        ended = run(*command)
        assert (ended.status, path.read_text()) == (1, "mine")
        assert "--force" in ended.err
        assert run(*command, "--force").status == 0
        assert run(*command).status == 0
        assert path.read_text() != "mine"


@pytest.mark.parametrize(
    "command",
    ["identify", "simulate", "robots import", "report", "study", "select", "sensitivity", "plan", "correct", "demo"],
)
def test_every_command_that_writes_takes_force(run: Run, command: str) -> None:
    assert "--force" in run(*command.split(), "--help").out


def test_a_plan_does_not_replace_the_poses_of_its_task(run: Run, cell: Path) -> None:
    before = (cell / "list.csv").read_bytes()
    ended = run("plan", "--robot", IRB6660, "--task", cell / "list.toml", "-o", cell / "list.csv", "--force")
    assert (ended.status, (cell / "list.csv").read_bytes()) == (1, before)


def test_campaign_and_truth_are_written_both_or_not_at_all(run: Run, cell: Path, tmp_path: Path) -> None:
    campaign, truth = tmp_path / "c.csv", tmp_path / "t.json"
    command = ["simulate", "--robot", IRB6660, "--task", cell / "list.toml", "-o", campaign, "--truth", truth]
    assert run(*command).status == 0
    old = campaign.read_bytes(), truth.read_bytes()
    truth.chmod(0o444)
    assert run(*command, "--seed", "1").status == 1
    assert (campaign.read_bytes(), truth.read_bytes()) == old


def test_an_interrupt_says_what_was_not_written(
    run: Run, tmp_path: Path, table: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("taskcal.robot.catalogue.describe_robot", interrupt)
    robot = tmp_path / "r.toml"
    ended = run("robots", "import", table, "--convention", "dh", "-o", robot)
    assert (ended.status, ended.out) == (130, "")
    assert ended.err == f"interrupted: nothing was written; not written: {robot}\n"


def test_what_is_written_in_one_process_is_known_to_the_next(tmp_path: Path, table: Path) -> None:
    robot = str(tmp_path / "r.toml")
    command = [sys.executable, "-m", "taskcal", "robots", "import", str(table), "--convention", "dh", "-o", robot]
    assert subprocess.run(command, check=False, capture_output=True).returncode == 0
    assert main(command[3:]) == 0
