"""One small run of the published procedure for all tests of what is made of it."""

import pytest

from taskcal.adaptation.procedure import Procedure, run_procedure
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel


@pytest.fixture(scope="session")
def procedure() -> Procedure:
    return run_procedure(ErrorModel(load_robot("abb-irb6660-205-1.9")), count=30, seed=3, held_out=40)
