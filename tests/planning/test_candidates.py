"""Poses that can be measured."""

import numpy as np
import pytest

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box, clear_of_itself, place_links
from taskcal.observations.point import Reflector
from taskcal.planning.plan import plan
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.default_task import default_task
from taskcal.task.task import enlarge
from tests.laws.robots import FEW_DIRECTIONS
from tests.planning.measuring_cell import TASK, cell


def test_candidates_reject_reflector_that_is_never_visible(model):
    """A reflector that is never visible is rejected with the reasons."""
    blind = Reflector(name="smr", position=np.zeros(3), axis=np.array([0, 0, -1.0]), acceptance=np.radians(1.0))
    with pytest.raises(ReachError, match=r"none of 100 candidate poses.*no reflector visible; move the tracker"):
        plan(model, TASK, 12, candidates=100, station=cell(reflectors=(blind,)))
    everywhere = Box(pose=se3.translation(1.5, 0.0, 1.2), size=np.full(3, 3.0))
    with pytest.raises(ReachError, match=r"none of 100 .* in a keep-out box"):
        plan(model, TASK, 12, candidates=100, station=cell(keep_out=(everywhere,)))


def test_planned_poses_stay_in_measurement_workspace(model, small):
    """Planned poses are inside the workspace allowed for measuring."""
    assert model.robot.inside_limits(small.q).all()
    assert clear_of_itself(place_links(model, small.q)).all()
    T = model.poses(small.q)
    space = enlarge(TASK, model).workspace
    # refinement moves each joint by a few tenths of a radian at most
    assert np.all(np.abs(T[:, :3, 3] - space.center) <= 0.5 * space.size + 0.8)
    unrefined = model.poses(plan(model, TASK, 12, candidates=100, refine=0).q)
    assert np.all(np.abs(unrefined[:, :3, 3] - space.center) <= 0.5 * space.size + 1e-9)
    tilt = np.arccos((unrefined[:, :3, 2] * TASK.workspace.orientations[0].rotation[:, 2]).sum(axis=1))
    assert tilt.max() <= np.radians(45.0) + 1e-9


@pytest.mark.parametrize("name", ["denso-hsr065a1", pytest.param("five-axis", marks=pytest.mark.long)])
def test_robots_of_few_directions_are_planned_for(name):
    """All poses are in the workspace for measuring, turn the last axis, and tell more than random ones."""
    few = ErrorModel(robot_from(FEW_DIRECTIONS[name]) if name in FEW_DIRECTIONS else load_robot(name))
    task = default_task(few)
    found = plan(few, task, 12, candidates=300)
    assert found.expected < found.random.mean() < found.before
    T, space = few.poses(found.q), enlarge(task, few).workspace
    assert space is not None
    assert space.contains(T).all()
    assert np.ptp(found.q, axis=0).min() > 0.05
