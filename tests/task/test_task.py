"""Task files, the poses spread over a workspace, and those that the robot reaches."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from taskcal.errors import FileError, ReachError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_postures
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, load_task, reach_task
from taskcal_demo.procedure import reference_task
from tests.task.task_files import BOX, CYLINDER, written


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


def listed(T: np.ndarray, weights: np.ndarray | None = None) -> str:
    quaternion = np.array([se3.to_quaternion(R) for R in T[:, :3, :3]]).reshape(len(T), 4)
    table = np.concatenate([T[:, :3, 3] * 1e3, quaternion], axis=1)
    header = "x_mm,y_mm,z_mm,qx,qy,qz,qw"
    if weights is not None:
        header, table = header + ",weight", np.concatenate([table, weights[:, None]], axis=1)
    return "\n".join([header, *(",".join(f"{value:.12g}" for value in row) for row in table)]) + "\n"


def test_a_box_in_a_part_frame(tmp_path):
    task = load_task(written(tmp_path, BOX))
    assert (task.name, task.accuracy) == ("pocket", pytest.approx(1e-4))
    space = task.workspace
    np.testing.assert_allclose(space.T_base_frame[:3, 3], [1.6, 0.03, 1.4])
    np.testing.assert_allclose(space.T_base_frame[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-7)
    np.testing.assert_allclose(space.size, [0.5, 0.7, 0.3])
    first, second = space.orientations
    assert (first.cone, first.spin) == (pytest.approx(np.radians(20)), pytest.approx(np.pi))
    assert (second.cone, second.spin) == (0.0, 0.0)
    T = space.sample(200)
    inside = np.abs(T[:, :3, 3] - [1.6, 0.13, 1.45])  # the part's x axis is the base's y
    assert np.all(inside <= [0.35 + 1e-9, 0.25 + 1e-9, 0.15 + 1e-9])
    assert np.all(inside.max(axis=0) > [0.33, 0.23, 0.14])


def test_per_axis_accuracy_uses_smallest_as_3d_accuracy(tmp_path):
    """Per-axis accuracies are met by a 3D accuracy equal to the smallest of them."""
    text = BOX.replace("position_mm = 0.1", "per_axis_mm = [0.3, 0.2, 0.4]")
    assert load_task(written(tmp_path, text)).accuracy == pytest.approx(2e-4)


def test_a_cylinder_along_an_axis(tmp_path):
    space = load_task(written(tmp_path, CYLINDER)).workspace
    p = space.sample(3000)[:, :3, 3] - [1.7, 0.0, 1.4]
    axis = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    along = p @ axis
    radius = np.linalg.norm(p - along[:, None] * axis, axis=1)
    assert 0.149 < np.abs(along).max() <= 0.15 + 1e-9
    assert 0.198 < radius.max() <= 0.2 + 1e-9
    assert kstest((radius / 0.2) ** 2, "uniform").statistic < 0.02  # even over the disc
    assert space.orientations[0].spin == pytest.approx(np.radians(15))


@pytest.mark.parametrize(
    ("text", "old", "new", "said"),
    [
        (BOX, 'name = "pocket"', 'name = ""', r"name: is empty; write something"),
        (BOX, "[accuracy]\nposition_mm = 0.1", "[accuracy]\nposition_mm = 0.0", r"accuracy, position_mm: .*got 0\.0"),
        (BOX, "size_mm = [500.0, 700.0, 300.0]", "size_mm = [500.0, -7.0, 300.0]", r"size_mm 2: .*got -7\.0"),
        (BOX, "size_mm = [500.0, 700.0, 300.0]", "radius_mm = 5.0", r"workspace: a box has size_mm, and neither"),
        (BOX, 'shape = "box"', 'shape = "ball"', r"workspace, shape: .*'box' or 'cylinder'.*got 'ball'"),
        (BOX, 'shape = "box"', 'shape = "cylinder"', r"a cylinder has radius_mm and height_mm, and no size_mm"),
        (BOX, 'frame = "part"', 'frame = "fixture"', r"frame 'fixture' is not defined; known: base, part"),
        (BOX, "[0.0, 1.0, 0.0, 0.0]", "[0.0, 1.1, 0.0, 0.0]", r"orientation 2, quaternion: .*length 1\.1000; it must be 1"),
        (BOX, "[0.0, 1.0, 0.0, 0.0]", "[0.0, 0.0, 0.0, 0.0]", r"orientation 2, quaternion: .*length 0\.0000"),
        (BOX, "0.70710678, 0.70710678]", "0.5, 0.5]", r"frames, part, quaternion: .*length 0\.7071"),
        (BOX, "cone_deg = 20.0", "cone_deg = -1.0", r"orientation 1, cone_deg: .*got -1\.0"),
        (BOX, 'spin = "free"', 'spin = "loose"', r"orientation 1, spin: .*'fixed' or 'free'.*got 'loose'"),
        (BOX, "cone_deg", "cone_mm", r"orientation 1: 'cone_mm' is not a known key"),
        (BOX, "center_mm = [100.0, 0.0, 50.0]", "", r"workspace, center_mm: is missing"),
        (BOX, "100.0", "inf", r"center_mm 1: .*finite"),
        (BOX, 'name = "pocket"', 'name = "pocket"\npath = "a.csv"', r"exactly one of .*this one has workspace and path"),
        (CYLINDER, "axis = [1.0, 1.0, 0.0]", "axis = [0.0, 0.0, 0.0]", r"workspace, axis: has no direction; give"),
        (BOX, "[accuracy]\nposition_mm = 0.1", "[accuracy]", r"accuracy: give position_mm.*or per_axis_mm"),
        (BOX, "position_mm = 0.1", "position_mm = 0.1\nper_axis_mm = [0.1, 0.1, 0.1]", r"accuracy: give position_mm"),
        (BOX, "position_mm = 0.1", "per_axis_mm = [0.1, 0.0, 0.1]", r"accuracy, per_axis_mm 2: .*got 0\.0"),
        (CYLINDER, "height_mm = 300.0", "", r"a cylinder has radius_mm and height_mm"),
        (CYLINDER, "[[workspace.orientation]]", "[[workspace.orientations]]", r"workspace, orientation: is missing"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_place_and_value(tmp_path, text, old, new, said):
    assert old in text
    path = written(tmp_path, text.replace(old, new))
    with pytest.raises(FileError, match=said) as caught:
        load_task(path)
    assert str(caught.value).startswith(str(path))


def test_task_rejects_missing_definition_and_missing_file(tmp_path):
    """A task without a workspace, poses or a path and a missing file are rejected."""
    with pytest.raises(FileError, match="exactly one of workspace, poses, path; this one has none"):
        load_task(written(tmp_path, 'name = "empty"'))
    with pytest.raises(FileError, match="cannot be read"):
        load_task(tmp_path / "none.toml")
    with pytest.raises(FileError, match=r"none\.csv.*cannot be read"):
        load_task(written(tmp_path, 'name = "listed"\nposes = "none.csv"'))


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("x_mm,y_mm,z_mm,qx,qy,qz\n1,2,3,0,0,0\n", r"no column 'qw'"),
        ("x_mm,y_mm,z_mm,qx,qy,qz,qw\n", r"no poses below its header"),
        (
            "x_mm,y_mm,z_mm,qx,qy,qz,qw\n1,2,3,0,0,0,1\n1,2,3,1,1,0,0\n",
            r":3: column 'qx': the quaternion has length 1\.4142",
        ),
        ("x_mm,y_mm,z_mm,qx,qy,qz,qw\n1,b,3,0,0,0,1\n", r":2: column 'y_mm': 'b' is not a number; give"),
        (
            "x_mm,y_mm,z_mm,qx,qy,qz,qw,weight\n1,2,3,0,0,0,1,-2\n",
            r":2: column 'weight': -2 is not a weight; give zero",
        ),
        ("x_mm,y_mm,z_mm,qx,qy,qz,qw,weight\n1,2,3,0,0,0,1,0\n", r"all weights are zero; give"),
    ],
)
def test_pose_list_errors_name_line_and_column(tmp_path, table, said):
    """Errors in a list of poses name the line and the column."""
    written(tmp_path, table, "poses.csv")
    with pytest.raises(FileError, match=said) as caught:
        load_task(written(tmp_path, 'name = "listed"\nposes = "poses.csv"'))
    assert str(caught.value).startswith(str(tmp_path / "poses.csv"))


@pytest.mark.parametrize("named", ["../poses.csv", "{}/poses.csv", "link.csv", "link/poses.csv"])
@pytest.mark.parametrize("key", ["poses", "path"])
def test_task_reads_no_file_outside_its_folder(tmp_path, key, named):
    written(tmp_path, "a-secret-of-the-machine\n", "poses.csv")
    own = tmp_path / "own"
    own.mkdir()
    (own / "link.csv").symlink_to(tmp_path / "poses.csv")
    (own / "link").symlink_to(tmp_path)
    with pytest.raises(FileError, match="lies outside the task file's folder") as caught:
        load_task(written(own, f'name = "listed"\n{key} = "{named.format(tmp_path)}"'))
    assert "secret" not in str(caught.value)


def test_a_list_of_poses_with_weights(tmp_path, model):
    T, weights = reference_task(np.radians(20.0)).workspace.sample(6), np.array([1.0, 0.0, 2.0, 1.0, 3.0, 1.0])
    written(tmp_path, listed(T, weights), "poses.csv")
    task = load_task(written(tmp_path, 'name = "listed"\nposes = "poses.csv"'))
    np.testing.assert_allclose(task.poses, T, atol=1e-10)
    assert not task.path
    found = reach_task(model, task)
    np.testing.assert_allclose(found.weights, weights / 8.0)
    np.testing.assert_allclose(model.poses(found.q), T, atol=1e-8)


def test_sampled_poses_are_low_discrepancy():
    """Sampled poses are more uniform than random ones, and the seed determines them."""
    space = reference_task(np.radians(20.0)).workspace
    T = space.sample(1000)
    local = (T[:, :3, 3] - space.center) / space.size + 0.5
    for axis in range(3):
        assert kstest(local[:, axis], "uniform").statistic < 0.015  # by chance about 0.027
    cosine = (space.orientations[0].rotation.T @ T[:, :3, :3])[:, 2, 2]
    share = (1 - cosine) / (1 - np.cos(np.radians(20.0)))
    assert kstest(share, "uniform").statistic < 0.015  # even over the cap
    np.testing.assert_array_equal(space.sample(50, seed=3), space.sample(50, seed=3))
    assert np.abs(space.sample(50, seed=3) - space.sample(50, seed=4)).max() > 0.1


def test_what_the_robot_does_not_reach_is_reported(model):
    task = reference_task()
    wide = replace(task, workspace=replace(task.workspace, size=np.array([3.0, 0.7, 0.5])))
    found = reach_task(model, wide, 200)
    assert 0.2 < found.unreachable.mean() < 0.9
    assert len(found) == 200 - found.unreachable.sum()
    assert found.weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(found.T, wide.workspace.sample(200)[~found.unreachable])
    np.testing.assert_allclose(model.poses(found.q), found.T, atol=1e-8)
    assert model.robot.inside_limits(found.q).all()
    farther = np.linalg.norm(wide.workspace.sample(200)[:, :3, 3], axis=1) > model.robot.reach
    assert np.all(found.unreachable[farther])


def line(T: np.ndarray, direction: list[float], length: float, count: int) -> np.ndarray:
    out = np.tile(T, (count, 1, 1))
    out[:, :3, 3] += np.linspace(-0.5, 0.5, count)[:, None] * length * np.array(direction)
    return out


def test_a_path_is_run_through_in_order_without_jumps(tmp_path, model):
    T = line(reference_task().workspace.middle()[0], [0.0, 1.0, 0.0], 0.6, 61)
    written(tmp_path, listed(T), "path.csv")
    task = load_task(written(tmp_path, 'name = "edge"\npath = "path.csv"\n[accuracy]\nposition_mm = 0.2'))
    assert task.path
    found = reach_task(model, task)
    assert not found.unreachable.any()
    np.testing.assert_allclose(model.poses(found.q), T, atol=1e-8)
    assert np.abs(np.diff(found.q, axis=0)).max() < np.radians(5.0)


def test_a_path_on_which_a_joint_would_jump_is_refused(model):
    """The tool turns by 120° between two poses."""
    T = np.tile(reference_task().workspace.middle()[0], (4, 1, 1))
    T[2:, :3, :3] = T[2:, :3, :3] @ se3.exp(np.array([np.radians(120.0), 0.0, 0.0]))
    with pytest.raises(
        ReachError, match=r"leaves its branch at pose 2 \(x 1711\.0, y 30\.0, z 1489\.0 mm\).*give closer"
    ):
        reach_task(model, Task(name="turn", poses=T, path=True))
    finer = np.tile(T[0], (16, 1, 1))
    finer[:, :3, :3] = T[0, :3, :3] @ se3.exp(
        np.linspace(0, np.radians(120.0), 16)[:, None] * np.array([1.0, 0.0, 0.0])
    )
    assert len(reach_task(model, Task(name="turn", poses=finer, path=True))) == 16


def test_a_task_is_reached_in_the_branch_of_known_postures():
    """A pose has several postures; whichever of them was measured is the one that the task is reached in."""
    model = ErrorModel(load_robot("ur5"))
    T = model.nominal.poses(np.array([[0.3, -1.2, 1.5, -0.3, 1.2, 0.4]]))[0]
    postures = find_postures(model, T)
    assert len(postures) > 3
    for q in postures:
        away = np.array([q + 2.0, q])  # another one is farther off
        reached = reach_task(model, Task(name="one", poses=T[None]), known=away)
        np.testing.assert_allclose(reached.q[0], q, atol=1e-6)


def test_known_joints_are_taken_where_they_are_inside_the_limits(model):
    reached = reach_task(model, reference_task(), 10)
    q = reached.q.copy()
    q[3, 1] = np.radians(200.0)
    found = reach_task(model, Task(name="measured", poses=reached.T, joints=q))
    assert np.flatnonzero(found.unreachable).tolist() == [3]
    np.testing.assert_array_equal(found.q, np.delete(q, 3, axis=0))


def test_a_list_out_of_reach_is_refused(model):
    T = np.tile(np.eye(4), (3, 1, 1))
    T[:, 0, 3] = 9.0
    with pytest.raises(ReachError, match="does not reach the tool pose"):
        reach_task(model, Task(name="far", poses=T))
    q = np.full((2, 6), 4.0)
    with pytest.raises(ReachError, match=r"reaches none of the 2 poses of task 'measured'.*move"):
        reach_task(model, Task(name="measured", poses=T[:2], joints=q))


def test_lengths_in_metres_are_refused_and_said(model, tmp_path):
    text = BOX.replace("[100.0, 0.0, 50.0]", "[0.1, 0.0, 0.05]").replace("[500.0, 700.0, 300.0]", "[0.5, 0.7, 0.3]")
    text = text.replace("[1600.0, 30.0, 1400.0]", "[1.6, 0.03, 1.4]")
    with pytest.raises(
        ReachError, match=r"task 'pocket' lies within 2\.\d mm .* seem to be in metres; write them in millimetres"
    ):
        reach_task(model, load_task(written(tmp_path, text)))
    T = reference_task().workspace.sample(5)
    T[:, :3, 3] *= 1e-3
    with pytest.raises(ReachError, match="in metres"):
        reach_task(model, Task(name="list", poses=T))


@pytest.mark.parametrize("name", ["abb-irb6660-205-1.9", "meca500-r3"])
def test_a_task_at_the_base_is_one_within_a_hundredth_of_the_reach(name):
    """Of a large robot and of a small one: what lies farther off may be out of reach, but is no mistake of units."""
    model = ErrorModel(load_robot(name))

    def refused(share: float) -> str:
        T = np.tile(np.eye(4), (3, 1, 1))
        T[:, 0, 3] = share * model.robot.reach * np.array([1.0, 0.3, -0.5])
        with pytest.raises(ReachError) as caught:
            reach_task(model, Task(name="list", poses=T))
        return str(caught.value)

    assert "write them in millimetres" in refused(0.0099)
    assert "millimetres" not in refused(0.0101)
