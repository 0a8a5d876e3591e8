"""The publication's registration in the demonstration, beside the way without."""

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal_demo import procedure_report as tables
from taskcal_demo.procedure import CIRCLES, INSIDE, ONE, SEVERAL, Procedure, frame_error, sweep_motors


def test_one_motor_turns_at_a_time_within_the_limits(procedure: Procedure) -> None:
    q = sweep_motors(procedure.model.robot, procedure.poses[ONE].q)
    assert procedure.model.robot.inside_limits(q).all()
    middle = np.median(q, axis=0)
    assert ((np.abs(q - middle) > 1e-9).sum(axis=1) <= 1).all()
    assert {int(np.argmax(np.abs(row - middle))) for row in q} == set(range(6))


def test_a_frame_is_off_by_what_it_was_moved() -> None:
    true = se3.pose(se3.exp(np.array([0.3, -0.2, 1.0])), np.array([3.0, 1.0, -1.0]))
    moved = true @ se3.pose(se3.exp(np.array([0.0, 2e-3, 0.0])), np.array([0.0, 3e-3, 4e-3]))
    assert frame_error(moved, true) == pytest.approx((5e-3, 2e-3))


def test_circles_of_all_six_motors_register_the_tracker(procedure: Procedure) -> None:
    assert {circle.axis for circle in procedure.circles} == set(range(6))
    lower_arm = next(circle for circle in procedure.circles if circle.axis == 1)
    assert lower_arm.radius == pytest.approx(0.7, abs=2e-3)
    off, turned = frame_error(procedure.registration.T_tracker_base, procedure.truth.T_tracker_base)
    assert off < 3e-3
    assert turned < 2e-3


@pytest.mark.parametrize("label", [ONE, SEVERAL])
def test_held_circles_leave_more_than_frames_in_the_fit(procedure: Procedure, label: str) -> None:
    held, free = procedure.fit(label, CIRCLES), procedure.fit(label, "published 33, damped")
    np.testing.assert_array_equal(held.calibration.T_tracker_base, procedure.registration.T_tracker_base)
    assert held.residual.mean > free.residual.mean
    rows = {
        row[0]: row for head, group in tables.tabulate_registration(procedure).groups if label in head for row in group
    }
    shown = float(rows["circles, held"][4])
    predicted = next(p for p in procedure.predictions if (p.campaign, p.model, p.where) == (label, held.model, INSIDE))
    assert shown == pytest.approx(predicted.length.mean() * 1e6, abs=0.051)


def test_six_lengths_leave_more_than_the_defects(procedure: Procedure) -> None:
    for label in (ONE, SEVERAL):
        lengths = procedure.fit(label, "lengths 6")
        assert lengths.calibration.model.names == ("RL1", "d2", "d3", "d4", "RL4", "RL6")
        assert procedure.fit(label, "all").residual.mean * 3.0 < lengths.residual.mean
        assert lengths.residual.mean < procedure.fit(label, "nominal").residual.mean


def test_one_orientation_predicts_itself_alone(procedure: Procedure) -> None:
    """A campaign in one orientation predicts poses in it, and not in others; one in several predicts both."""
    one, several = (procedure.fit(label, "all") for label in (ONE, SEVERAL))
    assert one.inside.mean < 20e-6 < 100e-6 < one.outside.mean
    assert several.outside.mean < 40e-6
