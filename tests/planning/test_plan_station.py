"""Plans for a station: what the tracker sees, and what stands in the way."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.kinematics.clearance import beam_is_free, clear_of_boxes, clear_of_itself, place_links
from taskcal.observations.point import Tracker
from taskcal.planning.expected_error import design
from taskcal.planning.plan import Plan, plan
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from tests.planning.measuring_cell import TASK, cell

STATION = cell()


@pytest.fixture(scope="module")
def made(model) -> Plan:
    return plan(model, TASK, 12, candidates=500, station=STATION)


def test_every_pose_of_a_plan_for_a_station_can_be_measured(model, made):
    assert made.visible.shape == (12, 2)
    assert made.visible.any(axis=1).all()
    assert model.robot.inside_limits(made.q).all()
    links = place_links(model, made.q)
    assert clear_of_itself(links).all()
    assert clear_of_boxes(links, STATION.keep_out).all()
    T = model.poses(made.q)
    for k, reflector in enumerate(STATION.reflectors):
        center = T[:, :3, :3] @ reflector.position + T[:, :3, 3]
        beam = STATION.position - center
        unhidden = beam_is_free(STATION.position, center, links, STATION.keep_out)
        if reflector.axis is not None:
            looks = (T[:, :3, :3] @ reflector.axis * beam).sum(axis=1) / np.linalg.norm(beam, axis=1)
            unhidden &= looks >= np.cos(reflector.acceptance)
        np.testing.assert_array_equal(made.visible[:, k], unhidden)
    assert made.lost["in a keep-out box"] > 0
    found = Tracker(station=STATION).find(model, TASK, 500, 0)
    assert sum(made.lost.values()) + len(found.q) == 500
    assert made.candidates == len(found.q)


def test_lost_beams_count_in_the_expected_error(model, made):
    """The campaign that is planned has gaps where a reflector is hidden; a design from it agrees."""
    campaign, _ = simulate(
        model, made.q, rng=np.random.default_rng(0), x=np.zeros(len(model)), T_tracker_base=STATION.T_tracker_base,
        targets={reflector.name: reflector.position for reflector in STATION.reflectors},
    )  # fmt: skip
    points = np.where(made.visible[..., None], campaign.points, np.nan)
    goal = reach_task(model, TASK, 200, 0)
    expected = design(model, replace(campaign, points=points), goal, model_error=(made.model_error,))
    assert made.expected == pytest.approx(expected.expected_error(np.arange(len(model))), rel=1e-3)
