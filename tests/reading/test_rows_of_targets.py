"""Tables of one target a row."""

import re

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.reading.reader import read_campaign
from tests.reading.measured_files import NAMED, ROBOT, measured, write

JOINTS = " ".join(map(str, np.degrees(measured(1)[0][0])))


def test_one_target_a_row_is_the_same_as_targets_side_by_side(tmp_path):
    q, _, points = measured(5)
    wide = [[k, *np.degrees(q[k]), *points["A"][k] * 1e3, *points["B"][k] * 1e3] for k in range(5)]
    long = [
        [k, name, *np.degrees(q[k]), *points[name][k] * 1e3]
        for k in range(5)
        for name in points
        if (k, name) != (2, "B")
    ]
    expected = read_campaign(
        write(tmp_path, "w.txt", f"id {NAMED} A_x_mm A_y_mm A_z_mm B_x_mm B_y_mm B_z_mm", wide), ROBOT
    )
    campaign = read_campaign(write(tmp_path, "l.txt", f"id target {NAMED} x_mm y_mm z_mm", long), ROBOT)
    assert campaign.targets == expected.targets == ("A", "B")
    np.testing.assert_array_equal(campaign.valid, np.array([[True, True]] * 2 + [[True, False]] + [[True, True]] * 2))
    np.testing.assert_allclose(campaign.points[campaign.valid], expected.points[campaign.valid], atol=1e-12)
    np.testing.assert_array_equal(campaign.q, expected.q)


def test_a_target_of_its_own_in_every_row_is_refused_at_once(tmp_path):
    rows = [[k, f"T{k}", JOINTS, 1, 2, 3] for k in range(4000)]
    with pytest.raises(FileError, match="names 4000 targets; Taskcal fits 100 at most"):
        read_campaign(write(tmp_path, "l.txt", f"id target {NAMED} x_mm y_mm z_mm", rows), ROBOT)


@pytest.mark.parametrize(
    ("columns", "rows", "words"),
    [
        ("x_mm y_mm z_mm", ["A", "nan"], "3: column 'target': the row names no target"),
        ("A_x_mm A_y_mm A_z_mm", ["A", "B"], "1: names a target in each row and in columns too (A); keep one form"),
    ],
)
def test_rows_whose_target_cannot_be_told_are_refused(columns, rows, words, tmp_path):
    path = write(tmp_path, "l.txt", f"id target {NAMED} {columns}", [[f"p0 {name} {JOINTS} 1 2 3"] for name in rows])
    with pytest.raises(FileError, match=re.escape(words)):
        read_campaign(path, ROBOT)


@pytest.mark.parametrize(("columns", "rows"), [("A", ["A"]), ("measured", ["A", "B"])])
def test_columns_may_name_the_target_that_rows_name(columns, rows, tmp_path):
    header = f"id target {NAMED} {columns}_x_mm {columns}_y_mm {columns}_z_mm"
    path = write(tmp_path, "l.txt", header, [[f"p0 {name} {JOINTS} 1 2 3"] for name in rows])
    assert read_campaign(path, ROBOT).targets == tuple(rows)


def test_poses_of_several_targets_are_refused(tmp_path):
    header = f"id target {NAMED} x_mm y_mm z_mm qw qx qy qz"
    rows = [["p0", name, JOINTS, *["1", "2", "3", "1", "0", "0", "0"]] for name in "AB"]
    with pytest.raises(FileError, match="has poses of several targets; choose the rows of one"):
        read_campaign(write(tmp_path, "l.txt", header, rows), ROBOT)
    assert read_campaign(write(tmp_path, "one.txt", header, rows[:1]), ROBOT).targets == ("A",)
