"""Held-out errors on real robots, with generic bounds a little above what a full geometric fit reaches."""

from collections.abc import Iterator

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.planning.plan import plan
from taskcal.reading.reader import read_campaign
from taskcal.registration.registration import register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.dh import read_dh_table
from taskcal.robot.robot import Robot
from taskcal.task.task import Task
from tests.laws.plain import product, shift, turn

pytestmark = pytest.mark.realdata

TABLES = {
    "ur5": ("ur5_tracker", "dh"),
    "ur10": ("ur10_tmac", "dh"),
    "barrett-wam": ("wam_tracker", "dh"),
    "abb-irb120": ("irb120_faro", "mdh"),
    "fanuc-r2000ic-165f": ("fanuc_r2000_tracker", "mdh"),
}


def robot_of(data_folder, name: str, source: str) -> Robot:
    folder, convention = TABLES[name]
    return (
        load_robot(name)
        if source == "catalogue"
        else read_dh_table(data_folder / folder / f"nominal_{convention}.csv", convention)
    )


def campaign_of(data_folder, name: str, robot: Robot, **options) -> Campaign:
    return read_campaign(data_folder / TABLES[name][0] / "measurements.csv", robot, **options)


@pytest.mark.parametrize("name", TABLES)
def test_a_robots_table_and_catalogue_and_plain_product_are_one(data_folder, name):
    table, catalogued = (robot_of(data_folder, name, source) for source in ("table", "catalogue"))
    folder, convention = TABLES[name]
    lines = (data_folder / folder / f"nominal_{convention}.csv").read_text(encoding="utf-8-sig").splitlines()
    header = lines[0].split(",")
    rows = [dict(zip(header, line.split(","), strict=True)) for line in lines[1:] if line.strip()]
    q = np.random.default_rng(0).uniform(-1.2, 1.2, (20, len(rows)))

    def pose(joints):
        by_name = {f"J{i + 1}": value for i, value in enumerate(joints)}
        T = np.eye(4)
        for i, row in enumerate(rows):
            theta = eval(row.get("theta_from_controller") or f"J{i + 1}", {}, by_name) + np.radians(
                float(row["theta_offset_deg"])
            )
            alpha, a, d = (
                turn(0, np.radians(float(row["alpha_deg"]))),
                shift(0, float(row["a_mm"]) / 1e3),
                shift(2, float(row["d_mm"]) / 1e3),
            )
            T = T @ product([turn(2, theta), d, a, alpha] if convention == "dh" else [alpha, a, turn(2, theta), d])
        return T

    expected = [pose(row) for row in q]
    np.testing.assert_allclose(ErrorModel(table).poses(q), expected, atol=1e-12)
    np.testing.assert_allclose(ErrorModel(catalogued).poses(q), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "worst_mm"),
    {"ur5": 1.2, "ur10": 2.0, "barrett-wam": 8.0, "abb-irb120": 1.5, "fanuc-r2000ic-165f": 1.5}.items(),
)
def test_catalogue_model_registers_to_campaign(data_folder, name, worst_mm):
    """The nominal model of the catalogue registers to the campaign of the robot."""
    robot = robot_of(data_folder, name, "catalogue")
    found = register(ErrorModel(robot), campaign_of(data_folder, name, robot))
    assert found.rms * 1e3 < worst_mm


def splits(campaign: Campaign, count: int) -> Iterator[tuple[Campaign, Campaign]]:
    """Ten random choices of rows to fit, and the rest."""
    for seed in range(10):
        order = np.random.default_rng(seed).permutation(len(campaign))
        yield campaign.take(order[:count]), campaign.take(order[count:])


def held_out_mm(model: ErrorModel, campaign: Campaign, count: int) -> float:
    """Median over the splits of the mean error on rows not used for the fit."""
    means = [validate(identify(model, fitted), held).mean * 1e3 for fitted, held in splits(campaign, count)]
    return float(np.median(means))


