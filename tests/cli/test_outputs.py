"""What commands write: nothing that is read, nothing twice, and nothing of others without --force."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.main import get_command

from taskcal.cli import app, main, output
from taskcal.cli import run as runs
from taskcal.cli.run import OutputOptions
from taskcal.errors import FileError
from tests.cli.conftest import IRB6660, Run

TABLE = "joint,alpha_deg,a_mm,d_mm,theta_offset_deg\nJ1,0,500,0,0\nJ2,90,300,200,0\n"


def check_outputs(
    command: str, outputs: list[tuple[str, Path | None]], *given: str | Path, force: bool = False
) -> runs.Run:
    """A run of a command whose outputs are seen to be free, of what it was given to read."""
    begun = runs.Run(command=command, out=OutputOptions(force=force), read=given)
    for option, path in outputs:
        begun.free(option, path)
    return begun


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "table.csv"
    path.write_text(TABLE)
    return path


def test_edits_are_said_once_each_to_people_and_programs(capsys: pytest.CaptureFixture[str]) -> None:
    runs.begin_account()
    for warning in ("one", "", "two", "one"):
        output.warn_of_edits(warning)
    output.tell_edits()
    assert capsys.readouterr().out.splitlines() == ["warning: one", "warning: two"]
    assert output.with_edits({"a": 1}) == {"a": 1, "edited": ("one", "two")}
    runs.begin_account()
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
        patch.setattr(runs, "write_all", killed)
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
        check_outputs("plan", [("--output", path)], given, force=force)


@pytest.mark.parametrize("name", ["arm.urdf#wrist", "arm.urdf"])
def test_a_robot_with_its_tip_is_no_output(tmp_path: Path, name: str) -> None:
    (tmp_path / "arm.urdf").write_text("")
    with pytest.raises(FileError, match="would overwrite an input file"):
        check_outputs("plan", [("--output", tmp_path / "arm.urdf")], str(tmp_path / name), force=True)


def test_in_a_folder_that_is_read_a_command_replaces_its_own_files_alone(tmp_path: Path) -> None:
    (tmp_path / "shots").mkdir()
    images, own, other = tmp_path / "shots", tmp_path / "shots/own.csv", tmp_path / "shots/image.png"
    check_outputs("convert", [("--output", own)], images).write({own: "first"})
    check_outputs("convert", [("--output", own)], images).write({own: "second"})
    other.write_text("seen")
    with pytest.raises(FileError, match=r"image\.png: exists"):
        check_outputs("convert", [("--output", other)], images, force=True)
    ready = check_outputs("convert", [("--output", own)], images, force=True)
    with pytest.raises(FileError, match=r"image\.png: exists"):
        ready.write({other: "lost"})


def test_a_file_that_is_named_on_the_way_is_no_input_either(tmp_path: Path) -> None:
    """As those of a folder, whose names an export knows late."""
    given = tmp_path / "cal.json"
    given.write_text("read")
    ready = check_outputs("export", [("--output", None)], given, force=True)
    with pytest.raises(FileError, match="would overwrite an input file"):
        ready.write({tmp_path / "new.txt": "made", given: "lost"})
    assert [path.name for path in tmp_path.iterdir()] == ["cal.json"]
    assert given.read_text() == "read"


def _of_texts(command: Any) -> tuple[list[str], list[str]]:
    """Options of a command that take a text, files among them, and those of them that are marked as naming what is written."""
    texts = [one.opts[0] for one in command.params if one.bare_type() in ("str", "Path")]
    return texts, [name for name in texts if name in command.callback.writes]


LEAST = {
    "board": [],
    "compare": ["{cell}/cal.json", "{cell}/cal.json"],
    "convert": ["{cell}/one.csv", "-r", IRB6660],
    "correct": ["{cell}/path.csv", "-c", "{cell}/cal.json"],
    "demo": [],
    "doctor": ["{cell}/one.csv", "-r", IRB6660],
    "export": ["{cell}/cal.json", "--form", "toml"],
    "fleet": ["{cell}"],
    "identify": ["{cell}/one.csv", "-r", IRB6660],
    "measure": ["-r", IRB6660, "-t", "{cell}/list.toml", "-c", "virtual", "-i", "virtual"],
    "performance": ["{cell}/one.csv"],
    "place": ["{cell}/list.toml", "-c", "{cell}/cal.json"],
    "plan": ["-r", IRB6660, "-t", "{cell}/list.toml"],
    "poses": ["{cell}/one.csv", "-r", IRB6660],
    "register": ["{cell}/one.csv", "-r", IRB6660],
    "report": ["{cell}/cal.json"],
    "robots import": ["{cell}/table.csv", "--convention", "dh"],
    "robots task": [IRB6660],
    "select": ["-r", IRB6660, "-t", "{cell}/list.toml"],
    "sensitivity": ["-r", IRB6660],
    "simulate": ["-r", IRB6660, "-t", "{cell}/list.toml"],
    "study": ["-r", IRB6660, "-t", "{cell}/list.toml"],
    "validate": ["{cell}/cal.json", "{cell}/one.csv"],
}
"""The least that each command needs beside its outputs."""


def _leaves(group: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    for key, command in group.commands.items():
        whole = f"{name} {key}".strip()
        yield from _leaves(command, whole) if hasattr(command, "commands") else [(whole, command)]


def test_no_command_writes_over_a_file_that_any_of_its_options_was_given(
    run: Run, cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever option names a file, and whichever output names it too, with --force: it stays as it is."""
    monkeypatch.chdir(tmp_path)
    (cell / "path.csv").write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,10,20,5,-40,10\n")
    (cell / "table.csv").write_text(TABLE)
    kept, tried = tmp_path / "kept.csv", 0
    kept.write_text("0\n1\n")
    for name, command in _leaves(get_command(app)):
        texts, writing = _of_texts(command)
        force = ["--force"] if any("--force" in one.opts for one in command.params) else []
        for option in [name for name in texts if name.startswith("-") and name not in writing]:
            for written in writing:
                given = [part.format(cell=cell) for part in LEAST[name]]
                more = ["--output", tmp_path / "other.pdf"] if "--output" in writing and written != "--output" else []
                ended = run(*name.split(), *given, option, kept, written, kept, *more, *force)
                assert kept.read_text() == "0\n1\n", (name, option, written)
                assert ended.status != 0, (name, option, written)
                tried += 1
    assert tried > 100


