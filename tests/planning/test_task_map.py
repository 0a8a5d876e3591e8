"""Maps over a workspace against the same values computed point by point, and the coverage of the tool's uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.planning.expected_error import design
from taskcal.planning.task_map import map_expected, map_sensitivity, map_tolerance, map_uncertainty, slice_workspace
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


@pytest.fixture(scope="module")
def slices(model):
    """Of a workspace so wide that the robot does not reach all of it."""
    task = reference_task()
    wide = replace(task, workspace=replace(task.workspace, size=np.array([2.6, 0.7, 0.5])))
    return slice_workspace(model, wide, 7)


@pytest.fixture(scope="module")
def measured(model):
    q = reach_task(model, reference_task(np.radians(20.0)), 30).q
    return simulate(model, q, rng=np.random.default_rng(1))


def points(at):
    """Row, column and joints of every reached point."""
    return [(i, j, at.q[i, j][None]) for i, j in zip(*np.nonzero(at.reached), strict=True)]


def test_slices_are_planes_through_the_middle(model, slices):
    assert [at.plane for at in slices] == ["xy", "xz", "yz"]
    center, R = reference_task().workspace.center, reference_task().workspace.orientations[0].rotation
    for at in slices:
        axes = ["xyz".index(letter) for letter in at.plane]
        for i, j, q in points(at):
            expected = center.copy()
            expected[axes] += at.u[j], at.v[i]
            T = model.poses(q)[0]
            np.testing.assert_allclose(T[:3, 3], expected, atol=1e-8)
            np.testing.assert_allclose(T[:3, :3], R, atol=1e-8)
    assert slices[2].reached.all()  # the middle plane is narrow enough
    assert 0.2 < slices[0].reached.mean() < 0.9


def test_a_cylinder_is_cut_to_its_shape(model):
    task = reference_task()
    ring = replace(task, workspace=replace(task.workspace, shape="cylinder", size=np.array([0.4, 0.4, 0.3])))
    across, along, _ = slice_workspace(model, ring, 9)
    radius = np.hypot(across.u[None], across.v[:, None])
    np.testing.assert_array_equal(across.reached, radius <= 0.2 + 1e-9)
    assert along.reached.all()


def test_maps_hold_nothing_where_the_robot_does_not_get_to(model, slices, measured):
    calibration = identify(model, measured[0])
    made = design(model, measured[0], reach_task(model, reference_task(), 30))
    at = slices[0]
    for one in (map_tolerance(model, at), map_expected(made, at), map_uncertainty(calibration, at)):
        np.testing.assert_array_equal(np.isnan(one), ~at.reached)
    each = map_sensitivity(model, at)
    assert each.shape == (len(model), 7, 7)
    np.testing.assert_array_equal(np.isnan(each), np.broadcast_to(~at.reached, each.shape))


def test_task_sensitivities_are_small_tcp_displacements(model, slices):
    """A tolerance's effect is how far the point moves with it; all together add in squares."""
    at = slices[1]
    each, together = map_sensitivity(model, at), map_tolerance(model, at)
    for i, j, q in points(at)[::5]:
        moved = []
        for k, tolerance in enumerate(model.tolerances):
            x = np.zeros(len(model))
            x[k] = 0.01 * tolerance
            moved.append(100 * np.linalg.norm((model.poses(q, x) - model.poses(q, -x))[0, :3, 3]) / 2)
        np.testing.assert_allclose(each[:, i, j], moved, rtol=1e-5, atol=1e-12)
        assert together[i, j] == pytest.approx(np.linalg.norm(moved), rel=1e-6)


def test_the_map_of_expected_errors_is_that_of_tasks_of_one_pose(model, slices, measured):
    at, kept = slices[2], np.arange(0, len(model), 2)
    goal = reach_task(model, reference_task(), 30)
    made = design(model, measured[0], goal)
    nominal, identified = map_expected(made, at), map_expected(made, at, kept)
    for i, j, q in points(at)[::7]:
        one = replace(goal, T=model.poses(q), q=q, weights=np.ones(1), unreachable=np.zeros(1, dtype=bool))
        alone = design(model, measured[0], one)
        assert identified[i, j] == pytest.approx(alone.expected_error(kept), rel=1e-6)
        assert nominal[i, j] == pytest.approx(alone.before, rel=1e-6)
    assert np.all(identified < nominal)


