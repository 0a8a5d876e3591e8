"""taskcal plan."""

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskcal
from taskcal.cli import main
from taskcal.robot.catalogue import load_robot
from taskcal.tables.forms import read_csv
from tests.cli.conftest import IRB6660, Run
from tests.task.task_files import BOX

STATION = """
position_mm = [4500.0, 0.0, 1500.0]
[[reflector]]
name = "smr1"
position_mm = [0.0, 0.0, 0.0]
axis = [-1.0, 0.0, 0.0]
acceptance_deg = 60.0
[[reflector]]
name = "smr2"
position_mm = [60.0, 0.0, 20.0]
"""
KEEP_OUT = """
[[keep_out]]
center_mm = [1711.0, 30.0, 1489.0]
size_mm = [3000.0, 3000.0, 3000.0]
"""

Alone = tuple[dict[str, Any], bytes]


@pytest.fixture
def ask(cell: Path, tmp_path: Path) -> list[object]:
    """A small plan."""
    small = ["--count", "12", "--candidates", "120", "-o", tmp_path / "plan.csv"]
    return ["plan", "--robot", IRB6660, "--task", cell / "list.toml", *small]


@pytest.fixture(scope="module")
def alone(cell: Path, tmp_path_factory: pytest.TempPathFactory) -> Alone:
    """What that plan says, and its file."""
    path = tmp_path_factory.mktemp("alone") / "plan.csv"
    small = ["--count", "12", "--candidates", "120", "-o", str(path), "--json"]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(["plan", "--robot", IRB6660, "--task", str(cell / "list.toml"), *small]) == 0
    return json.loads(out.getvalue()), path.read_bytes()


def test_a_plan_is_better_than_random_poses_and_can_be_driven(
    run: Run, ask: list[object], cell: Path, tmp_path: Path
) -> None:
    ended = run(*ask, "--task", cell / "task.toml", "--model-error-mm", "0.02", "--json")
    assert (ended.status, ended.err) == (0, "")
    result = ended.json
    assert (result["model_error_mm"], result["accuracy_mm"]) == pytest.approx((0.02, 0.1))
    assert 0.0 < result["expected_error_mm"] < 0.7 * result["random_expected_error_mm"]
    assert result["expected_error_mm"] < result["before_mm"]
    assert (result["count"], len(result["by_count_mm"]), result["criterion"]) == (12, 12, "task")
    allowed = result["geometry_allowance_mm"]
    assert allowed**2 + 3.0 * result["model_error_mm"] ** 2 == pytest.approx(0.1**2)
    enough = result["poses_needed"]
    assert result["by_count_mm"][enough - 1] <= allowed < result["by_count_mm"][enough - 2]
    assert result["poses_needed_without_model_error"] <= enough
    table = read_csv(tmp_path / "plan.csv")
    assert table.header == ("id", "J1_deg", "J2_deg", "J3_deg", "J4_deg", "J5_deg", "J6_deg")
    q = np.radians(np.stack([table.numbers(name) for name in table.header[1:]], axis=1))
    assert len(q) == 12
    assert not load_robot(IRB6660).outside_limits(q)


def test_plan_is_reproducible_from_seed_and_report_is_neutral(
    run: Run, ask: list[object], alone: Alone, tmp_path: Path
) -> None:
    """The same seed gives the same plan, and writing a report does not change it."""
    ended = run(*ask, "--report", tmp_path / "plan.html", "--json")
    assert (tmp_path / "plan.csv").read_bytes() == alone[1]
    assert ended.json["report"] == str(tmp_path / "plan.html")
    assert ended.json["expected_error_mm"] == alone[0]["expected_error_mm"]
    page = (tmp_path / "plan.html").read_text(encoding="utf-8")
    assert page.count("<figure>") == 2
    assert "All 12 poses" in page


