"""``taskcal measure`` on a virtual robot: lines of JSON, resuming, and what is refused."""

import json
from pathlib import Path

import pytest

import taskcal as tc
from tests.cli.conftest import Run
from tests.cli.test_json_keys import KEYS

LINE = "measure -r ur5 -t task.toml -c virtual -i virtual -o c.csv --effects none --accuracy-mm 0.3"


def test_measuring_stops_resumes_and_ends_with_a_calibration(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines for where to go, what was taken and what is known; the files beside the campaign are those of the other commands."""
    monkeypatch.chdir(tmp_path)
    assert run("robots", "task", "ur5", "-o", "task.toml").status == 0
    first = run(*LINE.split(), "--most", "13", "--json")
    assert first.status == 0, first.err
    *lines, end = [json.loads(line) for line in first.out.splitlines()]
    poses, taken, rows = lines[::3], lines[1::3], lines[2::3]
    assert {*map(tuple, map(sorted, poses))} == {tuple(KEYS["measure, where to go"]["top"])}
    assert {*map(tuple, map(sorted, taken))} == {tuple(KEYS["measure, a row taken"]["top"])}
    assert [one["number"] for one in poses] == [one["measured"] for one in taken] == list(range(1, 14))
    assert [one["rows"] for one in rows] == list(range(1, 14))
    assert all(sorted(one) == KEYS["measure"]["top"] for one in rows)
    assert sorted(end) == KEYS["measure at its end"]["top"]
    assert (end["ended"], end["proven"]) == ("most", False)
    assert rows[0]["expected_error_mm"] is None
    assert 0.0 < rows[-1]["expected_error_mm"] < 1.0
    again = run(*LINE.split(), "--resume")
    assert again.status == 0, again.err
    assert "13 rows are there" in again.err
    assert "proven" in again.out
    campaign = tc.read_campaign("c.csv", tc.load_robot("ur5"))
    assert len(campaign) >= 18
    calibration = tc.load_calibration("c.calibration.json")
    kept = [k for k in campaign.ids if k.endswith("kept-out")]
    assert len(kept) >= 6
    assert not set(kept) & set(calibration.ids)
    assert calibration.held_out is not None
    assert "<html" in Path("c.report.html").read_text()[:500]
    assert run(*LINE.split()).status == 1  # it is there already


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("-c virtua -i virtual", "did you mean 'virtual'"),
        ("-c virtual -i tracker", "folder"),
        ("-c hand -i virtual --drive", "--drive"),
        ("-c hand -i folder --instrument-address nowhere", "--instrument-address"),
        ("-c virtual --controller-address here -i virtual", "seed"),
        ("-c virtual -i virtual --instrument-address 4", "no address"),
        ("-c hand -i folder --instrument-address .", "would be read as points"),
        ("-c virtual -i socket", "--observe socket"),
        ("-c virtual -i hand", "--observe"),
        ("-c virtual -i virtual --observe board", "plan --observe board"),
        ("-c virtual -i virtual --observe socket --drive", "by hand"),
        ("-c virtual -i virtual --observe pixels --shots 2", "one image"),
        ("-c virtual -i virtual --observe pixels", "--camera"),
        ("-c virtual -i virtual --distances task.toml", "--observe socket"),
    ],
)
def test_devices_that_are_not_there_are_named(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: str, said: str
) -> None:
    """Nothing is written, and the message has what would work."""
    monkeypatch.chdir(tmp_path)
    assert run("robots", "task", "ur5", "-o", "task.toml").status == 0
    ended = run("measure", "-r", "ur5", "-t", "task.toml", "-o", "c.csv", *arguments.split())
    assert ended.status in (1, 2)
    assert said in ended.err
    assert not Path("c.csv").exists()


def test_each_pose_without_a_tracker_names_its_fixture(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As does its row; that is a row of an ordinary campaign of sockets, also of an arm that reaches some in few postures."""
    monkeypatch.chdir(tmp_path)
    assert run("robots", "task", "franka-panda", "-o", "task.toml").status == 0
    Path("d.csv").write_text("socket_a,socket_b,distance_mm\na,b,100\n")
    ended = run(
        *LINE.replace("ur5", "franka-panda").split(),
        *["--observe", "socket", "--distances", "d.csv", "--most", "2", "--json"],
    )
    assert ended.status == 0, ended.err
    *lines, end = [json.loads(line) for line in ended.out.splitlines()]
    assert {*map(tuple, map(sorted, lines[::3]))} == {tuple(KEYS["measure, where to go at a fixture"]["top"])}
    assert (end["ended"], end["proven"], end["calibration"]) == ("most", False, None)
    campaign = tc.read_campaign("c.csv", tc.load_robot("franka-panda"))
    sockets = campaign.observations[0].labels(campaign.read(0))
    assert sockets == [one["socket"] for one in lines[::3]]
