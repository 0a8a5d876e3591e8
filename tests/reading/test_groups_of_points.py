"""Points in groups, as SpatialAnalyzer exports them: collection, group, point, x, y, z, date."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign, read_measurements
from taskcal.reading.rows import MAX_NAMED_TARGETS
from tests.reading.measured_files import NAMED, ROBOT, measured, write

Q, _, POINTS = measured(12)
DATE = "03/14/2024 10:22:01 AM"


def export(folder, rows, *, header=None, separator=", ", dated=True):
    """A file of rows of words and a position, metres."""
    lines = [
        separator.join([*words, *(f"{v * 1e3:.4f}" for v in point), *([DATE] if dated else [])])
        for *words, point in rows
    ]
    path = folder / "points.txt"
    path.write_text("\n".join([*([header] if header else []), *lines]) + "\n")
    return path


def joints(folder, ids=True):
    rows = [[*([f"P{k}"] if ids else []), *np.degrees(Q[k])] for k in range(12)]
    return write(folder, "joints.txt", f"id {NAMED}" if ids else NAMED, rows)


def campaign(folder, points, ids=True):
    return read_campaign(joints(folder, ids), ROBOT, options=ReadOptions(points=points))


ONE = [("Robot", f"P{k}", POINTS["A"][k]) for k in range(12)]
BY_POSE = [(f"P{k}", t, POINTS[t][k]) for k in range(12) for t in "AB"]
BY_TARGET = [(t, f"P{k}", POINTS[t][k]) for t in "AB" for k in range(12)]


def test_groups_of_points_are_read_with_commas_in_the_date(tmp_path):
    path = export(tmp_path, ONE)
    path.write_text(path.read_text().replace(DATE, "Mar 14, 2024"))
    np.testing.assert_allclose(read_measurements(path, ROBOT).points["tool"], POINTS["A"], atol=1e-6)


def test_groups_of_one_point_each_are_poses(tmp_path):
    rows = [(f"P{k}", "SMR", POINTS["A"][k]) for k in range(12)]
    for header in (None, "Group, Point, X, Y, Z, Date"):
        assert read_measurements(export(tmp_path, rows, header=header), ROBOT).ids == tuple(f"P{k}" for k in range(12))


def test_groups_keep_a_target_that_few_poses_saw(tmp_path):
    rows = [row for row in BY_POSE if row[1] == "A" or int(row[0][1:]) < 4]
    found = campaign(tmp_path, export(tmp_path, rows))
    assert found.targets == ("A", "B")
    assert found.valid.sum(axis=0).tolist() == [12, 4]


def test_groups_that_saw_one_of_two_targets_are_asked_about(tmp_path):
    rows = [row for k, row in enumerate(BY_POSE) if k % 4 in (0, 3)]
    with pytest.raises(FileError, match="either may be the pose"):
        read_measurements(export(tmp_path, rows), ROBOT)


@pytest.mark.parametrize("separator", [", ", ",", ";", "\t"])
@pytest.mark.parametrize("header", [None, "Group, Point, X, Y, Z, Date", "// Group, Point, X, Y, Z, Date"])
def test_groups_of_points_are_read_with_a_date(header, separator, tmp_path):
    header = header and header.replace(", ", separator)
    found = campaign(tmp_path, export(tmp_path, ONE[::-1], header=header, separator=separator))
    np.testing.assert_allclose(found.points[:, 0], POINTS["A"], atol=1e-6)
    assert "paired by 12 ids" in " ".join(found.notes)


@pytest.mark.parametrize("rows", [BY_POSE, BY_TARGET], ids=["group is pose", "group is target"])
@pytest.mark.parametrize("form", ["columns", "collection", "named", "joined", "joined, blanks", "no date"])
def test_groups_are_poses_or_targets_by_what_repeats(rows, form, tmp_path):
    header, separator = "Group, Point, X, Y, Z, Date" if form == "named" else None, ", "
    if form == "collection":
        rows = [("Cell", *row) for row in rows]
    if form.startswith("joined"):
        rows = [("Cell::" + "::".join(row[:2]), row[2]) for row in rows]
        separator = " " if "blanks" in form else separator
    points = export(tmp_path, rows, header=header, separator=separator, dated=form != "no date")
    for ids in (True, False):
        found = campaign(tmp_path, points, ids)
        assert found.targets == ("A", "B")
        np.testing.assert_allclose(found.points[:, 0], POINTS["A"], atol=1e-6)
        np.testing.assert_allclose(found.points[:, 1], POINTS["B"], atol=1e-6)


def test_groups_and_points_with_joints_are_decided_by_joints(tmp_path):
    rows = [[t, f"P{k}", *np.degrees(Q[k]), *POINTS[t][k] * 1e3] for t in "AB" for k in range(12)]
    found = read_campaign(write(tmp_path, "a.txt", f"Group Point {NAMED} x_mm y_mm z_mm", rows), ROBOT)
    assert found.targets == ("A", "B")
    np.testing.assert_allclose(found.points[:, 1], POINTS["B"], atol=1e-9)


def test_groups_of_joints_alone_are_poses_by_their_joints(tmp_path):
    rows = [[f"P{k}", t, *np.degrees(Q[k])] for k in range(12) for t in "AB"]
    joint_file = write(tmp_path, "j.txt", f"Group Point {NAMED}", rows)
    found = read_campaign(joint_file, ROBOT, options=ReadOptions(points=export(tmp_path, BY_POSE)))
    np.testing.assert_allclose(found.points[:, 1], POINTS["B"], atol=1e-6)


def test_groups_with_a_point_beside_the_robot_are_poses(tmp_path):
    rows = [
        (f"P{k}", t, p) for k in range(12) for t, p in (("A", POINTS["A"][k]), ("base1", np.array([1.0, 2.0, 0.5])))
    ]
    found = campaign(tmp_path, export(tmp_path, rows))
    assert found.targets == ("A",)
    assert list(found.reference_points) == ["base1"]


@pytest.mark.parametrize("swapped", [False, True])
def test_groups_whose_rows_lie_together_are_shots(swapped, tmp_path):
    rng = np.random.default_rng(0)
    rows = [(f"P{k}", str(s), POINTS["A"][k] + rng.normal(0, 2e-5, 3)) for k in range(12) for s in range(3)]
    rows = [(s, p, point) for p, s, point in rows] if swapped else rows
    found = campaign(tmp_path, export(tmp_path, rows))
    assert found.targets == ("tool",)
    np.testing.assert_allclose(found.points[:, 0], POINTS["A"], atol=1e-4)


def test_groups_that_are_poses_or_targets_are_asked_about(tmp_path):
    # three targets moved along three lines without a turn are as far from one another either way
    rows = [(f"G{i}", f"P{j}", np.array([1.0, 0.4 * i, 0.3 * j])) for i in range(3) for j in range(3)]
    with pytest.raises(FileError, match=r"either may be the pose, the other its target; name the column of poses 'id'"):
        read_measurements(export(tmp_path, rows), ROBOT)


@pytest.mark.parametrize("count", [MAX_NAMED_TARGETS, MAX_NAMED_TARGETS + 1])
def test_more_names_than_a_tool_has_targets_are_no_targets(count, tmp_path):
    """A plate of points, each a group, that was turned once: targets of two poses, if they are not too many."""
    plate = np.random.default_rng(0).normal(size=(count, 3))
    turned = plate @ Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix().T + [1.0, 2.0, 0.0]
    rows = [(f"G{i}", name, at[i]) for i in range(count) for name, at in (("P0", plate), ("P1", turned))]
    readings = read_measurements(export(tmp_path, rows), ROBOT)
    few = count <= MAX_NAMED_TARGETS
    assert len(readings) == (2 if few else 2 * count)
    assert len(readings.points) == (count if few else 1)


def test_groups_that_count_points_anew_are_poses_of_their_own(tmp_path):
    rows = [(f"Day {k // 6}", f"P{k % 6}", POINTS["A"][k]) for k in range(12)]
    readings = read_measurements(export(tmp_path, rows), ROBOT)
    assert len(readings) == 12
    assert "each group and point is read as a pose of its own" in " ".join(readings.notes)


def test_points_whose_names_are_counts_are_read(tmp_path):
    rows = [("Robot", str(k), POINTS["A"][k]) for k in range(12)]
    assert read_measurements(export(tmp_path, rows), ROBOT).ids == tuple(map(str, range(12)))
    whole = [("Robot", str(k), np.round(POINTS["A"][k], 3)) for k in range(12)]
    path = export(tmp_path, whole)
    path.write_text(path.read_text().replace(".0000", "").replace("-", ""))
    with pytest.raises(FileError, match="names no columns"):
        read_measurements(path, ROBOT)
