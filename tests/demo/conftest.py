"""One small run of the published procedure for all tests of what is made of it."""

import pytest

from taskcal.demo.procedure import Procedure, run_procedure
from taskcal.demo.reference import ROBOT
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot(ROBOT)


@pytest.fixture(scope="session")
def procedure(robot: Robot) -> Procedure:
    return run_procedure(ErrorModel(robot), count=30, seed=3, held_out=40)
