"""A box that is moved and turned by hand is written as it is shown, and nothing else of its file changes."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taskcal.geometry import se3
from taskcal.task.task import load_task
from taskcal_studio.task_box import ToolRoom, box_of, save_box
from tests.laws.campaigns import random_pose
from tests.laws.robots import generators
from tests.task.task_files import BOX, CYLINDER, written


def test_a_box_that_was_not_touched_is_written_as_it_was(tmp_path: Path) -> None:
    path = written(tmp_path, BOX)
    box = box_of(load_task(path))
    assert box is not None
    assert (
        save_box(path, box).workspace.orientations[0].rotation.tolist()
        == box.workspace.orientations[0].rotation.tolist()
    )
    assert tomllib.loads(path.read_text()) == tomllib.loads(BOX)
    assert box_of(load_task(written(tmp_path, CYLINDER))) is None


@given(generators)
def test_what_is_shown_of_a_changed_box_is_what_its_file_says(tmp_path_factory, rng) -> None:
    path = written(tmp_path_factory.mktemp("box"), BOX)
    box = box_of(load_task(path))
    assert box is not None
    room = ToolRoom(angles=tuple(np.round(rng.uniform(-180, 180, 3), 3).tolist()), cone=12.5, spin=40.0)
    changed = replace(
        box,
        turn=np.round(rng.uniform(-80, 80, 3), 2),
        center=np.round(rng.uniform(-900, 900, 3), 1),
        rooms=(box.rooms[1], room),
    )
    saved = save_box(path, changed)
    at, shown = saved.workspace, changed.workspace
    np.testing.assert_allclose(at.sample(20), shown.sample(20), atol=1e-9)
    np.testing.assert_allclose(load_task(path).workspace.sample(20), shown.sample(20), atol=1e-9)
    np.testing.assert_array_equal(saved.turn, changed.turn)
    assert saved.rooms[0] == box.rooms[1]
    assert at.orientations[0].rotation.tolist() == box.workspace.orientations[1].rotation.tolist()  # the file's own
    content, before = tomllib.loads(path.read_text()), tomllib.loads(BOX)
    assert content["workspace"]["orientation"][0] == before["workspace"]["orientation"][1]
    assert {key: content[key] for key in ("name", "frames", "accuracy")} == {
        key: before[key] for key in ("name", "frames", "accuracy")
    }


@given(generators, st.integers(0, 2))
def test_task_box_follows_dragged_axis_handle_and_body(tmp_path_factory, rng, axis) -> None:
    """Dragging a handle rotates the box about its centre, and dragging the box moves it."""
    box = box_of(load_task(written(tmp_path_factory.mktemp("box"), BOX)))
    assert box is not None
    place = rng.uniform(-2, 2, 3)
    moved = box.moved_to(place)
    np.testing.assert_allclose(moved.T_base_box[:3, 3], place, atol=1e-4)
    target = place + random_pose(rng, 1)[:3, :3] @ np.array([0.3, 0.0, 0.0])
    turned = moved.turned_to(axis, target)
    T = turned.T_base_box
    direction = (target - T[:3, 3]) / np.linalg.norm(target - T[:3, 3])
    np.testing.assert_allclose(T[:3, axis], direction, atol=1e-3)
    shortest = np.arccos(np.clip(moved.T_base_box[:3, axis] @ direction, -1, 1))
    angle = np.linalg.norm(se3.log(moved.T_base_box[:3, :3].T @ T[:3, :3]))
    assert abs(angle - shortest) < 1e-3
    opposite = moved.turned_to(axis, 2.0 * place - target)
    np.testing.assert_allclose(opposite.T_base_box[:3, axis], -direction, atol=1e-3)
