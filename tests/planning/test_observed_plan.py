"""Plans without a tracker: their postures can be measured, and promise what virtual robots give."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError, ReachError
from taskcal.identification.identify import identify
from taskcal.observations.instrument import Measurable
from taskcal.planning.expected_error import PlanPrior, assumed_hyperparameters
from taskcal.planning.experiment import make_experiment
from taskcal.planning.plan import plan
from taskcal.virtual.cell import draw_defects
from tests.planning.without_tracker import (
    CANDIDATES,
    COUNT,
    GOAL,
    INSTRUMENTS,
    MODEL,
    TASK,
    aligned_error,
    instrument_of,
    measure,
    plan_of,
)

every_way = pytest.mark.parametrize("way", [*INSTRUMENTS, "pixels"])


@every_way
def test_plan_without_tracker_beats_random_and_falls_with_count(way):
    """A plan is better than random poses, and its error falls with the number of poses."""
    made = plan_of(way)
    assert made.expected < made.random.min() < made.random.max() < made.before
    assert made.expected < made.grid
    assert np.all(np.diff(made.by_count) <= 1e-12)
    assert made.expected <= made.by_count[-1] * (1 + 1e-9)
    assert len(set(made.rows)) == len(made.q) == COUNT


@every_way
def test_plan_respects_limits_and_covers_every_fixture(way):
    """Every pose is inside the joint limits, and every fixed object gets its minimum number of poses."""
    made = plan_of(way)
    assert MODEL.robot.inside_limits(made.q).all()
    assert np.bincount(made.of).min() >= instrument_of(way).rows_each
    assert made.names == tuple(instrument_of(way).fixtures.names[k] for k in made.of)
    said = made.summary()
    assert said["observe"] == instrument_of(way).name
    assert said[instrument_of(way).label] == list(made.names)
    assert said["poses_each"] == {name: made.names.count(name) for name in instrument_of(way).fixtures.names}
    assert [path["pose"] for path in said["not_clear_from_the_pose_before"]] == [path.pose for path in made.blocked]
    # what does not stand at the same time is measured one behind another
    stage = instrument_of(way).stages[made.of]
    assert np.count_nonzero(np.diff(stage)) == len(np.unique(stage)) - 1


@pytest.mark.parametrize(
    ("way", "robots"), [("socket", 8), ("wire", 8), pytest.param("pixels", 3, marks=pytest.mark.long)]
)
def test_virtual_robots_become_as_accurate_as_expected(way, robots):
    rng, made = np.random.default_rng(2), plan_of(way)
    squares = []
    for _ in range(robots):
        x = draw_defects(MODEL, rng)
        calibration = identify(MODEL, measure(instrument_of(way), made.q, made.of, x, rng, made.model_error))
        squares.append(aligned_error(calibration, x, instrument_of(way).T_tool_targets[0]) ** 2)
    # of few robots; `python -m tests.planning.observed_accuracy` has many, of all kinds
    assert np.sqrt(np.mean(squares)) == pytest.approx(made.expected, rel=0.4)


def test_the_same_seed_gives_the_same_plan():
    again = plan(MODEL, TASK, COUNT, observe=instrument_of("wire"), candidates=CANDIDATES)
    np.testing.assert_array_equal(again.q, plan_of("wire").q)
    assert again.names == plan_of("wire").names


def expected_in(way, made):
    """Expected error of the postures of a plan, measured in another way."""
    found = Measurable(q=made.q, rows=np.arange(len(made.q)), visible=made.visible, lost={})
    prior = PlanPrior(hyper=assumed_hyperparameters(MODEL))
    return make_experiment(MODEL, GOAL, found, prior, way).error(made.q, made.visible)


def test_precise_socket_distance_lowers_expected_error():
    """A stated socket distance lowers the expected error; a coarse one hardly does."""
    made, way = plan_of("socket"), instrument_of("socket")
    coarse = tuple(replace(one, uncertainty=1e-2) for one in way.distances)
    fine, little, none = (expected_in(replace(way, distances=d), made) for d in (way.distances, coarse, ()))
    assert 1.01 * fine < none
    assert little == pytest.approx(none, rel=5e-3)


def test_board_informs_more_than_landmark_unknown_scale_less():
    """A board is more informative than a landmark, and an unknown scale less than a known one."""
    camera, wire = plan_of("camera"), plan_of("wire")
    assert expected_in(instrument_of("board"), camera) < expected_in(instrument_of("camera"), camera)
    assert expected_in(replace(instrument_of("wire"), wire_scale=True), wire) > expected_in(instrument_of("wire"), wire)


def test_plan_rejects_too_few_poses_and_states_minimum():
    """Too few poses are rejected, and the number in the message is enough for a plan."""
    way = instrument_of("camera")
    with pytest.raises(CampaignError, match="each of 3 landmarks needs 5; plan at least 15"):
        plan(MODEL, TASK, 14, observe=way, candidates=90)
    made = plan(MODEL, TASK, 15, observe=way, candidates=90)
    assert np.bincount(made.of).tolist() == [5, 5, 5]


def test_postures_that_are_too_few_are_said_of_what():
    with pytest.raises(
        ReachError, match=r"only \d+ postures were found in which anchor '.*' can be measured; it needs 12"
    ):
        plan(MODEL, TASK, COUNT, observe=instrument_of("wire"), candidates=30)


def test_given_joints_or_measurements_do_not_go_with_it():
    way = instrument_of("socket")
    with pytest.raises(CampaignError, match="are looked for where its fixtures are"):
        plan(MODEL, TASK, COUNT, observe=way, candidates=GOAL.q)
    made = plan_of("socket")
    campaign = measure(way, made.q, made.of, np.zeros(len(MODEL)), np.random.default_rng(0), 1e-4)
    with pytest.raises(CampaignError, match="begins anew"):
        plan(MODEL, TASK, COUNT, observe=way, campaign=campaign)
