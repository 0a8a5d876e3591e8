import numpy as np
import pytest

import taskcal as tc
from taskcal.errors import FileError, TaskcalError
from taskcal.planning.fleet import date_of, find_fleet, identify_campaigns, review_fleet
from tests.laws.fleets import MOVED_RAD, lay_calibrations, lay_campaigns, small_model


@pytest.fixture
def fleet(tmp_path):
    return lay_calibrations(tmp_path / "fleet")


def test_every_calibration_has_its_row_in_the_order_of_time(fleet):
    (fleet / "a" / "2026-09-01.json").rename(fleet / "a" / "0-20260901.json")  # the name's date counts, not the name
    table = review_fleet(fleet).calibrations
    assert [(row["robot"], row["date"]) for row in table] == [
        ("a", "2026-03-01"), ("a", "2026-09-01"), ("b", "2026-03-01"), ("b", "2026-09-01"), ("c", "2026-03-01"),
    ]  # fmt: skip
    first = tc.load_calibration(fleet / "a" / "2026-03-01.json")
    assert table[0]["rows"] == len(first.ids)
    assert table[0]["fitted_mm"] == pytest.approx(1e3 * np.linalg.norm(first.residuals, axis=2).mean())
    assert {row["verdict"] for row in table} == {"not checked"}


def test_fleet_flags_only_changed_robot_and_its_joint(fleet):
    """Only the robot with a moved joint has changed, and the change is attributed to that joint."""
    reviewed = review_fleet(fleet)
    verdicts = {change["robot"]: change["verdict"] for change in reviewed.changes}
    assert verdicts == {"a": "unchanged", "b": "changed"}
    (moved,) = [change for change in reviewed.changes if change["robot"] == "b"]
    assert moved["resembles"][0]["name"] == "J3.rz"
    assert moved["resembles"][0]["amount"] == pytest.approx(1e3 * MOVED_RAD, rel=0.1)
    pair = [tc.load_calibration(fleet / "b" / f"2026-0{month}-01.json") for month in (3, 9)]
    assert (moved["rms_mm"], moved["chance"]) == (1e3 * tc.compare(*pair).rms, tc.compare(*pair).chance)


def test_the_more_comparisons_the_smaller_a_chance_has_to_be(fleet):
    reviewed = review_fleet(fleet)
    assert reviewed.level == pytest.approx(0.01 / 2)


@pytest.mark.slow
def test_every_engine_says_the_same(fleet, monkeypatch):
    monkeypatch.setattr("taskcal.planning.fleet.MAX_SEQUENTIAL", 0)
    said = [review_fleet(fleet, engine=engine, workers=2).summary() for engine in ("sequential", "threading", "loky")]
    assert said[0] == said[1] == said[2]


def test_files_that_cannot_be_read_are_told_once_and_left_out(fleet):
    (fleet / "a" / "2026-05-01.json").write_text("{}")
    (fleet / "c" / "cut.json").write_text((fleet / "c" / "2026-03-01.json").read_text()[:1000])
    (fleet / "d.json").write_text("[]")
    (fleet / "c" / "photo.jpg").write_text("")
    (fleet / ".hidden.json").write_text("{}")
    (fleet / "c" / "new.csv").write_text("J1_deg\n")
    reviewed = review_fleet(fleet)
    assert [name for name, _ in reviewed.skipped] == ["a/2026-05-01.json", "c/cut.json", "d.json"]
    assert all(reason.startswith(name) for name, reason in reviewed.skipped)
    assert reviewed.robots == ("a", "b", "c")
    assert (reviewed.others, reviewed.unidentified) == (("c/photo.jpg",), ("c/new.csv",))
    assert any("3 of abb-irb120: too few" in remark for remark in reviewed.remarks)


def test_fleet_reports_robots_with_other_joints(fleet):
    """Robots with other joints are excluded from the comparison, with a message."""
    other = tc.ErrorModel(tc.load_robot("barrett-wam"))
    q = np.random.default_rng(0).uniform(*0.4 * other.robot.limits.T, size=(25, len(other.robot.limits)))
    campaign, _ = tc.simulate(other, q, rng=np.random.default_rng(1))
    tc.identify(other, campaign).save(fleet / "c" / "2026-10-01.json")
    reviewed = review_fleet(fleet)
    assert [change["robot"] for change in reviewed.changes] == ["a", "b"]
    assert any("c/2026-10-01.json was not compared with c/2026-03-01.json" in remark for remark in reviewed.remarks)


def test_a_file_in_the_folder_itself_is_a_robot(fleet):
    (fleet / "a" / "2026-03-01.json").rename(fleet / "solo.json")
    assert review_fleet(fleet).robots == ("a", "b", "c", "solo")


def test_what_holds_no_fleet_is_refused(tmp_path):
    with pytest.raises(FileError, match="is not a folder"):
        review_fleet(tmp_path / "none")
    with pytest.raises(TaskcalError, match="holds no calibration"):
        review_fleet(tmp_path)
    (tmp_path / "a.csv").write_text("")
    with pytest.raises(TaskcalError, match=r"holds 1 campaigns, such as a\.csv"):
        review_fleet(tmp_path)
    (tmp_path / "b.json").write_text("{}")
    with pytest.raises(TaskcalError, match="none of 1 files can be read"):
        review_fleet(tmp_path)


def test_fleet_identifies_each_campaign_once_or_states_why(tmp_path):
    """Campaigns are identified once, and each failed one states its cause."""
    folder = lay_campaigns(tmp_path)
    for name in ("b/2026-03-01.csv", "b/2026-09-01.csv", "c/2026-03-01.csv"):
        (folder / name).write_text("J1_deg,x_mm\n0,1\n")
    (folder / "c" / "2026-03-01.json").write_text("mine")
    done = {
        one.campaign: one for one in identify_campaigns(find_fleet(folder), small_model(), folds=2, engine="sequential")
    }
    assert sorted(done) == ["a/2026-03-01.csv", "a/2026-09-01.csv", "b/2026-03-01.csv", "b/2026-09-01.csv"]
    assert done["a/2026-03-01.csv"].refusal is None
    assert done["b/2026-03-01.csv"].refusal.startswith("b/2026-03-01.csv:1")
    assert (folder / "c" / "2026-03-01.json").read_text() == "mine"
    reviewed = review_fleet(folder)
    assert [(row["file"], row["verdict"] != "not checked") for row in reviewed.calibrations] == [
        ("a/2026-03-01.json", True), ("a/2026-09-01.json", True),
    ]  # fmt: skip
    again = identify_campaigns(find_fleet(folder), small_model(), engine="sequential")
    assert {one.campaign for one in again} == {"b/2026-03-01.csv", "b/2026-09-01.csv"}


@pytest.mark.parametrize(
    ("name", "date"),
    [
        ("a/2026-03-01.json", "2026-03-01"),
        ("2025-01-01/cal_20260301_v2.json", "2026-03-01"),
        ("2026.03.01/cal.json", "2026-03-01"),
        ("a/2026-13-01.json", None),
        ("serial-120260301.json", None),
        ("cal.json", None),
    ],
)
def test_a_date_is_read_from_a_name(name, date):
    assert date_of(name) == date
