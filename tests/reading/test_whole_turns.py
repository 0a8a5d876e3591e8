"""Joints that are counted in another turn than the robot's limits, as from 0 to 360°."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.cli.commands.doctor import diagnose_file
from taskcal.errors import FileError
from taskcal.reading.joints import within_limits
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import campaign_text
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import ErrorModel
from tests.diagnosis.virtual_campaigns import healthy
from tests.laws.robots import seeds

ROWS = 30
NARROW = ("abb-irb120", "motoman-sia20d", "franka-panda")
"""Robots with joints of less than a turn."""


def _within(robot, rng):
    """Joint positions within the limits and half a turn, and those whose sums are, too."""
    low, high = np.clip(robot.limits, -np.pi, np.pi).T
    q = rng.uniform(low, high, (60 * ROWS, len(low)))
    return q[robot.inside_limits(q)][:ROWS]


def _from_zero(robot, q):
    """As a controller counts that shows 0 to 360°."""
    return np.where(robot.prismatic, q, np.mod(q, 2.0 * np.pi))


def _written(folder, robot, q, points, unit="_deg"):
    values = np.where(robot.prismatic, q * 1e3, np.degrees(q))
    names = [f"q{j + 1}{'_mm' if slides else unit}" for j, slides in enumerate(robot.prismatic)]
    lines = [" ".join([*names, "x_mm", "y_mm", "z_mm"])]
    lines += [" ".join(f"{v:.9f}" for v in (*values[k], *points[k] * 1e3)) for k in range(len(q))]
    path = folder / "measured.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


@given(name=st.sampled_from(catalogue_names()), seed=seeds)
def test_columns_from_0_to_360_are_within_the_limits(name, seed):
    """Each is read as the robot stood where its limits take that turn alone, and else in the same pose; all is said."""
    robot = load_robot(name)
    q = _within(robot, np.random.default_rng(seed))
    wrapped = _from_zero(robot, q)
    read, note = within_limits(robot, wrapped)
    low, high = robot.limits.T
    inside = (wrapped >= low - 1e-6) & (wrapped <= high + 1e-6)
    several = sum((q + k >= low) & (q + k <= high) for k in 2.0 * np.pi * np.array([-1, 0, 1])) > 1
    for j, joint in enumerate(robot.joint_names):
        if inside[:, j].all():
            np.testing.assert_array_equal(read[:, j], wrapped[:, j])
        else:
            assert joint in note
            assert (read[:, j] >= low[j] - 1e-6).all()
            assert (read[:, j] <= high[j] + 1e-6).all()
            np.testing.assert_allclose(read[~several[:, j], j], q[~several[:, j], j], atol=1e-9)
    assert bool(note) == (not inside.all())
    turns = (read - q) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)


@given(name=st.sampled_from(catalogue_names()), seed=seeds)
def test_joints_within_the_limits_are_left(name, seed):
    robot = load_robot(name)
    rng = np.random.default_rng(seed)
    low, high = np.clip(robot.limits, -4.0 * np.pi, 4.0 * np.pi).T
    q = rng.uniform(low, high, (ROWS, len(low)))
    read, note = within_limits(robot, q)
    np.testing.assert_array_equal(read, q)
    assert not note


@pytest.mark.parametrize("unit", ["_deg", ""])
@pytest.mark.parametrize("name", NARROW)
def test_wrapped_campaigns_are_read_as_the_robot_stood(tmp_path, name, unit):
    """Where the unit is stated and where it is told by the motion; the way to each pose is that of the robot, too."""
    robot = load_robot(name)
    q = _within(robot, np.random.default_rng(1))
    points = ErrorModel(robot).poses(q)[:, :3, 3] + [1.0, 2.0, 0.3]
    plain = read_campaign(_written(tmp_path, robot, q, points, unit), robot)
    campaign = read_campaign(_written(tmp_path, robot, _from_zero(robot, q), points, unit), robot)
    narrow = np.ptp(robot.limits, axis=1) <= 2.0 * np.pi + 1e-6
    np.testing.assert_allclose(campaign.q[:, narrow], q[:, narrow], atol=1e-9)
    np.testing.assert_array_equal(campaign.approach[:, narrow], plain.approach[:, narrow])
    assert any("counted in another turn" in note for note in campaign.notes)


def test_one_wrong_angle_is_not_a_turn(tmp_path):
    """350 for 35.0 beside angles of both signs, and an angle that no whole turn brings within the limits."""
    robot = load_robot("abb-irb120")
    q = _within(robot, np.random.default_rng(2))
    points = ErrorModel(robot).poses(q)[:, :3, 3]
    for value in (350.0, 190.0):
        wrong = q.copy()
        wrong[3, 0] = np.radians(value)
        with pytest.raises(FileError, match=f"J1 = {value:.3f}° is outside -165 to 165°"):
            read_campaign(_written(tmp_path, robot, wrong, points), robot)


def test_doctor_mends_wrapped_joints_as_the_robot_stood(tmp_path):
    """Beside a wrong sign, which is found; joints, moves and ways of the mended campaign are those of the true one."""
    robot, true = load_robot("motoman-sia20d"), healthy("motoman-sia20d", 1)
    signs = np.where(np.arange(7) == 3, -1.0, 1.0)
    wrapped = replace(true, q=_from_zero(robot, true.q * signs), conditions=type(true.conditions)())
    path = tmp_path / "wrapped.csv"
    path.write_text(campaign_text(wrapped, robot))
    plain = tmp_path / "plain.csv"
    plain.write_text(campaign_text(replace(true, conditions=type(true.conditions)()), robot))
    found = diagnose_file([path], robot)
    assert [finding.id for finding in found.mends] == ["joint-sign"]
    mended = tmp_path / "mended.csv"
    mended.write_text(campaign_text(found.campaign, found.robot))
    again, expected = read_campaign(mended, robot), read_campaign(plain, robot)
    np.testing.assert_allclose(again.q, expected.q, atol=1e-8)
    np.testing.assert_allclose(again.move, expected.move, atol=1e-7)
    np.testing.assert_array_equal(again.approach, expected.approach)
