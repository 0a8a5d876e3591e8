"""The doctor accuses no campaign in which nothing is wrong, and mends none."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.diagnose import diagnose
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.diagnosis.virtual_campaigns import HEALTHY, healthy, task_poses, virtual

ACCUSED = 0.02
"""Share of healthy campaigns, at most, in which a mistake is found."""


@pytest.mark.long
def test_hardly_a_healthy_campaign_is_accused():
    accused = [
        (name, seed, found.findings[0].id)
        for name in HEALTHY
        for seed in range(20)
        if (found := diagnose(healthy(name, seed), load_robot(name))).findings
    ]
    assert len(accused) <= ACCUSED * 20 * len(HEALTHY), accused


@pytest.mark.parametrize("name", HEALTHY[::3])
def test_poses_over_the_task_that_the_robot_has_are_right_for_it(name):
    found = diagnose(healthy(name, 0), load_robot(name))
    assert (found.findings, found.held_out) == ((), None)


@pytest.mark.parametrize("seed", [1, pytest.param(7, marks=pytest.mark.long)])
def test_what_the_geometry_explains_as_well_is_no_mistake(seed):
    """The target is on the last axis of this arm, whose sign changes nothing but the sign of errors within the tolerances."""
    robot = load_robot("motoman-sia20d")
    campaign = simulate(ErrorModel(robot), task_poses(robot.name, 60, seed), rng=np.random.default_rng(seed))[0]
    found = diagnose(campaign, robot)
    assert found.findings == ()
    assert found.campaign is campaign


@pytest.mark.parametrize("name", ["ur5e", pytest.param("franka-panda", marks=pytest.mark.long)])
def test_what_is_mended_predicts_rows_held_out_better(name):
    robot, sound = load_robot(name), virtual(name)
    signs = np.where(np.arange(sound.q.shape[1]) == 2, -1.0, 1.0)
    found = diagnose(replace(sound, q=sound.q * signs), robot)
    (first,) = found.mends
    assert (first.id, first.subject) == ("joint-sign", (robot.joint_names[2],))
    before, after = found.held_out
    assert after < 2e-3 < 0.05 * before


def two_robots(name: str, seed: int, *, apart: bool, rows: int = 40) -> Campaign:
    """The first rows of one robot, the others of another of its kind, on the same foot or from another place of the tracker."""
    model, rng = ErrorModel(load_robot(name)), np.random.default_rng(seed)
    q = virtual(name, seed, rows=rows).q
    frames = [se3.pose(se3.exp(rng.normal(size=3)), rng.normal(size=3)) for _ in range(2)]
    first, second = (
        simulate(model, q, rng=rng, targets={"a": np.full(3, 0.05)}, model_error=3e-5, T_tracker_base=frames[k])[0]
        for k in (0, int(apart))
    )
    late = np.arange(rows) >= rows // 2
    return replace(first, points=np.where(late[:, None, None], second.points, first.points))


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("name", ["ur5e", *(pytest.param(n, marks=pytest.mark.long) for n in HEALTHY[1:4])])
def test_rows_of_two_robots_are_parted_where_the_second_begins(name, apart):
    found = diagnose(two_robots(name, 3, apart=apart), load_robot(name))
    assert [(one.id, one.subject) for one in found.findings] == [("two-robots", ("20",))]
    assert found.findings[0].fix.endswith("--rows 0:20 and --rows 20:40")
    assert found.mends == ()


@pytest.mark.parametrize("name", ["ur5e", *(pytest.param(n, marks=pytest.mark.long) for n in HEALTHY[1:])])
def test_positions_of_the_controller_are_named_and_those_measured_in_its_base_are_not(name):
    robot, rng = load_robot(name), np.random.default_rng(2)
    model, q = ErrorModel(robot), virtual(name, 2).q
    measured = simulate(model, q, rng=rng, T_tracker_base=np.eye(4), model_error=5e-5)[0]
    shown = model.poses(q)[:, None, :3, 3] + rng.normal(scale=5e-5, size=measured.points.shape)
    assert [one.id for one in diagnose(replace(measured, points=shown), robot).findings] == ["calculated-points"]
    assert diagnose(measured, robot).findings == ()
