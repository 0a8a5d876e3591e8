"""Files without names of columns."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.measurement.reader import ReadOptions, read_campaign
from taskcal.tabular.csv_form import TableForm
from tests.measurement.measured_files import ROBOT, measured, write


def test_files_without_names_have_one_reading_or_are_asked_about(tmp_path):
    q, _, points = measured()
    rows = [[*np.degrees(q[k]), *points["A"][k] * 1e3] for k in range(len(q))]
    campaign = read_campaign(write(tmp_path, "a.txt", None, rows), ROBOT)
    np.testing.assert_allclose(campaign.points[:, 0], points["A"], atol=1e-9)
    assert "the file names no columns; they are read as J1 J2 J3 J4 J5 J6 x y z" in campaign.notes[0]
    path = write(tmp_path, "b.txt", None, [[*row, 1.5] for row in rows])
    with pytest.raises(FileError, match=r"names no columns, and its 10 columns .* name them: --columns \"id J1"):
        read_campaign(path, ROBOT)
    columns = ("J1_deg", "J2_deg", "J3_deg", "J4_deg", "J5_deg", "J6_deg", "x_mm", "y_mm", "z_mm", "-")
    named = read_campaign(path, ROBOT, options=ReadOptions(form=TableForm(columns=columns)))
    np.testing.assert_allclose(named.points, campaign.points)
