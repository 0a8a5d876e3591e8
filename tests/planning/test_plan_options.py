"""Options of a plan."""

import pytest

from taskcal.arguments import options_of
from taskcal.planning.plan import PlanOptions, plan
from tests.planning.measuring_cell import TASK


def test_an_option_that_a_plan_does_not_have_is_refused_by_name(model):
    with pytest.raises(TypeError, match=r"no option 'candidate' of a plan; there are seed, station, .*progress"):
        plan(model, TASK, 12, candidate=400)
    chosen = options_of(PlanOptions, {"options": PlanOptions(seed=3, refine=0), "refine": 1}, "a plan")
    assert (chosen.seed, chosen.refine) == (3, 1)
