"""Where next to nothing is learnt, regions hold the truth, or the campaign is refused."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.demo.procedure import reference_task
from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from tests.identification.poor_campaigns import judge, measured
from tests.identification.test_effect_selection import soft_arm

POOR = (
    ("abb-irb120", "one orientation"),
    ("franka-panda", "turned about one axis"),
    ("kuka-kr16-2", "a plane"),
    ("ur5", "a circle"),
    ("abb-irb120", "last two joints"),
    ("barrett-wam", "first two joints"),
    ("fanuc-m20ia", "joints within 1°"),
    ("franka-panda", "four rows"),
    ("abb-irb4600-60-2.05", "eight rows"),
)


@pytest.mark.parametrize(("robot", "shape"), POOR)
def test_regions_hold_all_over_the_workspace(robot, shape):
    """Of two robots nine tenths of 200 poses that nothing was measured near to; 95 % are stated."""
    inside = []
    for seed in range(2):
        model, campaign, truth = measured(robot, shape, seed)
        inside.append(judge(identify(model, campaign), truth, seed)[0])
    assert np.mean(inside) > 0.9, inside


@pytest.mark.parametrize("joint", ["first", "third", "last"])
@pytest.mark.parametrize("options", [{}, {"prior": None}, {"keep": ()}], ids=["tolerances", "no prior", "frames alone"])
def test_one_joint_in_motion_is_refused(joint, options):
    model, campaign, _ = measured("abb-irb120", f"{joint} joint", 0)
    name = {"first": "J1", "third": "J3", "last": "J6"}[joint]
    with pytest.raises(CampaignError, match=rf"rotation is open by .* only {name} moves, .*at least three joints move"):
        identify(model, campaign, **options)


@pytest.mark.parametrize("seed", range(3))
def test_frame_of_points_within_centimetres_is_found(seed):
    """Whatever the nominal robot leaves of so small a cloud: by a closed form alone half of these frames are turned about."""
    model, campaign, truth = measured("abb-irb120", "about a point", seed)
    assert campaign.points.std(axis=0).max() < 0.02
    turned = truth.T_tracker_base[:3, :3].T @ identify(model, campaign).T_tracker_base[:3, :3]
    assert np.linalg.norm(se3.log(turned)) < 0.02


def test_unlocated_target_errs_as_stated():
    """What is stated of a target's place is what a fit misses where the target is a tenth of a metre off along each axis."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = reach_task(model, reference_task(), 40).q
    turned = reach_task(model, reference_task(np.radians(40.0)), 10, seed=1).q
    options = {"model_error": 1e-4, "prior_scale": 1.0, "gross_errors": "keep"}
    errors = np.zeros((len(turned), 3, 3))
    for axis in range(3):
        offset = 0.1 * np.eye(3)[axis]
        campaign, truth = simulate(
            model, q, rng=np.random.default_rng(0), targets={"smr": offset}, x=np.zeros(len(model))
        )
        found = identify(model, campaign, **options)
        errors[..., axis] = (truth.points(turned) - found.predict(turned))[:, 0]
    wide, narrow = (
        replace(identify(model, campaign, target_within=within, **options), range_growth=0.0) for within in (1.0, 1e-6)
    )
    stated = wide.predict_covariance(turned)[:, 0] - narrow.predict_covariance(turned)[:, 0]
    np.testing.assert_allclose(stated, errors @ np.swapaxes(errors, 1, 2), atol=0.02 * stated.max())


def test_a_nominal_robot_still_varies_by_its_tolerances():
    """Where no parameter explains the rows, as where only the tracker frame is asked for."""
    model, campaign, _, _ = soft_arm(1, moving=(1, 2), still=ErrorModel(load_robot("ur5")).names)
    found = identify(model, campaign)
    assert not len(found.estimated)
    np.testing.assert_allclose(found.standard_errors, model.tolerances)
