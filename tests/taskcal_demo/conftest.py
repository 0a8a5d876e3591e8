"""One small run of the published procedure for all tests of what is made of it."""

import numpy as np
import pytest

from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.task.task import reach_task
from taskcal_demo.procedure import ROBOT, Procedure, reference_task, run_procedure


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot(ROBOT)


@pytest.fixture(scope="session")
def procedure(robot: Robot) -> Procedure:
    return run_procedure(ErrorModel(robot), count=30, seed=3, held_out=40)


@pytest.fixture(scope="session")
def q(robot):
    return reach_task(ErrorModel(robot), reference_task(np.radians(20.0)), 20).q
