"""Where to put the part: what is expected of a placement is what is expected of a program written for it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.reading import parse_program
from taskcal.correction.cell import Cell
from taskcal.correction.controller import simulate_controller
from taskcal.correction.frames import frames_on
from taskcal.correction.part_placement import (
    MIN_MARGIN,
    PartPlacements,
    PlacedPart,
    Region,
    place,
    without_rigid_motion,
)
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import solve_near
from taskcal.report.placement import state_recommendation, state_trade
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task
from taskcal_demo.true_robot import elastic_robot

NOWHERE = Region(low=np.zeros(3), high=np.zeros(3))


def around(*shift, turn=0.0):
    """A region of one placement."""
    return Region(low=np.array(shift), high=np.array(shift), turn=(turn, turn))


@pytest.fixture(scope="module")
def program(robot, middle):
    """A square of lines in a part's frame at the middle of the task."""
    rows = ["x_mm,y_mm,z_mm,qx,qy,qz,qw,move"]
    for x, y in ((0, 0), (60, 0), (60, 60), (0, 60)):
        rows.append(f"{x},{y},0,0,0,0,1,{'joint' if x == y == 0 else 'linear'}")
    source = Source.of(Path("square.csv"), "\n".join(rows).encode())
    return parse_program((source,), robot=robot, part=Frame(name="part", T=middle))


def test_a_placement_is_the_program_with_its_frame_moved(calibration, program):
    shift, turn = np.array([0.05, -0.08, 0.03]), 0.2
    (placed,) = place(calibration, program, around(*shift, turn=turn)).all
    middle = np.mean([m.flange(m.end.T)[:3, 3] for m in program.motions], axis=0)
    S = se3.translation(*shift) @ se3.translation(*middle) @ se3.rotation("z", turn) @ se3.translation(*-middle)
    part = Frame(name="part", T=S @ program.motions[0].part.T)
    moved = replace(program, motions=tuple(replace(m, part=part) for m in program.motions))
    now = place(calibration, moved, NOWHERE).now
    assert placed.possible
    np.testing.assert_allclose(placed.before, now.before, rtol=1e-6)
    np.testing.assert_allclose(placed.after, now.after, rtol=1e-6)
    np.testing.assert_allclose(placed.margin, now.margin, atol=1e-6)
    assert 0.0 < placed.after < placed.before


def test_touched_part_keeps_relative_errors_only(calibration, program, robot):
    """Robots drawn from the covariance, their targets brought back by the nearest rigid motion, by SciPy."""
    whole = place(calibration, program, NOWHERE).now
    touched = place(calibration, program, NOWHERE, touched_off=True).now
    assert touched.after < 0.9 * whole.after
    assert touched.before < whole.before
    trajectory = simulate_controller(robot, program.motions)
    frames, _ = frames_on(calibration, program.motions, Cell())
    (frame,) = frames
    moved = frame.moved(trajectory.end)
    points, spread = frame.points(moved), frame.spread(moved)
    about = points - points.mean(axis=0)
    rng, squares = np.random.default_rng(0), []
    for _ in range(400):
        there = about + spread @ rng.standard_normal(spread.shape[2])
        shift = there.mean(axis=0)
        turn, _ = Rotation.align_vectors(there - shift, about)
        squares.append(np.square(there - shift - turn.apply(about)).sum(axis=1).mean())
    white = 3.0 * calibration.model_error[0] ** 2
    np.testing.assert_allclose(np.sqrt(touched.after**2 - white), np.sqrt(np.mean(squares)), rtol=0.1)


def test_rigid_motion_is_no_error_of_a_touched_part(robot):
    """Moving the robot as a whole is no error of a touched part."""
    points = np.random.default_rng(1).standard_normal((7, 3)) + 5.0
    twists = np.random.default_rng(2).standard_normal((6, 4))
    errors = se3.by_twist(points) @ twists
    np.testing.assert_allclose(without_rigid_motion(points, errors), 0.0, atol=1e-12)
    other = np.random.default_rng(3).standard_normal((7, 3, 2))
    once = without_rigid_motion(points, other)
    np.testing.assert_allclose(without_rigid_motion(points, once + errors[:, :, :2]), once, atol=1e-12)


def test_without_a_calibration_the_tolerances_count(robot, program):
    shift = np.array([0.1, 0.05, -0.05])
    (placed,) = place(robot, program, around(*shift)).all
    trajectory = simulate_controller(robot, program.motions)
    model = ErrorModel(robot)
    T = se3.translation(*shift) @ model.poses(trajectory.end)
    q = solve_near(model, T, trajectory.end).q
    effect = model.jacobian(q)[:, :3] * model.tolerances
    np.testing.assert_allclose(placed.before, np.sqrt((effect**2).sum(axis=(1, 2)).mean()), rtol=1e-6)
    assert np.isnan(placed.after)
    assert placed.expected == placed.before


