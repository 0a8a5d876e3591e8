"""Joints in every spelling and unit."""

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import FileError
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.robot.robot_file import robot_from
from tests.reading.campaign_files import ROBOT, ROWS, write

SPELLINGS = {
    "of the robot": "J1_deg,Elbow_deg,slide_mm",
    "J numbers": "J1_deg,J2_deg,J3_mm",
    "q numbers": "q1_deg,q2_deg,q3_mm",
    "small letters": "j1_deg,elbow_deg,slide_mm",
    "capitals": "J1_DEG,ELBOW_DEG,SLIDE_MM",
    "mixed": "q1_deg,Elbow_deg,J3_mm",
}


@pytest.mark.parametrize("joints", SPELLINGS.values(), ids=list(SPELLINGS))
def test_every_spelling_of_the_joints_means_the_same(tmp_path, joints):
    expected = read_campaign(write(tmp_path), ROBOT)
    campaign = read_campaign(write(tmp_path, f"ID,{joints},X_mm,y_MM,z_mm"), ROBOT)
    np.testing.assert_array_equal(campaign.q, expected.q)
    np.testing.assert_array_equal(campaign.points, expected.points)


def test_units_and_order_of_columns_do_not_matter(tmp_path):
    expected = read_campaign(write(tmp_path), ROBOT)
    rows = []
    for text in ROWS:
        name, *numbers = text.split(",")
        j1, j2, j3, x, y, z = map(float, numbers)
        j1, j2 = (float(np.radians(v)) for v in (j1, j2))
        rows.append(f"{z},{j2!r},{x},{j1!r},{y},{j3 / 1e3!r},{name}")
    campaign = read_campaign(write(tmp_path, "z_mm,q2_rad,x_mm,J1_rad,y_mm,slide_m,id", rows), ROBOT)
    assert campaign.ids == expected.ids
    np.testing.assert_allclose(campaign.q, expected.q, rtol=1e-15)
    np.testing.assert_array_equal(campaign.points, expected.points)


@pytest.mark.parametrize("names", ["XYZ", "xyz"])
def test_joints_called_as_a_points_columns_are_written_by_number(tmp_path, names):
    """And read again so; by their own names they could not be told from the point."""
    joint = [{"name": name, "type": "prismatic", "steps": [{"rx_deg": 90.0}]} for name in names]
    robot = robot_from({"name": "gantry", "joint": joint})
    rng = np.random.default_rng(0)
    campaign = Campaign(
        ids=("1", "2", "3", "4"),
        q=rng.uniform(0.1, 1.0, (4, 3)),
        targets=("tool",),
        points=rng.uniform(1.0, 2.0, (4, 1, 3)),
    )
    write_campaign(tmp_path / "c.csv", campaign, robot)
    again = read_campaign(tmp_path / "c.csv", robot)
    np.testing.assert_allclose(again.q, campaign.q, rtol=1e-9)
    np.testing.assert_allclose(again.points, campaign.points, atol=1e-9)
    with pytest.raises(FileError, match=r"joint [xX] is given twice, by 'X_mm' and 'x_mm'; .* the joint's q1"):
        read_campaign(write(tmp_path, "id,X_mm,Y_mm,Z_mm,x_mm,y_mm,z_mm", ["a,1,2,3,4,5,6"]), robot)
