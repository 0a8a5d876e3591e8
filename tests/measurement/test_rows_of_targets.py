"""Tables of one target a row."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.measurement.reader import read_campaign
from tests.measurement.measured_files import NAMED, ROBOT, measured, write


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
    q, _, points = measured(3)
    joints = " ".join(map(str, np.degrees(q[0])))
    rows = [[k, f"T{k}", joints, *points["A"][0] * 1e3] for k in range(4000)]
    with pytest.raises(FileError, match="names 4000 targets; Taskcal fits 100 at most"):
        read_campaign(write(tmp_path, "l.txt", f"id target {NAMED} x_mm y_mm z_mm", rows), ROBOT)
