"""Units that a file does not state."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.measurement.reader import read_campaign
from tests.measurement.measured_files import NAMED, ROBOT, measured, write


@pytest.mark.parametrize("angle", ["deg", "rad"])
@pytest.mark.parametrize(("length", "per_metre"), [("mm", 1e3), ("m", 1.0), ("in", 1 / 0.0254)])
def test_units_that_are_stated_nowhere_are_told_by_the_robots_motion(tmp_path, angle, length, per_metre):
    q, _, points = measured()
    joints = np.degrees(q) if angle == "deg" else q
    rows = [[*joints[k], *points["A"][k] * per_metre] for k in range(len(q))]
    campaign = read_campaign(write(tmp_path, "a.txt", "A1 A2 A3 A4 A5 A6 X Y Z", rows), ROBOT)
    np.testing.assert_allclose(campaign.q, q, atol=1e-12)
    np.testing.assert_allclose(campaign.points[:, 0], points["A"], atol=1e-9)
    assert campaign.notes == (
        f"joints without a unit are read as {'degrees' if angle == 'deg' else 'radians'}, by their size",
        f"positions without a unit are read in {length}, by how far ur5 moved",
    )


def test_units_that_nothing_tells_are_not_guessed(tmp_path):
    q, _, points = measured(3)
    rows = [[*q[k], *points["A"][k]] for k in range(3)]
    with pytest.raises(FileError, match=r"column 'A1': the unit is not stated; name the column A1_deg or A1_rad"):
        read_campaign(write(tmp_path, "a.txt", "A1 A2 A3 A4 A5 A6 X Y Z", rows), ROBOT)
    q, _, points = measured()
    rows = [[*np.degrees(q[k]), *points["A"][k] * 100] for k in range(len(q))]
    with pytest.raises(FileError, match="in mm, m or inches the points would not spread as the robot's flange does"):
        read_campaign(write(tmp_path, "a.txt", f"{NAMED} X Y Z", rows), ROBOT)
