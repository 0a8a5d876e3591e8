"""Campaigns that tell next to nothing, on the command line: refused in words that can be read, and nothing is written."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.reading import read_program
from taskcal.campaigns.campaign import Campaign
from taskcal.cli import main
from taskcal.correction.correct import correct
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import load_calibration
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.cli.conftest import Run

ROBOT = "abb-irb120"
HOME = np.radians([10.0, 20.0, -15.0, 30.0, 40.0, 0.0])
ELSEWHERE = np.radians([-60.0, -10.0, 15.0, -40.0, -50.0, 60.0])


def moving(*joints: int) -> Campaign:
    """Sixty rows in which some joints move."""
    model, rng = ErrorModel(load_robot(ROBOT)), np.random.default_rng(0)
    q = np.tile(HOME, (60, 1))
    q[:, joints] += rng.uniform(-1.0, 1.0, (60, len(joints))) * np.array([0, 0, 0, 0, 1.0, 2.0])[list(joints)]
    return simulate(model, q, rng=rng, targets={"smr": np.array([0.003, 0.0, 0.05])}, model_error=3e-5)[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Campaigns of J6, and of J5 and J6, in motion."""
    folder = tmp_path_factory.mktemp("poor")
    robot = load_robot(ROBOT)
    for name, joints in (("one", (5,)), ("two", (4, 5))):
        write_campaign(folder / f"{name}.csv", moving(*joints), robot)
    for name, q in (("here", HOME), ("elsewhere", ELSEWHERE)):
        T = ErrorModel(robot).poses(q + np.radians([[0.0] * 6, [0.0, 0.0, 0.0, 0.0, 5.0, 5.0]]))
        rows = np.c_[T[:, :3, 3] * 1e3, se3.to_quaternion(T[:, :3, :3])]
        lines = [",".join(f"{value:.9f}" for value in row) + ",joint" for row in rows]
        (folder / f"{name}.path.csv").write_text("\n".join(["x_mm,y_mm,z_mm,qx,qy,qz,qw,move", *lines]) + "\n")
    return folder


@pytest.mark.parametrize("options", [(), ("--keep", "none"), ("--effects", "auto"), ("--folds", "3")])
def test_one_joint_in_motion_is_refused(run: Run, folder: Path, options):
    out = folder / "one.json"
    ended = run("identify", "--robot", ROBOT, folder / "one.csv", "-o", out, *options)
    assert ended.status == 1
    assert not out.exists()
    said = " ".join(ended.err.split())
    assert "one.csv" in said
    assert "only J6 moves" in said
    assert "at least three joints move" in said
    assert "hint" not in said


@pytest.fixture(scope="module")
def two(folder: Path) -> Path:
    """A calibration of two joints, which is one near the poses that were measured."""
    path = folder / "two.json"
    assert main(["identify", "--robot", ROBOT, str(folder / "two.csv"), "-o", str(path), "--json"]) == 0
    return path


def test_correct_writes_nothing_where_nothing_is_known(run: Run, folder: Path, two: Path, tmp_path: Path):
    program, out = folder / "elsewhere.path.csv", tmp_path / "out.csv"
    ended = run("correct", "-c", two, program, "-o", out)
    assert ended.status == 1
    assert not out.exists()
    said = " ".join(ended.err.split())
    assert "times as much as the tolerances" in said
    assert "--accept-uncertain" in said
    calibration = load_calibration(two)
    with pytest.raises(TaskcalError, match="Measure more poses near them"):
        correct(calibration, read_program(program, robot=calibration.model.robot))
    assert run("correct", "-c", two, program, "-o", out, "--accept-uncertain", "--max-shift-mm", "100").status == 0
    assert out.exists()


def test_place_ranks_known_placements_alone(run: Run, folder: Path, two: Path):
    here, there = folder / "here.path.csv", folder / "elsewhere.path.csv"
    region = ("--calibration", two, "--region", "0:1,0,0", "--steps", "1")
    assert run("place", here, *region).status == 0
    ended = run("place", there, *region)
    assert ended.status == 1
    assert "times as much as the tolerances" in " ".join(ended.out.split())
    ended = run("place", there, *region, "--accept-uncertain", "--json")
    assert (ended.status, len(ended.json["best"]), ended.json["recommended"]) == (1, 1, None)
    assert "outside the measured joint range" in ended.err


@pytest.mark.parametrize("form", ["urdf", "dh", "offsets"])
def test_export_writes_nothing_where_nothing_is_known(run: Run, two: Path, tmp_path: Path, form):
    out = tmp_path / "out"
    ended = run("export", two, "--form", form, "-o", out)
    assert ended.status == 1
    assert not out.exists()
    assert "times as much as the tolerances" in " ".join(ended.err.split())
    assert run("export", two, "--form", form, "-o", out, "--accept-uncertain", "--accept-loss").status == 0
    assert out.exists()