def test_no_command_writes_over_what_it_reads(
    run: Run, cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever of the least that a command needs is a file, under the name of each of its outputs, with --force."""
    monkeypatch.chdir(tmp_path)
    read = tmp_path / "read"
    shutil.copytree(cell, read)
    (read / "path.csv").write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,10,20,5,-40,10\n")
    (read / "table.csv").write_text(TABLE)
    before = {path: path.read_bytes() for path in read.iterdir()}
    tried = 0
    for name, command in _leaves(get_command(app)):
        given = [part.format(cell=read) for part in LEAST.get(name, ())]
        force = ["--force"] if any("--force" in one.opts for one in command.params) else []
        for written in command.callback.writes:
            for file in [part for part in given if Path(part).is_file()]:
                more = ["--output", tmp_path / "other.pdf"] if "--output" in command.callback.writes[:1] else []
                ended = run(*name.split(), *given, *([] if written == "--output" else more), written, file, *force)
                assert ended.status != 0, (name, written, file)
                assert {path: path.read_bytes() for path in read.iterdir()} == before, (name, written, file)
                tried += 1
    assert tried > 40


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
    monkeypatch.setattr(runs, "_folds_case", lambda folder: True)
    with pytest.raises(typer.BadParameter):
        check_outputs("plan", named)
    monkeypatch.setattr(runs, "_folds_case", lambda folder: False)
    check_outputs("plan", named)


def test_whether_a_folder_folds_case_is_seen_by_trying(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    assert runs._folds_case(tmp_path) == (tmp_path / "A").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_task_brings_its_list_of_poses(tmp_path: Path) -> None:
    task, poses = tmp_path / "task.toml", tmp_path / "list.csv"
    task.write_text('name = "x"\nposes = "list.csv"\n')
    with pytest.raises(FileError, match="would overwrite an input file"):
        check_outputs("plan", [("--output", poses)], task, force=True)
    task.write_text("not TOML [")
    check_outputs("plan", [("--output", poses)], task, force=True)


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
