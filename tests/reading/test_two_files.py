"""Joints in one file, points in another: what is wrong with one of them is said of that one."""

from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.errors import CampaignError, FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from tests.reading.measured_files import NAMED, ROBOT, measured, write

ROWS = 12
CELLS = "text", "", "1e400", "nan", "1.2.3", "1e9"
"""What no joint and no coordinate is; the last is beyond any robot."""


def rows_of(ids: bool) -> tuple[list[list[object]], list[list[object]]]:
    q, _, points = measured(ROWS)
    joints, points = np.degrees(q).tolist(), (points["A"] * 1e3).tolist()
    name = [f"p{k}" for k in range(ROWS)]
    return [[*([name[k]] if ids else []), *row] for k, row in enumerate(joints)], [
        [*([name[k]] if ids else []), *row] for k, row in enumerate(points)
    ]


@pytest.mark.parametrize("unit", ["_mm", ""])
@pytest.mark.parametrize("ids", [True, False], ids=["ids", "order"])
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("broken", ["j.txt", "p.txt"])
def test_a_wrong_cell_is_said_of_its_file_and_line(tmp_path, broken, cell, ids, unit):
    joints, points = rows_of(ids)
    row = (joints if broken == "j.txt" else points)[7]
    row[ids + 1] = cell or '""'
    head = "id " if ids else ""
    first = write(tmp_path, "j.txt", head + NAMED, joints)
    second = write(tmp_path, "p.txt", head + " ".join(f"{axis}{unit}" for axis in "xyz"), points)
    with pytest.raises(FileError) as refusal:
        read_campaign(first, ROBOT, options=ReadOptions(points=second))
    assert Path(refusal.value.path).name == broken
    assert refusal.value.line == 9


@pytest.mark.parametrize(
    ("header", "targets"),
    [("x_mm y_mm z_mm", ["other"]), ("x y z", None)],
    ids=["no such target", "no unit fits"],
)
def test_what_the_points_lack_is_said_of_their_file(tmp_path, header, targets):
    joints, points = rows_of(True)
    for row in points:
        row[1:4] = [value * 7.3 if header == "x y z" else value for value in row[1:4]]
    first = write(tmp_path, "j.txt", "id " + NAMED, joints)
    second = write(tmp_path, "p.txt", "id " + header, points)
    with pytest.raises(FileError) as refusal:
        read_campaign(first, ROBOT, targets=targets, options=ReadOptions(points=second))
    assert Path(refusal.value.path).name == "p.txt"


def test_a_campaign_of_two_files_names_both(tmp_path):
    joints, points = rows_of(True)
    first = write(tmp_path, "j.txt", "id " + NAMED, joints[:2])
    second = write(tmp_path, "p.txt", "id x_mm y_mm z_mm", points[:2])
    campaign = read_campaign(first, ROBOT, options=ReadOptions(points=second))
    with pytest.raises(CampaignError, match=r"^j\.txt with p\.txt: .* too few"):
        tc.identify(tc.ErrorModel(ROBOT), campaign)