def test_what_is_out_of_reach_is_said_and_not_recommended(calibration, program):
    region = Region(low=np.zeros(3), high=np.array([6.0, 0.0, 0.0]), steps=(2, 1))
    found = place(calibration, program, region)
    near, far = found.all
    assert far.reached < 1.0
    assert "square.csv:2" in far.obstacle
    assert "reach" in far.obstacle
    assert np.isnan([far.before, far.after]).all()
    assert found.ranked == (near,)


def test_errors_are_those_of_the_motions_that_are_reached(calibration, program):
    (edge,) = place(calibration, program, around(0.54, 0.0, 0.0)).all
    assert 0.0 < edge.reached < 1.0
    assert edge.before > edge.after > 0.0
    assert not edge.possible


def test_a_force_deflects_in_proportion(robot, program):
    elastic = elastic_robot(robot)
    one = place(elastic, program, NOWHERE, force=(0.0, 0.0, -100.0)).now
    three = place(elastic, program, NOWHERE, force=(0.0, 0.0, -300.0)).now
    assert one.compliance > 1e-6
    np.testing.assert_allclose(three.compliance, 3.0 * one.compliance, rtol=1e-3)
    np.testing.assert_allclose(one.expected, np.hypot(one.before, one.compliance))
    assert np.isnan(place(elastic, program, NOWHERE).now.compliance)


def test_a_robot_whose_stiffness_is_not_known_is_not_pushed(robot, program):
    with pytest.raises(TaskcalError, match="its file states no stiffness"):
        place(robot, program, NOWHERE, force=(0.0, 0.0, -100.0))


def test_a_task_is_placed_as_its_poses_are(robot, program, middle):
    poses = np.stack([move.flange(move.end.T) @ robot.T_flange_tool for move in program.motions])
    task = Task(name="square", poses=poses)
    shift = (0.1, 0.0, 0.05)
    (of_task,), (of_program,) = place(robot, task, around(*shift)).all, place(robot, program, around(*shift)).all
    assert of_task.reached == 1.0
    np.testing.assert_allclose(of_task.before, of_program.before, rtol=0.05)


def test_the_best_comes_first(robot, program):
    region = Region(low=np.array([-0.2, 0.0, 0.0]), high=np.array([0.2, 0.0, 0.0]), turn=(-0.3, 0.3), steps=(3, 2))
    said: list[tuple[int, int]] = []
    found = place(robot, program, region, progress=lambda *at: said.append(at))
    assert said == [(number, 6) for number in range(1, 7)]
    assert len(found.all) == 6
    errors = [placed.expected for placed in found.ranked]
    assert errors == sorted(errors)
    assert all(placed.possible for placed in found.ranked)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"low": np.ones(3)}, "from 1 to 0"),
        ({"turn": (1.0, 0.0)}, "from 1 to 0"),
        ({"high": np.full(3, np.nan)}, "from 0 to nan"),
        ({"steps": (0, 1)}, "not 0 and 1"),
        ({"high": np.ones(3), "steps": (20, 1)}, "8000 placements"),
    ],
)
def test_regions_that_are_none_are_refused(changes, reason):
    with pytest.raises(TaskcalError, match=reason):
        Region(**{"low": np.zeros(3), "high": np.zeros(3), **changes})


def test_a_placement_is_ranked_by_what_is_left_and_states_its_units():
    """The corrected error where there is a calibration, with the deflection beside it; nothing for what is not known."""
    one = PlacedPart(
        shift=np.array([0.1, -0.2, 0.3]), turn=np.radians(15.0), reached=1.0, obstacle="", before=3e-3, after=4e-4,
        compliance=3e-4, margin=np.radians(7.0), conditioning=0.2,
    )  # fmt: skip
    said = one.summary()
    assert [said[f"{axis}_mm"] for axis in "xyz"] == pytest.approx([100.0, -200.0, 300.0])
    assert (said["turn_deg"], said["joint_margin_deg"]) == pytest.approx((15.0, 7.0))
    assert [said[f"{key}_mm"] for key in ("before", "after", "compliance", "expected")] == pytest.approx(
        [3, 0.4, 0.3, 0.5]
    )
    unknown = replace(one, after=np.nan, compliance=np.nan, margin=np.inf)
    assert unknown.expected == one.before
    assert [unknown.summary()[key] for key in ("after_mm", "compliance_mm", "joint_margin_deg")] == [None] * 3
    others = [
        replace(one, conditioning=0.3),
        replace(one, after=1e-4),
        replace(one, after=1e-9, reached=0.9),
        replace(one, after=1e-9, conditioning=0.0),
    ]
    ranked = PartPlacements(name="part", now=one, all=(one, *others)).ranked
    assert ranked == (others[1], others[0], one)


