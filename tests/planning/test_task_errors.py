"""Errors over a task, for a workspace as maps and for a list as curves."""

import numpy as np
import pytest

import taskcal as tc
from taskcal.planning.selection import design_for
from taskcal.planning.task_map import TaskCurves, TaskMaps, map_task

MODEL = tc.ErrorModel(tc.load_robot("abb-irb6660-205-1.9"))
TASK = tc.demo.reference_task()


@pytest.fixture(scope="module")
def design():
    return design_for(MODEL, tc.reach_task(MODEL, TASK), TASK)[0]


def test_task_error_is_prior_without_identification(design) -> None:
    """Identifying no parameter leaves the nominal error; identifying all parameters reduces it."""
    listed = tc.Task(name="five poses", poses=tc.reach_task(MODEL, TASK, 5).T)
    nothing, everything = map_task(MODEL, listed, design, ()), map_task(MODEL, listed, design)
    assert isinstance(nothing, TaskCurves)
    np.testing.assert_allclose(nothing.after, nothing.before, rtol=1e-9)
    assert (everything.after < 0.5 * everything.before).all()


def test_single_parameters_add_up_to_all_tolerances(design) -> None:
    found = map_task(MODEL, TASK, design)
    assert isinstance(found, TaskMaps)
    assert set(found.effects) == set(MODEL.names)
    middle = found.slices[0].q.shape[0] // 2, found.coarse[0].q.shape[0] // 2  # both grids have the middle
    together = found.tolerance[0][middle[0], middle[0]]
    alone = [maps[0][middle[1], middle[1]] for maps in found.effects.values()]
    assert together == pytest.approx(np.linalg.norm(alone), rel=1e-9)