def test_the_tables_for_people(run: Run, ask: list[object]) -> None:
    assert "0.05 mm per axis at every pose: Gutiérrez et al." in " ".join(run(*ask).out.split())
    ended = run(*ask, "--model-error-mm", "0")
    assert ended.status == 0
    for part in (
        "0 mm per axis at every pose: as given",
        "this plan",
        "random poses",
        "space-filling poses",
        "greedy selection",
        "not reached",
        "poses chosen meet the task",
        "plan.csv",
    ):
        assert part in ended.out


def test_plan_with_station_states_visibility_and_clearance(run: Run, ask: list[object], tmp_path: Path) -> None:
    """With a station, the plan states the visible reflectors and the smallest clearance of the links."""
    pillar = "[[keep_out]]\ncenter_mm = [0.0, 2500.0, 500.0]\nsize_mm = [600.0, 600.0, 1000.0]\n"
    (tmp_path / "station.toml").write_text(STATION + pillar)
    result = run(*ask, "--station", tmp_path / "station.toml", "--json").json
    assert len(result["visible"]) == 12
    assert all("smr2" in names for names in result["visible"])
    assert result["station"] == str(tmp_path / "station.toml")
    for gaps in result["clearance_mm"].values():
        assert len(gaps) == 12
        assert min(gaps) > 0.0
    assert (
        f"{min(result['clearance_mm']['to_keep_out']):.0f} mm to keep-out boxes; links as capsules of 100 to 300 mm radius"
        in " ".join(run(*ask, "--station", tmp_path / "station.toml").out.split())
    )


def test_a_campaign_is_extended(run: Run, ask: list[object], alone: Alone, cell: Path) -> None:
    more = run(*ask, "--campaign", cell / "one.csv", "--json").json
    assert more["measured_before"] == 60
    assert more["expected_error_mm"] < alone[0]["expected_error_mm"]


def test_a_calibration_is_planned_on_with_its_effects(
    run: Run, ask: list[object], alone: Alone, cell: Path, tmp_path: Path
) -> None:
    cal = tmp_path / "cal.json"
    effects = ["--effects", "compliance,gain", "--model-error-mm", "0.000001"]
    assert run("identify", "--robot", IRB6660, cell / "one.csv", "-o", cal, *effects).status == 0
    on = ["plan", "--calibration", cal, *ask[3:]]
    result = run(*on, "--json").json
    assert (result["calibration"], result["measured_before"], result["count"]) == (str(cal), 60, 12)
    assert result["expected_error_mm"] < min(result["before_mm"], alone[0]["expected_error_mm"])
    people = run(*on, "--report", tmp_path / "plan.html")
    assert "calibration as it is" in people.out
    assert "added to 60" in people.out
    assert "calibration as it is" in (tmp_path / "plan.html").read_text(encoding="utf-8")
    poses = tmp_path / "poses.json"
    assert run("identify", "--robot", IRB6660, cell / "poses.csv", "-o", poses).status == 0
    refused = run("plan", "--calibration", poses, *ask[3:])
    assert (refused.status, refused.out) == (1, "")
    assert f"{poses}: a plan adds points to a calibration from points" in refused.err


def test_either_a_robot_or_a_calibration(run: Run, ask: list[object], cell: Path, tmp_path: Path) -> None:
    cal = ["--calibration", cell / "cal.json"]
    for wrong in (
        [*ask, *cal],
        ["plan", *ask[3:]],
        ["plan", *cal, *ask[3:], "--campaign", cell / "one.csv"],
        ["plan", *cal, *ask[3:], "--model-error-mm", "0.1"],
    ):
        ended = run(*wrong)
        assert (ended.status, ended.out) == (2, "")
        assert "--calibration" in ended.err
    over = run("plan", *cal, *ask[3:], "-o", cell / "cal.json")
    assert (over.status, over.out) == (1, "")
    assert "cal.json" in over.err
    assert run("plan", "--calibration", tmp_path / "nowhere.json", *ask[3:]).status == 1


