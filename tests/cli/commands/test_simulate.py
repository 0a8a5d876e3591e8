"""taskcal simulate."""

import json
from pathlib import Path

import numpy as np
import pytest

from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.cli.conftest import IRB6660, Run


def test_the_truth_explains_the_campaign(cell: Path) -> None:
    robot = load_robot(IRB6660)
    campaign, truth = read_campaign(cell / "one.csv", robot), json.loads((cell / "truth.json").read_text())
    model = ErrorModel(robot)
    assert tuple(truth["x"]) == model.names
    ends = np.array(truth["T_tracker_base"]) @ model.poses(campaign.q, np.array(list(truth["x"].values())))
    ends = ends @ np.array(truth["targets"]["tool"])
    assert len(campaign) == 60
    assert np.abs(campaign.points[:, 0] - ends[:, :3, 3]).max() < 2e-4


@pytest.mark.parametrize("option", ["--model-error-mm", "--joint-error-deg"])
def test_errors_are_as_large_as_asked_for(run: Run, cell: Path, tmp_path: Path, option: str) -> None:
    """What the truth leaves of the points, far above the tracker's noise: per axis, or by the derivative of the joints."""
    path, truth_path = tmp_path / "a.csv", tmp_path / "truth.json"
    task = ["--task", cell / "list.toml", "--count", "40", "--seed", "5"]
    ended = run("simulate", "--robot", IRB6660, *task, option, "0.7", "-o", path, "--truth", truth_path)
    assert ended.status == 0, ended.err
    robot = load_robot(IRB6660)
    campaign, truth, model = read_campaign(path, robot), json.loads(truth_path.read_text()), ErrorModel(robot)
    x = np.array(list(truth["x"].values()))

    def points(q: np.ndarray) -> np.ndarray:
        ends = np.array(truth["T_tracker_base"]) @ model.poses(q, x) @ np.array(truth["targets"]["tool"])
        return ends[:, :3, 3]

    at = points(campaign.q)
    wanted = np.array([0.7e-3])
    if option == "--joint-error-deg":
        step = np.radians(0.01)
        by_joint = [(points(campaign.q + step * one) - at) / step for one in np.eye(6)]
        wanted = np.radians(0.7) * np.sqrt(np.sum(np.square(by_joint), axis=0))
    assert np.sqrt(np.mean(((campaign.points[:, 0] - at) / wanted) ** 2)) == pytest.approx(1.0, abs=0.25)


def test_the_same_seed_gives_the_same_file(run: Run, cell: Path, tmp_path: Path) -> None:
    written = []
    for name, seed in (("a.csv", 3), ("b.csv", 3), ("c.csv", 4)):
        task = ["--task", cell / "task.toml", "--count", 8, "--seed", seed]
        assert run("simulate", "--robot", IRB6660, *task, "-o", tmp_path / name).status == 0
        written.append((tmp_path / name).read_bytes())
    assert written[0] == written[1] != written[2]


