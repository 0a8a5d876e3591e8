"""The lines of a budget add, as squares, to what the calibration states of its predictions."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.identification.identify import identify
from taskcal.identification.uncertainty_budget import budget_at, check_known, why_unknown
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


@pytest.mark.parametrize("joint_error", [(), (1e-4,) * 6])
def test_contributions_add_to_what_is_stated(joint_error: tuple[float, ...]) -> None:
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("ur5"))
    campaign, _ = simulate(model, rng.uniform(-1.2, 1.2, (30, 6)), rng=rng)
    calibration = replace(identify(model, campaign, model_error=2e-4), joint_error=joint_error)
    q = rng.uniform(-1.0, 1.0, (9, 6))
    budget = budget_at(calibration, q)
    stated = np.trace(calibration.predict_covariance(q)[:, 0], axis1=1, axis2=2).mean()
    assert budget.combined**2 == pytest.approx(stated)
    assert budget.expanded == pytest.approx(2.0 * np.sqrt(stated / 3.0))
    assert len(budget.contributions) == (3 if joint_error else 2)
    given = next(one for one in budget.contributions if one.evaluation == "B")
    assert given.deviation == pytest.approx(np.sqrt(3.0) * 2e-4)


@pytest.mark.parametrize("scale", [0.5, 2.9, 3.1, 40.0])
def test_a_calibration_is_unknown_that_is_three_times_as_open_as_tolerances(scale: float) -> None:
    """Of parameters that are as uncertain as so many tolerances the tool is, too, wherever the tracker's frame is."""
    rng, model = np.random.default_rng(1), ErrorModel(load_robot("ur5"))
    campaign, _ = simulate(model, rng.uniform(-1.2, 1.2, (20, 6)), rng=rng)
    calibration = identify(model, campaign, keep=[])
    open_frame = 0.1 * np.ones(len(calibration.z) - len(model))
    spread = np.diag(np.concatenate([scale * model.tolerances, open_frame]))
    q = campaign.q[:9]
    why = why_unknown(replace(calibration, z_spread=spread), q)
    assert bool(why) == (scale > 3.0)
    if why:
        assert f"{scale:.0f} times as much" in why
        with pytest.raises(TaskcalError, match="the program is not written: the calibration is uncertain there"):
            check_known(replace(calibration, z_spread=spread), q, "the program is not written")
    assert why_unknown(replace(calibration, z_spread=spread), q[:0]) == ""


@pytest.mark.parametrize(("moved", "known"), [(range(6), True), ((4, 5), False)])
def test_a_sound_calibration_is_known_far_from_its_rows(moved: Sequence[int], known: bool) -> None:
    """How far the target is from the tool stays as unknown there as it was; of joints that never moved nothing is known."""
    rng, model = np.random.default_rng(2), ErrorModel(load_robot("ur5"))
    q = np.tile([0.2, -1.0, 1.1, -0.5, 1.0, 0.2], (60, 1))
    q[:, moved] += rng.uniform(-0.8, 0.8, (60, len(moved)))
    calibration = identify(model, simulate(model, q, rng=rng)[0])
    assert calibration.range_growth > 0.0
    assert bool(why_unknown(calibration, rng.uniform(-np.pi, np.pi, (100, 6)))) != known
