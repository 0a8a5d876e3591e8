"""Poses spread over a workspace."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.geometry.euler import AngleForm, to_angles
from taskcal.task.task import load_task
from taskcal.task.workspace import Orientation, Workspace
from tests.laws.campaigns import random_pose
from tests.laws.robots import generators
from tests.task.task_files import BOX, CYLINDER, written

rooms = st.tuples(st.floats(0, np.pi), st.sampled_from([0.0, 0.3, np.pi]))


@given(generators, rooms, st.sampled_from(["box", "cylinder"]))
def test_sampled_poses_are_inside_shape_cone_and_spin(rng, room, shape):
    cone, spin = room
    size = rng.uniform(0.1, 1.0, 3)
    if shape == "cylinder":
        size[1] = size[0]
    orientations = tuple(Orientation(rotation=random_pose(rng, 1)[:3, :3], cone=cone, spin=spin) for _ in range(2))
    space = Workspace(
        T_base_frame=random_pose(rng, 2), shape=shape, center=rng.uniform(-1, 1, 3), size=size,
        turned=random_pose(rng, 1)[:3, :3], orientations=orientations,
    )  # fmt: skip
    T = se3.inverse(space.T_base_frame) @ space.sample(60, seed=int(rng.integers(100)))
    local = (T[:, :3, 3] - space.center) @ space.turned
    assert np.all(np.abs(local) <= 0.5 * size + 1e-12)
    if shape == "cylinder":
        assert np.all(np.hypot(local[:, 0], local[:, 1]) <= 0.5 * size[0] + 1e-12)
    for k, orientation in enumerate(orientations):
        relative = orientation.rotation.T @ T[k::2, :3, :3]
        tilt = np.arccos(np.clip(relative[:, 2, 2], -1, 1))
        assert np.all(tilt <= cone + 1e-7)
        if cone < 1e-3:  # without tilt the rest is the spin
            turned = np.arctan2(relative[:, 1, 0], relative[:, 0, 0])
            assert np.all(np.abs(turned) <= spin + cone + 1e-7)


def test_orientations_take_turns(tmp_path):
    space = load_task(written(tmp_path, BOX)).workspace
    T = space.sample(7)
    down = space.T_base_frame[:3, :3] @ space.orientations[1].rotation
    np.testing.assert_allclose(T[1::2, :3, :3], np.tile(down, (3, 1, 1)), atol=1e-12)


@given(generators, st.sampled_from(["box", "cylinder"]))
def test_workspace_contains_own_samples_but_no_outside_pose(rng, shape):
    """A workspace contains its own samples and none moved out of it."""
    size = rng.uniform(0.1, 1.0, 3)
    if shape == "cylinder":
        size[1] = size[0]
    room = Orientation(rotation=random_pose(rng, 1)[:3, :3], cone=rng.uniform(0, 1), spin=rng.uniform(0, 1))
    space = Workspace(
        T_base_frame=random_pose(rng, 2), shape=shape, center=rng.uniform(-1, 1, 3), size=size,
        turned=random_pose(rng, 1)[:3, :3], orientations=(room,),
    )  # fmt: skip
    T = space.sample(40)
    assert space.contains(T).all()
    out = T.copy()
    axis = space.T_base_frame[:3, :3] @ space.turned[:, int(rng.integers(3))]
    out[:, :3, 3] += 1.01 * size.max() * axis
    assert not space.contains(out).any()
    tilted = T.copy()
    tilted[:, :3, :3] = T[:, :3, :3] @ se3.exp(np.array([2.0 * room.cone + 0.01, 0.0, 0.0]))
    assert not space.contains(tilted).any()
    spun = space.middle().copy()
    spun[:, :3, :3] = spun[:, :3, :3] @ se3.exp(np.array([0.0, 0.0, room.spin + 0.01]))
    assert not space.contains(spun).any()
    assert space.contains(space.middle()).all()


@given(generators, st.sampled_from(["quaternion", "rpy", "abc", "wpr"]))
def test_rotated_box_samples_are_rotated_about_its_centre(tmp_path_factory, rng, form):
    """The samples of a rotated box are those of the straight box, rotated about its centre."""
    turned = random_pose(rng, 1)[:3, :3]
    told = f"quaternion = {se3.to_quaternion(turned).tolist()}"
    if form != "quaternion":
        way: AngleForm = form
        told = f"{form}_deg = {np.degrees(to_angles(way, turned)).tolist()}"
    folder = tmp_path_factory.mktemp("task")
    straight = load_task(written(folder, BOX)).workspace
    space = load_task(written(folder, BOX.replace('shape = "box"', f'shape = "box"\n{told}'))).workspace
    np.testing.assert_allclose(space.turned, turned, atol=1e-12)
    T, T_straight = (se3.inverse(w.T_base_frame) @ w.sample(50) for w in (space, straight))
    np.testing.assert_allclose(T[:, :3, 3] - space.center, (T_straight[:, :3, 3] - space.center) @ turned.T, atol=1e-12)
    np.testing.assert_allclose(T[:, :3, :3], T_straight[:, :3, :3], atol=1e-12)  # the tool does not turn with the box
    assert space.contains(space.sample(50)).all()
    corner = space.middle()[:1].copy()
    corner[0, :3, 3] += space.T_base_frame[:3, :3] @ turned @ (0.499 * space.size)
    assert space.contains(corner).all()
    corner[0, :3, 3] += space.T_base_frame[:3, :3] @ turned[:, 0] * 0.01
    assert not space.contains(corner).any()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            CYLINDER.replace("axis = [1.0, 1.0, 0.0]", "rpy_deg = [0.0, 90.0, 0.0]"),
            "give axis in place of the rotation",
        ),
        (BOX.replace('shape = "box"', "axis = [1.0, 0.0, 0.0]"), "a box has no axis"),
        (
            BOX.replace('shape = "box"', "rpy_deg = [0.0, 0.0, 1.0]\nquaternion = [0.0, 0.0, 0.0, 1.0]"),
            "keep one of them",
        ),
    ],
)
def test_workspace_rejects_repeated_or_malformed_rotation(tmp_path, text, message):
    """A rotation that is stated twice or has the wrong shape is rejected."""
    with pytest.raises(FileError, match=message):
        load_task(written(tmp_path, text))