def test_plan_optimises_another_criterion_if_asked(run: Run, ask: list[object], alone: Alone) -> None:
    result = run(*ask, "--criterion", "D", "--model-error-mm", "0.1", "--json").json
    assert (result["criterion"], result["model_error_mm"]) == ("D", pytest.approx(0.1))
    assert alone[0]["expected_error_mm"] < result["expected_error_mm"] < result["before_mm"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--campaign", "c.csv", "--model-error-mm", "0.1"], "--model-error-mm"),
        (["--model-error-mm", "nan"], "--model-error-mm"),
        (["--criterion", "Q"], "--criterion"),
        (["--candidates", "0"], "--candidates"),
        (["--count", "0"], "--count"),
        (["--observe", "socket", "--campaign", "c.csv"], "Invalid value for --campaign"),
        (["--observe", "socket", "--stations", "2"], "Invalid value for --stations"),
        (["--stations", "2", "--campaign", "c.csv"], "Invalid value for --stations"),
    ],
)
def test_wrong_usage(run: Run, ask: list[object], options: list[str], said: str) -> None:
    ended = run(*ask, *options)
    assert (ended.status, ended.out) == (2, "")
    assert said in ended.err


def test_plan_and_its_page_are_two_files(run: Run, ask: list[object], tmp_path: Path) -> None:
    assert run(*ask, "--report", tmp_path / "plan.csv").status == 2
    assert not (tmp_path / "plan.csv").exists()


@pytest.mark.parametrize(
    ("option", "change", "said"),
    [
        ("--task", ("1711.0", "8711.0"), "does not reach the tool pose at x 8711"),
        ("--task", ("position_mm = 0.1", "position_mm = 0.00001"), "accuracy of 1e-05 mm is out of reach"),
        ("--task", ("quaternion", "quarternion"), "orientation 1: 'quarternion' is not a known key; did you mean"),
        (
            "--robot",
            ("[-42.0, 85.0]", "[85.0, -42.0]"),
            "joint 2: the lower limit 85 must be below the upper limit -42",
        ),
        ("--robot", ("[-70.0, 70.0]", "[200.0, 210.0]"), "widen the limits in the robot file"),
    ],
)
def test_plan_refuses_tasks_and_limits_without_a_plan(
    run: Run, ask: list[object], cell: Path, tmp_path: Path, option: str, change: tuple[str, str], said: str
) -> None:
    """A task that no pose reaches, or limits that contradict each other or leave none: nothing is written."""
    catalogue = Path(taskcal.__file__).parent / "robot" / "catalogue"
    source = {"--task": cell / "task.toml", "--robot": catalogue / f"{IRB6660}.toml"}[option].read_text(
        encoding="utf-8"
    )
    assert change[0] in source
    (tmp_path / "bad.toml").write_text(source.replace(*change), encoding="utf-8")
    ended = run(*ask, option, tmp_path / "bad.toml", "--json")
    assert (ended.status, ended.out) == (1, "")
    assert said in ended.err
    assert not (tmp_path / "plan.csv").exists()


@pytest.mark.parametrize(
    ("station", "said"),
    [
        (STATION.replace("4500.0", "-45000.0"), "no reflector visible"),
        (STATION + KEEP_OUT, "in a keep-out box"),
        (STATION.replace("60.0\n", "600.0\n"), "reflector 1, acceptance_deg"),
        ("position_mm = [1.0, 2.0, 3.0]", "reflector: is missing"),
        ("position_mm = [1.0, ", "is not TOML"),
        (STATION.replace("smr2", "smr1"), "two reflectors are named 'smr1'"),
    ],
)
def test_stations_that_see_nothing_or_are_none(
    run: Run, ask: list[object], tmp_path: Path, station: str, said: str
) -> None:
    (tmp_path / "station.toml").write_text(station)
    ended = run(*ask, "--station", tmp_path / "station.toml", "--json")
    assert (ended.status, ended.out) == (1, "")
    assert said in ended.err


