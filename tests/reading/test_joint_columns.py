"""Joints in every spelling and unit."""

import numpy as np
import pytest

from taskcal.reading.reader import read_campaign
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
