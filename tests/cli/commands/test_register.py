"""taskcal register, and identify with what it wrote."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from taskcal.identification.calibration import load_calibration
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import TRACKER_POSE, simulate
from tests.cli.conftest import IRB6660, Run

QUIET = np.array([0.3, 0.2, 0.55, 0.4, -0.8, 0.5])


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Each motor of the IRB 6660 alone, and some poses: an exact robot that an ordinary tracker measures."""
    path = tmp_path_factory.mktemp("swept") / "swept.csv"
    model = ErrorModel(load_robot(IRB6660))
    q = [QUIET + turn * axis for axis in np.eye(6) for turn in np.linspace(-0.7, 0.7, 9)]
    q += list(QUIET + 0.2 * np.random.default_rng(0).normal(size=(20, 6)))
    campaign, _ = simulate(model, np.array(q), rng=np.random.default_rng(1), x=np.zeros(len(model)))
    write_campaign(path, campaign, model.robot)
    return path


@pytest.mark.parametrize("method", ["poses", "circles"])
def test_frame_targets_and_residuals(run: Run, swept: Path, method: str) -> None:
    result = run("register", "--robot", IRB6660, swept, "--method", method, "--json").json
    np.testing.assert_allclose(result["tracker_frame"]["position_mm"], TRACKER_POSE[:3, 3] * 1e3, atol=0.2)
    np.testing.assert_allclose(result["targets"]["tool"]["position_mm"], 0.0, atol=0.1)
    assert len(result["residuals"]) == result["rows"] == 74
    assert 0.0 < result["mean_mm"] < result["rms_mm"] < result["max_mm"] < 0.2
    assert result["max_mm"] == max(row["tool_mm"] for row in result["residuals"])
    assert [c["axis"] for c in result["circles"]] == ([] if method == "poses" else [f"J{j}" for j in range(1, 7)])


def test_the_table_names_circles_frames_and_the_worst_rows(run: Run, swept: Path) -> None:
    shown = run("register", "--robot", IRB6660, swept, "--method", "circles").out
    lower_arm = re.search(r"J2 +tool +\d+ +80\.2 +([\d.]+)", shown)
    assert lower_arm is not None
    assert float(lower_arm[1]) == pytest.approx(700.0, abs=0.1)
    assert all(text in shown for text in ("tracker", "largest residuals"))


def test_identify_takes_the_file_and_can_hold_it(run: Run, swept: Path, tmp_path: Path) -> None:
    register = ["register", "--robot", IRB6660, swept, "--method", "circles", "-o", tmp_path / "reg.json"]
    assert run(*register).status == 0
    identify = ["identify", "--robot", IRB6660, swept, "--frames", "fixed", "--keep", "published", "-o"]
    assert run(*identify, tmp_path / "file.json", "--registration", tmp_path / "reg.json").status == 0
    assert run(*identify, tmp_path / "circles.json", "--registration", "circles").status == 0
    written = json.loads((tmp_path / "reg.json").read_text())["registration"]["T_tracker_base"]
    by_file, by_name = (load_calibration(tmp_path / name) for name in ("file.json", "circles.json"))
    np.testing.assert_array_equal(by_file.T_tracker_base, written)
    np.testing.assert_array_equal(by_file.T_tracker_base, by_name.T_tracker_base)
    np.testing.assert_array_equal(by_file.estimate, by_name.estimate)


def test_circles_of_a_campaign_without_sweeps_are_refused(run: Run, cell: Path, tmp_path: Path) -> None:
    ended = run("register", "--robot", IRB6660, cell / "three.csv", "--method", "circles", "-o", tmp_path / "reg.json")
    assert (ended.status, ended.out) == (1, "")
    assert "only one axis turns" in ended.err
    assert not (tmp_path / "reg.json").exists()


def test_another_robot_is_refused(run: Run, swept: Path) -> None:
    ended = run("register", "--robot", "ur10", swept)
    assert ended.status == 1
    assert "inconsistent with ur10" in ended.err


def test_a_registration_that_is_not_there_is_named(run: Run, swept: Path, tmp_path: Path) -> None:
    ended = run(
        "identify", "--robot", IRB6660, swept, "-o", tmp_path / "cal.json", "--registration", tmp_path / "no.json"
    )
    assert ended.status == 1
    assert "no.json" in ended.err
