"""True robots that no model of the fit describes: each part does what it is said to do, and no fit can try it."""

import numpy as np
import pytest

from taskcal.demo.elastic_links import AXES, ElasticLinks, carried
from taskcal.demo.elastic_robot import elastic_robot
from taskcal.demo.gear_errors import GearErrors
from taskcal.demo.lost_motion import WIDTHS, lost_motion
from taskcal.demo.reference import reference_task
from taskcal.demo.true_robot import GROWING, Sizes, draw_true_robot
from taskcal.demo.uneven_expansion import UnevenExpansion
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import WarmUp
from taskcal.robot.effects.load_path import LoadPath
from taskcal.robot.effects.motor_torque import motor_torque
from taskcal.robot.effects.registry import kinds
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.load import Load
from taskcal.task.task import reach_task

NOTHING = dict.fromkeys(("links", "drives", "gears", "lost_motion", "expansion"), 0.0)


@pytest.fixture(scope="module")
def q(robot):
    return reach_task(ErrorModel(robot), reference_task(np.radians(20.0)), 20).q


def test_no_fit_can_try_what_the_truth_is_made_of():
    import taskcal.demo.true_robot  # noqa: F401

    assert not {ElasticLinks, GearErrors, UnevenExpansion} & set(kinds())


def test_moments_about_the_axes_are_those_of_virtual_work(robot, q):
    """What a link carries about its axis, seen from the motors, is the torque that `Compliance` knows but for the spring."""
    heavy = elastic_robot(robot)
    path = LoadPath.at(heavy, q)
    about_axes = carried(heavy, 6, q).reshape(len(q), 6, AXES)[:, :, 5]
    by_motor = np.einsum("nc,ncm->nm", about_axes, path.by_motor)
    known = motor_torque(heavy, Load())(path)
    spring = heavy.statics.spring
    assert spring is not None
    turn = path.coordinates[:, spring.joint] - heavy.joint_map.offset[spring.joint]
    known -= spring.torque(turn)[:, None] * path.by_motor[:, spring.joint]
    np.testing.assert_allclose(by_motor, known, atol=1e-6 * np.abs(known).max())


def test_a_link_turns_the_tool_by_its_moment_about_its_end(robot, q):
    """Against the lever by hand: the stand yields at the origin of axis 1, where all weights pull."""
    heavy = elastic_robot(robot)
    turn, shift = 1e-8, 2e-10
    model = ErrorModel(heavy, effects=(ElasticLinks(turns=(turn,), shifts=(shift,), first=6),))
    rigid = ErrorModel(heavy).poses(q)
    end = np.linalg.multi_dot([part.transform for part in heavy.joints[0].before] + [np.eye(4)] * 2)
    load = carried(heavy, 1, q)
    arm = rigid[:, :3, 3] - end[:3, 3]
    wanted = (turn * np.cross(load[:, 3:] @ end[:3, :3].T, arm)) + shift * load[:, :3] @ end[:3, :3].T
    moved = model.poses(q)[:, :3, 3] - rigid[:, :3, 3]
    np.testing.assert_allclose(moved, wanted, atol=2e-3 * np.abs(wanted).max())
    assert np.abs(moved).max() > 1e-5


def test_an_unknown_ripple_is_no_sum_of_the_orders_that_compete(robot):
    """Cosines and sines of orders 1 to 30 over a whole turn leave nearly all of a ripple of a higher one."""
    gears = GearErrors(orders=(37.3,) * 6, swell=(0.7,) * 6)
    term = gears.term(robot)
    q = np.zeros((600, 6))
    q[:, 0] = np.linspace(-np.pi, np.pi, 600)
    column = term.prepare(q)[:, list(term.names).index("J1.ripple_cos")]
    orders = np.arange(31)[None] * q[:, :1]
    known = np.concatenate([np.cos(orders), np.sin(orders)], axis=1)
    left = column - known @ np.linalg.lstsq(known, column, rcond=None)[0]
    assert 0.9 < np.linalg.norm(left) / np.linalg.norm(column) <= 1.0


