"""Files without names of columns."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign, read_measurements
from taskcal.tables.options import TableForm
from tests.reading.measured_files import ROBOT, T_TRACKER_BASE, measured, write


def test_files_without_names_have_one_reading_or_are_asked_about(tmp_path):
    q, _, points = measured()
    rows = [[*np.degrees(q[k]), *points["A"][k] * 1e3] for k in range(len(q))]
    campaign = read_campaign(write(tmp_path, "a.txt", None, rows), ROBOT)
    np.testing.assert_allclose(campaign.points[:, 0], points["A"], atol=1e-9)
    assert "the file names no columns; they are read as J1 J2 J3 J4 J5 J6 x y z" in campaign.notes[0]
    path = write(tmp_path, "b.txt", None, [[*row, 1.5] for row in rows])
    with pytest.raises(FileError, match=r"names no columns, and its 10 columns .* name them: --columns \"id J1"):
        read_campaign(path, ROBOT)
    columns = ("J1_deg", "J2_deg", "J3_deg", "J4_deg", "J5_deg", "J6_deg", "x_mm", "y_mm", "z_mm", "-")
    named = read_campaign(path, ROBOT, options=ReadOptions(form=TableForm(columns=columns)))
    np.testing.assert_allclose(named.points, campaign.points)


def asked_and_measured(rows=12, *, angles=True, frame=False, last=2):
    """Rows of a name, a nominal and a measured half in millimetres and degrees, and deviations; the second half alone."""
    rng = np.random.default_rng(0)
    _, T, points = measured(rows)
    asked, turned = points["A"] * 1e3, Rotation.from_matrix(T[:, :3, :3]).as_euler("xyz", degrees=True)
    found = asked + rng.normal(0, 0.5, (rows, 3))
    if frame:
        asked = asked @ T_TRACKER_BASE[:3, :3].T + 700.0
    half = [turned] if angles else []
    parts = [asked, *half, found, *half, rng.uniform(0, 1, (rows, last))]
    return [[f"P{k}", *np.concatenate(parts, axis=1)[k]] for k in range(rows)], found


@pytest.mark.parametrize("frame", [False, True], ids=["one frame", "two frames"])
@pytest.mark.parametrize(("angles", "last", "second"), [(True, 2, 8), (True, 0, 8), (False, 2, 5), (False, 1, 5)])
def test_name_columns_asks_which_of_two_blocks_was_measured(angles, last, second, frame, tmp_path):
    rows, found = asked_and_measured(angles=angles, frame=frame, last=last)
    path = write(tmp_path, "a.txt", None, rows)
    words = rf"a.txt:1: names no columns, and columns 2 to 4 and columns {second} to {second + 2} .* could both be the measured"
    with pytest.raises(FileError, match=words) as caught:
        read_measurements(path, ROBOT)
    columns = tuple(str(caught.value).split('--columns "')[1].split('"')[0].split())
    readings = read_measurements(path, ROBOT, ReadOptions(form=TableForm(columns=columns)))
    np.testing.assert_allclose(readings.points["tool"] * 1e3, found, atol=1e-6)


@pytest.mark.parametrize("rows", [1, 2])
def test_name_columns_asks_about_two_blocks_of_few_rows(rows, tmp_path):
    path = write(tmp_path, "a.txt", None, asked_and_measured(rows)[0])
    with pytest.raises(FileError, match=r"columns 2 to 4 and columns 8 to 10 .* could both be the measured position"):
        read_measurements(path, ROBOT)


def test_name_columns_asks_about_halves_as_wide_as_the_joints(tmp_path):
    # six numbers behind a name would be six joints: metres are as small as radians
    rows = [[row[0], *np.array(row[1:]) / 1e3] for row in asked_and_measured(angles=False, last=0)[0]]
    with pytest.raises(FileError, match=r"columns 2 to 4 and columns 5 to 7 .* could both be the measured position"):
        read_measurements(write(tmp_path, "a.txt", None, rows), ROBOT)


@pytest.mark.parametrize("more", [1, 3, 4])
def test_name_columns_asks_where_joints_may_come_first(more, tmp_path):
    q, _, points = measured()
    rows = [[f"P{k}", *np.degrees(q[k]), *points["A"][k] * 1e3, *[0.5 + k] * more] for k in range(len(q))]
    with pytest.raises(FileError, match=r"are not the 6 joints of .* --columns \"id J1 J2 J3 J4 J5 J6 x_mm y_mm z_mm"):
        read_measurements(write(tmp_path, "a.txt", None, rows), ROBOT)


def test_name_columns_takes_no_angles_for_a_second_block(tmp_path):
    _, T, points = measured(40)
    turned = Rotation.from_matrix(T[:, :3, :3]).as_euler("xyz", degrees=True)
    sigma = 0.01 + 1e-5 * np.abs(points["A"] * 1e3)
    for more in (np.concatenate([turned, sigma[:, :1]], axis=1), np.concatenate([sigma, 0 * sigma[:, :1]], axis=1)):
        rows = [[f"P{k}", *points["A"][k] * 1e3, *more[k]] for k in range(40)]
        readings = read_measurements(write(tmp_path, "a.txt", None, rows), ROBOT)
        np.testing.assert_allclose(readings.points["tool"], points["A"], atol=1e-9)


def test_name_columns_reads_joints_that_move_in_step(tmp_path):
    rows = [[f"P{k}", *(k * np.array([3.0, 2.0, -1.0, 5.0, 1.0, -2.0]))] for k in range(20)]
    assert read_measurements(write(tmp_path, "a.txt", None, rows), ROBOT).q is not None
