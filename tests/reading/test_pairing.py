"""Joints in one file, points in another."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from tests.reading.measured_files import NAMED, ROBOT, measured, write


def two_files(folder, ids, kept=None, joint_rows=None):
    q, _, points = measured(40)
    some = np.arange(40) if kept is None else kept
    mine = np.arange(40) if joint_rows is None else joint_rows
    first = [[*([f"p{k}"] if ids else []), *np.degrees(q[k])] for k in mine]
    second = [[*([f"p{k}"] if ids else []), *points["A"][k] * 1e3] for k in some]
    name = "id " if ids else ""
    return (
        write(folder, "j.txt", name + NAMED, first),
        write(folder, "p.txt", f"{name}x_mm y_mm z_mm", second),
        q,
        points["A"],
    )


@pytest.mark.parametrize(
    ("ids", "kept", "joint_rows", "note"),
    [
        (True, np.random.default_rng(0).permutation(40), None, "by 40 ids"),
        (True, np.arange(3, 39), None, "by 36 ids; 4 ids are in one file only and left out"),
        (False, None, None, "by their order, 40 of each"),
        (False, np.arange(3, 40), None, "by geometry: 37 fit together, 100% of the shorter file"),
        (False, np.delete(np.arange(40), [17, 30]), None, "by geometry: 38 fit together"),
        (
            False,
            np.delete(np.arange(40), 20),
            np.delete(np.arange(40), [3, 33]),
            "by geometry: 37 fit together, 97% of",
        ),
    ],
    ids=["shuffled", "some", "order", "shifted", "lost", "both"],
)
def test_joints_and_points_of_two_files_find_each_other(tmp_path, ids, kept, joint_rows, note):
    joints, points, q, p = two_files(tmp_path, ids, kept, joint_rows)
    campaign = read_campaign(joints, ROBOT, options=ReadOptions(points=points))
    assert note in campaign.notes[-1]
    for row in range(len(campaign)):
        k = int(np.argmin(np.abs(q - campaign.q[row]).max(axis=1)))
        np.testing.assert_allclose(campaign.points[row, 0], p[k], atol=1e-9)


def test_ids_written_in_two_ways_pair_by_their_numbers(tmp_path):
    order = np.random.default_rng(0).permutation(40)
    joints, points, _, p = two_files(tmp_path, True, order)
    points.write_text(points.read_text().replace("\np", "\nPoint_00"))
    campaign = read_campaign(joints, ROBOT, options=ReadOptions(points=points))
    assert "paired by the numbers of 40 ids, which are written in different ways" in campaign.notes[-1]
    np.testing.assert_allclose(campaign.points[:, 0], p, atol=1e-9)


def test_counts_from_zero_and_from_one_pair_by_their_order(tmp_path):
    joints, points, _, p = two_files(tmp_path, False)
    for path, first in ((joints, 0), (points, 1)):
        head, *rows = path.read_text().splitlines()
        path.write_text("\n".join([f"id {head}", *(f"{k} {row}" for k, row in enumerate(rows, start=first))]))
    campaign = read_campaign(joints, ROBOT, options=ReadOptions(points=points))
    assert "paired by their order, 40 of each" in campaign.notes[-1]
    np.testing.assert_allclose(campaign.points[:, 0], p, atol=1e-9)


def test_rows_paired_by_an_order_that_cannot_be_are_told_of(tmp_path):
    joints, points, _, _ = two_files(tmp_path, False, np.random.default_rng(0).permutation(40))
    note = read_campaign(joints, ROBOT, options=ReadOptions(points=points)).notes[-1]
    assert "paired by their order, 40 of each; the nominal robot misses them by" in note


def test_rows_that_cannot_be_paired_are_refused(tmp_path):
    joints, points, _, _ = two_files(tmp_path, False, np.random.default_rng(0).permutation(40)[:30])
    with pytest.raises(FileError, match=r"p\.txt has 30 rows, j\.txt 40, .* give both files ids"):
        read_campaign(joints, ROBOT, options=ReadOptions(points=points))
    with pytest.raises(FileError, match="both files hold joints"):
        read_campaign(joints, ROBOT, options=ReadOptions(points=joints))
