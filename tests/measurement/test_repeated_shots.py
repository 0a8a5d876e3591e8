"""Several shots of one pose."""

import numpy as np
import pytest

from taskcal.measurement.reader import read_campaign
from tests.measurement.measured_files import NAMED, ROBOT, measured, write


def test_shots_of_one_pose_are_averaged_and_their_scatter_said(tmp_path):
    q, _, points = measured(6)
    rng = np.random.default_rng(1)
    shots = [
        [k, *np.degrees(q[k]), *(points["A"][k] + rng.normal(0, 5e-5, 3)) * 1e3] for k in range(6) for _ in range(200)
    ]
    campaign = read_campaign(write(tmp_path, "a.txt", f"id {NAMED} x_mm y_mm z_mm", shots), ROBOT)
    np.testing.assert_allclose(campaign.points[:, 0], points["A"], atol=2e-5)
    (note,) = campaign.notes
    assert note.startswith("1200 rows are 6 poses measured up to 200 times, and averaged; the shots scatter by 0.0")
    assert float(note.split("by ")[1].split()[0]) == pytest.approx(0.05, rel=0.05)
