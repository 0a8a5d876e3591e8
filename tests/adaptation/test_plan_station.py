"""Plans for a station: what the tracker sees, and what stands in the way."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.adaptation.candidates import find_measurable
from taskcal.adaptation.expected_error import design
from taskcal.adaptation.experiment import make_experiment
from taskcal.adaptation.plan import plan
from taskcal.adaptation.plan_prior import PlanPrior
from taskcal.adaptation.refinement import refine
from taskcal.demo.reference import reference_task
from taskcal.errors import CampaignError, ReachError
from taskcal.geometry import se3
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.kinematics.clearance import Box, beam_is_free, clear_of_boxes, clear_of_itself, place_links
from taskcal.measurement.station import Reflector, Station
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task

TASK = reference_task()


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


def cell(**changed) -> Station:
    """A tracker in front of the robot; a box beside its workspace; two reflectors, one seen from one side only."""
    given = {
        "position": np.array([4.5, -1.5, 0.8]),
        "reach": 20.0,
        "nearest": 0.5,
        "reflectors": (
            Reflector(name="ball", position=np.array([0.0, 0.05, 0.0]), axis=None, acceptance=0.5),
            Reflector(name="smr", position=np.array([0.1, 0.0, 0.0]), axis=np.array([0, 0, 1.0]), acceptance=0.6),
        ),
        "keep_out": (Box(pose=se3.translation(1.9, 0.75, 1.2), size=np.array([0.6, 0.6, 1.5])),),
    }
    return Station(**{**given, **changed})


def test_every_pose_of_a_plan_for_a_station_can_be_measured(model):
    station = cell()
    made = plan(model, TASK, 12, candidates=500, station=station)
    assert made.visible.shape == (12, 2)
    assert made.visible.any(axis=1).all()
    assert model.robot.inside_limits(made.q).all()
    links = place_links(model, made.q)
    assert clear_of_itself(links).all()
    assert clear_of_boxes(links, station.keep_out).all()
    T = model.poses(made.q)
    for k, reflector in enumerate(station.reflectors):
        center = T[:, :3, :3] @ reflector.position + T[:, :3, 3]
        beam = station.position - center
        unhidden = beam_is_free(station.position, center, links, station.keep_out)
        if reflector.axis is not None:
            looks = (T[:, :3, :3] @ reflector.axis * beam).sum(axis=1) / np.linalg.norm(beam, axis=1)
            unhidden &= looks >= np.cos(reflector.acceptance)
        np.testing.assert_array_equal(made.visible[:, k], unhidden)
    assert made.lost["in a keep-out box"] > 0
    found = find_measurable(model, TASK, station, 500, 0)
    assert sum(made.lost.values()) + len(found.q) == 500
    assert made.candidates == len(found.q)


def test_lost_beams_count_in_the_expected_error(model):
    """The campaign that is planned has gaps where a reflector is hidden; a design from it agrees."""
    station = cell()
    made = plan(model, TASK, 12, candidates=500, station=station)
    campaign, _ = simulate(
        model, made.q, rng=np.random.default_rng(0), x=np.zeros(len(model)), T_tracker_base=station.T_tracker_base,
        targets={reflector.name: reflector.position for reflector in station.reflectors},
    )  # fmt: skip
    points = np.where(made.visible[..., None], campaign.points, np.nan)
    goal = reach_task(model, TASK, 200, 0)
    expected = design(model, replace(campaign, points=points), goal, model_error=(made.model_error,))
    assert made.expected == pytest.approx(expected.expected_error(np.arange(len(model))), rel=1e-3)


def test_a_reflector_that_is_never_visible_is_refused_with_the_reasons(model):
    blind = Reflector(name="smr", position=np.zeros(3), axis=np.array([0, 0, -1.0]), acceptance=np.radians(1.0))
    with pytest.raises(ReachError, match=r"none of 100 candidate poses.*no reflector visible; move the tracker"):
        plan(model, TASK, 12, candidates=100, station=cell(reflectors=(blind,)))
    everywhere = Box(pose=se3.translation(1.5, 0.0, 1.2), size=np.full(3, 3.0))
    with pytest.raises(ReachError, match=r"none of 100 .* in a keep-out box"):
        plan(model, TASK, 12, candidates=100, station=cell(keep_out=(everywhere,)))


def test_campaigns_that_do_not_fit_the_station_are_refused(model):
    q = reach_task(model, TASK, 20).q
    poses, _ = simulate(model, q, rng=np.random.default_rng(0), pose=True)
    with pytest.raises(CampaignError, match="campaign of points; this one measured poses"):
        plan(model, TASK, 6, candidates=50, campaign=poses)
    several, _ = simulate(model, q, rng=np.random.default_rng(0), targets={"a": np.zeros(3), "b": np.full(3, 0.1)})
    with pytest.raises(CampaignError, match="several targets; say with a station"):
        plan(model, TASK, 6, candidates=50, campaign=several)
    with pytest.raises(CampaignError, match="targets are a, b, the station's reflectors ball, smr; name them alike"):
        plan(model, TASK, 6, candidates=50, campaign=several, station=cell())


def test_refinement_keeps_what_the_station_sees(model):
    """Every variation tried is checked; a pose whose variations are all hidden stays."""
    station = cell()
    made = plan(model, TASK, 8, candidates=200, station=station, refine=0)
    links = place_links(model, made.q)
    seen = station.visible(model.poses(made.q), links)
    np.testing.assert_array_equal(seen, made.visible)
    prior = PlanPrior(hyper=Hyperparameters.of_deviations((0.0,)))
    experiment = make_experiment(
        model, reach_task(model, TASK, 50), find_measurable(model, TASK, station, 200, 0), prior, station=station
    )
    q, visible = refine(model, experiment, TASK, station, made.q, made.visible, scale=0.3, seed=0)
    np.testing.assert_array_equal(station.visible(model.poses(q), place_links(model, q)), visible)
    assert visible.any(axis=1).all()
    assert experiment.error(q, visible) < experiment.error(made.q, made.visible)
    assert np.any(q != made.q)