def test_numbers_of_poses_that_cannot_be_had(run: Run, ask: list[object]) -> None:
    few = run(*ask, "--count", "3")
    assert (few.status, few.out) == (1, "")
    assert "3 poses are too few: tracker frame and targets alone have 9 unknowns" in few.err
    many = run(*ask, "--count", "100", "--candidates", "50")
    assert (many.status, many.out) == (1, "")
    assert "100 were asked for" in many.err
    assert "--candidates" in many.err


def test_campaigns_that_cannot_be_extended(run: Run, ask: list[object], cell: Path, tmp_path: Path) -> None:
    poses = run(*ask, "--campaign", cell / "poses.csv")
    assert poses.status == 1
    assert f"{cell / 'poses.csv'}: a plan extends a campaign of points" in poses.err
    (tmp_path / "station.toml").write_text(STATION)
    other = run(*ask, "--campaign", cell / "one.csv", "--station", tmp_path / "station.toml")
    assert other.status == 1
    assert "smr1, smr2; name them alike" in other.err
    assert run(*ask, "--campaign", cell / "nowhere.csv").status == 1


def test_effects_are_planned_for_when_asked(run: Run, cell: Path, tmp_path: Path) -> None:
    common = ["--robot", IRB6660, "--task", cell / "list.toml", "--count", "20", "--candidates", "40", "--json"]
    common += ["--model-error-mm", "0.02"]
    plain = run("plan", *common, "-o", tmp_path / "plain.csv")
    more = run("plan", *common, "-o", tmp_path / "more.csv", "--effects", "compliance,gain")
    assert plain.status == more.status == 0
    # more to find out with as many poses, and more that may go wrong beforehand
    assert more.json["expected_error_mm"] > plain.json["expected_error_mm"]
    for arguments, words in (
        (["--robot", IRB6660, "--effects", "auto"], "list the effects"),
        (["--robot", IRB6660, "--effects", "slack"], "slack"),
        (["--calibration", cell / "cal.json", "--effects", "gain"], "the calibration has its own effects"),
    ):
        ended = run("plan", *arguments, "--task", cell / "list.toml", "-o", tmp_path / "no.csv")
        assert ended.status == 2
        assert words in ended.err
    assert not (tmp_path / "no.csv").exists()


CAMERA = """
[camera]
width = 1600
height = 1200
fx = 1450.0
[camera.focus]
nearest_mm = 300.0
farthest_mm = 900.0
"""
CHECKERS = '[[board]]\nkind = "checkerboard"\ncolumns = 9\nrows = 6\nsquare_mm = 25.0\n'


def test_poses_for_images_say_what_is_seen(run: Run, tmp_path: Path) -> None:
    (tmp_path / "camera.toml").write_text(CAMERA)
    (tmp_path / "board.toml").write_text(CHECKERS)
    (tmp_path / "where.csv").write_text("board,x_mm,y_mm,z_mm\nboard,1500,0,900\n")
    (tmp_path / "task.toml").write_text(BOX.replace("position_mm = 0.1", "position_mm = 5.0"))
    plan = ["plan", "--robot", IRB6660, "--task", tmp_path / "task.toml", "--observe", "pixels", "--count", "8"]
    files = ["--board", tmp_path / "board.toml", "--camera", tmp_path / "camera.toml"]
    made = ["--landmarks", tmp_path / "where.csv", "--candidates", "250", "-o", tmp_path / "plan.csv", "--json"]
    ended = run(*plan, *files, *made)
    assert ended.status == 0, ended.err
    said = json.loads(ended.out)
    assert (said["observe"], said["board"], said["poses_each"]) == ("pixels", ["board"] * 8, {"board": 8})
    assert said["views"]["corners"] == [40.0] * 8  # without markers a board is found as a whole
    assert 300.0 < min(said["views"]["distance_mm"]) <= max(said["views"]["distance_mm"]) < 1000.0
    assert max(said["views"]["tilt_deg"]) <= 60.0
    without = run(*plan, *made)
    assert (without.status, "give --board and --camera" in " ".join(without.err.split())) == (1, True), without.err
