"""The table that a calibration project of RoboDK writes: joints, measured poses, and the tool that it assumed.

Its columns are those that RoboDK's example scripts take from it; angles turn about moving axes, rotx·roty·rotz.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.tables.options import TableForm
from tests.reading.known_campaign import BARE, DEG, JOINTS, MM, ROBOT, XYZ, N, P, Q, R, lines, write

ANGLES = Rotation.from_matrix(R).as_euler("XYZ", degrees=True)
TOOL = np.tile([20.0, 30.0, 100.0, 0.0, 0.0, 0.0], (N, 1))
NAMES = [*BARE, *"XYZWPR", *(f"TCP {name}" for name in "XYZWPR")]
COLUMNS = (*JOINTS, *XYZ, "rx_deg", "ry_deg", "rz_deg", *["-"] * 6)


@pytest.mark.parametrize(("names", "columns"), [(NAMES, None), (None, COLUMNS)], ids=["named", "unnamed"])
def test_a_calibration_table_is_read_as_it_is_meant(tmp_path, names, columns):
    measured = np.column_stack([MM, ANGLES])
    measured[3] = 0.0  # as a pose that was not seen
    path = write(tmp_path, names, lines(DEG, measured, TOOL))
    options = ReadOptions(form=TableForm(columns=columns), angles="moving-xyz-deg")
    campaign = read_campaign(path, ROBOT, options=options)
    seen = np.arange(N) != 3
    np.testing.assert_array_equal(campaign.seen, seen)
    np.testing.assert_allclose(campaign.q, Q, atol=1e-6)
    np.testing.assert_allclose(campaign.points[seen, 0], P[seen], atol=1e-6)
    np.testing.assert_allclose(campaign.rotations[seen], R[seen], atol=1e-6)
