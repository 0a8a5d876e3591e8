"""A task to begin with is one that the robot does: in front of it, above its foot, the tool down, reached in nearly all of it."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from taskcal.errors import ReachError
from taskcal.kinematics.inverse import find_posture, follow
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.default_task import default_task, measured_task, task_text
from taskcal.task.task import load_task, reach_task

QUICK = ("ur5", "kuka-kr6-r900-sixx", "franka-panda", "denso-hsr065a1")
"""A robot without a front, one with, one with seven joints, and a SCARA, whose tool frame counts z backwards."""

LEAST = 0.9
"""Of a grid over the box, with the tool as it stands in its middle."""


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in catalogue_names()]
)
def test_the_box_to_begin_with_is_in_front_and_reached(tmp_path: Path, name: str) -> None:
    model = ErrorModel(load_robot(name))
    (tmp_path / "task.toml").write_text(task_text(default_task(model)))
    task = load_task(tmp_path / "task.toml")
    space = task.workspace
    assert space is not None
    assert (space.center - 0.5 * space.size)[[0, 2]].min() > 0.0
    assert abs(space.orientations[0].rotation[2, 2]) > 1.0 - 1e-9
    corners = np.array(list(product(np.linspace(-0.5, 0.5, 7), repeat=3)))
    T = np.tile(space.middle()[0], (len(corners), 1, 1))
    T[:, :3, 3] += corners * space.size
    found = follow(model, T, find_posture(model, space.middle()[0]))
    inside = found.reached & model.robot.inside_limits(found.q)
    np.testing.assert_allclose(model.poses(found.q[inside]), T[inside], atol=1e-6)
    assert inside.mean() >= LEAST
    assert 1.0 - reach_task(model, task, 100).unreachable.mean() >= LEAST  # tilted as well


@pytest.mark.parametrize("name", ["ur5", "abb-irb6660-205-1.9", "barrett-wam"])
def test_a_box_where_was_measured_is_reached_as_it_was(tmp_path: Path, name: str) -> None:
    """It lies within what was measured, and the postures that reach it are near to measured ones."""
    model = ErrorModel(load_robot(name))
    home = find_posture(model, default_task(model).workspace.middle()[0])
    q = home + np.random.default_rng(1).uniform(-0.4, 0.4, (200, len(home)))
    (tmp_path / "task.toml").write_text(task_text(measured_task(model, q)))
    task = load_task(tmp_path / "task.toml")
    assert task.accuracy is None
    places = model.nominal.poses(q)[:, :3, 3]
    corner = 0.5 * task.workspace.size
    assert (task.workspace.center - corner > places.min(axis=0)).all()
    assert (task.workspace.center + corner < places.max(axis=0)).all()
    reached = reach_task(model, task, 50, known=q)
    assert reached.unreachable.mean() <= 1.0 - LEAST
    assert np.abs(reached.q - home).max() < 1.5


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)])
def test_a_robot_that_hangs_works_down_too(gravity: tuple[float, float, float]) -> None:
    robot = load_robot("ur5")
    hung = ErrorModel(replace(robot, statics=replace(robot.statics, gravity=np.array(gravity))))
    space = default_task(hung).workspace
    assert space is not None
    np.testing.assert_allclose(space.orientations[0].rotation[:, 2], gravity, atol=1e-9)
    assert space.center[2] > 0.0  # away from what it hangs on


def test_a_robot_that_reaches_no_place_is_refused() -> None:
    robot = load_robot("ur5")
    locked = tuple(replace(joint, limits=(-0.01, 0.01)) for joint in robot.joints)
    with pytest.raises(ReachError, match="ur5 reaches no place in front of its base"):
        default_task(ErrorModel(replace(robot, joints=locked)))
