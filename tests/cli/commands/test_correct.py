"""``taskcal correct``: files, tables, and what happens to bad input."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from robot_programs.rapid.resolve import Confdata
from robot_programs.reading import read_program
from taskcal.correction.cell import Cell, Measured, write_cell
from taskcal.geometry import se3
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import load_task, reach_task
from taskcal.virtual.cell import simulate
from tests.cli.conftest import IRB6660, Run

SPINDLE = "[TRUE,[[250,30,120],[0.70710678,0,0.70710678,0]],[18,[120,0,60],[1,0,0,0],0,0,0]]"


def module(robot, *lines):
    """A module with a tool and a work object, and two targets at ordinary poses."""
    model = ErrorModel(robot)
    q = np.radians([[0.0, 10.0, 20.0, 5.0, -40.0, 10.0], [3.0, 12.0, 22.0, 6.0, -42.0, 12.0]])
    targets = []
    for name, at, T in zip(("pA", "pB"), q, model.poses(q), strict=True):
        x, y, z = (f"{v:.3f}" for v in T[:3, 3] * 1e3 - [1500.0, 0.0, 1200.0])
        i, j, k, w = se3.to_quaternion(T[:3, :3])
        rotation = ",".join(f"{v:.8f}" for v in (w, i, j, k))
        targets.append(
            f"  CONST robtarget {name}:=[[{x},{y},{z}],[{rotation}],{Confdata.of(robot, at)},[9E9,9E9,9E9,9E9,9E9,9E9]];"
        )
    head = [
        "MODULE Part ! Werkstück ä",
        f"  PERS tooldata tSpindle:={SPINDLE};",
        '  PERS wobjdata wPart:=[FALSE,TRUE,"",[[1500,0,1200],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];',
        *targets,
        "  PROC main()",
    ]
    return "\r\n".join([*head, *(f"    {line}" for line in lines), "  ENDPROC", "ENDMODULE", ""])


GOOD = ("MoveJ pA,v200,z5,tSpindle\\WObj:=wPart;", "MoveL pB,v50,fine,tSpindle\\WObj:=wPart; ! cut")


@pytest.fixture(scope="session")
def robot():
    return load_robot(IRB6660)


@pytest.fixture
def part(tmp_path, robot):
    path = tmp_path / "part.mod"
    path.write_bytes(module(robot, *GOOD).encode("latin-1"))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["", ".zip"])
def test_a_backup_is_corrected_into_one_of_the_same_shape(run: Run, cell: Path, part: Path, tmp_path: Path, suffix):
    folder = tmp_path / "backup"
    (folder / "RAPID/TASK1/PROGMOD").mkdir(parents=True)
    (folder / "RAPID/TASK1/PROGMOD/part.mod").write_bytes(part.read_bytes())
    (folder / "system.xml").write_text("<Controller/>")
    given = folder if not suffix else Path(shutil.make_archive(str(folder), "zip", folder))
    out = tmp_path / f"out{suffix}"
    command = ("correct", "--accept-uncertain", "--calibration", cell / "cal.json", given, "-o", out)
    ended = run(*command, "--json")
    assert ended.status == 0, ended.err
    assert ended.json["written"] == [str(out)]
    assert ended.json["skipped_files"] == 1
    if suffix:
        shutil.unpack_archive(out, tmp_path / "unpacked")
    made = out if not suffix else tmp_path / "unpacked"
    assert (made / "system.xml").read_text() == "<Controller/>"
    assert (made / "RAPID/TASK1/PROGMOD/part.mod").read_bytes() != part.read_bytes()
    again = run(*command)
    assert again.status == 1
    assert "exists already" in again.err


@pytest.mark.slow
def test_correct_changes_only_the_targets_of_a_program(run: Run, cell: Path, part: Path, tmp_path: Path):
    """A corrected program differs from the original in its targets alone."""
    ended = run(
        "correct", "--accept-uncertain", "--calibration", cell / "cal.json", part, "-o", tmp_path / "out.mod", "--json"
    )
    assert ended.status == 0, ended.err
    found = ended.json
    assert found["written"] == [str(tmp_path / "out.mod")]
    assert (found["moves"], found["corrected"], found["refused"]) == (2, 2, [])
    assert found["before"]["targets"]["max_mm"] > 0.1 > 0.001 > found["after"]["targets"]["max_mm"]
    old, new = part.read_bytes().split(b"\r\n"), (tmp_path / "out.mod").read_bytes().split(b"\r\n")
    changed = [i for i, (a, b) in enumerate(zip(old, new, strict=True)) if a != b]
    assert changed == [3, 4]
    assert new[0] == "MODULE Part ! Werkstück ä".encode("latin-1")
    # the true tool, at the joints of the nominal robot for the new targets
    known = load_calibration(cell / "cal.json")
    moved = [np.linalg.norm(row["shift_mm"]) for row in found["targets"]]
    assert all(0.1 < value < 5.0 for value in moved)
    assert [row["line"] for row in found["targets"]] == [7, 8]
    assert known.model.robot.name == IRB6660


@pytest.mark.slow
def test_long_lists_are_cut_with_a_count_unless_all_are_asked_for(
    run: Run, cell: Path, robot, tmp_path: Path, monkeypatch
):
    path = tmp_path / "far.mod"
    far, unknown = "MoveL Offs(pB,3000,0,0),v50,fine,tSpindle\\WObj:=wPart;", "MoveL pNowhere,v50,fine,tSpindle;"
    path.write_text(module(robot, *GOOD, far, unknown, unknown), newline="")
    line = ("correct", "-c", cell / "cal.json", path, "--dry-run", "--json")
    whole = run(*line).json
    monkeypatch.setattr("taskcal.cli.commands.correct.MAX_LISTED", 1)
    cut, every = run(*line), run(*line, "--all-rows").json
    assert every == whole
    assert set(every["not_listed"].values()) == {0}
    for name, left in cut.json["not_listed"].items():
        assert (len(cut.json[name]), len(cut.json[name]) + left) == (1, len(every[name]))
        assert all(row in every[name] for row in cut.json[name])
    assert cut.json["targets"][0]["before_mm"] == max(row["before_mm"] or 0.0 for row in every["targets"])
    assert "--all-rows" in cut.err


def test_correction_below_its_uncertainty_is_not_written(run: Run, cell: Path, part: Path, tmp_path: Path, robot):
    """A cutter that is known to centimetres: what to measure is said, and nothing is written unless asked for."""
    spindle = Measured(name="tSpindle", in_flange=robot.T_flange_tool, uncertainty=0.02)
    write_cell(tmp_path / "cell.toml", Cell(tools={"tspindle": spindle}))
    out, around = tmp_path / "out.mod", ["--cell", tmp_path / "cell.toml"]
    ended = run("correct", "-c", cell / "cal.json", *around, part, "-o", out, "--json")
    assert ended.status == 1
    assert not out.exists()
    assert "is smaller than its standard uncertainty" in ended.err
    assert "--accept-uncertain" in ended.err
    expected = ended.json["expected"]
    assert ended.json["written"] == []
    assert expected["uncertainty_mm"] > 30.0 > expected["correction_mm"] > 0.1
    assert expected["after_mm"] >= expected["uncertainty_mm"]
    assert expected["before_mm"] == pytest.approx(np.hypot(expected["correction_mm"], expected["uncertainty_mm"]))
    assert sum(expected["shares"].values()) == pytest.approx(1.0)
    assert max(expected["shares"], key=expected["shares"].get) == "tool"
    assert (
        "is tool: measure the tool against the reflectors, or touch one point with its tip, and state it in a cell file (--cell"
        in ended.err
    )
    people = run("correct", "--accept-uncertain", "-c", cell / "cal.json", *around, part, "-o", out)
    assert (people.status, out.exists()) == (0, True)
    assert people.out.index("Verdict") < people.out.index("\nnext") < people.out.index("\nTargets")


def test_a_dry_run_writes_nothing_and_prints_the_tables(run: Run, cell: Path, part: Path, tmp_path: Path):
    ended = run(
        "correct", "--accept-uncertain", "-c", cell / "cal.json", part, "--dry-run", "--report", tmp_path / "page.html"
    )
    assert ended.status == 0
    for words in ("Verdict", "targets", "relative to", "joint speed", "part.mod:7"):
        assert words in ended.out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["page.html", "part.mod"]
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Correction of part.mod" in page
    assert "Programmed path and error" in page


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("MoveL Offs(pB,3000,0,0),v50,fine,tSpindle\\WObj:=wPart;", "of the way there"),
        (
            "MoveAbsJ [[0,99,20,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tSpindle;",
            "J2 = 99.000° is outside -42 to 85°",
        ),
    ],
)
def test_what_cannot_be_reached_is_named_by_file_and_line(line, words, run: Run, cell, robot, tmp_path):
    path = tmp_path / "far.mod"
    path.write_text(module(robot, *GOOD, line), newline="")
    ended = run("correct", "-c", cell / "cal.json", path, "-o", tmp_path / "out.mod", "--json")
    assert ended.status == 1
    *others, refused = ended.json["refused"]
    assert all("shares its target" in other["reason"] for other in others)
    assert (refused["file"], refused["line"]) == (str(path), 9)
    assert words in refused["reason"]
    assert line in (tmp_path / "out.mod").read_text()


def test_correct_writes_same_bytes_if_nothing_was_estimated(run: Run, cell: Path, part: Path, tmp_path: Path, robot):
    """A calibration that found nothing corrects no motion and refuses none: the program is written as it was."""
    model = ErrorModel(robot)
    q = reach_task(model, load_task(cell / "task.toml"), 30, seed=1).q
    campaign, _ = simulate(model, q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    identify(model, campaign, keep=[]).save(tmp_path / "nothing.json")
    out = tmp_path / "out.mod"
    ended = run("correct", "--accept-uncertain", "-c", tmp_path / "nothing.json", part, "-o", out, "--json")
    assert (ended.status, ended.json["corrected"], ended.json["refused"]) == (0, 0, [])
    assert out.read_bytes() == part.read_bytes()


def test_correct_states_no_error_if_no_target_is_reached(run: Run, cell, robot, tmp_path):
    path = tmp_path / "far.mod"
    path.write_text(module(robot, "MoveL Offs(pB,9000,0,0),v50,fine,tSpindle\\WObj:=wPart;"), newline="")
    ended = run("correct", "-c", cell / "cal.json", path, "--dry-run", "--report", tmp_path / "page.html")
    assert ended.status == 1
    assert "not known: no target of the program is known and reached" in " ".join(ended.out.split())
    assert "rms mm" not in ended.out
    assert "0.000 mm before" not in ended.out
    assert "<dt>expected error before" not in (tmp_path / "page.html").read_text()


def test_an_unknown_frame_is_named_by_file_and_line_and_left(run: Run, cell, robot, tmp_path):
    path = tmp_path / "unknown.mod"
    line = "MoveL pB,v50,fine,tSpindle\\WObj:=wFixture;"
    path.write_text(module(robot, GOOD[0], line), newline="")
    to_fill_in = tmp_path / "cell.toml"
    ended = run("correct", "-c", cell / "cal.json", path, "-o", tmp_path / "out.mod", "--missing", to_fill_in)
    assert f"{path}:8" in ended.out
    assert "part wFixture (1)" in ended.err
    assert line in (tmp_path / "out.mod").read_text()
    assert 'name = "wFixture"' in to_fill_in.read_text()


def test_a_target_that_others_need_as_it_was_is_cloned(run: Run, cell, robot, tmp_path):
    path = tmp_path / "twice.mod"
    path.write_text(module(robot, *GOOD, "MoveL pB,v50,fine,tool0\\WObj:=wFixture;"), newline="")
    run("correct", "-c", cell / "cal.json", path, "-o", tmp_path / "out.mod")
    old, new = path.read_text(), (tmp_path / "out.mod").read_text()
    declared = next(line for line in old.splitlines() if "robtarget pB" in line)
    assert declared in new  # the motion in the unknown frame still goes there
    assert read_program(tmp_path / "out.mod").motions[1].end.name != "pB"


def test_correct_writes_nothing_if_every_motion_is_refused(run: Run, cell, part, tmp_path):
    out = tmp_path / "out.mod"
    ended = run("correct", "-c", cell / "cal.json", part, "-o", out, "--max-shift-mm", "0.01", "--json")
    assert ended.status == 1
    assert ended.json["written"] == []
    assert "not written: no motion was corrected" in ended.err
    assert f"{part}:7: would move by" in ended.err
    assert "0.01 mm are allowed" in ended.err
    assert not out.exists()


@pytest.mark.parametrize("suffix", ["", ".zip"])
def test_correct_writes_no_backup_if_every_motion_is_refused(run: Run, cell, part, tmp_path, suffix):
    folder = tmp_path / "backup"
    folder.mkdir()
    (folder / "part.mod").write_bytes(part.read_bytes())
    given = folder if not suffix else Path(shutil.make_archive(str(folder), "zip", folder))
    out = tmp_path / f"out{suffix}"
    ended = run("correct", "-c", cell / "cal.json", given, "-o", out, "--max-shift-mm", "0.01")
    assert ended.status == 1
    assert "not written" in ended.err
    assert not out.exists()


def test_correct_names_uncorrected_files_of_a_set(run: Run, cell, robot, part, tmp_path):
    """One module is corrected; the other, whose only motion is out of reach, goes with it as it was."""
    far = tmp_path / "far.mod"
    lines = module(robot, "MoveL Offs(pA,9000,0,0),v50,fine,tSpindle\\WObj:=wPart;").split("\r\n")
    text = "\r\n".join(["MODULE Far", *lines[1:]])
    for name in ("pA", "pB", "tSpindle", "wPart"):
        text = text.replace(name, f"{name}2")
    far.write_bytes(text.replace("main", "far").encode())
    (tmp_path / "out").mkdir()
    ended = run("correct", "-c", cell / "cal.json", part, far, "-o", tmp_path / "out", "--json")
    assert ended.status == 1
    assert (tmp_path / "out/far.mod").read_bytes() == far.read_bytes()
    assert (tmp_path / "out/part.mod").read_bytes() != part.read_bytes()
    said = [r["file"] for r in ended.json["remarks"] if "no motion of this file was corrected" in r["text"]]
    assert said == [str(far)]


def test_the_program_itself_is_never_overwritten(run: Run, cell, part):
    before = part.read_bytes()
    ended = run("correct", "-c", cell / "cal.json", part, "-o", part)
    assert ended.status == 1
    assert "would overwrite an input file" in ended.err
    assert part.read_bytes() == before


def test_correct_overwrites_no_calibration_nor_its_own_page(run: Run, cell, part, tmp_path):
    calibration = tmp_path / "cal.json"
    calibration.write_bytes((cell / "cal.json").read_bytes())
    once, twice = tmp_path / "cal.json", tmp_path / "x.mod"
    for status, out in ((1, [once]), (1, [twice, "--report", once]), (2, [twice, "--report", twice])):
        assert run("correct", "-c", calibration, part, "-o", *out, "--force").status == status
    assert calibration.read_bytes() == (cell / "cal.json").read_bytes()
    assert not twice.exists()


def test_several_files_go_into_a_folder(run: Run, cell, robot, tmp_path):
    text = module(robot, *GOOD)
    lines = text.split("\r\n")
    frames = "\r\n".join(["MODULE Frames(SYSMODULE)", *lines[1:3], "ENDMODULE", ""])
    main = "\r\n".join([lines[0], *lines[3:]])
    (tmp_path / "part.mod").write_text(main, newline="")
    (tmp_path / "frames.sys").write_text(frames, newline="")
    files = [tmp_path / "part.mod", tmp_path / "frames.sys"]
    ended = run("correct", "-c", cell / "cal.json", *files, "-o", tmp_path / "new.mod")
    assert ended.status == 1
    assert "written into a folder" in ended.err
    (tmp_path / "out").mkdir()
    ended = run("correct", "-c", cell / "cal.json", *files, "-o", tmp_path / "out", "--json")
    assert ended.status == 0
    assert (tmp_path / "out" / "frames.sys").read_text() == (tmp_path / "frames.sys").read_text()
    assert (tmp_path / "out" / "part.mod").read_text() != (tmp_path / "part.mod").read_text()


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["{part}"], 2, "--dry-run"),
        (["{part}", "-o", "{out}", "--tolerance-mm", "0"], 2, "0 mm is not above 0 mm"),
        (["{part}", "-o", "{out}", "--tool", "cutter"], 2, "--cell"),
        (["{part}", "-o", "{out}", "--cell", "{part}"], 1, "not TOML"),
        (["{part}", "{part}", "-o", "{out}"], 1, "given twice"),
        (["missing.mod", "-o", "{out}"], 1, "missing.mod: cannot be read"),
        (["part.docx", "-o", "{out}"], 1, "no suffix of a robot program"),
        (["{part}", "-o", "/nowhere/out.mod"], 1, "folder"),
    ],
)
def test_usage_errors_name_option_and_remedy(arguments, status, words, run: Run, cell, part, tmp_path):
    """Usage errors name the option or the cause."""
    place = {"part": str(part), "out": str(tmp_path / "out.mod")}
    ended = run(
        "correct", "--accept-uncertain", "-c", cell / "cal.json", *(argument.format(**place) for argument in arguments)
    )
    assert ended.status == status
    assert words in ended.err
    assert not (tmp_path / "out.mod").exists()


def test_a_program_with_logic_keeps_its_language(run: Run, cell, part, tmp_path):
    ended = run("correct", "-c", cell / "cal.json", part, "-o", tmp_path / "out.src")
    assert ended.status == 1
    assert "whose logic a new program would lose" in ended.err
    assert not (tmp_path / "out.src").exists()


def test_report_and_correction_give_one_verdict(run: Run, cell: Path, part: Path, tmp_path: Path) -> None:
    """What is said of the measured target over a task is the same wherever it is said."""
    task = cell / "task.toml"
    reported = run("report", cell / "cal.json", "--task", task, "-o", tmp_path / "r.html", "--json").json["verdict"]
    corrected = run(
        *(
            "correct",
            part,
            "--calibration",
            cell / "cal.json",
            "--task",
            task,
            "--dry-run",
            "--report",
            tmp_path / "c.html",
        ),
        "--json",
    ).json["verdict"]
    assert reported["judgements"][0] == corrected["judgements"][0]
    assert reported["judgements"][0]["decision"] == "met"
    assert [one["expected_mm"] is None for one in reported["judgements"]] == [False, False, True]
    assert corrected["judgements"][2]["expected_mm"] > corrected["judgements"][0]["expected_mm"]
    for page in ("r.html", "c.html"):
        text = (tmp_path / page).read_text(encoding="utf-8")
        assert text.index("Verdict") < text.index("Summary")


def test_a_robot_file_in_doubt_is_warned_of(run: Run, tmp_path: Path) -> None:
    """On the terminal, in the result and on the page: its controller computes with other lengths than this file's."""
    robot, rng = load_robot("ur5"), np.random.default_rng(0)
    q = rng.uniform(-1.5, 1.5, (60, 6))
    campaign, _ = simulate(ErrorModel(robot), q, rng=rng, model_error=3e-5)
    identify(ErrorModel(load_robot("ur5e")), campaign).save(tmp_path / "cal.json")
    calibration = load_calibration(tmp_path / "cal.json")
    T = ErrorModel(robot).poses(calibration.q[:2])
    rows = np.c_[T[:, :3, 3] * 1e3, se3.to_quaternion(T[:, :3, :3])]
    lines = ["x_mm,y_mm,z_mm,qx,qy,qz,qw,move", *(",".join(f"{v:.9f}" for v in row) + ",joint" for row in rows)]
    (tmp_path / "path.csv").write_text("\n".join([*lines, ""]))
    options = ["--max-shift-mm", "100", "--max-turn-deg", "30", "--max-joint-deg", "30"]
    given = ["-c", tmp_path / "cal.json", tmp_path / "path.csv", "-o", tmp_path / "out.csv", *options]
    ended = run("correct", *given, "--report", tmp_path / "r.html", "--json")
    assert ended.json["doubts"] == list(calibration.doubts)
    said = " ".join(run("correct", *given).out.split())
    assert "Warning: robot file in doubt: " in said
    assert "identify with --robot ur5" in said
    assert "computes with the nominal lengths of ur5e" in ended.json["relative_to"][-1]
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "Warning: robot file in doubt: " in page