def test_the_map_of_uncertainty_is_the_tools_covariance(model, slices, measured):
    calibration = identify(model, measured[0])
    at = slices[2]
    found = map_uncertainty(calibration, at)
    for i, j, q in points(at)[::6]:
        assert found[i, j] == pytest.approx(np.sqrt(np.trace(calibration.tool_covariance(q)[0, :3, :3])), rel=1e-9)


@pytest.mark.parametrize("pose", [False, True])
def test_tool_covariance_propagates_estimate_covariance(model, pose):
    """Differences of the predicted tool pose in every entry of the estimate."""
    q = reach_task(model, reference_task(np.radians(20.0)), 30).q
    campaign, _ = simulate(
        model, q, rng=np.random.default_rng(1), pose=pose, targets={"smr": np.array([0.1, 0.0, 0.05])}
    )
    calibration = identify(model, campaign)
    layout, z = calibration.layout, calibration.z

    def tool(z):
        return layout.frames(z)[0] @ model.poses(q[:4], layout.parameters(z))

    np.testing.assert_allclose(calibration.predict_tool(q[:4]), tool(z), atol=1e-12)
    J, h = np.zeros((4, 6, len(z))), 1e-6
    for k in range(len(z)):
        step = np.zeros(len(z))
        step[k] = h
        high, low = tool(z + step), tool(z - step)
        J[:, :3, k] = (high - low)[:, :3, 3] / (2 * h)
        J[:, 3:, k] = se3.log(high[:, :3, :3] @ np.swapaxes(low[:, :3, :3], 1, 2)) / (2 * h)
    expected = J @ calibration.z_covariance @ np.swapaxes(J, 1, 2)
    scale = np.sqrt(np.einsum("nii->ni", expected))
    np.testing.assert_allclose(calibration.tool_covariance(q[:4]) / scale[:, None] / scale[:, :, None],
                               expected / scale[:, None] / scale[:, :, None], atol=1e-4)  # fmt: skip


def test_a_list_of_poses_has_no_slices(model):
    with pytest.raises(ReachError, match="task 'listed' is a list of poses, which has no slices"):
        slice_workspace(model, Task(name="listed", poses=np.eye(4)[None]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pose", "spread_deg", "robots"),
    [
        (False, 0.0, 50),
        *(
            pytest.param(pose, spread, 200, marks=pytest.mark.long)
            for pose, spread in ((False, 0.0), (False, 20.0), (True, 20.0))
        ),
    ],
)
def test_tool_interval_coverage_is_nominal(model, pose, spread_deg, robots):
    """Tool positions, and rotations where poses were measured, at task poses in the tracker frame: 95 % intervals."""
    q = reach_task(model, reference_task(np.radians(spread_deg)), 40).q
    task = reach_task(model, reference_task(np.radians(spread_deg)), 20, 5).q
    known = {} if spread_deg else {"target_within": 1e-6}  # one orientation does not locate it
    inside = []
    for seed in range(robots):
        campaign, truth = simulate(model, q, rng=np.random.default_rng(seed), pose=pose)
        calibration = identify(model, campaign, gross_errors="keep", **known)
        found, true = calibration.predict_tool(task), truth.T_tracker_base @ model.poses(task, truth.x)
        deviation = np.sqrt(np.einsum("nii->ni", calibration.tool_covariance(task)))
        turned = se3.log(true[:, :3, :3] @ np.swapaxes(found[:, :3, :3], 1, 2))
        error = np.concatenate([true[:, :3, 3] - found[:, :3, 3], turned], axis=1)
        inside.append((np.abs(error) < 1.959964 * deviation).mean(axis=0))
    coverage = np.mean(inside, axis=0)
    position, rotation = coverage[:3].mean(), coverage[3:].mean()
    assert 0.93 < position < 0.97, coverage
    if pose:
        assert 0.93 < rotation < 0.97, coverage