def test_lost_motion_far_from_a_reversal_is_the_direction(robot):
    way = np.radians(np.array([0.0, 20.0, 40.0, 10.0]))[:, None] * np.ones(6)
    np.testing.assert_allclose(np.sign(lost_motion(robot, way))[1:, 0], [1.0, 1.0, -1.0])
    np.testing.assert_allclose(np.abs(lost_motion(robot, way)[1:, 0]), 1.0)


def test_lost_motion_is_taken_up_little_by_little_and_does_not_depend_on_stops(robot):
    turned = np.array([0.0, 0.5, 0.5 - 0.5 * WIDTHS[0], 0.5 - 3.0 * max(WIDTHS)])
    way = np.zeros((4, 6))
    way[:, 0] = turned
    state = lost_motion(robot, way)[:, 0]
    assert state[1] == 1.0
    assert 0.0 < state[2] < 1.0
    assert state[3] == -1.0
    finer = np.zeros((301, 6))
    finer[:, 0] = np.interp(np.linspace(0.0, 3.0, 301), np.arange(4.0), turned)
    np.testing.assert_allclose(lost_motion(robot, finer)[::100, 0], state, atol=1e-12)


def test_expansion_in_one_time_is_warming_up(robot, q):
    """With one time constant for all it is `WarmUp` of the same joints."""
    tau = 1800.0
    uneven = UnevenExpansion(joints=GROWING, tolerance=1e-4, time_constants=(tau,) * 4)
    even = WarmUp(joints=GROWING, tolerance=1e-4, time_constant=tau, reference=0.0)
    conditions = Conditions(time=np.linspace(100.0, 7200.0, len(q)))
    models = [ErrorModel(robot, effects=(effect,)) for effect in (uneven, even)]
    assert models[0].names == models[1].names
    x = np.random.default_rng(0).normal(size=len(models[0])) * models[0].tolerances
    ours, theirs = (model.poses(q, x, conditions) for model in models)
    np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_each_link_grows_in_its_own_time(robot, q):
    uneven = UnevenExpansion(joints=GROWING, tolerance=1e-4, time_constants=(9000.0, 100.0, 1000.0, 10_000.0))
    model = ErrorModel(robot, effects=(uneven,))
    shares = []
    for joint in GROWING:
        x = np.zeros(len(model))
        x[model.names.index(f"{joint}.expansion")] = 1e-4
        at = [model.poses(q[:1], x, Conditions(time=np.array([t])))[0, :3, 3] for t in (0.0, 1000.0, 1e9)]
        shares.append(np.linalg.norm(at[1] - at[0]) / np.linalg.norm(at[2] - at[0]))
    np.testing.assert_allclose(shares, 1.0 - np.exp(-1000.0 / np.array([100.0, 1000.0, 10_000.0])), atol=1e-3)


@pytest.mark.parametrize("part", NOTHING)
def test_each_part_alone_moves_the_tool_by_its_size(robot, q, part):
    """Twice the size moves it farther, and without any a robot has its defects of geometry alone."""
    nominal = ErrorModel(robot)
    moved = []
    for size in (0.0, 1.0, 2.0):
        true = draw_true_robot(robot, np.random.default_rng(1), Sizes(**{**NOTHING, part: size}))
        x = true.x.copy()
        x[: len(nominal)] = 0.0
        off = true.model.poses(q, x, true.measured(q))[:, :3, 3] - nominal.poses(q)[:, :3, 3]
        moved.append(np.linalg.norm(off, axis=1).max())
    assert moved[0] < 1e-12
    assert 5e-6 < moved[1] < 5e-3
    assert moved[2] == pytest.approx(2.0 * moved[1], rel=0.2)


def test_draws_repeat(robot, q):
    first, second = (draw_true_robot(robot, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.milled(q), second.milled(q))
