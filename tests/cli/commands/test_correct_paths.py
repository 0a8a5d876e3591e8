"""``taskcal correct`` on tool paths of CAM systems, which leave the rotation about the tool's axis open."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.reading import read_program
from taskcal.robot.catalogue import load_robot
from tests.cli.conftest import IRB6660, Run

APT = """PARTNO POCKET
FEDRAT/ 600.0,MMPM
GOTO/ 1700.00000,   30.00000, 1450.00000, -0.565044, 0.000000, 0.825059
GOTO/ 1750.00000,   30.00000, 1450.00000
INDIRV/ 0.00000, 1.00000, 0.00000
TLON,GOFWD/ (CIRCLE/ 1700.00000, 30.00000, 1450.00000,$
 50.00000),ON,(LINE/ 1700.00000, 30.00000, 1450.00000,$
 1700.00000, 80.00000, 1450.00000)
FINI
"""


def test_an_apt_path_is_corrected_by_its_points_and_arcs(run: Run, cell: Path, tmp_path: Path) -> None:
    path = tmp_path / "pocket.apt"
    path.write_text(APT)
    ended = run(
        "correct",
        "--accept-uncertain",
        "-c",
        cell / "cal.json",
        path,
        "-o",
        tmp_path / "out.apt",
        "--tolerance-mm",
        "1",
        "--json",
    )
    assert ended.status == 0, ended.err
    assert (ended.json["moves"], ended.json["corrected"], ended.json["refused"]) == (3, 3, [])
    assert ended.json["before"]["targets"]["max_mm"] > 0.1
    robot = load_robot(IRB6660)
    old, new = (read_program(p, robot=robot) for p in (path, tmp_path / "out.apt"))
    assert not new.diagnostics
    assert [move.kind for move in new.motions] == ["linear", "linear", "circular"]
    shifts = [np.linalg.norm(b.end.T[:3, 3] - a.end.T[:3, 3]) for a, b in zip(old.motions, new.motions, strict=True)]
    assert all(1e-4 < shift < 5e-3 for shift in shifts)


def test_a_joint_path_in_csv_is_corrected_in_its_joints(run: Run, cell: Path, tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("id,J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\na,0,10,20,5,-40,10\nb,3,12,22,6,-42,12\n")
    ended = run("correct", "-c", cell / "cal.json", path, "-o", tmp_path / "out.csv", "--json")
    assert ended.status == 0, ended.err
    old, new = (read_program(p).motions for p in (path, tmp_path / "out.csv"))
    change = np.degrees([b.end.q - a.end.q for a, b in zip(old, new, strict=True)])
    assert 1e-3 < np.abs(change).max() < 0.5


def test_corrected_apt_path_is_written_as_rapid_or_krl(run: Run, cell: Path, tmp_path: Path) -> None:
    """An APT path is written as a RAPID or KRL program of the corrected motions."""
    path = tmp_path / "pocket.apt"
    path.write_text(APT)
    ends = {}
    for name in ("out.mod", "out.src", "out.csv"):
        ended = run("correct", "-c", cell / "cal.json", path, "-o", tmp_path / name, "--json")
        assert ended.status == 0, ended.err
        # the finest zone of a controller, 0.3 mm, cuts a right angle by 0.3·√2/4; a table of points has none
        corner = 0.0 if name == "out.csv" else 0.3 * np.sqrt(2.0) / 4.0
        assert ended.json["after"]["targets"]["max_mm"] == pytest.approx(corner, abs=1e-3)
        motions = read_program(tmp_path / name, robot=load_robot(IRB6660)).motions
        assert [move.kind for move in motions] == ["linear", "linear", "circular"]
        ends[name] = np.array([move.flange(move.end.T) for move in motions])
    for name in ("out.src", "out.csv"):
        np.testing.assert_allclose(ends[name][:, :3, 3], ends["out.mod"][:, :3, 3], atol=2e-7)
        np.testing.assert_allclose(ends[name][:, :3, :3], ends["out.mod"][:, :3, :3], atol=2e-7)


def test_correct_leaves_points_of_another_tool(run: Run, cell: Path, tmp_path: Path) -> None:
    """Points of another tool stay, are named by their line, and make the exit status 1."""
    path = tmp_path / "two-tools.apt"
    first = "LOAD/TOOL,1\nGOTO/1700.,30.,1450.,-0.565044,0.,0.825059\n"
    path.write_text(first + "LOAD/TOOL,2\nGOTO/1750.,30.,1450.\n")
    ended = run("correct", "-c", cell / "cal.json", path, "-o", tmp_path / "out.apt")
    assert ended.status == 1
    said = " ".join(ended.out.split())
    assert "Rejected motions:" in said
    assert "two-tools.apt:4: tool 2 is loaded, and it is not known where that is" in said
    assert (tmp_path / "out.apt").read_text().endswith("\nLOAD/TOOL,2\nGOTO/1750.,30.,1450.\n")


def test_correct_refuses_a_path_that_no_spin_can_reach(run: Run, cell: Path, tmp_path: Path) -> None:
    path, out = tmp_path / "far.apt", tmp_path / "out.apt"
    path.write_text("PARTNO FAR\nGOTO/9000,0,0\n")
    ended = run("correct", "--accept-uncertain", "-c", cell / "cal.json", path, "-o", out, "--json")
    assert (ended.status, ended.out, out.exists()) == (1, "", False)
    assert "far.apt:2: of the motions from this line on" in ended.err