ANY = st.builds(
    PlacedPart,
    shift=st.just(np.zeros(3)), turn=st.just(0.0), reached=st.sampled_from([1.0, 1.0, 0.9]), obstacle=st.just(""),
    before=st.just(1.0), after=st.floats(1e-5, 2e-2), compliance=st.sampled_from([np.nan, 1e-3]), margin=st.floats(0.0, 1.0),
    conditioning=st.sampled_from([0.2, 0.2, 0.0]), outside=st.sampled_from(["", "", "1 of 30 targets is outside"]),
)  # fmt: skip


@given(now=ANY, every=st.lists(ANY, min_size=1, max_size=5), tolerance=st.none() | st.floats(1e-4, 2e-2))
def test_no_place_is_recommended_that_the_task_or_the_calibration_does_not_allow(now, every, tolerance):
    """However much better it is than where the part stands; nor is the part left where it may not be."""
    found = PartPlacements(name="part", now=now, all=tuple(every), tolerance=tolerance)

    def fits(placed):
        stiff = 0.0 if np.isnan(placed.compliance) else placed.compliance
        exact = tolerance is None or np.hypot(placed.after, stiff) <= tolerance
        return placed.possible and not placed.outside and exact

    said, best = state_recommendation(found), found.recommended
    worth = [
        placed
        for placed in every
        if fits(placed)
        and (placed.margin >= MIN_MARGIN or (now.possible and placed.margin >= now.margin))
        and (not fits(now) or placed.expected <= 0.9 * now.expected)
    ]
    assert (best is None) == (not worth)
    assert best is None or min(worth, key=lambda placed: round(placed.expected, 9)).expected == pytest.approx(
        best.expected, abs=1e-9
    )
    assert ("leave the part" in said) == (best is None and fits(now))
    assert said.startswith("none: ") == bool(found.unmet) == (best is None and not fits(now))
    if found.unmet and found.ranked and (first := found.ranked[0]).outside and fits(replace(first, outside="")):
        assert said == f"none: {first.outside}"


def test_a_recommended_place_lies_where_the_robot_was_measured(calibration, program):
    """With a region that goes out of the measured range; the ranges of the joints are the campaign's own."""
    region = Region(low=np.array([-0.4, -0.6, -0.3]), high=np.array([0.4, 0.6, 0.3]), steps=(3, 1))
    found = place(calibration, program, region, accept_uncertain=True)
    low, high = calibration.q.min(axis=0) - np.radians(1.0), calibration.q.max(axis=0) + np.radians(1.0)
    robot, seen = calibration.model.robot, {True: 0, False: 0}
    for placed in found.ranked:
        part = Frame(name="part", T=se3.translation(*placed.shift) @ program.motions[0].part.T)
        moved = tuple(replace(motion, part=part) for motion in program.motions)
        q = simulate_controller(robot, moved).end
        inside = bool(((low <= q) & (q <= high)).all())
        assert inside or found.unfit(placed)
        seen[inside] += 1
    assert min(seen.values()) > 0, seen


@pytest.mark.parametrize(
    ("error", "margin_deg", "now_deg", "worth"),
    [
        (0.99, 5.0, 30.0, False),
        (0.99, 40.0, 30.0, False),
        (0.5, 6.0, 30.0, True),
        (0.5, 3.0, 30.0, False),
        (0.5, 3.0, 2.0, True),
    ],
)
def test_placement_is_recommended_for_a_gain_that_leaves_margin(error, margin_deg, now_deg, worth):
    now = PlacedPart(
        shift=np.zeros(3), turn=0.0, reached=1.0, obstacle="", before=1e-3, after=np.nan, compliance=np.nan,
        margin=np.radians(now_deg), conditioning=0.2,
    )  # fmt: skip
    other = replace(now, before=error * 1e-3, margin=np.radians(margin_deg))
    found = PartPlacements(name="part", now=now, all=(now, other))
    assert found.recommended is (other if worth else None)
    assert ("not worth it" in state_trade(found, other)) != worth
    assert f"{1.0 - error:.0%} less error" in state_trade(found, other)
