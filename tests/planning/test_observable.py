"""Postures that an instrument allows."""

import numpy as np
from scipy.stats import qmc

from taskcal.observations import CameraInstrument
from taskcal.observations.instrument import Instrument, find_measurable, instrument_class
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.planning.without_tracker import INSTRUMENTS, MODEL, TASK, TIP, instrument_of


def test_joints_that_turn_more_than_once_are_not_wound_up():
    model = ErrorModel(load_robot("ur5e"))
    assert model.robot.limits.max() > 6.0
    way = CameraInstrument.set_up(model, TASK, TIP)
    found = find_measurable(model, TASK, way, 90, 0)
    assert np.abs(found.q).max() <= np.pi
    goals = way.goals(model, TASK, 0, qmc.Halton(6, rng=0).random(30))
    reached = model.poses(found.q[found.visible[:, 0]])
    apart = np.abs(reached[:, None] - goals[None]).max(axis=(2, 3)).min(axis=1)
    assert apart.max() < 1e-6


def test_a_probe_is_brought_to_the_plane_that_it_touches():
    """In the orientations in which it would be anywhere about the task."""
    way = instrument_class("plane").set_up(MODEL, TASK, TIP)
    u = qmc.Halton(6, rng=0).random(30)
    anywhere = Instrument.goals(way, MODEL, TASK, 0, u)
    for number, (*normal, offset) in enumerate(way.unknown.reshape(-1, 4)):
        goals = way.goals(MODEL, TASK, number, u)
        np.testing.assert_allclose((goals @ way.T_tool_tip)[:, :3, 3] @ normal, offset, atol=1e-9)
        np.testing.assert_allclose(goals[:, :3, :3], anywhere[:, :3, :3], atol=1e-12)


def test_default_fixtures_are_above_base_and_apart():
    """Default fixed objects are above the base and apart from each other."""
    for way in INSTRUMENTS:
        position = instrument_of(way).fixtures.position
        assert position[:, 2].min() >= 0.0
        apart = np.linalg.norm(position[:, None] - position, axis=2)
        assert apart[np.triu_indices(len(position), 1)].min() > 0.09


def test_postures_of_different_branches_are_found():
    found = find_measurable(MODEL, TASK, instrument_of("camera"), 150, 0)
    # wrist flipped either way, and the camera turned all about its axis
    assert (found.q[:, 4] > 0.1).any()
    assert (found.q[:, 4] < -0.1).any()
    x = (MODEL.poses(found.q) @ TIP)[:, :2, 0]
    assert len(np.unique(np.floor((np.arctan2(x[:, 1], x[:, 0]) + np.pi) / (np.pi / 4)))) == 8