BOUNDS = {
    "ur5, 60 rows": ("ur5", {}, 60, 0.115),
    "ur5, 700 rows": ("ur5", {}, 700, 0.106),
    "irb120, one reflector, 60 rows": ("abb-irb120", {"targets": ["smr1"]}, 60, 0.48),
    "ur10, 70 %": ("ur10", {}, 0.7, 0.41),
    "wam, 70 %": ("barrett-wam", {}, 0.7, 2.6),
}


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=[pytest.mark.long] if case.startswith("ur10") else []) for case in BOUNDS]
)
def test_geometry_predicts_held_out_rows_within_bound(data_folder, case):
    """Held-out rows are predicted as accurately as a full geometric fit allows."""
    name, options, count, bound_mm = BOUNDS[case]
    robot = robot_of(data_folder, name, "catalogue")
    campaign = campaign_of(data_folder, name, robot, **options)
    rows = count if isinstance(count, int) else round(count * len(campaign))
    assert held_out_mm(ErrorModel(robot), campaign, rows) <= bound_mm


def test_geometry_predicts_each_fanuc_pose_leave_one_out(data_folder):
    """Each pose of the robot with coupled axes is predicted from all other poses."""
    robot = robot_of(data_folder, "fanuc-r2000ic-165f", "catalogue")
    model, campaign = ErrorModel(robot), campaign_of(data_folder, "fanuc-r2000ic-165f", robot)
    errors = []
    for i in range(len(campaign)):
        others = campaign.take(np.arange(len(campaign)) != i)
        errors.append(validate(identify(model, others), campaign.take([i])).errors)
    assert np.concatenate(errors).mean() * 1e3 <= 0.345


def test_reference_points_and_lost_beams_are_told_from_targets(data_folder):
    robot = load_robot("abb-irb120")
    campaign = campaign_of(data_folder, "abb-irb120", robot)
    assert campaign.targets == ("smr1", "smr2", "smr3")
    assert set(campaign.reference_points) == {"base1", "base2", "base3"}
    assert len(campaign) == 620
    assert not all(np.isfinite(points).all() for points in campaign.reference_points.values())
    for points in campaign.reference_points.values():
        drift = np.linalg.norm(points - np.nanmedian(points, axis=0), axis=1)
        assert np.nanpercentile(drift, 90) < 1e-3


@pytest.mark.long
@pytest.mark.parametrize("name", TABLES)
def test_identify_leaves_no_row_of_a_measured_robot_out(data_folder, name):
    robot = robot_of(data_folder, name, "catalogue")
    assert identify(ErrorModel(robot), campaign_of(data_folder, name, robot)).left_out == ()


@pytest.mark.long
def test_rows_by_expected_error_beat_random_rows(data_folder):
    """60 of 700 rows of a real robot, whose model error is smooth over the joints; judged on the other 300."""
    model = ErrorModel(load_robot("ur5"))
    campaign = campaign_of(data_folder, "ur5", model.robot)
    means = []
    for seed in range(8):
        order = np.random.default_rng(seed).permutation(1000)
        fitted, rest = campaign.take(order[:700]), campaign.take(order[700:])
        task = Task(name="held out", poses=model.poses(rest.q), joints=rest.q)
        chosen = plan(model, task, 60, candidates=fitted.q, registration=register(model, fitted), model_error=6e-5).rows
        rng = np.random.default_rng(100 + seed)
        draws = [list(chosen)] + [rng.permutation(700)[:60] for _ in range(20)]
        means.append([validate(identify(model, fitted.take(rows)), rest).mean * 1e3 for rows in draws])
    own, random = np.array(means)[:, 0], np.array(means)[:, 1:]
    better = own < np.median(random, axis=1)
    quantiles = np.percentile(random, [0, 25, 50, 75, 100], axis=1).T.round(4)
    assert better.sum() >= 7, dict(zip(own.round(4).tolist(), quantiles.tolist(), strict=True))
