"""Fixtures that several test modules of this folder share."""

import numpy as np
import pytest

from taskcal.observations.point import Tracker
from taskcal.planning.plan import Plan, plan
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from tests.planning.measuring_cell import TASK


@pytest.fixture(scope="session")
def model():
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


@pytest.fixture(scope="session")
def listed(model) -> Task:
    """The task as a list of poses whose joints are known, so that planning needs no search for them."""
    reached = reach_task(model, TASK, 100, 3)
    return Task(name="listed", poses=reached.T, joints=reached.q, accuracy=5e-5)


@pytest.fixture(scope="session")
def pool(model) -> np.ndarray:
    """Joints of poses that can be measured."""
    return Tracker().find(model, TASK, 400, 0).q


@pytest.fixture(scope="session")
def small(model) -> Plan:
    return plan(model, TASK, 12, candidates=400)
