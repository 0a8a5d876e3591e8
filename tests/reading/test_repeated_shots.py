"""Several shots of one pose."""

import re

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign, read_measurements
from tests.reading.measured_files import NAMED, ROBOT, measured, write


def test_shots_of_one_pose_are_averaged_and_their_scatter_said(tmp_path):
    q, _, points = measured(6)
    rng = np.random.default_rng(1)
    shots = [
        [k, *np.degrees(q[k]), *(points["A"][k] + rng.normal(0, 5e-5, 3)) * 1e3] for k in range(6) for _ in range(200)
    ]
    campaign = read_campaign(write(tmp_path, "a.txt", f"id {NAMED} x_mm y_mm z_mm", shots), ROBOT)
    np.testing.assert_allclose(campaign.points[:, 0], points["A"], atol=2e-5)
    (note,) = campaign.notes
    assert note.startswith("1200 rows are 6 poses measured up to 200 times, and averaged; the shots scatter by 0.0")
    assert float(note.split("by ")[1].split()[0]) == pytest.approx(0.05, rel=0.05)


def shots(folder, name, header, *, noise=5e-5, apart=None, repeats=4, unit=1e3, joints=True, more=()):
    """A file of six poses; where `apart` is given, the last shot of the third is as far from the others, metres."""
    q, _, points = measured(6)
    rng = np.random.default_rng(2)
    rows = []
    for k in range(6):
        for shot in range(repeats):
            p = points["A"][k] + rng.normal(0, noise, 3)
            if apart is not None and k == 2 and shot == repeats - 1:
                p[0] += apart
            rows.append([f"p{k}", *(np.degrees(q[k]) if joints else ()), *p * unit, *more])
    return write(folder, name, header, rows)


def test_average_shots_refuses_two_poses_of_one_id(tmp_path):
    path = shots(tmp_path, "a.txt", f"id {NAMED} x_mm y_mm z_mm", apart=0.058)
    with pytest.raises(
        FileError, match=r":13: pose 'p2' has shots 5[78]\.\d mm apart, in lines \d+ and 13; .* most 1\.\d mm"
    ):
        read_campaign(path, ROBOT)


@pytest.mark.parametrize(("header", "unit"), [("id x_mm y_mm z_mm", 1e3), ("id x y z", 1e3), ("id x y z", 1.0)])
def test_average_shots_refuses_two_poses_whatever_the_unit(header, unit, tmp_path):
    points = shots(tmp_path, "p.txt", header, apart=0.005, unit=unit, joints=False)
    with pytest.raises(FileError, match=r"pose 'p2' has shots \d\.\d mm apart"):
        read_measurements(points, ROBOT)
    q = measured(6)[0]
    joints = write(tmp_path, "j.txt", f"id {NAMED}", [[f"p{k}", *np.degrees(q[k])] for k in range(6)])
    with pytest.raises(FileError, match=r"pose 'p2' has shots \d\.\d mm apart"):
        read_campaign(joints, ROBOT, options=ReadOptions(points=points))


@pytest.mark.parametrize(("noise", "more", "u"), [(8e-4, (), ""), (3e-3, (3.0,), " u_mm")])
def test_average_shots_keeps_shots_of_a_coarse_instrument(noise, more, u, tmp_path):
    path = shots(tmp_path, "a.txt", f"id {NAMED} x_mm y_mm z_mm{u}", noise=noise, more=more)
    assert len(read_campaign(path, ROBOT)) == 6


def test_average_shots_refuses_turned_shots(tmp_path):
    q, _, points = measured(1)
    row = ["p", *np.degrees(q[0]), *points["A"][0] * 1e3]
    rows = [[*row, 0, 0, 0, 1], [*row, 0, 0, np.sin(0.05), np.cos(0.05)]]
    path = write(tmp_path, "a.txt", f"id {NAMED} x_mm y_mm z_mm qx qy qz qw", rows)
    with pytest.raises(FileError, match=re.escape("pose 'p' has shots turned by 5.7°, in lines 2 and 3")):
        read_campaign(path, ROBOT)


def test_average_shots_gives_a_lost_shot_no_orientation(tmp_path):
    q, _, points = measured(1)
    named = ["p", *np.degrees(q[0])]
    turn = [0, 0, np.sin(0.5), np.cos(0.5)]
    rows = [[*named, *points["A"][0] * 1e3, *turn], [*named, 0, 0, 0, 0, 0, 0, 1]]
    path = write(tmp_path, "a.txt", f"id {NAMED} x_mm y_mm z_mm qx qy qz qw", rows)
    rotations = read_campaign(path, ROBOT).rotations
    assert rotations is not None
    assert rotations[0, 0, 0] == pytest.approx(np.cos(1.0))


def test_targets_by_row_refuse_two_poses_of_one_target(tmp_path):
    q, _, points = measured(4)
    rows = [[k, t, *np.degrees(q[k]), *points[t][k] * 1e3] for k in range(4) for t in "AB" for _ in range(2)]
    rows[-1][-1] += 20.0
    path = write(tmp_path, "l.txt", f"id target {NAMED} x_mm y_mm z_mm", rows)
    with pytest.raises(FileError, match=r":17: pose '3, target B' has shots 20\.0 mm apart, in lines 16 and 17"):
        read_campaign(path, ROBOT)
