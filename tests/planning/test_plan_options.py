"""Options of a plan."""

import pytest

from taskcal.arguments import chosen_options
from taskcal.planning.options import PlanOptions
from taskcal.planning.plan import plan
from tests.planning.measuring_cell import TASK


def test_an_option_that_a_plan_does_not_have_is_refused_by_name(model):
    with pytest.raises(TypeError, match=r"no option 'candidate' of plan; there are seed, station, .*progress"):
        plan(model, TASK, 12, candidate=400)
    chosen = chosen_options(PlanOptions, PlanOptions(seed=3, refine=0), refine=1)
    assert (chosen.seed, chosen.refine) == (3, 1)
