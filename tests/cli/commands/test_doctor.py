"""taskcal doctor."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.cli.conftest import Run
from tests.laws.observations import socket_campaign
from tests.observations.pictured import COLUMNS, CORNERS, LENS, ROWS, SQUARE, take_pictures


def test_a_sound_installation(run: Run) -> None:
    ended = run("doctor", "--json")
    assert ended.status == 0
    assert ended.json["ok"]
    names = {check["name"] for check in ended.json["checks"]}
    assert {"Python", "numpy", "scipy", "numba", "taskcal", "kernels", "BLAS threads", "catalogue"} <= names


def test_a_broken_one(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskcal.catalogue_names", lambda: ())
    ended = run("doctor")
    assert ended.status == 1
    assert "BROKEN" in ended.out
    assert "install Taskcal again" in " ".join(ended.out.split())  # wherever a narrow line breaks


def test_library_of_programs_installed_over_taskcals_is_broken(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {"robot-programs": "1.2.3"}
    monkeypatch.setattr("taskcal.cli.commands.doctor.version", lambda name: versions.get(name, "9.9"))
    ended = run("doctor", "--json")
    assert [check["name"] for check in ended.json["checks"] if not check["ok"]] == ["robot_programs"]


@pytest.fixture
def reversed_j3(tmp_path: Path) -> Path:
    """A campaign of a UR5 whose third joint has the other sign."""
    robot, rng = load_robot("ur5"), np.random.default_rng(0)
    q = rng.uniform(-1.2, 1.2, (40, 6))
    sound = simulate(ErrorModel(robot), q, rng=rng, targets={"tool": np.array([0.05, 0.02, 0.1])})[0]
    path = tmp_path / "reversed.csv"
    write_campaign(path, replace(sound, q=sound.q * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]), robot)
    return path


def test_a_reversed_joint_is_found_and_mended(run: Run, reversed_j3: Path, tmp_path: Path) -> None:
    mended = tmp_path / "mended.csv"
    ended = run("doctor", reversed_j3, "--robot", "ur5", "--fix", mended, "--json")
    assert ended.status == 0
    first = ended.json["findings"][0]
    assert (first["id"], first["subject"]) == ("joint-sign", ["J3"])
    assert first["error_after_mm"] < 0.1 * first["error_before_mm"]
    robot = load_robot("ur5")
    given, right = (read_campaign(path, robot).q for path in (reversed_j3, mended))
    np.testing.assert_allclose(right, given * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0], atol=1e-9)
    told = " ".join(ended.err.split())  # wherever a narrow line breaks
    assert "applied: joint-sign of J3" in told
    before, after = re.search(r"error of rows held out, .*: ([\d.]+) mm as given, ([\d.]+) mm fixed", told).groups()
    assert float(after) < 0.1 * float(before)
    again = tmp_path / "again.csv"
    sound = run("doctor", mended, "--robot", "ur5", "--fix", again, "--json")
    assert sound.json == {"findings": []}
    assert "is not written: no mistake found" in " ".join(sound.err.split())
    assert not again.exists()


def test_the_refusal_of_a_fit_says_what_the_doctor_finds(run: Run, reversed_j3: Path, tmp_path: Path) -> None:
    ended = run("identify", reversed_j3, "--robot", "ur5", "-o", tmp_path / "cal.json")
    assert ended.status == 1
    assert "hint: joint-sign of J3" in ended.err


def test_doctor_shows_too_few_rows_alone(run: Run, reversed_j3: Path, tmp_path: Path) -> None:
    three = tmp_path / "three.csv"
    three.write_text("".join(reversed_j3.read_text().splitlines(keepends=True)[:4]))
    (only,) = run("doctor", three, "--robot", "ur5", "--json").json["findings"]
    assert (only["id"], only["error_before_mm"], only["error_after_mm"]) == ("too-few-rows", None, None)
    shown = run("doctor", three, "--robot", "ur5", "--fix", tmp_path / "mended.csv")
    assert shown.status == 0
    assert "too-few-rows  3 measured rows are too few" in shown.out
    refused = run("identify", three, "--robot", "ur5", "-o", tmp_path / "cal.json")
    assert refused.status == 1
    assert "hint:" not in refused.err


def test_options_of_a_campaign_want_one(run: Run) -> None:
    ended = run("doctor", "--robot", "ur5")
    assert ended.status == 2
    assert "give the campaign as well" in ended.err


def test_a_campaign_wants_its_robot(run: Run, reversed_j3: Path) -> None:
    ended = run("doctor", reversed_j3)
    assert ended.status == 2
    assert "--robot is required with a campaign" in ended.err


def test_without_a_tracker_the_command_says_what_it_examined(run: Run, tmp_path: Path) -> None:
    robot, rng = load_robot("ur5"), np.random.default_rng(0)
    model = ErrorModel(robot)
    sockets = socket_campaign(rng, model, rng.normal(size=len(model)) * model.tolerances, 40, noise=2e-5)[0]
    path = tmp_path / "sockets.csv"
    write_campaign(path, replace(sockets, q=sockets.q * [1, 1, -1, 1, 1, 1]), robot)
    ended = run("doctor", path, "--robot", "ur5", "--json")
    assert ended.json["findings"][0]["id"] == "joint-sign"
    assert "frames, the order of rows, slips, drift and single rows are not" in ended.err


@pytest.mark.long
def test_doctor_reads_images_that_identify_refuses(run: Run, tmp_path: Path) -> None:
    """The wrong joint is named by both; the file without the mistake is identified."""
    seen = take_pictures(4, 12)
    image, corner = np.divmod(np.arange(len(seen.pixel)), len(CORNERS))
    corners = {"image": image, "corner": corner, "u_px": seen.pixel[:, 0], "v_px": seen.pixel[:, 1]}
    size = {"width_px": np.full(len(image), LENS.width), "height_px": np.full(len(image), LENS.height)}
    q = np.degrees(seen.q) * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]
    joints = {"image": range(12), **{f"J{j + 1}_deg": q[:, j] for j in range(6)}}
    for name, columns in (("corners.csv", corners | size), ("joints.csv", joints)):
        rows = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
        (tmp_path / name).write_text("\n".join(rows) + "\n")
    (tmp_path / "board.toml").write_text(
        f'[[board]]\nkind = "checkerboard"\ncolumns = {COLUMNS}\nrows = {ROWS}\nsquare_mm = {SQUARE * 1e3}\n'
    )
    images = ["--robot", "ur5", "--images", tmp_path / "corners.csv", "--board", tmp_path / "board.toml"]
    refused = run("identify", tmp_path / "joints.csv", *images, "-o", tmp_path / "cal.json")
    assert refused.status == 1
    assert "joint-sign of J3" in " ".join(refused.err.split())
    ended = run("doctor", tmp_path / "joints.csv", *images, "--fix", tmp_path / "mended.csv", "--json")
    assert [(one["id"], one["subject"]) for one in ended.json["findings"]] == [("joint-sign", ["J3"])]
    assert run("identify", tmp_path / "mended.csv", *images, "-o", tmp_path / "cal.json").status == 0
