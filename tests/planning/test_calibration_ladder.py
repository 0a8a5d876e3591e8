"""The ladder climbs from the nominal robot to the whole model, and its rungs are errors of rows left out."""

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.planning.selection import climb
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


def test_each_part_is_a_rung_and_worth_what_it_is() -> None:
    rng = np.random.default_rng(0)
    robot = load_robot("abb-irb120")
    model = ErrorModel(robot) + Compliance(joints=("J2", "J3"))
    campaign, _ = simulate(ErrorModel(robot), rng.uniform(*0.5 * robot.limits.T, size=(50, 6)), rng=rng)
    calibration = identify(model, campaign)
    rungs = climb(calibration, campaign)
    assert [rung.name for rung in rungs[:3]] == ["nominal (registered)", "joint zeros", "all geometry"]
    assert [rung.parameters for rung in rungs[:3]] == [0, 6, 42]
    assert rungs[-1].parameters == len(model)
    assert "compliance" in rungs[-1].name
    assert rungs[0].mean > rungs[1].mean > 5 * rungs[2].mean
    assert rungs[3].mean == pytest.approx(rungs[2].mean, rel=0.2)  # there is no compliance to find
    assert all(rung.p95 > rung.mean for rung in rungs)
    with pytest.raises(CampaignError, match="10 rows are too few for a ladder"):
        climb(calibration, campaign.take(list(range(10))))
