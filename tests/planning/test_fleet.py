from dataclasses import replace

import numpy as np
import pytest

import taskcal as tc
from taskcal.errors import FileError, TaskcalError
from taskcal.identification.held_out import HeldOut
from taskcal.planning.fleet import MIN_CHANGE_SIGMA, date_of, find_fleet, identify_campaigns, review_fleet
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


def test_a_change_told_the_other_way_round_has_the_other_sign(fleet):
    """What has grown has shrunk where the earlier file is the later one: all of it, and nothing else."""
    forth = review_fleet(fleet).changes
    for robot in ("a", "b"):
        folder = fleet / robot
        (folder / "2026-03-01.json").rename(folder / "2027-01-01.json")
    for there, back in zip(forth, review_fleet(fleet).changes, strict=True):
        assert there["rms_mm"] == pytest.approx(back["rms_mm"], rel=1e-3)
        changed = [{one["name"]: one["over_sigma"] for one in way["parameters"]} for way in (there, back)]
        assert changed[0].keys() == changed[1].keys()
        for name, value in changed[0].items():
            assert changed[1][name] == pytest.approx(-value, rel=1e-3)
        pair = [tc.load_calibration(fleet / there["robot"] / f"{date}.json") for date in ("2027-01-01", "2026-09-01")]
        every = tc.compare(*pair).summary()["parameters"]
        assert set(changed[0]) == {one["name"] for one in every if one["over_sigma"] ** 2 >= MIN_CHANGE_SIGMA**2}
    assert any(change["parameters"] for change in forth)


def test_a_robot_s_row_states_what_its_calibration_does(fleet):
    """In millimetres; the uncertainty that of single poses, model error with it."""
    file = fleet / "a" / "2026-03-01.json"
    calibration = tc.load_calibration(file)
    variance = np.trace(calibration.predict_covariance(calibration.q)[:, 0, :3, :3], axis1=1, axis2=2)
    (row,) = [one for one in review_fleet(fleet).calibrations if one["file"] == "a/2026-03-01.json"]
    assert row["stated_mm"] == pytest.approx(1e3 * np.sqrt(variance.mean()), rel=1e-6)


@pytest.mark.parametrize(
    ("nominal", "predicted", "verdict"),
    [(5.0, 1.5, "good"), (5.0, 1.7, "too few rows"), (1.5, 1.5, "no better"), (1.4, 1.5, "no better")],
)
def test_held_out_rows_judge_a_calibration(fleet, nominal, predicted, verdict):
    """By their error over that of the fitted rows, and beside that of the nominal robot."""
    file = fleet / "a" / "2026-03-01.json"
    calibration = tc.load_calibration(file)
    rows = np.arange(len(calibration.q))
    off = np.nanmean(np.linalg.norm(calibration.residuals, axis=2)) * np.array([0.6, 0.0, -0.8])
    left, by_nominal = (np.tile(share * off, (len(rows), 1, 1)) for share in (predicted, nominal))
    held_out = HeldOut(
        by="rows",
        folds=2,
        rows=rows,
        part=rows % 2,
        residuals=left,
        nominal=by_nominal,
        kinds=calibration.layout.observed,
    )
    replace(calibration, held_out=held_out).save(file)
    (row,) = [one for one in review_fleet(fleet).calibrations if one["file"] == "a/2026-03-01.json"]
    assert row["verdict"] == verdict
    shares = [row[key] / row["fitted_mm"] for key in ("nominal_mm", "held_out_mm")]
    assert shares == pytest.approx([nominal, predicted])


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
        ("2026-03-01/2026-13-01.json", "2026-03-01"),
        ("serial-120260301.json", None),
        ("cal.json", None),
    ],
)
def test_a_date_is_read_from_a_name(name, date):
    assert date_of(name) == date
