"""Units that a file does not state."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.reading.reader import read_campaign
from tests.reading.measured_files import NAMED, ROBOT, measured, write


@pytest.mark.parametrize("angle", ["deg", "rad"])
@pytest.mark.parametrize(("length", "per_metre"), [("mm", 1e3), ("m", 1.0), ("in", 1 / 0.0254)])
def test_missing_units_are_inferred_from_the_motion(tmp_path, angle, length, per_metre):
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


def test_each_target_has_its_own_unit(tmp_path):
    q, _, points = measured()
    rows = [[*np.degrees(q[k]), *points["A"][k], *points["B"][k] * 1e3] for k in range(len(q))]
    header = f"{NAMED} tip_x tip_y tip_z smr_x smr_y smr_z"
    campaign = read_campaign(write(tmp_path, "a.txt", header, rows), ROBOT)
    np.testing.assert_allclose(campaign.points, np.stack([points["A"], points["B"]], axis=1), atol=1e-9)
    assert campaign.notes == ("positions without a unit are read tip in m, smr in mm, by how far ur5 moved",)


def test_a_unit_stated_above_is_held_against_each_target(tmp_path):
    q, _, points = measured()
    rows = [[*np.degrees(q[k]), *points["A"][k] * 1e3, *points["B"][k]] for k in range(len(q))]
    header = f"# Units: mm\n{NAMED} smr_x smr_y smr_z tip_x tip_y tip_z"
    with pytest.raises(FileError, match=r"states mm above the table .* points of 'tip' only if they are m"):
        read_campaign(write(tmp_path, "a.txt", header, rows), ROBOT)