@pytest.mark.parametrize(
    "options", [["--targets", "2"], ["--targets", "3", "--pose"], ["--truth", "c.csv"]], ids=["two", "pose", "one file"]
)
def test_inconsistent_options(
    run: Run, cell: Path, tmp_path: Path, options: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = run("simulate", "--robot", IRB6660, "--task", cell / "task.toml", "-o", "c.csv", *options)
    assert ended.status == 2
    assert list(tmp_path.iterdir()) == []


def test_missing_output_folder_is_reported_before_simulation(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A missing output folder is reported before any computation."""
    monkeypatch.setattr("taskcal.task.task.load_task", lambda *_: pytest.fail("read"))
    (tmp_path / "any.toml").write_text("")
    ended = run("simulate", "--robot", IRB6660, "--task", tmp_path / "any.toml", "-o", tmp_path / "none" / "c.csv")
    assert ended.status == 1
    assert "there is no folder" in ended.err


def test_the_same_robot_measured_again(run: Run, cell: Path, tmp_path: Path) -> None:
    """The calibration of the first campaign predicts one of another seed, which is that of the seed alone not."""
    task = ["simulate", "--robot", IRB6660, "--task", cell / "task.toml", "--count", "20", "--seed", "8"]
    again, other = tmp_path / "again.csv", tmp_path / "other.csv"
    ended = run(*task, "-o", again, "--truth-from", cell / "truth.json", "--truth", tmp_path / "truth.json", "--json")
    assert ended.json["truth_from"] == str(cell / "truth.json")
    assert (tmp_path / "truth.json").read_bytes() == (cell / "truth.json").read_bytes()
    assert run(*task, "-o", other).status == 0
    same, different = (run("validate", cell / "cal.json", path, "--json").json["mean_mm"] for path in (again, other))
    assert same < 0.05 < 0.3 < different


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("abb-irb6660-205-1.9", "ur5"), "was simulated for ur5, not abb-irb6660-205-1.9"),
        (('"J1.tx"', '"J1.tq"'), "differ in parameter 'J1.tq'"),
        (('"targets"', '"target"'), "is not the truth"),
        (("{", "["), "is not JSON"),
    ],
)
def test_a_truth_that_is_none(run: Run, cell: Path, tmp_path: Path, change: tuple[str, str], said: str) -> None:
    (tmp_path / "truth.json").write_text((cell / "truth.json").read_text().replace(*change))
    task = ["simulate", "--robot", IRB6660, "--task", cell / "list.toml", "-o", tmp_path / "c.csv"]
    ended = run(*task, "--truth-from", tmp_path / "truth.json", "--json")
    assert (ended.status, ended.out) == (1, "")
    assert said in ended.err
    assert run(*task, "--truth-from", cell / "truth.json", "--targets", "3").status == 2
    assert not (tmp_path / "c.csv").exists()


@pytest.mark.parametrize("way", ["socket", "wire", "camera", "board", "tracker+socket"])
def test_a_robot_is_measured_without_a_tracker(run: Run, cell: Path, tmp_path: Path, way: str) -> None:
    path, distances, truth = tmp_path / "c.csv", tmp_path / "d.csv", tmp_path / "truth.json"
    stated = ["--distances", distances] if "socket" in way else []
    cone = (cell / "task.toml").read_text().replace("cone_deg = 0.0", "cone_deg = 40.0")
    (tmp_path / "task.toml").write_text(cone)
    of = ["--robot", IRB6660, "--task", tmp_path / "task.toml", "--count", 24, "--observe", way, "--places", 1]
    ended = run("simulate", *of, "-o", path, "--truth", truth, *stated, "--json")
    assert ended.status == 0, ended.err
    assert ended.json["observe"] == way
    found = run("identify", "--robot", IRB6660, path, *stated, "-o", tmp_path / "cal.json", "--json")
    assert found.status == 0, found.err
    assert set(json.loads(truth.read_text())["unknowns"]) >= {"socket a.tx"} if stated else True
    again = run("simulate", *of, "-o", tmp_path / "again.csv", "--truth-from", truth, "--seed", 5)
    assert again.status == 0, again.err
    assert (tmp_path / "again.csv").read_bytes() != path.read_bytes()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--observe", "sokcet"], "did you mean 'socket'"),
        (["--observe", "wire", "--pose"], "poses are measured by a tracker alone"),
        (["--observe", "wire", "--distances", "d.csv"], "only sockets have stated distances"),
        (["--places", "2"], "a tracker needs no places"),
        (["--joint-error-deg", "-1"], "'-1' must be 0 or more"),
    ],
)
def test_ways_to_measure_that_are_not_offered(
    run: Run, cell: Path, tmp_path: Path, options: list[str], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = run("simulate", "--robot", IRB6660, "--task", cell / "task.toml", "-o", "c.csv", *options)
    assert ended.status == 2
    assert message in ended.err
    assert list(tmp_path.iterdir()) == []
