"""Poses of several plans, chosen among the same candidates."""

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.planning.options import PlanOptions
from taskcal.planning.plan import PoseChoice, plan
from tests.planning.measuring_cell import TASK


def test_poses_of_every_number_are_those_of_a_plan_of_its_own(model):
    planning = PoseChoice.among(model, TASK, PlanOptions(candidates=200, refine=1))
    chosen = {count: planning.choose(count) for count in (14, 9)}
    for count, poses in chosen.items():
        alone = plan(model, TASK, count, candidates=200, refine=1)
        np.testing.assert_array_equal(poses.q, alone.q)
        assert tuple(planning.measurable.rows[poses.candidate]) == alone.rows
    with pytest.raises(CampaignError, match="2 poses are too few"):
        planning.choose(2)
