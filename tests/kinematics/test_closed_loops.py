"""Solvers on a robot with a closed loop: they end where it is singular, and none leads beyond."""

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.geometry.four_bar import can_close, close_four_bar
from taskcal.kinematics.inverse import closes, conditioning, find_postures, follow, solve_near
from taskcal.kinematics.tracing import trace
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import irb6660_description


def test_singular_loop_poses_are_not_reached():
    """Poses at which the loop is singular are told apart and not reached."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.zeros((3, 6))
    q[1, 2] = np.radians(90.0)  # rod and arm in line with the levers
    assert closes(model, q).tolist() == [True, False, True]
    T = np.tile(model.poses(q[:1]), (3, 1, 1))
    assert solve_near(model, T, q).reached.tolist() == [True, False, True]


def test_conditioning_is_zero_where_singular_or_open():
    """Conditioning falls to zero at singular postures and where the loop is open."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.radians(np.tile([0.0, 10.0, 40.0, 10.0, 45.0, 20.0], (4, 1)))
    q[1, 4], q[2, 4], q[3, 2] = np.radians(1.0), 0.0, q[3, 1] + np.radians(90.0)
    ratio = conditioning(model, q)
    J = model.joint_jacobian(q[:3]) * np.repeat([2.0, 1.0], 3)[:, None]
    s = np.linalg.svd(J, compute_uv=False)
    np.testing.assert_allclose(ratio[:3], s[:, -1] / s[:, 0], rtol=1e-6, atol=1e-12)
    assert ratio[0] > 10.0 * ratio[1] > 0.0
    assert ratio[2] < 1e-12
    assert ratio[3] == 0.0


LOOPS = [(500.0, 700.0, 500.0, 700.0), (500.0, 1300.0, 400.0, 700.0), (734.0, 288.0, 664.0, 385.0)]
"""A parallelogram, a loop that does not close with its levers square, and one that closes mirrored as well."""


def with_loop_and_no_limits(lengths):
    """The IRB 6660 with other lengths of its loop, and nothing but the loop to keep its joints from anywhere."""
    description = irb6660_description()
    keys = ("crank_mm", "rod_mm", "rocker_mm", "arm_mm")
    joints = [{**joint, "limits_deg": [-180.0, 180.0]} for joint in description["joint"]]
    bar = {**description["four_bar"], **dict(zip(keys, lengths, strict=True))}
    return ErrorModel(robot_from({**description, "joint": joints, "coupled_limit": [], "four_bar": bar}))


def ends_of_the_crank(model):
    """Ends of the crank's angles against the arm that fine steps lead to from where the loop was built: θ has not turned back."""
    bar = model.robot.four_bar.bar
    apart = np.radians(np.arange(-180.0, 180.0, 0.1))
    closing = can_close(bar, 0.0 * apart, apart)
    start = int(np.argmin(np.where(closing, np.abs(apart), np.inf)))
    ends = []
    for step in (-1, 1):
        k, before = start, None
        while closing[k]:
            theta = close_four_bar(bar, np.zeros(1), apart[k : k + 1]).angle[0]
            turned = None if before is None else step * np.angle(np.exp(1j * (theta - before)))
            if turned is not None and turned <= 0.0:
                break
            before, k = theta, (k + step) % len(apart)
        ends.append(apart[(k - step) % len(apart)])
    return ends


@pytest.mark.parametrize("lengths", LOOPS)
def test_no_solver_leads_beyond_the_loop_s_singular_position(lengths):
    model, rng = with_loop_and_no_limits(lengths), np.random.default_rng(0)
    low, high = ends_of_the_crank(model)
    q = rng.uniform(-1.0, 1.0, (60, 6)) * [1.0, 0.4, 0.0, 1.0, 1.0, 1.0]
    q[:, 4] += 1.2
    q[:, 2] = q[:, 1] + rng.uniform(low + 0.05, high - 0.05, len(q))
    T = model.poses(q)

    def assert_between_the_ends(found):
        assert len(found)
        turn = found[:, 2] - found[:, 1] - 0.5 * (low + high)
        assert (np.abs(np.angle(np.exp(1j * turn))) <= 0.5 * (high - low) + 0.01).all()

    seeds = rng.uniform(-np.pi, np.pi, (20 * len(q), 6))
    near = solve_near(model, np.repeat(T, 20, axis=0), seeds, iterations=60)
    assert_between_the_ends(near.q[near.reached])
    assert_between_the_ends(np.concatenate([find_postures(model, pose) for pose in T[:3]]))
    followed = follow(model, T, q[0])
    assert_between_the_ends(followed.q[followed.reached])
    straight = np.linspace(0.0, 1.0, 80)[:, None]
    beyond = np.tile(q[0], (80, 1))
    for end in (low - 0.2, high + 0.2):  # a path that is made by turning the crank past the end
        beyond[:, 2] = q[0, 1] + (1 - straight[:, 0]) * (q[0, 2] - q[0, 1]) + straight[:, 0] * end
        inside = closes(model, beyond)
        assert inside[0]
        assert not inside[-1]
        reached = model.poses(beyond[inside])
        path = np.concatenate([reached, reached[-1:] @ se3.translation(0.4, 0.4, 0.4)[None]])
        traced = trace(model, path, q[0])
        assert_between_the_ends(traced.q[traced.reached])
