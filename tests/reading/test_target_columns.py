"""Targets, reference points and their uncertainty."""

import numpy as np
import pytest

from taskcal.reading.reader import read_campaign
from tests.reading.campaign_files import HEADER, JOINTS, ROBOT, ROWS, write
from tests.reading.measured_files import NAMED, measured
from tests.reading.measured_files import ROBOT as UR5

TARGETS = f"id,{JOINTS}," + ",".join(f"{t}_{a}_mm" for t in ("smr1", "base1", "Base2", "smr2") for a in "xyz")


TARGET_ROW = ["a,0,0,0," + ",".join(map(str, range(1, 13)))]


@pytest.mark.parametrize(
    ("targets", "reference_points", "read", "fixed"),
    [
        (None, None, ("smr1", "smr2"), {"base1", "Base2"}),
        (["SMR2"], None, ("smr2",), {"base1", "Base2"}),
        (["smr2", "smr1"], None, ("smr2", "smr1"), {"base1", "Base2"}),
        (["base1", "smr1"], None, ("base1", "smr1"), {"Base2"}),
        (None, ["smr1"], ("base1", "Base2", "smr2"), {"smr1"}),
        (None, [], ("smr1", "base1", "Base2", "smr2"), set()),
        (["smr1"], ["smr2"], ("smr1",), {"smr2"}),
    ],
)
def test_targets_and_reference_points_are_chosen_by_name(tmp_path, targets, reference_points, read, fixed):
    campaign = read_campaign(
        write(tmp_path, TARGETS, TARGET_ROW), ROBOT, targets=targets, reference_points=reference_points
    )
    assert campaign.targets == read
    assert set(campaign.reference_points) == fixed
    first = {"smr1": 1, "base1": 4, "Base2": 7, "smr2": 10}
    for t, name in enumerate(read):
        np.testing.assert_allclose(campaign.points[0, t], (first[name] + np.arange(3)) / 1e3)
    for name in fixed:
        np.testing.assert_allclose(campaign.reference_points[name][0], (first[name] + np.arange(3)) / 1e3)


def test_uncertainty_is_stated_for_all_targets_or_each(tmp_path):
    campaign = read_campaign(write(tmp_path, HEADER + ",u_mm", [row + ",0.02" for row in ROWS]), ROBOT)
    np.testing.assert_allclose(campaign.uncertainty, [[2e-5], [2e-5]])
    header = f"id,{JOINTS},A_x_mm,A_y_mm,A_z_mm,B_x_mm,B_y_mm,B_z_mm"
    campaign = read_campaign(write(tmp_path, header + ",A_u_mm,u_mm", ["a,0,0,0,1,2,3,4,5,6,0.01,0.05"]), ROBOT)
    np.testing.assert_allclose(campaign.uncertainty, [[1e-5, 5e-5]])


@pytest.mark.parametrize("columns", ["u_mm", "sx_mm,sy_mm,sz_mm"])
def test_an_uncertainty_keeps_its_unit_beside_points_without_one(tmp_path, columns):
    q, _, points = measured(12)
    parts = len(columns.split(","))
    rows = [",".join(map(str, [*np.degrees(q[k]), *points["A"][k] * 1e3, *[0.05] * parts])) for k in range(len(q))]
    path = write(tmp_path, f"{NAMED.replace(' ', ',')},x,y,z,{columns}", rows)
    campaign = read_campaign(path, UR5)
    np.testing.assert_allclose(campaign.uncertainty, 5e-5)
    assert ("are read as standard uncertainties" in " ".join(campaign.notes)) == (parts == 3)
