"""Whether a plan gives what was asked is said by the plan's own numbers."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import ReachError
from taskcal.planning.plan import Plan, check_demands, extrapolate_poses

PLAN = Plan(
    q=np.zeros((4, 6)), rows=(0, 1, 2, 3), visible=np.ones((4, 1), dtype=bool), expected=2e-5, random=np.full(3, 4e-5),
    grid=3e-5, by_count=np.array([9e-5, 6e-5, 4e-5, 2e-5]), before=1e-3, criterion="task", exchanges=0, candidates=50,
    lost={"out of reach": 7, "in a keep-out box": 0},
)  # fmt: skip


def test_too_few_candidates_are_refused_with_what_fell_away() -> None:
    check_demands(PLAN, 4)
    with pytest.raises(
        ReachError, match=r"only 50 candidate poses can be measured, 60 were asked for \(7 out of reach\)"
    ):
        check_demands(PLAN, 60)


def test_accuracy_is_unreachable_if_all_candidates_miss_it() -> None:
    """An accuracy is out of reach if even all candidates together do not achieve it."""
    assert extrapolate_poses(4, 2e-5, 1e-5) == pytest.approx(16.0)
    just = 2e-5 * np.sqrt(4 / 50)
    check_demands(replace(PLAN, accuracy=just * 1.01), 4)
    with pytest.raises(
        ReachError, match=r"out of reach: 4 poses are expected to leave 0\.02 mm rms, and not even all 50"
    ):
        check_demands(replace(PLAN, accuracy=just * 0.99), 4)


def test_a_plan_states_its_figures_in_millimetres():
    """Of the random plans the mean, the best and the worst; at a single pose the model error of three axes beside the plan's."""
    random = np.array([2e-5, 7e-5, 3e-5])
    by_count, random = np.array([9.0, 1e-3, 1e-4, 2e-5]), np.array([2e-5, 7e-5, 3e-5])
    made = replace(PLAN, random=random, by_count=by_count, accuracy=1.2e-4, model_error=4e-5)
    said = made.summary()
    figures = ("expected_error_mm", "grid_expected_error_mm", "before_mm", "accuracy_mm", "model_error_mm")
    assert [said[key] for key in figures] == pytest.approx([0.02, 0.03, 1.0, 0.12, 0.04])
    assert said["random_expected_error_mm"] == pytest.approx(0.04)
    assert said["random_expected_error_range_mm"] == pytest.approx([0.02, 0.07])
    assert said["expected_with_model_error_mm"] == pytest.approx((0.02**2 + 3 * 0.04**2) ** 0.5)
    assert said["geometry_allowance_mm"] == pytest.approx((0.12**2 - 3 * 0.04**2) ** 0.5)
    assert (said["poses_needed"], said["poses_needed_without_model_error"]) == (4, 3)
    assert said["by_count_mm"] == pytest.approx([9000.0, 1.0, 0.1, 0.02])
