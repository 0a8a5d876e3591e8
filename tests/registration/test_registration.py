import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.campaigns.campaign import Campaign, check_rows
from taskcal.errors import CampaignError, ReachError
from taskcal.observations import Point, Sockets
from taskcal.registration.registration import STRAIGHT_SHARE, register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task
from tests.laws.campaigns import measure
from tests.laws.observations import campaign_of
from tests.laws.robots import generators, industrial, industrial_positions

KINDS = {"one target": {}, "three targets": {"targets": 3}, "poses": {"pose": True}}


def angle(A, B):
    return np.linalg.norm(Rotation.from_matrix(A.T @ B).as_rotvec())


def arm(rng):
    return ErrorModel(robot_from(industrial(rng)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_registration_is_exact_without_noise(kind):
    """Without noise the true frames are recovered exactly, wherever the tracker is."""

    @settings(max_examples=25)
    @given(generators, st.sampled_from([0.0, 0.3]))
    def law(rng, lost):
        model = arm(rng)
        campaign, truth = measure(rng, model, industrial_positions(rng, 40), lost=lost, **KINDS[kind])
        found = register(model, campaign)
        assert found.rms < 1e-7
        assert angle(found.T_tracker_base[:3, :3], truth.T_tracker_base[:3, :3]) < 1e-7
        np.testing.assert_allclose(found.T_tracker_base[:3, 3], truth.T_tracker_base[:3, 3], atol=1e-6)
        np.testing.assert_allclose(found.T_tool_target, truth.T_tool_target, atol=1e-6)

    law()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_registration_shift_is_bounded_by_tool_defects(kind):
    """Small defects shift the registration by no more than they shift the tool."""

    @settings(max_examples=15)
    @given(generators)
    def law(rng):
        model = arm(rng)
        q = industrial_positions(rng, 60)
        x = rng.normal(size=len(model)) * model.tolerances
        campaign, truth = measure(rng, model, q, x, **KINDS[kind])
        found = register(model, campaign)
        moved = np.linalg.norm(model.poses(q, x)[:, :3, 3] - model.poses(q)[:, :3, 3], axis=1)
        assert found.rms <= 2.0 * np.sqrt((moved**2).mean()) + 1e-3
        assert angle(found.T_tracker_base[:3, :3], truth.T_tracker_base[:3, :3]) < 0.02

    law()


@settings(max_examples=10)
@given(generators)
def test_a_registration_with_known_defects_is_exact(rng):
    model = arm(rng)
    x = 5.0 * rng.normal(size=len(model)) * model.tolerances
    campaign, truth = measure(rng, model, industrial_positions(rng, 40), x)
    found = register(model, campaign, model.poses(campaign.q, x))
    assert found.rms < 1e-7
    np.testing.assert_allclose(found.T_tracker_base, truth.T_tracker_base, atol=1e-6)


@given(generators)
def test_the_registration_turns_with_the_tracker(rng):
    model = arm(rng)
    campaign, _ = measure(rng, model, industrial_positions(rng, 30), sigma=1e-3)
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    T[:3, 3] = rng.normal(size=3)
    moved = replace(campaign, points=campaign.points @ T[:3, :3].T + T[:3, 3])
    found, again = register(model, campaign), register(model, moved)
    np.testing.assert_allclose(again.T_tracker_base, T @ found.T_tracker_base, atol=1e-6)
    np.testing.assert_allclose(again.T_tool_target, found.T_tool_target, atol=1e-6)


def gantry():
    """Three slides at right angles: one orientation everywhere."""
    steps = [{"ry_deg": 90.0}], [{"rx_deg": -90.0}], [{"ry_deg": 90.0}]
    joints = [
        {"name": name, "type": "prismatic", "steps": step, "limits_mm": [-500.0, 500.0]}
        for name, step in zip("XYZ", steps, strict=True)
    ]
    model = ErrorModel(robot_from({"name": "gantry", "joint": joints, "tool": [{"tx_mm": 100.0}]}))
    assert np.linalg.matrix_rank(model.joint_jacobian(np.zeros((1, 3)))[0, :3]) == 3
    return model


@pytest.mark.parametrize("kind", ["one target", "poses"])
def test_target_stays_at_tcp_and_unlocated_in_one_orientation(kind):
    """In one orientation the target stays at the TCP and is marked as not located."""
    rng = np.random.default_rng(0)
    model = gantry()
    q = rng.uniform(-0.5, 0.5, (30, 3))
    campaign, truth = measure(rng, model, q, sigma=1e-4, rotation_sigma=1e-4, **KINDS[kind])
    found = register(model, campaign)
    assert found.located == (False,)
    assert found.rms < 3e-4
    assert angle(found.T_tracker_base[:3, :3], truth.T_tracker_base[:3, :3]) < 1e-3
    np.testing.assert_allclose(found.T_tool_target[0, :3, 3], 0.0, atol=1e-9)
    predicted = (found.T_tracker_base @ model.poses(q) @ found.T_tool_target[0])[:, :3, 3]
    np.testing.assert_allclose(predicted, campaign.points[:, 0], atol=1e-3)


def test_a_ball_in_sockets_in_one_orientation_is_not_located():
    """What the rows do not tell of a target is stated of it alone, whatever measured it; located is what all axes tell of."""
    model, rng = gantry(), np.random.default_rng(0)
    of = np.arange(18) % 3
    q = rng.uniform(-0.4, 0.4, (3, 3))[of] + 1e-5 * rng.normal(size=(18, 3))
    campaign = campaign_of(q, "ball", Sockets(sockets=("a", "b", "c"), of=of))
    found = register(model, campaign)
    assert found.located == (False,)
    np.testing.assert_allclose(found.unobservable, np.eye(3), atol=1e-9)
    assert replace(found, unobservable=np.diag([0.0, 0.0, 1.0])).located == (False,)
    tracked = replace(
        campaign,
        targets=("ball", "smr"),
        points=np.stack([np.zeros((18, 3)), model.poses(q)[:, :3, 3]], axis=1),
        observations=(*campaign.observations, Point()),
    )
    beside = register(model, tracked)
    assert beside.located == (False, False)
    np.testing.assert_allclose(beside.unobservable, np.eye(6), atol=1e-9)


def test_poses_rotated_about_one_axis_register_by_position():
    """Poses that rotate about one direction are registered by their positions."""
    rng = np.random.default_rng(1)
    scara = {
        "name": "scara",
        "joint": [
            {"name": "J1", "mdh": {"d_mm": 400.0}},
            {"name": "J2", "mdh": {"a_mm": 350.0}},
            {"name": "J3", "mdh": {"a_mm": 300.0}},
            {"name": "Z", "type": "prismatic", "limits_mm": [-200.0, 0.0]},
        ],
    }
    model = ErrorModel(robot_from(scara))
    q = np.c_[rng.uniform(-2, 2, (40, 3)), rng.uniform(-0.2, 0, 40)]
    campaign, truth = measure(rng, model, q, pose=True)
    found = register(model, campaign)
    assert found.rms < 1e-6
    ends = found.T_tracker_base @ model.poses(q) @ found.T_tool_target[0]
    np.testing.assert_allclose(ends, truth.T_tracker_base @ model.poses(q) @ truth.T_tool_target[0], atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_too_few_rows_are_counted_and_the_number_needed_is_said(kind):
    rng = np.random.default_rng(0)
    model = arm(rng)
    need = {"one target": 4, "three targets": 2, "poses": 3}[kind]
    campaign, _ = measure(rng, model, industrial_positions(rng, need - 1), **KINDS[kind])
    with pytest.raises(
        CampaignError, match=rf"too few: the tracker frame and . targets? alone .*; measure at least {need} poses"
    ):
        register(model, campaign)
    campaign, _ = measure(rng, model, industrial_positions(rng, need), **KINDS[kind])
    check_rows(campaign)


def test_a_target_never_seen_is_named_with_the_others():
    rng = np.random.default_rng(0)
    model = arm(rng)
    campaign, _ = measure(rng, model, industrial_positions(rng, 10), targets=3)
    campaign.points[:, 1] = np.nan
    with pytest.raises(CampaignError, match=r"target 'smr2' was never seen; leave it out: choose among smr1, smr3"):
        register(model, campaign)


def test_points_on_one_line_are_refused():
    slide = {"name": "J1", "type": "prismatic", "limits_mm": [0.0, 2000.0]}
    model = ErrorModel(robot_from({"name": "slide", "joint": [slide]}))
    q = np.linspace(0, 2, 20)[:, None]
    campaign = Campaign(ids=tuple(map(str, range(20))), q=q, targets=("tool",), points=q[:, :, None] * [1.0, 2.0, 0.5])
    with pytest.raises(CampaignError, match=r"within 0\.00 mm of one line, which does not fix the tracker frame"):
        register(model, campaign)


@pytest.mark.parametrize("rows", [12, 300])
def test_a_line_is_judged_by_its_width_however_many_the_rows(rows):
    """The root mean square distance across it, as the singular values of the points say, over the robot's reach."""
    rng = np.random.default_rng(3)
    model = ErrorModel(load_robot("ur5"))
    q = rng.uniform(-1.0, 1.0, (rows, 6))

    def along_a_line(width):
        points = rng.normal(size=(rows, 1, 3)) * np.array([0.3, width, 0.5 * width])
        campaign = Campaign(ids=tuple(map(str, range(rows))), q=q, targets=("tool",), points=points)
        return campaign, np.linalg.svd(points[:, 0] - points[:, 0].mean(axis=0))[1][1] / np.sqrt(rows)

    limit = STRAIGHT_SHARE * model.robot.reach
    narrow, width = along_a_line(0.6 * limit)
    with pytest.raises(CampaignError, match="does not fix the tracker frame") as caught:
        register(model, narrow)
    assert float(re.search(r"within ([\d.]+) mm of one line", str(caught.value))[1]) == pytest.approx(
        1e3 * width, abs=0.006
    )
    register(model, along_a_line(2.0 * limit)[0])


def test_joints_in_degrees_are_called_so():
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("ur5"))
    sound, _ = measure(rng, model, industrial_positions(rng, 10))
    with pytest.raises(
        ReachError, match=r"ur5: pose 0: J1 = .* these look like degrees: give radians, np\.radians\(q\)"
    ):
        register(model, replace(sound, q=np.degrees(sound.q)))


def test_targets_in_one_orientation_register_mutually():
    """Several targets in one orientation are located relative to each other."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = reach_task(model, reference_task(), 40).q
    offsets = {"a": np.array([0.1, 0.0, 0.05]), "b": np.array([-0.1, 0.08, 0.0]), "c": np.array([0.0, -0.08, 0.02])}
    campaign, _ = simulate(model, q, rng=np.random.default_rng(0), x=np.zeros(len(model)), targets=offsets)
    found = register(model, campaign)
    placed, true = found.T_tool_target[:, :3, 3], np.stack(list(offsets.values()))
    assert found.located == (False, False, False)
    np.testing.assert_allclose(placed - placed.mean(axis=0), true - true.mean(axis=0), atol=1e-4)
    np.testing.assert_allclose(placed.mean(axis=0), 0.0, atol=1e-9)
    assert found.rms < 1e-4


@given(generators)
def test_positions_in_metres_are_recognised(rng):
    model = arm(rng)
    campaign, _ = measure(rng, model, industrial_positions(rng, 30), sigma=1e-4)
    with pytest.raises(CampaignError, match="the positions may be in metres"):
        register(model, replace(campaign, points=campaign.points / 1000.0))
